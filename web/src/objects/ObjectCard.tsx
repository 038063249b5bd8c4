// One object of the gallery, with the small picture that the server made of its mesh.
import { useEffect, useRef } from "preact/hooks";
import { ask } from "../api/http";
import type { ObjectInfo } from "../api/types";
import { objectColor } from "../colors";
import { bytes, plural } from "../format";
import { link } from "../router";

interface Props {
  object: ObjectInfo;
  /** Which of how many objects it is, from 1: most of them are no elements. */
  place: number;
  of: number;
}

export function ObjectCard({ object, place, of }: Props) {
  const { mesh } = object;
  return (
    <li class="card" aria-posinset={place} aria-setsize={of}>
      {mesh ? <Picture object={object} hash={mesh.hash} /> : <div class="no-picture">no mesh</div>}
      <div class="card-text">
        <span class="key"><span class="dot" style={{ background: objectColor(object.name) }} aria-hidden="true" /><a href={link("objects", object.name)} title={object.name}>{object.name}</a></span>
        <span class="faint">
          {mesh ? `${mesh.format.toUpperCase()} in ${mesh.unit}, ${bytes(mesh.bytes)}` : "taught by touch"}
        </span>
        <span class="faint">{object.n_readings > 0 ? plural(object.n_readings, "training touch", "training touches") : "simulated touches"}</span>
      </div>
    </li>
  );
}

/** The picture of a card: a canvas, of which nothing stays when it goes, where the browser would keep
 * the pixels of every image that was ever shown. */
function Picture({ object, hash }: { object: ObjectInfo; hash: string }) {
  const box = useRef<HTMLCanvasElement>(null);
  useEffect(() => {
    const canvas = box.current;
    if (canvas === null) return;
    const abort = new AbortController();
    // A link would carry no key. The hash tells pictures of other meshes apart.
    ask(`/v1/objects/${object.id}/thumbnail.png`, { signal: abort.signal })
      .then(async (answer) => createImageBitmap(await answer.blob()))
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
  }, [hash, object.id]);
  return <canvas ref={box} class="picture" width="0" height="0" aria-hidden="true" />;
}
