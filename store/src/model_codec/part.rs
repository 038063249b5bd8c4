//! Parts of a model, which methods read independently.

use super::{
    APPEARANCE_BLOCK, APPEARANCE_REPORT_BLOCK, CALIBRATION_BLOCK, GEOMETRY_BLOCK, SURFACE_BLOCK,
    VOCABULARY_BLOCK,
};

/// A part of a model that some methods need and others do not. The vocabulary of pair maps
/// belongs to every part: it is small and always present.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum ModelPart {
    /// Maps of pairs of touches.
    Sva,
    /// Maps of contact and pressure.
    Geometric,
    /// Classes of appearance.
    Appearance,
    /// Surfaces and symmetries.
    Surface,
}

impl ModelPart {
    /// All parts.
    pub const ALL: [Self; 4] = [Self::Sva, Self::Geometric, Self::Appearance, Self::Surface];

    /// Whether a block, by its name, belongs to this part alone.
    #[must_use]
    pub fn owns(self, block: &str) -> bool {
        let kind = block.split_once('/').map_or(block, |(kind, _)| kind);
        match self {
            Self::Sva => kind == "map",
            Self::Geometric => kind == GEOMETRY_BLOCK,
            Self::Appearance => kind == APPEARANCE_BLOCK || kind == APPEARANCE_REPORT_BLOCK,
            Self::Surface => [SURFACE_BLOCK, CALIBRATION_BLOCK, "symmetry"].contains(&kind),
        }
    }

    /// Whether this part needs a block.
    #[must_use]
    pub fn needs(self, block: &str) -> bool {
        block == VOCABULARY_BLOCK || self.owns(block)
    }
}

#[cfg(test)]
mod tests {
    use uuid::Uuid;

    use super::*;
    use crate::model_codec::{
        appearance_block_name, geometry_block_name, map_block_name, surface_block_name,
        symmetry_block_name,
    };

    #[test]
    fn every_block_but_the_vocabulary_belongs_to_one_part() {
        let object = Uuid::from_u128(7);
        let blocks = [
            (map_block_name(object), ModelPart::Sva),
            (GEOMETRY_BLOCK.to_owned(), ModelPart::Geometric),
            (geometry_block_name(object), ModelPart::Geometric),
            (APPEARANCE_BLOCK.to_owned(), ModelPart::Appearance),
            (APPEARANCE_REPORT_BLOCK.to_owned(), ModelPart::Appearance),
            (appearance_block_name(object), ModelPart::Appearance),
            (SURFACE_BLOCK.to_owned(), ModelPart::Surface),
            (CALIBRATION_BLOCK.to_owned(), ModelPart::Surface),
            (surface_block_name(object), ModelPart::Surface),
            (symmetry_block_name(object), ModelPart::Surface),
        ];
        for (block, owner) in blocks {
            for part in ModelPart::ALL {
                assert_eq!(part.owns(&block), part == owner, "{block} {part:?}");
                assert_eq!(part.needs(&block), part == owner, "{block} {part:?}");
            }
        }
        for part in ModelPart::ALL {
            assert!(part.needs(VOCABULARY_BLOCK) && !part.owns(VOCABULARY_BLOCK));
        }
    }
}
