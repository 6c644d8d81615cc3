// The page: what comes in is shown, what the operator does is sent.

import { $, fill, hint, mm, put, sure, unhint } from "./dom.js";
import { Drawing, named } from "./drawing.js";
import { Hands } from "./hands.js";
import { listen } from "./keys.js";
import { Laws } from "./laws.js";
import { Link } from "./link.js";
import { addLines } from "./log.js";
import { Notices } from "./notices.js";
import { MapPicture } from "./map.js";
import { DrawnPath } from "./path.js";
import { Bars, Strip, lineSample } from "./plots.js";
import { StatePanel } from "./state.js";
import { Stopping } from "./stopping.js";
import { View } from "./view.js";

const TOOLS = ["pan", "draw", "free", "goal"];
/** Time between two looks at the plots, and at whether there is news. */
const LOOK_MS = 100;
/** That near to a goal a path ends that leads to it. */
const GOAL_NEAR_M = 0.01;
/** Room for a line of words, where there is none yet. */
const WORDS_PX = 30;
/** Time in which Run waits to hear what would come of the path. */
const FORESEE_MS = 1000;

let fitted = false;
/** A path is on its way to the robot: what it drives next is what was drawn. */
let sending = false;
/** STOPs so far: what was begun before one is not gone on with. */
let stops = 0;
/** Run is under way, with its question perhaps. */
let running = false;

const path = new DrawnPath(() => pathChanged());
let picture = null;
const view = new View($("map"), () => picture?.touch(), margins);
picture = new MapPicture($("map"), view, path);
const panel = new StatePanel();
const speed = new Strip($("plot-speed"), [
  { label: "commanded", ink: "blue" },
  { label: "reference", ink: "green", dash: [6, 4] },
], "mm/s");
const track = new Strip($("plot-track"), [
  { label: "truth", ink: "orange", width: 3 },
  { label: "estimate", ink: "blue", dash: [6, 3] },
], "mm");
const late = new Bars($("plot-late"));
const notices = new Notices();
/** A process by its box and what drives in it. */
const nameOf = (p) => (p.law ? `${p.name} (${p.law})` : p.name);

// ---- what the robot says

/** The launch of the robot that is heard; and the path of the one before, as text, which is a drawing now. */
let [launch, left] = [null, null];

/** The robot that had the path is no more, its successor has none: what is left of it is a drawing. */
function leave() {
  picture.goal = null;
  if (path.unsent || !path.points.length) return;
  left = JSON.stringify(path.points);
  path.touch();
}

/** A sample of the plots: s, then mm/s and mm, null where there is none. */
function plot([t, ...values]) {
  const [commanded, reference, estimate, truth] = values.map((value) => (value == null ? null : value * 1e3));
  speed.push(t, [commanded, reference]);
  track.push(t, [truth, estimate]);
}

const heard = {
  hello(message) {
    document.title = `${message.robot} – hilare`;
    $("robot").textContent = $("robot").title = message.robot;
    put("clock", message.clock);
    Object.assign(picture.robot, { radius: message.radius_m, start: message.start });
    picture.acceptance = message.acceptance_m;
    drawing.allow(Math.max(1, Math.round(message.acceptance_m * 1e3)));
    laws.set(message.laws);
    $("log").replaceChildren();
    $("roadmap").checked = false;
    picture.begin(message.map);
    drawing.of(message.robot);
    if (launch !== null && launch !== message.launch) leave();
    launch = message.launch;
    stopping.meet(launch);
  },
  trail(message) {
    for (const which of ["estimate", "truth"]) message[which].forEach(([x, y]) => picture.extendTrail(which, x, y));
    speed.clear();
    track.clear();
    message.plots.forEach(plot);
    fitOnce();
    picture.touch();
  },
  path(message) {
    picture.active = message.waypoints.length ? message : null;
    drawing.inForce(message);
    // The goal is shown while the way to it is in force.
    const end = message.waypoints.at(-1);
    if (picture.goal && !(end && Math.hypot(end[0] - picture.goal[0], end[1] - picture.goal[1]) < GOAL_NEAR_M)) picture.goal = null;
    // What was sent comes back as it is driven: perhaps with the way to its beginning.
    if (picture.active && (!path.unsent || sending || left === JSON.stringify(path.points))) path.replace(message.waypoints, false);
    fitOnce();
    // Nobody has moved the map yet, and the robot is sent to where it does not reach.
    if (view.box && !message.waypoints.every(([x, y]) => view.shows(x, y))) view.fit(picture.extent());
    pathChanged();
  },
  state(message) {
    for (const [which, pose] of [["estimate", message.pose], ["truth", message.truth]]) {
      if (pose) picture.extendTrail(which, pose.x, pose.y);
    }
    Object.assign(picture.robot, { pose: message.pose, truth: message.truth });
    picture.current = message.waypoint;
    if ($("follow").checked && message.pose) view.centre(message.pose.x, message.pose.y);
    if (message.pose) plot([message.time_s, message.speed_mps, message.reference_mps, message.cross_track_m, message.cross_track_truth_m]);
    fitOnce();
    picture.touch();
    stopping.see(message);
    panel.note(message);
    if (document.body.dataset.state === "stopped" && !message.speed_mps && !message.omega_radps) unhint("stop", "stopped; Arm lets it go on");
  },
  status(message) {
    late.show(message.lateness.buckets, message.lateness.quantiles);
    fill($("hops"), message.hops.map((hop) => [hop.name, hop.p50_us, hop.p99_us, hop.max_us]));
    const name = (p) => `${nameOf(p)}${p.authority ? " ★" : ""}`;
    const state = (p) => (p.reason ? `${p.state}: ${p.reason}` : p.state);
    const isBad = (i) => ["dead", "degraded", "fault"].includes(message.processes[i].state);
    fill($("processes"), message.processes.map((p) => [name(p), state(p), p.late_p99_us ?? "–", p.restarts]), isBad);
    panel.restarts = message.processes.reduce((sum, p) => sum + p.restarts, 0);
    notices.processes(message.processes, nameOf);
  },
  log(message) {
    addLines(message.lines);
    notices.lines(message.lines);
  },
};

/** What of the map's edges is covered, px: the scale and the legend above, words below. */
function margins() {
  const [legend, notes] = [$("legend"), $("notes")];
  return { top: legend.offsetTop + legend.offsetHeight + 4, bottom: Math.max(notes.offsetHeight, WORDS_PX) + 12, side: 12 };
}

function fitOnce() {
  if (fitted || !(picture.active || picture.map || picture.robot.pose || picture.robot.start)) return;
  fitted = true;
  view.fit(picture.extent());
}

// ---- what the operator does

const link = new Link(
  (message) => heard[message.type]?.(message),
  (state) => panel.connection(state, link.refusal),
);
const stopping = new Stopping(link, () => panel.show(), (text) => hint(text, 4, { about: "stop" }));
panel.stopping = stopping;
const drawing = new Drawing(path, picture, link);
const laws = new Laws(async (law) => (await order("swap", { law })).ok, () => panel.last?.law);

function pathChanged() {
  unhint("file");
  drawing.changed();
  panel.show();
}

async function order(what, more) {
  const answer = await link.ask(what, more);
  hint(answer.message, answer.ok ? 4 : 12, { bad: !answer.ok });
  return answer;
}

/** An order after which the robot has another path, which then is the drawn one. */
async function orderPath(what, more) {
  sending = true;
  const answer = await order(what, more);
  sending = false;
  if (answer.ok) {
    path.unsent = false;
    path.select(-1);
  }
  return answer;
}

function stop(what = "stop") {
  stops++;
  if ($("ask").open) $("ask").close("no");
  stopping.press(what, panel.last?.tick ?? 0);
}

async function run() {
  if (running) return;
  running = true;
  const before = stops;
  if ((!path.unsent || path.points.length < 2 || (await send(before))) && stops === before) await order("arm");
  running = false;
}

/** Sends the drawn path; one that is predicted to touch an obstacle only if the operator wants it. */
async function send(before) {
  const points = path.points.map((point) => [...point]);
  const same = () => JSON.stringify(path.points) === JSON.stringify(points);
  const foreseen = await drawing.foreseen(FORESEE_MS);
  if (stops !== before) return false;
  if (foreseen?.touched.size) {
    const yes = await sure(`This path is predicted to touch an obstacle on the way to ${named(foreseen.touched)}. Drive it all the same?`, "Drive it");
    if (!yes || stops !== before) return false;
    if (!same()) {
      hint("the path was changed meanwhile: Run asks again", 12, { bad: true });
      return false;
    }
  }
  drawing.sending(foreseen);
  const { ok } = await orderPath("follow", { waypoints: points });
  if (!ok) drawing.sending(null);
  else if (!foreseen) drawing.judgeSent(points);
  return ok;
}

async function goTo(x, y) {
  const replaced = path.unsent && path.points.length > 0;
  picture.goal = [x, y];
  picture.touch();
  const { ok, message } = await orderPath("goal", { x_m: x, y_m: y });
  if (!ok) picture.goal = null;
  else if (replaced) hint(`${message}; Undo brings back what was drawn`, 12);
  picture.touch();
}

async function showRoadmap() {
  const box = $("roadmap");
  if (box.checked && !picture.roadmap) {
    hint("the planner's roadmap is being made", 0);
    const answer = await link.ask("roadmap");
    hint(answer.message);
    picture.roadmap = answer.edges ?? null;
    box.checked &&= answer.ok;
  }
  picture.show.roadmap = box.checked;
  picture.touch();
}

/** A button does what its click does, if it can be pressed. */
const press = (id) => $(id).click();

// On the way down already: a click that slips off the button is a stop all the same.
$("stop").addEventListener("pointerdown", () => stop());
$("stop").addEventListener("click", (event) => event.detail === 0 && stop());
$("estop").addEventListener("click", () => stop("estop"));
$("run").addEventListener("click", () => {
  if (path.points.length > 1 || panel.last?.path_state !== "idle") run();
  else hint("draw or import a path first; Arm lets commands act without one");
});
$("pause").addEventListener("click", () => ($("pause").textContent === "Pause" ? stop() : order("arm")));
$("arm").addEventListener("click", () => order("arm"));
$("reset").addEventListener("click", async () => (await sure("Release the emergency stop? The robot stays disarmed.", "Release")) && order("reset"));
$("undo").addEventListener("click", () => path.undo());
$("redo").addEventListener("click", () => path.redo());
$("remove").addEventListener("click", () => path.remove());
$("clear").addEventListener("click", () => path.replace([]));
$("zoom-in").addEventListener("click", () => view.zoom(1.4));
$("zoom-out").addEventListener("click", () => view.zoom(1 / 1.4));
$("fit").addEventListener("click", () => view.fit(picture.extent()));
$("circles").addEventListener("change", () => {
  picture.show.circles = $("circles").checked;
  picture.touch();
});
$("roadmap").addEventListener("change", showRoadmap);

const hands = new Hands(picture, {
  cursor: (at) => put("cursor", at ? `x ${mm(at[0], 0)}  y ${mm(at[1], 0)} mm` : ""),
  moved: () => ($("follow").checked = false),
  full: () => hint("a path has at most 65 536 waypoints", 6, { bad: true }),
  goal: goTo,
});
const tools = TOOLS.map((tool) => document.querySelector(`#tools [data-tool=${tool}]`));

function use(chosen) {
  hands.use(TOOLS[chosen]);
  tools.forEach((button, i) => {
    button.setAttribute("aria-checked", String(i === chosen));
    button.tabIndex = i === chosen ? 0 : -1;
  });
}
tools.forEach((button, i) => {
  button.addEventListener("click", () => use(i));
  button.addEventListener("keydown", (event) => {
    const by = { ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1 }[event.key];
    if (!by) return;
    event.preventDefault();
    const next = (i + by + tools.length) % tools.length;
    use(next);
    tools[next].focus();
  });
});
use(TOOLS.indexOf("draw"));

listen({
  stop,
  use,
  undo: () => path.undo(),
  redo: () => path.redo(),
  remove: () => path.remove(),
  zoom: (factor) => view.zoom(factor),
  fit: () => press("fit"),
  run: () => press("run"),
  pause: () => press("pause"),
  arm: () => press("arm"),
});

$("legend").replaceChildren(...[
  ["blue", "estimate", ""],
  ["orange", "truth", "", 4],
  ["green", "path in force", "", 2],
  ["purple", "drawn, not sent", "5 4"],
].map(([ink, text, dash, width]) => {
  const item = document.createElement("li");
  item.append(lineSample(ink, dash, width), text);
  return item;
}));

pathChanged();
setInterval(() => {
  panel.show();
  notices.show(Boolean(panel.last?.fault ?? panel.last?.gone));
  if (document.hidden) return;
  speed.draw();
  track.draw();
}, LOOK_MS);

/** For tests and the curious. */
globalThis.hilare = { view, path, picture, link, plots: [speed, track] };
