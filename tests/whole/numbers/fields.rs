//! The numbers in the requests of the API's description, with their stated bounds.

use reqwest::Method;
use serde_json::{Map, Value, json};

/// Location of a number in a request.
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
    /// The name, or in a body the pointer: `*` is any element of a list.
    pub(crate) pointer: String,
    /// The smallest and the largest value that the description allows, and above a bound of 0
    /// the smallest number and one whose square is none.
    pub(crate) bounds: Vec<Value>,
    /// The stated limits of a number that is no integer, each with the next number beyond.
    pub(crate) beyond: Vec<(f64, f64)>,
}

/// A path and a method with the numbers of its requests.
pub(crate) struct Operation {
    pub(crate) method: Method,
    pub(crate) path: String,
    pub(crate) fields: Vec<Field>,
}

impl Field {
    /// The number in a body; in a list, that of the first element. `None` for an omitted field.
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
                    fields.push(Field { place, pointer, bounds, beyond: Vec::new() });
                }
            }
            let body = &operation["requestBody"]["content"]["application/json"]["schema"];
            walk(body, "", schemas, 0, &mut |pointer, schema| {
                if let Some(bounds) = bounds(schema) {
                    let pointer = pointer.to_owned();
                    let beyond = beyond(schema);
                    fields.push(Field { place: Place::Body, pointer, bounds, beyond });
                }
            });
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

/// Maximum depth of nested schemas; deeper ones are recursive.
const DEPTH_MAX: usize = 24;

/// Visits a schema and all below it, with pointers at which `*` is any element of a list.
pub(crate) fn walk(
    schema: &Value,
    pointer: &str,
    schemas: &Map<String, Value>,
    depth: usize,
    visit: &mut dyn FnMut(&str, &Value),
) {
    assert!(depth < DEPTH_MAX, "a request that contains itself: {pointer}");
    if let Some(reference) = schema["$ref"].as_str() {
        let name = reference.rsplit('/').next().unwrap();
        walk(&schemas[name], pointer, schemas, depth + 1, visit);
    }
    visit(pointer, schema);
    for choice in ["oneOf", "anyOf", "allOf"] {
        for schema in schema[choice].as_array().into_iter().flatten() {
            walk(schema, pointer, schemas, depth + 1, visit);
        }
    }
    for (name, schema) in schema["properties"].as_object().into_iter().flatten() {
        walk(schema, &format!("{pointer}/{name}"), schemas, depth + 1, visit);
    }
    let items = schema.get("items").into_iter().filter(|items| items.is_object());
    for schema in schema["prefixItems"].as_array().into_iter().flatten().chain(items) {
        walk(schema, &format!("{pointer}/*"), schemas, depth + 1, visit);
    }
}

/// The bounds of a number's schema; where none is stated, the limits of its format.
fn bounds(schema: &Value) -> Option<Vec<Value>> {
    let types = types(schema);
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
    let tiny = types.contains(&"number") && low.as_f64() == Some(0.0);
    let mut bounds = vec![low, high];
    bounds.extend([5e-324, 1e-170].map(Value::from).into_iter().filter(|_| tiny));
    Some(bounds)
}

fn beyond(schema: &Value) -> Vec<(f64, f64)> {
    let stated = |name: &str| schema[name].as_f64().filter(|_| types(schema).contains(&"number"));
    let low = stated("minimum").map(|low| (low, low.next_down()));
    let high = stated("maximum").map(|high| (high, high.next_up()));
    low.into_iter().chain(high).collect()
}

/// The types that a schema permits.
pub(crate) fn types(schema: &Value) -> Vec<&str> {
    match &schema["type"] {
        Value::String(one) => vec![one.as_str()],
        Value::Array(several) => several.iter().filter_map(Value::as_str).collect(),
        _ => Vec::new(),
    }
}
