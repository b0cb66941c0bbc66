//! Options from a file, the options in force as a file, and what goes to a terminal: --config, --print-config, NO_COLOR, -q, -v,
//! completions and manual pages.

use crate::common::prelude::*;
use crate::common::program::{assert_says, entries, on_device, program};
use serde_json::Value;

const FILE: &str = "\
seed = 3
quiet = true
scene = \"absent.glb\"

[render]
scene = \"cornell\"
output = \"a.png\"
size = \"16x12\"
rounds = 0x8
photons = 1_000
environment = [0.5, 0.5, 0.25]
without = [\"glossy\", \"sheen\"]
judge = true
paranoid = false

[plan]
size = \"8\"
[map.info]
json = true
";

/// What a file says comes to the same picture as when it is typed, to the metadata; what is typed wins.
#[test]
fn a_run_from_a_file_is_that_of_its_options() {
    let place = Place::new();
    let table = "[open-box]\nvariant = \"cpu\"\noutput = \"a.png\"\nmesh = 0x10\nphotons = 1_000\neye = [0.25, 0, 1]\nbias = false\n";
    place.write("run.toml", format!("seed = 3\nquiet = true\nmesh = 1\n\n{table}"));
    let picture = |name: &str| std::fs::read(place.at(name)).unwrap();
    let (stdout, stderr) = place.said("--config run.toml");
    assert!(stderr.is_empty() && stdout.contains("wrote a.png"), "{stdout}{stderr}");
    place.said("--variant cpu --mesh 16 --photons 1000 --eye 0.25,0,1 --seed 3 -o b.png");
    assert!(picture("a.png") == picture("b.png"), "the pictures differ");
    place.said("--config run.toml -o c.png --seed 4");
    assert!(picture("a.png") != picture("c.png"), "--seed 4 changes nothing");
    // What conflicts with a typed option is not taken: --quiet with --progress.
    let (_, stderr) = place.said("--config run.toml -o d.png --progress json");
    assert!(stderr.lines().all(|line| serde_json::from_str::<Value>(line).is_ok()) && !stderr.is_empty(), "{stderr}");
    let (stdout, _) = place.said("repeat a.png");
    assert!(stdout.contains("identical"), "{stdout}");
}

/// Printed, taken back, and printed again; what is a comment is the default.
#[test]
fn options_in_force_are_printed_as_a_file() {
    let place = Place::new();
    place.write("run.toml", FILE);
    let print = |line: &str| place.said(&format!("{line} --print-config")).0;
    let commands = [
        "render --config run.toml --device 0 --error 2%",
        "plan cornell --with bvh",
        "map info a.pm --json",
        "bake",
        "",
        "--photons 10 -q",
    ];
    for line in commands {
        let first = print(line);
        place.write("printed.toml", &first);
        let words: Vec<&str> =
            line.split_whitespace().take_while(|word| word.chars().all(char::is_lowercase) && *word != "cornell").collect();
        let again = print(&format!("{} --config printed.toml", words.join(" ")));
        assert_eq!(first, again, "{line}");
        // With the defaults said, too, it is understood.
        let all: Vec<&str> = first.lines().skip(1).map(|line| line.trim_start_matches("# ")).collect();
        place.write("all.toml", all.join("\n"));
        let given = print(&format!("{} --config all.toml", words.join(" ")));
        let missing: Vec<&str> = given.lines().skip(1).filter(|line| line.starts_with("# ")).collect();
        assert_eq!(missing, Vec::<&str>::new(), "{line}");
    }
    let render = print("render --config run.toml --seed 4");
    let wanted = "scene = \"cornell\"|output = \"a.png\"|seed = 4|rounds = 8|without = [\"glossy\", \"sheen\"]|environment = \"0.5,0.5,0.25\"\
        |judge = 64|quiet = true|# group-size = 128|# tone = \"neutral\"";
    for line in wanted.split('|') {
        assert!(render.lines().any(|found| found == line), "{line}: {render}");
    }
    assert_eq!(place.names(), ["all.toml", "printed.toml", "run.toml"]);
}

#[test]
fn files_that_are_wrong_are_refused_in_one_line() {
    let cases: [(&str, &str, [&str; 3]); 16] = [
        ("rouds = 3", "render", ["c.toml, line 1: rouds: ", "did you mean rounds?", "photonmill --help"]),
        (
            "\n[render]\nrouds = 3",
            "render",
            ["c.toml, line 3: rouds: ", "no option of render; did you mean rounds?", "photonmill render --help"],
        ),
        ("[rendr]", "render", ["c.toml, line 1: rendr: no such command", "did you mean render?", ""]),
        ("[map.inf]", "render", ["c.toml, line 1: map.inf: no such command", "", ""]),
        // Of another command, which would not be run.
        ("[bake]\nsize = 5", "render", ["line 2: size: no option of bake", "", ""]),
        ("rounds = 0", "render", ["c.toml, line 1: --rounds 0", "from 1", ""]),
        ("rounds = \"many\"", "render", ["c.toml, line 1: --rounds many", "whole number", ""]),
        ("rounds = 99999999999999999999999999999999999999999999", "render", ["c.toml, line 1: rounds", "too large", ""]),
        ("aim = true", "render", ["c.toml, line 1: aim", "text in quotes", ""]),
        ("validate = \"yes\"", "render", ["c.toml, line 1: validate: must be true or false", "", ""]),
        ("rounds = 1979-05-27", "render", ["c.toml, line 1: rounds", "number", ""]),
        ("rounds = 3\nrounds = 4", "render", ["c.toml, line 2: is no TOML", "duplicate", ""]),
        ("photons = 3\nmap = \"m.pm\"", "render", ["c.toml, line 1: the argument '--photons <N>'", "--map", ""]),
        ("config = \"c.toml\"", "render", ["c.toml, line 1: config: stands in no file", "command line", ""]),
        ("[render]\nevery = \"3s\"", "render", ["with the options of c.toml: required: --checkpoint", "", ""]),
        ("", "render --json c.toml", ["--json c.toml: is the file of --config", "", ""]),
    ];
    let place = Place::new();
    for (file, line, words) in cases {
        place.write("c.toml", file);
        place.assert_refused([(format!("{line} cornell -o a.png --config c.toml").as_str(), words)]);
    }
    place.assert_refused([("render cornell -o a.png --config absent.toml", ["--config absent.toml", "no such file"])]);
}

/// -v says more than nothing, and -q less; both keep the report.
#[test]
fn messages_are_more_or_fewer() {
    let place = Place::new();
    let [quiet, usual] = ["--quiet", ""].map(|option| place.succeed(&format!("--mesh 8 -o a.png {option}")));
    let verbose = place.succeed("render cornell -o a.png --size 8 --rounds 2 --photons 500 -v");
    assert!(quiet.1.is_empty() && usual.1.contains("photonmill: device: "), "{}{}", quiet.1, usual.1);
    // What is printed every few seconds of a slow run has whole seconds.
    let steps = |stderr: &str| {
        let time =
            |line: &str| line.strip_prefix("photonmill: ")?.split_once(" s: ").map(|(time, step)| (time.contains('.'), step.to_owned()));
        let steps = stderr.lines().filter_map(time).filter(|(is_step, _)| *is_step);
        steps.map(|(_, step)| step).collect::<BTreeSet<String>>()
    };
    assert!(
        steps(&usual.1).is_empty()
            && steps(&verbose.1).is_superset(&["making the pipelines", "writing the results"].map(str::to_owned).into())
    );
    assert!(verbose.1.contains("subgroups of ") && !usual.1.contains("subgroups of "), "{}", verbose.1);
    assert!(verbose.0.contains("no glossy material") && !usual.0.contains("no glossy material"), "{}", verbose.0);
    assert!(quiet.0.contains("wrote a.png"), "{}", quiet.0);
}

/// What a command prints on a terminal, with an environment variable.
#[cfg(target_os = "linux")]
fn on_terminal(place: &Place, line: &str, variable: (&str, &str)) -> String {
    let command = format!("{} {line}", program());
    let mut script = std::process::Command::new("script");
    script
        .args(["-qec", &command, "/dev/null"])
        .current_dir(place.path())
        .env_remove("NO_COLOR")
        .env_remove("CLICOLOR_FORCE")
        .env("CI", "true");
    let output = script.env("TERM", "xterm").env(variable.0, variable.1).output().expect("script, of bsdutils, is there");
    assert!(output.status.success(), "{line}: {}", text(&output.stdout));
    text(&output.stdout)
}

#[cfg(target_os = "linux")]
#[test]
fn no_escapes_reach_who_does_not_want_them() {
    let place = Place::new();
    let run = on_device("--mesh 8 -o a.png");
    assert!(on_terminal(&place, &run, ("CLICOLOR", "1")).contains('\u{1b}'), "a terminal has a bar");
    for variable in [("NO_COLOR", "1"), ("TERM", "dumb")] {
        for line in [run.as_str(), "--help", "devices"] {
            let shown = on_terminal(&place, line, variable);
            assert!(!shown.contains('\u{1b}') && !shown.is_empty(), "{variable:?} {line}: {shown:?}");
        }
    }
    let (stdout, stderr) = place.succeed(&run);
    assert!(!(stdout + &stderr).contains('\u{1b}'), "no terminal");
}

/// bash's answer to the Tab key after some words.
fn completed(place: &Place, words: &str) -> Vec<String> {
    let program = program();
    let script = format!(
        "source <({program} completions bash)\nCOMP_WORDS=({words}); COMP_CWORD=$((${{#COMP_WORDS[@]}}-1)); COMPREPLY=()\n\
         _photonmill photonmill \"${{COMP_WORDS[-1]}}\" \"${{COMP_WORDS[-2]}}\"; echo \"${{COMPREPLY[*]}}\""
    );
    let output = std::process::Command::new("bash").args(["-c", &script]).current_dir(place.path()).output().expect("bash is there");
    assert!(output.status.success(), "{}", text(&output.stderr));
    text(&output.stdout).split_whitespace().map(ToOwned::to_owned).collect()
}

#[test]
fn shells_complete_commands_options_values_and_scenes() {
    let place = Place::new();
    assert_eq!(completed(&place, "photonmill ren"), ["render"]);
    assert_eq!(completed(&place, "photonmill render corn"), ["cornell", "cornell-spheres"]);
    assert_eq!(completed(&place, "photonmill bake x --vari"), ["--variant"]);
    assert_eq!(completed(&place, "photonmill render x --variant at"), ["atomic"]);
    assert_eq!(completed(&place, "photonmill repeat --conf"), ["--config"]);
    for shell in ["zsh", "fish", "powershell", "elvish"] {
        let stdout = text(&place.run(&format!("completions {shell}")).stdout);
        assert!(stdout.contains("caustic-photons") && stdout.contains("selfcheck"), "{shell}");
    }
}

/// A page for each command, with all of its options and examples, of which man has nothing to complain.
#[test]
fn manual_pages_are_whole() {
    let place = Place::new();
    place.said("man pages");
    let names = entries(&place.at("pages"));
    assert!(names.len() > 15 && names.contains(&"photonmill-map-export.1".to_owned()), "{names:?}");
    assert_eq!(text(&place.run("man").stdout), place.text("pages/photonmill.1"));
    let page = place.text("pages/photonmill-render.1").replace('\\', "");
    assert_says(&page, [".TH photonmill-render 1", "--caustic-photons", ".SH EXAMPLES", "--config"]);
    assert_says(&page, ["photonmill render cornell-spheres -o picture.png"]);
    let Ok(groff) = std::process::Command::new("groff")
        .args(["-man", "-ww", "-z"])
        .args(names.iter().map(|name| place.at("pages").join(name)))
        .output()
    else {
        return println!("no groff here");
    };
    assert!(groff.status.success() && groff.stderr.is_empty(), "{}", text(&groff.stderr));
}
