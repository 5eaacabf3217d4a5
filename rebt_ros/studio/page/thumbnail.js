// A demonstration at a glance: features over time, and below them what was done.

import { fillOf, inkOf } from "./colors.js";
import { element, svg } from "./dom.js";

const DASHES = ["none", "6 3", "2 3", "9 3 2 3", "1 4", "12 4"];
const [WIDTH, LINES, BAND] = [400, 60, 16];

/**
 * Draws a demonstration.
 *
 * @param {object} shown - As the studio sends it.
 * @param {(name: string) => string} name - The names of actions and features for people.
 * @param {{large?: boolean}} options - A large one has a legend, and words in its band.
 */
export function thumbnail(shown, name, { large = false } = {}) {
  const seconds = Math.max(shown.seconds, 1e-6);
  const x = (time) => (time / seconds) * WIDTH;
  const picture = svg("svg", {
    class: "thumbnail",
    viewBox: `0 0 ${WIDTH} ${LINES + BAND}`,
    preserveAspectRatio: "none",
    role: "img",
    "aria-label": spoken(shown, name),
  });
  const series = Object.entries(shown.series ?? {});
  series.forEach(([, points], place) => {
    const values = points.map(([, value]) => value);
    const [low, high] = [Math.min(...values), Math.max(...values)];
    const y = (value) => LINES - 4 - ((value - low) / (high - low || 1)) * (LINES - 8);
    picture.append(
      svg("polyline", {
        class: `line line-${place}`,
        points: points.map(([time, value]) => `${x(time).toFixed(1)},${y(value).toFixed(1)}`).join(" "),
        "stroke-dasharray": DASHES[place % DASHES.length],
      }),
    );
  });
  for (const [from, to, label] of shown.bands ?? []) {
    picture.append(
      svg(
        "rect",
        { x: x(from), y: LINES, width: Math.max(x(to) - x(from), 0.6), height: BAND, fill: fillOf(label) },
        svg("title", {}, name(label)),
      ),
    );
  }
  if (!large) return picture;
  const legend = element(
    "ul",
    { class: "legend" },
    ...series.map(([feature], place) =>
      element(
        "li",
        {},
        svg(
          "svg",
          { class: "key", viewBox: "0 0 28 10", "aria-hidden": "true" },
          svg("line", { class: `line line-${place}`, x1: 0, x2: 28, y1: 5, y2: 5, "stroke-dasharray": DASHES[place % DASHES.length] }),
        ),
        name(feature),
      ),
    ),
    ...Object.keys(shown.actions ?? {}).map((label) => chip(label, name(label))),
  );
  return element("div", { class: "large-picture" }, picture, legend);
}

/** An action with its color. */
export function chip(label, words, tag = "li") {
  const made = element(tag, { class: "chip" }, words);
  made.style.background = fillOf(label);
  made.style.color = inkOf(label);
  return made;
}

function spoken(shown, name) {
  const actions = Object.entries(shown.actions ?? {}).map(([label, rows]) => `${name(label)} ${rows}`);
  return `Features over ${shown.seconds} seconds; rows of each action: ${actions.join(", ") || "none"}`;
}
