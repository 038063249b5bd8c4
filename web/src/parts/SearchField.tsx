// A labelled field of a search: what is typed counts when Enter is pressed or the field is left.
import { useState } from "preact/hooks";

interface Props {
  id: string;
  label: string;
  value: string;
  placeholder?: string;
  onSearch: (value: string) => void;
}

export function SearchField({ id, label, value, placeholder = "", onSearch }: Props) {
  // Kept apart, so that a page that is drawn again does not take back what is being typed.
  const [typed, setTyped] = useState(value);
  // A value from outside replaces what is typed. Not in an effect: the one of the first drawing
  // would run late on a busy machine, and empty the field under the first letters.
  const [last, setLast] = useState(value);
  if (last !== value) {
    setLast(value);
    setTyped(value);
  }
  return (
    <div class="field">
      <label for={id}>{label}</label>
      <input
        id={id}
        type="search"
        value={typed}
        placeholder={placeholder}
        onInput={(event) => setTyped(event.currentTarget.value)}
        onChange={(event) => onSearch(event.currentTarget.value)}
      />
    </div>
  );
}
