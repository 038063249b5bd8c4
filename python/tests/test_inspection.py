"""Tests of operations that look closer, and of those that an operator needs now and then."""

import numpy as np

from palpate import Client, Pose, Readings
from palpate.options import BoundedPosePrior
from palpate.steps import ask, get

SENSOR = "digitacts-6x6"
UNIT = np.eye(4)


def test_a_contact_map_is_a_grid_of_probabilities(client: Client, trained: str) -> None:
    client.train(
        "maps",
        objects=["mug-client"],
        readings_per_object=100,
        geometric={"kind": "solid", "cell": 0.004},
    )
    grid = client.contact_map("maps", 1, "mug-client")
    assert grid.kind == "solid" and grid.cell == 0.004
    assert grid.log_odds.shape == tuple(grid.document["n_cells"])
    # The counts of the map are those of the cells, and x is the first axis.
    prior = grid.document["prior"]
    occupied = grid.probabilities > prior + 1e-6
    assert np.count_nonzero(occupied) == grid.document["n_occupied"] > 100
    layer = grid.log_odds[:, :, 3]
    path = ("v1", "catalogues", "maps", "versions", "1", "objects", "mug-client", "occupancy")
    shown = client.run(ask(get(*path).with_query(slice=3), dict))
    assert np.array_equal(layer.T.ravel(), np.asarray(shown["log_odds"]))
    report = client.training_report("maps", 1)
    assert [one["name"] for one in report["objects"]] == ["mug-client"]

    bounded: BoundedPosePrior = {
        "kind": "bounded",
        "pose": Pose.of(UNIT).to_wire(),
        "half_extents": [0.01, 0.01, 0.01],
        "half_angle": 0.2,
    }
    session = client.create_session(catalogue="maps", method="geometric", pose_prior=bounded)
    image = np.zeros((1, 6, 6))
    image[0, 2:4, 2:4] = 6000.0
    client.add_readings(session.id, SENSOR, Readings.of([UNIT], image), robot="maps")
    marginals = client.marginals(session.id)
    assert marginals["name"] == "mug-client" and marginals["axes"]


def test_a_withdrawn_reading_stays_listed(client: Client, trained: str, felt: Readings) -> None:
    session = client.create_session(catalogue=trained)
    client.add_readings(session.id, SENSOR, felt, robot="withdrawing")
    before = client.belief(session.id)
    assert client.retract_reading(session.id, 0)["n_readings"] == len(felt) - 1
    listed = client.session_readings(session.id)
    assert [one["retracted_by"] is not None for one in listed] == [True] + [False] * (len(felt) - 1)
    assert client.belief(session.id).n_readings == before.n_readings - 1


def test_robot_names_belong_to_keys(client: Client) -> None:
    key = client.create_key("holder", "robot")["key"]["id"]
    assert client.bind_robot("bound-arm", "holder")["holder"]["key_id"] == key
    assert "bound-arm" in {one["name"] for one in client.robots()}
    client.release_robot("bound-arm")
    assert "bound-arm" not in {one["name"] for one in client.robots()}
    client.revoke_key(key)


def test_a_snapshot_is_a_file_and_storage_is_counted(client: Client) -> None:
    snapshot = client.take_snapshot()
    assert len(snapshot) > 1000
    assert client.storage()["stored_bytes"] > 0
