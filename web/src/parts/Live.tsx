// What the page says of its connection: the word "live", and the bar over values that are old.
import { isLive, silentSince } from "../api/pulse";
import { age, clock, now } from "../format";

/** The word that says whether a view follows the server. */
export function Live({ idle = "connecting" }: { idle?: string }) {
  const since = silentSince.value;
  if (since !== undefined) return <span class="live live-silent">last heard {age(now.value - since)} ago</span>;
  return <span class={isLive.value ? "live live-on" : "live"}>{isLive.value ? "live" : idle}</span>;
}

/** Says over every view that the server is silent, and how old the values below are. */
export function Silence() {
  const since = silentSince.value;
  return (
    <div role="status">
      {since !== undefined && (
        <p class="silence">
          <b>The server does not answer.</b>
          <span aria-hidden="true"> Last heard {age(now.value - since)} ago.</span> What is shown is as of {clock(since)}, and may have changed.
        </p>
      )}
    </div>
  );
}
