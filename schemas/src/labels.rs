//! Labels on the wire: keys and values by which sessions, objects, sensors and catalogues are found.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use utoipa::openapi::RefOr;
use utoipa::openapi::schema::{ObjectBuilder, Schema, Type};
use utoipa::{IntoParams, PartialSchema, ToSchema};

/// Keys and their values: at most 16. A key is 1 to 64 letters, digits, `.`, `_`, `/` or `-`, a value
/// at most 128 characters without a comma.
pub type Labels = BTreeMap<String, String>;

/// The schema of [`Labels`], under their name instead of their Rust type's.
#[derive(Debug)]
pub struct LabelsSchema;

impl PartialSchema for LabelsSchema {
    fn schema() -> RefOr<Schema> {
        let text = |max| ObjectBuilder::new().schema_type(Type::String).max_length(Some(max));
        let map = ObjectBuilder::new()
            .property_names(Some(text(64).build()))
            .additional_properties(Some(text(128)))
            .max_properties(Some(16))
            .description(Some("Keys and their values, by which things are found."))
            .build();
        Schema::Object(map).into()
    }
}

impl ToSchema for LabelsSchema {
    fn name() -> std::borrow::Cow<'static, str> {
        "Labels".into()
    }
}

/// New labels, which replace all earlier ones.
#[derive(Clone, Debug, Default, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct SetLabels {
    /// Keys and their values: at most 16. A key is 1 to 64 letters, digits, `.`, `_`, `/` or `-`, a
    /// value at most 128 characters without a comma.
    #[schema(value_type = LabelsSchema, example = json!({"site": "oslo", "shift": "night"}))]
    pub labels: Labels,
}

/// Parameters of a paged list of things with labels.
#[derive(Clone, Debug, Default, Deserialize, Serialize, PartialEq, Eq, IntoParams)]
#[into_params(parameter_in = Query)]
#[serde(deny_unknown_fields)]
pub struct LabelledQuery {
    /// Maximum number of items, 1 to 1000. Default: 100.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[param(minimum = 1, maximum = 1000)]
    pub limit: Option<u32>,
    /// The `next_cursor` of the previous page, passed back unchanged.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cursor: Option<String>,
    /// Only things with all these labels: `key` or `key:value`, separated by commas. A page looks at
    /// 10,000 things at most, so it may be short and still have a `next_cursor`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[param(example = "site:oslo,shift")]
    pub labels: Option<String>,
}
