"""Simulation and checks of arguments, without a server."""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from palpate import Readings, local
from palpate.local import Mesh, Recognition, Sensor

PLATE = local.make_mesh(
    [[-0.05, -0.05, 0], [0.05, -0.05, 0], [0.05, 0.05, 0], [-0.05, 0.05, 0]],
    [[0, 1, 2], [0, 2, 3]],
)
"""A plate in the plane z = 0 that faces +z."""

DOWN = np.diag([1.0, -1.0, -1.0, 1.0])
"""A sensor at the origin that looks down."""


def lifted(height: float) -> npt.NDArray[np.float64]:
    pose: npt.NDArray[np.float64] = DOWN.copy()
    pose[2, 3] = height
    return pose


def test_a_deeper_press_is_stronger_and_none_in_the_air(sensor: Sensor) -> None:
    images = local.press(PLATE, sensor, [lifted(z) for z in (0.01, -0.0002, -0.0005)], seed=3)
    assert images.shape == (3, 36)
    air, light, deep = images.mean(axis=1)
    assert air < sensor.contact_floor < light < deep
    # The plate is flat and larger than the sensor: all taxels feel the same, but for the noise.
    assert np.ptp(images[2]) < 8 * sensor.noise + 20e3 / 256


def test_presses_depend_on_the_seed_alone(sensor: Sensor) -> None:
    poses = [lifted(-0.0004)] * 4
    one, other = (local.press(PLATE, sensor, poses, seed=seed) for seed in (1, 2))
    assert np.array_equal(one, local.press(PLATE, sensor, poses, seed=1))
    assert not np.array_equal(one, other)


def test_touches_rest_in_contact_on_the_surface(sensor: Sensor) -> None:
    mesh = Mesh.example("mug")
    touches = local.touch(mesh, sensor, 30, seed=5)
    assert (touches.images.max(axis=1) > sensor.contact_floor).all()
    nearest = [np.linalg.norm(mesh.vertices - at, axis=1).min() for at in touches.poses[:, :3]]
    assert max(nearest) < 0.006


def test_the_drivers_order_of_images_is_kept() -> None:
    numbers: dict[str, Any] = {
        "pitch": 0.002,
        "taxel_width": 0.0018,
        "covering_thickness": 0.0025,
        "saturation": 20e3,
        "quantisation": 0.0,
        "noise": 0.0,
    }
    # An edge: the plate's corner lies under a part of the sensor.
    pose = lifted(-0.0005)
    pose[:2, 3] = 0.049, 0.047
    plain = Sensor.grid(4, 5, **numbers)
    turned = Sensor.grid(4, 5, **numbers, image_order=(True, True, False))
    image = local.press(PLATE, plain, [pose])[0].reshape(4, 5)
    sent = local.press(PLATE, turned, [pose])[0].reshape(5, 4)
    assert np.array_equal(sent, image[::-1].T)
    assert not np.array_equal(image, image[::-1])


def test_a_file_is_the_mesh_it_was_written_from(tmp_path: Path) -> None:
    mesh = Mesh.example("hammer")
    (tmp_path / "hammer.off").write_bytes(mesh.to_off())
    read = local.load_mesh(tmp_path / "hammer.off", unit="m")
    assert np.array_equal(read.vertices, mesh.vertices)
    assert np.array_equal(read.faces, mesh.faces)
    with pytest.warns(UserWarning, match=r"is the file in m \(80 mm\)"):
        millimetres = local.load_mesh(tmp_path / "hammer.off", unit="mm")
    assert millimetres.largest_dimension == pytest.approx(mesh.largest_dimension / 1000)
    (tmp_path / "broken.stl").write_bytes(b"no mesh")
    for name in ("broken.stl", "hammer.step"):
        (tmp_path / "hammer.step").write_bytes(mesh.to_off())
        with pytest.raises(ValueError, match=f"^path: .*{name}"):
            local.load_mesh(tmp_path / name, unit="m")


def refused(expected: str, call: Callable[[], object]) -> None:
    with pytest.raises(ValueError, match=expected):
        call()


def test_errors_name_the_argument(sensor: Sensor) -> None:
    mesh = Mesh.example("mug")
    image, pose = np.zeros(36), np.array([0, 0, 0, 0, 0, 0, 1.0])
    some, wide = Readings.of([pose] * 30, [image] * 30), Readings.of([pose], [np.zeros(49)])

    def native(poses: Any, images: Any) -> Callable[[], object]:
        return lambda: local.native(sensor, Readings.of(poses, images))

    refused(r"poses\[1\]: orientation: has length 0", native([pose, np.zeros(7)], [image] * 2))
    refused(r"images\[0\]: image has 35 taxels, expected 36", native([pose], [image[1:]]))
    refused(r"images\[0, 2\]: pressure", native([pose], [[0, 0, np.inf] + [0] * 33]))
    refused(r"images\[0\]: .*missing", native([pose], [[np.nan] * 36]))
    refused(r"poses\[0\]\[1\]: .* m", native([[0, 1e6, 0, 0, 0, 0, 1]], [image]))
    refused("^name: ", lambda: Sensor.preset("6x6"))
    refused("^knowledge: ", lambda: Sensor.preset("digitacts-6x6", knowledge="exact"))
    refused("^faces: ", lambda: local.make_mesh(np.zeros((3, 3)), [[0, 1, 2.5]]))
    refused(r"^faces\[0\]: ", lambda: local.make_mesh(np.eye(3), [[0, 1, 3]]))
    refused("^unit: ", lambda: local.load_mesh("mug.stl", unit="mile"))
    refused(r'^objects\["mug"\]: images\[0\]', lambda: local.train({"mug": wide}, sensor=sensor))
    refused("^touches: ", lambda: local.train({"mug": mesh}, touches=3))
    refused("^objects: ", lambda: local.train({}))
    refused(r'^objects\["mug"\]: none of 30', lambda: local.train({"mug": some}, sensor=sensor))
    refused("^n: ", lambda: local.touch(mesh, sensor, 0))
    refused(
        "^pitch: |pitch is",
        lambda: Sensor.grid(
            4, 4, pitch=2.0, taxel_width=1.0, covering_thickness=1.0, saturation=1, quantisation=0
        ),
    )


def test_options_of_a_recognition_are_checked(
    sensor: Sensor, taught: dict[str, Readings], felt: Readings
) -> None:
    here = local.train(taught, sensor=sensor)
    refused("^unknown_prior: ", lambda: Recognition(here, unknown_prior=1.0))
    refused("^prior: ", lambda: Recognition(here, prior={"cup": 0.5}))
    refused("^object_moves: ", lambda: Recognition(here, object_moves=(1.0, 0.1)))
    refused("^poses: ", lambda: Recognition(here).belief(poses=101))
    refused("^risk: ", lambda: Recognition(here).belief(risk=0.9))
    # Probabilities stated before any touch are those of the answer, less "none of these".
    belief = Recognition(here, prior={"mug": 0.3}).belief()
    assert belief.probability("mug") / belief.probability("hammer") == pytest.approx(3 / 7)
    impossible = Recognition(here, prior={"mug": 0.0}).add(sensor, felt)
    assert impossible.probability("mug") == 0.0


def test_training_lets_other_threads_run(sensor: Sensor) -> None:
    mesh, counted, stop = Mesh.example("mug"), [0], threading.Event()

    def count() -> None:
        while not stop.is_set():
            counted[0] += 1
            time.sleep(0.001)

    other = threading.Thread(target=count)
    other.start()
    time.sleep(0.5)
    alone, started = 2 * counted[0], time.monotonic()
    local.touch(mesh, sensor, 2000, seed=1)
    took, seen = time.monotonic() - started, counted[0] - alone / 2
    stop.set()
    other.join()
    # At least a twentieth of the ticks of a second without the training.
    assert seen > 0.05 * alone * took, (seen, alone, took)


def test_ctrl_c_stops_a_long_work(sensor: Sensor) -> None:
    mesh = Mesh.example("mug")
    # A shell that starts the tests in the background lets them ignore the signal.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    used = time.process_time()
    local.touch(mesh, sensor, 2000, seed=1)
    tenth = time.process_time() - used
    timer = threading.Timer(0.05, signal.raise_signal, [signal.SIGINT])
    timer.start()
    used = time.process_time()
    with pytest.raises(KeyboardInterrupt):
        local.touch(mesh, sensor, 20_000, seed=1)
    assert time.process_time() - used < 8 * tenth, "it went on to its end"
    timer.join()


def test_the_likeliest_pose_puts_the_mesh_under_the_touches(
    sensor: Sensor, meshes: dict[str, Mesh], taught: dict[str, Readings], felt: Readings
) -> None:
    belief = Recognition(local.train(taught, sensor=sensor)).add(sensor, felt)
    assert belief.best == "mug"
    in_model = felt.moved(belief.poses[0].session_from_model.inverse()).poses[:, :3]
    vertices = meshes["mug"].vertices
    distances = [np.linalg.norm(vertices - at, axis=1).min() for at in in_model]
    # The mesh's vertices are 2 mm apart, and the covering gives way by a millimetre.
    assert np.median(distances) < 0.003, distances
