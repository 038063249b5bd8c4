// Labels of a session, which the sessions page and the API search for.
import { useState } from "preact/hooks";
import { Badge, Panel } from "../parts/Panel";
import { ProblemNote } from "../parts/Notes";
import { useAction } from "../parts/useAction";
import { labelsOf, labelWords } from "../sessions/words";
import { may } from "../signin";
import type { SessionModel } from "./model";

export function LabelsPanel({ model }: { model: SessionModel }) {
  const labels = model.session.value?.labels;
  const [text, setText] = useState<string>();
  const action = useAction();
  const mayEdit = may("robot", "admin");
  if (!mayEdit && Object.keys(labels ?? {}).length === 0) return null;
  const wanted = text === undefined ? undefined : labelsOf(text);
  const submit = (event: Event) => {
    event.preventDefault();
    if (wanted === undefined) return;
    action.run(async () => {
      await model.label(wanted);
      setText(undefined);
    });
  };
  return (
    <Panel title="Labels" aside={mayEdit && text === undefined && <button type="button" class="small" onClick={() => setText(labelWords(labels))}>Edit</button>}>
      {text === undefined ? (
        <p class="labels">
          {Object.entries(labels ?? {}).map(([key, value]) => <Badge key={key} kind="label">{value === "" ? key : `${key}=${value}`}</Badge>)}
          {Object.keys(labels ?? {}).length === 0 && <span class="faint">None.</span>}
        </p>
      ) : (
        <form onSubmit={submit}>
          <div class="field">
            <label for="labels">Keys and values, separated by commas</label>
            <input id="labels" type="text" value={text} placeholder="site=oslo, shift=night" onInput={(event) => setText(event.currentTarget.value)} />
          </div>
          <div class="form-end">
            <button type="button" onClick={() => setText(undefined)}>Cancel</button>
            <button type="submit" class="primary" disabled={action.busy || wanted === undefined}>Set labels</button>
          </div>
        </form>
      )}
      {action.problem && <ProblemNote problem={action.problem} />}
    </Panel>
  );
}
