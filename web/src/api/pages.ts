// A list that grows page by page; how many are shown is in the address, so that the way back leads to the same rows.
import { useChoice } from "../router";
import { getJson } from "./http";
import { type Resource, useResource } from "./resource";
import type { Page } from "./types";

/** Number of pages that a list shows at most. */
const PAGES_MAX = 100;

export interface Pages<T> extends Resource<{ items: T[]; hasMore: boolean }> {
  showMore: () => void;
  /** Whether more exists than a list shows. */
  isFull: boolean;
}

/** The first pages of a list with an id in each item, by the path of its first page. */
export function usePages<T>(path: string, idOf: (item: T) => string | number, everyMs?: number): Pages<T> {
  const [chosen, choose] = useChoice("pages", "1");
  const n = Math.max(1, Math.min(PAGES_MAX, Number(chosen) || 1));
  const list = useResource(`${path} ${n}`, async (signal) => {
    const items = new Map<string | number, T>();
    let cursor: string | null = null;
    for (let page = 0; page < n; page += 1) {
      const behind: string = cursor === null ? "" : `&cursor=${encodeURIComponent(cursor)}`;
      const found: Page<T> = await getJson(`${path}${behind}`, signal);
      for (const item of found.items) items.set(idOf(item), item);
      cursor = found.next_cursor ?? null;
      if (cursor === null) break;
    }
    return { items: [...items.values()], hasMore: cursor !== null };
  }, everyMs, path);
  const isFull = n >= PAGES_MAX && (list.data?.hasMore ?? false);
  return { ...list, isFull, showMore: () => choose(String(n + 1)) };
}
