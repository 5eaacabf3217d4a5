// Gamepads: each action has a button, which people may choose themselves.

const KEPT = "rebt_ros gamepad";
/** Names on most gamepads ("standard" mapping). */
const NAMES = ["A", "B", "X", "Y", "L1", "R1", "L2", "R2", "back", "start", "left stick", "right stick", "up", "down", "left", "right"];

/** Watches the buttons of all gamepads; the browser has no events for them. */
export class Gamepads {
  /** @param {{press: Function, release: Function, changed: Function}} handlers - Told what happens. */
  constructor(handlers) {
    this.handlers = handlers;
    this.labels = [];
    this.assigning = null;
    this.pressed = null;
    this.name = "";
    this.chosen = kept();
    addEventListener("gamepadconnected", () => this.watch());
    addEventListener("gamepaddisconnected", () => this.watch());
  }

  know(labels) {
    this.labels = labels;
  }

  /** Begins to ask for the button of an action; null: no more. */
  assign(label) {
    this.assigning = label;
  }

  buttonOf(label) {
    if (!this.name) return "";
    const button = this.place(label);
    return button === null ? "" : `gamepad ${NAMES[button] ?? button + 1}`;
  }

  place(label) {
    if (Number.isInteger(this.chosen[label])) return this.chosen[label];
    const taken = new Set(Object.values(this.chosen));
    const free = NAMES.map((_, button) => button).filter((button) => !taken.has(button));
    const rest = this.labels.filter((other) => !Number.isInteger(this.chosen[other]));
    return free[rest.indexOf(label)] ?? null;
  }

  watch() {
    const [pad] = this.there();
    this.name = pad ? pad.id.replace(/\s*\(.*\)/, "") || "gamepad" : "";
    if (!pad) this.let(null);
    this.handlers.changed();
    if (pad && !this.watching) {
      this.watching = true;
      this.look();
    }
  }

  there() {
    return (navigator.getGamepads?.() ?? []).filter((pad) => pad?.connected);
  }

  look() {
    const pads = this.there();
    if (!pads.length) {
      this.watching = false;
      return;
    }
    let down = null;
    for (const pad of pads) {
      const button = pad.buttons.findIndex((one) => one.pressed);
      if (button >= 0) down = button;
    }
    this.let(down);
    requestAnimationFrame(() => this.look());
  }

  let(button) {
    if (button === this.pressed) return;
    this.pressed = button;
    if (button === null) {
      this.handlers.release();
      return;
    }
    if (this.assigning !== null) {
      this.keep(button);
      return;
    }
    const label = this.labels.find((one) => this.place(one) === button);
    if (label === undefined) this.handlers.release();
    else this.handlers.press(label);
  }

  keep(button) {
    for (const [label, other] of Object.entries(this.chosen)) if (other === button) delete this.chosen[label];
    this.chosen[this.assigning] = button;
    try {
      localStorage.setItem(KEPT, JSON.stringify(this.chosen));
    } catch {
      // Without storage the choice lasts as long as the page.
    }
    this.assigning = this.labels[this.labels.indexOf(this.assigning) + 1] ?? null;
    this.handlers.changed();
  }
}

function kept() {
  try {
    const chosen = JSON.parse(localStorage.getItem(KEPT) ?? "{}");
    return chosen && typeof chosen === "object" ? chosen : {};
  } catch {
    return {};
  }
}
