// Where the camera stands, what lies under the pointer, and round lengths: numbers without the 3-D library.
import type { Vector } from "./vectors";

/** The camera's place: what it looks at, and how far from it. */
export interface Standpoint {
  target: Vector;
  distance: number;
}

/** Directions of a camera, of length one: to the right, up, and from what it looks at back to the camera. */
export interface Directions {
  right: Vector;
  up: Vector;
  back: Vector;
}

/** Tangents of half the angles of view, across and upright. */
export interface Opening {
  across: number;
  upright: number;
}

const ROUNDS = 6;

export function dot(a: Vector, b: Vector): number {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/** The nearest standpoint from which all points are in view, in the middle of the frame. */
export function standpoint(points: Vector[], { right, up, back }: Directions, opening: Opening): Standpoint {
  const first = points[0] ?? [0, 0, 0];
  const target: Vector = [...first];
  let distance = 0;
  for (let round = 0; round <= ROUNDS; round += 1) {
    const seen = points.map((point) => {
      const from: Vector = [point[0] - target[0], point[1] - target[1], point[2] - target[2]];
      return { x: dot(from, right) / opening.across, y: dot(from, up) / opening.upright, z: dot(from, back) };
    });
    distance = Math.max(...seen.map(({ x, y, z }) => Math.max(Math.abs(x), Math.abs(y)) + z), 0);
    if (round === ROUNDS) break;
    const across = middle(seen.map(({ x, z }) => x / (distance - z || 1)));
    const upright = middle(seen.map(({ y, z }) => y / (distance - z || 1)));
    const deep = middle(seen.map(({ z }) => z));
    for (let i = 0; i < 3; i += 1) {
      target[i]! += distance * (across * opening.across * right[i]! + upright * opening.upright * up[i]!) + deep * back[i]!;
    }
  }
  return { target, distance };
}

function middle(values: number[]): number {
  return (Math.min(...values) + Math.max(...values)) / 2;
}

/** The farthest points of a cloud of x, y, z in 98 directions: its outline, nearly. */
export function outline(cloud: ArrayLike<number>): Vector[] {
  const found = new Set<number>();
  for (const [x, y, z] of DIRECTIONS) {
    let [best, most] = [0, -Infinity];
    for (let at = 0; at + 2 < cloud.length; at += 3) {
      const along = cloud[at]! * x + cloud[at + 1]! * y + cloud[at + 2]! * z;
      if (along > most) [best, most] = [at, along];
    }
    if (cloud.length >= 3) found.add(best);
  }
  return [...found].map((at): Vector => [cloud[at]!, cloud[at + 1]!, cloud[at + 2]!]);
}

/** All directions from the middle of a cube of 5 × 5 × 5 points to its surface. */
const DIRECTIONS: Vector[] = [-2, -1, 0, 1, 2].flatMap((x) => [-2, -1, 0, 1, 2].flatMap((y) => [-2, -1, 0, 1, 2].map((z): Vector => [x, y, z])))
  .filter((direction) => Math.max(...direction.map(Math.abs)) === 2);

/** The ball about the box about points, with a radius of at least a centimetre. */
export interface Ball {
  centre: Vector;
  radius: number;
}

export function ballAround(points: Vector[]): Ball {
  if (points.length === 0) return { centre: [0, 0, 0], radius: 0.05 };
  const ends = [0, 1, 2].map((i) => points.map((point) => point[i]!));
  const least = ends.map((parts) => Math.min(...parts));
  const most = ends.map((parts) => Math.max(...parts));
  const centre = least.map((low, i) => (low + most[i]!) / 2) as Vector;
  return { centre, radius: Math.max(0.01, Math.hypot(...least.map((low, i) => most[i]! - low)) / 2) };
}

/** The largest of 1, 2 and 5 times a power of ten that is at most `most`. */
export function roundLength(most: number): number {
  const power = 10 ** Math.floor(Math.log10(most) + 1e-9);
  const share = most / power + 1e-9;
  return (share >= 5 ? 5 : share >= 2 ? 2 : 1) * power;
}

/** A mark on the screen, in pixels, with its distance from the camera. */
export interface Seen {
  id: number;
  x: number;
  y: number;
  depth: number;
}

/** The mark under the pointer; of several within reach, the one in front. */
export function markAt(marks: Seen[], at: { x: number; y: number }, reach: number): number | undefined {
  const near = marks.filter(({ x, y }) => Math.hypot(x - at.x, y - at.y) <= reach);
  near.sort((a, b) => a.depth - b.depth);
  return near[0]?.id;
}
