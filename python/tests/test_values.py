"""What Python expects of values: pickles, equality, texts, arrays, lengths; each kind for all."""

from __future__ import annotations

import copy
import json
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import palpate
from palpate import AsyncClient, Client, ClosedClientError, Pose, Readings, local

GRID: dict[str, Any] = {
    "pitch": 0.002,
    "taxel_width": 0.0018,
    "covering_thickness": 0.003,
    "saturation": 20e3,
    "quantisation": 10.0,
}


@pytest.fixture(scope="module")
def catalogue() -> local.Catalogue:
    objects = {name: local.Mesh.example(name) for name in ("mug", "hammer")}
    told: list[tuple[int, int]] = []
    trained = local.train(
        objects, touches=60, seed=3, progress=lambda done, total: told.append((done, total))
    )
    assert told[-1] == (120, 120)
    return trained


def values(catalogue: local.Catalogue) -> list[Any]:
    mesh, sensor = local.Mesh.example("mug"), local.Sensor.preset("digitacts-6x6")
    readings = local.touch(mesh, sensor, 3, seed=5)
    belief = local.Recognition(catalogue).add(sensor, readings)
    grid = local.Sensor.grid(4, 5, **GRID, image_order=(False, True, False))
    unknown = local.Sensor.preset("digitacts-6x6", knowledge="unknown")
    return [
        catalogue,
        mesh,
        sensor,
        grid,
        unknown,
        readings,
        readings[0],
        belief,
        belief.poses[0],
        Pose.of(np.eye(4)),
    ]


def test_every_value_is_equal_to_its_copies(catalogue: local.Catalogue) -> None:
    for value in values(catalogue):
        for other in (pickle.loads(pickle.dumps(value)), copy.copy(value), copy.deepcopy(value)):
            assert other == value, value
            assert hash(other) == hash(value)
        assert value != 1
        assert len(repr(value)) < 300, repr(value)
    assert local.Sensor.preset("digitacts-6x6") != local.Sensor.grid(4, 5, **GRID)
    assert local.Mesh.example("mug") != local.Mesh.example("hammer")


def test_catalogues_of_other_seeds_differ(catalogue: local.Catalogue) -> None:
    objects = {name: local.Mesh.example(name) for name in ("mug", "hammer")}
    assert local.train(objects, touches=60, seed=3) == catalogue
    assert local.train(objects, touches=60, seed=4) != catalogue


def test_equal_numbers_have_equal_hashes() -> None:
    poses = np.tile([0, 0, 0, 0, 0, 0, 1.0], (2, 1))
    one = Readings.of(poses, np.array([[0.0, np.nan], [1.0, 2.0]]))
    other = Readings.of(poses, np.array([[-0.0, -np.nan], [1.0, 2.0]]))
    assert one == other and hash(one) == hash(other)
    up, down = (Pose(np.array([zero, 0, 0]), np.array([0, 0, 0, 1.0])) for zero in (0.0, -0.0))
    assert up == down and hash(up) == hash(down)
    assert hash(one) != hash(Readings.of(poses, np.array([[0.0, np.nan], [1.0, 3.0]])))


def test_a_copied_catalogue_gives_the_same_numbers(
    catalogue: local.Catalogue, tmp_path: Path
) -> None:
    local.save(catalogue, tmp_path / "two")
    copies = [local.load(tmp_path / "two"), pickle.loads(pickle.dumps(catalogue))]
    sensor = local.Sensor.preset("digitacts-6x6")
    readings = local.touch(local.Mesh.example("hammer"), sensor, 5, seed=9)
    expected = local.Recognition(catalogue).add(sensor, readings)
    for other in copies:
        assert (other.names, other.n_readings, other.origins) == (
            catalogue.names,
            catalogue.n_readings,
            catalogue.origins,
        )
        assert local.Recognition(other).add(sensor, readings) == expected
    (tmp_path / "broken").write_bytes((tmp_path / "two").read_bytes()[:-3])
    with pytest.raises(ValueError, match="broken: content: is no catalogue"):
        local.load(tmp_path / "broken")


def test_clients_are_copied_and_say_that_they_are_closed() -> None:
    client = pickle.loads(pickle.dumps(Client("http://127.0.0.1:1", key="k")))
    assert client.address == "http://127.0.0.1:1"
    client.close()
    with pytest.raises(ClosedClientError, match="closed"):
        client.jobs()
    assert isinstance(copy.copy(AsyncClient("http://127.0.0.1:1")), AsyncClient)


def test_values_show_themselves_in_notebooks(catalogue: local.Catalogue) -> None:
    _, mesh, _, _, _, readings, _, belief, *_ = values(catalogue)
    assert "data:image/png" in mesh._repr_html_()
    assert "<svg" in readings._repr_html_()
    assert "mug" in belief._repr_html_() and "none of these" in belief._repr_html_()


def test_answers_can_be_written_as_json(catalogue: local.Catalogue) -> None:
    for value in values(catalogue)[5:]:
        assert json.loads(json.dumps(value.to_dict()))


def test_poses_are_compared_applied_and_checked() -> None:
    pose = Pose.of(([0.0, 0.0, 0.0, 1.0], [1.0, 2.0, 3.0]))
    assert pose.isclose(Pose.of(([0.0, 0.0, 0.0, -1.0], [1.0, 2.0, 3.0])))
    assert not pose.isclose(Pose.of(([0.0, 0.0, 0.0, 1.0], [1.0, 2.0, 3.1])), position=0.01)
    assert (pose @ [1.0, 0.0, 0.0]).tolist() == [2.0, 2.0, 3.0]
    assert pose.apply(np.zeros((2, 3))).shape == (2, 3)
    assert np.asarray(pose).shape == (4, 4)
    for wrong in ([0.0] * 7, [0.0] * 6 + [2.0], [np.nan] * 7):
        with pytest.raises(ValueError, match="length"):
            Pose.of(wrong)
    with pytest.raises(ValueError, match="length"):
        Pose.of(([0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0]))
    with pytest.raises(ValueError, match="length 0"):
        Pose(np.zeros(3), np.zeros(4))
    with pytest.raises(ValueError, match="length 0"):
        Pose.from_wire({"position": [0.0] * 3, "orientation": [0.0] * 4})
    with pytest.raises(ValueError, match="points"):
        pose.apply([1.0, 2.0])


def test_a_reading_of_an_index_is_one_press() -> None:
    readings = Readings.of(np.tile([0, 0, 0, 0, 0, 0, 1.0], (3, 1)), np.zeros((3, 4)))
    assert readings[0].pose == Pose.of([0, 0, 0, 0, 0, 0, 1.0])
    assert [one.image.shape for one in readings] == [(4,), (4,), (4,)]
    assert len(readings[1:]) == 2


def test_numbers_that_are_none_are_refused() -> None:
    for images in (np.zeros((1, 4), dtype=complex), [["1", "2"]]):
        with pytest.raises(ValueError, match="images: are of type"):
            Readings.of([np.eye(4)], images)
    with pytest.raises(ValueError, match="seed"):
        local.touch(local.Mesh.example("mug"), local.Sensor.preset("digitacts-6x6"), 1, seed=-1)


def test_a_wrong_unit_is_warned_of_as_by_the_server(catalogue: local.Catalogue) -> None:
    sensor = local.Sensor.preset("digitacts-6x6")
    taken = local.touch(local.Mesh.example("mug"), sensor, 4, seed=5)
    far = taken.poses * [1000, 1000, 1000, 1, 1, 1, 1]

    def codes(readings: Readings) -> set[str]:
        belief = local.Recognition(catalogue).add(sensor, readings)
        return {warning.code for warning in belief.warnings}

    assert codes(taken) == set()
    assert "pressure_unit" in codes(Readings.of(taken.poses, taken.images / 1000))
    assert "position_unit" in codes(Readings.of(far, taken.images))
    assert "not_tared" in codes(Readings.of(taken.poses, -taken.images))


def test_one_object_alone_is_warned_of() -> None:
    with pytest.warns(UserWarning, match="one object"):
        local.train({"mug": local.Mesh.example("mug")}, touches=20, seed=1)


def test_the_version_is_that_of_the_package() -> None:
    assert palpate.__version__.count(".") == 2
