// A new secret, shown once, with a button that copies it.
import { useState } from "preact/hooks";
import { Dialog } from "./Dialog";

interface Props {
  /** Whose secret it is. */
  owner: string;
  secret: string;
  /** What to do with it. */
  advice: string;
  onClose: () => void;
}

export function SecretDialog({ owner, secret, advice, onClose }: Props) {
  const [copied, setCopied] = useState(false);
  const copy = () => void navigator.clipboard?.writeText(secret).then(() => setCopied(true), () => undefined);
  return (
    <Dialog title={`Secret of ${owner}`} onClose={onClose}>
      <div class="stack">
        <p class="note note-warn">This secret is shown only once. {advice}</p>
        <div class="secret">
          <code>{secret}</code>
          <button type="button" onClick={copy}>{copied ? "Copied" : "Copy"}</button>
        </div>
        <div class="form-end">
          <button type="button" class="primary" onClick={onClose}>Done</button>
        </div>
      </div>
    </Dialog>
  );
}
