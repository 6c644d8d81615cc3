// Live plots of the last minute.

const SECONDS = 60;
/** Samples that are kept: 30 a second. */
const HELD = 2000;
/** The least that an axis reaches over: mm or mm/s. */
const LEAST_SPAN = 1;
/** Steps between the labels of an axis. */
const MOST_STEPS = 3;

/** Decades of the bars that have each a label. */
const MOST_DECADES = 4;

function colour(name) {
  return getComputedStyle(document.body).getPropertyValue(`--${name}`).trim();
}

/** A piece of a line, for a legend. */
export function lineSample(ink, dash, width = 2.5) {
  const svg = document.createElementNS("http://www.w3.org/2000/svg", "svg");
  svg.setAttribute("width", "22");
  svg.setAttribute("height", "6");
  svg.setAttribute("aria-hidden", "true");
  const line = document.createElementNS("http://www.w3.org/2000/svg", "line");
  const set = { x1: 0, y1: 3, x2: 22, y2: 3, stroke: `var(--${ink})`, "stroke-width": width, "stroke-dasharray": dash };
  for (const [name, value] of Object.entries(set)) line.setAttribute(name, value);
  svg.append(line);
  return svg;
}

/** Labels of an axis that reaches over low, high and nought: round numbers, the outermost at its ends. */
export function labels(low = 0, high = 0) {
  [low, high] = [Math.min(low, 0), Math.max(high, 0)];
  if (high - low < LEAST_SPAN) [low, high] = [Math.min(low, -LEAST_SPAN / 2), Math.max(high, LEAST_SPAN / 2)];
  const decade = 10 ** Math.floor(Math.log10((high - low) / MOST_STEPS));
  // The finest that needs no more labels than there is room for: two steps then, or more.
  for (const step of [1, 2, 2.5, 5, 10, 20].map((n) => n * decade)) {
    const [from, to] = [Math.floor(low / step + 1e-6), Math.ceil(high / step - 1e-6)];
    if (to - from <= MOST_STEPS) return Array.from({ length: to - from + 1 }, (_, i) => +((from + i) * step).toPrecision(6));
  }
  return [low, 0, high];
}

/** Says so where there is nothing to be seen. */
function mark(host, full) {
  if (full) delete host.dataset.empty;
  else host.dataset.empty = "nothing yet: it has not been armed";
}

/** A plot of values over time, newest at the right. */
export class Strip {
  constructor(host, series, unit) {
    this.host = host;
    this.names = series;
    this.unit = unit;
    this.labels = labels();
    this.data = [[], ...series.map(() => [])];
    this.legend();
    this.build();
    new ResizeObserver(() => this.plot.setSize(this.size())).observe(host);
    matchMedia("(prefers-color-scheme: light)").addEventListener("change", () => {
      this.plot.destroy();
      this.build();
    });
  }

  /** Line, name and newest value of each series, in the caption. */
  legend() {
    this.newest = this.names.map(({ label, ink, dash, width }) => {
      const item = document.createElement("span");
      item.className = "key";
      item.append(lineSample(ink, dash?.join(" ") ?? "", width), ` ${label} `);
      const value = document.createElement("b");
      item.append(value);
      this.host.previousElementSibling.append(item);
      return value;
    });
  }

  size() {
    return { width: Math.max(120, this.host.clientWidth), height: Math.max(60, this.host.clientHeight) };
  }

  build() {
    const axis = { stroke: colour("dim"), grid: { stroke: colour("grid"), width: 1 }, ticks: { show: false }, font: "11px system-ui, sans-serif" };
    this.plot = new uPlot(
      {
        ...this.size(),
        padding: [8, 8, 0, 0],
        cursor: { drag: { x: false, y: false } },
        legend: { show: false },
        scales: { x: { time: false }, y: { range: (_, low, high) => this.range(low, high) } },
        axes: [{ ...axis, size: 22, values: (_, ticks) => ticks.map((t) => `${t} s`) }, { ...axis, size: 60, splits: () => this.labels, values: (_, ticks) => ticks.map((t, i) => (i + 1 < ticks.length ? `${t}` : `${t} ${this.unit}`)) }],
        series: [
          {},
          ...this.names.map(({ label, ink, dash, width = 1.8 }) => ({ label, stroke: colour(ink), width, dash, points: { show: false } })),
        ],
      },
      this.data,
      this.host,
    );
  }

  range(low, high) {
    this.labels = Number.isFinite(low) && Number.isFinite(high) ? labels(low, high) : labels();
    return [this.labels[0], this.labels.at(-1)];
  }

  push(t, values) {
    const times = this.data[0];
    if (times.length && t <= times[times.length - 1]) {
      if (t < times[times.length - 1] - 1) this.clear();
      else return;
    }
    times.push(t);
    values.forEach((value, i) => this.data[i + 1].push(value));
    let old = 0;
    while (times[old] < t - SECONDS) old++;
    old = Math.max(old, times.length - HELD);
    if (old > 0) this.data.forEach((column) => column.splice(0, old));
  }

  clear() {
    this.data.forEach((column) => column.splice(0));
  }

  draw() {
    mark(this.host, this.data[0].length > 0);
    this.newest.forEach((place, i) => {
      const value = this.data[i + 1].at(-1);
      place.textContent = value == null ? "–" : value.toFixed(1).replace(/^-0\.0$/, "0.0");
    });
    this.plot.setData(this.data);
  }
}

/** How many ticks were how late: bars over powers of two, heights in powers of ten. */
export class Bars {
  constructor(host) {
    this.host = host;
    this.canvas = document.createElement("canvas");
    this.canvas.setAttribute("role", "img");
    host.append(this.canvas);
    this.buckets = [];
    new ResizeObserver(() => this.draw()).observe(host);
    matchMedia("(prefers-color-scheme: light)").addEventListener("change", () => this.draw());
  }

  /** Buckets are [upper bound in µs, count]. */
  show(buckets, quantiles) {
    this.buckets = buckets;
    mark(this.host, buckets.length > 0);
    const text = quantiles ? `half within ${quantiles.p50} µs, 99 % within ${quantiles.p99} µs, worst ${quantiles.max} µs` : "nothing measured yet";
    this.canvas.setAttribute("aria-label", `Lateness of the tick: ${text}`);
    this.quantiles = quantiles;
    this.draw();
  }

  draw() {
    const ratio = devicePixelRatio || 1;
    const [width, height] = [this.host.clientWidth, this.host.clientHeight];
    this.canvas.style.width = `${width}px`;
    this.canvas.style.height = `${height}px`;
    this.canvas.width = Math.round(width * ratio);
    this.canvas.height = Math.round(height * ratio);
    const c = this.canvas.getContext("2d");
    c.setTransform(ratio, 0, 0, ratio, 0, 0);
    c.clearRect(0, 0, width, height);
    c.font = "11px system-ui, sans-serif";
    c.fillStyle = colour("dim");
    if (!this.buckets.length) return;
    const [left, bottom, top] = [34, 18, 16];
    const tallest = Math.max(1, ...this.buckets.map(([, n]) => n));
    const decades = Math.max(1, Math.ceil(Math.log10(tallest + 1)));
    const wide = (width - left - 14) / this.buckets.length;
    const up = (n) => (n > 0 ? ((height - bottom - top) * Math.log10(n + 1)) / decades : 0);
    for (let d = 0; d <= decades; d++) {
      const y = height - bottom - up(10 ** d - 1);
      c.strokeStyle = colour("grid");
      c.beginPath();
      c.moveTo(left, y + 0.5);
      c.lineTo(width, y + 0.5);
      c.stroke();
      c.textAlign = "right";
      // Every other one, where there are many.
      if (decades > MOST_DECADES && (decades - d) % 2) continue;
      c.fillText(d === 0 ? "0" : `10${[..."⁰¹²³⁴⁵⁶⁷⁸⁹"][d] ?? ""}`, left - 4, y + 4);
    }
    this.buckets.forEach(([bound, n], i) => {
      c.fillStyle = bound > 1000 ? colour("red") : bound > 100 ? colour("orange") : colour("blue");
      const h = up(n);
      c.fillRect(left + i * wide + 1, height - bottom - h, Math.max(1, wide - 2), h);
      c.fillStyle = colour("dim");
      c.textAlign = "center";
      if (i % Math.ceil(this.buckets.length / 7) === 0) c.fillText(bound >= 1000 ? `${Math.round(bound / 1000)} ms` : `${bound}`, left + (i + 0.5) * wide, height - 4);
    });
    if (this.quantiles) {
      c.textAlign = "right";
      c.fillStyle = colour("ink");
      c.fillText(`p50 ${this.quantiles.p50}  p99 ${this.quantiles.p99}  max ${this.quantiles.max} µs`, width - 4, 11);
    }
  }
}
