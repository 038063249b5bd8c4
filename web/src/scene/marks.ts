// Touches, suggested approaches and the uncertainty of a pose, as few meshes whatever their number.
import {
  ArrowHelper, BackSide, BufferGeometry, Color, ConeGeometry, DoubleSide, Float32BufferAttribute, Group, InstancedMesh, LineBasicMaterial,
  LineSegments, Matrix4, Mesh, MeshBasicMaterial, RingGeometry, SphereGeometry, Vector3,
} from "three";
import type { Material, Object3D } from "three";
import { facing } from "./bodies";
import type { ApproachMark, Content, TouchMark } from "./content";
import { directionSpread, positionSpread } from "./spread";
import type { Theme } from "./studio";
import { rotate, type Vector } from "./vectors";

/** Radius of a mark, and length of its normal, as shares of the content's radius, for up to `PLAIN` touches. */
const SIZE = 0.04;
const NORMAL = 0.2;
const PLAIN = 24;
/** Standard deviations that ellipsoid and cones show. */
const SIGMAS = 2;
/** Wider cones are drawn with this half angle, in radians. */
const CONE_MAX = Math.PI / 3;

/** Size of the marks of this many touches, as a share of the content's radius: many are smaller. */
export function markSize(nTouches: number): number {
  return SIZE * Math.sqrt(Math.min(1, PLAIN / Math.max(1, nTouches)));
}

/** Marks of touches, with or without contact, and their normals. */
export function touchMarks(touches: TouchMark[], radius: number, theme: Theme): Object3D[] {
  if (touches.length === 0) return [];
  const size = radius * markSize(touches.length);
  const contacts = touches.filter((touch) => touch.contact);
  const misses = touches.filter((touch) => !touch.contact);
  const sphere = new SphereGeometry(size, 14, 10);
  const ring = new RingGeometry(size * 0.75, size * 1.1, 24);
  return [
    ...instances(sphere, contacts, theme),
    ...instances(ring, misses, theme),
    normals(touches, (radius * NORMAL * markSize(touches.length)) / SIZE, theme),
  ];
}

function instances(shape: BufferGeometry, touches: TouchMark[], theme: Theme): InstancedMesh[] {
  if (touches.length === 0) return [];
  const front = new MeshBasicMaterial({ side: DoubleSide });
  // Parts behind the object stay faintly visible.
  const behind = new MeshBasicMaterial({ side: DoubleSide, depthTest: false, transparent: true, opacity: 0.2 });
  return [front, behind].map((material) => {
    const mesh = new InstancedMesh(shape, material, touches.length);
    touches.forEach((touch, i) => {
      mesh.setMatrixAt(i, facing(touch.position, touch.normal, 0, 0.6 + 0.4 * touch.strength));
      mesh.setColorAt(i, faded(touch, theme));
    });
    mesh.renderOrder = material === front ? 1 : 0;
    return mesh;
  });
}

/** A selected touch: larger, with an outline, in front of everything. */
export function haloMark(touch: TouchMark, size: number, theme: Theme): Group {
  const group = new Group();
  const shape = touch.contact ? new SphereGeometry(size, 20, 14) : new RingGeometry(size * 0.75, size * 1.1, 24);
  const outline = touch.contact ? new SphereGeometry(size * 1.3, 20, 14) : new RingGeometry(size * 0.6, size * 1.25, 24);
  const layers = [
    new Mesh(outline, new MeshBasicMaterial({ color: theme.ink, side: touch.contact ? BackSide : DoubleSide, depthTest: false })),
    new Mesh(shape, new MeshBasicMaterial({ color: touch.color, side: DoubleSide, depthTest: false })),
  ];
  layers.forEach((layer, i) => {
    layer.applyMatrix4(facing(touch.position, touch.normal, 0));
    layer.renderOrder = 4 + i;
    group.add(layer);
  });
  return group;
}

function faded({ color, strength }: TouchMark, theme: Theme): Color {
  return new Color(color).lerp(theme.ground, 0.75 * (1 - strength));
}

function normals(touches: TouchMark[], length: number, theme: Theme): LineSegments {
  const places: number[] = [];
  const colors: number[] = [];
  for (const touch of touches) {
    const tip = touch.position.map((part, i) => part + touch.normal[i]! * length * touch.strength);
    places.push(...touch.position, ...tip);
    const color = faded(touch, theme).toArray();
    colors.push(...color, ...color);
  }
  return lines(places, colors);
}

function lines(places: number[], colors: number[]): LineSegments {
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new Float32BufferAttribute(places, 3));
  geometry.setAttribute("color", new Float32BufferAttribute(colors, 3));
  return new LineSegments(geometry, new LineBasicMaterial({ vertexColors: true }));
}

/** An arrow that ends where the approach ends. */
export function approachMark(approach: ApproachMark, theme: Theme, radius: number): Object3D {
  const length = Math.min(approach.length, radius * 0.9);
  const along = new Vector3(...approach.direction).normalize();
  const arrow = new ArrowHelper(
    along,
    new Vector3(...approach.from).addScaledVector(along, approach.length - length),
    length,
    theme.next,
    radius * 0.12,
    radius * (approach.best ? 0.07 : 0.045),
  );
  for (const part of [arrow.line, arrow.cone]) {
    const material = part.material as Material;
    material.transparent = true;
    material.opacity = approach.best ? 1 : 0.45;
    material.depthTest = !approach.best;
  }
  return arrow;
}

/** The place of a pose as an ellipsoid, and its three axes as cones: both of two standard deviations. */
export function uncertaintyMark({ pose, covariance }: NonNullable<Content["uncertain"]>, theme: Theme, radius: number): Group {
  const group = new Group();
  group.position.fromArray(pose.position as Vector);
  const { directions, sigmas } = positionSpread(covariance);
  const ellipsoid = new Mesh(new SphereGeometry(1, 24, 16), through(theme.ink, 0.45));
  ellipsoid.applyMatrix4(basis(directions, sigmas.map((sigma) => Math.max(1e-5, SIGMAS * sigma))));
  group.add(ellipsoid);
  const length = radius * 0.75;
  const places: number[] = [];
  const colors: number[] = [];
  ([[1, 0, 0], [0, 1, 0], [0, 0, 1]] as Vector[]).forEach((unit, i) => {
    const axis = rotate(pose.orientation, unit);
    const wavers = directionSpread(covariance, axis);
    const [most, least] = wavers.sigmas.map((sigma) => Math.min(CONE_MAX, SIGMAS * sigma)) as Vector;
    const height = length * Math.cos(most);
    const across = new Vector3(...axis).cross(new Vector3(...wavers.directions[0])).toArray();
    const cone = new Mesh(unitCone(), through(theme.axes[i]!, 0.28));
    cone.applyMatrix4(basis([wavers.directions[0], across, axis], [Math.tan(most) * height, Math.max(1e-6, Math.tan(least) * height), height]));
    if (most > 0) group.add(cone);
    places.push(0, 0, 0, ...axis.map((part) => part * length));
    const color = new Color(theme.axes[i]!).toArray();
    colors.push(...color, ...color);
  });
  const axes = lines(places, colors);
  (axes.material as Material).depthTest = false;
  axes.renderOrder = 3;
  group.add(axes);
  return group;
}

/** Its tip at the origin, opening along +z. */
function unitCone(): ConeGeometry {
  return new ConeGeometry(1, 1, 32, 1, true).rotateX(-Math.PI / 2).translate(0, 0, 0.5);
}

/** Seen through everything. */
function through(color: string, opacity: number): MeshBasicMaterial {
  return new MeshBasicMaterial({ color, transparent: true, opacity, depthTest: false, depthWrite: false, side: DoubleSide });
}

function basis(directions: Vector[], lengths: number[]): Matrix4 {
  const [x, y, z] = directions.map((direction, i) => new Vector3(...direction).multiplyScalar(lengths[i]!));
  return new Matrix4().makeBasis(x!, y!, z!);
}
