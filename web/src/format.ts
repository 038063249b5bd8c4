// Formats of numbers, times and colours, with all units and palettes.
import { signal } from "@preact/signals";

/** Current time, updated each second. */
export const now = signal(Date.now());
setInterval(() => {
  now.value = Date.now();
}, 1000);

/** Whether the dark theme is active; charts and scenes are redrawn when it changes. */
const darkQuery = matchMedia("(prefers-color-scheme: dark)");
export const dark = signal(darkQuery.matches);
darkQuery.addEventListener("change", (event) => {
  dark.value = event.matches;
});

/** Whether the window is as narrow as a phone. */
const narrowQuery = matchMedia("(max-width: 640px)");
export const narrow = signal(narrowQuery.matches);
narrowQuery.addEventListener("change", (event) => {
  narrow.value = event.matches;
});

export function percent(p: number): string {
  if (p >= 0.9995 && p < 1) return ">99.9 %";
  if (p > 0 && p < 0.0005) return "<0.1 %";
  return `${(p * 100).toFixed(p >= 0.9995 || p === 0 ? 0 : 1)} %`;
}

export function bits(value: number | null | undefined): string {
  return value === null || value === undefined ? "–" : `${decimal(value, 2)} bit`;
}

/** Bits with a sign. */
export function signedBits(value: number | null | undefined): string {
  if (value === null || value === undefined) return "–";
  const shown = Math.abs(value).toFixed(2);
  if (Number(shown) === 0) return "0.00";
  return value < 0 ? `−${shown}` : `+${shown}`;
}

export function mm(metres: number): string {
  const value = metres * 1000;
  return `${decimal(value, Math.abs(value) >= 100 ? 0 : 1)} mm`;
}

export function degrees(radians: number): string {
  return `${decimal((radians * 180) / Math.PI, 1)}°`;
}

export function kPa(pascal: number): string {
  if (Math.abs(pascal) < 1000) return `${decimal(pascal, 0)} Pa`;
  return `${decimal(pascal / 1000, 1)} kPa`;
}

/** Symmetry of an object: `16-fold, 16 × 2-fold`. */
export function symmetryWords(object: {
  symmetry?: { order?: number | null }[] | null;
  symmetry_by?: string | null;
  symmetry_touches_needed?: number | null;
}): string {
  if (object.symmetry_by === "undetermined") {
    const needed = object.symmetry_touches_needed;
    return needed ? `undetermined, ${count(needed)} more touches needed` : "undetermined";
  }
  const axes = object.symmetry;
  if (!axes) return "not determined";
  const counts = new Map<string, number>();
  for (const { order } of axes) {
    const word = typeof order === "number" ? `${order}-fold` : "round";
    counts.set(word, (counts.get(word) ?? 0) + 1);
  }
  return [...counts].map(([word, n]) => (n === 1 ? word : `${n} × ${word}`)).join(", ") || "none";
}

/** A number of bytes in decimal units, 1 MB being 10⁶ bytes: three digits, as the server writes it. */
export function bytes(n: number): string {
  const units = ["B", "kB", "MB", "GB", "TB"];
  let value = n;
  let unit = 0;
  while (value >= 999.5 && unit < units.length - 1) {
    value /= 1000;
    unit += 1;
  }
  const digits = unit === 0 || value >= 99.95 ? 0 : value >= 9.995 ? 1 : 2;
  return `${value.toFixed(digits)} ${units[unit]}`;
}

export function count(n: number): string {
  return n.toLocaleString("en-US");
}

/** A number with its noun: `3 readings`. */
export function plural(n: number, one: string, many = `${one}s`): string {
  return `${count(n)} ${n === 1 ? one : many}`;
}

export function age(milliseconds: number): string {
  const seconds = Math.max(0, Math.round(milliseconds / 1000));
  if (seconds < 60) return `${seconds} s`;
  if (seconds < 3600) return `${Math.floor(seconds / 60)} min`;
  if (seconds < 86_400) return `${Math.floor(seconds / 3600)} h`;
  return `${Math.floor(seconds / 86_400)} d`;
}

export function duration(seconds: number): string {
  if (seconds < 10) return `${seconds.toFixed(1)} s`;
  if (seconds < 90) return `${Math.round(seconds)} s`;
  return `${Math.floor(seconds / 60)} min ${Math.round(seconds % 60)} s`;
}

/** A server time in local time, to the second. */
export function when(time: string | null | undefined): string {
  if (time === null || time === undefined) return "–";
  const date = new Date(time);
  const day = `${date.getFullYear()}-${pad(date.getMonth() + 1)}-${pad(date.getDate())}`;
  return `${day} ${clock(date.getTime())}`;
}

/** The time of day of a moment of this browser, to the second. */
export function clock(milliseconds: number): string {
  const date = new Date(milliseconds);
  return `${pad(date.getHours())}:${pad(date.getMinutes())}:${pad(date.getSeconds())}`;
}

function pad(n: number): string {
  return String(n).padStart(2, "0");
}

/** The end of an id, where ids of the same hour differ. */
export function shortId(id: string): string {
  return id.slice(-8);
}

/** A number with so many digits, and a minus sign instead of a hyphen, unless it rounds to zero. */
export function decimal(value: number, digits: number): string {
  const shown = value.toFixed(digits);
  return Number(shown) === 0 ? shown.replace("-", "") : shown.replace("-", "−");
}

/** Series colours safe for colour blindness (Okabe and Ito, adapted). */
const SERIES_LIGHT = ["#0b6e8a", "#b4520f", "#5b3fa3", "#1c7a3e", "#a8326e", "#6b6300", "#3a5bbf", "#8a4b2a", "#4d6a7a", "#7a7a7a"];
const SERIES_DARK = ["#53c1de", "#f0995a", "#b39df2", "#6fce8f", "#f08abb", "#d6cb4d", "#8fabff", "#d99a76", "#9dbccb", "#b5b5b5"];
export function seriesColor(index: number): string {
  const palette = dark.value ? SERIES_DARK : SERIES_LIGHT;
  return palette[index % palette.length] ?? "#888";
}

/** Colours of appearance classes: hues of equal lightness. */
export function classColor(index: number | null | undefined): string {
  if (index === null || index === undefined) return "#8a949e";
  const hue = (index * 137.508) % 360;
  return hslHex(hue, index % 2 === 0 ? 0.62 : 0.45, dark.value ? 0.62 : 0.46);
}

/** Diverging scale: against (orange), neutral (grey), for (blue); saturated at ±4 bits. */
export function bitsColor(value: number | null | undefined): string {
  const grey: Rgb = dark.value ? [214, 220, 226] : [64, 74, 84];
  if (value === null || value === undefined) return rgbHex(grey);
  const share = Math.max(-1, Math.min(1, value / 4));
  const end: Rgb = share < 0 ? [232, 92, 10] : dark.value ? [70, 160, 255] : [16, 110, 224];
  return rgbHex(mix(grey, end, Math.abs(share) ** 0.6));
}

/** Pressure scale: dark blue, teal, pale yellow. */
const HEAT: Rgb[] = [[30, 34, 62], [36, 80, 122], [32, 137, 141], [122, 191, 118], [246, 230, 130]];
export function heat(share: number): Rgb {
  const place = Math.max(0, Math.min(1, share)) * (HEAT.length - 1);
  const low = Math.min(HEAT.length - 2, Math.floor(place));
  return mix(HEAT[low]!, HEAT[low + 1]!, place - low);
}

export type Rgb = [number, number, number];

export function rgbHex(rgb: Rgb): string {
  return `#${rgb.map((part) => Math.round(part).toString(16).padStart(2, "0")).join("")}`;
}

export function mix(a: Rgb, b: Rgb, share: number): Rgb {
  return [0, 1, 2].map((i) => a[i]! + (b[i]! - a[i]!) * share) as Rgb;
}

function hslHex(hue: number, saturation: number, lightness: number): string {
  const a = saturation * Math.min(lightness, 1 - lightness);
  const part = (n: number) => {
    const k = (n + hue / 30) % 12;
    return 255 * (lightness - a * Math.max(-1, Math.min(k - 3, 9 - k, 1)));
  };
  return rgbHex([part(0), part(8), part(4)]);
}
