// Explain: choose a moment, of a demonstration or of the last ten minutes, and see why.

import { byId, element, keyed, setAttribute, setText, show } from "./dom.js";
import { Strip } from "./strip.js";
import { thumbnail } from "./thumbnail.js";
import { Tree, actingPaths, calm, treeTools } from "./tree.js";
import { showBranch, showNoWhy, showWhy } from "./why.js";
import { count, duration, number, yesNo } from "./words.js";

const ROBOT = "";

/** The section. */
export class Explain {
  sections = ["demonstrations", "tree", "draft", "timeline", "names"];

  constructor({ state, ask, visit }) {
    this.state = state;
    this.ask = ask;
    this.go = visit;
    this.name = ROBOT;
    this.seconds = 0;
    this.number = 0;
    const shown = (name) => state.shown(name);
    this.tree = new Tree(byId("explain-tree"), {
      label: "The tree at that moment",
      shown,
      live: true,
      choose: (node) => this.branch(node),
    });
    byId("explain-tools").append(treeTools(this.tree, { jump: () => this.acting && this.tree.reveal(this.acting) }));
    this.strip = new Strip(byId("explain-strip"), state, (time) => this.ofRobot(time));
    byId("explain-which").addEventListener("change", (event) => this.visit(event.target.value));
    byId("explain-seconds").addEventListener("input", (event) => this.at(Number(event.target.value)));
    byId("explain-picture").addEventListener("pointerdown", (event) => this.press(event));
    byId("explain-picture").addEventListener("pointermove", (event) => event.buttons && this.press(event));
  }

  render(changed) {
    if (changed.has("demonstrations") || changed.has("names")) this.choices();
    if (changed.has("timeline")) this.strip.render();
    const { view } = this.isRobot ? this.state.get("tree") : this.state.get("draft");
    if (view) this.tree.show(view, this.state.get("names"));
    if (this.told) this.color();
  }

  get isRobot() {
    return this.name === ROBOT;
  }

  choices() {
    const all = Object.entries(this.state.get("demonstrations")).filter(([, one]) => !one.deleted && one.rows);
    all.sort((left, right) => right[1].start - left[1].start);
    const choices = [[ROBOT, null], ...all];
    keyed(
      byId("explain-which"),
      choices.map(([name, one]) => [name || "robot", [name, one]]),
      () => element("option"),
      (child, [name, one]) => {
        child.value = name;
        setText(child, one ? `${this.state.demonstration(name)}: ${duration(one.seconds)}, ${count(one.rows, "row")}` : "the robot, in the last ten minutes");
      },
    );
    if (!choices.some(([name]) => name === this.name)) this.name = ROBOT;
    this.picture();
  }

  /** Chooses a demonstration by name; the empty name is the robot. */
  visit(name, seconds = 0) {
    this.name = name;
    this.seconds = seconds;
    this.told = null;
    this.drawn = null;
    this.node = null;
    show(byId("explain-branch"), false);
    this.picture();
    this.render(new Set());
    if (!this.isRobot && this.state.get("demonstrations")[name]) this.at(seconds);
    else showNoWhy(byId("explain-why"), "Choose a moment: press a point of the strip above.");
  }

  picture() {
    byId("explain-which").value = this.name;
    const shown = this.state.get("demonstrations")[this.name];
    show(byId("explain-strip"), this.isRobot);
    show(byId("explain-slide"), !this.isRobot);
    show(byId("explain-picture"), !this.isRobot);
    setText(
      byId("explain-hint"),
      this.isRobot
        ? "Press a point of the strip: you see what the robot's tree did then, and why."
        : "Press a point of the picture: you see what your draft does then, and why.",
    );
    // What is pointed at stays, unless it is another picture: a recording goes on elsewhere, say.
    const names = this.state.get("names");
    if (this.isRobot || !shown || (shown === this.drawn && names === this.names)) return;
    [this.drawn, this.names] = [shown, names];
    const drawn = thumbnail(shown, (one) => this.state.shown(one), { large: true });
    this.cursor = element("span", { class: "cursor" });
    byId("explain-picture").replaceChildren(element("div", { class: "cut" }, drawn.firstElementChild, this.cursor), drawn);
    setAttribute(byId("explain-seconds"), "max", shown.seconds);
    this.point();
  }

  point() {
    const shown = this.state.get("demonstrations")[this.name];
    if (!shown || !this.cursor) return;
    this.cursor.style.left = `${(this.seconds / Math.max(shown.seconds, 1e-6)) * 100}%`;
    byId("explain-seconds").value = this.seconds;
    setText(byId("explain-output"), duration(this.seconds));
  }

  press(event) {
    const frame = byId("explain-picture").querySelector(".cut");
    const shown = this.state.get("demonstrations")[this.name];
    if (!frame || !shown || !frame.contains(event.target)) return;
    const box = frame.getBoundingClientRect();
    this.at(Math.min(Math.max((event.clientX - box.left) / box.width, 0), 1) * shown.seconds);
  }

  at(seconds) {
    this.seconds = seconds;
    this.point();
    this.explain();
  }

  ofRobot(time) {
    this.time = time;
    this.explain();
  }

  /** Asks why; while an answer is under way only the newest question waits. */
  async explain() {
    const given = this.isRobot
      ? this.time === null || this.time === undefined ? {} : { t: this.time }
      : { demonstration: this.name, seconds: this.seconds };
    this.wanted = given;
    if (this.busy) return;
    this.busy = true;
    let answer;
    let asked;
    do {
      asked = this.wanted;
      answer = await this.ask("explain", asked, { quiet: true });
    } while (asked !== this.wanted);
    this.busy = false;
    if (!answer.ok) {
      this.told = null;
      this.tree.status(null, {}, null);
      showNoWhy(byId("explain-why"), answer.message);
      return;
    }
    this.told = answer.data;
    showWhy(byId("explain-why"), answer.data, this.go, (name) => this.state.demonstration(name));
    this.color();
    if (this.acting) this.tree.reveal(this.acting);
  }

  /** Shows from which demonstrations the branch of a node comes. */
  async branch(node) {
    this.node = node;
    const answer = await this.ask("branch", { path: node.path, robot: this.isRobot }, { quiet: true });
    if (this.node !== node) return;
    setText(byId("explain-node"), node.explanation);
    showBranch(byId("explain-from"), answer, this.go, (name) => this.state.demonstration(name));
    show(byId("explain-branch"), true);
    byId("explain-branch").scrollIntoView({ block: "nearest", behavior: calm() ? "auto" : "smooth" });
  }

  color() {
    const { statuses, values, acting } = this.told;
    const shown = values ?? {};
    this.acting = acting ?? [...(this.tree.view ? actingPaths(this.tree.view, statuses, {}) : [])][0] ?? null;
    this.tree.status(statuses ?? null, shown, this.acting ? new Set([this.acting]) : null);
    show(byId("explain-no-values"), !Object.keys(shown).length);
    const truths = new Set(this.tree.view?.nodes.filter((node) => node.truth).map((node) => node.feature));
    keyed(
      byId("explain-values"),
      Object.entries(shown).sort(),
      (name) => element("li", {}, element("span", { class: "name" }, this.state.shown(name)), element("span", { class: "value" })),
      (child, value, name) => setText(child.children[1], truths.has(name) ? yesNo(value) : number(value)),
    );
  }
}
