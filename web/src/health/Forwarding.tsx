// What a cell has to forward to the central service, and the state of the line.
import type { Forwarding } from "../api/types";
import { count, when } from "../format";
import { Badge, Panel } from "../parts/Panel";

export function ForwardingPanel({ state }: { state: Forwarding }) {
  const isDown = state.down_since != null;
  const problems: [string, string][] = [
    ...state.refused.map(({ session, reason }): [string, string] => [`session ${session}`, reason]),
    ...state.catalogues.flatMap(({ name, problem }): [string, string][] => (problem == null ? [] : [[`catalogue ${name}`, problem]])),
    ...state.sensors.map(({ name, problem }): [string, string] => [`sensor ${name}`, problem]),
  ];
  return (
    <Panel title={`Cell ${state.cell ?? ""}`} class="panel-forwarding">
      <p>
        <Badge kind={isDown ? "bad" : "good"}>{isDown ? "line down" : "line up"}</Badge> {state.to}
        {isDown && ` since ${when(state.down_since)}: ${state.last_error ?? ""}`}
      </p>
      <p>
        {count(state.sessions_waiting)} sessions with {count(state.entries_waiting)} readings and retractions wait
        {state.oldest_waiting_since != null && `, the oldest since ${when(state.oldest_waiting_since)}`}
        {state.sessions_refused > 0 && `; the central service refused ${count(state.sessions_refused)}`}.
      </p>
      {problems.length > 0 && (
        <table>
          <thead><tr><th scope="col">What</th><th scope="col">Problem</th></tr></thead>
          <tbody>
            {problems.map(([what, problem]) => (
              <tr key={what}><th scope="row">{what}</th><td>{problem}</td></tr>
            ))}
          </tbody>
        </table>
      )}
    </Panel>
  );
}
