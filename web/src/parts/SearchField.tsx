// A labelled field of a search, which counts as it is typed, after a short pause, or when Enter is pressed.
import { useEffect, useRef, useState } from "preact/hooks";

const PAUSE_MS = 300;

interface Props {
  id: string;
  label: string;
  value: string;
  placeholder?: string;
  /** Whether only whole words count, so that Enter is waited for; the field says so. */
  isWhole?: boolean;
  onSearch: (value: string) => void;
}

export function SearchField({ id, label, value, placeholder = "", isWhole = false, onSearch }: Props) {
  // Kept apart, so that a page that is drawn again does not take back what is being typed.
  const [typed, setTyped] = useState(value);
  // A value from outside replaces what is typed. Not in an effect: the one of the first drawing
  // would run late on a busy machine, and empty the field under the first letters.
  const [last, setLast] = useState(value);
  const waiting = useRef<ReturnType<typeof setTimeout> | undefined>(undefined);
  if (last !== value) {
    setLast(value);
    if (waiting.current === undefined) setTyped(value);
  }
  const stop = () => {
    clearTimeout(waiting.current);
    waiting.current = undefined;
  };
  useEffect(() => () => clearTimeout(waiting.current), []);
  const search = (text: string) => {
    stop();
    onSearch(text);
  };
  const type = (text: string) => {
    setTyped(text);
    stop();
    if (!isWhole) waiting.current = setTimeout(() => search(text), PAUSE_MS);
  };
  return (
    <div class="field">
      <label for={id}>{label}{isWhole && ", then Enter"}</label>
      <input
        id={id}
        type="search"
        value={typed}
        placeholder={placeholder}
        onInput={(event) => type(event.currentTarget.value)}
        onChange={(event) => search(event.currentTarget.value)}
      />
    </div>
  );
}
