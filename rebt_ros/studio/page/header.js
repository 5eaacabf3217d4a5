// What is above all sections: who is there, and the button that stops the tree.

import { byId, element, keyed, setAttribute, setText, show } from "./dom.js";
import { sentence } from "./words.js";

const SIGNS = { OK: "●", WARN: "▲", ERROR: "■", GONE: "○" };
const WORDS = { OK: "fine", WARN: "look here", ERROR: "in trouble", GONE: "not running" };

/** The head of the page. */
export class Header {
  sections = ["nodes", "run", "tree"];

  constructor({ state, ask }) {
    this.state = state;
    byId("stop").addEventListener("click", () => ask("enable", { on: false }));
    byId("start").addEventListener("click", () => ask("enable", { on: true }));
  }

  render() {
    const { nodes, run, tree } = this.state.sections;
    const roles = ["executor", "recorder", "learner"].filter((role) => nodes[role]);
    keyed(
      byId("health"),
      roles.map((role) => [role, nodes[role]]),
      (role) => {
        const sign = element("span", { class: "sign", "aria-hidden": "true" });
        return element("li", {}, sign, element("span", {}, role), element("span", { class: "state" }));
      },
      (child, node) => {
        const level = node.there ? node.level : "GONE";
        setAttribute(child, "data-level", level);
        setAttribute(child, "title", sentence(node.message));
        setText(child.children[0], SIGNS[level] ?? "?");
        setText(child.children[2], WORDS[level] ?? level);
      },
    );
    const isThere = nodes.executor?.there === true;
    const rests = run.condition === "disabled" || nodes.executor?.values?.enabled === "False";
    show(byId("stop"), isThere && !rests);
    show(byId("start"), isThere && rests);
    byId("start").disabled = !tree.view;
    setAttribute(byId("start"), "title", tree.view ? "The robot begins to follow its tree" : "There is no tree yet");
  }

  /** Says how the connection is. */
  connection(state) {
    const words = {
      open: "",
      lost: "The studio cannot be reached. What you see may be old; the page connects again by itself.",
      refused: "The studio was started again with another token: open the address that it printed.",
    }[state];
    setText(byId("banner"), words ?? "");
    show(byId("banner"), Boolean(words));
    document.body.classList.toggle("offline", state !== "open");
  }
}
