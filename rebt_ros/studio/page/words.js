// Numbers, times and states as people say them.

const STATUS_WORDS = {
  SUCCESS: "succeeds",
  FAILURE: "does not hold",
  RUNNING: "runs",
  INVALID: "was not reached",
};

/** What the status of a node means. */
export function statusWords(status, isCondition) {
  if (isCondition && status === "SUCCESS") return "holds";
  if (!isCondition && status === "FAILURE") return "did not act";
  return STATUS_WORDS[status] ?? "not known";
}

/** A value with as many digits as help. */
export function number(value, digits = 3) {
  if (value === null || value === undefined) return "not known";
  if (typeof value !== "number") return String(value);
  const size = Math.abs(value);
  if (size === 0) return "0";
  if (size >= 1e6 || size < 1e-3) return value.toExponential(digits - 1);
  return String(Number(value.toPrecision(digits))).replace("-", "−");
}

/** The value of a feature that is yes or no. */
export function yesNo(value) {
  if (value === null || value === undefined) return "not known";
  if (typeof value === "number") return value > 0.5 ? "yes" : "no";
  return String(value);
}

export function percent(share) {
  if (share === null || share === undefined) return "–";
  const whole = Math.round(share * 100);
  // Never rounded to all or nothing.
  if ((whole === 100 && share < 1) || (whole === 0 && share > 0)) return `${(share * 100).toFixed(1)}%`;
  return `${whole}%`;
}

export function count(amount, noun, several = `${noun}s`) {
  return `${amount.toLocaleString("en")} ${amount === 1 ? noun : several}`;
}

export function duration(seconds) {
  if (seconds < 10) return `${seconds.toFixed(1)} s`;
  if (seconds < 100) return `${Math.round(seconds)} s`;
  return `${Math.floor(seconds / 60)} min ${Math.round(seconds % 60)} s`;
}

/** How long ago, to be read at a glance. */
export function ago(seconds) {
  if (seconds < 1.5) return "just now";
  if (seconds < 100) return `${Math.round(seconds)} s ago`;
  if (seconds < 5400) return `${Math.round(seconds / 60)} min ago`;
  if (seconds < 129600) return `${Math.round(seconds / 3600)} h ago`;
  return `${Math.round(seconds / 86400)} days ago`;
}

/** A time of day, with the date where that is another one. */
export function clock(epoch) {
  const then = new Date(epoch * 1000);
  const time = then.toLocaleTimeString("en-GB");
  if (then.toDateString() === new Date().toDateString()) return time;
  return `${then.toLocaleDateString("en-GB", { day: "numeric", month: "short", year: "numeric" })}, ${time}`;
}

/** With a capital letter and a full stop. */
export function sentence(text) {
  const words = String(text).trim();
  if (!words) return "";
  const begun = words[0].toUpperCase() + words.slice(1);
  return /[.!?:]$/.test(begun) ? begun : `${begun}.`;
}

/**
 * A text with the names that people gave, each where the robot's name stands.
 *
 * @param {string} text - With the robot's names.
 * @param {string[]} names - Those that may stand in it.
 * @param {(name: string) => string} shown - What people call it.
 */
export function renamed(text, names, shown) {
  if (names.every((name) => shown(name) === name)) return text;
  // The longest first: one name may begin like another.
  const sorted = [...names].sort((left, right) => right.length - left.length);
  const plain = sorted.map((name) => name.replace(/[.*+?^${}()|[\]\\]/g, "\\$&")).join("|");
  // A name that is part of a word is none.
  return text.replace(new RegExp(`(?<![\\p{L}\\p{N}_])(?:${plain})(?![\\p{L}\\p{N}_])`, "gu"), (name) => shown(name));
}

/** When a recording was begun, which its name says in UTC; the name itself where it does not. */
export function shortName(name) {
  const found = /^(\d{4})(\d\d)(\d\d)T(\d\d)(\d\d)(\d\d)/.exec(name);
  if (!found) return name;
  const [year, month, ...rest] = found.slice(1).map(Number);
  return clock(Date.UTC(year, month - 1, ...rest) / 1000);
}

/**
 * A sentence with the names of recordings as people see them, and without their directories.
 *
 * @param {string} text - With the names of files.
 * @param {(name: string) => string} called - What people call a recording.
 */
export function withShortNames(text, called = shortName) {
  return text.replace(/(?:\S*\/)?(\d{8}T\d{6}\.\d+Z-\d+-[0-9a-f]+(?:-[12])*)(?:\.rec)?/g, (_, name) => called(name));
}
