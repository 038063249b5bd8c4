// One object of the gallery, with the small picture that the server made of its mesh.
import { useEffect, useRef, useState } from "preact/hooks";
import { ask } from "../api/http";
import type { ObjectInfo } from "../api/types";
import { objectColor } from "../colors";
import { decimal, plural } from "../format";
import { link } from "../router";

interface Props {
  object: ObjectInfo;
  /** The versions that know it, in words; undefined while they are loading. */
  known: string | undefined;
  /** Which of how many objects it is, from 1: most of them are no elements. */
  place: number;
  of: number;
}

export function ObjectCard({ object, known, place, of }: Props) {
  const { mesh } = object;
  const [size, setSize] = useState<string>();
  return (
    <li class="card" aria-posinset={place} aria-setsize={of}>
      {mesh ? <Picture object={object} hash={mesh.hash} onSize={setSize} /> : <div class="no-picture">no mesh</div>}
      <div class="card-text">
        <span class="key"><span class="dot" style={{ background: objectColor(object.name) }} aria-hidden="true" /><a href={link("objects", object.name)} title={object.name}>{object.name}</a></span>
        <span class="faint">{[mesh && (size ?? "mesh"), object.n_readings > 0 && plural(object.n_readings, "training touch", "training touches")].filter(Boolean).join(", ") || "nothing to learn from yet"}</span>
        <span class="faint" title={known}>{known ?? "…"}</span>
      </div>
    </li>
  );
}

/** The picture of a card: a canvas, of which nothing stays when it goes, where the browser would keep
 * the pixels of every image that was ever shown. */
function Picture({ object, hash, onSize }: { object: ObjectInfo; hash: string; onSize: (size: string) => void }) {
  const box = useRef<HTMLCanvasElement>(null);
  useEffect(() => {
    const canvas = box.current;
    if (canvas === null) return;
    const abort = new AbortController();
    // A link would carry no key. The hash tells pictures of other meshes apart.
    ask(`/v1/objects/${object.id}/thumbnail.png`, { signal: abort.signal })
      .then(async (answer) => {
        const blob = await answer.blob();
        const size = sizeWords(await blob.arrayBuffer());
        if (size !== undefined && !abort.signal.aborted) onSize(size);
        return createImageBitmap(blob);
      })
      .then((picture) => {
        if (!abort.signal.aborted) {
          [canvas.width, canvas.height] = [picture.width, picture.height];
          canvas.getContext("2d")?.drawImage(picture, 0, 0);
          canvas.dataset.picture = hash;
        }
        picture.close();
      })
      .catch(() => {
        // A card without a picture still links to the object.
      });
    return () => {
      abort.abort();
      [canvas.width, canvas.height] = [0, 0];
    };
  }, [hash, object.id, onSize]);
  return <canvas ref={box} class="picture" width="0" height="0" aria-hidden="true" />;
}

/** The extent of the mesh that a picture states in its text `size_m`: `80.0 × 58.1 × 68.5 mm`. */
export function sizeWords(png: ArrayBuffer): string | undefined {
  const bytes = new DataView(png);
  // After the signature come chunks: length, type, content, checksum.
  for (let at = 8; at + 12 <= png.byteLength; at += 12 + bytes.getUint32(at)) {
    const text = new TextDecoder("latin1").decode(png.slice(at + 4, at + 8 + bytes.getUint32(at)));
    const [, extent] = /^tEXtsize_m\0([\d. ]+)$/.exec(text) ?? [];
    if (extent !== undefined) return `${extent.split(" ").map((side) => decimal(Number(side) * 1000, 1)).join(" × ")} mm`;
  }
  return undefined;
}
