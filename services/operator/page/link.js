// The connection to the robot: one WebSocket, opened again when it is lost.

const RETRY_MS = [250, 500, 1000, 2000, 4000];
const SILENCE_MS = 3000;

/** Calls `hear(message)` for every message and `changed(state)` with "open" or "lost". */
export class Link {
  constructor(hear, changed) {
    this.hear = hear;
    this.changed = changed;
    this.tries = 0;
    this.next = 1;
    this.waiting = new Map();
    this.open();
    setInterval(() => this.watch(), 1000);
  }

  open() {
    const scheme = location.protocol === "https:" ? "wss:" : "ws:";
    const socket = new WebSocket(`${scheme}//${location.host}/ws${location.search}`);
    this.socket = socket;
    this.heard = performance.now();
    socket.onopen = () => {
      this.tries = 0;
      this.heard = performance.now();
      this.changed("open");
    };
    socket.onmessage = (event) => {
      this.heard = performance.now();
      let message;
      try {
        message = JSON.parse(event.data);
      } catch {
        return;
      }
      if (message.type === "answer") this.settle(message);
      else this.hear(message);
    };
    socket.onclose = () => {
      if (this.socket !== socket) return;
      this.changed("lost");
      for (const answer of this.waiting.values()) answer({ ok: false, message: "the connection was lost before the answer came" });
      this.waiting.clear();
      setTimeout(() => this.open(), RETRY_MS[Math.min(this.tries++, RETRY_MS.length - 1)]);
    };
  }

  // A peer that is gone without a word (cable, power) closes nothing.
  watch() {
    if (this.socket.readyState === WebSocket.OPEN && performance.now() - this.heard > SILENCE_MS) this.socket.close();
  }

  get isOpen() {
    return this.socket.readyState === WebSocket.OPEN;
  }

  settle(message) {
    this.waiting.get(message.id)?.(message);
    this.waiting.delete(message.id);
  }

  /** Asks for something; the answer is {ok, message, …}. */
  ask(what, more = {}) {
    if (!this.isOpen) return Promise.resolve({ ok: false, message: "not connected" });
    const id = this.next++;
    return new Promise((resolve) => {
      this.waiting.set(id, resolve);
      this.socket.send(JSON.stringify({ id, do: what, ...more }));
    });
  }

  /** STOP goes by both ways: the socket, and a request of its own where the socket hangs. */
  stop(what) {
    const asked = this.ask(what);
    if (this.isOpen && performance.now() - this.heard < 500) return asked;
    return fetch(`/api/${what}${location.search}`, { method: "POST", headers: { "content-type": "application/json" }, body: "{}" })
      .then((answer) => answer.json())
      .catch(() => ({ ok: false, message: "NOT SENT: no connection to the robot" }));
  }
}
