//! Lists of numbers in arguments, such as poses.

/// The numbers of a list separated by commas; `None` unless there are `N` finite ones.
pub(crate) fn numbers<const N: usize>(text: &str) -> Option<[f64; N]> {
    let numbers: Vec<f64> =
        text.split(',').map(|part| part.trim().parse()).collect::<Result<_, _>>().ok()?;
    let numbers: [f64; N] = numbers.try_into().ok()?;
    numbers.iter().all(|number| number.is_finite()).then_some(numbers)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_list_has_its_length_and_finite_numbers() {
        assert_eq!(numbers("1, -2.5,3e-3"), Some([1.0, -2.5, 0.003]));
        for text in ["1,2", "1,2,3,4", "1,2,x", "1,2,nan", "1,2,inf", ""] {
            assert_eq!(numbers::<3>(text), None, "{text}");
        }
    }
}
