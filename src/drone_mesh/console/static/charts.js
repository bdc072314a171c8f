// Three small charts over simulated time. Hovering shows the values at one moment.

import { niceStep, readColours } from "./draw.js";

const LEFT_PX = 34;
const BOTTOM_PX = 17;
const TOP_PX = 8;
const RIGHT_PX = 8;
const BETWEEN_TIMES_PX = 10;
const SHOWN = 120; // samples, two minutes: the start of a large mesh would flatten all that follows
const RATE_OVER = 10; // samples; one check period of the mesh at normal speed

export class Charts {
  constructor(mesh) {
    this.mesh = mesh;
    this.colours = readColours();
    this.hover = null; // 0..1 across every chart
    this.whole = document.getElementById("charts-whole"); // pressed: all samples are shown
    this.whole.addEventListener("click", () => {
      this.whole.setAttribute("aria-pressed", !this.#isWhole());
      this.redraw();
    });
    this.charts = [
      {
        id: "share",
        top: () => 100,
        lines: [{ colour: "connected", fill: true, value: share }],
        text: (v) => (v[0] === null ? "–" : `${v[0].toFixed(0)} %`),
      },
      {
        id: "rate",
        lines: [{ colour: "accent", fill: true, value: (s) => s.rate }],
        text: (v) => v[0]?.toFixed(0) ?? "–",
      },
      {
        id: "hops",
        lines: [
          { colour: "accent", value: (s) => s.most_hops },
          { colour: "gateway", value: (s) => s.mean_hops },
        ],
        text: (v) => (v[0] === null ? "–" : `${v[1].toFixed(1)} / ${v[0]}`),
      },
    ];
    for (const chart of this.charts) {
      chart.canvas = document.getElementById(`chart-${chart.id}`);
      chart.now = document.getElementById(`${chart.id}-now`);
      new ResizeObserver(() => this.#draw(chart)).observe(chart.canvas);
      chart.canvas.addEventListener("pointermove", (event) =>
        this.#point(event.offsetX / chart.canvas.clientWidth),
      );
      chart.canvas.addEventListener("pointerleave", () => this.#point(null));
    }
    mesh.addEventListener(
      "frame",
      (event) => (event.detail.samples.length || event.detail.full) && this.redraw(),
    );
  }

  redraw() {
    this.samples = withRates(this.mesh.samples);
    if (!this.#isWhole()) this.samples = this.samples.slice(-SHOWN);
    for (const chart of this.charts) this.#draw(chart);
  }

  #isWhole() {
    return this.whole.getAttribute("aria-pressed") === "true";
  }

  themeChanged() {
    this.colours = readColours();
    this.redraw();
  }

  #point(at) {
    this.hover = at;
    this.redraw();
  }

  #draw(chart) {
    const samples = this.samples ?? [];
    const { clientWidth: width, clientHeight: height } = chart.canvas;
    if (!width || !height) return;
    const ratio = window.devicePixelRatio;
    chart.canvas.width = width * ratio;
    chart.canvas.height = height * ratio;
    const context = chart.canvas.getContext("2d");
    context.scale(ratio, ratio);
    context.font = "11px system-ui, sans-serif";
    if (samples.length < 2) {
      context.fillStyle = this.colours.muted;
      context.fillText("a few seconds of data are needed", LEFT_PX, height / 2);
      chart.now.textContent = "–";
      return;
    }
    const [start, end] = [samples[0].stamp_s, samples[samples.length - 1].stamp_s];
    const values = chart.lines.map((line) => samples.map(line.value));
    const step = niceStep(Math.max(...values.flat(), 1) / 3);
    const top =
      chart.top?.() ?? Math.max(step, Math.ceil(Math.max(...values.flat()) / step) * step);
    const x = (t) => LEFT_PX + ((t - start) / (end - start || 1)) * (width - LEFT_PX - RIGHT_PX);
    const y = (value) => height - BOTTOM_PX - (value / top) * (height - BOTTOM_PX - TOP_PX);
    this.#axes(context, x, y, width, height, start, end, top, chart.top ? 50 : step);
    chart.lines.forEach((line, index) => {
      const points = samples.map((s, i) => [
        x(s.stamp_s),
        values[index][i] === null ? null : y(values[index][i]),
      ]);
      this.#line(context, points, line, y(0));
    });
    chart.now.textContent = this.#reading(
      context,
      chart,
      samples,
      values,
      x,
      y,
      start,
      end,
      height,
    );
  }

  #axes(context, x, y, width, height, start, end, top, step) {
    context.strokeStyle = this.colours.grid;
    context.fillStyle = this.colours.muted;
    context.lineWidth = 1;
    context.textAlign = "right";
    context.beginPath();
    for (let value = 0; value <= top * 1.001; value += step) {
      context.moveTo(LEFT_PX, Math.round(y(value)) + 0.5);
      context.lineTo(width - RIGHT_PX, Math.round(y(value)) + 0.5);
      context.fillText(label(value), LEFT_PX - 5, y(value) + 4);
    }
    context.stroke();
    const room = context.measureText(`${end.toFixed(0)} s`).width + BETWEEN_TIMES_PX;
    const spacing = niceStep(((end - start) * room) / Math.max(width - LEFT_PX, 1) || 1);
    context.textAlign = "left";
    let [ticks, free] = [0, 0]; // free: px, where the previous text ends
    for (let t = Math.ceil(start / spacing) * spacing; t <= end; t += spacing) {
      const text = `${Number(t.toPrecision(6))} s`;
      const wide = context.measureText(text).width;
      const left = Math.min(x(t) - wide / 2, width - 1 - wide);
      if (left < free) continue;
      context.fillText(text, left, height - 4);
      free = left + wide + BETWEEN_TIMES_PX / 2;
      ticks++;
    }
    context.canvas.dataset.ticks = ticks;
  }

  /** One line, with gaps where there is no value. */
  #line(context, points, line, base) {
    context.strokeStyle = context.fillStyle = this.colours[line.colour];
    context.lineWidth = 1.75;
    context.lineJoin = "round";
    for (const run of runsOf(points)) {
      context.beginPath();
      run.forEach(([px, py], i) => (i ? context.lineTo(px, py) : context.moveTo(px, py)));
      context.stroke();
      if (!line.fill) continue;
      context.lineTo(run[run.length - 1][0], base);
      context.lineTo(run[0][0], base);
      context.globalAlpha = 0.12;
      context.fill();
      context.globalAlpha = 1;
    }
  }

  /** The words above a chart: the newest values, or those under the pointer. */
  #reading(context, chart, samples, values, x, y, start, end, height) {
    let index = samples.length - 1;
    if (this.hover !== null) {
      const px = this.hover * chart.canvas.clientWidth;
      index = samples.reduce(
        (best, s, i) =>
          Math.abs(x(s.stamp_s) - px) < Math.abs(x(samples[best].stamp_s) - px) ? i : best,
        0,
      );
      context.strokeStyle = this.colours.muted;
      context.beginPath();
      context.moveTo(x(samples[index].stamp_s), TOP_PX);
      context.lineTo(x(samples[index].stamp_s), height - BOTTOM_PX);
      context.stroke();
    }
    const reading = chart.text(values.map((list) => list[index]));
    return this.hover === null ? reading : `${reading} at ${samples[index].stamp_s.toFixed(0)} s`;
  }
}

/** Runs of [x, y] without a gap; y is null in gaps. */
function runsOf(points) {
  const runs = [[]];
  for (const point of points) {
    if (point[1] !== null) runs[runs.length - 1].push(point);
    else if (runs[runs.length - 1].length) runs.push([]);
  }
  return runs.filter((run) => run.length);
}

/** A value beside an axis, in at most four characters up to a million: 5000, 15k. */
function label(value) {
  return value < 10000
    ? String(Number(value.toPrecision(3)))
    : `${Number((value / 1000).toPrecision(3))}k`;
}

/** Percent of the routers that are on; null while none is. */
function share(sample) {
  return sample.routers_on ? (100 * sample.routers_connected) / sample.routers_on : null;
}

/** Messages per simulated second, over a few samples, because nodes send in bursts. */
function withRates(samples) {
  return samples.map((sample, i) => {
    const before = samples[Math.max(0, i - RATE_OVER)];
    const seconds = sample.stamp_s - before.stamp_s;
    return {
      ...sample,
      rate: seconds > 0 ? Math.max(0, sample.messages - before.messages) / seconds : null,
    };
  });
}
