"""The server and this process give the same numbers, bit for bit."""

from __future__ import annotations

from typing import Any

import numpy as np

import palpate
from palpate import Belief, Client, Readings, local
from palpate.local import Catalogue, Mesh, Recognition, Sensor

SEED = 9


def numbers(belief: Belief) -> dict[str, Any]:
    """Everything that a belief states, in an exact form."""
    return {
        "objects": [(one.name, one.probability.hex()) for one in belief.objects],
        "unknown": belief.unknown.hex(),
        "entropy": belief.entropy_bits.hex(),
        "n_readings": belief.n_readings,
        "calibrated": (belief.calibrated, belief.uncalibrated_reason),
        "stop": belief.stop,
        "poses": [
            (
                one.name,
                one.weight.hex(),
                one.pose.numbers.tobytes(),
                one.session_from_model.numbers.tobytes(),
                one.covariance.tobytes(),
                [(a.point.tobytes(), a.direction.tobytes(), a.order) for a in one.symmetry],
            )
            for one in belief.poses
        ],
    }


def compare(
    client: Client, catalogue: str, here: Catalogue, sensor: Sensor, felt: Readings, **options: Any
) -> Belief:
    """Compares the beliefs after each touch; the last one."""
    recognition = Recognition(here, **options)
    session = client.create_session(
        catalogue=catalogue,
        risk=0.05,
        unknown_prior=options.get("unknown_prior"),
        object_moves=None
        if "object_moves" not in options
        else {
            "position_m": options["object_moves"][0],
            "angle_rad": options["object_moves"][1],
        },
    )
    for index in range(len(felt)):
        one = felt[index : index + 1]
        added = client.add_readings(session.id, "digitacts-6x6", one, robot="arm", first_seq=index)
        assert added.belief is not None
        recognition.add(sensor, one)
        assert numbers(recognition.belief(risk=0.05)) == numbers(added.belief), index
    there = client.belief(session.id, poses=100)
    assert numbers(recognition.belief(poses=100, risk=0.05)) == numbers(there)
    return there


def test_readings_train_to_the_servers_numbers(
    client: Client, sensor: Sensor, taught: dict[str, Readings], felt: Readings
) -> None:
    names = {name: f"{name}-taught" for name in taught}
    for name, readings in taught.items():
        client.create_object(names[name])
        added = client.add_training_readings(names[name], "digitacts-6x6", readings)
        assert (added.n_new, added.n_readings) == (200, 200)
    job = client.train("taught", objects=list(names.values()), seed=SEED, sva=False, surface=True)
    assert job.version == 1
    here = local.train(
        {names[name]: readings for name, readings in taught.items()}, sensor=sensor, seed=SEED
    )
    belief = compare(client, "taught", here, sensor, felt)
    assert belief.best == "mug-taught" and belief.objects[0].probability > 0.9
    assert belief.calibrated
    compare(client, "taught", here, sensor, felt, unknown_prior=0.2)
    compare(client, "taught", here, sensor, felt[:6], object_moves=(0.002, 0.05))


def test_meshes_train_to_the_servers_numbers(
    client: Client, sensor: Sensor, meshes: dict[str, Mesh], felt: Readings
) -> None:
    for name, mesh in meshes.items():
        client.create_object(name)
        assert client.put_mesh(name, mesh)["n_triangles"] == len(mesh.faces)
    stages: list[str] = []
    job = client.train(
        "meshes",
        objects=list(meshes),
        seed=SEED,
        readings_per_object=120,
        surface_readings_per_object=200,
        sva=False,
        surface=True,
        progress=lambda job: stages.append(job.state),
    )
    assert stages[-1] == "succeeded" and job.is_final
    here = local.train(meshes, sensor=sensor, touches=120, surface_touches=200, seed=SEED)
    belief = compare(client, "meshes", here, sensor, felt)
    assert belief.best == "mug"
    report = client.catalogue_version("meshes", 1)["report"]["objects"]
    assert [one["surface"]["n_patches"] for one in report] == here.n_patches


def test_a_family_of_sensors_trains_to_the_servers_numbers(
    client: Client, meshes: dict[str, Mesh], felt: Readings
) -> None:
    described: dict[str, Any] = {
        "grid": {"rows": 6, "cols": 6, "pitch": 0.002, "taxel_width": 0.0018},
        "covering_thickness": 0.0025,
        "saturation": 20e3,
        "quantisation": 80.0,
    }
    client.create_sensor("mine", description=described)
    mine = Sensor.grid(
        **described["grid"],
        covering_thickness=0.0025,
        saturation=20e3,
        quantisation=80.0,
    )
    for name, mesh in meshes.items():
        client.create_object(f"{name}-family")
        client.put_mesh(f"{name}-family", mesh)
    names = [f"{name}-family" for name in meshes]
    client.train(
        "family",
        sensor="mine",
        objects=names,
        seed=SEED,
        readings_per_object=60,
        surface_readings_per_object=90,
        sva=False,
        surface=True,
    )
    renamed = {f"{name}-family": mesh for name, mesh in meshes.items()}
    here = local.train(renamed, sensor=mine, touches=60, surface_touches=90, seed=SEED)
    recognition, session = Recognition(here), client.create_session(catalogue="family")
    there = client.add_readings(session.id, "mine", felt, robot="arm").belief
    assert there is not None
    assert numbers(recognition.add(mine, felt)) == numbers(there)


def test_one_seed_gives_one_belief_in_any_batches(
    sensor: Sensor, taught: dict[str, Readings], felt: Readings
) -> None:
    here = local.train(taught, sensor=sensor, seed=SEED)
    again = local.train(taught, sensor=sensor, seed=SEED)
    single, batch = Recognition(here), Recognition(again)
    for index in range(len(felt)):
        single.touch(sensor, felt.images[index], felt.poses[index])
    assert numbers(single.belief()) == numbers(batch.add(sensor, felt))
    other = local.train(taught, sensor=sensor, seed=SEED + 1)
    assert numbers(Recognition(other).add(sensor, felt)) != numbers(batch.belief())
    assert np.isfinite(palpate.Pose.of(batch.belief().poses[0].pose).matrix).all()
