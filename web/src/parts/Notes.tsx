// Placeholders of a view: empty, loading, refused.
import type { ComponentChildren } from "preact";
import type { Problem } from "../api/types";
import type { Resource } from "../api/resource";

/** The server's problem, with invalid fields and a retry button. */
export function ProblemNote({ problem, retry }: { problem: Problem; retry?: () => void }) {
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
  return (
    <div class="skeleton" role="status">
      <span class="visually-hidden">Loading {what} …</span>
      {Array.from({ length: lines }, (_, line) => (
        <div key={line} class="skeleton-line" />
      ))}
    </div>
  );
}

/** Shows a resource, or its placeholder. */
export function Show<T>(props: {
  of: Resource<T>;
  what: string;
  lines?: number;
  children: (data: T) => ComponentChildren;
}) {
  const { of: resource, what, lines, children } = props;
  return (
    <>
      {resource.problem && <ProblemNote problem={resource.problem} retry={resource.reload} />}
      {resource.data !== undefined
        ? children(resource.data)
        : !resource.problem && <Loading what={what} {...(lines === undefined ? {} : { lines })} />}
    </>
  );
}
