// A behavior tree as a drawing that can be read, heard, and walked through with the keyboard.

import { fillOf } from "./colors.js";
import { element, setAttribute, setText, svg } from "./dom.js";
import { arrange } from "./layout.js";
import { features, holding, isNumeric, range, read, readText, share } from "./margins.js";
import { renamed, statusWords } from "./words.js";

const METER = 22;
const MARGIN = 14;
const [SMALLEST, LARGEST] = [0.45, 2.5];
const [SMALLEST_FIT, LARGEST_FIT] = [0.85, 1.5];
const STEP = 1.25;

const KINDS = {
  control: "control node",
  condition: "condition",
  inverter: "inverter",
  action: "action",
  psa: "parallel or selector, yours to choose",
  lat_sequence: "suggested sequence",
  repeater: "repeater",
};

/** The status as a shape, 18 pixels wide, centered at the origin. */
const SIGNS = {
  SUCCESS: "M-4.5 0.5L-1.5 3.5L4.5 -3.5",
  FAILURE: "M-3.5 -3.5L3.5 3.5M3.5 -3.5L-3.5 3.5",
  RUNNING: "M-2.5 -4.5L4.5 0L-2.5 4.5Z",
};

/** One drawn tree. */
export class Tree {
  /**
   * @param {Element} host - Where it is drawn; scrolls.
   * @param {{label: string, live?: boolean, choose?: (node: object) => void,
   *   shown?: (name: string) => string, still?: boolean}} options - A live one has room for values; a
   *   still one is a picture, and takes no part in keyboard use.
   */
  constructor(host, options) {
    this.host = host;
    this.options = { live: false, still: false, choose: () => {}, shown: (name) => name, ...options };
    this.view = null;
    this.folded = new Set();
    this.zoom = null;
    this.parts = [];
    this.byPath = new Map();
    this.chosen = null;
    this.focused = "root";
    this.query = "";
    this.values = {};
    this.isSeen = !this.options.live;
    /** The parts in sight, or nearly: what cannot be seen need not be drawn ten times a second. */
    this.near = [];
    this.links = svg("g", { class: "links", "aria-hidden": "true" });
    this.nodes = svg("g", { role: "presentation" });
    this.picture = svg("svg", { class: "tree" }, this.links, this.nodes);
    if (this.options.still) {
      setAttribute(this.picture, "role", "img");
    } else {
      setAttribute(this.picture, "role", "tree");
      this.picture.addEventListener("keydown", (event) => this.key(event));
      this.picture.addEventListener("click", (event) => this.click(event));
    }
    setAttribute(this.picture, "aria-label", this.options.label);
    host.append(this.picture);
    new ResizeObserver(() => this.fit()).observe(host);
    host.addEventListener("scroll", () => this.look(), { passive: true });
  }

  /** Draws a tree; what was folded, chosen and focused stays as far as it is there. */
  show(view, names = null) {
    if (view === this.view && names === this.names) return;
    const children = new Set(view.nodes.map((node) => node.parent));
    this.view = view;
    this.names = names;
    this.parents = children;
    this.folded = new Set([...this.folded].filter((path) => children.has(path)));
    this.draw();
    this.place();
    if (this.chosen !== null) this.choose(this.byPath.has(this.chosen) ? this.chosen : null);
    this.status(null, {}, null);
    if (this.query) this.search(this.query);
  }

  // --- what happens ---

  /**
   * Colors the nodes.
   *
   * @param {string[] | null} statuses - Of each node; null where they are not known.
   * @param {object} values - The state by feature.
   * @param {Set<string> | null} acting - Paths of the actions that are commanded.
   */
  status(statuses, values, acting) {
    const active = this.ancestors(acting);
    const fits = statuses?.length === this.parts.length;
    this.values = values;
    // Where not all of it can be seen, it begins at what runs.
    if (active.size && !this.isSeen && this.host.clientWidth) {
      this.isSeen = true;
      if (this.host.scrollWidth > this.host.clientWidth) this.reveal([...acting][0]);
    }
    this.parts.forEach((part, place) => {
      part.next = fits ? statuses[place] : null;
      const isActive = active.has(part.node.path);
      if (part.active === isActive) return;
      part.active = isActive;
      part.group.classList.toggle("active", isActive);
      part.link?.classList.toggle("active", isActive);
      // What runs lies above what does not where two lines meet.
      if (isActive && part.link) this.links.append(part.link);
    });
    for (const part of this.near) this.refresh(part);
  }

  /** Finds out what is in sight, and brings it up to date. */
  look() {
    const { scrollLeft, scrollTop, clientWidth, clientHeight } = this.host;
    const scale = this.zoom ?? this.fitting();
    // Half a screen more on each side, so that little has to be caught up with while it is scrolled.
    const [left, right] = [scrollLeft / scale - clientWidth, (scrollLeft + 1.5 * clientWidth) / scale];
    const [top, bottom] = [scrollTop / scale - clientHeight, (scrollTop + 1.5 * clientHeight) / scale];
    this.near = this.parts.filter(({ at, node }) =>
      at && at.x + node.width > left && at.x < right && at.y + node.height + METER > top && at.y < bottom);
    for (const part of this.near) this.refresh(part);
  }

  refresh(part) {
    if (part.status !== part.next) this.mark(part, part.next);
    if (part.meter) this.measure(part, this.values);
  }

  mark(part, status) {
    part.status = status;
    setAttribute(part.group, "data-status", status);
    setAttribute(part.sign, "d", SIGNS[status] ?? "");
    if (this.options.still) return;
    setAttribute(part.group, "aria-label", this.spoken(part));
  }

  spoken(part) {
    const { node } = part;
    const words = part.status ? `; ${statusWords(part.status, node.kind === "condition")}` : "";
    return `${this.words(node)}, ${KINDS[node.kind] ?? node.kind}${words}`;
  }

  measure(part, values) {
    const { node, meter } = part;
    const value = read(node, values);
    if (meter.value === value) return;
    meter.value = value;
    const known = typeof value === "number";
    const isAnyKnown = Object.keys(values).length > 0;
    setText(meter.text, isAnyKnown ? (meter.needle && !known ? "?" : readText(node, values)) : "");
    if (!meter.needle) return;
    setAttribute(meter.needle, "visibility", known ? null : "hidden");
    if (known) {
      const x = meter.from + share(value, meter.range) * meter.length;
      setAttribute(meter.needle, "transform", `translate(${x.toFixed(1)} 0)`);
    }
  }

  ancestors(paths) {
    const active = new Set();
    for (const path of paths ?? []) {
      let node = this.byPath.get(path)?.node;
      while (node) {
        active.add(node.path);
        node = this.byPath.get(node.parent)?.node;
      }
    }
    return active;
  }

  // --- what is chosen, found and shown ---

  choose(path) {
    if (this.chosen !== null) this.byPath.get(this.chosen)?.group.classList.remove("chosen");
    for (const part of this.parts) setAttribute(part.group, "aria-selected", null);
    this.chosen = path;
    const part = this.byPath.get(path);
    if (!part) return;
    part.group.classList.add("chosen");
    setAttribute(part.group, "aria-selected", "true");
  }

  /** Marks what contains some words; returns how many nodes do, and goes to one of them. */
  search(query, turn = 0) {
    this.query = query;
    const wanted = query.trim().toLowerCase();
    const found = [];
    for (const part of this.parts) {
      const { node } = part;
      const words = `${this.words(node)} ${node.text} ${node.explanation}`.toLowerCase();
      const isFound = wanted !== "" && words.includes(wanted);
      part.group.classList.toggle("found", isFound);
      if (isFound) found.push(node.path);
    }
    if (found.length) this.reveal(found[((turn % found.length) + found.length) % found.length]);
    return found.length;
  }

  /** Unfolds what hides a node, and scrolls to it. */
  reveal(path) {
    const part = this.byPath.get(path);
    if (!part) return;
    let above = part.node.parent;
    let unfolded = false;
    while (above !== null && above !== undefined) {
      unfolded = this.folded.delete(above) || unfolded;
      above = this.byPath.get(above)?.node.parent;
    }
    if (unfolded) this.place();
    const host = this.host.getBoundingClientRect();
    const box = part.group.getBoundingClientRect();
    this.host.scrollBy({
      left: box.left + box.width / 2 - host.left - host.width / 2,
      top: box.top + box.height / 2 - host.top - host.height / 2,
      behavior: calm() ? "auto" : "smooth",
    });
  }

  fold(path, folded) {
    if (!this.parents.has(path)) return;
    if (folded) this.folded.add(path);
    else this.folded.delete(path);
    this.place();
  }

  /** Folds every branch below the root, or none. */
  foldAll(folded) {
    this.folded.clear();
    if (folded) {
      for (const node of this.view?.nodes ?? []) {
        if (node.parent === "root" && this.parents.has(node.path)) this.folded.add(node.path);
      }
    }
    this.place();
  }

  /** Makes the drawing larger (1), smaller (-1), or as wide as there is room (0). */
  scale(direction) {
    this.zoom = direction === 0 ? null : (this.zoom ?? this.fitting()) * STEP ** direction;
    if (this.zoom !== null) this.zoom = Math.min(Math.max(this.zoom, SMALLEST), LARGEST);
    this.fit();
  }

  fitting() {
    const room = this.host.clientWidth - 2;
    const least = this.options.still ? 0.3 : SMALLEST_FIT;
    const most = this.options.still ? 1 : LARGEST_FIT;
    return Math.min(Math.max(room / this.width, least), most);
  }

  fit() {
    if (!this.view || !this.host.clientWidth) return;
    const scale = this.zoom ?? this.fitting();
    this.picture.style.width = `${Math.round(this.width * scale)}px`;
    this.picture.style.height = `${Math.round(this.height * scale)}px`;
    this.look();
  }

  // --- drawing ---

  draw() {
    this.links.replaceChildren();
    this.nodes.replaceChildren();
    this.parts = this.view.nodes.map((node) => this.part(node));
    this.near = [];
    this.byPath = new Map(this.parts.map((part) => [part.node.path, part]));
    this.nodes.append(...this.parts.map((part) => part.group));
    if (!this.byPath.has(this.focused)) this.focused = "root";
  }

  words(node) {
    const { shown } = this.options;
    if (node.label !== undefined) return shown(node.label);
    return renamed(node.text, features(node), shown);
  }

  part(node) {
    const words = this.words(node);
    const text = svg("text", { x: node.width / 2, y: node.height / 2 + 4.6 }, words);
    if (words.length > node.text.length) {
      setAttribute(text, "textLength", Math.round(node.width - 16));
      setAttribute(text, "lengthAdjust", "spacingAndGlyphs");
    }
    const sign = svg("path", { class: "sign" });
    const group = svg(
      "g",
      { class: `node kind-${node.kind}`, "data-path": node.path },
      svg("title", {}, node.explanation),
      svg("path", { class: "box", d: this.outline(node) }),
      // The color that the action has everywhere else.
      node.label === undefined ? null : svg("rect", { class: "hue", x: 0, y: node.height - 5, width: node.width, height: 5, rx: 2.5, fill: fillOf(node.label) }),
      text,
      svg("g", { class: "badge" }, svg("circle", { r: 9 }), sign),
    );
    const part = { node, group, sign, status: null, next: null, active: false, at: null, link: null, meter: null, toggle: null };
    if (this.options.live && isMetered(node)) part.meter = this.meter(node, group);
    if (!this.options.still) {
      setAttribute(group, "role", "treeitem");
      setAttribute(group, "aria-level", node.path === "root" ? 1 : node.path.split(".").length + 1);
      setAttribute(group, "tabindex", node.path === this.focused ? 0 : -1);
      setAttribute(group, "aria-label", this.spoken(part));
      if (this.parents.has(node.path) && node.kind !== "inverter") {
        part.toggle = svg("path", { class: "fold" });
        group.append(
          svg(
            "g",
            { class: "toggle", transform: `translate(${node.width} 0)` },
            svg("circle", { class: "touch", r: 16 }),
            svg("circle", { r: 8.5 }),
            part.toggle,
          ),
        );
      }
    }
    return part;
  }

  /** The box; an Inverter and its condition are two halves of one. */
  outline(node) {
    const radius = node.pill ? node.height / 2 : 6;
    const left = this.neighbor(node, -1) ? 0 : radius;
    const right = this.neighbor(node, 1) ? 0 : radius;
    const arc = (size, x, y) => (size ? `a${size} ${size} 0 0 1 ${x * size} ${y * size}` : "");
    return (
      `M${left} 0h${node.width - left - right}${arc(right, 1, 1)}v${node.height - 2 * right}` +
      `${arc(right, -1, 1)}h${left + right - node.width}${arc(left, -1, -1)}v${2 * left - node.height}` +
      `${arc(left, 1, -1)}z`
    );
  }

  neighbor(node, side) {
    if (!node.pill) return false;
    const { nodes } = this.view;
    const other = nodes[nodes.indexOf(node) + side];
    if (!other?.pill || Math.abs(other.y - node.y) > 0.5) return false;
    return side > 0
      ? node.kind === "inverter" && other.parent === node.path
      : other.kind === "inverter" && node.parent === other.path;
  }

  meter(node, group) {
    const text = svg("text", { class: "value", x: 2, y: node.height + 15 }, "");
    const parts = svg("g", { class: "meter", "aria-hidden": "true" }, text);
    group.append(parts);
    if (!isNumeric(node)) return { text, value: undefined };
    const [from, length] = [52, Math.max(node.width - 54, 24)];
    const span = range(node);
    const y = node.height + 7;
    const at = (place) => (from + place * length).toFixed(1);
    parts.append(svg("rect", { class: "track", x: from, y, width: length, height: 8, rx: 2 }));
    for (const [start, end] of holding(node, span)) {
      const width = ((end - start) * length).toFixed(1);
      parts.append(svg("rect", { class: "holding", x: at(start), y, width, height: 8 }));
    }
    for (const end of [node.above, node.at_most]) {
      if (end === null) continue;
      const x = at(share(end, span));
      parts.append(svg("line", { class: "threshold", x1: x, x2: x, y1: y - 2, y2: y + 10 }));
    }
    const needle = svg("path", { class: "needle", d: `M0 ${y + 2}l-5 9h10z` });
    needle.setAttribute("visibility", "hidden");
    parts.append(needle);
    return { text, needle, from, length, range: span, value: undefined };
  }

  place() {
    if (!this.view) return;
    const extra = (node) => (this.options.live && isMetered(node) ? METER : 0);
    const arranged = arrange(this.view, this.folded, extra);
    this.width = arranged.width + 2 * MARGIN;
    this.height = arranged.height + 2 * MARGIN;
    setAttribute(this.picture, "viewBox", `${-MARGIN} ${-MARGIN} ${this.width} ${this.height}`);
    for (const part of this.parts) {
      const at = arranged.places.get(part.node.path) ?? null;
      part.at = at;
      setAttribute(part.group, "display", at ? null : "none");
      if (at) setAttribute(part.group, "transform", `translate(${at.x.toFixed(1)} ${at.y.toFixed(1)})`);
      if (part.toggle) {
        const folded = this.folded.has(part.node.path);
        setAttribute(part.toggle, "d", folded ? "M-4 0H4M0 -4V4" : "M-4 0H4");
        setAttribute(part.group, "aria-expanded", String(!folded));
        part.group.classList.toggle("folded", folded);
      }
    }
    if (!this.links.childElementCount) {
      for (const link of arranged.links) {
        const line = svg("polyline", {});
        this.links.append(line);
        const part = this.byPath.get(link.path);
        if (part) part.link = line;
        link.made = line;
      }
      this.lines = arranged.links.map((link) => link.made);
    }
    arranged.links.forEach((link, index) => {
      setAttribute(this.lines[index], "display", link.line ? null : "none");
      if (link.line) setAttribute(this.lines[index], "points", link.line);
    });
    this.hidden = arranged.hidden;
    if (this.hidden.has(this.focused)) this.focus("root", false);
    this.fit();
  }

  // --- mouse, finger and keyboard ---

  click(event) {
    const group = event.target.closest(".node");
    if (!group) return;
    const { path } = group.dataset;
    this.focus(path, false);
    if (event.target.closest(".toggle")) {
      this.fold(path, !this.folded.has(path));
      return;
    }
    this.choose(path);
    this.options.choose(this.byPath.get(path).node);
  }

  focus(path, now = true) {
    setAttribute(this.byPath.get(this.focused)?.group ?? this.nodes, "tabindex", -1);
    this.focused = path;
    const group = this.byPath.get(path)?.group;
    if (!group) return;
    setAttribute(group, "tabindex", 0);
    this.refresh(this.byPath.get(path));
    if (now) group.focus();
  }

  key(event) {
    const visible = this.parts.filter((part) => !this.hidden.has(part.node.path));
    const place = visible.findIndex((part) => part.node.path === this.focused);
    if (place < 0 || event.ctrlKey || event.altKey || event.metaKey) return;
    const { node } = visible[place];
    const open = this.parents.has(node.path) && !this.folded.has(node.path);
    const to = (index) => visible[index] && this.focus(visible[index].node.path);
    switch (event.key) {
      case "ArrowDown":
        to(place + 1);
        break;
      case "ArrowUp":
        to(place - 1);
        break;
      case "Home":
        to(0);
        break;
      case "End":
        to(visible.length - 1);
        break;
      case "ArrowRight":
        if (open) to(place + 1);
        else this.fold(node.path, false);
        break;
      case "ArrowLeft":
        if (open && node.parent !== null) this.fold(node.path, true);
        else if (node.parent !== null) this.focus(node.parent);
        break;
      case "Enter":
      case " ":
        this.choose(node.path);
        this.options.choose(node);
        break;
      default:
        return;
    }
    event.preventDefault();
  }
}

/** Whether things should not glide across the screen. */
export function calm() {
  return matchMedia("(prefers-reduced-motion: reduce)").matches;
}

/** Whether there is something to show below a node while it runs. */
function isMetered(node) {
  return node.kind === "condition" && features(node).length > 0;
}

/** Buttons for a tree: find, jump, fold and zoom. */
export function treeTools(tree, { jump = null } = {}) {
  let turn = 0;
  const found = element("span", { class: "found-count", role: "status" });
  const look = (step) => {
    turn = step === 0 ? 0 : turn + step;
    const amount = tree.search(field.value, turn);
    const here = amount ? (((turn % amount) + amount) % amount) + 1 : 0;
    setText(found, field.value.trim() ? (amount ? `${here} of ${amount}` : "not found") : "");
  };
  const field = element("input", {
    type: "search",
    placeholder: "Find in the tree",
    "aria-label": "Find in the tree",
    input: () => look(0),
    keydown: (event) => {
      if (event.key === "Enter") look(event.shiftKey ? -1 : 1);
    },
  });
  const tool = (text, click, label) => element("button", { type: "button", click, "aria-label": label, title: label }, text);
  return element(
    "div",
    { class: "tools" },
    field,
    found,
    jump ? tool("Jump to what runs", jump, "Jump to what runs: shows the action in the tree") : null,
    element(
      "span",
      { class: "group" },
      tool("Fold up", () => tree.foldAll(true), "Fold up all branches"),
      tool("Unfold", () => tree.foldAll(false), "Unfold all branches"),
    ),
    element(
      "span",
      { class: "group" },
      tool("−", () => tree.scale(-1), "Make the drawing smaller"),
      tool("Fit", () => tree.scale(0), "Fit the drawing to the width"),
      tool("+", () => tree.scale(1), "Make the drawing larger"),
    ),
  );
}

/** The actions among the nodes that are commanded now, by path. */
export function actingPaths(view, statuses, commands) {
  const acting = new Set();
  if (statuses?.length !== view.nodes.length) return acting;
  view.nodes.forEach((node, place) => {
    const moves = statuses[place] === "RUNNING" || statuses[place] === "SUCCESS";
    if (moves && node.label !== undefined && commands[node.channel] === node.label) acting.add(node.path);
  });
  return acting;
}
