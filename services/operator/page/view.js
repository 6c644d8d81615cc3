// Where the world lies on the canvas: x to the right, y up, metres.

export class View {
  /** `margins()` tells what of the canvas' edges is covered, px: top, bottom, side. */
  constructor(canvas, changed, margins) {
    this.canvas = canvas;
    this.changed = changed;
    this.margins = margins;
    this.scale = 400; // pixels a metre
    this.x = 0;
    this.y = 0; // world point in the middle
    this.box = null; // what was fitted, until somebody moves
    new ResizeObserver(() => this.resize()).observe(canvas);
    this.resize();
  }

  resize() {
    const ratio = devicePixelRatio || 1;
    const { width, height } = this.canvas.getBoundingClientRect();
    this.width = width;
    this.height = height;
    this.canvas.width = Math.max(1, Math.round(width * ratio));
    this.canvas.height = Math.max(1, Math.round(height * ratio));
    this.canvas.getContext("2d").setTransform(ratio, 0, 0, ratio, 0, 0);
    if (this.box) this.fit(this.box);
    this.changed();
  }

  toScreen(x, y) {
    return [this.width / 2 + (x - this.x) * this.scale, this.height / 2 - (y - this.y) * this.scale];
  }

  toWorld(px, py) {
    return [this.x + (px - this.width / 2) / this.scale, this.y - (py - this.height / 2) / this.scale];
  }

  shows(x, y) {
    const [px, py] = this.toScreen(x, y);
    return px >= 0 && py >= 0 && px <= this.width && py <= this.height;
  }

  zoom(factor, px = this.width / 2, py = this.height / 2) {
    const [x, y] = this.toWorld(px, py);
    this.scale = Math.min(1e5, Math.max(0.5, this.scale * factor));
    const [nx, ny] = this.toWorld(px, py);
    this.centre(this.x + x - nx, this.y + y - ny);
  }

  pan(dx, dy) {
    this.centre(this.x - dx / this.scale, this.y + dy / this.scale);
  }

  centre(x, y) {
    this.x = x;
    this.y = y;
    this.box = null;
    this.changed();
  }

  /** Shows a box [x0, y0, x1, y1] whole, in another size of the window as well. */
  fit(box) {
    const [x0, y0, x1, y1] = box;
    const { top, bottom, side } = this.margins();
    const span = (a, b) => Math.max(b - a, 0.2);
    this.scale = Math.min((this.width - 2 * side) / span(x0, x1), (this.height - top - bottom) / span(y0, y1));
    this.scale = Math.min(4000, Math.max(0.5, this.scale));
    this.centre((x0 + x1) / 2, (y0 + y1) / 2 + (top - bottom) / 2 / this.scale);
    this.box = box;
  }
}
