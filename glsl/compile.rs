//! One kernel from GLSL to SPIR-V, every operation rounded by itself. Used by build.rs, and by tests that plant
//! faults in kernels.

use std::cell::RefCell;
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use shaderc::{CompileOptions, Compiler, EnvVersion, GlslProfile, OptimizationLevel, ResolvedInclude, ShaderKind, TargetEnv};

/// Kernels that exist in several forms: in the paths of their includes each word stands for one of these.
const FORMS: &[(&str, &[Word])] = &[
    ("kernels/emit.comp", &[WORLDS]),
    ("kernels/trace.comp", &[WORLDS, ("BUILDER", &["naive", "atomic", "ballot", "group", "scan"])]),
    ("kernels/scan_move.comp", &[WORLDS]),
    ("kernels/trace_persistent.comp", &[WORLDS]),
    ("kernels/gather.comp", &[("INDEX", &["brute", "grid", "tree"]), SUMS]),
    ("kernels/nearest.comp", &[SUMS]),
    ("kernels/gather_visible_points.comp", &[SUMS]),
    ("check/start_up.comp", &[SUMS]),
];
/// A word and what it may stand for.
type Word = (&'static str, &'static [&'static str]);
const WORLDS: Word = ("WORLD", &["room", "scene"]);
/// With 64-bit atomics and without.
const SUMS: Word = ("SUMS", &["u64", "two_words"]);

/// A kernel: of `trace.comp` in the room by ballots the name is `trace_room_ballot`.
pub struct Source {
    pub name: String,
    /// Within `glsl`.
    pub path: String,
    /// What stands for which word in the paths of its includes.
    choices: Vec<(&'static str, &'static str)>,
}

/// Every kernel, by name.
pub fn sources(glsl: &Path) -> Vec<Source> {
    let mut sources = Vec::new();
    for folder in ["kernels", "check"] {
        let entries = fs::read_dir(glsl.join(folder)).unwrap_or_else(|error| panic!("glsl/{folder}: {error}"));
        for file in entries.map(|entry| entry.expect("a folder can be read").file_name().to_string_lossy().into_owned()) {
            let Some(stem) = file.strip_suffix(".comp") else { continue };
            let path = format!("{folder}/{file}");
            let words = FORMS.iter().find(|(of, _)| *of == path).map_or(&[][..], |(_, words)| *words);
            let mut forms = vec![Source { name: stem.to_owned(), path, choices: Vec::new() }];
            for (word, values) in words {
                let with = |form: &Source, value: &'static str| Source {
                    name: format!("{}_{value}", form.name),
                    path: form.path.clone(),
                    choices: [form.choices.clone(), vec![(*word, value)]].concat(),
                };
                forms = forms.iter().flat_map(|form| values.iter().map(move |value| with(form, value))).collect();
            }
            sources.extend(forms);
        }
    }
    sources.sort_by(|a, b| a.name.cmp(&b.name));
    sources
}

/// A module, and the files that it was made from.
pub struct Compiled {
    pub words: Vec<u32>,
    pub files: BTreeSet<PathBuf>,
}

/// SPIR-V of one kernel, or shaderc's message, which names file and line.
///
/// The module is left unoptimised: drivers optimise it anyway, and the optimiser would drop names
/// and unused bindings that reflection needs.
///
/// A file that several others include stands where the first of them does so, and nowhere else.
///
/// `edit` changes the text of files on their way (path within `glsl`, text): tests plant faults by it.
pub fn compile(glsl: &Path, kernel: &Source, macros: &[(&str, u32)], edit: &dyn Fn(&str, String) -> String) -> Result<Compiled, String> {
    let read = |name: &str| -> Result<String, String> {
        let path = glsl.join(name);
        let text = fs::read_to_string(&path).map_err(|error| format!("{}: {error}", path.display()))?;
        Ok(edit(name, text))
    };
    let source = read(&kernel.path)?;
    let files = RefCell::new(BTreeSet::from([glsl.join(&kernel.path)]));
    let compiler = Compiler::new().expect("shaderc starts");
    let mut options = CompileOptions::new().expect("shaderc starts");
    options.set_forced_version_profile(460, GlslProfile::None);
    options.set_target_env(TargetEnv::Vulkan, EnvVersion::Vulkan1_3 as u32);
    options.set_optimization_level(OptimizationLevel::Zero);
    options.set_warnings_as_errors();
    for (name, value) in macros {
        options.add_macro_definition(name, Some(&format!("{value}u")));
    }
    options.set_include_callback(|name, _kind, from, _depth| {
        let name = &kernel.choices.iter().fold(name.to_owned(), |name, (word, value)| name.replace(word, value));
        let is_new = files.borrow_mut().insert(glsl.join(name));
        let content = if is_new { read(name).map_err(|error| format!("included from {from}: {error}"))? } else { String::new() };
        Ok(ResolvedInclude { resolved_name: format!("glsl/{name}"), content })
    });
    let shown = format!("glsl/{} ({})", kernel.path, kernel.name);
    let artifact =
        compiler.compile_into_spirv(&source, ShaderKind::Compute, &shown, "main", Some(&options)).map_err(|error| error.to_string())?;
    drop(options);
    let words = artifact.as_binary();
    if let Some(function) = rounded_as_the_device_likes(words) {
        return Err(format!("{shown}: {function} divides or calls a function that devices round differently; use glsl/math/math.glsl\n"));
    }
    Ok(Compiled { words: uncontracted(words), files: files.into_inner() })
}

/// Each instruction of a module: its place, its number, and its words.
fn instructions(words: &[u32]) -> impl Iterator<Item = (usize, u32, &[u32])> {
    const HEADER_WORDS: usize = 5;
    let mut at = HEADER_WORDS;
    std::iter::from_fn(move || {
        let first = *words.get(at)?;
        let instruction = (at, first & 0xffff, &words[at..at + (first >> 16) as usize]);
        at += (first >> 16) as usize;
        Some(instruction)
    })
}

const NAME: u32 = 5;
const FUNCTION: u32 = 54;

/// (id, name) of what has a name.
fn names(words: &[u32]) -> impl Iterator<Item = (u32, String)> {
    instructions(words).filter(|(_, op, _)| *op == NAME).map(|(_, _, instruction)| {
        let bytes = instruction[2..].iter().flat_map(|word| word.to_le_bytes());
        (instruction[1], bytes.take_while(|byte| !matches!(byte, 0 | b'(')).map(char::from).collect())
    })
}

/// Functions, by result id, whose names begin with one of these.
fn functions_named(words: &[u32], starts: &[&str]) -> BTreeSet<u32> {
    names(words).filter(|(_, name)| starts.iter().any(|start| name.starts_with(start))).map(|(id, _)| id).collect()
}

/// The first function, other than `native_...`, that does what Vulkan does not define to the bit: divides, takes
/// a dot product, or calls a built-in function that is neither rounding, choice, nor packing.
fn rounded_as_the_device_likes(words: &[u32]) -> Option<String> {
    const CALL_BUILT_IN: u32 = 12;
    let built_in_is_exact = |number: u32| matches!(number, 2..=9 | 37..=45 | 54..=65 | 73..=75);
    let native = functions_named(words, &["native_"]);
    let mut function = 0;
    let offender = instructions(words).find(|(_, op, instruction)| {
        if *op == FUNCTION {
            function = instruction[2];
        }
        // Quotients, remainders, products with matrices and of vectors.
        let is_open = matches!(op, 136 | 140 | 141 | 143..=148) || (*op == CALL_BUILT_IN && !built_in_is_exact(instruction[4]));
        is_open && !native.contains(&function)
    });
    offender.map(|_| names(words).find(|(id, _)| *id == function).map_or_else(String::new, |(_, name)| name))
}

/// Functions whose rounding decides no result: they may fuse a product and a sum.
const MAY_CONTRACT: [&str; 1] = ["intersect_children"];

/// Marks every floating-point operation as one to be rounded by itself, as `precise` does in GLSL: else a
/// driver may fuse and reorder operations in one pipeline and not in another, and a specialization that
/// takes an unused effect away would change the last bit of a result.
fn uncontracted(words: &[u32]) -> Vec<u32> {
    const DECORATE: u32 = 71;
    const NO_CONTRACTION: u32 = 42;
    // OpTypeVoid, the first instruction that may stand after all decorations.
    const FIRST_TYPES: std::ops::RangeInclusive<u32> = 19..=33;
    // Negation, sums, differences, products, quotients, remainders, products of vectors and matrices.
    let is_arithmetic = |op: u32| matches!(op, 127 | 129 | 131 | 133 | 136 | 140..=148);

    let free = functions_named(words, &MAY_CONTRACT);
    let decorated: BTreeSet<u32> = instructions(words)
        .filter(|(_, op, instruction)| *op == DECORATE && instruction[2] == NO_CONTRACTION)
        .map(|(_, _, instruction)| instruction[1])
        .collect();
    let mut function = 0;
    let mut results = Vec::new();
    for (_, op, instruction) in instructions(words) {
        match op {
            FUNCTION => function = instruction[2],
            op if is_arithmetic(op) && !free.contains(&function) && !decorated.contains(&instruction[2]) => results.push(instruction[2]),
            _ => {}
        }
    }
    let place = instructions(words).find(|(_, op, _)| FIRST_TYPES.contains(op)).expect("a module has types").0;
    let decorations = results.iter().flat_map(|result| [DECORATE | 3 << 16, *result, NO_CONTRACTION]);
    words[..place].iter().copied().chain(decorations).chain(words[place..].iter().copied()).collect()
}
