// Content of the session's scene: the likeliest object, ghosts, touches and suggested approaches.
import type { Belief, NextTouch, Sensor, Session, SessionReading, Truth } from "../api/types";
import { objectColor } from "../colors";
import { bitsColor } from "../format";
import type { ApproachMark, Body, Content, Shape, TouchMark } from "../scene/content";
import { centreOfPressure, rotate, transform, upright, type Vector } from "../scene/vectors";

/** Minimum weight of a ghost. */
const GHOST_WEIGHT_MIN = 0.02;

export interface Seen {
  belief: Belief | undefined;
  truth: Truth | undefined;
  revision: number;
  readings: SessionReading[];
  /** Colour values by reading number. */
  tints: Map<number, number | null | undefined>;
  sensors: Map<string, Sensor>;
  shapes: Map<string, Shape>;
  next: NextTouch[];
  layers: Layers;
}

/** What is drawn, as chosen. */
export interface Layers {
  touches: boolean;
  /** Whether older touches are faint. */
  faded: boolean;
  ghosts: boolean;
  uncertainty: boolean;
  /** Whether the surface that was not touched is tinted. */
  untouched: boolean;
  /** Whether the object is drawn in its true pose as well, where that was told. */
  truth: boolean;
}

/** Touches drawn at full strength, those that grow fainter before them, and the strength of the oldest. */
const FRESH = 8;
const AGING = 24;
const OLDEST = 0.2;

/** How plainly a touch is drawn that this many others have followed. */
export function strengthOf(followers: number): number {
  return Math.max(OLDEST, Math.min(1, 1 - ((followers - FRESH + 1) / AGING) * (1 - OLDEST)));
}

export function contentOf(seen: Seen): Content {
  const { layers, belief } = seen;
  const all = touches(seen);
  const best = belief?.poses[0];
  return {
    bodies: [...bodies(seen), ...(layers.truth ? trueBody(seen) : [])],
    touches: layers.touches ? all : [],
    approaches: seen.next.map(approach),
    patches: [],
    ...(layers.uncertainty && best ? { uncertain: { pose: best.pose, covariance: best.covariance } } : {}),
    ...(layers.untouched ? { covering: all } : {}),
  };
}

function bodies({ belief, shapes, layers: { ghosts } }: Seen): Body[] {
  const poses = (belief?.poses ?? []).slice(0, 5);
  return poses.flatMap((hypothesis, place): Body[] => {
    const shape = shapes.get(hypothesis.object);
    if (shape === undefined) return [];
    if (place === 0) return [{ shape, pose: hypothesis.pose }];
    if (!ghosts || hypothesis.weight < GHOST_WEIGHT_MIN) return [];
    return [{ shape, pose: hypothesis.pose, ghost: { color: objectColor(hypothesis.name), weight: hypothesis.weight } }];
  });
}

/** The true object in its true pose, if a client told both. */
function trueBody({ truth, shapes }: Seen): Body[] {
  const shape = truth?.object ? shapes.get(truth.object) : undefined;
  return truth?.pose && shape ? [{ shape, pose: truth.pose, isTruth: true }] : [];
}

/** Whether a reading counts at a revision: arrived and not retracted. */
export function counts(reading: SessionReading, revision: number): boolean {
  const withdrawn = reading.retracted_by;
  return reading.number < revision && !(typeof withdrawn === "number" && withdrawn <= revision);
}

/** Whether the base of a reading's robot is only known roughly in the session's frame. */
export function hasLooseBase(session: Session | undefined, reading: SessionReading): boolean {
  return session?.robots?.some(({ robot }) => robot === reading.robot) ?? false;
}

function touches({ readings, revision, tints, sensors, layers }: Seen): TouchMark[] {
  const marks = readings.filter((reading) => counts(reading, revision)).flatMap((reading): TouchMark[] => {
    const place = placeOf(reading, sensors.get(reading.sensor));
    if (place === undefined) return [];
    return [{ ...place, id: reading.number, color: bitsColor(tints.get(reading.number)), strength: 1, reach: reachOf(sensors.get(reading.sensor)) }];
  });
  return layers.faded ? marks.map((mark, i) => ({ ...mark, strength: strengthOf(marks.length - 1 - i) })) : marks;
}

/** Where a reading touched, and against what; undefined without a pose. */
function placeOf(reading: SessionReading, sensor: Sensor | undefined): Pick<TouchMark, "position" | "normal" | "contact"> | undefined {
  if (reading.contact) {
    const { position, normal, touched } = reading.contact;
    // Without a normal the mark stands upright.
    return { position: position as Vector, normal: (normal ?? [0, 0, 1]) as Vector, contact: touched !== false };
  }
  if (!reading.pose) return undefined;
  const image = sensor === undefined ? undefined : upright(sensor, reading.image as (number | null)[]);
  const centre = sensor === undefined || image === undefined ? null : centreOfPressure(sensor, image);
  const normal = rotate(reading.pose.orientation, [0, 0, -1]);
  return { position: transform(reading.pose, centre ?? [0, 0, 0]), normal, contact: centre !== null };
}

/** Half the width of a sensor's pad, in metres. */
function reachOf(sensor: Sensor | undefined): number | undefined {
  if (sensor === undefined) return undefined;
  const { rows, cols, pitch } = sensor.description.grid;
  return (Math.min(rows, cols) * pitch) / 2;
}

function approach(touch: NextTouch, place: number): ApproachMark {
  const direction = rotate(touch.pose.orientation, [0, 0, 1]);
  return { from: touch.pose.position as Vector, direction, length: touch.reach_m, best: place === 0 };
}
