// The connection to the robot: one WebSocket, opened again when it is lost.

const RETRY_MS = [250, 500, 1000, 2000, 4000];
/** Time between two looks whether something is heard. */
const LOOK_MS = 250;
/** Launch is heard four times a second: after that long something is wrong. */
const STALE_MS = 1500;
/** After that long another connection is tried: a peer that is gone without a word (cable, power) closes nothing. */
const SILENCE_MS = 3000;
/** Time after which STOP goes another way as well, and after which nobody has answered. */
const STOP_AGAIN_MS = 300;
const STOP_ANSWER_MS = 2000;

/** What a server says that lets nobody in: who comes has no token or a wrong one, is another's, or one too many. */
const REFUSALS = [401, 403, 503];

/** A server's words for a page. */
const words = (text) => text.trim().replace(/^hilare: /, "");

const after = (ms) => new Promise((resolve) => setTimeout(resolve, ms));

/** Calls `hear(message)` for every message and `changed(state)` with "open", "stale", "lost" or "refused". */
export class Link {
  constructor(hear, changed) {
    this.hear = hear;
    this.changed = changed;
    this.state = "connecting";
    /** What the server said when it let nobody in: {status, why}. */
    this.refusal = null;
    this.tries = 0;
    this.next = 1;
    /** Something waits for the next connection. */
    this.urgent = false;
    this.waiting = new Map();
    this.open();
    setInterval(() => this.watch(), LOOK_MS);
  }

  open() {
    const scheme = location.protocol === "https:" ? "wss:" : "ws:";
    const socket = new WebSocket(`${scheme}//${location.host}/ws${location.search}`);
    this.socket = socket;
    // What comes over a connection that was given up is of yesterday.
    const now = (act) => (event) => this.socket === socket && act(event);
    this.began = performance.now();
    this.opened = false;
    // It is no connection before the robot is heard.
    socket.onopen = now(() => {
      this.heard = performance.now();
      this.opened = true;
    });
    socket.onmessage = now((event) => {
      this.heard = performance.now();
      this.tries = 0;
      this.become("open");
      const message = JSON.parse(event.data);
      if (message.type === "answer") this.settle(message);
      else this.hear(message);
    });
    socket.onclose = now(() => this.lose());
  }

  become(state) {
    if (this.state === state) return;
    this.state = state;
    this.changed(state);
  }

  lose() {
    this.socket = null;
    if (this.opened || this.state !== "refused") this.become("lost");
    if (!this.opened) this.enquire();
    for (const answer of this.waiting.values()) answer({ ok: false, message: "the connection was lost before the answer came; whether it was done is not known" });
    this.waiting.clear();
    const rest = RETRY_MS[Math.min(this.tries++, RETRY_MS.length - 1)];
    setTimeout(() => this.open(), this.urgent ? RETRY_MS[0] : rest);
  }

  /** A browser tells no page why it got no connection; the server does if it is asked. */
  async enquire() {
    let refusal = null;
    try {
      const answer = await fetch(`/api/entry${location.search}`, { signal: AbortSignal.timeout(STOP_ANSWER_MS) });
      if (REFUSALS.includes(answer.status)) refusal = { status: answer.status, why: words(await answer.text()) };
    } catch {
      // Nobody is there.
    }
    if (this.isHeard) return;
    this.refusal = refusal;
    this.become(refusal ? "refused" : "lost");
  }

  watch() {
    if (!this.socket) return;
    // A host that is gone, or a process that hangs, leaves it half open.
    const silence = performance.now() - (this.isOpen ? this.heard : this.began);
    if (silence > SILENCE_MS) {
      this.socket.close();
      this.lose();
    } else if (silence > STALE_MS && this.state === "open") this.become("stale");
  }

  get isOpen() {
    return this.socket?.readyState === WebSocket.OPEN;
  }

  /** It is open, and the robot was heard over it. */
  get isHeard() {
    return this.isOpen && ["open", "stale"].includes(this.state);
  }

  settle(message) {
    this.waiting.get(message.id)?.(message);
    this.waiting.delete(message.id);
  }

  /** Asks for something; the answer is {ok, message, …}. */
  ask(what, more = {}) {
    if (!this.isOpen) return Promise.resolve({ ok: false, message: `${what} was not sent: no connection to the robot` });
    const id = this.next++;
    return new Promise((resolve) => {
      this.waiting.set(id, resolve);
      this.socket.send(JSON.stringify({ id, do: what, ...more }));
    });
  }

  /** The same as a request of its own, where the socket hangs. */
  async post(what) {
    try {
      const signal = AbortSignal.timeout(STOP_ANSWER_MS);
      const answer = await fetch(`/api/${what}${location.search}`, { method: "POST", headers: { "content-type": "application/json" }, body: "{}", signal });
      if (answer.headers.get("content-type")?.startsWith("application/json")) return await answer.json();
      return { ok: false, message: words(await answer.text()) };
    } catch {
      return { ok: false, message: "no connection to the robot" };
    }
  }

  /** STOP or e-stop: by the socket, and by a request as well if that is not answered at once. */
  async stop(what) {
    const bySocket = this.ask(what);
    const first = await Promise.race([bySocket, after(STOP_AGAIN_MS)]);
    if (first?.ok) return first;
    const done = (answer) => (answer.ok ? answer : Promise.reject(answer));
    const any = Promise.any([bySocket.then(done), this.post(what).then(done)]).catch(({ errors }) => errors.at(-1));
    return (await Promise.race([any, after(STOP_ANSWER_MS)])) ?? { ok: false, message: "no answer" };
  }
}
