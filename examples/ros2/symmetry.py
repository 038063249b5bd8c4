"""Poses equivalent under an object's symmetry: rotations about its axes.

An axis has a point, a unit direction, both in the frame of the pose, and an order, None for full
rotational symmetry, which gives `TURNS_OF_CONTINUOUS` poses. Several axes are combined, up to
`POSES_MAX` poses.
"""

import math

TURNS_OF_CONTINUOUS = 12
"""Number of poses that represent all rotations about an axis of full symmetry."""

POSES_MAX = 144
"""Maximum number of poses: 12 rotations about one axis times 12 about another."""


def orbit(pose, axes):
    """Returns the pose and all equivalent poses, each once."""
    found = [pose]
    for pose in found:
        for axis in axes:
            for turned in _turns(pose, axis):
                if len(found) < POSES_MAX and not any(_same(turned, other) for other in found):
                    found.append(turned)
    return found


def _turns(pose, axis):
    n = axis.get("order") or TURNS_OF_CONTINUOUS
    for k in range(1, n):
        half = math.pi * k / n
        turn = [*(math.sin(half) * d for d in axis["direction"]), math.cos(half)]
        arm = [p - a for p, a in zip(pose["position"], axis["point"])]
        yield {
            "position": [a + t for a, t in zip(axis["point"], rotate(turn, arm))],
            "orientation": multiply(turn, pose["orientation"]),
        }


def _same(a, b):
    """Whether two poses are equal to a micrometre and about a thousandth of a degree."""
    near = all(abs(p - q) < 1e-6 for p, q in zip(a["position"], b["position"]))
    cosine = abs(sum(p * q for p, q in zip(a["orientation"], b["orientation"])))
    return near and cosine > 1 - 1e-10


def multiply(a, b):
    """The product of two quaternions (x, y, z, w): first `b`, then `a`."""
    ax, ay, az, aw = a
    bx, by, bz, bw = b
    return [
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    ]


def rotate(quaternion, vector):
    """Rotates a vector by a unit quaternion (x, y, z, w)."""
    x, y, z, w = quaternion
    turned = multiply(multiply(quaternion, [*vector, 0.0]), [-x, -y, -z, w])
    return turned[:3]
