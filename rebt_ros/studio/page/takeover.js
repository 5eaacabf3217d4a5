// Driving by hand: a button is held down on the page, on the keyboard or on a gamepad, and its action
// is sent again and again until it is let go.

import { fillOf, inkOf } from "./colors.js";
import { byId, element, keyed, setAttribute, setText, show } from "./dom.js";
import { Gamepads } from "./gamepad.js";

const PERIOD = 200;
const DIGITS = "123456789";

/** The buttons for all actions. */
export class Takeover {
  constructor({ state, ask }) {
    this.state = state;
    this.ask = ask;
    this.held = null;
    this.timer = null;
    this.active = false;
    this.labels = [];
    this.added = new Set();
    this.gamepads = new Gamepads({
      press: (label) => this.active && this.hold(label, "gamepad"),
      release: () => this.letGo("gamepad"),
      changed: () => this.render(),
    });
    byId("gamepad-set").addEventListener("click", () => {
      this.gamepads.assign(this.gamepads.assigning === null ? (this.labels[0] ?? null) : null);
      this.render();
    });
    byId("hand-back").addEventListener("click", () => {
      this.letGo();
      ask("enable", { on: true });
    });
    byId("new-action").addEventListener("submit", (event) => {
      event.preventDefault();
      const field = byId("new-action-name");
      if (field.value.trim()) this.added.add(field.value.trim());
      field.value = "";
      this.render();
    });
    addEventListener("keydown", (event) => this.key(event));
    addEventListener("keyup", (event) => {
      if (event.key === this.heldKey) this.letGo("key");
    });
    addEventListener("blur", () => this.letGo());
    document.addEventListener("visibilitychange", () => document.hidden && this.letGo());
  }

  render() {
    const actions = this.state.get("actions");
    this.labels = [...new Set([...Object.keys(actions), ...this.added])].sort();
    this.gamepads.know(this.labels);
    setText(
      byId("takeover-hint"),
      this.labels.length
        ? "Hold a button down: the robot does it until you let go, and the tree waits meanwhile. The keys 1 to 9 work, too."
        : "No actions are known yet: write the name of one below, as the robot knows it, and hold its button down to drive.",
    );
    keyed(
      byId("takeover"),
      this.labels.map((label) => [label, null]),
      (label) => this.button(label),
      (child, _, label) => {
        const [name, hint] = child.children;
        setText(name, this.state.shown(label));
        const place = this.labels.indexOf(label);
        const digit = place < DIGITS.length ? `key ${DIGITS[place]}` : "";
        setText(hint, [digit, this.gamepads.buttonOf(label)].filter(Boolean).join(" · "));
        child.classList.toggle("assigning", this.gamepads.assigning === label);
        setAttribute(child, "aria-pressed", String(this.held === label));
      },
    );
    const { assigning } = this.gamepads;
    const words = assigning !== null
      ? `Press the gamepad button for “${this.state.shown(assigning)}”`
      : this.gamepads.name ? `Gamepad: ${this.gamepads.name}` : "A gamepad works, too: press any of its buttons.";
    setText(byId("gamepad"), words);
    setText(byId("gamepad-set"), assigning === null ? "Choose gamepad buttons" : "Keep them as they are");
    show(byId("gamepad-set"), Boolean(this.gamepads.name) && this.labels.length > 0);
    show(byId("hand-back"), this.state.get("nodes").executor?.there === true && Boolean(this.state.get("tree").view));
  }

  button(label) {
    const made = element(
      "button",
      {
        type: "button",
        class: "act",
        title: "Hold it: the robot does this until you let go",
        pointerdown: (event) => {
          if (event.button > 0) return;
          // The finger may slide off the button; only lifting it lets go.
          made.setPointerCapture(event.pointerId);
          this.hold(label, "pointer");
        },
        pointerup: () => this.letGo("pointer"),
        pointercancel: () => this.letGo("pointer"),
        lostpointercapture: () => this.letGo("pointer"),
        contextmenu: (event) => event.preventDefault(),
        keydown: (event) => {
          if (event.key !== " " && event.key !== "Enter") return;
          event.preventDefault();
          if (!event.repeat) this.holdKey(event.key, label);
        },
        blur: () => this.letGo("key"),
      },
      element("span", { class: "name" }),
      element("small"),
    );
    made.style.background = fillOf(label);
    made.style.color = inkOf(label);
    return made;
  }

  key(event) {
    if (!this.active || event.repeat || event.ctrlKey || event.altKey || event.metaKey) return;
    if (event.target.matches?.("input:not([type=range]), select, textarea")) return;
    const label = this.labels[DIGITS.indexOf(event.key)];
    if (label !== undefined && DIGITS.includes(event.key)) this.holdKey(event.key, label);
  }

  holdKey(key, label) {
    this.heldKey = key;
    this.hold(label, "key");
  }

  hold(label, by) {
    if (this.held === label) return;
    this.letGo();
    this.held = label;
    this.by = by;
    this.said = false;
    this.send();
    this.timer = setInterval(() => this.send(), PERIOD);
    this.mark();
  }

  async send() {
    const { held, said } = this;
    const answer = await this.ask("act", { label: held }, { quiet: true });
    if (answer.ok || this.held !== held || said) return;
    // Said once, not five times a second.
    this.said = true;
    this.refused?.(answer.message);
  }

  /** Ends what is held, by whatever or by one kind of device. */
  letGo(by = null) {
    if (this.held === null || (by !== null && by !== this.by)) return;
    clearInterval(this.timer);
    this.held = null;
    this.heldKey = null;
    this.mark();
  }

  mark() {
    for (const child of byId("takeover").children) {
      setAttribute(child, "aria-pressed", String(child.dataset.key === this.held));
    }
  }
}
