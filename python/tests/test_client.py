"""The client against a real server: sessions, errors, events, both transports."""

from __future__ import annotations

import asyncio
import signal
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from conftest import Server

import palpate
import palpate.steps
from palpate import (
    AsyncClient,
    BeliefEvent,
    Client,
    ClosedEvent,
    DeletedEvent,
    Readings,
    RetryPolicy,
)
from palpate.local import Mesh

SENSOR = "digitacts-6x6"
UNIT = np.eye(4)


def test_a_touch_session_recognises_and_reports_the_truth(
    client: Client, trained: str, felt: Readings
) -> None:
    with client.touch_session(
        "arm", sensor=SENSOR, catalogue=trained, frame_id="base_link", risk=0.05
    ) as session:
        for pose, image in zip(felt.poses, felt.images, strict=True):
            belief = session.touch(image.reshape(6, 6), palpate.Pose.of(pose))
        assert belief.best == "mug-client" and belief.n_readings == len(felt)
        assert belief.stop is not None and belief.stop.risk == 0.05
        ranked = session.next_touches(recenters=True, n=3, deadline_ms=2000)
        assert len(ranked.touches) == 3
        assert ranked.touches[0].pose.matrix.shape == (4, 4)
        candidates = [(one.pose, one.reach_m) for one in ranked.touches]
        again = session.next_touches(candidates=candidates, costs=[1.0, 2.0, 3.0])
        assert {one.candidate for one in again.touches} == {0, 1, 2}
        felt_again = session.feel(felt.poses[0, :3], 0.002)
        assert felt_again.n_readings == len(felt) + 1
        judged = session.close(truth="mug-client").truth
    assert judged is not None and judged.was_right and judged.name == "mug-client"
    assert client.session(session.id).state == "closed"


def test_a_session_is_closed_when_its_block_fails(client: Client, trained: str) -> None:
    with (
        pytest.raises(RuntimeError, match="arm is stuck"),
        client.touch_session("arm", catalogue=trained) as session,
    ):
        raise RuntimeError("arm is stuck")
    assert client.session(session.id).state == "closed"
    with pytest.raises(palpate.SessionEndedError) as ended:
        client.extend_session(session.id, 60)
    assert ended.value.kind == "session-ended"


def test_an_error_names_the_field(client: Client, trained: str) -> None:
    with client.touch_session("arm", sensor=SENSOR, catalogue=trained) as session:
        with pytest.raises(palpate.InvalidValueError, match="expected 36") as refused:
            session.touch(np.zeros(35), UNIT)
        assert refused.value.field == "/readings/0/image"
        assert isinstance(refused.value, ValueError) and refused.value.request_id
        with pytest.raises(ValueError, match="orientation: has length 0"):
            session.touch(np.zeros(36), [0, 0, 0, 0, 0, 0, 0])
        # Refused readings took no number: the next one is the first.
        assert session.touch(np.zeros(36), UNIT).n_readings == 1
    with pytest.raises(palpate.NotFoundError, match="cup") as missing:
        client.object("cup")
    assert isinstance(missing.value, LookupError)
    with pytest.raises(palpate.ConflictError):
        client.create_object("mug-client")
    with pytest.raises(palpate.InvalidValueError) as unknown:
        client.create_session(metod="surface")  # type: ignore[call-arg]
    assert "metod" in str(unknown.value)
    with pytest.raises(ValueError, match="NaN"):
        client.create_session(risk=float("nan"))


def test_a_training_that_fails_says_why(client: Client) -> None:
    client.create_object("untouched")
    air = Readings.of([UNIT] * 30, np.zeros((30, 36)))
    client.add_training_readings("untouched", SENSOR, air)
    with pytest.raises(palpate.JobFailedError, match="untouched") as failed:
        client.train("air", objects=["untouched"], sva=False, surface=True)
    assert failed.value.job.state == "failed"


def test_repeated_readings_count_once(client: Client, trained: str, felt: Readings) -> None:
    session = client.create_session(catalogue=trained)
    first = client.add_readings(session.id, SENSOR, felt, robot="arm")
    again = client.add_readings(session.id, SENSOR, felt, robot="arm")
    assert (first.n_new, again.n_new, again.n_repeated) == (12, 0, 12)
    more = client.add_readings(session.id, SENSOR, felt[:2], robot="arm", first_seq=12)
    assert more.n_readings == 14


def test_objects_and_sensors_are_listed_and_changed(client: Client, tmp_path: Path) -> None:
    mesh = Mesh.example("hammer")
    client.create_object("tool", description="of steel")
    (tmp_path / "tool.off").write_bytes(mesh.to_off())
    report = client.put_mesh("tool", tmp_path / "tool.off", unit="m")
    assert report["n_triangles"] == len(mesh.faces)
    assert client.mesh("tool") == mesh.to_off()
    with pytest.raises(ValueError, match="off does not record it"):
        client.put_mesh("tool", tmp_path / "tool.off")
    assert client.update_object("tool", name="tool-2").description == "of steel"
    assert client.object("tool-2").has_mesh
    client.delete_object("tool-2")
    assert "tool-2" not in {one.name for one in client.objects()}
    names = {one.name for one in client.sensors()}
    assert names >= set(palpate.local.Sensor.preset_names())
    checked = client.check_reading(SENSOR, np.full(36, 3000.0), UNIT)
    assert checked["max_pressure"] == 3000.0


def test_events_tell_of_beliefs_and_the_end(client: Client, trained: str, felt: Readings) -> None:
    session = client.create_session(catalogue=trained)
    events = client.session_events(session.id)
    first = next(events)
    assert isinstance(first, BeliefEvent) and first.belief.n_readings == 0
    client.add_readings(session.id, SENSOR, felt, robot="arm")
    second = next(events)
    assert isinstance(second, BeliefEvent) and second.belief.n_readings == 12
    client.close_session(session.id, none_of_these=True)
    last = next(events)
    assert isinstance(last, ClosedEvent) and last.session.truth is not None
    assert not last.session.truth.was_right
    assert list(events) == []
    other = client.create_session(catalogue=trained)
    events = client.session_events(other.id)
    next(events)
    client.delete_session(other.id)
    assert list(events) == [DeletedEvent(other.id)]


def test_a_stream_survives_a_restart(own_server: Server, felt: Readings) -> None:
    patient = RetryPolicy(attempts_max=20, pause_max=0.5)
    with Client(own_server.address, retry=patient) as client:
        client.create_object("mug")
        client.put_mesh("mug", Mesh.example("mug"))
        job = client.start_training(readings_per_object=60, sva=False, surface=True)
        states = [one.state for one in client.job_events(job.id)]
        assert states[-1] == "succeeded"
        session = client.create_session()
        events = client.session_events(session.id)
        next(events)

        def restart() -> None:
            own_server.stop(signal.SIGKILL)
            time.sleep(0.5)
            own_server.start()

        other = threading.Thread(target=restart)
        other.start()
        # Sent while nobody listens: connections are refused, and the call is repeated.
        time.sleep(0.2)
        added = client.add_readings(session.id, SENSOR, felt[:4], robot="arm")
        assert added.n_readings == 4
        event = next(events)
        while isinstance(event, BeliefEvent) and event.belief.n_readings == 0:
            event = next(events)
        assert isinstance(event, BeliefEvent) and event.belief.n_readings == 4
        other.join()


def test_a_missing_session_has_no_events(client: Client) -> None:
    with pytest.raises(palpate.NotFoundError):
        next(client.session_events("018f0000-0000-7000-8000-000000000000"))


def test_the_async_client_does_the_same(
    server: Server, trained: str, felt: Readings, client: Client
) -> None:
    async def story() -> tuple[palpate.Belief, list[str], palpate.Session]:
        async with AsyncClient(server.address) as other:
            kinds: list[str] = []
            async with other.touch_session("arm", sensor=SENSOR, catalogue=trained) as session:

                async def listen() -> None:
                    async for event in other.session_events(session.id):
                        kinds.append(type(event).__name__)

                listening = asyncio.create_task(listen())
                for pose, image in zip(felt.poses, felt.images, strict=True):
                    belief = await session.touch(image, pose)
                with pytest.raises(palpate.InvalidValueError):
                    await session.touch(np.zeros(35), UNIT)
                await session.close(truth="mug-client")
                await asyncio.wait_for(listening, 30)
            # Many at once, over one client.
            await asyncio.gather(*(other.objects() for _ in range(8)))
            return belief, kinds, await other.session(session.id)

    belief, kinds, session = asyncio.run(story())
    assert kinds[-1] == "ClosedEvent" and set(kinds) == {"BeliefEvent", "ClosedEvent"}
    assert session.truth is not None and session.truth.was_right
    there = client.create_session(catalogue=trained)
    same = client.add_readings(there.id, SENSOR, felt, robot="arm").belief
    assert same is not None and same.objects == belief.objects


def test_lists_have_all_pages(own_server: Server) -> None:
    with Client(own_server.address) as client:
        for index in range(3):
            client.create_object(f"object-{index}")
        request = palpate.steps.get("v1", "objects").with_query(limit=2)
        page = client.run(palpate.steps.ask(request, dict))
        assert len(page["items"]) == 2 and page["next_cursor"]
        assert len(client.objects()) == 3


def test_sessions_are_labelled_searched_and_compared(
    client: Client, trained: str, felt: Readings
) -> None:
    session = client.create_session(catalogue=trained, labels={"site": "oslo"})
    client.add_readings(session.id, SENSOR, felt, robot="searched")
    client.close_session(session.id, truth="mug-client")
    labelled = client.set_session_labels(session.id, {"site": "oslo", "shift": "night"})
    assert labelled.document["labels"] == {"shift": "night", "site": "oslo"}
    newest = client.sessions("closed", with_truth=True, robot="searched", order="newest")
    assert [one.id for one in newest] == [session.id]
    assert client.sessions("open", labels="shift:night") == []
    assert [one.id for one in client.sessions(labels="shift:night")] == [session.id]
    assert client.sessions(none_of_these=True, robot="searched") == []

    client.set_object_labels("mug-client", {"line": "3"})
    assert [one.name for one in client.objects(labels="line:3")] == ["mug-client"]
    client.set_sensor_labels(SENSOR, {"side": "left"})
    assert [one.name for one in client.sensors(labels="side")] == [SENSOR]
    client.set_catalogue_labels(trained, {"team": "b"})
    assert [one["name"] for one in client.catalogues(labels="team:b")] == [trained]

    client.train(trained, objects=["mug-client"], sva=False, surface=True, activate=False)
    assert client.set_alias(trained, "candidate", 2)["aliases"] == {"candidate": 2}
    job = client.wait_for(client.start_comparison(2, trained, sessions=[session.id]))
    assert job.document["shadow_report"]["n_with_truth"] == 1
    client.remove_alias(trained, "candidate")
    assert client.catalogue(trained)["aliases"] == {}


def test_the_fleet_is_read_and_closed(client: Client, trained: str, felt: Readings) -> None:
    session = client.create_session(catalogue=trained)
    client.add_readings(session.id, SENSOR, felt, robot="fleet")
    assert session.id in {one["session"]["id"] for one in client.fleet()["sessions"]}
    assert client.acknowledge_sessions([session.id], mute_s=60)["n_done"] == 1
    assert client.close_sessions([session.id])["n_done"] == 1
    assert client.forwarding()["to"] is None
    assert session.id not in {one["session"]["id"] for one in client.fleet()["sessions"]}


def test_webhooks_are_made_tested_and_deleted(client: Client) -> None:
    made = client.create_webhook("https://localhost:9/hook", ["session.decided"], description="x")
    assert made["secret"].startswith("whsec_")
    webhook = made["webhook"]["id"]
    assert client.rotate_webhook_secret(webhook, grace_s=60)["secret"] != made["secret"]
    # The server was not started with `--webhook-allow-private`.
    tested = client.test_webhook(webhook)
    assert tested["state"] == "abandoned"
    assert "private" in tested["attempts"][0]["error"]
    assert [one["type"] for one in client.webhook_deliveries(webhook)] == ["ping"]
    client.redeliver_webhook(webhook, tested["id"])
    assert client.update_webhook(webhook, enabled=False)["enabled"] is False
    assert client.webhook(webhook)["description"] == "x"
    client.delete_webhook(webhook)
    assert client.webhooks() == []


def test_keys_are_made_rotated_and_revoked(client: Client) -> None:
    made = client.create_key("python-arm", "robot", expires_in_s=3600)
    assert made["secret"].startswith("palpate_")
    key = made["key"]["id"]
    assert client.rotate_key(key, grace_s=0)["secret"] != made["secret"]
    client.revoke_key(key)
    keys = client.keys()
    states = {one["name"]: one["active"] for one in keys}
    assert states["python-arm"] is False
    assert client.audit(operation="create_key")[0]["resource"].endswith(key)
