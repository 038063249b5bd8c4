// Where a surface was touched: within a pad's half width of a touch that came from outside.
import type { Vector } from "./vectors";

/** A touch on a surface, with half the width of the pad that made it. */
export interface Press {
  position: Vector;
  /** Outward, towards the sensor. */
  normal: Vector;
  reach: number;
}

/** Beyond this many reaches, distances no longer count. */
export const FAR = 2;

/** Distance of each point from the nearest press on its side, in reaches of that press; at most `FAR`. */
export function apartness(positions: ArrayLike<number>, normals: ArrayLike<number>, presses: Press[]): Float32Array {
  const apart = new Float32Array(positions.length / 3).fill(FAR);
  for (const { position: [px, py, pz], normal: [nx, ny, nz], reach } of presses) {
    const most = FAR * reach;
    for (let i = 0; i < apart.length; i += 1) {
      const at = 3 * i;
      const [dx, dy, dz] = [positions[at]! - px, positions[at + 1]! - py, positions[at + 2]! - pz];
      if (Math.abs(dx) >= most || Math.abs(dy) >= most || Math.abs(dz) >= most) continue;
      if (normals[at]! * nx + normals[at + 1]! * ny + normals[at + 2]! * nz <= 0) continue;
      const distance = Math.sqrt(dx * dx + dy * dy + dz * dz) / reach;
      if (distance < apart[i]!) apart[i] = distance;
    }
  }
  return apart;
}

/** Share of a surface of triangles that was touched, by area. */
export function touchedShare(positions: ArrayLike<number>, apart: ArrayLike<number>): number {
  let [touched, all] = [0, 0];
  for (let corner = 0; corner + 2 < apart.length; corner += 3) {
    const area = triangleArea(positions, 3 * corner);
    const near = [0, 1, 2].filter((i) => apart[corner + i]! <= 1).length;
    touched += (area * near) / 3;
    all += area;
  }
  return all === 0 ? 0 : touched / all;
}

function triangleArea(positions: ArrayLike<number>, at: number): number {
  const side = (corner: number, i: number) => positions[at + 3 * corner + i]! - positions[at + i]!;
  const [ax, ay, az] = [side(1, 0), side(1, 1), side(1, 2)];
  const [bx, by, bz] = [side(2, 0), side(2, 1), side(2, 2)];
  return Math.hypot(ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx) / 2;
}

/** Area of a surface of triangles. */
export function surfaceArea(positions: ArrayLike<number>): number {
  let area = 0;
  for (let at = 0; at + 8 < positions.length; at += 9) area += triangleArea(positions, at);
  return area;
}
