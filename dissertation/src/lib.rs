//! The dissertation's methods: chapters 3 to 5 of Pezzementi (2011), as printed and as corrected.
//!
//! Chapter 3 is `occupancy`, `mosaic`, `filter` and `geometric`; chapter 4 is `appearance`;
//! chapter 5 is `patch`, `patch_pair` and `sva`. Chapter 2 is shared by all methods
//! (`palpate_core::sensor`). The modules are listed in the order in which they may use each
//! other. Corrections are in `docs/equations.md`. Not here: the service's own recogniser.

pub mod occupancy;
pub mod mosaic;
pub mod rotation_grid;
pub mod filter;
pub mod geometric;
pub mod appearance;
pub mod patch;
pub mod patch_pair;
pub mod sva;
