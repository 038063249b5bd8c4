"""A robot's part in a session.

It numbers the robot's readings, so that a repeated reading is not counted twice, and stamps
them, so that the readings of several robots are folded in the order in which they were taken.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from types import TracebackType
from typing import TYPE_CHECKING, Any

import numpy.typing as npt

from palpate.belief import Belief
from palpate.documents import Added, NextTouches, Session
from palpate.errors import PalpateError, StatusError
from palpate.operations import add_documents, close, create, rank, read_belief
from palpate.pose import Pose, PoseLike
from palpate.readings import image_to_wire
from palpate.steps import AsyncRunner, Document, Step, Steps, SyncRunner, ask, operation

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from palpate.options import NextTouchOptions, SessionOptions


class Stamps:
    """Stamps by this computer's clock. They always increase; a repeated reading keeps its own."""

    def __init__(self) -> None:
        self._newest = 0
        self._given_to: int | None = None

    def of(self, seq: int, now_ns: int) -> dict[str, int]:
        """The stamp of the reading with a number, given the time since 1970."""
        if self._given_to != seq:
            self._newest, self._given_to = max(now_ns, self._newest + 1), seq
        return {"sec": self._newest // 10**9, "nanosec": self._newest % 10**9}

    def forget(self) -> None:
        """Drops the newest stamp: its reading was not stored, and its number is used again."""
        self._given_to = None


class TouchOperations:
    """The operations of `TouchSession` and `AsyncTouchSession`."""

    def __init__(self, robot: str, sensor: str | None, options: SessionOptions) -> None:
        self._robot, self._sensor, self._options = robot, sensor, options
        self._session: Session | None = None
        self._next_seq = 0
        self._stamps = Stamps()

    @property
    def session(self) -> Session:
        """The session as it was when it was opened or closed."""
        if self._session is None:
            raise RuntimeError("the session is not open: use `with`")
        return self._session

    @property
    def id(self) -> str:
        """Id of the session."""
        return self.session.id

    @operation
    def touch(
        self,
        image: npt.ArrayLike,
        pose: PoseLike | None,
        *,
        sensor: str | None = None,
        approach_m: float | None = None,
        object_moved: tuple[float, float] | None = None,
        stamp: tuple[int, int] | None = None,
        feature: npt.ArrayLike | None = None,
    ) -> Steps[Belief]:
        """Sends one press and returns the belief after it.

        `image` is in pascal as the driver sends it, NaN for a missing taxel; `pose` is
        `session_from_sensor`, None if the session's method needs none. `approach_m` is the free
        path along the sensor's +z before the press; `object_moved` announces a motion since the
        last touch, as deviations in metres and radians; `stamp` is seconds and nanoseconds of a
        clock that all robots of the session share. A failed call may be repeated with the same
        arguments: it keeps its number and stamp.
        """
        reading: Document = {"image": image_to_wire(image)}
        if pose is not None:
            reading["pose"] = Pose.of(pose).to_wire()
        if feature is not None:
            reading["feature"] = image_to_wire(feature)
        if approach_m is not None:
            reading["approach_m"] = approach_m
        if object_moved is not None:
            position, angle = object_moved
            reading["object_moved"] = {"position_m": position, "angle_rad": angle}
        return self._send(reading, sensor, stamp)

    @operation
    def feel(
        self,
        position: npt.ArrayLike,
        position_deviation_m: float,
        *,
        normal: npt.ArrayLike | None = None,
        normal_deviation_rad: float | None = None,
        touched: bool = True,
        sensor: str | None = None,
        stamp: tuple[int, int] | None = None,
    ) -> Steps[Belief]:
        """Sends one contact without an image, as a bumper or a force–torque sensor feels it."""
        contact: Document = {
            "position": image_to_wire(position),
            "position_deviation_m": position_deviation_m,
            "touched": touched,
        }
        if normal is not None:
            contact["normal"] = image_to_wire(normal)
            contact["normal_deviation_rad"] = normal_deviation_rad
        return self._send({"contact": contact}, sensor, stamp)

    @operation
    def belief(self, *, poses: int | None = None) -> Steps[Belief]:
        """Returns the current belief."""
        return read_belief(self.id, poses, None)

    @operation
    def next_touches(
        self,
        /,
        *,
        sensor: str | None = None,
        candidates: Sequence[tuple[PoseLike, float]] | None = None,
        costs: Sequence[float] | None = None,
        workspace: tuple[npt.ArrayLike, float] | None = None,
        **options: Unpack[NextTouchOptions],
    ) -> Steps[NextTouches]:
        """Ranks the next touches, as `Client.next_touches`."""
        used = self._sensor_of(sensor)
        return rank(self.id, used, candidates, costs, workspace, options)

    @operation
    def close(
        self,
        *,
        truth: str | None = None,
        none_of_these: bool = False,
        pose: PoseLike | None = None,
    ) -> Steps[Session]:
        """Closes the session and reports its true object; `truth` of the result judges it.

        `pose` is the true pose of the object, as far as it is known; it needs `truth`.
        """
        self._session = yield from close(self.id, truth, none_of_these, pose)
        return self._session

    def _send(
        self, reading: Document, sensor: str | None, stamp: tuple[int, int] | None
    ) -> Steps[Belief]:
        given = {"sec": stamp[0], "nanosec": stamp[1]} if stamp else None
        reading |= {
            "sensor": self._sensor_of(sensor),
            "robot": self._robot,
            "seq": self._next_seq,
            "stamp": given or self._stamps.of(self._next_seq, time.time_ns()),
        }
        if self.session.frame_id is not None:
            reading["frame_id"] = self.session.frame_id
        request = add_documents(("v1", "sessions", self.id, "readings"), [reading], belief="full")
        try:
            added = yield from ask(request, Added.from_wire)
        except StatusError as error:
            # A refused press is not stored, so the next one gets a stamp of its own.
            if error.status < 500:
                self._stamps.forget()
            raise
        self._next_seq += 1
        if added.belief is not None:
            return added.belief
        return (yield from read_belief(self.id, None, None))

    def _sensor_of(self, sensor: str | None) -> str:
        used = sensor or self._sensor
        if used is None:
            raise ValueError("sensor: is missing, expected an id or a name here or at the session")
        return used

    def _open(self) -> Steps[None]:
        self._session = yield from create(self._options)

    def _leave(self, is_failing: bool) -> Steps[None]:
        """Closes the session if it is open; a failure does not hide one that came before."""
        if self._session is None or self._session.state != "open":
            return
        try:
            self._session = yield from close(self._session.id, None, False, None)
        except PalpateError:
            if not is_failing:
                raise


class TouchSession(TouchOperations, SyncRunner):
    """A session for one robot, closed at the end of `with`."""

    def __init__(
        self, client: SyncRunner, robot: str, sensor: str | None, **options: Unpack[SessionOptions]
    ) -> None:
        super().__init__(robot, sensor, options)
        self._client = client

    def perform(self, step: Step) -> Any:
        """Performs one step of an operation."""
        return self._client.perform(step)

    def __enter__(self) -> TouchSession:
        """Opens the session."""
        self.run(self._open())
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Closes the session."""
        self.run(self._leave(error is not None))


class AsyncTouchSession(TouchOperations, AsyncRunner):
    """A session for one robot, closed at the end of `async with`."""

    def __init__(
        self, client: AsyncRunner, robot: str, sensor: str | None, **options: Unpack[SessionOptions]
    ) -> None:
        super().__init__(robot, sensor, options)
        self._client = client

    async def perform(self, step: Step) -> Any:
        """Performs one step of an operation."""
        return await self._client.perform(step)

    async def __aenter__(self) -> AsyncTouchSession:
        """Opens the session."""
        await self.run(self._open())
        return self

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Closes the session."""
        await self.run(self._leave(error is not None))
