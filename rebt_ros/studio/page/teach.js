// Teach: record demonstrations, drive by hand, and keep the good ones.

import { Demonstrations } from "./demonstrations.js";
import { button, byId, element, keyed, setText, show } from "./dom.js";
import { Takeover } from "./takeover.js";
import { chip } from "./thumbnail.js";
import { say } from "./toasts.js";
import { count, sentence } from "./words.js";

/** The section. */
export class Teach {
  sections = ["nodes", "actions", "demonstrations", "names", "tree"];

  constructor({ state, ask, visit }) {
    this.state = state;
    this.takeover = new Takeover({ state, ask });
    this.takeover.refused = (message) => say(message, { bad: true });
    this.demonstrations = new Demonstrations({ state, ask, visit });
    this.on = button("Start recording", () => ask("record", { on: true }), {
      class: "primary big",
      title: "Records everything that is done from now on",
    });
    this.off = button("Stop recording", () => ask("record", { on: false }), {
      class: "big",
      title: "Keeps this demonstration, and records no more",
    });
    this.next = button("Well done: next one", () => ask("new_demonstration"), {
      class: "primary big",
      title: "Keeps this demonstration; the next action begins another one",
    });
    this.discard = button("Discard this one", () => ask("discard"), {
      title: "Deletes the demonstration that is being recorded, or the one just kept if you have not driven since",
    });
    this.failed = button("The robot failed: show it", () => ask("failed"), {
      title: "Says that the robot failed; what you show next is its correction",
    });
    byId("recorder-buttons").append(this.on, this.next, this.off, this.discard, this.failed);
  }

  render(changed) {
    this.takeover.active = true;
    this.recorder();
    if (changed.has("actions") || changed.has("names") || changed.has("nodes") || changed.has("tree")) this.takeover.render();
    if (changed.has("demonstrations") || changed.has("names")) this.demonstrations.render();
  }

  leave() {
    this.takeover.active = false;
    this.letGo();
  }

  letGo() {
    this.takeover.letGo();
  }

  recorder() {
    const node = this.state.get("nodes").recorder;
    const isThere = node?.there === true;
    const values = node?.values ?? {};
    const records = isThere && !node.message.startsWith("not recording");
    const rows = Number(values["rows of the demonstration"] ?? 0);
    const name = String(values.demonstration ?? "").split("/").at(-1).replace(/\.rec$/, "");
    const shown = this.state.get("demonstrations")[name];
    show(this.on, !records);
    show(this.off, records);
    show(this.next, records);
    for (const one of [this.on, this.off, this.next, this.failed]) one.disabled = !isThere;
    this.discard.disabled = !records;
    const line = byId("recorder-state");
    line.classList.toggle("recording", records);
    if (!isThere) setText(line, "The recorder is not running");
    else if (!records) setText(line, "Not recording");
    else setText(line, rows ? `Recording: ${count(rows, "row")} of this demonstration` : "Ready: drive the robot, and recording begins");
    setText(byId("recorder-hint"), this.hint(isThere, records, values));
    const warnings = isThere && node.level !== "OK" ? node.message.split("; ").filter((one) => one !== "not recording") : [];
    if (node && !isThere) warnings.push(node.message);
    keyed(
      byId("recorder-warnings"),
      warnings.map((one) => [one, one]),
      () => element("li"),
      (child, one) => setText(child, sentence(one)),
    );
    show(byId("recorder-warnings"), warnings.length > 0);
    const figures = isThere ? Object.entries(values).map(([key, value]) => figure(key, value)).filter(Boolean) : [];
    keyed(
      byId("recorder-figures"),
      figures,
      () => element("div", {}, element("dt"), element("dd")),
      (child, value, key) => {
        setText(child.children[0], key);
        setText(child.children[1], value);
      },
    );
    keyed(
      byId("recorder-actions"),
      records && shown && !shown.deleted ? Object.entries(shown.actions) : [],
      (label) => chip(label, "", "span"),
      (child, amount, label) => setText(child, `${this.state.shown(label)} ${amount}`),
    );
  }

  hint(isThere, records, values) {
    if (!isThere) return "Start the recorder; this page notices it by itself.";
    if (!records) return "Press “Start recording”, then drive the robot through the whole task.";
    const origin = values["origin of the demonstration"];
    if (origin === "failed") return "Show how it is done right, from here to the end. Then press “Well done”.";
    if (origin === "takeover") return "You correct the robot. Drive to the end of the task, then press “Well done”.";
    return "Drive through the whole task. At its end press “Well done: next one”; show it three times or more.";
  }
}

/** What the recorder counts, in words; null for what only its makers need. */
function figure(key, value) {
  const rate = /^rate of (.*) \(Hz\)$/.exec(key);
  if (rate) return [`${rate[1]}, messages a second`, value];
  const words = {
    rows: "rows, all demonstrations",
    takeovers: "takeovers",
    "rows lost": "rows lost",
    "messages lost": "messages lost",
    "failed episodes": "failures that were corrected",
  }[key];
  if (!words || (value === "0" && key !== "rows")) return null;
  return [words, value];
}
