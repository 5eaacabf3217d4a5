// Sentences that come and go: what was done, what was refused, and how to take it back.

import { button, byId, element } from "./dom.js";
import { sentence } from "./words.js";

const STAYS = 6000;
const STAYS_LONGER = 14000;
const MOST = 2;

/**
 * Says a sentence.
 *
 * @param {string} text - What to say.
 * @param {{bad?: boolean, undo?: Function}} [options] - Whether something was refused; what takes
 *   back what was done.
 */
export function say(text, { bad = false, undo = null } = {}) {
  const words = sentence(text);
  if (!words) return;
  const region = byId("toasts");
  const toast = element("div", { class: bad ? "toast bad" : "toast" });
  const leave = () => toast.remove();
  toast.append(
    element("span", { class: "sign", "aria-hidden": "true" }, bad ? "!" : "✓"),
    element("span", { class: "words" }, bad ? `Not done. ${words}` : words),
  );
  if (undo) {
    const takeBack = () => {
      leave();
      undo();
    };
    toast.append(button("Undo", takeBack));
  }
  toast.append(button("✕", leave, { class: "quiet", "aria-label": "Close this message" }));
  region.append(toast);
  while (region.children.length > MOST) region.firstElementChild.remove();
  setTimeout(leave, bad || undo ? STAYS_LONGER : STAYS);
}
