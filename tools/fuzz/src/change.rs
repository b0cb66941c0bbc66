//! A glTF file's JSON changed in one place, and .glb files taken apart. The tests of the loader change files
//! in the same way.

use serde_json::{Value, json};

/// JSON and binary part of a .glb.
pub fn parts(file: &[u8]) -> Option<(&[u8], &[u8])> {
    let length = |at: usize| Some(u32::from_le_bytes(file.get(at..at + 4)?.try_into().ok()?) as usize);
    if !file.starts_with(b"glTF") {
        return None;
    }
    let end = 20usize.checked_add(length(12)?)?;
    Some((file.get(20..end)?, file.get(end + 8..).unwrap_or_default()))
}

/// Pointers to all values within a value.
pub fn pointers(value: &Value) -> Vec<String> {
    fn walk(value: &Value, at: &str, found: &mut Vec<String>) {
        found.push(at.to_owned());
        match value {
            Value::Array(items) => items.iter().enumerate().for_each(|(k, item)| walk(item, &format!("{at}/{k}"), found)),
            Value::Object(members) => members.iter().for_each(|(key, item)| {
                walk(item, &format!("{at}/{}", key.replace('~', "~0").replace('/', "~1")), found);
            }),
            _ => {}
        }
    }
    let mut found = Vec::new();
    walk(value, "", &mut found);
    found
}

/// Members that a file may have and the seeds lack, and where they go.
const MEMBERS: [(&str, &str, &str); 12] = [
    ("/accessors/0", "normalized", "true"),
    ("/accessors/0", "sparse", r#"{"count":1,"indices":{"bufferView":3,"componentType":5123},"values":{"bufferView":0}}"#),
    ("/bufferViews/0", "byteStride", "16"),
    ("/nodes/0", "matrix", "[1,0,0,0,0,1,0,0,0,0,1,0,0,0,0,1]"),
    ("/nodes/0", "children", "[4]"),
    ("/nodes/0", "skin", "0"),
    ("/meshes/0/primitives/0", "targets", r#"[{"POSITION":0}]"#),
    ("/materials/0", "normalTexture", r#"{"index":0}"#),
    ("/materials/0", "alphaMode", r#""MASK""#),
    ("/cameras/0", "orthographic", r#"{"xmag":1,"ymag":1,"zfar":9,"znear":0}"#),
    ("", "animations", r#"[{"channels":[],"samplers":[]}]"#),
    ("", "extensionsRequired", r#"["KHR_draco_mesh_compression"]"#),
];

/// One value replaced, taken away, doubled, swapped, nudged, or taken from another place; or a member more.
pub fn change(value: &mut Value, random: &mut Random) {
    let all = pointers(value);
    let (place, other) = (random.pick(&all), random.pick(&all));
    let numbers = [0.0, -0.0, -1.0, 0.5, 1e-45, 1e-38, 1e-20, 1e-6, 1e6, 1e18, 1e30, 3e38, -3e38, 1e300, 1e-300];
    let integers =
        [0, 1, 2, 3, 4, 5, 7, 12, 255, 5120, 5121, 5123, 5125, 5126, 9728, 33_071, 65_535, 1 << 24, u64::from(u32::MAX), u64::MAX];
    let words = ["", "SCALAR", "VEC2", "VEC3", "VEC4", "MAT4", "spot", "point", "directional", "orthographic", "image/jpeg", "a%20b"];
    let new = match random.below(11) {
        0 | 1 => json!(random.pick(&numbers)),
        2 | 3 => json!(random.pick(&integers)),
        4 => value.pointer(&other).expect("it was found there").clone(),
        5 => random.pick(&[json!(null), json!([]), json!({}), json!(true), json!([0, 0])]),
        6 => json!(random.pick(&words)),
        7 => {
            let (parent, key, text) = random.pick(&MEMBERS);
            if let Some(Value::Object(members)) = value.pointer_mut(parent) {
                members.insert(key.into(), serde_json::from_str(text).expect("it is JSON"));
            }
            return;
        }
        8 => match value.pointer(&place).expect("it was found there").as_f64() {
            Some(number) => json!(random.pick(&[number + 1.0, number - 1.0, -number, number * 2.0, number * 0.5, number * 1e6])),
            None => return,
        },
        _ => return take_or_double(value, &place, random),
    };
    *value.pointer_mut(&place).expect("it was found there") = new;
}

fn take_or_double(value: &mut Value, place: &str, random: &mut Random) {
    let Some((parent, key)) = place.rsplit_once('/') else { return };
    match value.pointer_mut(parent) {
        Some(Value::Array(items)) => {
            let (item, other) = (key.parse::<usize>().expect("a place in a list"), random.below(items.len()));
            match random.below(3) {
                0 => items.push(items[item].clone()),
                1 => drop(items.remove(item)),
                _ => items.swap(item, other),
            }
        }
        Some(Value::Object(members)) => drop(members.remove(&key.replace("~1", "/").replace("~0", "~"))),
        _ => {}
    }
}

/// Random numbers that are the same on every machine.
pub struct Random(pub u64);

impl Random {
    pub fn below(&mut self, limit: usize) -> usize {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((self.0 >> 33) as usize) % limit.max(1)
    }

    pub fn pick<T: Clone>(&mut self, of: &[T]) -> T {
        of[self.below(of.len())].clone()
    }
}
