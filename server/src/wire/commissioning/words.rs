//! Findings in words: what was found, and the correction to make in one sentence.

use palpate_commissioning::commission::{Edge, PressureUnit, RESIDUAL_MAX};
use palpate_core::convention::PositionUnit;
use palpate_core::units::{DEG, MM, Shown};

use super::{
    Choice, CoveringEdge, Estimate, Findings, ImageOrder, Name, Passport, Pose, PoseDirection,
    QuaternionOrder, SensorDescription, TaxelFault, Verdict, verdict, wire,
};

/// Relative deviation above which a factor is not determined. Chosen: half of a data sheet's range.
const FACTOR_OPEN: f64 = 0.35;

/// Deviation above which a stiffening is not determined. Chosen: half of its prior's.
const STIFFENING_OPEN: f64 = 0.3;

/// Every finding.
pub(super) fn findings(
    found: &Findings,
    passport: &Passport,
    stated: &SensorDescription,
) -> Vec<wire::Finding> {
    let corrections = corrections(passport, stated);
    let unit = |unit: &PressureUnit| pressure_words(*unit);
    let mut list = vec![
        choice(Name::PressureUnit, &found.pressure_unit, unit),
        choice(Name::PositionUnit, &found.position_unit, |unit| position_words(*unit).to_owned()),
        choice(Name::QuaternionOrder, &found.quaternion, |order| match order {
            QuaternionOrder::Xyzw => "x, y, z, w".to_owned(),
            QuaternionOrder::Wxyz => "w, x, y, z".to_owned(),
        }),
        choice(Name::PoseDirection, &found.direction, |direction| match direction {
            PoseDirection::SessionFromSensor => "session_from_sensor".to_owned(),
            PoseDirection::SensorFromSession => "sensor_from_session".to_owned(),
        }),
        choice(Name::ImageOrder, &found.image_order, |order| order_words(*order)),
        tool(found),
        number(Name::Gain, found.gain, relative(found.gain) < FACTOR_OPEN, |gain| {
            format!("{} × the described pressures", Shown(round(gain)))
        }),
        number(
            Name::Stiffening,
            found.stiffening,
            found.stiffening.deviation < STIFFENING_OPEN,
            |excess| format!("{} × as stiff at full indentation", Shown(round(1.0 + excess))),
        ),
        number(
            Name::PointSpread,
            found.point_spread,
            relative(found.point_spread) < FACTOR_OPEN,
            |spread| format!("{} mm", Shown(round(spread / MM))),
        ),
        choice(Name::Edge, &found.edge, edge_words),
        taxels(found, stated),
    ];
    // A covering differs from its sheet without anything to be corrected by hand.
    if let Some(edge) = list.iter_mut().find(|one| one.name == Name::Edge)
        && edge.verdict == wire::FindingVerdict::Wrong
    {
        edge.verdict = wire::FindingVerdict::Right;
    }
    let looseness = Estimate { value: found.looseness, deviation: f64::INFINITY };
    let in_mm = |metres: f64| format!("{} mm", Shown(round(metres / MM)));
    list.push(number(Name::Looseness, looseness, found.looseness.is_finite(), in_mm));
    for (name, sentence) in corrections {
        if let Some(one) = list.iter_mut().find(|one| one.name == name) {
            one.correction.get_or_insert(sentence);
        }
    }
    list
}

/// The verdict in words.
pub(super) fn summary(wrong: &[Name], open: &[Name], residual: f64) -> String {
    let names = |names: &[Name]| {
        let words: Vec<String> = names.iter().map(|name| name.name().replace('_', " ")).collect();
        words.join(", ")
    };
    if residual > RESIDUAL_MAX {
        return format!(
            "The touches are not understood: {:.0} % of the pressures remain unexplained. Is it the \
             right object, at rest, and does the description fit the sensor?",
            100.0 * residual
        );
    }
    match (wrong.is_empty(), open.is_empty()) {
        (true, true) => "Everything is as stated: nothing needs a correction.".to_owned(),
        (true, false) => format!(
            "Nothing is wrong, but these touches do not determine: {}. Touch faces with different \
             normals, edges and corners.",
            names(open)
        ),
        (false, true) => format!("To correct: {}.", names(wrong)),
        (false, false) => format!(
            "To correct: {}. Not determined by these touches: {}.",
            names(wrong),
            names(open)
        ),
    }
}

/// What a passport corrects, each in one sentence.
pub(super) fn corrections(passport: &Passport, stated: &SensorDescription) -> Vec<(Name, String)> {
    let mut all = Vec::new();
    let unit = PressureUnit::ALL
        .into_iter()
        .find(|unit| (unit.pascals(stated) / passport.pascals - 1.0).abs() < 1e-9);
    if (passport.pascals - 1.0).abs() > 1e-9 {
        let they = unit
            .map_or("in another unit".to_owned(), |unit| format!("in {}", pressure_words(unit)));
        let by = Shown(passport.pascals);
        all.push((Name::PressureUnit, format!("Multiply pressures by {by}: they are {they}.")));
    }
    let convention = passport.convention;
    if convention.unit != PositionUnit::Metre {
        let (by, they) = (Shown(convention.unit.metres()), position_words(convention.unit));
        all.push((Name::PositionUnit, format!("Multiply positions by {by}: they are in {they}.")));
    }
    if convention.quaternion == QuaternionOrder::Wxyz {
        let text = "Send quaternions as x, y, z, w: they come as w, x, y, z.".to_owned();
        all.push((Name::QuaternionOrder, text));
    }
    if convention.direction == PoseDirection::SensorFromSession {
        let text = "Invert the poses: they are sensor_from_session, and session_from_sensor is \
                    expected."
            .to_owned();
        all.push((Name::PoseDirection, text));
    }
    if passport.image_order != stated.parameters().image_order {
        let ImageOrder { transposed, rows_reversed, cols_reversed } = passport.image_order;
        let text = format!(
            "Create the sensor with the image_order transposed {transposed}, rows_reversed \
             {rows_reversed}, cols_reversed {cols_reversed}: the images are {}.",
            order_words(passport.image_order)
        );
        all.push((Name::ImageOrder, text));
    }
    if passport.sent_from_true != Pose::IDENTITY {
        let tool = passport.sent_from_true;
        let text = format!(
            "Move the tool centre by {} mm along x, y, z of the sensor and turn it by {} degrees \
             about them: multiply sent poses by sent_from_true.",
            signed(tool.translation.to_array(), MM),
            signed(tool.rotation.to_scaled_axis().to_array(), DEG)
        );
        all.push((Name::ToolCenter, text));
    }
    if !passport.dead.is_empty() {
        let cols = stated.grid().cols;
        let place = |taxel: &usize| format!("({}, {})", taxel / cols, taxel % cols);
        let places: Vec<String> = passport.dead.iter().map(place).collect();
        let text = format!(
            "Replace the dead taxels at (row, column) {}, or send null.",
            places.join(", ")
        );
        all.push((Name::Taxels, text));
    }
    all
}

fn choice<T: PartialEq + Copy>(
    name: Name,
    choice: &Choice<T>,
    words: impl Fn(&T) -> String,
) -> wire::Finding {
    wire::Finding {
        name,
        verdict: verdict(choice.verdict()),
        found: words(&choice.value),
        stated: Some(words(&choice.stated)),
        probability: Some(choice.probability),
        value: None,
        deviation: None,
        correction: None,
    }
}

fn number(
    name: Name,
    estimate: Estimate,
    is_determined: bool,
    words: impl Fn(f64) -> String,
) -> wire::Finding {
    let verdict = if is_determined { Verdict::Right } else { Verdict::Undetermined };
    wire::Finding {
        name,
        verdict: super::verdict(verdict),
        found: words(estimate.value),
        stated: None,
        probability: None,
        value: Some(estimate.value),
        deviation: Some(estimate.deviation).filter(|deviation| deviation.is_finite()),
        correction: None,
    }
}

fn tool(found: &Findings) -> wire::Finding {
    let offset = found.tool.offset.map(|estimate| estimate.value);
    let turn = found.tool.turn.map(|estimate| estimate.value);
    wire::Finding {
        name: Name::ToolCenter,
        verdict: verdict(found.tool.verdict),
        found: format!("off by {} mm and {} degrees", signed(offset, MM), signed(turn, DEG)),
        stated: None,
        probability: None,
        value: None,
        deviation: None,
        correction: None,
    }
}

fn taxels(found: &Findings, stated: &SensorDescription) -> wire::Finding {
    let cols = stated.grid().cols;
    let words = |(taxel, fault): &(usize, TaxelFault)| {
        let place = format!("({}, {})", taxel / cols, taxel % cols);
        match fault {
            TaxelFault::Dead => format!("{place} is dead"),
            TaxelFault::Offset(by) => format!("{place} reads {} Pa too much", Shown(by.round())),
        }
    };
    let faults: Vec<String> = found.taxels.iter().map(words).collect();
    let is_right = faults.is_empty();
    let has_offset = found.taxels.iter().any(|(_, fault)| *fault != TaxelFault::Dead);
    let advice = "Calibrate the sensor: taxels have offsets, which a passport does not correct.";
    wire::Finding {
        name: Name::Taxels,
        verdict: verdict(if is_right { Verdict::Right } else { Verdict::Wrong }),
        found: if is_right { "all respond".to_owned() } else { faults.join(", ") },
        stated: Some("all respond".to_owned()),
        probability: None,
        value: None,
        deviation: None,
        correction: has_offset.then(|| advice.to_owned()),
    }
}

fn relative(estimate: Estimate) -> f64 {
    estimate.deviation / estimate.value.abs().max(f64::MIN_POSITIVE)
}

/// Rounded to three digits.
fn round(value: f64) -> f64 {
    let scale = 10_f64.powi(2 - value.abs().max(1e-9).log10().floor() as i32);
    (value * scale).round() / scale
}

fn signed(of: [f64; 3], unit: f64) -> String {
    let [x, y, z] = of.map(|value| format!("{:+.1}", value / unit));
    format!("{x}, {y}, {z}")
}

fn pressure_words(unit: PressureUnit) -> String {
    match unit {
        PressureUnit::Pascal => "Pa".to_owned(),
        PressureUnit::Kilopascal => "kPa".to_owned(),
        PressureUnit::Bar => "bar".to_owned(),
        PressureUnit::Psi => "psi".to_owned(),
        PressureUnit::NewtonPerTaxel => "N per taxel".to_owned(),
        PressureUnit::Counts { bits } => format!("counts of {bits} bits"),
    }
}

fn position_words(unit: PositionUnit) -> &'static str {
    match unit {
        PositionUnit::Metre => "m",
        PositionUnit::Millimetre => "mm",
        PositionUnit::Inch => "inches",
    }
}

fn order_words(order: ImageOrder) -> String {
    let words = match (order.transposed, order.rows_reversed, order.cols_reversed) {
        (false, false, false) => "as in the sensor frame",
        (false, true, false) => "with rows reversed",
        (false, false, true) => "with columns reversed",
        (false, true, true) => "turned by 180 degrees",
        (true, false, false) => "transposed",
        (true, true, false) => "transposed, with rows reversed",
        (true, false, true) => "transposed, with columns reversed",
        (true, true, true) => "transposed, with rows and columns reversed",
    };
    words.to_owned()
}

fn edge_words(edge: &Edge) -> String {
    let effect = match edge.effect {
        CoveringEdge::Continues => "acts as if it went on",
        CoveringEdge::ConservesForce => "conserves force",
        CoveringEdge::LosesForce => "loses force",
    };
    match edge.margin {
        None => "goes on beyond the array".to_owned(),
        Some(margin) => {
            format!("ends {} mm beyond the array and {effect}", Shown(round(margin / MM)))
        }
    }
}
