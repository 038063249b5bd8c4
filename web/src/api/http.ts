// Requests to the server: the key goes in a header, never in a URL; problems become errors.
import { signal } from "@preact/signals";
import { asking, heard, missed } from "./pulse";
import type { Page, Problem } from "./types";

const STORED_KEY = "palpate.key";
/** Time limits: until an answer begins, until a JSON answer is complete, and for sending a file. */
const ANSWER_MS = 30_000;
const JSON_MS = 60_000;
const FILE_MS = 600_000;

/** API key of this tab; empty without one. */
export const apiKey = signal(sessionStorage.getItem(STORED_KEY) ?? "");
/** Whether the server refused a request for lack of a key. */
export const keyWanted = signal(false);

/** Stores the key for this tab; an empty key removes it. */
export function keepKey(key: string): void {
  if (key === "") sessionStorage.removeItem(STORED_KEY);
  else sessionStorage.setItem(STORED_KEY, key);
  apiKey.value = key;
  keyWanted.value = false;
}

/** An error with the server's problem. */
export class ProblemError extends Error {
  constructor(readonly problem: Problem) {
    super(problem.detail ?? problem.title);
  }

  get status(): number {
    return this.problem.status;
  }
}

/** Headers of every request. */
export function authorization(key = apiKey.value): Record<string, string> {
  return key === "" ? {} : { authorization: `Bearer ${key}` };
}

/** Sends a request; throws a `ProblemError` unless an answer begins in time and is a success. */
export async function ask(path: string, init: RequestInit = {}, timeoutMs = timeoutOf(init)): Promise<Response> {
  const sent = apiKey.value;
  const late = new AbortController();
  const timer = setTimeout(() => late.abort(), timeoutMs);
  const begun = Date.now();
  const answered = asking();
  let response: Response;
  try {
    response = await fetch(path, {
      ...init,
      signal: init.signal ? AbortSignal.any([init.signal, late.signal]) : late.signal,
      headers: { ...authorization(sent), ...(init.headers as Record<string, string>) },
    });
  } catch (error) {
    if (init.signal?.aborted) throw error;
    if (late.signal.aborted) throw new ProblemError(tooLate(path, timeoutMs));
    missed(begun);
    throw new ProblemError(unreachable(path));
  } finally {
    clearTimeout(timer);
    answered();
  }
  if (isOurs(response)) heard();
  else missed(begun);
  if (response.ok) return readable(response, path, init.signal);
  if (response.status === 401 && sent === apiKey.value) keyWanted.value = true;
  throw new ProblemError(await problemOf(response, path));
}

/** An answer whose body fails as one that never began, if the server goes while it is read. */
function readable(response: Response, path: string, signal: AbortSignal | null | undefined): Response {
  for (const how of ["json", "text", "blob", "arrayBuffer"] as const) {
    const read = response[how].bind(response) as () => Promise<never>;
    const begun = Date.now();
    response[how] = () => read().catch((error: unknown) => {
      if (signal?.aborted || error instanceof SyntaxError) throw error;
      missed(begun);
      throw new ProblemError(unreachable(path));
    });
  }
  return response;
}

/** Gets JSON; the whole answer must arrive in time. */
export async function getJson<T>(path: string, signal?: AbortSignal, timeoutMs = ANSWER_MS): Promise<T> {
  const late = AbortSignal.timeout(Math.max(timeoutMs, JSON_MS));
  try {
    const response = await ask(path, { signal: signal ? AbortSignal.any([signal, late]) : late }, timeoutMs);
    return (await response.json()) as T;
  } catch (error) {
    if (error instanceof ProblemError || signal?.aborted || error instanceof SyntaxError) throw error;
    throw new ProblemError(unreachable(path));
  }
}

/** Sends JSON; the result is undefined for an empty answer. */
export async function sendJson<T>(
  method: "POST" | "PUT" | "PATCH" | "DELETE",
  path: string,
  body?: unknown,
  headers: Record<string, string> = {},
): Promise<T> {
  const json: Record<string, string> = body === undefined ? {} : { "content-type": "application/json" };
  const response = await ask(path, {
    method,
    headers: { ...json, ...headers },
    body: body === undefined ? null : JSON.stringify(body),
  });
  return (response.status === 204 ? undefined : await response.json()) as T;
}

/** All items of a list, page by page, at most `max`. */
export async function getAll<T>(path: string, max = 5000, signal?: AbortSignal): Promise<T[]> {
  const items: T[] = [];
  let cursor: string | null = null;
  do {
    const join = path.includes("?") ? "&" : "?";
    const behind: string = cursor === null ? "" : `&cursor=${encodeURIComponent(cursor)}`;
    const page: Page<T> = await getJson(`${path}${join}limit=500${behind}`, signal);
    items.push(...page.items);
    cursor = page.next_cursor ?? null;
  } while (cursor !== null && items.length < max);
  return items;
}

async function problemOf(response: Response, path: string): Promise<Problem> {
  try {
    const body = (await response.json()) as Problem;
    if (typeof body.title === "string") return body;
  } catch {
    // Not a problem document: use the status.
  }
  return { ...unreachable(path), status: response.status, title: `The server answered ${response.status}` };
}

/** Whether the server itself answered, and not a proxy before it that says that it is away. */
function isOurs(response: Response): boolean {
  return !isGateway(response.status) || (response.headers.get("content-type") ?? "").startsWith("application/problem+json");
}

/** Statuses by which a proxy says that the server behind it is away. */
function isGateway(status: number): boolean {
  return status >= 502 && status <= 504;
}

/** Whether the same request may succeed later: nothing answered, or the server was not ready. */
export function isPassing(problem: Problem): boolean {
  return isUnanswered(problem) || isGateway(problem.status);
}

/** Whether nothing answered at all, which the page says once and not for each request. */
export function isUnanswered(problem: Problem): boolean {
  return problem.type === UNREACHABLE && problem.status === 0;
}

function timeoutOf(init: RequestInit): number {
  return init.body instanceof Blob ? FILE_MS : ANSWER_MS;
}

function tooLate(path: string, timeoutMs: number): Problem {
  return { ...unreachable(path), detail: `no answer within ${Math.round(timeoutMs / 1000)} s` };
}

const UNREACHABLE = "urn:palpate:problem:unavailable";

/** No status: no server gave one. */
function unreachable(path: string): Problem {
  return {
    type: UNREACHABLE,
    title: "Server unreachable",
    status: 0,
    detail: "no answer; it may be restarting, or the network may be down",
    instance: path,
    request_id: "",
  } as Problem;
}
