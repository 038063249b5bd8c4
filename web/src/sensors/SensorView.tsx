// One sensor: geometry, force curve, calibration, health and commissioning.
import { useMemo } from "preact/hooks";
import { getJson } from "../api/http";
import { useResource } from "../api/resource";
import type { Sensor, SensorCalibration } from "../api/types";
import { dark, kPa, mm, percent, seriesColor, when } from "../format";
import { Chart, type Series } from "../parts/Chart";
import { Show } from "../parts/Notes";
import { Badge, Facts, Panel, ViewHead } from "../parts/Panel";
import { CommissionPanel } from "./CommissionPanel";
import { HealthPanel } from "./HealthPanel";
import { listedTaxels } from "../scene/vectors";
import { newestCalibration, taxels } from "./SensorsView";

export function SensorView({ id }: { id: string }) {
  const sensor = useResource(`sensor ${id}`, (signal) => getJson<Sensor>(`/v1/sensors/${encodeURIComponent(id)}`, signal));
  const known = sensor.data;
  const calibration = useResource(known ? `calibration ${known.id}` : null, (signal) => newestCalibration(known!, signal));
  return (
    <>
      <ViewHead title={sensor.data?.name ?? id} sub={sensor.data ? `${taxels(sensor.data)} taxels${sensor.data.preset ? `, preset ${sensor.data.preset}` : ""}` : "Sensor"} />
      <Show of={sensor} what="the sensor" lines={6}>
        {(found) => (
          <div class="grid grid-2">
            <div class="stack">
              <Described sensor={found} />
              <Panel title="Calibration" aside={calibration.data && `number ${calibration.data.number}, ${when(calibration.data.created_at)}`}>
                <Show of={calibration} what="the calibration" lines={5}>
                  {(one) => one === null ? <Uncalibrated sensor={found} /> : <Calibrated calibration={one} />}
                </Show>
              </Panel>
            </div>
            <div class="stack">
              <HealthPanel sensor={found} />
              {listedTaxels(found) ? (
                <Panel title="Commissioning">
                  <p class="faint">Only sensors with rows and columns are commissioned and calibrated. Correct the values of this one in its driver.</p>
                </Panel>
              ) : (
                <CommissionPanel sensor={found} onApplied={sensor.reload} />
              )}
            </div>
          </div>
        )}
      </Show>
    </>
  );
}

function Uncalibrated({ sensor }: { sensor: Sensor }) {
  if (listedTaxels(sensor)) return <p class="faint">Not calibrated: readings count as the description says.</p>;
  return (
    <p class="faint">
      Not calibrated: readings count as the description says. Press every taxel with a small indenter and post it
      with <code>palpate sensors calibrate {sensor.name} --file indentation.json</code>.
    </p>
  );
}

/** How a list of taxels becomes an image. */
function drawing({ layout, description: { grid } }: Sensor): string {
  if (!layout) return "as sent";
  const lost = `loses ${percent(layout.drawing_loss)} of a small contact`;
  if (layout.drawing === "as_is") return `as sent, ${lost}`;
  const plane = layout.drawing === "at_contact" ? "the plane of the contact" : "the plane of the taxels";
  return `${grid.rows} × ${grid.cols} on ${plane}, ${lost}`;
}

function Described({ sensor }: { sensor: Sensor }) {
  const { description } = sensor;
  const isDark = dark.value;
  const x = useMemo(() => description.force_curve.map((knot) => knot.displacement * 1000), [description.force_curve]);
  const series = useMemo(
    (): Series[] => [{ label: "pressure (kPa)", color: seriesColor(0), values: description.force_curve.map((knot) => knot.pressure / 1000) }],
    [description.force_curve, isDark],
  );
  return (
    <Panel title="Description">
      <Facts
        of={[
          ["Taxels", taxels(sensor)],
          ...(sensor.layout ? ([["Image", drawing(sensor)]] as [string, string][]) : []),
          ["Distance of taxels", mm(description.grid.pitch)],
          ["Taxel width", mm(description.grid.taxel_width)],
          ["Covering, thickness", mm(description.covering_thickness)],
          ["A point spreads (1 σ) to", mm(description.point_spread)],
          ["Saturates at", kPa(description.saturation)],
          ["Noise (1 σ)", kPa(description.noise)],
          ["Image order", order(description.image_order)],
          ["Covering beyond the array", margin(description)],
          ["Edge of the covering", (description.coupling?.edge ?? "continues").replace("_", " ")],
          ["Cross-talk", `${(100 * (description.coupling?.cross_talk ?? 0)).toFixed(1)} %`],
        ]}
      />
      <p class="known"><span class="faint">How well it is known: </span>{knowledge(sensor)}.</p>
      <h3 class="chart-title">Force curve: pressure over displacement</h3>
      <Chart label="Force curve: pressure in kilopascal over displacement in millimetres" xLabel="Displacement (mm)" yLabel="Pressure (kPa)" x={x} series={series}
        format={(value) => String(Number(value.toPrecision(3)))} legend={false} />
    </Panel>
  );
}

function margin(description: Sensor["description"]): string {
  const known = description.coupling?.margin;
  if (typeof known === "number") return mm(known);
  const open = description.ranges?.margin;
  return open ? `open, ${mm(open.low)} to ${mm(open.high)}` : "reaches far";
}

/** What the owner says about the description, and what trainings from meshes make of it. */
function knowledge(sensor: Sensor): string {
  switch (sensor.sensor_knowledge) {
    case "measured":
      return "measured, meshes are pressed exactly as described";
    case "unknown":
      return "hardly, meshes are pressed with quite different sensors of this grid";
    default:
      return "as a data sheet says, meshes are pressed with all sensors that it may stand for; commission the sensor to know yours";
  }
}

function order(order: Sensor["description"]["image_order"]): string {
  const said = [order?.transposed && "transposed", order?.rows_reversed && "rows reversed", order?.cols_reversed && "columns reversed"];
  return said.filter(Boolean).join(", ") || "unchanged";
}

function Calibrated({ calibration }: { calibration: SensorCalibration }) {
  const dead = calibration.taxels.filter((taxel) => taxel.state === "dead");
  const crossed = calibration.taxels.filter((taxel) => taxel.state === "cross_wired");
  return (
    <div class="stack">
      <p>
        {dead.length > 0 && <Badge kind="bad">{dead.length} dead</Badge>}{" "}
        {crossed.length > 0 && <Badge kind="warn">{crossed.length} cross-wired</Badge>}{" "}
        {dead.length + crossed.length === 0 && <Badge kind="good">all taxels usable</Badge>}
      </p>
      <Taxels calibration={calibration} />
      <h3>Response lines</h3>
      <Lines calibration={calibration} />
      <Facts
        of={[
          ["R² measured", calibration.before.r_squared.toFixed(3)],
          ["R² corrected", calibration.after.r_squared.toFixed(3)],
          ["Residual before", kPa(calibration.before.residual)],
          ["Residual after", kPa(calibration.after.residual)],
          ["Presses", String(calibration.n_presses)],
          ...(calibration.spread
            ? ([["Point spread fitted", `${mm(calibration.spread.sigma)} (described ${mm(calibration.spread.described)})`]] as [string, string][])
            : []),
        ]}
      />
    </div>
  );
}

/** Gain of every taxel relative to the target, +y up as in the sensor's frame. */
function Taxels({ calibration }: { calibration: SensorCalibration }) {
  const rows = Math.max(...calibration.taxels.map((taxel) => taxel.row)) + 1;
  const cols = Math.max(...calibration.taxels.map((taxel) => taxel.col)) + 1;
  const at = (row: number, col: number) => calibration.taxels.find((taxel) => taxel.row === row && taxel.col === col);
  return (
    <table class="taxels" aria-label="Gain of every taxel relative to the target, or its fault">
      <tbody>
        {Array.from({ length: rows }, (_, place) => rows - 1 - place).map((row) => (
          <tr key={row} class="taxels-row">
            {Array.from({ length: cols }, (_, col) => {
              const taxel = at(row, col);
              const state = taxel?.state ?? "ok";
              const gain = taxel ? taxel.slope / calibration.target.slope : 1;
              const answers = taxel?.answers ? `responds to row ${taxel.answers.row}, column ${taxel.answers.col}` : "";
              return (
                <td key={col} class={`taxel taxel-${state}`} title={`row ${row}, column ${col}: ${state.replace("_", " ")} ${answers}`}>
                  {state === "ok" ? gain.toFixed(2) : state === "dead" ? "dead" : "×"}
                  {state === "cross_wired" && <span class="visually-hidden">cross-wired, {answers}</span>}
                </td>
              );
            })}
          </tr>
        ))}
      </tbody>
    </table>
  );
}

const DEPTHS_MM = [0, 0.2, 0.4, 0.6];

/** Pressure over depth: a thin line per usable taxel, a thick one for the target. */
function Lines({ calibration }: { calibration: SensorCalibration }) {
  const isDark = dark.value;
  const x = DEPTHS_MM;
  const series = useMemo((): Series[] => {
    const line = (slope: number, offset: number) => x.map((depth) => (slope * depth) / 1e6 + offset / 1000);
    const usable = calibration.taxels.filter((taxel) => taxel.state === "ok");
    const faint = dark.value ? "#4d5b66" : "#b9c4cc";
    const thin = usable.slice(0, 64).map((taxel): Series => ({
      label: `row ${taxel.row}, column ${taxel.col}`,
      color: faint,
      width: 1,
      values: line(taxel.slope, taxel.offset),
    }));
    return [...thin, { label: "target", color: seriesColor(1), width: 3, values: line(calibration.target.slope, calibration.target.offset) }];
  }, [calibration, isDark]);
  return (
    <Chart label="Pressure in kilopascal over depth in millimetres, for every taxel and the target" xLabel="Depth (mm)" yLabel="Pressure (kPa)" x={x} series={series}
      format={(value) => value.toFixed(0)} legend={false} />
  );
}
