// The fleet: open sessions, those that need attention first.
import { useEffect, useRef, useState } from "preact/hooks";
import { announce } from "../announce";
import { silentSince } from "../api/pulse";
import { percent, plural } from "../format";
import { TouchCommands } from "../parts/Commands";
import { Empty, Loading, ProblemNote } from "../parts/Notes";
import { Live } from "../parts/Live";
import { ViewHead } from "../parts/Panel";
import { SearchField } from "../parts/SearchField";
import { choose, useChoice } from "../router";
import { FleetActions } from "./FleetActions";
import { FleetRow } from "./FleetRow";
import { canNotify, notifying, toggleNotifying, useNotifications } from "./notify";
import { chosen as wanted, fleet, watchFleet } from "./watch";
import type { Watched } from "./watch";

export function FleetView() {
  useEffect(() => watchFleet(), []);
  const [selected, setSelected] = useState<ReadonlySet<string>>(new Set());
  const [search, setSearch] = useChoice("search");
  const { sessions, nOpen, nNeeded, more, loaded, problem } = fleet.value;
  useAnnouncements(sessions);
  useNotifications(sessions);
  const chosen = sessions.map((one) => one.info.session.id).filter((id) => selected.has(id));
  const select = (id: string, isSelected: boolean) => {
    const next = new Set(chosen);
    if (isSelected) next.add(id);
    else next.delete(id);
    setSelected(next);
  };
  const needed = sessions.filter((one) => one.info.attention.is_needed).map((one) => one.info.session.id);
  return (
    <>
      <ViewHead
        title="Fleet"
        tab={nNeeded > 0 ? `(${nNeeded}) ` : ""}
        sub={loaded ? `${plural(nOpen, "open session")}${nNeeded > 0 ? `, ${nNeeded} ${nNeeded === 1 ? "needs" : "need"} attention` : ""}` : "Open sessions"}
      >
        {canNotify && (
          <button type="button" aria-pressed={notifying.value} onClick={() => void toggleNotifying()}>
            Notify me
          </button>
        )}
        <Live idle={sessions.length > 0 ? "connecting" : "listening"} />
      </ViewHead>
      {problem && <ProblemNote problem={problem} />}
      {!loaded && <Loading what="the fleet" lines={6} />}
      {loaded && (nOpen > 0 || search !== "") && (
        <div class="fleet-bar">
          <FleetActions chosen={chosen} needed={needed} onSelect={(ids) => setSelected(new Set(ids))} />
          <SearchField id="fleet-search" label="Search" value={search} placeholder="robot, object, label, catalogue or id" onSearch={setSearch} />
        </div>
      )}
      {loaded && !problem && sessions.length === 0 && (search === "" ? <NoSessions /> : (
        <Empty title="No open session fits"><button type="button" onClick={() => setSearch("")}>Show all</button></Empty>
      ))}
      {loaded && sessions.length > 0 && (
        <div class={problem && silentSince.value === undefined ? "old" : ""}>
          <div class="fleet-head" aria-hidden="true">
            <span />
            <span>Believed — robot</span>
            <span>Probabilities</span>
            <span>Uncertainty</span>
            <span>Last reading</span>
            <span>State</span>
          </div>
          <ul class="fleet" aria-label="Open sessions, those that need attention first">
            {sessions.map((watched) => (
              <FleetRow
                key={watched.info.session.id}
                watched={watched}
                selected={selected.has(watched.info.session.id)}
                onSelect={select}
              />
            ))}
          </ul>
          {more && (
            <p class="faint">
              {sessions.length} of {search === "" ? nOpen : "more"} open sessions are shown.{" "}
              <button type="button" class="small" onClick={showMore}>
                Show more
              </button>
            </p>
          )}
        </div>
      )}
    </>
  );
}

function showMore(): void {
  choose({ pages: String(wanted().pages + 1) });
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
      const { level, reason } = watched.info.attention;
      const id = watched.info.session.id;
      const last = watched.trace.at(-1);
      const key = `${level} ${last?.best ?? ""}`;
      const before = said.current.get(id);
      said.current.set(id, key);
      if (before === undefined || before === key || (level !== "sure" && level !== "surprising")) continue;
      const robot = watched.info.session.touched_by?.[0] ?? "A session";
      const words = level === "sure" ? `${last?.best} with ${percent(last?.probability ?? 0)}` : reason;
      announce(`${robot}: ${words}`);
    }
  }, [sessions]);
}
