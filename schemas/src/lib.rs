//! Wire types of Palpate's HTTP API.
//!
//! Units are SI: metres, pascals, seconds, radians; quaternions are x, y, z, w. Requests with
//! unknown fields are refused, so that a typo is never ignored; answers may gain fields. Ids are
//! `UUIDv7` strings. Not here: validation (the server's `wire`) and HTTP.

pub mod access;
pub mod analysis;
pub mod calibration;
pub mod coupling;
pub mod descriptor;
pub mod appearance;
pub mod health;
pub mod labels;
pub mod method;
pub mod page;
pub mod pose;
pub mod next_touch;
pub mod interest;
pub mod problem;
pub mod retry_after;
pub mod reading;
pub mod camera;
pub mod geometry;
pub mod symmetry;
pub mod warning;
pub mod belief;
pub mod history;
pub mod object;
pub mod layout;
pub mod sensor;
pub mod sensor_health;
pub mod commissioning;
pub mod session;
pub mod session_list;
pub mod forwarding;
pub mod fleet;
pub mod storage;
pub mod recalibration;
pub mod shadow;
pub mod training;
pub mod job;
pub mod webhook;

pub use access::{
    ApiKey, ApiKeyPage, AuditEntry, AuditPage, AuditQuery, AuditRing, BindRobot, CreateKey,
    NewApiKey, Robot, RobotPage, Role, RotateKey, Whoami, Writer,
};
pub use analysis::{AnalyseCoverings, CoveringAnalysis, CoveringTradeOff, SpatialAcuity};
pub use appearance::{
    AppearanceReport, AppearanceSummary, AppearanceTraining, ClassCandidate, ClusteringKind,
    FeatureSource, NearDuplicate, ObjectAppearance,
};
pub use belief::{
    Belief, BeliefQuery, ObjectProbability, PoseHypothesis, StopAdvice, UncalibratedReason,
};
pub use calibration::{
    CalibrateSensor, CalibrationQuery, ResponseForm, ResponseGoodness, ResponseKnot, ResponseLine,
    ResponsePress, SensorCalibration, SpreadCalibration, SpreadPress, SpreadPresses,
    TaxelCalibration, TaxelPlace, TaxelState,
};
pub use camera::{ClassWeight, StatedPose, WorkspaceBox};
pub use commissioning::{
    CommissionSensor, CommissionedTouch, Commissioning, CommissioningReading, Finding, FindingName,
    FindingVerdict, Measured, Passport, PoseDirection, QuaternionOrder, ReferenceBodies,
    ReferenceBody, ReferenceBodyName, SensorPassport, ToolCenterEstimate,
};
pub use coupling::{
    Coupling, CoveringEdge, NumberRange, SensorKnowledge, SensorRanges, SpreadKernel,
};
pub use descriptor::Descriptor;
pub use fleet::{
    AcknowledgeSessions, Attention, AttentionLevel, CloseSessions, Fleet, FleetChanged, FleetQuery,
    FleetResult, FleetSession,
};
pub use forwarding::{
    DifferentSensor, EntriesForwarded, FollowedCatalogue, ForwardEntries, ForwardSession,
    ForwardedEntry, Forwarding, RefusedSession, SensorPackage, VersionPackage,
};
pub use geometry::{
    AxisUnit, GeometricKind, GeometricReport, GeometricTraining, Marginal, Marginals,
    MarginalsQuery, MergeMaps, OccupancyMap, PlaneMarginal, PlyForm, PlyQuery, PosePrior,
    SliceQuery, VersionReference,
};
pub use health::{Check, Compacted, Liveness, Readiness, Version};
pub use history::{
    BestObject, ExplainQuery, ExplainedAnswer, Explanation, NearestObject, Objection,
    ObjectionCode, ReadingContribution, ReadingMisfit, ReadingRetracted, Replay, ReplayQuery,
    ReplayStep, SessionChange, SessionReading, SessionReadingPage, TracePoint,
};
pub use interest::{InterestMap, InterestPlace, InterestRival};
pub use job::{Job, JobPage, JobStage, JobState};
pub use labels::{LabelledQuery, Labels, SetLabels};
pub use layout::{Drawing, Layout, Taxel};
pub use method::Method;
pub use next_touch::{AskNextTouches, NextTouch, NextTouches, TouchCandidate, TouchWorkspace};
pub use object::{
    AddTrainingReadings, CreateObject, MeshFormat, MeshInfo, MeshQuery, MeshReport, MeshUnit,
    ObjectInfo, ObjectPage, StoredReading, StoredReadingPage, TrainingReadingsAdded, UpdateObject,
};
pub use page::PageQuery;
pub use pose::{Point, Pose};
pub use problem::{FieldError, Problem, ProblemType};
pub use reading::{Contact, Looseness, Reading, Stamp};
pub use recalibration::{
    RecalibrateCatalogue, RecalibrationReport, RecalibrationSide, RecalibrationStage,
    RecalibrationStops,
};
pub use sensor::{
    CreateSensor, DescribeSensor, ForceKnot, ImageOrder, ReadingCheck, Sensor, SensorDescription,
    SensorPage, SensorPreset, TaxelGrid,
};
pub use sensor_health::{
    HealthCode, HealthReason, HealthState, SensorHealth, SensorRest, ToolCenterError,
};
pub use session::{
    AddReadings, BeliefDetail, CloseSession, CreateSession, EventsQuery, ExtendSession, PriorEntry,
    ReadingsAdded, ReadingsQuery, RobotBase, Session, SessionEnd, SessionEvent, SessionState,
    Truth,
};
pub use session_list::{SessionOrder, SessionPage, SessionsQuery};
pub use shadow::{ShadowAnswer, ShadowChange, ShadowReport, ShadowSide, ShadowVersion};
pub use storage::{Storage, StorageHolder, StoredKind, StoredThing};
pub use symmetry::{SymmetryAxis, SymmetryBy};
pub use training::{
    Catalogue, CataloguePage, CatalogueVersion, CatalogueVersionPage, CurrentVersion,
    DistanceRange, MapDistances, MapPatch, ObjectMap, ObjectReport, SetAlias, SetCurrent,
    SkippedObject, StartTraining, SurfaceReport, TrainingReport,
};
pub use warning::{Warning, WarningCode};
pub use webhook::{
    CreateWebhook, NewWebhook, RotateWebhookSecret, UpdateWebhook, Webhook, WebhookAttempt,
    WebhookDelivery, WebhookDeliveryPage, WebhookDeliveryState, WebhookEvent, WebhookEventData,
    WebhookEventType, WebhookJob, WebhookPage, WebhookSnapshot,
};

/// The OpenAPI description of these types.
pub const OPENAPI_JSON: &str = include_str!("../openapi.json");
