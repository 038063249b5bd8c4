// What can be done to several sessions at once: acknowledge, mute, close.
import { ProblemError, sendJson } from "../api/http";
import type { FleetChanged, Problem } from "../api/types";
import { plural } from "../format";
import { ProblemNote } from "../parts/Notes";
import { useAction } from "../parts/useAction";
import { may } from "../signin";
import { relist } from "./watch";

const MUTE_S = 3600;
/** Maximum number of sessions in a request. */
const AT_ONCE = 100;

export function FleetActions(props: { chosen: string[]; needed: string[]; onSelect: (ids: string[]) => void }) {
  const { chosen, needed, onSelect } = props;
  const action = useAction();
  const mayAcknowledge = may("trainer", "admin");
  const mayClose = may("robot", "admin");
  if (!mayAcknowledge && !mayClose) return null;
  const send = (path: string, more: object = {}) =>
    action.run(async () => {
      for (let from = 0; from < chosen.length; from += AT_ONCE) {
        const sessions = chosen.slice(from, from + AT_ONCE);
        const changed = await sendJson<FleetChanged>("POST", `/v1/fleet/${path}`, { sessions, ...more });
        refuse(changed);
      }
      onSelect([]);
      await relist();
    });
  const idle = action.busy || chosen.length === 0;
  return (
    <>
      <div class="fleet-actions" role="group" aria-label="Actions on the selected sessions">
        <button type="button" class="small" disabled={needed.length === 0} onClick={() => onSelect(needed)}>
          Select all that need attention
        </button>
        {chosen.length > 0 && (
          <button type="button" class="small" onClick={() => onSelect([])}>
            Select none
          </button>
        )}
        <span class="faint">{plural(chosen.length, "session")} selected</span>
        {mayAcknowledge && (
          <>
            <button type="button" class="small" disabled={idle} onClick={() => send("acknowledgements")}>
              Seen
            </button>
            <button type="button" class="small" disabled={idle} onClick={() => send("acknowledgements", { mute_s: MUTE_S })}>
              Mute for an hour
            </button>
          </>
        )}
        {mayClose && (
          <button type="button" class="small danger" disabled={idle} onClick={() => confirm(`Close ${plural(chosen.length, "session")}? A closed session takes no more readings.`) && send("closings")}>
            Close
          </button>
        )}
      </div>
      {action.problem && <ProblemNote problem={action.problem} />}
    </>
  );
}

/** Throws the problem of the first session that was not changed. */
function refuse(changed: FleetChanged): void {
  const failed = changed.results.filter((one) => one.problem);
  if (failed.length === 0) return;
  const title = `${plural(failed.length, "session")} not changed`;
  const detail = failed[0]?.problem ?? "";
  throw new ProblemError({ title, detail, status: 0, type: "", instance: "", request_id: "" } as unknown as Problem);
}
