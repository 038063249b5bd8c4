// A drop zone for meshes, with a dialog for the unit if the format does not record it.
import { useRef, useState } from "preact/hooks";
import { ask, sendJson } from "../api/http";
import type { MeshReport, MeshUnit, ObjectInfo } from "../api/types";
import { count, mm } from "../format";
import { Dialog } from "../parts/Dialog";
import { ProblemNote } from "../parts/Notes";
import { useAction } from "../parts/useAction";
import { FORMATS, formatOf, meshQuery, recordsUnit, UNITS } from "./mesh";

interface Props {
  onAdded: () => void;
  /** The object whose mesh is replaced; without it a new object is created. */
  into?: ObjectInfo;
}

export function DropZone({ onAdded, into }: Props) {
  const [over, setOver] = useState(false);
  const [file, setFile] = useState<File>();
  const chooser = useRef<HTMLInputElement>(null);
  const take = (files: FileList | null | undefined) => {
    const first = files?.[0];
    if (first) setFile(first);
  };
  return (
    <>
      {/* biome-ignore lint/a11y/noStaticElementInteractions: dropping is for the mouse; the button within does the same */}
      <div
        class={over ? "drop drop-over" : "drop"}
        onDragOver={(event) => {
          event.preventDefault();
          setOver(true);
        }}
        onDragLeave={() => setOver(false)}
        onDrop={(event) => {
          event.preventDefault();
          setOver(false);
          take(event.dataTransfer?.files);
        }}
      >
        <span>
          <b>{into ? "Replace the mesh" : "Add an object"}</b>
          <span class="faint"> · drop a mesh here (STL, OBJ, PLY, OFF, GLB or 3MF)</span>
        </span>
        <button type="button" onClick={() => chooser.current?.click()}>
          Choose a file …
        </button>
        <input
          ref={chooser}
          type="file"
          hidden
          aria-label="Mesh file"
          accept={FORMATS.map((one) => `.${one}`).join()}
          onChange={(event) => {
            take(event.currentTarget.files);
            event.currentTarget.value = "";
          }}
        />
      </div>
      {file && <MeshDialog key={file.name} file={file} {...(into ? { into } : {})} onClose={() => setFile(undefined)} onAdded={onAdded} />}
    </>
  );
}

function MeshDialog({ file, into, onClose, onAdded }: Props & { file: File; onClose: () => void }) {
  const format = formatOf(file.name);
  const [name, setName] = useState(into?.name ?? nameOf(file.name));
  const [unit, setUnit] = useState<MeshUnit>();
  const [report, setReport] = useState<MeshReport>();
  const action = useAction();
  const isKnown = format !== undefined && recordsUnit(format);
  const submit = (event: Event) => {
    event.preventDefault();
    action.run(async () => {
      const id = into?.id ?? (await made(name)).id;
      const answer = await ask(`/v1/objects/${id}/mesh?${meshQuery(format ?? "stl", unit)}`, {
        method: "PUT",
        headers: { "content-type": "application/octet-stream" },
        body: file,
      });
      setReport((await answer.json()) as MeshReport);
      onAdded();
    });
  };
  return (
    <Dialog title={into ? `New mesh of ${into.name}` : "Add an object"} onClose={onClose}>
      {report ? (
        <Understood report={report} name={name} onClose={onClose} />
      ) : (
        <form onSubmit={submit}>
          <p class="faint">{file.name}, {count(file.size)} bytes</p>
          {format === undefined && (
            <p class="note note-warn">The name does not end in .stl, .obj, .ply, .off, .glb or .3mf; it will be read as STL.</p>
          )}
          {!into && (
            <div class="field">
              <label for="object-name">Name</label>
              <input id="object-name" type="text" required maxlength={64} pattern="[A-Za-z0-9][A-Za-z0-9._\-]*" value={name}
                onInput={(event) => setName(event.currentTarget.value)} />
              <span class="hint">Letters, digits, “.”, “_” and “-”.</span>
            </div>
          )}
          {!isKnown && (
            <fieldset>
              <legend>One unit of the file means</legend>
              {UNITS.map(([one, words]) => (
                <label key={one}>
                  <input type="radio" name="unit" value={one} required checked={unit === one} onChange={() => setUnit(one)} />
                  {words}
                </label>
              ))}
            </fieldset>
          )}
          {action.problem && <ProblemNote problem={action.problem} />}
          <div class="form-end">
            <button type="submit" class="primary" disabled={action.busy || (!isKnown && unit === undefined)}>
              {action.busy ? "Sending …" : into ? "Replace" : "Add"}
            </button>
          </div>
        </form>
      )}
    </Dialog>
  );
}

function Understood({ report, name, onClose }: { report: MeshReport; name: string; onClose: () => void }) {
  return (
    <div class="stack">
      <div class="note note-good" role="status">
        <p class="note-title">{name} has its mesh</p>
        <p>
          {count(report.n_triangles)} triangles, {report.size.map((side) => mm(side).replace(" mm", "")).join(" × ")} mm.
        </p>
      </div>
      {report.warnings.map((warning) => (
        <p key={warning} class="note note-warn">{warning}</p>
      ))}
      <div class="form-end">
        <button type="button" class="primary" onClick={onClose}>
          Done
        </button>
      </div>
    </div>
  );
}

/** Creates an object, or finds the one that an interrupted upload left without a mesh. */
async function made(name: string): Promise<ObjectInfo> {
  try {
    return await sendJson<ObjectInfo>("POST", "/v1/objects", { name });
  } catch (error) {
    const found = await ask(`/v1/objects/${encodeURIComponent(name)}`).catch(() => undefined);
    const object = found && ((await found.json()) as ObjectInfo);
    if (object && !object.mesh && object.n_readings === 0) return object;
    throw error;
  }
}

/** An object name from a file name, with dashes for invalid characters. */
function nameOf(file: string): string {
  const bare = file.replace(/\.[^.]*$/, "").replace(/[^A-Za-z0-9._-]+/g, "-");
  return bare.replace(/^[^A-Za-z0-9]+/, "").slice(0, 64);
}
