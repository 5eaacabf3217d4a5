// The answer to "why?": what acted, what did not, from which demonstrations that comes.

import { button, element } from "./dom.js";
import { count, duration, number, sentence } from "./words.js";

/**
 * Shows an explanation.
 *
 * @param {Element} host - Its content is replaced.
 * @param {{lines: string[], from?: object[], least?: string[]}} data - The studio's answer.
 * @param {(name: string) => void} visit - Goes to a demonstration.
 * @param {(name: string) => string} called - What people call a demonstration.
 */
export function showWhy(host, data, visit, called) {
  const lines = data.lines ?? [];
  const parts = [];
  lines.forEach((line, place) => {
    const depth = Math.floor((line.length - line.trimStart().length) / 2);
    parts.push(element("p", { class: `why depth-${Math.min(depth, 3)}${place === 0 ? " first" : ""}` }, shortened(line.trim())));
  });
  const least = data.least ?? [];
  if (least.length) {
    parts.push(
      element("h4", {}, "The least change for something else"),
      element("ul", {}, ...least.map((line) => element("li", {}, line.trim()))),
    );
  }
  if (data.from?.length) parts.push(element("h4", {}, "Learned from"), visits(data.from, visit, called));
  host.replaceChildren(...parts);
}

/** In how much of what was shown a branch acts, with buttons that lead to where it does. */
export function showBranch(host, answer, visit, called) {
  const from = answer.data?.from ?? [];
  host.replaceChildren(element("p", { class: "hint" }, sentence(answer.message)), ...(from.length ? [visits(from, visit, called)] : []));
}

function visits(from, visit, called) {
  const buttons = from.map(({ demonstration, rows, seconds }) => {
    const name = String(demonstration).replace(/\.rec$/, "");
    const words = `${called(name)}: ${count(rows, "row")}${seconds ? `, from ${duration(seconds)} on` : ""}`;
    return button(words, () => visit(name, seconds), { title: `Look at ${name}` });
  });
  return element("div", { class: "from" }, ...buttons);
}

/** With numbers that people can read; thresholds are short already. */
function shortened(line) {
  return line.replace(/-?\d+\.\d{5,}(?:e[+-]?\d+)?/g, (digits) => number(Number(digits), 4).replace("−", "-"));
}

/** Says that there is no explanation, and why. */
export function showNoWhy(host, message) {
  host.replaceChildren(element("p", { class: "hint" }, sentence(message)));
}
