//! Every struct that a kernel has in a buffer or push-constant block against its Rust twin.

use crate::common::prelude::*;
use photonmill::gpu::kernel::ReflectedStruct;
use photonmill::gpu::kernels::STRUCTS;
use photonmill::records::{Field, LAYOUTS, Layout};

/// What is wrong between one reflected struct and its twin.
fn compare(kernel: &str, found: &ReflectedStruct, twin: &Layout) -> Check {
    let place = format!("{} in {kernel}", found.name);
    let [of_glsl, of_rust] = [found.fields.len(), twin.fields.len()];
    require(of_glsl == of_rust, || format!("{place} has {of_glsl} fields, its twin {of_rust}"))?;
    for (glsl, rust) in pairs(found.fields, twin.fields) {
        require(glsl == rust, || format!("{place}: GLSL has {glsl:?}, Rust {rust:?}"))?;
    }
    let (stride, size) = (found.stride_bytes.unwrap_or(twin.size_bytes), twin.size_bytes);
    require(stride == size, || format!("{place}: neighbours lie {stride} bytes apart, its twin has {size}"))
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
    // Only arrays have a stride, so only there is a Rust record's tail padding judged.
    for name in ["Room", "Wall", "DiscLight", "PhotonState", "Point", "Tally", "DispatchArgs"] {
        assert!(STRUCTS.iter().any(|(_, found)| found.name == name && found.stride_bytes.is_some()), "{name}");
    }
}

/// How a record of this name is spoiled, and what the check says of that.
type Spoil = (&'static str, &'static [&'static str], fn(&mut Layout, &mut Vec<Field>));

#[test]
fn the_check_complains_about_spoiled_records() {
    let spoils: [Spoil; 7] = [
        ("PhotonState", &["GLSL has"], |_, fields| fields.swap(2, 3)),
        ("Tally", &["GLSL has"], |_, fields| (fields[1].name, fields[2].name) = (fields[2].name, fields[1].name)),
        // Where std430 would put what follows a vec3 in scalar layout.
        ("PhotonState", &["GLSL has"], |_, fields| fields[1].offset = 16),
        ("PhotonState", &["GLSL has"], |_, fields| fields[3].kind = "f32"),
        ("PhotonState", &["bytes apart"], |layout, _| layout.size_bytes += 4),
        ("GatherPush", &["fields, its twin"], |layout, fields| {
            fields.push(Field { name: "weight", kind: "f32", offset: layout.size_bytes });
        }),
        ("Point", &["Point in", "has no twin", "Camera of", "is in no kernel"], |layout, _| layout.name = "Camera"),
    ];
    for (number, (name, words, spoil)) in spoils.into_iter().enumerate() {
        let mut layouts = LAYOUTS.to_vec();
        let layout = layouts.iter_mut().find(|layout| layout.name == name).expect("a record of that name");
        let mut fields = layout.fields.to_vec();
        spoil(layout, &mut fields);
        layout.fields = Vec::leak(fields);
        let found = complaints(STRUCTS, &layouts).join("\n");
        assert!(words.iter().all(|word| found.contains(word)), "{number}, {name}: {found}");
    }
}
