//! The objects that are touched in every world: those of the catalogue, and foreign ones.

use anyhow::Context as _;
use palpate_core::sensor::SensorDescription;
use palpate_sim::shapes::assembled;

use super::OtherWorlds;
use crate::objects::{self, TestObject};
use crate::surface_scale::own_objects;

/// The objects of the catalogue. Of our own, those that cannot be touched often enough are
/// replaced by the next ones.
///
/// # Errors
/// When objects cannot be loaded or made, or too few can be touched.
pub(super) fn known(
    config: &OtherWorlds,
    sensor: &SensorDescription,
) -> anyhow::Result<Vec<TestObject>> {
    let Some(n) = config.own else { return config.objects.load() };
    let (n_readings, seed) = (config.test_readings, 2 * config.seed);
    let is_touched = |object: &TestObject| objects::touch(object, sensor, n_readings, seed).is_ok();
    let candidates = own_objects(n, config.objects.size())?.into_iter();
    let found: Vec<_> = candidates.filter(is_touched).take(n).collect();
    anyhow::ensure!(found.len() == n, "{} objects can be touched, expected {n}", found.len());
    Ok(found)
}

/// Objects that are not in the catalogue, as large as the others.
///
/// # Errors
/// When a procedural object cannot be made.
pub(super) fn foreign(config: &OtherWorlds) -> anyhow::Result<Vec<TestObject>> {
    let of = |index: usize| {
        let mesh = assembled(config.seed, index as u64)
            .with_context(|| format!("procedural object {index} never hangs together"))?;
        Ok(TestObject::new(format!("assembled {index}"), &mesh, config.objects.size()))
    };
    (0..config.foreign).map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arguments;

    #[test]
    fn a_catalogue_of_our_own_has_as_many_objects_as_asked() {
        let config = OtherWorlds { own: Some(3), test_readings: 2, ..arguments::defaults() };
        let known = known(&config, &SensorDescription::digitacts_6x6()).unwrap();
        assert_eq!(known.len(), 3);
        assert!(known.iter().all(|object| !object.name.starts_with("assembled")), "not foreign");
    }
}
