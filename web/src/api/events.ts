// Server-sent events over fetch, because EventSource cannot send a header.
import { ask, ProblemError } from "./http";
import { closed, heard, type Line, opened } from "./pulse";

/** Two missed keep-alives: the stream is broken, even if the network has not noticed. */
const BROKEN_MS = 32_000;

/** One event of a stream. */
export interface StreamEvent {
  name: string;
  data: string;
}

/** Follows a stream until `signal` aborts or it ends for good; reopens broken and silent streams. */
export async function follow(
  path: string,
  signal: AbortSignal,
  onEvent: (event: StreamEvent) => boolean | void,
  onOpen: () => void = () => {},
): Promise<void> {
  for (let attempt = 0; !signal.aborted; attempt += 1) {
    const silent = new AbortController();
    let watchdog = setTimeout(() => silent.abort(), BROKEN_MS);
    let line: Line | undefined;
    const onBytes = () => {
      clearTimeout(watchdog);
      watchdog = setTimeout(() => silent.abort(), BROKEN_MS);
      heard();
      if (line) line.heardAt = Date.now();
    };
    try {
      const either = AbortSignal.any([signal, silent.signal]);
      const response = await ask(path, { signal: either, headers: { accept: "text/event-stream" } });
      line = opened();
      onOpen();
      attempt = 0;
      if (await read(response, onEvent, onBytes)) return;
    } catch (error) {
      if (signal.aborted) return;
      if (error instanceof ProblemError && [401, 403, 404, 422].includes(error.status)) throw error;
    } finally {
      clearTimeout(watchdog);
      if (line) closed(line);
    }
    await pause(Math.min(5000, 500 * 2 ** attempt), signal);
  }
}

/** Reads a stream; returns true if the reader has finished. */
async function read(response: Response, onEvent: (event: StreamEvent) => boolean | void, onBytes: () => void) {
  const reader = response.body?.pipeThrough(new TextDecoderStream()).getReader();
  if (reader === undefined) return false;
  let rest = "";
  for (;;) {
    const { done, value } = await reader.read();
    if (done) return false;
    onBytes();
    const blocks = (rest + value).split(/\r?\n\r?\n/);
    rest = blocks.pop() ?? "";
    for (const block of blocks) {
      const event = parse(block);
      if (event !== null && onEvent(event) === true) {
        await reader.cancel();
        return true;
      }
    }
  }
}

/** Parses an event; null for keep-alive comments. */
export function parse(block: string): StreamEvent | null {
  let name = "message";
  const data: string[] = [];
  for (const line of block.split(/\r?\n/)) {
    if (line.startsWith("event:")) name = line.slice(6).trim();
    else if (line.startsWith("data:")) data.push(line.slice(5).replace(/^ /, ""));
  }
  return data.length === 0 ? null : { name, data: data.join("\n") };
}

/** Resolves after a while, or when `signal` aborts. */
export function pause(milliseconds: number, signal: AbortSignal): Promise<void> {
  return new Promise((resolve) => {
    const timer = setTimeout(resolve, milliseconds);
    const end = () => {
      clearTimeout(timer);
      resolve();
    };
    signal.addEventListener("abort", end, { once: true });
  });
}
