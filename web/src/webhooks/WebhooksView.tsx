// Webhooks: receivers of signed events; a new secret is shown once.
import { useState } from "preact/hooks";
import { getAll, sendJson } from "../api/http";
import { useResource } from "../api/resource";
import type { NewWebhook, Webhook, WebhookDelivery, WebhookEventType } from "../api/types";
import { when } from "../format";
import { Dialog } from "../parts/Dialog";
import { Empty, ProblemNote, Show } from "../parts/Notes";
import { Badge, Panel, ViewHead } from "../parts/Panel";
import { SecretDialog } from "../parts/SecretDialog";
import { Table } from "../parts/Table";
import { useAction } from "../parts/useAction";
import { link } from "../router";
import { EVENTS, hostOf, lastAnswer, webhookState } from "./words";

export function WebhooksView() {
  const webhooks = useResource("webhooks", (signal) => getAll<Webhook>("/v1/webhooks", 1000, signal));
  const [creating, setCreating] = useState(false);
  const [secret, setSecret] = useState<NewWebhook>();
  const done = (made: NewWebhook) => {
    setSecret(made);
    setCreating(false);
    webhooks.reload();
  };
  return (
    <>
      <ViewHead title="Webhooks" sub="Signed events for other programs">
        <button type="button" class="primary" onClick={() => setCreating(true)}>
          New webhook …
        </button>
      </ViewHead>
      <Show of={webhooks} what="the webhooks" lines={4}>
        {(found) =>
          found.length === 0 ? (
            <Empty title="No webhooks">
              <p>The server posts events to the URLs of webhooks: decisions of sessions, sessions that need somebody, ended trainings, snapshots.</p>
            </Empty>
          ) : (
            <Panel title="All webhooks">
              <Table label="Webhooks" columns={["Receiver", "Events", "State", "Waiting", "Last delivered", ["Actions", "hidden"]]}>
                {found.map((webhook) => (
                  <Row key={webhook.id} webhook={webhook} onChanged={webhooks.reload} onSecret={done} />
                ))}
              </Table>
            </Panel>
          )
        }
      </Show>
      {creating && <CreateDialog onMade={done} onClose={() => setCreating(false)} />}
      {secret && (
        <SecretDialog owner={hostOf(secret.webhook.url)} secret={secret.secret} onClose={() => setSecret(undefined)}
          advice="The receiver verifies signatures with it, as Standard Webhooks describes." />
      )}
    </>
  );
}

function Row(props: { webhook: Webhook; onChanged: () => void; onSecret: (made: NewWebhook) => void }) {
  const { webhook } = props;
  const path = `/v1/webhooks/${webhook.id}`;
  const [tested, setTested] = useState<WebhookDelivery>();
  const action = useAction();
  const [kind, words] = webhookState(webhook);
  const host = hostOf(webhook.url);
  const test = () =>
    action.run(async () => {
      setTested(await sendJson<WebhookDelivery>("POST", `${path}/test`));
      props.onChanged();
    });
  const change = (work: () => Promise<unknown>) =>
    action.run(async () => {
      await work();
      props.onChanged();
    });
  const remove = () => {
    if (!confirm(`Delete the webhook to ${host} with its history?`)) return;
    change(() => sendJson("DELETE", path));
  };
  const rotate = () => {
    if (!confirm(`Give the webhook to ${host} a new secret? The present one signs for another hour.`)) return;
    action.run(async () => props.onSecret(await sendJson<NewWebhook>("POST", `${path}/rotate`, { grace_s: 3600 })));
  };
  const toggle = () => change(() => sendJson("PATCH", path, { enabled: !webhook.enabled }));
  return (
    <>
      <tr>
        <th scope="row">
          <a href={link("webhooks", webhook.id)}>{host}</a>
          {webhook.description && <div class="faint">{webhook.description}</div>}
        </th>
        <td>{webhook.events.join(", ")}</td>
        <td><Badge kind={kind}>{words}</Badge></td>
        <td class="num">{webhook.n_waiting}</td>
        <td class="num-left">{when(webhook.last_delivered_at)}</td>
        <td class="row-end">
          <button type="button" class="small" disabled={action.busy || !webhook.enabled} aria-label={`Test ${host}`} onClick={test}>Test</button>
          <button type="button" class="small" disabled={action.busy} aria-label={`${webhook.enabled ? "Disable" : "Enable"} ${host}`} onClick={toggle}>
            {webhook.enabled ? "Disable" : "Enable"}
          </button>
          <button type="button" class="small" disabled={action.busy} aria-label={`Rotate the secret of ${host}`} onClick={rotate}>Rotate</button>
          <button type="button" class="small danger" disabled={action.busy} aria-label={`Delete ${host}`} onClick={remove}>Delete</button>
        </td>
      </tr>
      {(action.problem || tested) && (
        <tr>
          <td colSpan={6}>
            {action.problem && <ProblemNote problem={action.problem} />}
            {tested && (
              <p role="status">
                <Badge kind={tested.state === "delivered" ? "good" : "bad"}>test {tested.state}</Badge> {lastAnswer(tested)}
              </p>
            )}
          </td>
        </tr>
      )}
    </>
  );
}

function CreateDialog(props: { onMade: (made: NewWebhook) => void; onClose: () => void }) {
  const [url, setUrl] = useState("");
  const [description, setDescription] = useState("");
  const [events, setEvents] = useState<WebhookEventType[]>(["session.decided", "session.unknown"]);
  const action = useAction();
  const toggle = (event: WebhookEventType, on: boolean) => setEvents(on ? [...events, event] : events.filter((one) => one !== event));
  const submit = (event: Event) => {
    event.preventDefault();
    action.run(async () => props.onMade(await sendJson<NewWebhook>("POST", "/v1/webhooks", { url, events, description })));
  };
  return (
    <Dialog title="New webhook" onClose={props.onClose}>
      <form onSubmit={submit}>
        <div class="field">
          <label for="webhook-url">URL</label>
          <input id="webhook-url" type="text" inputMode="url" required maxlength={2048} value={url} placeholder="https://mes.example/touch" onInput={(event) => setUrl(event.currentTarget.value)} />
        </div>
        <div class="field">
          <label for="webhook-description">Description</label>
          <input id="webhook-description" type="text" maxlength={200} value={description} placeholder="line 3, night shift" onInput={(event) => setDescription(event.currentTarget.value)} />
        </div>
        <fieldset>
          <legend>Events</legend>
          {EVENTS.map(([one, words]) => (
            <label key={one}>
              <input type="checkbox" checked={events.includes(one)} onChange={(event) => toggle(one, event.currentTarget.checked)} />
              <span><b>{one}</b> <span class="faint">{words}</span></span>
            </label>
          ))}
        </fieldset>
        {action.problem && <ProblemNote problem={action.problem} />}
        <div class="form-end">
          <button type="submit" class="primary" disabled={action.busy || events.length === 0}>Create webhook</button>
        </div>
      </form>
    </Dialog>
  );
}
