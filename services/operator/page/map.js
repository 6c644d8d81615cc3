// What the map shows. Draws when something has changed, at most once a frame.

import { along } from "./path.js";

const TRAIL_MAX = 40000;
/** Waypoints of a longer path have no numbers. */
const NUMBERED_MAX = 60;

export class MapPicture {
  constructor(canvas, view, path) {
    Object.assign(this, { canvas, view, path });
    this.context = canvas.getContext("2d");
    this.robot = { radius: 0.037, pose: null, truth: null, start: null };
    this.trails = { estimate: [], truth: [] };
    this.active = null; // path in force
    this.current = 0; // waypoint that is driven to
    this.acceptance = 0;
    this.map = null;
    this.roadmap = null;
    this.goal = null;
    this.stroke = null; // freehand line
    this.show = { circles: true, roadmap: false };
    this.prediction = null; // of the path that is drawn: {points, after, bad, touched, text}
    this.foreseen = null; // the same of the path in force, if it was a warning
    this.dirty = false;
    matchMedia("(prefers-color-scheme: light)").addEventListener("change", () => this.touch());
    for (const event of ["focus", "blur"]) canvas.addEventListener(event, () => this.touch());
  }

  /** Forgets what is of another robot or another run. */
  begin(map) {
    this.trails = { estimate: [], truth: [] };
    this.active = this.roadmap = this.foreseen = null;
    this.show.roadmap = false;
    this.map = map && { ...map };
    if (map?.image) {
      this.map.image = new Image();
      this.map.image.onload = () => this.touch();
      this.map.image.src = map.image;
    }
    this.touch();
  }

  touch() {
    if (this.dirty) return;
    this.dirty = true;
    requestAnimationFrame(() => {
      this.dirty = false;
      this.draw();
    });
  }

  colour(name) {
    return getComputedStyle(document.body).getPropertyValue(`--${name}`).trim();
  }

  extendTrail(which, x, y) {
    const trail = this.trails[which];
    const last = trail[trail.length - 1];
    if (last && Math.hypot(x - last[0], y - last[1]) < 0.0005) return;
    trail.push([x, y]);
    if (trail.length > TRAIL_MAX) this.trails[which] = trail.filter((_, i) => i % 2 === 0);
  }

  /** Everything there is, with the circles around it and the whole of the robot, as a box. */
  extent() {
    const box = [Infinity, Infinity, -Infinity, -Infinity];
    const take = ([x, y], around = 0) => {
      [box[0], box[1]] = [Math.min(box[0], x - around), Math.min(box[1], y - around)];
      [box[2], box[3]] = [Math.max(box[2], x + around), Math.max(box[3], y + around)];
    };
    const circle = this.show.circles ? this.acceptance : 0;
    for (const waypoints of [this.path.points, this.active?.waypoints ?? []]) {
      this.outline(waypoints).forEach((point) => take(point));
      waypoints.forEach((point) => take(point, circle));
    }
    for (const corner of this.map?.corners ?? []) take(corner);
    const alone = box[0] === Infinity;
    const at = this.robot.pose ?? this.robot.start;
    // With nothing else to be seen it is seen with some floor around it.
    if (at) take([at.x, at.y], alone ? Math.max(0.5, 4 * this.robot.radius) : this.robot.radius);
    return box[0] === Infinity ? [-0.5, -0.5, 0.5, 0.5] : box;
  }

  draw() {
    const { context: c, view } = this;
    c.clearRect(0, 0, view.width, view.height);
    c.fillStyle = this.colour("floor");
    c.fillRect(0, 0, view.width, view.height);
    c.lineJoin = c.lineCap = "round";
    this.drawGrid();
    this.drawMap();
    if (this.show.roadmap && this.roadmap) this.drawRoadmap();
    this.drawTrail(this.trails.truth, this.colour("orange"), 4);
    this.drawTrail(this.trails.estimate, this.colour("blue"), 1.5);
    if (this.active) this.drawActive();
    this.drawDrawn();
    if (this.stroke) this.line(this.stroke, this.colour("purple"), 2.5);
    if (this.goal) this.drawGoal();
    if (this.robot.truth) this.drawRobot(this.robot.truth, this.colour("orange"), false);
    if (this.robot.pose) this.drawRobot(this.robot.pose, this.colour("blue"), true);
    // Not armed yet: where the system file says that it stands.
    else if (this.robot.start) this.drawRobot(this.robot.start, this.colour("dim"), false);
    this.drawScale();
    if (this.canvas.matches(":focus-visible")) this.drawCross();
  }

  /** Where Enter would put a waypoint. */
  drawCross() {
    const { context: c, view } = this;
    const [px, py] = [view.width / 2, view.height / 2];
    c.strokeStyle = this.colour("ink");
    c.lineWidth = 1.5;
    c.beginPath();
    c.moveTo(px - 9, py);
    c.lineTo(px + 9, py);
    c.moveTo(px, py - 9);
    c.lineTo(px, py + 9);
    c.stroke();
  }

  line(points, colour, width, dash = []) {
    if (points.length < 2) return;
    const c = this.context;
    c.strokeStyle = colour;
    c.lineWidth = width;
    c.setLineDash(dash);
    c.beginPath();
    points.forEach(([x, y], i) => {
      const [px, py] = this.view.toScreen(x, y);
      if (i) c.lineTo(px, py);
      else c.moveTo(px, py);
    });
    c.stroke();
    c.setLineDash([]);
  }

  // Points closer than a pixel to the one before are left out.
  drawTrail(trail, colour, width) {
    const near = 0.7 / this.view.scale;
    let last = null;
    const seen = trail.filter((p, i) => {
      const keep = !last || i === trail.length - 1 || Math.abs(p[0] - last[0]) + Math.abs(p[1] - last[1]) > near;
      if (keep) last = p;
      return keep;
    });
    this.line(seen, colour, width);
  }

  step() {
    const wanted = 70 / this.view.scale;
    const power = 10 ** Math.floor(Math.log10(wanted));
    return [1, 2, 5, 10].map((n) => n * power).find((n) => n >= wanted);
  }

  drawGrid() {
    const { context: c, view } = this;
    const step = this.step();
    const [x0, y1] = view.toWorld(0, 0);
    const [x1, y0] = view.toWorld(view.width, view.height);
    c.strokeStyle = this.colour("grid");
    c.lineWidth = 1;
    c.beginPath();
    for (let x = Math.ceil(x0 / step) * step; x <= x1; x += step) {
      const [px] = view.toScreen(x, 0);
      c.moveTo(Math.round(px) + 0.5, 0);
      c.lineTo(Math.round(px) + 0.5, view.height);
    }
    for (let y = Math.ceil(y0 / step) * step; y <= y1; y += step) {
      const [, py] = view.toScreen(0, y);
      c.moveTo(0, Math.round(py) + 0.5);
      c.lineTo(view.width, Math.round(py) + 0.5);
    }
    c.stroke();
    const [ox, oy] = view.toScreen(0, 0);
    c.strokeStyle = this.colour("edge");
    c.beginPath();
    c.moveTo(ox, 0);
    c.lineTo(ox, view.height);
    c.moveTo(0, oy);
    c.lineTo(view.width, oy);
    c.stroke();
  }

  drawScale() {
    const { context: c, view } = this;
    const step = this.step();
    const length = step * view.scale;
    const text = step >= 1 ? `${step} m` : `${Math.round(step * 1000)} mm`;
    const [x, y] = [12, 22];
    c.strokeStyle = this.colour("ink");
    c.lineWidth = 2;
    c.beginPath();
    c.moveTo(x, y - 5);
    c.lineTo(x, y);
    c.lineTo(x + length, y);
    c.lineTo(x + length, y - 5);
    c.stroke();
    this.write(text, x + 4, y - 5, "ink", "12px");
  }

  drawMap() {
    if (!this.map) return;
    const { context: c, view, map } = this;
    if (map.image) {
      c.imageSmoothingEnabled = false;
      c.save();
      const [ox, oy] = view.toScreen(map.origin[0], map.origin[1]);
      c.translate(ox, oy);
      c.rotate(-map.origin[2]);
      c.drawImage(map.image, 0, -map.height_m * view.scale, map.width_m * view.scale, map.height_m * view.scale);
      c.restore();
    }
    c.strokeStyle = this.colour("dim");
    c.lineWidth = 1.5;
    this.polygon(map.corners);
    c.stroke();
    c.fillStyle = this.colour("obstacle");
    c.strokeStyle = this.colour("obstacle-edge");
    for (const shape of map.obstacles ?? []) {
      if (shape.disc) {
        const [x, y, r] = shape.disc;
        c.beginPath();
        c.arc(...view.toScreen(x, y), r * view.scale, 0, 2 * Math.PI);
      } else this.polygon(shape.polygon);
      c.fill();
      c.stroke();
    }
  }

  polygon(corners) {
    const c = this.context;
    c.beginPath();
    corners.forEach(([x, y], i) => c[i ? "lineTo" : "moveTo"](...this.view.toScreen(x, y)));
    c.closePath();
  }

  drawRoadmap() {
    const c = this.context;
    c.strokeStyle = this.colour("purple");
    c.globalAlpha = 0.5;
    c.lineWidth = 1;
    c.beginPath();
    for (const [x0, y0, x1, y1] of this.roadmap) {
      c.moveTo(...this.view.toScreen(x0, y0));
      c.lineTo(...this.view.toScreen(x1, y1));
    }
    c.stroke();
    c.globalAlpha = 1;
  }

  outline(waypoints) {
    return waypoints.flatMap((p, i) => (i ? along(waypoints[i - 1], p) : [[p[0], p[1]]]));
  }

  circles(waypoints, from, colour) {
    const c = this.context;
    const radius = this.acceptance * this.view.scale;
    if (!this.show.circles || radius < 3) return;
    c.strokeStyle = colour;
    c.globalAlpha = 0.75;
    c.lineWidth = 1;
    c.setLineDash([3, 3]);
    for (const [x, y] of waypoints.slice(from, from + 2000)) {
      const [px, py] = this.view.toScreen(x, y);
      if (px < -radius || py < -radius || px > this.view.width + radius || py > this.view.height + radius) continue;
      c.beginPath();
      c.arc(px, py, radius, 0, 2 * Math.PI);
      c.stroke();
    }
    c.setLineDash([]);
    c.globalAlpha = 1;
  }

  drawActive() {
    const { context: c, view } = this;
    const points = this.active.waypoints;
    const colour = this.colour("green");
    this.line(this.outline(points), colour, 2);
    this.circles(points, Math.max(0, this.current - 1), colour);
    points.forEach(([x, y], i) => {
      if (points.length > 500 && i !== this.current) return;
      const [px, py] = view.toScreen(x, y);
      c.beginPath();
      c.arc(px, py, i === this.current ? 6 : 3, 0, 2 * Math.PI);
      c.fillStyle = i < this.current ? this.colour("dim") : colour;
      c.fill();
    });
    if (this.foreseen) this.drawForeseen(this.foreseen);
  }

  /** Where it was predicted to touch an obstacle or to leave the tolerance. */
  drawForeseen({ points, bad, touched }) {
    touched.forEach((i) => {
      const from = points[Math.max(0, i - 1)];
      if (points[i]) this.line([from, ...along(from, points[i])], this.colour("red"), 5, [2, 6]);
    });
    bad.forEach((off, i) => points[i] && this.drawBad(...this.view.toScreen(points[i][0], points[i][1]), off));
  }

  /** The drawn path where it is not the one in force; of that one, what is selected. */
  drawDrawn() {
    const { path } = this;
    const { points } = path;
    const colour = this.colour("purple");
    // While a waypoint is dragged the marks go with it.
    const foreseen = { bad: new Map(), touched: new Set(), ...(path.unsent && this.prediction), points };
    if (path.unsent) {
      this.line(this.outline(points), colour, 2, [7, 5]);
      this.circles(points, 0, colour);
      this.drawForeseen(foreseen);
    }
    points.forEach((point, i) => {
      const selected = i === path.selected;
      if (!path.unsent && !selected) return;
      const [px, py] = this.view.toScreen(point[0], point[1]);
      this.drawWaypoint(px, py, selected, colour);
      if (points.length <= NUMBERED_MAX && this.view.scale > 60 && !foreseen.bad.has(i)) this.write(String(i), px + 8, py - 6, "dim", "11px");
    });
  }

  drawWaypoint(px, py, selected, colour) {
    const c = this.context;
    const half = selected ? 6.5 : 4.5;
    c.beginPath();
    c.rect(px - half, py - half, 2 * half, 2 * half);
    c.fillStyle = selected ? this.colour("yellow") : colour;
    c.fill();
    c.strokeStyle = this.colour("floor");
    c.lineWidth = 1;
    c.stroke();
  }

  /** A corner that the robot cannot take within the tolerance, and how far it would be off. */
  drawBad(px, py, off) {
    const c = this.context;
    c.strokeStyle = this.colour("red");
    c.lineWidth = 3;
    c.beginPath();
    c.moveTo(px, py - 13);
    c.lineTo(px + 12, py + 8);
    c.lineTo(px - 12, py + 8);
    c.closePath();
    c.stroke();
    this.write(`${(off * 1e3).toFixed(0)} mm`, px + 15, py + 4, "red", "bold 13px");
  }

  /** A word on the map, readable over lines. */
  write(text, px, py, ink, font) {
    const c = this.context;
    c.font = `${font} system-ui, sans-serif`;
    c.textAlign = "left";
    c.strokeStyle = this.colour("floor");
    c.lineWidth = 3;
    c.strokeText(text, px, py);
    c.fillStyle = this.colour(ink);
    c.fillText(text, px, py);
  }

  drawGoal() {
    const c = this.context;
    const [px, py] = this.view.toScreen(...this.goal);
    c.strokeStyle = this.colour("yellow");
    c.lineWidth = 2.5;
    c.beginPath();
    c.moveTo(px - 9, py - 9);
    c.lineTo(px + 9, py + 9);
    c.moveTo(px + 9, py - 9);
    c.lineTo(px - 9, py + 9);
    c.stroke();
  }

  drawRobot({ x, y, theta }, colour, filled) {
    const c = this.context;
    const [px, py] = this.view.toScreen(x, y);
    const radius = Math.max(7, this.robot.radius * this.view.scale);
    c.save();
    c.translate(px, py);
    c.rotate(-theta);
    c.beginPath();
    c.arc(0, 0, radius, 0, 2 * Math.PI);
    c.lineWidth = 2.5;
    c.strokeStyle = colour;
    if (filled) {
      c.globalAlpha = 0.25;
      c.fillStyle = colour;
      c.fill();
      c.globalAlpha = 1;
    } else c.setLineDash([4, 3]);
    c.stroke();
    c.setLineDash([]);
    c.beginPath();
    c.moveTo(radius * 0.95, 0);
    c.lineTo(-radius * 0.35, radius * 0.5);
    c.lineTo(-radius * 0.35, -radius * 0.5);
    c.closePath();
    if (filled) {
      c.fillStyle = colour;
      c.fill();
    } else c.stroke();
    c.restore();
  }
}
