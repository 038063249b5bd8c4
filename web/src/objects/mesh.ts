// Formats of mesh files, and the units of their coordinates.
import type { MeshFormat, MeshUnit } from "../api/types";

export const FORMATS: MeshFormat[] = ["stl", "obj", "ply", "off", "glb", "3mf"];

/** Units with their words, the usual ones first. */
export const UNITS: [MeshUnit, string][] = [
  ["mm", "a millimetre (CAD)"], ["m", "a metre (robotics)"], ["cm", "a centimetre"], ["in", "an inch"],
];

/** The format by the end of a file's name. */
export function formatOf(name: string): MeshFormat | undefined {
  const end = name.split(".").pop()?.toLowerCase();
  return FORMATS.find((format) => format === end);
}

/** Whether files of a format record their unit. */
export function recordsUnit(format: MeshFormat): boolean {
  return format === "glb" || format === "3mf";
}

/** The query of an upload. */
export function meshQuery(format: MeshFormat, unit: MeshUnit | undefined): string {
  return unit === undefined || recordsUnit(format) ? `format=${format}` : `format=${format}&unit=${unit}`;
}
