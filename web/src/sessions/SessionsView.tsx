// All sessions, open and ended, newest first: searched, compared, saved as a table.
import { getAll } from "../api/http";
import { usePages } from "../api/pages";
import type { Session } from "../api/types";
import { plural, shortId, when } from "../format";
import { TouchCommands } from "../parts/Commands";
import { csv, save } from "../parts/save";
import { More } from "../parts/More";
import { Empty, ProblemNote, Show } from "../parts/Notes";
import { Badge, Panel, ViewHead } from "../parts/Panel";
import { Table } from "../parts/Table";
import { useAction } from "../parts/useAction";
import { go, link, useChoice } from "../router";
import { methodWords } from "../words";
import { FilterForm } from "./FilterForm";
import { filters, NO_FILTERS, sessionsPath, setFilters } from "./query";
import { answerOf, answerWords, labelWords, truthName } from "./words";

const PAGE = 50;
/** Maximum number of rows of a saved table. */
const SAVED_MAX = 10_000;

export function SessionsView() {
  const asked = filters();
  const list = usePages<Session>(sessionsPath(asked, PAGE), (one) => one.id, 5000);
  const [compared, setCompared] = useChoice("compared");
  const chosen = compared.split(",").filter((id) => id !== "");
  const action = useAction();
  const sessions = list.data?.items ?? [];
  const hasMore = list.data?.hasMore ?? false;
  const isFiltered = Object.values(asked).some((value) => value !== "");
  const saveTable = () =>
    action.run(async () => {
      const found = await getAll<Session>(sessionsPath(asked), SAVED_MAX);
      save("sessions.csv", "text/csv", csv([COLUMNS, ...found.map(row)]));
    });
  const toggle = (id: string) => setCompared((chosen.includes(id) ? chosen.filter((one) => one !== id) : [...chosen, id].slice(-2)).join(","));
  return (
    <>
      <ViewHead title="Sessions" sub="Open and ended ones, newest first">
        <button type="button" disabled={chosen.length !== 2} onClick={() => go("compare", ...chosen)}>
          Compare two
        </button>
        <button type="button" disabled={action.busy || sessions.length === 0} onClick={saveTable}>
          Save as CSV
        </button>
      </ViewHead>
      <FilterForm />
      {action.problem && <ProblemNote problem={action.problem} />}
      <Show of={list} what="the sessions" lines={8}>
        {() =>
          sessions.length === 0 && !hasMore ? (
            isFiltered ? <Empty title="No session fits">
              <button type="button" onClick={() => setFilters(NO_FILTERS)}>Show all sessions</button>
            </Empty> : <Empty title="No sessions yet"><TouchCommands /></Empty>
          ) : (
            <Panel title="Found" aside={plural(sessions.length, "session") + (hasMore ? " and more" : "")}>
              <Table label="Sessions" columns={[["Choose to compare", "hidden"], "Session", "Answer", "Truth", "Robots", ["Readings", "num"], "Method", "Labels", "Began"]}>
                {sessions.map((session) => <Row key={session.id} session={session} chosen={chosen.includes(session.id)} toggle={toggle} />)}
              </Table>
              <More of={list} />
            </Panel>
          )
        }
      </Show>
    </>
  );
}

function Row({ session, chosen, toggle }: { session: Session; chosen: boolean; toggle: (id: string) => void }) {
  const truth = truthName(session);
  const robots = session.touched_by ?? [];
  return (
    <tr class={chosen ? "chosen" : ""}>
      <td>
        <input type="checkbox" checked={chosen} aria-label={`Compare session ${shortId(session.id)}`} onChange={() => toggle(session.id)} />
      </td>
      <th scope="row" class="tight">
        <a href={link("sessions", session.id)}>{shortId(session.id)}</a>{" "}
        <Badge kind={session.state} isPast={session.state === "closed"}>{session.ended ?? session.state}</Badge>
      </th>
      <td>{answerWords(session)}</td>
      <td>{truth === undefined ? <span class="faint">–</span> : <><span>{truth}</span> <Badge kind={session.truth?.was_right ? "good" : "bad"} isPast>{session.truth?.was_right ? "right" : "wrong"}</Badge></>}</td>
      <td>{robots.slice(0, 3).join(", ") || <span class="faint">–</span>}{robots.length > 3 && ` and ${robots.length - 3} more`}</td>
      <td class="num">{session.n_readings}</td>
      <td class="tight">{methodWords(session.method)} <span class="faint">{session.catalogue} {session.version}</span></td>
      <td>{labelWords(session.labels)}</td>
      <td class="num-left">{when(session.created_at)}</td>
    </tr>
  );
}

const COLUMNS = ["id", "state", "catalogue", "version", "method", "robots", "n_readings", "answer", "probability", "unknown", "entropy_bits", "truth", "was_right", "labels", "created_at", "closed_at"];

function row(session: Session): (string | number | null | undefined)[] {
  const answer = answerOf(session);
  return [
    session.id, session.ended ?? session.state, session.catalogue, session.version, session.method,
    (session.touched_by ?? []).join(" "), session.n_readings, answer?.name, answer?.probability,
    session.latest?.unknown, session.latest?.entropy_bits, truthName(session),
    session.truth ? String(session.truth.was_right) : "", labelWords(session.labels), session.created_at, session.closed_at,
  ];
}
