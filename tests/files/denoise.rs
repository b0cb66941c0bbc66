//! `--denoise`: what goes to Open Image Denoise and what comes back, by a library in its place that is compiled here; and what the
//! library itself does, where it is installed.

use std::process::{Command, Output};

use crate::common::prelude::*;
use crate::common::program::on_device;
use photonmill::oidn::{Denoiser, Guides};
use photonmill::output::metadata::Metadata;

/// A little more light by the albedo and the normal, or with `DENOISER_LIES` far too much, where everything is set as it should be.
/// Names are those of version 2, or with `--cfg old` those of version 1.
const IN_ITS_PLACE: &str = r#"
use std::collections::HashMap;
use std::ffi::{CStr, c_char, c_int, c_void};
use std::sync::Mutex;

static IMAGES: Mutex<Option<HashMap<String, (usize, usize)>>> = Mutex::new(None);
static SWITCHES: Mutex<Vec<String>> = Mutex::new(Vec::new());
static FAILED: Mutex<bool> = Mutex::new(false);
static DEVICE: u8 = 0;

unsafe fn text(name: *const c_char) -> String { unsafe { CStr::from_ptr(name).to_str().unwrap().to_owned() } }
fn handle() -> *const c_void { (&raw const DEVICE).cast() }

#[unsafe(no_mangle)] extern "C" fn oidnNewDevice(kind: c_int) -> *const c_void { assert_eq!(kind, 1); handle() }
#[unsafe(no_mangle)] extern "C" fn oidnCommitDevice(_: *const c_void) {}
#[cfg_attr(old, unsafe(export_name = "oidnGetDevice1i"))] #[cfg_attr(not(old), unsafe(export_name = "oidnGetDeviceInt"))]
unsafe extern "C" fn number(_: *const c_void, name: *const c_char) -> c_int {
    assert_eq!(unsafe { text(name) }, "version");
    if cfg!(old) { 10403 } else { 20501 }
}
#[unsafe(no_mangle)] unsafe extern "C" fn oidnGetDeviceError(_: *const c_void, message: *mut *const c_char) -> c_int {
    unsafe { *message = c"out of luck".as_ptr() };
    std::mem::take(&mut *FAILED.lock().unwrap()).into()
}
#[unsafe(no_mangle)] unsafe extern "C" fn oidnNewFilter(_: *const c_void, name: *const c_char) -> *const c_void {
    assert_eq!(unsafe { text(name) }, "RT");
    handle()
}
#[unsafe(no_mangle)] unsafe extern "C" fn oidnSetSharedFilterImage(
    _: *const c_void, name: *const c_char, memory: *mut c_void, format: c_int, width: usize, height: usize, a: usize, b: usize, c: usize,
) {
    assert_eq!((format, a, b, c), (3, 0, 0, 0));
    IMAGES.lock().unwrap().get_or_insert_default().insert(unsafe { text(name) }, (memory as usize, 3 * width * height));
}
#[cfg_attr(old, unsafe(export_name = "oidnSetFilter1b"))] #[cfg_attr(not(old), unsafe(export_name = "oidnSetFilterBool"))]
unsafe extern "C" fn switch(_: *const c_void, name: *const c_char, value: bool) {
    assert!(value);
    SWITCHES.lock().unwrap().push(unsafe { text(name) });
}
#[unsafe(no_mangle)] extern "C" fn oidnCommitFilter(_: *const c_void) {}
#[unsafe(no_mangle)] unsafe extern "C" fn oidnExecuteFilter(_: *const c_void) {
    *FAILED.lock().unwrap() = std::env::var_os("DENOISER_FAILS").is_some();
    assert_eq!(*SWITCHES.lock().unwrap(), ["hdr", "cleanAux"]);
    let images = IMAGES.lock().unwrap().take().unwrap();
    assert_eq!(images.len(), 4);
    let image = |name: &str| { let (memory, count) = images[name]; unsafe { std::slice::from_raw_parts(memory as *const f32, count) } };
    let lies = std::env::var_os("DENOISER_LIES").is_some();
    let (memory, count) = images["output"];
    let output = unsafe { std::slice::from_raw_parts_mut(memory as *mut f32, count) };
    for (place, value) in output.iter_mut().enumerate() {
        let by = if lies { 1000.0 } else { image("albedo")[place] / 1024.0 + image("normal")[place] / 2048.0 };
        *value = image("color")[place] * (1.0 + by);
    }
}
#[unsafe(no_mangle)] extern "C" fn oidnReleaseFilter(_: *const c_void) {}
#[unsafe(no_mangle)] extern "C" fn oidnReleaseDevice(_: *const c_void) {}
"#;

/// A folder with such a library of either version.
fn in_its_place(place: &Place, is_old: bool) -> PathBuf {
    let folder = place.at(if is_old { "old" } else { "new" });
    std::fs::create_dir(&folder).unwrap();
    place.write("denoiser.rs", IN_ITS_PLACE);
    let mut rustc = Command::new(std::env::var("RUSTC").unwrap_or("rustc".to_owned()));
    rustc.args(["--edition", "2024", "--crate-type", "cdylib", "-o"]).arg(folder.join("libOpenImageDenoise.so"));
    rustc.args(is_old.then_some(["--cfg", "old"]).into_iter().flatten()).arg(place.at("denoiser.rs"));
    let output = rustc.output().expect("the compiler of this test is there");
    assert!(output.status.success(), "{}", text(&output.stderr));
    folder
}

const SMALL: &str = "--size 24x17 --photons 500 -q";

const NEW: (bool, &str) = (false, "2.5.1");
const OLD: (bool, &str) = (true, "1.4.3");

#[test]
fn direct_light_alone_is_denoised_and_the_file_says_so() {
    // Of the library, the new one first.
    let (scene, versions) = of_run::<(_, &[_])>(("cornell", &[NEW]), ("cornell-spheres", &[NEW, OLD]));
    let Some(_) = device() else { return };
    if cfg!(not(target_os = "linux")) || Denoiser::open().is_ok() {
        eprintln!("SKIPPED: Open Image Denoise itself is in the place of the test's library");
        return;
    }
    let place = Place::new();
    let render = format!("render {scene} {SMALL} --rounds 8 --block 1 -o");
    place.succeed(&format!("{render} plain.exr --error-image plain-error.exr"));
    let plain = place.channels("plain.exr");
    for &(is_old, version) in versions {
        let folder = in_its_place(&place, is_old);
        let run = |line: &str, how: Option<&str>| -> Output {
            let mut command = place.command(&on_device(line));
            let output = command.env("LD_LIBRARY_PATH", &folder).envs(how.map(|name| (name, "1"))).output().unwrap();
            assert!(output.status.success(), "{line}: {}", text(&output.stderr));
            output
        };
        let printed = text(&run(&format!("{render} a.exr --denoise --error-image error.exr"), None).stdout);
        assert!(printed.contains(&format!("direct light is denoised by Open Image Denoise {version}; all errors are those")), "{printed}");
        let found = place.channels("a.exr");
        let mut moved = 0;
        for (channel, axis) in [("R", "X"), ("G", "Y"), ("B", "Z")] {
            let layer = |name: &str, channel: &str, pixel: usize| plain[&format!("{name}.{channel}")][pixel];
            for (pixel, value) in found[channel].iter().enumerate() {
                let (all, direct) = (plain[channel][pixel], layer("direct", channel, pixel));
                let by = layer("albedo", channel, pixel) / 1024.0 + layer("normal", axis, pixel) / 2048.0;
                let (change, expected) = (value - all, direct * by);
                let is_right = (change * by).signum() >= 0.0 && change.abs() <= expected.abs() + 1e-6 * all;
                assert!(is_right, "{channel} of pixel {pixel}: {change}, {expected}");
                // Not of lamps that the eye sees, and not where there is less noise than that.
                moved += usize::from((change - expected).abs() <= 1e-6 * all && change != 0.0);
            }
        }
        assert!(moved > 24 * 17 * 3 / 2, "{moved} values as they should be");
        // Layers and errors are those of the plain picture.
        for (name, values) in plain.iter().filter(|(name, _)| name.len() > 1) {
            assert!(*values == found[name], "{name}");
        }
        assert!(place.channels("error.exr") == place.channels("plain-error.exr"));

        if is_old {
            let repeated = run("repeat of-new.exr -q", None);
            let warned = "warning: was denoised by Open Image Denoise 2.5.1, and now by Open Image Denoise 1.4.3";
            assert!(text(&repeated.stderr).contains(warned), "{}", text(&repeated.stderr));
            continue;
        }
        std::fs::copy(place.at("a.exr"), place.at("of-new.exr")).unwrap();
        run(&format!("{render} a.png --denoise"), None);
        for file in ["a.exr", "a.png"] {
            let content = place.content(file);
            let made = Metadata::read(&content).unwrap();
            assert_eq!(made.denoiser, Some(format!("Open Image Denoise {version}")), "{file}");
            assert!(text(&content).contains("Denoised: direct light, by Open Image Denoise") || file == "a.png", "{file}");
            let repeated = run(&format!("repeat {file} -q"), None);
            assert!(text(&repeated.stdout).contains("repeated, all") && repeated.stderr.is_empty(), "{}", text(&repeated.stderr));
        }
        // Nothing moves farther than its error, whatever the library says.
        run(&format!("{render} lie.exr --denoise"), Some("DENOISER_LIES"));
        let lie = place.channels("lie.exr");
        let farthest = |name: &str| {
            let errors = &plain[&format!("standard_error.{name}")];
            let moves =
                lie[name].iter().zip(&plain[name]).zip(errors).map(|((lie, plain), error)| (lie - plain, 1.00001 * error + 1e-6 * plain));
            moves.filter(|(moved, _)| *moved > 0.0).map(|(moved, error)| moved / error).fold(0.0, f32::max)
        };
        assert!(["R", "G", "B"].iter().all(|name| (0.5..=1.0).contains(&farthest(name))), "{}", farthest("R"));
        // A library that fails in the end loses no picture.
        let stderr = text(&run(&format!("{render} failed.exr --denoise"), Some("DENOISER_FAILS")).stderr);
        assert!(stderr.contains("--denoise: Open Image Denoise fails: out of luck; the picture is as it was"), "{stderr}");
        assert!(place.channels("failed.exr")["R"] == plain["R"]);
        assert_eq!(Metadata::read(&place.content("failed.exr")).unwrap().denoiser, None);
    }
}

#[test]
fn what_cannot_be_denoised_is_refused_before_the_run() {
    let place = Place::new();
    let of_part = ["--denoise", "leave --part out"];
    let of_maps = ["--denoise", "needs --illumination split"];
    place.assert_refused([
        (format!("render cornell {SMALL} -o a.exr --denoise --part caustic"), &of_part[..]),
        (format!("render cornell {SMALL} -o a.exr --denoise --illumination photons"), &of_maps[..]),
    ]);
    if Denoiser::open().is_ok() {
        return;
    }
    let absent = ["--denoise: Open Image Denoise is not installed; install", "or omit --denoise"];
    place.assert_refused([(format!("render cornell {SMALL} -o a.png --denoise"), &absent[..])]);
}

/// Grey noise over a level picture, of which next to nothing is left.
#[test]
fn the_library_takes_noise_from_a_picture() {
    let Ok(denoiser) = Denoiser::open() else {
        eprintln!("SKIPPED: Open Image Denoise is not installed, so what it does was not tested here");
        return;
    };
    const SIZE: u32 = 64;
    let noisy: Vec<Vec3> =
        (0..SIZE * SIZE).map(|pixel| Vec3::splat(0.5 + philox([pixel, 0, 0, 0], [7, 0])[0] as f32 * 2f32.powi(-32))).collect();
    let guide = |value| vec![Vec3::splat(value); noisy.len()];
    let guides = Guides { albedo: &guide(0.5), normal: &guide(0.57735) };
    let clean = denoiser.denoise((SIZE, SIZE), &noisy, &guides).unwrap();
    let spread = |picture: &[Vec3]| (picture.iter().map(|value| (value.x - 1.0).powi(2)).sum::<f32>() / picture.len() as f32).sqrt();
    assert!(spread(&noisy) > 0.25 && spread(&clean) < 0.05, "{} to {}, {}", spread(&noisy), spread(&clean), denoiser.version);
}
