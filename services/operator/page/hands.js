// Mouse, touch and keys on the map.

import { tenths } from "./dom.js";
import { simplify } from "./path.js";

const GRAB_PX = { mouse: 9, touch: 18 };
const CLICK_PX = 5;
const FREEHAND_PX = 2.5;

export class Hands {
  constructor(picture, said) {
    this.picture = picture;
    this.view = picture.view;
    this.path = picture.path;
    this.canvas = picture.canvas;
    this.said = said;
    this.tool = "draw";
    this.pointers = new Map();
    this.held = null;
    const on = (event, what) => this.canvas.addEventListener(event, what);
    on("pointerdown", (event) => this.down(event));
    on("pointermove", (event) => this.move(event));
    on("pointerup", (event) => this.up(event));
    on("pointercancel", (event) => this.up(event, true));
    on("pointerleave", () => this.said.cursor(null));
    on("contextmenu", (event) => event.preventDefault());
    on("wheel", (event) => {
      event.preventDefault();
      const [px, py] = this.at(event);
      this.view.zoom(Math.exp(-event.deltaY * (event.deltaMode ? 0.05 : 0.0015)), px, py);
    });
    this.canvas.addEventListener("keydown", (event) => this.key(event));
  }

  use(tool) {
    this.tool = tool;
    this.canvas.dataset.tool = tool;
  }

  at(event) {
    const box = this.canvas.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  }

  nearest(px, py, pointer) {
    let [best, least] = [-1, GRAB_PX[pointer] ?? GRAB_PX.mouse];
    this.path.points.forEach(([x, y], i) => {
      const [qx, qy] = this.view.toScreen(x, y);
      const d = Math.hypot(qx - px, qy - py);
      if (d < least) [best, least] = [i, d];
    });
    return best;
  }

  down(event) {
    this.canvas.setPointerCapture(event.pointerId);
    this.canvas.focus({ preventScroll: true });
    const [px, py] = this.at(event);
    this.pointers.set(event.pointerId, [px, py]);
    if (this.pointers.size === 2) {
      // A second finger: move and zoom, whatever the first one began.
      if (this.held?.kind === "waypoint" && this.held.moved) this.path.undo();
      this.picture.stroke = null;
      this.held = { kind: "pinch" };
      return;
    }
    const pans = event.button !== 0 || this.tool === "pan";
    this.held = { kind: pans ? "pan" : "click", px, py, moved: false };
    if (pans) return;
    if (this.tool === "draw") {
      const index = this.nearest(px, py, event.pointerType);
      // With Shift there is always room for one more.
      if (index >= 0 && !event.shiftKey) {
        this.path.select(index);
        this.held.kind = "waypoint";
        this.held.index = index;
      }
    } else if (this.tool === "free") {
      this.held.kind = "stroke";
      this.picture.stroke = [this.view.toWorld(px, py)];
    }
  }

  move(event) {
    const [px, py] = this.at(event);
    this.said.cursor(this.view.toWorld(px, py));
    const before = this.pointers.get(event.pointerId);
    if (!before || !this.held) return;
    const { held } = this;
    if (held.kind === "pinch") {
      this.pinch(event.pointerId, [px, py]);
      return;
    }
    const begins = !held.moved && Math.hypot(px - held.px, py - held.py) > CLICK_PX;
    if (begins) held.moved = true;
    if (held.kind === "waypoint" && held.moved) {
      this.path.move(held.index, ...this.view.toWorld(px, py), begins);
    } else if (held.kind === "stroke") {
      const stroke = this.picture.stroke;
      const last = this.view.toScreen(...stroke[stroke.length - 1]);
      if (Math.hypot(px - last[0], py - last[1]) >= FREEHAND_PX) stroke.push(this.view.toWorld(px, py));
      this.picture.touch();
    } else if ((held.kind === "pan" || held.kind === "click") && held.moved) {
      this.view.pan(px - before[0], py - before[1]);
      this.said.moved();
    }
    this.pointers.set(event.pointerId, [px, py]);
  }

  pinch(id, now) {
    const others = [...this.pointers].filter(([other]) => other !== id);
    const [, fixed] = others[0];
    const was = this.pointers.get(id);
    const [before, after] = [Math.hypot(was[0] - fixed[0], was[1] - fixed[1]), Math.hypot(now[0] - fixed[0], now[1] - fixed[1])];
    this.view.pan((now[0] - was[0]) / 2, (now[1] - was[1]) / 2);
    if (before > 1) this.view.zoom(after / before, (now[0] + fixed[0]) / 2, (now[1] + fixed[1]) / 2);
    this.pointers.set(id, now);
    this.said.moved();
  }

  up(event, cancelled = false) {
    const [px, py] = this.at(event);
    this.pointers.delete(event.pointerId);
    const held = this.held;
    if (!held || (held.kind === "pinch" && this.pointers.size)) return;
    this.held = null;
    if (cancelled) {
      this.picture.stroke = null;
      this.picture.touch();
    } else if (held.kind === "stroke") this.endStroke();
    else if (held.kind === "click" && !held.moved) {
      const [x, y] = this.view.toWorld(px, py).map(tenths);
      if (this.tool === "goal") this.said.goal(x, y);
      else if (!this.path.add(x, y)) this.said.full();
    }
  }

  /** A freehand line goes on from the path's end. */
  endStroke() {
    const stroke = this.picture.stroke ?? [];
    this.picture.stroke = null;
    if (stroke.length > 1) {
      const few = simplify(stroke, Math.max(0.002, 3 / this.view.scale));
      const points = few.map((point) => point.map(tenths));
      this.path.replace([...this.path.points, ...points]);
      this.path.select(this.path.points.length - 1);
    }
    this.picture.touch();
  }

  key(event) {
    const arrows = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
    const { path, view } = this;
    const step = event.shiftKey ? 0.001 : 0.01;
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (arrows[event.key]) {
      const [dx, dy] = arrows[event.key];
      if (path.selected >= 0 && this.tool === "draw") {
        const [x, y] = path.points[path.selected];
        path.move(path.selected, tenths(x + dx * step), tenths(y + dy * step));
      } else {
        view.pan(-40 * dx, 40 * dy);
        this.said.moved();
      }
    } else if (event.key === "Enter" && this.tool === "goal") this.said.goal(tenths(view.x), tenths(view.y));
    else if (event.key === "Enter") path.add(tenths(view.x), tenths(view.y));
    else if ((event.key === "n" || event.key === "b") && path.points.length) {
      const count = path.points.length;
      const from = path.selected < 0 ? (event.key === "n" ? -1 : count) : path.selected;
      path.select((from + (event.key === "n" ? 1 : -1) + count) % count);
    } else return;
    event.preventDefault();
  }
}
