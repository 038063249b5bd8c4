//! Symmetries as the API tells of them: in words, and for errors that count them.

use glam::DVec3;
use palpate_client::schemas::SymmetryAxis;
use palpate_core::symmetry::{AxisOrder, Symmetry};

/// The symmetry of axes in the frame that they are in; they meet in one point.
pub(crate) fn of_axes(axes: &[SymmetryAxis]) -> Symmetry {
    let Some(first) = axes.first() else { return Symmetry::NONE };
    let axis = |axis: &SymmetryAxis| {
        let order = axis.order.map_or(AxisOrder::Continuous, AxisOrder::Finite);
        (DVec3::from_array(axis.direction), order)
    };
    let axes: Vec<(DVec3, AxisOrder)> = axes.iter().map(axis).collect();
    Symmetry::through(DVec3::from_array(first.point), &axes)
}

/// Which turns look the same; `none` without axes.
pub(crate) fn words(axes: &[SymmetryAxis]) -> String {
    let n_continuous = axes.iter().filter(|axis| axis.order.is_none()).count();
    match (axes, n_continuous) {
        ([], _) => "none".to_owned(),
        (_, 2..) => "any turn".to_owned(),
        ([_], 1) => "any turn about its axis".to_owned(),
        (_, 1) => "any turn about its axis, or over".to_owned(),
        ([first, others @ ..], _) => {
            let turns = format!("{} equal turns", first.order.unwrap_or_default());
            match others.len() {
                0 => turns,
                1 => format!("{turns}, others about 1 more axis"),
                n => format!("{turns}, others about {n} more axes"),
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn axes(orders: &[Option<u8>]) -> Vec<SymmetryAxis> {
        let axis = |order: &Option<u8>| SymmetryAxis {
            point: [0.01, 0.0, 0.0],
            direction: [0.0, 0.0, 1.0],
            order: *order,
        };
        orders.iter().map(axis).collect()
    }

    #[test]
    fn words_say_how_often_an_object_can_be_turned() {
        for (orders, expected) in [
            (&[][..], "none"),
            (&[Some(4)], "4 equal turns"),
            (&[Some(5), Some(2)], "5 equal turns, others about 1 more axis"),
            (&[Some(2), Some(2), Some(2)], "2 equal turns, others about 2 more axes"),
            (&[None], "any turn about its axis"),
            (&[None, Some(2)], "any turn about its axis, or over"),
            (&[None, None, None], "any turn"),
        ] {
            assert_eq!(words(&axes(orders)), expected);
        }
    }

    #[test]
    fn axes_of_the_wire_are_those_of_core() {
        assert_eq!(of_axes(&[]), Symmetry::NONE);
        let found = of_axes(&axes(&[None, Some(2)]));
        let center = DVec3::new(0.01, 0.0, 0.0);
        let both = [(DVec3::Z, AxisOrder::Continuous), (DVec3::Z, AxisOrder::Finite(2))];
        assert_eq!(found, Symmetry::through(center, &both));
    }
}
