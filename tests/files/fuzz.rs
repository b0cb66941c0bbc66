//! Files as nobody would write them. Whatever the loader takes must become records and a plan: no panic, no
//! endless loop, no memory without bound, no number that is none.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::process::Command;
use std::sync::mpsc;
use std::time::Duration;

use crate::common::gltf_file::{self, data_uri, encoded, floats, push, set_buffer};
use crate::common::prelude::*;
use crate::common::rich_file;
use crate::fuzz::change::{Random, change, parts};
use crate::fuzz::sealed::{Format, Map, Run};
use crate::fuzz::{self, refused, seeds};
use image::{ImageFormat, RgbImage};
use photonmill::engine::run::blocks::Share;
use photonmill::engine::run::saved::SavedRun;
use photonmill::plan::photons_of;
use photonmill::scene::Reading;
use photonmill::scene::gltf::source::binary_file;
use photonmill::scene::sky::Sky;
use serde_json::{Value, json};

const BLENDER: &[u8] = include_bytes!("../scenes/blender.glb");
/// The same mutations each time; `tools/fuzz/run` goes on with others for as long as it is let.
const SEED: u64 = 1;

/// What became of a file.
#[derive(Debug, PartialEq, Eq)]
enum Fate {
    /// The line that says why.
    Refused(String),
    /// Its triangles.
    Planned(usize),
}

/// Loads, packs and plans a file, and looks at what is handed to a device.
fn plan(folder: &Path, name: &str, content: &[u8]) -> Fate {
    let path = folder.join(name);
    std::fs::write(&path, content).unwrap();
    fuzz::gltf::plan(&path).map_or_else(|error| Fate::Refused(refused(&error)), Fate::Planned)
}

/// What has not ended by then hangs, however slow the machine.
const PATIENCE: Duration = Duration::from_secs(600);

/// Runs `work` and fails with `what` where it panics or does not end.
fn in_time<T: Send + 'static>(what: &str, work: impl FnOnce() -> T + Send + 'static) -> T {
    let (send, receive) = mpsc::channel();
    std::thread::spawn(move || {
        let _ = send.send(catch_unwind(AssertUnwindSafe(work)));
    });
    match receive.recv_timeout(PATIENCE) {
        Ok(Ok(value)) => value,
        Ok(Err(_)) => panic!("{what}: panics, as said above"),
        Err(_) => panic!("{what}: no end after {PATIENCE:?}"),
    }
}

fn plan_value(what: &str, value: &Value) -> Fate {
    let text = value.to_string().into_bytes();
    in_time(what, move || plan(tempfile::tempdir().unwrap().path(), "scene.gltf", &text))
}

type Change = fn(&mut Value);

/// The lines by which the square is refused with each of these changes.
fn refusals(cases: &[(&str, Change)]) -> Vec<String> {
    let refusal = |(what, change): &(&str, Change)| {
        let mut value = square();
        change(&mut value);
        match plan_value(what, &value) {
            Fate::Refused(line) => line,
            fate => panic!("{what}: {fate:?}"),
        }
    };
    cases.iter().map(refusal).collect()
}

/// Whether a file is read, into places that are numbers, or refused in one line.
fn reads(what: &str, value: &Value, at: Option<f64>) -> bool {
    let text = value.to_string();
    in_time(what, move || {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.gltf");
        std::fs::write(&path, text).unwrap();
        let read = Scene::open_with(path.to_str().unwrap(), Reading { radiometric: false, at }, &mut |_, _| {});
        let read = read.inspect_err(|error| assert_eq!(error.to_string().lines().count(), 1, "{error}"));
        read.inspect(|scene| assert!(scene.meshes.iter().flat_map(|mesh| &mesh.positions).all(|position| position.is_finite()))).is_ok()
    })
}

/// The square by hand with more of everything: two triangles that emit through a texture, and glass, under a lamp of each kind,
/// and all that a material may have.
fn square() -> Value {
    square_with([0., 0., 1., 0., 1., 1., 0., 1.])
}

/// The same with other texture coordinates.
fn square_with(coordinates: [f32; 8]) -> Value {
    let picture = RgbImage::from_fn(3, 2, |i, j| image::Rgb([(i * 100) as u8, (j * 200) as u8, 50]));
    let (mut bytes, png) = (gltf_file::square_buffer(), encoded(&picture, ImageFormat::Png));
    bytes[96..128].copy_from_slice(&floats(&coordinates));
    let start = bytes.len();
    bytes.extend(&png);
    bytes.resize(bytes.len().next_multiple_of(4), 0);
    let tangents_start = bytes.len();
    bytes.extend(floats(&[0.6, 0.8, 0.0, 1.0].repeat(4)));
    let mut value = gltf_file::square();
    set_buffer(&mut value, &bytes);
    value["nodes"][3]["rotation"] = json!([0, 0.6, 0, 0.8]);
    value["meshes"][0]["primitives"][0]["mode"] = json!(4);
    push(&mut value["meshes"][0]["primitives"], json!({"attributes": {"POSITION": 0, "TEXCOORD_1": 2}, "material": 1, "mode": 5}));
    let turned = json!({"index": 0, "extensions": {"KHR_texture_transform": {"offset": [0, 1], "rotation": 0.5, "scale": [2, 1]}}});
    let glow = &mut value["materials"][0];
    glow["emissiveTexture"] = json!({"index": 0});
    glow["normalTexture"] = turned.clone();
    glow["alphaMode"] = json!("BLEND");
    glow["extensions"]["KHR_materials_clearcoat"] = json!({"clearcoatFactor": 0.5, "clearcoatNormalTexture": {"index": 0}});
    glow["extensions"]["KHR_materials_iridescence"] = json!({"iridescenceFactor": 1, "iridescenceIor": 1,
        "iridescenceThicknessMinimum": 0, "iridescenceThicknessMaximum": 1e30, "iridescenceThicknessTexture": {"index": 0}});
    glow["extensions"]["KHR_materials_anisotropy"] =
        json!({"anisotropyStrength": 1, "anisotropyRotation": 1e3, "anisotropyTexture": {"index": 0}});
    glow["extensions"]["KHR_materials_diffuse_transmission"] =
        json!({"diffuseTransmissionFactor": 1, "diffuseTransmissionColorTexture": {"index": 0}});
    glow["extensions"]["KHR_materials_sheen"] = json!({"sheenColorFactor": [1, 0, 0.5], "sheenRoughnessTexture": turned});
    push(
        &mut value["materials"],
        json!({"name": "glass", "doubleSided": true, "alphaMode": "MASK", "alphaCutoff": 0.25, "extensions": {
            "KHR_materials_ior": {"ior": 1.5}, "KHR_materials_dispersion": {"dispersion": 1000}, "KHR_materials_transmission": {"transmissionFactor": 1},
            "KHR_materials_volume": {"thicknessFactor": 1, "attenuationDistance": 2, "attenuationColor": [1, 0.5, 0]},
            "KHR_materials_specular": {"specularFactor": 0.5, "specularColorTexture": {"index": 0}}},
         "pbrMetallicRoughness": {"baseColorTexture": {"index": 0, "texCoord": 1}, "roughnessFactor": 0.3}}),
    );
    push(
        &mut value["materials"],
        json!({"name": "old", "extensions": {"KHR_materials_pbrSpecularGlossiness": {
            "diffuseFactor": [1, 1, 1, 1], "specularGlossinessTexture": {"index": 0}, "glossinessFactor": 0.5}}}),
    );
    push(&mut value["materials"], json!({"name": "sign", "extensions": {"KHR_materials_unlit": {}}}));
    for material in [2, 3] {
        push(&mut value["meshes"][0]["primitives"], json!({"attributes": {"POSITION": 0}, "material": material, "mode": 5}));
    }
    // Tangents are colours as well.
    let attributes = &mut value["meshes"][0]["primitives"][0]["attributes"];
    (attributes["TANGENT"], attributes["COLOR_0"]) = (json!(4), json!(4));
    push(&mut value["accessors"], json!({"bufferView": 5, "componentType": 5126, "count": 4, "type": "VEC4"}));
    value["textures"] = json!([{"source": 0, "sampler": 0}]);
    value["samplers"] = json!([{"wrapS": 33071, "wrapT": 33648}]);
    value["images"] = json!([{"bufferView": 4, "mimeType": "image/png"}]);
    push(&mut value["bufferViews"], json!({"buffer": 0, "byteOffset": start, "byteLength": png.len()}));
    push(&mut value["bufferViews"], json!({"buffer": 0, "byteOffset": tangents_start, "byteLength": 64}));
    value
}

/// Most memory that this process has held, bytes.
fn peak_memory() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    Some(line.split_whitespace().nth(1)?.parse::<u64>().ok()? * 1024)
}

/// Runs the test that calls this in a process of its own, whose memory nobody else takes, and says so; in that process it says no.
fn is_run_alone() -> bool {
    const ALONE: &str = "PHOTONMILL_TEST_ALONE";
    if std::env::var_os(ALONE).is_some() {
        return false;
    }
    let thread = std::thread::current();
    let test = thread.name().expect("a test's thread has its name");
    let output = Command::new(std::env::current_exe().unwrap()).args([test, "--exact"]).env(ALONE, "yes").output().unwrap();
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success() && said.contains("1 passed"), "{said}{}", String::from_utf8_lossy(&output.stderr));
    true
}

fn assert_memory() {
    assert!(peak_memory().is_none_or(|bytes| bytes < 1 << 30), "{:?} bytes of memory", peak_memory());
}

/// Cases `make` makes are refused in one line or planned; neither may be all of them.
fn survive(what: &str, count: usize, mut make: impl FnMut(&mut Random) -> Vec<u8>) {
    if is_run_alone() {
        return;
    }
    let name = if what.ends_with("gltf") { "a.gltf" } else { "a.glb" };
    let (mut random, mut folder) = (Random(SEED), tempfile::tempdir().unwrap());
    // Where a case fails, its file is there to be looked at.
    folder.disable_cleanup(true);
    let mut planned = 0;
    for case in 0..count {
        let (path, content) = (folder.path().to_owned(), make(&mut random));
        let fate = in_time(&format!("{what}, case {case}, in {}", path.display()), move || plan(&path, name, &content));
        planned += usize::from(matches!(fate, Fate::Planned(_)));
    }
    folder.disable_cleanup(false);
    assert!(planned > count / 20 && planned < count, "{what}: {planned} of {count} were planned; the mutations must matter");
    assert_memory();
}

#[test]
fn mutated_values_of_a_file_by_hand_are_planned_or_refused() {
    let seed = square();
    assert_eq!(plan_value("as it is", &seed), Fate::Planned(6), "of one material the others lie on these");
    survive("gltf", 1500, move |random| {
        let mut value = seed.clone();
        (0..=random.below(3)).for_each(|_| change(&mut value, random));
        value.to_string().into_bytes()
    });
}

/// What Blender wrote: JSON and binary part; with a normal map on every material.
fn blender() -> (Value, Vec<u8>) {
    let (text, binary) = parts(BLENDER).unwrap();
    let mut value: Value = serde_json::from_slice(text).unwrap();
    for material in value["materials"].as_array_mut().unwrap() {
        material["normalTexture"] = json!({"index": 0});
    }
    (value, binary.to_vec())
}

#[test]
fn mutated_values_of_a_blender_file_are_planned_or_refused() {
    let (value, binary) = blender();
    survive("values of a glb", 200, move |random| {
        let mut value = value.clone();
        (0..=random.below(2)).for_each(|_| change(&mut value, random));
        binary_file(&value, &binary, &[])
    });
}

/// Vertices, normals, coordinates and indices become extreme numbers.
#[test]
fn mutated_numbers_of_a_blender_file_are_planned_or_refused() {
    let (value, binary) = blender();
    let words = [0.0f32, -0.0, 1.0, 1e-38, 1e-45, 1e-20, -1e10, 1e18, 3e38, f32::INFINITY].map(f32::to_bits);
    survive("numbers of a glb", 200, move |random| {
        let mut binary = binary.clone();
        for _ in 0..=random.below(12) {
            let word = random.below(binary.len() / 4 - 1) * 4;
            let new = match random.below(8) {
                0 => random.below(1 << 31) as u32,
                1 => 0x0001_0000 * random.below(500) as u32,
                _ => random.pick(&words[..9]),
            };
            binary[word..word + 4].copy_from_slice(&new.to_le_bytes());
        }
        binary_file(&value, &binary, &[])
    });
}

#[test]
fn mutated_bytes_of_a_blender_file_are_planned_or_refused() {
    survive("bytes of a glb", 400, |random| {
        let mut bytes = BLENDER.to_vec();
        for _ in 0..=random.below(3) {
            let place = random.below(bytes.len());
            match random.below(6) {
                0 => bytes.truncate(place),
                1 => bytes.truncate(random.below(30)),
                2 => drop(bytes.splice(place..place, [0; 3])),
                3 => bytes.get_mut(random.below(24)).into_iter().for_each(|byte| *byte = random.below(256) as u8),
                _ => bytes.get_mut(place).into_iter().for_each(|byte| *byte ^= 1 << random.below(8)),
            }
        }
        bytes
    });
}

/// Members that the specification asks for and a file leaves out, and nodes within themselves, through which a walk without memory
/// takes 2^depth steps.
#[test]
fn documents_without_sense_are_refused() {
    refusals(&[
        ("a perspective camera without its numbers", |v| v["cameras"][0] = json!({"type": "perspective"})),
        ("a camera of the other kind", |v| v["cameras"][0]["type"] = json!("orthographic")),
        ("lights without a list", |v| drop(v.as_object_mut().unwrap().remove("extensions"))),
        ("sparse values without any", |v| v["accessors"][0]["sparse"] = json!({"count": 3})),
        ("a scene that is not there", |v| v["scene"] = json!(4)),
        ("a chain of double links", |v| {
            v["nodes"] = (1..61).map(|k| if k < 60 { json!({"children": [k, k]}) } else { json!({}) }).collect();
            v["scenes"][0]["nodes"] = json!([0]);
        }),
        ("a node three times within itself", |v| v["nodes"][0]["children"] = json!([0, 0, 0])),
    ]);
}

/// A few bytes that claim much.
#[test]
fn claims_without_content_take_no_memory() {
    if is_run_alone() {
        return;
    }
    let before = peak_memory();
    refusals(&[
        ("elements", |v| v["accessors"][0]["count"] = json!(u32::MAX)),
        ("elements without a view", |v| {
            v["accessors"][0] = json!({"componentType": 5126, "count": 4e9 as u64, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0]});
        }),
        ("sparse elements", |v| {
            v["accessors"][0]["sparse"] =
                json!({"count": 4e9 as u64, "indices": {"bufferView": 3, "componentType": 5123}, "values": {"bufferView": 0}});
        }),
        ("a stride", |v| v["bufferViews"][0]["byteStride"] = json!(252)),
    ]);
    // Of a buffer only what is used must be there.
    let mut value = square();
    value["buffers"][0]["byteLength"] = json!(1u64 << 40);
    assert_eq!(plan_value("a buffer", &value), Fate::Planned(6));
    if let (Some(before), Some(after)) = (before, peak_memory()) {
        assert!(after - before < 1 << 29, "{} bytes more", after - before);
    }
}

/// Texture coordinates that lie far apart, lights far from the scene, and scenes so small or large that a light's strength in their own
/// unit leaves the range of f32.
#[test]
fn numbers_out_of_range_are_planned_or_refused() {
    for far in [1e4, 1e9, 1e18, 1e19, 1e30, 3e38] {
        for second in [0.0, -far] {
            let value = square_with([second, 0., far, 0., 1., 1., 0., -far]);
            plan_value(&format!("coordinates from {second} to {far}"), &value);
        }
    }
    for factor in [1e-37, 1e-30, 1e-19, 1e-10, 1e10, 1e19, 1e29] {
        let mut value = square();
        value["nodes"][0]["scale"] = json!([factor, factor, factor]);
        value["nodes"][0].as_object_mut().unwrap().remove("translation");
        plan_value(&format!("scaled by {factor}"), &value);
    }
    for distance in [1e6, 1e18, 3e38] {
        let mut value = square();
        value["nodes"][2]["translation"] = json!([0, distance, 0]);
        value["nodes"][4]["translation"] = json!([distance, 0, 0]);
        value["nodes"][1]["translation"] = json!([0, 0, distance]);
        plan_value(&format!("lights at {distance} m"), &value);
    }
}

/// Triangles that lie on one another leave a hierarchy nothing to part them by.
#[test]
fn many_equal_triangles_are_planned_or_refused() {
    let mut value = square();
    let primitive = value["meshes"][0]["primitives"][0].clone();
    value["meshes"][0]["primitives"] = json!(vec![primitive; 3000]);
    // Of each, the first is left.
    assert_eq!(plan_value("6000 triangles, each 3000 times", &value), Fate::Planned(2));
}

/// Planning looks at no chunk, however many are asked for.
#[test]
fn a_billion_chunks_are_planned_at_once() {
    let settings = RoomSettings { photons: 1 << 31, chunk: Some(2), ..RoomSettings::default() };
    let plan = in_time("a billion chunks", move || RoomPlan::new(&open_box(&settings), &settings, &Limits::of_host()).unwrap());
    let last = plan.chunks_per_round - 1;
    assert!((1..=4).contains(&plan.path_capacity) && last > 1 << 29, "{} chunks of {}", last + 1, plan.path_capacity);
    for chunk in [0, 1, last / 2, last] {
        assert!(photons_of(&plan.chunk(chunk)) <= plan.path_capacity, "chunk {chunk}");
    }
}

/// A name may hold anything; a complaint stays one line.
#[test]
fn names_with_line_breaks_do_not_break_the_line() {
    let lines = refusals(&[
        ("a name of several lines", |v| {
            v["nodes"][0]["name"] = json!("wall\nof\r\nmany\u{1b}[31m lines");
            v["accessors"][1]["count"] = json!(3);
        }),
        ("a version", |v| v["asset"]["version"] = json!("1\n0")),
        ("an extension", |v| v["extensionsRequired"] = json!(["EXT\nof\r\nlines"])),
        ("a file", |v| v["buffers"][0]["uri"] = json!("no%0Awhere.bin")),
        ("a place", |v| v["buffers"][0]["uri"] = json!("https:\n//there")),
    ]);
    assert!(!lines.concat().chars().any(char::is_control), "{lines:?}");
}

/// The square with a JPEG of eight by eight for its picture, changed.
fn square_with_jpeg(change: impl FnOnce(&mut Vec<u8>)) -> Value {
    let mut jpeg = encoded(&RgbImage::new(8, 8), ImageFormat::Jpeg);
    change(&mut jpeg);
    let mut value = square();
    value["images"][0] = json!({"uri": data_uri("image/jpeg", &jpeg)});
    value
}

/// The picture says that it is larger.
fn claim(jpeg: &mut [u8], width: u16, height: u16) {
    // Start of frame: marker, length, precision, then height and width.
    let frame = jpeg.windows(2).position(|marker| marker == [0xff, 0xc0]).unwrap();
    jpeg[frame + 5..frame + 7].copy_from_slice(&height.to_be_bytes());
    jpeg[frame + 7..frame + 9].copy_from_slice(&width.to_be_bytes());
}

/// What the JPEG decoder says of a file that was cut off ends in a line break.
#[test]
fn pictures_cut_off_are_refused_in_one_line() {
    let mut whole = 0;
    let value = square_with_jpeg(|jpeg| whole = jpeg.len());
    assert!(matches!(plan_value("a whole picture", &value), Fate::Planned(_)));
    let refused = (0..whole).filter(|length| {
        let value = square_with_jpeg(|jpeg| jpeg.truncate(*length));
        matches!(plan_value(&format!("{length} bytes of a picture"), &value), Fate::Refused(_))
    });
    // Its last bytes a decoder may do without.
    assert!(refused.count() > whole * 3 / 4);
}

/// A picture is read in several ways, each of which takes memory of its own: all of them count before it is decoded.
#[test]
fn every_use_of_a_large_picture_counts() {
    if is_run_alone() {
        return;
    }
    let fate = |kinds: &[&str], samplers: usize| {
        let mut value = square_with_jpeg(|jpeg| claim(jpeg, 0x1000, 0x1000));
        let wraps = [10497, 33071, 33648];
        value["samplers"] = (0..samplers).map(|k| json!({"wrapS": wraps[k % 3], "wrapT": wraps[k / 3]})).collect();
        value["textures"] = (0..samplers).map(|k| json!({"source": 0, "sampler": k})).collect();
        let material = |k: usize| kinds.iter().map(|kind| ((*kind).to_owned(), json!({"index": k}))).collect::<Value>();
        value["materials"] = (0..samplers.max(4)).map(|k| material(k % samplers)).collect();
        // Only what a mesh uses counts.
        let primitives = value["meshes"][0]["primitives"].as_array_mut().unwrap();
        for k in 4..samplers {
            primitives.push(primitives[0].clone());
            primitives.last_mut().unwrap()["material"] = json!(k);
        }
        plan_value(&format!("4096 by 4096 texels as {kinds:?} with {samplers} samplers"), &value)
    };
    // Eight are 2^27 texels, and some of those are kept free. Uses that are alike are one.
    assert_eq!(fate(&["emissiveTexture"], 1), Fate::Planned(3));
    for (kinds, samplers) in [(&["emissiveTexture"] as &[&str], 8), (&["emissiveTexture", "normalTexture"], 4)] {
        let Fate::Refused(line) = fate(kinds, samplers) else { panic!("{kinds:?} must be refused") };
        assert!(line.contains("texels, the most that are read"), "{line}");
    }
    // A few bytes whose picture would take 3 GiB.
    let value = square_with_jpeg(|jpeg| claim(jpeg, 0x4000, 0x4000));
    let Fate::Refused(line) = plan_value("16384 by 16384 texels", &value) else { panic!("must be refused") };
    assert!(line.contains("texels"), "{line}");
    // A picture as long as may be is a picture.
    for (width, height) in [(100_000, 1), (1, 100_000)] {
        let mut value = square();
        value["images"][0] = json!({"uri": data_uri("image/png", &encoded(&RgbImage::new(width, height), ImageFormat::Png))});
        assert_eq!(plan_value(&format!("{width} by {height} texels"), &value), Fate::Planned(6));
    }
    assert_memory();
}

/// Skies from bytes that were changed or cut off: a picture without odd numbers, or one line.
#[test]
fn skies_of_any_bytes_are_read_or_refused() {
    if is_run_alone() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let colours = image::Rgb32FImage::from_fn(32, 16, |i, j| image::Rgb([0.1 * i as f32, j as f32, 1e4]));
    let picture = image::DynamicImage::ImageRgb32F(colours);
    for (name, format) in [("a.hdr", ImageFormat::Hdr), ("a.exr", ImageFormat::OpenExr)] {
        let mut whole = std::io::Cursor::new(Vec::new());
        picture.write_to(&mut whole, format).unwrap();
        let whole = whole.into_inner();
        let path = folder.path().join(name);
        let read = |content: &[u8]| {
            std::fs::write(&path, content).unwrap();
            let path = path.clone();
            in_time(name, move || {
                let table = Sky::read(&path).map(|sky| sky.table());
                let table = table.inspect_err(|reason| assert_eq!(reason.lines().count(), 1, "{reason}"));
                table.inspect(|table| assert!(table.integral.is_finite() && table.most_over_density.is_finite())).is_ok()
            })
        };
        assert!(read(&whole));
        let cut = (0..whole.len()).step_by(19).filter(|length| read(&whole[..*length])).count();
        assert!(cut < whole.len() / 38, "{name}: {cut}");
        let mut random = Random(SEED);
        let mut sound = 0;
        for _ in 0..200 {
            let mut content = whole.clone();
            for _ in 0..1 + random.below(3) {
                // Half of them in the head, where sizes stand.
                let place = if random.below(2) == 0 { random.below(content.len().min(300)) } else { random.below(content.len()) };
                content[place] = random.below(256) as u8;
            }
            sound += usize::from(read(&content));
        }
        assert!(sound > 0, "{name}");
    }
    assert_memory();
}

/// What extensions bring, with changed members: a scene, or one line.
#[test]
fn extensions_with_changed_members_are_read_or_refused() {
    if is_run_alone() {
        return;
    }
    let files = [
        rich_file::animated(),
        rich_file::instanced(),
        rich_file::compressed("EXT_meshopt_compression"),
        rich_file::with_webp(),
        rich_file::draco_square(),
        rich_file::with_image_light(),
        rich_file::with_ktx2(&rich_file::ktx2_in_zstandard(&[[1, 2, 3, 4], [5, 6, 7, 8]])),
    ];
    let mut random = Random(SEED);
    let mut read = 0;
    for case in 0..600 {
        let mut value = files[case % files.len()].clone();
        for _ in 0..1 + random.below(2) {
            change(&mut value, &mut random);
        }
        read += usize::from(reads(&format!("case {case}: {value}"), &value, (case % 4 == 0).then_some(1.5)));
    }
    assert!((100..575).contains(&read), "{read}");
    assert_memory();
}

/// The bytes of compressed views, changed and cut off.
#[test]
fn compressed_views_of_any_bytes_are_read_or_refused() {
    let whole = rich_file::compressed("KHR_meshopt_compression");
    let encoded = whole["buffers"][0]["uri"].as_str().unwrap().split_once("base64,").unwrap().1;
    let bytes = base64::Engine::decode(&base64::engine::general_purpose::STANDARD, encoded).unwrap();
    let mut random = Random(SEED);
    let mut read = 0;
    for case in 0..400 {
        let (mut value, mut changed) = (whole.clone(), bytes.clone());
        for _ in 0..1 + random.below(4) {
            let place = random.below(changed.len());
            changed[place] = random.below(256) as u8;
        }
        set_buffer(&mut value, &changed);
        read += usize::from(reads(&format!("case {case}"), &value, None));
    }
    assert!((5..400).contains(&read), "{read}");
}

/// Changes members of a file's header, whose checksums are right. `take` uses the file, or has the line by which it is refused.
fn change_headers<F: Format>(file: &[u8], take: impl Fn(&[u8]) -> Result<(), String>) {
    let (header, arrays) = F::parts(file).unwrap();
    let mut random = Random(SEED);
    let mut taken = 0;
    for _ in 0..600 {
        let mut value: Value = serde_json::from_slice(header).unwrap();
        (0..=random.below(2)).for_each(|_| change(&mut value, &mut random));
        match take(&F::pack(&serde_json::to_vec(&value).unwrap(), arrays)) {
            Ok(()) => taken += 1,
            Err(line) => assert!(!line.is_empty() && line.lines().count() == 1, "{line}"),
        }
    }
    assert!((41..560).contains(&taken), "{taken} of 600 are taken");
}

/// Checkpoints whose header says anything: refused in one line, or of use.
#[test]
fn checkpoints_of_any_header_are_refused_or_of_use() {
    for saved in [seeds::part_of_box(Share::default(), None).unwrap(), seeds::part_of_picture(Share::default(), false)] {
        let whole = saved.to_bytes();
        assert!(SavedRun::from_bytes(&whole).unwrap() == saved);
        change_headers::<Run>(&whole, |file| {
            let run = SavedRun::from_bytes(file)?;
            let _ = run.identity.differs_from(&saved.identity);
            fuzz::checkpoint::use_run(&run);
            Ok(())
        });
    }
}

/// Files of photons likewise.
#[test]
fn photon_maps_of_any_header_are_refused_or_of_use() {
    let place = Place::new();
    let path = place.at("a.pm");
    change_headers::<Map>(&seeds::photon_map(&path), |file| {
        std::fs::write(&path, file).unwrap();
        fuzz::map::use_map(&path).map_err(|error| refused(&error))
    });
}
