//! Proposal: selection of pairs of touches, and the object poses that they propose.
//!
//! Beyond the dissertation; the key of a pair is that of Drost et al. (2010).

pub(crate) mod effort;
pub(crate) mod pair_density;
pub(crate) mod partners;
pub(crate) mod proposals;
pub(crate) mod retrieval;
