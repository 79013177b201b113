// A motion: the robot's body at a time, and the path of its tip, coloured by clearance.
import * as THREE from "three";
import { Line2 } from "three/examples/jsm/lines/Line2.js";
import { LineGeometry } from "three/examples/jsm/lines/LineGeometry.js";
import { LineMaterial } from "three/examples/jsm/lines/LineMaterial.js";
import { backbone, reach, tip } from "./backbone.js";
import { colourOf } from "./colours.js";
import { indexAt } from "./samples.js";

const POINTS_OF_A_SECTION = 14;
const POINTS_AROUND = 28;
// Least distance between two corners of a tip path, as a share of the robot's length.
const CORNER = 5e-3;

export class Motion {
  // `time` in s, `zeta` six radians a sample, `clearance` as long as `time`; `stays`: whether the body stays at the end of its motion.
  // Of bodies at the same place the one with the least `depth` is seen.
  constructor({ name, hue, depth, robot, range, stays, isSolid, time, zeta, clearance }) {
    Object.assign(this, { name, hue, robot, range, stays, time, zeta, clearance });
    this.group = new THREE.Group();
    this.body = new THREE.Group();
    const look = { color: hue, roughness: 0.55, transparent: !isSolid, opacity: isSolid ? 1 : 0.5, polygonOffset: true, polygonOffsetFactor: depth, polygonOffsetUnits: 4 * depth };
    this.material = new THREE.MeshStandardMaterial(look);
    this.ringMaterial = new THREE.MeshStandardMaterial({ ...look, color: new THREE.Color(hue).multiplyScalar(0.7) });
    this.tipPath = new Line2(new LineGeometry(), new LineMaterial({ vertexColors: true, linewidth: 2.5 }));
    this.tipPath.frustumCulled = false;
    // Until a picture has them.
    this.body.visible = this.tipPath.visible = false;
    this.group.add(this.body, this.tipPath);
    // Corners of the tip path, and how many samples they are of.
    this.path = [];
    this.walked = 0;
    // The configuration of the body; the time up to which the tip path is drawn, and when it was.
    this.shown = "";
    this.drawnUntil = this.drawnAt = -Infinity;
  }

  // Adds a sample; those before a time are let go of.
  push(time, zeta, clearance, oldest) {
    this.time.push(time);
    this.zeta.push(...zeta);
    this.clearance.push(clearance);
    const old = this.time.findIndex((it) => it >= oldest);
    if (old < 500) return;
    this.time.splice(0, old);
    this.zeta.splice(0, 6 * old);
    this.clearance.splice(0, old);
    this.walked = Math.max(this.walked - old, 0);
    this.path = this.path.filter((corner) => corner.time >= oldest);
  }

  // Draws what has come since it was drawn, if that was so many milliseconds ago.
  drawTipPath(pause) {
    if (this.drawnUntil === this.time.at(-1) || performance.now() - this.drawnAt < pause) return;
    [this.drawnUntil, this.drawnAt] = [this.time.at(-1), performance.now()];
    if (this.time.length < 2) return;
    this.walk();
    const corners = [...this.path, this.corner(this.time.length - 1)];
    const colours = corners.flatMap(({ clearance }) => colourOf(clearance, this.range).toArray());
    this.tipPath.geometry.dispose();
    this.tipPath.geometry = new LineGeometry().setPositions(corners.flatMap(({ place }) => place.toArray())).setColors(colours);
  }

  corner(index) {
    return { time: this.time[index], place: tip(this.robot.section_lengths, this.zeta, 6 * index), clearance: this.clearance[index] };
  }

  // Adds the corners of the samples that have come: where the tip has gone on so far that it is seen, with the least clearance there; none
  // is no number.
  walk() {
    const least = CORNER * reach(this.robot.section_lengths);
    for (; this.walked < this.time.length; this.walked++) {
      const corner = this.corner(this.walked);
      const last = this.path.at(-1);
      if (!last || corner.place.distanceTo(last.place) >= least) this.path.push(corner);
      else if (Number.isFinite(corner.clearance) && !(last.clearance <= corner.clearance)) last.clearance = corner.clearance;
    }
  }

  clearanceAt(time) {
    return this.clearance[indexAt(this.time, time)];
  }

  isThere(time) {
    const count = this.time.length;
    return count > 0 && time >= this.time[0] && (this.stays || time <= this.time[count - 1]);
  }

  place(time, byClearance, isShown) {
    this.body.visible = isShown && this.isThere(time);
    if (!this.body.visible) return;
    const colour = byClearance ? colourOf(this.clearanceAt(time), this.range) : new THREE.Color(this.hue);
    this.material.color.copy(colour);
    this.ringMaterial.color.copy(colour).multiplyScalar(0.7);
    const index = indexAt(this.time, time);
    const next = Math.min(index + 1, this.time.length - 1);
    const span = this.time[next] - this.time[index];
    const part = span > 0 ? Math.min(Math.max((time - this.time[index]) / span, 0), 1) : 0;
    const zeta = Array.from({ length: 6 }, (_, d) => this.zeta[6 * index + d] * (1 - part) + this.zeta[6 * next + d] * part);
    const key = zeta.join();
    if (key === this.shown) return;
    this.shown = key;
    this.drawBody(zeta);
  }

  drawBody(zeta) {
    this.body.children.forEach((mesh) => mesh.geometry.dispose());
    this.body.clear();
    const sections = backbone(this.robot.section_lengths, zeta);
    sections.forEach((section, index) => {
      const radius = this.robot.tube_radii[index];
      this.add(new THREE.TubeGeometry(section, POINTS_OF_A_SECTION, radius, POINTS_AROUND), this.material);
      const ring = new THREE.CylinderGeometry(1.01 * radius, 1.01 * radius, 0.1 * radius, 2 * POINTS_AROUND);
      const at = this.add(ring, this.ringMaterial);
      at.position.copy(section.getPoint(1));
      at.quaternion.setFromUnitVectors(new THREE.Vector3(0, 1, 0), section.getTangent(1));
    });
    const end = sections.at(-1).getPoint(1);
    this.add(new THREE.SphereGeometry(this.robot.tube_radii.at(-1), POINTS_AROUND, 14), this.material).position.copy(end);
  }

  add(geometry, material) {
    const mesh = new THREE.Mesh(geometry, material);
    this.body.add(mesh);
    return mesh;
  }

  // What the picture has of it.
  seen() {
    const { name, hue, group, body, tipPath, material } = this;
    const colour = `#${material.color.getHexString()}`;
    return { name, hue, colour, body: group.visible && body.visible, tipPath: group.visible && tipPath.visible };
  }

  dispose() {
    this.group.removeFromParent();
    this.body.children.forEach((mesh) => mesh.geometry.dispose());
    this.tipPath.geometry.dispose();
    [this.material, this.ringMaterial, this.tipPath.material].forEach((material) => material.dispose());
  }
}
