// One color for each action, the same everywhere. After Okabe and Ito: color-blind people tell them
// apart; the action's name stands beside the color wherever there is room.

const FILLS = ["#0072b2", "#e69f00", "#009e73", "#cc79a7", "#56b4e9", "#d55e00", "#f0e442", "#8c8c8c"];
const INKS = ["#ffffff", "#000000", "#000000", "#000000", "#000000", "#000000", "#000000", "#000000"];

const places = new Map();

/** Gives known labels their colors, in the order of the alphabet. */
export function knowLabels(labels) {
  for (const label of [...labels].sort()) {
    if (!places.has(label)) places.set(label, places.size);
  }
}

function place(label) {
  if (!places.has(label)) places.set(label, places.size);
  return places.get(label) % FILLS.length;
}

/** The fill of an action's marks. */
export function fillOf(label) {
  return FILLS[place(label)];
}

/** The color of words on that fill. */
export function inkOf(label) {
  return INKS[place(label)];
}
