// The sections of the page as tabs: arrow keys go from one to the next.

import { byId, show } from "./dom.js";

/** Shows one section at a time. */
export class Tabs {
  /** @param {(name: string) => void} changed - Told which section is shown. */
  constructor(changed) {
    this.changed = changed;
    this.tabs = [...document.querySelectorAll('[role="tab"]')];
    for (const tab of this.tabs) {
      tab.addEventListener("click", () => this.choose(tab.dataset.tab));
      tab.addEventListener("keydown", (event) => this.key(event));
    }
    addEventListener("hashchange", () => this.choose(location.hash.slice(1)));
    this.chosen = "";
    this.choose(location.hash.slice(1) || "live");
  }

  choose(name) {
    if (!this.tabs.some((tab) => tab.dataset.tab === name)) return;
    this.chosen = name;
    for (const tab of this.tabs) {
      const here = tab.dataset.tab === name;
      tab.setAttribute("aria-selected", String(here));
      tab.tabIndex = here ? 0 : -1;
      show(byId(tab.getAttribute("aria-controls")), here);
    }
    if (location.hash.slice(1) !== name) history.replaceState(null, "", `#${name}`);
    this.changed(name);
  }

  key(event) {
    const place = this.tabs.indexOf(event.currentTarget);
    const last = this.tabs.length - 1;
    const to = {
      ArrowRight: place === last ? 0 : place + 1,
      ArrowLeft: place === 0 ? last : place - 1,
      Home: 0,
      End: last,
    }[event.key];
    if (to === undefined) return;
    event.preventDefault();
    this.tabs[to].focus();
    this.choose(this.tabs[to].dataset.tab);
  }
}
