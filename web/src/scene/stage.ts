// A 3-D view: draws content, turns by mouse, fingers and keys, and selects touches.
import {
  type BufferGeometry, GridHelper, Group, InstancedMesh, LineSegments, Mesh, type PerspectiveCamera, Raycaster, type Scene, Vector3,
  WebGLRenderer,
} from "three";
import type { Material } from "three";
import { type Covered, discs, drawBody, drawCovered, drawHeated, place, pointsInView } from "./bodies";
import { type Commands, control, type Controlled } from "./control";
import type { ApproachMark, Content, TouchMark } from "./content";
import { approachMark, haloMark, markSize, touchMarks, uncertaintyMark } from "./marks";
import { drawOverlay, type Label } from "./overlay";
import { placeCamera, studio, type Theme, themeOf } from "./studio";
import { type Ball, ballAround, markAt, roundLength, type Seen } from "./view";
import type { Vector } from "./vectors";

/** Reach of a pointer about a mark, in pixels. */
const REACH = { mouse: 9, touch: 22 };
/** What is in view without content. */
const EMPTY: Vector[] = [[-0.05, -0.05, -0.05], [0.05, 0.05, 0.05]];
/** The view is framed anew when its content fills less of it. */
const FILL_MIN = 0.6;

/** How far above its touch a number is written, in pixels. */
const LABEL_ABOVE = 26;

/** What a view tells of its touches. */
export interface Listener {
  onSelect: (touch: number | undefined) => void;
  onHover: (touch: number | undefined) => void;
}

export class Stage implements Commands {
  private readonly renderer: WebGLRenderer;
  private readonly scene: Scene;
  private readonly camera: PerspectiveCamera;
  private readonly controlled: Controlled;
  private readonly resized: ResizeObserver;
  private content = new Group();
  /** Previous content, freed after the next frame so that shaders are reused. */
  private readonly outdated: Group[] = [];
  private theme: Theme = themeOf();
  private touches: TouchMark[] = [];
  private points: Vector[] = EMPTY;
  private ball: Ball | undefined;
  /** Whether somebody has turned the view: it is not framed anew then, unless its content leaves. */
  private isTurned = false;
  private selected: number | undefined;
  private hovered: number | undefined;
  private halo: Group | undefined;
  private waiting = 0;

  /** Draws into a canvas, and writes over it; throws without WebGL. */
  constructor(
    private readonly canvas: HTMLCanvasElement,
    private readonly over: HTMLCanvasElement,
    private readonly listener: Listener,
  ) {
    this.renderer = new WebGLRenderer({ canvas, antialias: true, alpha: true });
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    ({ scene: this.scene, camera: this.camera } = studio(1));
    this.scene.add(this.content);
    this.controlled = control(this.camera, canvas, this);
    this.resized = new ResizeObserver(this.resize);
    this.resized.observe(canvas.parentElement ?? canvas);
    this.resize();
  }

  /** Replaces the content; returns the share of the surface that was touched, if that is drawn. */
  show(content: Content): number | undefined {
    this.outdated.push(this.content);
    this.scene.remove(this.content);
    this.content = new Group();
    this.scene.add(this.content);
    this.theme = themeOf();
    this.touches = content.touches;
    const points = pointsInView(content);
    const ball = ballAround(points);
    const { radius } = ball;
    const covered = this.addBodies(content, radius);
    for (const mark of touchMarks(content.touches, radius, this.theme)) this.content.add(mark);
    if (content.uncertain) this.content.add(uncertaintyMark(content.uncertain, this.theme, radius));
    this.content.updateMatrixWorld(true);
    for (const approach of content.approaches) this.content.add(approachMark(this.untilHit(approach), this.theme, radius));
    if (points.length > 0) this.content.add(floor(ball, this.theme));
    this.frame(points.length > 0 ? points : EMPTY, ball);
    this.mark();
    return covered?.share;
  }

  private addBodies(content: Content, radius: number): Covered | undefined {
    const first = content.bodies.find((body) => body.ghost === undefined);
    let covered: Covered | undefined;
    for (const body of content.bodies) {
      if (body === first && content.covering && !body.hideMesh) {
        covered = drawCovered(body, content.covering, this.theme, radius);
        this.content.add(covered.drawn);
      } else if (body === first && content.heat && !body.hideMesh) {
        this.content.add(drawHeated(body, content.heat, this.theme, radius));
      } else this.content.add(drawBody(body, this.theme, radius));
    }
    if (content.patches.length > 0) {
      const patches = discs(content.patches, radius * 0.035);
      if (first !== undefined) place(patches, first.pose);
      this.content.add(patches);
    }
    return covered;
  }

  /** Marks the selected touch. */
  select(touch: number | undefined): void {
    this.selected = touch;
    this.mark();
  }

  /** Selects at once, so that the next key goes on from here, and tells the page. */
  private choose(touch: number | undefined): void {
    this.select(touch);
    this.listener.onSelect(touch);
  }

  /** Selects the touch before or after the selected one. */
  step(by: 1 | -1): void {
    const ids = this.touches.map((touch) => touch.id);
    const at = this.selected === undefined ? -1 : ids.indexOf(this.selected);
    const next = at < 0 ? ids.at(by === 1 ? 0 : -1) : ids[at + by];
    if (next !== undefined) this.choose(next);
  }

  /** The touch under a pointer is pointed out, and selected by a click. */
  point(x: number, y: number, isTouch: boolean): void {
    const found = markAt(this.seen(), { x, y }, isTouch ? REACH.touch : REACH.mouse);
    this.canvas.style.cursor = found === undefined ? "" : "pointer";
    if (found === this.hovered) return;
    this.hovered = found;
    this.listener.onHover(found);
    this.draw();
  }

  pick(x: number, y: number, isTouch: boolean): void {
    const found = markAt(this.seen(), { x, y }, isTouch ? REACH.touch : REACH.mouse);
    this.choose(found === this.selected ? undefined : found);
  }

  deselect(): void {
    if (this.selected !== undefined) this.choose(undefined);
  }

  /** Places the camera in front and above, with everything in view. */
  reset = (): void => {
    this.isTurned = false;
    this.controlled.lookAt(placeCamera(this.camera, this.points));
    this.draw();
  };

  turned(): void {
    this.isTurned = true;
    this.draw();
  }

  /** The picture as it is seen, with what is written over it and a caption. */
  picture(caption: string): Promise<Blob | null> {
    this.render();
    const picture = document.createElement("canvas");
    [picture.width, picture.height] = [this.canvas.width, this.canvas.height];
    const context = picture.getContext("2d")!;
    context.fillStyle = this.theme.panel;
    context.fillRect(0, 0, picture.width, picture.height);
    context.drawImage(this.canvas, 0, 0);
    context.drawImage(this.over, 0, 0, picture.width, picture.height);
    const ratio = picture.width / this.canvas.clientWidth;
    context.font = `600 ${13 * ratio}px system-ui, sans-serif`;
    context.fillStyle = this.theme.ink;
    context.fillText(caption, 12 * ratio, 24 * ratio);
    return new Promise((resolve) => picture.toBlob(resolve, "image/png"));
  }

  dispose(): void {
    cancelAnimationFrame(this.waiting);
    this.resized.disconnect();
    this.controlled.end();
    this.unmark();
    [...this.outdated, this.content].forEach(empty);
    this.renderer.dispose();
    this.renderer.forceContextLoss();
  }

  /** Frames new content, unless it is still well in view. */
  private frame(points: Vector[], ball: Ball): void {
    const before = this.ball;
    this.points = points;
    if (before !== undefined && this.isTurned) {
      const isMoved = new Vector3(...ball.centre).distanceTo(new Vector3(...before.centre)) > before.radius * 0.7;
      const isResized = ball.radius > before.radius * 1.5 || ball.radius < before.radius / 1.8;
      if (!isMoved && !isResized) return;
    } else if (before !== undefined) {
      const fill = Math.max(...points.flatMap((point) => new Vector3(...point).project(this.camera).toArray().slice(0, 2).map(Math.abs)));
      if (fill <= 1 && fill >= FILL_MIN) return;
    }
    this.ball = ball;
    this.reset();
  }

  /** An approach that ends at the estimated surface. */
  private untilHit(approach: ApproachMark): ApproachMark {
    const ray = new Raycaster(new Vector3(...approach.from), new Vector3(...approach.direction).normalize(), 0, approach.length);
    const solids: Mesh[] = [];
    this.content.traverse((node) => {
      if (node instanceof Mesh && node.userData.solid === true) solids.push(node);
    });
    const hit = ray.intersectObjects(solids, false)[0];
    return hit === undefined ? approach : { ...approach, length: hit.distance };
  }

  /** Places of the touches on the screen. */
  private seen(): Seen[] {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    return this.touches.map(({ id, position }): Seen => {
      const at = new Vector3(...position);
      const depth = at.distanceTo(this.camera.position);
      at.project(this.camera);
      return { id, x: ((at.x + 1) / 2) * width, y: ((1 - at.y) / 2) * height, depth };
    });
  }

  private mark(): void {
    this.unmark();
    const touch = this.touches.find((one) => one.id === this.selected);
    if (touch !== undefined && this.ball !== undefined) {
      this.halo = haloMark(touch, this.ball.radius * Math.max(0.022, 1.15 * markSize(this.touches.length)), this.theme);
      this.scene.add(this.halo);
    }
    this.draw();
  }

  private unmark(): void {
    if (this.halo === undefined) return;
    this.scene.remove(this.halo);
    empty(this.halo);
    this.halo = undefined;
  }

  private labels(): Label[] {
    const named = new Set([this.selected, this.hovered]);
    return this.seen().flatMap(({ id, x, y }) => (named.has(id) ? [{ text: String(id + 1), x, y: y - LABEL_ABOVE }] : []));
  }

  private readonly draw = (): void => {
    if (this.waiting !== 0) return;
    this.waiting = requestAnimationFrame(() => {
      this.waiting = 0;
      this.render();
      this.outdated.splice(0).forEach(empty);
    });
  };

  private render(): void {
    this.renderer.render(this.scene, this.camera);
    const { clientWidth: width, clientHeight: height } = this.canvas;
    const away = this.camera.position.distanceTo(this.controlled.target());
    const metresPerPixel = (2 * away * Math.tan((this.camera.fov * Math.PI) / 360)) / Math.max(1, height);
    drawOverlay(this.over, { width, height, metresPerPixel, camera: this.camera, theme: this.theme, labels: this.labels() });
  }

  private readonly resize = (): void => {
    const { clientWidth: width, clientHeight: height } = this.canvas.parentElement ?? this.canvas;
    if (width === 0 || height === 0) return;
    this.renderer.setSize(width, height, false);
    [this.over.width, this.over.height] = [this.canvas.width, this.canvas.height];
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    if (this.isTurned) this.draw();
    else this.reset();
  };
}

/** A faint grid in the frame's x-y plane, below everything, with cells of a round length. */
function floor({ centre, radius }: Ball, theme: Theme): GridHelper {
  const cell = roundLength(radius * 500) / 1000;
  const cells = 2 * Math.ceil((radius * 1.8) / cell);
  const grid = new GridHelper(cells * cell, cells, theme.grid, theme.grid);
  grid.rotation.x = Math.PI / 2;
  grid.position.set(...centre);
  grid.position.z -= radius * 1.02;
  return grid;
}

/** Empties a group and frees its content. */
function empty(group: Group): void {
  group.traverse(free);
  group.clear();
}

/** Frees what a node has on the graphics card, except for meshes that are kept. */
function free(node: unknown): void {
  if (!(node instanceof Mesh || node instanceof LineSegments)) return;
  const geometry = node.geometry as BufferGeometry;
  if (geometry.userData.isKept !== true) geometry.dispose();
  (node.material as Material).dispose();
  if (node instanceof InstancedMesh) node.dispose();
}
