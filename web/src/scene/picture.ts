// Small pictures of shapes, drawn one after the other by one renderer, because browsers limit them.
import { type Material, Mesh, type PerspectiveCamera, type Scene, WebGLRenderer } from "three";
import { outlineOf, drawBody } from "./bodies";
import { type Body, IDENTITY, type Shape } from "./content";
import { newGeometry } from "./geometry";
import { placeCamera, studio, themeOf } from "./studio";
import { ballAround } from "./view";

const WIDTH = 480;
const HEIGHT = 360;

let shared: { renderer: WebGLRenderer; scene: Scene; camera: PerspectiveCamera } | undefined;

/** Draws a picture of a shape; nothing of the shape stays in memory. */
export function picture(shape: Shape, into: HTMLCanvasElement): void {
  shared ??= shop();
  const { renderer, scene, camera } = shared;
  const geometry = newGeometry(shape);
  const body: Body = { shape, pose: IDENTITY };
  const outline = outlineOf(body, geometry);
  const drawn = drawBody(body, themeOf(), ballAround(outline).radius, geometry);
  scene.add(drawn);
  placeCamera(camera, outline);
  renderer.render(scene, camera);
  into.width = WIDTH;
  into.height = HEIGHT;
  into.getContext("2d")?.drawImage(renderer.domElement, 0, 0);
  scene.remove(drawn);
  drawn.traverse((node) => {
    if (node instanceof Mesh) (node.material as Material).dispose();
  });
  geometry?.dispose();
}

function shop() {
  const renderer = new WebGLRenderer({ antialias: true, alpha: true, preserveDrawingBuffer: true });
  renderer.setSize(WIDTH, HEIGHT, false);
  return { renderer, ...studio(WIDTH / HEIGHT) };
}
