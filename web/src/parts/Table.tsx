// A table in a frame that scrolls: the frame is a region that the keyboard reaches and scrolls.
import type { ComponentChildren } from "preact";

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
  return (
    <div class="scroll" tabIndex={0} role="region" aria-label={label}>
      <table>
        <thead>
          <tr>{columns.map((column, place) => <Head key={place} of={column} />)}</tr>
        </thead>
        <tbody>{children}</tbody>
      </table>
    </div>
  );
}

function Head({ of: column }: { of: Column }) {
  if (typeof column === "string") return <th scope="col">{column}</th>;
  const [name, kind] = column;
  if (kind === "num") return <th scope="col" class="num">{name}</th>;
  return <th scope="col"><span class="visually-hidden">{name}</span></th>;
}
