// The page: what comes in is shown, what the operator does is sent.

import { Hands } from "./hands.js";
import { Link } from "./link.js";
import { MapPicture } from "./map.js";
import { DrawnPath, parseCsv, toCsv } from "./path.js";
import { Bars, Strip, lineSample } from "./plots.js";
import { View } from "./view.js";

const $ = (id) => document.getElementById(id);
// Without the minus of what is rounded to nothing.
const fixed = (value, digits) => value.toFixed(digits).replace(/^-(0\.?0*)$/, "$1");
const mm = (metres, digits = 1) => (metres == null || !Number.isFinite(metres) ? "–" : fixed(metres * 1e3, digits));
const LOG_MAX = 1000;

const path = new DrawnPath(() => drawn());
let picture = null;
const view = new View($("map"), () => picture?.touch());
picture = new MapPicture($("map"), view, path);
const speed = new Strip($("plot-speed"), [
  { label: "commanded", ink: "blue" },
  { label: "reference", ink: "green", dash: [6, 4] },
], { zero: true });
const track = new Strip($("plot-track"), [
  { label: "estimate", ink: "blue" },
  { label: "truth", ink: "orange" },
]);
const late = new Bars($("plot-late"));
let hello = null;
let last = null;
let fitted = false;
let roadmapOf = null;
let sending = false;

// ---- what the robot says

const heard = {
  hello(message) {
    hello = message;
    document.title = `${message.robot} – hilare`;
    $("robot").textContent = $("robot").title = message.robot;
    $("clock").textContent = message.clock;
    picture.robot.radius = message.radius_m;
    picture.robot.start = message.start;
    picture.acceptance = message.acceptance_m;
    if (!$("tolerance").value) $("tolerance").value = Math.max(1, Math.round(message.acceptance_m * 1e3));
    $("law").replaceChildren(...message.laws.map((law) => new Option(law, law)));
    picture.trails = { estimate: [], truth: [] };
    picture.active = null;
    $("log").replaceChildren();
    setMap(message.map);
  },
  trail(message) {
    for (const which of ["estimate", "truth"]) message[which].forEach(([x, y]) => picture.extendTrail(which, x, y));
    picture.touch();
  },
  path(message) {
    picture.active = message.waypoints.length ? message : null;
    // What was sent comes back as it is driven: perhaps with the way to its beginning.
    if (picture.active && (!path.unsent || sending)) path.replace(message.waypoints, false);
    fitOnce();
    drawn();
  },
  state(message) {
    last = message;
    for (const [which, pose] of [["estimate", message.pose], ["truth", message.truth]]) {
      if (pose) picture.extendTrail(which, pose.x, pose.y);
    }
    picture.robot.pose = message.pose;
    picture.robot.truth = message.truth;
    picture.current = message.waypoint;
    if ($("follow").checked && message.pose) view.centre(message.pose.x, message.pose.y);
    if (message.pose) {
      speed.push(message.time_s, [message.speed_mps * 1e3, message.reference_mps == null ? null : message.reference_mps * 1e3]);
      track.push(message.time_s, [message.cross_track_m, message.cross_track_truth_m].map((v) => (v == null ? null : v * 1e3)));
    }
    fitOnce();
    picture.touch();
    showState(message);
  },
  status(message) {
    late.show(message.lateness.buckets, message.lateness.quantiles);
    rows($("hops"), message.hops.map((hop) => [hop.name, hop.p50_us, hop.p99_us, hop.max_us]));
    rows($("processes"), message.processes.map((p) => [p.law ? `${p.name} (${p.law})${p.authority ? " ★" : ""}` : p.name, p.reason ? `${p.state}: ${p.reason}` : p.state, p.late_p99_us ?? "–", p.restarts]), (i) => ["dead", "degraded", "fault"].includes(message.processes[i].state));
  },
  log(message) {
    const list = $("log");
    const box = list.parentElement;
    const atEnd = box.scrollHeight - box.scrollTop - box.clientHeight < 40;
    for (const line of message.lines) {
      const item = document.createElement("li");
      item.dataset.level = line.level;
      const when = document.createElement("time");
      when.textContent = clockTime(line.time);
      const level = document.createElement("b");
      level.textContent = line.level;
      const text = document.createElement("span");
      text.textContent = line.text;
      item.append(when, level, text);
      list.append(item);
    }
    while (list.childElementCount > LOG_MAX) list.firstElementChild.remove();
    if (atEnd) box.scrollTop = box.scrollHeight;
  },
};

/** Time of day of a time in ms since 1970, to the millisecond. */
function clockTime(ms) {
  const at = new Date(ms);
  const two = (n, digits = 2) => String(n).padStart(digits, "0");
  return `${two(at.getHours())}:${two(at.getMinutes())}:${two(at.getSeconds())}.${two(at.getMilliseconds(), 3)}`;
}

function rows(table, values, isBad = () => false) {
  const body = table.tBodies[0];
  body.replaceChildren(...values.map((cells, i) => {
    const row = document.createElement("tr");
    if (isBad(i)) row.dataset.bad = "";
    cells.forEach((value, j) => {
      const cell = document.createElement("td");
      if (j && typeof value === "number") cell.className = "n";
      cell.textContent = value;
      row.append(cell);
    });
    return row;
  }));
}

function setMap(map) {
  picture.map = null;
  if (!map) return picture.touch();
  const found = { ...map };
  if (map.image) {
    const image = new Image();
    image.onload = () => picture.touch();
    image.src = map.image;
    found.image = image;
  }
  picture.map = found;
  picture.touch();
}

function fitOnce() {
  if (fitted || !(picture.active || picture.map || picture.robot.pose)) return;
  fitted = true;
  view.fit(picture.extent());
}

// ---- state in words

/** What the operator has to know: one word, and why. */
function stateOf(s) {
  if (s.gone) return ["fault", "ROBOT IS DOWN"];
  if (s.fault) return ["fault", "FAULT"];
  if (s.mode === "e-stop") return ["estop", "EMERGENCY STOP"];
  if (s.mode === "stop" || s.halted) return ["stopped", "STOPPED"];
  if (s.mode === "disarmed") return ["disarmed", "DISARMED"];
  if (s.mode !== "armed") return ["unknown", s.mode.toUpperCase()];
  if (s.path_state === "arrived") return ["arrived", "ARRIVED"];
  if (s.path_state !== "tracking") return ["ready", "ARMED, NO PATH"];
  // A command that came late is no stop yet.
  return ["driving", "holding the last command"].includes(s.drive) ? ["driving", "DRIVING"] : ["stopped", s.drive.toUpperCase()];
}

function showState(s) {
  const [state, text] = stateOf(s);
  document.body.dataset.state = state;
  put("state-text", text);
  const why = s.fault ?? s.halted ?? (s.gone ? "The robot has ended, or its launch does not answer; its log says why." : null) ?? (state === "estop" ? "Emergency stop: nothing moves until Reset, then Arm." : null);
  $("fault").hidden = !why;
  if (why) put("fault", why);
  put("waypoint", s.waypoints ? `${s.waypoint} of ${s.waypoints - 1}` : "no path");
  put("time", `${s.time_s.toFixed(1)} s`);
  if (document.activeElement !== $("law") && s.law && !$("law").disabled) {
    // A program of its own may drive, which cannot be chosen here.
    if (![...$("law").options].some((option) => option.value === s.law)) $("law").add(Object.assign(new Option(s.law, s.law), { disabled: true }));
    $("law").value = s.law;
  }
  $("arm").disabled = s.mode === "armed" || s.mode === "e-stop";
  $("pause").textContent = state === "stopped" && s.path_state === "tracking" ? "Resume" : "Pause";
  $("pause").disabled = !["driving", "stopped"].includes(state);
  $("reset").disabled = s.mode !== "e-stop";
  $("run").disabled = s.mode === "e-stop" || (path.points.length < 2 && s.path_state === "idle");
  numbers([
    ["Pose x, y", s.pose ? `${mm(s.pose.x, 0)}, ${mm(s.pose.y, 0)} mm` : "–"],
    ["Heading", s.pose ? `${fixed((s.pose.theta * 180) / Math.PI, 1)} °` : "–"],
    ["Speed", `${mm(s.speed_mps)} mm/s`],
    ["Yaw rate", `${fixed(s.omega_radps, 2)} rad/s`],
    ["Cross-track, estimate", s.cross_track_m == null ? "–" : `${mm(s.cross_track_m)} mm`],
    ["Cross-track, truth", s.cross_track_truth_m == null ? "–" : `${mm(s.cross_track_truth_m)} mm`],
    ["In charge", s.law ? `${s.law}${s.standby ? `, ${s.standby} stands by` : ""}` : "nobody"],
    ["Commands late, refused", `${s.commands_late}, ${s.commands_rejected}`],
    ["Cycles without command", `${s.cycles_without_command}`],
    ["Pauses", `${s.paused_ticks} ms`],
  ]);
}

function put(id, text) {
  if ($(id).textContent !== text) $(id).textContent = text;
}

function numbers(list) {
  const host = $("numbers");
  if (host.childElementCount !== list.length) {
    host.replaceChildren(...list.map(([name]) => {
      const box = document.createElement("div");
      const term = document.createElement("dt");
      term.textContent = name;
      box.append(term, document.createElement("dd"));
      return box;
    }));
  }
  list.forEach(([, value], i) => {
    const cell = host.children[i].lastElementChild;
    if (cell.textContent !== value) cell.textContent = value;
  });
}

// ---- what the operator does

const link = new Link(
  (message) => heard[message.type]?.(message),
  (state) => {
    document.body.dataset.link = state;
    put("link", state === "open" ? "connected" : "lost, trying again");
    // A robot that has said that it goes down, and why, is not merely out of reach.
    if (state === "lost") put("state-text", last?.gone ? "ROBOT IS DOWN" : "NO CONNECTION");
    else if (last) showState(last);
  },
);

let hintEnds = 0;
function hint(text, seconds = 6) {
  $("hint").textContent = text;
  clearTimeout(hintEnds);
  if (seconds) hintEnds = setTimeout(() => ($("hint").textContent = ""), seconds * 1e3);
}

async function order(what, more) {
  const answer = await link.ask(what, more);
  hint(answer.message, answer.ok ? 4 : 12);
  return answer;
}

async function stop(what) {
  const answer = await link.stop(what);
  hint(answer.message, answer.ok ? 4 : 0);
}

async function run() {
  if (path.unsent && path.points.length > 1) {
    sending = true;
    const answer = await order("follow", { waypoints: path.points });
    sending = false;
    if (!answer.ok) return;
    path.unsent = false;
    path.selected = -1;
    drawn();
  }
  await order("arm");
}

function sure(text, yes) {
  const dialog = $("ask");
  $("ask-text").textContent = text;
  $("ask-yes").textContent = yes;
  dialog.returnValue = "no";
  dialog.showModal();
  return new Promise((resolve) => dialog.addEventListener("close", () => resolve(dialog.returnValue === "yes"), { once: true }));
}

// On the way down already: a click that slips off the button is a stop all the same.
$("stop").addEventListener("pointerdown", () => stop("stop"));
$("stop").addEventListener("click", (event) => event.detail === 0 && stop("stop"));
$("estop").addEventListener("click", () => stop("estop"));
$("run").addEventListener("click", run);
$("pause").addEventListener("click", () => ($("pause").textContent === "Pause" ? stop("stop") : order("arm")));
$("arm").addEventListener("click", () => order("arm"));
$("reset").addEventListener("click", async () => (await sure("Release the emergency stop? The robot stays disarmed.", "Release")) && order("reset"));
$("law").addEventListener("change", async () => {
  const law = $("law").value;
  $("law").disabled = true;
  hint(`${law} is being tried`, 0);
  await order("swap", { law });
  $("law").disabled = false;
  $("law").blur();
});
$("undo").addEventListener("click", () => path.undo());
$("redo").addEventListener("click", () => path.redo());
$("remove").addEventListener("click", () => path.remove());
$("clear").addEventListener("click", () => path.points.length && path.replace([]));
$("import").addEventListener("click", () => $("file").click());
$("file").addEventListener("change", async () => {
  const [file] = $("file").files;
  $("file").value = "";
  if (!file) return;
  try {
    if (file.size > 8 << 20) throw new Error(`${file.name}: larger than 8 MB; a path has at most 65 536 waypoints`);
    path.replace(parseCsv(await file.text(), file.name));
    view.fit(picture.extent());
    hint(`${path.points.length} waypoints from ${file.name}`);
  } catch (error) {
    hint(error.message, 0);
  }
});
$("export").addEventListener("click", () => {
  if (path.points.length < 2) return hint("draw a path first: two waypoints at least");
  const anchor = document.createElement("a");
  anchor.href = URL.createObjectURL(new Blob([toCsv(path.points)], { type: "text/csv" }));
  anchor.download = "path.csv";
  anchor.click();
  setTimeout(() => URL.revokeObjectURL(anchor.href), 1000);
});
$("zoom-in").addEventListener("click", () => view.zoom(1.4));
$("zoom-out").addEventListener("click", () => view.zoom(1 / 1.4));
$("fit").addEventListener("click", () => view.fit(picture.extent()));
$("circles").addEventListener("change", () => {
  picture.show.circles = $("circles").checked;
  picture.touch();
});
$("roadmap").addEventListener("change", async () => {
  picture.show.roadmap = $("roadmap").checked;
  if (picture.show.roadmap && roadmapOf !== hello?.robot) {
    const answer = await link.ask("roadmap");
    if (answer.ok) [picture.roadmap, roadmapOf] = [answer.edges, hello.robot];
    hint(answer.message);
    if (!answer.ok) $("roadmap").checked = picture.show.roadmap = false;
  }
  picture.touch();
});
$("tolerance").addEventListener("change", () => judge());
$("only-faults").addEventListener("change", () => $("log").classList.toggle("only-faults", $("only-faults").checked));

const tools = [...document.querySelectorAll("[data-tool]")].filter((element) => element.tagName === "BUTTON");
function use(tool) {
  hands.use(tool);
  for (const button of tools) {
    button.setAttribute("aria-checked", String(button.dataset.tool === tool));
    button.tabIndex = button.dataset.tool === tool ? 0 : -1;
  }
}
tools.forEach((button, i) => {
  button.addEventListener("click", () => use(button.dataset.tool));
  button.addEventListener("keydown", (event) => {
    const by = { ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1 }[event.key];
    if (!by) return;
    event.preventDefault();
    const next = tools[(i + by + tools.length) % tools.length];
    use(next.dataset.tool);
    next.focus();
  });
});

const hands = new Hands(picture, {
  cursor: (at) => put("cursor", at ? `x ${mm(at[0], 0)}  y ${mm(at[1], 0)} mm` : ""),
  moved: () => ($("follow").checked = false),
  full: () => hint("a path has at most 65 536 waypoints"),
  goal: async (x, y) => {
    picture.goal = [x, y];
    picture.touch();
    const answer = await order("goal", { x_m: x, y_m: y });
    if (answer.ok) path.unsent = false;
    else picture.goal = null;
    picture.touch();
  },
});
use("draw");

// ---- the drawn path: table, prediction

let judging = 0;
function drawn() {
  picture.touch();
  $("undo").disabled = !path.past.length;
  $("redo").disabled = !path.future.length;
  $("remove").disabled = path.selected < 0;
  $("clear").disabled = !path.points.length;
  $("export").disabled = path.points.length < 2;
  if (last) showState(last);
  showTable();
  clearTimeout(judging);
  judging = setTimeout(judge, 250);
}

const TABLE_MAX = 300;
function showTable() {
  put("table-title", `${path.points.length} waypoints${path.unsent && path.points.length ? ", not sent yet" : ""}`);
  if (!$("table-box").open) return;
  const body = $("table").tBodies[0];
  if (body.contains(document.activeElement)) return;
  const deviation = picture.prediction?.deviation ?? [];
  body.replaceChildren(...path.points.slice(0, TABLE_MAX).map((point, i) => {
    const row = document.createElement("tr");
    if (picture.prediction?.bad.has(i)) row.dataset.bad = "";
    const number = document.createElement("td");
    number.textContent = i;
    const cells = ["x", "y"].map((axis, j) => {
      const cell = document.createElement("td");
      const input = document.createElement("input");
      Object.assign(input, { type: "number", step: "1", value: +(point[j] * 1e3).toFixed(1) });
      input.setAttribute("aria-label", `${axis} of waypoint ${i}, mm`);
      input.addEventListener("focus", () => path.select(i));
      input.addEventListener("change", () => {
        const value = Number(input.value);
        if (!Number.isFinite(value) || input.value === "") return (input.value = +(path.points[i][j] * 1e3).toFixed(1));
        const next = [...path.points[i]];
        next[j] = value / 1e3;
        path.move(i, next[0], next[1]);
      });
      cell.append(input);
      return cell;
    });
    const predicted = document.createElement("td");
    predicted.className = "n";
    predicted.textContent = deviation[i] == null ? "" : mm(deviation[i]);
    row.append(number, ...cells, predicted);
    return row;
  }));
}
$("table-box").addEventListener("toggle", showTable);

/** Asks what the robot would make of the drawn path, and marks where it would stray too far. */
async function judge() {
  const tolerance = Number($("tolerance").value) / 1e3;
  if (!path.unsent || path.points.length < 2 || !link.isOpen || !(tolerance > 0)) {
    picture.prediction = null;
    picture.touch();
    return;
  }
  const asked = path.points;
  const version = JSON.stringify(asked);
  const answer = await link.ask("predict", { waypoints: asked });
  // Changed meanwhile: the next answer counts.
  if (JSON.stringify(path.points) !== version) return;
  if (!answer.ok) {
    picture.prediction = null;
    hint(answer.message, 10);
    picture.touch();
    return;
  }
  // Of segment i, which ends at waypoint i; its deviation comes from the corner it begins with.
  const deviation = answer.cross_track_max_m;
  const bad = new Map();
  deviation.forEach((d, i) => {
    if (i > 0 && d != null && d > tolerance) bad.set(i - 1, Math.max(d, bad.get(i - 1) ?? 0));
  });
  picture.prediction = { deviation, bad };
  const worst = mm(answer.max_m);
  const reached = answer.reached ? `${answer.duration_s.toFixed(1)} s` : `not reached within ${answer.duration_s.toFixed(0)} s`;
  hint(`predicted: ${reached}, cross-track ${mm(answer.mean_m)} mm in the mean, ${worst} mm at most${bad.size ? `; ${bad.size} corners leave the tolerance` : ""}`, 0);
  showTable();
  picture.touch();
}

// ---- keys, wherever the focus is

addEventListener("keydown", (event) => {
  const typing = event.target.matches?.("input:not([type=checkbox]), select");
  if (event.key === "Escape" || (event.key === " " && !typing)) {
    // Not the button that has the focus: the space bar stops.
    event.preventDefault();
    event.stopPropagation();
    if (!event.repeat) stop("stop");
    if ($("ask").open) $("ask").close("no");
    return;
  }
  if (typing) return;
  const command = event.ctrlKey || event.metaKey;
  const key = event.key.toLowerCase();
  if (command && key === "z") event.shiftKey ? path.redo() : path.undo();
  else if (command && key === "y") path.redo();
  else if (command || event.altKey) return;
  else if (event.key === "Delete" || event.key === "Backspace") path.remove();
  else if (event.key === "+" || event.key === "=") view.zoom(1.25);
  else if (event.key === "-") view.zoom(1 / 1.25);
  else if (event.key === "0") view.fit(picture.extent());
  else if (["1", "2", "3", "4"].includes(event.key)) use(["pan", "draw", "free", "goal"][event.key - 1]);
  else if (key === "r" && !$("run").disabled) run();
  else if (key === "p" && !$("pause").disabled) $("pause").click();
  else if (key === "a" && !$("arm").disabled) order("arm");
  else return;
  event.preventDefault();
}, { capture: true });
addEventListener("keyup", (event) => event.key === " " && event.target.tagName === "BUTTON" && event.preventDefault(), { capture: true });

$("legend").replaceChildren(...[
  ["blue", "estimate", ""],
  ["orange", "truth", ""],
  ["green", "path in force", ""],
  ["purple", "drawn, not sent", "5 4"],
].map(([ink, text, dash]) => {
  const item = document.createElement("li");
  item.append(lineSample(ink, dash), text);
  return item;
}));

drawn();
setInterval(() => {
  if (document.hidden) return;
  speed.draw();
  track.draw();
}, 100);

/** For tests and the curious: where the map is. */
globalThis.hilare = { view, path, picture, link };
