//! The belief of a session, by any recognition method.
//!
//! Sessions know nothing of methods; a method knows nothing of sessions. [`check`] refuses
//! readings that a method cannot fold before they are stored.

mod comparison;
mod seen;

use std::sync::Arc;

use palpate_core::belief::MismatchError;
use palpate_core::belief::answer::Answer;
use palpate_core::belief::orbits::{OrbitScale, merge_orbits};
use palpate_core::object::ObjectIdx;
use palpate_core::reading::{Felt, Reading};
use palpate_core::sensor::SensorDescription;
use palpate_core::stop::Stop;
use palpate_core::symmetry::Symmetry;
use palpate_core::units::{DEG, MM};
use palpate_dissertation::appearance::model::AppearanceSource;
use palpate_dissertation::appearance::{AppearanceBelief, AppearanceError, AppearanceOptions};
use palpate_dissertation::filter::particle::ParticleOptions;
use palpate_dissertation::geometric::{
    AdaptiveOptions, BeliefMemory, GeometricBelief, GeometricError, GeometricFilter,
    GeometricOptions, Marginals, PrintedFilter,
};
use palpate_dissertation::sva::{SvaBelief, SvaOptions};
use palpate_recogniser::belief::SurfaceBelief;
use palpate_recogniser::next_touch::{Ranking, rank};
use palpate_recogniser::pose_prior::PosePriorError;
use palpate_schemas::{FieldError, Method};
use palpate_store::entity::{Session, StoredReading};
use thiserror::Error;

use crate::model::{Model, NoPart};
use crate::wire::Invalid;
use crate::wire::geometry::core_prior;
use crate::wire::next_touch::Question;
use crate::wire::reading::{ERRORS_MAX, Incoming};
use crate::wire::session::{Options, options, surface_options};
pub(crate) use seen::seen;

/// Scale at which refined poses of pair maps are equal: half a bin and a few degrees.
const SVA_SCALE: OrbitScale = OrbitScale { distance: 4.0 * MM, angle: 8.0 * DEG };
/// Number of poses of pair maps considered for each answered one.
const MODES_OF_AN_ORBIT: usize = 4;

/// A belief, by method. A copy folds readings like its original, bit for bit.
#[derive(Clone)]
pub(crate) enum SessionBelief {
    Surface(Box<SurfaceBelief>),
    /// With the symmetries of the objects; none for the printed method.
    Sva(SvaBelief, Arc<[Symmetry]>),
    Geometric(GeometricBelief),
    Appearance(AppearanceBelief),
}

/// The distribution of each coordinate of an object's pose.
pub(crate) struct ObjectMarginals {
    pub(crate) object: ObjectIdx,
    pub(crate) probability: f64,
    pub(crate) marginals: Marginals,
}

/// Error of a belief.
#[derive(Debug, Error)]
pub(crate) enum BeliefError {
    #[error(transparent)]
    Recognise(#[from] MismatchError),
    #[error(transparent)]
    PosePrior(#[from] PosePriorError),
    #[error(transparent)]
    Geometric(#[from] GeometricError),
    #[error(transparent)]
    Appearance(#[from] AppearanceError),
    #[error("a reading has no pose, which the session's method needs")]
    PoseMissing,
    #[error("an option that the session's method needs is not stored")]
    OptionMissing,
    #[error(transparent)]
    NoPart(#[from] NoPart),
    #[error(transparent)]
    Invalid(#[from] Invalid),
}

impl SessionBelief {
    /// The belief before the first reading.
    pub(crate) fn new(session: &Session, model: &Model) -> Result<Self, BeliefError> {
        let weights: Vec<f64> = session.prior.iter().map(|(_, weight)| *weight).collect();
        let prior = (!weights.is_empty()).then_some(weights.as_slice());
        let sva = || Arc::clone(&model.core.sva);
        let options = options(session);
        match options.method {
            Method::Surface => {
                let surfaces = Arc::clone(model.surface()?);
                let belief = SurfaceBelief::new(surfaces, surface_options(&options), prior)?;
                Ok(Self::Surface(Box::new(seen(belief, &options, model)?)))
            }
            Method::Sva => {
                let belief = SvaBelief::new(sva(), SvaOptions::default(), prior)?;
                Ok(Self::Sva(belief, Arc::clone(&model.symmetries)))
            }
            Method::SvaLiteral => {
                let belief = SvaBelief::new(sva(), SvaOptions::literal(), prior)?;
                Ok(Self::Sva(belief, Arc::default()))
            }
            Method::Appearance => {
                let options = AppearanceOptions::default();
                Ok(Self::Appearance(AppearanceBelief::new(
                    Arc::clone(model.appearance()?),
                    options,
                    prior,
                )?))
            }
            Method::AppearanceLiteral => {
                let options = AppearanceOptions::literal();
                Ok(Self::Appearance(AppearanceBelief::new(
                    Arc::clone(model.appearance()?),
                    options,
                    prior,
                )?))
            }
            Method::Geometric | Method::GeometricHistogram | Method::GeometricParticles => {
                let options = geometric_options(&options, session.seed)?;
                Ok(Self::Geometric(GeometricBelief::new(model.prepared()?, options, prior)?))
            }
        }
    }

    /// Memory of a geometric belief, without creating it; `None` for other methods.
    pub(crate) fn memory(
        session: &Session,
        model: &Model,
    ) -> Result<Option<BeliefMemory>, BeliefError> {
        let options = options(session);
        if !options.method.is_geometric() {
            return Ok(None);
        }
        let weights: Vec<f64> = session.prior.iter().map(|(_, weight)| *weight).collect();
        let prior = (!weights.is_empty()).then_some(weights.as_slice());
        let options = geometric_options(&options, session.seed)?;
        Ok(Some(GeometricBelief::memory(model.prepared()?, &options, prior)?))
    }

    /// Bytes of memory of its own.
    pub(crate) fn bytes(&self) -> usize {
        match self {
            Self::Surface(belief) => belief.bytes(),
            Self::Sva(belief, _) => belief.bytes(),
            Self::Geometric(belief) => belief.bytes(),
            Self::Appearance(belief) => belief.bytes(),
        }
    }

    /// Makes long loops unwind once `stop` is requested.
    pub(crate) fn heed(&mut self, stop: &Stop) {
        match self {
            Self::Surface(belief) => belief.heed(stop),
            Self::Sva(belief, _) => belief.heed(stop),
            Self::Geometric(belief) => belief.heed(stop),
            // A reading takes a millisecond.
            Self::Appearance(_) => {}
        }
    }

    /// Adds a reading: in its `stored` form, and in core's. Methods that need an image leave
    /// contacts without one out; the answer to the request says so.
    pub(crate) fn add(
        &mut self,
        stored: &StoredReading,
        felt: &Felt,
        sensor: &SensorDescription,
    ) -> Result<(), BeliefError> {
        let reading = match (felt, &mut *self, &stored.feature) {
            (Felt::Press(reading), ..) => reading,
            (Felt::Contact(contact), Self::Surface(belief), _) => {
                if let Some(motion) = &stored.object_moved {
                    belief.announce_move(motion);
                }
                belief.add_contact(contact);
                return Ok(());
            }
            (Felt::Contact(_), Self::Appearance(belief), Some(feature)) => {
                return Ok(belief.add_feature(feature)?);
            }
            (Felt::Contact(_), ..) => return Ok(()),
        };
        match self {
            Self::Appearance(belief) => match &stored.feature {
                Some(feature) => Ok(belief.add_feature(feature)?),
                None => Ok(belief.add(reading, sensor)?),
            },
            Self::Surface(_) | Self::Sva(..) | Self::Geometric(_)
                if stored.session_from_sensor.is_none() =>
            {
                Err(BeliefError::PoseMissing)
            }
            Self::Surface(belief) => {
                if let Some(motion) = &stored.object_moved {
                    belief.announce_move(motion);
                }
                belief.add(reading, sensor);
                Ok(())
            }
            Self::Sva(belief, _) => Ok(belief.add(reading, sensor)?),
            Self::Geometric(belief) => Ok(belief.add(reading, sensor)?),
        }
    }

    /// The checkpoint, for methods with an expensive search.
    pub(crate) fn conclusions(&self) -> Option<Vec<u8>> {
        match self {
            Self::Surface(belief) => Some(belief.checkpoint()),
            Self::Sva(..) | Self::Geometric(_) | Self::Appearance(_) => None,
        }
    }

    /// Registers a reading whose effect [`SessionBelief::resume`] restores; whether the
    /// method can.
    pub(crate) fn retrace(
        &mut self,
        stored: &StoredReading,
        felt: &Felt,
        sensor: &SensorDescription,
    ) -> bool {
        let Self::Surface(belief) = self else { return false };
        if let Some(motion) = &stored.object_moved {
            belief.retrace_move(motion);
        }
        match felt {
            Felt::Press(reading) => belief.retrace(reading, sensor),
            Felt::Contact(contact) => belief.retrace_contact(contact),
        }
        true
    }

    /// Restores a checkpoint of readings that were all retraced; whether it fits.
    pub(crate) fn resume(&mut self, conclusions: &[u8]) -> bool {
        let Self::Surface(belief) = self else { return false };
        belief.resume(conclusions).is_ok()
    }

    /// The belief as an answer with at most `n_modes` poses.
    pub(crate) fn answer(&self, n_modes: usize) -> Answer {
        match self {
            Self::Surface(belief) => belief.answer(n_modes),
            Self::Sva(belief, symmetries) => sva_answer(belief, symmetries, n_modes),
            Self::Geometric(belief) => belief.answer(n_modes),
            Self::Appearance(belief) => belief.answer(),
        }
    }

    /// The marginals of an object's pose, or the likeliest object's; `None` when the method
    /// has none or the object is impossible.
    pub(crate) fn marginals(&self, object: Option<ObjectIdx>) -> Option<ObjectMarginals> {
        let belief = match self {
            Self::Surface(_) | Self::Sva(..) | Self::Appearance(_) => return None,
            Self::Geometric(belief) => belief,
        };
        let answer = belief.answer(0);
        let object = object.or_else(|| answer.best_object())?;
        let probability = answer.probabilities[object.0 as usize];
        Some(ObjectMarginals { object, probability, marginals: belief.marginals(object)? })
    }

    /// The best next touches; `None` when the method has none, or the position of the object
    /// is unknown.
    pub(crate) fn next_touches(
        &self,
        question: &Question,
        should_stop: &mut dyn FnMut() -> bool,
    ) -> Option<Ranking> {
        let Self::Surface(belief) = self else { return None };
        rank(belief, question.approaches.as_deref(), &question.options, should_stop).ok()
    }
}

/// The options of a geometric session.
fn geometric_options(options: &Options, seed: u64) -> Result<GeometricOptions, BeliefError> {
    let filter = match (options.method, options.bins, options.particles) {
        (Method::GeometricHistogram, Some(n), _) => {
            let n = n.map(|n| n as usize);
            GeometricFilter::Printed(PrintedFilter::Histogram { n })
        }
        (Method::GeometricParticles, _, Some(n)) => {
            let options = ParticleOptions::literal(n as usize);
            GeometricFilter::Printed(PrintedFilter::Particles(options))
        }
        (Method::GeometricHistogram | Method::GeometricParticles, ..) => {
            return Err(BeliefError::OptionMissing);
        }
        _ => GeometricFilter::Adaptive(AdaptiveOptions::default()),
    };
    let pose = options.pose_prior.as_ref().ok_or(BeliefError::OptionMissing)?;
    Ok(GeometricOptions { pose: core_prior(pose)?, filter, seed })
}

/// The answer of pair maps, with poses that are equal under the objects' symmetries merged.
fn sva_answer(belief: &SvaBelief, symmetries: &[Symmetry], n_modes: usize) -> Answer {
    if symmetries.iter().all(Symmetry::is_none) {
        return belief.answer(n_modes);
    }
    let mut answer = belief.answer(n_modes * MODES_OF_AN_ORBIT);
    let symmetry = |object: ObjectIdx| &symmetries[object.0 as usize];
    answer.modes = merge_orbits(answer.modes, symmetry, &SVA_SCALE);
    answer.modes.truncate(n_modes);
    answer
}

/// Refuses readings that a session's method cannot fold, naming the field.
pub(crate) fn check(
    session: &Session,
    model: &Model,
    readings: &[Incoming],
) -> Result<(), Invalid> {
    let options = options(session);
    let unfit = |incoming: &Incoming| {
        let (field, detail) = unfit(&options, model, incoming)?;
        Some(FieldError { pointer: format!("{}/{field}", incoming.pointer), detail })
    };
    let errors: Vec<FieldError> = readings.iter().filter_map(unfit).take(ERRORS_MAX).collect();
    if errors.is_empty() { Ok(()) } else { Err(Invalid(errors)) }
}

/// The field of a reading that a method cannot fold, and the reason.
fn unfit(options: &Options, model: &Model, incoming: &Incoming) -> Option<(&'static str, String)> {
    let stored = &incoming.stored;
    if options.method.is_appearance() {
        return unfit_for_appearance(model, incoming);
    }
    let method = options.method.name();
    if stored.feature.is_some() {
        let detail = format!("came with the method `{method}`, expected with `appearance…` only");
        return Some(("feature", detail));
    }
    // A contact has its own position, and only `surface` uses it.
    let reading = incoming.reading.press()?;
    if stored.session_from_sensor.is_none() {
        let detail = format!(
            "is missing, expected the sensor's pose in the session frame: only the methods \
             `appearance…` do without, `{method}` does not"
        );
        return Some(("pose", detail));
    }
    match options.method {
        Method::Surface | Method::Appearance | Method::AppearanceLiteral => None,
        Method::Sva | Method::SvaLiteral => {
            let (vocabulary, image) = (&model.core.sva.vocabulary, reading.image());
            let error = shape_error([vocabulary.rows, vocabulary.cols], reading);
            (!vocabulary.fits(image)).then(|| ("sensor", error.to_string()))
        }
        Method::Geometric | Method::GeometricHistogram | Method::GeometricParticles => {
            let prior = core_prior(options.pose_prior.as_ref()?).ok()?;
            let error = prior.check_press(&reading.session_from_sensor()).err()?;
            Some(("pose", error.to_string()))
        }
    }
}

/// Like [`unfit`], for methods that compare appearance alone.
fn unfit_for_appearance(model: &Model, incoming: &Incoming) -> Option<(&'static str, String)> {
    let source = model.core.appearance.as_ref()?.vocabulary.source;
    let feature = incoming.stored.feature.as_ref();
    match (source, feature) {
        (AppearanceSource::Image { rows, cols, .. }, Some(_)) => {
            let error = AppearanceError::ImageExpected { rows, cols };
            Some(("feature", format!("{error}: the version was trained on images")))
        }
        (_, None) if incoming.stored.contact.is_some() => None,
        (AppearanceSource::Image { rows, cols, .. }, None) => {
            let press = incoming.reading.press()?;
            let (image, error) = (press.image(), shape_error([rows, cols], press));
            ((image.rows, image.cols) != (rows, cols)).then(|| ("sensor", error.to_string()))
        }
        (AppearanceSource::External { dimension }, None) => {
            Some(("feature", AppearanceError::FeatureExpected { dimension }.to_string()))
        }
        (AppearanceSource::External { dimension }, Some(feature)) => {
            let (expected, found) = (dimension, feature.len());
            let error = AppearanceError::Feature { expected, found };
            (expected != found).then(|| ("feature", error.to_string()))
        }
    }
}

fn shape_error([rows, cols]: [usize; 2], reading: &Reading) -> MismatchError {
    let (found_rows, found_cols) = (reading.image().rows, reading.image().cols);
    MismatchError::Shape { rows, cols, found_rows, found_cols }
}
