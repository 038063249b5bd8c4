//! Tagged unions in the form that client generators need.
//!
//! Every variant gets a named schema, and a discriminator maps the values of the tag to
//! variants. The derive writes variants in place, under titles; a variant without a title or
//! a tag stays there.

use std::collections::BTreeMap;

use utoipa::openapi::schema::{Discriminator, OneOf};
use utoipa::openapi::{Ref, RefOr, Schema};

/// The property that distinguishes the variants of a union.
const TAG: &str = "kind";

/// Moves the variants of all tagged unions into `schemas`, under their titles.
pub(super) fn name_variants(schemas: &mut BTreeMap<String, RefOr<Schema>>) {
    let mut named = Vec::new();
    for schema in schemas.values_mut() {
        if let RefOr::T(Schema::OneOf(union)) = schema {
            name_variants_of(union, &mut named);
        }
    }
    schemas.extend(named);
}

fn name_variants_of(union: &mut OneOf, named: &mut Vec<(String, RefOr<Schema>)>) {
    let Some(variants) = union.items.iter().map(title_and_tag).collect::<Option<Vec<_>>>() else {
        return;
    };
    let reference = |title: &str| Ref::from_schema_name(title);
    let mapping = variants.iter().map(|(title, tag)| (tag.clone(), reference(title).ref_location));
    union.discriminator = Some(Discriminator::with_mapping(TAG, mapping));
    let references = variants.iter().map(|(title, _)| reference(title).into()).collect();
    let moved = std::mem::replace(&mut union.items, references);
    named.extend(variants.into_iter().map(|(title, _)| title).zip(moved));
}

/// The title of a variant and its tag's one value; `None` for other schemas.
fn title_and_tag(variant: &RefOr<Schema>) -> Option<(String, String)> {
    let RefOr::T(Schema::Object(variant)) = variant else { return None };
    let RefOr::T(Schema::Object(tag)) = variant.properties.get(TAG)? else { return None };
    let [value] = tag.enum_values.as_deref()? else { return None };
    Some((variant.title.clone()?, value.as_str()?.to_owned()))
}
