// Notifications of the browser when a session begins to need attention, if the user wants them.
import { signal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import { shortId } from "../format";
import { go } from "../router";
import type { Watched } from "./watch";

const STORED = "palpate.notify";

/** Whether the browser can notify at all; pages without TLS on other hosts cannot. */
export const canNotify = "Notification" in globalThis && globalThis.isSecureContext;

/** Whether the user wants notifications in this tab and the browser permits them. */
export const notifying = signal(canNotify && Notification.permission === "granted" && sessionStorage.getItem(STORED) === "yes");

/** Asks the browser for permission, or ends the notifications. */
export async function toggleNotifying(): Promise<void> {
  const wanted = !notifying.value && (await Notification.requestPermission()) === "granted";
  notifying.value = wanted;
  sessionStorage.setItem(STORED, wanted ? "yes" : "no");
}

/** Notifies once for each alarm that comes while the page is open. */
export function useNotifications(sessions: Watched[]): void {
  const known = useRef<Set<string> | undefined>(undefined);
  useEffect(() => {
    const alarms = sessions.filter(({ info }) => info.attention.is_needed);
    const keys = alarms.map(({ info }) => `${info.session.id} ${info.attention.since}`);
    const before = known.current;
    known.current = new Set([...(before ?? []), ...keys]);
    // Those of the first look are no news.
    if (before === undefined || !notifying.value) return;
    alarms.forEach(({ info }, i) => {
      if (before.has(keys[i]!)) return;
      const robots = (info.session.touched_by ?? []).join(", ") || `Session ${shortId(info.session.id)}`;
      const shown = new Notification(`${robots} needs attention`, { body: info.attention.reason, tag: info.session.id });
      shown.onclick = () => {
        window.focus();
        go("sessions", info.session.id);
      };
    });
  }, [sessions]);
}
