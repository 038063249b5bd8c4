"""A belief of Palpate as `vision_msgs/Detection3DArray`: plain dictionaries with its fields.

A session is one object, so an array has one detection; its `results` are the hypotheses of object
and pose, likeliest first. Both sides are right-handed, in metres and radians, with quaternions
x, y, z, w and a 6 x 6 covariance in the order x, y, z, rotation about x, y, z, so numbers are
copied unchanged. Not here: ROS (`palpate_node`), HTTP (`palpate_http`).
"""

from symmetry import orbit, rotate

UNKNOWN = "unknown"
"""Class of an object that is not in the catalogue."""

NO_POSE_VARIANCE = 1e6
"""Variance (m², rad²) on the diagonal of an unknown pose."""


def detection_array(belief, frame_id, stamp, boxes=None, orbits=False, probability_min=0.001):
    """Converts a belief to a dictionary with the fields of Detection3DArray.

    `frame_id` is the session's frame, in which all poses are given; `stamp` is a dictionary of
    `sec` and `nanosec`, that of the newest reading. `boxes` maps object ids to (low, high), the
    corners of the object's bounding box in the object frame, in metres; size zero means unknown.
    With `orbits`, each pose equivalent under the object's symmetry becomes a result of its own,
    and they share the hypothesis's score. Results below `probability_min` are dropped.
    """
    header = {"stamp": dict(stamp), "frame_id": frame_id}
    results = [r for r in _results(belief, orbits) if r["hypothesis"]["score"] >= probability_min]
    detection = {
        "header": header,
        "results": results,
        "bbox": _box(belief, boxes or {}),
        "id": belief["session"],
    }
    return {"header": header, "detections": [detection]}


def _results(belief, orbits):
    """ObjectHypothesisWithPose of all hypotheses, of objects without a pose, and of "unknown"."""
    results = []
    for hypothesis in belief["poses"]:
        poses = [hypothesis["pose"]]
        if orbits:
            poses = orbit(hypothesis["pose"], hypothesis.get("symmetry", []))
        score = hypothesis["weight"] / len(poses)
        for pose in poses:
            results.append(_result(hypothesis["name"], score, pose, hypothesis["covariance"]))
    placed = {hypothesis["object"] for hypothesis in belief["poses"]}
    for candidate in belief["objects"]:
        if candidate["object"] not in placed:
            results.append(_result(candidate["name"], candidate["probability"]))
    results.append(_result(UNKNOWN, belief.get("unknown", 0.0)))
    return sorted(results, key=lambda result: -result["hypothesis"]["score"])


def _result(class_id, score, pose=None, covariance=None):
    if pose is None:
        pose = {"position": [0.0, 0.0, 0.0], "orientation": [0.0, 0.0, 0.0, 1.0]}
        covariance = [NO_POSE_VARIANCE if i % 7 == 0 else 0.0 for i in range(36)]
    return {
        "hypothesis": {"class_id": class_id, "score": score},
        "pose": {"pose": _pose(pose), "covariance": list(covariance)},
    }


def _pose(pose):
    return {
        "position": dict(zip("xyz", pose["position"])),
        "orientation": dict(zip("xyzw", pose["orientation"])),
    }


def _box(belief, boxes):
    """BoundingBox3D of the likeliest hypothesis."""
    nothing = {
        "center": _pose({"position": [0.0] * 3, "orientation": [0.0, 0.0, 0.0, 1.0]}),
        "size": {"x": 0.0, "y": 0.0, "z": 0.0},
    }
    if not belief["poses"] or belief["poses"][0]["weight"] <= belief.get("unknown", 0.0):
        return nothing
    likeliest = belief["poses"][0]
    low, high = boxes.get(likeliest["object"], ([0.0] * 3, [0.0] * 3))
    center_in_object = [(a + b) / 2 for a, b in zip(low, high)]
    position, orientation = likeliest["pose"]["position"], likeliest["pose"]["orientation"]
    shift = rotate(orientation, center_in_object)
    center = [p + s for p, s in zip(position, shift)]
    return {
        "center": _pose({"position": center, "orientation": orientation}),
        "size": dict(zip("xyz", (b - a for a, b in zip(low, high)))),
    }
