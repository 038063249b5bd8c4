// All sessions, open and ended, newest first: searched, compared, saved as a table.
import { useEffect, useState } from "preact/hooks";
import { getAll, getJson } from "../api/http";
import { useResource } from "../api/resource";
import type { Page, Session } from "../api/types";
import { plural, shortId, when } from "../format";
import { TouchCommands } from "../parts/Commands";
import { csv, save } from "../parts/save";
import { Empty, ProblemNote, Show } from "../parts/Notes";
import { Badge, Panel, ViewHead } from "../parts/Panel";
import { Table } from "../parts/Table";
import { useAction } from "../parts/useAction";
import { go, link } from "../router";
import { FilterForm } from "./FilterForm";
import { filters, NO_FILTERS, sessionsPath } from "./query";
import { answerOf, answerWords, labelWords, truthName } from "./words";

const PAGE = 50;
/** Maximum number of rows of a saved table. */
const SAVED_MAX = 10_000;

export function SessionsView() {
  const path = sessionsPath(filters.value, PAGE);
  const first = useResource(path, (signal) => getJson<Page<Session>>(path, signal), 5000);
  const [further, setFurther] = useState<{ path: string; items: Session[]; next: string | undefined }>();
  const [chosen, setChosen] = useState<string[]>([]);
  const action = useAction();
  useEffect(() => setFurther(undefined), [path]);
  const more = further?.path === path ? further : undefined;
  const next = more ? more.next : (first.data?.next_cursor ?? undefined);
  const known = new Set(first.data?.items.map((one) => one.id));
  const sessions = [...(first.data?.items ?? []), ...(more?.items ?? []).filter((one) => !known.has(one.id))];
  const isFiltered = JSON.stringify(filters.value) !== JSON.stringify(NO_FILTERS);
  const showMore = () =>
    action.run(async () => {
      const page = await getJson<Page<Session>>(sessionsPath(filters.value, PAGE, next));
      setFurther({ path, items: [...(more?.items ?? []), ...page.items], next: page.next_cursor ?? undefined });
    });
  const saveTable = () =>
    action.run(async () => {
      const found = await getAll<Session>(sessionsPath(filters.value), SAVED_MAX);
      save("sessions.csv", "text/csv", csv([COLUMNS, ...found.map(row)]));
    });
  const toggle = (id: string) => setChosen(chosen.includes(id) ? chosen.filter((one) => one !== id) : [...chosen, id].slice(-2));
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
      <Show of={first} what="the sessions" lines={8}>
        {() =>
          sessions.length === 0 && next === undefined ? (
            isFiltered ? <Empty title="No session fits">
              <button type="button" onClick={() => (filters.value = NO_FILTERS)}>Show all sessions</button>
            </Empty> : <Empty title="No sessions yet"><TouchCommands /></Empty>
          ) : (
            <Panel title="Found" aside={plural(sessions.length, "session") + (next === undefined ? "" : " and more")}>
              <Table label="Sessions" columns={[["Choose to compare", "hidden"], "Session", "Answer", "Truth", "Robots", ["Readings", "num"], "Method", "Labels", "Began"]}>
                {sessions.map((session) => <Row key={session.id} session={session} chosen={chosen.includes(session.id)} toggle={toggle} />)}
              </Table>
              {next !== undefined && (
                <p class="more"><button type="button" class="small" disabled={action.busy} onClick={showMore}>Show more</button></p>
              )}
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
        <Badge kind={session.state}>{session.ended ?? session.state}</Badge>
      </th>
      <td>{answerWords(session)}</td>
      <td>{truth === undefined ? <span class="faint">–</span> : <><span>{truth}</span> <Badge kind={session.truth?.was_right ? "good" : "bad"}>{session.truth?.was_right ? "right" : "wrong"}</Badge></>}</td>
      <td>{robots.slice(0, 3).join(", ") || <span class="faint">–</span>}{robots.length > 3 && ` and ${robots.length - 3} more`}</td>
      <td class="num">{session.n_readings}</td>
      <td class="tight">{session.method.replaceAll("_", " ")} <span class="faint">{session.catalogue} {session.version}</span></td>
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
