//! One object under two names, which touch can never tell apart.

use std::collections::BTreeMap;

use palpate_store::error::StoreError;
use uuid::Uuid;

use super::material::Material;
use super::{Plan, Sources};

/// The names of the first two objects of a training with equal meshes or readings, and the number
/// of such pairs. Objects of an extended version are compared by their mesh files, byte for byte.
pub(super) fn twins(
    plan: &Plan,
    materials: &[Material],
    sources: &Sources<'_>,
) -> Result<Option<([String; 2], usize)>, StoreError> {
    let (mut first, mut n_pairs) = (None, 0);
    let mut count = |names: [&str; 2], n: usize| {
        first.get_or_insert_with(|| names.map(str::to_owned));
        n_pairs += n;
    };
    for (at, one) in materials.iter().enumerate() {
        for other in materials[at + 1..].iter().filter(|other| are_equal(one, other)) {
            count([&one.object.name, &other.object.name], 1);
        }
    }
    if let Some(base) = &plan.base {
        let file = |id: Uuid| {
            let info = sources.store.meshes().info(id)?;
            Ok::<_, StoreError>(info.map(|info| (info.hash, info.unit as u8)))
        };
        // The first name of each file, and the number of objects with it.
        let mut known: BTreeMap<([u8; 32], u8), (&str, usize)> = BTreeMap::new();
        let is_new = |id: Uuid| materials.iter().any(|material| material.object.id == id);
        for report in base.reports.iter().filter(|report| !is_new(report.id)) {
            if let Some(file) = file(report.id)? {
                known.entry(file).or_insert((&report.name, 0)).1 += 1;
            }
        }
        for one in materials.iter().filter(|one| one.has_mesh()) {
            let same = file(one.object.id)?.and_then(|file| known.get(&file));
            if let Some((name, n)) = same {
                count([name, &one.object.name], *n);
            }
        }
    }
    Ok(first.map(|names| (names, n_pairs)))
}

fn are_equal(one: &Material, other: &Material) -> bool {
    match (&one.form, &other.form) {
        (Some(one), Some(other)) => one.equals(other),
        (None, None) => one.readings == other.readings,
        _ => false,
    }
}
