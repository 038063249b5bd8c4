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

/** Loaded when the card comes near the window, and dropped when it is far. */
function Picture({ object, hash }: { object: ObjectInfo; hash: string }) {
  const box = useRef<HTMLDivElement>(null);
  const [near, setNear] = useState(false);
  const [url, setUrl] = useState<string>();
  useEffect(() => {
    const watch = new IntersectionObserver((entries) => setNear(entries.at(-1)?.isIntersecting ?? false), { rootMargin: MARGIN });
    if (box.current) watch.observe(box.current);
    return () => watch.disconnect();
  }, []);
  useEffect(() => {
    if (!near) return;
    const abort = new AbortController();
    let made: string | undefined;
    // A link would carry no key.
    ask(`/v1/objects/${object.id}/thumbnail.png`, { signal: abort.signal })
      .then((answer) => answer.blob())
      .then((blob) => {
        if (abort.signal.aborted) return;
        made = URL.createObjectURL(blob);
        setUrl(made);
      })
      .catch(() => {
        // A card without a picture still links to the object.
      });
    return () => {
      abort.abort();
      if (made !== undefined) URL.revokeObjectURL(made);
      setUrl(undefined);
    };
  }, [near, hash, object.id]);
  return <div ref={box} class="picture">{url && <img src={url} alt="" width="256" height="256" />}</div>;
}
