//! The program as a user meets it: refusals in one line with exit code 2, outputs whole or not at
//! all, help, progress, the CPU builder where there is no Vulkan, and Ctrl-C.

use crate::common::prelude::*;
use crate::common::program::{assert_says, entries, validated, without_vulkan};
use serde_json::Value;

/// The bias is measured before the run, so that one line says what is being done and the last one that it was in vain.
#[test]
fn an_error_below_the_bias_is_refused() {
    let place = Place::new();
    let output = place.run("--error 2% --bias --radius 0.2 --mesh 8 --variant cpu");
    let stderr = text(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{stderr}");
    let [_device, _plan, measuring, refused] = stderr.lines().collect::<Vec<_>>()[..] else { panic!("four lines expected: {stderr}") };
    assert!(measuring.contains("measuring the bias"), "{stderr}");
    assert!(refused.starts_with("photonmill: --error 2%") && refused.contains("a smaller --radius"), "{stderr}");
    assert!(output.stdout.is_empty(), "{}", text(&output.stdout));
    assert_eq!(place.names(), Vec::<String>::new());
}

/// Refusals name the value as it was typed, not what was made of it, and say what is allowed.
#[test]
fn bad_input_is_refused_in_one_line() {
    let place = Place::new();
    // Options, values as they may be typed, and what is allowed.
    place.assert_values_refused(&[
        ("--photons", "0, 00, -5, 5000000000", "from 2 to 2147483648"),
        ("--photons", "many", "whole number"),
        ("--rounds", "0, 000, -3, 5000000000", "from 1 to 4294967295"),
        ("--bounces", "0, 010001, -99999999999999999999999999999999999999999", "from 1 to 10000"),
        ("--bounces", "99999999999999999999999999999999999999999", "from 1 to 10000"),
        ("--mesh", "01025", "from 1 to 1024"),
        ("--threads", "0, 00, -3", "from 1 to 1024"),
        ("--seed", "-1", "from 0 to 18446744073709551615"),
        ("--seed", "4294967296, 04294967296", "4294967295"),
        ("--radius", "0, 0.51, 0.50100, -0.1, nan, inf", "0.5 metres"),
        // By the grid, which is the usual one.
        ("--nearest", "5, 05", "--gather kdtree"),
        ("--full-light", "0, 1e-0013", "from 1e-12"),
        ("--shininess", "-1, -1.0, nan", "0 or more"),
        ("--shininess", "1,2", "left,right,floor,ceiling,back"),
        ("--reflectance", "1.1, 1.10", "0 to 1"),
        ("--light-power", "1,-1, 1.0,1e-13", "from 1e-12"),
        ("--light-power", "1,1e-9", "a millionth of the total power"),
        ("--light-power", "1e308,1e308", "1e12"),
        ("--light-radius", "0.3, .3", "0.25"),
        ("--variant", "atomik", "did you mean atomic? must be one of naive, atomic, ballot, group, scan, persistent, cpu, auto"),
        ("--rng", "dice", "rand48, mt, philox, sobol"),
        ("--sums", "double", "integer, f32, compensated"),
        ("--group-size", "48, 048", "power of two"),
        ("--counters", "3, 03", "power of two up to 64"),
        ("--chunk", "1, 01", "from 2"),
        ("--device", "no such card, 999", "available: "),
        ("--device", "", "must match exactly one Vulkan device; available: "),
        ("--eye", "0,0,1e20, 0,0,1e+20", "from -1e15"),
        ("--error", "0%, -1%, -0.5, 1e-5 %", "0.0001 %"),
        ("--error", "few", "per cent"),
        ("--confidence", "10%, 0.95%, -5%", "50 %"),
        ("--confidence", "0.95", "did you mean 95% or 0.95%?"),
        ("--time", "0s, -1m, 0.1ms", "1ms"),
        ("--total-photons", "0, 00", "must be 1 or more"),
        ("--gather kdtree --nearest", "1, 1025", "from 2 to 1024"),
        ("--gather kdtree --nearest", "some", "whole number"),
        ("--gather kdtree --nearest 9 --chunk", "100", "--photons 5000 or more"),
        ("--rng mt --bounces", "75", "74"),
        ("--photons 2147483648 --rounds 3 --rng", "sobol", "philox"),
        ("--photons 2147483648 --rounds 100000 --rng", "rand48", "philox"),
        ("--photons 2147483648 --rng philox --rounds", "100000", "fewer"),
        ("--variant cpu --device", "0", "leave one"),
        ("--irradiance i --reflectance", "0", "above 0"),
        ("render cornell -o a.png --rounds", "-3", "from 1 to 1048576"),
        ("render cornell -o a.png --samples", "03", "power of two"),
        ("render cornell -o a.png --shadow-rays", "065", "from 1 to"),
        ("render cornell -o a.png --alpha", "1.50", "at most 1"),
        ("render cornell -o a.png --radius", "-1e-1", "above 0"),
        ("render cornell -o a.png --caustic-radius", "-0.0", "above 0"),
        ("render cornell -o a.png --exposure", "1e3", "from -64 to 64"),
        ("render cornell -o a.png --white-balance", "1000", "from 1667 to 25000 K"),
        ("render cornell -o a.exr --white-balance", "3000", "is for PNG only"),
        ("render cornell -o a.png --judge", "01", "from 2 to"),
        ("render cornell -o a.png --error", "200.0%", "to 100 %"),
        ("render cornell -o a.png --size", "-16x16", "from 1 to 65535"),
        ("study cornell -o s --seed", "-1", "from 0 to 4294966295"),
        ("study cornell -o s --budget", "0.1s", "from 1s"),
        ("study cornell -o s --side", "01", "from 2 to 1024"),
        ("study cornell -o s --repeats", "01", "from 2 to 1000"),
        ("bench --time", "-1h", "from 1s"),
        ("compare a.exr b.exr --errors-a a.exr --fail-above", "-00.5", "0 % or more"),
        ("compare a.exr b.exr --errors-a a.exr --error-blocks", "01", "from 2 to"),
        ("gallery -o g --quiet --size", "0", "from 1 to"),
        ("gallery -o g --quiet --error", "nonsense", "per cent"),
        ("gallery -o g --quiet --device", "no-such-device", "available: "),
        ("paper -o p --large", "05000", "from 5001 to"),
        ("paper -o p --repeats", "01001", "from 1 to 1000"),
        ("paper --out p --longest", "0s, -90ms", "above 0"),
    ]);
    // Arguments, and what the line must name: option, value, what is allowed.
    let cases: [(&str, [&str; 3]); 21] = [
        ("--validate --variant cpu", ["--validate", "on", "leave one"]),
        ("-o new.png/", ["-o", "new.png", "folder"]),
        ("-o /proc/a.png", ["-o /proc/a.png", "no file can be made there", ""]),
        ("--json x --trace x", ["--trace x", "--json", "writes it too"]),
        ("-o d.png --json ./d.png", ["./d.png", "-o", "writes it too"]),
        ("--irradiance i --radiosity i", ["--radiosity", "left.exr", "--irradiance writes it too"]),
        ("--irradiance . --json layout.json", ["layout.json", "--json", "writes it too"]),
        ("-o absent/a.png", ["-o", "absent/a.png", "folder"]),
        ("-o a.jpg", ["-o", "a.jpg", ".png or .exr"]),
        ("--irradiance /dev/null/x", ["--irradiance", "/dev/null/x", "cannot be written"]),
        ("--colour", ["--colour", "no such option", "--help"]),
        ("bakery", ["bakery", "no such command", "--help"]),
        ("paper", ["--out", "required", "photonmill paper -o paper"]),
        ("render cornell", ["required", "--output <FILE>", "photonmill render cornell-spheres -o picture.png"]),
        ("render", ["--output <FILE> and <SCENE>", "photonmill render cornell-spheres", "-o picture.png"]),
        ("--size 64", ["--size", "is an option of render, view, plan and gallery;", "photonmill render --help"]),
        ("devices --points p", ["--points", "is an option of probe", "--help"]),
        ("render cornell -o a.png --mesh 8", ["--mesh", "is an option of photonmill without a command", "photonmill --help"]),
        ("probe cornell --points p -o - --json -", ["--json -", "-o - already is standard output", "name a file"]),
        ("--photons 5 render cornell -o a.png", ["render", "options stand after the command", "--photons"]),
        ("bake cornell -o -", ["-o -", "standard output", "several files"]),
    ];
    place.assert_refused(cases);
}

#[test]
fn the_check_of_refusals_complains() {
    let place = Place::new();
    assert!(place.refusal("--version").unwrap_err().contains("ends with Some(0)"));
    let unnamed = std::panic::catch_unwind(|| place.assert_refused([("--photons 0", ["--photons"]), ("--photons 0", ["--rounds"])]));
    assert!(unnamed.unwrap_err().downcast_ref::<String>().unwrap().contains("must name \"--rounds\""));
    let other_limit =
        std::panic::catch_unwind(|| place.assert_values_refused(&[("--photons", "0", "from 2"), ("--photons", "0", "from 3")]));
    assert!(other_limit.unwrap_err().downcast_ref::<String>().unwrap().contains("must name \"from 3\""));
}

#[test]
fn a_run_writes_everything_it_was_asked_for() {
    let place = Place::new();
    // Folders are made where results are written.
    let line = "--variant scan -o a.exr --json a.json --trace t.json --irradiance walls/irradiance --radiosity walls/radiosity";
    let (stdout, _) = place.succeed(&validated(line));
    assert!(stdout.contains(": 1 round of 5000 photons, ") && !stdout.contains("(s)"), "{stdout}");
    // What the driver repeats of the device's name is left out.
    let device: Vec<&str> = stdout.lines().next().unwrap().split([' ', ',', '(', ')']).filter(|word| !word.is_empty()).collect();
    assert!((1..device.len()).all(|word| !device[..word].contains(&device[word])), "{device:?}");
    // The CPU builder takes a photon through all its bounces at once.
    let on_gpu = !no_gpu();
    assert_says(&stdout, on_gpu.then_some("bounce 15"));
    assert_says(&stdout, ["ledger: 5000 emitted = 2498 absorbed + 2498 escaped + 4 cut off + 0 dropped", "7511 photons stored", "gather"]);

    let report = place.json("a.json");
    let ledger = &report["ledger"];
    let count = |fate: &str| ledger[fate].as_u64().unwrap();
    assert_eq!(count("emitted"), count("absorbed") + count("escaped") + count("cut_off") + count("dropped"));
    assert_eq!((count("emitted"), count("stored"), count("dropped")), (5000, 7511, 0));
    assert_eq!((&report["seed"], &report["nonfinite_values"]), (&1.into(), &Value::Null));
    let builder = if on_gpu { "scan" } else { "cpu" };
    assert_eq!((&report["settings"]["bounces"], &report["settings"]["builder"]), (&15.into(), &builder.into()));
    assert!(report["device"].is_string() && report["driver"].is_string());
    let timings = report["timings"].as_array().unwrap();
    let named = |name: &str| timings.iter().find(|row| row["name"] == name).unwrap_or_else(|| panic!("no timing {name}: {timings:?}"));
    for name in ["round", "round/build", "round/gather"].into_iter().chain(on_gpu.then_some("round/build/bounce 7")) {
        assert_eq!(named(name)["count"], 1, "{name}");
        if on_gpu {
            assert!(named(name)["gpu_ms"].as_f64().unwrap() > 0.0, "{name}");
        }
    }
    assert!(named("round")["wall_ms"].as_f64().unwrap() > 0.0);

    let trace = place.json("t.json");
    let spans = trace["traceEvents"].as_array().unwrap();
    assert!(spans.iter().any(|span| span["name"] == "gather" && span["dur"].as_f64().unwrap() > 0.0), "{spans:?}");

    let layout = place.json("walls/irradiance/layout.json");
    let walls = layout["walls"].as_array().unwrap();
    assert_eq!(walls.iter().map(|wall| wall["name"].as_str().unwrap()).collect::<Vec<_>>(), ["left", "right", "floor", "ceiling", "back"]);
    let floor = &walls[2];
    assert_eq!(floor["origin"], serde_json::json!([-0.25, -0.25, -0.25]));
    assert_eq!((&floor["u"], &floor["v"]), (&serde_json::json!([0.0, 0.0, 0.5]), &serde_json::json!([0.5, 0.0, 0.0])));
    assert_eq!((&floor["width"], &floor["height"], &floor["file"]), (&64.into(), &64.into(), &"floor.exr".into()));
    let (irradiance, radiosity) = (place.pixels("walls/irradiance/floor.exr"), place.pixels("walls/radiosity/floor.exr"));
    assert_eq!(irradiance.len(), 3 * 64 * 64);
    for (irradiance, radiosity) in pairs(&irradiance, &radiosity) {
        assert!((radiosity - 0.75 * irradiance).abs() <= 1e-6 * irradiance, "{radiosity} {irradiance}");
    }
    // 2 W in a box of 1.25 m2 of walls: some watts a square metre.
    let mean = irradiance.iter().sum::<f32>() / irradiance.len() as f32;
    assert!((1.0..4.0).contains(&mean), "{mean}");
    place.picture("a.exr");
}

/// How far and how wrong: progress as lines, why the run ended, noise, bias and error images.
#[test]
fn a_run_says_how_wrong_it_is() {
    let place = Place::new();
    let line = "--photons 501 --mesh 8 --error 90% --bias --progress json --json a.json --irradiance i";
    let (stdout, stderr) = place.succeed(&validated(line));
    // Warnings stay text.
    let lines = stderr.lines().filter(|line| !line.starts_with("photonmill: "));
    let lines: Vec<Value> = lines.map(|line| serde_json::from_str(line).expect(line)).collect();
    const STEP: [&str; 8] = ["done", "error", "error_wanted", "ledger", "photons", "seconds", "seconds_left", "total"];
    for line in &lines {
        let fields: Vec<&str> = line.as_object().unwrap().keys().map(String::as_str).collect();
        assert!(fields == ["message"] || fields == STEP, "{line}");
    }
    let last = lines.last().expect("progress is reported");
    assert_eq!(last["ledger"]["emitted"], last["photons"]);
    assert!(last["error"].as_f64().unwrap() <= last["error_wanted"].as_f64().unwrap() && last["seconds_left"].is_number(), "{last}");
    let report = place.json("a.json");
    assert_eq!((&report["end"], &report["rounds"], &report["cancelled"]), (&"error".into(), &16.into(), &false.into()));
    let known = |value: &Value| value.as_f64().unwrap();
    let (noise, bias) = (known(&report["error_bound"]), known(&report["bias"]["upper"]));
    let lost = known(&report["losses"]["relative"]);
    assert!(
        (noise.hypot(bias + lost) - known(&last["error"])).abs() < 1e-9 && lost > 0.0 && noise > known(&report["relative_error"]),
        "{report}"
    );
    let words =
        "ended at the requested error|noise: |bias of the radius: |light cut off after 15 bounces: |noise, bias and light cut off: ";
    assert_says(&stdout, words.split('|'));
    let (light, errors) = (place.pixels("i/floor.exr"), place.pixels("i/floor-error.exr"));
    assert!(pairs(&light, &errors).all(|(light, error)| *error > 0.0 && error < light), "{errors:?}");
}

/// Whoever asks for the fastest gets the one that took least; the times of all are printed.
#[test]
fn the_fastest_builder_is_taken() {
    let place = Place::new();
    let auto = |bounces: u32| {
        let line = format!("--variant auto --bounces {bounces} --photons 500 --mesh 4 -o a.png --json a.json");
        let (_, stderr) = place.succeed(&validated(&line));
        let taken = place.json("a.json")["settings"]["builder"].as_str().unwrap().to_owned();
        if taken == "cpu" {
            // There is no device here.
            return Vec::new();
        }
        let (_, times) = stderr.lines().find_map(|line| line.split_once(", in ms: ")).expect(&stderr);
        let times: Vec<(String, f64)> = times
            .split(", ")
            .map(|candidate| candidate.split_once(' ').expect(&stderr))
            .map(|(builder, ms)| (builder.to_owned(), ms.parse().expect(&stderr)))
            .collect();
        assert!(stderr.contains(&format!("auto takes {taken};")) && times[0].0 == taken, "{stderr}");
        assert!(times.is_sorted_by(|a, b| a.1 <= b.1) && times[0].1 > 0.0, "{stderr}");
        times
    };
    let holds = |times: &[(String, f64)], builder: &str| times.iter().any(|(name, _)| name == builder);
    let short = auto(15);
    // A persistent invocation would loop too long.
    let long = auto(1001);
    assert!(short.is_empty() || (short.len() == 6 && long.len() == 5 && holds(&short, "persistent") && !holds(&long, "persistent")));
}

#[test]
fn without_vulkan_the_cpu_builder_runs() {
    let place = Place::new();
    let output = place.run_without_vulkan("-o a.png --json a.json --quiet");
    let stderr = text(&output.stderr);
    assert!(output.status.success(), "{stderr}");
    assert_eq!(stderr.trim_end().lines().count(), 1, "{stderr}");
    assert_says(&stderr, ["no Vulkan device", "install", "CPU builder"]);
    let report = place.json("a.json");
    assert_eq!((&report["device"], &report["ledger"]["stored"]), (&"cpu".into(), &7511.into()));

    let refused = place.run_without_vulkan("--device 0");
    assert_eq!(refused.status.code(), Some(2));
    assert!(text(&refused.stderr).contains("available: none"), "{}", text(&refused.stderr));
}

/// Whichever signal asks for the end: what is finished is saved, and the exit code says which it was.
#[test]
fn an_interrupt_saves_what_is_finished() {
    let cases = [("INT", 130), ("TERM", 143), ("HUP", 129)];
    let runs = cases.map(|(signal, code)| std::thread::spawn(move || interrupted(signal, code)));
    runs.into_iter().for_each(|run| run.join().unwrap());
}

fn interrupted(signal: &str, code: i32) {
    let place = Place::new();
    let mut run = place.start(&validated("--rounds 4000000 --rng philox -o a.png --json a.json --progress json"));
    // Photons are under way once progress is reported.
    run.line_with("\"photons\"");
    run.signal(signal);
    let (ended, rest, _) = run.end();
    assert_eq!(ended, Some(code), "{signal}: {rest:?}");
    let report = place.json("a.json");
    let emitted = report["ledger"]["emitted"].as_u64().unwrap();
    assert!(emitted > 0 && emitted < 4_000_000 * 5000, "{emitted}");
    assert_eq!((&report["cancelled"], &report["ledger"]["dropped"]), (&true.into(), &0.into()));
    // The picture is that of the photons that were emitted, not a dark one.
    let picture = place.picture("a.png").into_luma8();
    let brightest = picture.pixels().map(|pixel| pixel.0[0]).max().unwrap();
    assert!(brightest > 100, "{brightest}");
    assert_eq!(place.names(), ["a.json", "a.png"]);
}

/// Device and plan first, then a line every few seconds.
#[test]
fn a_run_says_what_it_does() {
    let place = Place::new();
    let line = "--variant cpu --photons 300 --mesh 4 --error 0.0002% -o a.png";
    let mut run = place.start(&format!("{line} --time 3600s"));
    assert_eq!(run.line_with(""), "photonmill: device: CPU");
    let plan = run.line_with("");
    let words = "plan: open box|300 photons|15 bounces|radius 0.05 m|MiB|an error of 0.0002 % (95 % confidence)|or 3600 s";
    assert_says(&plan, words.split('|'));
    let step = run.line_with("photons/s");
    assert!(step.contains("s left"), "{step}");
    run.signal("INT");
    assert_eq!(run.end().0, Some(130));
}

/// Of a long value a message shows the beginning and the end.
#[test]
fn long_values_are_not_repeated_whole() {
    let long = "7".repeat(5000);
    let place = Place::new();
    for line in [
        "--photons LONG",
        "--eye LONG",
        "--variant LONG",
        "--replay LONG",
        "--device LONG",
        "-o absent/LONG.png",
        "--LONG",
        "LONG",
        "render LONG -o a.png",
        "render LONG.glb -o a.png",
        "render cornell -o a.png --camera LONG",
        "render cornell -o a.png --fixed-radius LONG",
        "probe cornell --points LONG -o a.csv",
        "bench --only LONG",
        "compare LONG.exr b.exr",
    ] {
        let refusal = place.refusal(&line.replace("LONG", &long)).unwrap();
        assert!(refusal.len() < 600 && refusal.contains("777...777"), "{line}: {refusal}");
    }
    place.write("points.txt", format!("{long} 0 0 0 1 0\n"));
    let stderr = text(&place.run("probe cornell --points points.txt -o a.csv").stderr);
    assert!(stderr.len() < 600 && stderr.contains("777...777") && stderr.contains("1e15"), "{stderr}");
}

#[test]
fn help_takes_help() {
    let place = Place::new();
    for (asked, meant) in [("help --help", "help"), ("help -h", "help"), ("help plan --help", "help plan")] {
        let [asked, meant] = [asked, meant].map(|line| place.run(line));
        assert!(asked.status.success() && asked.stdout == meant.stdout && !asked.stdout.is_empty(), "{}", text(&asked.stderr));
    }
}

#[test]
fn a_slip_is_answered_with_what_was_meant() {
    let place = Place::new();
    let cases: [(&str, [&str; 1]); 6] = [
        ("rendr cornell", ["did you mean render?"]),
        ("render cornell -o a.png --phtons 3", ["did you mean --photons?"]),
        ("scene.glb", ["photonmill render scene.glb -o picture.png"]),
        ("folder/Scene.GLTF -o a.png", ["photonmill render folder/Scene.GLTF -o picture.png"]),
        ("-o a.png scene.glb", ["photonmill render scene.glb -o picture.png"]),
        ("cornell-spheres", ["photonmill render cornell-spheres -o picture.png"]),
    ];
    place.assert_refused(cases);
}

#[test]
fn without_arguments_it_says_how_to_start() {
    let place = Place::new();
    let (stdout, stderr) = place.said("");
    assert_eq!(stderr, "");
    assert_says(&stdout, ["photonmill render cornell-spheres -o picture.png", "photonmill render scene.glb", "--help"]);
    assert_eq!(place.names(), Vec::<String>::new());
}

/// Before the run, whichever option names the file: of a run that has begun there would be more than one line.
#[test]
fn names_that_the_file_system_refuses_are_found_at_once() {
    let long = "n".repeat(300) + ".exr";
    let place = Place::new();
    for (command, options) in [
        ("", "-o --json --trace --irradiance --radiosity"),
        ("render cornell", "-o"),
        ("render cornell -o a.png", "--error-image --json"),
        ("bake cornell", "-o"),
        ("probe cornell --points -", "-o"),
        ("plan cornell", "--json"),
        ("compare a.exr b.exr", "--json"),
        ("devices", "--json"),
        ("selfcheck", "--json"),
        ("study cornell", "-o"),
        ("bench", "-o --json"),
        ("paper", "-o"),
    ] {
        for option in options.split(' ') {
            let refusal = place.refusal(&format!("{command} {option} {long}")).unwrap();
            let is_refused = refusal.starts_with(&format!("photonmill: {option} ")) && refusal.contains("cannot be written");
            assert!(is_refused, "{command} {option}: {refusal}");
        }
    }
}

/// A disk that fills up during the run: everything is saved in another folder, which the error names.
#[test]
fn results_that_cannot_be_written_are_saved_elsewhere() {
    let place = Place::new();
    std::os::unix::fs::symlink("/dev/full", place.at("a.exr")).unwrap();
    std::fs::create_dir(place.at("tmp")).unwrap();
    let mut command = place.command("--variant cpu --mesh 8 --json a.json -o a.exr --irradiance i --quiet");
    let output = command.env("TMPDIR", place.at("tmp")).output().unwrap();
    let stderr = text(&output.stderr);
    assert_eq!((output.status.code(), stderr.lines().count()), (Some(2), 1), "{stderr}");
    let [saved] = &entries(&place.at("tmp"))[..] else { panic!("one folder expected: {stderr}") };
    assert!(stderr.contains("-o a.exr") && stderr.contains(saved.as_str()), "{stderr}");
    assert_eq!(place.json(&format!("tmp/{saved}/json/a.json"))["ledger"]["emitted"], 5000);
    for file in ["output/a.exr", "irradiance/floor.exr"] {
        place.picture(&format!("tmp/{saved}/{file}"));
    }
    // The report is printed, and no destination holds a part.
    assert!(text(&output.stdout).contains("ledger: 5000 emitted"), "{}", text(&output.stdout));
    assert!(!place.at("a.json").exists());
}

/// No file at all can grow, as with a full disk everywhere: what was measured is printed.
#[test]
#[ignore = "long: ten seconds of the paper's measurements, which the short run makes once"]
fn a_measured_paper_run_is_not_lost_on_a_full_disk() {
    let place = Place::new();
    // Without a device it is the CPU builder's, which is the shortest.
    let line = "ulimit -f 1; exec photonmill paper -o p --large 5001 --repeats 1 --longest 1ms";
    let output = without_vulkan(&mut place.shell(line)).output().unwrap();
    let (stdout, stderr) = (text(&output.stdout), text(&output.stderr));
    assert_eq!(output.status.code(), Some(2), "{stderr}");
    assert!(stderr.lines().last().is_some_and(|line| line.contains("-o p/") && line.contains("cannot be written")), "{stderr}");
    // All three tables, of which the first has rows at least.
    let tables: Vec<&str> = stdout.split("\n\n").collect();
    assert!(tables.len() == 3 && tables[0].starts_with("photons,bounces,builder,") && tables[0].lines().count() > 1, "{stdout}");
    assert!(tables[1].starts_with("photons_per_round,rounds,"), "{stdout}");
    assert!(tables[2].starts_with("finding,verdict,"), "{stdout}");
}

/// Headings of a help text, and the options under each.
fn groups(help: &str) -> Vec<(String, Vec<String>)> {
    let mut groups: Vec<(String, Vec<String>)> = Vec::new();
    for line in help.lines() {
        let words = line.trim_start();
        let option = words.strip_prefix("--").or_else(|| words.strip_prefix('-')?.get(1..)?.strip_prefix(", --"));
        if !line.starts_with(' ') && line.ends_with(':') && !line.contains('.') {
            groups.push((line.trim_end_matches(':').to_owned(), Vec::new()));
        } else if let (Some(option), Some((_, options))) = (option, groups.last_mut()) {
            options.push(option.split("  ").next().unwrap().trim().to_owned());
        }
    }
    groups
}

/// One order of headings, one heading and one kind of value for an option of all commands, examples at the end.
#[test]
fn help_is_grouped_alike_everywhere() {
    const HEADINGS: &str = "Commands|Arguments|Options|Output|Scene|When to stop|Measurements|Photons|Light transport|\
        Density estimate|Implementation|Checks|Messages|Device|Examples";
    let place = Place::new();
    let mut places: HashMap<String, (String, String)> = HashMap::new();
    for command in ["", "devices", "render", "bake", "probe", "plan", "info", "compare", "selfcheck", "study", "bench", "paper"] {
        let help = text(&place.run(&format!("{command} --help")).stdout);
        let groups = groups(&help);
        let order: Vec<_> = groups.iter().map(|(heading, _)| HEADINGS.split('|').position(|known| known == heading)).collect();
        assert!(order.iter().all(Option::is_some) && order.is_sorted_by(|a, b| a < b), "{command}: {groups:?}");
        assert_eq!(groups.last().unwrap().0, "Examples", "{command}");
        assert!(help.contains(&format!("photonmill {command}").trim_end().to_owned()), "{command}");
        for (heading, options) in groups {
            for option in options {
                let (name, value) = option.split_once(' ').unwrap_or((&option, ""));
                // A folder is an output as a file is, and what is printed needs no file.
                let value = match (name, value) {
                    ("output", "<DIR>") | ("json", "[<FILE>]") => "<FILE>",
                    _ => value,
                };
                let place = (heading.clone(), value.to_owned());
                let first = places.entry(name.to_owned()).or_insert_with(|| place.clone());
                assert_eq!(*first, place, "{command}: --{name}");
            }
        }
        let takes_scene = ["render", "bake", "probe", "plan", "info", "study"].contains(&command);
        let missing = built_in::names().into_iter().find(|scene| !help.contains(scene));
        assert!(!takes_scene || missing.is_none(), "{command}: {missing:?}");
        assert_eq!(help.contains("\nArguments:\n  <SCENE>"), takes_scene, "{command}");
    }
    assert!(places.len() > 60, "{}", places.len());
}

/// A reader that goes away, a full disk: one line at most, no panic.
#[test]
fn output_that_nobody_takes_is_no_panic() {
    let place = Place::new();
    let gone = place.shell("set -o pipefail; photonmill --variant cpu -o a.png | true").output().unwrap();
    assert!(gone.status.success(), "{}", text(&gone.stderr));
    for (line, code, complaints) in [
        ("photonmill --variant cpu -o a.png --quiet > /dev/full", 2, 1),
        ("photonmill --photons 0 2> /dev/full", 2, 0),
        ("photonmill plan cornell -q | true", 0, 0),
        ("photonmill plan cornell -q --json | head -c 1 > /dev/null", 0, 0),
        ("photonmill plan cornell -q > /dev/full", 2, 1),
    ] {
        place.assert_shell(line, code, complaints);
    }
    if !no_gpu() {
        place.assert_shell("photonmill render cornell --size 8x8 --photons 10 --rounds 1 -q -o b.png | true", 0, 0);
        assert!(place.at("b.png").exists());
    }
}

/// The paper's page, whole, at a large size that is hardly larger than the paper's. Which of its longest rows are left out is the clock's
/// affair.
fn check_paper(place: &Place, words: &[&str]) {
    let names = entries(&place.at("paper"));
    let panels = [(1, "abcde"), (2, "ab"), (3, "abc"), (4, "abcdef")];
    let panels = panels.iter().flat_map(|(figure, letters)| letters.chars().map(move |letter| format!("figure{figure}{letter}.png")));
    let tables = ["findings.csv", "index.html", "running_times.csv", "table1.csv"].map(str::to_owned);
    let mut wanted: Vec<String> = panels.chain(tables).collect();
    wanted.sort();
    assert_eq!(names, wanted);
    // Thousands are set apart by narrow spaces.
    let page = place.text("paper/index.html").replace('\u{202f}', "");
    assert_says(&page, ["7511", "Figure 4", "data:image/png;base64,"].into_iter().chain(words.iter().copied()));
    assert!(!page.contains("http://") && !page.contains("src=\"/"), "the page opens without a network");
    let table = place.text("paper/table1.csv");
    // The large size has no published time.
    let of_grid = table.lines().filter(|line| line.contains(",grid,")).filter_map(|line| line.rsplit(',').next());
    let of_grid: Vec<&str> = of_grid.filter(|published| !published.is_empty()).collect();
    let published = ["2130", "10670", "20850", "53280", "105640"];
    assert!(!of_grid.is_empty() && published.starts_with(&of_grid), "{of_grid:?}");
}

/// By the CPU builder, which is the shortest.
#[test]
fn the_paper_is_regenerated() {
    let place = Place::new();
    let output = place.run_without_vulkan("paper --out paper --large 5001 --repeats 1 --longest 1ms");
    assert!(output.status.success(), "{}", text(&output.stderr));
    check_paper(&place, &[]);
    if is_long_run() {
        let place = Place::new();
        place.succeed(&validated("paper --out paper --large 5001 --repeats 1 --longest 9s"));
        check_paper(&place, &["still holds", "105640"]);
    }
}

/// Before anything is computed, as while a scene is read or settings are looked for, Ctrl-C ends the program at once, and it says so.
#[cfg(unix)]
#[test]
fn ctrl_c_before_the_first_result_is_answered() {
    let place = Place::new();
    assert!(std::process::Command::new("mkfifo").arg(place.at("points")).status().unwrap().success());
    let run = place.start("probe cornell --points points -o a.csv");
    // Opens once the program waits for points.
    let _points = std::fs::OpenOptions::new().write(true).open(place.at("points")).unwrap();
    run.signal("INT");
    let (code, said, _) = run.end();
    assert_eq!((code, said), (Some(130), vec!["photonmill: interrupted before the first result; nothing was written".to_owned()]));
}
