//! Scripts beside the program: no test runs most of them, as they need other programs, a GPU or a night. Each must at least be one
//! that its interpreter can read.

use std::process::{Command, Output};

use crate::common::prelude::*;
use crate::common::program::entries;
use crate::common::sources::root;

/// Lines of code in all. It may only fall: where a change needs more, another part gets shorter.
const MOST_LINES: u32 = 92_050;

/// Files below a folder.
fn below(folder: &str) -> Vec<String> {
    let paths = entries(&root(folder)).into_iter().map(|name| format!("{folder}/{name}"));
    let is_made = |path: &String| ["corpus", "artifacts", "target", "__pycache__", "node_modules"].iter().any(|made| path.ends_with(made));
    paths.filter(|path| !is_made(path)).flat_map(|path| if root(&path).is_dir() { below(&path) } else { vec![path] }).collect()
}

/// What reads a script without running it, by its first line or its name.
fn reader(path: &str, first_line: &str) -> Option<[&'static str; 2]> {
    let is = |interpreter: &str, end: &str| (first_line.starts_with("#!") && first_line.ends_with(interpreter)) || path.ends_with(end);
    match () {
        () if is("bash", ".sh") => Some(["bash", "-n"]),
        () if is("python3", ".py") => Some(["python3", "-c"]),
        () if is("node", ".mjs") || path.ends_with(".js") => Some(["node", "--check"]),
        () => None,
    }
}

/// Python takes all files at once, others one. `None` where the interpreter is not installed.
fn parsed(paths: &[String], [program, argument]: [&str; 2]) -> Option<Output> {
    let mut command = Command::new(program);
    command.arg(argument);
    if program == "python3" {
        command.arg("import ast, sys; [ast.parse(open(path, encoding='utf-8').read(), path) for path in sys.argv[1:]]");
    }
    command.args(paths.iter().map(|path| root(path))).output().ok()
}

#[test]
fn every_script_can_be_read() {
    let mut scripts: BTreeMap<[&str; 2], Vec<String>> = BTreeMap::new();
    for path in below("tools").into_iter().chain(below(".ci")) {
        let content = std::fs::read(root(&path)).unwrap();
        let first_line = String::from_utf8_lossy(content.split(|byte| *byte == b'\n').next().unwrap_or_default()).into_owned();
        let Some(reader) = reader(&path, &first_line) else { continue };
        scripts.entry(reader).or_default().push(path);
    }
    let readers: BTreeMap<&str, usize> = scripts.iter().map(|(reader, paths)| (reader[0], paths.len())).collect();
    for (reader, paths) in &scripts {
        let at_once = if reader[0] == "python3" { paths.len() } else { 1 };
        for paths in paths.chunks(at_once) {
            match parsed(paths, *reader) {
                Some(output) => assert!(output.status.success(), "{paths:?}: {}", text(&output.stderr)),
                None => println!("SKIPPED: {paths:?}, as there is no {}", reader[0]),
            }
        }
    }
    assert!(readers["bash"] > 10 && readers["python3"] > 15 && readers["node"] >= 2, "{readers:?}");

    let place = Place::new();
    for (name, content) in [("a.sh", "if true; then\n"), ("a.py", "def f(:\n")] {
        place.write(name, content);
        let path = place.at(name).to_str().unwrap().to_owned();
        let reader = reader(&path, "").unwrap();
        assert!(parsed(&[path], reader).is_none_or(|output| !output.status.success()), "{name}");
    }
}

#[test]
fn the_code_does_not_grow() {
    let output = Command::new(root("tools/lines")).output().unwrap();
    let counted = text(&output.stdout);
    let total = counted.lines().last().and_then(|line| line.trim().strip_suffix(" in all")?.parse::<u32>().ok());
    assert!(
        total.is_some_and(|total| 50_000 < total && total <= MOST_LINES),
        "more than {MOST_LINES} lines: {counted}{}",
        text(&output.stderr)
    );
}
