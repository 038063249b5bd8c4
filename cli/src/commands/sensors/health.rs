//! `palpate sensors health`: a sensor's health in words.

use palpate_client::schemas::{HealthState, SensorHealth, SensorRest, ToolCenterError};

/// The verdict, its reasons, and what it rests on.
pub(super) fn text(health: &SensorHealth) -> String {
    let mut lines = vec![format!("{}: {}", health.name, health.summary)];
    if health.n_reasons > 1 {
        lines.extend(health.reasons.iter().map(|reason| {
            let state = if reason.state == HealthState::Watch { "watch" } else { "commission" };
            format!("  {state}: {}", reason.detail)
        }));
        let n_more = (health.n_reasons as usize).saturating_sub(health.reasons.len());
        if n_more > 0 {
            lines.push(format!("  and {n_more} more"));
        }
    }
    lines.extend(health.rest.as_ref().map(rest));
    lines.extend(health.tool_center.as_ref().map(tool_center));
    lines.push(basis(health));
    lines.join("\n")
}

fn rest(rest: &SensorRest) -> String {
    let largest = |values: &[Option<f64>]| {
        values.iter().flatten().fold(0.0_f64, |largest, value| largest.max(value.abs()))
    };
    let changes = rest.changes.as_ref().map_or_else(String::new, |changes| {
        format!(", has changed by at most {:.0} Pa since the first days", largest(changes))
    });
    format!(
        "at rest a taxel reads at most {:.0} Pa{changes}; its noise is at most {:.0} Pa, described \
         are {:.0} Pa; a contact begins at {:.0} Pa",
        largest(&rest.pressures),
        largest(&rest.noise),
        rest.described_noise,
        rest.contact_floor
    )
}

fn tool_center(found: &ToolCenterError) -> String {
    let axes = ["x", "y", "z"].iter().zip(found.shift_m).zip(found.deviation_m);
    let said: Vec<String> = axes
        .map(|((axis, shift), deviation)| {
            format!("{axis} {:+.1} ± {:.1} mm", 1e3 * shift, 1e3 * deviation)
        })
        .collect();
    let (sessions, touches) = (found.n_sessions, found.n_touches);
    format!("tool centre: {} ({sessions} sessions, {touches} touches)", said.join(", "))
}

fn basis(health: &SensorHealth) -> String {
    let mut said = vec![format!(
        "counted: sessions {}, presses {}, without contact {}",
        health.n_sessions, health.n_presses, health.n_quiet
    )];
    if let (Some(first), Some(last)) = (&health.first_day, &health.last_day) {
        said.push(format!("days {}, {first} to {last}", health.n_days));
    }
    said.extend(health.calibration.map(|number| format!("under calibration {number}")));
    if health.n_waiting > 0 {
        said.push(format!("still to be counted {}", health.n_waiting));
    }
    said.join("; ")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A sensor with a drifting taxel and a wrong tool centre.
    fn health() -> SensorHealth {
        serde_json::from_value(serde_json::json!({
            "sensor": "00000000-0000-0000-0000-00000000000a", "name": "finger",
            "state": "commission", "summary": "commission the sensor again: a (and one more reason)",
            "reasons": [
                {"code": "drift", "state": "commission", "taxel": 14, "axis": null,
                    "value": 300.0, "expected": 150.0, "detail": "a"},
                {"code": "tool_center", "state": "watch", "taxel": null, "axis": "z",
                    "value": 0.0007, "expected": 0.0005, "detail": "b"}],
            "n_reasons": 2, "calibration": 3, "first_day": "2026-11-01", "last_day": "2026-11-25",
            "n_days": 20, "n_sessions": 41, "n_presses": 500, "n_quiet": 120,
            "rest": {"n_presses": 60, "pressures": [12.0, -300.0, null], "changes": [1.0, -290.0,
                null], "noise": [30.0, 20.0, null], "described_noise": 31.2,
                "contact_floor": 156.0},
            "dead": [], "stuck": [],
            "tool_center": {"shift_m": [0.0001, -0.0002, 0.0007], "deviation_m": [0.0001, 0.0001,
                0.0001], "n_sessions": 30, "n_touches": 240},
            "n_waiting": 1
        }))
        .unwrap()
    }

    #[test]
    fn the_verdict_comes_first_and_then_what_it_rests_on() {
        let expected = "finger: commission the sensor again: a (and one more reason)\n\
            \x20 commission: a\n\
            \x20 watch: b\n\
            at rest a taxel reads at most 300 Pa, has changed by at most 290 Pa since the first \
            days; its noise is at most 30 Pa, described are 31 Pa; a contact begins at 156 Pa\n\
            tool centre: x +0.1 ± 0.1 mm, y -0.2 ± 0.1 mm, z +0.7 ± 0.1 mm (30 sessions, 240 \
            touches)\n\
            counted: sessions 41, presses 500, without contact 120; days 20, 2026-11-01 to \
            2026-11-25; under calibration 3; still to be counted 1";
        assert_eq!(text(&health()), expected);
    }
}
