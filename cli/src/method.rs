//! The methods that an argument takes.

use clap::ValueEnum;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use palpate_client::schemas::Method;

/// Takes one of these methods, by its name on the wire.
pub(crate) fn among(methods: &[Method]) -> impl TypedValueParser<Value = Method> {
    let names: Vec<PossibleValue> =
        methods.iter().filter_map(ValueEnum::to_possible_value).collect();
    PossibleValuesParser::new(names).try_map(|name| Method::from_str(&name, false))
}
