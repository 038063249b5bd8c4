// Mouse, fingers and keys over a 3-D view: they turn it where they do not scroll the page.
import { type PerspectiveCamera, TOUCH, type Vector3 } from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";

const TURN = 0.12;
/** A pointer that moved less between press and release has clicked, in pixels. */
const CLICK = 5;

/** What a view does for its controls. */
export interface Commands {
  turned(): void;
  reset(): void;
  step(by: 1 | -1): void;
  deselect(): void;
  point(x: number, y: number, isTouch: boolean): void;
  pick(x: number, y: number, isTouch: boolean): void;
}

export interface Controlled {
  target(): Vector3;
  lookAt(target: Vector3): void;
  end(): void;
}

export function control(camera: PerspectiveCamera, canvas: HTMLCanvasElement, commands: Commands): Controlled {
  const ended = new AbortController();
  const options = { signal: ended.signal };
  // Before the controls' own listener: without Ctrl or the focus, the wheel scrolls the page.
  canvas.addEventListener("wheel", (event) => {
    if (!event.ctrlKey && document.activeElement !== canvas) event.stopImmediatePropagation();
  }, { ...options, passive: true });
  const controls = new OrbitControls(camera, canvas);
  controls.enableDamping = false;
  controls.touches = { ONE: null, TWO: TOUCH.DOLLY_ROTATE };
  // One finger scrolls the page, two turn the view.
  canvas.style.touchAction = "pan-x pan-y";
  canvas.addEventListener("touchmove", (event) => {
    if (event.touches.length > 1 && event.cancelable) event.preventDefault();
  }, { ...options, passive: false });
  let isPlacing = false;
  controls.addEventListener("change", () => {
    if (!isPlacing) commands.turned();
  });
  canvas.addEventListener("keydown", (event) => onKey(event, controls, commands), options);
  clicks(canvas, commands, options);
  return {
    target: () => controls.target,
    lookAt(target) {
      isPlacing = true;
      controls.target.copy(target);
      controls.update();
      isPlacing = false;
    },
    end() {
      ended.abort();
      controls.dispose();
    },
  };
}

function clicks(canvas: HTMLCanvasElement, commands: Commands, options: { signal: AbortSignal }): void {
  let pressed: { x: number; y: number } | undefined;
  const at = (event: PointerEvent) => {
    const { left, top } = canvas.getBoundingClientRect();
    return { x: event.clientX - left, y: event.clientY - top };
  };
  canvas.addEventListener("pointerdown", (event) => {
    pressed = event.isPrimary && event.button === 0 ? at(event) : undefined;
  }, options);
  canvas.addEventListener("pointerup", (event) => {
    const { x, y } = at(event);
    if (pressed !== undefined && Math.hypot(x - pressed.x, y - pressed.y) < CLICK) commands.pick(x, y, event.pointerType === "touch");
    pressed = undefined;
  }, options);
  canvas.addEventListener("pointermove", (event) => {
    if (event.buttons === 0) commands.point(at(event).x, at(event).y, event.pointerType === "touch");
  }, options);
  canvas.addEventListener("pointerleave", () => commands.point(-1e6, -1e6, false), options);
}

function onKey(event: KeyboardEvent, controls: OrbitControls, commands: Commands): void {
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  const turns: Record<string, [number, number, number]> = {
    ArrowLeft: [-TURN, 0, 1],
    ArrowRight: [TURN, 0, 1],
    ArrowUp: [0, -TURN, 1],
    ArrowDown: [0, TURN, 1],
    "+": [0, 0, 0.9],
    "=": [0, 0, 0.9],
    "-": [0, 0, 1 / 0.9],
  };
  const others: Record<string, () => void> = {
    0: () => commands.reset(),
    Home: () => commands.reset(),
    n: () => commands.step(1),
    p: () => commands.step(-1),
    Escape: () => commands.deselect(),
  };
  const turn = turns[event.key];
  const other = others[event.key];
  if (turn !== undefined) turnBy(controls, ...turn);
  else if (other !== undefined) other();
  else return;
  event.preventDefault();
}

function turnBy(controls: OrbitControls, around: number, over: number, farther: number): void {
  const camera = controls.object;
  const arm = camera.position.clone().sub(controls.target);
  const distance = arm.length() * farther;
  const azimuth = Math.atan2(arm.y, arm.x) + around;
  const polar = Math.min(Math.PI - 0.05, Math.max(0.05, Math.acos(arm.z / arm.length()) + over));
  const flat = Math.sin(polar);
  arm.set(flat * Math.cos(azimuth), flat * Math.sin(azimuth), Math.cos(polar)).multiplyScalar(distance);
  camera.position.copy(controls.target).add(arm);
  controls.update();
}
