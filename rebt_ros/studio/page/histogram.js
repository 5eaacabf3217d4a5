// A threshold on the histogram of its feature: dragged, typed, or moved with the arrow keys.

import { chip } from "./thumbnail.js";
import { button, element, setAttribute, setText, svg } from "./dom.js";
import { fillOf } from "./colors.js";
import { number } from "./words.js";

const [WIDTH, HEIGHT, AXIS] = [520, 170, 20];

/** The histogram of one condition, with a handle for each of its thresholds. */
export class Histogram {
  /**
   * @param {{edges: number[], counts: object}} data - Rows of each action over the values.
   * @param {object} node - The condition.
   * @param {(value: number, end: string) => void} change - Told the new threshold.
   * @param {(name: string) => string} shown - Names for people.
   */
  constructor(data, node, change, shown) {
    this.data = data;
    this.change = change;
    const ends = ["above", "at_most"].filter((end) => node[end] !== null);
    const values = [...data.edges, ...ends.map((end) => node[end])];
    [this.low, this.high] = [Math.min(...values), Math.max(...values)];
    if (this.high === this.low) this.high = this.low + 1;
    this.picture = svg("svg", { class: "histogram", viewBox: `0 0 ${WIDTH} ${HEIGHT + AXIS}` });
    this.bars();
    this.element = element(
      "div",
      {},
      this.picture,
      element("ul", { class: "legend" }, ...Object.keys(data.counts).map((label) => chip(label, shown(label)))),
      ...ends.map((end) => this.handle(node, end, ends.length > 1)),
    );
  }

  x(value) {
    return ((value - this.low) / (this.high - this.low)) * WIDTH;
  }

  bars() {
    const { edges, counts } = this.data;
    const bins = edges.length - 1;
    const totals = Array.from({ length: bins }, (_, bin) =>
      Object.values(counts).reduce((sum, one) => sum + one[bin], 0),
    );
    const most = Math.max(...totals, 1);
    for (let bin = 0; bin < bins; bin += 1) {
      let y = HEIGHT;
      for (const [label, one] of Object.entries(counts)) {
        // Rare actions are what thresholds are about: a root makes them visible beside common ones.
        if (!one[bin]) continue;
        const height = Math.max((one[bin] / totals[bin]) * Math.sqrt(totals[bin] / most) * (HEIGHT - 8), 1.5);
        y -= height;
        const x = this.x(edges[bin]);
        const width = Math.max(this.x(edges[bin + 1]) - x - 1, 1);
        this.picture.append(
          svg("rect", { x: x.toFixed(1), y: y.toFixed(1), width: width.toFixed(1), height: height.toFixed(1), fill: fillOf(label) }),
        );
      }
    }
    this.picture.append(
      svg("line", { class: "axis", x1: 0, x2: WIDTH, y1: HEIGHT + 0.5, y2: HEIGHT + 0.5 }),
      svg("text", { x: 2, y: HEIGHT + 15 }, number(this.low)),
      svg("text", { x: WIDTH - 2, y: HEIGHT + 15, "text-anchor": "end" }, number(this.high)),
    );
  }

  handle(node, end, several) {
    const before = node[end];
    const step = (this.high - this.low) / 200;
    let value = before;
    const line = svg("line", { class: "threshold", y1: 0, y2: HEIGHT });
    const knob = svg("circle", { class: "knob", cy: 14, r: 11 });
    const grip = svg("rect", { class: "grip", y: 0, width: 44, height: HEIGHT });
    const label = several ? (end === "above" ? "Lower threshold" : "Upper threshold") : "Threshold";
    const group = svg(
      "g",
      {
        class: "handle",
        tabindex: 0,
        role: "slider",
        "aria-label": label,
        "aria-valuemin": this.low,
        "aria-valuemax": this.high,
        keydown: (event) => key(event),
        pointerdown: (event) => group.setPointerCapture(event.pointerId),
        pointermove: (event) => group.hasPointerCapture(event.pointerId) && set(this.at(event)),
      },
      grip,
      line,
      knob,
    );
    const field = element("input", {
      type: "number",
      step: "any",
      "aria-label": label,
      input: () => field.value !== "" && set(Number(field.value), true),
    });
    const apply = button("", () => this.change(value, end), {
      class: "primary",
      title: "Changes the draft; the robot gets it once you publish",
    });
    const back = button("Put it back", () => set(before), { title: "The threshold is where it was" });
    const set = (to, typed = false) => {
      value = typed ? to : Number(to.toPrecision(4));
      const x = this.x(Math.min(Math.max(value, this.low), this.high));
      setAttribute(line, "x1", x);
      setAttribute(line, "x2", x);
      setAttribute(knob, "cx", x);
      setAttribute(grip, "x", x - 22);
      setAttribute(group, "aria-valuenow", value);
      setAttribute(group, "aria-valuetext", number(value));
      if (!typed) field.value = String(value);
      setText(apply, value === before ? "Drag to change" : `Change it to ${number(value)}`);
      apply.disabled = value === before;
      back.disabled = value === before;
    };
    const key = (event) => {
      const many = event.shiftKey ? 10 : 1;
      const to = {
        ArrowLeft: value - step * many,
        ArrowDown: value - step * many,
        ArrowRight: value + step * many,
        ArrowUp: value + step * many,
        Home: this.low,
        End: this.high,
      }[event.key];
      if (to !== undefined) set(Math.min(Math.max(to, this.low), this.high));
      else if (event.key === "Enter" && value !== before) this.change(value, end);
      else return;
      event.preventDefault();
    };
    this.picture.append(group);
    set(before, true);
    field.value = String(before);
    return element("div", { class: "tools" }, element("label", {}, `${label} `, field), apply, back);
  }

  at(event) {
    const box = this.picture.getBoundingClientRect();
    const share = Math.min(Math.max((event.clientX - box.left) / box.width, 0), 1);
    return this.low + share * (this.high - this.low);
  }
}
