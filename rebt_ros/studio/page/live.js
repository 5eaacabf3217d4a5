// Live: what the robot does now, and did in the last ten minutes.

import { fillOf, inkOf } from "./colors.js";
import { byId, element, keyed, setAttribute, setText, show, svg } from "./dom.js";
import { features, isNumeric, marginText, range, read, readText, share } from "./margins.js";
import { Strip } from "./strip.js";
import { Tree, actingPaths, calm, treeTools } from "./tree.js";
import { showBranch, showNoWhy, showWhy } from "./why.js";
import { count, number, renamed, sentence, yesNo } from "./words.js";

const CONDITIONS = {
  running: "The tree drives the robot",
  disabled: "The tree is stopped: press “Let the tree drive” to start it",
  "waiting for a tree": "The robot waits for a tree",
  paused: "A person has taken over",
  "waiting for state": "The tree waits for the robot's state",
  "held until a person takes over": "The tree has stopped: it was never shown anything like this. Take over in Teach",
  "waiting for /clock": "The tree waits for the simulated clock",
};

/** The section. */
export class Live {
  sections = ["nodes", "tree", "run", "values", "timeline", "names", "demonstrations"];

  constructor({ state, ask, visit }) {
    this.state = state;
    this.ask = ask;
    this.visit = visit;
    this.moment = null;
    this.asked = 0;
    this.follow = false;
    this.strip = new Strip(byId("live-strip"), state, (time) => this.stepTo(time));
    this.tree = new Tree(byId("live-tree"), {
      label: "The tree that the robot follows",
      live: true,
      choose: (node) => this.why(node),
      shown: (name) => state.shown(name),
    });
    byId("live-tools").append(treeTools(this.tree, { jump: () => this.jump() }));
    byId("why-now").addEventListener("click", () => this.why(null));
  }

  /** What is shown: the present, or the moment that was stepped back to. */
  get scene() {
    const run = this.state.get("run");
    const tree = this.state.get("tree");
    const past = this.moment;
    const document = past ? past.document : run.document;
    const fits = tree.view && document === tree.document;
    return {
      statuses: fits ? (past ? past.statuses : run.statuses) : null,
      values: past ? past.values : this.state.get("values"),
      commands: (past ? past.commands : run.commands) ?? {},
    };
  }

  render(changed) {
    const { view } = this.state.get("tree");
    if (changed.has("timeline")) this.strip.render();
    if (changed.has("tree") || changed.has("names")) {
      show(byId("live-empty"), !view);
      show(byId("live-full"), Boolean(view));
      this.firstStep ??= [...byId("live-shown").childNodes];
      if (view) this.tree.show(view, this.state.get("names"));
      setText(byId("live-summary"), this.state.get("tree").summary ?? "");
    }
    if (changed.has("demonstrations") || changed.has("tree")) this.shown();
    if (this.moment && !changed.has("moment") && !changed.has("tree")) return;
    const { statuses, values, commands } = this.scene;
    this.command(commands);
    if (view) {
      const acting = actingPaths(view, statuses, commands);
      this.acting = acting;
      this.tree.status(statuses, values, acting);
      this.showValues(view, values);
      this.showChosen(values);
    }
    if (changed.has("nodes")) this.advise();
  }

  /** Whether the first step to a tree is done. */
  shown() {
    const kept = Object.values(this.state.get("demonstrations")).filter((one) => one.kept && !one.deleted);
    const done = element("span", {}, `✓ The robot was shown what to do, in ${count(kept.length, "demonstration")}.`);
    byId("live-shown").replaceChildren(...(kept.length ? [done] : this.firstStep));
  }

  command(commands) {
    const run = this.state.get("run");
    const executor = this.state.get("nodes").executor;
    const isThere = executor?.there !== false;
    const past = this.moment !== null;
    const words = past
      ? "What the tree commanded at that moment"
      : isThere
        ? (CONDITIONS[run.condition] ?? run.condition ?? (this.state.get("tree").view ? "Nothing is known of the robot yet" : CONDITIONS["waiting for a tree"]))
        : "The executor is not running";
    setText(byId("condition"), sentence(words));
    const drives = past || run.condition === "running";
    const shown = Object.entries(commands).filter(([, label]) => label);
    byId("command").classList.toggle("resting", !drives || !shown.length);
    const items = shown.length ? shown : [["", ""]];
    keyed(
      byId("command"),
      items,
      () => element("span", { class: "one" }, element("span", { class: "swatch", "aria-hidden": "true" }), element("span", { class: "name" }), element("span", { class: "channel" })),
      (child, label, channel) => {
        const [swatch, name, on] = child.children;
        swatch.style.background = label ? fillOf(label) : "transparent";
        swatch.style.color = label ? inkOf(label) : "inherit";
        setText(name, label ? this.state.shown(label) : "no command");
        setText(on, items.length > 1 ? channel : "");
      },
    );
  }

  /** What is missing or in trouble, and what to do about it. */
  advise() {
    const { nodes } = this.state.sections;
    const missing = ["executor", "recorder", "learner"].filter((role) => nodes[role] && nodes[role].level !== "OK");
    keyed(
      byId("live-advice"),
      missing.map((role) => [role, nodes[role]]),
      () => element("li"),
      (child, node, role) => setText(child, node.there ? `${role}: ${sentence(node.message)}` : sentence(node.message)),
    );
    show(byId("live-advice"), missing.length > 0);
  }

  // --- values ---

  showValues(view, values) {
    if (this.computedIn !== view) {
      this.computedIn = view;
      // What conditions compute from several features, each once.
      this.computed = new Map(view.nodes.filter((node) => node.terms).map((node) => [`computed ${node.quantity}`, node]));
    }
    const names = Object.keys(values).sort();
    const sums = names.length ? [...this.computed] : [];
    keyed(
      byId("live-values"),
      [...names.map((name) => [name, { feature: name }]), ...sums],
      () => this.bar(),
      (child, quantity) => this.measure(child, quantity, values, view),
    );
    show(byId("live-no-values"), names.length === 0);
  }

  bar() {
    const picture = svg("svg", { class: "value-bar", viewBox: "0 0 100 16", preserveAspectRatio: "none", "aria-hidden": "true" });
    return element("li", {}, element("span", { class: "name" }), element("span", { class: "value" }), picture);
  }

  measure(child, quantity, values, view) {
    const [title, text, picture] = child.children;
    const names = this.state.get("names");
    if (child.view !== view || child.names !== names) {
      [child.view, child.names, child.last] = [view, names, undefined];
      const shown = (name) => this.state.shown(name);
      setText(title, quantity.terms ? renamed(quantity.quantity, features(quantity), shown) : shown(quantity.feature));
      const tests = view.nodes.filter((node) => node.quantity === quantity.quantity && node.feature === quantity.feature);
      child.truth = tests.some((node) => node.truth !== undefined);
      child.range = this.scale(picture, tests.filter(isNumeric));
      child.needle = picture.lastElementChild;
    }
    const value = read(quantity, values);
    if (child.last === value) return;
    child.last = value;
    setText(text, child.truth ? yesNo(value) : number(value));
    if (!child.range) return;
    const known = typeof value === "number";
    setAttribute(child.needle, "visibility", known ? null : "hidden");
    if (!known) return;
    const x = (share(value, child.range) * 100).toFixed(1);
    setAttribute(child.needle, "transform", `translate(${x} 0)`);
  }

  /** Draws a feature's scale with all its thresholds; returns its range, null where it has none. */
  scale(picture, tests) {
    picture.replaceChildren();
    if (!tests.length) return null;
    const ranges = tests.map(range);
    const span = [Math.min(...ranges.map(([low]) => low)), Math.max(...ranges.map(([, high]) => high))];
    picture.append(svg("rect", { class: "track", x: 0, y: 5, width: 100, height: 6 }));
    const ends = new Set(tests.flatMap((node) => [node.above, node.at_most]).filter((end) => end !== null));
    for (const end of ends) {
      const x = share(end, span) * 100;
      picture.append(svg("line", { class: "threshold", x1: x, x2: x, y1: 1, y2: 15 }));
    }
    picture.append(svg("line", { class: "needle", x1: 0, x2: 0, y1: 0, y2: 16 }));
    return span;
  }

  // --- moments ---

  async stepTo(time) {
    this.asked += 1;
    const asked = this.asked;
    if (time === null) {
      this.moment = null;
      this.refresh();
      return;
    }
    // Dragging asks for many moments: one at a time, and the last one always.
    this.wanted = time;
    if (this.busy) return;
    this.busy = true;
    const answer = await this.ask("moment", { t: time }, { quiet: true });
    this.busy = false;
    if (this.wanted !== time && this.strip.time !== null) {
      this.stepTo(this.wanted);
      return;
    }
    if (asked !== this.asked && this.strip.time === null) return;
    if (answer.ok) {
      this.moment = answer.data;
      this.refresh();
    } else {
      showNoWhy(byId("why-text"), answer.message);
    }
  }

  refresh() {
    byId("panel-live").classList.toggle("past", this.moment !== null);
    this.render(new Set(["moment", "nodes"]));
  }

  jump() {
    const { view } = this.state.get("tree");
    if (!view) return;
    const [path] = this.acting ?? [];
    if (path !== undefined) this.tree.reveal(path);
  }

  // --- why ---

  showChosen(values) {
    const node = this.node;
    show(byId("why-node"), Boolean(node));
    if (!node) return;
    const value = isNumeric(node) ? read(node, values) : null;
    const words = isNumeric(node)
      ? `Now ${number(value)}: ${marginText(node, value)}`
      : node.feature === undefined ? "" : `Now ${readText(node, values)}`;
    setText(byId("why-node-text"), node.explanation);
    setText(byId("why-node-now"), sentence(words));
  }

  /** Shows from which demonstrations the branch of a node comes. */
  async branch(node) {
    this.node = node;
    byId("why-node-from").replaceChildren();
    const answer = await this.ask("branch", { path: node.path, robot: true }, { quiet: true });
    if (this.node === node) showBranch(byId("why-node-from"), answer, this.visit, (name) => this.state.demonstration(name));
  }

  async why(node) {
    if (node) this.branch(node);
    this.showChosen(this.scene.values);
    const given = this.strip.time === null ? {} : { t: this.strip.time };
    const answer = await this.ask("explain", given, { quiet: true });
    if (node) byId("why").scrollIntoView({ block: "nearest", behavior: calm() ? "auto" : "smooth" });
    if (answer.ok) showWhy(byId("why-text"), answer.data, this.visit, (name) => this.state.demonstration(name));
    else showNoWhy(byId("why-text"), answer.message);
  }
}
