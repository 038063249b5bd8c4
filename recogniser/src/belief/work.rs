//! Work that needs the maps of objects: done here on a whole model, and by the holders of the maps
//! of a divided one.
//!
//! The result for an object depends on that object, its map and the observations alone, never on
//! which objects are worked on together. What decides across objects (bars, gains, the posterior)
//! is not work: it stays with the belief.

use std::sync::Arc;

use super::object::{ObjectBelief, for_each_object};
use super::positions::propose_by_positions;
use super::search::{Scope, add_scores, propose_poses, score_anew, settle_chosen};
use super::stated_search::{Turned, propose_stated, weigh_stated};
use crate::propose::partners::Partner;
use crate::refine::settle::settle;
use crate::verify::evidence::{Evidence, Known};
use crate::verify::stated_prior::StatedPrior;

/// Work on objects.
#[derive(Clone, Debug)]
pub(super) enum Work {
    /// Evidence of the first touch by its appearance at an object's first patches.
    WeighAppearance {
        /// Maximum number of these patches.
        patches_max: usize,
    },
    /// Every hypothesis is scored by all observations, and settled if told so.
    ScoreAnew {
        /// Whether it is settled.
        settles: bool,
    },
    /// The newest press adds to the score of every hypothesis, and its touch with it.
    AddNewest {
        /// Whether the press touched something.
        is_touch: bool,
    },
    /// The newest touch and its partners propose poses.
    Propose {
        /// The partners in their order.
        partners: Vec<Partner>,
        scope: Scope,
    },
    /// Three touches propose poses by their positions alone.
    ProposeByPositions {
        scope: Scope,
        /// Number of objects of the catalogue.
        n_objects: usize,
    },
    /// The evidence of one touch or of a pair beside a stated prior.
    WeighStated {
        /// Patches that are laid onto the touch, in a large catalogue.
        patches_max: Option<usize>,
        /// Density of the pair on a usual object; 1 for one touch.
        usual: f64,
    },
    /// The stated prior proposes poses.
    ProposeStated {
        /// Patches that are laid onto the touch, in a large catalogue.
        patches_max: Option<usize>,
        /// Least evidence (ln) of an object that gets poses.
        evidence_min: f64,
    },
    /// Some of the first hypotheses are settled.
    Settle {
        /// Hypotheses of each object, a bit each.
        chosen: Vec<u8>,
    },
}

impl Work {
    /// Does the work on objects; `evidence` has their maps, in the same order.
    pub(super) fn run(&self, objects: &mut [ObjectBelief], evidence: &Evidence<'_>) {
        match self {
            Self::WeighAppearance { patches_max } => {
                weigh_appearance(objects, evidence, *patches_max);
            }
            Self::ScoreAnew { settles } => {
                score_anew(objects, evidence, |hypothesis, known| {
                    if *settles {
                        settle(evidence, hypothesis, known);
                    }
                });
            }
            Self::AddNewest { is_touch: true } => {
                let newest = |known: Known<'_>, pose: &_| evidence.newest(known.map, pose);
                add_scores(objects, evidence, newest);
            }
            Self::AddNewest { is_touch: false } => {
                let press = |known: Known<'_>, pose: &_| evidence.newest_press(known.map, pose);
                add_scores(objects, evidence, press);
            }
            Self::Propose { partners, scope } => {
                propose_poses(objects, evidence, partners, scope);
            }
            Self::ProposeByPositions { scope, n_objects } => {
                propose_by_positions(objects, evidence, scope, *n_objects);
            }
            Self::WeighStated { patches_max, usual } => {
                let Some(stated) = stated_of(objects) else { return };
                let turned = Turned::new(&stated, evidence.touches.len(), *patches_max);
                weigh_stated(objects, evidence, &turned, *usual);
            }
            Self::ProposeStated { patches_max, evidence_min } => {
                let Some(stated) = stated_of(objects) else { return };
                let turned = Turned::new(&stated, evidence.touches.len(), *patches_max);
                propose_stated(objects, evidence, &turned, *evidence_min);
            }
            Self::Settle { chosen } => settle_chosen(objects, evidence, chosen),
        }
    }
}

impl Work {
    /// Whether it may change an object, the `index`th.
    pub(super) fn concerns(&self, index: usize, object: &ObjectBelief) -> bool {
        match self {
            Self::WeighAppearance { .. } | Self::WeighStated { .. } => true,
            Self::ScoreAnew { .. } | Self::AddNewest { .. } => !object.hypotheses.is_empty(),
            Self::Propose { partners, scope } => !partners.is_empty() && scope.has(object),
            Self::ProposeByPositions { scope, .. } => scope.has(object),
            Self::ProposeStated { evidence_min, .. } => object.log_evidence >= *evidence_min,
            Self::Settle { chosen } => chosen[index] != 0,
        }
    }

    /// The part of the evidence that it reads.
    pub(super) fn read_of<'a>(&self, evidence: &Evidence<'a>) -> Evidence<'a> {
        let Evidence { touches, spaces, .. } = *evidence;
        let newest = &touches[touches.len().saturating_sub(1)..];
        let press = &spaces[spaces.len().saturating_sub(1)..];
        let (touches, spaces) = match self {
            Self::WeighAppearance { .. } | Self::WeighStated { .. } => (touches, &[][..]),
            Self::AddNewest { is_touch: true } => (newest, press),
            Self::AddNewest { is_touch: false } => (&[][..], press),
            _ => (touches, spaces),
        };
        Evidence { touches, spaces, ..*evidence }
    }

    /// The same work on these objects alone.
    pub(super) fn only(&self, objects: &[usize]) -> Self {
        match self {
            Self::Settle { chosen } => {
                Self::Settle { chosen: objects.iter().map(|object| chosen[*object]).collect() }
            }
            other => other.clone(),
        }
    }

    /// Whether it can be done by this many touches on this many objects.
    pub(super) fn fits(&self, n_touches: usize, n_objects: usize) -> bool {
        match self {
            Self::Propose { partners, .. } => {
                partners.iter().all(|partner| partner.index.saturating_add(1) < n_touches)
            }
            Self::WeighStated { .. } => (1..=2).contains(&n_touches),
            Self::ProposeStated { .. } => n_touches > 0,
            Self::Settle { chosen } => chosen.len() == n_objects,
            _ => true,
        }
    }
}

mod coded;

/// The statement of a session, which all its objects share.
pub(super) fn stated_of(objects: &[ObjectBelief]) -> Option<Arc<StatedPrior>> {
    let of = |object: &ObjectBelief| Some(Arc::clone(&object.motion_prior.stated.as_ref()?.prior));
    objects.iter().find_map(of)
}

/// The evidence of one touch: its appearance. Equation R17 of docs/recogniser.md, k = 1.
fn weigh_appearance(objects: &mut [ObjectBelief], evidence: &Evidence<'_>, patches_max: usize) {
    let Some(touch) = evidence.touches.first() else { return };
    for_each_object(objects, evidence.maps, evidence.stop, |object, map| {
        let mut ratios = Vec::new();
        let n = patches_max.min(map.patches().len());
        touch.appearance_ratios(map.features(), 0..n, &mut ratios);
        object.log_evidence = f64::from((ratios.iter().sum::<f32>() / n as f32).ln());
    });
}
