// The pages of the dashboard by their addresses. `app.tsx` shows a view for each, and `web/test/away.mjs` visits each.

export const ROUTES = [
  "fleet",
  "sessions",
  "sessions/:id",
  "sessions/:id/at/:revision",
  "compare/:id/:id",
  "objects",
  "objects/:name",
  "models",
  "models/:catalogue/:version",
  "jobs",
  "jobs/:id",
  "sensors",
  "sensors/:name",
  "keys",
  "audit",
  "snapshots",
  "webhooks",
  "webhooks/:id",
  "health",
] as const;

export type Route = (typeof ROUTES)[number];

/** The route of an address, and its parameters; undefined if there is no such page. */
export function matched(parts: string[]): { name: Route; params: string[] } | undefined {
  const asked = parts.length === 0 ? ["fleet"] : parts;
  for (const name of ROUTES) {
    const pattern = name.split("/");
    if (pattern.length !== asked.length) continue;
    if (!pattern.every((part, i) => part.startsWith(":") || part === asked[i])) continue;
    return { name, params: asked.filter((_, i) => pattern[i]!.startsWith(":")) };
  }
  return undefined;
}
