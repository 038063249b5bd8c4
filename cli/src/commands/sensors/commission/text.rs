//! Commissioning in words and characters: what to touch next, findings, images, the verdict.

use palpate_client::schemas::{
    CommissionedTouch, Commissioning, Finding, FindingName, FindingVerdict, Sensor,
};

use crate::output;

/// Shades of pressure from none to the largest.
const SHADES: [char; 9] = [' ', '.', ':', '-', '=', '+', '*', '#', '@'];

/// What the next touch should be, after `n` touches that leave `open` undetermined.
pub(super) fn next_touch(n: usize, open: &[FindingName]) -> &'static str {
    let is_open = |name: FindingName| open.contains(&name);
    let is_odd = !n.is_multiple_of(2);
    if is_open(FindingName::ToolCenter) && is_odd {
        return "touch a face whose normal differs from all before, or a face with the sensor turned \
                about its normal";
    }
    if is_open(FindingName::Edge) && is_odd {
        return "touch an edge, with half of the array beyond it";
    }
    if is_open(FindingName::ImageOrder) && is_odd {
        return "touch a corner or the end of an edge, away from the middle of the array";
    }
    match n % 10 {
        0 => "touch the middle of a face",
        1 => "touch a face at a right angle to the last",
        2 => "touch a third face, at a right angle to both",
        3 => "touch an edge, with half of the array beyond it",
        4 => "touch a face opposite one touched before",
        5 => "touch a corner",
        6 => "touch another edge, across the array",
        7 => "touch a face with the sensor turned by a quarter about its normal",
        8 => "touch a curved or sloping place, if there is one",
        _ => "touch a face near its border",
    }
}

/// The answer for a person.
pub(super) fn report(found: &Commissioning, sensor: &Sensor) -> String {
    let mut parts = vec![table(&found.findings)];
    if let Some(picture) = picture(&found.touches, sensor.description.grid.cols as usize) {
        parts.push(picture);
    }
    parts.push(format!(
        "unexplained pressure: {:.1} % as stated, {:.1} % as found",
        100.0 * found.residual_before,
        100.0 * found.residual_after
    ));
    let corrections: Vec<String> =
        found.findings.iter().filter_map(|one| one.correction.clone()).collect();
    if !corrections.is_empty() {
        parts.push(corrections.join("\n"));
    }
    parts.push(found.summary.clone());
    parts.push(match (found.calibration, found.verdict) {
        (Some(number), _) => {
            format!(
                "applied as calibration {number}: later readings of {} are corrected",
                sensor.name
            )
        }
        (None, FindingVerdict::Wrong) => {
            "nothing was stored: correct the driver, or repeat with --apply to let the server do it"
                .to_owned()
        }
        (None, _) => "nothing was stored: with --apply trainings press with the sensor as measured"
            .to_owned(),
    });
    parts.join("\n\n")
}

fn table(findings: &[Finding]) -> String {
    let row = |finding: &Finding| {
        let certainty = match (finding.probability, finding.deviation) {
            (Some(probability), _) => format!("{:.1} %", 100.0 * probability),
            (None, Some(deviation)) => format!("± {deviation:.2e}"),
            (None, None) => String::new(),
        };
        [
            finding.name.name().replace('_', " "),
            output::word(&finding.verdict),
            finding.found.clone(),
            certainty,
        ]
    };
    output::table(["finding", "verdict", "found", "certainty"], findings.iter().map(row))
}

/// The image of the firmest touch, observed beside predicted; +y of the sensor points up.
fn picture(touches: &[CommissionedTouch], cols: usize) -> Option<String> {
    let peak = |image: &[f64]| image.iter().copied().fold(0.0, f64::max);
    let firmest = touches.iter().max_by(|a, b| peak(&a.observed).total_cmp(&peak(&b.observed)))?;
    let most = peak(&firmest.observed).max(peak(&firmest.predicted)).max(f64::MIN_POSITIVE);
    let shade = |pressure: &f64| {
        let level = (pressure / most * (SHADES.len() - 1) as f64).round().max(0.0) as usize;
        let shade = SHADES[level.min(SHADES.len() - 1)];
        [shade, shade].iter().collect::<String>()
    };
    let line = |row: &[f64]| row.iter().map(shade).collect::<String>();
    let rows = firmest.observed.chunks(cols).zip(firmest.predicted.chunks(cols)).rev();
    let width = (2 * cols).max("observed".len());
    let mut lines = vec![format!("touch {}:", firmest.reading + 1)];
    lines.push(format!("  {:<width$}    predicted", "observed"));
    for (observed, predicted) in rows {
        lines.push(format!("  {:<width$}    {}", line(observed), line(predicted)));
    }
    Some(lines.join("\n"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn images_are_drawn_beside_each_other() {
        let touch = CommissionedTouch {
            reading: 4,
            observed: vec![0.0, 4.0, 8.0, 2.0],
            predicted: vec![0.0, 4.0, 4.0, 2.0],
        };
        let picture = picture(&[touch], 2).unwrap();
        let expected = "touch 5:\n  observed    predicted\n  @@::        ==::\n    ==          ==";
        assert_eq!(picture, expected);
        assert_eq!(super::picture(&[], 2), None);
    }

    #[test]
    fn what_is_open_decides_what_is_touched_next() {
        assert!(next_touch(0, &[]).contains("middle of a face"));
        assert!(next_touch(9, &[FindingName::Edge]).contains("an edge"));
        assert!(next_touch(9, &[FindingName::ToolCenter]).contains("normal differs"));
    }
}
