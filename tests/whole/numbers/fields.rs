//! The numbers in the requests of a description of the API, with the bounds that it states.

use reqwest::Method;
use serde_json::{Map, Value, json};

/// Where a number comes in a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Place {
    Body,
    Query,
    Path,
}

/// A number of a request.
#[derive(Clone, Debug)]
pub(crate) struct Field {
    pub(crate) place: Place,
    /// Its name, or in a body where it is: `*` is any element of a list.
    pub(crate) pointer: String,
    /// The smallest and the largest value that the description allows.
    pub(crate) bounds: [Value; 2],
}

/// A path and a method with the numbers that its requests have.
pub(crate) struct Operation {
    pub(crate) method: Method,
    pub(crate) path: String,
    pub(crate) fields: Vec<Field>,
}

impl Field {
    /// The number in a body; of lists, the first element. A field that is left out is none.
    pub(crate) fn find<'body>(&self, body: &'body mut Value) -> Option<&'body mut Value> {
        self.pointer.split('/').skip(1).try_fold(body, |value, part| match part {
            "*" => value.get_mut(0),
            name => value.get_mut(name),
        })
    }
}

/// All operations whose requests have numbers.
pub(crate) fn operations(description: &Value) -> Vec<Operation> {
    let schemas = description["components"]["schemas"].as_object().unwrap();
    let mut found = Vec::new();
    for (path, item) in description["paths"].as_object().unwrap() {
        for (method, operation) in item.as_object().unwrap() {
            let Ok(method) = Method::from_bytes(method.to_uppercase().as_bytes()) else { continue };
            let mut fields = Vec::new();
            let own = operation["parameters"].as_array().into_iter().flatten();
            for parameter in own.chain(item["parameters"].as_array().into_iter().flatten()) {
                let place = match parameter["in"].as_str() {
                    Some("query") => Place::Query,
                    Some("path") => Place::Path,
                    _ => continue,
                };
                if let Some(bounds) = bounds(&parameter["schema"]) {
                    let pointer = parameter["name"].as_str().unwrap().to_owned();
                    fields.push(Field { place, pointer, bounds });
                }
            }
            let body = &operation["requestBody"]["content"]["application/json"]["schema"];
            walk(body, "", schemas, 0, &mut fields);
            let mut known = Vec::new();
            fields.retain(|field| {
                let is_new = !known.contains(&field.pointer);
                known.push(field.pointer.clone());
                is_new
            });
            if !fields.is_empty() {
                found.push(Operation { method, path: path.clone(), fields });
            }
        }
    }
    found
}

/// Schemas within schemas deeper than this are those of a description that refers to itself.
const DEPTH_MAX: usize = 24;

fn walk(
    schema: &Value,
    pointer: &str,
    schemas: &Map<String, Value>,
    depth: usize,
    fields: &mut Vec<Field>,
) {
    assert!(depth < DEPTH_MAX, "a request that contains itself: {pointer}");
    if let Some(reference) = schema["$ref"].as_str() {
        let name = reference.rsplit('/').next().unwrap();
        walk(&schemas[name], pointer, schemas, depth + 1, fields);
    }
    if let Some(bounds) = bounds(schema) {
        fields.push(Field { place: Place::Body, pointer: pointer.to_owned(), bounds });
    }
    for choice in ["oneOf", "anyOf", "allOf"] {
        for schema in schema[choice].as_array().into_iter().flatten() {
            walk(schema, pointer, schemas, depth + 1, fields);
        }
    }
    for (name, schema) in schema["properties"].as_object().into_iter().flatten() {
        walk(schema, &format!("{pointer}/{name}"), schemas, depth + 1, fields);
    }
    let items = schema.get("items").into_iter().filter(|items| items.is_object());
    for schema in schema["prefixItems"].as_array().into_iter().flatten().chain(items) {
        walk(schema, &format!("{pointer}/*"), schemas, depth + 1, fields);
    }
}

/// The bounds of a schema of numbers; where none is stated, the ends of what its format holds.
fn bounds(schema: &Value) -> Option<[Value; 2]> {
    let types = match &schema["type"] {
        Value::String(one) => vec![one.as_str()],
        Value::Array(several) => several.iter().filter_map(Value::as_str).collect(),
        _ => Vec::new(),
    };
    let [low, high] = if types.contains(&"integer") {
        match schema["format"].as_str() {
            Some("int64") => [json!(i64::MIN), json!(i64::MAX)],
            _ => [json!(i64::from(i32::MIN)), json!(i64::from(i32::MAX))],
        }
    } else if types.contains(&"number") {
        [json!(-1e308), json!(1e308)]
    } else {
        return None;
    };
    let stated = |name: &str| schema.get(name).filter(|bound| bound.is_number()).cloned();
    let low = stated("minimum").or_else(|| stated("exclusiveMinimum")).unwrap_or(low);
    let high = stated("maximum").or_else(|| stated("exclusiveMaximum")).unwrap_or(high);
    Some([low, high])
}
