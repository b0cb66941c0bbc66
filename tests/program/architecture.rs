//! The order of the house, read off the sources: a file uses only what stands to its left on the line, no files use each
//! other in a circle, the device layer knows no photon, and the CPU's twin and the judge know no engine.

use crate::common::prelude::*;
use crate::common::sources::{files, read, root};

/// From left to right; what stands side by side does not know each other. The longest name decides for a file.
const LINE: &[&[&str]] = &[
    &["constants", "error", "text", "records", "rng", "ledger", "timings"],
    &["settings", "photon_state", "photon"],
    &["scene"],
    &["verify::judge", "plan"],
    &["cpu", "gpu", "oidn"],
    &[
        "engine",
        "engine::error",
        "engine::error::bias",
        "engine::error::degrees_of_freedom",
        "engine::error::measure",
        "engine::error::unknown",
        "engine::nonfinite_values",
        "engine::planned",
        "engine::prefix_sum",
        "engine::run::blocks",
        "engine::run::identity",
        "engine::tallies",
        "engine::totals",
    ],
    &["engine::film", "engine::error::bound", "engine::error::differences"],
    &["engine::room::film", "engine::scene::film"],
    &["engine::run::saved"],
    &["engine::run::watch", "engine::replay"],
    &["engine::error::bias_batches"],
    &["engine::run"],
    &["engine::run::several_devices"],
    &["engine::run::retry"],
    &["engine::room", "engine::scene"],
    &["engine::choose_builder"],
    &["output"],
    &["bake", "measure::compaction", "measure::line_fit", "verify::compare"],
    &["render"],
    &["measure::interval", "verify::selfcheck"],
    &["measure::paper"],
    &["measure::study"],
    &["measure::bench", "measure::gallery", "window"],
    &["cli"],
    &["main", "lib"],
];
/// Files of the first group may use each other.
const GROUND: usize = 0;
/// What the device layer may use: it knows no photon.
const FOR_GPU: [&str; 6] = ["constants", "error", "text", "records", "ledger", "timings"];
/// Modules that only name their parts.
const SIGNPOSTS: [&str; 2] = ["measure", "verify"];

/// The entry of [`LINE`] that a file's module belongs to, and where it stands.
fn place(module: &str) -> Option<(usize, &'static str)> {
    let holds = |entry: &str| module == entry || module.starts_with(&format!("{entry}::"));
    let entries = LINE.iter().enumerate().flat_map(|(place, group)| group.iter().map(move |entry| (place, *entry)));
    entries.filter(|(_, entry)| holds(entry)).max_by_key(|(_, entry)| entry.len())
}

/// Whether a file may use another.
fn allowed(from: &str, to: &str) -> bool {
    let (Some((from, of)), Some((to, other))) = (place(from), place(to)) else { return true };
    of == other || (from == GROUND && to == GROUND) || (to < from && (of != "gpu" || FOR_GPU.contains(&other)))
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

const SHADERS: [&str; 2] = [".glsl", ".comp"];

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

/// The path of a file's module: `plan::buffers` of src/plan/buffers.rs.
fn module_path(inside: &str) -> String {
    let names: Vec<String> = Path::new(inside).with_extension("").iter().map(|name| name.to_string_lossy().into_owned()).collect();
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

/// The modules of files that a file names, in `use` lines and in paths from the crate's root. A folder's own file and what is in
/// the folder belong together.
fn files_used(module: &str, code: &str, known: &BTreeSet<String>) -> BTreeSet<String> {
    let lines = format!("\n{code}");
    let starts = ["\nuse ", "\npub use ", "\npub(super) use ", "\npub(crate) use "];
    let uses = starts.into_iter().flat_map(|start| lines.split(start).skip(1)).map(|rest| rest.split(';').next().unwrap_or(""));
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
    // What tests at a file's end name is no part of the house.
    let code = code.split("#[cfg(test)]").next().unwrap_or(code);
    let is_name = |symbol: char| symbol.is_alphanumeric() || symbol == '_' || symbol == ':';
    let paths = ["crate::", "photonmill::"].into_iter().flat_map(|root| code.split(root).skip(1));
    let paths = paths.map(|rest| format!("crate::{}", rest.chars().take_while(|symbol| is_name(*symbol)).collect::<String>()));
    let is_kin = |other: &str| other.starts_with(&format!("{module}::")) || module.starts_with(&format!("{other}::"));
    uses.flat_map(opened).chain(paths).filter_map(resolved).filter(|other| other != module && !is_kin(other)).collect()
}

/// Which file uses which.
fn arrows(sources: &BTreeMap<String, String>) -> Vec<[String; 2]> {
    let known: BTreeSet<String> = sources.keys().cloned().collect();
    let of_file = |(module, source): (&String, &String)| {
        let from = module.clone();
        files_used(module, &code_of(source), &known).into_iter().map(move |to| [from.clone(), to]).collect::<Vec<_>>()
    };
    sources.iter().flat_map(of_file).collect()
}

/// Arrows of circles, and from one circle to another: what is left when those are taken away, again and again, that start where none ends
/// or end where none starts.
fn circles(sources: &BTreeMap<String, String>) -> Vec<[String; 2]> {
    let mut left = arrows(sources);
    loop {
        let count = left.len();
        let [starts, ends] = [0, 1].map(|end| left.iter().map(|arrow| arrow[end].clone()).collect::<HashSet<String>>());
        left.retain(|[from, to]| ends.contains(from) && starts.contains(to));
        if left.len() == count {
            return left;
        }
    }
}

#[test]
fn no_files_use_each_other_in_a_circle() {
    let found = circles(&sources());
    assert!(found.is_empty(), "{found:?}");

    let of =
        |sources: &[(&str, &str)]| circles(&sources.iter().map(|(module, source)| ((*module).to_owned(), (*source).to_owned())).collect());
    let three =
        [("a", ""), ("a::b", "use super::c::{self, D};"), ("a::c", "pub use crate::{e::{F, G}, h};"), ("e", "use crate::a::b::B as C;")];
    assert_eq!(of(&three), [["a::b", "a::c"], ["a::c", "e"], ["e", "a::b"]]);
    let none = [("a", "use self::b::B;"), ("a::b", "use super::A;\nmod tests {\n    use super::*;\n}"), ("b", "use std::fmt;")];
    assert!(of(&none).is_empty());
}

/// Files by module.
fn sources() -> BTreeMap<String, String> {
    files("src", &[".rs"]).into_iter().map(|(path, source)| (module_path(path.strip_prefix("src/").unwrap()), source)).collect()
}

/// Arrows to the right.
fn wrong_arrows(sources: &BTreeMap<String, String>) -> Vec<String> {
    let wrong = arrows(sources).into_iter().filter(|[from, to]| !allowed(from, to));
    wrong.map(|[from, to]| format!("{from} must not use {to}")).collect()
}

#[test]
fn no_arrow_points_to_the_right() {
    let sources = sources();
    assert!(sources.len() > 100, "{} sources", sources.len());
    assert_eq!(wrong_arrows(&sources), Vec::<String>::new());
    for module in sources.keys().filter(|module| !SIGNPOSTS.contains(&module.as_str()) && !module.starts_with("guide")) {
        assert!(place(module).is_some(), "say in this test where {module} stands");
    }
}

/// A comment or page that sends its reader to a file that is not there.
#[test]
fn files_that_are_named_exist() {
    let is_path = |symbol: char| symbol.is_ascii_alphanumeric() || "_/.*".contains(symbol);
    let pages = ["README.md", "src/guide/architecture.md", "src/guide/performance.md"];
    let pages = pages.map(|page| (page.to_owned(), read(page)));
    for (path, text) in files("src", &[".rs"]).into_iter().chain(files("glsl", &SHADERS)).chain(pages) {
        for named in text.split(|symbol| !is_path(symbol)) {
            let named = named.trim_end_matches('.');
            let is_ours = ["src/", "glsl/"].iter().any(|folder| named.starts_with(folder));
            if !is_ours || ![".rs", ".glsl", ".comp"].iter().any(|end| named.ends_with(end)) || named.contains('*') {
                continue;
            }
            let worlds = ["room", "scene"].map(|world| root(&named.replace("WORLD", world)));
            assert!(worlds.iter().all(|file| file.exists()), "{path} names {named}");
        }
    }
}

/// Items that are `pub` at the top level of a file, by path: what the library shows, or gives as the type of something that it shows.
fn public_items(sources: &BTreeMap<String, String>) -> BTreeSet<String> {
    const BEFORE_NAMES: [&str; 9] = ["async", "const", "enum", "fn", "static", "struct", "trait", "type", "unsafe"];
    let of_file = |(module, source): (&String, &String)| {
        let path = |name: &str| format!("{module}::{name}").trim_start_matches("lib::").to_owned();
        // What is indented is a field or a method, but for a type in a macro that writes more of it.
        let is_type = |line: &str| ["pub enum ", "pub struct "].iter().any(|start| line.starts_with(start) && !line.contains('$'));
        let at_the_edge = |line: &str| Some(line.trim_start()).filter(|trimmed| is_type(trimmed)).unwrap_or(line).to_owned();
        let code = format!("\n{}", code_of(source).lines().map(at_the_edge).collect::<Vec<_>>().join("\n"));
        let names = |item: &str| match item.strip_prefix("use ").and_then(|rest| rest.split(';').next()) {
            Some(tree) => opened(tree).iter().map(|used| path(used.rsplit([':', ' ']).next().unwrap_or_default())).collect(),
            None => {
                let mut words = item.split(|letter: char| !(letter.is_alphanumeric() || letter == '_'));
                words.find(|word| !BEFORE_NAMES.contains(word)).filter(|word| *word != "mod").map(path).into_iter().collect::<Vec<_>>()
            }
        };
        code.split("\npub ").skip(1).flat_map(names).collect::<Vec<_>>()
    };
    sources.iter().flat_map(of_file).collect()
}

/// Whether the modules of a path are public.
fn is_reached(sources: &BTreeMap<String, String>, path: &str) -> bool {
    path.match_indices("::").all(|(end, _)| {
        let (parent, module) = path[..end].rsplit_once("::").unwrap_or(("lib", &path[..end]));
        sources.get(parent).is_some_and(|source| format!("\n{source}").contains(&format!("\npub mod {module};")))
    })
}

/// What is public stays as it is until x of 0.x rises, so that nothing is by chance: a list has all of it.
#[test]
fn what_is_public_is_promised() {
    let promised = read("tests/program/promised.txt");
    let promised: BTreeSet<String> = promised.lines().filter(|line| !line.starts_with('#')).map(str::to_owned).collect();
    let public = public_items(&sources());
    let differences: Vec<&String> = public.symmetric_difference(&promised).collect();
    assert!(differences.is_empty(), "public and not in promised.txt, or in it and not public: {differences:?}");
    // By one of its paths, if `pub use` shows it at several.
    let sources = sources();
    let is_shown = |name: &str| promised.iter().any(|path| path.ends_with(&format!("::{name}")) && is_reached(&sources, path));
    let hidden: Vec<&String> = promised.iter().filter(|path| !path.rsplit("::").next().is_some_and(is_shown)).collect();
    assert!(hidden.is_empty(), "promised, in modules that are private: {hidden:?}");

    let a =
        "pub use b::{C, d::E as F};\npub const fn g() {}\npub(crate) fn h() {}\nimpl C {\n    pub fn i() {}\n}\nx! {\n    pub enum J {}\n}";
    let sources = [("lib", "pub mod a;\npub struct K;"), ("a", a)].map(|(module, source)| (module.to_owned(), source.to_owned()));
    assert_eq!(public_items(&sources.into()), ["K", "a::C", "a::F", "a::J", "a::g"].map(str::to_owned).into());
}

/// A file of tests that no module names would never run.
#[test]
fn every_file_of_tests_is_run() {
    let programs = read("Cargo.toml") + &read("src/lib.rs");
    let mut modules = 0;
    for (path, _) in files("tests", &[".rs"]) {
        let (folder, file) = path.rsplit_once('/').expect("it lies in tests");
        let name = file.strip_suffix(".rs").expect("it is a file of Rust");
        let list = if folder == "tests" { "tests/main.rs".to_owned() } else { format!("{folder}/mod.rs") };
        let is_named = name == "mod" || read(&list).contains(&format!("\npub mod {name};\n"));
        assert!(is_named || programs.contains(&format!("{path}\"")), "{path} is in neither {list} nor Cargo.toml nor src/lib.rs");
        modules += usize::from(is_named);
    }
    assert!(modules > 60, "{modules} modules");
}

#[test]
fn vulkan_and_unsafe_stay_in_the_engine() {
    for (path, source) in files("src", &[".rs"]).into_iter().filter(|(path, _)| !path.starts_with("src/gpu/")) {
        let code = code_of(&source);
        // What is loaded at run time is as unsafe as Vulkan.
        assert!(path == "src/oidn.rs" || !has_word(&code, "unsafe"), "{path}: unsafe");
        assert!(!has_word(&code, "ash"), "{path}: ash");
    }
}

/// The clock of the day may be set while a run goes on; times are taken by one that only runs forward.
#[test]
fn nothing_goes_by_the_clock_of_the_day() {
    for (path, source) in files("src", &[".rs"]) {
        assert!(!has_word(&code_of(&source), "SystemTime"), "{path}: SystemTime");
    }
}

#[test]
fn no_kernel_forks_inside_a_function() {
    let sources = files("glsl", &SHADERS);
    assert!(sources.len() > 30, "{} sources", sources.len());
    for (path, source) in sources {
        let lines = forks_in_functions(&source);
        assert!(lines.is_empty(), "{path}: lines {lines:?}");
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
const LOCK_FREE: [&str; 2] = ["film/float_two_words.glsl", "film/float_u64.glsl"];

#[test]
fn no_kernel_waits_for_another_invocation() {
    for (path, source) in files("glsl", &SHADERS) {
        let allowed: &[&str] = if LOCK_FREE.iter().any(|file| path.ends_with(file)) { &["atomicCompSwap"] } else { &[] };
        assert_eq!(waits(&source), allowed, "{path}");
    }
    assert_eq!(waits("while (atomicCompSwap(lock, 0, 1) != 0) {}").len(), 2);
    assert!(waits("// atomicExchange would wait\natomicAdd(count, 1);").is_empty());
}

#[test]
fn the_check_complains_about_arrows_to_the_right() {
    // Every file that is named below exists; the first one has the source.
    let complains = |module: &str, source: &str| {
        let mut sources: BTreeMap<String, String> = sources().into_keys().map(|module| (module, String::new())).collect();
        assert!(sources.insert(module.to_owned(), source.to_owned()).is_some(), "{module}");
        !wrong_arrows(&sources).is_empty()
    };
    assert!(complains("gpu", "use crate::plan::RoomPlan;"));
    assert!(complains("gpu", "use crate::scene;"));
    assert!(complains("gpu::buffer", "use crate::photon::Photon;"));
    assert!(complains("plan::buffers", "fn f() { crate::gpu::check::run() }"));
    assert!(complains("scene", "use crate::{error::Result, gpu::{Buffer, Gpu}};"));
    assert!(complains("cpu", "use crate::engine::room::resources::RoomResources;"));
    assert!(complains("verify::judge::camera_path", "use crate::engine::scene::Viewpoint;"));
    assert!(complains("records", "use crate::scene::room::RoomScene;"));
    assert!(complains("engine::room::trace", "use crate::{\n    error::Result,\n    output,\n};"));
    assert!(complains("engine::room", "use super::scene::Viewpoint;"));
    assert!(complains("engine::scene::film", "use super::super::room::film::RoomFilm;"));
    assert!(complains("engine::run::watch", "use crate::engine::choose_builder::Choice;"));
    assert!(complains("engine::run", "use super::room::trace::chunk;"));

    assert!(!complains("engine::room::trace", "use crate::{error::{Error, Result}, engine::tallies, plan::{self, RoomPlan}};"));
    assert!(!complains("plan", "//! See [`crate::engine::room`].\n/* crate::gpu */ const A: &str = \"crate::gpu\";"));
    assert!(!complains("engine::choose_builder", "use super::room;\nuse crate::gpu;"));
    assert!(!complains("gpu::kernel", "use super::{Buffer, device};\nuse crate::error;"));
}

#[test]
fn the_check_complains_about_unsafe_code_and_forks() {
    assert!(has_word(&code_of("fn f() { unsafe { g() } }"), "unsafe"));
    assert!(!has_word(&code_of("#![deny(unsafe_code)] // unsafe\nlet s = \"unsafe\"; let c = '\"'; let d = '\"';"), "unsafe"));
    assert!(has_word(&code_of("use ash::vk;"), "ash"));
    assert_eq!(forks_in_functions("#if A\nvoid f()\n{\n    x();\n#ifdef B\n    y();\n#endif\n}\n#endif\n"), [5, 7]);
    assert!(forks_in_functions("#if A\nvoid f() { // {\n}\n#else\nvoid f() {}\n#endif\n").is_empty());
}
