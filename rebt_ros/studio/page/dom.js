// Elements, made without markup: whatever a name or label holds, it is shown as text.

const SVG = "http://www.w3.org/2000/svg";

function fill(made, attributes, children) {
  for (const [name, value] of Object.entries(attributes)) {
    if (value === undefined || value === null || value === false) continue;
    if (typeof value === "function") made.addEventListener(name, value);
    else if (value === true) made.setAttribute(name, "");
    else made.setAttribute(name, String(value));
  }
  made.append(...children.filter((child) => child !== null && child !== undefined));
  return made;
}

/** An HTML element; functions among the attributes are event listeners. */
export function element(name, attributes = {}, ...children) {
  return fill(document.createElement(name), attributes, children);
}

/** An SVG element. */
export function svg(name, attributes = {}, ...children) {
  return fill(document.createElementNS(SVG, name), attributes, children);
}

/** A button that says what it does. */
export function button(text, click, attributes = {}) {
  return element("button", { type: "button", click, ...attributes }, text);
}

/** The element of the page with this id. */
export function byId(id) {
  return document.getElementById(id);
}

/** Sets the text only where it differs, which spares the browser a layout. */
export function setText(target, text) {
  if (target.textContent !== text) target.textContent = text;
}

/** Sets an attribute only where it differs; null takes it away. */
export function setAttribute(target, name, value) {
  if (value === null) {
    if (target.hasAttribute(name)) target.removeAttribute(name);
  } else if (target.getAttribute(name) !== String(value)) {
    target.setAttribute(name, String(value));
  }
}

/** Shows or hides. */
export function show(target, visible) {
  if (target.hidden === visible) target.hidden = !visible;
}

/**
 * Brings the children of an element in line with keyed items; what stays keeps focus and state.
 *
 * @param {Element} parent - Whose children they are; it must have no others.
 * @param {[string, any][]} items - Keys and items, in order.
 * @param {(key: string, item: any) => Element} make - Makes the child of a new key.
 * @param {(child: Element, item: any, key: string) => void} update - Brings a child up to date.
 */
export function keyed(parent, items, make, update) {
  const there = new Map([...parent.children].map((child) => [child.dataset.key, child]));
  let place = parent.firstElementChild;
  for (const [key, item] of items) {
    let child = there.get(key);
    there.delete(key);
    if (!child) {
      child = make(key, item);
      child.dataset.key = key;
    }
    if (child === place) place = place.nextElementSibling;
    else parent.insertBefore(child, place);
    update(child, item, key);
  }
  for (const child of there.values()) child.remove();
}
