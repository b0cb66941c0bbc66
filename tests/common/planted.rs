//! Kernels made from changed sources, to be run in place of a device's own.

#[path = "../../glsl/compile.rs"]
mod compile;

use std::path::Path;

use photonmill::constants;

/// These kernels, with every `from` in a file under `glsl/` replaced by its `to`; each must stand there once.
pub fn kernels(names: &[&str], file: &str, changes: &[(&str, &str)]) -> Vec<(String, Vec<u32>)> {
    let glsl = Path::new(env!("CARGO_MANIFEST_DIR")).join("glsl");
    let edit = |name: &str, text: String| {
        if name != file {
            return text;
        }
        changes.iter().fold(text, |text, (from, to)| {
            assert_eq!(text.matches(from).count(), 1, "{file} says no longer {from:?}");
            text.replace(from, to)
        })
    };
    let sources = compile::sources(&glsl);
    let compile = |kernel: &&str| {
        let source = sources.iter().find(|source| source.name == *kernel).unwrap_or_else(|| panic!("there is no kernel {kernel}"));
        let compiled = compile::compile(&glsl, source, constants::SHARED_WITH_GLSL, &edit).unwrap_or_else(|error| panic!("{error}"));
        assert!(compiled.files.contains(&glsl.join(file)), "{kernel} has nothing of {file}");
        (kernel.to_string(), compiled.words)
    };
    names.iter().map(compile).collect()
}

/// Every kernel of the sources as they are.
pub fn all_kernels() -> Vec<(String, Vec<u32>)> {
    let glsl = Path::new(env!("CARGO_MANIFEST_DIR")).join("glsl");
    let compile = |source: &compile::Source| {
        let compiled =
            compile::compile(&glsl, source, constants::SHARED_WITH_GLSL, &|_, text| text).unwrap_or_else(|error| panic!("{error}"));
        (source.name.clone(), compiled.words)
    };
    compile::sources(&glsl).iter().map(compile).collect()
}
