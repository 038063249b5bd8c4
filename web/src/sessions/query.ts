// The filters of the sessions page, which are in its address, and the request that they make.
import { choose, query } from "../router";

/** Filters as the form has them; empty is no filter. */
export interface Filters {
  state: string;
  robot: string;
  object: string;
  method: string;
  catalogue: string;
  labels: string;
  since: string;
  until: string;
  withTruth: string;
}

export const NO_FILTERS: Filters = {
  state: "", robot: "", object: "", method: "", catalogue: "", labels: "", since: "", until: "", withTruth: "",
};

/** Choice of an object that stands for "none of these"; no object can have this name. */
export const NONE = "*none";

/** The filters that the address names. */
export function filters(): Filters {
  const named = Object.keys(NO_FILTERS).map((name) => [name, query.value.get(name) ?? ""]);
  return Object.fromEntries(named) as Filters;
}

/** Puts filters into the address; the list is then at its first page. */
export function setFilters(changes: Partial<Filters>): void {
  choose({ ...changes, pages: "" });
}

/** The path of a page of the sessions that fit, newest first. */
export function sessionsPath(of: Filters, limit?: number): string {
  const asked = new URLSearchParams({ order: "newest" });
  if (limit !== undefined) asked.set("limit", String(limit));
  const set = (name: string, value: string) => {
    if (value.trim() !== "") asked.set(name, value.trim());
  };
  set("state", of.state);
  // The beginning of a name is enough while it is typed.
  if (of.robot.trim() !== "") asked.set("robot", `${of.robot.trim().replace(/\*$/, "")}*`);
  if (of.object === NONE) asked.set("none_of_these", "true");
  else set("object", of.object);
  set("method", of.method);
  set("catalogue", of.catalogue);
  set("labels", of.labels.replaceAll("=", ":").replaceAll(/\s*,\s*/g, ",").replace(/,$/, ""));
  set("since", instant(of.since));
  set("until", instant(of.until));
  set("with_truth", of.withTruth);
  return `/v1/sessions?${asked}`;
}

/** A local time of a form as the API takes it. */
function instant(local: string): string {
  const date = new Date(local);
  return local === "" || Number.isNaN(date.getTime()) ? "" : date.toISOString();
}
