// What a covariance of a pose means as shapes: an ellipsoid of places, and cones about the object's axes.
import type { Vector } from "./vectors";

/** Directions of length one with the standard deviation along each, the largest first. */
export interface Spread {
  directions: [Vector, Vector, Vector];
  sigmas: [number, number, number];
}

/** Spread of the position, in metres, from a 6 × 6 covariance in the order of ROS. */
export function positionSpread(covariance: number[]): Spread {
  return spread(block(covariance, 0));
}

/** How a direction of the object wavers, in radians: two directions across it, and the direction itself with 0. */
export function directionSpread(covariance: number[], direction: Vector): Spread {
  // A small turn w moves the direction by w × d = J w.
  const [x, y, z] = direction;
  const j = [[0, z, -y], [-z, 0, x], [y, -x, 0]];
  const turns = block(covariance, 3);
  const moved = j.map((row) => j.map((other) => row.reduce((sum, a, i) => sum + other.reduce((all, b, k) => all + a * turns[i]![k]! * b, 0), 0)));
  return spread(moved);
}

function block(covariance: number[], from: number): number[][] {
  return [0, 1, 2].map((row) => [0, 1, 2].map((col) => covariance[(from + row) * 6 + from + col] ?? 0));
}

/** Principal axes of a symmetric 3 × 3 matrix, by Jacobi's rotations. */
function spread(matrix: number[][]): Spread {
  const a = matrix.map((row) => [...row]);
  const v = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
  for (let sweep = 0; sweep < 12; sweep += 1) {
    for (const [p, q] of [[0, 1], [0, 2], [1, 2]] as const) {
      if (a[p]![q] === 0) continue;
      const angle = 0.5 * Math.atan2(2 * a[p]![q]!, a[q]![q]! - a[p]![p]!);
      const [c, s] = [Math.cos(angle), Math.sin(angle)];
      for (const m of [a, v]) rotateColumns(m, p, q, c, s);
      rotateRows(a, p, q, c, s);
    }
  }
  const order = [0, 1, 2].sort((i, k) => a[k]![k]! - a[i]![i]!);
  return {
    directions: order.map((i) => v.map((row) => row[i]!) as Vector) as Spread["directions"],
    sigmas: order.map((i) => Math.sqrt(Math.max(0, a[i]![i]!))) as Spread["sigmas"],
  };
}

function rotateColumns(m: number[][], p: number, q: number, c: number, s: number): void {
  for (const row of m) {
    const [left, right] = [row[p]!, row[q]!];
    row[p] = c * left - s * right;
    row[q] = s * left + c * right;
  }
}

function rotateRows(m: number[][], p: number, q: number, c: number, s: number): void {
  const [upper, lower] = [m[p]!, m[q]!];
  m[p] = upper.map((value, i) => c * value - s * lower[i]!);
  m[q] = upper.map((value, i) => s * value + c * lower[i]!);
}
