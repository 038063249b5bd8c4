//! The readings of a request before they are checked: their places in it, and their size.

use palpate_schemas as wire;

use crate::wire::Invalid;

/// Maximum number of readings in one request.
pub(crate) const READINGS_MAX: usize = 1000;
/// Maximum number of taxels and feature values in one request, which one commit must hold.
pub(crate) const TAXELS_MAX: usize = 4_000_000;

/// A reading of a request, with the pointer to it there.
pub(crate) type Given<'a> = (String, &'a wire::Reading);

/// The readings of a request that has nothing else in its list.
pub(crate) fn given(readings: &[wire::Reading]) -> Vec<Given<'_>> {
    let pointer = |(index, reading)| (format!("/readings/{index}"), reading);
    readings.iter().enumerate().map(pointer).collect()
}

/// Refuses more entries of a request's list, or larger readings among them, than one request may
/// have.
pub(crate) fn check_size(list: &str, n: usize, given: &[Given<'_>]) -> Result<(), Invalid> {
    if n == 0 || n > READINGS_MAX {
        let what = list.trim_start_matches('/');
        let detail = format!("{n} {what} came, expected 1 to {READINGS_MAX}");
        return Err(Invalid::field(list, detail));
    }
    let values = |reading: &wire::Reading| {
        let shear = 2 * reading.shear.as_ref().map_or(0, Vec::len);
        reading.image.len() + shear + reading.feature.as_ref().map_or(0, Vec::len)
    };
    let n_taxels: usize = given.iter().map(|(_, reading)| values(reading)).sum();
    if n_taxels > TAXELS_MAX {
        let detail = format!(
            "{n_taxels} taxels and feature values came in one request, expected at most {TAXELS_MAX}: send fewer \
             readings at once"
        );
        return Err(Invalid::field(list, detail));
    }
    Ok(())
}
