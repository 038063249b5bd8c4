// A matrix as a table with tinted cells, for confusion and similarity.
import { useId } from "preact/hooks";

export function Matrix(props: {
  caption: string;
  names: string[];
  rows: number[][];
  rowWord: string;
  /** Whether large values belong on the diagonal. */
  diagonalIsGood: boolean;
}) {
  const id = useId();
  const tint = (value: number, isDiagonal: boolean) => {
    const step = Math.round(Math.max(0, Math.min(1, value)) * 10);
    return `tint tint-${props.diagonalIsGood && !isDiagonal ? "bad" : "good"}-${step}`;
  };
  return (
    <div class="scroll" tabIndex={0} role="region" aria-labelledby={id}>
      <p id={id} class="faint">{props.caption}</p>
      <table class="matrix" aria-labelledby={id}>
        <thead>
          <tr>
            <th scope="col">{props.rowWord}</th>
            {props.names.map((name) => (
              <th key={name} scope="col" class="matrix-col"><span>{name}</span></th>
            ))}
          </tr>
        </thead>
        <tbody>
          {props.names.map((name, row) => (
            <tr key={name}>
              <th scope="row">{name}</th>
              {props.names.map((other, col) => {
                const value = props.rows[row]?.[col] ?? 0;
                return (
                  <td key={other} class={tint(value, row === col)} title={`${name} → ${other}`}>
                    {value < 0.005 ? "·" : value.toFixed(2).replace(/^0/, "").replace("1.00", "1")}
                  </td>
                );
              })}
            </tr>
          ))}
        </tbody>
      </table>
    </div>
  );
}
