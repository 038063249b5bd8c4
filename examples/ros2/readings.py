"""Builds a reading of Palpate from values of ROS messages, without ROS."""

import math


def reading(robot, seq, sensor, frame_id, stamp, position, orientation, pressures):
    """Returns a reading. `position` (m) and `orientation` (x, y, z, w) are `session_from_sensor`,
    the tf2 transform of the sensor's frame in `frame_id`; `pressures` are in Pa, in the driver's
    order, NaN for a taxel without a value; `stamp` is a dictionary of `sec` and `nanosec`.
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
