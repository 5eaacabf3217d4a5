// Puts the page together: what comes in goes to the section that is shown.

import { knowLabels } from "./colors.js";
import { Connection } from "./connection.js";
import { Curate } from "./curate.js";
import { byId, show } from "./dom.js";
import { Explain } from "./explain.js";
import { Header } from "./header.js";
import { Learn } from "./learn.js";
import { Live } from "./live.js";
import { State } from "./state.js";
import { Tabs } from "./tabs.js";
import { Teach } from "./teach.js";
import { say } from "./toasts.js";

const state = new State();

/**
 * Asks the studio for something, and says what it answers.
 *
 * @param {string} verb - What to do.
 * @param {object} given - The arguments.
 * @param {{quiet?: boolean, undo?: Function}} options - A quiet one says nothing; `undo` takes
 *   back what was done.
 */
async function ask(verb, given = {}, { quiet = false, undo = null } = {}) {
  const answer = await connection.ask(verb, given);
  if (!quiet) say(answer.message, { bad: !answer.ok, undo: answer.ok ? undo : null, called: (name) => state.demonstration(name) });
  return answer;
}

/** Goes to a demonstration, from wherever it is named, and to a moment of it. */
function visit(name, seconds = 0) {
  tabs.choose("explain");
  sections.explain.visit(name, seconds);
}

const given = { state, ask, visit };
const header = new Header(given);
const sections = {
  live: new Live(given),
  teach: new Teach(given),
  learn: new Learn(given),
  curate: new Curate(given),
  explain: new Explain(given),
};
/** What has changed since a section was shown last. */
const missed = Object.fromEntries(Object.entries(sections).map(([name, one]) => [name, new Set(one.sections)]));

function render(name) {
  if (!state.known) return;
  const changed = missed[name];
  if (!changed.size) return;
  missed[name] = new Set();
  sections[name].render(changed);
}

function changed(names) {
  if (names.has("actions") || names.has("demonstrations")) {
    const shown = Object.values(state.get("demonstrations")).flatMap((one) => Object.keys(one.actions ?? {}));
    knowLabels(new Set([...Object.keys(state.get("actions")), ...shown]));
  }
  for (const [name, section] of Object.entries(sections)) {
    for (const one of section.sections) if (names.has(one)) missed[name].add(one);
  }
  if (header.sections.some((one) => names.has(one))) header.render();
  render(tabs.chosen);
}

const connection = new Connection({
  snapshot: (parts, now) => {
    state.snapshot(parts, now);
    show(byId("loading"), false);
  },
  changes: (parts) => state.changes(parts),
  state: (how) => {
    header.connection(how);
    if (how !== "open") sections.teach.letGo();
  },
});

const tabs = new Tabs((name) => {
  for (const [other, section] of Object.entries(sections)) if (other !== name) section.leave?.();
  // The section is drawn when there is room for it to be measured.
  requestAnimationFrame(() => render(name));
});
state.listen(changed);
connection.open();
