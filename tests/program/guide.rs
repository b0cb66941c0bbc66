//! README and guide: commands run, links and options exist.

use std::fs;

use crate::common::gltf_file::{square, square_buffer};
use crate::common::prelude::*;
use crate::common::program::on_device;
use crate::common::sources::{files, read, root};
use photonmill::scene::gltf::source::binary_file;

/// Pages of the guide by path, without `links.md`, which is no page.
fn pages() -> Vec<(String, String)> {
    let pages: Vec<_> = files("src/guide", &[".md"]).into_iter().filter(|(path, _)| !path.ends_with("/links.md")).collect();
    assert!(pages.len() >= 9, "{} pages", pages.len());
    pages
}

fn all_texts() -> Vec<(String, String)> {
    [vec![("README.md".to_owned(), read("README.md"))], pages()].concat()
}

/// Lines of the fenced blocks of a language.
fn fenced<'a>(text: &'a str, language: &str) -> Vec<&'a str> {
    let mut inside = None;
    let mut lines = Vec::new();
    for line in text.lines() {
        match (line.strip_prefix("```"), inside) {
            (Some(named), None) => inside = Some(named),
            (Some(_), Some(_)) => inside = None,
            (None, Some(named)) if named == language => lines.push(line),
            _ => {}
        }
    }
    lines
}

/// Commands of a text without their comments.
fn commands(text: &str) -> Vec<String> {
    let bare = |line: &str| line.split(" #").next().unwrap_or_default().trim().to_owned();
    fenced(text, "sh").into_iter().map(bare).filter(|line| !line.is_empty()).collect()
}

/// Commands that start so are not run, and why.
const NOT_RUN: [(&str, &str); 19] = [
    ("pip install ", "builds a wheel; `tools/python/test` does, and runs what the page shows"),
    ("tools/setup && tools/test", "runs this test"),
    ("tools/setup && cargo build", "takes minutes; whatever it builds is here"),
    ("export PATH", "is for the user's shell"),
    ("tools/test", "runs this test"),
    ("tools/bench/run ", "writes into the repository"),
    ("tools/bench/targets ", "measures for minutes what only an H200 is judged by"),
    ("tools/bench/tuning ", "takes an hour"),
    ("tools/bench_peers", "installs other programs"),
    ("tools/fuzz/run ", "needs a nightly toolchain"),
    ("tools/faults", "takes half an hour; `tests/engine/failures.rs` has short forms"),
    ("tools/package", "`tests/program/package.rs` runs it"),
    ("tools/soak ", "takes an hour"),
    ("tools/sanitize", "needs a nightly toolchain"),
    ("tools/sample_models ", "needs a collection of files"),
    ("tools/blender/test_addon.py", "needs Blender's Python module"),
    ("tools/open_pictures", "installs Blender's Python module and Mitsuba"),
    ("node tools/viewers/try.mjs", "needs Chromium and three.js"),
    ("photonmill selfcheck", "takes half a minute at any size; `every_closed_form_holds` runs the same"),
];

/// Commands of which only the options are checked, and why.
const PARSED: [(&str, &str); 8] = [
    ("photonmill view ", "opens a window; `tests/program/view.rs` has a display for it"),
    ("photonmill render scene.glb -o picture.exr --display ", "needs a viewer; `tests/program/display.rs` has one"),
    (
        "photonmill render scene.glb -o picture.exr --denoise",
        "needs Open Image Denoise; `tests/files/denoise.rs` has something in its place",
    ),
    ("photonmill render scene.glb -o a.exr --math strict", "compiles kernels for half a minute; `tests/engine/strict.rs` runs them"),
    ("photonmill gallery ", "makes pipelines for every picture; `tests/program/gallery.rs` runs it"),
    ("photonmill paper ", "takes a minute at any size; `tests/program/bench.rs` and `tests/program/cli.rs` run its parts"),
    ("photonmill study ", "compiles pipelines for every choice; `tests/program/study.rs` runs small studies"),
    ("photonmill bench", "takes a minute at any size; `tests/program/bench.rs` runs all of it"),
];

/// Commands that the long run alone runs, and what stands for them in the short one, where their options are checked.
const LONG: [(&str, &str); 20] = [
    ("photonmill --preset naive", "`--variant atomic` runs"),
    ("photonmill --preset phong ", "`--preset rounds` runs"),
    ("photonmill --variant auto ", "`tests/program/cli.rs` runs one"),
    ("photonmill --photons 250000 --gather kdtree ", "`--variant ballot --photons` runs"),
    ("photonmill --irradiance out --json ", "`tests/program/cli.rs` runs one with more files"),
    ("photonmill --error 5% --bias", "`tests/program/cli.rs` runs one with more options"),
    ("photonmill bake scene.glb -o baked --time ", "one without the ends of a run runs"),
    ("photonmill render cornell -o a.exr --error 2% --confidence ", "`tests/engine/stop.rs` ends runs at an error"),
    ("photonmill render scene.glb -o picture.exr --error 2% --error-image ", "one with an error image and rounds runs"),
    ("photonmill render scene.glb -o picture.exr --time 30s", "one with snapshots runs"),
    ("photonmill render scene.glb -o picture.png --size 320 --rounds ", "one without the size runs"),
    ("photonmill probe scene.glb --points points.txt -o -", "one into a file runs"),
    ("photonmill render cornell-spheres -o a.exr --judge", "one into another file runs"),
    ("photonmill render scene.glb -o a.exr --paranoid", "`tests/program/render_and_probe.rs` runs one"),
    ("photonmill render scene.glb -o picture.exr --rounds 4096 --checkpoint picture.pms", "one into another file runs"),
    ("photonmill render scene.glb -o picture.exr --rounds 8192 --checkpoint more.pms ", "one from another file runs"),
    ("photonmill render scene.glb -o picture.exr --error 1% --devices ", "one on a device runs"),
    ("photonmill render scene.glb -o picture.exr --rounds 4096 --devices ", "one on a device runs"),
    ("photonmill map scene.glb -o map.pm --rounds ", "one with the usual rounds runs"),
    ("photonmill render scene.glb --map map.pm -o picture.exr --error-image ", "one without an error image runs"),
];

/// Sets options to values that make a run short. An option that is not there is added.
fn shrunk(arguments: &[&str], values: &[(&str, &str)]) -> Vec<String> {
    let mut all: Vec<String> = arguments.iter().map(ToString::to_string).collect();
    for (option, value) in values {
        match all.iter().position(|argument| argument == option) {
            Some(at) => all[at + 1] = (*value).to_owned(),
            None => all.extend([(*option).to_owned(), (*value).to_owned()]),
        }
    }
    all
}

/// A run of the same kind that takes a second or two.
fn short(arguments: &[&str]) -> Vec<String> {
    // Kernels of matt walls are made in a quarter of the time; what a file may hold besides is no matter here.
    let is_lit = matches!(arguments.first(), Some(&"render" | &"bake" | &"probe" | &"map"));
    let shorter = |word: &&str| if is_lit && ["scene.glb", "cornell-spheres"].contains(word) { "cornell" } else { *word }.to_owned();
    let has = |options: &[&str]| arguments.iter().any(|argument| options.contains(argument));
    let of_kind: &[(&str, &str)] = match (arguments.first(), arguments.get(1)) {
        (Some(&"plan" | &"info" | &"compare" | &"devices" | &"merge" | &"repeat"), _) | (Some(&"map"), Some(&"info" | &"export")) => {
            return arguments.iter().map(shorter).collect();
        }
        // A photon is replayed by its number in the run as it is given.
        _ if has(&["--replay"]) => return arguments.iter().map(shorter).collect(),
        (Some(&"render"), _) => &[("--size", "8x8")],
        (Some(&"bake"), _) => &[("--texels-per-metre", "2")],
        (Some(&"probe" | &"map"), _) => &[],
        _ => &[("--mesh", "8")],
    };
    // What is kept has two blocks of rounds, one for each of two shards, and it takes eight to know an error.
    let has_blocks = has(&["map", "--map", "--checkpoint", "--resume", "--shard", "--error-image", "--judge"]);
    // Photons of a file are as many as they are.
    let photons = [("--photons", "500")].into_iter().filter(|_| !has(&["--map"]));
    let rounds = match (has(&["--error-image"]) && !has(&["--map"]), has_blocks) {
        (true, _) => "32",
        (false, true) => "8",
        (false, false) => "2",
    };
    let of_run: Vec<_> = photons.chain([("--rounds", rounds)]).collect();
    // There is one device at least.
    let only_if_there = [("--error", "60%"), ("--samples", "2"), ("--counters", "2"), ("--devices", "0,0")];
    let there: Vec<_> = only_if_there.into_iter().filter(|(option, _)| has(&[option])).collect();
    let words: Vec<String> = arguments.iter().map(shorter).collect();
    shrunk(&words.iter().map(String::as_str).collect::<Vec<_>>(), &[&of_run, &there[..], of_kind].concat())
}

fn ends_well(place: &Place, line: &str) -> Check {
    let output = place.shell(&format!("photonmill {line}")).output().expect("bash starts");
    require(output.status.success(), || format!("{line}: {:?}: {}", output.status.code(), text(&output.stderr).trim()))
}

/// Files and folders that the command says it writes.
fn outputs<'a>(arguments: &[&'a str]) -> Vec<&'a str> {
    let options = ["-o", "--json", "--trace", "--error-image", "--irradiance", "--radiosity", "--checkpoint"];
    let values = arguments.windows(2).filter(|pair| options.contains(&pair[0])).map(|pair| pair[1]);
    values.filter(|value| *value != "-").collect()
}

/// What a command asks for, whatever the values: its name, the names of its options, and what it writes, which others may read.
fn kind(command: &str) -> BTreeSet<&str> {
    let words: Vec<&str> = command.split_whitespace().collect();
    let is_name = |word: &&&str| word.chars().all(char::is_lowercase) && built_in::by_name(word).is_none();
    let names = words.iter().skip_while(|word| **word != "photonmill").skip(1).take_while(is_name);
    let options = words.iter().filter(|word| word.starts_with('-'));
    names.chain(options).copied().chain(outputs(&words)).collect()
}

/// Runs one command of a text in a folder that holds its inputs; what it says it writes must be there.
fn run(place: &Place, command: &str) -> Check {
    let line = command.replace("tools/setup && cargo run --release --", "photonmill");
    let mut words = line.split_whitespace();
    require(words.next() == Some("photonmill") && !line.contains(['|', '>', '<', ';', '&', '$', '"', '\'', '\\']), || {
        format!("{command}: is neither run nor listed as not run")
    })?;
    let arguments: Vec<&str> = words.collect();
    ends_well(place, &on_device(&short(&arguments).join(" ")))?;
    let absent = outputs(&arguments).into_iter().find(|path| !place.at(path).exists());
    require(absent.is_none(), || format!("{command}: wrote no {absent:?}"))
}

/// Only whether the program knows command, options and values, and takes them together: `--print-config` is parsed with all of them.
fn parse(place: &Place, command: &str) -> Check {
    ends_well(place, &format!("{} --print-config", command.trim_start_matches("photonmill ")))
}

/// A folder with the files that the commands read.
fn place_with_inputs() -> Place {
    let place = Place::new();
    let mut scene = square();
    scene["buffers"][0].as_object_mut().unwrap().remove("uri");
    place.write("scene.glb", binary_file(&scene, &square_buffer(), &[]));
    place.write("points.txt", "# two points of the floor\n0 0.01 0 0 1 0\n1 0.01 1 0 1 0\n");
    place
}

#[test]
fn commands_of_readme_and_guide_run() {
    let all = is_long_run();
    let Some(_) = device() else { return };
    let place = place_with_inputs();
    let texts: Vec<(String, Vec<String>)> = all_texts().into_iter().map(|(path, text)| (path, commands(&text))).collect();
    let parsed_only = || PARSED.iter().chain(LONG.iter().filter(move |_| !all));
    let (mut seen, mut done, mut kinds) = (BTreeSet::new(), BTreeSet::new(), BTreeSet::new());
    for (path, commands) in &texts {
        // What stands in several texts is the same command.
        for command in commands.iter().filter(|command| done.insert(*command)) {
            let starts = |(start, _): &&(&'static str, &'static str)| command.starts_with(start);
            if let Some((start, why)) = NOT_RUN.iter().find(starts) {
                println!("{path}: {command}: not run, {why}");
                seen.insert(*start);
            } else if let Some((start, why)) = parsed_only().find(starts) {
                println!("{path}: {command}: parsed only, {why}");
                seen.insert(*start);
                assert_holds(path, parse(&place, command));
            } else if kinds.insert(kind(command)) {
                let began = Instant::now();
                assert_holds(path, run(&place, command));
                println!("{path}: {command}: {:.2} s", began.elapsed().as_secs_f64());
            } else {
                println!("{path}: {command}: parsed only, one that differs in values was run");
                assert_holds(path, parse(&place, command));
            }
        }
    }
    let listed: BTreeSet<&str> = NOT_RUN.iter().chain(parsed_only()).map(|(start, _)| *start).collect();
    assert_eq!(listed, seen, "what is listed as not run stands in no text");
}

#[test]
fn commands_that_are_wrong_are_noticed() {
    let place = place_with_inputs();
    let text = "```sh\nphotonmill a  # one\n\nphotonmill b --c\n```\n```text\nphotonmill no\n```\n";
    assert_eq!(commands(text), ["photonmill a", "photonmill b --c"]);
    assert_complains("another program", run(&place, "photonhill render scene.glb -o a.exr"));
    assert_complains("a shell's syntax", run(&place, "photonmill devices | head"));
    assert_complains("no such option", run(&place, "photonmill render cornell -o a.exr --no-such-option"));
    assert_complains("no such file", run(&place, "photonmill plan absent.glb"));
    assert_complains("a file that is not written", run(&place, "photonmill --version -o absent.png"));
    assert_holds("options that are known", parse(&place, "photonmill render cornell -o a.exr"));
    assert_complains("no such option, parsed", parse(&place, "photonmill render cornell -o a.exr --no-such-option"));
    assert_complains("no such value, parsed", parse(&place, "photonmill render cornell -o a.exr --rounds some"));
    assert_complains("what excludes each other, parsed", parse(&place, "photonmill render a.glb -o a.exr --photons 5 --map a.pm"));
    let is_alike = |a: &str, b: &str| kind(a) == kind(b);
    let first = "photonmill render cornell --rounds 4 -o a.exr";
    assert!(is_alike(first, "photonmill render cornell-spheres --rounds 8 -o a.exr"));
    for other in ["render cornell --seed 4 -o a.exr", "render cornell --rounds 4 -o b.exr", "bake cornell --rounds 4 -o a.exr"] {
        assert!(!is_alike(first, &format!("photonmill {other}")), "{other}");
    }
    assert_eq!(shrunk(&["--rounds", "25", "-o", "x"], &[("--rounds", "2"), ("--mesh", "8")]), ["--rounds", "2", "-o", "x", "--mesh", "8"]);
}

/// Options of the project's other tools, of cargo and of Slurm.
const OTHER_OPTIONS: &str = "--lib --again --array --dependency --gres --help --hostname --ignored --install --limit --long --open --open-mode --out \
    --parsable --pictures --partition --path --plot --quick --release --requeue --sbatch --sbatch-merge --shards \
    --signal --test --wrap";

/// Words of a text that are options.
fn options(text: &str) -> BTreeSet<String> {
    let words = text.split(|letter: char| !(letter.is_ascii_alphanumeric() || letter == '-' || letter == '<'));
    // The lines of tables are dashes, too, and so are those of HTML comments.
    let is_option = |word: &&str| word.strip_prefix("--").is_some_and(|name| name.starts_with(|letter: char| letter.is_ascii_lowercase()));
    words.filter(is_option).map(ToOwned::to_owned).collect()
}

#[test]
fn options_of_readme_and_guide_exist() {
    let names =
        ["", "render", "repeat", "bake", "probe", "merge", "plan", "info", "compare", "devices", "selfcheck", "study", "bench", "paper"];
    let help = |name: &str| Place::new().said(&format!("{name} --help")).0;
    let known = options(&names.map(help).concat());
    assert!(known.len() > 60 && known.contains("--final-gather"), "{known:?}");
    for (path, text) in all_texts() {
        let unknown: Vec<String> = options(&text)
            .into_iter()
            .filter(|option| !known.contains(option) && !OTHER_OPTIONS.split(' ').any(|other| other == option))
            .collect();
        assert!(unknown.is_empty(), "{path}: {unknown:?}");
    }
    let found = options("| --- | <!-- a --> `--error 2%`, `--aim off`; -o, --math=strict");
    assert_eq!(found.iter().collect::<Vec<_>>(), ["--aim", "--error", "--math"]);
}

#[test]
fn readme_is_short_and_in_order() {
    let readme = read("README.md");
    assert!(readme.lines().count() <= 150, "{} lines", readme.lines().count());
    assert!(readme.len() <= 12_000, "{} bytes", readme.len());
    let headings: Vec<&str> = readme.lines().filter(|line| line.starts_with('#')).collect();
    let wanted = "# photonmill|## Try it|## Your own scene|## How wrong is it, and when to stop|## The paper's box|\
        ## What is guaranteed|## Scale|## Speed against peers|## Limits and platforms|## More";
    assert_eq!(headings.join("|"), wanted);
    let commands = commands(&readme);
    assert_eq!(commands[..2], ["tools/setup && cargo run --release -- --variant atomic", "tools/setup && tools/test"]);
    assert!(fs::metadata(root("src/guide/caustic.png")).unwrap().len() < 100_000);
}

/// Targets of links of one kind: `[label](target)`, or at the start of a line `[label]: target`.
fn links(text: &str) -> (Vec<String>, Vec<(String, String)>) {
    let inline = text.split("](").skip(1).filter_map(|rest| Some(rest.split_once(')')?.0.to_owned())).collect();
    let defined = text.lines().filter_map(|line| line.strip_prefix('[')?.split_once("]: "));
    (inline, defined.map(|(label, target)| (label.to_owned(), target.to_owned())).collect())
}

/// Links of the guide lead to files where it is read as Markdown, and to the same pages where rustdoc shows it.
fn guide_links_check(path: &str, text: &str, for_rustdoc: &[(String, String)], build: &str) -> Check {
    let (inline, defined) = links(text);
    if let Some(target) = inline.iter().find(|target| !target.starts_with("https://")) {
        return Err(format!("{path}: rustdoc cannot follow ({target})"));
    }
    for (label, target) in &defined {
        require(root("src/guide").join(target).is_file(), || format!("{path}: there is no {target}"))?;
        let has_twin = match target.strip_suffix(".md") {
            Some(page) => for_rustdoc.contains(&(label.clone(), format!("crate::guide::{page}"))),
            None => {
                let path = target.strip_prefix("../../").map_or_else(|| format!("src/guide/{target}"), ToOwned::to_owned);
                let stem = path.rsplit_once('.').map_or("", |(stem, _)| stem);
                stem.ends_with(label.as_str()) && build.contains(&format!("\"{path}\""))
            }
        };
        require(has_twin, || format!("{path}: rustdoc knows no [{label}]"))?;
    }
    // Tables of TOML are no links.
    let toml = fenced(text, "toml").join("\n");
    let without_toml = if toml.is_empty() { text.to_owned() } else { text.replace(&toml, "") };
    let in_brackets = without_toml.split('[').skip(1).filter_map(|rest| Some(rest.split_once(']')?.0));
    let is_label = |label: &&str| !label.is_empty() && label.chars().all(|letter| letter.is_ascii_lowercase() || letter == '-');
    for label in in_brackets.filter(is_label) {
        require(defined.iter().any(|(known, _)| known == label), || format!("{path}: [{label}] is not defined"))?;
    }
    Ok(())
}

#[test]
fn links_of_readme_and_guide_lead_somewhere() {
    for target in links(&read("README.md")).0 {
        assert!(target.starts_with("https://") || root(&target).is_file(), "README.md: {target}");
    }
    let for_rustdoc = links(&read("src/guide/links.md")).1;
    let build = read("build.rs");
    for (path, text) in pages() {
        assert_holds(&path, guide_links_check(&path, &text, &for_rustdoc, &build));
    }
    let check = |text: &str| guide_links_check("a page", text, &for_rustdoc, &build);
    assert_complains("a file", check("[a](paper.md)"));
    assert_complains("no such page", check("[a]: absent.md\n"));
    assert_complains("a label that rustdoc does not know", check("[a]: paper.md\n"));
    assert_complains("a chart that rustdoc does not know", check("[a]: ../../tools/setup\n"));
    assert_complains("no such label", check("[a][b]"));
}

#[test]
fn built_in_scenes_are_in_the_guide() {
    let text = read("src/guide/scenes.md");
    for name in built_in::names() {
        assert!(text.contains(&format!("`{name}`")), "{name}");
    }
}
