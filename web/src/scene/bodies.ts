// Objects as solids, ghosts and discs, and the points that must be in view.
import {
  BufferAttribute, BufferGeometry, CircleGeometry, Color, DoubleSide, Group, InstancedMesh, Matrix4, Mesh, MeshBasicMaterial,
  MeshStandardMaterial, Quaternion, SRGBColorSpace, Vector3,
} from "three";
import type { Object3D } from "three";
import type { Body, Content, SurfacePoint, TouchMark } from "./content";
import { heat } from "../format";
import { apartness, type Press, surfaceArea, touchedShare } from "./coverage";
import { fineGeometryOf, geometryOf } from "./geometry";
import { carried, type Valued } from "./heat";
import type { Theme } from "./studio";
import { outline, roundLength } from "./view";
import type { Vector } from "./vectors";

const Z = new Vector3(0, 0, 1);
/** Width of the mean over places of a heat map, in spacings of the places. */
const HEAT_SPACINGS = 0.6;

/** Draws a body; `geometry` replaces that of its shape. */
export function drawBody(body: Body, theme: Theme, radius: number, geometry = geometryOf(body.shape)): Group {
  const group = new Group();
  const { ghost } = body;
  if (geometry !== undefined && !body.hideMesh) {
    const color = ghost ? new Color(ghost.color) : theme.body;
    const mesh = new Mesh(geometry, body.isTruth ? lineMaterial(theme.truth) : solidMaterial(color, ghost?.weight));
    mesh.userData.solid = ghost === undefined && !body.isTruth;
    group.add(mesh);
  } else if (body.shape.points !== undefined && !body.hideMesh) {
    const color = ghost?.color ?? `#${(body.isTruth ? theme.truth : theme.body).getHexString()}`;
    const points = body.shape.points.map((point) => ({ ...point, color: point.color ?? color }));
    group.add(discs(points, radius * 0.045, ghost ? 0.2 + 0.3 * ghost.weight : 1));
  }
  place(group, body.pose);
  return group;
}

/** The net of a mesh: where it coincides with the believed one both are seen. */
function lineMaterial(color: Color): MeshBasicMaterial {
  return new MeshBasicMaterial({ color, wireframe: true, transparent: true, opacity: 0.3, depthWrite: false });
}

function solidMaterial(color: Color, ghostWeight?: number): MeshStandardMaterial {
  return new MeshStandardMaterial({
    color,
    roughness: 0.75,
    metalness: 0,
    side: DoubleSide,
    transparent: ghostWeight !== undefined,
    opacity: ghostWeight === undefined ? 1 : 0.1 + 0.3 * Math.min(1, ghostWeight),
    depthWrite: ghostWeight === undefined,
  });
}

/** A body with the surface tinted that no touch has reached, and the share that was. */
export interface Covered {
  drawn: Object3D;
  share: number;
}

/** Draws a body with its untouched surface tinted. */
export function drawCovered(body: Body, touches: TouchMark[], theme: Theme, radius: number): Covered {
  const presses = pressesOn(body, touches);
  // Rounded, so that another touch does not divide the surface anew.
  const fine = fineGeometryOf(body.shape, roundLength(Math.min(...presses.map((press) => press.reach), radius / 4)));
  if (fine === undefined) return coveredPoints(body, presses, theme, radius);
  const positions = fine.getAttribute("position");
  const apart = apartness(positions.array, fine.getAttribute("normal").array, presses);
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", positions);
  geometry.setAttribute("normal", fine.getAttribute("normal"));
  geometry.setAttribute("apart", new BufferAttribute(apart, 1));
  const drawn = drawBody(body, theme, radius, geometry);
  drawn.traverse((node) => {
    if (node instanceof Mesh) tintBeyond(node.material as MeshStandardMaterial, theme.untouched);
  });
  return { drawn, share: touchedShare(positions.array, apart) };
}

function coveredPoints(body: Body, presses: Press[], theme: Theme, radius: number): Covered {
  const points = body.shape.points ?? [];
  const apart = apartness(points.flatMap((point) => point.position), points.flatMap((point) => point.normal), presses);
  const untouched = `#${theme.untouched.getHexString()}`;
  const tinted = points.map((point, i) => (apart[i]! <= 1 ? point : { ...point, color: untouched }));
  const near = apart.filter((one) => one <= 1).length;
  return { drawn: drawBody({ ...body, shape: { ...body.shape, points: tinted } }, theme, radius), share: points.length === 0 ? 0 : near / points.length };
}

/** Draws a body whose mesh is coloured by places with values from 0 to 1; without a mesh it stays plain. */
export function drawHeated(body: Body, places: Valued[], theme: Theme, radius: number): Group {
  const coarse = geometryOf(body.shape);
  if (coarse === undefined || places.length === 0) return drawBody(body, theme, radius);
  const spacing = Math.sqrt(surfaceArea(coarse.getAttribute("position").array) / places.length);
  const fine = fineGeometryOf(body.shape, roundLength(spacing))!;
  const [positions, normals] = [fine.getAttribute("position"), fine.getAttribute("normal")];
  const values = carried(positions.array, normals.array, places, HEAT_SPACINGS * spacing);
  const colors = new Float32Array(3 * values.length);
  const color = new Color();
  values.forEach((value, i) => {
    if (Number.isNaN(value)) color.copy(theme.body);
    else color.setRGB(...(heat(value).map((part) => part / 255) as Vector), SRGBColorSpace);
    color.toArray(colors, 3 * i);
  });
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", positions);
  geometry.setAttribute("normal", normals);
  geometry.setAttribute("color", new BufferAttribute(colors, 3));
  const drawn = drawBody(body, theme, radius, geometry);
  drawn.traverse((node) => {
    if (!(node instanceof Mesh)) return;
    const material = node.material as MeshStandardMaterial;
    material.color.set("#ffffff");
    material.vertexColors = true;
  });
  return drawn;
}

/** Touches with contact, in the frame of a body. */
function pressesOn(body: Body, touches: TouchMark[]): Press[] {
  const sessionFromObject = new Group();
  place(sessionFromObject, body.pose);
  sessionFromObject.updateMatrix();
  const objectFromSession = sessionFromObject.matrix.invert();
  return touches.flatMap(({ position, normal, contact, reach }): Press[] => {
    if (!contact || reach === undefined) return [];
    return [{
      position: new Vector3(...position).applyMatrix4(objectFromSession).toArray(),
      normal: new Vector3(...normal).transformDirection(objectFromSession).toArray(),
      reach,
    }];
  });
}

/** Mixes a tint into a material where the attribute `apart` is above 1. */
function tintBeyond(material: MeshStandardMaterial, tint: Color): void {
  material.onBeforeCompile = (shader) => {
    shader.uniforms.tint = { value: tint };
    shader.vertexShader = `attribute float apart;\nvarying float vApart;\n${shader.vertexShader}`
      .replace("#include <begin_vertex>", "#include <begin_vertex>\n\tvApart = apart;");
    shader.fragmentShader = `uniform vec3 tint;\nvarying float vApart;\n${shader.fragmentShader}`
      .replace("#include <color_fragment>", "#include <color_fragment>\n\tdiffuseColor.rgb = mix(diffuseColor.rgb, tint, 0.8 * smoothstep(0.97, 1.03, vApart));");
  };
  material.customProgramCacheKey = () => "tintBeyond";
}

export function place(object: Object3D, pose: { position: readonly number[]; orientation: readonly number[] }): void {
  object.position.fromArray(pose.position as Vector);
  object.quaternion.fromArray(pose.orientation as [number, number, number, number]);
}

/** Small discs on a surface, facing along their normals. */
export function discs(points: SurfacePoint[], radius: number, opacity = 1): InstancedMesh {
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
export function facing(position: Vector, normal: Vector, lift: number, scale = 1): Matrix4 {
  const up = new Vector3(...normal).normalize();
  const at = new Vector3(...position).addScaledVector(up, lift);
  const turn = new Quaternion().setFromUnitVectors(Z, up);
  return new Matrix4().compose(at, turn, new Vector3(scale, scale, scale));
}

/** Outlines of the bodies, except ghosts, and the touches: what must be in view. */
export function pointsInView(content: Content): Vector[] {
  const solid = content.bodies.filter((body) => body.ghost === undefined && !body.isTruth);
  const points = (solid.length > 0 ? solid : content.bodies).flatMap((body) => outlineOf(body));
  if (solid.length === 0) points.push(...content.patches.map((patch) => patch.position));
  points.push(...content.touches.map((touch) => touch.position));
  return points;
}

/** The outermost points of a body, in the scene's frame. */
export function outlineOf(body: Body, geometry = geometryOf(body.shape)): Vector[] {
  const points = geometry ? outlineOfMesh(geometry) : outline((body.shape.points ?? []).flatMap((point) => point.position));
  const group = new Group();
  place(group, body.pose);
  group.updateMatrix();
  return points.map((point) => new Vector3(...point).applyMatrix4(group.matrix).toArray());
}

/** Found once for each mesh. */
function outlineOfMesh(geometry: BufferGeometry): Vector[] {
  geometry.userData.outline ??= outline(geometry.getAttribute("position").array);
  return geometry.userData.outline as Vector[];
}
