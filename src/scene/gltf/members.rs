//! Members of a file's JSON, whatever it holds.

use std::collections::BTreeSet;

use serde_json::Value;

/// The place in a list that a number says.
pub(crate) fn index(value: &Value) -> Option<usize> {
    value.as_u64().and_then(|number| number.try_into().ok())
}

pub(crate) fn items(list: &Value) -> impl Iterator<Item = &Value> {
    list.as_array().into_iter().flatten()
}

/// With their places.
pub(crate) fn items_mut<'a>(root: &'a mut Value, list: &str) -> impl Iterator<Item = (usize, &'a mut Value)> + use<'a> {
    root.get_mut(list).and_then(Value::as_array_mut).into_iter().flatten().enumerate()
}

pub(crate) fn entries(object: &Value) -> impl Iterator<Item = (&String, &Value)> {
    object.as_object().into_iter().flatten()
}

pub(crate) const INDICES: &str = "indices";

/// Numbers of the accessors that these nodes, all meshes and all animations read; of a primitive's attributes and indices those that `counts`.
pub(crate) fn accessors<'a>(
    root: &'a Value,
    nodes: impl Iterator<Item = &'a Value>,
    counts: impl Fn(&Value, &str) -> bool,
) -> BTreeSet<usize> {
    let members = |object: &'a Value| entries(object).filter_map(|(_, of)| index(of));
    let mut found = BTreeSet::new();
    for primitive in items(&root["meshes"]).flat_map(|mesh| items(&mesh["primitives"])) {
        let attributes = entries(&primitive["attributes"]).filter(|(name, _)| counts(primitive, name));
        found.extend(attributes.filter_map(|(_, of)| index(of)));
        found.extend(index(&primitive[INDICES]).filter(|_| counts(primitive, INDICES)));
        found.extend(items(&primitive["targets"]).flat_map(members));
    }
    for node in nodes {
        found.extend(members(&node["extensions"]["EXT_mesh_gpu_instancing"]["attributes"]));
        found.extend(index(&node["skin"]).and_then(|skin| index(&root["skins"][skin]["inverseBindMatrices"])));
    }
    for sampler in items(&root["animations"]).flat_map(|animation| items(&animation["samplers"])) {
        found.extend(["input", "output"].iter().filter_map(|member| index(&sampler[member])));
    }
    found
}
