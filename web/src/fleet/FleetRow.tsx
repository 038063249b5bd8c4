// Row of an open session: likeliest answer, robots and state. A sure session takes one line.
import { silentSince } from "../api/pulse";
import { answerOf, titleOf } from "../belief";
import { objectColor } from "../colors";
import { age, bits, now, plural, shortId } from "../format";
import { Badge } from "../parts/Panel";
import { ProbabilityBars, shares } from "../parts/ProbabilityBars";
import { Sparkline } from "../parts/Sparkline";
import { link } from "../router";
import { methodWords } from "../words";
import type { Watched } from "./watch";

export function FleetRow(props: {
  watched: Watched;
  selected: boolean;
  onSelect: (id: string, isSelected: boolean) => void;
}) {
  const { watched, selected, onSelect } = props;
  const { info, belief, trace } = watched;
  const { session } = info;
  const { level, reason, is_needed, muted_until } = info.attention;
  const isSeen = !is_needed && (level === "surprising" || level === "stuck");
  const touchedBy = info.session.touched_by ?? [];
  const robots = touchedBy.length > 0 ? touchedBy.join(", ") : "no robot yet";
  const entropy = trace.at(-1)?.entropyBits;
  const first = trace[0]?.entropyBits;
  // Only the first page is followed live; other rows show the listed belief.
  const { latest } = info.session;
  const shown = belief ?? (latest && { objects: latest.best ? [latest.best] : [], unknown: latest.unknown });
  const nReadings = belief?.n_readings ?? session.n_readings;
  const answer = answerOf(shown, nReadings);
  // Nothing is to be compared where one answer is sure, or none is felt.
  const isLine = level === "sure" || nReadings === 0;
  return (
    <li class={`fleet-row level-${isSeen ? "seen" : level} ${isLine ? "fleet-line" : ""}`}>
      <input
        type="checkbox"
        class="fleet-check"
        checked={selected}
        aria-label={`Select ${robots}, session ${shortId(session.id)}`}
        onChange={(event) => onSelect(session.id, event.currentTarget.checked)}
      />
      <div class="fleet-who">
        <a href={link("sessions", session.id)} class="fleet-link">
          {answer && <span class="dot" style={answer.isUnknown ? {} : { background: objectColor(answer.name) }} aria-hidden="true" />}
          {titleOf(answer, robots)}
        </a>
        <span class="faint">
          {methodWords(session.method)} · <code>{shortId(session.id)}</code> · {plural(nReadings, "reading")}
        </span>
      </div>
      <div class="fleet-bars">
        {isLine ? null : shown ? (
          <ProbabilityBars of={shares(shown.objects, shown.unknown ?? 0, 3)} label={`Likeliest objects of ${robots}`} />
        ) : (
          <span class="faint">loading belief …</span>
        )}
      </div>
      <div class="fleet-entropy">
        <Sparkline
          points={trace.map((point) => ({ n: point.nReadings, value: point.entropyBits }))}
          label={`Uncertainty over readings, from ${bits(first)} to ${bits(entropy)}`}
        />
        <span class="num">{bits(entropy)}</span>
      </div>
      <div class="fleet-age num">
        {watched.lastReadingAt === undefined ? "–" : `${age(now.value - watched.lastReadingAt)} ago`}
      </div>
      <div class="fleet-state">
        <Badge kind={isSeen ? "seen" : level}>{isSeen ? `${level}, ${muted_until ? "muted" : "seen"}` : level}</Badge>
        <span class="faint">
          {level === "sure" || silentSince.value !== undefined ? "" : reason}
          {is_needed && ` · ${age(Math.max(0, now.value - watched.since))} ago`}
        </span>
      </div>
    </li>
  );
}
