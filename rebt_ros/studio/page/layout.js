// The studio lays trees out; here they only get room for live values, and close the gaps where
// branches are folded up.

/** The widest gap that stays where something was folded up (pixels). */
const GAP = 34;

/** Paths of the nodes that are inside of a folded branch. */
export function hiddenPaths(view, folded) {
  const hidden = new Set();
  for (const node of view.nodes) {
    if (node.parent !== null && (folded.has(node.parent) || hidden.has(node.parent))) {
      hidden.add(node.path);
    }
  }
  return hidden;
}

/**
 * A growing function from old to new coordinates.
 *
 * @param {[number, number, number][]} spans - From, to, and what is added behind.
 * @param {boolean} squeeze - Whether wide gaps are closed.
 * @returns {{map: (x: number) => number, end: number}}
 */
function warp(spans, squeeze) {
  const joined = [];
  for (const [from, to, extra] of [...spans].sort((left, right) => left[0] - right[0])) {
    const last = joined.at(-1);
    if (last && from <= last[1]) {
      if (to >= last[1]) last[2] = to > last[1] ? extra : Math.max(last[2], extra);
      last[1] = Math.max(last[1], to);
    } else joined.push([from, to, extra]);
  }
  const knots = [];
  let [old, moved] = [joined[0][0], 0];
  for (const [from, to, extra] of joined) {
    const gap = from - old;
    moved += squeeze ? Math.min(gap, GAP) : gap;
    knots.push([from, moved]);
    moved += to - from;
    knots.push([to, moved]);
    old = to;
    if (extra) {
      // Lines that begin at the lower edge begin there still.
      knots.push([to + 0.5, moved + extra]);
      moved += extra;
      old = to + 0.5;
    }
  }
  const map = (x) => {
    let [low, high] = [0, knots.length - 1];
    if (x <= knots[0][0]) return knots[0][1] + x - knots[0][0];
    if (x >= knots[high][0]) return knots[high][1] + x - knots[high][0];
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (knots[middle][0] <= x) low = middle;
      else high = middle;
    }
    const [[from, start], [to, end]] = [knots[low], knots[high]];
    return to === from ? start : start + ((x - from) / (to - from)) * (end - start);
  };
  return { map, end: knots.at(-1)[1] };
}

/**
 * Where everything goes.
 *
 * @param {object} view - As the studio sends it.
 * @param {Set<string>} folded - Paths of branches whose inside is hidden.
 * @param {(node: object) => number} extra - The room below a node (pixels).
 */
export function arrange(view, folded, extra) {
  const hidden = hiddenPaths(view, folded);
  const nodes = view.nodes.filter((node) => !hidden.has(node.path));
  const squeeze = hidden.size > 0;
  const across = warp(nodes.map((node) => [node.x, node.x + node.width, 0]), squeeze);
  const down = warp(nodes.map((node) => [node.y, node.y + node.height, extra(node)]), squeeze);
  const places = new Map(
    nodes.map((node) => [node.path, { x: across.map(node.x), y: down.map(node.y) }]),
  );
  const figures = view.nodes.filter((node) => !sharesBox(view, node));
  const links = view.links.map((points, place) => {
    const path = figures[place + 1]?.path ?? null;
    if (path === null || hidden.has(path)) return { path, line: null };
    const line = points.map(([x, y]) => `${round(across.map(x))},${round(down.map(y))}`).join(" ");
    return { path, line };
  });
  return { hidden, places, links, width: across.end, height: down.end };
}

/** A condition stands in one box with the Inverter that it belongs to, and has no line of its own. */
function sharesBox(view, node) {
  if (node.kind !== "condition" || node.parent === null) return false;
  parents(view);
  return view.kinds.get(node.parent) === "inverter";
}

function parents(view) {
  if (view.kinds) return;
  // Not enumerable, so that it is never taken for something that the studio has sent.
  Object.defineProperty(view, "kinds", {
    value: new Map(view.nodes.map((node) => [node.path, node.kind])),
  });
}

function round(value) {
  return Math.round(value * 10) / 10;
}
