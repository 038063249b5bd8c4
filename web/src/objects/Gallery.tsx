// The cards of all objects: a search, and of thousands only those near the window as elements.
import { useLayoutEffect, useMemo, useRef, useState } from "preact/hooks";
import type { CatalogueVersion, ObjectInfo } from "../api/types";
import { count, plural } from "../format";
import { versionName } from "../models/current";
import { useChoice } from "../router";
import { ObjectCard } from "./ObjectCard";
import { matches, nearWindow, type Near } from "./window";

/** From this number of objects on a search is worth its place. */
const SEARCH_FROM = 12;
/** Cards drawn before their size is known. */
const FIRST = 24;

export function Gallery({ objects, versions }: { objects: ObjectInfo[]; versions: CatalogueVersion[] | undefined }) {
  const [search, setSearch] = useChoice("search");
  const known = useMemo(() => versions && namesOf(versions), [versions]);
  const found = objects.filter((object) => matches(textOf(object), search));
  return (
    <>
      {objects.length >= SEARCH_FROM && (
        <div class="gallery-head">
          <input type="search" aria-label="Search objects" placeholder="Search names and labels" value={search}
            onInput={(event) => setSearch(event.currentTarget.value)} />
          <span class="faint" aria-live="polite">{search.trim() !== "" && `${count(found.length)} of ${plural(objects.length, "object")}`}</span>
        </div>
      )}
      {found.length === 0 ? <p class="faint">No object has such a name or label.</p> : <Cards objects={found} known={known} />}
    </>
  );
}

/** What a search looks into. */
function textOf({ name, labels }: ObjectInfo): string {
  return [name, ...Object.entries(labels ?? {}).map(([key, value]) => `${key}=${value}`)].join(" ");
}

/** The current versions that know each object, by its id. */
function namesOf(versions: CatalogueVersion[]): Map<string, string> {
  const names = new Map<string, string>();
  for (const version of versions) {
    for (const { id } of version.report.objects) names.set(id, [names.get(id), versionName(version)].filter(Boolean).join(", "));
  }
  return names;
}

function Cards({ objects, known }: { objects: ObjectInfo[]; known: Map<string, string> | undefined }) {
  const list = useRef<HTMLUListElement>(null);
  const total = objects.length;
  const [near, setNear] = useState<Near>({ from: 0, to: FIRST, abovePx: 0, belowPx: 0 });
  useLayoutEffect(() => {
    let frame = 0;
    const place = () => {
      frame = 0;
      const card = list.current?.querySelector(".card");
      if (!list.current || !card) return;
      const style = getComputedStyle(list.current);
      const next = nearWindow({
        count: total,
        columns: style.gridTemplateColumns.split(" ").length,
        rowPx: card.getBoundingClientRect().height + Number.parseFloat(style.rowGap),
        topPx: list.current.getBoundingClientRect().top,
        windowPx: innerHeight,
      });
      setNear((now) => (now.from === next.from && now.to === next.to && now.belowPx === next.belowPx ? now : next));
    };
    const soon = () => {
      frame ||= requestAnimationFrame(place);
    };
    place();
    addEventListener("scroll", soon, { passive: true });
    // The window, or what stands above the list, has another size.
    const sizes = new ResizeObserver(soon);
    sizes.observe(document.body);
    return () => {
      removeEventListener("scroll", soon);
      sizes.disconnect();
      cancelAnimationFrame(frame);
    };
  }, [total]);
  return (
    <ul class="gallery" ref={list} style={{ paddingTop: `${near.abovePx}px`, paddingBottom: `${near.belowPx}px` }}>
      {objects.slice(near.from, near.to).map((object, index) => (
        <ObjectCard key={object.id} object={object} known={known && (known.get(object.id) ?? "in no current version")} place={near.from + index + 1} of={total} />
      ))}
    </ul>
  );
}
