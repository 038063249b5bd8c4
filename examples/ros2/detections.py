"""A belief of Palpate as `vision_msgs/Detection3DArray`: plain dictionaries with its fields.

A session is about one object, so an array has one detection; its `results` are the hypotheses of
what it is and where, likeliest first. Both sides are right-handed, in metres and radians, with
quaternions x, y, z, w, and both order a 6 x 6 covariance x, y, z, rotation about x, y, z: numbers
pass as they are. Not here: ROS (`palpate_node`), HTTP (`palpate_http`).
"""

from symmetry import orbit, rotate

UNKNOWN = "unknown"
"""The class of what is none of the catalogue's objects."""

NO_POSE_VARIANCE = 1e6
"""The variance (m², rad²) on the diagonal of a pose of which nothing is known."""


def detection_array(belief, frame_id, stamp, boxes=None, orbits=False, probability_min=0.001):
    """The message of a belief: a dictionary with the fields of Detection3DArray.

    `frame_id` is the session's frame, in which all poses are; `stamp` a dictionary of `sec` and
    `nanosec`, that of the newest reading. `boxes` maps object ids to (low, high), the corners of
    the object's box in the object frame, in metres; a size of zeros means that it is not known.
    With `orbits` every pose that looks the same as another by the object's symmetry becomes a
    result of its own, which share the hypothesis's score. What is less probable than
    `probability_min` is left out.
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
    """BoundingBox3D of the likeliest hypothesis: its box in its pose."""
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
