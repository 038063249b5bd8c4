//! Retrieval: density of each object's pairs about observed ones, from the joint pair table.
//!
//! Section 5.6.4 of the dissertation leaves large sets of objects to future work. In a large
//! catalogue each new touch, paired with earlier ones, is looked up once in the table of all
//! objects' pairs (`model::joint_pairs`), by the same measure as in an object's own pairs.

use rayon::prelude::*;

use super::pair_density::{pair_density, pair_stretch_ratio, widened};
use super::proposals::PairEvidence;
use crate::model::joint_pairs::{JointPairs, JointTable, OBJECTS_PER_TABLE};
use crate::model::pair_geometry::PairGeometry;
use crate::observe::observation::{Observation, Says};
use crate::options::SurfaceOptions;

/// A pair of touches that is looked up in the table.
struct Query<'a> {
    touches: [&'a Observation; 2],
    geometry: PairGeometry,
    options: SurfaceOptions,
}

impl<'a> Query<'a> {
    /// The query of two touches; `None` if both are at one place or a normal is missing.
    fn new(touches: [&'a Observation; 2], options: &SurfaceOptions) -> Option<Self> {
        if touches.iter().any(|touch| touch.says == Says::Position) {
            return None;
        }
        let [a, b] = touches.map(|touch| (touch.position, touch.normal));
        Some(Self {
            touches,
            geometry: PairGeometry::new(a, b)?,
            options: widened(options, touches),
        })
    }

    /// Estimates of a table for its requested objects; `appearances` are the ratios of both
    /// touches at the tabled patches.
    fn look_up(
        &self,
        table: &JointTable,
        wanted: &[bool],
        appearances: [&[f32]; 2],
    ) -> Vec<Option<PairEvidence>> {
        let mut estimates = vec![PairEvidence::default(); table.n_objects()];
        // Appearance is checked first, since it differs more often.
        let mut alike = Vec::new();
        let least = self.options.appearance_min_if_many;
        table.matches(self.geometry, self.options.pairs, |object, [first, second]| {
            estimates[object].geometry += 1.0;
            let appearance = appearances[0][first] * appearances[1][second];
            if appearance >= least {
                alike.push((object, appearance, [first, second]));
            }
        });
        for (object, appearance, touches) in alike {
            let Some((facets, stored)) = table.pair(touches) else { continue };
            let density =
                pair_density(self.touches, &self.geometry, &stored, facets, &self.options);
            if let Some(density) = density {
                let stretch = pair_stretch_ratio(self.touches, facets, &self.options);
                estimates[object].evidence += appearance * density * stretch;
            }
        }
        let of_object = |(object, estimate): (usize, &PairEvidence)| {
            let n_pairs = table.n_pairs(object).max(1) as f32;
            let mean = |ratios: &[f32]| {
                let ratios = &ratios[table.touches(object)];
                ratios.iter().sum::<f32>() / ratios.len().max(1) as f32
            };
            wanted[object].then(|| PairEvidence {
                geometry: estimate.geometry / n_pairs,
                evidence: estimate.evidence / n_pairs,
                appearance: mean(appearances[0]) * mean(appearances[1]),
            })
        };
        estimates.iter().enumerate().map(of_object).collect()
    }
}

/// The table's estimate of R10 for each object, for the newest touch with each partner: `None`
/// for objects that are not requested, and for all objects if the partner is at the newest
/// touch's place.
pub(crate) fn estimate(
    joint: &JointPairs,
    newest: &Observation,
    partners: &[&Observation],
    wanted: &[bool],
    options: &SurfaceOptions,
) -> Vec<Vec<Option<PairEvidence>>> {
    let pairs = partners.iter().map(|partner| [newest, *partner]);
    let queries: Vec<Option<Query<'_>>> = pairs.map(|pair| Query::new(pair, options)).collect();
    let of_table = |(table, wanted): (&JointTable, &[bool])| -> Vec<Vec<Option<PairEvidence>>> {
        let ratios = |touch: &Observation| {
            let mut ratios = Vec::with_capacity(table.features().len());
            for (object, wanted) in wanted.iter().enumerate() {
                let touches = table.touches(object);
                if *wanted {
                    touch.appearance_ratios(table.features(), touches, &mut ratios);
                } else {
                    ratios.resize(touches.end, 0.0);
                }
            }
            ratios
        };
        let newest = ratios(newest);
        let look_up = |query: &Option<Query<'_>>| match query {
            Some(query) => query.look_up(table, wanted, [&newest, &ratios(query.touches[1])]),
            None => vec![None; table.n_objects()],
        };
        queries.iter().map(look_up).collect()
    };
    let tables = joint.tables().par_iter().zip(wanted.par_chunks(OBJECTS_PER_TABLE));
    let of_tables: Vec<Vec<Vec<Option<PairEvidence>>>> = tables.map(of_table).collect();
    let all = |query: usize| of_tables.iter().flat_map(|of| &of[query]).copied().collect();
    (0..queries.len()).map(all).collect()
}

/// Gains of the objects' retrieval scores by one lookup: `None` where the object was not looked
/// up; no gains when no object has such a pair. They sum to 0.
///
/// Equation R19 of docs/recogniser.md.
pub(crate) fn gains(estimates: &[Option<PairEvidence>], floor: f32) -> Option<Vec<Option<f64>>> {
    let n = estimates.iter().flatten().count().max(1);
    let mean = mean_of(estimates, n, |estimate| estimate.evidence);
    if mean <= 0.0 {
        return None;
    }
    let gain = |estimate: &PairEvidence| f64::from((estimate.evidence / mean + floor).ln());
    let usual = estimates.iter().flatten().map(gain).sum::<f64>() / n as f64;
    Some(estimates.iter().map(|estimate| Some(gain(estimate.as_ref()?) - usual)).collect())
}

/// Mean over the `n` requested objects.
pub(crate) fn mean_of(
    estimates: &[Option<PairEvidence>],
    n: usize,
    value: fn(&PairEvidence) -> f32,
) -> f32 {
    estimates.iter().flatten().map(value).sum::<f32>() / n as f32
}
