//! What the targets of fuzzing run. They are a part of the library where it is built for fuzzing or for tests, and see what is private to it.

pub mod change;
pub mod checkpoint;
pub mod gltf;
pub mod map;
mod mutation;
pub mod sealed;
pub mod seeds;
pub mod settings;

use std::path::PathBuf;

use photonmill::error::Error;

/// Takes away the hook by which libFuzzer ends the program at every panic: the loader catches some on threads of
/// their own. A panic that leaves the target still ends it.
pub fn panics_are_caught() {
    drop(std::panic::take_hook());
}

/// A refusal is one line, and the user's to mend.
pub fn refused(error: &Error) -> String {
    let line = error.to_string();
    assert!(error.exit_code() == 2 && !line.is_empty() && line.lines().count() == 1, "{line:?}");
    line
}

/// A file of this process; `run` lays it into memory.
pub fn file(name: &str) -> PathBuf {
    std::env::temp_dir().join(format!("photonmill-fuzz-{}-{name}", std::process::id()))
}
