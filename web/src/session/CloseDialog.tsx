// Closing a session, with what the object really was.
import { useState } from "preact/hooks";
import { Dialog } from "../parts/Dialog";
import { ProblemNote } from "../parts/Notes";
import { useAction } from "../parts/useAction";
import type { SessionModel } from "./model";

const NONE = "\u0000none";

export function CloseDialog({ model, onClose }: { model: SessionModel; onClose: () => void }) {
  const [truth, setTruth] = useState("");
  const action = useAction();
  const isOpen = model.session.value?.state === "open";
  const names = (model.version.value?.report.objects ?? []).map((object) => object.name).sort();
  const submit = (event: Event) => {
    event.preventDefault();
    action.run(async () => {
      await model.close(truth === "" ? {} : truth === NONE ? { none_of_these: true } : { object: truth });
      onClose();
    });
  };
  return (
    <Dialog title={isOpen ? "Close the session" : "What was it?"} onClose={onClose}>
      <form onSubmit={submit}>
        <p>{isOpen ? "The session takes no more readings; its belief can still be read. " : ""}What the object really was counts in the metrics, and recalibrations learn from it.</p>
        <div class="field">
          <label for="truth">It was</label>
          <select id="truth" value={truth} onChange={(event) => setTruth(event.currentTarget.value)}>
            <option value="">not known</option>
            <option value={NONE}>none of these</option>
            {names.map((name) => <option key={name} value={name}>{name}</option>)}
          </select>
        </div>
        {action.problem && <ProblemNote problem={action.problem} />}
        <div class="form-end">
          <button type="button" onClick={onClose}>Cancel</button>
          <button type="submit" class="primary" disabled={action.busy || (!isOpen && truth === "")}>{isOpen ? "Close session" : "Record"}</button>
        </div>
      </form>
    </Dialog>
  );
}
