// A session as a file: everything as JSON, or a line for each revision as CSV, as
// `palpate sessions export` writes them.
import { getAll, getJson } from "../api/http";
import type { Replay, Session, SessionReading } from "../api/types";
import { csv, save } from "../parts/save";
import { likeliest } from "../sessions/words";

const READINGS_MAX = 10_000;
const STEPS = 1000;
const COLUMNS = ["revision", "at", "change", "reading", "robot", "seq", "x_m", "y_m", "z_m", "qx", "qy", "qz", "qw", "peak_pa", "n_readings", "answer", "probability", "entropy_bits"];

export async function exportSession(id: string, format: "json" | "csv"): Promise<void> {
  const path = `/v1/sessions/${encodeURIComponent(id)}`;
  const session = await getJson<Session>(path);
  const upto = session.revision ?? 0;
  const readings = (await getAll<SessionReading>(`${path}/readings`, READINGS_MAX)).filter((reading) => reading.number < upto);
  const replay = await whole(path, upto);
  if (format === "json") save(`session-${id}.json`, "application/json", JSON.stringify({ session, readings, replay }));
  else save(`session-${id}.csv`, "text/csv", csv([COLUMNS, ...rows(readings, replay)]));
}

async function whole(path: string, upto: number): Promise<Replay> {
  const ask = (after: number) => getJson<Replay>(`${path}/replay?upto=${upto}&after=${after}&limit=${STEPS}`);
  let all = await ask(0);
  while (typeof all.next_after === "number") {
    const more = await ask(all.next_after);
    all = { ...more, steps: [...all.steps, ...more.steps] };
  }
  return all;
}

function rows(readings: SessionReading[], replay: Replay): (string | number | null | undefined)[][] {
  const byNumber = new Map(readings.map((reading) => [reading.number, reading]));
  return replay.steps.map((step) => {
    const number = step.change.kind === "closed" ? undefined : step.change.number;
    const reading = number === undefined ? undefined : byNumber.get(number);
    const answer = likeliest(step);
    const pose = reading?.pose;
    const peak = reading?.image.reduce<number | null>((most, value) => (typeof value === "number" && (most === null || value > most) ? value : most), null);
    return [
      step.revision, step.at, step.change.kind, number, reading?.robot, reading?.seq,
      ...(pose ? [...pose.position, ...pose.orientation] : Array<undefined>(7).fill(undefined)), peak, step.n_readings,
      answer.name, answer.probability, step.entropy_bits,
    ];
  });
}
