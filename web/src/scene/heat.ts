// Values of places of a surface, carried to all of its points.
import type { Vector } from "./vectors";

/** A place of a surface with a value. */
export interface Valued {
  position: Vector;
  /** Outward normal. */
  normal: Vector;
  value: number;
}

/** Beyond this many widths a place no longer counts. */
const FAR = 3;

/** The value at each point: the mean of places on its side of the surface, by a Gaussian of their distance. NaN far from all. */
export function carried(positions: ArrayLike<number>, normals: ArrayLike<number>, places: Valued[], width: number): Float32Array {
  const sums = new Float32Array(positions.length / 3);
  const weights = new Float32Array(sums.length);
  const most = FAR * width;
  for (const { position: [px, py, pz], normal: [nx, ny, nz], value } of places) {
    for (let i = 0; i < sums.length; i += 1) {
      const at = 3 * i;
      const [dx, dy, dz] = [positions[at]! - px, positions[at + 1]! - py, positions[at + 2]! - pz];
      if (Math.abs(dx) >= most || Math.abs(dy) >= most || Math.abs(dz) >= most) continue;
      if (normals[at]! * nx + normals[at + 1]! * ny + normals[at + 2]! * nz <= 0) continue;
      const weight = Math.exp(-(dx * dx + dy * dy + dz * dz) / (2 * width * width));
      sums[i]! += weight * value;
      weights[i]! += weight;
    }
  }
  return sums.map((sum, i) => (weights[i]! > 0 ? sum / weights[i]! : Number.NaN));
}
