// Learn: make a tree of the demonstrations, and choose its size.

import { drawLevels, driveWords } from "./chart.js";
import { fillOf } from "./colors.js";
import { byId, element, keyed, setAttribute, setText, show } from "./dom.js";
import { say } from "./toasts.js";
import { Tree } from "./tree.js";
import { count, percent, sentence } from "./words.js";

/** The section. */
export class Learn {
  sections = ["nodes", "demonstrations", "learning", "draft", "tree", "names", "versions"];

  constructor({ state, ask }) {
    this.state = state;
    this.ask = ask;
    const shown = (name) => state.shown(name);
    this.published = new Tree(byId("learn-published"), { label: "The robot's tree now", shown });
    this.draft = new Tree(byId("learn-draft"), { label: "Your draft", shown });
    this.asked = false;
    byId("learn").addEventListener("click", () => this.learn());
    byId("learn-cancel").addEventListener("click", () => ask("cancel"));
    byId("learn-rollback").addEventListener("click", () => ask("rollback"));
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.chart());
  }

  async learn() {
    this.asked = true;
    this.progress();
    await this.ask("learn");
    this.asked = false;
    this.progress();
  }

  render(changed) {
    if (["nodes", "demonstrations", "learning", "versions"].some((one) => changed.has(one))) this.progress();
    const learning = this.state.get("learning");
    const draft = this.state.get("draft");
    const hasLevels = (learning.levels ?? []).length > 0;
    show(byId("learn-full"), hasLevels);
    if (changed.has("learning") || changed.has("names")) {
      const problems = [learning.problem, ...(learning.notes ?? [])].filter(Boolean);
      keyed(
        byId("learn-problems"),
        problems.map((one) => [one, one]),
        () => element("li"),
        (child, one) => setText(child, sentence(one)),
      );
      show(byId("learn-problems"), problems.length > 0);
      if (hasLevels) {
        this.chart();
        this.levels(learning);
        this.recalls(learning);
      }
    }
    if (hasLevels) this.compare(draft);
  }

  // --- learning ---

  progress() {
    const node = this.state.get("nodes").learner;
    const isThere = node?.there === true;
    const stage = node?.values?.stage ?? "idle";
    const share = Number(node?.values?.["progress (%)"] ?? 0);
    const works = isThere && (stage !== "idle" || this.asked);
    const kept = Object.values(this.state.get("demonstrations")).filter((one) => one.kept && !one.deleted);
    const rows = kept.reduce((sum, one) => sum + one.rows, 0);
    byId("learn").disabled = !isThere || works || !rows;
    setText(byId("learn"), kept.length ? `Learn from ${count(kept.length, "demonstration")}` : "Learn");
    let words = `${count(rows, "row")} of ${count(kept.length, "demonstration")} are learned from. The new tree is published to the robot.`;
    if (!isThere) words = node ? sentence(node.message) : "The learner is not running.";
    else if (!rows) words = "There is nothing to learn from yet: go to Teach and show the robot what to do.";
    setText(byId("learn-from"), words);
    show(byId("learn-cancel"), works);
    const earlier = Object.keys(this.state.get("versions")).length > 1;
    byId("learn-rollback").disabled = !isThere || works || !earlier;
    const awaited = !works && this.state.get("learning").awaited === true;
    show(byId("learn-progress"), works || awaited);
    if (awaited) {
      byId("learn-bar").removeAttribute("value");
      setText(byId("learn-stage"), "The tree is learned; its sizes are being prepared…");
    }
    if (works) {
      byId("learn-bar").value = stage === "idle" ? 0 : share;
      setText(byId("learn-stage"), stage === "idle" ? "Starting…" : `${sentence(stage)} ${share}%`);
    }
  }

  // --- the size ---

  choose(number) {
    if (number === this.state.get("learning").level) return;
    this.ask("level", { number }, { undo: () => this.ask("undo") });
  }

  chart() {
    const { levels, level } = this.state.get("learning");
    const host = byId("learn-chart");
    if (!levels?.some((one) => one.agreement !== null || one.drove)) {
      host.classList.remove("js-plotly-plot");
      host.replaceChildren(
        element("p", { class: "hint" }, "With several demonstrations, a chart appears here: how often each size does what was shown."),
      );
      return;
    }
    if (!host.classList.contains("js-plotly-plot")) {
      host.replaceChildren(element("p", { class: "hint drawing" }, "Drawing the chart…"));
    }
    drawLevels(host, levels, level, (number) => this.choose(number)).catch((error) => say(error.message, { bad: true }));
  }

  levels(learning) {
    const sorted = [...learning.levels].sort((left, right) => left.leaves - right.leaves);
    keyed(
      byId("learn-levels"),
      sorted.map((level) => [String(level.number), level]),
      (key) => this.level(Number(key)),
      (child, level) => {
        const [input, name, figures] = child.children;
        input.checked = level.number === learning.level;
        const size = `${count(level.leaves, "leaf", "leaves")}${level.nodes ? `, ${count(level.nodes, "node")}` : ""}`;
        const marks = [level.chosen ? "recommended" : "", level.best ? "most agreement" : ""].filter(Boolean);
        setText(name, size);
        const does = level.agreement === null ? "" : `agreement ${percent(level.agreement)}, recall ${percent(level.recall)}`;
        setText(figures, [does, level.drove ? driveWords(level.drove) : "", ...marks].filter(Boolean).join(" · "));
      },
    );
  }

  level(number) {
    const input = element("input", { type: "radio", name: "level", change: () => this.choose(number) });
    return element("label", {}, input, element("strong"), element("small"));
  }

  recalls(learning) {
    const never = new Set(learning.never ?? []);
    const recalls = Object.entries(learning.recalls ?? {});
    for (const label of never) if (!recalls.some(([other]) => other === label)) recalls.push([label, null]);
    recalls.sort((left, right) => (left[1] ?? -1) - (right[1] ?? -1));
    setText(
      byId("learn-recall-hint"),
      `How often the tree does what you did, for each action. Always doing the most common one would be right in ${percent(learning.baseline)} of all rows.`,
    );
    keyed(
      byId("learn-recalls"),
      recalls,
      () => element("li", {}, element("span", { class: "name" }), element("span", { class: "gauge", "aria-hidden": "true" }, element("span")), element("strong"), element("span", { class: "flag" })),
      (child, recall, label) => {
        const [name, gauge, words, flag] = child.children;
        setText(name, this.state.shown(label));
        gauge.firstElementChild.style.width = `${(recall ?? 0) * 100}%`;
        gauge.firstElementChild.style.background = fillOf(label);
        setText(words, percent(recall));
        child.classList.toggle("never", never.has(label));
        setText(flag, never.has(label) ? "▲ You showed it, but the tree never does it: show it more often, or choose a larger tree." : "");
      },
    );
  }

  // --- the difference ---

  compare(draft) {
    const tree = this.state.get("tree");
    const names = this.state.get("names");
    if (draft.view) this.draft.show(draft.view, names);
    if (tree.view) this.published.show(tree.view, names);
    // The same tree twice would only leave each less room.
    show(byId("learn-draft-side"), !draft.published);
    byId("learn-compare").classList.toggle("even", !draft.published);
    setText(byId("learn-draft-summary"), draft.summary ?? "");
    setText(byId("learn-published-summary"), tree.summary ?? "No tree is published yet.");
    setText(byId("learn-changed"), changedWords(draft));
    keyed(
      byId("learn-words"),
      (draft.words ?? []).map((one) => [one, one]),
      () => element("li"),
      (child, one) => setText(child, sentence(one)),
    );
    setAttribute(byId("learn-words"), "hidden", draft.words?.length ? null : "");
  }
}

/** How much of what was shown the draft would do in another way than the robot's tree. */
export function changedWords(draft) {
  if (!draft.view) return "";
  if (draft.published) return "The robot follows this tree.";
  const { changed } = draft;
  if (!changed) return "There is no published tree to compare with, or it reads other values.";
  if (!changed.rows) return `The draft does the same as the robot's tree in all ${count(changed.of, "row")} that were shown.`;
  return `The draft acts differently from the robot's tree in ${changed.rows.toLocaleString("en")} of ${count(changed.of, "row")} (${percent(changed.rows / changed.of)}).`;
}
