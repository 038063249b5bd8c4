// State of an action: whether it is in progress, and the problem if it failed.
import { useState } from "preact/hooks";
import type { Problem } from "../api/types";
import { problemFrom } from "../api/resource";

export interface Action {
  busy: boolean;
  problem: Problem | undefined;
  run: (work: () => Promise<void>) => void;
  clear: () => void;
}

export function useAction(): Action {
  const [busy, setBusy] = useState(false);
  const [problem, setProblem] = useState<Problem>();
  const run = (work: () => Promise<void>) => {
    setBusy(true);
    setProblem(undefined);
    work()
      .catch((error: unknown) => setProblem(problemFrom(error)))
      .finally(() => setBusy(false));
  };
  return { busy, problem, run, clear: () => setProblem(undefined) };
}
