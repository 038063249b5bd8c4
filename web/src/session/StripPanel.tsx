// The strip of tactile images, with contributions and disagreements.
import { useMemo } from "preact/hooks";
import type { SessionReading } from "../api/types";
import { bitsColor, kPa, signedBits } from "../format";
import { Panel } from "../parts/Panel";
import { TactileImage, type Image } from "../parts/TactileImage";
import { upright } from "../scene/vectors";
import { counts } from "./content";
import type { SessionModel } from "./model";

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
  const contributed = new Map(model.explanation.value?.readings.map((one) => [one.number, one]));
  return (
    <Panel title="Tactile images" aside={<span>dark 0 · bright {kPa(most)}</span>}>
      {readings.length === 0 ? (
        <p class="faint">No reading yet.</p>
      ) : (
        <ol class="strip" aria-label="Readings">
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
                    {one?.disagrees ? "disagrees" : signedBits(one?.bits)}
                    <span class="visually-hidden"> bit, {describe(reading, images[i])}</span>
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

function shade(reading: SessionReading, revision: number): string {
  if (counts(reading, revision)) return "";
  return reading.number >= revision ? "later" : "later retracted";
}

function describe(reading: SessionReading, image: Image | undefined): string {
  const most = Math.max(0, ...(image?.values ?? []).map((value) => value ?? 0));
  const withdrawn = typeof reading.retracted_by === "number" ? ", retracted" : "";
  const by = reading.written_by;
  const writer = by ? `written with ${by.key_name ?? by.key_id}, ` : "";
  const felt = reading.contact ? (reading.contact.touched === false ? "nothing touched" : "a contact") : `up to ${kPa(most)}`;
  return `${reading.robot ? `of ${reading.robot}, ` : ""}${writer}${felt}${withdrawn}`;
}
