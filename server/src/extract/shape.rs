//! What a body may look like: a first pass over its bytes that refuses and weighs, and keeps
//! nothing.
//!
//! serde reads a list to its end before anybody counts it, and takes the values of an array for
//! the fields of an object. So the tokens of a body are compared with its type's schema, which is
//! the one of `openapi.json`, before they become values: lists, maps and texts beyond their
//! bounds, unknown fields, and lists, objects and plain values in each other's place are refused
//! at any depth, in JSON and in MessagePack. Not here: types and ranges of plain values.

use std::any::TypeId;
use std::cell::Cell;
use std::collections::BTreeMap;
use std::fmt;
use std::sync::{Mutex, PoisonError};

use serde::Deserializer;
use serde::de::{DeserializeSeed, Error, MapAccess, SeqAccess, Unexpected, Visitor};
use serde_json::Value;
use utoipa::ToSchema;

/// Length of a text that the schema does not bound, such as an id or one of several names.
pub(super) const TEXT_MAX: usize = 256;
/// Bytes of a number in memory, which may be absent; those of a text, list or map without its
/// content.
const NUMBER: usize = 16;
const POINTER: usize = 24;

/// The values that a schema permits, of any of its alternatives. A list or map without a stated
/// bound permits no entry.
#[derive(Debug, Default)]
pub(super) struct Shape {
    /// A plain value, in serde's words.
    plain: Option<&'static str>,
    text_max: usize,
    /// A list: its maximum length, and its items.
    list: Option<(usize, Box<Self>)>,
    /// An object with these fields.
    fields: Option<BTreeMap<String, Self>>,
    /// A map: its maximum length, that of its keys, and its values.
    map: Option<(usize, usize, Box<Self>)>,
    /// Bytes that the value takes in its place.
    size: usize,
}

/// The shape of a type of bodies. Shapes are made once for each type.
pub(super) fn of<T: ToSchema + 'static>() -> &'static Shape {
    static SHAPES: Mutex<BTreeMap<TypeId, &Shape>> = Mutex::new(BTreeMap::new());
    let mut shapes = SHAPES.lock().unwrap_or_else(PoisonError::into_inner);
    shapes.entry(TypeId::of::<T>()).or_insert_with(|| {
        let mut named = Vec::new();
        T::schemas(&mut named);
        let json = |schema| serde_json::to_value(schema).expect("a schema can be written as JSON");
        let named = named.into_iter().map(|(name, schema)| (name, json(schema))).collect();
        Box::leak(Box::new(Shape::new(&json(T::schema()), &named)))
    })
}

impl Shape {
    fn new(schema: &Value, named: &BTreeMap<String, Value>) -> Self {
        if let Some(reference) = schema["$ref"].as_str() {
            let name = reference.rsplit('/').next().unwrap_or_default();
            return named.get(name).map(|schema| Self::new(schema, named)).unwrap_or_default();
        }
        let bound = |name: &str| schema[name].as_u64().and_then(|max| usize::try_from(max).ok());
        let nested = |name: &str| schema.get(name).filter(|schema| schema.is_object());
        let mut shape = Self::default();
        let types = match &schema["type"] {
            Value::Array(types) => &types[..],
            one => std::slice::from_ref(one),
        };
        for name in types.iter().filter_map(Value::as_str) {
            match name {
                "array" => {
                    let items = nested("items").map(|items| Self::new(items, named));
                    let items = Box::new(items.unwrap_or_default());
                    shape.list = Some((bound("maxItems").unwrap_or(0), items));
                    shape.size = shape.size.max(POINTER);
                }
                "object" => shape.set_object(schema, named),
                "string" => {
                    shape.plain = Some("a string");
                    shape.text_max = bound("maxLength").unwrap_or(TEXT_MAX);
                    shape.size = shape.size.max(POINTER);
                }
                "null" => {}
                number => {
                    shape.plain = Some(if number == "boolean" { "a boolean" } else { "f64" });
                    shape.size = shape.size.max(NUMBER);
                }
            }
        }
        for choice in ["oneOf", "anyOf", "allOf"] {
            for schema in schema[choice].as_array().into_iter().flatten() {
                shape.also(Self::new(schema, named));
            }
        }
        shape
    }

    fn set_object(&mut self, schema: &Value, named: &BTreeMap<String, Value>) {
        if let Some(fields) = schema["properties"].as_object() {
            let shape =
                |(name, schema): (&String, &Value)| (name.clone(), Self::new(schema, named));
            let fields: BTreeMap<String, Self> = fields.iter().map(shape).collect();
            self.size = self.size.max(fields.values().map(|field| field.size).sum());
            self.fields = Some(fields);
        } else {
            let bound = |schema: &Value, name: &str| schema[name].as_u64().map(|max| max as usize);
            let keys_max = bound(&schema["propertyNames"], "maxLength").unwrap_or(TEXT_MAX);
            let values = Self::new(&schema["additionalProperties"], named);
            let max = bound(schema, "maxProperties").unwrap_or(0);
            self.map = Some((max, keys_max, Box::new(values)));
            self.size = self.size.max(POINTER);
        }
    }

    /// Permits another alternative's values too.
    fn also(&mut self, other: Self) {
        self.plain = self.plain.or(other.plain);
        self.text_max = self.text_max.max(other.text_max);
        self.size = self.size.max(other.size);
        match (&mut self.list, other.list) {
            (Some((max, items)), Some((other_max, other))) => {
                *max = other_max.max(*max);
                items.also(*other);
            }
            (own, other) => *own = own.take().or(other),
        }
        match (&mut self.fields, other.fields) {
            (Some(own), Some(other)) => {
                for (name, field) in other {
                    own.entry(name).or_default().also(field);
                }
            }
            (own, other) => *own = own.take().or(other),
        }
        self.map = self.map.take().or(other.map);
    }
}

/// The first pass over a value.
pub(super) struct Pass<'a> {
    pub(super) shape: &'a Shape,
    /// Bytes of memory that the body will take.
    pub(super) weight: &'a Cell<usize>,
    /// The weight at which the pass ends.
    pub(super) weight_max: usize,
}

impl<'a> Pass<'a> {
    fn to(&self, shape: &'a Shape) -> Self {
        Self { shape, ..*self }
    }

    fn weigh<E: Error>(&self, bytes: usize) -> Result<(), E> {
        self.weight.set(self.weight.get().saturating_add(bytes));
        if self.weight.get() > self.weight_max {
            Err(E::custom("the body is too large"))
        } else {
            Ok(())
        }
    }

    fn text<E: Error>(&self, length: usize, bytes: usize) -> Result<(), E> {
        let max = if self.shape.text_max > 0 { self.shape.text_max } else { TEXT_MAX };
        if length > max {
            return Err(E::custom(format!("{length} characters came, expected at most {max}")));
        }
        self.weigh(bytes)
    }
}

impl<'de> DeserializeSeed<'de> for Pass<'_> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        deserializer.deserialize_any(self)
    }
}

impl<'de> Visitor<'de> for Pass<'_> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self.shape {
            Shape { plain: Some(_), fields: Some(_), .. } => "string or map",
            Shape { plain: Some(plain), .. } => plain,
            Shape { list: Some(_), .. } => "a sequence",
            _ => "a map",
        })
    }

    fn visit_bool<E>(self, _: bool) -> Result<(), E> {
        Ok(())
    }

    fn visit_i64<E>(self, _: i64) -> Result<(), E> {
        Ok(())
    }

    fn visit_u64<E>(self, _: u64) -> Result<(), E> {
        Ok(())
    }

    fn visit_f64<E>(self, _: f64) -> Result<(), E> {
        Ok(())
    }

    fn visit_unit<E>(self) -> Result<(), E> {
        Ok(())
    }

    fn visit_str<E: Error>(self, text: &str) -> Result<(), E> {
        self.text(text.chars().count(), text.len())
    }

    fn visit_bytes<E: Error>(self, bytes: &[u8]) -> Result<(), E> {
        Err(E::invalid_type(Unexpected::Bytes(bytes), &self))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<(), A::Error> {
        let Some((max, items)) = &self.shape.list else {
            return Err(A::Error::invalid_type(Unexpected::Seq, &self));
        };
        let mut n = 0;
        while list.next_element_seed(self.to(items))?.is_some() {
            n += 1;
            if n > *max {
                let detail = format!("more than {max} items came, expected at most {max}");
                return Err(A::Error::custom(detail));
            }
            self.weigh(items.size)?;
        }
        Ok(())
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<(), A::Error> {
        let mut n = 0;
        while let Some(value) = map.next_key_seed(Key(&self))? {
            n += 1;
            if let Some((max, ..)) = &self.shape.map
                && n > *max
            {
                let detail = format!("more than {max} entries came, expected at most {max}");
                return Err(A::Error::custom(detail));
            }
            map.next_value_seed(self.to(value))?;
        }
        Ok(())
    }
}

/// A key: the name of a field, or any text of a map.
struct Key<'p, 'a>(&'p Pass<'a>);

impl<'de, 'a> DeserializeSeed<'de> for Key<'_, 'a> {
    type Value = &'a Shape;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<&'a Shape, D::Error> {
        deserializer.deserialize_str(self)
    }
}

impl<'a> Visitor<'_> for Key<'_, 'a> {
    type Value = &'a Shape;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("the name of a field")
    }

    fn visit_str<E: Error>(self, key: &str) -> Result<&'a Shape, E> {
        let shape = self.0.shape;
        let length = key.chars().count();
        if let Some(fields) = shape.fields.as_ref().filter(|_| length <= TEXT_MAX) {
            return fields.get(key).ok_or_else(|| {
                let known: Vec<String> = fields.keys().map(|name| format!("`{name}`")).collect();
                let known = known.join(", ");
                E::custom(format!("unknown field {key:?}, expected one of {known}"))
            });
        }
        let (keys_max, values) = match &shape.map {
            Some((_, keys_max, values)) => (*keys_max, &**values),
            None if shape.fields.is_some() => (TEXT_MAX, shape),
            None => return Err(E::invalid_type(Unexpected::Map, self.0)),
        };
        if length > keys_max {
            let detail = format!("a key of {length} characters came, expected at most {keys_max}");
            return Err(E::custom(detail));
        }
        self.0.weigh(2 * POINTER + key.len()).map(|()| values)
    }
}
