//! Fits to presses of a small array with known gains and faults.

use super::*;
use crate::sensor::spread_fit::{Indenter, indentation_image};
use crate::units::{KPA, MM};

const GRID: TaxelGrid = TaxelGrid { rows: 3, cols: 3, pitch: 2.0 * MM, taxel_width: 1.8 * MM };

/// Presses of every taxel to five depths. The pressed taxel reads `gain(taxel)` · depth,
/// the others the share of it left by a blur of 1.36 pitches.
fn presses(gain: impl Fn(usize) -> f64, wire: impl Fn(usize) -> usize) -> Vec<Indentation> {
    let mut presses = Vec::new();
    for taxel in 0..9 {
        let (x, y) = GRID.center(taxel / 3, taxel % 3);
        let indenter = Indenter { diameter: 1.0 * MM };
        let shape = indentation_image(&GRID, 1.36 * GRID.pitch, indenter, (x, y));
        for depth in [0.2, 0.3, 0.4, 0.5, 0.6] {
            let depth = depth * MM;
            let read = |reads: usize| {
                let at = wire(reads);
                Some(gain(reads) * depth * shape[at] / shape[taxel])
            };
            let pressures = (0..9).map(read).collect();
            presses.push(Indentation { taxel, depth, pressures });
        }
    }
    presses
}

#[test]
fn gains_are_recovered_and_removed() {
    // Gains 8, 9, 10, …, 16 MPa/m: the pooled slope is their mean, 12 MPa/m.
    let gain = |taxel: usize| (8.0 + taxel as f64) * 1e6;
    let fit = fit_response(&presses(gain, |taxel| taxel), &GRID, 20.0 * KPA, ResponseForm::Lines)
        .unwrap();
    let calibration = &fit.calibration;
    assert!((calibration.target().slope / 12e6 - 1.0).abs() < 1e-9);
    for (taxel, response) in calibration.taxels().iter().enumerate() {
        assert_eq!(response.state, TaxelState::Ok);
        assert!((response.line.slope / gain(taxel) - 1.0).abs() < 1e-9);
        assert!((response.r_squared - 1.0).abs() < 1e-9);
    }
    assert!(fit.before.residual > 500.0, "{:?}", fit.before);
    assert!(fit.after.residual < 1e-6 && (fit.after.r_squared - 1.0).abs() < 1e-9);
}

#[test]
fn dead_and_cross_wired_taxels_are_distinguished_under_blur() {
    let gain = |taxel: usize| if taxel == 2 { 1e4 } else { 1e7 };
    let wire = |taxel: usize| if taxel == 7 { 4 } else { taxel };
    let fit = fit_response(&presses(gain, wire), &GRID, 20.0 * KPA, ResponseForm::Lines).unwrap();
    let states: Vec<TaxelState> =
        fit.calibration.taxels().iter().map(|taxel| taxel.state).collect();
    for (taxel, state) in states.into_iter().enumerate() {
        let expected = match taxel {
            2 => TaxelState::Dead,
            7 => TaxelState::CrossWired { answers: 4 },
            _ => TaxelState::Ok,
        };
        assert_eq!(state, expected, "taxel {taxel}");
    }
    assert!((fit.calibration.target().slope / 1e7 - 1.0).abs() < 1e-9, "left out of the fit");
}

#[test]
fn curves_remove_what_lines_leave_of_bent_responses() {
    // Taxels stiffen by different amounts: p = 8 MPa/m · d · (1 + bend · d / 0.6 mm).
    let mut presses = presses(|_| 8e6, |taxel| taxel);
    for press in &mut presses {
        for (taxel, pressure) in press.pressures.iter_mut().enumerate() {
            let bend = 0.1 * taxel as f64;
            *pressure = pressure.map(|p| p * (1.0 + bend * p / (8e6 * 0.6 * MM)));
        }
    }
    let fit = |form| fit_response(&presses, &GRID, 20.0 * KPA, form).unwrap();
    let (lines, curves) = (fit(ResponseForm::Lines), fit(ResponseForm::Curves));
    assert!(lines.after.residual > 50.0, "{:?}", lines.after);
    assert!(curves.after.residual < 0.5 * lines.after.residual, "{:?}", curves.after);
    let target = &curves.calibration.curves().unwrap().target;
    // The mean bend is 0.4: 0.6 mm give 4.8 kPa · 1.4.
    assert!((target.at(0.6 * MM) - 6.72 * KPA).abs() < 1e-6);
    let flat = presses.iter().map(|press| {
        let falls = press.taxel == 4 && press.depth > 0.25 * MM;
        let pressures = press.pressures.iter().map(|p| if falls { Some(0.0) } else { *p });
        Indentation { pressures: pressures.collect(), ..press.clone() }
    });
    let flat: Vec<Indentation> = flat.collect();
    let state = fit_response(&flat, &GRID, 20.0 * KPA, ResponseForm::Curves).unwrap();
    assert_ne!(state.calibration.taxels()[4].state, TaxelState::Ok, "no curve is needed");
}

#[test]
fn saturated_values_are_left_out() {
    // 20 MPa/m reach 10 kPa at 0.5 mm: the values of 0.5 and 0.6 mm are clipped there.
    let mut presses = presses(|_| 2e7, |taxel| taxel);
    for press in &mut presses {
        press.pressures.iter_mut().flatten().for_each(|p| *p = p.min(10.0 * KPA));
    }
    let fit = fit_response(&presses, &GRID, 10.0 * KPA, ResponseForm::Lines).unwrap();
    assert!((fit.calibration.target().slope / 2e7 - 1.0).abs() < 1e-9);
}

#[test]
fn missing_presses_are_refused_by_taxel() {
    let all = presses(|_| 1e7, |taxel| taxel);
    let without: Vec<_> = all.iter().filter(|press| press.taxel != 5).cloned().collect();
    let fit = |presses: &[Indentation]| {
        fit_response(presses, &GRID, 20.0 * KPA, ResponseForm::Lines).unwrap_err()
    };
    assert_eq!(fit(&without), ResponseError::Depths { row: 1, col: 2 });
    let mut wrong = all.clone();
    wrong[3].depth = f64::NAN;
    assert!(matches!(fit(&wrong), ResponseError::Depth { press: 3, .. }));
    wrong[2].pressures.pop();
    let shape = ResponseError::Shape { press: 2, found: 8, expected: 9 };
    assert_eq!(fit(&wrong), shape);
    wrong[1].taxel = 9;
    assert_eq!(fit(&wrong), ResponseError::Taxel { press: 1, taxel: 9, n_taxels: 9 });
    let numb = presses(|_| 0.0, |taxel| taxel);
    assert_eq!(fit(&numb), ResponseError::Silent { usable: 0, n_taxels: 9 });
    let n_presses = all.len();
    let mut others = all.clone();
    others.iter_mut().flat_map(|press| press.pressures.iter_mut()).for_each(|p| *p = Some(3e4));
    assert_eq!(fit(&others), ResponseError::Saturated { n_saturated: n_presses, n_presses });
    others.iter_mut().flat_map(|press| press.pressures.iter_mut()).for_each(|p| *p = Some(-3e4));
    assert_eq!(fit(&others), ResponseError::Negative { n_negative: n_presses, n_presses });
}
