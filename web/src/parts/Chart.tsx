// A line chart, drawn by uPlot, with the same numbers as a table.
import { useEffect, useRef } from "preact/hooks";
import uPlot from "uplot";
import "uplot/dist/uPlot.min.css";
import { dark } from "../format";

export interface Series {
  label: string;
  color: string;
  values: (number | null)[];
  width?: number;
  dashed?: boolean;
}

/** Height of a low chart. */
export const LOW = 140;
/** A drawn range is at least this wide, in pixels. */
const DRAWN_MIN = 6;

interface Props {
  label: string;
  /** Labels of both axes with their units; that of x heads the table's first column. */
  xLabel: string;
  yLabel: string;
  x: number[];
  series: Series[];
  range?: [number, number];
  format: (value: number) => string;
  /** Format of ticks, if shorter than that of values. */
  tick?: (value: number) => string;
  height?: number;
  /** Marked position on the x axis. */
  at?: number;
  legend?: boolean;
  /** Whether x is a count, with integer ticks. */
  wholeX?: boolean;
  /** Whether the scale of values begins at 0. */
  fromZero?: boolean;
  onPick?: (x: number) => void;
  /** Range of x that is shown; undefined for all of it. Charts with the same range move together. */
  zoom?: Range | undefined;
  /** Told the range that was drawn with the mouse. */
  onZoom?: (zoom: Range) => void;
}

export type Range = [from: number, to: number];

export function Chart(props: Props) {
  const host = useRef<HTMLDivElement>(null);
  const plot = useRef<uPlot | undefined>(undefined);
  const newest = useRef(props);
  newest.current = props;
  const isDark = dark.value;
  const shape = JSON.stringify([isDark, props.height, props.series.map((s) => [s.label, s.color])]);
  useEffect(() => {
    const element = host.current;
    if (!element) return;
    const made = new uPlot(options(newest, element.clientWidth || 300), data(newest.current), element);
    plot.current = made;
    const resized = new ResizeObserver(() => {
      const { height } = newest.current;
      if (element.clientWidth > 0) made.setSize({ width: element.clientWidth, height: height ?? 180 });
    });
    resized.observe(element);
    return () => {
      resized.disconnect();
      made.destroy();
      plot.current = undefined;
    };
  }, [shape]);
  // biome-ignore lint/correctness/useExhaustiveDependencies: other properties change neither data nor range
  useEffect(() => {
    plot.current?.setData(data(props), false);
    if (plot.current) showRange(plot.current, props);
  }, [props.x, props.series, props.zoom, shape]);
  useEffect(() => {
    plot.current?.redraw(false);
  }, [props.at]);
  return (
    <figure class="chart">
      <p class="axis axis-y" aria-hidden="true">{props.yLabel}</p>
      <div ref={host} class={props.height === LOW ? "chart-plot chart-low" : "chart-plot"} role="img" aria-label={props.label} />
      <p class="axis axis-x" aria-hidden="true">{props.xLabel}</p>
      {props.legend !== false && <Legend series={props.series} />}
      <ChartTable {...props} />
    </figure>
  );
}

function Legend({ series }: { series: Series[] }) {
  return (
    <ul class="legend" aria-hidden="true">
      {series.map((one) => (
        <li key={one.label}>
          <svg width="14" height="8">
            <line x1="0" x2="14" y1="4" y2="4" stroke={one.color} stroke-width="3" stroke-dasharray={one.dashed ? "3 2" : undefined} />
          </svg>
          {one.label}
        </li>
      ))}
    </ul>
  );
}

function ChartTable(props: Props) {
  return (
    <details class="behind">
      <summary>Numbers</summary>
      <div class="scroll" tabIndex={0} role="region" aria-label={`${props.label}, numbers`}>
        <table>
          <thead>
            <tr>
              <th scope="col">{props.xLabel}</th>
              {props.series.map((one) => (
                <th key={one.label} scope="col" class="num">{one.label}</th>
              ))}
            </tr>
          </thead>
          <tbody>
            {props.x.map((x, row) => (
              <tr key={x}>
                <th scope="row">{Number(x.toPrecision(6))}</th>
                {props.series.map((one) => {
                  const value = one.values[row];
                  return <td key={one.label} class="num">{typeof value === "number" ? props.format(value) : "–"}</td>;
                })}
              </tr>
            ))}
          </tbody>
        </table>
      </div>
    </details>
  );
}

function showRange(plot: uPlot, { x, zoom }: Props): void {
  const [min, max] = zoom ?? [x[0] ?? 0, x.at(-1) ?? 1];
  plot.setScale("x", { min, max: Math.max(max, min + 1e-9) });
}

/** Distances between integer ticks. */
const WHOLE = [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000];

function data(props: Props): uPlot.AlignedData {
  return [props.x, ...props.series.map((one) => one.values)] as uPlot.AlignedData;
}

function options(newest: { current: Props }, width: number): uPlot.Options {
  const props = newest.current;
  const css = getComputedStyle(document.documentElement);
  const color = (name: string) => css.getPropertyValue(name).trim();
  const font = "11px system-ui, sans-serif";
  const axis = { stroke: color("--faint"), font, grid: { stroke: color("--line"), width: 1 }, ticks: { show: false } };
  return {
    width,
    height: props.height ?? 180,
    legend: { show: false },
    cursor: { drag: { x: props.onZoom !== undefined, y: false, setScale: false }, points: { size: 6 } },
    scales: { x: { time: false }, y: props.range ? { range: props.range } : props.fromZero ? { range: (_, __, most) => [0, Math.max(most, 1e-3) * 1.05] } : {} },
    axes: [
      { ...axis, size: 26, space: 40, ...(props.wholeX ? { incrs: WHOLE } : {}) },
      { ...axis, size: 50, space: props.height === LOW ? 20 : 28, values: (_, ticks) => ticks.map((tick) => (props.tick ?? props.format)(tick)) },
    ],
    series: [
      {},
      ...props.series.map((one) => ({
        label: one.label,
        stroke: one.color,
        width: one.width ?? 2,
        ...(one.dashed ? { dash: [4, 3] } : {}),
        points: { show: props.x.length < 2 },
      })),
    ],
    hooks: {
      setSelect: [(drawn) => zoomTo(drawn, newest.current)],
      draw: [(drawn) => mark(drawn, newest.current.at, color("--ink"))],
      ready: [
        (made) =>
          made.over.addEventListener("click", () => {
            const index = made.cursor.idx;
            const x = typeof index === "number" ? newest.current.x[index] : undefined;
            if (x !== undefined) newest.current.onPick?.(x);
          }),
      ],
    },
  };
}

/** Reports the range that was drawn, and removes its drawing. */
function zoomTo(plot: uPlot, { onZoom }: Props): void {
  const { left, width } = plot.select;
  if (width < DRAWN_MIN) return;
  plot.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
  onZoom?.([plot.posToVal(left, "x"), plot.posToVal(left + width, "x")]);
}

/** Line at the position of the replay. */
function mark(plot: uPlot, at: number | undefined, color: string): void {
  if (at === undefined) return;
  const x = plot.valToPos(at, "x", true);
  plot.ctx.save();
  plot.ctx.strokeStyle = color;
  plot.ctx.globalAlpha = 0.55;
  plot.ctx.setLineDash([]);
  plot.ctx.lineWidth = 1.5;
  plot.ctx.beginPath();
  plot.ctx.moveTo(x, plot.bbox.top);
  plot.ctx.lineTo(x, plot.bbox.top + plot.bbox.height);
  plot.ctx.stroke();
  plot.ctx.restore();
}
