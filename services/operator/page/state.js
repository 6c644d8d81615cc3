// The robot's state in words and numbers: the bar, the reason, the figures at the right.

import { $, fixed, make, mm, put } from "./dom.js";

/** Time without news of a robot whose ticks go on after which what is shown is old. */
const OLD_MS = 1000;

/** A robot that is down and all is well: what is said of it, by what launch said last. */
const ENDED = {
  arrived: ["RUN OVER: ARRIVED", "The run is over: the robot has arrived. The verdict and where the report lies stand where it was started."],
  "not arrived": ["RUN OVER", "The run is over; the robot has not arrived. The verdict, where it was started, says why."],
  "emergency stop": ["RUN OVER", "The run was ended by the emergency stop."],
  interrupted: ["TAKEN DOWN", "The robot was taken down by a signal, as Ctrl-C is one."],
  "taken down": ["TAKEN DOWN", "The robot was taken down (hilare down)."],
};
const AGAIN = "This page shows the next one that comes up here.";

/** What the operator has to know: a kind, and a word or two. */
export function stateOf(s) {
  if (ENDED[s.ended]) return ["ended", ENDED[s.ended][0]];
  if (s.gone) return ["fault", "ROBOT IS DOWN"];
  if (s.fault) return ["fault", "FAULT"];
  if (s.mode === "e-stop") return ["estop", "EMERGENCY STOP"];
  // Halted, and nothing to be resumed: it is armed, as from the beginning.
  if (s.mode === "disarmed") return ["disarmed", "DISARMED"];
  if (s.mode === "stop" || s.halted) return ["stopped", s.speed_mps || s.omega_radps ? "STOPPING" : "STOPPED"];
  if (s.mode !== "armed") return ["unknown", s.mode.toUpperCase()];
  if (s.path_state === "arrived") return ["arrived", "ARRIVED"];
  if (s.path_state !== "tracking") return ["ready", "ARMED, NO PATH"];
  // A command that came late is no stop yet.
  return ["driving", "holding the last command"].includes(s.drive) ? ["driving", "DRIVING"] : ["stopped", s.drive.toUpperCase()];
}

export class StatePanel {
  constructor() {
    this.last = null;
    this.restarts = 0; // of all processes
    this.at = 0;
    this.link = "lost"; // until something is heard
    this.refusal = null;
    this.stopping = null;
  }

  /** Takes over what the robot says of itself. */
  note(state) {
    this.last = state;
    this.at = performance.now();
    this.show();
  }

  /** Takes over how the connection is, and what the server said if it refused it. */
  connection(link, refusal) {
    Object.assign(this, { link, refusal });
    this.show();
  }

  /** Why what is shown is old, or null. A robot that was never armed has no ticks yet. */
  old() {
    if (this.link === "refused") return refused(this.refusal);
    if (this.last?.gone) return null;
    if (this.link === "lost") return ["NO CONNECTION", "No connection to the robot: what is shown is old, and STOP does not reach it from here. Trying again."];
    const silent = this.link === "stale" || (this.last?.tick > 0 && performance.now() - this.at > OLD_MS);
    return silent ? ["NO NEWS", "No news from the robot: what is shown is old."] : null;
  }

  show() {
    const old = this.old();
    const link = old && this.link === "open" ? "stale" : !old && this.last?.ended ? "ended" : this.link;
    document.body.dataset.link = link;
    put("link", { open: "connected", stale: "silent", lost: "lost", refused: "refused", ended: "closed" }[link]);
    const s = this.last;
    const [state, text] = s ? stateOf(s) : ["unknown", "WAITING"];
    document.body.dataset.state = state;
    const stop = this.stopping?.words();
    document.body.toggleAttribute("data-stopping", !!stop);
    put("state-text", old?.[0] ?? stop?.name ?? text);
    // A STOP that has not arrived says all there is to say of the connection.
    const rest = old ? !stop?.late && old[1] : s && reason(s, state);
    const why = [stop?.text, rest].filter(Boolean).join(" ");
    $("fault").hidden = !why;
    if (why) put("fault", why);
    this.buttons(state);
    if (!s) return;
    put("waypoint", s.waypoints ? `${s.waypoint} of ${s.waypoints - 1}` : "no path");
    put("time", `${s.time_s.toFixed(1)} s`);
    showLaw(s.law);
    figures(s, this.restarts);
  }

  /** What cannot be done now cannot be pressed; STOP and e-stop always can. */
  buttons(state) {
    const s = this.last;
    const off = !s || s.gone || ["lost", "refused"].includes(this.link);
    const latched = s?.mode === "e-stop";
    $("arm").disabled = off || latched || s.mode === "armed";
    const resumable = state === "stopped" && s.path_state === "tracking";
    $("pause").textContent = resumable ? "Resume" : "Pause";
    $("pause").disabled = off || !(state === "driving" || resumable);
    $("reset").disabled = off || !latched;
    $("run").disabled = off || latched;
    $("law").disabled = off || $("law").dataset.busy === "yes";
    // First the STOP that is under way.
    if (this.stopping?.what) for (const id of ["arm", "pause", "run"]) $(id).disabled = true;
  }
}

/** Why the server lets this page not in. */
function refused({ status, why }) {
  if (status === 503) return ["NO ROOM", `The robot has no room for this page: ${why}. STOP does not reach it from here.`];
  const anew = status === 401 ? " Every start of the robot makes a new token." : "";
  return ["NOT ALLOWED", `The robot does not let this page in: ${why}.${anew} STOP does not reach it from here.`];
}

function reason(s, state) {
  if (state === "ended") return `${ENDED[s.ended][1]} ${AGAIN}`;
  if (s.fault ?? s.halted) return s.fault ?? s.halted;
  if (s.gone) return "The robot has ended, or its launch does not answer; its log says why.";
  return state === "estop" ? "Emergency stop: nothing moves until Reset, then Arm." : null;
}

function showLaw(law) {
  const menu = $("law");
  if (document.activeElement === menu || !law || menu.dataset.busy === "yes") return;
  // A program of its own may drive, which cannot be chosen here.
  if (![...menu.options].some((option) => option.value === law)) menu.add(Object.assign(new Option(law, law), { disabled: true }));
  menu.value = law;
}

/** Degrees in (−180, 180]. */
export function degrees(rad) {
  const text = fixed((Math.atan2(Math.sin(rad), Math.cos(rad)) * 180) / Math.PI, 1);
  return text === "-180.0" ? "180.0" : text;
}

function figures(s, restarts) {
  // What is no nought of these is set off.
  const count = (n, unit = "") => [`${n}${unit}`, n > 0];
  const list = [
    ["Pose x, y", s.pose ? `${mm(s.pose.x, 0)}, ${mm(s.pose.y, 0)} mm` : "–"],
    ["Heading", s.pose ? `${degrees(s.pose.theta)}°` : "–"],
    ["Speed", `${mm(s.speed_mps)} mm/s`],
    ["Yaw rate", `${fixed(s.omega_radps, 2)} rad/s`],
    ["Cross-track, estimate", s.cross_track_m == null ? "–" : `${mm(s.cross_track_m)} mm`],
    ["Cross-track, truth", s.cross_track_truth_m == null ? "–" : `${mm(s.cross_track_truth_m)} mm`],
    ["Commands late", ...count(s.commands_late)],
    ["Commands refused", ...count(s.commands_rejected)],
    ["Without command", ...count(s.cycles_without_command, " cycles")],
    ["Host pauses", ...count(s.paused_ticks, " ms")],
    ["Restarts", ...count(restarts)],
    ["Stands by", s.standby ?? "nobody"],
  ];
  const host = $("numbers");
  if (!host.childElementCount) {
    host.append(...list.map(([name]) => {
      const box = make("div");
      box.append(make("dt", name), make("dd"));
      return box;
    }));
  }
  list.forEach(([, value, off = false], i) => {
    const cell = host.children[i].lastElementChild;
    cell.toggleAttribute("data-off", off);
    if (cell.textContent !== value) cell.textContent = cell.title = value;
  });
}
