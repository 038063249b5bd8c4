// Which rows of a long grid are near the window: the others are space and no elements.

/** Rows drawn beyond the edges of the window, so that a fast scroll and the Tab key find the next ones. */
const MARGIN_ROWS = 3;

export interface Grid {
  /** Number of items. */
  count: number;
  /** Items in a row. */
  columns: number;
  /** Distance of two rows, in pixels, the gap included. */
  rowPx: number;
  /** Distance of the grid's top from the window's, in pixels: negative when it is scrolled out. */
  topPx: number;
  /** Height of the window, in pixels. */
  windowPx: number;
}

export interface Near {
  /** First item near the window. */
  from: number;
  /** The item after the last one near the window. */
  to: number;
  /** Space above the first, in pixels. */
  abovePx: number;
  /** Space below the last, in pixels. */
  belowPx: number;
}

/** The items of a grid that are near the window; whole rows. */
export function nearWindow({ count, columns, rowPx, topPx, windowPx }: Grid): Near {
  const rows = Math.ceil(count / columns);
  const bounded = (row: number) => Math.min(Math.max(row, 0), rows);
  const first = bounded(Math.floor(-topPx / rowPx) - MARGIN_ROWS);
  const end = Math.max(first, bounded(Math.ceil((windowPx - topPx) / rowPx) + MARGIN_ROWS));
  return {
    from: first * columns,
    to: Math.min(end * columns, count),
    abovePx: first * rowPx,
    belowPx: (rows - end) * rowPx,
  };
}

/** Whether a name contains every word of a search, in any case and order. */
export function matches(name: string, search: string): boolean {
  const words = search.toLowerCase().split(/\s+/).filter((word) => word !== "");
  return words.every((word) => name.toLowerCase().includes(word));
}
