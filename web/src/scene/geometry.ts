// Geometry of shapes' meshes, kept while there is room, and divided finely where a surface is tinted.
import type { BufferGeometry } from "three";
import { TessellateModifier } from "three/addons/modifiers/TessellateModifier.js";
import type { Shape } from "./content";
import { surfaceArea } from "./coverage";
import { Kept } from "./kept";
import { readMesh } from "./meshes";

const KEPT_BYTES_MAX = 96e6;
/** Edges of a fine surface: at most half a reach, but no more triangles than this, roughly. */
const FINE_TRIANGLES = 80_000;

// A geometry that is dropped while it is drawn is given to the graphics card again; who draws it disposes of it then.
const kept = new Kept<BufferGeometry>(KEPT_BYTES_MAX, (geometry) => {
  geometry.userData.isKept = false;
  geometry.dispose();
});

/** Geometry of a shape's mesh; undefined without a mesh. */
export function geometryOf(shape: Shape): BufferGeometry | undefined {
  return shape.mesh && keptOr(shape.id, () => newGeometry(shape)!);
}

/** Geometry of a shape's mesh that nobody else has: its owner disposes of it. */
export function newGeometry(shape: Shape): BufferGeometry | undefined {
  if (shape.mesh === undefined) return undefined;
  const { file, format, metresPerUnit, origin } = shape.mesh;
  return readMesh(file, format, metresPerUnit, origin);
}

/** The same surface in triangles small enough to show what lies within `reach`. */
export function fineGeometryOf(shape: Shape, reach: number): BufferGeometry | undefined {
  const coarse = geometryOf(shape);
  if (coarse === undefined) return undefined;
  return keptOr(`${shape.id} within ${reach}`, () => {
    const edge = Math.max(reach / 2, Math.sqrt((4 * surfaceArea(coarse.getAttribute("position").array)) / FINE_TRIANGLES));
    const fine = new TessellateModifier(edge, 10).modify(coarse);
    fine.computeVertexNormals();
    return fine;
  });
}

function keptOr(id: string, make: () => BufferGeometry): BufferGeometry {
  const known = kept.get(id);
  if (known !== undefined) return known;
  const made = make();
  made.userData.isKept = true;
  kept.set(id, made, 24 * made.getAttribute("position").count);
  return made;
}
