// Sign-in with an API key, which stays in this tab.
import { signal } from "@preact/signals";
import { useEffect, useState } from "preact/hooks";
import { apiKey, ask, authorization, getJson, keepKey, keyWanted } from "./api/http";
import { useResource } from "./api/resource";
import type { Role, Whoami } from "./api/types";
import { Empty, ProblemNote } from "./parts/Notes";
import { ViewHead } from "./parts/Panel";
import { useAction } from "./parts/useAction";

/** The signed-in key and role; undefined while unknown. */
export const who = signal<Whoami | undefined>(undefined);

/** Whether the server has been asked who the user is, and has answered or was away. */
export const whoAsked = signal(false);

/** Whether the user has one of these roles; false while unknown. */
export function may(...roles: Whoami["role"][]): boolean {
  return who.value !== undefined && roles.includes(who.value.role);
}

/** Whether the key's role may open a view, according to the server's table of roles. */
export function maySee(view: string): boolean {
  return rolesOf(view).length === ALL.length || may(...rolesOf(view));
}

/** Roles that may open a view. */
export function rolesOf(view: string): Role[] {
  return VIEW_ROLES[view] ?? ALL;
}

const ALL: Role[] = ["robot", "trainer", "viewer", "admin"];
const LOOKING: Role[] = ["trainer", "viewer", "admin"];
const VIEW_ROLES: Record<string, Role[]> = {
  fleet: LOOKING,
  objects: LOOKING,
  jobs: LOOKING,
  health: LOOKING,
  keys: ["admin"],
  audit: ["admin"],
  snapshots: ["admin"],
  webhooks: ["admin"],
};

/** The note in place of a view that the key's role may not open. */
export function NotPermitted({ view, name }: { view: string; name: string }) {
  const roles = rolesOf(view);
  const needed = roles.length === 1 ? roles[0] : `${roles.slice(0, -1).join(", ")} or ${roles.at(-1)}`;
  return (
    <>
      <ViewHead title={name} />
      <Empty title={`Needs the role ${needed}`}>
        <p>This key has the role {who.value?.role}. Sign out to use another key.</p>
      </Empty>
    </>
  );
}

export function SignIn() {
  const [key, setKey] = useState("");
  const action = useAction();
  const submit = (event: Event) => {
    event.preventDefault();
    action.run(async () => {
      const given = key.trim();
      // Verified before it is stored.
      const headers = authorization(given);
      const answer = await ask("/v1/whoami", { headers });
      who.value = (await answer.json()) as Whoami;
      keepKey(given);
    });
  };
  return (
    <div class="signin">
      <h1 tabIndex={-1}>Sign in</h1>
      <p class="sub">This server requires an API key. The key stays in this tab.</p>
      <form onSubmit={submit}>
        <label for="key">API key</label>
        <input
          id="key"
          type="password"
          autocomplete="off"
          spellcheck={false}
          placeholder="palpate_…"
          required
          value={key}
          onInput={(event) => setKey(event.currentTarget.value)}
        />
        <button type="submit" class="primary" disabled={action.busy}>
          Sign in
        </button>
      </form>
      {action.problem && <ProblemNote problem={action.problem} />}
    </div>
  );
}

/** The signed-in user, and sign-out. */
export function Who() {
  const asked = useResource(keyWanted.value ? null : `whoami ${apiKey.value}`, (signal) => getJson<Whoami>("/v1/whoami", signal));
  useEffect(() => {
    if (asked.data !== undefined) who.value = asked.data;
    if (asked.data !== undefined || asked.problem !== undefined) whoAsked.value = true;
  }, [asked.data, asked.problem]);
  const found = who.value;
  if (keyWanted.value || found === undefined || !found.keys_required) return null;
  return (
    <span class="who">
      <span class="faint" title={`role: ${found.role}`}>
        {found.key?.name ?? found.role} · {found.role}
      </span>
      <button type="button" class="small" onClick={signOut}>
        Sign out
      </button>
    </span>
  );
}

function signOut(): void {
  keepKey("");
  who.value = undefined;
  keyWanted.value = true;
}
