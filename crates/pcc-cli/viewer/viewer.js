// The page that `pcc view` writes: the robot as tubes among its obstacles, motions to switch on and off, their tip paths coloured by
// clearance, a time bar and the curves under it. Positions are in metres, or section lengths, in the base frame, z up; configurations in radians.
import * as THREE from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";

const data = JSON.parse(document.getElementById("data").textContent);
const element = (id) => document.getElementById(id);
const HUES = ["#2a6fb8", "#c2571a", "#2f8f5b", "#8a4fb0", "#b58a00", "#14868c", "#c23b6b", "#6b7a1f", "#4d57c4", "#8c5a3c"];
const POINTS_OF_A_SECTION = 14;

// Arrays travel as base64 of little-endian f32.
function floats(text) {
  const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  return new Float32Array(bytes.buffer);
}

// --- Kinematics: sections of constant curvature, (ζ_x, ζ_y) along the axis of bending.
function backbone(zeta, at = 0) {
  const points = [new THREE.Vector3()];
  const ends = [];
  const turn = new THREE.Quaternion();
  const base = new THREE.Vector3();
  data.robot.section_lengths.forEach((length, section) => {
    const axis = new THREE.Vector3(zeta[at + 2 * section], zeta[at + 2 * section + 1], 0);
    const angle = axis.length();
    if (angle > 0) axis.divideScalar(angle);
    for (let i = 1; i <= POINTS_OF_A_SECTION; i++) {
      const part = i / POINTS_OF_A_SECTION;
      points.push(arcEnd(axis, angle * part, length * part).applyQuaternion(turn).add(base));
    }
    base.copy(points[points.length - 1]);
    ends.push(base.clone());
    turn.multiply(new THREE.Quaternion().setFromAxisAngle(axis, angle));
  });
  return { points, ends };
}

function arcEnd(axis, angle, length) {
  const [along, beside] = angle > 1e-6 ? [Math.sin(angle) / angle, (1 - Math.cos(angle)) / angle] : [1, angle / 2];
  return new THREE.Vector3(axis.y * beside, -axis.x * beside, along).multiplyScalar(length);
}

// --- The scene.
const renderer = new THREE.WebGLRenderer({ canvas: element("scene"), antialias: true });
const scene = new THREE.Scene();
const camera = new THREE.PerspectiveCamera(40, 1, 0.001, 100);
camera.up.set(0, 0, 1);
const controls = new OrbitControls(camera, renderer.domElement);
const reach = data.robot.section_lengths.reduce((sum, length) => sum + length, 0);
scene.add(new THREE.HemisphereLight(0xffffff, 0x8899aa, 2.2));
const sun = new THREE.DirectionalLight(0xffffff, 1.6);
sun.position.set(1, -2, 3);
scene.add(sun);
const grid = new THREE.GridHelper(2 * reach, 12, 0x8a96a3, 0xb9c2cb);
grid.rotation.x = Math.PI / 2;
scene.add(grid);

function look(direction) {
  controls.target.set(0, 0, 0.5 * reach);
  camera.position.copy(direction).normalize().multiplyScalar(2.9 * reach).add(controls.target);
  controls.update();
}

const VIEWS = [["Front view", [1.4, -2, 0.8]], ["Side view", [0, -1, 0.02]], ["Top view", [0.001, 0, 1]]];
let view = 0;
look(new THREE.Vector3(...VIEWS[0][1]));

const obstacles = new THREE.Group();
scene.add(obstacles);
const obstacleMaterial = new THREE.MeshStandardMaterial({ color: 0xc8503c, transparent: true, opacity: 0.55, roughness: 0.6 });
const balls = data.balls.map((ball) => {
  const mesh = new THREE.Mesh(new THREE.SphereGeometry(ball.radius, 32, 20), obstacleMaterial);
  obstacles.add(mesh);
  return { ...ball, mesh };
});
function placeBalls(time) {
  for (const ball of balls) {
    ball.mesh.visible = time >= ball.from_s && time <= ball.until_s;
    const since = time - ball.from_s;
    ball.mesh.position.set(...ball.centre.map((at, axis) => at + since * ball.velocity[axis]));
  }
}

// --- Motions.
const least = data.clearance_range[0], most = data.clearance_range[1];
const far = new THREE.Color("#2f9e6e"), middle = new THREE.Color("#f0b429"), near = new THREE.Color("#d62f2f");
function colourOf(clearance) {
  const share = most > least ? Math.min(Math.max((clearance - least) / (most - least), 0), 1) : 1;
  return share < 0.5 ? near.clone().lerp(middle, 2 * share) : middle.clone().lerp(far, 2 * share - 1);
}

const motions = data.motions.map((motion, index) => {
  const time = floats(motion.time_s), zeta = floats(motion.configurations_rad), clearance = floats(motion.clearance);
  const hue = HUES[index % HUES.length];
  const group = new THREE.Group();
  scene.add(group);
  const tips = [], colours = [];
  for (let i = 0; i < time.length; i++) {
    const { ends } = backbone(zeta, 6 * i);
    tips.push(ends[2]);
    const colour = colourOf(Number.isFinite(clearance[i]) ? clearance[i] : most);
    colours.push(colour.r, colour.g, colour.b);
  }
  const path = new THREE.BufferGeometry().setFromPoints(tips);
  path.setAttribute("color", new THREE.Float32BufferAttribute(colours, 3));
  const tipPath = new THREE.Line(path, new THREE.LineBasicMaterial({ vertexColors: true }));
  group.add(tipPath);
  const body = new THREE.Group();
  group.add(body);
  const material = new THREE.MeshStandardMaterial({ color: hue, roughness: 0.55, transparent: !motion.is_selected, opacity: motion.is_selected ? 1 : 0.55 });
  return { ...motion, time, zeta, clearance, hue, group, tipPath, body, material, shownFrame: -1 };
});

// The index of the last sample at or before a time.
function indexAt(times, time) {
  let low = 0, high = times.length - 1;
  while (low < high) {
    const half = (low + high + 1) >> 1;
    if (times[half] <= time) low = half; else high = half - 1;
  }
  return low;
}

function placeBody(motion, time) {
  const index = indexAt(motion.time, time);
  const next = Math.min(index + 1, motion.time.length - 1);
  const span = motion.time[next] - motion.time[index];
  const part = span > 0 ? Math.min(Math.max((time - motion.time[index]) / span, 0), 1) : 0;
  const frame = index + part;
  if (frame === motion.shownFrame) return;
  motion.shownFrame = frame;
  const zeta = Array.from({ length: 6 }, (_, d) => motion.zeta[6 * index + d] * (1 - part) + motion.zeta[6 * next + d] * part);
  const { points } = backbone(zeta);
  motion.body.children.forEach((mesh) => mesh.geometry.dispose());
  motion.body.clear();
  data.robot.tube_radii.forEach((radius, section) => {
    const own = points.slice(section * POINTS_OF_A_SECTION, (section + 1) * POINTS_OF_A_SECTION + 1);
    const curve = new THREE.CatmullRomCurve3(own);
    motion.body.add(new THREE.Mesh(new THREE.TubeGeometry(curve, POINTS_OF_A_SECTION, radius, 18), motion.material));
  });
  const end = new THREE.Mesh(new THREE.SphereGeometry(data.robot.tube_radii[2], 18, 12), motion.material);
  end.position.copy(points[points.length - 1]);
  motion.body.add(end);
}

// --- What is switched on and off.
const layers = [
  ["Obstacles", (on) => { obstacles.visible = on; }],
  ["Bodies", (on) => motions.forEach((motion) => { motion.body.visible = on; })],
  ["Tip paths", (on) => motions.forEach((motion) => { motion.tipPath.visible = on; })],
  ["Ground", (on) => { grid.visible = on; }],
];
for (const [name, show] of layers) {
  const label = document.createElement("label");
  label.innerHTML = `<input type="checkbox" checked>${name}`;
  label.firstChild.addEventListener("change", (event) => { show(event.target.checked); draw(); });
  element("shown").append(label);
}
const boxes = motions.map((motion) => {
  const item = document.createElement("li");
  item.innerHTML = `<label><input type="checkbox"><i></i><span></span></label>`;
  item.querySelector("i").style.background = motion.hue;
  item.querySelector("span").textContent = motion.name;
  const box = item.querySelector("input");
  box.checked = motion.group.visible = motion.is_selected || motions.length <= 4;
  box.addEventListener("change", () => { motion.group.visible = box.checked; draw(); });
  element("motions").append(item);
  return box;
});
const switchAll = (on) => { boxes.forEach((box, index) => { box.checked = motions[index].group.visible = on; }); draw(); };
element("all").addEventListener("click", () => switchAll(true));
element("none").addEventListener("click", () => switchAll(false));
element("view").addEventListener("click", (event) => {
  view = (view + 1) % VIEWS.length;
  event.target.textContent = VIEWS[view][0];
  look(new THREE.Vector3(...VIEWS[view][1]));
  draw();
});
const lengthText = (length) => (data.unit === "m" ? `${(1e3 * length).toFixed(1)} mm` : `${length.toFixed(3)} ${data.unit}`);
element("least").textContent = lengthText(least);
element("most").textContent = lengthText(most);
element("key").hidden = !(most > least);

// --- Curves.
const curveSets = data.curves.map((curves) => ({ ...curves, time: floats(curves.time_s), values: curves.values.map(floats) }));
curveSets.forEach((curves, index) => element("curves").add(new Option(`${curves.name}, ${curves.unit}`, index)));
if (curveSets.length === 0) document.querySelectorAll("footer .row:nth-child(2), #plot").forEach((part) => { part.hidden = true; });

function showLegend() {
  const curves = curveSets[element("curves").value || 0];
  element("legend").replaceChildren(...(curves ? curves.labels : []).map((label, index) => {
    const entry = document.createElement("span");
    entry.textContent = label;
    entry.style.setProperty("--of", HUES[index % HUES.length]);
    return entry;
  }));
}

const plot = element("plot"), pen = plot.getContext("2d");
const MARGIN = { left: 56, right: 8, top: 6, bottom: 18 };
function plotX(time) {
  return MARGIN.left + (time / data.duration_s) * (plot.clientWidth - MARGIN.left - MARGIN.right);
}

function drawCurves() {
  const curves = curveSets[element("curves").value || 0];
  if (!curves) return;
  const ratio = window.devicePixelRatio || 1, width = plot.clientWidth, height = plot.clientHeight;
  plot.width = width * ratio;
  plot.height = height * ratio;
  pen.scale(ratio, ratio);
  const style = getComputedStyle(document.body), ink = style.color;
  const soft = style.getPropertyValue("--soft"), line = style.getPropertyValue("--line");
  let low = Infinity, high = -Infinity;
  for (const values of curves.values) for (const value of values) { if (value < low) low = value; if (value > high) high = value; }
  if (!(high > low)) { low -= 1; high += 1; }
  const y = (value) => MARGIN.top + (1 - (value - low) / (high - low)) * (height - MARGIN.top - MARGIN.bottom);
  pen.font = "11px system-ui, sans-serif";
  pen.fillStyle = soft;
  pen.strokeStyle = line;
  pen.lineWidth = 1;
  for (const value of [low, (low + high) / 2, high]) {
    pen.textAlign = "right";
    pen.fillText(value.toPrecision(3), MARGIN.left - 4, Math.min(Math.max(y(value) + 4, 10), height - MARGIN.bottom));
    pen.beginPath();
    pen.moveTo(MARGIN.left, y(value));
    pen.lineTo(width - MARGIN.right, y(value));
    pen.stroke();
  }
  pen.textAlign = "center";
  const ticks = width < 500 ? 3 : 6;
  for (let tick = 0; tick <= ticks; tick++) {
    const time = (tick / ticks) * data.duration_s;
    pen.textAlign = tick === 0 ? "left" : tick === ticks ? "right" : "center";
    pen.fillText(`${time.toFixed(data.duration_s < 20 ? 2 : 0)} s`, plotX(time), height - 4);
  }
  pen.setLineDash([4, 3]);
  pen.strokeStyle = soft;
  for (const mark of data.marks) {
    pen.beginPath();
    pen.moveTo(plotX(mark.time_s), MARGIN.top);
    pen.lineTo(plotX(mark.time_s), height - MARGIN.bottom);
    pen.stroke();
  }
  pen.setLineDash([]);
  curves.values.forEach((values, index) => {
    pen.strokeStyle = HUES[index % HUES.length];
    pen.beginPath();
    const every = Math.max(1, Math.floor(values.length / (2 * width)));
    for (let i = 0; i < values.length; i += every) {
      if (i === 0) pen.moveTo(plotX(curves.time[i]), y(values[i])); else pen.lineTo(plotX(curves.time[i]), y(values[i]));
    }
    pen.stroke();
  });
  pen.strokeStyle = ink;
  pen.beginPath();
  pen.moveTo(plotX(now), MARGIN.top);
  pen.lineTo(plotX(now), height - MARGIN.bottom);
  pen.stroke();
}

plot.addEventListener("click", (event) => {
  const share = (event.offsetX - MARGIN.left) / (plot.clientWidth - MARGIN.left - MARGIN.right);
  goTo(Math.min(Math.max(share, 0), 1) * data.duration_s);
});
element("curves").addEventListener("change", () => { showLegend(); draw(); });

// --- Time.
let now = 0, isPlaying = false, before = 0;
element("time").addEventListener("input", (event) => goTo(event.target.value * data.duration_s));
element("play").addEventListener("click", () => {
  isPlaying = !isPlaying;
  if (isPlaying && now >= data.duration_s) now = 0;
  element("play").textContent = isPlaying ? "Pause" : "Play";
  before = performance.now();
  if (isPlaying) requestAnimationFrame(advance);
});

function advance(stamp) {
  if (!isPlaying) return;
  now += Math.max(stamp - before, 0) * 1e-3 * element("speed").value;
  before = stamp;
  if (now >= data.duration_s) {
    now = data.duration_s;
    isPlaying = false;
    element("play").textContent = "Play";
  }
  goTo(now);
  if (isPlaying) requestAnimationFrame(advance);
}

function goTo(time) {
  now = time;
  draw();
}

function draw() {
  element("time").value = data.duration_s > 0 ? now / data.duration_s : 0;
  element("now").textContent = `${now.toFixed(2)} s`;
  placeBalls(now);
  const shown = motions.filter((motion) => motion.group.visible);
  shown.forEach((motion) => placeBody(motion, now));
  const at = shown.map((motion) => motion.clearance[indexAt(motion.time, now)]).filter(Number.isFinite);
  element("tells").textContent = at.length > 0 ? `clearance ${lengthText(Math.min(...at))}` : "";
  renderer.render(scene, camera);
  drawCurves();
}

function fit() {
  const { clientWidth, clientHeight } = element("picture");
  renderer.setPixelRatio(Math.min(window.devicePixelRatio || 1, 2));
  renderer.setSize(clientWidth, clientHeight, false);
  const dark = matchMedia("(prefers-color-scheme: dark)").matches;
  scene.background = new THREE.Color(dark ? 0x14191f : 0xf5f7f9);
  camera.aspect = clientWidth / Math.max(clientHeight, 1);
  camera.updateProjectionMatrix();
  draw();
}

controls.addEventListener("change", () => renderer.render(scene, camera));
window.addEventListener("resize", fit);
showLegend();
// The address may say what is shown first: #time=1.5&motions=all
const wanted = new URLSearchParams(location.hash.slice(1));
if (wanted.get("motions") === "all") boxes.forEach((box, index) => { box.checked = motions[index].group.visible = true; });
if (wanted.has("time")) now = Math.min(Math.max(Number(wanted.get("time")) || 0, 0), data.duration_s);
fit();
document.body.dataset.ready = "true";
