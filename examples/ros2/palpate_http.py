"""The calls to Palpate that the node makes, with the standard library alone.

A generated client (docs/clients.md) offers the same with types; this one needs no installation
on a robot.
"""

import http.client
import json
import struct
import time
import urllib.error
import urllib.parse
import urllib.request
from email.utils import parsedate_to_datetime

ATTEMPTS = 3
RETRY_AFTER_S = 1.0
WAIT_S_MAX = 10.0  # a longer wait is the caller's decision


class Refused(Exception):
    """A refused request, with the problem document (RFC 9457) as `problem`."""

    def __init__(self, problem):
        fields = "; ".join(f"{e['pointer']}: {e['detail']}" for e in problem.get("errors", []))
        super().__init__(f"{problem['title']}: {fields or problem['detail']}")
        self.problem = problem


class Unanswered(Exception):
    """A call without an answer of Palpate: no connection, a broken one, or a proxy's own words.

    Whether the request took effect is unknown.
    """


UNITS_M = {"m": 1.0, "mm": 1e-3, "cm": 1e-2, "in": 25.4e-3}
"""Units of mesh files, metres."""


class Palpate:
    """A server at a URL, with a key if it requires one."""

    def __init__(self, url, key=None, timeout=10.0):
        self.url, self.timeout = url.rstrip("/"), timeout
        self.headers = {"authorization": f"Bearer {key}"} if key else {}

    def open_session(self, frame_id, **options):
        """Starts a session with sensor poses in `frame_id` and returns its id."""
        # Not repeated: the first attempt may have made one.
        body = {"frame_id": frame_id, **options}
        return self._json("POST", "/v1/sessions", body, is_repeatable=False)["id"]

    def add_readings(self, session, readings):
        """Adds readings and returns the belief. Repeated readings count once, by robot and seq."""
        path = f"/v1/sessions/{session}/readings"
        return self._json("POST", path, {"readings": readings})["belief"]

    def close_session(self, session):
        """Closes a session. Its belief can still be read."""
        return self._json("POST", f"/v1/sessions/{session}/close")

    def boxes(self, session):
        """Returns the bounding box (low, high) of each object in the object frame, in metres.

        Only objects with a binary STL mesh are included.
        """
        session = self._json("GET", f"/v1/sessions/{session}")
        name = urllib.parse.quote(session["catalogue"])
        report = self._json("GET", f"/v1/catalogues/{name}/versions/{session['version']}/report")
        boxes = {}
        for trained in report["objects"]:
            box = self._mesh_box(trained["id"])
            if box:
                origin = trained["origin_in_mesh"]
                boxes[trained["id"]] = [[c - o for c, o in zip(corner, origin)] for corner in box]
        return boxes

    def _mesh_box(self, object_id):
        try:
            mesh = self._json("GET", f"/v1/objects/{object_id}")["mesh"]
            if not mesh or mesh["format"] != "stl":
                return None
            stl = self._request("GET", f"/v1/objects/{object_id}/mesh")
        except Refused as refused:
            if refused.problem["status"] == 404:  # it was deleted since
                return None
            raise
        box = stl_box(stl)
        scale = UNITS_M.get(mesh["unit"])
        return box and scale and [[scale * c for c in corner] for corner in box]

    def _json(self, method, path, body=None, is_repeatable=True):
        answer = self._request(method, path, body, is_repeatable)
        try:
            return json.loads(answer)
        except ValueError:
            raise Unanswered(f"{method} {path}: the answer is not JSON: {answer[:80]!r}") from None

    def _request(self, method, path, body=None, is_repeatable=True):
        headers = dict(self.headers)
        data = None
        if body is not None:
            data, headers["content-type"] = json.dumps(body).encode(), "application/json"
        request = urllib.request.Request(self.url + path, data, headers, method=method)
        attempts = ATTEMPTS if is_repeatable else 1
        for attempt in range(1, attempts + 1):
            try:
                with urllib.request.urlopen(request, timeout=self.timeout) as answer:
                    return answer.read()
            except urllib.error.HTTPError as error:
                wait = seconds_to_wait(error.headers)
                if wait is None or wait > WAIT_S_MAX or attempt == attempts:
                    raise refusal(error) from None
            except (OSError, http.client.HTTPException) as error:  # it may be stored: the same again
                if attempt == attempts:
                    raise Unanswered(f"{method} {path}: {error!r}") from error
                wait = RETRY_AFTER_S
            time.sleep(wait)


def refusal(error):
    """Returns the exception of an answer other than 2xx: the server's problem, or a proxy's words."""
    try:
        body = error.read()
        problem = json.loads(body)
        return Refused({**problem, "status": error.code})
    except (OSError, http.client.HTTPException, ValueError, TypeError, KeyError):
        return Unanswered(f"status {error.code} without a problem document")


def seconds_to_wait(headers):
    """Returns the wait by `Retry-After`, seconds or a date; None without a readable one."""
    asked = (headers.get("retry-after") or "").strip()
    if asked.isascii() and asked.isdigit():
        return float(asked)
    try:
        until, sent = (parsedate_to_datetime(text) for text in (asked, headers.get("date") or ""))
        return max(0.0, (until - sent).total_seconds())
    except (TypeError, ValueError):  # not dates, or one of them without a time zone
        return None


def stl_box(stl):
    """Returns the corners (low, high) of a binary STL file, in its unit; None for other files."""
    if len(stl) < 84 or len(stl) != 84 + 50 * struct.unpack_from("<I", stl, 80)[0]:
        return None
    corners = [
        struct.unpack_from("<3f", stl, 84 + 50 * triangle + 12 * corner)
        for triangle in range((len(stl) - 84) // 50)
        for corner in (1, 2, 3)
    ]
    if not corners:
        return None
    return [list(map(min, zip(*corners))), list(map(max, zip(*corners)))]
