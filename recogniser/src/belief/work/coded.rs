//! Work as bytes, for the parts of a divided catalogue.

use super::Work;
use crate::belief::search::Scope;
use crate::coding::{Coded, NotWork};

impl Coded for Scope {
    fn put(&self, to: &mut Vec<u8>) {
        let Self { evidence_min, retrieval_min, refined_min, score_min } = self;
        evidence_min.put(to);
        retrieval_min.put(to);
        refined_min.put(to);
        score_min.put(to);
    }

    fn take(from: &mut &[u8]) -> Result<Self, NotWork> {
        Ok(Self {
            evidence_min: Coded::take(from)?,
            retrieval_min: Coded::take(from)?,
            refined_min: Coded::take(from)?,
            score_min: Coded::take(from)?,
        })
    }
}

impl Coded for Work {
    fn put(&self, to: &mut Vec<u8>) {
        match self {
            Self::WeighAppearance { patches_max } => {
                0u8.put(to);
                patches_max.put(to);
            }
            Self::ScoreAnew { settles } => {
                1u8.put(to);
                settles.put(to);
            }
            Self::AddNewest { is_touch } => {
                2u8.put(to);
                is_touch.put(to);
            }
            Self::Propose { partners, scope } => {
                3u8.put(to);
                partners.put(to);
                scope.put(to);
            }
            Self::ProposeByPositions { scope, n_objects } => {
                4u8.put(to);
                scope.put(to);
                n_objects.put(to);
            }
            Self::WeighStated { patches_max, usual } => {
                5u8.put(to);
                patches_max.put(to);
                usual.put(to);
            }
            Self::ProposeStated { patches_max, evidence_min } => {
                6u8.put(to);
                patches_max.put(to);
                evidence_min.put(to);
            }
            Self::Settle { chosen } => {
                7u8.put(to);
                chosen.put(to);
            }
        }
    }

    fn take(from: &mut &[u8]) -> Result<Self, NotWork> {
        Ok(match u8::take(from)? {
            0 => Self::WeighAppearance { patches_max: Coded::take(from)? },
            1 => Self::ScoreAnew { settles: Coded::take(from)? },
            2 => Self::AddNewest { is_touch: Coded::take(from)? },
            3 => Self::Propose { partners: Coded::take(from)?, scope: Coded::take(from)? },
            4 => Self::ProposeByPositions {
                scope: Coded::take(from)?,
                n_objects: Coded::take(from)?,
            },
            5 => Self::WeighStated { patches_max: Coded::take(from)?, usual: Coded::take(from)? },
            6 => Self::ProposeStated {
                patches_max: Coded::take(from)?,
                evidence_min: Coded::take(from)?,
            },
            7 => Self::Settle { chosen: Coded::take(from)? },
            _ => return Err(NotWork),
        })
    }
}
