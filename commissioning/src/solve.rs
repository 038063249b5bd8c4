//! Robust least squares with priors, and uncertainty that does not trust single taxels.
//!
//! Levenberg and Marquardt's method with numerical derivatives. Residuals come in groups, one a
//! touch; errors within a group are taken to be dependent, so the covariance is the sandwich
//! estimator over groups (White 1982). Prior deviations keep what the data does not determine.

use nalgebra::{DMatrix, DVector};

/// Residual beyond which an observation counts less, in its deviations. Chosen: 95 % efficiency
/// of Cauchy's weight (Holland and Welsch 1977).
pub(crate) const CAUCHY: f64 = 2.385;

/// A parameter: its prior about 0 and the step of its derivative.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Parameter {
    /// Deviation of the prior; infinite for none.
    pub(crate) prior: f64,
    /// Step of the numerical derivative.
    pub(crate) step: f64,
}

/// A solution.
#[derive(Clone, Debug)]
pub(crate) struct Solution {
    /// The parameters.
    pub(crate) values: Vec<f64>,
    /// Robust cost without the prior: ½ c² ln(1 + (r/c)²), summed.
    pub(crate) cost: f64,
    /// Cost of the prior: ½ (value / deviation)², summed.
    pub(crate) penalty: f64,
    /// Deviations of the parameters.
    pub(crate) deviations: Vec<f64>,
}

/// Minimises the robust cost of `residuals` and the prior from `start` in `rounds` steps at most.
///
/// `residuals` gives `group` numbers a touch, in units of their deviation.
pub(crate) fn solve(
    parameters: &[Parameter],
    start: &[f64],
    group: usize,
    rounds: usize,
    residuals: &dyn Fn(&[f64]) -> Vec<f64>,
) -> Solution {
    let mut values = start.to_vec();
    let mut at = residuals(&values);
    let mut damping = 1e-3;
    let mut normal = None;
    for _ in 0..rounds {
        let jacobian = derivatives(parameters, &values, &at, residuals);
        let (hessian, gradient) = normal_equations(parameters, &values, &jacobian, &at);
        let before = total(parameters, &values, &at);
        let mut is_better = false;
        for _ in 0..4 {
            let mut damped = hessian.clone();
            for diagonal in 0..values.len() {
                damped[(diagonal, diagonal)] *= 1.0 + damping;
            }
            let Some(factor) = damped.cholesky() else {
                damping *= 10.0;
                continue;
            };
            let step = factor.solve(&gradient);
            let tried: Vec<f64> = values.iter().zip(step.iter()).map(|(v, s)| v - s).collect();
            let there = residuals(&tried);
            if total(parameters, &tried, &there) < before {
                (values, at, is_better) = (tried, there, true);
                damping = (0.2 * damping).max(1e-9);
                break;
            }
            damping *= 10.0;
        }
        normal = Some((hessian, jacobian));
        if !is_better || before - total(parameters, &values, &at) < 1e-4 * before {
            break;
        }
    }
    let deviations = match normal {
        Some((hessian, jacobian)) => deviations(&hessian, &jacobian, &at, group),
        None => vec![f64::INFINITY; values.len()],
    };
    Solution { cost: robust(&at), penalty: penalty(parameters, &values), values, deviations }
}

/// The robust cost of residuals.
pub(crate) fn robust(residuals: &[f64]) -> f64 {
    residuals.iter().map(|r| 0.5 * CAUCHY * CAUCHY * (r / CAUCHY).powi(2).ln_1p()).sum()
}

fn total(parameters: &[Parameter], values: &[f64], residuals: &[f64]) -> f64 {
    robust(residuals) + penalty(parameters, values)
}

fn penalty(parameters: &[Parameter], values: &[f64]) -> f64 {
    let prior = |(value, parameter): (&f64, &Parameter)| 0.5 * (value / parameter.prior).powi(2);
    values.iter().zip(parameters).map(prior).sum()
}

fn weight(residual: f64) -> f64 {
    1.0 / (1.0 + (residual / CAUCHY).powi(2))
}

fn derivatives(
    parameters: &[Parameter],
    values: &[f64],
    at: &[f64],
    residuals: &dyn Fn(&[f64]) -> Vec<f64>,
) -> DMatrix<f64> {
    let mut jacobian = DMatrix::zeros(at.len(), values.len());
    for (column, parameter) in parameters.iter().enumerate() {
        let mut ahead = values.to_vec();
        ahead[column] += parameter.step;
        let ahead = residuals(&ahead);
        for row in 0..at.len() {
            jacobian[(row, column)] = (ahead[row] - at[row]) / parameter.step;
        }
    }
    jacobian
}

fn normal_equations(
    parameters: &[Parameter],
    values: &[f64],
    jacobian: &DMatrix<f64>,
    at: &[f64],
) -> (DMatrix<f64>, DVector<f64>) {
    let mut weighted = jacobian.clone();
    let mut pull = DVector::from_column_slice(at);
    for (row, residual) in at.iter().enumerate() {
        let weight = weight(*residual);
        weighted.row_mut(row).scale_mut(weight);
        pull[row] *= weight;
    }
    let mut hessian = jacobian.transpose() * weighted;
    let mut gradient = jacobian.transpose() * pull;
    for (column, parameter) in parameters.iter().enumerate() {
        let precision = parameter.prior.powi(-2);
        hessian[(column, column)] += precision + 1e-12;
        gradient[column] += precision * values[column];
    }
    (hessian, gradient)
}

/// Deviations by the sandwich estimator, at least those of the prior's and data's own precision.
fn deviations(
    hessian: &DMatrix<f64>,
    jacobian: &DMatrix<f64>,
    at: &[f64],
    group: usize,
) -> Vec<f64> {
    let n = hessian.nrows();
    let Some(inverse) = hessian.clone().try_inverse() else { return vec![f64::INFINITY; n] };
    let n_groups = (at.len() / group).max(2);
    let mut meat = DMatrix::zeros(n, n);
    for first in (0..at.len()).step_by(group) {
        let mut score = DVector::zeros(n);
        for (row, residual) in at.iter().enumerate().skip(first).take(group) {
            let pull = weight(*residual) * residual;
            score += jacobian.row(row).transpose() * pull;
        }
        meat += &score * score.transpose();
    }
    let lost = n_groups as f64 / (n_groups as f64 - n as f64 / 2.0).max(1.0);
    let sandwich = &inverse * meat * &inverse * lost;
    (0..n).map(|at| sandwich[(at, at)].max(inverse[(at, at)]).max(0.0).sqrt()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_fitted_despite_an_outlier() {
        // y = 2 x + 1, one point far off.
        let points: Vec<(f64, f64)> =
            (0..20).map(|x| (f64::from(x), 2.0 * f64::from(x) + 1.0)).collect();
        let residuals = |p: &[f64]| -> Vec<f64> {
            let at = |(index, (x, y)): (usize, &(f64, f64))| {
                let y = if index == 3 { y + 500.0 } else { *y };
                (y - p[0] * x - p[1]) / 0.1
            };
            points.iter().enumerate().map(at).collect()
        };
        let free = Parameter { prior: f64::INFINITY, step: 1e-4 };
        let solution = solve(&[free; 2], &[0.0, 0.0], 1, 50, &residuals);
        assert!((solution.values[0] - 2.0).abs() < 0.01, "{:?}", solution.values);
        assert!((solution.values[1] - 1.0).abs() < 0.1, "{:?}", solution.values);
    }

    #[test]
    fn what_the_data_does_not_say_keeps_its_prior() {
        let residuals = |p: &[f64]| vec![(p[0] - 3.0) / 0.1; 10];
        let parameters =
            [Parameter { prior: 100.0, step: 1e-4 }, Parameter { prior: 0.5, step: 1e-4 }];
        let solution = solve(&parameters, &[0.0, 0.0], 1, 20, &residuals);
        assert!((solution.values[0] - 3.0).abs() < 0.01);
        assert!(solution.values[1].abs() < 1e-9 && (solution.deviations[1] - 0.5).abs() < 1e-6);
    }
}
