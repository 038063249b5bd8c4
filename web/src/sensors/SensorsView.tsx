// The sensors of the server and their calibrations.
import { getAll, getJson } from "../api/http";
import { useResource } from "../api/resource";
import type { Sensor, SensorCalibration } from "../api/types";
import { mm, plural } from "../format";
import { Commands } from "../parts/Commands";
import { Empty, Show } from "../parts/Notes";
import { Badge, Panel, ViewHead } from "../parts/Panel";
import { Table } from "../parts/Table";
import { link } from "../router";
import { listedTaxels } from "../scene/vectors";
import { may } from "../signin";

export function SensorsView() {
  const sensors = useResource("sensors", (signal) => getAll<Sensor>("/v1/sensors", 1000, signal));
  return (
    <>
      <ViewHead title="Sensors" sub={sensors.data ? plural(sensors.data.length, "sensor") : "Tactile sensor arrays"} />
      <Show of={sensors} what="the sensors" lines={6}>
        {(found) =>
          found.length === 0 ? (
            <Empty title="No sensors">
              {may("trainer", "admin") && <p>Describe one with <code>POST /v1/sensors</code>, or add a preset:</p>}
              <Commands lines={["palpate sensors add finger --preset digitacts-6x6"]} roles={["trainer", "admin"]} />
            </Empty>
          ) : (
            <Panel title="All sensors">
              <Table label="Sensors" columns={["Sensor", "Taxels", ["Distance of taxels", "num"], ["Covering", "num"], "Calibration"]}>
                {found.map((sensor) => (
                  <Row key={sensor.id} sensor={sensor} />
                ))}
              </Table>
            </Panel>
          )
        }
      </Show>
    </>
  );
}

/** The number of taxels: rows and columns, or how many are listed. */
export function taxels(sensor: Sensor): string {
  const { rows, cols } = sensor.description.grid;
  const listed = listedTaxels(sensor);
  return listed ? String(listed.length) : `${rows} × ${cols}`;
}

function Row({ sensor }: { sensor: Sensor }) {
  const { grid, covering_thickness: covering } = sensor.description;
  const calibration = useResource(`calibration ${sensor.id}`, (signal) => newestCalibration(sensor, signal));
  const found = calibration.data;
  return (
    <tr>
      <th scope="row"><a href={link("sensors", sensor.name)}>{sensor.name}</a></th>
      <td class="num-left">{taxels(sensor)}</td>
      <td class="num">{mm(grid.pitch)}</td>
      <td class="num">{mm(covering)}</td>
      <td>
        {found === undefined ? "…" : found === null ? <span class="faint">uncalibrated</span> : (
          <>
            number {found.number} {found.n_unusable > 0 && <Badge kind="warn">{plural(found.n_unusable, "taxel")} unusable</Badge>}
          </>
        )}
      </td>
    </tr>
  );
}

/** The newest calibration; null when the sensor has none. */
export async function newestCalibration(sensor: Sensor, signal: AbortSignal): Promise<SensorCalibration | null> {
  if (typeof sensor.calibration !== "number") return null;
  return getJson<SensorCalibration>(`/v1/sensors/${sensor.id}/calibration`, signal);
}
