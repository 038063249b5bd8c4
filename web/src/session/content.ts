// Content of the session's scene: the likeliest object, ghosts, touches and suggested approaches.
import type { Belief, NextTouch, Sensor, SessionReading } from "../api/types";
import { objectColor } from "../colors";
import { bitsColor } from "../format";
import type { ApproachMark, Body, Content, Shape, TouchMark } from "../scene/content";
import { centreOfPressure, rotate, transform, upright, type Vector } from "../scene/vectors";

/** Minimum weight of a ghost. */
const GHOST_WEIGHT_MIN = 0.02;

export interface Seen {
  belief: Belief | undefined;
  revision: number;
  readings: SessionReading[];
  /** Colour values by reading number. */
  tints: Map<number, number | null | undefined>;
  sensors: Map<string, Sensor>;
  shapes: Map<string, Shape>;
  selected: number | undefined;
  next: NextTouch[];
  ghosts: boolean;
}

export function contentOf(seen: Seen): Content {
  return {
    bodies: bodies(seen),
    touches: touches(seen),
    approaches: seen.next.map(approach),
    patches: [],
  };
}

function bodies({ belief, shapes, ghosts }: Seen): Body[] {
  const poses = (belief?.poses ?? []).slice(0, 5);
  return poses.flatMap((hypothesis, place): Body[] => {
    const shape = shapes.get(hypothesis.object);
    if (shape === undefined) return [];
    if (place === 0) return [{ shape, pose: hypothesis.pose }];
    if (!ghosts || hypothesis.weight < GHOST_WEIGHT_MIN) return [];
    return [{ shape, pose: hypothesis.pose, ghost: { color: objectColor(hypothesis.name), weight: hypothesis.weight } }];
  });
}

/** Whether a reading counts at a revision: arrived and not retracted. */
export function counts(reading: SessionReading, revision: number): boolean {
  const withdrawn = reading.retracted_by;
  return reading.number < revision && !(typeof withdrawn === "number" && withdrawn <= revision);
}

function touches({ readings, revision, tints, sensors, selected }: Seen): TouchMark[] {
  return readings.flatMap((reading): TouchMark[] => {
    const sensor = sensors.get(reading.sensor);
    if (!counts(reading, revision)) return [];
    if (reading.contact) {
      const { position, normal, touched } = reading.contact;
      return [{
        position: position as Vector,
        // Without a normal the mark stands upright.
        normal: (normal ?? [0, 0, 1]) as Vector,
        color: bitsColor(tints.get(reading.number)),
        selected: reading.number === selected,
        contact: touched !== false,
      }];
    }
    if (!reading.pose) return [];
    const image = sensor === undefined ? undefined : upright(sensor, reading.image as (number | null)[]);
    const centre = sensor === undefined || image === undefined ? null : centreOfPressure(sensor, image);
    const normal = rotate(reading.pose.orientation, [0, 0, -1]);
    return [{
      position: transform(reading.pose, centre ?? [0, 0, 0]),
      normal,
      color: bitsColor(tints.get(reading.number)),
      selected: reading.number === selected,
      contact: centre !== null,
    }];
  });
}

function approach(touch: NextTouch, place: number): ApproachMark {
  const direction = rotate(touch.pose.orientation, [0, 0, 1]);
  return { from: touch.pose.position as Vector, direction, length: touch.reach_m, best: place === 0 };
}
