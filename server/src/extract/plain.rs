//! Translation of parser messages into JSON terms: numbers, integers, lists.
//!
//! A message in an unknown form passes unchanged.

/// A parser's message in JSON terms.
pub(super) fn words(message: &str) -> String {
    if let Some(plain) = of_query(message) {
        return plain.to_owned();
    }
    let (message, place) = match message.rfind(" at line ") {
        Some(at) => message.split_at(at),
        None => (message, ""),
    };
    let type_or_value = message
        .strip_prefix("invalid type: ")
        .or_else(|| message.strip_prefix("invalid value: "))
        .and_then(|rest| rest.rsplit_once(", expected "));
    match type_or_value {
        Some((found, wanted)) => {
            let hint = match (found, is_number(wanted)) {
                ("sequence", true) => ": one list of numbers, not a list of lists",
                _ => "",
            };
            format!("came {}, expected {}{hint}{place}", came(found), expected(wanted))
        }
        // Names that serde does not know: its words for them are Rust's.
        None => match message.strip_prefix("unknown variant `") {
            Some(rest) => format!("came {}{place}", rest.replacen('`', "", 1)),
            None => format!("{message}{place}"),
        },
    }
}

/// The message of the parser of a query's numbers.
fn of_query(message: &str) -> Option<&'static str> {
    Some(match message {
        "invalid digit found in string" => "expected an integer of at least 0",
        "cannot parse integer from empty string" => "came empty, expected an integer",
        "number too large to fit in target type" => "came an integer that is too large",
        "number too small to fit in target type" => "came an integer that is too small",
        "invalid float literal" => "expected a number",
        "cannot parse float from empty string" => "came empty, expected a number",
        "provided string was not `true` or `false`" => "expected true or false",
        _ => return None,
    })
}

/// The given value, from serde's description.
fn came(found: &str) -> String {
    match found {
        "sequence" => "a list".to_owned(),
        "map" => "an object".to_owned(),
        "null" | "unit value" | "Option value" => "null".to_owned(),
        other => {
            let number = ["integer `", "floating point `", "boolean `", "string "];
            let rest = number.iter().find_map(|kind| other.strip_prefix(kind));
            rest.map_or(other, |rest| rest.trim_end_matches('`')).to_owned()
        }
    }
}

/// The expected value, from serde's description.
fn expected(wanted: &str) -> String {
    let known = match wanted {
        "u8" => "an integer from 0 to 255",
        "u16" => "an integer from 0 to 65535",
        "u32" => "an integer from 0 to 4294967295",
        "u64" | "usize" => "an integer of at least 0",
        "i8" | "i16" | "i32" | "i64" | "isize" => "an integer",
        "f32" | "f64" => "a number",
        "a sequence" => "a list",
        "a map" => "an object",
        "string or map" => "a name or an object",
        _ if wanted.starts_with("struct ") => "an object",
        _ if wanted.starts_with("enum ") => "one of its names",
        other => return other.replace("an array of length", "a list of length"),
    };
    known.to_owned()
}

fn is_number(wanted: &str) -> bool {
    matches!(wanted, "f32" | "f64")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn check<T: serde::de::DeserializeOwned + std::fmt::Debug>(json: &str, expected: &str) {
        let error = serde_json::from_str::<T>(json).unwrap_err();
        let said = words(&error.to_string());
        let (said, _) = said.split_once(" at line ").unwrap_or((&said, ""));
        assert_eq!(said, expected);
    }

    #[test]
    fn types_are_named_as_in_json() {
        check::<u64>("-1", "came -1, expected an integer of at least 0");
        check::<u64>("1.5", "came 1.5, expected an integer of at least 0");
        check::<u8>("256", "came 256, expected an integer from 0 to 255");
        let rows = "came a list, expected a number: one list of numbers, not a list of lists";
        check::<Vec<Option<f64>>>("[[0.0]]", rows);
        check::<f64>("\"soft\"", "came \"soft\", expected a number");
        check::<f64>("\"a, expected u8\"", "came \"a, expected u8\", expected a number");
        check::<Vec<f64>>("{}", "came an object, expected a list");
        check::<[f64; 3]>("7", "came 7, expected a list of length 3");
        #[derive(Debug, serde::Deserialize)]
        #[serde(rename_all = "snake_case")]
        enum Unit {
            M,
            Mm,
        }
        check::<Unit>("\"MM\"", "came MM, expected `m` or `mm`");
        check::<bool>("null", "came null, expected a boolean");
    }

    #[test]
    fn numbers_of_queries_are_named_as_in_json() {
        let said = |text: &str| words(&text.parse::<u32>().unwrap_err().to_string());
        assert_eq!(said("-1"), "expected an integer of at least 0");
        assert_eq!(said("99999999999"), "came an integer that is too large");
        assert_eq!(said(""), "came empty, expected an integer");
        assert_eq!(words("unknown field `colour`"), "unknown field `colour`");
    }
}
