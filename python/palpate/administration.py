"""Operations of those who run a fleet: labels, aliases, alarms, keys, webhooks, comparisons.

They belong to `Client` and `AsyncClient` like those of `operations.py`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from palpate.documents import Job, ObjectInfo, SensorInfo, Session
from palpate.steps import (
    Document,
    Request,
    Steps,
    ask,
    ask_for_bytes,
    ask_for_nothing,
    delete,
    get,
    operation,
    pages,
    patch,
    post,
    put,
    same,
)

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from palpate.options import ComparisonOptions


def label(kind: str, thing: str, labels: dict[str, str]) -> Request:
    """The request that replaces the labels of a thing."""
    return put("v1", kind, thing, "labels").with_json({"labels": labels})


class Administration:
    """The operations of those who run a fleet."""

    @operation
    def set_session_labels(self, session: str, labels: dict[str, str]) -> Steps[Session]:
        """Replaces all labels of a session, also of an ended one."""
        return ask(label("sessions", session, labels), Session.from_wire)

    @operation
    def set_object_labels(self, object: str, labels: dict[str, str]) -> Steps[ObjectInfo]:
        """Replaces all labels of an object."""
        return ask(label("objects", object, labels), ObjectInfo.from_wire)

    @operation
    def set_sensor_labels(self, sensor: str, labels: dict[str, str]) -> Steps[SensorInfo]:
        """Replaces all labels of a sensor."""
        return ask(label("sensors", sensor, labels), SensorInfo.from_wire)

    @operation
    def set_catalogue_labels(self, catalogue: str, labels: dict[str, str]) -> Steps[Document]:
        """Replaces all labels of a catalogue."""
        return ask(label("catalogues", catalogue, labels), same)

    @operation
    def thumbnail(self, object: str) -> Steps[bytes]:
        """Returns a small picture of an object's mesh, a PNG file."""
        return ask_for_bytes(get("v1", "objects", object, "thumbnail.png"))

    @operation
    def set_alias(self, catalogue: str, alias: str, version: int) -> Steps[Document]:
        """Lets an alias, such as `candidate`, name a version; returns the catalogue."""
        request = put("v1", "catalogues", catalogue, "aliases", alias)
        return ask(request.with_json({"version": version}), same)

    @operation
    def remove_alias(self, catalogue: str, alias: str) -> Steps[None]:
        """Removes an alias; the version stays."""
        return ask_for_nothing(delete("v1", "catalogues", catalogue, "aliases", alias))

    @operation
    def start_comparison(
        self, /, version: int, catalogue: str = "default", **options: Unpack[ComparisonOptions]
    ) -> Steps[Job]:
        """Starts a comparison of a version with another one on ended sessions.

        When the job has ended, its document has the `shadow_report`.
        """
        path = ("v1", "catalogues", catalogue, "versions", str(version), "shadow")
        return ask(post(*path).with_json({**options}), Job.from_wire)

    @operation
    def fleet(self, *, needed: bool = False, limit: int = 100) -> Steps[Document]:
        """Returns the open sessions, those that need attention first; up to `limit` of them."""
        only = "true" if needed else None
        return ask(get("v1", "fleet").with_query(needed=only, limit=limit), same)

    @operation
    def acknowledge_sessions(
        self, sessions: Sequence[str], *, mute_s: int | None = None
    ) -> Steps[Document]:
        """Says that somebody has seen the alarms of sessions; `mute_s` mutes later ones."""
        document = {"sessions": list(sessions), "mute_s": mute_s}
        return ask(post("v1", "fleet", "acknowledgements").with_json(document).repeatable(), same)

    @operation
    def close_sessions(self, sessions: Sequence[str]) -> Steps[Document]:
        """Closes sessions without a truth."""
        document = {"sessions": list(sessions)}
        return ask(post("v1", "fleet", "closings").with_json(document).repeatable(), same)

    @operation
    def forwarding(self) -> Steps[Document]:
        """Returns what a cell has to forward to its central service, and the state of the line."""
        return ask(get("v1", "forwarding"), same)

    @operation
    def keys(self) -> Steps[list[Document]]:
        """Returns all API keys, without their secrets."""
        return pages(get("v1", "keys"), same)

    @operation
    def create_key(
        self, name: str, role: str, *, expires_in_s: int | None = None
    ) -> Steps[Document]:
        """Creates a key of a role; the answer's `secret` is shown only here."""
        document = {"name": name, "role": role, "expires_in_s": expires_in_s}
        return ask(post("v1", "keys").with_json(document), same)

    @operation
    def rotate_key(self, key: str, *, grace_s: int | None = None) -> Steps[Document]:
        """Gives a key another secret; the previous one stays valid for `grace_s` seconds."""
        return ask(post("v1", "keys", key, "rotate").with_json({"grace_s": grace_s}), same)

    @operation
    def revoke_key(self, key: str) -> Steps[None]:
        """Revokes a key at once."""
        return ask_for_nothing(delete("v1", "keys", key))

    @operation
    def webhooks(self) -> Steps[list[Document]]:
        """Returns all webhooks, without their secrets."""
        return pages(get("v1", "webhooks"), same)

    @operation
    def webhook(self, webhook: str) -> Steps[Document]:
        """Returns a webhook."""
        return ask(get("v1", "webhooks", webhook), same)

    @operation
    def create_webhook(
        self,
        url: str,
        events: Sequence[str],
        *,
        description: str | None = None,
        secret: str | None = None,
    ) -> Steps[Document]:
        """Creates a webhook, to which events are posted; the `secret` is shown only here."""
        document = {
            "url": url,
            "events": list(events),
            "description": description,
            "secret": secret,
        }
        return ask(post("v1", "webhooks").with_json(document), same)

    @operation
    def update_webhook(self, webhook: str, /, **changes: Any) -> Steps[Document]:
        """Changes a webhook: `url`, `events`, `description`, `enabled`."""
        return ask(patch("v1", "webhooks", webhook).with_json(changes), same)

    @operation
    def rotate_webhook_secret(
        self, webhook: str, *, secret: str | None = None, grace_s: int | None = None
    ) -> Steps[Document]:
        """Gives a webhook another secret; the previous one signs as well for `grace_s` seconds."""
        document = {"secret": secret, "grace_s": grace_s}
        return ask(post("v1", "webhooks", webhook, "rotate").with_json(document), same)

    @operation
    def delete_webhook(self, webhook: str) -> Steps[None]:
        """Deletes a webhook with its history."""
        return ask_for_nothing(delete("v1", "webhooks", webhook))

    @operation
    def test_webhook(self, webhook: str) -> Steps[Document]:
        """Sends a test message; returns its delivery with the receiver's answer."""
        return ask(post("v1", "webhooks", webhook, "test"), same)

    @operation
    def webhook_deliveries(self, webhook: str) -> Steps[list[Document]]:
        """Returns the newest deliveries to a webhook, newest event first."""
        return pages(get("v1", "webhooks", webhook, "deliveries"), same)

    @operation
    def redeliver_webhook(self, webhook: str, event: str) -> Steps[Document]:
        """Delivers an event again."""
        path = ("v1", "webhooks", webhook, "deliveries", event, "redeliver")
        return ask(post(*path), same)

    @operation
    def robots(self) -> Steps[list[Document]]:
        """Returns the robot names and the keys that hold them."""
        return pages(get("v1", "robots"), same)

    @operation
    def bind_robot(self, robot: str, key: str) -> Steps[Document]:
        """Gives a robot name to a key, given by id or name: only that key may post under it."""
        return ask(put("v1", "robots", robot).with_json({"key": key}), same)

    @operation
    def release_robot(self, robot: str) -> Steps[None]:
        """Releases a robot name: the next key that posts under it holds it."""
        return ask_for_nothing(delete("v1", "robots", robot))

    @operation
    def take_snapshot(self) -> Steps[bytes]:
        """Returns a snapshot of all data, in memory; `palpate snapshot backup` writes a file."""
        return ask_for_bytes(post("v1", "snapshots").repeatable())

    @operation
    def storage(self) -> Steps[Document]:
        """Returns the stored bytes and what would free most of them."""
        return ask(get("v1", "storage"), same)

    @operation
    def audit(self, /, **search: str) -> Steps[list[Document]]:
        """Returns the audit log, newest first: `since`, `until`, `key`, `operation`, `ring`."""
        return pages(get("v1", "audit").with_query(**search), same)
