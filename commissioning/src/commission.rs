//! The whole: touches of a known object in, findings with their corrections out.
//!
//! Order of the steps: unit of pressure, convention of poses with the object's place, order of
//! the image, covering, single taxels. Later steps know the earlier ones' results.

use palpate_core::convention::{PoseConvention, PoseDirection, PositionUnit, QuaternionOrder};
use palpate_core::pose::Pose;
use palpate_core::sensor::{Estimate, ImageOrder};
use palpate_core::stop::{Stop, Stopped};
use palpate_sim::press::PressSimulator;
use thiserror::Error;

use crate::conventions::{self, Scored, part, score};
use crate::covering;
use crate::estimate::{Choice, Verdict};
pub use crate::images::Edge;
use crate::images::{Images, LN_GAIN, LN_SPREAD, N, STIFFEN};
use crate::order::{self, Ordered, reordered, values};
pub use crate::order::{ORDERS, composed};
use crate::pressure;
pub use crate::pressure::PressureUnit;
use crate::surface::SurfaceSearch;
use crate::taxels;
pub use crate::taxels::TaxelFault;
use crate::tool_center::tool_center;
pub use crate::tool_center::{RESIDUAL_MAX, ToolCenter};
use crate::touch::{SentTouch, TOUCHES_MAX, TOUCHES_MIN};

/// Residual above which the place of the object is searched again with other touches. Fitted: as
/// [`RESIDUAL_MAX`].
const RESIDUAL_USUAL: f64 = 0.08;

/// Most searches, and taxels in all images that two searches may have. Chosen: of eight searches for
/// a hammer touched twenty times three failed, so that four fail once in fifty.
const SEARCHES: usize = 4;
const SEARCH_TAXELS: usize = 40_000;

/// Places of the object at which images are compared, over all conventions.
const PLACES_MAX: usize = 6;

/// What is commissioned.
#[derive(Clone, Copy, Debug)]
pub struct Setup<'a> {
    /// The object under the sensor as described, in the frame of its mesh.
    pub object: &'a PressSimulator,
    /// The object's pose, `session_from_object`, if it is known.
    pub session_from_object: Option<Pose>,
    /// The touches in the numbers that were sent.
    pub touches: &'a [SentTouch],
    /// Seed of the search.
    pub seed: u64,
    /// The end of the computation before its result.
    pub stop: &'a Stop,
}

/// Why touches cannot be used.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
pub enum CommissionError {
    /// Too few or too many.
    #[error("{found} touches, expected {TOUCHES_MIN} to {TOUCHES_MAX}")]
    Count {
        /// Number of touches.
        found: usize,
    },
    /// An image has another number of taxels than the sensor.
    #[error("touch {touch} has {found} taxels, expected {expected}")]
    Taxels {
        /// Index of the touch.
        touch: usize,
        /// Taxels of the image.
        found: usize,
        /// Taxels of the sensor.
        expected: usize,
    },
    /// A number is not finite, or a quaternion has not norm 1.
    #[error("touch {touch} has a number that is not finite, or a quaternion whose norm is not 1")]
    Number {
        /// Index of the touch.
        touch: usize,
    },
    /// In no convention do the touches have the object's size.
    #[error("the touches do not fit the object's size in any unit of position")]
    Nowhere,
    /// Not enough touches have any pressure.
    #[error("{found} touches have a pressure above 0, expected at least {TOUCHES_MIN}")]
    Silent {
        /// Number of touches with a pressure.
        found: usize,
    },
    /// It was stopped.
    #[error("the computation was stopped")]
    Stopped,
}

/// Findings about a sensor on its robot.
#[derive(Clone, Debug, PartialEq)]
pub struct Findings {
    /// Unit of pressures.
    pub pressure_unit: Choice<PressureUnit>,
    /// Unit of positions.
    pub position_unit: Choice<PositionUnit>,
    /// Order of quaternions.
    pub quaternion: Choice<QuaternionOrder>,
    /// Direction of poses.
    pub direction: Choice<PoseDirection>,
    /// Order of the driver's images, as a description states it.
    pub image_order: Choice<ImageOrder>,
    /// The tool centre.
    pub tool: ToolCenter,
    /// Factor on the described pressures.
    pub gain: Estimate,
    /// Excess of the pressure ratio at full indentation over that at first touch.
    pub stiffening: Estimate,
    /// Standard deviation of the point spread, metres.
    pub point_spread: Estimate,
    /// End of the covering.
    pub edge: Choice<Edge>,
    /// Faults of single taxels, row-major in the sensor frame's order found.
    pub taxels: Vec<(usize, TaxelFault)>,
    /// Deviation of single poses, metres.
    pub looseness: f64,
    /// Root mean square misfit of a pressure as a share of the touch's largest, with the set-up
    /// as stated and as found.
    pub residual: (f64, f64),
    /// The object's pose.
    pub session_from_object: Pose,
    /// Image of each touch, and what the findings predict: pascal, row-major in the order found.
    pub images: Vec<(Vec<f64>, Vec<f64>)>,
}

impl Findings {
    /// Whether nothing needs a correction.
    #[must_use]
    pub fn is_right(&self) -> bool {
        self.wrong().is_empty()
    }

    /// Names of the findings that need a correction.
    #[must_use]
    pub fn wrong(&self) -> Vec<&'static str> {
        let verdicts = [
            ("pressure_unit", self.pressure_unit.verdict()),
            ("position_unit", self.position_unit.verdict()),
            ("quaternion_order", self.quaternion.verdict()),
            ("pose_direction", self.direction.verdict()),
            ("image_order", self.image_order.verdict()),
            ("tool_center", self.tool.verdict),
        ];
        let named = verdicts.into_iter().filter(|(_, verdict)| *verdict == Verdict::Wrong);
        let mut names: Vec<&'static str> = named.map(|(name, _)| name).collect();
        if !self.taxels.is_empty() {
            names.push("taxels");
        }
        names
    }

    /// The convention of poses that was found.
    #[must_use]
    pub fn convention(&self) -> PoseConvention {
        PoseConvention {
            unit: self.position_unit.value,
            quaternion: self.quaternion.value,
            direction: self.direction.value,
        }
    }
}

/// Finds what holds for a sensor on its robot.
///
/// # Errors
/// [`CommissionError`] names the first touch that cannot be used.
pub fn commission(setup: &Setup<'_>) -> Result<Findings, CommissionError> {
    let touches = usable(setup)?;
    let mut best: Result<Findings, CommissionError> = Err(CommissionError::Nowhere);
    for n in 0..searches(setup, touches.len()) {
        let seeded = Setup { seed: setup.seed.wrapping_add(n), ..*setup };
        let found = Stop::heeding(|| found(&seeded, &touches));
        let found = found.map_err(|Stopped| CommissionError::Stopped)?;
        let residual = |of: &Result<Findings, CommissionError>| {
            of.as_ref().map_or(f64::INFINITY, |found| found.residual.1)
        };
        if residual(&found) < residual(&best) {
            best = found;
        }
        if residual(&best) < RESIDUAL_USUAL {
            break;
        }
    }
    best
}

/// Searches for the object's place; one if it is given. Fewer for many touches or taxels: a bound
/// on the work.
fn searches(setup: &Setup<'_>, n_touches: usize) -> u64 {
    if setup.session_from_object.is_some() {
        return 1;
    }
    let n_taxels = n_touches * setup.object.sensor().grid().n_taxels();
    let affordable = (TOUCHES_MAX / n_touches).min(SEARCH_TAXELS / n_taxels);
    affordable.clamp(1, SEARCHES) as u64
}

fn found(setup: &Setup<'_>, touches: &[SentTouch]) -> Result<Findings, CommissionError> {
    let sensor = setup.object.sensor();
    let stated = sensor.parameters().image_order;
    let mut images: Vec<Vec<Option<f64>>> =
        touches.iter().map(|touch| reordered(&touch.pressures, stated, sensor)).collect();
    let pressure_unit = pressure::unit(&images, sensor);
    let pascals = pressure_unit.value.pascals(sensor);
    for image in &mut images {
        image.iter_mut().flatten().for_each(|pressure| *pressure *= pascals);
    }
    let dead = taxels::dead(&images);
    for image in &mut images {
        dead.iter().for_each(|taxel| image[*taxel] = None);
    }
    let search = SurfaceSearch::new(setup.object, setup.seed, setup.stop);
    let given = setup.session_from_object.map(|pose| pose.inverse());
    let mut scored = score(touches, given, &search, setup.seed);
    let n_open = conventions::n_open(&scored);
    let fits: Vec<Ordered<'_>> =
        scored[..n_open].iter().filter_map(|one| fit(setup, touches, &images, one)).collect();
    let losses: Vec<f64> = fits.iter().map(|fit| fit.loss).collect();
    if losses.len() == n_open {
        conventions::weigh(&mut scored, &losses);
    }
    let likeliest =
        (0..losses.len()).max_by(|a, b| scored[*a].probability.total_cmp(&scored[*b].probability));
    let (at, ordered) = likeliest
        .and_then(|at| Some((at, fits.into_iter().nth(at)?)))
        .ok_or(CommissionError::Nowhere)?;
    let best = scored[at].convention;
    let turned = ordered.order;
    let (edge, fitted, solution) = covering::choose(ordered.images, &ordered.solution);
    let found = values(&solution);
    let mut faults: Vec<(usize, TaxelFault)> = dead
        .iter()
        .map(|taxel| (place_after(*taxel, turned.value, setup), TaxelFault::Dead))
        .collect();
    faults.extend(
        taxels::offsets(&fitted, &found).into_iter().map(|(at, by)| (at, TaxelFault::Offset(by))),
    );
    faults.sort_by_key(|fault| fault.0);
    let as_stated =
        Images { measured: images, poses: fitted.poses.clone(), ..fitted_copy(&fitted) };
    let residual = (misfit(&as_stated, &[0.0; N]), misfit(&fitted, &found));
    let described = sensor.parameters();
    Ok(Findings {
        pressure_unit,
        position_unit: conventions::unit(&scored, best),
        quaternion: part(&scored, best, |convention| convention.quaternion),
        direction: part(&scored, best, |convention| convention.direction),
        image_order: Choice {
            value: composed(stated, turned.value, sensor),
            probability: turned.probability,
            stated,
        },
        tool: tool_center(&found, &solution.deviations, residual.1),
        gain: logarithmic(1.0, found[LN_GAIN], solution.deviations[LN_GAIN]),
        stiffening: Estimate { value: found[STIFFEN], deviation: solution.deviations[STIFFEN] },
        point_spread: logarithmic(
            described.point_spread,
            found[LN_SPREAD],
            solution.deviations[LN_SPREAD],
        ),
        edge,
        taxels: faults,
        looseness: taxels::looseness(&fitted, &found),
        residual,
        session_from_object: fitted.object_from_session(&found).inverse(),
        images: paired(&fitted, &found),
    })
}

/// Fits the images of a convention at its places of the object; `None` without a place.
fn fit<'a>(
    setup: &Setup<'a>,
    touches: &[SentTouch],
    images: &[Vec<Option<f64>>],
    scored: &Scored,
) -> Option<Ordered<'a>> {
    let convention = scored.convention;
    let coupling = setup.object.sensor().parameters().coupling;
    let read = |touch: &SentTouch| convention.read(touch.position, touch.quaternion);
    let sent = Images {
        simulator: setup.object,
        stop: setup.stop,
        poses: touches.iter().map(read).collect(),
        measured: images.to_vec(),
        object_from_session: Pose::IDENTITY,
        may_move: setup.session_from_object.is_none(),
        edge: Edge { margin: coupling.margin, effect: coupling.edge },
    };
    let mut places = scored.places.clone();
    let least = places.first()?.misfit;
    places.retain(|placed| setup.session_from_object.is_some() || placed.misfit < least + 0.25);
    places.truncate(PLACES_MAX);
    order::choose(&sent, &places)
}

/// The touches with a pressure, checked.
fn usable(setup: &Setup<'_>) -> Result<Vec<SentTouch>, CommissionError> {
    let found = setup.touches.len();
    if !(TOUCHES_MIN..=TOUCHES_MAX).contains(&found) {
        return Err(CommissionError::Count { found });
    }
    let expected = setup.object.sensor().grid().n_taxels();
    for (touch, sent) in setup.touches.iter().enumerate() {
        if sent.pressures.len() != expected {
            let found = sent.pressures.len();
            return Err(CommissionError::Taxels { touch, found, expected });
        }
        let is_finite = sent.pressures.iter().flatten().all(|p| p.is_finite() && p.abs() < 1e9)
            && sent.position.iter().all(|p| p.is_finite() && p.abs() < 1e6);
        if !is_finite || Pose::new([0.0; 3], sent.quaternion).is_err() {
            return Err(CommissionError::Number { touch });
        }
    }
    let has_pressure = |touch: &&SentTouch| touch.pressures.iter().flatten().any(|p| *p > 0.0);
    let kept: Vec<SentTouch> = setup.touches.iter().filter(has_pressure).cloned().collect();
    if kept.len() < TOUCHES_MIN {
        return Err(CommissionError::Silent { found: kept.len() });
    }
    Ok(kept)
}

fn fitted_copy<'a>(images: &Images<'a>) -> Images<'a> {
    Images { poses: images.poses.clone(), measured: images.measured.clone(), ..*images }
}

/// The index of a taxel after its image is brought into another order.
fn place_after(taxel: usize, order: ImageOrder, setup: &Setup<'_>) -> usize {
    let sensor = setup.object.sensor();
    let places: Vec<usize> = (0..sensor.grid().n_taxels()).collect();
    let moved = reordered(&places, order, sensor);
    moved.iter().position(|at| *at == taxel).unwrap_or(taxel)
}

fn logarithmic(described: f64, ln: f64, deviation: f64) -> Estimate {
    let value = described * ln.exp();
    Estimate { value, deviation: value * deviation.min(10.0) }
}

/// Measured and modelled image of every touch; 0 for taxels without a value.
fn paired(images: &Images<'_>, values: &[f64; N]) -> Vec<(Vec<f64>, Vec<f64>)> {
    let measured = images.measured.iter().map(|image| image.iter().map(|p| p.unwrap_or(0.0)));
    measured.map(Iterator::collect).zip(images.modelled(values)).collect()
}

/// Root mean square misfit of a pressure as a share of its touch's largest.
fn misfit(images: &Images<'_>, values: &[f64; N]) -> f64 {
    let modelled = images.modelled(values);
    let (mut sum, mut n) = (0.0, 0_usize);
    for (image, modelled) in images.measured.iter().zip(&modelled) {
        let largest = image.iter().flatten().copied().fold(f64::MIN_POSITIVE, f64::max);
        for (measured, modelled) in image.iter().zip(modelled) {
            if let Some(measured) = measured {
                sum += ((measured - modelled) / largest).powi(2);
                n += 1;
            }
        }
    }
    (sum / n.max(1) as f64).sqrt()
}
