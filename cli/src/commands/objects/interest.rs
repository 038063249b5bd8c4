//! `palpate objects interest`: where a touch tells most about which object it is.

use clap::Args;
use palpate_client::schemas::{InterestMap, InterestPlace};
use palpate_core::units::MM;

use crate::commands::Context;
use crate::output;

/// Number of places in the table: those that tell most.
const SHOWN: usize = 10;

/// Arguments of `palpate objects interest`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  palpate objects interest mug\n  \
    palpate objects interest mug --catalogue lab --version 3 --json\n\n\
    Bits are the expected information of one touch on the identity, once poses are known. \
    `--json` has all places.")]
pub(super) struct InterestArgs {
    /// Id of the object, or its name when it was trained.
    object: String,
    /// Name of the catalogue.
    #[arg(long, default_value = "default")]
    catalogue: String,
    /// Version of the catalogue [default: the current one].
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..))]
    version: Option<u32>,
}

/// Shows the places of an object at which a touch tells most.
pub(super) async fn run(args: InterestArgs, context: &Context) -> anyhow::Result<()> {
    let client = &context.client;
    let version = match args.version {
        Some(version) => version,
        None => client.current_version(&args.catalogue).await?.version,
    };
    let map = client.interest(&args.catalogue, version, &args.object).await?;
    context.output.answer(&map, words)
}

fn words(map: &InterestMap) -> String {
    let InterestMap { name, bits_max, places, rivals, .. } = map;
    if rivals.is_empty() {
        return format!("{name} is the only object of its version: no touch tells it from another");
    }
    let mut best: Vec<&InterestPlace> = places.iter().collect();
    best.sort_by(|a, b| b.bits.total_cmp(&a.bits));
    let bits: Vec<f64> = best.iter().map(|place| place.bits).collect();
    let middle = output::median(&bits).unwrap_or(0.0);
    let alike = rivals.iter().take(3).map(|r| format!("{} ({:.2})", r.name, r.likeness));
    let head = format!(
        "{name}: a touch tells {middle:.2} of {bits_max:.2} bits in the median of {} places\n\
         most alike of {}: {}\n\n",
        places.len(),
        rivals.len(),
        alike.collect::<Vec<_>>().join(", ")
    );
    let numbers =
        |values: [f64; 3], digits: usize| values.map(|value| format!("{value:.digits$}")).join(" ");
    let row = |place: &&InterestPlace| {
        let position = place.position.map(|metres| metres / MM);
        [format!("{:.2}", place.bits), numbers(position, 1), numbers(place.normal, 2)]
    };
    let table = output::table(
        ["bits", "position (mm)", "outward normal"],
        best.iter().take(SHOWN).map(row),
    );
    head + &table
}

#[cfg(test)]
mod tests {
    use palpate_client::schemas::InterestRival;
    use uuid::Uuid;

    use super::*;

    #[test]
    fn places_that_tell_most_come_first() {
        let place = |n: u32| InterestPlace {
            position: [0.001 * f64::from(n), 0.0, 0.0],
            normal: [0.0, 0.0, 1.0],
            bits: 0.1 * f64::from(n),
        };
        let rival = InterestRival { id: Uuid::nil(), name: "cup".to_owned(), likeness: 0.75 };
        let map = InterestMap {
            id: Uuid::nil(),
            name: "mug".to_owned(),
            bits_max: 1.0,
            places: (0..=10).map(place).collect(),
            rivals: vec![rival],
        };
        let words_of = words(&map);
        assert!(words_of.starts_with("mug: a touch tells 0.50 of 1.00 bits"), "{words_of}");
        assert!(words_of.contains("cup (0.75)"), "{words_of}");
        let (most, least) = (words_of.find("10.0 0.0 0.0"), words_of.find("1.0 0.0 0.0"));
        assert!(most.is_some() && most < least, "{words_of}");
        let alone = InterestMap { rivals: Vec::new(), ..map };
        assert!(words(&alone).contains("only object"));
    }
}
