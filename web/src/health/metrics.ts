// Sums and quantiles from the Prometheus text format.

export interface Sample {
  name: string;
  labels: Record<string, string>;
  value: number;
}

export function parseMetrics(text: string): Sample[] {
  return text.split("\n").flatMap((line): Sample[] => {
    const found = /^([a-zA-Z_:][\w:]*)(?:\{(.*)\})? (\S+)$/.exec(line);
    if (found === null) return [];
    const labels: Record<string, string> = {};
    for (const [, name, value] of (found[2] ?? "").matchAll(/(\w+)="((?:[^"\\]|\\.)*)"/g)) labels[name!] = value!;
    return [{ name: found[1]!, labels, value: Number(found[3]) }];
  });
}

/** Sum of the samples of a metric with these labels. */
export function total(samples: Sample[], name: string, labels: (labels: Record<string, string>) => boolean = () => true): number {
  return samples.filter((one) => one.name === name && labels(one.labels)).reduce((sum, one) => sum + one.value, 0);
}

/** Upper bound of the bucket that holds a quantile of the requests, in seconds. */
export function quantile(
  samples: Sample[],
  name: string,
  share: number,
  labels: (labels: Record<string, string>) => boolean = () => true,
): number | undefined {
  const buckets = new Map<number, number>();
  for (const one of samples.filter((sample) => sample.name === `${name}_bucket` && labels(sample.labels))) {
    const end = one.labels.le === "+Inf" ? Infinity : Number(one.labels.le);
    buckets.set(end, (buckets.get(end) ?? 0) + one.value);
  }
  const all = buckets.get(Infinity) ?? 0;
  if (all === 0) return undefined;
  return [...buckets].sort((a, b) => a[0] - b[0]).find(([, n]) => n >= share * all)?.[0];
}
