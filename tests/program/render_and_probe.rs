//! `photonmill render`, `probe` and `plan` as their users meet them.

use std::fmt::Display;
use std::io::Write;
use std::process::Stdio;

use crate::common::gltf_file;
use crate::common::prelude::*;
use crate::common::program::{assert_says, on_device};
use photonmill::constants::RADIUS_CLASSES;
use photonmill::output::exr_file;
use serde_json::{Value, json};

const EFFECTS: &str = "direct indirect glossy layers transmission diffuse-transmission iridescence anisotropy media dispersion clear-coat sheen normal-maps alpha reflective-caustics \
    refractive-caustics specular-chains textures vertex-colours environment mesh-lights point-lights spot-lights directional-lights disc-lights bvh two-sided smooth-normals";
const BLENDER: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/scenes/blender.glb");
const TINY: &str = "--size 8x8 --photons 500 --rounds 2 --block 1";

/// A folder for runs on a device; `None` where `PHOTONMILL_NO_GPU=1` asks to go without.
fn place_with_device() -> Option<Place> {
    (!no_gpu()).then(Place::new)
}

/// `render` at a tiny size into a.exr, and its pixels.
fn exr(place: &Place, line: &str) -> Vec<f32> {
    place.succeed(&format!("render {line} {TINY} -o a.exr"));
    place.pixels("a.exr")
}

/// With nothing said of device and plan, refusals are all that is said.
fn assert_refused<'a>(place: &Place, cases: impl IntoIterator<Item = (impl Display, impl AsRef<[&'a str]>)>) {
    place.assert_refused(cases.into_iter().map(|(line, named)| (format!("{line} --quiet"), named)));
}

/// A white square of 2 m in the plane z = 0 that faces +z, under a bulb; `change` makes of it what a test needs.
fn square(change: impl FnOnce(&mut Value)) -> String {
    let mut value = gltf_file::square();
    value["scenes"][0]["nodes"] = json!([0, 1, 2, 3]);
    value["nodes"] = json!([
        {"name": "wall", "mesh": 0, "translation": [-1, -1, 0], "scale": [2, 2, 1]},
        {"name": "eye", "camera": 0, "translation": [0, 0, 2]},
        {"name": "side", "camera": 0, "translation": [0.5, 0, 1]},
        {"name": "bulb", "translation": [0, 0, 1], "extensions": {"KHR_lights_punctual": {"light": 0}}}
    ]);
    let no_gloss = json!({"KHR_materials_specular": {"specularFactor": 0}});
    value["materials"] = json!([{"pbrMetallicRoughness": {"metallicFactor": 0}, "extensions": no_gloss}]);
    value["extensionsUsed"] = json!(["KHR_lights_punctual", "KHR_materials_specular"]);
    value["extensions"]["KHR_lights_punctual"]["lights"] = json!([{"type": "point", "intensity": 683}]);
    change(&mut value);
    value.to_string()
}

fn srgb(linear: f32) -> f32 {
    let linear = linear.clamp(0.0, 1.0);
    255.0 * if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

#[test]
fn bad_options_are_refused_in_one_line() {
    let place = Place::new();
    place.write("scene.gltf", square(|_| {}));
    place.assert_values_refused(&[
        (
            "render cornell --quiet -o a.exr --size",
            "0x16, 0, 16x, x16, 16x16x16, 16*16, 65537x16, 1.5x2, -1x4, 65536x65536, 65536x32768",
            "pixels at most",
        ),
        ("plan cornell --quiet --size", "65536x65536", "pixels at most"),
        ("render cornell --quiet -o", "a.jpg", ".png or .exr"),
        ("render cornell --quiet -o a.exr --exposure", "1", "PNG"),
        ("render cornell --quiet -o a.png --exposure", "nan, 999", "64"),
        ("render cornell --quiet -o a.exr --error-image", "e.png", ".exr"),
        ("render cornell --quiet -o a.exr --camera", "nobody", "front"),
        ("render scene.gltf --quiet -o a.exr --camera", "nobody", "eye, side"),
        ("render cornell --quiet -o a.exr --with", "magic", "smooth-normals"),
        ("render cornell --quiet -o a.exr --without", "magic", "smooth-normals"),
        ("render cornell --quiet -o a.exr --part", "half", "caustic"),
        ("render cornell --quiet -o a.exr --photons", "0", "from 1 to"),
        ("render cornell --quiet -o a.exr --rounds", "0", "from 1 to"),
        ("render cornell --quiet -o a.exr --radius", "nan, 1000", "metres"),
        ("render cornell --quiet -o a.exr --alpha", "0", "above 0"),
        ("render cornell --quiet -o a.exr --environment", "red, 1,2", "or three separated by commas"),
        ("render cornell --quiet -o a.exr --environment", "nan, -1", "0 or more"),
        ("render cornell --quiet -o a.exr --device", "nonsense", "available: "),
        ("plan cornell --quiet --device", "nonsense", "available: "),
    ]);
    let cases: [(&str, &[&str]); 5] = [
        ("render cornell", &["--output"]),
        ("render cornell -o a.exr --size ''", &["--size"]),
        ("render cornell -o a.exr --json a.exr", &["--json", "-o writes it too"]),
        ("render cornell -o a.exr --with glossy --without direct,glossy", &["--without glossy", "--with"]),
        ("render cornell -o a.exr --alpha 0.5 --fixed-radius", &["--alpha", "--fixed-radius"]),
    ];
    assert_refused(&place, cases);
}

/// What a newcomer may have in place of a scene, and what to do about it.
#[test]
fn bad_scenes_are_refused_in_one_line() {
    let place = Place::new();
    std::fs::create_dir(place.at("folder.glb")).unwrap();
    let whole = std::fs::read(BLENDER).unwrap();
    place.write("cut.glb", &whole[..5000]);
    place.write("longer.glb", [&whole[..], b"more"].concat());
    place.write("empty.glb", "");
    place.write("noise.glb", [0xd5; 300]);
    place.write("pointer.glb", "version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 9\n");
    place.write("scene.blend", "BLENDER");
    place.write("apart.gltf", "{\"asset\":{\"version\":\"2.0\"},\"buffers\":[{\"byteLength\":36,\"uri\":\"absent.bin\"}]}");
    place.write("broken.gltf", "{");
    place.write(
        "lines.gltf",
        square(|v| {
            v["nodes"][0]["name"] = json!("a\nb");
            v["accessors"][0]["count"] = json!(99);
        }),
    );
    place.write("points.txt", "0.5 0 0.5 0 1 0");
    let cases: &[(&str, &[&str])] = &[
        ("absent.glb", &["photonmill: absent.glb: the file cannot be read", "no such file"]),
        ("cornel", &["SCENE cornel", "did you mean cornell? ", "cornell-spheres", ".gltf"]),
        ("", &["SCENE"]),
        ("scene.blend", &["scene.blend: must be a .gltf or .glb file", "File > Export"]),
        ("folder.glb", &["folder.glb", "is no file"]),
        (".", &["SCENE .", ".glb"]),
        ("cut.glb", &["cut.glb", "has 5000; it was cut off", "download it again"]),
        ("longer.glb", &["longer.glb", "behind its end", "export it again"]),
        ("empty.glb", &["empty.glb", "is empty", "export it again"]),
        ("noise.glb", &["noise.glb", "is no glTF", "neither JSON nor binary"]),
        ("pointer.glb", &["pointer.glb", "is no glTF", "git lfs pull"]),
        ("apart.gltf", &["apart.gltf", "absent.bin", "export a .glb"]),
        ("broken.gltf", &["broken.gltf"]),
        ("lines.gltf", &["lines.gltf", "mesh"]),
    ];
    for line in ["render SCENE -o a.exr --json a.json", "probe SCENE --points points.txt -o a.csv", "plan SCENE"] {
        assert_refused(&place, cases.iter().map(|(scene, named)| (line.replace("SCENE", &format!("'{scene}'")), named)));
    }
}

#[test]
fn bad_points_are_refused_with_their_line() {
    let place = Place::new();
    let good = "0.5 0 0.5 0 1 0\n";
    let cases: [(String, &[&str]); 9] = [
        (String::new(), &["no point"]),
        ("# nothing\n\n".into(), &["no point"]),
        (format!("{good}# five\n1 2 3 4 5\n"), &["line 3", "5 numbers"]),
        (format!("{good}1 2 3 4 5 6 7\n"), &["line 2", "7 numbers"]),
        (format!("{good}{good}nan 0 0 0 1 0\n"), &["line 3", "holds NaN", "from -1e15 to 1e15"]),
        ("0 0 inf 0 1 0".into(), &["line 1", "inf"]),
        ("0 0 1e16 0 1 0".into(), &["line 1", "1e15"]),
        (format!("{good}\n0 0 0 0 0 0\n"), &["line 3", "normal"]),
        ("x y z nx ny nz\n".into(), &["line 1", "'x'"]),
    ];
    for (content, named) in cases {
        place.write("points.txt", content);
        assert_refused(&place, [("probe cornell --points points.txt -o a.csv", [&["--points points.txt"], named].concat())]);
    }
    place.write("bytes.txt", [0xff, 0xfe, 0x00]);
    place.assert_values_refused(&[
        ("probe cornell --quiet -o a.csv --points", "absent.txt, ., bytes.txt", "cannot be read"),
        ("probe cornell --quiet -o a.csv --points", "-", "no point"),
    ]);
    assert_refused(&place, [("probe cornell -o a.csv", ["--points"])]);
}

/// Of a probe's table.
const PROBE_COLUMNS: &str = "red,green,blue,red_error,green_error,blue_error,degrees_of_freedom,confidence,\
    red_low,green_low,blue_low,red_high,green_high,blue_high,unseen";

/// A row a point in their order, from a file with comments and from standard input, the same to the bit.
#[test]
fn a_probe_writes_a_row_a_point() {
    let Some(place) = place_with_device() else { return };
    let points = "# floor, and above it\n0.5 0 0.5 0 1 0\n\n  0.5,0,0.5,0,7,0\n0.5\t0\t0.5\t0\t1\t0\n0.5 0 0.5 0 -1 0";
    // Some editors begin a file with a mark of the order of its bytes.
    place.write("points.txt", format!("\u{feff}{points}"));
    let run = "probe cornell --photons 500 --rounds 8 --block 1";
    place.succeed(&format!("{run} --points points.txt -o a.csv"));
    // The same table from standard input to standard output, and the report elsewhere.
    let mut child = place.command(&on_device(&format!("{run} --points - -o -")));
    let mut child = child.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
    child.stdin.take().unwrap().write_all(points.as_bytes()).unwrap();
    let output = child.wait_with_output().unwrap();
    let table = |name: &str| place.text(name);
    assert!(output.status.success() && text(&output.stdout) == table("a.csv") && !place.at("-").exists(), "{}", text(&output.stdout));
    let lines: Vec<String> = table("a.csv").lines().map(str::to_owned).collect();
    assert_eq!((lines.len(), lines[0].as_str()), (5, PROBE_COLUMNS));
    let rows: Vec<Vec<f64>> = lines[1..].iter().map(|line| line.split(',').map(|field| field.parse().unwrap()).collect()).collect();
    // Three random streams at one place, all near 5 W/m2, whatever the normal's length; nothing from below the floor.
    assert!(rows[..3].iter().all(|row| row.len() == 15 && row[..8].iter().all(|value| *value > 0.0)), "{rows:?}");
    // Eight blocks: seven degrees of freedom, of which Student's quantile is 2.365.
    for row in &rows[..3] {
        assert_eq!(row[6..8], [7.0, 0.95], "{row:?}");
        for channel in 0..3 {
            let (mean, half) = (row[channel], 2.36462 * row[3 + channel]);
            assert!((row[8 + channel] - (mean - half).max(0.0)).abs() + (row[11 + channel] - mean - half).abs() < 1e-4 * half, "{row:?}");
        }
    }
    assert!(rows[1..3].iter().all(|row| (row[0] / rows[0][0] - 1.0).abs() < 1.0), "{rows:?}");
    assert_eq!(rows[3][..3], [0.0; 3], "{rows:?}");

    // Of one round no error is known, nor of seven blocks.
    for (rounds, freedom) in [(1, 0), (7, 6)] {
        let (report, _) = place.succeed(&format!("probe cornell --points points.txt --rounds {rounds} --block 1 --photons 500 -o c.csv"));
        let row: Vec<String> = table("c.csv").lines().nth(1).unwrap().split(',').map(str::to_owned).collect();
        assert_eq!(row[3..14].join(","), format!("inf,inf,inf,{freedom},0.95,0,0,0,inf,inf,inf"), "{}", table("c.csv"));
        assert!(report.contains("noise: unknown"), "{report}");
    }
}

#[test]
fn an_exr_is_linear_and_a_png_obeys_its_exposure() {
    let Some(place) = place_with_device() else { return };
    let linear = exr(&place, "cornell --without indirect");
    let exr = place.picture("a.exr");
    assert!(matches!(exr, image::DynamicImage::ImageRgb32F(_)), "{:?}", exr.color());
    // The lamp's own radiance stands in it, far above what a screen shows.
    assert!(linear.iter().any(|value| *value > 1.0) && linear.iter().all(|value| value.is_finite() && *value >= 0.0));
    let png = |options: &str| {
        let (stdout, _) = place.succeed(&format!("render cornell --without indirect {TINY} -o a.png {options}"));
        assert!(stdout.contains("wrote a.png at ") && stdout.contains("stops"), "{stdout}");
        place.picture("a.png").into_rgb8().into_raw()
    };
    let [_, cut] = ["-2", "3.5"].map(|stops| {
        let png = png(&format!("--exposure {stops} --tone linear"));
        let factor = stops.parse::<f32>().unwrap().exp2();
        for (code, value) in pairs(&png, &linear) {
            assert!((f32::from(*code) - srgb(value * factor)).abs() <= 0.51, "{stops} stops: {code} for {value}");
        }
        png
    });
    // By the tone curve the lamp is white, and not cut off at the same value as its surroundings.
    let white = |png: &[u8]| png.iter().filter(|code| **code == 255).count();
    assert!(white(&png("--exposure 3.5")) < white(&cut));
    // Left alone, it is neither dark nor burnt out.
    let usual = png("");
    let mean = usual.iter().map(|code| f64::from(*code)).sum::<f64>() / usual.len() as f64;
    assert!((40.0..200.0).contains(&mean), "{mean}");
}

/// A camera by its name, what lights emit in their own units, and a triangle without area that is left out with a warning.
#[test]
fn a_file_is_seen_as_its_options_say() {
    let Some(place) = place_with_device() else { return };
    place.write("scene.gltf", square(|_| {}));
    let with_flat_triangle = square(|v| {
        gltf_file::set_buffer(v, &[gltf_file::square_buffer(), vec![1, 0, 1, 0, 2, 0]].concat());
        (v["bufferViews"][3]["byteLength"], v["accessors"][3]["count"]) = (json!(18), json!(9));
    });
    place.write("flat.gltf", with_flat_triangle);
    let (_, stderr) = place.succeed(&format!("render flat.gltf --without indirect {TINY} -o flat.exr --radiometric --quiet"));
    assert!(stderr.contains("warning: 1 triangle without area left out") && stderr.lines().count() == 1, "{stderr}");
    let lumens = exr(&place, "scene.gltf --camera eye --without indirect");
    assert!(lumens.iter().any(|value| *value > 0.1));
    for (watt, lumen) in pairs(&place.pixels("flat.exr"), &lumens) {
        assert!((watt - 683.0 * lumen).abs() <= 1e-4 * watt, "{watt} W, {lumen} lm");
    }
    assert_ne!(exr(&place, "scene.gltf --camera side --without indirect"), lumens);
    // 1 W/sr from 1 m on a white wall, seen in the middle: 1 / pi, and 3 % less within a pixel of it.
    let middle = lumens[3 * (8 * 4 + 4)];
    assert!((middle * std::f32::consts::PI - 0.97).abs() < 0.06, "{middle}");
}

/// Of a camera of 2 : 1, whole or as wide or as large as is asked for; the vertical field of view is kept.
#[test]
fn a_picture_has_the_aspect_of_its_camera() {
    let place = Place::new();
    let with_aspect = |aspect: f64| square(|v| v["cameras"][0]["perspective"]["aspectRatio"] = json!(aspect));
    place.write("wide.gltf", with_aspect(2.0));
    place.write("open.gltf", square(|_| {}));
    place.write("wrong.gltf", with_aspect(-1.0));
    for (line, size, said) in [
        ("wide.gltf", "784 x 392", ""),
        ("wide.gltf --size 640", "640 x 320", ""),
        ("wide.gltf --size 640x480", "640 x 480", "vertical field of view is kept"),
        ("cornell", "554 x 554", ""),
        ("open.gltf", "640 x 480", ""),
        ("wrong.gltf", "640 x 480", "aspect ratio"),
    ] {
        let (table, stderr) = place.succeed(&format!("plan {line}"));
        assert!(table.contains(&format!("\n{size} pixels\n")), "{line}: {table}");
        assert!(stderr.contains(said) && (!said.is_empty() || !stderr.contains("note")), "{line}: {stderr}");
    }
}

/// Effect and whether it was kept, of each row of a table.
fn rows_of(table: &str) -> Vec<(String, bool)> {
    table
        .lines()
        .filter_map(|line| {
            let mut words = line.split_whitespace();
            let (name, verb) = (words.next()?, words.next()?);
            (EFFECTS.split(' ').any(|effect| effect == name) && ["kept", "dropped"].contains(&verb))
                .then(|| (name.to_owned(), verb == "kept"))
        })
        .collect()
}

const FORCED: &str = "--with glossy,textures";
const LEFT_OUT: &str = "--without mesh-lights --illumination photons";

#[test]
fn tables_and_json_show_one_plan_with_a_row_an_effect() {
    let cases = [("cornell", [FORCED, LEFT_OUT]), (BLENDER, [LEFT_OUT, FORCED])];
    let place = Place::new();
    for (scene, all_options) in cases {
        for options in &all_options[..of_run(1, 2)] {
            let (table, _) = place.succeed(&format!("plan {scene} {options}"));
            let (json, _) = place.succeed(&format!("plan {scene} --json {options}"));
            let json: Value = serde_json::from_str(&json).unwrap();
            let rows = rows_of(&table);
            assert!(rows.iter().map(|(name, _)| name.as_str()).eq(EFFECTS.split(' ')), "{table}");
            for (row, (name, kept)) in pairs(json["effects"].as_array().unwrap(), &rows) {
                assert_eq!((&row["effect"], &row["kept"]), (&json!(name), &json!(kept)), "{table}");
                let evidence = row["evidence"].as_str().unwrap();
                let line = table.lines().find(|line| line.starts_with(&format!("{name} "))).unwrap();
                assert!(!evidence.is_empty() && line.ends_with(evidence), "{line}");
                for number in ["photons", "bytes"].map(|field| row[field].as_u64().unwrap()).iter().filter(|number| **number > 0) {
                    assert!(line.split_whitespace().any(|word| word == number.to_string()), "{number}: {line}");
                }
            }
            assert!(table.contains(&format!("{} bytes of device memory", json["bytes"])), "{table}");
            assert_eq!(table.matches(" photons per round in ").count(), json["maps"].as_array().unwrap().len(), "{table}");
        }
    }
}

/// Photons and bytes of a trace's spans, and their rates, against the ledgers of the run.
fn assert_trace_counts(trace: &Value, report: &Value) {
    let ledgers = &report["ledgers"];
    let spans: Vec<&Value> = trace["traceEvents"].as_array().unwrap().iter().filter(|event| event["ph"] == "X").collect();
    let sum = |path: &str, count: &str| -> u64 {
        let of_path = spans.iter().filter(|span| span["args"]["path"] == path);
        of_path.map(|span| span["args"][count].as_u64().unwrap_or(0)).sum()
    };
    for map in ["global", "caustic"] {
        let ledger = |fate: &str| ledgers[map][fate].as_u64().unwrap();
        for pass in ["", "/trace"] {
            assert_eq!(sum(&format!("round/{map}{pass}"), "photons"), ledger("emitted"), "{map}{pass}");
        }
        // Each grid of a map has all of its photons.
        let sorted = ["/index", "/index/count", "/index/sort", "/gather"].map(|pass| sum(&format!("round/{map}{pass}"), "stored_photons"));
        // Where photons are traced to their end in one go, only the device knows how many are in a map.
        if sorted == [0; 4] && !report["device"].as_str().unwrap().contains("llvmpipe") {
            continue;
        }
        let grids = sorted[0] / ledger("stored").max(1);
        assert!(sorted == [grids * ledger("stored"); 4] && (1..=RADIUS_CLASSES.into()).contains(&grids), "{map}: {sorted:?}");
        assert!(sum(&format!("round/{map}/gather"), "bytes") > 0, "{map}");
        // Two photons of 32 bytes, and a place.
        assert_eq!(sum(&format!("round/{map}/index/sort"), "bytes"), 68 * sorted[0]);
    }
    let passes = ["set-up", "round", "round/visible points", "round/flux to radiance", "round/resolve"];
    assert!(passes.iter().all(|pass| sum(pass, "bytes") > 0), "{passes:?}: {:?}", passes.map(|pass| sum(pass, "bytes")));
    for span in spans {
        let (arguments, microseconds) = (&span["args"], span["dur"].as_f64().unwrap());
        let rates = [("photons", "photons_per_second", 1e6), ("bytes", "gigabytes_per_second", 1e-3)];
        for (count, rate, unit) in rates.into_iter().filter(|(count, ..)| !arguments[*count].is_null() && microseconds > 0.0) {
            let expected = arguments[count].as_f64().unwrap() * unit / microseconds;
            assert!((arguments[rate].as_f64().unwrap() / expected - 1.0).abs() < 1e-9, "{span}");
        }
    }
}

#[test]
fn a_run_explains_itself_and_its_report_closes() {
    let Some(place) = place_with_device() else { return };
    let run = format!("render cornell-spheres {TINY} -o a.exr --explain --json a.json --trace t.json");
    let (stdout, _) = place.succeed(&run);
    assert!(rows_of(&stdout).iter().map(|(name, _)| name.as_str()).eq(EFFECTS.split(' ')), "{stdout}");
    assert_says(&stdout, ["GPU ms", "light", "evidence", "noise: ", "global ledger: ", "caustic ledger: ", "wrote a.exr"]);
    let report = place.json("a.json");
    let ledgers = ["global", "caustic"].map(|map| &report["ledgers"][map]);
    for ledger in ledgers {
        let count = |fate: &str| ledger[fate].as_u64().unwrap();
        assert_eq!(count("emitted"), count("absorbed") + count("escaped") + count("cut_off") + count("dropped"), "{ledger}");
        assert_eq!((count("emitted"), count("dropped")), (1000, 0), "{ledger}");
    }
    assert_eq!((&report["rounds"], &report["end"]), (&json!(2), &json!("rounds")));
    let film = &report["film"];
    assert_eq!((&film["nonfinite_values"], &film["uncorrected_estimates"]), (&json!(0), &json!(0)));
    // Points of each map, by the classes of their radii: all that are seen.
    let points = |map: usize| film["radius_classes"][map].as_array().unwrap().iter().map(|count| count.as_u64().unwrap()).sum::<u64>();
    assert!(points(0) == points(1) && (50..=64).contains(&points(0)), "{film}");
    let settings = &report["settings"];
    assert_eq!(
        (&settings["bounces"], &settings["builder"], &report["nonfinite_values"]),
        (&Value::Null, &json!("persistent"), &Value::Null)
    );
    assert!(stdout.contains(": 2 rounds of ") && !stdout.contains("(s)"), "{stdout}");
    let timings = report["timings"].as_array().unwrap();
    for name in ["round", "round/visible points", "round/global", "round/caustic", "round/resolve"] {
        let row = timings.iter().find(|row| row["name"] == name).unwrap_or_else(|| panic!("no {name}: {timings:?}"));
        assert!(row["count"] == 2 && row["gpu_ms"].as_f64().unwrap() > 0.0, "{row}");
    }
    let effects = report["plan"]["effects"].as_array().unwrap();
    let shares = ["direct", "specular-chains", "refractive-caustics", "indirect"];
    let share = |name: &str| effects.iter().find(|row| row["effect"] == name).unwrap()["share"].as_f64().unwrap();
    assert!((shares.iter().map(|name| share(name)).sum::<f64>() - 1.0).abs() < 1e-9, "{effects:?}");
    assert_trace_counts(&place.json("t.json"), &report);

    // What is not asked for is not printed; one round knows no error and still is JSON.
    let (stdout, _) = place.succeed("render cornell --size 4x4 --photons 10 --rounds 1 --bounces 9 --paranoid -o a.png --json b.json");
    assert!(rows_of(&stdout).is_empty() && stdout.contains("unknown after a single round"), "{stdout}");
    let report = place.json("b.json");
    assert!(report["relative_error"].is_null());
    assert_eq!((&report["settings"]["bounces"], &report["nonfinite_values"]), (&json!(9), &json!({"count": 0, "first": []})));
}

#[test]
fn effects_are_forced_and_left_out_by_name() {
    let Some(place) = place_with_device() else { return };
    let reference = exr(&place, "cornell");
    assert_eq!(exr(&place, "cornell --with glossy --with textures"), reference);
    let run = format!("render cornell {TINY} -o a.exr --without indirect --without glossy");
    for line in [run.as_str(), "plan cornell --without indirect,glossy"] {
        let (stdout, _) = place.succeed(line);
        let line = stdout.lines().find(|line| line.contains("left out") && !line.starts_with("indirect"));
        assert!(line.is_some_and(|line| line.contains("indirect") && !line.contains("glossy")), "{stdout}");
    }
    assert_ne!(place.pixels("a.exr"), reference);
}

/// A white wall under an even sky is as bright as the sky. The camera is twice as wide as high, and so is its picture.
#[test]
fn a_scene_without_light_has_a_sky_and_a_line_says_so() {
    let skies: [(&str, [f32; 3]); 5] = [
        ("--without indirect", [1.0; 3]),
        ("--without indirect --environment 2,1,0.5", [2.0, 1.0, 0.5]),
        ("", [1.0; 3]),
        ("--environment 2,1,0.5", [2.0, 1.0, 0.5]),
        ("--environment 0", [0.0; 3]),
    ];
    let Some(place) = place_with_device() else { return };
    let dark = square(|v| {
        v["scenes"][0]["nodes"] = json!([0, 1]);
        v["cameras"][0]["perspective"]["aspectRatio"] = json!(2);
    });
    place.write("dark.gltf", dark);
    for (options, sky) in &skies[..of_run(2, 5)] {
        let (_, stderr) = place.succeed(&format!("render dark.gltf --size 16 --photons 500 --rounds 2 -o a.exr {options}"));
        assert_eq!(
            stderr.matches("nothing in this scene emits light").count(),
            usize::from(!options.contains("--environment")),
            "{stderr}"
        );
        let picture = place.picture("a.exr").into_rgb32f();
        assert_eq!(picture.dimensions(), (16, 8));
        for (channel, sky) in sky.iter().enumerate() {
            let mean = picture.pixels().map(|pixel| pixel.0[channel]).sum::<f32>() / 128.0;
            assert!((mean - sky).abs() <= 0.05 * sky, "channel {channel}: {mean} of {sky}");
        }
    }
}

#[test]
fn a_scene_without_a_camera_is_seen_whole() {
    let Some(place) = place_with_device() else { return };
    place.write("scene.gltf", square(|v| v["scenes"][0]["nodes"] = json!([0, 3])));
    let pixels = exr(&place, "scene.gltf");
    let is_lit = |i: usize, j: usize| pixels[3 * (8 * j + i)] > 0.0;
    assert!(is_lit(4, 4), "the middle is dark");
    assert!((0..8).all(|k| !is_lit(k, 0) && !is_lit(k, 7) && !is_lit(0, k) && !is_lit(7, k)), "the wall is cut off");
    assert_refused(&place, [("render scene.gltf -o b.exr --camera eye", ["--camera eye", "none"])]);
}

/// What a run of a file from Blender says that it keeps.
fn assert_blender_is_whole((stdout, stderr): (String, String)) {
    assert!(!stderr.contains("has no light"), "{stderr}");
    let kept: Vec<String> = rows_of(&stdout).into_iter().filter(|(_, kept)| *kept).map(|(name, _)| name).collect();
    for effect in ["textures", "point-lights", "spot-lights", "directional-lights", "mesh-lights", "refractive-caustics", "bvh"] {
        assert!(kept.iter().any(|name| name == effect), "{effect}: {kept:?}");
    }
}

#[test]
fn a_blender_file_is_planned_with_all_that_it_holds() {
    let place = Place::new();
    assert_blender_is_whole(place.succeed(&format!("plan {BLENDER}")));
}

/// Whose parts add up to the whole, as those of matt walls, mirrors and glass do in tests/files/picture_files.rs.
#[test]
#[ignore = "long: kernels of all that the file holds"]
fn a_blender_file_renders_with_all_that_it_holds() {
    let Some(place) = place_with_device() else { return };
    assert_blender_is_whole(place.succeed(&format!("render {BLENDER} {TINY} -o a.exr --explain --camera eye")));
    let (_, channels) = exr_file::decode(&std::fs::read(place.at("a.exr")).unwrap()).unwrap();
    let channels: BTreeMap<String, Vec<f32>> = channels.into_iter().map(|channel| (channel.name, channel.values)).collect();
    for channel in ["R", "G", "B"] {
        let whole = &channels[channel];
        assert!(whole.iter().all(|value| value.is_finite()) && whole.iter().filter(|value| **value > 0.0).count() > 20);
        for (pixel, value) in whole.iter().enumerate() {
            let sum: f32 =
                ["direct", "specular", "caustic", "indirect"].map(|part| channels[&format!("{part}.{channel}")][pixel]).iter().sum();
            assert!((sum - value).abs() <= 1e-6 * value.max(1e-3), "{channel} of pixel {pixel}: {sum} instead of {value}");
        }
    }
}

/// Results are of texels here, not of points.
#[test]
fn a_bake_speaks_of_texels() {
    let Some(place) = place_with_device() else { return };
    let (stdout, stderr) = place.succeed("bake cornell -o b --texels-per-metre 2 --photons 50 --rounds 1");
    assert!(stderr.contains(" texels; 1 round of 50 global photons"), "{stderr}");
    assert!(stdout.contains(" texels where some may arrive"), "{stdout}");
}

/// A plan needs a device's limits, not the device; a picture needs the device and says so.
#[test]
fn without_vulkan_a_scene_is_planned_but_not_rendered() {
    let place = Place::new();
    assert!(place.run_without_vulkan("plan cornell").status.success());
    let refused = place.run_without_vulkan("render cornell -o a.exr --quiet");
    let stderr = text(&refused.stderr);
    assert!(!refused.status.success() && stderr.lines().count() == 1 && stderr.contains("no Vulkan device"), "{stderr}");
    assert!(stderr.contains("install") && stderr.contains("driver"), "{stderr}");
    assert!(!place.at("a.exr").exists());
}

/// The mean of a picture of a square wall without lamps.
fn mean_of_dark(place: &Place, options: &str) -> [f32; 3] {
    place.write("dark.gltf", square(|v| v["scenes"][0]["nodes"] = json!([0, 1])));
    place.succeed(&format!("render dark.gltf --without indirect {TINY} -o a.exr {options}"));
    let pixels = place.pixels("a.exr");
    [0, 1, 2].map(|channel| pixels.iter().skip(channel).step_by(3).sum::<f32>() / 64.0)
}

/// A wall that faces the sun: 100 klx and less, of which a white wall returns 1 / pi, over 683 lm/W; half of that.
#[test]
#[ignore = "long: kernels of a sun and its sky; `tests/light/skies.rs` has skies with one"]
fn a_sun_by_its_options_lights_a_wall() {
    let Some(place) = place_with_device() else { return };
    let bright = mean_of_dark(&place, "--sun 180,30 --environment-strength 0.5")[1];
    assert!((13.0..33.0).contains(&bright), "{bright}");
}

/// A picture of the sky by its options, and what is said of wrong ones.
#[test]
fn a_picture_of_the_sky_is_turned_scaled_and_refused() {
    let Some(place) = place_with_device() else { return };
    let sky = image::Rgb32FImage::from_fn(8, 4, |i, _| image::Rgb(if i < 4 { [4.0, 0.0, 1.0] } else { [0.0, 2.0, 1.0] }));
    sky.save(place.at("sky.exr")).unwrap();
    // The wall faces +z, the middle of the right half, and sees no more than that half.
    let found = mean_of_dark(&place, "--environment sky.exr --environment-rotate 180 --environment-strength 0.5");
    let is_near = pairs(found, [1.975, 0.025, 0.5]).all(|(found, expected)| (found - expected).abs() < 0.12 + 0.05 * expected);
    assert!(is_near, "{found:?}");
    let (table, _) = place.succeed("plan dark.gltf --sun 180,30 --environment-strength 0.5");
    let kept = rows_of(&table);
    for effect in ["environment", "directional-lights"] {
        assert!(kept.contains(&(effect.to_owned(), true)), "{effect}: {table}");
    }
    std::fs::write(place.at("text.hdr"), "no picture").unwrap();
    let cases = [
        ("--environment none.exr", "none.exr"),
        ("--sun 30", "AZIMUTH,ELEVATION"),
        ("--sun 30,-5", "above 0"),
        ("--environment text.hdr", "--environment text.hdr: is neither a Radiance (.hdr) nor an OpenEXR (.exr)"),
        ("--environment sky.jpg", ".hdr or .exr"),
        ("--environment 1 --environment-rotate 5", "turns a picture"),
        ("--environment sky.exr --environment-strength -1", "must be 0 to 1e9"),
        ("--environment inf", "0 or more and finite"),
        ("--environment 3e38", "must be at most 1e30 W/m2/sr"),
        ("--environment 1e29 --environment-strength 100", "must be at most 1e30 W/m2/sr"),
        ("--environment sky.exr --environment-strength 1e9 --sun 30,inf", "the elevation above 0"),
        ("--sun 30,20 --environment-rotate 90", "change the azimuth of --sun"),
        ("--aperture -1", "must be 0 to 1e6 metres"),
        ("--aperture inf", "must be 0 to 1e6 metres"),
        ("--aperture 0.1 --focus 0", "above 0"),
        ("--aperture 0.1 --focus inf", "at most 1e12 metres, which is as good as infinity"),
        ("--at 1", "has none"),
    ];
    place.assert_refused(cases.map(|(options, words)| (format!("render dark.gltf {TINY} -o b.exr {options}"), [words])));
}
