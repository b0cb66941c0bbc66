//! Every struct that a kernel has in a buffer or push-constant block against its Rust twin.

use photonmill::gpu::kernel::ReflectedStruct;
use photonmill::gpu::kernels::STRUCTS;
use photonmill::records::{Field, LAYOUTS, Layout};

/// What is wrong between one reflected struct and its twin.
fn compare(kernel: &str, found: &ReflectedStruct, twin: &Layout) -> Result<(), String> {
    let place = format!("{} in {kernel}", found.name);
    if found.fields.len() != twin.fields.len() {
        return Err(format!("{place} has {} fields, its twin {}", found.fields.len(), twin.fields.len()));
    }
    for (glsl, rust) in found.fields.iter().zip(twin.fields) {
        if glsl != rust {
            return Err(format!("{place}: GLSL has {glsl:?}, Rust {rust:?}"));
        }
    }
    match found.stride_bytes {
        Some(stride) if stride != twin.size_bytes => {
            Err(format!("{place}: neighbours lie {stride} bytes apart, its twin has {}", twin.size_bytes))
        }
        _ => Ok(()),
    }
}

/// Everything that is wrong between the kernels and the Rust records.
fn complaints(structs: &[(&str, ReflectedStruct)], layouts: &[Layout]) -> Vec<String> {
    let twin_of = |found: &ReflectedStruct| layouts.iter().find(|layout| layout.name == found.name);
    let mut complaints: Vec<String> = structs
        .iter()
        .filter_map(|(kernel, found)| match twin_of(found) {
            None => Some(format!("{} in {kernel} has no twin in src/records.rs", found.name)),
            Some(twin) => compare(kernel, found, twin).err(),
        })
        .collect();
    let unused = layouts.iter().filter(|layout| structs.iter().all(|(_, found)| found.name != layout.name));
    complaints.extend(unused.map(|layout| format!("{} of src/records.rs is in no kernel", layout.name)));
    complaints
}

#[test]
fn rust_and_glsl_lay_out_every_record_alike() {
    assert!(STRUCTS.len() > LAYOUTS.len(), "reflection found {} structs", STRUCTS.len());
    let found = complaints(STRUCTS, LAYOUTS);
    assert!(found.is_empty(), "{}", found.join("\n"));
}

/// Only arrays have a stride, so only there is a Rust record's tail padding judged.
#[test]
fn records_that_lie_in_arrays_are_seen_there() {
    for name in ["Room", "Wall", "DiscLight", "LightPath", "Point", "Tally", "DispatchArgs"] {
        assert!(STRUCTS.iter().any(|(_, found)| found.name == name && found.stride_bytes.is_some()), "{name}");
    }
}

fn layout(name: &str) -> Layout {
    *LAYOUTS.iter().find(|layout| layout.name == name).expect("a record of that name")
}

/// The Rust records with one of them replaced.
fn with(spoiled: Layout) -> Vec<Layout> {
    LAYOUTS.iter().map(|layout| if layout.name == spoiled.name { spoiled } else { *layout }).collect()
}

fn leaked(fields: Vec<Field>) -> &'static [Field] {
    Vec::leak(fields)
}

#[test]
fn the_check_complains_about_swapped_fields() {
    let mut fields = layout("LightPath").fields.to_vec();
    fields.swap(2, 3);
    let spoiled = Layout { fields: leaked(fields), ..layout("LightPath") };
    assert!(!complaints(STRUCTS, &with(spoiled)).is_empty());
}

#[test]
fn the_check_complains_about_names_swapped_in_place() {
    let mut fields = layout("Tally").fields.to_vec();
    let (absorbed, escaped) = (fields[1].name, fields[2].name);
    (fields[1].name, fields[2].name) = (escaped, absorbed);
    let spoiled = Layout { fields: leaked(fields), ..layout("Tally") };
    assert!(!complaints(STRUCTS, &with(spoiled)).is_empty());
}

#[test]
fn the_check_complains_about_an_offset_a_kind_and_a_stride() {
    // Offset 16 is where std430 would put what follows a vec3 in scalar layout.
    let mut fields = layout("LightPath").fields.to_vec();
    fields[1].offset = 16;
    let moved = Layout { fields: leaked(fields), ..layout("LightPath") };
    let mut fields = layout("LightPath").fields.to_vec();
    fields[3].kind = "f32";
    let retyped = Layout { fields: leaked(fields), ..layout("LightPath") };
    let padded = Layout { size_bytes: layout("LightPath").size_bytes + 4, ..layout("LightPath") };
    for (what, spoiled) in [("offset", moved), ("kind", retyped), ("stride", padded)] {
        assert!(!complaints(STRUCTS, &with(spoiled)).is_empty(), "{what}");
    }
}

#[test]
fn the_check_complains_about_a_new_field() {
    let mut fields = layout("GatherPush").fields.to_vec();
    fields.push(Field { name: "weight", kind: "f32", offset: layout("GatherPush").size_bytes });
    let spoiled = Layout { fields: leaked(fields), ..layout("GatherPush") };
    assert!(!complaints(STRUCTS, &with(spoiled)).is_empty());
}

#[test]
fn the_check_complains_about_a_missing_twin_and_an_idle_one() {
    let without: Vec<Layout> = LAYOUTS.iter().filter(|layout| layout.name != "Point").copied().collect();
    assert!(complaints(STRUCTS, &without).iter().any(|complaint| complaint.contains("no twin")));
    let mut idle = LAYOUTS.to_vec();
    idle.push(Layout { name: "Camera", ..layout("Point") });
    assert!(complaints(STRUCTS, &idle).iter().any(|complaint| complaint.contains("in no kernel")));
}
