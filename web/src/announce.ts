// Announcements for screen readers, one polite sentence at a time.
import { signal } from "@preact/signals";

/** The sentence in the page's live region. */
export const announcement = signal("");

const PAUSE_MS = 1500;
let last = 0;
let waiting: ReturnType<typeof setTimeout> | undefined;

/** Announces a sentence; of several at once only the newest is kept. */
export function announce(sentence: string): void {
  clearTimeout(waiting);
  const say = () => {
    last = Date.now();
    announcement.value = sentence;
  };
  const left = last + PAUSE_MS - Date.now();
  if (left <= 0) say();
  else waiting = setTimeout(say, left);
}
