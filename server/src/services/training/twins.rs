//! One object under two names, which touch can never tell apart.

use palpate_store::error::StoreError;
use uuid::Uuid;

use super::material::Material;
use super::{Plan, Sources};

/// The names of every two objects of a training with equal meshes or readings. Objects of an
/// extended version count if a file of theirs is equal byte for byte.
pub(super) fn twins(
    plan: &Plan,
    materials: &[Material],
    sources: &Sources<'_>,
) -> Result<Vec<[String; 2]>, StoreError> {
    let mut found = Vec::new();
    for (at, one) in materials.iter().enumerate() {
        let twins = materials[at + 1..].iter().filter(|other| are_equal(one, other));
        found.extend(twins.map(|other| [one.object.name.clone(), other.object.name.clone()]));
    }
    let Some(base) = &plan.base else { return Ok(found) };
    let file = |id: Uuid| {
        let info = sources.store.meshes().info(id)?;
        Ok::<_, StoreError>(info.map(|info| (info.hash, info.unit)))
    };
    for one in materials.iter().filter(|one| one.has_mesh()) {
        let its = file(one.object.id)?;
        let is_new = |id: Uuid| materials.iter().any(|material| material.object.id == id);
        for known in base.reports.iter().filter(|known| !is_new(known.id)) {
            if its.is_some() && file(known.id)? == its {
                found.push([known.name.clone(), one.object.name.clone()]);
            }
        }
    }
    Ok(found)
}

fn are_equal(one: &Material, other: &Material) -> bool {
    match (&one.form, &other.form) {
        (Some(one), Some(other)) => one.equals(other),
        (None, None) => one.readings == other.readings,
        _ => false,
    }
}
