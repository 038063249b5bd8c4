// The choice of the objects to train: searched by name, chosen one by one or all that match.
import { useState } from "preact/hooks";
import type { ObjectInfo } from "../api/types";
import { count, plural } from "../format";
import { matches } from "./window";

interface Props {
  objects: ObjectInfo[];
  chosen: Set<string>;
  onChange: (chosen: Set<string>) => void;
}

export function ObjectChoice({ objects, chosen, onChange }: Props) {
  const [search, setSearch] = useState("");
  const matching = objects.filter((object) => matches(object.name, search));
  const set = (some: ObjectInfo[], isChosen: boolean) => {
    const next = new Set(chosen);
    for (const { id } of some) {
      if (isChosen) next.add(id);
      else next.delete(id);
    }
    onChange(next);
  };
  const isSearching = search.trim() !== "";
  return (
    <fieldset>
      <legend aria-live="polite">{plural(chosen.size, "object")} of {count(objects.length)}</legend>
      <div class="choice-head">
        <input type="search" aria-label="Search objects" placeholder="Search objects" value={search}
          onInput={(event) => setSearch(event.currentTarget.value)}
          // Enter would start the training.
          onKeyDown={(event) => event.key === "Enter" && event.preventDefault()} />
        <button type="button" class="small" disabled={matching.every(({ id }) => chosen.has(id))} onClick={() => set(matching, true)}>
          {isSearching ? `All ${count(matching.length)} found` : "All"}
        </button>
        <button type="button" class="small" disabled={!matching.some(({ id }) => chosen.has(id))} onClick={() => set(matching, false)}>
          {isSearching ? "None of these" : "None"}
        </button>
      </div>
      <div class="train-objects">
        {matching.map((object) => (
          <label key={object.id}>
            <input type="checkbox" checked={chosen.has(object.id)} onChange={(event) => set([object], event.currentTarget.checked)} />
            {object.name}
          </label>
        ))}
        {matching.length === 0 && <p class="faint">No object is called so.</p>}
      </div>
    </fieldset>
  );
}
