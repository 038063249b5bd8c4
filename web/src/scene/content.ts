// Content of a scene as plain data, from views to the 3-D chunk.
import type { Pose } from "../api/types";
import type { Valued } from "./heat";
import type { Vector } from "./vectors";

/** Shape of an object in its own frame: a mesh file, or points without one. */
export interface Shape {
  id: string;
  mesh?: { file: ArrayBuffer; format: string; metresPerUnit: number; origin: Vector };
  points?: SurfacePoint[];
}

export interface SurfacePoint {
  position: Vector;
  normal: Vector;
  color?: string;
}

/** An object in a pose; a ghost is an alternative hypothesis, the truth is drawn as lines. */
export interface Body {
  shape: Shape;
  pose: Pose;
  ghost?: { color: string; weight: number };
  isTruth?: boolean;
  /** Without a mesh only the points are drawn. */
  hideMesh?: boolean;
}

/** A touch in the scene's frame. */
export interface TouchMark {
  /** Number of the reading. */
  id: number;
  position: Vector;
  /** Outward normal, towards the sensor. */
  normal: Vector;
  color: string;
  /** Whether the touch had contact; otherwise it is drawn as a ring. */
  contact: boolean;
  /** How plainly it is drawn, 0 to 1. */
  strength: number;
  /** Half the width of the sensor's pad, in metres; undefined if the sensor is unknown. */
  reach: number | undefined;
}

/** A suggested approach: from its start along its direction. */
export interface ApproachMark {
  from: Vector;
  direction: Vector;
  length: number;
  best: boolean;
}

export interface Content {
  bodies: Body[];
  touches: TouchMark[];
  approaches: ApproachMark[];
  /** Patches on the surface, in the frame of the first body. */
  patches: SurfacePoint[];
  /** Places of the first body with values from 0 to 1, which colour its mesh. */
  heat?: Valued[];
  /** A pose with its 6 × 6 covariance, in the order of ROS, drawn as an ellipsoid and cones. */
  uncertain?: { pose: Pose; covariance: number[] };
  /** Touches whose surroundings on the first body are not tinted; undefined tints nothing. */
  covering?: TouchMark[];
}

export const IDENTITY: Pose = { position: [0, 0, 0], orientation: [0, 0, 0, 1] };
