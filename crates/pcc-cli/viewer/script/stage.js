// What stands around the robot: light, ground, base plate, obstacles; and the camera.
import * as THREE from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
import { floats } from "./samples.js";

const DIRECTIONS = { Front: [1.4, -2, 0.8], Side: [0, -1, 0.02], Top: [0.001, 0, 1] };

export class Stage {
  // The canvas, the length of the straight robot, its radius, and what is done when the camera has moved.
  constructor(canvas, reach, thickness, moved) {
    this.canvas = canvas;
    this.reach = reach;
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: true });
    this.scene = new THREE.Scene();
    this.camera = new THREE.PerspectiveCamera(40, 1, 0.01 * reach, 100 * reach);
    this.camera.up.set(0, 0, 1);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.addEventListener("change", moved);
    this.scene.add(new THREE.HemisphereLight(0xffffff, 0x8899aa, 2.2));
    const sun = new THREE.DirectionalLight(0xffffff, 1.6);
    sun.position.set(1, -2, 3);
    this.scene.add(sun);
    this.ground = new THREE.Group();
    const grid = new THREE.GridHelper(2 * reach, 12, 0x8a96a3, 0xb9c2cb);
    grid.material.transparent = true;
    grid.material.opacity = 0.5;
    const plate = new THREE.Mesh(
      new THREE.CylinderGeometry(1.6 * thickness, 1.8 * thickness, 0.3 * thickness, 48),
      new THREE.MeshStandardMaterial({ color: 0x6f7b87, roughness: 0.7 }),
    );
    for (const part of [grid, plate]) {
      part.rotation.x = Math.PI / 2;
      this.ground.add(part);
    }
    plate.position.z = -0.15 * thickness;
    this.scene.add(this.ground);
  }

  look(name) {
    const wide = Math.max(1, 1 / this.camera.aspect);
    this.controls.target.set(0, 0, 0.45 * this.reach);
    this.camera.position.set(...DIRECTIONS[name]).normalize().multiplyScalar(2.6 * wide * this.reach).add(this.controls.target);
    this.controls.update();
  }

  fit(width, height) {
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio || 1, 2));
    this.renderer.setSize(width, height, false);
    const dark = matchMedia("(prefers-color-scheme: dark)").matches;
    this.scene.background = new THREE.Color(dark ? 0x14191f : 0xf5f7f9);
    this.camera.aspect = width / Math.max(height, 1);
    this.camera.updateProjectionMatrix();
  }

  render() {
    this.renderer.render(this.scene, this.camera);
  }
}

// Balls that come, move evenly and go; solids that stay.
export class Obstacles {
  constructor(solids) {
    this.group = new THREE.Group();
    this.material = new THREE.MeshStandardMaterial({ color: 0xc8503c, transparent: true, opacity: 0.5, roughness: 0.6, depthWrite: false });
    this.sphere = new THREE.SphereGeometry(1, 32, 20);
    this.tracks = [];
    this.spheres = null;
    for (const solid of solids) this.group.add(this.solid(solid));
  }

  solid({ vertices, triangles }) {
    const shape = new THREE.BufferGeometry();
    shape.setAttribute("position", new THREE.BufferAttribute(floats(vertices), 3));
    shape.setIndex(triangles.flat());
    const faceted = shape.toNonIndexed();
    faceted.computeVertexNormals();
    return new THREE.Mesh(faceted, this.material);
  }

  place(time) {
    const there = this.tracks.filter((track) => time >= track.from_s && time <= track.until_s);
    if (!this.spheres || there.length > this.spheres.instanceMatrix.count) {
      this.spheres?.dispose();
      this.spheres?.removeFromParent();
      this.spheres = new THREE.InstancedMesh(this.sphere, this.material, Math.max(16, 2 * there.length));
      this.spheres.frustumCulled = false;
      this.group.add(this.spheres);
    }
    const place = new THREE.Matrix4();
    there.forEach(({ centre, velocity, radius, from_s }, index) => {
      const at = centre.map((start, axis) => start + (time - from_s) * velocity[axis]);
      place.makeScale(radius, radius, radius).setPosition(...at);
      this.spheres.setMatrixAt(index, place);
    });
    this.spheres.count = there.length;
    this.spheres.instanceMatrix.needsUpdate = true;
  }

  // How many the picture has.
  shown() {
    const solids = this.group.children.filter((part) => part !== this.spheres).length;
    return this.group.visible ? this.spheres.count + solids : 0;
  }
}
