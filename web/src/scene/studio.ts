// Camera, lights and colours that all 3-D pictures share.
import { AmbientLight, Color, DirectionalLight, HemisphereLight, PerspectiveCamera, Scene, Vector3 } from "three";
import { type Directions, type Opening, standpoint } from "./view";
import type { Vector } from "./vectors";

/** From what the camera looks at to the camera: in front and above. */
const BACK = new Vector3(0.75, -1.15, 0.7).normalize();
/** Share of the frame that the object fills. */
const FILLED = 0.85;

/** Colours of the current theme. */
export interface Theme {
  ground: Color;
  panel: string;
  ink: string;
  faint: string;
  body: Color;
  grid: Color;
  next: Color;
  untouched: Color;
  truth: Color;
  axes: [string, string, string];
}

export function themeOf(): Theme {
  const css = getComputedStyle(document.documentElement);
  const text = (name: string) => css.getPropertyValue(name).trim() || "#888888";
  const color = (name: string) => new Color(text(name));
  return {
    ground: color("--raised"), panel: text("--raised"), ink: text("--ink"), faint: text("--faint"), body: color("--bar-faint"),
    grid: color("--line"), next: color("--good"), untouched: color("--untouched"), truth: color("--truth"),
    axes: [text("--axis-x"), text("--axis-y"), text("--axis-z")],
  };
}

/** A scene with lights that move with its camera. */
export function studio(aspect: number): { scene: Scene; camera: PerspectiveCamera } {
  const camera = new PerspectiveCamera(34, aspect, 0.001, 50);
  camera.up.set(0, 0, 1);
  const lamp = new DirectionalLight(0xffffff, 1.6);
  lamp.position.set(1, -1.5, 2.5);
  camera.add(lamp);
  const scene = new Scene();
  scene.add(camera, new AmbientLight(0xffffff, 0.7), new HemisphereLight(0xffffff, 0x8899aa, 1.1));
  return { scene, camera };
}

/** Places a camera in front and above, with all points in view; returns what it looks at. */
export function placeCamera(camera: PerspectiveCamera, points: Vector[]): Vector3 {
  const across = new Vector3().crossVectors(camera.up, BACK).normalize();
  const directions: Directions = {
    right: across.toArray(),
    up: new Vector3().crossVectors(BACK, across).toArray(),
    back: BACK.toArray(),
  };
  const half = Math.tan((camera.fov * Math.PI) / 360) * FILLED;
  const opening: Opening = { across: half * camera.aspect, upright: half };
  const { target, distance } = standpoint(points, directions, opening);
  const centre = new Vector3(...target);
  camera.position.copy(centre).addScaledVector(BACK, distance);
  camera.near = distance / 100;
  camera.far = distance * 40;
  camera.lookAt(centre);
  camera.updateProjectionMatrix();
  return centre;
}
