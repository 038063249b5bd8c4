// A labelled field of a search: what is typed counts when Enter is pressed or the field is left.
import { useEffect, useState } from "preact/hooks";

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
  useEffect(() => setTyped(value), [value]);
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
