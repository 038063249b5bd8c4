// A table in a frame that scrolls: the frame is a region that the keyboard reaches and scrolls. On a phone each row
// is a card, in which every value has the name of its column.
import type { ComponentChildren } from "preact";
import { useLayoutEffect, useRef } from "preact/hooks";
import { narrow } from "../format";

/** Head of a column: its name, `num` above numbers, `hidden` where only a screen reader needs it. */
export type Column = string | [name: ComponentChildren, kind: "num" | "hidden"];

interface Props {
  /** Name of the region. */
  label: string;
  columns: Column[];
  /** The rows. */
  children: ComponentChildren;
}

export function Table({ label, columns, children }: Props) {
  const table = useRef<HTMLTableElement>(null);
  const isNarrow = narrow.value;
  useLayoutEffect(() => {
    if (table.current) nameCells(table.current, isNarrow);
  });
  return (
    <div class="scroll" tabIndex={0} role="region" aria-label={label}>
      <table ref={table} class="cards">
        <thead>
          <tr>{columns.map((column, place) => <Head key={place} of={column} />)}</tr>
        </thead>
        <tbody>{children}</tbody>
      </table>
    </div>
  );
}

/** Names each cell by its column, and says what the elements are, which as blocks they no longer do by themselves. */
function nameCells(table: HTMLTableElement, isNarrow: boolean): void {
  const names = [...(table.tHead?.rows[0]?.cells ?? [])].map((cell) => (cell.querySelector(".visually-hidden") ? "" : (cell.textContent ?? "")));
  const role = (element: Element, name: string) => (isNarrow ? element.setAttribute("role", name) : element.removeAttribute("role"));
  role(table, "table");
  for (const part of [...(table.tHead ? [table.tHead] : []), ...table.tBodies]) {
    role(part, "rowgroup");
    for (const row of part.rows) {
      role(row, "row");
      for (const [place, cell] of [...row.cells].entries()) {
        role(cell, cell.scope === "row" ? "rowheader" : cell.scope === "col" ? "columnheader" : "cell");
        if (part !== table.tHead && cell.colSpan === 1) cell.dataset.column = names[place] ?? "";
      }
    }
  }
}

function Head({ of: column }: { of: Column }) {
  if (typeof column === "string") return <th scope="col">{column}</th>;
  const [name, kind] = column;
  if (kind === "num") return <th scope="col" class="num">{name}</th>;
  return <th scope="col"><span class="visually-hidden">{name}</span></th>;
}
