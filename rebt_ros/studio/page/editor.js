// What can be done to the node that was pressed: its threshold, its kind, its place, its end.

import { button, byId, element, setText } from "./dom.js";
import { Histogram } from "./histogram.js";
import { features, isNumeric } from "./margins.js";
import { calm } from "./tree.js";
import { showBranch } from "./why.js";
import { renamed, sentence } from "./words.js";

/** The panel beside the draft. */
export class Editor {
  constructor({ state, ask, visit }) {
    this.state = state;
    this.ask = ask;
    this.visit = visit;
    this.node = null;
    this.view = null;
    this.shown = null;
  }

  /** Shows a node of the draft; null: none. What was just chosen is brought into sight. */
  show(node, view, chosen = false) {
    this.node = node;
    this.view = view;
    const body = byId("editor-body");
    if (!node) {
      this.shown = null;
      setText(byId("editor-title"), "Change a node");
      body.replaceChildren(
        element("p", { class: "hint" }, "Press a node of your draft: here you can move its threshold, choose how it runs, move it or delete it. Nothing reaches the robot before you publish."),
      );
      return;
    }
    const shown = (name) => this.state.shown(name);
    const words = node.label === undefined ? renamed(node.text, features(node), shown) : shown(node.label);
    setText(byId("editor-title"), words);
    // What a threshold says is in the title already, and its number in the field below.
    const parts = isNumeric(node) ? [] : [element("p", {}, sentence(node.explanation))];
    const from = element("div");
    parts.push(from);
    const place = element("div", { class: "place" });
    if (isNumeric(node)) parts.push(place);
    if (this.choosable(node)) parts.push(this.psa(node));
    parts.push(this.moves(node));
    body.replaceChildren(...parts);
    if (chosen) byId("editor").scrollIntoView({ block: "nearest", behavior: calm() ? "auto" : "smooth" });
    if (isNumeric(node)) this.histogram(node, place);
    this.branch(node, from);
  }

  /** Shows in how much of what was shown the branch acts, before somebody deletes it, say. */
  async branch(node, host) {
    const answer = await this.ask("branch", { path: node.path, robot: false }, { quiet: true });
    if (this.node === node) showBranch(host, answer, this.visit, (name) => this.state.demonstration(name));
  }

  /** Whether its actions may run at the same time or one after the other. */
  choosable(node) {
    if (node.kind === "psa") return true;
    const children = this.view.nodes.filter((other) => other.parent === node.path);
    return (
      node.kind === "control" && children.length > 1 && children.every((other) => other.label !== undefined) &&
      /Parallel|Selector/.test(node.text)
    );
  }

  psa(node) {
    const is = (word) => node.kind !== "psa" && node.text.includes(word);
    const choose = (choice) => this.ask("psa", { path: node.path, choice }, { undo: () => this.ask("undo") });
    return element(
      "div",
      { class: "choice" },
      element("h3", {}, "How do these actions run?"),
      button("All at the same time (Parallel)", () => choose("parallel"), { "aria-pressed": String(is("Parallel")), title: "The draft does all of them at once" }),
      button("The first one that can (Selector)", () => choose("selector"), { "aria-pressed": String(is("Selector")), title: "The draft does the first, or the next where that fails" }),
    );
  }

  moves(node) {
    const siblings = this.view.nodes.filter((other) => other.parent === node.parent);
    const place = siblings.indexOf(siblings.find((other) => other.path === node.path));
    const undo = () => this.ask("undo");
    const move = (by) => this.ask("move", { path: node.path, by }, { undo });
    const isRoot = node.parent === null;
    const within = this.view.nodes.filter((other) => other.path.startsWith(`${node.path}.`)).length;
    const earlier = button("◀ Earlier", () => move(-1), { title: "Is tried before its neighbor on the left" });
    const later = button("Later ▶", () => move(1), { title: "Is tried after its neighbor on the right" });
    const remove = button(within ? `Delete this branch of ${within + 1} nodes` : "Delete this node", () => this.ask("remove", { path: node.path }, { undo }), {
      class: "careful",
      title: "Deletes it from the draft; Undo brings it back",
    });
    earlier.disabled = isRoot || place === 0;
    later.disabled = isRoot || place === siblings.length - 1;
    remove.disabled = isRoot;
    return element("div", { class: "buttons" }, earlier, later, remove);
  }

  async histogram(node, place) {
    place.replaceChildren(element("p", { class: "hint" }, "Counting…"));
    const answer = await this.ask("histogram", { path: node.path }, { quiet: true });
    if (this.node !== node) return;
    if (!answer.ok) {
      place.replaceChildren(element("p", { class: "hint" }, sentence(answer.message)), this.typed(node));
      return;
    }
    const change = (value, end) => this.change(node, value, end);
    const shown = (name) => this.state.shown(name);
    const quantity = renamed(answer.data.quantity, features(node), shown);
    place.replaceChildren(
      element("p", { class: "hint" }, `How often each action was shown at which ${quantity}. Drag the line.`),
      new Histogram(answer.data, node, change, shown).element,
    );
  }

  /** Thresholds without a histogram: where nothing is known of what was shown. */
  typed(node) {
    const ends = ["above", "at_most"].filter((end) => node[end] !== null);
    return element(
      "div",
      {},
      ...ends.map((end) => {
        const field = element("input", { type: "number", step: "any" });
        field.value = String(node[end]);
        const words = ends.length > 1 ? (end === "above" ? "Lower threshold " : "Upper threshold ") : "Threshold ";
        return element(
          "div",
          { class: "tools" },
          element("label", {}, words, field),
          button("Change it", () => field.value !== "" && this.change(node, Number(field.value), end), { class: "primary", title: "Changes the draft; the robot gets it once you publish" }),
        );
      }),
    );
  }

  change(node, value, end) {
    this.ask("threshold", { path: node.path, value, end }, { undo: () => this.ask("undo") });
  }
}
