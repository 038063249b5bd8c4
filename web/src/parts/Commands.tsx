// Commands that work on this server as it is, with its address and, if it requires keys, the key.
import { useState } from "preact/hooks";
import { getAll, getJson } from "../api/http";
import { useResource } from "../api/resource";
import type { Catalogue, CatalogueVersion, ObjectInfo, Role } from "../api/types";
import { may, who } from "../signin";

/** Lines for a shell, with the button that copies them; another role reads who may run them. */
export function Commands({ lines, roles }: { lines: string[]; roles: Role[] }) {
  const [copied, setCopied] = useState(false);
  if (!may(...roles)) return <p>Needs a key with the role {roles.join(" or ")}.</p>;
  const text = [...preamble(), ...lines].join("\n");
  const copy = () => void navigator.clipboard?.writeText(text).then(() => setCopied(true), () => undefined);
  return (
    <div class="commands">
      <pre tabIndex={0}>{text}</pre>
      <button type="button" class="small" onClick={copy}>{copied ? "Copied" : "Copy"}</button>
    </div>
  );
}

/** This server's address, and a prompt for the key. */
function preamble(): string[] {
  const key = "read -rsp 'API key: ' PALPATE_KEY && export PALPATE_KEY";
  return [`export PALPATE_SERVER=${location.origin}`, ...(who.value?.keys_required ? [key] : [])];
}

/** The object of the examples. */
const EXAMPLE = "mug";
export const EXAMPLE_MESH = `palpate objects example ${EXAMPLE} --out .`;
export const ADD_EXAMPLE = [EXAMPLE_MESH, `palpate objects add ${EXAMPLE} --mesh ${EXAMPLE}.stl --unit mm`];

/** Commands that train what the server has, or the example. */
export function TrainCommands() {
  const objects = useResource("objects to train", (signal) => getAll<ObjectInfo>("/v1/objects", 5000, signal));
  if (objects.data === undefined) return null;
  const hasTrainable = objects.data.some((object) => object.mesh || object.n_readings > 0);
  return <Commands lines={[...(hasTrainable ? [] : ADD_EXAMPLE), "palpate train"]} roles={["trainer", "admin"]} />;
}

/** Commands that open a session of a simulated robot. */
export function TouchCommands() {
  const lines = useResource("commands of a session", touchLines);
  if (lines.data === undefined) return null;
  // Without a version the object is added and trained first.
  const roles: Role[] = lines.data.some((line) => line.startsWith("palpate train")) ? ["admin"] : ["robot", "admin"];
  return <Commands lines={lines.data} roles={roles} />;
}

async function touchLines(signal: AbortSignal): Promise<string[]> {
  const objects = await getAll<ObjectInfo>("/v1/objects", 5000, signal);
  const trained = await touchable(objects, signal);
  if (trained !== undefined) {
    const { catalogue, object } = trained;
    return [download(object), touch(object.name, fileOf(object), object.mesh!.unit, catalogue)];
  }
  const hasExample = objects.some((object) => object.name === EXAMPLE && object.mesh);
  const add = hasExample ? [EXAMPLE_MESH] : ADD_EXAMPLE;
  return [...add, `palpate train ${EXAMPLE}`, touch(EXAMPLE, `${EXAMPLE}.stl`, "mm", "default")];
}

/** An object with a mesh that a current version knows. */
async function touchable(objects: ObjectInfo[], signal: AbortSignal) {
  for (const { name: catalogue, current } of await getAll<Catalogue>("/v1/catalogues", 100, signal)) {
    if (!current) continue;
    const path = `/v1/catalogues/${encodeURIComponent(catalogue)}/versions/${current.version}`;
    const { report } = await getJson<CatalogueVersion>(path, signal);
    const known = new Set(report.objects.map((one) => one.id));
    const object = objects.find((one) => one.mesh && known.has(one.id));
    if (object !== undefined) return { catalogue, object };
  }
  return undefined;
}

function fileOf(object: ObjectInfo): string {
  return `${object.name}.${object.mesh!.format.toLowerCase()}`;
}

function download(object: ObjectInfo): string {
  const key = who.value?.keys_required ? ' -H "authorization: Bearer $PALPATE_KEY"' : "";
  return `curl -fsS${key} -o ${fileOf(object)} $PALPATE_SERVER/v1/objects/${object.id}/mesh`;
}

function touch(object: string, file: string, unit: string, catalogue: string): string {
  const into = catalogue === "default" ? "" : ` --catalogue ${catalogue}`;
  return `palpate touch --object ${object} --mesh ${file} --unit ${unit}${into} --pace 500`;
}
