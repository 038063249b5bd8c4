// Whether a sensor should be commissioned again, and why.
import { getJson } from "../api/http";
import { useResource } from "../api/resource";
import type { Sensor, SensorHealth } from "../api/types";
import { kPa, mm, plural } from "../format";
import { Show } from "../parts/Notes";
import { Badge, Facts, Panel } from "../parts/Panel";
import { TactileImage } from "../parts/TactileImage";
import { listedTaxels, upright } from "../scene/vectors";

/** Looks again this often: sessions are counted when they end. */
const EVERY_MS = 30_000;

const KINDS = { unknown: "open", good: "good", watch: "warn", commission: "bad" } as const;

export function HealthPanel({ sensor }: { sensor: Sensor }) {
  const health = useResource(`health ${sensor.id}`, (signal) => getJson<SensorHealth>(`/v1/sensors/${sensor.id}/health`, signal), EVERY_MS);
  const state = health.data?.state;
  return (
    <Panel title="Health" aside={state && <Badge kind={KINDS[state]}>{state === "commission" ? "commission again" : state}</Badge>}>
      <Show of={health} what="the health" lines={4}>
        {(found) => (
          <div class="stack">
            <p>{found.summary}</p>
            {found.reasons.length > 0 && (
              <ul class="objections">
                {found.reasons.map((reason, place) => <li key={place}>{reason.detail}</li>)}
              </ul>
            )}
            {found.n_sessions > 0 && <Facts of={facts(found)} />}
            {found.rest && <Rest rest={found.rest} sensor={sensor} />}
          </div>
        )}
      </Show>
    </Panel>
  );
}

function facts(found: SensorHealth): [string, string][] {
  const tool = found.tool_center;
  return [
    ["Based on", `${plural(found.n_sessions, "session")}, ${plural(found.n_presses, "press", "presses")}, ${found.n_quiet} met nothing`],
    ["Days", found.n_days === 1 ? (found.first_day ?? "") : `${found.first_day} to ${found.last_day}`],
    ...(tool
      ? ([["Tool centre off by", `${tool.shift_m.map((part) => mm(part).replace(" mm", "")).join(", ")} mm ± ${mm(Math.max(...tool.deviation_m))}`]] as [string, string][])
      : []),
  ];
}

/** The taxels while nothing is touched. */
function Rest({ rest, sensor }: { rest: NonNullable<SensorHealth["rest"]>; sensor: Sensor }) {
  // Values of health are in the order of the sensor frame already.
  const { rows, cols } = sensor.description.grid;
  const image = listedTaxels(sensor) ? upright(sensor, rest.pressures) : { rows, cols, values: rest.pressures };
  const most = Math.max(rest.contact_floor, ...rest.pressures.map((pressure) => pressure ?? 0));
  return (
    <figure class="resting">
      <TactileImage image={image} most={most} label={`Taxels without contact, up to ${kPa(most)}`} />
      <figcaption class="faint">Without contact ({plural(rest.n_presses, "press", "presses")}), full scale {kPa(most)}</figcaption>
    </figure>
  );
}
