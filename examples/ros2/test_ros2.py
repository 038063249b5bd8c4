"""What the example maps, without ROS; against a real server where PALPATE_SERVER names one."""

import copy
import json
import math
import os
import socket
import struct
import sys
import threading
import unittest
import unittest.mock
from types import SimpleNamespace

from detections import NO_POSE_VARIANCE, detection_array
from messages import fill
from palpate_http import UNITS_M, Palpate, Refused, Unanswered, stl_box
from readings import reading
from symmetry import orbit, rotate

STAMP = {"sec": 12, "nanosec": 500_000_000}
QUARTER_ABOUT_Z = [0.0, 0.0, math.sqrt(0.5), math.sqrt(0.5)]
COVARIANCE = [float(i) for i in range(36)]


def belief(**changes):
    """A mug in two poses, a hammer without, and something unknown."""
    pose = {"position": [1.0, 2.0, 3.0], "orientation": QUARTER_ABOUT_Z}
    mug = {"object": "m", "name": "mug", "pose": pose, "covariance": COVARIANCE, "symmetry": []}
    found = {
        "session": "s",
        "objects": [
            {"object": "m", "name": "mug", "probability": 0.7},
            {"object": "h", "name": "hammer", "probability": 0.2},
        ],
        "unknown": 0.1,
        "poses": [{**mug, "weight": 0.5}, {**mug, "weight": 0.2}],
    }
    return copy.deepcopy({**found, **changes})


class Detections(unittest.TestCase):
    def test_results_are_hypotheses_then_objects_without_a_pose_and_unknown(self):
        message = detection_array(belief(), "base_link", STAMP)
        self.assertEqual(message["header"], {"stamp": STAMP, "frame_id": "base_link"})
        [detection] = message["detections"]
        self.assertEqual(detection["header"], message["header"])
        self.assertEqual(detection["id"], "s")
        scores = [(r["hypothesis"]["class_id"], r["hypothesis"]["score"]) for r in detection["results"]]
        expected = [("mug", 0.5), ("mug", 0.2), ("hammer", 0.2), ("unknown", 0.1)]
        self.assertEqual(scores, expected)
        self.assertAlmostEqual(sum(score for _, score in scores), 1.0)

    def test_pose_and_covariance_pass_as_they_are(self):
        result = detection_array(belief(), "base_link", STAMP)["detections"][0]["results"][0]
        self.assertEqual(result["pose"]["pose"]["position"], {"x": 1.0, "y": 2.0, "z": 3.0})
        self.assertEqual(result["pose"]["pose"]["orientation"]["z"], math.sqrt(0.5))
        # Row 1, column 3: covariance of y with the turn about x, in both orders of ROS.
        self.assertEqual(result["pose"]["covariance"][1 * 6 + 3], 9.0)

    def test_what_has_no_pose_says_that_nothing_is_known_of_it(self):
        only_objects = detection_array(belief(poses=[]), "base_link", STAMP)["detections"][0]
        names = [result["hypothesis"]["class_id"] for result in only_objects["results"]]
        self.assertEqual(names, ["mug", "hammer", "unknown"])
        covariance = only_objects["results"][0]["pose"]["covariance"]
        self.assertEqual([covariance[7 * i] for i in range(6)], [NO_POSE_VARIANCE] * 6)
        self.assertEqual(sum(covariance), 6 * NO_POSE_VARIANCE)
        self.assertEqual(only_objects["bbox"]["size"], {"x": 0.0, "y": 0.0, "z": 0.0})

    def test_the_box_is_turned_and_moved_with_the_object(self):
        # Middle (1, 0, 0) in the object, turned a quarter about z: (0, 1, 0) from its origin.
        boxes = {"m": ([0.0, -0.5, -0.25], [2.0, 0.5, 0.25])}
        box = detection_array(belief(), "base_link", STAMP, boxes)["detections"][0]["bbox"]
        self.assertEqual(box["size"], {"x": 2.0, "y": 1.0, "z": 0.5})
        center = box["center"]["position"]
        self.assertAlmostEqual(center["x"], 1.0)
        self.assertAlmostEqual(center["y"], 3.0)
        self.assertAlmostEqual(center["z"], 3.0)

    def test_poses_that_look_the_same_share_the_score(self):
        flipped = belief()
        axis = {"point": [1.0, 2.0, 0.0], "direction": [0.0, 0.0, 1.0], "order": 2}
        flipped["poses"] = [{**flipped["poses"][0], "weight": 0.7, "symmetry": [axis]}]
        results = detection_array(flipped, "base_link", STAMP, orbits=True)["detections"][0]["results"]
        self.assertEqual([r["hypothesis"]["score"] for r in results], [0.35, 0.35, 0.2, 0.1])
        once = detection_array(flipped, "base_link", STAMP)["detections"][0]["results"]
        self.assertEqual([r["hypothesis"]["score"] for r in once], [0.7, 0.2, 0.1])

    def test_what_is_not_probable_is_left_out(self):
        sure = belief(unknown=0.0001)
        names = [
            result["hypothesis"]["class_id"]
            for result in detection_array(sure, "base_link", STAMP)["detections"][0]["results"]
        ]
        self.assertEqual(names, ["mug", "mug", "hammer"])


class Symmetry(unittest.TestCase):
    POSE = {"position": [1.0, 0.0, 0.0], "orientation": [0.0, 0.0, 0.0, 1.0]}

    def test_half_a_turn_about_an_axis_beside_the_origin(self):
        # About the vertical through (2, 0): from (1, 0) to (3, 0), turned by a half about z.
        axis = {"point": [2.0, 0.0, 5.0], "direction": [0.0, 0.0, 1.0], "order": 2}
        first, second = orbit(self.POSE, [axis])
        self.assertEqual(first, self.POSE)
        for found, expected in zip(second["position"], [3.0, 0.0, 0.0]):
            self.assertAlmostEqual(found, expected)
        for found, expected in zip(second["orientation"], [0.0, 0.0, 1.0, 0.0]):
            self.assertAlmostEqual(found, expected)

    def test_the_turns_of_a_cube_are_twenty_four(self):
        axes = [
            {"point": [1.0, 0.0, 0.0], "direction": direction, "order": 4}
            for direction in ([0.0, 0.0, 1.0], [1.0, 0.0, 0.0])
        ]
        self.assertEqual(len(orbit(self.POSE, axes)), 24)

    def test_every_turn_stands_for_twelve_and_a_ball_ends(self):
        glass = {"point": [1.0, 0.0, 0.0], "direction": [0.0, 0.0, 1.0], "order": None}
        self.assertEqual(len(orbit(self.POSE, [glass])), 12)
        ball = [{**glass, "direction": d} for d in ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0])]
        self.assertEqual(len(orbit(self.POSE, ball)), 144)

    def test_a_quarter_turn_about_z_takes_x_to_y(self):
        turned = rotate(QUARTER_ABOUT_Z, [1.0, 0.0, 0.0])
        for found, expected in zip(turned, [0.0, 1.0, 0.0]):
            self.assertAlmostEqual(found, expected)


class Messages(unittest.TestCase):
    def test_fields_go_where_they_belong(self):
        def point():
            return SimpleNamespace(x=0.0, y=0.0)

        def item():
            return SimpleNamespace(name="", at=point())

        message = SimpleNamespace(at=point(), items=[], numbers=None)
        fields = {"at": {"x": 1.0}, "items": [{"name": "a", "at": {"y": 2.0}}], "numbers": [1.0]}
        filled = fill(message, fields, {"items": item})
        self.assertEqual((filled.at.x, filled.at.y, filled.numbers), (1.0, 0.0, [1.0]))
        self.assertEqual((filled.items[0].name, filled.items[0].at.y), ("a", 2.0))

    def test_a_taxel_without_a_value_is_null(self):
        press = reading("arm", 1, "s", "base", STAMP, (1, 2, 3), (0, 0, 0, 1), [1.5, math.nan])
        self.assertEqual(press["image"], [1.5, None])
        self.assertEqual(press["pose"], {"position": [1, 2, 3], "orientation": [0, 0, 0, 1]})

    def test_the_box_of_a_mesh(self):
        triangle = struct.pack("<12fH", 0, 0, 1, 0, 0, 0, 2, 0, 0, 0, 3, -1, 0)
        stl = bytes(80) + struct.pack("<I", 1) + triangle
        self.assertEqual(stl_box(stl), [[0.0, 0.0, -1.0], [2.0, 3.0, 0.0]])
        self.assertIsNone(stl_box(b"solid of text"))
        self.assertIsNone(stl_box(stl[:-1]))


class Node(unittest.TestCase):
    """The node itself, where ROS is made of paper: it takes a press and publishes its belief."""

    def setUp(self):
        self.published, self.errors = [], []
        self.node = self.paper_node()

    def paper_node(self):
        """A node among stand-ins for the modules of ROS."""
        test = self

        class PaperNode:
            def __init__(self, name):
                self.parameters = {}

            def declare_parameter(self, name, value):
                self.parameters[name] = SimpleNamespace(value=value)

            def get_parameter(self, name):
                return self.parameters[name]

            def create_publisher(self, *_):
                return SimpleNamespace(publish=test.published.append)

            def create_subscription(self, *_):
                pass

            create_service = create_subscription

            def get_logger(self):
                return SimpleNamespace(error=test.errors.append, warning=test.errors.append)

        def header():
            return SimpleNamespace(frame_id="", stamp=SimpleNamespace(sec=0, nanosec=0))

        def pose():
            return SimpleNamespace(
                position=SimpleNamespace(x=0.0, y=0.0, z=0.0),
                orientation=SimpleNamespace(x=0.0, y=0.0, z=0.0, w=1.0),
            )

        def detection():
            box = SimpleNamespace(center=pose(), size=SimpleNamespace(x=0.0, y=0.0, z=0.0))
            return SimpleNamespace(header=header(), results=[], bbox=box, id="")

        def result():
            return SimpleNamespace(
                hypothesis=SimpleNamespace(class_id="", score=0.0),
                pose=SimpleNamespace(pose=pose(), covariance=[0.0] * 36),
            )

        class TransformException(Exception):
            pass

        paper = {
            "rclpy": {},
            "rclpy.node": {"Node": PaperNode},
            "rclpy.time": {"Time": object},
            "std_msgs.msg": {"Float64MultiArray": object},
            "std_srvs.srv": {"Trigger": object},
            "tf2_ros": {
                "Buffer": SimpleNamespace,
                "TransformException": TransformException,
                "TransformListener": lambda *_: None,
            },
            "vision_msgs.msg": {
                "Detection3D": detection,
                "Detection3DArray": lambda: SimpleNamespace(header=header(), detections=[]),
                "ObjectHypothesisWithPose": result,
            },
        }
        modules = {name: SimpleNamespace(**contents) for name, contents in paper.items()}
        with unittest.mock.patch.dict(sys.modules, modules):
            sys.modules.pop("palpate_node", None)
            import palpate_node

            return palpate_node.PalpateNode()

    def test_a_press_is_sent_and_its_belief_published(self):
        stamp = SimpleNamespace(**STAMP)
        transform = SimpleNamespace(
            translation=SimpleNamespace(x=0.1, y=0.2, z=0.3),
            rotation=SimpleNamespace(x=0.0, y=0.0, z=0.0, w=1.0),
        )
        found = SimpleNamespace(header=SimpleNamespace(stamp=stamp), transform=transform)
        self.node.buffer.lookup_transform = lambda *_: found
        server = unittest.mock.Mock()
        server.open_session.return_value = "s"
        server.boxes.return_value = {}
        server.add_readings.return_value = belief()
        self.node.palpate = server
        self.node.press(SimpleNamespace(data=[0.0, 5.0]))
        self.assertEqual(self.errors, [])
        session, [sent] = server.add_readings.call_args.args
        self.assertEqual((session, sent["seq"], sent["robot"]), ("s", 1, "arm"))
        self.assertEqual(sent["pose"]["position"], [0.1, 0.2, 0.3])
        [message] = self.published
        self.assertEqual(message.header.stamp.sec, 12)
        self.assertEqual(message.header.frame_id, "base_link")
        best = message.detections[0].results[0]
        self.assertEqual((best.hypothesis.class_id, best.pose.pose.position.z), ("mug", 3.0))

    def test_a_session_that_has_ended_is_followed_by_a_new_one(self):
        self.node.buffer.lookup_transform = lambda *_: SimpleNamespace(
            header=SimpleNamespace(stamp=SimpleNamespace(**STAMP)),
            transform=SimpleNamespace(
                translation=SimpleNamespace(x=0.0, y=0.0, z=0.0),
                rotation=SimpleNamespace(x=0.0, y=0.0, z=0.0, w=1.0),
            ),
        )
        server = unittest.mock.Mock()
        server.open_session.side_effect = ["first", "second"]
        server.boxes.return_value = {}
        closed = {"title": "closed", "detail": "the session is closed", "status": 409}
        server.add_readings.side_effect = [Refused(closed), belief()]
        self.node.palpate = server
        self.node.press(SimpleNamespace(data=[0.0]))
        self.node.press(SimpleNamespace(data=[0.0]))
        self.assertEqual(self.errors, ["a press was not sent: closed: the session is closed"])
        self.assertEqual([call.args[0] for call in server.add_readings.call_args_list], ["first", "second"])
        self.assertEqual(len(self.published), 1)


    def test_no_failure_of_a_call_leaves_the_callback(self):
        self.node.buffer.lookup_transform = lambda *_: SimpleNamespace(
            header=SimpleNamespace(stamp=SimpleNamespace(**STAMP)),
            transform=SimpleNamespace(
                translation=SimpleNamespace(x=0.0, y=0.0, z=0.0),
                rotation=SimpleNamespace(x=0.0, y=0.0, z=0.0, w=1.0),
            ),
        )
        for answer in ANSWERS:
            with self.subTest(answer=answer[:40]), answering(answer) as url:
                self.node.palpate = Palpate(url, timeout=2.0)
                self.node.session = "s"
                self.errors.clear()
                with unittest.mock.patch("palpate_http.RETRY_AFTER_S", 0.0):
                    self.node.press(SimpleNamespace(data=[0.0]))
                self.assertEqual(len(self.errors), 1, self.errors)
        self.node.palpate = unittest.mock.Mock(add_readings=lambda *_: {"poses": "of another form"})
        self.node.press(SimpleNamespace(data=[0.0]))
        self.assertIn("fault of this node", self.errors[-1])

    def test_boxes_that_cannot_be_had_do_not_lose_the_press(self):
        self.node.palpate = unittest.mock.Mock()
        self.node.palpate.boxes.side_effect = Unanswered("no mesh")
        self.node.palpate.add_readings.return_value = belief()
        transform = SimpleNamespace(
            translation=SimpleNamespace(x=0.0, y=0.0, z=0.0),
            rotation=SimpleNamespace(x=0.0, y=0.0, z=0.0, w=1.0),
        )
        stamp = SimpleNamespace(stamp=SimpleNamespace(**STAMP))
        found = SimpleNamespace(header=stamp, transform=transform)
        self.assertIs(self.node.send(SimpleNamespace(data=[0.0]), found)["session"], "s")


class Calls(unittest.TestCase):
    def test_every_failure_is_one_of_two_exceptions(self):
        for answer in ANSWERS:
            with self.subTest(answer=answer[:40]), answering(answer) as url:
                with unittest.mock.patch("palpate_http.RETRY_AFTER_S", 0.0):
                    with self.assertRaises((Refused, Unanswered)):
                        Palpate(url, timeout=2.0).close_session("s")

    def test_every_unit_of_the_api_has_its_length(self):
        root = os.path.join(os.path.dirname(__file__), "../../schemas/openapi.json")
        with open(root, encoding="utf-8") as file:
            units = json.load(file)["components"]["schemas"]["MeshUnit"]
        named = units.get("enum") or [one["const"] for one in units["oneOf"]]
        self.assertEqual(set(named), set(UNITS_M))


def http_answer(status, body, **headers):
    """An answer as bytes."""
    lines = [f"HTTP/1.1 {status} Whatever", f"Content-Length: {len(body)}", "Connection: close"]
    lines += [f"{name}: {value}" for name, value in headers.items()]
    return ("\r\n".join(lines) + "\r\n\r\n").encode() + body


ANSWERS = [
    http_answer(502, b"<html>bad gateway</html>"),
    http_answer(200, b"<html>sign in first</html>"),
    http_answer(200, b""),
    http_answer(200, b"\xff\xfe"),
    http_answer(500, b"[]"),
    http_answer(500, b"{}"),
    http_answer(503, b"busy", **{"Retry-After": "soon"}),
    http_answer(404, json.dumps({"title": "not found", "detail": "gone"}).encode()),
    http_answer(302, b"", Location="http://127.0.0.1:1/"),
    b"HTTP/1.1 200 OK\r\nContent-Length: 500\r\n\r\n{\"belief\"",
    b"HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\nzz\r\n",
    b"not http at all\r\n\r\n",
    b"",
]
"""What comes instead of an answer: of proxies, of broken connections, of other programs."""


class answering:  # noqa: N801, used like a function
    """A server that gives the same bytes to every request and closes."""

    def __init__(self, answer):
        self.answer = answer

    def __enter__(self):
        self.listener = socket.create_server(("127.0.0.1", 0))
        threading.Thread(target=self.serve, daemon=True).start()
        return f"http://127.0.0.1:{self.listener.getsockname()[1]}"

    def serve(self):
        try:
            while True:
                connection, _ = self.listener.accept()
                with connection:
                    connection.recv(65536)
                    connection.sendall(self.answer)
                    connection.shutdown(socket.SHUT_WR)
                    while connection.recv(65536):
                        pass
        except OSError:  # the listener or the connection was closed
            pass

    def __exit__(self, *_):
        self.listener.close()


@unittest.skipUnless(os.environ.get("PALPATE_SERVER"), "PALPATE_SERVER names no server")
class Server(unittest.TestCase):
    """Against a server that knows `mug`, with the readings of it in PALPATE_READINGS."""

    def setUp(self):
        self.palpate = Palpate(os.environ["PALPATE_SERVER"], os.environ.get("PALPATE_KEY"))
        with open(os.environ["PALPATE_READINGS"], encoding="utf-8") as file:
            self.readings = json.load(file)["readings"]

    def test_a_mug_is_detected_where_it_was_touched(self):
        session = self.palpate.open_session("world")
        for taken in self.readings:
            pose = taken["pose"]
            press = reading(
                "node", taken["seq"], taken["sensor"], "world", STAMP,
                pose["position"], pose["orientation"],
                [math.nan if p is None else p for p in taken["image"]],
            )  # fmt: skip
            found = self.palpate.add_readings(session, [press])
        boxes = self.palpate.boxes(session)
        detection = detection_array(found, "world", STAMP, boxes)["detections"][0]
        best = detection["results"][0]
        self.assertEqual(best["hypothesis"]["class_id"], "mug")
        mugs = [r["hypothesis"]["score"] for r in detection["results"] if r["hypothesis"]["class_id"] == "mug"]
        self.assertTrue(0.9 < sum(mugs) < 1.0001, mugs)
        self.assertTrue(all(best["pose"]["covariance"][7 * i] > 0 for i in range(6)))
        # The mug lies where it was touched: every touch within its box and a centimetre more.
        center = [detection["bbox"]["center"]["position"][axis] for axis in "xyz"]
        half_diagonal = math.dist((0, 0, 0), detection["bbox"]["size"].values()) / 2
        self.assertTrue(0.03 < half_diagonal < 0.2, half_diagonal)
        for taken in self.readings:
            distance = math.dist(center, taken["pose"]["position"])
            self.assertLess(distance, half_diagonal + 0.01)
        self.palpate.close_session(session)

    def test_a_refusal_names_the_field(self):
        session = self.palpate.open_session("world")
        wrong = {**self.readings[0], "frame_id": "camera"}
        with self.assertRaisesRegex(Refused, "/readings/0/frame_id"):
            self.palpate.add_readings(session, [wrong])


if __name__ == "__main__":
    unittest.main()
