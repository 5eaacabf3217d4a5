// How far a value is from where a condition would change its mind.

import { number, yesNo } from "./words.js";

/** Whether the node is a condition on a number, which has thresholds. */
export function isNumeric(node) {
  return node.above !== undefined && features(node).length > 0;
}

/** The names of the features that the condition reads. */
export function features(node) {
  if (node.terms !== undefined) return node.terms.map(([name]) => name);
  return node.feature === undefined ? [] : [node.feature];
}

/** What the condition reads; null where it is not known. */
export function read(node, values) {
  if (node.terms !== undefined) {
    const products = node.terms.map(([name, weight]) =>
      typeof values[name] === "number" ? weight * values[name] : null,
    );
    return products.includes(null) ? null : products.reduce((total, product) => total + product);
  }
  const value = node.feature === undefined ? null : values[node.feature];
  return value ?? null;
}

/** The value in words; "" where the condition reads none. */
export function readText(node, values) {
  if (isNumeric(node)) return number(read(node, values));
  if (node.feature === undefined) return "";
  const value = read(node, values);
  return node.truth === undefined ? number(value) : yesNo(value);
}

/** Whether the condition on numbers holds for a value; null where that is not known. */
export function holds(node, value) {
  if (typeof value !== "number") return null;
  const inside =
    (node.above === null || value > node.above) && (node.at_most === null || value <= node.at_most);
  return node.positive === false ? !inside : inside;
}

/** The distance to the nearest threshold, never negative. */
export function distance(node, value) {
  const ends = [node.above, node.at_most].filter((end) => end !== null);
  return Math.min(...ends.map((end) => Math.abs(value - end)));
}

/** The margin in a sentence. */
export function marginText(node, value) {
  if (typeof value !== "number") return "the value is not known";
  const away = number(distance(node, value));
  return holds(node, value) ? `holds, by ${away}` : `does not hold, by ${away}`;
}

/** The range of numbers that a bar shows: what was shown, and all thresholds. */
export function range(node) {
  const ends = [node.above, node.at_most].filter((end) => end !== null);
  const shown = [node.low, node.high].filter((end) => typeof end === "number");
  const all = [...ends, ...shown];
  let [low, high] = [Math.min(...all), Math.max(...all)];
  if (high === low) [low, high] = [low - Math.abs(low) / 2 - 1, high + Math.abs(high) / 2 + 1];
  const room = (high - low) * 0.06;
  return [low - room, high + room];
}

/** Where a value is within a range: 0 to 1. */
export function share(value, [low, high]) {
  return Math.min(Math.max((value - low) / (high - low), 0), 1);
}

/** The parts of a range, as pairs of shares, in which the condition holds. */
export function holding(node, span) {
  const from = node.above === null ? 0 : share(node.above, span);
  const to = node.at_most === null ? 1 : share(node.at_most, span);
  if (node.positive === false) return [[0, from], [to, 1]].filter(([start, end]) => end > start);
  return [[from, to]];
}
