// How far a view is scrolled: kept in its entry of the history, and restored on the way back and after a reload.

const SAVED_AFTER_MS = 150;
/** A view of this age that did not change its size is where it was left. */
const SETTLED_MS = 1000;
/** Content that has not arrived by then is not waited for. */
const RESTORED_WITHIN_MS = 15_000;

let saving: ReturnType<typeof setTimeout> | undefined;
let stopRestoring: (() => void) | undefined;

function save(): void {
  clearTimeout(saving);
  saving = undefined;
  history.replaceState({ ...history.state, scrolled: Math.round(scrollY) }, "");
}

/** Keeps the place of every view from now on. */
export function keepScroll(): void {
  history.scrollRestoration = "manual";
  addEventListener("scroll", () => {
    if (stopRestoring !== undefined) return;
    clearTimeout(saving);
    saving = setTimeout(save, SAVED_AFTER_MS);
  }, { passive: true });
  const flush = () => {
    if (saving !== undefined) save();
  };
  addEventListener("click", flush, { capture: true });
  addEventListener("pagehide", flush);
  // A place that was not kept by now belongs to the view that was left.
  addEventListener("hashchange", () => {
    clearTimeout(saving);
    saving = undefined;
  });
}

/** Scrolls a new view to its kept place, as soon as it is that long. A user who scrolls meanwhile is left alone. */
export function restoreScroll(): void {
  stopRestoring?.();
  const wanted = Number((history.state as { scrolled?: number } | null)?.scrolled ?? 0);
  scrollTo(0, wanted);
  if (wanted === 0) return;
  let settling: ReturnType<typeof setTimeout> | undefined;
  const sizes = new ResizeObserver(() => {
    scrollTo(0, wanted);
    clearTimeout(settling);
    // A view that is long enough may still be emptied and filled anew.
    if (scrollY >= wanted - 1) settling = setTimeout(stop, SETTLED_MS);
  });
  const moves = ["wheel", "touchstart", "keydown", "pointerdown"];
  const timer = setTimeout(stop, RESTORED_WITHIN_MS);
  function stop() {
    sizes.disconnect();
    clearTimeout(timer);
    clearTimeout(settling);
    for (const move of moves) removeEventListener(move, stop);
    stopRestoring = undefined;
  }
  stopRestoring = stop;
  for (const move of moves) addEventListener(move, stop, { passive: true });
  sizes.observe(document.body);
}
