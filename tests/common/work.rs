//! What each test asks for, in counts that no clock disturbs: pipelines, dispatches, invocations, paths of the judge, and starts of
//! the program. They are written into a file as tests end; `tests/work.rs`, which runs after all others, holds the budget.

use std::cell::Cell;
use std::fs::File;
use std::io::Write;
use std::sync::{LazyLock, Mutex};

use photonmill::gpu;
use photonmill::verify::judge::paths_traced;

use super::program::built;

/// Emptied by the process that runs the tests, or by tools/runner, whose processes all go on with it. Its lines: a test, what is
/// counted, how many.
static FILE: LazyLock<Mutex<File>> = LazyLock::new(|| {
    let path = built("work.txt");
    let goes_on = std::env::var_os("PHOTONMILL_TESTS_GO_ON").is_some();
    let file = File::options().create(true).write(true).append(goes_on).truncate(!goes_on).open(path);
    Mutex::new(file.expect("target can be written"))
});

fn add(lines: &[(&str, u64)]) {
    let thread = std::thread::current();
    let test = thread.name().unwrap_or("?");
    let text: String = lines.iter().filter(|(_, count)| *count > 0).map(|(what, count)| format!("{test} {what} {count}\n")).collect();
    FILE.lock().unwrap().write_all(text.as_bytes()).expect("target can be written");
}

/// What a device did for the test that this thread runs, and what the test's judges have traced since the last call.
pub fn of_device(before: gpu::Work, after: gpu::Work) {
    thread_local! {
        static PATHS_BEFORE: Cell<u64> = const { Cell::new(0) };
    }
    add(&[
        ("pipelines", (after.pipelines - before.pipelines) as u64),
        ("dispatches", after.dispatches - before.dispatches),
        ("invocations", after.invocations - before.invocations),
        ("paths", paths_traced() - PATHS_BEFORE.replace(paths_traced())),
    ]);
}

/// Nothing was tested here, as there is no device.
pub fn of_skipped() {
    add(&[("skipped", 1)]);
}

/// Some cases were left to the long run.
pub fn of_shortened() {
    add(&[("shortened", 1)]);
}

/// The program was started once.
pub fn of_program() {
    add(&[("programs", 1)]);
}
