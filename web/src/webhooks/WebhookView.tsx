// One webhook: its settings, and the history of deliveries with their attempts and bodies.
import { getAll, getJson, sendJson } from "../api/http";
import { useResource } from "../api/resource";
import type { Webhook, WebhookDelivery } from "../api/types";
import { when } from "../format";
import { Empty, ProblemNote, Show } from "../parts/Notes";
import { Badge, Facts, Panel, ViewHead } from "../parts/Panel";
import { Table } from "../parts/Table";
import { useAction } from "../parts/useAction";
import { link, useChoice } from "../router";
import { answerOf, deliveryState, hostOf, lastAnswer, pretty, webhookState } from "./words";

/** As many as the server keeps. */
const DELIVERIES_MAX = 200;

export function WebhookView({ id }: { id: string }) {
  const path = `/v1/webhooks/${encodeURIComponent(id)}`;
  const webhook = useResource(path, (signal) => getJson<Webhook>(path, signal));
  const history = useResource(`${path}/deliveries`, (signal) => getAll<WebhookDelivery>(`${path}/deliveries`, DELIVERIES_MAX, signal));
  const reload = () => {
    webhook.reload();
    history.reload();
  };
  const host = webhook.data ? hostOf(webhook.data.url) : "Webhook";
  return (
    <>
      <ViewHead title={host} sub={<a href={link("webhooks")}>All webhooks</a>}>
        <button type="button" onClick={reload}>Reload</button>
      </ViewHead>
      <Show of={webhook} what="the webhook" lines={4}>
        {(found) => {
          const [kind, words] = webhookState(found);
          return (
            <Panel title="Settings" aside={<Badge kind={kind}>{words}</Badge>}>
              <Facts
                isWide
                of={[
                  ["URL", found.url],
                  ["Events", found.events.join(", ")],
                  ["Waiting", String(found.n_waiting)],
                  ["Last delivered", when(found.last_delivered_at)],
                  ["Created", when(found.created_at)],
                  ["Description", found.description || "none"],
                ]}
              />
            </Panel>
          );
        }}
      </Show>
      <Panel title="Deliveries" aside={`the newest ${DELIVERIES_MAX}`}>
        <Show of={history} what="the deliveries" lines={6}>
          {(found) =>
            found.length === 0 ? (
              <Empty title="None yet">
                <p>A test message shows whether the receiver is reached: <a href={link("webhooks")}>Test</a>.</p>
              </Empty>
            ) : (
              <Table label="Deliveries" columns={["When", "Event", "State", "Last answer", ["Actions", "hidden"]]}>
                {found.map((delivery) => (
                  <Delivery key={delivery.id} path={path} delivery={delivery} onChanged={reload} />
                ))}
              </Table>
            )
          }
        </Show>
      </Panel>
    </>
  );
}

function Delivery({ path, delivery, onChanged }: { path: string; delivery: WebhookDelivery; onChanged: () => void }) {
  const [shown, show] = useChoice("delivery");
  const isOpen = shown === delivery.id;
  const setOpen = (open: boolean) => show(open ? delivery.id : "");
  const action = useAction();
  const [kind, words] = deliveryState(delivery);
  const name = `${delivery.type} of ${when(delivery.created_at)}`;
  const again = () =>
    action.run(async () => {
      await sendJson("POST", `${path}/deliveries/${delivery.id}/redeliver`);
      onChanged();
    });
  return (
    <>
      <tr>
        <th scope="row" class="num-left">{when(delivery.created_at)}</th>
        <td>{delivery.type}</td>
        <td><Badge kind={kind}>{words}</Badge></td>
        <td>{lastAnswer(delivery)}</td>
        <td class="row-end">
          <button type="button" class="small" aria-expanded={isOpen} aria-label={`Details of ${name}`} onClick={() => setOpen(!isOpen)}>
            Details
          </button>
          <button type="button" class="small" disabled={action.busy} aria-label={`Deliver again: ${name}`} onClick={again}>
            Deliver again
          </button>
        </td>
      </tr>
      {(isOpen || action.problem) && (
        <tr>
          <td colSpan={5}>
            {action.problem && <ProblemNote problem={action.problem} />}
            {isOpen && (
              <div class="stack">
                <p class="faint">event {delivery.id}</p>
                <ol>
                  {delivery.attempts.map((attempt) => (
                    <li key={attempt.at}>
                      {when(attempt.at)}: {answerOf(attempt)}
                    </li>
                  ))}
                </ol>
                <pre class="wrap">{pretty(delivery.body)}</pre>
              </div>
            )}
          </td>
        </tr>
      )}
    </>
  );
}
