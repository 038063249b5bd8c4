//! Conversion between wire, core and store, with all checks of numbers.
//!
//! Errors name the field by a JSON pointer. JSON permits values that are not numbers: the
//! parser refuses 1e999 and the types null; all other values that core would not accept are
//! refused here.

pub(crate) mod access;
pub(crate) mod analysis;
pub(crate) mod appearance;
pub(crate) mod belief;
pub(crate) mod calibration;
pub(crate) mod camera;
pub(crate) mod commissioning;
pub(crate) mod coupling;
mod descriptor;
pub(crate) mod evidence;
pub(crate) mod felt;
pub(crate) mod forwarding;
pub(crate) mod geometry;
pub(crate) mod labels;
mod layout;
pub(crate) mod life;
pub(crate) mod misfit;
pub(crate) mod history;
pub(crate) mod interest;
pub(crate) mod next_touch;
pub(crate) mod object;
pub(crate) mod reading;
pub(crate) mod sensor;
pub(crate) mod sensor_health;
pub(crate) mod session;
pub(crate) mod symmetry;
pub(crate) mod recalibration;
pub(crate) mod training;
pub(crate) mod webhook;

use palpate_core::units::{Beyond, Shown};
use palpate_schemas::{FieldError, PageQuery};
use thiserror::Error;
use uuid::Uuid;

use crate::secret;

/// Wrong values, each named by a pointer to its field.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("{}", summary(.0))]
pub(crate) struct Invalid(pub(crate) Vec<FieldError>);

impl Invalid {
    /// One wrong field.
    pub(crate) fn field(pointer: impl Into<String>, detail: impl ToString) -> Self {
        Self(vec![FieldError { pointer: pointer.into(), detail: detail.to_string() }])
    }
}

fn summary(errors: &[FieldError]) -> String {
    match errors {
        [] => "a value is invalid".to_owned(),
        [only] => only.detail.clone(),
        [first, rest @ ..] => format!("{} (and {} more)", first.detail, rest.len()),
    }
}

/// Name of an object that the catalogue does not have, in answers and messages.
pub(crate) const NONE_OF_THESE: &str = "none of these";

/// The largest integer that every JSON reader keeps exactly.
pub(crate) const INTEGER_MAX: u64 = (1 << 53) - 1;

/// Default length of a page.
const PAGE_LENGTH: u32 = 100;
/// Maximum length of a page.
const PAGE_LENGTH_MAX: u32 = 1000;

/// Stored bytes at which a page of readings ends with the reading that reaches them. Chosen:
/// as JSON they are about three times as long, which a robot reads in a second on a slow
/// network.
pub(crate) const PAGE_BYTES: usize = 4 << 20;

/// Milliseconds since 1970 in the wire form of times.
pub(crate) fn time(ms: u64) -> String {
    let ms = i64::try_from(ms).unwrap_or(i64::MAX);
    format!("{:.3}", jiff::Timestamp::from_millisecond(ms).unwrap_or(jiff::Timestamp::MAX))
}

/// A time of the wire, milliseconds since 1970. All of the year 9999, which people write for
/// "never", is at most the last time that there is.
pub(crate) fn moment(text: &str) -> Option<i64> {
    let never = || {
        let pieces = jiff::fmt::temporal::Pieces::parse(text).ok()?;
        let is_whole = pieces.time().is_some() && pieces.offset().is_some();
        (is_whole && pieces.date().year() == 9999).then_some(jiff::Timestamp::MAX)
    };
    let time: Option<jiff::Timestamp> = text.parse().ok().or_else(never);
    time.map(jiff::Timestamp::as_millisecond)
}

/// Checks a new name: short, safe in paths and shells, and distinct from ids.
pub(crate) fn name(name: &str) -> Result<(), Invalid> {
    let first_fits = name.starts_with(|c: char| c.is_ascii_alphanumeric());
    let fits = |c: char| c.is_ascii_alphanumeric() || matches!(c, '.' | '_' | '-');
    if !first_fits || name.len() > 64 || !name.chars().all(fits) {
        return Err(Invalid::field(
            "/name",
            format!(
                "came {name:?}, expected 1 to 64 of the letters a-z and A-Z, digits, `.`, `_` \
                 and `-`, beginning with a letter or digit"
            ),
        ));
    }
    if Uuid::parse_str(name).is_ok() {
        return Err(Invalid::field("/name", format!("came {name}, which looks like an id")));
    }
    Ok(())
}

/// Checks a free text: its length in characters, and that it is printable.
pub(crate) fn text(pointer: &str, text: &str, max: usize) -> Result<(), Invalid> {
    if let Some(found) = text.chars().find(|c| is_control(*c)) {
        let found = found.escape_unicode();
        let detail = format!("the control character {found} came, expected text that can be shown");
        return Err(Invalid::field(pointer, detail));
    }
    if secret::is_in(text) {
        let detail =
            "an API key came: keys are sent in the header `Authorization`, and nowhere else";
        return Err(Invalid::field(pointer, detail));
    }
    match text.chars().count() {
        found if found > max => {
            Err(Invalid::field(pointer, format!("{found} characters came, expected at most {max}")))
        }
        _ => Ok(()),
    }
}

/// Whether a character controls a display: control characters, line ends included, and marks
/// that change the direction of writing.
pub(crate) fn is_control(c: char) -> bool {
    c.is_control()
        || matches!(c, '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

/// Checks an integer against its range.
pub(crate) fn within(pointer: &str, found: u64, low: u64, high: u64) -> Result<u64, Invalid> {
    if (low..=high).contains(&found) {
        Ok(found)
    } else {
        Err(Invalid::field(pointer, format!("came {found}, expected {low} to {high}")))
    }
}

/// Checks a number against its range.
pub(crate) fn number(pointer: &str, found: f64, low: f64, high: f64) -> Result<f64, Invalid> {
    if (low..=high).contains(&found) {
        Ok(found)
    } else {
        Err(outside(pointer, found, [low, high], &range(low, high)))
    }
}

/// The refusal of a number beyond one of its limits.
pub(crate) fn outside<const N: usize>(
    pointer: impl Into<String>,
    found: f64,
    limits: [f64; N],
    expected: &str,
) -> Invalid {
    Invalid::field(pointer, format!("came {}, expected {expected}", Beyond(found, limits)))
}

/// A range of numbers in a message.
pub(crate) fn range(low: f64, high: f64) -> String {
    format!("{} to {}", Shown(low), Shown(high))
}

/// The requested number of items of a page.
pub(crate) fn page_length(query: &PageQuery) -> Result<usize, Invalid> {
    let limit = query.limit.unwrap_or(PAGE_LENGTH);
    Ok(within("?limit", u64::from(limit), 1, u64::from(PAGE_LENGTH_MAX))? as usize)
}

/// The id after which a page begins.
pub(crate) fn page_id(query: &PageQuery) -> Result<Option<Uuid>, Invalid> {
    query
        .cursor
        .as_deref()
        .map(|cursor| Uuid::parse_str(cursor).map_err(|_| bad_cursor(cursor)))
        .transpose()
}

/// The number at which a page begins.
pub(crate) fn page_number(query: &PageQuery) -> Result<u64, Invalid> {
    let number =
        query.cursor.as_deref().map(|cursor| cursor.parse().map_err(|_| bad_cursor(cursor)));
    Ok(number.transpose()?.unwrap_or(0))
}

/// A cursor in its wire form.
pub(crate) fn cursor(next: Option<Uuid>) -> Option<String> {
    next.map(|id| id.simple().to_string())
}

fn bad_cursor(cursor: &str) -> Invalid {
    Invalid::field("?cursor", format!("came {cursor:?}, expected a `next_cursor` of this list"))
}

/// A count in its wire form.
pub(crate) fn count(n: impl TryInto<u32>) -> u32 {
    n.try_into().unwrap_or(u32::MAX)
}
