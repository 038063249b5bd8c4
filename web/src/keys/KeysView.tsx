// API keys and their roles; a new secret is shown once.
import { useState } from "preact/hooks";
import { getAll, sendJson } from "../api/http";
import { useResource } from "../api/resource";
import type { ApiKey, NewApiKey, Role } from "../api/types";
import { when } from "../format";
import { Dialog } from "../parts/Dialog";
import { Empty, ProblemNote, Show } from "../parts/Notes";
import { Badge, Panel, ViewHead } from "../parts/Panel";
import { SecretDialog } from "../parts/SecretDialog";
import { Table } from "../parts/Table";
import { useAction } from "../parts/useAction";
import { who } from "../signin";

const ROLES: [Role, string][] = [
  ["robot", "touch: sessions and readings"],
  ["trainer", "train: objects, sensors, trainings"],
  ["viewer", "read only"],
  ["admin", "everything, including keys"],
];

export function KeysView() {
  const keys = useResource("keys", (signal) => getAll<ApiKey>("/v1/keys", 5000, signal));
  const [creating, setCreating] = useState(false);
  const [secret, setSecret] = useState<NewApiKey>();
  const action = useAction();
  const isOpen = who.value !== undefined && !who.value.keys_required;
  const done = (made: NewApiKey) => {
    setSecret(made);
    setCreating(false);
    keys.reload();
  };
  const rotate = (key: ApiKey) =>
    confirm(`Give ${key.name} a new secret? The present one is valid for another hour.`) && action.run(async () => done(await sendJson<NewApiKey>("POST", `/v1/keys/${key.id}/rotate`, { grace_s: 3600 })));
  const revoke = (key: ApiKey) => {
    if (!confirm(`Revoke ${key.name}? Its requests will be refused at once.`)) return;
    action.run(async () => {
      await sendJson("DELETE", `/v1/keys/${key.id}`);
      keys.reload();
    });
  };
  return (
    <>
      <ViewHead title="Keys" sub={isOpen ? "The server requires keys from its next start" : "API keys and their roles"}>
        <button type="button" class="primary" onClick={() => setCreating(true)}>
          New key …
        </button>
      </ViewHead>
      {action.problem && <ProblemNote problem={action.problem} />}
      <Show of={keys} what="the keys" lines={4}>
        {(found) =>
          found.length === 0 ? (
            <Empty title="No keys">
              <p>This server is open to everybody on its own machine. Once a key exists, it requires keys from its next start: create an admin key first.</p>
            </Empty>
          ) : (
            <Panel title="All keys">
              <Table label="Keys" columns={["Name", "Role", "State", "Last used", "Created", ["Actions", "hidden"]]}>
                {found.map((key) => (
                  <tr key={key.id}>
                    <th scope="row">{key.name}</th>
                    <td>{key.role}</td>
                    <td><State of={key} /></td>
                    <td class="num-left">{when(key.last_used_at)}</td>
                    <td class="num-left">{when(key.created_at)}</td>
                    <td class="row-end">
                      {key.active && (
                        <>
                          <button type="button" class="small" disabled={action.busy} aria-label={`Rotate ${key.name}`} onClick={() => rotate(key)}>Rotate</button>
                          <button type="button" class="small danger" disabled={action.busy} aria-label={`Revoke ${key.name}`} onClick={() => revoke(key)}>Revoke</button>
                        </>
                      )}
                    </td>
                  </tr>
                ))}
              </Table>
            </Panel>
          )
        }
      </Show>
      {creating && <CreateDialog isFirst={isOpen} onMade={done} onClose={() => setCreating(false)} />}
      {secret && <SecretDialog owner={secret.key.name} secret={secret.secret} advice="Store it now." onClose={() => setSecret(undefined)} />}
    </>
  );
}

function State({ of: key }: { of: ApiKey }) {
  if (key.revoked_at) return <Badge kind="bad">revoked {when(key.revoked_at)}</Badge>;
  if (!key.active) return <Badge kind="warn">expired {when(key.expires_at)}</Badge>;
  return (
    <>
      <Badge kind="good">active</Badge>
      {key.expires_at && <span class="faint"> until {when(key.expires_at)}</span>}
      {key.rotating_until && <span class="faint"> old secret until {when(key.rotating_until)}</span>}
    </>
  );
}

function CreateDialog(props: { isFirst: boolean; onMade: (made: NewApiKey) => void; onClose: () => void }) {
  const [name, setName] = useState("");
  const [role, setRole] = useState<Role>(props.isFirst ? "admin" : "robot");
  const [days, setDays] = useState("");
  const action = useAction();
  const submit = (event: Event) => {
    event.preventDefault();
    const expires = days === "" ? {} : { expires_in_s: Math.round(Number(days) * 86_400) };
    action.run(async () => props.onMade(await sendJson<NewApiKey>("POST", "/v1/keys", { name, role, ...expires })));
  };
  return (
    <Dialog title="New key" onClose={props.onClose}>
      <form onSubmit={submit}>
        {props.isFirst && <p class="note note-warn">From its next start the server requires keys, also for this page. Create an admin key first and keep it.</p>}
        <div class="field">
          <label for="key-name">Name</label>
          <input id="key-name" type="text" required maxlength={64} value={name} placeholder="arm-3" onInput={(event) => setName(event.currentTarget.value)} />
        </div>
        <fieldset>
          <legend>Role</legend>
          {ROLES.map(([one, words]) => (
            <label key={one}>
              <input type="radio" name="role" checked={role === one} onChange={() => setRole(one)} />
              <span><b>{one}</b> <span class="faint">{words}</span></span>
            </label>
          ))}
        </fieldset>
        <div class="field">
          <label for="key-days">Expires after (days)</label>
          <input id="key-days" type="number" min={1} max={3650} value={days} placeholder="never" onInput={(event) => setDays(event.currentTarget.value)} />
        </div>
        {action.problem && <ProblemNote problem={action.problem} />}
        <div class="form-end">
          <button type="submit" class="primary" disabled={action.busy}>Create key</button>
        </div>
      </form>
    </Dialog>
  );
}
