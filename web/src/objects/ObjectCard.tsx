// One object of the gallery, with a picture of its mesh drawn when it scrolls into view.
import { useEffect, useRef, useState } from "preact/hooks";
import type { ObjectInfo } from "../api/types";
import { objectColor } from "../colors";
import { bytes, dark, plural } from "../format";
import { link } from "../router";
import { loadScene } from "../scene/load";
import { meshOf } from "../session/shapes";

/** Larger meshes have no picture in the gallery. */
const PICTURE_BYTES_MAX = 12e6;

export function ObjectCard({ object }: { object: ObjectInfo }) {
  const { mesh } = object;
  return (
    <li class="card">
      {mesh && mesh.bytes <= PICTURE_BYTES_MAX ? <Picture object={object} /> : <div class="no-picture">{mesh ? "large mesh" : "no mesh"}</div>}
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

function Picture({ object }: { object: ObjectInfo }) {
  const canvas = useRef<HTMLCanvasElement>(null);
  const [seen, setSeen] = useState(false);
  const isDark = dark.value;
  useEffect(() => {
    const watch = new IntersectionObserver((entries) => {
      if (entries.some((entry) => entry.isIntersecting)) setSeen(true);
    });
    if (canvas.current) watch.observe(canvas.current);
    return () => watch.disconnect();
  }, []);
  // biome-ignore lint/correctness/useExhaustiveDependencies: another list of the same objects draws nothing anew
  useEffect(() => {
    if (!seen) return;
    let gone = false;
    const draw = async () => {
      const shape = await meshOf(object, [0, 0, 0], `picture/${object.mesh!.hash}/${object.mesh!.unit}`);
      const { picture } = await loadScene();
      if (!gone && canvas.current) picture(shape, canvas.current);
    };
    draw().catch(() => {
      // A card without a picture still links to the object.
    });
    return () => {
      gone = true;
    };
  }, [seen, isDark, object.mesh?.hash]);
  return <canvas ref={canvas} width="480" height="360" aria-hidden="true" />;
}
