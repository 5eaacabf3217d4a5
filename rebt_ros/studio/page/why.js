// The answer to "why?": what acted, what did not, from which demonstrations that comes.

import { button, element } from "./dom.js";
import { count, duration, sentence } from "./words.js";

/**
 * Shows an explanation.
 *
 * @param {Element} host - Its content is replaced.
 * @param {{lines: string[], from?: object[], least?: string[]}} data - The studio's answer.
 * @param {(name: string) => void} visit - Goes to a demonstration.
 */
export function showWhy(host, data, visit) {
  const lines = data.lines ?? [];
  const parts = [];
  lines.forEach((line, place) => {
    const depth = Math.floor((line.length - line.trimStart().length) / 2);
    const name = place === 0 ? "p" : "p";
    parts.push(element(name, { class: `why depth-${Math.min(depth, 3)}${place === 0 ? " first" : ""}` }, line.trim()));
  });
  const least = data.least ?? [];
  if (least.length) {
    parts.push(
      element("h4", {}, "The least change for something else"),
      element("ul", {}, ...least.map((line) => element("li", {}, line.trim()))),
    );
  }
  const from = data.from ?? [];
  if (from.length) {
    const visits = from.map(({ demonstration, rows, seconds }) => {
      const name = String(demonstration).replace(/\.rec$/, "");
      const words = `${shortName(name)}: ${count(rows, "row")}${seconds ? `, ${duration(seconds)}` : ""}`;
      return button(words, () => visit(name), { title: `Look at ${name}` });
    });
    parts.push(element("h4", {}, "Learned from"), element("div", { class: "from" }, ...visits));
  }
  host.replaceChildren(...parts);
}

/** Says that there is no explanation, and why. */
export function showNoWhy(host, message) {
  host.replaceChildren(element("p", { class: "hint" }, sentence(message)));
}

/** A recording's name without what only machines read. */
export function shortName(name) {
  const found = /^(\d{4})(\d\d)(\d\d)T(\d\d)(\d\d)(\d\d)/.exec(name);
  if (!found) return name;
  const [, , month, day, hour, minute, second] = found;
  return `${day}.${month}. ${hour}:${minute}:${second}`;
}
