// Bars of the likeliest objects and "none of these".
import { objectColor } from "../colors";
import { percent } from "../format";

export interface Share {
  name: string;
  probability: number;
  color?: string;
  isUnknown?: boolean;
}

/** The `n` likeliest answers of a belief, including "none of these". */
export function shares(
  objects: { name: string; probability: number }[],
  unknown: number,
  n: number,
): Share[] {
  const all: Share[] = objects.map(({ name, probability }) => ({ name, probability, color: objectColor(name) }));
  if (unknown > 0) all.push({ name: "none of these", probability: unknown, isUnknown: true });
  all.sort((a, b) => b.probability - a.probability);
  return all.slice(0, n);
}

export function ProbabilityBars({ of: list, label }: { of: Share[]; label: string }) {
  return (
    <ul class="bars" aria-label={label}>
      {list.map((share, place) => (
        <li key={share.name} class={place === 0 ? "bar bar-best" : "bar"}>
          <span class={share.isUnknown ? "bar-name faint" : "bar-name"} title={share.name}>
            {share.name}
          </span>
          <svg class="bar-track" viewBox="0 0 100 6" preserveAspectRatio="none" aria-hidden="true">
            <rect
              class={share.isUnknown ? "bar-fill bar-unknown" : "bar-fill"}
              width={Math.max(0.5, share.probability * 100)}
              height="6"
              {...(share.color ? { style: { fill: share.color } } : {})}
            />
          </svg>
          <span class="bar-value">{percent(share.probability)}</span>
        </li>
      ))}
    </ul>
  );
}
