// Poses and images as plain numbers, for views that do not load the 3-D chunk.
import type { Pose, Sensor } from "../api/types";
import type { Image } from "../parts/TactileImage";

export type Vector = [number, number, number];

/** Pressure from which a taxel counts as in contact, in pascal. */
export const CONTACT_PA = 2000;

/** Rotates a vector by a quaternion x, y, z, w. */
export function rotate(q: readonly number[], v: Vector): Vector {
  const [x = 0, y = 0, z = 0, w = 1] = q;
  const cross = (a: Vector, b: Vector): Vector => [
    a[1] * b[2] - a[2] * b[1],
    a[2] * b[0] - a[0] * b[2],
    a[0] * b[1] - a[1] * b[0],
  ];
  const u: Vector = [x, y, z];
  const t = cross(u, v).map((part) => 2 * part) as Vector;
  const c = cross(u, t);
  return [0, 1, 2].map((i) => v[i]! + w * t[i]! + c[i]!) as Vector;
}

/** Maps a point from frame `b` into frame `a`. */
export function transform(aFromB: Pose, pointInB: Vector): Vector {
  const turned = rotate(aFromB.orientation, pointInB);
  return [0, 1, 2].map((i) => turned[i]! + aFromB.position[i]!) as Vector;
}

/** The taxels of a sensor whose values are not in rows and columns; null for any other. */
export function listedTaxels(sensor: Sensor) {
  return sensor.layout && sensor.layout.drawing !== "as_is" ? (sensor.description.taxels ?? null) : null;
}

/** Values of listed taxels seen against +z, about the sensor's origin: places take the nearest taxel within a pitch. */
function seenFromAbove(sensor: Sensor, sent: (number | null)[]): Image {
  const taxels = listedTaxels(sensor) ?? [];
  const { pitch } = sensor.description.grid;
  const side = (along: "x" | "y") => 2 * Math.ceil(Math.max(0, ...taxels.map((taxel) => Math.abs(taxel.position[along]))) / pitch) + 1;
  const [rows, cols] = [side("y"), side("x")];
  const values: (number | null)[] = [];
  for (let row = 0; row < rows; row += 1) {
    for (let col = 0; col < cols; col += 1) {
      const [x, y] = [(col - (cols - 1) / 2) * pitch, (row - (rows - 1) / 2) * pitch];
      let [nearest, least] = [-1, pitch];
      taxels.forEach((taxel, index) => {
        const apart = Math.hypot(taxel.position.x - x, taxel.position.y - y);
        if (apart < least) [nearest, least] = [index, apart];
      });
      values.push(nearest < 0 ? null : (sent[nearest] ?? null));
    }
  }
  return { rows, cols, values };
}

/** The image in sensor orientation: rows along +y, columns along +x. */
export function upright(sensor: Sensor, sent: (number | null)[]): Image {
  if (listedTaxels(sensor)) return seenFromAbove(sensor, sent);
  const { grid, image_order: order } = sensor.description;
  const { rows, cols } = grid;
  const values: (number | null)[] = [];
  for (let row = 0; row < rows; row += 1) {
    for (let col = 0; col < cols; col += 1) {
      const r = order?.rows_reversed ? rows - 1 - row : row;
      const c = order?.cols_reversed ? cols - 1 - col : col;
      values.push(sent[order?.transposed ? c * rows + r : r * cols + c] ?? null);
    }
  }
  return { rows, cols, values };
}

/** Centre of pressure in the sensor frame, metres; null without contact. */
export function centreOfPressure(sensor: Sensor, image: Image): Vector | null {
  const { pitch } = sensor.description.grid;
  let [sum, x, y] = [0, 0, 0];
  image.values.forEach((value, taxel) => {
    if (value === null || value < CONTACT_PA) return;
    const row = Math.floor(taxel / image.cols);
    const col = taxel % image.cols;
    sum += value;
    x += value * (col - (image.cols - 1) / 2) * pitch;
    y += value * (row - (image.rows - 1) / 2) * pitch;
  });
  return sum === 0 ? null : [x / sum, y / sum, 0];
}

