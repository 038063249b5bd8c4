// The touches of the 3-D view as a table, which selects them as the view does.
import { decimal, signedBits } from "../format";
import { counts } from "./content";
import type { SessionModel } from "./model";
import { Table } from "../parts/Table";

interface Props {
  model: SessionModel;
  selected: number | undefined;
  select: (number: number | undefined) => void;
}

export function TouchTable({ model, selected, select }: Props) {
  const revision = model.shownRevision.value;
  const contributed = new Map(model.explanation.value?.readings.map((one) => [one.number, one.bits]));
  const touched = model.readings.value.filter((reading) => reading.pose && counts(reading, revision));
  return (
    <details class="behind">
      <summary>Touches as a table</summary>
      <Table label="Touches" columns={["Reading", "Position (mm)", "Sensor direction", ["Left out (bit)", "num"]]}>
        {touched.map((reading) => (
          <tr key={reading.number} class={reading.number === selected ? "chosen" : ""}>
            <th scope="row">
              <button type="button" class="plain small" aria-pressed={reading.number === selected}
                onClick={() => select(reading.number === selected ? undefined : reading.number)}>
                {reading.number + 1}
              </button>
            </th>
            <td class="num-left">{reading.pose!.position.map((part) => decimal(part * 1000, 1)).join(", ")}</td>
            <td>{direction(reading.pose!.orientation)}</td>
            <td class="num">{signedBits(contributed.get(reading.number))}</td>
          </tr>
        ))}
      </Table>
    </details>
  );
}

function direction(q: number[]): string {
  const [x = 0, y = 0, z = 0, w = 1] = q;
  const along = [2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)];
  return along.map((part) => decimal(part, 2)).join(", ");
}
