// The versions that new sessions of each catalogue use.
import { getAll, getJson } from "../api/http";
import type { Catalogue, CatalogueVersion } from "../api/types";

export async function currentVersions(signal: AbortSignal): Promise<CatalogueVersion[]> {
  const catalogues = await getAll<Catalogue>("/v1/catalogues", 100, signal);
  return Promise.all(
    catalogues.flatMap(({ name, current }) =>
      current ? [getJson<CatalogueVersion>(`/v1/catalogues/${encodeURIComponent(name)}/versions/${current.version}`, signal)] : [],
    ),
  );
}

/** `default version 3`. */
export function versionName({ catalogue, version }: CatalogueVersion): string {
  return `${catalogue} version ${version}`;
}
