"""Types of the options of requests, which editors complete and type checkers check.

Written by `python/options_of_api.py` from the API's description; do not edit.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Literal, TypedDict

if TYPE_CHECKING:
    from typing_extensions import Required


Labels = Mapping[str, str]
"""Keys and their values, by which things are found."""


Method = Literal[
    "surface",
    "sva",
    "sva_literal",
    "geometric",
    "geometric_histogram",
    "geometric_particles",
    "appearance",
    "appearance_literal",
]
"""Recognition method."""


class Looseness(TypedDict, total=False):
    """Uncertainty of a position and orientation, as standard deviations."""

    angle_rad: Required[float]
    """Standard deviation about each axis, in radians, 1e-9 to 1."""
    position_m: Required[float]
    """Standard deviation in each direction, in metres, 1e-9 to 0.1."""


class PoseDocument(TypedDict, total=False):
    """A rigid pose: where one frame is in another. A sensor's pose in a session maps sensor
    coordinates into the session frame (`session_from_sensor`), like the transform of the
    sensor in the base frame in ROS.
    """

    orientation: Required[Sequence[float]]
    """Unit quaternion in the order x, y, z, w. The identity is 0, 0, 0, 1."""
    position: Required[Sequence[float]]
    """Translation x, y, z in metres."""


class PlanarPosePrior(TypedDict, total=False):
    """Flat in a plane, for maps of kind `planar`: uniform in x, y and rotation."""

    angle: float | None
    """Central rotation in radians. Default: 0."""
    center: Sequence[float] | None
    """Centre of the square that holds the object's origin, in the plane, in metres. Default: 0,
    0.
    """
    half_angle: float | None
    """Maximum deviation from `angle` in radians, 0.001 to π. Default: π (any rotation)."""
    half_extent: float | None
    """Half the square's side in metres, 0.0001 to 1. Default: 0.01."""
    kind: Required[Literal["planar"]]
    plane: PoseDocument | None
    """The plane's pose in the session frame: x and y in the plane, z towards the sensor.
    Default: the session frame.
    """


class BoundedPosePrior(TypedDict, total=False):
    """Near a given pose, for maps of kind `solid`."""

    half_angle: Required[float]
    """Maximum rotation about each of the session's axes, in radians, 0.001 to π."""
    half_extents: Required[Sequence[float]]
    """Maximum distance of the object's origin from the central pose along the session's x, y and
    z, in metres, each 0.0001 to 1.
    """
    kind: Required[Literal["bounded"]]
    pose: Required[PoseDocument]
    """Central pose (`session_from_object`)."""


class ClassWeight(TypedDict, total=False):
    """A detector's weight of an object."""

    object: Required[str]
    """Id or name of the object."""
    weight: Required[float]
    """Weight, 0 to 1000000; only ratios count."""


class StatedPose(TypedDict, total=False):
    """A possible pose of the object, with its uncertainty: `deviation` or `covariance`."""

    covariance: Sequence[float] | None
    """6 × 6 covariance, row-major, in the order of ROS and of a belief's `covariance`: x, y, z
    in metres, then rotation about the fixed x, y, z axes of the session frame in radians.
    Symmetric and positive definite, with deviations of 0.00001 to 1 m and 0.0001 to π rad.
    """
    deviation: Looseness | None
    """Standard deviations along each axis and about each axis of the session frame, at least
    0.00001 m and 0.0001 rad.
    """
    object: str | None
    """Id or name of the object that was seen. Default: any object."""
    pose: Required[PoseDocument]
    """Mean pose of the object's frame in the session frame, as `pose` of a belief states it."""
    weight: float | None
    """Weight beside the other hypotheses, 0 to 1000000. Default: 1."""


class WorkspaceBox(TypedDict, total=False):
    """A box in the session frame that holds the origin of the object's frame."""

    high: Required[Sequence[float]]
    """The corner with the largest x, y and z, in metres: larger than `low` by 0.001 to 100."""
    low: Required[Sequence[float]]
    """The corner with the smallest x, y and z, in metres."""


class CameraPosePrior(TypedDict, total=False):
    """A camera's word, for the method `surface`: hypotheses of the pose, a detector's weights of
    objects, a workspace, or several of these. Touches overrule it. It holds for the object as
    it lies at the first touch.
    """

    class_weights: Sequence[ClassWeight]
    """A detector's weights of objects, which multiply the session's `prior`. Objects that are
    not listed have the weight 0. Default: all objects weigh the same.
    """
    hypotheses: Sequence[StatedPose]
    """Possible poses. Default: any pose in the workspace."""
    kind: Required[Literal["camera"]]
    workspace: WorkspaceBox | None
    """Box that holds the object. Default: anywhere."""
    wrong: float | None
    """Probability that the statement is wrong, 0.001 to 0.9. A wrong statement says nothing
    about the object and its pose. Default: 0.1.
    """


PosePrior = PlanarPosePrior | BoundedPosePrior | CameraPosePrior
"""Prior of the object's pose, before the first touch."""


class PriorEntry(TypedDict, total=False):
    """Prior probability of one object."""

    object: Required[str]
    """The object's id or name."""
    probability: Required[float]
    """Probability of the object, 0 to 1; at most 1 over all entries."""


class RobotBase(TypedDict, total=False):
    """A robot with an inexactly known base."""

    base: Required[Looseness]
    """Uncertainty of its base."""
    robot: Required[str]
    """Name of the robot, as its readings give it."""


class SessionOptions(TypedDict, total=False):
    """A new session: one object that is touched. It rests in one frame, except with the methods
    `appearance…`.
    """

    alias: str | None
    """Alias of a version, such as `candidate`: the session keeps the version that it names now.
    Excludes `version`.
    """
    bins: Sequence[int] | None
    """Number of bins per object along x, y and the rotation, each 2 to 200, at most 100000 in
    total; only for `geometric_histogram`. Default: 25, 25, 16.
    """
    catalogue: str | None
    """Name of the catalogue. Default: `default`."""
    frame_id: str | None
    """Frame of all sensor poses of the session, such as `base_link`. A reading that names
    another frame is refused.
    """
    labels: Labels
    """Labels for searches: at most 16, as `PUT …/labels` describes them."""
    method: Method | None
    """Recognition method. Default: `surface`, or `sva` if the version has no surfaces."""
    object_moves: Looseness | None
    """Motion of the object between any two touches, for `surface`: pressing may shift the
    object, or a hand may hold it. Earlier touches then say less about the pose. For a single
    motion use `object_moved` of a reading.
    """
    particles: int | None
    """Number of particles over all objects, 100 to 100000; only for `geometric_particles`.
    Default: 10000.
    """
    pose_prior: PosePrior | None
    """Prior of the object's pose: of kind `camera` for the method `surface`, by default none; of
    the other kinds for the methods `geometric…`, by default the planar prior's defaults for
    maps of kind `planar`, while maps of kind `solid` require it.
    """
    prior: Sequence[PriorEntry] | None
    """Prior of the objects, given that the object is in the catalogue. Objects that are not
    listed share the rest evenly.
    """
    risk: float | None
    """Accepted risk of a wrong answer, 0.0001 to 0.5, for `surface`. The belief's `stop` says
    when it is reached.
    """
    robots: Sequence[RobotBase] | None
    """Robots with an inexactly known base, for `surface`. All readings of such a robot (by its
    `robot`) are displaced by one unknown motion within this uncertainty. Readings of other
    robots are taken as exact.
    """
    seed: int | None
    """Seed of the random choices of the methods `geometric…`, at most 2⁵³ − 1. Default: 1."""
    ttl_s: int | None
    """Seconds without a new reading after which the session expires, 1 to 31536000; a lease
    keeps it open longer. Default: the server's setting, one day unless the operator changed
    it.
    """
    unknown_prior: float | None
    """Prior probability that the object is not in the catalogue, above 0 and below 1; for
    `surface`. Default: 0.05.
    """
    version: int | None
    """Version of the catalogue, fixed for the session. Default: the current one."""


ClusteringKind = Literal["mixture", "shared_mixture", "per_object", "k_means"]
"""Clustering method for the appearance classes."""


Descriptor = Literal[
    "vectorize",
    "sift",
    "mr8",
    "moment_normalized",
    "polar_fourier",
    "polar_fourier_rw",
    "polar_fourier_ni",
    "polar_fourier_signed",
    "mnti",
    "steerable",
    "schmid",
    "polar_spectrum",
]
"""Descriptor that turns a press into a feature."""


FeatureSource = Literal["images", "features"]
"""Source of the features."""


class AppearanceTraining(TypedDict, total=False):
    """Training options of the methods `appearance…`."""

    clustering: ClusteringKind | None
    """Clustering method for the appearance classes. Default: `mixture`."""
    descriptor: Descriptor | None
    """Descriptor that turns an image into a feature. Only with `images`. Default: `mnti`."""
    discriminant_axes: int | None
    """Maximum number of discriminant axes after the principal components, 1 to 1000 (beyond the
    dissertation). Default: none.
    """
    n_classes: Sequence[int] | None
    """1 to 10 candidates for the number of classes, each 2 to 400. The candidate that recognises
    the held-back readings best wins. Default: 48 alone.
    """
    report_readings: int | None
    """Number of held-back readings in each trial of the report, 1 to 1000. Default: 20."""
    source: FeatureSource | None
    """What is compared: images of readings, or features that clients send. Default: `images`."""
    variance_share: float | None
    """Share of the features' variance that the kept principal components hold, 0.5 to 1.
    Default: 0.99 (the dissertation: 0.9).
    """


class DistanceRange(TypedDict, total=False):
    """A range of distances between touches, in 40 steps."""

    max: float | None
    """Largest distance in metres. Default: the largest in the training data."""
    min: Required[float]
    """Smallest distance in metres."""


GeometricKind = Literal["planar", "solid"]
"""Kind of contact map."""


class GeometricTraining(TypedDict, total=False):
    """Training options of the methods `geometric…`."""

    cell: float | None
    """Cell size in metres, 0.0001 to 0.05. Default: suited to the kind."""
    kind: Required[GeometricKind]
    """Kind of contact map: a pressed plane or a whole surface."""


SensorKnowledge = Literal["measured", "data_sheet", "unknown", "commissioned"]
"""Trust in a sensor's description, which decides how meshes are pressed in trainings."""


class TrainingOptions(TypedDict, total=False):
    """Training request."""

    activate: bool | None
    """Whether to make the version current as soon as it is trained. Default: true."""
    appearance: AppearanceTraining | None
    """Training options for the methods `appearance…`. Default: none."""
    descriptor: Descriptor | None
    """Descriptor that turns a press into a feature. Default: `mnti`."""
    distance_range: DistanceRange | None
    """Distances of the touch pairs to learn. Default: from 8 mm to the object's size."""
    extend: int | None
    """Version of the same catalogue to extend. Its vocabularies and objects are kept bit for
    bit; only `objects` are trained (default: those it does not know). `sensor_knowledge`,
    `n_classes`, `descriptor`, `distance_range`, `geometric`, `appearance`, `surface` and
    `sva` are taken from that version and must not be given.
    """
    geometric: GeometricTraining | None
    """Contact maps for the methods `geometric…`. Default: none."""
    n_classes: int | None
    """Number of appearance classes, 2 to 255. Default: 25."""
    objects: Sequence[str] | None
    """Ids or names of the objects. Default: every object that has a mesh or readings."""
    readings_per_object: int | None
    """Number of simulated readings per object that has only a mesh, 20 to 20000. Default: 1000."""
    seed: int | None
    """Seed of all random choices, at most 2⁵³ − 1. Default: 1."""
    sensor_knowledge: SensorKnowledge | None
    """Trust in that sensor's description, which decides how meshes are pressed. Default:
    `commissioned` if the sensor has a passport, else that of the catalogue's current version
    if this sensor pressed it (with the warning `knowledge_kept` if the sensor states
    another), else that of the sensor.
    """
    strict: bool | None
    """Whether one object that cannot be trained fails the training. If false, the object is
    skipped and listed under `skipped` in the report. A training left without objects always
    fails. Default: false.
    """
    surface: bool | None
    """Whether to learn the surfaces that `surface` needs. Default: the value of `sva`."""
    surface_readings_per_object: int | None
    """Number of simulated readings for the surface of such an object, `readings_per_object` to
    20000. The first `readings_per_object` of them also train everything else. A surface keeps
    at most 1000 touches, spread evenly, and recognises better if it can choose from more.
    Default: 2400, or `readings_per_object` if that is given.
    """
    sva: bool | None
    """Whether to learn the pair maps that `sva` needs. Set false for readings without poses,
    which only train `appearance`, or, with `surface` true, for large catalogues. Default:
    true.
    """


class RecalibrationOptions(TypedDict, total=False):
    """Request to recalibrate a version from ended sessions whose true object is known."""

    activate: bool | None
    """Whether to make the new version current, if it is better on sessions that its calibration
    does not know and the recalibrated version is still the current one. Default: true.
    """
    sensor: str | None
    """Id or name of a sensor: only sessions whose first 16 readings are all of this sensor.
    Default: sessions of any sensor.
    """
    sessions: Sequence[str] | None
    """Sessions to use: ended ones of this catalogue with the method `surface`, a known truth and
    at least 3 readings. Default: the newest 300 of them.
    """
    version: int | None
    """Version to recalibrate. Default: the current one."""


class ComparisonOptions(TypedDict, total=False):
    """Request to compare a version with another one by replaying ended sessions with both."""

    against: int | None
    """Version to compare with. Default: the current one."""
    risk: float | None
    """Accepted risk of a wrong answer, 0.0001 to 0.5, at which a session counts as decided. A
    session's own `risk` does not count. Default: 0.05.
    """
    sessions: Sequence[str] | None
    """Sessions to replay: ended ones of this catalogue with the method `surface` and a reading.
    Default: the newest 100 of them.
    """


class NextTouchOptions(TypedDict, total=False):
    """Request to rank the next touches."""

    deadline_ms: int | None
    """Time limit of the evaluation in milliseconds from the request's arrival, 1 to 10000. At
    least one approach is evaluated. Default: 100.
    """
    n: int | None
    """Maximum number of approaches to return, 1 to 1000. Default: 5."""
    recenters: bool | None
    """Whether the robot re-centres: it touches, finds the centre of contact, lifts, moves there
    and touches again. Default: false.
    """
    seed: int | None
    """Seed of random choices, 0 to 2⁵³ − 1. Default: 0."""


CoveringEdge = Literal["continues", "conserves_force", "loses_force"]
"""Effect of the end of the covering on forces near it."""


SpreadKernel = Literal["gaussian", "exponential"]
"""Shape of the lateral spread of a press; its standard deviation is `point_spread`."""


class Coupling(TypedDict, total=False):
    """Coupling of the covering and the taxels, beyond the standard deviation of the spread.
    Every field may be omitted. In trainings of `data_sheet`, a value other than its default
    is taken as known, and a default as unknown.
    """

    cross_talk: float
    """Share of a taxel's pressure that each of its up to four neighbours reads in addition, 0 to
    0.5. Sheets call it "cross-talk"; −20 dB is 0.1. Default: 0.
    """
    edge: CoveringEdge
    """Effect of the covering's end on forces near it. Press a flat plate on the whole array: the
    outermost taxels read as much as the others (`continues`), more (`conserves_force`) or
    less (`loses_force`). Default: `continues`.
    """
    gain_spread: float
    """Relative standard deviation of the taxels' gains, 0 to 0.5. Sheets call it "uniformity" or
    "part-to-part repeatability". Default: 0.
    """
    hysteresis: float
    """Largest relative deviation of a press through hysteresis, 0 to 0.5. Half of the
    "hysteresis" of the sheet, which is the whole width of the loop. Default: 0.
    """
    kernel: SpreadKernel
    """Shape of the lateral spread. Data sheets do not state it: omit it. Default: `gaussian`."""
    margin: float | None
    """Extent of the covering beyond the cells of the outermost taxels, in metres, 0 to 0.1; null
    if it is farther than any press spreads. Measure it with a ruler: 0 if the rubber ends
    where the array ends. Default: null.
    """


class ImageOrder(TypedDict, total=False):
    """Orientation of the driver's image relative to the row-major order of the sensor frame."""

    cols_reversed: bool
    """Whether the driver's first column is the frame's last."""
    rows_reversed: bool
    """Whether the driver's first row is the frame's last."""
    transposed: bool
    """Whether the driver sends columns as rows."""


class SensorOptions(TypedDict, total=False):
    """A new sensor, from a preset or a description."""

    coupling: Coupling | None
    """Coupling of the covering and the taxels; overrides that of the preset or description."""
    image_order: ImageOrder | None
    """Orientation of the driver's images; overrides that of the preset or description."""
    labels: Labels
    """Labels for searches: at most 16, as `PUT …/labels` describes them."""
    sensor_knowledge: SensorKnowledge | None
    """Trust in the description. Default: `data_sheet`. State `measured` only for a sensor whose
    numbers were measured, or for a simulation of exactly this description.
    """
