// Frame of every view: skip link, navigation, main landmark, and the sign-in gate.
import type { ComponentChildren } from "preact";
import { useEffect, useRef } from "preact/hooks";
import { announcement } from "./announce";
import { AuditView } from "./audit/AuditView";
import { keyWanted } from "./api/http";
import { silentSince } from "./api/pulse";
import { narrow } from "./format";
import { FleetView } from "./fleet/FleetView";
import { HealthView } from "./health/HealthView";
import { JobsView } from "./jobs/JobsView";
import { JobView } from "./jobs/JobView";
import { KeysView } from "./keys/KeysView";
import { ModelsView } from "./models/ModelsView";
import { VersionView } from "./models/VersionView";
import { ObjectsView } from "./objects/ObjectsView";
import { ObjectView } from "./objects/ObjectView";
import { Silence } from "./parts/Live";
import { Empty, Loading } from "./parts/Notes";
import { ViewHead } from "./parts/Panel";
import { link, route } from "./router";
import { matched, type Route } from "./routes";
import { restoreScroll } from "./scroll";
import { SensorsView } from "./sensors/SensorsView";
import { SensorView } from "./sensors/SensorView";
import { SessionView } from "./session/SessionView";
import { CompareView } from "./sessions/CompareView";
import { SessionsView } from "./sessions/SessionsView";
import { maySee, NotPermitted, SignIn, Who, who, whoAsked } from "./signin";
import { SnapshotsView } from "./snapshots/SnapshotsView";
import { WebhooksView } from "./webhooks/WebhooksView";
import { WebhookView } from "./webhooks/WebhookView";

const VIEWS: [path: string, name: string][] = [
  ["fleet", "Fleet"],
  ["sessions", "Sessions"],
  ["objects", "Objects"],
  ["models", "Models"],
  ["jobs", "Jobs"],
  ["sensors", "Sensors"],
  ["keys", "Keys"],
  ["audit", "Audit"],
  ["snapshots", "Snapshots"],
  ["webhooks", "Webhooks"],
  ["health", "Health"],
];

export function App() {
  const [view = "fleet"] = route.value;
  const nav = useRef<HTMLElement>(null);
  const isKnown = whoAsked.value;
  const isNarrow = narrow.value;
  useEffect(() => {
    // On a phone the row of pages scrolls: the current one is in its middle.
    const [row, current] = [nav.current?.querySelector("ul"), nav.current?.querySelector<HTMLElement>("[aria-current]")];
    if (row && current) row.scrollLeft = current.offsetLeft - row.offsetLeft + current.offsetWidth / 2 - row.clientWidth / 2;
  }, [view, isKnown, isNarrow]);
  return (
    <>
      {/* biome-ignore lint/a11y/useValidAnchor: a skip link; the fragment of the address is the route, so it moves the focus itself */}
      <a class="skip" href="#main" onClick={toMain}>
        Skip to the content
      </a>
      <header class="top">
        <a class="brand" href={link("fleet")} aria-label="Palpate, fleet">
          <img src="/assets/icon.svg" width="26" height="26" alt="" />
          <span>Palpate</span>
        </a>
        <nav ref={nav} aria-label="Views" class={!isKnown ? "nav-unknown" : ""}>
          <ul>
            {VIEWS.filter(([path]) => who.value === undefined || maySee(path)).map(([path, name]) => (
              <li key={path}>
                <a href={link(path)} {...(isAt(view, path) ? { "aria-current": "page" } : {})}>
                  {name}
                </a>
              </li>
            ))}
          </ul>
        </nav>
        <div class="top-end">
          <a href="/docs/" class="faint">API</a>
          <Who />
        </div>
      </header>
      <Main />
      <p class="visually-hidden" aria-live="polite" aria-atomic="true">
        {announcement.value}
      </p>
    </>
  );
}

function Main() {
  const main = useRef<HTMLElement>(null);
  const found = matched(route.value);
  // Another revision of a session is the same view.
  const key = [...(found?.params ?? []).slice(0, found?.name === MOMENT ? 1 : undefined), found?.name.replace(/\/at.*/, "") ?? route.value].join("/");
  const before = useRef(key);
  useEffect(() => {
    restoreScroll();
    if (before.current === key) return;
    before.current = key;
    // Moves the focus of screen readers to the new view.
    main.current?.querySelector<HTMLElement>("h1")?.focus({ preventScroll: true });
  }, [key]);
  const isOld = silentSince.value !== undefined;
  return (
    <main ref={main} id="main" tabIndex={-1}>
      <Silence />
      <div class={isOld ? "old" : ""}>
        {keyWanted.value ? <SignIn /> : whoAsked.value ? <View key={key} /> : <Loading what="the page" lines={6} />}
      </div>
    </main>
  );
}

const MOMENT: Route = "sessions/:id/at/:revision";

/** The view of each page. */
const SHOWN: Record<Route, (first: string, second: string) => ComponentChildren> = {
  fleet: () => <FleetView />,
  sessions: () => <SessionsView />,
  "sessions/:id": (id) => <SessionView id={id} />,
  [MOMENT]: (id, at) => <SessionView id={id} at={at} />,
  "compare/:id/:id": (one, other) => <CompareView ids={[one, other]} />,
  objects: () => <ObjectsView />,
  "objects/:name": (name) => <ObjectView id={name} />,
  models: () => <ModelsView />,
  "models/:catalogue/:version": (catalogue, version) => <VersionView catalogue={catalogue} version={version} />,
  jobs: () => <JobsView />,
  "jobs/:id": (id) => <JobView id={id} />,
  sensors: () => <SensorsView />,
  "sensors/:name": (name) => <SensorView id={name} />,
  keys: () => <KeysView />,
  audit: () => <AuditView />,
  snapshots: () => <SnapshotsView />,
  webhooks: () => <WebhooksView />,
  "webhooks/:id": (id) => <WebhookView id={id} />,
  health: () => <HealthView />,
};

function View() {
  const found = matched(route.value);
  const view = found?.name.split("/")[0] ?? "";
  const name = VIEWS.find(([path]) => path === view)?.[1];
  if (who.value !== undefined && name !== undefined && !maySee(view)) return <NotPermitted view={view} name={name} />;
  if (found !== undefined) return SHOWN[found.name](found.params[0] ?? "", found.params[1] ?? "");
  return (
    <>
      <ViewHead title="Page not found" />
      <Empty title="The address names no page"><a href={link("fleet")}>Go to the fleet</a></Empty>
    </>
  );
}

function isAt(view: string, path: string): boolean {
  return view === path || (view === "compare" && path === "sessions");
}

function toMain(event: Event): void {
  event.preventDefault();
  document.getElementById("main")?.focus();
}
