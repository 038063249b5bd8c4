// One object of the gallery, with the small picture that the server made of its mesh.
import { useEffect, useRef, useState } from "preact/hooks";
import { ask } from "../api/http";
import type { ObjectInfo } from "../api/types";
import { objectColor } from "../colors";
import { bytes, plural } from "../format";
import { link } from "../router";

/** How far outside the window pictures are kept. */
const MARGIN = "300px";

export function ObjectCard({ object }: { object: ObjectInfo }) {
  const { mesh } = object;
  return (
    <li class="card">
      {mesh ? <Picture object={object} hash={mesh.hash} /> : <div class="no-picture">no mesh</div>}
      <div class="card-text">
        <span class="key"><span class="dot" style={{ background: objectColor(object.name) }} aria-hidden="true" /><a href={link("objects", object.name)}>{object.name}</a></span>
        <span class="faint">
          {mesh ? `${mesh.format.toUpperCase()} in ${mesh.unit}, ${bytes(mesh.bytes)}` : "taught by touch"}
        </span>
        <span class="faint">{object.n_readings > 0 ? plural(object.n_readings, "training touch", "training touches") : "simulated touches"}</span>
      </div>
    </li>
  );
}

/** Drawn when the card comes near the window, and freed when it is far. A canvas keeps nothing then,
 * where the browser would keep the pixels of every image that was ever shown. */
function Picture({ object, hash }: { object: ObjectInfo; hash: string }) {
  const box = useRef<HTMLCanvasElement>(null);
  const [near, setNear] = useState(false);
  useEffect(() => {
    const watch = new IntersectionObserver((entries) => setNear(entries.at(-1)?.isIntersecting ?? false), { rootMargin: MARGIN });
    if (box.current) watch.observe(box.current);
    return () => watch.disconnect();
  }, []);
  useEffect(() => {
    const canvas = box.current;
    if (!near || canvas === null) return;
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
      delete canvas.dataset.picture;
    };
  }, [near, hash, object.id]);
  return <canvas ref={box} class="picture" width="0" height="0" aria-hidden="true" />;
}
