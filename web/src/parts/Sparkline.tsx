// A small line without axes, for the entropy of a session.

interface Point {
  n: number;
  value: number;
}

const WIDTH = 120;
const HEIGHT = 28;

export function Sparkline({ points, label }: { points: Point[]; label: string }) {
  const most = Math.max(1, ...points.map((point) => point.value));
  const first = points[0]?.n ?? 0;
  const span = Math.max(1, (points.at(-1)?.n ?? 1) - first);
  const x = (point: Point) => 2 + ((point.n - first) / span) * (WIDTH - 8);
  const y = (point: Point) => HEIGHT - 3 - (point.value / most) * (HEIGHT - 7);
  const path = points.map((point, i) => `${i === 0 ? "M" : "L"}${x(point).toFixed(1)} ${y(point).toFixed(1)}`);
  const last = points.at(-1);
  return (
    <svg class="spark" viewBox={`0 0 ${WIDTH} ${HEIGHT}`} role="img" aria-label={label}>
      <line class="spark-base" x1="2" x2={WIDTH - 2} y1={HEIGHT - 3} y2={HEIGHT - 3} />
      <path class="spark-line" d={path.join(" ")} />
      {last && <circle class="spark-end" cx={x(last)} cy={y(last)} r="2.4" />}
    </svg>
  );
}
