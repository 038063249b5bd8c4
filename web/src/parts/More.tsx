// The end of a list that grows page by page.
import type { Pages } from "../api/pages";

/** The button for the next page; after the last one, how to find the rest. */
export function More({ of: list }: { of: Pages<unknown> }) {
  if (!list.data?.hasMore) return null;
  return (
    <p class="more">
      {list.isFull
        ? <span class="faint">A list ends here. Use the filters to find the rest.</span>
        : <button type="button" class="small" onClick={list.showMore}>Show more</button>}
    </p>
  );
}
