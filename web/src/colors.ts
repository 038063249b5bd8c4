// Colours of objects: an object has one colour, on every page and in every order.
import { effect, signal } from "@preact/signals";
import { getAll } from "./api/http";
import { persist } from "./api/resource";
import type { ObjectInfo } from "./api/types";
import { dark } from "./format";
import { maySee, who } from "./signin";

/** The first are the easiest to tell apart; each has a contrast of at least 3 to 1 with a panel. */
const LIGHT = [
  "#0b6e8a", "#b4520f", "#5b3fa3", "#1c7a3e", "#a8326e", "#6b6300", "#3a5bbf",
  "#8a4b2a", "#00857a", "#c0392b", "#8e44ad", "#4f7a00", "#d1495b", "#1b3a8a", "#9a7000", "#7a2048",
];
const DARK = [
  "#53c1de", "#f0995a", "#b39df2", "#6fce8f", "#f08abb", "#d6cb4d", "#8fabff",
  "#d99a76", "#4fd1c0", "#ff8a80", "#d79cf0", "#aedb5a", "#ff9fb0", "#6f8cff", "#f2c14e", "#c9809c",
];

/** Number of colours that the oldest objects share. */
const N_FIRST = 7;

/** Places in the palette by object name. */
const places = signal(new Map<string, number>());

/** The colour of an object; grey is kept for "none of these". */
export function objectColor(name: string): string {
  const place = places.value.get(name) ?? hash(name) % LIGHT.length;
  return (dark.value ? DARK : LIGHT)[place]!;
}

/** Changes when colours change: a dependency of what is drawn with them. */
export function colorsVersion(): unknown {
  return places.value;
}

/** The colour of lines that belong to no object. */
export function plainColor(): string {
  return dark.value ? "#a0afba" : "#54626e";
}

/** Gives every object a place. Its name chooses among the first places, or the others once those are
 * taken; the older object has precedence, so that an added one changes no other. Places repeat once
 * all are taken. */
export function nameColors(objects: Pick<ObjectInfo, "name" | "created_at">[]): void {
  const oldest = [...objects].sort((a, b) => a.created_at.localeCompare(b.created_at) || a.name.localeCompare(b.name));
  const taken = new Set<number>();
  const found = new Map<string, number>();
  oldest.forEach(({ name }, i) => {
    if (i % LIGHT.length === 0) taken.clear();
    const [from, n] = i % LIGHT.length < N_FIRST ? [0, N_FIRST] : [N_FIRST, LIGHT.length - N_FIRST];
    let turn = hash(name) % n;
    while (taken.has(from + turn)) turn = (turn + 1) % n;
    taken.add(from + turn);
    found.set(name, from + turn);
  });
  const isSame = found.size === places.peek().size && [...found].every(([name, place]) => places.peek().get(name) === place);
  if (!isSame) places.value = found;
}

/** FNV-1a. */
function hash(name: string): number {
  let value = 0x811c9dc5;
  for (const byte of new TextEncoder().encode(name)) value = Math.imul(value ^ byte, 0x01000193) >>> 0;
  return value;
}

effect(() => {
  // Robots may not list objects: their names alone choose.
  if (who.value === undefined || !maySee("objects")) return;
  const abort = new AbortController();
  persist(() => getAll<ObjectInfo>("/v1/objects", 5000, abort.signal), abort.signal).then(nameColors, () => undefined);
  return () => abort.abort();
});
