// Mesh files to geometry, for the four formats of the API.
import { BufferGeometry, Float32BufferAttribute, Mesh } from "three";
import { OBJLoader } from "three/addons/loaders/OBJLoader.js";
import { PLYLoader } from "three/addons/loaders/PLYLoader.js";
import { STLLoader } from "three/addons/loaders/STLLoader.js";
import { mergeGeometries } from "three/addons/utils/BufferGeometryUtils.js";
import type { Vector } from "./vectors";

/** Parses a mesh file into geometry in metres, in the object frame, with normals. */
export function readMesh(file: ArrayBuffer, format: string, metresPerUnit: number, origin: Vector): BufferGeometry {
  const geometry = parse(file, format);
  geometry.scale(metresPerUnit, metresPerUnit, metresPerUnit);
  geometry.translate(-origin[0], -origin[1], -origin[2]);
  geometry.deleteAttribute("normal");
  const flat = geometry.index === null ? geometry : geometry.toNonIndexed();
  flat.computeVertexNormals();
  return flat;
}

function parse(file: ArrayBuffer, format: string): BufferGeometry {
  switch (format) {
    case "stl":
      return new STLLoader().parse(file);
    case "ply":
      return new PLYLoader().parse(file);
    case "obj":
      return objGeometry(new TextDecoder().decode(file));
    default:
      return offGeometry(new TextDecoder().decode(file));
  }
}

function objGeometry(text: string): BufferGeometry {
  const parts: BufferGeometry[] = [];
  new OBJLoader().parse(text).traverse((node) => {
    if (node instanceof Mesh) {
      const part = new BufferGeometry();
      part.setAttribute("position", (node.geometry as BufferGeometry).getAttribute("position"));
      parts.push(part);
    }
  });
  return parts.length === 1 ? parts[0]! : mergeGeometries(parts);
}

/** OFF: counts, vertices, and faces, split into triangles at their first corner. */
function offGeometry(text: string): BufferGeometry {
  const numbers = text
    .replace(/^\s*OFF/, "")
    .replace(/#.*$/gm, "")
    .split(/\s+/)
    .filter((word) => word !== "")
    .map(Number);
  const [nVertices = 0, nFaces = 0] = numbers;
  const vertex = (i: number) => numbers.slice(3 + 3 * i, 6 + 3 * i);
  const positions: number[] = [];
  let at = 3 + 3 * nVertices;
  for (let face = 0; face < nFaces; face += 1) {
    const n = numbers[at] ?? 0;
    const corners = numbers.slice(at + 1, at + 1 + n);
    for (let i = 1; i + 1 < n; i += 1) {
      positions.push(...vertex(corners[0]!), ...vertex(corners[i]!), ...vertex(corners[i + 1]!));
    }
    at += 1 + n;
  }
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new Float32BufferAttribute(positions, 3));
  return geometry;
}
