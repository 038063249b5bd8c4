// The filters of the sessions page, and the request that they make.
import { signal } from "@preact/signals";

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

/** Choice of an object that stands for "none of these". */
export const NONE = "\u0000none";

/** The filters; they stay when another page is opened. */
export const filters = signal<Filters>(NO_FILTERS);

/** The path of a page of the sessions that fit, newest first. */
export function sessionsPath(of: Filters, limit?: number, cursor?: string): string {
  const query = new URLSearchParams({ order: "newest" });
  if (limit !== undefined) query.set("limit", String(limit));
  const set = (name: string, value: string) => {
    if (value.trim() !== "") query.set(name, value.trim());
  };
  set("state", of.state);
  set("robot", of.robot);
  if (of.object === NONE) query.set("none_of_these", "true");
  else set("object", of.object);
  set("method", of.method);
  set("catalogue", of.catalogue);
  set("labels", of.labels.replaceAll("=", ":").replaceAll(/\s*,\s*/g, ","));
  set("since", instant(of.since));
  set("until", instant(of.until));
  set("with_truth", of.withTruth);
  if (cursor !== undefined) query.set("cursor", cursor);
  return `/v1/sessions?${query}`;
}

/** A local time of a form as the API takes it. */
function instant(local: string): string {
  const date = new Date(local);
  return local === "" || Number.isNaN(date.getTime()) ? "" : date.toISOString();
}
