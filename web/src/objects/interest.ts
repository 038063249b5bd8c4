// What a touch at each place of an object tells about it: its scale of colours, and points for the 3-D view.
import type { InterestMap, InterestPlace } from "../api/types";
import { heat, rgbHex } from "../format";
import type { SurfacePoint } from "../scene/content";
import type { Valued } from "../scene/heat";
import type { Vector } from "../scene/vectors";

/** The least range of bits that the colours span: smaller differences are none to a robot. */
const RANGE_MIN = 0.25;

/** Bits of the darkest and of the brightest colour. */
export interface Scale {
  low: number;
  high: number;
}

/** The scale from the place that tells least to the one that tells most, not narrower than a quarter of a bit. */
export function scaleOf(places: InterestPlace[]): Scale {
  const bits = places.map((place) => place.bits);
  const high = Math.max(...bits, RANGE_MIN);
  return { low: Math.max(0, Math.min(...bits, high - RANGE_MIN)), high };
}

/** Places with their shares of the scale, 0 to 1. */
export function valued({ places }: InterestMap): Valued[] {
  const { low, high } = scaleOf(places);
  return places.map(({ position, normal, bits }) => ({
    position: position as Vector,
    normal: normal as Vector,
    value: (bits - low) / (high - low),
  }));
}

/** Places as coloured points, for an object without a mesh. */
export function points(map: InterestMap): SurfacePoint[] {
  return valued(map).map(({ position, normal, value }) => ({ position, normal, color: rgbHex(heat(value)) }));
}

/** The places that tell most, best first. */
export function mostTelling({ places }: InterestMap, n: number): InterestPlace[] {
  return [...places].sort((a, b) => b.bits - a.bits).slice(0, n);
}

/** The middle of all places' bits. */
export function medianBits({ places }: InterestMap): number {
  const sorted = places.map((place) => place.bits).sort((a, b) => a - b);
  return sorted[Math.floor(sorted.length / 2)] ?? 0;
}
