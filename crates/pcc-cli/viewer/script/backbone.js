// The robot's backbone: sections of constant curvature, one after the other, in the base frame, z up.
import { Curve, Quaternion, Vector3 } from "three";

// A section as a curve of even speed from its base (0) to its end (1).
class Section extends Curve {
  // Its base, the rotation of its base's frame, the axis of bending in that frame, the angle (rad) and the length.
  constructor(base, turn, axis, angle, length) {
    super();
    Object.assign(this, { base, turn, axis, angle, length });
  }

  getPoint(part, point = new Vector3()) {
    const angle = this.angle * part;
    const straight = Math.abs(angle) < 1e-6;
    const along = straight ? 1 : Math.sin(angle) / angle;
    const beside = straight ? angle / 2 : (1 - Math.cos(angle)) / angle;
    point.set(this.axis.y * beside, -this.axis.x * beside, along).multiplyScalar(this.length * part);
    return point.applyQuaternion(this.turn).add(this.base);
  }

  getTangent(part, tangent = new Vector3()) {
    const angle = this.angle * part;
    return tangent.set(this.axis.y * Math.sin(angle), -this.axis.x * Math.sin(angle), Math.cos(angle)).applyQuaternion(this.turn);
  }

  getPointAt(part, point) {
    return this.getPoint(part, point);
  }

  getTangentAt(part, tangent) {
    return this.getTangent(part, tangent);
  }
}

// The sections of a configuration: (ζ_x, ζ_y) of each in radians, along its axis of bending; `at` is the index of the first number.
export function backbone(lengths, zeta, at = 0) {
  let base = new Vector3();
  let turn = new Quaternion();
  return lengths.map((length, index) => {
    const axis = new Vector3(zeta[at + 2 * index], zeta[at + 2 * index + 1], 0);
    const angle = axis.length();
    if (angle > 0) axis.divideScalar(angle);
    const section = new Section(base, turn, axis, angle, length);
    base = section.getPoint(1);
    turn = turn.clone().multiply(new Quaternion().setFromAxisAngle(axis, angle));
    return section;
  });
}

// The length of the robot.
export const reach = (lengths) => lengths.reduce((sum, length) => sum + length, 0);

export function tip(lengths, zeta, at = 0) {
  return backbone(lengths, zeta, at).at(-1).getPoint(1);
}
