//! The order of the house, read off the sources: a module may use what stands to its left on the
//! straight line, the engine sees no scene and no plan, and the CPU builder, as a judge, no engine.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// What everyone may use, and what among itself has no order.
const GROUND: [&str; 12] =
    ["text", "error", "bias", "unknown", "constants", "records", "path", "photon", "ledger", "rng", "settings", "timings"];
/// From left to right.
const LINE: [&str; 24] = [
    "scene",
    "judge",
    "plan",
    "gpu",
    "nonfinite_values",
    "tallies",
    "totals",
    "prefix_sum",
    "resources",
    "trace",
    "index",
    "estimate",
    "film",
    "render",
    "transport",
    "selfcheck",
    "output",
    "bake",
    "paper",
    "compaction",
    "study",
    "bench",
    "cli",
    "main",
];
/// Beside the line: seen by `render` and what follows it.
const CPU: &str = "cpu";

/// Whether module `from` may use module `to`.
fn allowed(from: &str, to: &str) -> bool {
    let place = |module: &str| LINE.iter().position(|name| *name == module);
    if from == to || from == "lib" {
        return true;
    }
    if GROUND.contains(&from) {
        return GROUND.contains(&to);
    }
    match from {
        // The engine knows no photon.
        "gpu" => ["text", "error", "records", "constants", "ledger", "timings"].contains(&to),
        CPU => GROUND.contains(&to) || ["scene", "plan"].contains(&to),
        _ if GROUND.contains(&to) => place(from).is_some(),
        _ if to == CPU => place(from) >= place("render"),
        _ => matches!((place(from), place(to)), (Some(from), Some(to)) if to < from),
    }
}

/// The source without comments and without the content of strings, line breaks kept.
fn code_of(source: &str) -> String {
    let mut code = String::with_capacity(source.len());
    let mut rest = source.chars().peekable();
    while let Some(symbol) = rest.next() {
        match symbol {
            '/' if rest.peek() == Some(&'/') => {
                while rest.peek().is_some_and(|next| *next != '\n') {
                    rest.next();
                }
            }
            '/' if rest.peek() == Some(&'*') => {
                let mut before = ' ';
                for next in rest.by_ref() {
                    if next == '\n' {
                        code.push('\n');
                    }
                    if before == '*' && next == '/' {
                        break;
                    }
                    before = next;
                }
            }
            '"' => {
                code.push('"');
                while let Some(next) = rest.next() {
                    match next {
                        '\\' => drop(rest.next()),
                        '"' => break,
                        '\n' => code.push('\n'),
                        _ => {}
                    }
                }
                code.push('"');
            }
            // A quote that is a character and no string; a lifetime has no second apostrophe there.
            '\'' if rest.clone().nth(1) == Some('\'') => {
                rest.nth(1);
                code.push_str("' '");
            }
            _ => code.push(symbol),
        }
    }
    code
}

/// Top-level modules that a source names by paths from the crate's root (`prefix` and two colons),
/// grouped uses included.
fn modules_used(code: &str, prefix: &str) -> BTreeSet<String> {
    let identifier = |text: &str| text.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect::<String>();
    let mut used = BTreeSet::new();
    for (at, found) in code.match_indices(prefix) {
        let before = code[..at].chars().next_back();
        if before.is_some_and(|c| c.is_alphanumeric() || c == '_' || c == ':' || c == '$') {
            continue;
        }
        let path = &code[at + found.len()..];
        let Some(group) = path.strip_prefix('{') else {
            used.insert(identifier(path));
            continue;
        };
        let mut depth = 0;
        let mut starts = true;
        for (offset, symbol) in group.char_indices() {
            match symbol {
                '{' => depth += 1,
                '}' if depth == 0 => break,
                '}' => depth -= 1,
                ',' if depth == 0 => starts = true,
                _ if symbol.is_whitespace() => {}
                _ if starts => {
                    used.insert(identifier(&group[offset..]));
                    starts = false;
                }
                _ => {}
            }
        }
    }
    used.remove("");
    used
}

/// Arrows to the right in one source: what the module must not name.
fn wrong_arrows(module: &str, is_root_file: bool, source: &str) -> Vec<String> {
    let code = code_of(source);
    let mut used = modules_used(&code, "crate::");
    used.extend(modules_used(&code, "photonmill::"));
    // In src/NAME.rs the parent is the crate itself; deeper down it is the module's own folder, and
    // two steps up from src/NAME/PART.rs is the crate.
    let climbs = if is_root_file { "super::" } else { "super::super::" };
    used.extend(
        modules_used(&code, climbs)
            .into_iter()
            .filter(|name| GROUND.contains(&name.as_str()) || LINE.contains(&name.as_str()) || name == CPU),
    );
    used.into_iter().filter(|to| !allowed(module, to)).map(|to| format!("{module} must not use {to}")).collect()
}

fn root(folder: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(folder)
}

/// Files below a folder, with their content.
fn files(folder: &Path) -> Vec<(PathBuf, String)> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(files(&path));
        } else if path.extension().is_some_and(|extension| ["rs", "glsl", "comp"].iter().any(|known| extension == *known)) {
            let source = fs::read_to_string(&path).unwrap();
            found.push((path, source));
        }
    }
    found
}

/// Top-level module of a file, and whether it is that module's only file at the root.
fn module_of(path: &Path) -> (String, bool) {
    let inside = path.strip_prefix(root("src")).unwrap();
    let first = inside.components().next().unwrap().as_os_str().to_string_lossy().into_owned();
    (first.trim_end_matches(".rs").to_owned(), inside.components().count() == 1)
}

fn has_word(code: &str, word: &str) -> bool {
    code.split(|c: char| !(c.is_alphanumeric() || c == '_')).any(|found| found == word)
}

/// Lines on which the preprocessor forks inside a function.
fn forks_in_functions(source: &str) -> Vec<usize> {
    let mut depth = 0i32;
    let mut lines = Vec::new();
    for (number, line) in code_of(source).lines().enumerate() {
        let directive = line.trim_start();
        let forks = ["#if", "#elif", "#else", "#endif"].iter().any(|fork| directive.replace("# ", "#").starts_with(fork));
        if depth > 0 && forks {
            lines.push(number + 1);
        }
        depth += line.matches('{').count() as i32 - line.matches('}').count() as i32;
    }
    lines
}

/// The path of a file's module: `plan::memory` of src/plan/memory.rs.
fn module_path(inside: &Path) -> String {
    let names: Vec<String> = inside.with_extension("").iter().map(|name| name.to_string_lossy().into_owned()).collect();
    names.join("::").trim_end_matches("::mod").to_owned()
}

/// What a tree of a `use` line names, its groups opened.
fn opened(tree: &str) -> Vec<String> {
    let Some((prefix, group)) = tree.split_once('{') else {
        return vec![tree.trim().to_owned()];
    };
    let group = group.trim_end().strip_suffix('}').expect("a group ends");
    let mut depth = 0;
    let parts = group.split(|symbol| {
        depth += i32::from(symbol == '{') - i32::from(symbol == '}');
        symbol == ',' && depth == 0
    });
    parts.filter(|part| !part.trim().is_empty()).flat_map(opened).map(|part| format!("{}{part}", prefix.trim())).collect()
}

/// The modules of files that the `use` lines of a file name. A folder's own file and what is in the folder belong together.
fn files_used(module: &str, code: &str, known: &BTreeSet<String>) -> BTreeSet<String> {
    let lines = format!("\n{code}");
    let uses = ["\nuse ", "\npub use ", "\npub(super) use ", "\npub(crate) use "].map(|start| {
        let trees: Vec<String> = lines.split(start).skip(1).map(|rest| rest.split(';').next().unwrap_or("").to_owned()).collect();
        trees
    });
    let resolved = |path: String| {
        let mut base: Vec<&str> = module.split("::").collect();
        let mut names = path.split("::").peekable();
        match names.peek() {
            Some(&"crate") => {
                names.next();
                base.clear();
            }
            Some(&"super") => {
                while names.next_if_eq(&"super").is_some() {
                    base.pop();
                }
            }
            Some(&"self") => drop(names.next()),
            // Of the file itself, or of another crate.
            _ => {}
        }
        base.extend(names.map(|name| name.split(' ').next().unwrap_or(name)));
        (1..=base.len()).rev().map(|length| base[..length].join("::")).find(|path| known.contains(path))
    };
    let is_kin = |other: &str| other.starts_with(&format!("{module}::")) || module.starts_with(&format!("{other}::"));
    uses.into_iter()
        .flatten()
        .flat_map(|tree| opened(&tree))
        .filter_map(resolved)
        .filter(|other| other != module && !is_kin(other))
        .collect()
}

/// A circle of files that use each other, the first again at the end.
fn circle(sources: &BTreeMap<String, String>) -> Option<Vec<String>> {
    let known: BTreeSet<String> = sources.keys().cloned().collect();
    let arrows: BTreeMap<&str, BTreeSet<String>> =
        sources.iter().map(|(module, source)| (module.as_str(), files_used(module, &code_of(source), &known))).collect();
    // What is in no circle.
    let mut done = BTreeSet::new();
    fn search(module: &str, way: &mut Vec<String>, arrows: &BTreeMap<&str, BTreeSet<String>>, done: &mut BTreeSet<String>) -> bool {
        if done.contains(module) {
            return false;
        }
        if let Some(first) = way.iter().position(|before| before == module) {
            way.drain(..first);
            way.push(module.to_owned());
            return true;
        }
        way.push(module.to_owned());
        if arrows[module].iter().any(|next| search(next, way, arrows, done)) {
            return true;
        }
        done.insert(way.pop().expect("what was pushed"));
        false
    }
    arrows.keys().find_map(|module| {
        let mut way = Vec::new();
        search(module, &mut way, &arrows, &mut done).then_some(way)
    })
}

#[test]
fn no_files_use_each_other_in_a_circle() {
    let folder = root("src");
    let sources: BTreeMap<String, String> =
        files(&folder).into_iter().map(|(path, source)| (module_path(path.strip_prefix(&folder).unwrap()), source)).collect();
    assert!(sources.len() > 100, "{} sources", sources.len());
    assert_eq!(circle(&sources), None);

    let of =
        |sources: &[(&str, &str)]| circle(&sources.iter().map(|(module, source)| ((*module).to_owned(), (*source).to_owned())).collect());
    let three =
        [("a", ""), ("a::b", "use super::c::{self, D};"), ("a::c", "pub use crate::{e::{F, G}, h};"), ("e", "use crate::a::b::B as C;")];
    assert_eq!(of(&three).unwrap(), ["a::b", "a::c", "e", "a::b"]);
    assert_eq!(of(&[("a", "use self::b::B;"), ("a::b", "use super::A;\nmod tests {\n    use super::*;\n}"), ("b", "use std::fmt;")]), None);
}

#[test]
fn no_arrow_points_to_the_right() {
    let sources = files(&root("src"));
    assert!(sources.len() > 30, "{} sources", sources.len());
    let wrong: Vec<String> = sources
        .iter()
        .flat_map(|(path, source)| {
            let (module, is_root_file) = module_of(path);
            wrong_arrows(&module, is_root_file, source)
                .into_iter()
                .map(|complaint| format!("{}: {complaint}", path.display()))
                .collect::<Vec<_>>()
        })
        .collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn every_module_has_its_place() {
    for (path, _) in files(&root("src")) {
        let (module, _) = module_of(&path);
        let known =
            GROUND.contains(&module.as_str()) || LINE.contains(&module.as_str()) || [CPU, "lib", "guide"].contains(&module.as_str());
        assert!(known, "{}: say in this test where {module} stands", path.display());
    }
}

/// A file of tests that no program names would never run.
#[test]
fn every_file_of_tests_is_run() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"));
    let [modules, programs] = ["tests/main.rs", "Cargo.toml"].map(|file| fs::read_to_string(folder.join(file)).unwrap());
    let found = fs::read_dir(folder.join("tests")).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let names: Vec<String> = found.filter_map(|file| Some(file.strip_suffix(".rs")?.to_owned())).collect();
    assert!(names.len() > 30, "{names:?}");
    for name in names {
        let is_run = modules.contains(&format!("\nmod {name};\n")) || programs.contains(&format!("path = \"tests/{name}.rs\""));
        assert!(is_run, "tests/{name}.rs is in neither tests/main.rs nor Cargo.toml");
    }
}

#[test]
fn vulkan_and_unsafe_stay_in_the_engine() {
    for (path, source) in files(&root("src")) {
        if module_of(&path).0 == "gpu" {
            continue;
        }
        let code = code_of(&source);
        assert!(!has_word(&code, "unsafe"), "{}: unsafe", path.display());
        assert!(!has_word(&code, "ash"), "{}: ash", path.display());
    }
}

#[test]
fn no_kernel_forks_inside_a_function() {
    let sources = files(&root("glsl"));
    assert!(sources.len() > 30, "{} sources", sources.len());
    for (path, source) in sources {
        let lines = forks_in_functions(&source);
        assert!(lines.is_empty(), "{}: lines {lines:?}", path.display());
    }
}

/// Ways in which one invocation waits for another. No device promises that the other one moves on.
fn waits(source: &str) -> Vec<&'static str> {
    let code = code_of(source);
    ["atomicCompSwap", "atomicExchange", "coherent", "volatile", "while (atomic", "while (!atomic"]
        .into_iter()
        .filter(|way| code.contains(way))
        .collect()
}

/// Sums of floats, where bits are compared and swapped without a wait: a try fails only where another's addition
/// went in, so that somebody moves on whatever the device promises.
const LOCK_FREE: [&str; 2] = ["film/f32.glsl", "film/compensated.glsl"];

#[test]
fn no_kernel_waits_for_another_invocation() {
    for (path, source) in files(&root("glsl")) {
        let allowed: &[&str] = if LOCK_FREE.iter().any(|file| path.ends_with(file)) { &["atomicCompSwap"] } else { &[] };
        assert_eq!(waits(&source), allowed, "{}", path.display());
    }
    assert_eq!(waits("while (atomicCompSwap(lock, 0, 1) != 0) {}").len(), 2);
    assert!(waits("// atomicExchange would wait\natomicAdd(count, 1);").is_empty());
}

#[test]
fn the_check_complains_about_arrows_to_the_right() {
    let complains = |module: &str, source: &str| !wrong_arrows(module, true, source).is_empty();
    assert!(complains("gpu", "use crate::plan::Plan;"));
    assert!(complains("gpu", "use crate::scene;"));
    assert!(complains("plan", "fn f() { crate::gpu::check::run() }"));
    assert!(complains("scene", "use crate::{error::Result, gpu::{Buffer, Gpu}};"));
    assert!(complains("cpu", "use crate::resources::Resources;"));
    assert!(complains("film", "use super::render::RunResult;"));
    assert!(complains("estimate", "use crate::cpu::index::Index;"));
    assert!(complains("records", "use crate::scene::room::RoomScene;"));
    assert!(complains("trace", "use crate::{\n    error::Result,\n    index,\n};"));
    assert!(!wrong_arrows("plan", false, "use super::super::gpu::Gpu;").is_empty());

    assert!(!complains("trace", "use crate::{error::{Error, Result}, resources, plan::{self, Plan}};"));
    assert!(!complains("plan", "//! See [`crate::film`].\n/* crate::gpu */ const A: &str = \"crate::gpu\";"));
    assert!(!complains("render", "use crate::{cpu, film, gpu};"));
    assert!(wrong_arrows("gpu", false, "use super::{Buffer, kernel};").is_empty());
}

#[test]
fn the_check_complains_about_unsafe_code_and_forks() {
    assert!(has_word(&code_of("fn f() { unsafe { g() } }"), "unsafe"));
    assert!(!has_word(&code_of("#![deny(unsafe_code)] // unsafe\nlet s = \"unsafe\"; let c = '\"'; let d = '\"';"), "unsafe"));
    assert!(has_word(&code_of("use ash::vk;"), "ash"));
    assert_eq!(forks_in_functions("#if A\nvoid f()\n{\n    x();\n#ifdef B\n    y();\n#endif\n}\n#endif\n"), [5, 7]);
    assert!(forks_in_functions("#if A\nvoid f() { // {\n}\n#else\nvoid f() {}\n#endif\n").is_empty());
}
