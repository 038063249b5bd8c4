// The 3-D chunk: draws a view's content, with mouse, touch and keyboard control.
import {
  AmbientLight, Box3, BufferGeometry, CircleGeometry, Color, DirectionalLight, DoubleSide, Float32BufferAttribute,
  GridHelper, Group, HemisphereLight, InstancedMesh, LineBasicMaterial, LineSegments, Matrix4, Mesh,
  MeshBasicMaterial, MeshStandardMaterial, PerspectiveCamera, Quaternion, Raycaster, RingGeometry, Scene, Sphere,
  SphereGeometry, Vector3, WebGLRenderer, ArrowHelper,
} from "three";
import type { Material, Object3D } from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import type { ApproachMark, Body, Content, Shape, SurfacePoint, TouchMark } from "./content";
import { readMesh } from "./meshes";
import type { Vector } from "./vectors";

const TURN = 0.12;
const Z = new Vector3(0, 0, 1);

/** Colours of the current theme. */
interface Theme {
  ground: Color;
  body: Color;
  grid: Color;
  next: Color;
}

const geometries = new Map<string, BufferGeometry>();

/** Geometry of a shape's mesh, cached. */
function geometryOf(shape: Shape): BufferGeometry | undefined {
  if (shape.mesh === undefined) return undefined;
  const known = geometries.get(shape.id);
  if (known !== undefined) return known;
  const { file, format, metresPerUnit, origin } = shape.mesh;
  const made = readMesh(file, format, metresPerUnit, origin);
  geometries.set(shape.id, made);
  return made;
}

export class Stage {
  private readonly renderer: WebGLRenderer;
  private readonly scene = new Scene();
  private readonly camera = new PerspectiveCamera(38, 1, 0.001, 50);
  private readonly controls: OrbitControls;
  private readonly resized: ResizeObserver;
  private content = new Group();
  /** Previous content, freed after the next frame so that shaders are reused. */
  private readonly outdated: Group[] = [];
  private readonly lamp = new DirectionalLight(0xffffff, 1.6);
  private framed: Sphere | undefined;
  private waiting = 0;

  /** Draws into a canvas; throws without WebGL. */
  constructor(private readonly canvas: HTMLCanvasElement) {
    this.renderer = new WebGLRenderer({ canvas, antialias: true, alpha: true });
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    this.camera.up.set(0, 0, 1);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.enableDamping = false;
    this.controls.addEventListener("change", this.draw);
    this.lamp.position.set(1, -1.5, 2.5);
    this.camera.add(this.lamp);
    this.scene.add(this.camera, new AmbientLight(0xffffff, 0.7), new HemisphereLight(0xffffff, 0x8899aa, 1.1), this.content);
    this.resized = new ResizeObserver(this.resize);
    this.resized.observe(canvas.parentElement ?? canvas);
    canvas.addEventListener("keydown", this.onKey);
    this.resize();
  }

  /** Replaces the content; the camera moves only if the content has left its view. */
  show(content: Content): void {
    this.outdated.push(this.content);
    this.scene.remove(this.content);
    this.content = new Group();
    this.scene.add(this.content);
    const theme = themeOf();
    const radius = Math.max(0.01, sphereOf(content).radius);
    for (const body of content.bodies) this.content.add(bodyOf(body, theme, radius));
    const first = content.bodies.find((body) => body.ghost === undefined);
    if (content.patches.length > 0) {
      const patches = discs(content.patches, radius * 0.035);
      if (first !== undefined) place(patches, first.pose);
      this.content.add(patches);
    }
    for (const mark of touchMarks(content.touches, radius)) this.content.add(mark);
    this.content.updateMatrixWorld(true);
    for (const approach of content.approaches) this.content.add(approachOf(this.untilHit(approach), theme, radius));
    const sphere = sphereOf(content);
    if (content.bodies.length + content.touches.length > 0) this.content.add(floor(sphere, theme));
    this.frame(sphere);
    this.draw();
  }

  /** Places the camera in front and above, with everything in view. */
  reset = (): void => {
    const sphere = this.framed ?? new Sphere(new Vector3(), 0.1);
    const away = new Vector3(0.75, -1.15, 0.7).normalize().multiplyScalar(sphere.radius * 3.6);
    this.controls.target.copy(sphere.center);
    this.camera.position.copy(sphere.center).add(away);
    this.camera.near = sphere.radius / 50;
    this.camera.far = sphere.radius * 60;
    this.camera.updateProjectionMatrix();
    this.controls.update();
    this.draw();
  };

  dispose(): void {
    cancelAnimationFrame(this.waiting);
    this.resized.disconnect();
    this.canvas.removeEventListener("keydown", this.onKey);
    this.controls.dispose();
    [...this.outdated, this.content].forEach(empty);
    this.renderer.dispose();
    this.renderer.forceContextLoss();
  }

  private frame(sphere: Sphere): void {
    const before = this.framed;
    const moved = before === undefined || before.center.distanceTo(sphere.center) > before.radius * 0.7;
    const resized = before === undefined || sphere.radius > before.radius * 1.5 || sphere.radius < before.radius / 1.8;
    if (!moved && !resized) return;
    this.framed = sphere.clone();
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

  private readonly draw = (): void => {
    if (this.waiting !== 0) return;
    this.waiting = requestAnimationFrame(() => {
      this.waiting = 0;
      this.renderer.render(this.scene, this.camera);
      this.outdated.splice(0).forEach(empty);
    });
  };

  private readonly resize = (): void => {
    const { clientWidth: width, clientHeight: height } = this.canvas.parentElement ?? this.canvas;
    if (width === 0 || height === 0) return;
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    this.draw();
  };

  private readonly onKey = (event: KeyboardEvent): void => {
    const turns: Record<string, [number, number, number]> = {
      ArrowLeft: [-TURN, 0, 1],
      ArrowRight: [TURN, 0, 1],
      ArrowUp: [0, -TURN, 1],
      ArrowDown: [0, TURN, 1],
      "+": [0, 0, 0.9],
      "=": [0, 0, 0.9],
      "-": [0, 0, 1 / 0.9],
    };
    const turn = turns[event.key];
    if (event.key === "0" || event.key === "Home") this.reset();
    else if (turn === undefined) return;
    else this.turn(...turn);
    event.preventDefault();
  };

  private turn(around: number, over: number, farther: number): void {
    const arm = this.camera.position.clone().sub(this.controls.target);
    const distance = arm.length() * farther;
    const azimuth = Math.atan2(arm.y, arm.x) + around;
    const polar = Math.min(Math.PI - 0.05, Math.max(0.05, Math.acos(arm.z / arm.length()) + over));
    const flat = Math.sin(polar);
    arm.set(flat * Math.cos(azimuth), flat * Math.sin(azimuth), Math.cos(polar)).multiplyScalar(distance);
    this.camera.position.copy(this.controls.target).add(arm);
    this.controls.update();
    this.draw();
  }
}

let shared: { renderer: WebGLRenderer; scene: Scene; camera: PerspectiveCamera } | undefined;

/** Draws a small picture of a shape. All pictures share one renderer, because browsers limit them. */
export function picture(shape: Shape, into: HTMLCanvasElement): void {
  const width = 480;
  const height = 360;
  if (shared === undefined) {
    const renderer = new WebGLRenderer({ antialias: true, alpha: true, preserveDrawingBuffer: true });
    renderer.setSize(width, height, false);
    const camera = new PerspectiveCamera(36, width / height, 0.001, 50);
    camera.up.set(0, 0, 1);
    const lamp = new DirectionalLight(0xffffff, 1.6);
    lamp.position.set(1, -1.5, 2.5);
    camera.add(lamp);
    const scene = new Scene();
    scene.add(camera, new AmbientLight(0xffffff, 0.7), new HemisphereLight(0xffffff, 0x8899aa, 1.1));
    shared = { renderer, scene, camera };
  }
  const { renderer, scene, camera } = shared;
  const body: Body = { shape, pose: { position: [0, 0, 0], orientation: [0, 0, 0, 1] } };
  const sphere = sphereOf({ bodies: [body], touches: [], approaches: [], patches: [] });
  const drawn = bodyOf(body, themeOf(), sphere.radius);
  scene.add(drawn);
  camera.near = sphere.radius / 50;
  camera.far = sphere.radius * 60;
  camera.position.copy(sphere.center).add(new Vector3(0.75, -1.15, 0.7).normalize().multiplyScalar(sphere.radius * 3.5));
  camera.lookAt(sphere.center);
  camera.updateProjectionMatrix();
  renderer.render(scene, camera);
  into.width = width;
  into.height = height;
  into.getContext("2d")?.drawImage(renderer.domElement, 0, 0);
  scene.remove(drawn);
}

function themeOf(): Theme {
  const css = getComputedStyle(document.documentElement);
  const color = (name: string) => new Color(css.getPropertyValue(name).trim() || "#888888");
  return { ground: color("--raised"), body: color("--bar-faint"), grid: color("--line"), next: color("--good") };
}

function bodyOf(body: Body, theme: Theme, radius: number): Object3D {
  const group = new Group();
  const geometry = body.hideMesh ? undefined : geometryOf(body.shape);
  const { ghost } = body;
  if (geometry !== undefined) {
    const material = new MeshStandardMaterial({
      color: ghost ? new Color(ghost.color) : theme.body,
      roughness: 0.75,
      metalness: 0,
      side: DoubleSide,
      transparent: ghost !== undefined,
      opacity: ghost ? 0.1 + 0.3 * Math.min(1, ghost.weight) : 1,
      depthWrite: ghost === undefined,
    });
    const mesh = new Mesh(geometry, material);
    mesh.userData.solid = ghost === undefined;
    group.add(mesh);
  } else if (body.shape.points !== undefined && !body.hideMesh) {
    const color = ghost?.color ?? `#${theme.body.getHexString()}`;
    const points = body.shape.points.map((point) => ({ ...point, color: point.color ?? color }));
    group.add(discs(points, radius * 0.045, ghost ? 0.2 + 0.3 * ghost.weight : 1));
  }
  place(group, body.pose);
  return group;
}

function place(object: Object3D, pose: { position: readonly number[]; orientation: readonly number[] }): void {
  object.position.fromArray(pose.position as Vector);
  object.quaternion.fromArray(pose.orientation as [number, number, number, number]);
}

/** Small discs on a surface, facing along their normals. */
function discs(points: SurfacePoint[], radius: number, opacity = 1): InstancedMesh {
  const material = new MeshStandardMaterial({
    roughness: 0.8,
    transparent: opacity < 1,
    opacity,
    // A press sinks in by a few millimetres, so the disc is drawn in front of the surface.
    polygonOffset: true,
    polygonOffsetFactor: -2,
    polygonOffsetUnits: -900,
  });
  const mesh = new InstancedMesh(new CircleGeometry(radius, 14), material, points.length);
  points.forEach((point, i) => {
    mesh.setMatrixAt(i, facing(point.position, point.normal, radius * 0.15));
    mesh.setColorAt(i, new Color(point.color ?? "#888888"));
  });
  return mesh;
}

/** A frame at a point with its +z along the normal, lifted slightly off the surface. */
function facing(position: Vector, normal: Vector, lift: number, scale = 1): Matrix4 {
  const up = new Vector3(...normal).normalize();
  const at = new Vector3(...position).addScaledVector(up, lift);
  const turn = new Quaternion().setFromUnitVectors(Z, up);
  return new Matrix4().compose(at, turn, new Vector3(scale, scale, scale));
}

function touchMarks(touches: TouchMark[], radius: number): Object3D[] {
  const marks: Object3D[] = [];
  const lines: number[] = [];
  const colors: number[] = [];
  for (const touch of touches) {
    const size = radius * (touch.selected ? 0.072 : 0.05);
    const color = new Color(touch.color);
    const shape = touch.contact ? new SphereGeometry(size, 16, 12) : new RingGeometry(size * 0.7, size, 24);
    const material = new MeshBasicMaterial({ color, side: DoubleSide, depthTest: !touch.selected });
    const mark = new Mesh(shape, material);
    mark.applyMatrix4(facing(touch.position, touch.normal, 0));
    mark.renderOrder = touch.selected ? 2 : 1;
    marks.push(mark);
    // Parts behind the object stay faintly visible.
    const behind = new Mesh(shape, new MeshBasicMaterial({ color, side: DoubleSide, depthTest: false, transparent: true, opacity: 0.28 }));
    behind.matrixAutoUpdate = false;
    behind.matrix.copy(facing(touch.position, touch.normal, 0));
    marks.push(behind);
    const tip = touch.position.map((part, i) => part + touch.normal[i]! * radius * 0.24);
    lines.push(...touch.position, ...tip);
    colors.push(...color.toArray(), ...color.toArray());
  }
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new Float32BufferAttribute(lines, 3));
  geometry.setAttribute("color", new Float32BufferAttribute(colors, 3));
  marks.push(new LineSegments(geometry, new LineBasicMaterial({ vertexColors: true })));
  return marks;
}

function approachOf(approach: ApproachMark, theme: Theme, radius: number): Object3D {
  const length = Math.min(approach.length, radius * 0.9);
  const along = new Vector3(...approach.direction).normalize();
  const arrow = new ArrowHelper(
    along,
    new Vector3(...approach.from).addScaledVector(along, approach.length - length),
    length,
    theme.next,
    radius * 0.16,
    radius * (approach.best ? 0.1 : 0.06),
  );
  for (const part of [arrow.line, arrow.cone]) {
    const material = part.material as Material;
    material.transparent = true;
    material.opacity = approach.best ? 1 : 0.45;
    material.depthTest = !approach.best;
  }
  return arrow;
}

/** A faint grid in the frame's x-y plane, below everything. */
function floor(sphere: Sphere, theme: Theme): Object3D {
  const size = sphere.radius * 4;
  const grid = new GridHelper(size, 16, theme.grid, theme.grid);
  grid.rotation.x = Math.PI / 2;
  grid.position.copy(sphere.center).addScaledVector(Z, -sphere.radius * 1.02);
  return grid;
}

/** Bounding ball of the bodies, except ghosts, and the touches. */
function sphereOf(content: Content): Sphere {
  const box = new Box3();
  const solid = content.bodies.filter((body) => body.ghost === undefined);
  for (const body of solid.length > 0 ? solid : content.bodies) {
    const own = new Box3();
    const geometry = geometryOf(body.shape);
    if (geometry !== undefined) {
      geometry.computeBoundingBox();
      own.copy(geometry.boundingBox!);
    }
    for (const point of body.shape.points ?? []) own.expandByPoint(new Vector3(...point.position));
    if (own.isEmpty()) continue;
    const group = new Group();
    place(group, body.pose);
    group.updateMatrix();
    box.union(own.applyMatrix4(group.matrix));
  }
  for (const patch of solid.length === 0 ? content.patches : []) box.expandByPoint(new Vector3(...patch.position));
  for (const touch of content.touches) box.expandByPoint(new Vector3(...touch.position));
  return box.isEmpty() ? new Sphere(new Vector3(), 0.05) : box.getBoundingSphere(new Sphere());
}

/** Empties a group and frees its content, except for cached meshes. */
function empty(group: Group): void {
  const kept = new Set(geometries.values());
  group.traverse((node) => {
    if (!(node instanceof Mesh || node instanceof LineSegments)) return;
    const geometry = node.geometry as BufferGeometry;
    if (!kept.has(geometry)) geometry.dispose();
    (node.material as Material).dispose();
    if (node instanceof InstancedMesh) node.dispose();
  });
  group.clear();
}
