// The drawn path beside the map: what the robot would make of it, its table, its files, and that it is not lost.

import { $, hint, make, mm, put } from "./dom.js";
import { length, parseCsv, toCsv } from "./path.js";

/** Least time between two predictions while a waypoint is dragged. */
const JUDGE_MS = 150;
/** Time between two looks whether a prediction has come. */
const LOOK_MS = 20;
/** A path that long which is not driven in time is perhaps in another unit. */
const LONG_M = 50;
/** Rows of the table. */
const TABLE_MAX = 300;
/** Largest file that is read: the longest path with all its digits. */
const FILE_MAX = 8 << 20;

/** Waypoints in words, not too many of them. */
export function named(indices) {
  const [first, ...others] = [...indices].map(String);
  const more = others.length > 3 ? [...others.slice(0, 2), `${others.length - 2} more`] : others;
  if (!more.length) return `waypoint ${first}`;
  return `waypoints ${[first, ...more.slice(0, -1)].join(", ")} and ${more.at(-1)}`;
}

export class Drawing {
  constructor(path, picture, link) {
    Object.assign(this, { path, picture, link });
    this.robot = null;
    this.timer = 0;
    this.asking = false;
    this.again = false;
    /** What was predicted of the path that is sent, until it is in force; and what tells that one from others. */
    [this.sent, this.which] = [null, ""];
    $("table-box").addEventListener("toggle", () => this.showTable());
    /** What a corner may be off, mm. */
    this.tolerance = null;
    $("tolerance").addEventListener("input", () => this.readTolerance());
    $("tolerance").addEventListener("change", () => this.readTolerance(true));
    $("import").addEventListener("click", () => $("file").click());
    $("file").addEventListener("change", () => this.read());
    $("export").addEventListener("click", () => this.save());
  }

  /** The path or what is selected of it has changed. */
  changed() {
    const { path } = this;
    $("undo").disabled = !path.past.length;
    $("redo").disabled = !path.future.length;
    $("remove").disabled = path.selected < 0;
    $("clear").disabled = !path.points.length;
    $("export").disabled = path.points.length < 2;
    // Marks of a path with other waypoints would stand at the wrong ones.
    if (this.picture.prediction?.points.length !== path.points.length || !path.unsent) this.forget();
    // Others are of the path as it was: they stay, with dots behind, until the answer.
    else $("predicted").ariaBusy = "true";
    this.picture.touch();
    this.showTable();
    this.store();
    this.judgeSoon();
  }

  // ---- tolerance

  /** One to begin with. */
  allow(tolerance) {
    this.tolerance ??= tolerance;
    $("tolerance").value = this.tolerance;
  }

  /** Takes the number in the field, if it is one; `entered` is whether the operator has left it so. */
  readTolerance(entered = false) {
    const field = $("tolerance");
    const { min, max, valueAsNumber: value } = field;
    if (value >= Number(min) && value <= Number(max)) this.tolerance = value;
    else if (entered) {
      hint(`the tolerance is a number from ${min} to ${max} mm; it stays ${this.tolerance} mm`, 12, { bad: true });
      field.value = this.tolerance;
    }
    this.judgeSoon();
  }

  // ---- a page that is loaded anew

  /** Whose path it is; one that was drawn before the page was loaded anew comes back. */
  of(robot) {
    if (this.robot === robot) return;
    this.robot = robot;
    try {
      const kept = JSON.parse(sessionStorage.getItem(this.key()));
      if (kept?.length && !this.path.points.length) this.path.replace(kept);
    } catch {
      // Nothing was kept, or nothing may be.
    }
  }

  key(what = "path") {
    return `hilare ${what} of ${this.robot}`;
  }

  store() {
    if (this.robot === null) return;
    try {
      if (this.path.unsent) sessionStorage.setItem(this.key(), JSON.stringify(this.path.points));
      else sessionStorage.removeItem(this.key());
    } catch {
      // Too long, or not allowed: then it is not kept.
    }
  }

  // ---- prediction

  /** Asks again in a moment, once for all that changes until then. */
  judgeSoon() {
    if (this.asking) this.again = true;
    else this.timer ||= setTimeout(() => this.judge(), JUDGE_MS);
  }

  /** Asks what the robot would make of the drawn path. */
  async judge() {
    this.timer = 0;
    const { path, link } = this;
    if (!path.unsent || path.points.length < 2 || !link.isOpen) return this.forget();
    [this.asking, this.again] = [true, false];
    const answer = await link.ask("predict", { waypoints: path.points });
    this.asking = false;
    // What was drawn meanwhile is asked for next.
    if (this.again) this.judgeSoon();
    else if (path.unsent) this.show(answer);
    else this.forget();
  }

  forget() {
    this.picture.prediction = null;
    put("predicted", "");
    $("predicted").ariaBusy = "false";
    this.picture.touch();
  }

  /** What is predicted of the path as it is drawn, once that is known; null if it is not after `patience` ms. */
  async foreseen(patience) {
    const end = performance.now() + patience;
    while ((this.timer || this.asking) && performance.now() < end) await new Promise((resolve) => setTimeout(resolve, LOOK_MS));
    return this.timer || this.asking ? null : this.picture.prediction;
  }

  // ---- the path in force

  /** Another path is in force: what was said of it when it was sent is said as long as it is. */
  inForce({ path_id, waypoints }) {
    const { picture } = this;
    // Numbers begin anew with the robot.
    const which = `${path_id}: ${waypoints.length} waypoints to ${waypoints.at(-1)}`;
    this.which = which;
    if (this.sent) picture.foreseen = { ...this.sent, which };
    else if (picture.foreseen?.which !== which) picture.foreseen = this.kept(which);
    this.sent = null;
    this.sayInForce();
  }

  /** A path is being sent of which this is predicted; null if nothing is, or it was refused. */
  sending(prediction) {
    this.sent = prediction?.bad.size || prediction?.touched.size ? prediction : null;
  }

  /** Asks what would come of a path that was sent before that was known. */
  async judgeSent(points) {
    const answer = await this.link.ask("predict", { waypoints: points });
    const prediction = answer.ok ? this.reading(answer, points) : null;
    const end = this.picture.active?.waypoints.at(-1);
    if (!prediction?.bad.size && !prediction?.touched.size) return;
    if (String(end?.slice(0, 2)) !== String(points.at(-1).slice(0, 2))) return;
    this.picture.foreseen = { ...prediction, which: this.which };
    this.sayInForce();
  }

  sayInForce() {
    const { foreseen } = this.picture;
    put("in-force", foreseen ? `path in force, ${foreseen.text}` : "");
    try {
      const kept = foreseen && JSON.stringify({ ...foreseen, bad: [...foreseen.bad], touched: [...foreseen.touched] });
      if (kept) sessionStorage.setItem(this.key("in force"), kept);
      else sessionStorage.removeItem(this.key("in force"));
    } catch {
      // Too long, or not allowed: then it is not kept.
    }
    this.picture.touch();
  }

  /** What was said of a path before the page was loaded anew, if it was of that one. */
  kept(which) {
    try {
      const kept = JSON.parse(sessionStorage.getItem(this.key("in force")));
      return kept?.which === which ? { ...kept, bad: new Map(kept.bad), touched: new Set(kept.touched) } : null;
    } catch {
      return null;
    }
  }

  /** Marks where the robot would leave the tolerance or touch an obstacle. */
  show(answer) {
    this.forget();
    if (!answer.ok) return hint(answer.message, 10, { bad: true, about: "file" });
    const prediction = this.reading(answer, this.path.points);
    this.picture.prediction = prediction;
    put("predicted", prediction.text);
    $("predicted").toggleAttribute("data-bad", prediction.bad.size > 0 || prediction.touched.size > 0 || !answer.reached);
    this.showTable();
    this.picture.touch();
  }

  /** What an answer says of these waypoints. */
  reading(answer, points) {
    const tolerance = this.tolerance / 1e3;
    // Of the segment that ends at waypoint i: its deviation comes from the corner that it begins with.
    const after = answer.cross_track_max_m.slice(1);
    const bad = new Map(after.map((d, i) => [i, d]).filter(([, d]) => d != null && d > tolerance));
    const touched = new Set(answer.touched);
    const said = [`predicted: ${answer.reached ? `${answer.duration_s.toFixed(1)} s` : `not reached within ${answer.duration_s.toFixed(0)} s`}`];
    const long = length(points);
    if (!answer.reached && long > LONG_M) said.push(`the path is ${long.toFixed(0)} m long: metres are wanted`);
    said.push(`cross-track ${mm(answer.mean_m)} mm in the mean, ${mm(answer.max_m)} mm at most`);
    if (bad.size) said.push(`${bad.size === 1 ? "1 corner leaves" : `${bad.size} corners leave`} the tolerance`);
    if (touched.size) said.push(`TOUCHES AN OBSTACLE on the way to ${named(touched)}`);
    return { points: points.map((point) => [...point]), after, bad, touched, text: said.join("; ") };
  }

  // ---- table

  showTable() {
    const { path } = this;
    const title = `${path.points.length} waypoints${path.unsent && path.points.length ? ", not sent yet" : ""}`;
    put("table-title", title);
    const body = $("table").tBodies[0];
    // Whoever types in it is not disturbed.
    if (!$("table-box").open || body.contains(document.activeElement)) return;
    body.replaceChildren(...path.points.slice(0, TABLE_MAX).map((point, i) => this.row(point, i)));
    if (path.points.length > TABLE_MAX) {
      const more = make("tr");
      more.append(make("td", `and ${path.points.length - TABLE_MAX} more: export the path to see them`, { colSpan: 4 }));
      body.append(more);
    }
  }

  row(point, i) {
    const { prediction } = this.picture;
    const row = make("tr");
    if (prediction?.bad.has(i)) row.dataset.bad = "";
    const cells = ["x", "y"].map((axis, j) => {
      const cell = make("td");
      cell.append(this.field(point, i, axis, j));
      return cell;
    });
    const after = prediction?.after[i];
    row.append(make("td", i), ...cells, make("td", after == null ? "" : mm(after), { className: "n" }));
    return row;
  }

  field(point, i, axis, j) {
    const shown = +(point[j] * 1e3).toFixed(1);
    const input = make("input", "", { type: "number", step: "1", value: shown });
    input.setAttribute("aria-label", `${axis} of waypoint ${i}, mm`);
    input.addEventListener("focus", () => this.path.select(i));
    input.addEventListener("change", () => {
      const next = [...this.path.points[i]];
      if (input.value === "" || !Number.isFinite(input.valueAsNumber)) {
        input.value = shown;
        return;
      }
      next[j] = input.valueAsNumber / 1e3;
      this.path.move(i, next[0], next[1]);
    });
    return input;
  }

  // ---- files

  async read() {
    const [file] = $("file").files;
    $("file").value = "";
    if (!file) return;
    try {
      if (file.size > FILE_MAX) throw new Error(`${file.name}: larger than 8 MB; a path has at most 65 536 waypoints`);
      this.path.replace(parseCsv(await file.text(), file.name));
      this.picture.view.fit(this.picture.extent());
      hint(`${this.path.points.length} waypoints from ${file.name}`);
    } catch (error) {
      hint(error.message, 0, { bad: true, about: "file" });
    }
  }

  save() {
    const url = URL.createObjectURL(new Blob([toCsv(this.path.points)], { type: "text/csv" }));
    make("a", "", { href: url, download: "path.csv" }).click();
    setTimeout(() => URL.revokeObjectURL(url), 1000);
  }
}
