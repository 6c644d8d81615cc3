// The path that is being drawn: waypoints [x, y, bulge, crab] in metres, undo and redo, CSV, simplification.

export const MAX_WAYPOINTS = 65536;
const REMEMBERED = 200;

export class DrawnPath {
  constructor(changed) {
    this.changed = changed;
    this.points = [];
    this.selected = -1;
    this.past = [];
    this.future = [];
    /** Anything here that the robot has not been sent. */
    this.unsent = false;
  }

  /** Remembers what is, before it changes. */
  keep() {
    this.past.push(this.points.map((p) => [...p]));
    if (this.past.length > REMEMBERED) this.past.shift();
    this.future = [];
  }

  touch() {
    this.unsent = true;
    this.selected = Math.min(this.selected, this.points.length - 1);
    this.changed();
  }

  /** Adds a waypoint after the selected one, or at the end. False without room. */
  add(x, y) {
    if (this.points.length >= MAX_WAYPOINTS) return false;
    this.keep();
    const at = this.selected >= 0 && this.selected < this.points.length - 1 ? this.selected + 1 : this.points.length;
    this.points.splice(at, 0, [x, y, 0, 0]);
    // A bend through a waypoint that was not there does not hold.
    if (at + 1 < this.points.length) this.points[at + 1][2] = 0;
    this.selected = at;
    this.touch();
    return true;
  }

  /** Moves a waypoint; `first` at the beginning of a drag. */
  move(index, x, y, first = true) {
    if (first) this.keep();
    this.points[index][0] = x;
    this.points[index][1] = y;
    this.touch();
  }

  remove(index = this.selected) {
    if (index < 0 || index >= this.points.length) return;
    this.keep();
    this.points.splice(index, 1);
    this.selected = Math.min(index, this.points.length - 1);
    this.touch();
  }

  /** Other waypoints; `unsent` false for those that the robot has already. */
  replace(points, unsent = true) {
    const next = points.map(([x, y, bulge = 0, crab = 0]) => [x, y, bulge, crab]);
    // What comes back as it was sent is no step that could be undone.
    if (JSON.stringify(next) !== JSON.stringify(this.points) && (unsent || this.points.length)) this.keep();
    this.points = next;
    this.selected = -1;
    this.touch();
    this.unsent = unsent;
    this.changed();
  }

  select(index) {
    this.selected = index;
    this.changed();
  }

  undo() {
    if (!this.past.length) return;
    this.future.push(this.points);
    this.points = this.past.pop();
    this.touch();
  }

  redo() {
    if (!this.future.length) return;
    this.past.push(this.points);
    this.points = this.future.pop();
    this.touch();
  }
}

/** The fewest of the points from which no other is farther than `tolerance` (Douglas and Peucker). */
export function simplify(points, tolerance) {
  if (points.length < 3) return points;
  const keep = new Uint8Array(points.length);
  keep[0] = keep[points.length - 1] = 1;
  const stack = [[0, points.length - 1]];
  while (stack.length) {
    const [a, b] = stack.pop();
    let far = -1;
    let most = tolerance;
    for (let i = a + 1; i < b; i++) {
      const d = distanceToSegment(points[i], points[a], points[b]);
      if (d > most) [far, most] = [i, d];
    }
    if (far >= 0) {
      keep[far] = 1;
      stack.push([a, far], [far, b]);
    }
  }
  return points.filter((_, i) => keep[i]);
}

export function distanceToSegment([x, y], [ax, ay], [bx, by]) {
  const [dx, dy] = [bx - ax, by - ay];
  const length2 = dx * dx + dy * dy;
  const t = length2 > 0 ? Math.min(1, Math.max(0, ((x - ax) * dx + (y - ay) * dy) / length2)) : 0;
  return Math.hypot(x - ax - t * dx, y - ay - t * dy);
}

/** Points along a segment that ends at `to` with its bulge: one for a line, several for an arc. */
export function along(from, to) {
  const bulge = to[2];
  if (!bulge) return [[to[0], to[1]]];
  const [dx, dy] = [to[0] - from[0], to[1] - from[1]];
  const half = (1 - bulge * bulge) / (4 * bulge);
  const centre = [(from[0] + to[0]) / 2 - dy * half, (from[1] + to[1]) / 2 + dx * half];
  const radius = Math.hypot(from[0] - centre[0], from[1] - centre[1]);
  const start = Math.atan2(from[1] - centre[1], from[0] - centre[0]);
  const sweep = 4 * Math.atan(bulge);
  const pieces = Math.max(2, Math.ceil(Math.abs(sweep) / 0.1));
  return Array.from({ length: pieces }, (_, i) => {
    const angle = start + (sweep * (i + 1)) / pieces;
    return i + 1 === pieces ? [to[0], to[1]] : [centre[0] + radius * Math.cos(angle), centre[1] + radius * Math.sin(angle)];
  });
}

/** Length of a path, m. */
export function length(points) {
  let sum = 0;
  let last = points[0];
  for (const point of points.slice(1).flatMap((to, i) => along(points[i], to))) {
    sum += Math.hypot(point[0] - last[0], point[1] - last[1]);
    last = point;
  }
  return sum;
}

/** Waypoints of a CSV file with a header x,y[,bulge[,crab_rad]]; throws a line that says where and what. */
export function parseCsv(text, name) {
  const lines = text.replace(/^\ufeff/, "").split(/\r?\n/);
  const points = [];
  let columns = null;
  lines.forEach((line, i) => {
    const cells = line.split("#")[0].split(",").map((cell) => cell.trim());
    if (cells.length === 1 && !cells[0]) return;
    const where = `${name}:${i + 1}`;
    if (!columns) {
      const wanted = ["x", "y", "bulge", "crab_rad"].slice(0, cells.length);
      if (cells.length < 2 || cells.join() !== wanted.join()) throw new Error(`${where}: the first line must be x,y or x,y,bulge or x,y,bulge,crab_rad`);
      columns = cells.length;
      return;
    }
    if (cells.length !== columns) throw new Error(`${where}: ${cells.length} values, ${columns} are wanted`);
    const values = cells.map(Number);
    const bad = cells.findIndex((cell, j) => cell === "" || !Number.isFinite(values[j]));
    if (bad >= 0) throw new Error(`${where}: "${cells[bad].slice(0, 40)}" is not a number`);
    if (values.some((value) => Math.abs(value) > 1e4)) throw new Error(`${where}: beyond 10 km; coordinates are in metres`);
    points.push([values[0], values[1], values[2] ?? 0, values[3] ?? 0]);
    if (points.length > MAX_WAYPOINTS) throw new Error(`${where}: more than ${MAX_WAYPOINTS} waypoints; thin the path out`);
  });
  if (points.length < 2) throw new Error(`${name}: ${points.length} waypoints; a path needs 2`);
  return points;
}

export function toCsv(points) {
  const crab = points.some((p) => p[3]);
  const bulge = crab || points.some((p) => p[2]);
  const width = crab ? 4 : bulge ? 3 : 2;
  const head = ["x", "y", "bulge", "crab_rad"].slice(0, width).join();
  return [head, ...points.map((p) => p.slice(0, width).join())].join("\n") + "\n";
}
