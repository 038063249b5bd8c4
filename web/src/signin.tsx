// Sign-in with an API key, which stays in this tab.
import { signal } from "@preact/signals";
import { useEffect, useState } from "preact/hooks";
import { apiKey, ask, authorization, getJson, keepKey, keyWanted } from "./api/http";
import type { Whoami } from "./api/types";
import { ProblemNote } from "./parts/Notes";
import { useAction } from "./parts/useAction";

/** The signed-in key and role; undefined while unknown. */
export const who = signal<Whoami | undefined>(undefined);

/** Whether the user has one of these roles, as far as known. */
export function may(...roles: Whoami["role"][]): boolean {
  return who.value === undefined || roles.includes(who.value.role);
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
  const key = apiKey.value;
  useEffect(() => {
    getJson<Whoami>("/v1/whoami").then(
      (found) => {
        who.value = found;
      },
      () => {
        who.value = undefined;
      },
    );
  }, [key, keyWanted.value]);
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
