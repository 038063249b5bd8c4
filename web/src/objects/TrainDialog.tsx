// The dialog that starts a training: objects and options.
import { useState } from "preact/hooks";
import { sendJson } from "../api/http";
import type { Job, ObjectInfo, StartTraining } from "../api/types";
import { Dialog } from "../parts/Dialog";
import { ProblemNote } from "../parts/Notes";
import { useAction } from "../parts/useAction";
import { ObjectChoice } from "./ObjectChoice";
import { startedJobs } from "./TrainingNow";

export function TrainDialog({ objects, onClose }: { objects: ObjectInfo[]; onClose: () => void }) {
  const [catalogue, setCatalogue] = useState("default");
  const [chosen, setChosen] = useState(new Set(objects.map((object) => object.id)));
  const [readings, setReadings] = useState(1000);
  const [ofSurface, setOfSurface] = useState(2400);
  const [seed, setSeed] = useState(1);
  const [knowledge, setKnowledge] = useState<"" | NonNullable<StartTraining["sensor_knowledge"]>>("");
  const [appearance, setAppearance] = useState(true);
  const [geometry, setGeometry] = useState<"none" | "planar" | "solid">("none");
  const [activate, setActivate] = useState(true);
  const action = useAction();
  const submit = (event: Event) => {
    event.preventDefault();
    action.run(async () => {
      const asked: Partial<StartTraining> = {
        ...(chosen.size < objects.length ? { objects: [...chosen] } : {}),
        readings_per_object: readings,
        surface_readings_per_object: ofSurface,
        seed,
        activate,
        ...(knowledge === "" ? {} : { sensor_knowledge: knowledge }),
        ...(appearance ? { appearance: {} } : {}),
        ...(geometry === "none" ? {} : { geometric: { kind: geometry } }),
      };
      const path = `/v1/catalogues/${encodeURIComponent(catalogue)}/trainings`;
      startedJobs.value = [...startedJobs.value, await sendJson<Job>("POST", path, asked)];
      onClose();
    });
  };
  return (
    <Dialog title="Train" onClose={onClose}>
      <form onSubmit={submit}>
        <div class="form-row">
          <div class="field">
            <label for="train-catalogue">Catalogue</label>
            <input id="train-catalogue" type="text" required value={catalogue} onInput={(event) => setCatalogue(event.currentTarget.value)} />
          </div>
          <div class="field">
            <label for="train-seed">Seed</label>
            <input id="train-seed" type="number" min={0} required value={seed} onInput={(event) => setSeed(event.currentTarget.valueAsNumber)} />
          </div>
        </div>
        <div class="form-row">
          <div class="field">
            <label for="train-readings">Simulated touches per mesh</label>
            <input id="train-readings" type="number" min={20} max={20000} required value={readings}
              onInput={(event) => {
                const asked = event.currentTarget.valueAsNumber;
                setReadings(asked);
                if (asked > ofSurface) setOfSurface(asked);
              }} />
            <span class="hint">Objects with a robot’s touches are trained from those.</span>
          </div>
          <div class="field">
            <label for="train-surface-readings">Touches for its surface</label>
            <input id="train-surface-readings" type="number" min={readings} max={20000} required value={ofSurface}
              onInput={(event) => setOfSurface(event.currentTarget.valueAsNumber)} />
            <span class="hint">More recognise better, and take longer to press.</span>
          </div>
        </div>
        <div class="field">
          <label for="train-knowledge">Trust in the sensor’s description</label>
          <select id="train-knowledge" value={knowledge} onChange={(event) => setKnowledge(event.currentTarget.value as typeof knowledge)}>
            <option value="">as the version before, else as the sensor states</option>
            <option value="data_sheet">data sheet</option>
            <option value="measured">measured or simulated exactly as described</option>
            <option value="unknown">unknown but for its grid</option>
          </select>
          <span class="hint">Decides how meshes are pressed. If in doubt, data sheet.</span>
        </div>
        <ObjectChoice objects={objects} chosen={chosen} onChange={setChosen} />
        <fieldset>
          <legend>Contact maps</legend>
          {(["none", "planar", "solid"] as const).map((kind) => (
            <label key={kind}>
              <input type="radio" name="geometry" checked={geometry === kind} onChange={() => setGeometry(kind)} />
              {kind}
            </label>
          ))}
        </fieldset>
        <label class="check">
          <input type="checkbox" checked={appearance} onChange={(event) => setAppearance(event.currentTarget.checked)} />
          Also learn appearance (confusion, affinity, near-duplicates)
        </label>
        <label class="check">
          <input type="checkbox" checked={activate} onChange={(event) => setActivate(event.currentTarget.checked)} />
          Make the version current
        </label>
        {action.problem && <ProblemNote problem={action.problem} />}
        <div class="form-end">
          <button type="submit" class="primary" disabled={action.busy || chosen.size === 0}>
            Start training
          </button>
        </div>
      </form>
    </Dialog>
  );
}
