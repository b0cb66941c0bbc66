//! What files of pictures hold beside the picture: layers of an EXR, and what both formats say of how they were made, from which
//! `photonmill repeat` makes them again.

use std::process::Command;

use crate::common::layered::row_of_texels;
use crate::common::prelude::*;
use crate::common::program::on_device;
use glam::{dvec3, vec3};
use photonmill::output::colour::png_codes;
use photonmill::output::exr_file;
use photonmill::output::metadata::{Metadata, Repeat};
use photonmill::scene::material::Coverage;
use photonmill::scene::texture::Filter;
use photonmill::verify::judge::{FirstSurface, first_surfaces};
use serde_json::json;

const SMALL: &str = "--size 8x8 --photons 500 -q";

impl Place {
    pub fn content(&self, name: &str) -> Vec<u8> {
        std::fs::read(self.at(name)).unwrap()
    }

    /// Channels by their names.
    pub fn channels(&self, name: &str) -> BTreeMap<String, Vec<f32>> {
        let (size, channels) = exr_file::decode(&self.content(name)).unwrap();
        assert!(channels.iter().all(|channel| channel.values.len() == (size.0 * size.1) as usize));
        channels.into_iter().map(|channel| (channel.name, channel.values)).collect()
    }

    fn light(&self, name: &str) -> [Vec<f32>; 3] {
        let mut channels = self.channels(name);
        ["R", "G", "B"].map(|channel| channels.remove(channel).unwrap())
    }
}

#[test]
fn layers_are_the_parts_the_error_and_what_is_seen() {
    // Those of which runs are made alone, too.
    let parts = of_run::<&[_]>(&["caustic"], &["specular", "caustic"]);
    let Some(_) = device() else { return };
    let place = Place::new();
    place.succeed(&format!("render cornell-spheres --rounds 8 --block 1 -o a.exr --error-image e.exr {SMALL}"));
    let all = place.channels("a.exr");
    let rgb = ["direct", "specular", "caustic", "indirect", "standard_error", "unseen", "albedo"];
    let mut expected: BTreeSet<String> = rgb.iter().flat_map(|layer| ["R", "G", "B"].map(|channel| format!("{layer}.{channel}"))).collect();
    expected.extend(["R", "G", "B", "normal.X", "normal.Y", "normal.Z", "depth.Z"].map(str::to_owned));
    assert_eq!(all.keys().cloned().collect::<BTreeSet<_>>(), expected);
    // As if a part were asked for alone; and the sum of all but for the rounding of floats.
    for part in parts {
        place.succeed(&format!("render cornell-spheres --rounds 8 --block 1 --part {part} --layers none -o {part}.exr {SMALL}"));
        let alone = place.channels(&format!("{part}.exr"));
        assert_eq!(alone.len(), 3);
        for (channel, values) in &alone {
            assert!(*values == all[&format!("{part}.{channel}")], "{part}.{channel}");
        }
    }
    for channel in ["R", "G", "B"] {
        let errors = &all[&format!("standard_error.{channel}")];
        assert!(*errors == place.channels("e.exr")[channel] && errors.iter().any(|error| *error > 0.0));
        assert!(all[&format!("unseen.{channel}")] == place.channels("e.exr")[&format!("unseen.{channel}")]);
        for (pixel, whole) in all[channel].iter().enumerate() {
            let sum: f64 = rgb[..4].iter().map(|part| f64::from(all[&format!("{part}.{channel}")][pixel])).sum();
            assert!((sum - f64::from(*whole)).abs() <= 3e-7 * f64::from(*whole), "{channel} of pixel {pixel}: {sum}, {whole}");
        }
    }
    // Neither layers nor their lack change the light, which is what `--part all` asks for.
    place.succeed(&format!("render cornell-spheres --rounds 8 --block 1 --part all -o b.exr --layers albedo,depth {SMALL}"));
    assert!(place.light("a.exr") == place.light("b.exr"));
    let some: Vec<String> = place.channels("b.exr").into_keys().collect();
    assert_eq!(some, ["B", "G", "R", "albedo.B", "albedo.G", "albedo.R", "depth.Z"]);
    place.assert_refused([
        ("render cornell -o c.exr --layers light", ["--layers light", "must be all, none, or some of direct, specular"]),
        ("render cornell -o c.png --layers none", ["--layers none", "is for EXR only"]),
    ]);
}

/// The layer and the report state the same error: their root mean squares agree, however little some pixels have seen of some kind of
/// light. What that may add is in a layer of its own, and is no error.
#[test]
fn the_error_layer_is_as_large_as_the_report_says() {
    let Some(_) = device() else { return };
    let place = Place::new();
    place.succeed(
        "render caustic-sphere --rounds 8 --block 1 -o a.exr --json a.json --size 8x8 --photons 500 --caustic-photons 100 --aim off -q",
    );
    let all = place.channels("a.exr");
    let report = place.json("a.json");
    let mean_square = |layer: &str| {
        let values = ["R", "G", "B"].map(|channel| &all[&format!("{layer}{channel}")]);
        let finite = || values.into_iter().flatten().map(|value| f64::from(*value)).filter(|value| value.is_finite());
        finite().map(|value| value * value).sum::<f64>() / finite().count() as f64
    };
    let mean = ["R", "G", "B"].map(|channel| all[channel].iter().map(|value| f64::from(*value)).sum::<f64>()).iter().sum::<f64>() / 192.0;
    let [layer, unseen] = ["standard_error.", "unseen."].map(|layer| mean_square(layer).sqrt() / mean);
    let stated = report["relative_error"].as_f64().unwrap();
    println!("the layer says {layer:.3}, the report {stated:.3}; unseen {unseen:.3}");
    assert!((0.7 * stated..2.0 * stated).contains(&layer), "the layer says {layer}, the report {stated}");
    assert!(unseen > 2.0 * stated, "nothing is unseen: the test needs fewer photons");
    assert_eq!(report["intervals"]["degrees_of_freedom"], 7);
}

/// What was seen before a checkpoint counts in its layers, and so does each shard; less than a block is a picture too.
#[test]
fn parts_of_runs_add_up_in_layers() {
    let Some(_) = device() else { return };
    let place = Place::new();
    let run = |more: &str| place.succeed(&format!("render cornell {more} {SMALL}"));
    run("--rounds 16 -o whole.exr");
    run("--rounds 8 -o half.exr --checkpoint half.pms");
    run("--rounds 16 -o resumed.exr --resume half.pms");
    assert!(place.content("resumed.exr") == place.content("whole.exr"));
    for shard in [1, 2] {
        run(&format!("--rounds 16 --shard {shard}/2 --checkpoint {shard}.pms -o {shard}.exr"));
    }
    place.succeed("merge 1.pms 2.pms -o merged.exr");
    let (merged, whole) = (place.channels("merged.exr"), place.channels("whole.exr"));
    assert!(merged.len() == whole.len() - 7 && merged.iter().all(|(name, values)| *values == whole[name]));
    place.assert_refused([
        ("repeat 1.exr", ["1.exr: holds a shard", "without --shard"]),
        ("repeat merged.exr", ["merged.exr: was put together by merge", ""]),
    ]);
    // Of two shards one has no parts.
    run("--rounds 16 --shard 1/2 --checkpoint 1.pms");
    place.succeed("merge 1.pms 2.pms -o merged.exr");
    assert!(place.channels("merged.exr").keys().all(|name| !name.starts_with("direct") && !name.starts_with("indirect")));
    run("--rounds 8 --checkpoint half.pms -o half.png");
    let (_, stderr) = run("--rounds 16 -o resumed.exr --resume half.pms");
    assert!(stderr.contains("warning: -o resumed.exr: has no layers of the parts") && stderr.contains("--resume"), "{stderr}");
    assert!(place.light("resumed.exr") == place.light("whole.exr"));
    // Three rounds are less than a block.
    run("--rounds 3 -o few.exr");
    let few = place.channels("few.exr");
    for (pixel, whole) in few["G"].iter().enumerate() {
        let sum: f64 = ["direct", "specular", "caustic", "indirect"].iter().map(|part| f64::from(few[&format!("{part}.G")][pixel])).sum();
        assert!((sum - f64::from(*whole)).abs() <= 3e-7 * f64::from(*whole), "pixel {pixel}: {sum}, {whole}");
    }
    assert!(few["indirect.G"].iter().any(|value| *value > 0.0));
}

#[test]
#[ignore = "long: kernels of indirect light alone"]
fn parts_of_less_than_a_block_are_those_that_are_asked_for_alone() {
    let Some(_) = device() else { return };
    let place = Place::new();
    place.succeed(&format!("render cornell --rounds 3 -o few.exr {SMALL}"));
    place.succeed(&format!("render cornell --rounds 3 --part indirect -o indirect.exr {SMALL}"));
    assert!(place.channels("few.exr")["indirect.G"] == place.light("indirect.exr")[1]);
}

/// A wall 4 m away; before it on the left, at 3 m, the back of another one, and on the right, at 2 m, one of which a quarter is there.
#[test]
fn what_is_seen_first_is_what_closed_forms_say() {
    let wall =
        |x: f64, z: f64, width: f64, material| Mesh::parallelogram("wall", dvec3(x, -2.0, z), width * DVec3::X, 4.0 * DVec3::Y, material);
    let mut turned = wall(-1.0, -3.0, 1.0, 1);
    turned.triangles.iter_mut().for_each(|triangle| triangle.reverse());
    let scene = scene_of(
        vec![wall(-2.0, -4.0, 4.0, 0), turned, wall(0.0, -2.0, 2.0, 2)],
        vec![
            Material { base_colour: vec3(0.2, 0.4, 0.6), ..matt(0.5) },
            Material { two_sided: true, ..matt(0.3) },
            Material { surface: Surface::Layered, coverage: Coverage::Blend { alpha: 0.25 }, ..matt(0.8) },
        ],
        vec![],
    );
    let camera = Camera::looking_at("eye", DVec3::ZERO, DVec3::NEG_Z, DVec3::Y, FRAC_PI_2);
    let seen = first_surfaces(&scene, &camera, (16, 16));
    let near = |a: DVec3, b: DVec3| (a - b).abs().max_element() < 1e-6;
    for (number, FirstSurface { albedo, normal, depth }) in seen.iter().enumerate() {
        let (x, y) = (((number % 16) as f64 + 0.5) / 8.0 - 1.0, 1.0 - ((number / 16) as f64 + 0.5) / 8.0);
        let along = dvec3(x, y, -1.0).length();
        let back = dvec3(0.2, 0.4, 0.6);
        // The back ends at -1/3, within a pixel.
        let (expected, metres) = match x {
            x if x > 0.0 => (0.25 * DVec3::splat(0.8) + 0.75 * back, 4.0),
            x if x > -0.3 => (DVec3::splat(0.3), 3.0),
            x if x > -0.37 => continue,
            _ => (back, 4.0),
        };
        // Near the walls' ends, 2 m to the side, a pixel sees both.
        if (metres * x).abs().max((metres * y).abs()) > 1.7 {
            continue;
        }
        assert!(near(*albedo, expected), "albedo at {x}, {y}: {albedo}, not {expected}");
        assert!(near(*normal, DVec3::Z), "normal at {x}, {y}: {normal}");
        assert!((depth - metres * along).abs() < 1e-6, "depth at {x}, {y}: {depth}, not {}", metres * along);
    }
    let corner = seen[0];
    assert_eq!((corner.albedo, corner.normal, corner.depth), (DVec3::ZERO, DVec3::ZERO, f64::INFINITY));
    // Behind itself a camera sees nothing, and an edge within a pixel shows in its mean: half of the four rays.
    let away = first_surfaces(&scene, &Camera::looking_at("eye", DVec3::ZERO, DVec3::Z, DVec3::Y, 1.0), (2, 2));
    assert!(away.iter().all(|seen| seen.depth == f64::INFINITY && seen.albedo == DVec3::ZERO));
    let one = scene_of(vec![wall(0.0, -1.0, 2.0, 0)], vec![matt(0.5)], vec![]);
    let half = first_surfaces(&one, &camera, (1, 1))[0];
    assert!(near(half.albedo, DVec3::splat(0.25)) && near(half.normal, 0.5 * DVec3::Z), "{half:?}");
}

#[test]
fn albedos_have_textures_and_normals_are_smooth() {
    let mut wall = Mesh::parallelogram("wall", dvec3(-1.0, -1.0, -1.0), 2.0 * DVec3::X, 2.0 * DVec3::Y, 0);
    wall.colours = vec![DVec3::splat(0.5); 4];
    let texture = row_of_texels(&[[255, 0, 0, 255], [0, 255, 0, 255]], Filter::Nearest);
    let red_and_green = Material { base_colour: Vec3::ONE, base_colour_texture: Some(TextureUse::of(0, 0)), ..matt(1.0) };
    let scene = Scene { textures: vec![texture], ..scene_of(vec![wall], vec![red_and_green], vec![]) };
    let camera = Camera::looking_at("eye", DVec3::ZERO, DVec3::NEG_Z, DVec3::Y, FRAC_PI_2);
    let seen = first_surfaces(&scene, &camera, (2, 2));
    assert_eq!([seen[0].albedo, seen[1].albedo], [dvec3(0.5, 0.0, 0.0), dvec3(0.0, 0.5, 0.0)]);
    // A ball of 1 m: normals point away from its centre.
    let ball = scene_of(vec![Mesh::sphere("ball", dvec3(0.0, 0.0, -3.0), 1.0, 64, 0)], vec![matt(0.5)], vec![]);
    let seen = first_surfaces(&ball, &camera, (33, 33));
    let middle = seen[16 * 33 + 16];
    assert!((middle.depth - 2.0).abs() < 3e-3 && (middle.normal - DVec3::Z).length() < 0.01, "{middle:?}");
    for (number, seen) in seen.iter().enumerate().filter(|(_, seen)| seen.depth < 2.3) {
        let way = dvec3(((number % 33) as f64 - 16.0) / 16.5, (16.0 - (number / 33) as f64) / 16.5, -1.0).normalize();
        let expected = (seen.depth * way - dvec3(0.0, 0.0, -3.0)).normalize();
        assert!((seen.normal - expected).length() < 0.03, "pixel {number}: {}, not {expected}", seen.normal);
    }
}

#[test]
fn files_say_how_they_were_made() {
    let Some(gpu) = device() else { return };
    let place = Place::new();
    place.succeed(&format!("render cornell --rounds 8 --seed 7 --samples 2 --exposure -1.5 --white-balance 3000 -o a.png {SMALL}"));
    place.succeed(&format!("render cornell --rounds 8 --seed 7 --samples 2 -o a.exr --json a.json {SMALL}"));
    let report = place.json("a.json");
    let [png, exr] = ["a.png", "a.exr"].map(|name| Metadata::read(&place.content(name)).unwrap());
    assert!(
        png.units.ends_with("exposure -1.50 stops, tone curve Khronos PBR Neutral, white balance 3000 K") && exr.units.contains("W/m2/sr"),
        "{}, {}",
        png.units,
        exr.units
    );
    for made in [&png, &exr] {
        assert_eq!((made.photonmill.as_str(), made.scene.as_str(), made.seed, made.rounds), (env!("CARGO_PKG_VERSION"), "cornell", 7, 8));
        assert_eq!(made.devices, [format!("{}, {}", gpu.facts().name, gpu.facts().driver)]);
        assert_eq!(made.scene_hash.as_ref().map(String::len), Some(64));
        assert_eq!((made.error, made.error_bound), (report["relative_error"].as_f64(), report["error_bound"].as_f64()));
        assert_eq!(made.settings["samples"], 2);
    }
    // The command makes the same picture.
    assert_eq!(exr.command, "photonmill render cornell --size 8x8 --photons 500 --rounds 8 --seed 7 --samples 2 -o picture.exr");
    let line = exr.command.strip_prefix("photonmill ").unwrap();
    place.succeed(&format!("{line} -q"));
    assert!(place.content("picture.exr") == place.content("a.exr"), "equal results are equal files");
    // What any reader of PNGs finds.
    let content = place.content("a.png");
    let reader = png::Decoder::new(std::io::Cursor::new(&content)).read_info().unwrap();
    let texts: BTreeMap<&str, &str> =
        reader.info().uncompressed_latin1_text.iter().map(|chunk| (chunk.keyword.as_str(), chunk.text.as_str())).collect();
    assert_eq!(texts["Software"], format!("photonmill {}", env!("CARGO_PKG_VERSION")));
    assert!(texts["Comment"].contains("Command: photonmill render cornell") && texts["Comment"].contains("\nSeed: 7\n"), "{texts:?}");
    assert!(texts["photonmill"].is_ascii());
    // The paper's box says it too, and its command makes it again.
    place.succeed("--photons 500 --rounds 3 --mesh 8 --reflectance 0.5 -o box.png -q");
    let made = Metadata::read(&place.content("box.png")).unwrap();
    assert_eq!(made.command, "photonmill --reflectance 0.5 --photons 500 --rounds 3 --mesh 8 -o picture.png");
    place.succeed(&format!("{} -q", made.command.strip_prefix("photonmill ").unwrap()));
    assert!(place.content("picture.png") == place.content("box.png"));
    let (said, _) = place.succeed("repeat box.png -o again.png -q");
    assert!(said.contains("box.png: repeated, all ") && place.content("again.png") == place.content("box.png"), "{said}");
    place.assert_refused([("repeat box.png --scene a.glb -q", ["--scene", "a.glb", "the paper's box"])]);
    // Nothing of where it was made.
    let folder = place.path().display().to_string();
    assert!(!texts.values().any(|text| text.contains(&folder)) && !format!("{:?}", exr.settings).contains(&folder));
}

/// The square by hand, matt and without lamps.
fn square_file() -> String {
    let mut file = crate::common::gltf_file::square();
    file["scenes"][0]["nodes"] = json!([0, 1]);
    file["materials"][0] = json!({
        "pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.25, 0.125, 1], "metallicFactor": 0},
        "extensions": {"KHR_materials_specular": {"specularFactor": 0}}
    });
    file["extensionsUsed"] = json!(["KHR_lights_punctual", "KHR_materials_specular"]);
    file.to_string()
}

/// With what a pilot chose, tiles that are put to it, a run that went on, and a scene of a file.
#[test]
fn pictures_are_made_again_to_the_bit() {
    let all = is_long_run();
    let Some(gpu) = device() else { return };
    let place = Place::new();
    if all {
        let error = if gpu.facts().kind == "cpu" { "12% --photons 1024 --caustic-photons 1024" } else { "3%" };
        place.succeed(&format!("render cornell-spheres --size 24x24 --error {error} -o piloted.exr -q"));
    } else {
        place.succeed("render cornell --size 16x16 --error 50% --photons 1024 --save-settings s.json -q");
        let mut chosen = place.json("s.json");
        chosen["tiles"] = vec!["0012"; 4].into();
        place.write("s.json", chosen.to_string());
        place.succeed("render cornell --size 16x16 --settings s.json --rounds 8 -o piloted.exr -q");
    }
    let filter = if all { "--filter tent" } else { "" };
    let Repeat::With { tiles, .. } = Metadata::read(&place.content("piloted.exr")).unwrap().repeat else { panic!("cannot be repeated") };
    assert!(tiles.is_some());
    place.write("a scene.gltf", square_file());
    // As many rounds as there is time for.
    let without = if all { "" } else { "--without indirect" };
    let of_file = format!("render 'a scene.gltf' -o file.png --time 0.2s --environment 0.5 {without} --tone linear --exposure 1 {SMALL}");
    place.succeed(&of_file);
    place.succeed(&format!("render cornell -o half.exr --rounds 8 {filter} --checkpoint half.pms {SMALL}"));
    // The last three are less than a block.
    place.succeed(&format!("render cornell -o resumed.exr --rounds 11 {filter} --resume half.pms {SMALL}"));
    if all {
        place.succeed("map cornell -o map.pm --photons 500 --rounds 8 -q");
        place.succeed("render cornell --map map.pm --rounds 4 -o mapped.png --size 8x8 -q");
    }
    for line in ["piloted.exr", "resumed.exr -o again.exr"].into_iter().chain(all.then_some("mapped.png")) {
        let (stdout, stderr) = place.succeed(&format!("repeat {line} -q"));
        assert!(stdout.contains(": repeated, all ") && stdout.contains("are identical"), "{line}: {stdout}");
        assert!(!stderr.contains("warning"), "{line}: {stderr}");
    }
    // A file that repeats says how, too.
    assert!(place.channels("again.exr") == place.channels("resumed.exr"));
    let [again, resumed] = ["again.exr", "resumed.exr"].map(|name| Metadata::read(&place.content(name)).unwrap());
    assert_eq!((&again.command, &again.repeat), (&resumed.command, &resumed.repeat));
    // The scene has moved.
    std::fs::create_dir(place.at("moved")).unwrap();
    std::fs::rename(place.at("a scene.gltf"), place.at("moved/scene.gltf")).unwrap();
    place.assert_refused([(on_device("repeat file.png -q"), ["file.png: is of the scene a scene.gltf, which is not there", "--scene"])]);
    let (stdout, _) = place.succeed("repeat file.png --scene moved/scene.gltf -o again.png -q");
    assert!(stdout.starts_with("file.png: repeated, all ") && stdout.contains("are identical"), "{stdout}");
    assert_eq!(png_codes(&place.content("again.png")), png_codes(&place.content("file.png")));
}

#[test]
fn what_cannot_be_made_again_is_refused() {
    let Some(_) = device() else { return };
    let place = Place::new();
    place.write("scene.gltf", square_file());
    place.succeed(&format!("render scene.gltf -o a.png --rounds 4 --environment 0.5 {SMALL}"));
    // Another scene of that name.
    place.write("scene.gltf", square_file().replace("[0.5,0.25,0.125,1]", "[0.5,0.25,0.25,1]"));
    // Without what it says, and without it as another version does.
    let codes = png_codes(&place.content("a.png")).unwrap();
    image::save_buffer(place.at("bare.png"), &codes, 8, 8, image::ColorType::Rgb8).unwrap();
    let own = format!("\"photonmill\":\"{}\"", env!("CARGO_PKG_VERSION"));
    place.succeed(&format!("render cornell --rounds 4 -o b.exr --layers none {SMALL}"));
    let content = place.content("b.exr");
    let exr = |from: &str, to: &str| {
        let at = content.windows(from.len()).position(|bytes| bytes == from.as_bytes()).unwrap();
        assert_eq!(from.len(), to.len());
        [&content[..at], to.as_bytes(), &content[at + from.len()..]].concat()
    };
    place.write("old.exr", exr(&own, &own.replace("\"0.", "\"9.")));
    place.write("sly.exr", exr("\"--size=8x8\"", "\"--json=b.j\""));
    place.write("wrong.exr", exr("\"--size=8x8\"", "\"--size=8y8\""));
    place.write("text.png", "no picture");
    place.assert_refused([
        (on_device("repeat a.png -q"), ["a.png: is of another scene than scene.gltf is now", "SHA-256", "--scene"].as_slice()),
        ("repeat bare.png".into(), &["bare.png: holds nothing of how it was made", "another program has saved it"]),
        ("repeat old.exr".into(), &["old.exr: was made by photonmill 9.", "only the same version"]),
        ("repeat sly.exr".into(), &["sly.exr: says otherwise", "decide no pixel"]),
        ("repeat wrong.exr".into(), &["wrong.exr: says otherwise", "8y8"]),
        ("repeat text.png".into(), &["text.png", "OpenEXR"]),
        ("repeat absent.png".into(), &["absent.png", "cannot be read"]),
        ("repeat a.jpg".into(), &["FILE a.jpg", "ends in .png or .exr"]),
        ("repeat a.png -o b.exr".into(), &["-o b.exr", "must be in the format of a.png"]),
        ("repeat a.png -o a.png".into(), &["-o a.png", "it is also read"]),
    ]);
    // A pixel was changed since: the values differ, and the exit code says so.
    let (size, mut channels) = exr_file::decode(&content).unwrap();
    let made = Metadata::read(&content).unwrap();
    channels[0].values[5] += 1.0;
    place.write("touched.exr", exr_file::encode(size, channels, Some(&made)));
    let output = place.run(&on_device("repeat touched.exr -q"));
    let stderr = text(&output.stderr);
    assert!(output.status.code() == Some(1) && stderr.contains("touched.exr: 1 of 192 values differ"), "{stderr}");
}

/// Blender's Python module and Mitsuba, which the tool installs.
#[test]
#[ignore = "installs Blender's Python module and Mitsuba"]
fn other_programs_find_all_layers() {
    let Some(_) = device() else { return };
    let tool = format!("{}/tools/open_pictures", env!("CARGO_MANIFEST_DIR"));
    let output = Command::new(tool).arg(crate::common::program::program()).output().expect("the tool starts");
    assert!(output.status.success(), "{}{}", text(&output.stdout), text(&output.stderr));
}
