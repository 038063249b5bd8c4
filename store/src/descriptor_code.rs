//! Codes of descriptors in stored models; a code never changes its meaning.
//!
//! Drawn in `docs/formats.md`, blocks of a catalogue version.

use palpate_core::descriptor::DescriptorKind;

/// Descriptors by their codes, from 1 on.
pub(crate) const DESCRIPTORS: [DescriptorKind; 12] = [
    DescriptorKind::Vectorize,
    DescriptorKind::Mnti,
    DescriptorKind::Sift,
    DescriptorKind::Mr8,
    DescriptorKind::MomentNormalized,
    DescriptorKind::PolarFourier,
    DescriptorKind::PolarFourierRw,
    DescriptorKind::PolarFourierNi,
    DescriptorKind::PolarFourierSigned,
    DescriptorKind::Steerable,
    DescriptorKind::Schmid,
    DescriptorKind::PolarSpectrum,
];

/// The code of a descriptor: its position, from 1.
pub(crate) fn descriptor_code(descriptor: DescriptorKind) -> u32 {
    let place = DESCRIPTORS.iter().position(|kind| *kind == descriptor);
    place.expect("every descriptor has a code: a test counts them") as u32 + 1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_stay_as_they_were() {
        // In the order of DescriptorKind::ALL: vectorize 1, mnti 2, then as they came.
        let codes = DescriptorKind::ALL.map(descriptor_code);
        assert_eq!(codes, [1, 3, 4, 5, 6, 7, 8, 9, 2, 12, 10, 11]);
        for (descriptor, code) in DescriptorKind::ALL.into_iter().zip(codes) {
            assert_eq!(DESCRIPTORS[code as usize - 1], descriptor);
        }
    }
}
