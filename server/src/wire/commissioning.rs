//! Conversion of commissioning: touches in, findings and passports out.

mod words;

use palpate_commissioning::commission::{CommissionError, Findings, TaxelFault};
use palpate_commissioning::estimate::{Choice, Verdict};
use palpate_commissioning::touch::{SentTouch, TOUCHES_MAX, TOUCHES_MIN};
use palpate_core::convention::{PoseDirection, QuaternionOrder};
use palpate_core::pose::Pose;
use palpate_core::reading::{ReadingError, after_lines};
use palpate_core::sensor::{
    Correction, CoveringEdge, Estimate, ImageOrder, Passport, SensorDescription,
};
use palpate_schemas as wire;
use palpate_schemas::FindingName as Name;
use palpate_store::calibration::StoredPassport;
use palpate_store::entity::Sensor;

use crate::wire::reading::{ERRORS_MAX, pose as checked_pose};
use crate::wire::{Invalid, count, sensor, time};

/// Maximum number of taxels in one request: the images are fitted all at once, with a matrix of
/// 15 columns. Chosen: eight touches of the largest array, which take 190 MB and half a minute.
const TAXELS_MAX: usize = 140_000;

/// A checked request.
pub(crate) struct Touches {
    /// The touches after the taxel lines, in the numbers that were sent.
    pub(crate) sent: Vec<SentTouch>,
    /// The object's pose, if it is stated.
    pub(crate) session_from_object: Option<Pose>,
    /// Seed of the search.
    pub(crate) seed: u64,
}

/// The touches of a request, after the response lines of `correction`.
pub(crate) fn touches(
    request: &wire::CommissionSensor,
    description: &SensorDescription,
    correction: Option<&Correction>,
) -> Result<Touches, Invalid> {
    let n = request.readings.len();
    if !(TOUCHES_MIN..=TOUCHES_MAX).contains(&n) {
        let detail = format!("{n} touches came, expected {TOUCHES_MIN} to {TOUCHES_MAX}");
        return Err(Invalid::field("/readings", detail));
    }
    if description.listed().is_some() {
        let detail = "the sensor is a list of taxels, expected one with rows and columns: only \
                      those are commissioned";
        return Err(Invalid::field("/readings", detail));
    }
    let n_taxels = n * description.grid().n_taxels();
    if n_taxels > TAXELS_MAX {
        let most = TAXELS_MAX / description.grid().n_taxels();
        let detail = format!(
            "{n_taxels} taxels came, expected at most {TAXELS_MAX}: send at most {most} touches of \
             this sensor"
        );
        return Err(Invalid::field("/readings", detail));
    }
    let seed = super::within("/seed", request.seed.unwrap_or(0), 0, super::INTEGER_MAX)?;
    let at = request.session_from_object.as_ref();
    let session_from_object = at.map(|at| checked_pose("/session_from_object", at)).transpose()?;
    let none = Correction::default();
    let lines = correction.unwrap_or(&none);
    let mut errors = Vec::new();
    let mut sent = Vec::with_capacity(n);
    for (index, reading) in request.readings.iter().enumerate() {
        match touch(&format!("/readings/{index}"), reading, description, lines) {
            Ok(touch) => sent.push(touch),
            Err(Invalid(wrong)) => errors.extend(wrong),
        }
        if errors.len() >= ERRORS_MAX {
            break;
        }
    }
    if !errors.is_empty() {
        return Err(Invalid(errors));
    }
    Ok(Touches { sent, session_from_object, seed })
}

fn touch(
    pointer: &str,
    given: &wire::CommissioningReading,
    description: &SensorDescription,
    lines: &Correction,
) -> Result<SentTouch, Invalid> {
    let pose = checked_pose(&format!("{pointer}/pose"), &given.pose)?;
    let pressures = after_lines(description, lines, &given.image).map_err(|error| {
        let at = match error {
            ReadingError::Pressure { taxel, .. } => format!("{pointer}/image/{taxel}"),
            _ => format!("{pointer}/image"),
        };
        Invalid::field(at, error)
    })?;
    let (position, quaternion) = (pose.translation.to_array(), pose.rotation.to_array());
    Ok(SentTouch { pressures, position, quaternion })
}

/// The refusal of touches that cannot be used; `None` if the computation was stopped.
pub(crate) fn refused(error: CommissionError) -> Option<Invalid> {
    let at = match error {
        CommissionError::Count { .. }
        | CommissionError::Nowhere
        | CommissionError::Silent { .. } => "/readings".to_owned(),
        CommissionError::Taxels { touch, .. } => format!("/readings/{touch}/image"),
        CommissionError::Number { touch } => format!("/readings/{touch}"),
        CommissionError::Stopped => return None,
    };
    Some(Invalid::field(at, error))
}

/// What an answer is about.
pub(crate) struct Answered<'a> {
    pub(crate) sensor: &'a Sensor,
    /// Name of the object or reference body.
    pub(crate) touched: String,
    pub(crate) touches: &'a Touches,
    pub(crate) findings: &'a Findings,
    pub(crate) passport: &'a Passport,
    /// Number that the passport was stored as.
    pub(crate) calibration: Option<u32>,
}

/// The answer to a request.
pub(crate) fn commissioning(answered: Answered<'_>) -> wire::Commissioning {
    let Answered { sensor: stated, findings, passport, .. } = answered;
    let list = words::findings(findings, passport, &stated.description);
    let with = |verdict: wire::FindingVerdict| -> Vec<Name> {
        list.iter().filter(|one| one.verdict == verdict).map(|one| one.name).collect()
    };
    let wrong = with(wire::FindingVerdict::Wrong);
    let undetermined = with(wire::FindingVerdict::Undetermined);
    let verdict = match (wrong.is_empty(), undetermined.is_empty()) {
        (false, _) => wire::FindingVerdict::Wrong,
        (true, false) => wire::FindingVerdict::Undetermined,
        (true, true) => wire::FindingVerdict::Right,
    };
    let has_pressure = |touch: &SentTouch| touch.pressures.iter().flatten().any(|p| *p > 0.0);
    let sent = answered.touches.sent.iter().enumerate().filter(|(_, touch)| has_pressure(touch));
    let images = sent.zip(&findings.images);
    let touches: Vec<wire::CommissionedTouch> = images
        .map(|((reading, _), (observed, predicted))| wire::CommissionedTouch {
            reading: count(reading),
            observed: observed.clone(),
            predicted: predicted.clone(),
        })
        .collect();
    wire::Commissioning {
        sensor: stated.id,
        touched: answered.touched,
        n_touches: count(touches.len()),
        verdict,
        summary: words::summary(&wrong, &undetermined, findings.residual.1),
        wrong,
        undetermined,
        findings: list,
        tool_center: wire::ToolCenterEstimate {
            sent_from_true: sensor::pose(&findings.tool.sent_from_true),
            offset: findings.tool.offset.iter().map(measured).collect(),
            turn: findings.tool.turn.iter().map(measured).collect(),
        },
        residual_before: findings.residual.0,
        residual_after: findings.residual.1,
        session_from_object: sensor::pose(&findings.session_from_object),
        touches,
        passport: self::passport(passport),
        calibration: answered.calibration,
    }
}

/// Names of the findings that the touches did not determine.
pub(crate) fn undetermined(
    findings: &Findings,
    passport: &Passport,
    stated: &SensorDescription,
) -> Vec<String> {
    let list = words::findings(findings, passport, stated);
    let open = list.iter().filter(|one| one.verdict == wire::FindingVerdict::Undetermined);
    open.map(|one| one.name.name().to_owned()).collect()
}

/// A stored passport in its wire form.
pub(crate) fn stored_passport(stored: &StoredPassport, sensor: &Sensor) -> wire::SensorPassport {
    let (wrong, corrections) =
        words::corrections(&stored.passport, &sensor.description).into_iter().unzip();
    let named = |name: &String| Name::ALL.into_iter().find(|known| known.name() == name);
    wire::SensorPassport {
        sensor: sensor.id,
        number: stored.since,
        touched: stored.touched.clone(),
        n_touches: stored.n_touches,
        wrong,
        corrections,
        undetermined: stored.undetermined.iter().filter_map(named).collect(),
        residual_before: stored.residual.0,
        residual_after: stored.residual.1,
        passport: passport(&stored.passport),
        created_at: time(stored.created_at_ms),
    }
}

fn passport(passport: &Passport) -> wire::Passport {
    wire::Passport {
        pressure_factor: passport.pascals,
        position_factor: passport.convention.unit.metres(),
        quaternion_order: match passport.convention.quaternion {
            QuaternionOrder::Xyzw => wire::QuaternionOrder::Xyzw,
            QuaternionOrder::Wxyz => wire::QuaternionOrder::Wxyz,
        },
        pose_direction: match passport.convention.direction {
            PoseDirection::SessionFromSensor => wire::PoseDirection::SessionFromSensor,
            PoseDirection::SensorFromSession => wire::PoseDirection::SensorFromSession,
        },
        image_order: order(passport.image_order),
        sent_from_true: sensor::pose(&passport.sent_from_true),
        dead: passport.dead.iter().map(|taxel| count(*taxel)).collect(),
        gain: measured(&passport.gain),
        stiffening: measured(&passport.stiffening),
        point_spread: measured(&passport.point_spread),
        margin: passport.margin,
        edge: passport.is_edge_known.then(|| edge(passport.edge)),
        looseness_m: passport.looseness,
    }
}

fn order(order: ImageOrder) -> wire::ImageOrder {
    let ImageOrder { transposed, rows_reversed, cols_reversed } = order;
    wire::ImageOrder { transposed, rows_reversed, cols_reversed }
}

fn edge(edge: CoveringEdge) -> wire::CoveringEdge {
    match edge {
        CoveringEdge::Continues => wire::CoveringEdge::Continues,
        CoveringEdge::ConservesForce => wire::CoveringEdge::ConservesForce,
        CoveringEdge::LosesForce => wire::CoveringEdge::LosesForce,
    }
}

fn measured(estimate: &Estimate) -> wire::Measured {
    wire::Measured {
        value: estimate.value,
        deviation: Some(estimate.deviation).filter(|deviation| deviation.is_finite()),
    }
}

fn verdict(verdict: Verdict) -> wire::FindingVerdict {
    match verdict {
        Verdict::Right => wire::FindingVerdict::Right,
        Verdict::Wrong => wire::FindingVerdict::Wrong,
        Verdict::Undetermined => wire::FindingVerdict::Undetermined,
    }
}

/// A reference body in its wire form.
pub(crate) fn reference_body(
    name: wire::ReferenceBodyName,
    size: [f64; 3],
    n_triangles: usize,
) -> wire::ReferenceBody {
    let (tells, stands_on) = match name {
        wire::ReferenceBodyName::Ridge => {
            ("everything: it has no symmetry", "the flat face opposite the ridge")
        }
        wire::ReferenceBodyName::Sphere => (
            "units, gain, spread and height; the roll of the sensor only poorly",
            "a ring or a lump of putty",
        ),
        wire::ReferenceBodyName::Cube => {
            ("everything but its own pose, which has 24 equal ones", "any face")
        }
        wire::ReferenceBodyName::Wedge => (
            "everything; steps of 8 and 12 mm show the edge of the covering",
            "the flat face opposite the steps",
        ),
    };
    wire::ReferenceBody {
        name,
        size: size.to_vec(),
        tells: tells.to_owned(),
        stands_on: stands_on.to_owned(),
        n_triangles: count(n_triangles),
    }
}
