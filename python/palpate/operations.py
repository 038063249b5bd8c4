"""All operations of a client, described once for both transports.

Names, limits and semantics are those of docs/http.md. SI units, quaternions x, y, z, w.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy.typing as npt

from palpate._native import Mesh
from palpate.administration import Administration
from palpate.belief import Belief
from palpate.documents import Added, Job, NextTouches, ObjectInfo, SensorInfo, Session
from palpate.errors import JobFailedError
from palpate.inspection import Inspection
from palpate.pose import Pose, PoseLike
from palpate.readings import Readings, image_to_wire
from palpate.steps import (
    Document,
    Request,
    Sleep,
    Steps,
    ask,
    ask_for_bytes,
    ask_for_nothing,
    delete,
    get,
    operation,
    pages,
    patch,
    post,
    put,
    same,
)

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from palpate.options import (
        NextTouchOptions,
        RecalibrationOptions,
        SensorOptions,
        SessionOptions,
        TrainingOptions,
    )

READINGS_MAX = 1_000
"""Most readings of one request."""
TAXELS_MAX = 4_000_000
"""Most taxels of one request."""
BODY_TAXELS = 500_000
"""Most taxels that are sent at once: 32 MB of JSON hold this many in any case."""
POLL_MIN, POLL_MAX = 0.1, 1.0
"""Seconds between two looks at a job; they grow."""

MEDIA_TYPES = {
    "stl": "model/stl",
    "obj": "model/obj",
    "ply": "model/ply",
    "off": "model/off",
    "glb": "model/gltf-binary",
    "3mf": "model/3mf",
}

Progress = Callable[[Job], None]


def read_job(job: str) -> Steps[Job]:
    """Reads a job."""
    return ask(get("v1", "jobs", job), Job.from_wire)


def wait(job: Job | str, progress: Progress | None, timeout: float | None) -> Steps[Job]:
    """Waits for the end of a job."""
    pause, waited = POLL_MIN, 0.0
    while True:
        state = yield from read_job(job if isinstance(job, str) else job.id)
        if progress is not None:
            progress(state)
        if state.is_final:
            break
        if timeout is not None and waited >= timeout:
            raise JobFailedError(f"job {state.id} has not ended after {waited:.0f} s", state)
        yield Sleep(pause)
        waited += pause
        pause = min(1.5 * pause, POLL_MAX)
    if state.state != "succeeded":
        reason = f": {state.reason}" if state.reason else ""
        raise JobFailedError(f"job {state.id} {state.state}{reason}", state)
    return state


def start(name: str, sensor: str | None, options: TrainingOptions) -> Steps[Job]:
    """Starts a training."""
    document = {"sensor": sensor, **options}
    return ask(post("v1", "catalogues", name, "trainings").with_json(document), Job.from_wire)


def add_documents(path: tuple[str, ...], readings: list[Document], **query: Any) -> Request:
    """The request that adds readings; harmless to repeat if all of them have numbers."""
    is_harmless = all("robot" in one and "seq" in one for one in readings)
    request = post(*path).with_query(**query).with_json({"readings": readings})
    return request.repeatable(is_harmless)


def add_in_parts(path: tuple[str, ...], readings: list[Document], **query: Any) -> Steps[Added]:
    """Adds readings in requests of a permitted size; the answer counts all of them."""
    if not readings:
        raise ValueError("readings: came empty, expected at least one")
    largest = max(len(one.get("image", [])) for one in readings)
    size = max(1, min(READINGS_MAX, BODY_TAXELS // max(1, largest)))
    n_new = n_repeated = 0
    warnings = []
    for first in range(0, len(readings), size):
        request = add_documents(path, readings[first : first + size], **query)
        added = yield from ask(request, Added.from_wire)
        n_new, n_repeated = n_new + added.n_new, n_repeated + added.n_repeated
        warnings += added.warnings
    return Added(n_new, n_repeated, added.n_readings, warnings, added.belief)


def close(
    session: str, truth: str | None, none_of_these: bool, pose: PoseLike | None
) -> Steps[Session]:
    """Closes a session."""
    document = {
        "object": truth,
        "none_of_these": True if none_of_these else None,
        "pose": None if pose is None else Pose.of(pose).to_wire(),
    }
    request = post("v1", "sessions", session, "close").with_json(document).repeatable()
    return ask(request, Session.from_wire)


def create(options: SessionOptions) -> Steps[Session]:
    """Creates a session."""
    return ask(post("v1", "sessions").with_json({**options}), Session.from_wire)


def read_belief(session: str, poses: int | None, at: int | None) -> Steps[Belief]:
    """Reads the belief of a session."""
    request = get("v1", "sessions", session, "belief").with_query(poses=poses, at=at)
    return ask(request, Belief.from_wire)


def rank(
    session: str,
    sensor: str,
    candidates: Sequence[tuple[PoseLike, float]] | None,
    costs: Sequence[float] | None,
    workspace: tuple[npt.ArrayLike, float] | None,
    options: NextTouchOptions,
) -> Steps[NextTouches]:
    """Ranks the next touches of a session."""
    document: Document = {"sensor": sensor, **options}
    if candidates is not None:
        document["candidates"] = [
            {"pose": Pose.of(pose).to_wire(), "reach_m": reach} for pose, reach in candidates
        ]
        if costs is not None:
            if len(costs) != len(candidates):
                words = f"costs: {len(costs)} came, expected {len(candidates)}: one a candidate"
                raise ValueError(words)
            for one, cost in zip(document["candidates"], costs, strict=True):
                one["cost"] = cost
    if workspace is not None:
        center, radius = workspace
        document["workspace"] = {"center": image_to_wire(center), "radius": radius}
    request = post("v1", "sessions", session, "next-touches").with_json(document).repeatable()
    return ask(request, NextTouches.from_wire)


class Operations(Administration, Inspection):
    """The operations of `Client` and `AsyncClient`."""

    # The server.

    @operation
    def version(self) -> Steps[Document]:
        """Returns the name and version of the server."""
        return ask(get("version"), same)

    @operation
    def ready(self) -> Steps[Document]:
        """Checks that the server is ready."""
        return ask(get("readyz"), same)

    @operation
    def whoami(self) -> Steps[Document]:
        """Returns your key and role."""
        return ask(get("v1", "whoami"), same)

    # Sensors.

    @operation
    def sensors(self, *, labels: str | None = None) -> Steps[list[SensorInfo]]:
        """Returns all sensors, or those with all these labels (`site:oslo,shift`)."""
        return pages(get("v1", "sensors").with_query(labels=labels), SensorInfo.from_wire)

    @operation
    def sensor(self, sensor: str) -> Steps[SensorInfo]:
        """Returns a sensor, by id or name."""
        return ask(get("v1", "sensors", sensor), SensorInfo.from_wire)

    @operation
    def create_sensor(
        self,
        /,
        name: str,
        *,
        preset: str | None = None,
        description: Document | None = None,
        **options: Unpack[SensorOptions],
    ) -> Steps[SensorInfo]:
        """Creates a sensor from a preset or a description (`DescribeSensor` of the API)."""
        document = {"name": name, "preset": preset, "description": description, **options}
        return ask(post("v1", "sensors").with_json(document), SensorInfo.from_wire)

    @operation
    def delete_sensor(self, sensor: str) -> Steps[None]:
        """Deletes a sensor that nothing needs."""
        return ask_for_nothing(delete("v1", "sensors", sensor))

    @operation
    def check_reading(
        self, sensor: str, image: npt.ArrayLike, pose: PoseLike | None = None
    ) -> Steps[Document]:
        """Reports how the server interprets a reading. Nothing is stored."""
        document = {
            "sensor": sensor,
            "image": image_to_wire(image),
            "pose": None if pose is None else Pose.of(pose).to_wire(),
        }
        return ask(post("v1", "sensors", sensor, "check").with_json(document).repeatable(), same)

    @operation
    def calibrate_sensor(self, sensor: str, indentation: Document) -> Steps[Document]:
        """Calibrates a sensor from indentations (`response` and `spread`)."""
        request = post("v1", "sensors", sensor, "calibration").with_json(indentation)
        return ask(request, same)

    @operation
    def commission_sensor(
        self,
        sensor: str,
        readings: Readings,
        *,
        object: str | None = None,
        reference_body: str | None = None,
        session_from_object: PoseLike | None = None,
        apply: bool = False,
        seed: int | None = None,
    ) -> Steps[Document]:
        """Judges a sensor and its robot by touches of a known object.

        `readings` are in the numbers that the driver sends, whatever their units.
        """
        sent = [{"image": one["image"], "pose": one["pose"]} for one in readings.to_wire(sensor)]
        known = None if session_from_object is None else Pose.of(session_from_object).to_wire()
        document = {
            "readings": sent,
            "object": object,
            "reference_body": reference_body,
            "session_from_object": known,
            "apply": apply,
            "seed": seed,
        }
        request = post("v1", "sensors", sensor, "commissionings").with_json(document)
        return ask(request.repeatable(not apply), same)

    @operation
    def passport(self, sensor: str, number: int | None = None) -> Steps[Document]:
        """Returns the passport of a sensor."""
        return ask(get("v1", "sensors", sensor, "passport").with_query(number=number), same)

    @operation
    def sensor_health(self, sensor: str) -> Steps[Document]:
        """Says whether to commission or calibrate a sensor again, and why."""
        return ask(get("v1", "sensors", sensor, "health"), same)

    # Objects.

    @operation
    def objects(self, *, labels: str | None = None) -> Steps[list[ObjectInfo]]:
        """Returns all objects, or those with all these labels (`site:oslo,shift`)."""
        return pages(get("v1", "objects").with_query(labels=labels), ObjectInfo.from_wire)

    @operation
    def object(self, object: str) -> Steps[ObjectInfo]:
        """Returns an object, by id or name."""
        return ask(get("v1", "objects", object), ObjectInfo.from_wire)

    @operation
    def create_object(self, name: str, *, description: str | None = None) -> Steps[ObjectInfo]:
        """Creates an object."""
        document = {"name": name, "description": description}
        return ask(post("v1", "objects").with_json(document), ObjectInfo.from_wire)

    @operation
    def update_object(
        self, object: str, *, name: str | None = None, description: str | None = None
    ) -> Steps[ObjectInfo]:
        """Changes an object's name or description."""
        document = {"name": name, "description": description}
        return ask(patch("v1", "objects", object).with_json(document), ObjectInfo.from_wire)

    @operation
    def delete_object(self, object: str) -> Steps[None]:
        """Deletes an object with its mesh and readings. Trained versions still recognise it."""
        return ask_for_nothing(delete("v1", "objects", object))

    @operation
    def put_mesh(
        self,
        object: str,
        mesh: Mesh | Path | str | bytes,
        *,
        unit: str | None = None,
        format: str | None = None,
    ) -> Steps[Document]:
        """Uploads or replaces an object's mesh: a `Mesh`, the path of a file, or its bytes.

        `unit` (m, mm, cm, in) is mandatory for files, except GLB and 3MF, which record it; `format`
        (stl, obj, ply, off, glb, 3mf) is needed for bytes.
        """
        content: bytes
        if isinstance(mesh, Mesh):
            content, unit, format = mesh.to_off(), "m", "off"
        elif isinstance(mesh, bytes):
            content = mesh
        else:
            content = Path(mesh).read_bytes()
            format = format or Path(mesh).suffix.removeprefix(".").lower()
        if format not in MEDIA_TYPES:
            raise ValueError(f"format: came {format!r}, expected one of {', '.join(MEDIA_TYPES)}")
        if unit is None and format not in ("glb", "3mf"):
            expected = "expected m, mm, cm or in"
            raise ValueError(f"unit: is missing, {expected}: {format} does not record it")
        request = put("v1", "objects", object, "mesh").with_query(unit=unit)
        return ask(request.with_content(MEDIA_TYPES[format], content), same)

    @operation
    def mesh(self, object: str) -> Steps[bytes]:
        """Returns the file of an object's mesh, as uploaded."""
        return ask_for_bytes(get("v1", "objects", object, "mesh"))

    @operation
    def add_training_readings(
        self,
        object: str,
        sensor: str,
        readings: Readings,
        *,
        robot: str | None = None,
        first_seq: int = 0,
    ) -> Steps[Added]:
        """Adds training readings of an object at rest.

        `robot` and `first_seq` number them, so that repeated ones count once; only then a lost
        connection is retried.
        """
        documents = readings.to_wire(sensor, robot=robot, first_seq=first_seq)
        return add_in_parts(("v1", "objects", object, "readings"), documents)

    # Catalogues and trainings.

    @operation
    def catalogues(self, *, labels: str | None = None) -> Steps[list[Document]]:
        """Returns all catalogues, or those with all these labels (`site:oslo,shift`)."""
        return pages(get("v1", "catalogues").with_query(labels=labels), same)

    @operation
    def catalogue(self, name: str = "default") -> Steps[Document]:
        """Returns a catalogue."""
        return ask(get("v1", "catalogues", name), same)

    @operation
    def delete_catalogue(self, name: str) -> Steps[None]:
        """Deletes a catalogue with all its versions."""
        return ask_for_nothing(delete("v1", "catalogues", name))

    @operation
    def catalogue_version(self, name: str, version: int) -> Steps[Document]:
        """Returns a version of a catalogue, with its report."""
        return ask(get("v1", "catalogues", name, "versions", str(version)), same)

    @operation
    def current_version(self, name: str = "default") -> Steps[Document]:
        """Returns the version that new sessions use, with its `revision`."""
        return ask(get("v1", "catalogues", name, "current"), same)

    @operation
    def set_current_version(self, name: str, version: int, revision: int) -> Steps[Document]:
        """Makes a version current if the current one still has `revision`."""
        request = put("v1", "catalogues", name, "current").with_header("if-match", f'"{revision}"')
        # A retry after an unnoticed success would find another revision.
        return ask(request.with_json({"version": version}).repeatable(False), same)

    @operation
    def start_training(
        self,
        /,
        catalogue: str = "default",
        *,
        sensor: str | None = None,
        **options: Unpack[TrainingOptions],
    ) -> Steps[Job]:
        """Starts a training and returns its job."""
        return start(catalogue, sensor, options)

    @operation
    def train(
        self,
        /,
        catalogue: str = "default",
        *,
        sensor: str | None = None,
        progress: Progress | None = None,
        timeout: float | None = None,
        **options: Unpack[TrainingOptions],
    ) -> Steps[Job]:
        """Trains and waits for the end. Raises `JobFailedError` if the training fails."""
        job = yield from start(catalogue, sensor, options)
        return (yield from wait(job, progress, timeout))

    @operation
    def recalibrate(
        self,
        /,
        catalogue: str = "default",
        *,
        progress: Progress | None = None,
        timeout: float | None = None,
        **options: Unpack[RecalibrationOptions],
    ) -> Steps[Job]:
        """Recalibrates a version from ended sessions and waits for the end."""
        request = post("v1", "catalogues", catalogue, "calibrations").with_json({**options})
        job = yield from ask(request, Job.from_wire)
        return (yield from wait(job, progress, timeout))

    @operation
    def jobs(self) -> Steps[list[Job]]:
        """Returns all jobs."""
        return pages(get("v1", "jobs"), Job.from_wire)

    @operation
    def job(self, job: str) -> Steps[Job]:
        """Returns a job."""
        return read_job(job)

    @operation
    def cancel_job(self, job: str) -> Steps[Job]:
        """Cancels a job, which ends shortly after."""
        return ask(post("v1", "jobs", job, "cancel"), Job.from_wire)

    @operation
    def wait_for(
        self, job: Job | str, *, progress: Progress | None = None, timeout: float | None = None
    ) -> Steps[Job]:
        """Waits for the end of a job. Raises `JobFailedError` unless it succeeds."""
        return wait(job, progress, timeout)

    # Sessions.

    @operation
    def create_session(self, /, **options: Unpack[SessionOptions]) -> Steps[Session]:
        """Creates a session."""
        return create(options)

    @operation
    def sessions(
        self,
        /,
        state: str | None = None,
        *,
        none_of_these: bool | None = None,
        with_truth: bool | None = None,
        **search: str,
    ) -> Steps[list[Session]]:
        """Returns the sessions that fit, oldest first.

        `search` is any of `robot`, `object`, `method`, `catalogue`, `labels`, `cell`, `since`,
        `until` and `order` (`oldest`, `newest`).
        """
        flags = {"none_of_these": none_of_these, "with_truth": with_truth}
        told = {name: str(flag).lower() for name, flag in flags.items() if flag is not None}
        request = get("v1", "sessions").with_query(state=state, **told, **search)
        return pages(request, Session.from_wire)

    @operation
    def session(self, session: str) -> Steps[Session]:
        """Returns a session."""
        return ask(get("v1", "sessions", session), Session.from_wire)

    @operation
    def close_session(
        self,
        session: str,
        *,
        truth: str | None = None,
        none_of_these: bool = False,
        pose: PoseLike | None = None,
    ) -> Steps[Session]:
        """Closes a session and reports its true object, even after its end.

        `pose` is the true pose of the object, as far as it is known; it needs `truth`.
        """
        return close(session, truth, none_of_these, pose)

    @operation
    def extend_session(self, session: str, seconds: int) -> Steps[Session]:
        """Keeps a session open for `seconds` from now without new readings."""
        request = post("v1", "sessions", session, "lease").with_json({"seconds": seconds})
        return ask(request.repeatable(), Session.from_wire)

    @operation
    def delete_session(self, session: str) -> Steps[None]:
        """Deletes a session with its readings."""
        return ask_for_nothing(delete("v1", "sessions", session))

    @operation
    def add_readings(
        self,
        session: str,
        sensor: str,
        readings: Readings,
        *,
        robot: str | None = None,
        first_seq: int = 0,
    ) -> Steps[Added]:
        """Adds readings to a session and returns the belief after them.

        `robot` and `first_seq` number them, so that repeated ones count once; only then a lost
        connection is retried.
        """
        documents = readings.to_wire(sensor, robot=robot, first_seq=first_seq)
        return add_in_parts(("v1", "sessions", session, "readings"), documents, belief="full")

    @operation
    def belief(
        self, session: str, *, poses: int | None = None, at: int | None = None
    ) -> Steps[Belief]:
        """Returns the belief of a session, now or at revision `at`."""
        return read_belief(session, poses, at)

    @operation
    def next_touches(
        self,
        /,
        session: str,
        sensor: str,
        *,
        candidates: Sequence[tuple[PoseLike, float]] | None = None,
        costs: Sequence[float] | None = None,
        workspace: tuple[npt.ArrayLike, float] | None = None,
        **options: Unpack[NextTouchOptions],
    ) -> Steps[NextTouches]:
        """Ranks the next touches: candidates (pose and reach in metres), or generated ones.

        `workspace` is the centre and radius of a ball that holds the object.
        """
        return rank(session, sensor, candidates, costs, workspace, options)

    @operation
    def explain(self, session: str, *, at: int | None = None) -> Steps[Document]:
        """Explains what each reading of a session says."""
        return ask(get("v1", "sessions", session, "explain").with_query(at=at), same)

    @operation
    def replay(self, /, session: str, **query: int) -> Steps[Document]:
        """Lists what each revision of a session added, with the belief after the last."""
        return ask(get("v1", "sessions", session, "replay").with_query(**query), same)
