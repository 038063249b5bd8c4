"""Poses from matrices, rotations and numbers."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from palpate import Pose, Readings
from palpate.pose import poses_array


def some() -> Rotation:
    return Rotation.from_euler("xyz", [0.3, -1.2, 2.9])


@pytest.mark.parametrize("turn", [some(), some().as_matrix(), some().as_quat()])
def test_a_pair_of_turn_and_translation_is_a_pose(turn: Any) -> None:
    pose = Pose.of((turn, [1.0, 2.0, 3.0]))
    assert pose.matrix[:3, :3] == pytest.approx(some().as_matrix())
    assert pose.matrix[:3, 3] == pytest.approx([1, 2, 3])
    assert (pose.rotation * some().inv()).magnitude() < 1e-12


def test_all_turns_survive_the_way_through_a_matrix() -> None:
    # Half turns and turns near them use each of the four formulas.
    turns = [*Rotation.random(200, random_state=1), *Rotation.from_quat(np.eye(4))]
    for turn in turns:
        again = Pose.of(Pose.of((turn, np.zeros(3))).matrix)
        assert (again.rotation * turn.inv()).magnitude() < 1e-9


def test_frames_cancel() -> None:
    a_from_b = Pose.of((some(), [1.0, 2.0, 3.0]))
    assert (a_from_b @ a_from_b.inverse()).matrix == pytest.approx(np.eye(4), abs=1e-12)


def test_seven_numbers_are_kept_exactly() -> None:
    numbers = np.array([0.1, 0.2, 0.3, 0.1, -0.2, 0.3, 0.9273618495495704])
    assert Pose.of(numbers).numbers.tobytes() == numbers.tobytes()
    wire = Pose.of(numbers).to_wire()
    assert Pose.from_wire(wire).numbers.tobytes() == numbers.tobytes()


def test_many_poses_come_in_any_form() -> None:
    matrices = np.stack([Pose.of((turn, [0, 0, 1.0])).matrix for turn in Rotation.random(3)])
    assert poses_array(matrices).shape == (3, 7)
    assert poses_array(poses_array(matrices)).shape == (3, 7)
    assert poses_array([matrices[0], Pose.of(matrices[1])]).shape == (2, 7)
    with pytest.raises(ValueError, match="poses"):
        poses_array(np.zeros((3, 6)))


def test_what_is_no_pose_is_refused() -> None:
    cases: list[tuple[Any, str]] = [
        (np.eye(3), "4 × 4"),
        (np.diag([1.0, 1, 1, 2]), "last row"),
        (np.diag([1.0, 1, -1, 1]), "not a rotation"),
        ((some(), [1.0, 2.0]), "translation"),
        ((np.zeros(3), [1.0, 2.0, 3.0]), "rotation"),
    ]
    for given, expected in cases:
        with pytest.raises(ValueError, match=expected):
            Pose.of(given)


def test_images_have_rows_or_not() -> None:
    poses = np.tile([0, 0, 0, 0, 0, 0, 1.0], (2, 1))
    square = Readings.of(poses, np.arange(72.0).reshape(2, 6, 6))
    assert np.array_equal(square.images, np.arange(72.0).reshape(2, 36))
    with pytest.raises(ValueError, match="one a pose"):
        Readings.of(poses, np.zeros((3, 36)))
    sent = Readings.of(poses, [[1.0, np.nan], [2.0, 3.0]]).to_wire("s", robot="arm", first_seq=4)
    assert [one["image"] for one in sent] == [[1.0, None], [2.0, 3.0]]
    assert [one["seq"] for one in sent] == [4, 5]
