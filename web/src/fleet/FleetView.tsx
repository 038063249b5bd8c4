// The fleet: open sessions, those that need attention first.
import { useEffect, useRef } from "preact/hooks";
import { announce } from "../announce";
import { NO_LINE } from "../api/pulse";
import { now, percent, plural } from "../format";
import { TouchCommands } from "../parts/Commands";
import { Empty, Loading, ProblemNote } from "../parts/Notes";
import { Live } from "../parts/Live";
import { ViewHead } from "../parts/Panel";
import { attention, byAttention } from "./attention";
import { FleetRow } from "./FleetRow";
import { fleet, watchFleet } from "./watch";
import type { Watched } from "./watch";

export function FleetView() {
  useEffect(() => watchFleet(), []);
  const { sessions, nOpen, loaded, line, problem } = fleet.value;
  const sorted = [...sessions].sort(byAttention(now.value));
  const nUrgent = sorted.filter((one) => ["surprising", "stuck"].includes(attention(one, now.value).level)).length;
  useAnnouncements(sorted);
  return (
    <>
      <ViewHead
        title="Fleet"
        sub={
          loaded && !problem
            ? `${plural(nOpen, "open session")}${nUrgent > 0 ? `, ${nUrgent} need attention` : ""}`
            : "Open sessions, live"
        }
      >
        <Live line={sessions.length > 0 ? line : NO_LINE} idle={sessions.length > 0 ? "connecting" : "listening"} />
      </ViewHead>
      {problem && <ProblemNote problem={problem} />}
      {!loaded && <Loading what="the fleet" lines={6} />}
      {loaded && !problem && sessions.length === 0 && <NoSessions />}
      {loaded && sessions.length > 0 && (
        <>
          <div class="fleet-head" aria-hidden="true">
            <span>Robot · session</span>
            <span>It is</span>
            <span>Uncertainty</span>
            <span>Last reading</span>
            <span>State</span>
          </div>
          <ul class="fleet" aria-label="Open sessions, those that need attention first">
            {sorted.map((watched) => (
              <FleetRow key={watched.info.session.id} watched={watched} />
            ))}
          </ul>
          {nOpen > sessions.length && (
            <p class="faint">The {sessions.length} most recent of {nOpen} open sessions are shown.</p>
          )}
        </>
      )}
    </>
  );
}

function NoSessions() {
  return (
    <Empty title="No open sessions">
      <p>A robot opens one with <code>POST /v1/sessions</code>. A simulated one is started by:</p>
      <TouchCommands />
    </Empty>
  );
}

/** Announces when a session becomes sure or surprising. */
function useAnnouncements(sessions: Watched[]): void {
  const said = useRef(new Map<string, string>());
  useEffect(() => {
    for (const watched of sessions) {
      const { level, why } = attention(watched, now.value);
      const id = watched.info.session.id;
      const last = watched.trace.at(-1);
      const key = `${level} ${last?.best ?? ""}`;
      const before = said.current.get(id);
      said.current.set(id, key);
      if (before === undefined || before === key || (level !== "sure" && level !== "surprising")) continue;
      const robot = watched.info.robots[0] ?? "A session";
      const words = level === "sure" ? `${last?.best} with ${percent(last?.probability ?? 0)}` : why;
      announce(`${robot}: ${words}`);
    }
  }, [sessions]);
}
