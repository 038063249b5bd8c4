// Frame of every view: skip link, navigation, main landmark, and the sign-in gate.
import { useEffect, useRef } from "preact/hooks";
import { announcement } from "./announce";
import { AuditView } from "./audit/AuditView";
import { keyWanted } from "./api/http";
import { FleetView } from "./fleet/FleetView";
import { HealthView } from "./health/HealthView";
import { JobsView } from "./jobs/JobsView";
import { JobView } from "./jobs/JobView";
import { KeysView } from "./keys/KeysView";
import { ModelsView } from "./models/ModelsView";
import { VersionView } from "./models/VersionView";
import { ObjectsView } from "./objects/ObjectsView";
import { ObjectView } from "./objects/ObjectView";
import { Empty, Loading } from "./parts/Notes";
import { link, route } from "./router";
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
        <nav aria-label="Views" class={!whoAsked.value ? "nav-unknown" : ""}>
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
  const path = route.value.join("/");
  const before = useRef(path);
  useEffect(() => {
    const title = main.current?.querySelector("h1")?.textContent;
    document.title = title ? `${title} · Palpate` : "Palpate";
    if (before.current === path) return;
    before.current = path;
    scrollTo(0, 0);
    // Moves the focus of screen readers to the new view.
    main.current?.querySelector<HTMLElement>("h1")?.focus({ preventScroll: true });
  }, [path]);
  return (
    <main ref={main} id="main" tabIndex={-1}>
      {keyWanted.value ? <SignIn /> : whoAsked.value ? <View key={path} /> : <Loading what="the page" lines={6} />}
    </main>
  );
}

function View() {
  const [view = "fleet", id, part, what] = route.value;
  const name = VIEWS.find(([path]) => path === view)?.[1];
  if (who.value !== undefined && name !== undefined && !maySee(view)) return <NotPermitted view={view} name={name} />;
  switch (view) {
    case "fleet":
      return <FleetView />;
    case "sessions":
      return id === undefined ? <SessionsView /> : <SessionView id={id} at={revision(part, what)} />;
    case "compare":
      return id !== undefined && part !== undefined ? <CompareView ids={[id, part]} /> : <SessionsView />;
    case "objects":
      return id === undefined ? <ObjectsView /> : <ObjectView id={id} />;
    case "models":
      return id !== undefined && part !== undefined ? <VersionView catalogue={id} version={part} /> : <ModelsView />;
    case "jobs":
      return id === undefined ? <JobsView /> : <JobView id={id} />;
    case "sensors":
      return id === undefined ? <SensorsView /> : <SensorView id={id} />;
    case "keys":
      return <KeysView />;
    case "audit":
      return <AuditView />;
    case "snapshots":
      return <SnapshotsView />;
    case "webhooks":
      return id === undefined ? <WebhooksView /> : <WebhookView id={id} />;
    case "health":
      return <HealthView />;
    default:
      return (
        <Empty title="Page not found">
          <a href={link("fleet")}>Go to the fleet</a>
        </Empty>
      );
  }
}

function isAt(view: string, path: string): boolean {
  return view === path || (view === "compare" && path === "sessions");
}

/** The revision of a link to a moment, `#/sessions/ID/at/12`; null for the newest. */
function revision(part: string | undefined, at: string | undefined): number | null {
  return part === "at" && /^\d+$/.test(at ?? "") ? Number(at) : null;
}

function toMain(event: Event): void {
  event.preventDefault();
  document.getElementById("main")?.focus();
}
