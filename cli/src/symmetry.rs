//! Text output of symmetries.

use palpate_client::schemas::{ObjectReport, SymmetryAxis};

/// Symmetry of a trained object as text: `undetermined` if the touches cannot tell.
pub(crate) fn trained_words(object: &ObjectReport) -> String {
    match (&object.symmetry, object.symmetry_touches_needed) {
        (None, _) => "–".to_owned(),
        (Some(_), Some(needed)) => format!("undetermined: {needed} more touches"),
        (Some(axes), None) => words(axes),
    }
}

/// Symmetry axes as text; `none` without axes.
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
}
