// A loaded resource of a view: loading, loaded or refused, with retry.
import { useCallback, useEffect, useRef, useState } from "preact/hooks";
import { apiKey, ProblemError } from "./http";
import type { Problem } from "./types";

export interface Resource<T> {
  data: T | undefined;
  problem: Problem | undefined;
  loading: boolean;
  reload: () => void;
}

/** Loads when `key` changes and every `everyMs`; a `null` key loads nothing. Old data stays meanwhile. */
export function useResource<T>(
  key: string | null,
  load: (signal: AbortSignal) => Promise<T>,
  everyMs?: number,
): Resource<T> {
  const [state, setState] = useState<{ key: string | null; data?: T; problem?: Problem }>({ key });
  const [loading, setLoading] = useState(key !== null);
  const [turn, setTurn] = useState(0);
  const loader = useRef(load);
  loader.current = load;
  const secret = apiKey.value;
  useEffect(() => {
    if (key === null) return;
    const abort = new AbortController();
    setLoading(true);
    loader.current(abort.signal).then(
      (data) => {
        if (abort.signal.aborted) return;
        setState({ key, data });
        setLoading(false);
      },
      (error: unknown) => {
        if (abort.signal.aborted) return;
        const problem = problemFrom(error);
        setState((before) => ({ key, data: before.key === key ? before.data : undefined, problem }) as typeof before);
        setLoading(false);
      },
    );
    return () => abort.abort();
  }, [key, turn, secret]);
  useEffect(() => {
    if (everyMs === undefined || key === null) return;
    const timer = setInterval(() => {
      if (!document.hidden) setTurn((n) => n + 1);
    }, everyMs);
    return () => clearInterval(timer);
  }, [everyMs, key]);
  const reload = useCallback(() => setTurn((n) => n + 1), []);
  const isCurrent = state.key === key;
  return {
    data: isCurrent ? state.data : undefined,
    problem: isCurrent ? state.problem : undefined,
    loading,
    reload,
  };
}

/** Converts any error to a problem. */
export function problemFrom(error: unknown): Problem {
  if (error instanceof ProblemError) return error.problem;
  const detail = error instanceof Error ? error.message : String(error);
  return { title: "Error in this page", detail, status: 0, type: "", instance: "", request_id: "" } as unknown as Problem;
}
