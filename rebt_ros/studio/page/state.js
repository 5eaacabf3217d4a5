// What the studio has told: sections of keys and values. The page keeps no other state of the robot.

import { clock, shortName } from "./words.js";

/** The stamps of a robot are times of day from here on (seconds since the epoch). */
const FIRST_CLOCK = 1e9;

const SECTIONS = [
  "nodes", "tree", "run", "values", "timeline", "actions", "demonstrations", "learning", "draft",
  "versions", "names",
];

/** Holds the sections, and tells once for each picture which of them have changed. */
export class State {
  constructor() {
    this.sections = Object.fromEntries(SECTIONS.map((name) => [name, {}]));
    this.known = false;
    this.ahead = 0;
    this.changed = new Set();
    this.listeners = [];
    this.due = false;
  }

  get(name) {
    return this.sections[name];
  }

  /** The studio's time: seconds since the epoch; a tablet's own clock is often wrong. */
  now() {
    return Date.now() / 1000 + this.ahead;
  }

  /** The name that people gave to an action or feature. */
  shown(name) {
    const names = this.sections.names;
    return Object.hasOwn(names, name) ? String(names[name]) : String(name);
  }

  /** What people call a demonstration: when it began, by the same clock everywhere. */
  demonstration(name) {
    const start = this.sections.demonstrations[name]?.start ?? 0;
    // A simulated clock begins at nought.
    return start > FIRST_CLOCK ? clock(start) : shortName(name);
  }

  /** Calls back with a Set of section names, before the next picture is drawn. */
  listen(listener) {
    this.listeners.push(listener);
  }

  snapshot(sections, now) {
    if (typeof now === "number") this.ahead = now - Date.now() / 1000;
    for (const name of SECTIONS) this.sections[name] = sections[name] ?? {};
    this.known = true;
    this.touch(SECTIONS);
  }

  changes(sections) {
    for (const [name, values] of Object.entries(sections)) {
      const section = this.sections[name];
      if (!section) continue;
      for (const [key, value] of Object.entries(values)) {
        if (value === null) delete section[key];
        else section[key] = value;
      }
    }
    // Trees are drawn again where names are others, which they see by the object.
    if (sections.names) this.sections.names = { ...this.sections.names };
    this.touch(Object.keys(sections));
  }

  touch(names) {
    for (const name of names) this.changed.add(name);
    if (this.due) return;
    this.due = true;
    requestAnimationFrame(() => {
      this.due = false;
      const changed = this.changed;
      this.changed = new Set();
      for (const listener of this.listeners) listener(changed);
    });
  }
}
