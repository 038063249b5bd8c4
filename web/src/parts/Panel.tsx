// A titled panel, and the head of a view with its actions.
import type { ComponentChildren } from "preact";
import { useEffect, useId, useRef } from "preact/hooks";
import { silentSince } from "../api/pulse";
import { age, now } from "../format";

export function Panel(props: {
  title: string;
  aside?: ComponentChildren;
  class?: string;
  children: ComponentChildren;
}) {
  const id = useId();
  return (
    <section class={`panel ${props.class ?? ""}`} aria-labelledby={id}>
      <header class="panel-head">
        <h2 id={id}>{props.title}</h2>
        {props.aside && <div class="panel-aside">{props.aside}</div>}
      </header>
      {props.children}
    </section>
  );
}

/** The heading of a view, which is the title of the tab as well. */
export function ViewHead(props: {
  title: ComponentChildren;
  /** What stands before the heading in the tab's title. */
  tab?: string;
  sub?: ComponentChildren;
  children?: ComponentChildren;
}) {
  const head = useRef<HTMLHeadingElement>(null);
  const isOld = silentSince.value !== undefined;
  // With every drawing, since the heading may be made of more than text.
  useEffect(() => {
    document.title = `${isOld ? "(no answer) " : (props.tab ?? "")}${head.current?.textContent?.trim() ?? ""} · Palpate`;
  });
  return (
    <div class="view-head">
      <div>
        <h1 ref={head} tabIndex={-1}>{props.title}</h1>
        {props.sub && <p class="sub">{props.sub}</p>}
      </div>
      {props.children && <div class="actions">{props.children}</div>}
    </div>
  );
}

/** Facts in two columns: name and value. */
export function Facts({ of: facts, isWide = false }: { of: [string, ComponentChildren][]; isWide?: boolean }) {
  return (
    <dl class={isWide ? "facts facts-wide" : "facts"}>
      {facts.map(([name, value]) => (
        <div key={name}>
          <dt>{name}</dt>
          <dd>{value}</dd>
        </div>
      ))}
    </dl>
  );
}

/** A word on a coloured ground; the colour repeats the word's meaning. While the server is silent a state has its
 * age. A state that is past has no age. */
export function Badge({ kind, isPast = kind === "label", children }: { kind: string; isPast?: boolean; children: ComponentChildren }) {
  const since = isPast ? undefined : silentSince.value;
  return <span class={`badge badge-${kind}${isPast ? " badge-past" : ""}`}>{children}{since !== undefined && `, ${age(now.value - since)} ago`}</span>;
}
