// Curate: choose suggestions, change the draft, publish it, and bring earlier trees back.

import { button, byId, element, keyed, setAttribute, setText, show } from "./dom.js";
import { Editor } from "./editor.js";
import { changedWords } from "./learn.js";
import { features } from "./margins.js";
import { Tree, treeTools } from "./tree.js";
import { clock, count, sentence } from "./words.js";

const RULE_WORDS = { true: "kept", false: "broken", null: "not known" };
const RULE_SIGNS = { true: "✓", false: "✕", null: "?" };

/** The section. */
export class Curate {
  sections = ["draft", "versions", "names", "actions", "nodes"];

  constructor({ state, ask, visit }) {
    this.state = state;
    this.ask = ask;
    this.visit = visit;
    this.editor = new Editor({ state, ask, visit });
    this.tree = new Tree(byId("curate-tree"), {
      label: "Your draft",
      choose: (node) => this.editor.show(node, this.tree.view, true),
      shown: (name) => state.shown(name),
    });
    byId("curate-tools").append(treeTools(this.tree));
    for (const verb of ["undo", "redo", "reset"]) byId(verb).addEventListener("click", () => ask(verb));
    byId("publish-form").addEventListener("submit", (event) => {
      event.preventDefault();
      this.publish();
    });
    addEventListener("keydown", (event) => this.key(event));
    this.editor.show(null, null);
  }

  key(event) {
    if (!(event.ctrlKey || event.metaKey) || event.altKey || byId("panel-curate").hidden) return;
    if (event.target.matches?.("input, textarea")) return;
    const letter = event.key.toLowerCase();
    const verb = letter === "y" || (letter === "z" && event.shiftKey) ? "redo" : letter === "z" ? "undo" : null;
    if (!verb) return;
    event.preventDefault();
    if (!byId(verb).disabled) this.ask(verb);
  }

  async publish() {
    byId("publish").disabled = true;
    const note = byId("publish-note").value.trim();
    const answer = await this.ask("publish", { note });
    if (answer.ok) byId("publish-note").value = "";
    this.state.touch(["draft"]);
  }

  render(changed) {
    const draft = this.state.get("draft");
    show(byId("curate-empty"), !draft.view);
    show(byId("curate-full"), Boolean(draft.view));
    if (draft.view && (changed.has("draft") || changed.has("names"))) this.draft(draft);
    if (draft.view && (changed.has("draft") || changed.has("names") || changed.has("actions"))) this.names();
    if (changed.has("versions")) this.versions();
    if (changed.has("nodes")) this.publishable(draft);
  }

  draft(draft) {
    const before = this.tree.view;
    this.tree.show(draft.view, this.state.get("names"));
    if (before !== draft.view || this.editor.node === null) {
      const path = this.tree.chosen;
      const node = path === null ? null : draft.view.nodes.find((one) => one.path === path);
      // Another node may stand at this place now.
      const same = node && this.editor.node && node.kind === this.editor.node.kind;
      if (!same) this.tree.choose(null);
      this.editor.show(same ? node : null, draft.view);
    }
    setText(byId("curate-summary"), draft.summary ?? "");
    for (const verb of ["undo", "redo"]) {
      const words = verb === "undo" ? "Undo" : "Redo";
      setText(byId(verb), draft[verb] ? `${words}: ${draft[verb]}` : `Nothing to ${verb}`);
      setAttribute(byId(verb), "title", draft[verb] ? `${words}: ${draft[verb]}` : `There is nothing to ${verb}`);
      byId(verb).disabled = !draft[verb];
    }
    byId("reset").disabled = !draft.undo;
    this.publishable(draft);
    setText(byId("changed"), changedWords(draft));
    const where = Object.entries(draft.changed?.demonstrations ?? {});
    keyed(
      byId("changed-demonstrations"),
      where,
      (name) => element("li", {}, button("", () => this.visit(name.replace(/\.rec$/, "")), { title: `Look at ${name}` })),
      (child, rows, name) => setText(child.firstElementChild, `${this.state.demonstration(name.replace(/\.rec$/, ""))}: ${count(rows, "row")}`),
    );
    keyed(
      byId("changed-words"),
      (draft.words ?? []).map((one) => [one, one]),
      () => element("li"),
      (child, one) => setText(child, sentence(one)),
    );
    this.rules(draft.rules ?? []);
    this.suggestions(draft.suggestions ?? []);
  }

  publishable(draft) {
    const learner = this.state.get("nodes").learner;
    const gone = learner && !learner.there;
    const words = draft.published
      ? "The robot follows this draft."
      : gone ? "To publish, the learner must run: it hands the tree to the robot." : "Not published: the robot does not have this draft yet.";
    setText(byId("curate-state"), words);
    byId("publish").disabled = draft.published === true || Boolean(gone);
  }

  rules(rules) {
    show(byId("rules-card"), rules.length > 0);
    keyed(
      byId("rules"),
      rules.map((rule) => [rule.rule, rule]),
      () => element("li", {}, element("b", { "aria-hidden": "true" }), element("strong"), element("span", { class: "verdict" }), element("p", { class: "hint" })),
      (child, rule) => {
        const [sign, text, verdict, sentenceOf] = child.children;
        setAttribute(child, "data-kept", rule.kept);
        setText(sign, RULE_SIGNS[rule.kept]);
        setText(text, rule.rule);
        setText(verdict, RULE_WORDS[rule.kept]);
        setText(sentenceOf, sentence(rule.sentence ?? ""));
      },
    );
  }

  suggestions(suggestions) {
    setText(
      byId("suggestions-hint"),
      suggestions.length
        ? "What was done again and again in the demonstrations, as branches that you can add to the tree."
        : "There are none: nothing was done often enough in the same order.",
    );
    keyed(
      byId("suggestions"),
      suggestions.map((one) => [one.id, one]),
      () => this.suggestion(),
      (child, one) => {
        const part = child.pieces;
        setText(part.title, one.heading);
        setAttribute(part.title, "title", one.id);
        setText(part.state, one.attached ? "✓ In the draft" : "");
        setText(part.toggle, one.attached ? "Take it out of the draft" : "Put it into the draft");
        setAttribute(part.toggle, "title", one.attached ? "Removes this branch from the draft" : "Adds this branch to the draft; the robot gets it once you publish");
        part.toggle.classList.toggle("primary", !one.attached);
        child.classList.toggle("attached", one.attached);
        child.suggestion = one;
        part.tree.options.label = one.heading;
        part.tree.show(one.view, this.state.get("names"));
      },
    );
  }

  suggestion() {
    const part = { title: element("h3"), state: element("span", { class: "state" }) };
    const host = element("div", { class: "tree-host low" });
    part.toggle = button("", () => {
      const { id, attached } = item.suggestion;
      this.ask(attached ? "detach" : "attach", { suggestion: id }, { undo: () => this.ask("undo") });
    });
    const item = element("li", {}, element("div", { class: "tools" }, part.title, part.state), host, part.toggle);
    part.tree = new Tree(host, { label: "A suggestion", still: true, shown: (name) => this.state.shown(name) });
    item.pieces = part;
    return item;
  }

  names() {
    const { view } = this.state.get("draft");
    const named = view.nodes.flatMap(features);
    const labels = new Set(Object.keys(this.state.get("actions")));
    const all = [...labels, ...named.filter((one) => !labels.has(one))];
    keyed(
      byId("names"),
      [...new Set(all)].sort().map((name) => [name, labels.has(name)]),
      (name) => {
        const field = element("input", {
          type: "text",
          maxlength: 200,
          "aria-label": `Name for ${name}`,
          change: () => this.ask("rename", { name, shown: field.value }),
        });
        return element("li", {}, element("label", {}, element("span", {}, name), field));
      },
      (child, _, name) => {
        const field = child.querySelector("input");
        const names = this.state.get("names");
        setAttribute(field, "placeholder", name);
        if (document.activeElement !== field) field.value = Object.hasOwn(names, name) ? names[name] : "";
      },
    );
  }

  versions() {
    const versions = Object.entries(this.state.get("versions")).sort().reverse();
    setText(
      byId("versions-hint"),
      versions.length ? "Every tree that was published. Each can be brought back." : "Nothing has been published yet. Each tree that you publish is kept here.",
    );
    keyed(
      byId("versions"),
      versions,
      (number) => {
        const back = button("Bring it back", () => this.ask("restore", { version: number }), { title: "Publishes this tree to the robot again" });
        return element("li", {}, element("strong"), element("span", { class: "what" }), element("span", { class: "hint" }), back);
      },
      (child, version, key) => {
        const [title, what, about, back] = child.children;
        setText(title, `Version ${Number(key)}`);
        setText(what, version.what ?? "");
        const size = version.nodes ? ` · ${count(version.nodes, "node")}` : "";
        setText(about, `${clock(version.when)} · ${version.who}${size}`);
        child.classList.toggle("current", version.current === true);
        setText(back, version.current ? "✓ On the robot" : "Bring it back");
        back.disabled = version.current === true;
      },
    );
  }
}
