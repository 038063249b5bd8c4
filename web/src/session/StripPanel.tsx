// The strip of tactile images, with contributions and disagreements.
import { useEffect, useMemo, useRef } from "preact/hooks";
import type { SessionReading } from "../api/types";
import { bitsColor, kPa, signedBits } from "../format";
import { Panel } from "../parts/Panel";
import { TactileImage, type Image } from "../parts/TactileImage";
import { upright } from "../scene/vectors";
import { counts } from "./content";
import type { SessionModel } from "./model";

/** A strip that ends farther to the right than this, in pixels, was scrolled back. */
const ELSEWHERE = 120;

interface Props {
  model: SessionModel;
  selected: number | undefined;
  select: (number: number | undefined) => void;
}

export function StripPanel({ model, selected, select }: Props) {
  const readings = model.readings.value;
  const sensors = model.sensors.value;
  const images = useMemo(
    () => readings.map((reading): Image | undefined => {
      const sensor = sensors.get(reading.sensor);
      // A contact without an image has nothing to draw.
      if (reading.contact) return undefined;
      return sensor && upright(sensor, reading.image as (number | null)[]);
    }),
    [readings, sensors],
  );
  const most = useMemo(() => {
    const all = images.flatMap((image) => image?.values ?? []).filter((value) => value !== null);
    return all.reduce((a, b) => Math.max(a, b), 1000);
  }, [images]);
  const tints = model.tints.value;
  const strip = useStrip(selected ?? lastCounted(readings, model.at.value), readings.length);
  const contributed = new Map(model.explanation.value?.readings.map((one) => [one.number, one]));
  return (
    <Panel title="Tactile images" aside={<span class="key">0 <span class="ramp ramp-heat" aria-hidden="true" /> {kPa(most)}</span>}>
      {readings.length === 0 ? (
        <p class="faint">No reading yet.</p>
      ) : (
        <ol ref={strip} class="strip" aria-label="Readings">
          {readings.map((reading, i) => {
            const one = contributed.get(reading.number);
            return (
              <li key={reading.number}>
                <button
                  type="button"
                  class={shade(reading, model.revision.value)}
                  title={describe(reading, images[i])}
                  {...(reading.number === selected ? { "aria-current": "true" } : {})}
                  onClick={() => select(reading.number === selected ? undefined : reading.number)}
                >
                  {images[i] && <TactileImage image={images[i]!} most={most} />}
                  <span class="key">
                    <span class="dot" style={{ background: bitsColor(tints.get(reading.number)) }} />
                    <span class="visually-hidden">Reading </span>
                    {reading.number + 1}
                  </span>
                  <span class="num faint">
                    {one?.disagrees ? "disagrees" : signedBits(model.valueOf(one))}
                    <span class="visually-hidden"> bit {{ bits: "lost without it", came: "when it came", fit: "of fit" }[model.coloring.value]}, {describe(reading, images[i])}</span>
                  </span>
                </button>
              </li>
            );
          })}
        </ol>
      )}
    </Panel>
  );
}

/** The number of the last reading that counts at a revision; the newest one for null. */
function lastCounted(readings: SessionReading[], at: number | null): number | undefined {
  return (at === null ? readings : readings.filter((reading) => counts(reading, at))).at(-1)?.number;
}

/** Scrolls the strip to a reading when it changes, and to new readings unless somebody looks at older ones. */
function useStrip(shown: number | undefined, nReadings: number) {
  const strip = useRef<HTMLOListElement>(null);
  const before = useRef({ shown, nReadings: 0, end: 0 });
  useEffect(() => {
    const list = strip.current;
    if (list === null) return;
    const was = before.current;
    const isGrown = nReadings > was.nReadings;
    // Where the strip ended before the new readings were there.
    const isElsewhere = isGrown && was.nReadings > 0 && list.scrollLeft + list.clientWidth < was.end - ELSEWHERE;
    const item = list.children[shown ?? -1] as HTMLElement | undefined;
    if (item !== undefined && !isElsewhere && (isGrown || shown !== was.shown)) {
      list.scrollLeft = item.offsetLeft + item.offsetWidth / 2 - list.clientWidth / 2;
    }
    before.current = { shown, nReadings, end: list.scrollWidth };
  }, [shown, nReadings]);
  return strip;
}

function shade(reading: SessionReading, revision: number): string {
  if (counts(reading, revision)) return "";
  return reading.number >= revision ? "later" : "later withdrawn";
}

function describe(reading: SessionReading, image: Image | undefined): string {
  const most = Math.max(0, ...(image?.values ?? []).map((value) => value ?? 0));
  const withdrawn = typeof reading.retracted_by === "number" ? ", retracted" : "";
  const by = reading.written_by;
  const writer = by ? `written with ${by.key_name ?? by.key_id}, ` : "";
  const felt = reading.contact ? (reading.contact.touched === false ? "nothing touched" : "a contact") : `up to ${kPa(most)}`;
  return `${reading.robot ? `of ${reading.robot}, ` : ""}${writer}${felt}${withdrawn}`;
}
