//! Descriptors on the wire and in the mathematics: one table for both ways.

use palpate_core::descriptor::DescriptorKind;
use palpate_schemas::Descriptor;

/// Every descriptor by both of its names.
const DESCRIPTORS: [(Descriptor, DescriptorKind); 12] = [
    (Descriptor::Vectorize, DescriptorKind::Vectorize),
    (Descriptor::Sift, DescriptorKind::Sift),
    (Descriptor::Mr8, DescriptorKind::Mr8),
    (Descriptor::MomentNormalized, DescriptorKind::MomentNormalized),
    (Descriptor::PolarFourier, DescriptorKind::PolarFourier),
    (Descriptor::PolarFourierRw, DescriptorKind::PolarFourierRw),
    (Descriptor::PolarFourierNi, DescriptorKind::PolarFourierNi),
    (Descriptor::PolarFourierSigned, DescriptorKind::PolarFourierSigned),
    (Descriptor::Mnti, DescriptorKind::Mnti),
    (Descriptor::Steerable, DescriptorKind::Steerable),
    (Descriptor::Schmid, DescriptorKind::Schmid),
    (Descriptor::PolarSpectrum, DescriptorKind::PolarSpectrum),
];

pub(super) fn from_wire(descriptor: Descriptor) -> DescriptorKind {
    let found = DESCRIPTORS.iter().find(|(known, _)| *known == descriptor);
    found.expect("every descriptor of the wire is in the table: a test counts them").1
}

pub(super) fn to_wire(kind: DescriptorKind) -> Descriptor {
    let found = DESCRIPTORS.iter().find(|(_, known)| *known == kind);
    found.expect("every descriptor is in the table: a test counts them").0
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn descriptors_have_one_name_each() {
        for kind in DescriptorKind::ALL {
            let wire = to_wire(kind);
            assert_eq!((from_wire(wire), json!(wire)), (kind, json!(kind.name())));
        }
        assert!(DESCRIPTORS.iter().all(|(wire, kind)| from_wire(*wire) == *kind));
    }
}
