// Shape of a trained object: its mesh, otherwise its trained map, otherwise its training touches.
import { ask, getAll, getJson, ProblemError } from "../api/http";
import type { CatalogueVersion, MapPatch, ObjectInfo, ObjectMap, StoredReading } from "../api/types";
import type { Shape, SurfacePoint } from "../scene/content";
import { Kept } from "../scene/kept";
import { rotate, type Vector } from "../scene/vectors";

const KEPT_BYTES_MAX = 64e6;
/** A surface point as it is kept: two vectors of numbers in objects. */
const POINT_BYTES = 200;

const kept = new Kept<Promise<Shape>>(KEPT_BYTES_MAX);

/** Shape of an object of a version in its own frame, cached. */
export function shapeOf(version: CatalogueVersion, object: string): Promise<Shape> {
  const id = `${version.catalogue}/${version.version}/${object}`;
  const known = kept.get(id);
  if (known !== undefined) return known;
  const asked = load(version, object, id);
  kept.set(id, asked, 0);
  asked.then(
    (shape) => kept.set(id, asked, bytesOf(shape)),
    () => kept.forget(id),
  );
  return asked;
}

function bytesOf(shape: Shape): number {
  return (shape.mesh?.file.byteLength ?? 0) + (shape.points?.length ?? 0) * POINT_BYTES;
}

async function load(version: CatalogueVersion, object: string, id: string): Promise<Shape> {
  const trained = version.report.objects.find((one) => one.id === object);
  const origin = (trained?.origin_in_mesh ?? [0, 0, 0]) as Vector;
  const info = await orNothing(() => getJson<ObjectInfo>(`/v1/objects/${object}`));
  // An object with readings was trained from those, in their frame.
  if (info?.mesh && info.n_readings === 0) return meshOf(info, origin, `${id}/${info.mesh.hash}`);
  const patches = await orNothing(() => patchesOf(version, object));
  if (patches !== undefined && patches.length > 0) return { id, points: patches };
  if (info === undefined) return { id, points: [] };
  return { id, points: await touchesOf(info, origin) };
}

/** An object's mesh, moved to the origin of the object frame. */
export async function meshOf(info: ObjectInfo, origin: Vector, id: string): Promise<Shape> {
  const file = await (await ask(`/v1/objects/${info.id}/mesh`)).arrayBuffer();
  const mesh = info.mesh!;
  return { id, mesh: { file, format: mesh.format, metresPerUnit: mesh.unit === "mm" ? 0.001 : 1, origin } };
}

/** Surface points from a version's pair map. */
export async function mapOf(version: CatalogueVersion, object: string): Promise<ObjectMap & { all: MapPatch[] }> {
  const path = `/v1/catalogues/${encodeURIComponent(version.catalogue)}/versions/${version.version}/objects/${object}/map`;
  const all: MapPatch[] = [];
  let map = await getJson<ObjectMap>(`${path}?limit=1000`);
  all.push(...map.patches);
  while (typeof map.next_cursor === "string" && all.length < 4000) {
    map = await getJson<ObjectMap>(`${path}?limit=1000&cursor=${encodeURIComponent(map.next_cursor)}`);
    all.push(...map.patches);
  }
  return { ...map, all };
}

async function patchesOf(version: CatalogueVersion, object: string): Promise<SurfacePoint[]> {
  const map = await mapOf(version, object);
  return map.all.map(({ position, normal }) => ({ position: position as Vector, normal: normal as Vector }));
}

/** Surface points from a robot's training readings: at the sensor, against its +z. */
export async function touchesOf(info: ObjectInfo, origin: Vector): Promise<SurfacePoint[]> {
  const readings = await getAll<StoredReading>(`/v1/objects/${info.id}/readings`, 2000);
  return readings.flatMap(({ pose }) => {
    if (!pose) return [];
    const position = pose.position.map((part, i) => part - origin[i]!) as Vector;
    return [{ position, normal: rotate(pose.orientation, [0, 0, -1]) }];
  });
}

/** Undefined if the resource does not exist or was not trained. */
async function orNothing<T>(get: () => Promise<T>): Promise<T | undefined> {
  try {
    return await get();
  } catch (error) {
    if (error instanceof ProblemError && [403, 404, 409].includes(error.status)) return undefined;
    throw error;
  }
}
