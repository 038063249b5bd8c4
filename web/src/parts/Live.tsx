// The word that says whether a view is live, and how long ago the server was last heard.
import { useEffect } from "preact/hooks";
import { silentFor, watchPulse, type Line } from "../api/pulse";
import { age, now } from "../format";

export function Live({ line, idle = "connecting" }: { line: Line; idle?: string }) {
  useEffect(watchPulse, []);
  const silent = silentFor(line, now.value);
  if (silent > 0) return <span class="live live-silent">last heard {age(silent)} ago</span>;
  return <span class={line.open ? "live live-on" : "live"}>{line.open ? "live" : idle}</span>;
}
