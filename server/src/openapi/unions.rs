//! Unions in the form that client generators and validators need.
//!
//! Every variant gets a named schema, and a discriminator maps the values of the tag to
//! variants. The derive writes variants in place, under titles; a variant without a title or
//! a tag stays there.

use std::collections::BTreeMap;

use utoipa::openapi::schema::{AdditionalProperties, AnyOfBuilder, ArrayItems, Discriminator};
use utoipa::openapi::schema::{OneOf, SchemaType, Type};
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

/// Lets `null` be one of any alternatives. The derive makes it one of exactly one, which readers
/// of a union with a discriminator take for a contradiction.
pub(super) fn accept_null(schemas: &mut BTreeMap<String, RefOr<Schema>>) {
    schemas.values_mut().for_each(accept_null_in);
}

fn accept_null_in(schema: &mut RefOr<Schema>) {
    let RefOr::T(schema) = schema else { return };
    match schema {
        Schema::Object(object) => {
            object.properties.values_mut().for_each(accept_null_in);
            if let Some(AdditionalProperties::RefOr(values)) =
                object.additional_properties.as_deref_mut()
            {
                accept_null_in(values);
            }
        }
        Schema::Array(array) => {
            if let ArrayItems::RefOrSchema(items) = &mut array.items {
                accept_null_in(items);
            }
        }
        Schema::OneOf(union) if union.items.iter().any(is_null) => {
            let any = AnyOfBuilder::new().description(union.description.take());
            let items = std::mem::take(&mut union.items);
            *schema = items.into_iter().fold(any, AnyOfBuilder::item).build().into();
        }
        _ => {}
    }
}

fn is_null(schema: &RefOr<Schema>) -> bool {
    let null = SchemaType::Type(Type::Null);
    matches!(schema, RefOr::T(Schema::Object(object)) if object.schema_type == null)
}
