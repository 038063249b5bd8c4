// What a scene shows, in plain numbers: views say it, the 3-D chunk draws it.
import type { Pose } from "../api/types";
import type { Vector } from "./vectors";

/** The shape of an object in its own frame: a mesh file, or points where there is none. */
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

/** An object somewhere; a ghost is another hypothesis. */
export interface Body {
  shape: Shape;
  pose: Pose;
  ghost?: { color: string; weight: number };
  /** Without its mesh only its points are shown. */
  hideMesh?: boolean;
}

/** A touch in the scene's frame. */
export interface TouchMark {
  position: Vector;
  /** Out of the object, towards the sensor. */
  normal: Vector;
  color: string;
  selected: boolean;
  /** Whether something was in touch; otherwise a ring is drawn. */
  contact: boolean;
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
}

export const NOTHING: Content = { bodies: [], touches: [], approaches: [], patches: [] };
export const IDENTITY: Pose = { position: [0, 0, 0], orientation: [0, 0, 0, 1] };
