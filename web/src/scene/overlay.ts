// What is written over a 3-D picture: the axes of the frame, a scale bar, and numbers of touches.
import type { PerspectiveCamera } from "three";
import { Quaternion, Vector3 } from "three";
import type { Theme } from "./studio";
import { roundLength } from "./view";

const FONT = "600 12px system-ui, sans-serif";
const ARM = 30;
const MARGIN = 14;
/** The scale bar takes at most this share of the width. */
const BAR_MAX = 0.22;

/** A number beside a mark, in pixels of the page. */
export interface Label {
  text: string;
  x: number;
  y: number;
}

export interface Overlay {
  width: number;
  height: number;
  /** Metres that one pixel covers at what the camera looks at. */
  metresPerPixel: number;
  camera: PerspectiveCamera;
  theme: Theme;
  labels: Label[];
}

export function drawOverlay(canvas: HTMLCanvasElement, over: Overlay): void {
  const context = canvas.getContext("2d");
  if (context === null) return;
  const ratio = canvas.width / over.width;
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, over.width, over.height);
  context.font = FONT;
  context.lineWidth = 2;
  context.lineCap = "round";
  axes(context, over);
  scaleBar(context, over);
  for (const { text, x, y } of over.labels) write(context, over.theme, text, x, y, over.theme.ink);
}

function axes(context: CanvasRenderingContext2D, { height, camera, theme }: Overlay): void {
  const [x, y] = [MARGIN + ARM, height - MARGIN - ARM];
  const cameraFromWorld = new Quaternion().copy(camera.quaternion).invert();
  const arms = ["X", "Y", "Z"].map((name, i) => {
    const seen = new Vector3().setComponent(i, 1).applyQuaternion(cameraFromWorld);
    return { name, color: theme.axes[i]!, seen };
  });
  context.textAlign = "center";
  context.textBaseline = "middle";
  // The farthest first.
  for (const { name, color, seen } of arms.sort((a, b) => a.seen.z - b.seen.z)) {
    context.strokeStyle = color;
    context.beginPath();
    context.moveTo(x, y);
    context.lineTo(x + seen.x * ARM, y - seen.y * ARM);
    context.stroke();
    // An axis that points at the viewer has its name beside the middle.
    const far = Math.max(0.35, Math.hypot(seen.x, seen.y));
    const [dx, dy] = Math.hypot(seen.x, seen.y) < 0.05 ? [0.35, 0.35] : [(seen.x / Math.hypot(seen.x, seen.y)) * far, (seen.y / Math.hypot(seen.x, seen.y)) * far];
    write(context, theme, name, x + dx * ARM + Math.sign(dx) * 8 * Math.abs(dx), y - dy * ARM - Math.sign(dy) * 8 * Math.abs(dy), color);
  }
}

function scaleBar(context: CanvasRenderingContext2D, { width, height, metresPerPixel, theme }: Overlay): void {
  const millimetres = roundLength(width * BAR_MAX * metresPerPixel * 1000);
  const length = millimetres / 1000 / metresPerPixel;
  const [right, y] = [width - MARGIN, height - MARGIN];
  context.strokeStyle = theme.ink;
  context.beginPath();
  context.moveTo(right - length, y - 4);
  context.lineTo(right - length, y);
  context.lineTo(right, y);
  context.lineTo(right, y - 4);
  context.stroke();
  context.textAlign = "center";
  context.textBaseline = "bottom";
  write(context, theme, `${Number(millimetres.toPrecision(1))} mm`, right - length / 2, y - 4, theme.ink);
}

function write(context: CanvasRenderingContext2D, theme: Theme, text: string, x: number, y: number, color: string): void {
  context.save();
  context.lineWidth = 4;
  context.lineJoin = "round";
  context.strokeStyle = theme.panel;
  context.strokeText(text, x, y);
  context.fillStyle = color;
  context.fillText(text, x, y);
  context.restore();
}
