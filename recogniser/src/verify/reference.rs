//! The reference: the evidence of a session as one plain sum over all patches, poses and touches.
//!
//! The equations of `docs/recogniser.md` as printed, in double precision, without look-up,
//! pruning or rounded storage. It is slow and serves as the reference for the fast path
//! ([`super::check::check_recogniser`]).

use std::f64::consts::TAU;

use glam::{DVec2, DVec3, Vec3};
use palpate_core::log_prob::log_sum_exp;
use palpate_core::pose::Pose;

use crate::model::agreement::{Feature, N_AXES, StoredFeature, unstored};
use crate::model::appearance::AppearanceSpace;
use crate::model::bend::{Bend, bends};
use crate::model::{SurfaceMap, SurfacePatch};
use crate::observe::touch::Touch;
use crate::options::SurfaceOptions;

/// Touches of an object at rest or in announced drift ([`SurfaceOptions::motion`]), and poses that
/// explain them.
#[derive(Clone, Copy, Debug)]
pub struct Session<'a> {
    /// The object.
    pub map: &'a SurfaceMap,
    /// The space of its features.
    pub space: &'a AppearanceSpace,
    /// The options.
    pub options: &'a SurfaceOptions,
    /// The touches in their order.
    pub touches: &'a [Touch],
    /// `session_from_object`.
    pub poses: &'a [Pose],
    /// True place of the sensor relative to the stated one, sensor frame, metres (equation R21a).
    pub tool: DVec3,
}

/// ln L_o of equation R17 for k = 3: the sum over the session's poses and over the case that all
/// touches fit nowhere.
#[must_use]
pub fn evidence(session: &Session<'_>) -> f64 {
    let bends = bends(session.map.patches(), session.map.spacing());
    let placed: Vec<Placed> = (0..session.touches.len()).map(|n| Placed::new(session, n)).collect();
    let touches = || session.touches.iter().zip(&placed);
    let score = |pose: &Pose| -> f64 {
        let all =
            touches().map(|(touch, at)| at.weight * density(session, &bends, pose, touch, at).ln());
        all.sum::<f64>() + tool_prior(session)
    };
    let lost = touches().map(|(_, at)| {
        at.weight * (f64::from(session.options.scale.outliers) + at.off_object).ln()
    });
    let lost = lost.sum::<f64>();
    log_sum_exp(session.poses.iter().map(score).chain([lost]))
}

/// ln prior density of the tool's error relative to none. Equation R21a.
fn tool_prior(session: &Session<'_>) -> f64 {
    let of_usual = session.tool / f64::from(session.options.refinement.tool);
    -2.0 * (1.0 + of_usual.length_squared()).ln()
}

/// Placement of a touch: its weight, the variances of its position and angle, and its off-object
/// density. Equations R2, R3 and R14.
#[derive(Clone, Copy, Debug)]
struct Placed {
    weight: f64,
    position: f64,
    angle: f64,
    off_object: f64,
    unsteady: f64,
    stretch_outliers: f64,
}

impl Placed {
    fn new(session: &Session<'_>, index: usize) -> Self {
        let touch = &session.touches[index];
        let missing = (0.53 - touch.evenness).max(0.0);
        let moves = (session.touches.len() - 1 - index) as f64;
        let drift = session.options.motion;
        let moved = drift.map_or(0.0, |drift| moves * drift.position.powi(2));
        // Equation R1a: a contact without an image, or a loose sensor, has deviations of its own.
        let point = touch.point.map_or(0.0, |point| point.position.powi(2));
        let position = moved + point + touch.looseness.powi(2);
        let x = 0.007 / position.sqrt();
        let normal = touch.point.and_then(|point| point.normal);
        Self {
            weight: novelties(session)[index] / (1.0 + moved / 0.01f64.powi(2)),
            position,
            angle: drift.map_or(0.0, |drift| moves * drift.angle.powi(2)),
            off_object: 64.0 * (-0.717 * x - 0.416 * x * x).exp(),
            unsteady: normal.unwrap_or(1.83 * missing).powi(2),
            stretch_outliers: (0.05 + 2.25 * missing).min(0.9),
        }
    }
}

/// Probability of each touch that no earlier one was at its place. Equation R2.
fn novelties(session: &Session<'_>) -> Vec<f64> {
    let mut all: Vec<f64> = Vec::new();
    for touch in session.touches {
        let n = all.len();
        let is_new = |(index, (other, novelty)): (usize, (&Touch, &f64))| {
            let moves = (n - index) as f64;
            let loose = session.options.motion.map_or(0.0, |drift| {
                let turned = if feel_normals(touch, other) { drift.angle } else { 0.0 };
                moves * (3.0 * drift.position.powi(2) + 2.0 * (0.006 * turned).powi(2))
            });
            let squared = touch.position.distance_squared(other.position)
                + (0.006 * turned(touch, other)).powi(2)
                + loose;
            1.0 - novelty * (1.0 - normal_probability((squared.sqrt() - 0.004) / 0.001))
        };
        all.push(session.touches.iter().zip(&all).enumerate().map(is_new).product());
    }
    all
}

/// Φ: probability that a normal number is below `x` deviations, by the midpoint rule.
fn normal_probability(x: f64) -> f64 {
    let density = |t: f64| (-0.5 * t * t).exp() / std::f64::consts::TAU.sqrt();
    let n = 400;
    let step = x.clamp(-8.0, 8.0) / f64::from(n);
    0.5 + step * (0..n).map(|i| density((f64::from(i) + 0.5) * step)).sum::<f64>()
}

/// Distance of the normals of two touches; 0 if one was not felt.
fn turned(touch: &Touch, other: &Touch) -> f64 {
    if feel_normals(touch, other) { touch.normal.distance(other.normal) } else { 0.0 }
}

/// Whether both touches felt a normal.
fn feel_normals(touch: &Touch, other: &Touch) -> bool {
    let felt = |touch: &Touch| touch.point.is_none_or(|point| point.normal.is_some());
    felt(touch) && felt(other)
}

/// L of equation R4: density ratio of the touch under the object in a pose against a touch
/// anywhere.
fn density(session: &Session<'_>, bends: &[Bend], pose: &Pose, touch: &Touch, at: &Placed) -> f64 {
    let scale = &session.options.scale;
    let object_from_session = pose.inverse();
    let (x, z) = (touch.sensor_x, -touch.normal);
    let off = session.tool.x * x + session.tool.y * z.cross(x) + session.tool.z * z;
    let point = object_from_session * (touch.position + off);
    let normal = object_from_session.turn(touch.normal);
    let direction = object_from_session.turn(touch.direction);
    let across = f64::from(scale.across).powi(2) + at.position;
    let along = f64::from(scale.along.max(session.map.spacing())).powi(2) + at.position;
    let anywhere = density_anywhere(session.space, &touch.feature, scale.appearance_of_pose);
    let variance = f64::from(scale.normal).powi(2) + at.unsteady + at.angle;
    let mut sum = 0.0;
    for (patch, bend) in session.map.patches().iter().zip(bends) {
        let surface = Surface::new(patch, bend, point);
        let spatial = surface.height.powi(2) / across + surface.flat_squared / along;
        let turned = normal - surface.normal;
        let turned = DVec2::new(turned.dot(surface.axes[0]), turned.dot(surface.axes[1]));
        let variances = DVec2::from(bend.normal_variances.map(f64::from)) + variance;
        let cosine = normal.dot(surface.normal);
        let facing = match touch.point {
            Some(point) if point.normal.is_none() => 1.0,
            _ => normal_ratio(cosine, turned, variances, scale.normal_outliers.into()),
        };
        let concentration =
            f64::from(scale.direction) * f64::from(patch.elongation) * touch.elongation;
        let stretch =
            stretch_ratio(concentration, direction.dot(surface.axes[0]), at.stretch_outliers);
        let alike = student(&touch.feature, &patch.feature, scale.appearance_of_pose);
        let appearance =
            if touch.point.is_some() { 1.0 } else { appearance_ratio(alike, anywhere) };
        sum += (-0.5 * spatial).exp() * facing * stretch * appearance;
    }
    let n = session.map.patches().len() as f64;
    let outliers = f64::from(scale.outliers);
    let peak =
        (1.0 - outliers) * f64::from(scale.workspace) / (TAU.powf(1.5) * across.sqrt() * along);
    peak * sum / n + outliers + at.off_object
}

/// The curved surface about a patch, at a point: equation R4a.
struct Surface {
    /// Height of the point above it, metres.
    height: f64,
    /// Squared distance along the tangent plane, m².
    flat_squared: f64,
    normal: DVec3,
    /// Tangent axes: along the stretch and across it.
    axes: [DVec3; 2],
}

impl Surface {
    fn new(patch: &SurfacePatch, bend: &Bend, point: DVec3) -> Self {
        let double = |v: Vec3| v.as_dvec3();
        let (normal, along) = (double(patch.normal), double(patch.direction));
        let axes = [along, normal.cross(along)];
        let off = point - double(patch.position);
        let [xx, xy, yy] = bend.form.map(f64::from);
        let (x, y) = (off.dot(axes[0]), off.dot(axes[1]));
        let turn = [xx * x + xy * y, xy * x + yy * y];
        let fall = 0.5 * (turn[0] * x + turn[1] * y);
        let height = off.dot(normal);
        let [first, second] = turn.map(|turn| turn.clamp(-1.0, 1.0));
        Self {
            height: height + fall,
            flat_squared: off.length_squared() - height * height,
            normal: (normal + first * axes[0] + second * axes[1]).normalize(),
            axes,
        }
    }
}

/// Equation R5: ratio of the density of a normal to a uniform one. `turned` is its rotation
/// along the stretch and across it, `cosine` that of the angle to the expected normal.
#[must_use]
pub fn normal_ratio(cosine: f64, turned: DVec2, variances: DVec2, outliers: f64) -> f64 {
    let side = outliers * 0.75 * (1.0 + cosine).powi(2);
    if cosine <= 0.0 {
        return side;
    }
    let misfit = turned.x.powi(2) / variances.x + turned.y.powi(2) / variances.y;
    let peak = 2.0 / (variances.x * variances.y).sqrt();
    (1.0 - outliers) * peak * (-0.5 * misfit).exp() + side
}

/// Equation R6 with the exact Bessel function.
#[must_use]
pub fn stretch_ratio(concentration: f64, cosine: f64, outliers: f64) -> f64 {
    let concentration = concentration.min(7.0);
    let likelier = (concentration * (2.0 * cosine * cosine - 1.0)).exp() / bessel(concentration);
    (1.0 - outliers) * likelier + outliers
}

/// I₀(x) = Σ (x²/4)^n / n!².
fn bessel(x: f64) -> f64 {
    let (mut sum, mut term, mut n) = (0.0, 1.0, 0.0);
    while term > 1e-17 * sum {
        sum += term;
        n += 1.0;
        term *= x * x / (4.0 * n * n);
    }
    sum
}

/// Equation R7 by the agreement with a patch and its mean anywhere.
fn appearance_ratio(agreement: f64, anywhere: f64) -> f64 {
    0.95 * agreement / anywhere + 0.05
}

/// Student's t with three degrees of freedom in eight dimensions, not normalised.
fn student(feature: &Feature, other: &StoredFeature, softness: f32) -> f64 {
    let other = unstored(other);
    let square: f64 =
        (0..N_AXES).map(|axis| (f64::from(feature[axis]) - f64::from(other[axis])).powi(2)).sum();
    (1.0 + square / (3.0 * f64::from(softness))).powf(-5.5)
}

/// The mean agreement with features of touches anywhere.
fn density_anywhere(space: &AppearanceSpace, feature: &Feature, softness: f32) -> f64 {
    let all = space.anywhere();
    let sum: f64 = all.iter().map(|other| student(feature, other, softness)).sum();
    (sum / all.len().max(1) as f64).max(f64::from(f32::MIN_POSITIVE))
}

/// P_o of equation R10 for the session's first two touches: the mean over all ordered pairs of the
/// patches whose pairs are tabled. `None` when both touches are at one place.
#[must_use]
pub fn pair_evidence(session: &Session<'_>) -> Option<f64> {
    let [first, second, ..] = session.touches else { return None };
    let observed =
        PairGeometry::new([first.position, second.position], [first.normal, second.normal])?;
    let map = session.map;
    let bends = bends(map.patches(), map.spacing());
    let n = map.layout().pair_patches_max.min(map.patches().len());
    let softness = session.options.scale.appearance;
    let ratios = [first, second].map(|touch| -> Vec<f64> {
        let anywhere = density_anywhere(session.space, &touch.feature, softness);
        let ratio = |patch: &SurfacePatch| {
            if touch.point.is_some() {
                return 1.0;
            }
            appearance_ratio(student(&touch.feature, &patch.feature, softness), anywhere)
        };
        map.patches()[..n].iter().map(ratio).collect()
    });
    let mut sum = 0.0;
    for j in 0..n {
        for k in (0..n).filter(|k| *k != j) {
            let ends = [j, k].map(|index| (&map.patches()[index], &bends[index]));
            sum += ratios[0][j] * ratios[1][k] * pair_density(session, &observed, ends);
        }
    }
    Some(sum / (n * (n - 1)).max(1) as f64)
}

/// Distance, cosines of both normals with the axis, and the angle between the normals about the
/// axis.
struct PairGeometry {
    axis: DVec3,
    distance: f64,
    cosines: [f64; 2],
    /// Cosine and sine of the angle between both normals about the axis, times both sines.
    turn: DVec2,
}

impl PairGeometry {
    fn new(positions: [DVec3; 2], normals: [DVec3; 2]) -> Option<Self> {
        let axis = (positions[1] - positions[0]).try_normalize()?;
        let cosines = normals.map(|normal| normal.dot(axis));
        let turn = DVec2::new(
            normals[0].dot(normals[1]) - cosines[0] * cosines[1],
            normals[0].cross(normals[1]).dot(axis),
        );
        Some(Self { axis, distance: positions[0].distance(positions[1]), cosines, turn })
    }
}

/// G of equation R9 times the two factors of equation R6, for touches at rest.
fn pair_density(
    session: &Session<'_>,
    observed: &PairGeometry,
    ends: [(&SurfacePatch, &Bend); 2],
) -> f64 {
    let options = session.options;
    let patches = ends.map(|(patch, _)| patch);
    let stored = PairGeometry::new(
        patches.map(|patch| patch.position.as_dvec3()),
        patches.map(|patch| patch.normal.as_dvec3()),
    );
    let Some(stored) = stored else { return 0.0 };
    let placed = [0, 1].map(|index| Placed::new(session, index));
    let unsteady = placed[0].unsteady + placed[1].unsteady;
    let tolerance = f64::from(options.pairs.cosine).hypot(2.0 * unsteady.min(0.09).sqrt());
    let distance = observed.distance - stored.distance;
    let off = [0, 1].map(|end| observed.cosines[end] - stored.cosines[end]);
    let is_short = stored.distance < f64::from(session.map.layout().pair_distance_min);
    let is_far = distance.abs() > options.pairs.distance.into();
    if is_short || is_far || off.iter().any(|off| off.abs() > tolerance) {
        return 0.0;
    }
    let own = f64::from(options.pair_deviation.cosine);
    let least = (0.5 * own).powi(2);
    let mut misfit = (distance / f64::from(options.pair_deviation.distance)).powi(2);
    let (mut product, mut about_axis, mut stretch) = (1.0, 0.0, 1.0);
    for (end, (patch, bend)) in ends.into_iter().enumerate() {
        let (normal, along) = (patch.normal.as_dvec3(), patch.direction.as_dvec3());
        let across = normal.cross(along);
        let variances = bend.normal_variances.map(f64::from);
        let [a, b] = variances.map(|variance| 0.625 * variance + least + placed[end].unsteady);
        let towards = |v: DVec3| a * along.dot(v).powi(2) + b * across.dot(v).powi(2);
        let about = stored.axis.cross(normal);
        let sine_squared = about.length_squared().max(1e-3);
        let variance = towards(stored.axis) + least;
        misfit += off[end].powi(2) / variance;
        product *= variance;
        about_axis += towards(about) / sine_squared.powi(2);
        let touch = &session.touches[end];
        let in_plane = |normal: DVec3, direction: DVec3, axis: DVec3| {
            DVec2::new(direction.dot(axis), direction.dot(normal.cross(axis))).normalize_or_zero()
        };
        let cosine = in_plane(touch.normal, touch.direction, observed.axis).dot(in_plane(
            normal,
            along,
            stored.axis,
        ));
        let concentration =
            f64::from(options.scale.direction) * touch.elongation * f64::from(patch.elongation);
        stretch *= stretch_ratio(concentration, cosine, placed[end].stretch_outliers);
    }
    let turn = observed.turn.perp_dot(stored.turn).atan2(observed.turn.dot(stored.turn));
    let about_axis = (about_axis + own.powi(2) / observed.turn.length().max(1e-3)).min(3.0);
    misfit += turn.powi(2) / about_axis;
    if misfit > 16.0 {
        return 0.0;
    }
    1e-3 / (product * about_axis).sqrt() * (-0.5 * misfit).exp() * stretch
}
