// Router: the route is the fragment of the URL, so that the server serves one page.
import { computed, signal } from "@preact/signals";

const hash = signal(location.hash);
addEventListener("hashchange", () => {
  hash.value = location.hash;
});

/** Parts of the route, decoded: `#/sessions/7` is `["sessions", "7"]`. */
export const route = computed(() => {
  const parts = hash.value.replace(/^#\/?/, "").split("/").filter((part) => part !== "");
  return parts.map((part) => {
    try {
      return decodeURIComponent(part);
    } catch {
      return part;
    }
  });
});

/** A link within the page. */
export function link(...parts: (string | number)[]): string {
  return `#/${parts.map((part) => encodeURIComponent(String(part))).join("/")}`;
}

export function go(...parts: (string | number)[]): void {
  location.hash = link(...parts);
}
