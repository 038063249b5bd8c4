"""Plays the examples of the API's description against a fresh server, in the order of a story.

    examples.py PALPATE FOLDER [--record]

Every example of a request is sent as it stands (ids of sessions and keys are replaced by those of
the server), and must get the documented success. Answers, and the committed examples of answers,
must satisfy their schemas. `--record` writes schemas/examples/responses.json anew.
"""

import http.server
import json
import math
import re
import subprocess
import sys
import threading
import time
import urllib.error
import urllib.parse
import urllib.request
from pathlib import Path

from jsonschema import Draft202012Validator

ROOT = Path(__file__).resolve().parents[2]
RESPONSES = ROOT / "schemas/examples/responses.json"
EXAMPLE_ID = "01890a5d-ac96-774b-bcce-b302099a8057"
"""The id of a session in examples of requests."""
ITEMS_MAX = 3
"""Most items of a list of objects in a recorded answer."""
LINES_MAX = 12
"""Most lines of a recorded text."""
WAIT_S_MAX = 120
NO_SECRETS = {"palpate": f"palpate_{32 * '0'}_{64 * '0'}", "whsec": f"whsec_{43 * 'A'}="}
"""Stand for the secrets of keys and webhooks in recorded answers, by how those begin."""
NO_EXAMPLE = {
    *(f"model/{kind}" for kind in ("stl", "obj", "ply", "off", "gltf-binary", "3mf")),
    "image/png",
    "application/octet-stream",
}
"""Files: their bytes are no example."""


class Story:
    """A server, the description, and what came so far."""

    def __init__(self, server: str, is_recording: bool):
        self.server = server
        self.description = json.loads((ROOT / "schemas/openapi.json").read_text())
        self.operations = {
            operation["operationId"]: (method.upper(), path, operation)
            for path, item in self.description["paths"].items()
            for method, operation in item.items()
            if isinstance(operation, dict) and "operationId" in operation
        }
        if is_recording:
            self.take_requests()
        self.values: dict[str, str] = {}
        self.recorded: dict[str, object] = {}
        self.told: set[str] = set()

    def take_requests(self) -> None:
        """Takes the examples of requests from their files: the description has them later."""
        for operation_id, (_, _, operation) in self.operations.items():
            file = RESPONSES.parent / f"{operation_id}.json"
            if "requestBody" in operation and file.exists():
                content = operation["requestBody"]["content"]["application/json"]
                content["example"] = json.loads(file.read_text())

    def tell(self, operation_id: str, query: str = "", body: object = None, headers=None, **values: str):
        """Sends an operation with its example, checks the answer and returns it."""
        method, path, operation = self.operations[operation_id]
        shown = {one["name"]: str(one["example"]) for one in operation.get("parameters", []) if "example" in one}
        for name, value in {**shown, **self.values, **values}.items():
            path = path.replace("{" + name + "}", urllib.parse.quote(value))
        data, sent = None, dict(headers or {})
        if "requestBody" in operation:
            media = operation["requestBody"]["content"]
            if isinstance(body, bytes):
                data = body
                sent.setdefault("content-type", "application/octet-stream")
            else:
                example = media["application/json"].get("example")
                assert example is not None, f"{operation_id}: the request has no example"
                text = json.dumps(example if body is None else body)
                self.check(media["application/json"]["schema"], json.loads(text), f"{operation_id}: request")
                data = text.replace(EXAMPLE_ID, self.values.get("session", EXAMPLE_ID)).encode()
                sent["content-type"] = "application/json"
        begun = time.monotonic()
        status, content_type, answer = self.send(method, path + query, data, sent)
        (success,) = (code for code in operation["responses"] if code.startswith("2"))
        assert status == int(success), f"{operation_id}: {status}, expected {success}: {answer[:600]!r}"
        self.told.add(operation_id)
        if (took := time.monotonic() - begun) > 2:
            print(f"{took:6.1f} s {operation_id}")
        content = operation["responses"][success].get("content", {})
        if content_type in NO_EXAMPLE or not content:
            return answer
        assert content_type in content, f"{operation_id}: {content_type} is not described"
        if content_type == "text/event-stream":
            fields = dict(line.split(": ", 1) for line in answer.decode().splitlines())
            schema = content[content_type]["schema"]
            self.check(schema, fields, f"{operation_id}: event")
            data = json.loads(fields["data"])
            self.check(schema["properties"]["data"]["contentSchema"], data, f"{operation_id}: data of an event")
            fields["data"] = json.dumps(shortened(data), ensure_ascii=False)
            self.recorded.setdefault(operation_id, fields)
            return answer
        if content_type != "application/json":
            lines = answer.decode().splitlines()[:LINES_MAX]
            self.recorded.setdefault(operation_id, "\n".join(line if len(line) < 300 else line[:299] + "…" for line in lines) + "\n")
            return answer
        document = json.loads(answer)
        self.check(content[content_type]["schema"], document, f"{operation_id}: answer")
        self.recorded.setdefault(operation_id, shortened(document))
        return document

    def send(self, method: str, path: str, data: bytes | None = None, headers=None) -> tuple[int, str, bytes]:
        """The status, content type and body of an answer."""
        request = urllib.request.Request(self.server + path, data=data, method=method, headers=headers or {})
        try:
            answer = urllib.request.urlopen(request, timeout=WAIT_S_MAX)
        except urllib.error.HTTPError as refused:
            answer = refused
        with answer:
            content_type = (answer.headers["content-type"] or "").split(";")[0]
            # A stream of events does not end: the first one is the example.
            is_stream = content_type == "text/event-stream"
            return answer.status, content_type, first_event(answer) if is_stream else answer.read()

    def post(self, path: str, body: object) -> dict:
        """A request that only prepares."""
        status, _, answer = self.send("POST", path, json.dumps(body).encode(), {"content-type": "application/json"})
        assert status in (200, 201, 202), f"{path}: {status} {answer!r}"
        return json.loads(answer)

    def finish(self, job: str) -> None:
        """Waits for the end of a job."""
        deadline = time.monotonic() + WAIT_S_MAX
        while (state := json.loads(self.send("GET", f"/v1/jobs/{job}")[2]))["state"] in ("queued", "running"):
            assert time.monotonic() < deadline, state
            time.sleep(0.1)
        assert state["state"] == "succeeded", state
        print(f"{WAIT_S_MAX - deadline + time.monotonic():6.1f} s {state['catalogue']}")

    def check(self, schema: dict, value: object, where: str) -> None:
        """Checks a value against a schema of the description."""
        whole = {**schema, "components": self.description["components"]}
        faults = [f"{fault.json_path}: {fault.message[:200]}" for fault in Draft202012Validator(whole).iter_errors(value)]
        assert not faults, f"{where}: {faults[:5]}"


class Receiver(http.server.BaseHTTPRequestHandler):
    """Takes what webhooks send."""

    def do_POST(self) -> None:
        self.rfile.read(int(self.headers["content-length"]))
        self.send_response(204)
        self.end_headers()

    def log_message(self, format: str, *arguments: object) -> None:
        """Says nothing."""


def first_event(stream) -> bytes:
    """The lines of a stream up to the first empty one."""
    lines = []
    while (line := stream.readline()).strip():
        lines.append(line)
    return b"".join(lines)


def shortened(value: object) -> object:
    """An answer as an example: the first items of its lists, six digits, no secret."""
    if isinstance(value, dict):
        return {
            name: NO_SECRETS[one.split("_")[0]] if name == "secret" else shortened(one)
            for name, one in value.items()
        }
    if isinstance(value, list):
        nested = any(isinstance(one, dict) for one in value)
        return [shortened(one) for one in (value[:ITEMS_MAX] if nested else value)]
    if isinstance(value, float) and value and math.isfinite(value):
        return float(f"{value:.6g}")
    return value


def tell(story: Story, palpate: str, folder: Path) -> None:
    """The story."""
    for operation in ("livez", "readyz", "version", "whoami"):
        story.tell(operation)

    meshes = folder / "meshes"
    subprocess.run([palpate, "objects", "example", "--all", "--out", meshes], check=True, stdout=subprocess.DEVNULL)
    story.tell("create_object")
    story.post("/v1/objects", {"name": "hammer"})
    story.tell("put_mesh", "?unit=mm&format=stl", (meshes / "mug.stl").read_bytes())
    story.tell("put_mesh", "?unit=mm&format=stl", (meshes / "hammer.stl").read_bytes(), object="hammer")
    story.tell("get_object")
    story.tell("update_object")
    story.tell("get_mesh")
    story.tell("get_thumbnail")
    story.tell("set_object_labels")
    story.tell("list_objects", "?limit=2")
    story.tell("list_reference_bodies")
    story.tell("get_reference_mesh")

    story.tell("create_sensor")
    story.tell("get_sensor")
    story.tell("set_sensor_labels")
    story.tell("list_sensors", "?limit=2")
    story.tell("check_reading")
    story.tell("calibrate_sensor")
    story.tell("get_calibration")
    story.tell("get_sensor_health")
    story.tell("get_sensor_package")
    story.tell("analyse_coverings")
    story.post("/v1/sensors", {"name": "pad", "preset": "xela-uskin-4x4"})
    story.tell("commission_sensor")
    commissioning = story.operations["commission_sensor"][2]["requestBody"]["content"]["application/json"]["example"]
    story.tell("commission_sensor", body={**commissioning, "apply": True}, sensor="pad")
    story.tell("get_passport", sensor="pad")

    job = story.tell("start_training")["id"]
    story.finish(job)
    story.tell("get_job", job=job)
    story.tell("job_events", job=job)
    story.tell("list_jobs", "?limit=2")
    story.tell("get_catalogue")
    story.tell("set_catalogue_labels")
    story.tell("list_catalogues", "?limit=2")
    story.tell("list_versions", "?limit=2")
    story.tell("get_version")
    story.tell("get_report")
    tag = story.tell("get_current")["revision"]
    story.tell("set_current", headers={"if-match": f'"{tag}"'})

    maps = {"objects": ["mug", "hammer"], "readings_per_object": 100, "seed": 3, "geometric": {"kind": "solid", "cell": 0.004}}
    for name in ("lab", "lab-2"):
        appearance = {"appearance": {"n_classes": [8]}} if name == "lab" else {}
        story.finish(story.post(f"/v1/catalogues/{name}/trainings", {**maps, **appearance})["id"])
    for operation, query in (("get_occupancy", "?slice=8"), ("get_occupancy_png", ""), ("get_occupancy_ply", "?form=points")):
        story.tell(operation, query, name="lab")
    story.tell("get_object_map", "?limit=2", name="lab")
    story.tell("get_interest", name="lab")
    story.tell("get_appearance_report", name="lab")
    story.tell("merge_maps", name="lab")

    pose = {"position": [0.4, -0.1, 0.25], "orientation": [0, 0, 0, 1]}
    bounded = {"kind": "bounded", "pose": pose, "half_extents": [0.01, 0.01, 0.01], "half_angle": 0.2}
    placed = story.post("/v1/sessions", {"catalogue": "lab", "method": "geometric", "pose_prior": bounded})["id"]
    image = [0.0] * 14 + [4000.0, 8000.0] + [0.0] * 20
    story.post(f"/v1/sessions/{placed}/readings", {"readings": [{"sensor": "digitacts-6x6", "pose": pose, "image": image}]})
    story.tell("get_marginals", session=placed)

    session = story.values["session"] = story.tell("create_session")["id"]
    story.tell("ask_next_touches")
    story.tell("add_readings")
    story.tell("get_session")
    story.tell("set_session_labels")
    story.tell("list_sessions", "?limit=2")
    story.tell("extend_session")
    story.tell("get_fleet", "?limit=2")
    story.tell("acknowledge_sessions")
    story.tell("retract_robot_reading")
    story.tell("retract_reading")
    story.tell("close_session")
    story.tell("session_events")
    story.tell("events", f"?sessions={session}")
    story.tell("close_sessions")
    story.tell("delete_session")

    package = story.tell("get_package")
    story.tell("get_block", hash=package["blocks"][0])
    forwarding = story.operations["forward_session"][2]["requestBody"]["content"]["application/json"]["example"]
    # Its id states its time, which must be near that of the server.
    now = f"{int(time.time() * 1000):012x}"
    forwarded = f"{now[:8]}-{now[8:]}{EXAMPLE_ID[13:-1]}9"
    story.tell("forward_session", body={**forwarding, "version_hash": package["hash"]}, session=forwarded)
    story.tell("forward_entries", session=forwarded)
    story.tell("get_forwarding")

    recorded = folder / "recording.json"
    for index in range(20):
        name = ("mug", "hammer")[index % 2]
        command = [palpate, "--server", story.server, "--json", "touch", "--object", name, "--readings", "3"]
        touched = [*command, "--mesh", meshes / f"{name}.stl", "--seed", str(index)]
        with recorded.open("w") as out:
            subprocess.run(touched, stdout=out, stderr=subprocess.DEVNULL, check=False)
        touched_session = json.loads(recorded.read_text())["session"]
        if index == 0:
            story.tell("get_belief", "?poses=1", session=touched_session)
            story.tell("explain_session", session=touched_session)
            story.tell("replay_session", session=touched_session)
            story.tell("list_session_readings", session=touched_session)
        story.post(f"/v1/sessions/{touched_session}/close", {"object": name})
    job = story.tell("recalibrate_catalogue")["id"]
    story.finish(job)
    story.finish(story.tell("shadow_version")["id"])
    story.tell("set_alias")
    story.tell("remove_alias")
    story.tell("add_object_readings")
    story.tell("list_object_readings")

    job = story.post("/v1/catalogues/other/trainings", {"objects": ["hammer"], "readings_per_object": 20_000})["id"]
    story.tell("cancel_job", job=job)
    while json.loads(story.send("GET", f"/v1/jobs/{job}")[2])["state"] in ("queued", "running"):
        time.sleep(0.1)
    story.tell("delete_job", job=job)

    key = story.tell("create_key")["key"]["id"]
    story.tell("list_keys")
    story.tell("get_key", key=key)
    story.tell("rotate_key", key=key)
    story.tell("bind_robot", robot="left-arm")
    story.tell("list_robots")
    story.tell("release_robot", robot="left-arm")
    story.tell("revoke_key", key=key)
    story.tell("list_audit", "?limit=2")

    receiver = http.server.HTTPServer(("127.0.0.1", 0), Receiver)
    threading.Thread(target=receiver.serve_forever, daemon=True).start()
    hook = story.tell("create_webhook")["webhook"]["id"]
    story.tell("list_webhooks")
    story.tell("get_webhook", webhook=hook)
    story.tell("update_webhook", webhook=hook)
    url = json.dumps({"url": f"http://127.0.0.1:{receiver.server_port}/"}).encode()
    story.send("PATCH", f"/v1/webhooks/{hook}", url, {"content-type": "application/json"})
    delivery = story.tell("test_webhook", webhook=hook)
    assert delivery["state"] == "delivered", delivery
    story.tell("list_webhook_deliveries", webhook=hook)
    story.tell("get_webhook_delivery", webhook=hook, delivery=delivery["id"])
    story.tell("redeliver_webhook", webhook=hook, delivery=delivery["id"])
    story.tell("rotate_webhook_secret", webhook=hook)
    story.tell("delete_webhook", webhook=hook)

    story.tell("get_storage")
    story.tell("take_snapshot")
    story.tell("compact")
    story.tell("metrics")
    story.tell("delete_version", name="lab", version="2")
    story.tell("delete_catalogue", name="lab-2")
    story.tell("delete_object", object="hammer")
    story.tell("delete_sensor")


def check_committed(story: Story) -> None:
    """Every JSON answer has an example, and examples satisfy their schemas."""
    for operation_id, (_, _, operation) in story.operations.items():
        for code, response in operation["responses"].items():
            for content_type, content in response.get("content", {}).items():
                if content_type in NO_EXAMPLE:
                    continue
                assert "example" in content, f"{operation_id}: the answer {code} has no example"
                story.check(content["schema"], content["example"], f"{operation_id}: example of {code}")


def main() -> None:
    palpate, folder = sys.argv[1], Path(sys.argv[2])
    log = (folder / "log").open("w")
    process = subprocess.Popen(
        [palpate, "serve", "--listen", "127.0.0.1:0", "--data", folder / "data", "--json",
         "--webhook-allow-private"],
        stdout=subprocess.PIPE, stderr=log, text=True,
    )  # fmt: skip
    try:
        story = Story(json.loads(process.stdout.readline())["server"], "--record" in sys.argv)
        tell(story, palpate, folder)
    finally:
        process.terminate()
        process.wait(30)
    left = story.operations.keys() - story.told
    assert not left, f"the story leaves out {sorted(left)}"
    assert "panicked" not in (folder / "log").read_text(), "something panicked"
    if "--record" in sys.argv:
        RESPONSES.write_text(json.dumps(story.recorded, indent=1, ensure_ascii=False) + "\n")
        print(f"wrote {RESPONSES}: now UPDATE_OPENAPI=1 cargo test -p palpate-server --all-features openapi")
        return
    check_committed(story)
    print(f"every example of {len(story.told)} operations runs")


if __name__ == "__main__":
    main()
