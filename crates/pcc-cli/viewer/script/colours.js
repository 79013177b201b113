// Colours of motions and curves, and of clearances.
import { Color } from "three";

export const HUES = ["#2a6fb8", "#c2571a", "#2f8f5b", "#8a4fb0", "#b58a00", "#14868c", "#c23b6b", "#6b7a1f", "#4d57c4", "#8c5a3c"];
const NEAR = new Color("#d62f2f"), MIDDLE = new Color("#f0b429"), FAR = new Color("#2f9e6e");

// The colour of a clearance on the scale from the least to the most; what has no obstacles is far.
export function colourOf(clearance, [least, most]) {
  const share = most > least && Number.isFinite(clearance) ? Math.min(Math.max((clearance - least) / (most - least), 0), 1) : 1;
  return share < 0.5 ? NEAR.clone().lerp(MIDDLE, 2 * share) : MIDDLE.clone().lerp(FAR, 2 * share - 1);
}
