// Sentences that come and go: what was done, what was refused, and how to take it back.

import { button, byId, element, setText } from "./dom.js";
import { sentence, withShortNames } from "./words.js";

const STAYS = 6000;
const STAYS_LONGER = 14000;
const MOST = 2;
/** A longer text (characters) is its first sentence, until somebody wants the rest. */
const LONG = 200;

/**
 * Says a sentence.
 *
 * @param {string} text - What to say.
 * @param {{bad?: boolean, undo?: Function, called?: Function}} [options] - Whether something was
 *   refused; what takes back what was done; what people call a recording.
 */
export function say(text, { bad = false, undo = null, called = undefined } = {}) {
  const words = sentence(withShortNames(text, called));
  if (!words) return;
  const region = byId("toasts");
  const toast = element("div", { class: bad ? "toast bad" : "toast" });
  const leave = () => toast.remove();
  const all = bad ? `Not done. ${words}` : words;
  const short = inShort(all);
  const shown = element("span", { class: "words" }, short);
  toast.append(element("span", { class: "sign", "aria-hidden": "true" }, bad ? "!" : "✓"), shown);
  if (short !== all) {
    const more = button("Say more", () => {
      setText(shown, all);
      more.remove();
      clearTimeout(leaving);
    });
    toast.append(more);
  }
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
  const leaving = setTimeout(leave, bad || undo || short !== all ? STAYS_LONGER : STAYS);
}

function inShort(text) {
  if (text.length <= LONG) return text;
  return /^.{30,}?[.](?=\s+[A-Z])/s.exec(text)?.[0] ?? text;
}
