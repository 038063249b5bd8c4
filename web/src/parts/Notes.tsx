// Placeholders of a view: empty, loading, refused.
import type { ComponentChildren } from "preact";
import { isUnanswered } from "../api/http";
import { silentSince } from "../api/pulse";
import type { Problem } from "../api/types";
import type { Resource } from "../api/resource";
import { clock } from "../format";

/** The server's problem, with invalid fields and a retry button; none if the page says already that it is silent. */
export function ProblemNote({ problem, retry }: { problem: Problem; retry?: () => void }) {
  if (isUnanswered(problem) && silentSince.value !== undefined) return null;
  const errors = (problem.errors ?? []).filter((error) => error.detail !== problem.detail);
  return (
    <div class="note note-bad" role="alert">
      <p class="note-title">
        {problem.title}
        {problem.status > 0 && <span class="faint"> · {problem.status}</span>}
      </p>
      {problem.detail && <p>{problem.detail}</p>}
      {errors.length > 0 && (
        <ul>
          {errors.map((error) => (
            <li key={error.pointer}>
              <code>{error.pointer}</code> {error.detail}
            </li>
          ))}
        </ul>
      )}
      <p class="note-foot">
        {problem.request_id && <span class="faint">request {problem.request_id}</span>}
        {retry && (
          <button type="button" class="small" onClick={retry}>
            Try again
          </button>
        )}
      </p>
    </div>
  );
}

/** An empty state, with a hint how to fill it. */
export function Empty({ title, children }: { title: string; children?: ComponentChildren }) {
  return (
    <div class="note note-empty">
      <p class="note-title">{title}</p>
      {children && <div>{children}</div>}
    </div>
  );
}

/** Placeholder lines of the final size, so that the layout does not jump. */
export function Loading({ lines = 3, what }: { lines?: number; what: string }) {
  if (silentSince.value !== undefined) return <p class="faint">No answer about {what} yet; it comes as soon as the server answers.</p>;
  return (
    <div class="skeleton" role="status">
      <span class="visually-hidden">Loading {what} …</span>
      {Array.from({ length: lines }, (_, line) => (
        <div key={line} class="skeleton-line" />
      ))}
    </div>
  );
}

/** Shows a resource, or its placeholder; what a failed request could not renew is faded and has its time. */
export function Show<T>(props: {
  of: Resource<T>;
  what: string;
  lines?: number;
  children: (data: T) => ComponentChildren;
}) {
  const { of: resource, what, lines, children } = props;
  const isOld = resource.problem !== undefined && silentSince.value === undefined;
  return (
    <>
      {resource.problem && <ProblemNote problem={resource.problem} retry={resource.reload} />}
      {resource.data === undefined ? (
        (!resource.problem || isUnanswered(resource.problem)) && <Loading what={what} {...(lines === undefined ? {} : { lines })} />
      ) : (
        <div class={isOld ? "old" : ""}>
          {isOld && <p class="faint">As of {clock(resource.at)}:</p>}
          {children(resource.data)}
        </div>
      )}
    </>
  );
}
