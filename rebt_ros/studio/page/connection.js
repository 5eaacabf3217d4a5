// The WebSocket to the studio: comes back by itself, and matches answers to requests.

const FIRST_PAUSE = 250;
const LONGEST_PAUSE = 3000;
/** Without a message for so long (ms), the page asks whether the studio is still there. */
const SILENCE = 15000;
const PATIENCE = 5000;

const LOST = "The studio cannot be reached, so nothing was done. The page connects again by itself.";

/** Keeps a connection open for as long as the page is. */
export class Connection {
  /**
   * @param {{snapshot: Function, changes: Function, state: Function}} handlers - Told what comes in;
   *   the state is "open", "lost" or "refused".
   */
  constructor(handlers) {
    this.handlers = handlers;
    this.socket = null;
    this.pause = FIRST_PAUSE;
    this.number = 0;
    this.waiting = new Map();
    this.timer = null;
    this.silence = null;
    // A tablet that was asleep, or out of reach, need not wait for the next try.
    addEventListener("online", () => this.hurry());
    document.addEventListener("visibilitychange", () => {
      if (!document.hidden) this.hurry();
    });
  }

  get isOpen() {
    return this.socket?.readyState === WebSocket.OPEN;
  }

  open() {
    const scheme = location.protocol === "https:" ? "wss" : "ws";
    const socket = new WebSocket(`${scheme}://${location.host}/live`);
    this.socket = socket;
    socket.addEventListener("message", (event) => this.take(event));
    socket.addEventListener("close", () => {
      if (this.socket === socket) this.lost();
    });
  }

  /**
   * Asks for something.
   *
   * @returns {Promise<{ok: boolean, message: string, data: any}>} Never rejected.
   */
  ask(verb, given = {}) {
    if (!this.isOpen) return Promise.resolve({ ok: false, message: LOST, data: null });
    this.number += 1;
    const id = this.number;
    this.socket.send(JSON.stringify({ id, do: verb, ...given }));
    return new Promise((resolve) => this.waiting.set(id, resolve));
  }

  take(event) {
    this.listen();
    const frame = JSON.parse(event.data);
    if (frame.snapshot) {
      this.pause = FIRST_PAUSE;
      this.handlers.snapshot(frame.snapshot, frame.now);
      this.handlers.state("open");
    } else if (frame.changes) {
      this.handlers.changes(frame.changes);
    } else if (this.waiting.has(frame.answer)) {
      const resolve = this.waiting.get(frame.answer);
      this.waiting.delete(frame.answer);
      resolve({ ok: frame.ok, message: frame.message, data: frame.data });
    }
  }

  /** Notices a network that has fallen silent, which no event tells. */
  listen() {
    clearTimeout(this.silence);
    this.silence = setTimeout(() => {
      if (!this.isOpen) return;
      this.ask("ping");
      this.silence = setTimeout(() => this.drop(), PATIENCE);
    }, SILENCE);
  }

  drop() {
    const socket = this.socket;
    if (!socket) return;
    socket.close();
    this.lost();
  }

  lost() {
    this.socket = null;
    clearTimeout(this.silence);
    for (const resolve of this.waiting.values()) {
      resolve({ ok: false, message: "The connection broke before the studio answered.", data: null });
    }
    this.waiting.clear();
    this.handlers.state("lost");
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.again(), this.pause);
    this.pause = Math.min(this.pause * 1.6, LONGEST_PAUSE);
  }

  hurry() {
    if (this.socket || this.timer === null) return;
    clearTimeout(this.timer);
    this.pause = FIRST_PAUSE;
    this.again();
  }

  /** A studio that was started again has another token: asking for its page gives us the new one. */
  async again() {
    this.timer = null;
    try {
      const answer = await fetch("/", { cache: "no-store", credentials: "same-origin" });
      if (answer.ok) {
        if (!this.socket) this.open();
        return;
      }
      this.lost();
      if (answer.status === 403) this.handlers.state("refused");
    } catch {
      this.lost();
    }
  }
}
