"""One press as a reading of Palpate, from what ROS knows of it. Knows no ROS."""

import math


def reading(robot, seq, sensor, frame_id, stamp, position, orientation, pressures):
    """A reading: `position` (m) and `orientation` (x, y, z, w) are `session_from_sensor`, as tf2
    answers for the sensor's frame in `frame_id`; `pressures` in Pa, in the driver's order, NaN
    where a taxel has no value; `stamp` a dictionary of `sec` and `nanosec`.
    """
    return {
        "robot": robot,
        "seq": seq,
        "sensor": sensor,
        "frame_id": frame_id,
        "stamp": stamp,
        "pose": {"position": list(position), "orientation": list(orientation)},
        "image": [None if math.isnan(pressure) else pressure for pressure in pressures],
    }
