// The list of demonstrations: look at them, leave them out, trim, split and delete them.

import { button, byId, element, keyed, setAttribute, setText, show } from "./dom.js";
import { chip, thumbnail } from "./thumbnail.js";
import { count, duration, sentence } from "./words.js";

const ORIGINS = { takeover: "takeover", failed: "correction", correction: "correction" };

/** The list. */
export class Demonstrations {
  constructor({ state, ask, visit }) {
    this.state = state;
    this.ask = ask;
    this.visit = visit;
    this.open = new Map();
  }

  render() {
    const all = Object.entries(this.state.get("demonstrations"));
    const there = all.filter(([, one]) => !one.deleted);
    const kept = there.filter(([, one]) => one.kept);
    const rows = kept.reduce((sum, [, one]) => sum + one.rows, 0);
    setText(
      byId("demonstrations-summary"),
      all.length
        ? `${count(kept.length, "demonstration")} to learn from, ${count(rows, "row")}${there.length > kept.length ? `; ${there.length - kept.length} left out` : ""}`
        : "There are none yet: press “Start recording” above, and drive the robot through the task.",
    );
    all.sort((left, right) => right[1].start - left[1].start || (left[0] < right[0] ? 1 : -1));
    keyed(byId("demonstrations"), all, (name) => this.item(name), (child, shown, name) => this.update(child, shown, name));
  }

  item(name) {
    const part = {
      title: element("h3"),
      about: element("p", { class: "hint" }),
      chips: element("div", { class: "chips" }),
      notes: element("p", { class: "note" }),
      picture: element("button", { type: "button", class: "picture", click: () => this.visit(name) }),
      buttons: element("div", { class: "buttons" }),
      editor: element("div", { class: "editor" }),
    };
    const item = element(
      "li",
      { class: "demonstration" },
      part.picture,
      element("div", { class: "text" }, part.title, part.about, part.chips, part.notes, part.buttons),
      part.editor,
    );
    item.pieces = part;
    const { ask } = this;
    const restore = () => ask("restore_demonstration", { name });
    part.take = button("Leave out", () => {
      const { kept } = this.state.get("demonstrations")[name] ?? {};
      const back = () => ask(kept ? "take_in" : "leave_out", { name });
      ask(kept ? "leave_out" : "take_in", { name }, { undo: back });
    });
    part.trim = button("Trim ends", () => this.edit(item, name, "trim"), {
      "aria-expanded": "false",
      title: "Shows where to cut off its beginning and its end",
    });
    part.split = button("Split in two", () => this.edit(item, name, "split"), {
      "aria-expanded": "false",
      title: "Shows where to make two demonstrations of it",
    });
    part.remove = button("Delete", () => ask("delete", { name }, { undo: restore }), {
      title: "Deletes it; for ten minutes it can be restored",
    });
    part.back = button("Undo delete", restore, { class: "primary", title: "Restores it as it was" });
    part.buttons.append(part.take, part.trim, part.split, part.remove, part.back);
    return item;
  }

  update(item, shown, name) {
    const part = item.pieces;
    const display = (one) => this.state.shown(one);
    const kind = ORIGINS[shown.origin];
    item.classList.toggle("left-out", !shown.kept);
    setText(part.title, `${this.state.demonstration(name)}${kind ? ` · ${kind}` : ""}`);
    const how = shown.deleted ? " · deleted, goes soon" : shown.kept ? "" : " · left out";
    setText(part.about, `${duration(shown.seconds)} · ${count(shown.rows, "row")}${how}`);
    setAttribute(part.picture, "aria-label", `Look inside ${part.title.textContent}`);
    setAttribute(part.picture, "title", `Look inside ${name}`);
    setText(part.notes, (shown.notes ?? []).map(sentence).join(" "));
    setText(part.take, shown.kept ? "Leave out" : "Take in again");
    setAttribute(part.take, "title", shown.kept ? "Nothing is learned from it; it is kept" : "It is learned from again");
    show(part.notes, Boolean(shown.notes?.length));
    for (const one of [part.trim, part.split]) one.disabled = shown.rows < 2;
    for (const one of [part.take, part.trim, part.split, part.remove]) show(one, !shown.deleted);
    show(part.back, shown.deleted);
    if (shown.deleted) this.close(item);
    keyed(
      part.chips,
      Object.entries(shown.actions ?? {}),
      (label) => chip(label, "", "span"),
      (child, amount, label) => setText(child, `${display(label)} ${amount}`),
    );
    const drawn = JSON.stringify([shown.series, shown.bands, shown.seconds, Object.keys(shown.actions ?? {}).map(display)]);
    if (item.drawn !== drawn) {
      item.drawn = drawn;
      part.picture.replaceChildren(thumbnail(shown, display));
    }
  }

  close(item) {
    item.pieces.editor.replaceChildren();
    item.mode = null;
    setAttribute(item.pieces.trim, "aria-expanded", "false");
    setAttribute(item.pieces.split, "aria-expanded", "false");
  }

  /** Opens the sliders for cutting; they lie under a large picture. */
  edit(item, name, mode) {
    const again = item.mode === mode;
    this.close(item);
    if (again) return;
    item.mode = mode;
    setAttribute(item.pieces[mode], "aria-expanded", "true");
    const shown = this.state.get("demonstrations")[name];
    const picture = thumbnail(shown, (one) => this.state.shown(one), { large: true });
    const shades = [element("span", { class: "shade" }), element("span", { class: "shade" })];
    const frame = element("div", { class: "cut" }, picture.firstElementChild, ...shades);
    const slider = (label, value, input) => {
      const range = element("input", { type: "range", min: 0, max: shown.seconds, step: shown.seconds / 500 || 1, "aria-label": label, input });
      range.value = value;
      return range;
    };
    const does = button("", () => act(), { class: "primary", title: "The whole one can be restored for ten minutes" });
    let act;
    if (mode === "trim") {
      const [from, to] = [slider("From", 0, () => look()), slider("To", shown.seconds, () => look())];
      const look = () => {
        const [first, last] = [Number(from.value), Number(to.value)];
        shades[0].style.width = `${(first / shown.seconds) * 100}%`;
        shades[1].style.left = `${(last / shown.seconds) * 100}%`;
        setText(does, `Keep only ${duration(first)} to ${duration(last)}`);
        does.disabled = last <= first || (first === 0 && last >= shown.seconds);
      };
      act = () => this.cut(item, "trim", { name, from: Number(from.value), to: Number(to.value) });
      item.pieces.editor.append(frame, element("label", {}, "Begin at", from), element("label", {}, "End at", to), does);
      look();
    } else {
      const at = slider("Split at", shown.seconds / 2, () => look());
      const look = () => {
        shades[0].style.width = `${(Number(at.value) / shown.seconds) * 100}%`;
        shades[1].hidden = true;
        setText(does, `Make two of it, at ${duration(Number(at.value))}`);
      };
      act = () => this.cut(item, "split", { name, at: Number(at.value) });
      item.pieces.editor.append(frame, element("label", {}, "Split at", at), does);
      look();
    }
  }

  async cut(item, verb, given) {
    const undo = () => this.ask("restore_demonstration", { name: given.name });
    const answer = await this.ask(verb, given, { undo });
    if (answer.ok) this.close(item);
  }
}
