// Router: the address of a view is the fragment of the URL, so that the server serves one page. The path names the
// view, the query what is chosen in it; how far it is scrolled is kept in its entry of the history (`scroll.ts`).
import { computed, signal } from "@preact/signals";

const hash = signal(location.hash);
addEventListener("hashchange", () => {
  hash.value = location.hash;
});

const halves = computed(() => hash.value.replace(/^#\/?/, "").split(/\?(.*)/s));

/** Parts of the route, decoded: `#/sessions/7?reading=2` is `["sessions", "7"]`. */
export const route = computed(() => {
  const parts = halves.value[0]!.split("/").filter((part) => part !== "");
  return parts.map((part) => {
    try {
      return decodeURIComponent(part);
    } catch {
      return part;
    }
  });
});

/** What is chosen in the view: filters, searches, what is open. */
export const query = computed(() => new URLSearchParams(halves.value[1] ?? ""));

/** A link within the page. */
export function link(...parts: (string | number)[]): string {
  return `#/${parts.map((part) => encodeURIComponent(String(part))).join("/")}`;
}

export function go(...parts: (string | number)[]): void {
  location.hash = link(...parts);
}

/** Replaces the address of this entry of the history; what is chosen stays. */
export function replaceRoute(...parts: (string | number)[]): void {
  replace(link(...parts), query.peek());
}

/** Puts choices into the address; an empty one leaves it. */
export function choose(choices: Record<string, string>): void {
  const next = new URLSearchParams(query.peek());
  for (const [name, value] of Object.entries(choices)) {
    if (value === "") next.delete(name);
    else next.set(name, value);
  }
  const [first = "fleet", ...rest] = route.peek();
  replace(link(first, ...rest), next);
}

/** A choice that is kept in the address: its value, and the way to change it. */
export function useChoice(name: string, usual = ""): [value: string, set: (value: string) => void] {
  return [query.value.get(name) ?? usual, (value) => choose({ [name]: value === usual ? "" : value })];
}

function replace(path: string, chosen: URLSearchParams): void {
  const next = chosen.size > 0 ? `${path}?${chosen}` : path;
  if (next === location.hash) return;
  history.replaceState(history.state, "", next);
  hash.value = next;
}
