// Curves over time on a canvas, a line at the time that is shown, and dashed lines at marks.
import { HUES } from "./colours.js";
import { indexAt } from "./samples.js";

const MARGIN = { left: 52, right: 10, top: 6, bottom: 18 };
// Least distance between two marks, pixels.
const MARK_PX = 4;
// Drawn by the processor: without a graphics card, long thin lines take 0.4 s of the page's first picture otherwise.
const SOFTWARE = { willReadFrequently: true };

// Round numbers between two others, at most so many, and how many digits they need.
function ticks(low, high, most) {
  const rough = (high - low) / most;
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].find((factor) => factor * power >= rough * (1 - 1e-9)) * power;
  const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
  const first = Math.ceil(low / step - 1e-9);
  const count = Math.floor(high / step + 1e-9) - first + 1;
  return { values: Array.from({ length: Math.max(count, 0) }, (_, index) => (first + index) * step), digits };
}

export class Plot {
  // `span` is the time from `from_s` to `until_s` that the plot has; it may change.
  constructor(canvas, span, goTo) {
    // What stays while the time goes on is drawn once.
    const still = document.createElement("canvas");
    Object.assign(this, { canvas, span, still, pen: still.getContext("2d", SOFTWARE), drawn: "" });
    canvas.addEventListener("click", (event) => {
      const share = (event.offsetX - MARGIN.left) / (canvas.clientWidth - MARGIN.left - MARGIN.right);
      goTo(span.from_s + Math.min(Math.max(share, 0), 1) * (span.until_s - span.from_s));
    });
  }

  x(time) {
    const { from_s, until_s } = this.span;
    return MARGIN.left + ((time - from_s) / Math.max(until_s - from_s, 1e-9)) * (this.width - MARGIN.left - MARGIN.right);
  }

  y(value) {
    return MARGIN.top + ((this.high - value) / (this.high - this.low)) * (this.height - MARGIN.top - MARGIN.bottom);
  }

  draw(curves, marks, now) {
    const { canvas, still } = this;
    const ratio = window.devicePixelRatio || 1;
    const style = getComputedStyle(canvas);
    [this.width, this.height] = [canvas.clientWidth, canvas.clientHeight];
    if (this.width < 1 || this.height < 1) return;
    const all = [curves.name, curves.time.length, marks.length, this.span.from_s, this.span.until_s, this.width, this.height, ratio, style.color].join();
    if (all !== this.drawn) {
      this.drawn = all;
      this.drawStill(curves, marks, ratio, style);
    }
    [canvas.width, canvas.height] = [still.width, still.height];
    const pen = canvas.getContext("2d", SOFTWARE);
    pen.drawImage(still, 0, 0);
    pen.scale(ratio, ratio);
    pen.strokeStyle = style.color;
    pen.lineWidth = 1.5;
    this.upright(pen, now);
  }

  drawStill(curves, marks, ratio, style) {
    const { still, pen } = this;
    this.curves = curves.name;
    [still.width, still.height] = [this.width * ratio, this.height * ratio];
    pen.scale(ratio, ratio);
    const [soft, line] = ["--soft", "--line"].map((name) => style.getPropertyValue(name));
    this.measure(curves);
    pen.font = "11px system-ui, sans-serif";
    this.axes(soft, line);
    pen.setLineDash([4, 3]);
    pen.strokeStyle = soft;
    pen.globalAlpha = 0.6;
    this.marks(marks);
    pen.globalAlpha = 1;
    pen.setLineDash([]);
    curves.values.forEach((values, index) => this.curve(curves.time, values, HUES[index % HUES.length]));
  }

  measure(curves) {
    [this.low, this.high] = [Infinity, -Infinity];
    for (const values of curves.values) {
      for (const value of values) {
        if (value < this.low) this.low = value;
        if (value > this.high) this.high = value;
      }
    }
    const room = 0.05 * (this.high - this.low);
    [this.low, this.high] = room > 1e-9 ? [this.low - room, this.high + room] : [(this.low || 0) - 1e-3, (this.high || 0) + 1e-3];
    if (!Number.isFinite(room)) [this.low, this.high] = [-1, 1];
  }

  axes(soft, line) {
    const { pen, width, height } = this;
    pen.fillStyle = soft;
    pen.strokeStyle = line;
    pen.lineWidth = 1;
    pen.textAlign = "right";
    const upright = ticks(this.low, this.high, 4);
    for (const value of upright.values) {
      pen.fillText((value || 0).toFixed(upright.digits), MARGIN.left - 5, this.y(value) + 4);
      pen.beginPath();
      pen.moveTo(MARGIN.left, this.y(value));
      pen.lineTo(width - MARGIN.right, this.y(value));
      pen.stroke();
    }
    const { from_s, until_s } = this.span;
    if (!(until_s > from_s)) return;
    const level = ticks(from_s, until_s, width < 500 ? 4 : 8);
    for (const time of level.values) {
      const text = `${time.toFixed(level.digits)} s`;
      const half = pen.measureText(text).width / 2;
      pen.textAlign = "center";
      pen.fillText(text, Math.min(Math.max(this.x(time), MARGIN.left + half), width - half - 1), height - 4);
    }
  }

  curve(times, values, hue) {
    const { pen } = this;
    const first = indexAt(times, this.span.from_s);
    const every = Math.max(1, Math.floor((times.length - first) / this.width));
    pen.strokeStyle = hue;
    pen.lineWidth = 1.2;
    pen.beginPath();
    for (let i = first; i < times.length; i += every) pen.lineTo(Math.max(this.x(times[i]), MARGIN.left), this.y(values[i]));
    pen.stroke();
  }

  // Those that are too near to each other are drawn once.
  marks(marks) {
    let before = MARGIN.left - 1;
    for (const { time_s } of marks) {
      if (this.x(time_s) < before + MARK_PX) continue;
      before = this.x(time_s);
      this.upright(this.pen, time_s);
    }
  }

  upright(pen, time) {
    pen.beginPath();
    pen.moveTo(this.x(time), MARGIN.top);
    pen.lineTo(this.x(time), this.height - MARGIN.bottom);
    pen.stroke();
  }
}
