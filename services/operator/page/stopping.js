// A STOP on its way: it stays until the robot has taken it, whatever becomes of the connection meanwhile.

/** Time without an answer after which that is said. */
const SAID_MS = 100;
/** Time between two tries, and between two looks whether it is time for one. */
const AGAIN_MS = 500;
const LOOK_MS = 100;

/** What the robot says of itself once it has taken a stop. */
const TAKEN = { stop: ["stop", "e-stop", "disarmed"], estop: ["e-stop"] };

export class Stopping {
  /** `changed()` is called whenever there is something else to show, `say(text)` when a STOP has come to its end. */
  constructor(link, changed, say) {
    Object.assign(this, { link, changed, say });
    /** What the robot is not known to have taken: "stop", "estop" or null. */
    this.what = null;
    /** Why it has not, once a try has failed. */
    this.why = "";
    /** When it was pressed, at which tick, and for which launch of the robot; and which is heard. */
    this.since = this.tick = 0;
    this.meant = this.heard = null;
    /** The robot went down in good order. */
    this.down = false;
    /** Tries under way, and when the last of them ended. */
    this.trying = this.tried = 0;
    setInterval(() => this.look(), LOOK_MS);
  }

  /** The operator wants it. `tick` is the newest that is known. */
  press(what, tick) {
    // An emergency stop is not less for a stop after it.
    if (this.what !== "estop") this.what = what;
    this.why = "";
    // What was said before is not of now.
    this.say("");
    this.since = performance.now();
    this.tick = tick;
    this.meant = this.heard;
    this.try();
  }

  async try() {
    const what = this.what;
    this.trying++;
    this.changed();
    const answer = await this.link.stop(what);
    this.trying--;
    this.tried = performance.now();
    if (answer.ok) {
      this.say(answer.message);
      if (this.what === what) this.what = null;
    } else if (this.down) {
      this.end();
      this.say("the robot is down: there is nothing to stop");
    } else this.why = answer.message;
    this.changed();
  }

  /** Tries again where the robot is heard. Where nobody is it waits for `meet`: it may be another one that comes. */
  look() {
    this.link.urgent = this.what !== null;
    if (this.what && !this.trying && this.link.isHeard && performance.now() - this.tried > AGAIN_MS) this.try();
  }

  /** A robot is heard anew, of this launch. A STOP is for the one that was in view. */
  meet(launch) {
    this.heard = launch;
    this.down = false;
    if (!this.what) return;
    if (this.meant === null || this.meant === launch) this.try();
    else {
      this.end();
      this.say("the robot was launched anew; STOP was for the one before");
    }
  }

  /** What the robot says of itself. */
  see(state) {
    this.down = !!state.ended;
    if (this.what && (this.down || (state.tick > this.tick && TAKEN[this.what].includes(state.mode)))) this.end();
  }

  end() {
    this.what = null;
    this.changed();
  }

  /** What the operator has to know of it, or null: a word or two, a sentence, and whether it has failed so far. */
  words() {
    if (!this.what || performance.now() - this.since < SAID_MS) return null;
    const name = this.what === "stop" ? "STOP" : "E-STOP";
    if (!this.why) return { name: `${name} SENT`, text: `${name} sent, waiting for the robot's answer.`, late: false };
    return { name: `${name} NOT TAKEN`, late: true, text: `${name} HAS NOT REACHED THE ROBOT: ${this.why}. It is sent again as soon as the robot is heard.` };
  }
}
