// Commissioning: touches of a known object in, findings and a passport out.
import { useRef, useState } from "preact/hooks";
import { getJson, sendJson } from "../api/http";
import { useResource } from "../api/resource";
import type { Commissioning, ReferenceBodies, Sensor, SensorPassport } from "../api/types";
import { percent, plural, when } from "../format";
import { Commands } from "../parts/Commands";
import { ProblemNote, Show } from "../parts/Notes";
import { Badge, Facts, Panel } from "../parts/Panel";
import { TactileImage } from "../parts/TactileImage";
import { Table } from "../parts/Table";
import { useAction } from "../parts/useAction";
import { may } from "../signin";

const KINDS = { right: "good", wrong: "bad", undetermined: "warn" } as const;
/** Touches whose images are shown. */
const SHOWN = 6;

export function CommissionPanel({ sensor, onApplied }: { sensor: Sensor; onApplied: () => void }) {
  const passport = useResource(`passport ${sensor.id} ${sensor.passport ?? ""}`, (signal) => passportOf(sensor, signal));
  const [body, setBody] = useState("");
  const [touches, setTouches] = useState<{ name: string; readings: unknown[] }>();
  const [found, setFound] = useState<Commissioning>();
  const [wrongFile, setWrongFile] = useState("");
  const chooser = useRef<HTMLInputElement>(null);
  const bodies = useResource("reference bodies", (signal) => getJson<ReferenceBodies>("/v1/reference-bodies", signal));
  const action = useAction();
  const isTeaching = may("trainer", "admin");
  const known = bodies.data?.items.map((one) => one.name as string) ?? [];
  const run = (apply: boolean) =>
    action.run(async () => {
      const touched = known.includes(body) ? { reference_body: body } : { object: body };
      setFound(await sendJson<Commissioning>("POST", `/v1/sensors/${sensor.id}/commissionings`, { ...touched, readings: touches!.readings, apply }));
      if (apply) onApplied();
    });
  const compare = (event: Event) => {
    event.preventDefault();
    run(false);
  };
  const take = async (file: File | undefined) => {
    if (!file) return;
    const readings = readingsIn(await file.text());
    setFound(undefined);
    setTouches(readings && { name: file.name, readings });
    setWrongFile(readings ? "" : `${file.name} holds no touches: expected JSON, a list of readings with image and pose, or one on each line.`);
  };
  return (
    <Panel title="Commissioning" aside={passport.data ? `passport ${passport.data.number}, ${when(passport.data.created_at)}` : ""}>
      <div class="stack">
        <Show of={passport} what="the passport" lines={2}>
          {(one) => (one === null ? <p class="faint">Not commissioned: readings count as they are sent.</p> : <Passport passport={one} />)}
        </Show>
        {isTeaching && (
          <form class="stack" onSubmit={compare}>
            <p>Touch one known object about twenty times, on faces with different normals, edges and corners, and give the touches as your driver sends them.</p>
            <div class="field">
              <label for="touched">Touched object or reference body</label>
              <input id="touched" type="text" list="bodies" required value={body} onInput={(event) => setBody(event.currentTarget.value)} />
              <datalist id="bodies">{known.map((name) => <option key={name} value={name} />)}</datalist>
              <span class="hint">{bodies.data?.items.find((one) => one.name === body)?.tells ?? "An object with a mesh, or one of the four bodies to print."}</span>
            </div>
            <div class="actions">
              <button type="button" onClick={() => chooser.current?.click()}>{touches ? `${touches.name}: ${plural(touches.readings.length, "touch", "touches")}` : "Choose the touches …"}</button>
              <button type="submit" class="primary" disabled={action.busy || !touches || body === ""}>{action.busy ? "Comparing …" : "Check the touches"}</button>
              <input ref={chooser} type="file" hidden aria-label="File of touches" accept=".json,.jsonl"
                onChange={(event) => void take(event.currentTarget.files?.[0])} />
            </div>
            {wrongFile && <p class="note note-warn">{wrongFile}</p>}
          </form>
        )}
        {action.problem && <ProblemNote problem={action.problem} />}
        {found && <Findings found={found} sensor={sensor} />}
        {found && found.calibration === null && isTeaching && (
          <div class="actions">
            <button type="button" class="primary" disabled={action.busy} onClick={() => run(true)}>Correct later readings by this</button>
          </div>
        )}
        {!found && isTeaching && <Commands lines={[`palpate sensors commission ${sensor.name} --reference ridge --readings touches.jsonl`]} roles={["trainer", "admin"]} />}
      </div>
    </Panel>
  );
}

async function passportOf(sensor: Sensor, signal: AbortSignal): Promise<SensorPassport | null> {
  if (typeof sensor.passport !== "number") return null;
  return getJson<SensorPassport>(`/v1/sensors/${sensor.id}/passport`, signal);
}

/** The readings of a file: a list, an object with `readings`, or one on each line. */
export function readingsIn(text: string): unknown[] | undefined {
  const whole = parsed(text) as { readings?: unknown } | unknown[] | undefined;
  if (Array.isArray(whole)) return whole;
  if (Array.isArray(whole?.readings)) return whole.readings;
  const lines = text.split("\n").filter((line) => line.trim() !== "").map(parsed);
  return lines.length > 0 && lines.every((line) => typeof line === "object" && line !== null) ? lines : undefined;
}

function parsed(text: string): unknown {
  try {
    return JSON.parse(text);
  } catch {
    return undefined;
  }
}

function Passport({ passport }: { passport: SensorPassport }) {
  return (
    <>
      <p>
        From {plural(passport.n_touches, "touch", "touches")} of {passport.touched}; images deviate by {percent(passport.residual_after)} of their largest
        pressure, {percent(passport.residual_before)} as sent.
      </p>
      {passport.corrections.length === 0 ? <p class="faint">Nothing is corrected.</p> : (
        <ul class="objections">{passport.corrections.map((one) => <li key={one}>{one}</li>)}</ul>
      )}
    </>
  );
}

function Findings({ found, sensor }: { found: Commissioning; sensor: Sensor }) {
  const { rows, cols } = sensor.description.grid;
  return (
    <>
      <p class={`note note-${found.verdict === "right" ? "good" : found.verdict === "wrong" ? "bad" : "warn"}`} role="status">{found.summary}</p>
      <Table label="Findings" columns={["What", "Found", "Stated", "Verdict", "Correction"]}>
        {found.findings.map((one) => (
          <tr key={one.name}>
            <th scope="row">{one.name.replaceAll("_", " ")}</th>
            <td>{one.found}{typeof one.probability === "number" && <span class="faint"> ({percent(one.probability)})</span>}</td>
            <td>{one.stated ?? "–"}</td>
            <td><Badge kind={KINDS[one.verdict]}>{one.verdict}</Badge></td>
            <td>{one.correction ?? ""}</td>
          </tr>
        ))}
      </Table>
      <Facts of={[["Deviation as sent", percent(found.residual_before)], ["Deviation as found", percent(found.residual_after)], ["Touches used", String(found.n_touches)]]} />
      <div class="pairs">
        {found.touches.slice(0, SHOWN).map((touch) => {
          const most = Math.max(1, ...touch.observed, ...touch.predicted);
          return (
            <figure key={touch.reading}>
              <div class="pair">
                <TactileImage image={{ rows, cols, values: touch.observed }} most={most} label={`Touch ${touch.reading + 1} as it came`} />
                <TactileImage image={{ rows, cols, values: touch.predicted }} most={most} label={`Touch ${touch.reading + 1} as the findings predict it`} />
              </div>
              <figcaption class="faint">touch {touch.reading + 1}: came, predicted</figcaption>
            </figure>
          );
        })}
      </div>
    </>
  );
}
