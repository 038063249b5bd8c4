// A loaded resource of a view: loading, loaded or refused, with retry.
import { useCallback, useEffect, useRef, useState } from "preact/hooks";
import { apiKey, isPassing, ProblemError } from "./http";
import { pause } from "./events";
import type { Problem } from "./types";

/** Pause before a request that the server could not answer is repeated. */
export const RETRY_MS = 3000;

export interface Resource<T> {
  data: T | undefined;
  problem: Problem | undefined;
  /** When the data arrived, by this browser's clock. */
  at: number;
  loading: boolean;
  reload: () => void;
}

/** Loads when `key` changes, every `everyMs`, and again while the server is away; a `null` key loads
 * nothing. Old data stays meanwhile. */
export function useResource<T>(
  key: string | null,
  load: (signal: AbortSignal) => Promise<T>,
  everyMs?: number,
  /** Data of another key of the same family stay until the new ones are there. */
  family: string | null = key,
): Resource<T> {
  const [state, setState] = useState<{ key: string | null; at: number; data?: T; problem?: Problem }>({ key: family, at: 0 });
  const [loading, setLoading] = useState(key !== null);
  const [turn, setTurn] = useState(0);
  const isBusy = useRef(false);
  const loader = useRef(load);
  loader.current = load;
  const secret = apiKey.value;
  useEffect(() => {
    if (key === null) return;
    const abort = new AbortController();
    setLoading(true);
    isBusy.current = true;
    let retry: ReturnType<typeof setTimeout> | undefined;
    loader.current(abort.signal).then(
      (data) => {
        if (abort.signal.aborted) return;
        isBusy.current = false;
        setState({ key: family, at: Date.now(), data });
        setLoading(false);
      },
      (error: unknown) => {
        if (abort.signal.aborted) return;
        isBusy.current = false;
        const problem = problemFrom(error);
        if (isPassing(problem)) retry = setTimeout(() => setTurn((n) => n + 1), RETRY_MS);
        setState((before) => ({ key: family, at: before.at, data: before.key === family ? before.data : undefined, problem }) as typeof before);
        setLoading(false);
      },
    );
    return () => {
      clearTimeout(retry);
      abort.abort();
    };
  }, [key, family, turn, secret]);
  useEffect(() => {
    if (everyMs === undefined || key === null) return;
    const timer = setInterval(() => {
      if (!document.hidden && !isBusy.current) setTurn((n) => n + 1);
    }, everyMs);
    return () => clearInterval(timer);
  }, [everyMs, key]);
  const reload = useCallback(() => setTurn((n) => n + 1), []);
  const isCurrent = state.key === family;
  return {
    data: isCurrent ? state.data : undefined,
    problem: isCurrent ? state.problem : undefined,
    at: state.at,
    loading,
    reload,
  };
}

/** Repeats a request until the server is back; other errors are thrown. */
export async function persist<T>(
  request: () => Promise<T>,
  signal: AbortSignal,
  onAway: (problem: Problem) => void = () => {},
): Promise<T> {
  for (;;) {
    try {
      return await request();
    } catch (error) {
      const problem = problemFrom(error);
      if (signal.aborted || !isPassing(problem)) throw error;
      onAway(problem);
      await pause(RETRY_MS, signal);
    }
  }
}

/** Converts any error to a problem. */
export function problemFrom(error: unknown): Problem {
  if (error instanceof ProblemError) return error.problem;
  const detail = error instanceof Error ? error.message : String(error);
  return { title: "Error in this page", detail, status: 0, type: "", instance: "", request_id: "" } as unknown as Problem;
}
