// The page's picture, its controls and the time that is shown. Positions are in metres, or section lengths, in the base frame, z up.
import { reach } from "./backbone.js";
import { HUES, colourOf } from "./colours.js";
import { Motion } from "./motion.js";
import { Plot } from "./plot.js";
import { floats } from "./samples.js";
import { Obstacles, Stage } from "./stage.js";

// Least time between two drawings of a tip path that grows.
const TIP_PATH_MS = 200;
// Of so many motions or fewer all are shown from the beginning.
const FEW = 4;

export const element = (id) => document.getElementById(id);

function checkbox(parent, name, hue, on, change) {
  const item = document.createElement("label");
  const box = Object.assign(document.createElement("input"), { type: "checkbox", checked: on });
  box.addEventListener("change", () => change(box.checked));
  item.append(box);
  if (hue) item.append(Object.assign(document.createElement("i"), { style: `background: ${hue}` }));
  item.append(Object.assign(document.createElement("span"), { textContent: name }));
  parent.append(item);
  return { item, box };
}

export class Viewer {
  // What `pcc view` tells; samples that more are added to are arrays.
  constructor(view, samples = floats) {
    const { robot, solids } = view;
    Object.assign(this, { view, samples });
    this.span = { from_s: 0, until_s: view.duration_s };
    this.now = 0;
    this.isPlaying = false;
    this.byClearance = false;
    this.stage = new Stage(element("scene"), reach(robot.section_lengths), robot.tube_radii[0], () => this.draw());
    this.obstacles = new Obstacles(solids);
    this.stage.scene.add(this.obstacles.group);
    this.motions = [];
    this.take(view);
    this.plot = new Plot(element("plot"), this.span, (time) => this.goTo(time));
    this.layers();
    this.buttons();
    this.scale();
    this.time();
    window.addEventListener("resize", () => this.fit());
    this.fit();
    this.stage.look("Front");
  }

  // What a view tells, in place of what there was; motions of the same name stay on or off.
  take({ balls, motions, curves, marks }) {
    const wasOn = new Map(this.motions.map((motion) => [motion.name, motion.group.visible]));
    for (const motion of this.motions) this.removeMotion(motion);
    this.added = 0;
    this.marks = marks;
    this.obstacles.tracks = balls;
    motions.forEach((motion) => this.addMotion(motion, wasOn.get(motion.name) ?? (motion.is_selected || motions.length <= FEW)));
    this.curves = curves.map((set) => ({ ...set, time: this.samples(set.time_s), values: set.values.map(this.samples) }));
  }

  addMotion(motion, on) {
    const { samples, view } = this;
    const index = this.added++;
    const shown = new Motion({
      name: motion.name,
      hue: HUES[index % HUES.length],
      depth: motion.is_selected ? 0 : 1 + (index % 16),
      robot: view.robot,
      range: view.clearance_range,
      stays: motion.stays,
      isSolid: motion.is_selected,
      time: samples(motion.time_s),
      zeta: samples(motion.configurations_rad),
      clearance: samples(motion.clearance),
    });
    shown.group.visible = on;
    const item = document.createElement("li");
    shown.row = item;
    shown.box = checkbox(item, motion.name, shown.hue, on, (isOn) => {
      shown.group.visible = isOn;
      this.draw();
    }).box;
    element("motions").append(item);
    this.motions.push(shown);
    this.stage.scene.add(shown.group);
    return shown;
  }

  removeMotion(motion) {
    this.motions = this.motions.filter((it) => it !== motion);
    motion.row.remove();
    motion.dispose();
  }

  // --- What is switched on and off.
  layers() {
    const layers = [
      ["Obstacles", (on) => { this.obstacles.group.visible = on; }],
      ["Bodies", (on) => { this.hasBodies = on; }],
      ["Tip paths", (on) => { this.hasTipPaths = on; }],
      ["Ground", (on) => { this.stage.ground.visible = on; }],
    ];
    for (const [name, show] of layers) {
      show(true);
      checkbox(element("layers"), name, null, true, (on) => {
        show(on);
        this.draw();
      });
    }
  }

  switchAll(on) {
    for (const motion of this.motions) motion.box.checked = motion.group.visible = on;
    this.draw();
  }

  buttons() {
    element("all").addEventListener("click", () => this.switchAll(true));
    element("none").addEventListener("click", () => this.switchAll(false));
    for (const name of ["Front", "Side", "Top"]) {
      const button = Object.assign(document.createElement("button"), { textContent: name });
      button.addEventListener("click", () => this.stage.look(name));
      element("views").append(button);
    }
    element("colour").addEventListener("change", (event) => {
      this.byClearance = event.target.value === "clearance";
      this.draw();
    });
  }

  lengthText(length) {
    return this.view.unit === "m" ? `${(1e3 * length).toFixed(1)} mm` : `${length.toFixed(3)} ${this.view.unit}`;
  }

  scale() {
    const range = this.view.clearance_range;
    const [least, most] = range;
    element("least").textContent = this.lengthText(least);
    element("most").textContent = this.lengthText(most);
    const colours = [0, 0.5, 1].map((part) => `#${colourOf(least + part * (most - least), range).getHexString()}`);
    element("bar").style.background = `linear-gradient(90deg, ${colours.join()})`;
    element("key").hidden = element("colouring").hidden = !(most > least);
  }

  // --- Time.
  time() {
    this.curves.forEach((curves, index) => element("curves").add(new Option(`${curves.name}, ${curves.unit}`, index)));
    if (this.curves.length === 0) element("under").hidden = true;
    element("curves").addEventListener("change", () => {
      this.legend();
      this.draw();
    });
    this.legend();
    element("time").addEventListener("input", (event) => this.goTo(Number(event.target.value)));
    element("play").addEventListener("click", () => this.play(!this.isPlaying));
  }

  legend() {
    const curves = this.curves[element("curves").value || 0];
    const entries = (curves?.labels ?? []).map((label, index) => {
      const entry = Object.assign(document.createElement("span"), { textContent: label });
      entry.style.setProperty("--of", HUES[index % HUES.length]);
      return entry;
    });
    if (this.marks.length > 0) entries.push(Object.assign(document.createElement("span"), { textContent: "another motion", className: "mark" }));
    element("legend").replaceChildren(...entries);
  }

  play(on) {
    this.isPlaying = on;
    element("play").textContent = on ? "Pause" : "Play";
    if (!on) return;
    if (this.now >= this.span.until_s) this.now = this.span.from_s;
    let before = performance.now();
    const advance = (stamp) => {
      if (!this.isPlaying) return;
      this.now += Math.max(stamp - before, 0) * 1e-3 * element("speed").value;
      before = stamp;
      if (this.now >= this.span.until_s) this.atEnd();
      this.draw();
      requestAnimationFrame(advance);
    };
    requestAnimationFrame(advance);
  }

  atEnd() {
    this.now = this.span.until_s;
    this.play(false);
  }

  goTo(time) {
    this.now = time;
    this.draw();
  }

  // Tells the time at once; the picture comes with the browser's next frame, whatever is changed until then.
  draw() {
    const { from_s, until_s } = this.span;
    Object.assign(element("time"), { min: from_s, max: until_s, value: this.now });
    element("now").textContent = `${this.now.toFixed(2)} of ${until_s.toFixed(2)} s`;
    this.awaited ??= requestAnimationFrame(() => {
      this.awaited = null;
      this.picture();
    });
  }

  picture() {
    this.obstacles.place(this.now);
    const shown = this.motions.filter((motion) => motion.group.visible);
    for (const motion of shown) {
      motion.tipPath.visible = this.hasTipPaths && motion.time.length > 1;
      if (motion.tipPath.visible) motion.drawTipPath(TIP_PATH_MS);
      motion.place(this.now, this.byClearance, this.hasBodies);
    }
    const there = shown.filter((motion) => motion.isThere(this.now));
    const least = Math.min(...there.map((motion) => motion.clearanceAt(this.now)).filter(Number.isFinite));
    element("clearance").textContent = Number.isFinite(least) ? `clearance ${this.lengthText(least)}` : "no obstacle";
    this.stage.render();
    const curves = this.curves[element("curves").value || 0];
    if (curves) this.plot.draw(curves, this.marks, this.now);
  }

  // What the page shows, and how many pictures there were: for a program that looks at it. What has just changed is in the next picture.
  shown() {
    const { camera, controls, ground, renderer } = this.stage;
    return {
      now_s: this.now,
      ...this.span,
      pictures: renderer.info.render.frame,
      camera: camera.position.clone().sub(controls.target).toArray(),
      ground: ground.visible,
      obstacles: this.obstacles.shown(),
      motions: this.motions.map((motion) => motion.seen()),
      curves: this.plot.curves,
    };
  }

  fit() {
    const { clientWidth, clientHeight } = element("picture");
    this.stage.fit(clientWidth, clientHeight);
    this.draw();
  }
}
