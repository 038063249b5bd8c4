// The filters of the sessions page.
import { getAll } from "../api/http";
import { useResource } from "../api/resource";
import type { Catalogue, ObjectInfo } from "../api/types";
import { Filters as Form } from "../parts/Filters";
import { SearchField } from "../parts/SearchField";
import { maySee } from "../signin";
import { METHODS, methodWords } from "../words";
import { type Filters, filters, NO_FILTERS, NONE, setFilters } from "./query";
import { NONE_OF_THESE } from "../belief";

const OBJECTS_MAX = 5000;

export function FilterForm() {
  const objects = useResource(maySee("objects") ? "objects" : null, (signal) => getAll<ObjectInfo>("/v1/objects", OBJECTS_MAX, signal));
  const catalogues = useResource("catalogues", (signal) => getAll<Catalogue>("/v1/catalogues", 1000, signal));
  const of = filters();
  const set = (name: keyof Filters) => (event: { currentTarget: HTMLInputElement | HTMLSelectElement }) => {
    setFilters({ [name]: event.currentTarget.value });
  };
  const choice = (name: keyof Filters, label: string, options: [value: string, shown: string][]) => (
    <div class="field">
      <label for={`filter-${name}`}>{label}</label>
      <select id={`filter-${name}`} value={of[name]} onChange={set(name)}>
        <option value="">any</option>
        {options.map(([value, shown]) => <option key={value} value={value}>{shown}</option>)}
      </select>
    </div>
  );
  const text = (name: keyof Filters, label: string, placeholder: string) => (
    <SearchField id={`filter-${name}`} label={label} value={of[name]} placeholder={placeholder}
      onSearch={(value) => setFilters({ [name]: value })} />
  );
  const time = (name: keyof Filters, label: string) => (
    <div class="field">
      <label for={`filter-${name}`}>{label}</label>
      <input id={`filter-${name}`} type="datetime-local" value={of[name]} onChange={set(name)} />
    </div>
  );
  const names = (objects.data ?? []).map((object) => object.name).sort();
  return (
    <Form nSet={Object.values(of).filter((value) => value !== "").length} onClear={() => setFilters(NO_FILTERS)}>
      {choice("state", "State", [["open", "open"], ["closed", "ended"]])}
      {choice("object", "Object", [[NONE, NONE_OF_THESE], ...names.map((name): [string, string] => [name, name])])}
      {choice("withTruth", "Truth", [["true", "known"], ["false", "not known"]])}
      {text("robot", "Robot", "name or its beginning")}
      {text("labels", "Labels", "site=oslo, shift")}
      {choice("method", "Method", METHODS.map((method) => [method, methodWords(method)]))}
      {choice("catalogue", "Catalogue", (catalogues.data ?? []).map(({ name }) => [name, name]))}
      {time("since", "Began after")}
      {time("until", "Began before")}
    </Form>
  );
}
