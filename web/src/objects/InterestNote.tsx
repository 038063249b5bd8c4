// What the heat map of an object shows: its scale in bits, the objects that it is compared with, and its numbers as tables.
import type { InterestMap } from "../api/types";
import type { Resource } from "../api/resource";
import { bits, decimal, percent, plural } from "../format";
import { Empty, ProblemNote } from "../parts/Notes";
import { Table } from "../parts/Table";
import { medianBits, mostTelling, scaleOf } from "./interest";

/** Rows of the table of places. */
const N_PLACES = 10;

export function InterestNote({ of }: { of: Resource<InterestMap> }) {
  if (of.problem) return <ProblemNote problem={of.problem} retry={of.reload} />;
  const map = of.data;
  if (map === undefined) return <p class="touch-say" role="status">Comparing the object with others …</p>;
  if (map.rivals.length === 0) {
    return <Empty title="Nothing to tell it from">The version has no other object. Train it with the objects that robots may meet.</Empty>;
  }
  const { low, high } = scaleOf(map.places);
  const [first] = map.rivals;
  return (
    <>
      <p class="layers">
        <span class="key">{bits(low)} <span class="ramp ramp-heat" aria-hidden="true" /> {bits(high)}</span>
        <span class="key">
          What a touch tells about which of {plural(map.rivals.length + 1, "object")} it is, of at most {bits(map.bits_max)}, once poses are known;
          half of the places tell {bits(medianBits(map))} or more. Most like it: {first!.name} ({percent(first!.likeness)} alike).
        </span>
      </p>
      <details class="behind">
        <summary>Information as tables</summary>
        <Table label="Places that tell most" columns={[["Bits", "num"], ["x", "num"], ["y", "num"], ["z (mm)", "num"]]}>
          {mostTelling(map, N_PLACES).map((place) => (
            <tr key={place.position.join()}>
              <td class="num">{decimal(place.bits, 2)}</td>
              {place.position.map((metres, i) => <td key={"xyz"[i]} class="num">{decimal(metres * 1000, 1)}</td>)}
            </tr>
          ))}
        </Table>
        <Table label="Objects that it is compared with" columns={["Object", ["Alike", "num"]]}>
          {map.rivals.map((rival) => (
            <tr key={rival.id}>
              <th scope="row">{rival.name}</th>
              <td class="num">{percent(rival.likeness)}</td>
            </tr>
          ))}
        </Table>
      </details>
    </>
  );
}
