"""A ROS 2 node that sends tactile readings to Palpate and publishes its beliefs.

Subscribes `tactile` (std_msgs/Float64MultiArray: pressures in Pa, row by row, one message per
press), looks up the sensor's pose in `frame_id` by tf2, posts both as a reading, and publishes
`detections` (vision_msgs/Detection3DArray). The service `~/new_object` (std_srvs/Trigger) closes
the session; the next reading starts a new one.

    python3 palpate_node.py --ros-args -p server:=http://127.0.0.1:7411 -p frame_id:=base_link \
        -p sensor_frame:=tactile_link -p sensor:=digitacts-6x6 -p robot:=arm-3

Only this file needs ROS (rclpy, tf2_ros, vision_msgs, std_srvs); the mapping is in `detections`.
"""

import os

import rclpy
from rclpy.node import Node
from rclpy.time import Time
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import Trigger
from tf2_ros import Buffer, TransformException, TransformListener
from vision_msgs.msg import Detection3D, Detection3DArray, ObjectHypothesisWithPose

from detections import detection_array
from messages import fill
from palpate_http import Palpate, Refused, Unanswered
from readings import reading

PARAMETERS = {
    "server": "http://127.0.0.1:7411",
    "frame_id": "base_link",
    "sensor_frame": "tactile_link",
    "sensor": "digitacts-6x6",
    "robot": "arm",
    "catalogue": "default",
    "orbits": False,
}
"""The node's parameters and their defaults. The key is in PALPATE_KEY."""

TYPES = {"detections": Detection3D, "results": ObjectHypothesisWithPose}
"""Item types of the message's lists."""


class PalpateNode(Node):
    """One sensor of one robot; readings in, detections out."""

    def __init__(self):
        super().__init__("palpate")
        for name, default in PARAMETERS.items():
            self.declare_parameter(name, default)
        self.palpate = Palpate(self.value("server"), os.environ.get("PALPATE_KEY"))
        self.session, self.boxes, self.seq = None, {}, 0
        self.buffer = Buffer()
        self.listener = TransformListener(self.buffer, self)
        self.publisher = self.create_publisher(Detection3DArray, "detections", 10)
        self.create_subscription(Float64MultiArray, "tactile", self.press, 10)
        self.create_service(Trigger, "~/new_object", self.new_object)

    def value(self, name):
        """A parameter's value."""
        return self.get_parameter(name).value

    def press(self, message):
        """Sends one press with the sensor's pose and publishes the belief after it."""
        try:
            found = self.buffer.lookup_transform(
                self.value("frame_id"), self.value("sensor_frame"), Time()
            )
            belief = self.send(message, found)
            answer = detection_array(
                belief, self.value("frame_id"), stamp_of(found), self.boxes, self.value("orbits")
            )
            self.publisher.publish(fill(Detection3DArray(), answer, TYPES))
        except (TransformException, Refused, Unanswered) as reason:
            self.get_logger().error(f"a press was not sent: {reason}")
        except Exception as fault:  # an exception that leaves a callback ends the node
            self.get_logger().error(f"a press was lost by a fault of this node: {fault!r}")

    def send(self, message, found):
        """Returns the belief after one press. The first press starts a session."""
        if self.session is None:
            options = {"catalogue": self.value("catalogue")}
            self.session = self.palpate.open_session(self.value("frame_id"), **options)
            try:
                self.boxes = self.palpate.boxes(self.session)
            except (Refused, Unanswered) as reason:
                self.boxes = {}
                self.get_logger().warning(f"detections have no boxes: {reason}")
        self.seq += 1
        t, q = found.transform.translation, found.transform.rotation
        press = reading(
            self.value("robot"), self.seq, self.value("sensor"), self.value("frame_id"),
            stamp_of(found), (t.x, t.y, t.z), (q.x, q.y, q.z, q.w), message.data,
        )  # fmt: skip
        try:
            return self.palpate.add_readings(self.session, [press])
        except Refused as refused:
            if refused.problem["status"] in (404, 409, 410):  # the session has ended
                self.session = None
            raise

    def new_object(self, _request, response):
        """Closes the session; the next press touches another object."""
        try:
            if self.session is not None:
                self.palpate.close_session(self.session)
            self.session, response.success = None, True
        except (Refused, Unanswered) as reason:
            response.success, response.message = False, str(reason)
        return response


def stamp_of(found):
    """The time of a transform in the API's format."""
    return {"sec": found.header.stamp.sec, "nanosec": found.header.stamp.nanosec}


def main():
    """Runs the node until it is stopped."""
    rclpy.init()
    node = PalpateNode()
    try:
        rclpy.spin(node)
    except KeyboardInterrupt:
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == "__main__":
    main()
