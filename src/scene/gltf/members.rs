//! Members of a file's JSON, whatever it holds.

use serde_json::Value;

/// The place in a list that a number says.
pub fn index(value: &Value) -> Option<usize> {
    value.as_u64().and_then(|number| number.try_into().ok())
}

pub fn items(list: &Value) -> impl Iterator<Item = &Value> {
    list.as_array().into_iter().flatten()
}

/// With their places.
pub fn items_mut<'a>(root: &'a mut Value, list: &str) -> impl Iterator<Item = (usize, &'a mut Value)> + use<'a> {
    root.get_mut(list).and_then(Value::as_array_mut).into_iter().flatten().enumerate()
}

pub fn entries(object: &Value) -> impl Iterator<Item = (&String, &Value)> {
    object.as_object().into_iter().flatten()
}
