//! The packed crate: SPIR-V of every kernel, from the sources beside it, and no shaderc by default. What who uses the library alone has to
//! build for it.

use std::fs;
use std::process::Command;

use crate::common::planted::{self, all_kernels};
use crate::common::prelude::*;
use crate::common::program::entries;
use crate::common::sources::{files, root};

/// The crate as it is unpacked.
fn packed(folder: &Path) -> PathBuf {
    let spirv = Path::new(env!("OUT_DIR")).join("spirv");
    let mut package = Command::new(root("tools/package"));
    // Whatever cargo builds is here already.
    let package =
        package.arg(folder).env("PHOTONMILL_SPIRV", spirv).env("CARGO_NET_OFFLINE", "true").output().expect("tools/package starts");
    assert!(package.status.success(), "{}", text(&package.stderr));
    let name = format!("photonmill-{}", env!("CARGO_PKG_VERSION"));
    let file = folder.join(format!("{name}.crate"));
    // What crates.io takes.
    assert!(fs::metadata(&file).unwrap().len() < 10 << 20, "{} bytes", fs::metadata(&file).unwrap().len());
    let tar = Command::new("tar").arg("xzf").arg(&file).arg("-C").arg(folder).output().expect("tar starts");
    assert!(tar.status.success(), "{}", text(&tar.stderr));
    folder.join(name)
}

/// Compares the SPIR-V of an unpacked crate with what its sources are compiled to.
fn check(folder: &Path, compiled: &[(String, Vec<u32>)]) -> Check {
    let prebuilt = folder.join("glsl/prebuilt");
    let wanted: BTreeSet<String> = compiled.iter().map(|(name, _)| format!("{name}.spv")).chain(["kernels.txt".to_owned()]).collect();
    let there: BTreeSet<String> = entries(&prebuilt).into_iter().collect();
    require(wanted == there, || format!("{:?} differ", wanted.symmetric_difference(&there)))?;
    for (name, words) in compiled {
        let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
        require(fs::read(prebuilt.join(format!("{name}.spv"))).unwrap() == bytes, || format!("{name} is of other sources"))?;
    }
    for (path, source) in files("glsl", &[".glsl", ".comp", ".rs"]).into_iter().chain(files("src", &[".rs"])) {
        require(fs::read_to_string(folder.join(&path)).is_ok_and(|packed| packed == source), || format!("{path} differs"))?;
    }
    Ok(())
}

/// Kernels of the sources as the build has compiled them.
fn built() -> Vec<(String, Vec<u32>)> {
    let spirv = Path::new(env!("OUT_DIR")).join("spirv");
    let list = fs::read_to_string(spirv.join("kernels.txt")).unwrap();
    let words = |name: &str| {
        let bytes = fs::read(spirv.join(format!("{name}.spv"))).unwrap();
        bytes.chunks_exact(4).map(|word| u32::from_le_bytes(word.try_into().unwrap())).collect()
    };
    // A hash, then a line for each, with its name first.
    let names = list.lines().skip(1).filter_map(|line| line.split(' ').next());
    names.map(|name| (name.to_owned(), words(name))).collect()
}

/// As the build has compiled them, and some of them anew.
#[test]
fn the_packed_crate_has_the_spirv_of_its_sources() {
    let built = built();
    for kernel in ["measure_float", "check_lobes", "try_lights"] {
        let folder = if kernel == "try_lights" { "kernels" } else { "check" };
        let compiled = planted::kernels(&[kernel], &format!("{folder}/{kernel}.comp"), &[]);
        assert!(built.contains(&compiled[0]), "{kernel} is of other sources");
    }
    let compiled = &if is_long_run() { all_kernels() } else { built };
    let place = Place::new();
    let folder = packed(place.path());
    assert!(compiled.len() > 50, "{} kernels", compiled.len());
    assert_holds("the packed crate", check(&folder, compiled));
    let manifest: toml::Table = fs::read_to_string(folder.join("Cargo.toml")).unwrap().parse().unwrap();
    let wanted = ["program", "window", "lab"].map(toml::Value::from);
    assert_eq!(manifest["features"]["default"], toml::Value::from(wanted.to_vec()));
    let absent = [".ci", ".shaderc", "tests", "target"].into_iter().find(|name| folder.join(name).exists());
    assert_eq!(absent, None);

    let prebuilt = folder.join("glsl/prebuilt").join(format!("{}.spv", compiled[0].0));
    let mut bytes = fs::read(&prebuilt).unwrap();
    *bytes.last_mut().unwrap() ^= 1;
    fs::write(&prebuilt, bytes).unwrap();
    assert_complains("another kernel", check(&folder, compiled));
    fs::remove_file(&prebuilt).unwrap();
    assert_complains("no kernel", check(&folder, compiled));
}

/// Crates that the library is built with, each with its distance from it.
fn crates(features: &[&str]) -> BTreeSet<(usize, String)> {
    let mut tree = Command::new(env!("CARGO"));
    let tree = tree.args(["tree", "--offline", "--edges", "normal", "--prefix", "depth", "--format", " {p}"]).args(features);
    let tree = tree.current_dir(root("")).output().expect("cargo starts");
    assert!(tree.status.success(), "{}", text(&tree.stderr));
    let line = |line: &str| {
        let mut words = line.split(' ').map(str::to_owned);
        let [distance, name] = [(); 2].map(|()| words.next().expect("a line has a distance and a name"));
        (distance.parse().unwrap(), name)
    };
    text(&tree.stdout).lines().map(line).collect()
}

/// What only the command line, the window and the pages of the lab use; `ctrlc` is for systems without signals.
const OF_FEATURES: [&str; 13] = [
    "clap",
    "clap_complete",
    "clap_mangen",
    "csv",
    "egui",
    "flip-rs",
    "indicatif",
    "maud",
    "plotters",
    "signal-hook",
    "tev_client",
    "toml",
    "winit",
];

#[test]
fn the_library_alone_needs_few_crates() {
    let of_features = |crates: &BTreeSet<(usize, String)>| -> Vec<&str> {
        OF_FEATURES.into_iter().filter(|of| crates.iter().any(|(_, name)| name == of || name.starts_with(&format!("{of}-")))).collect()
    };
    assert_eq!(of_features(&crates(&[])), OF_FEATURES);
    let alone = crates(&["--no-default-features"]);
    assert_eq!(of_features(&alone), Vec::<&str>::new());
    let direct: Vec<&String> = alone.iter().filter(|(distance, _)| *distance == 1).map(|(_, name)| name).collect();
    assert!((1..=36).contains(&direct.len()), "{} crates: {direct:?}", direct.len());
}
