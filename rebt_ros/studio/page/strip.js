// The last ten minutes as a strip: what the tree commanded, when a person took over.

import { fillOf, inkOf } from "./colors.js";
import { button, element, setAttribute, setText } from "./dom.js";
import { ago, clock, count } from "./words.js";

const SPANS = [60, 600];
const [ROW, GAP, AXIS, GUTTER] = [30, 4, 22, 62];
/** Of the words at a mark (pixels). */
const ROOM = 48;
const PERIOD = 500;
/** A person's command that nothing follows counts for so long (seconds). */
const TAKEOVER = 2;

/** The strip, with its buttons. */
export class Strip {
  /**
   * @param {Element} host - Where it is drawn.
   * @param {object} state - What the studio has told.
   * @param {(time: number | null) => void} choose - Told which moment was chosen; null: now.
   */
  constructor(host, state, choose) {
    this.state = state;
    this.choose = choose;
    this.span = SPANS[0];
    this.time = null;
    this.events = [];
    this.canvas = element("canvas", {
      class: "strip",
      tabindex: 0,
      role: "slider",
      "aria-label": "Moment of the last ten minutes",
      "aria-valuemin": -SPANS.at(-1),
      "aria-valuemax": 0,
      keydown: (event) => this.key(event),
      pointerdown: (event) => this.drag(event),
      pointermove: (event) => event.buttons && this.drag(event),
    });
    this.words = element("span", { class: "strip-words" });
    this.pause = button("Pause", () => this.go(this.time === null ? this.state.now() : null), {
      title: "The page stands still; the robot goes on",
    });
    this.spans = SPANS.map((span) => {
      const look = () => {
        this.span = span;
        this.draw();
      };
      return button(`${span / 60} min`, look, { title: `Shows the last ${count(span / 60, "minute")}` });
    });
    host.append(
      element(
        "div",
        { class: "tools" },
        this.pause,
        element(
          "span",
          { class: "group" },
          button("◀ Earlier", () => this.step(-1), { title: "Go to the change before" }),
          button("Later ▶", () => this.step(1), { title: "Go to the next change" }),
        ),
        this.words,
        element("span", { class: "group push" }, ...this.spans),
      ),
      this.canvas,
    );
    this.host = host;
    new ResizeObserver(() => this.draw()).observe(this.canvas);
    setInterval(() => {
      if (!document.hidden && this.canvas.offsetParent) this.draw();
    }, PERIOD);
  }

  /** Takes in what has changed on the timeline. */
  render() {
    this.events = Object.values(this.state.get("timeline")).sort((left, right) => left.t - right.t);
    this.draw();
  }

  /** Goes to a moment; null: back to now. */
  go(time) {
    const now = this.state.now();
    this.time = time === null ? null : Math.min(Math.max(time, now - SPANS.at(-1)), now);
    if (this.time !== null && this.time < now - this.span) this.span = SPANS.at(-1);
    this.draw();
    this.choose(this.time);
  }

  step(direction) {
    const from = this.time ?? this.state.now();
    // A little inside of the stretch that begins with the change.
    const times = this.events.filter((event) => event.kind !== "tree").map((event) => event.t + 0.05);
    const next =
      direction < 0 ? times.findLast((time) => time < from - 0.06) : times.find((time) => time > from + 0.06);
    if (next !== undefined) this.go(next);
    else if (direction > 0) this.go(null);
  }

  key(event) {
    const from = this.time ?? this.state.now();
    const small = event.shiftKey ? 10 : 1;
    const to = {
      ArrowLeft: from - small,
      ArrowDown: from - small,
      ArrowRight: from + small,
      ArrowUp: from + small,
      Home: this.state.now() - SPANS.at(-1),
    }[event.key];
    if (to !== undefined) this.go(to >= this.state.now() ? null : to);
    else if (event.key === "End") this.go(null);
    else if (event.key === "PageUp") this.step(-1);
    else if (event.key === "PageDown") this.step(1);
    else return;
    event.preventDefault();
  }

  drag(event) {
    const box = this.canvas.getBoundingClientRect();
    const share = (event.clientX - box.left - GUTTER) / (box.width - GUTTER);
    const now = this.end();
    this.go(now - this.span * (1 - Math.min(Math.max(share, 0), 1)));
  }

  /** The right end of the strip: it stands still while a moment is looked at. */
  end() {
    if (this.time === null) {
      this.stop = null;
      return this.state.now();
    }
    this.stop ??= this.state.now();
    return this.stop;
  }

  // --- drawing ---

  draw() {
    const { canvas } = this;
    const width = canvas.clientWidth;
    if (!width) return;
    const rows = this.rows();
    const height = rows.length * (ROW + GAP) + AXIS;
    const sharp = devicePixelRatio || 1;
    if (canvas.width !== Math.round(width * sharp) || canvas.height !== Math.round(height * sharp)) {
      canvas.width = Math.round(width * sharp);
      canvas.height = Math.round(height * sharp);
      canvas.style.height = `${height}px`;
    }
    const style = getComputedStyle(canvas);
    const [ink, faded, rest] = ["--ink", "--faded", "--well"].map((name) => style.getPropertyValue(name));
    const end = this.end();
    const start = end - this.span;
    const at = (time) => GUTTER + ((time - start) / this.span) * (width - GUTTER);
    const pen = canvas.getContext("2d");
    pen.setTransform(sharp, 0, 0, sharp, 0, 0);
    pen.clearRect(0, 0, width, height);
    pen.font = "600 13px system-ui, sans-serif";
    pen.textBaseline = "middle";
    rows.forEach((row, place) => {
      const y = place * (ROW + GAP);
      pen.fillStyle = faded;
      pen.fillText(row.name, 0, y + ROW / 2, GUTTER - 6);
      pen.fillStyle = rest;
      pen.fillRect(GUTTER, y, width - GUTTER, ROW);
      for (const { from, to, text } of row.stretches) {
        if (to < start || from > end) continue;
        const left = Math.max(at(from), GUTTER);
        const right = Math.min(at(to), width);
        pen.fillStyle = fillOf(text);
        pen.fillRect(left, y, Math.max(right - left, 1.5), ROW);
        if (row.person) hatch(pen, left, y, Math.max(right - left, 1.5));
        const words = this.state.shown(text);
        if (right - left > pen.measureText(words).width + 12) {
          pen.fillStyle = inkOf(text);
          pen.fillText(words, left + 6, y + ROW / 2);
        }
      }
      if (!row.stretches.some((stretch) => stretch.to >= start && stretch.from <= end)) {
        pen.fillStyle = faded;
        pen.fillText(row.empty, GUTTER + 8, y + ROW / 2);
      }
    });
    this.axis(pen, { end, at, faded, height, width });
    if (this.time !== null) {
      const x = at(this.time);
      pen.fillStyle = ink;
      pen.fillRect(x - 1.5, 0, 3, height - AXIS + 4);
      pen.beginPath();
      pen.moveTo(x - 8, height - AXIS + 12);
      pen.lineTo(x + 8, height - AXIS + 12);
      pen.lineTo(x, height - AXIS);
      pen.fill();
    }
    this.say();
  }

  axis(pen, { end, at, faded, height, width }) {
    let every = this.span > 60 ? 60 : 10;
    // Where there is little room, every second mark has words, or every fourth.
    while ((every / this.span) * (width - GUTTER) < ROOM) every *= 2;
    pen.fillStyle = faded;
    pen.font = "12px system-ui, sans-serif";
    for (let back = 0; back < this.span; back += every) {
      const x = at(end - back);
      if (x < GUTTER + 14) continue;
      const words = back === 0 ? (this.time === null ? "now" : clock(end)) : `−${back >= 60 ? `${back / 60} min` : `${back} s`}`;
      const size = pen.measureText(words).width;
      pen.fillText(words, Math.min(x - size / 2, width - size - 2), height - AXIS / 2 + 2);
    }
  }

  say() {
    const now = this.state.now();
    const paused = this.time !== null;
    setText(this.pause, paused ? "Back to now" : "Pause");
    this.pause.classList.toggle("primary", paused);
    const words = paused ? `${clock(this.time)} · ${ago(now - this.time)}` : "Live";
    setText(this.words, words);
    this.words.classList.toggle("paused", paused);
    setAttribute(this.canvas, "aria-valuenow", paused ? Math.round(this.time - now) : 0);
    setAttribute(this.canvas, "aria-valuetext", paused ? words : "now");
    this.spans.forEach((one, place) => setAttribute(one, "aria-pressed", String(SPANS[place] === this.span)));
  }

  /** For each channel what the tree and what a person commanded, from when until when. */
  rows() {
    const end = this.state.now();
    const trees = new Map();
    const persons = [];
    const close = (stretches, time) => {
      const last = stretches?.at(-1);
      if (last && last.to === null) last.to = time;
    };
    for (const { t, kind, text, channel } of this.events) {
      if (kind === "command") {
        if (!trees.has(channel)) trees.set(channel, []);
        close(trees.get(channel), t);
        close(persons, t);
        if (text) trees.get(channel).push({ from: t, to: null, text });
      } else if (kind === "person") {
        close(persons, t);
        for (const stretches of trees.values()) close(stretches, t);
        if (text && text !== "nothing") persons.push({ from: t, to: null, text });
      } else if (kind === "driving") {
        close(persons, t);
        if (text.includes("rest")) for (const stretches of trees.values()) close(stretches, t);
      }
    }
    const held = String(this.state.get("run").condition ?? "").startsWith("paused");
    const last = persons.at(-1);
    if (last && last.to === null) last.to = held ? end : Math.min(last.from + TAKEOVER, end);
    for (const stretches of trees.values()) close(stretches, end);
    const several = trees.size > 1;
    const rows = [...trees].sort().map(([channel, stretches]) => ({
      name: several ? channel : "tree",
      stretches,
      empty: "no command in this time",
    }));
    if (!rows.length) rows.push({ name: "tree", stretches: [], empty: "no command in this time" });
    rows.push({ name: "person", stretches: persons, person: true, empty: "nobody took over in this time" });
    return rows;
  }
}

/** What a person did is hatched: it differs from what the tree did without color, too. */
function hatch(pen, left, top, width) {
  pen.save();
  pen.beginPath();
  pen.rect(left, top, width, 5);
  pen.clip();
  pen.strokeStyle = "#000000";
  pen.lineWidth = 2;
  for (let x = left - 10; x < left + width + 10; x += 7) {
    pen.beginPath();
    pen.moveTo(x, top + 6);
    pen.lineTo(x + 7, top - 1);
    pen.stroke();
  }
  pen.restore();
}
