// The filters of a list: open on a wide window, folded on a phone, with the number of those that are set.
import type { ComponentChildren } from "preact";
import { narrow } from "../format";

export function Filters({ nSet, onClear, children }: { nSet: number; onClear: () => void; children: ComponentChildren }) {
  return (
    <details class="panel filters-fold" open={!narrow.value}>
      <summary>Filters{nSet > 0 ? ` (${nSet} set)` : ""}</summary>
      <form class="filters" aria-label="Filters" onSubmit={(event) => event.preventDefault()}>
        {children}
        <div class="field">
          <button type="button" disabled={nSet === 0} onClick={onClear}>Clear filters</button>
        </div>
      </form>
    </details>
  );
}
