// Server-sent events over fetch, because EventSource cannot send a header.
import { ask, ProblemError } from "./http";

/** One event of a stream. */
export interface StreamEvent {
  name: string;
  data: string;
}

/** Follows a stream until `signal` aborts or it ends for good; reopens broken streams. */
export async function follow(
  path: string,
  signal: AbortSignal,
  onEvent: (event: StreamEvent) => boolean | void,
  onState: (connected: boolean) => void = () => {},
): Promise<void> {
  for (let attempt = 0; !signal.aborted; attempt += 1) {
    try {
      const response = await ask(path, { signal, headers: { accept: "text/event-stream" } });
      onState(true);
      attempt = 0;
      if (await read(response, onEvent)) return;
    } catch (error) {
      if (signal.aborted) return;
      if (error instanceof ProblemError && [401, 403, 404, 422].includes(error.status)) throw error;
    }
    onState(false);
    await pause(Math.min(10_000, 500 * 2 ** attempt), signal);
  }
}

/** Reads a stream; returns true if the reader has finished. */
async function read(response: Response, onEvent: (event: StreamEvent) => boolean | void) {
  const reader = response.body?.pipeThrough(new TextDecoderStream()).getReader();
  if (reader === undefined) return false;
  let rest = "";
  for (;;) {
    const { done, value } = await reader.read();
    if (done) return false;
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

function pause(milliseconds: number, signal: AbortSignal): Promise<void> {
  return new Promise((resolve) => {
    const timer = setTimeout(resolve, milliseconds);
    signal.addEventListener("abort", () => (clearTimeout(timer), resolve()), { once: true });
  });
}
