//! Ctrl-C and other requests to end.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicI32, Ordering};

use super::complain;
use crate::error::Error;
use crate::output::destination::remove_staged;

/// Whether what is under way looks at the flag; a scene that is being read does not.
static IS_INTERRUPTIBLE: AtomicBool = AtomicBool::new(false);
/// Whether anything that looks at the flag has begun.
static HAS_BEGUN: AtomicBool = AtomicBool::new(false);
/// The signal that arrived first; 0 as long as there was none.
static SIGNAL: AtomicI32 = AtomicI32::new(0);
/// Ctrl-C.
const SIGINT: i32 = 2;

/// Says whether what is under way looks at the flag from now on.
pub(super) fn set_interruptible(is_so: bool) {
    HAS_BEGUN.fetch_or(is_so, Ordering::Relaxed);
    IS_INTERRUPTIBLE.store(is_so, Ordering::Relaxed);
}

/// Runs `body`, which ends early once the flag is set.
pub(super) fn interruptible<T>(body: impl FnOnce() -> T) -> T {
    set_interruptible(true);
    let result = body();
    set_interruptible(false);
    result
}

/// Exit code of a command that a signal ended, as shells have it: 130 after Ctrl-C, 143 after SIGTERM, 129 after SIGHUP.
pub(super) fn exit_code() -> u8 {
    let signal = SIGNAL.load(Ordering::Relaxed);
    128 + u8::try_from(if signal == 0 { SIGINT } else { signal }).unwrap_or(0)
}

/// The flag that the first Ctrl-C (SIGTERM, SIGHUP) sets; the run then ends early and writes what it has. The second ends
/// the program at once, as does the first where nothing looks at the flag. A half-written file is removed.
pub(super) fn cancel_on_signal() -> Arc<AtomicBool> {
    let cancelled = Arc::new(AtomicBool::new(false));
    let flag = cancelled.clone();
    let handle = move |signal: i32| {
        let is_first = SIGNAL.compare_exchange(0, signal, Ordering::Relaxed, Ordering::Relaxed).is_ok();
        if !is_first || !IS_INTERRUPTIBLE.load(Ordering::Relaxed) {
            remove_staged();
            match HAS_BEGUN.load(Ordering::Relaxed) {
                false => complain(&Error::Interrupted.to_string()),
                true => complain("interrupted; what was not written yet is lost"),
            }
            std::process::exit(i32::from(exit_code()));
        }
        flag.store(true, Ordering::Relaxed);
        complain("ending early and keeping what is finished; press Ctrl-C again to end at once");
    };
    // Without a handler a signal ends the program at once, and files still appear whole or not at all.
    let _ = on_signal(handle);
    cancelled
}

#[cfg(unix)]
fn on_signal(handle: impl Fn(i32) + Send + 'static) -> std::io::Result<()> {
    use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM, SIGXFSZ};
    // A file that grows beyond its limit is then an error of the write, as on a full disk, and not the end.
    signal_hook::flag::register(SIGXFSZ, Arc::new(AtomicBool::new(false)))?;
    let ignored = ignored_signals();
    let wanted = [SIGINT, SIGTERM, SIGHUP].into_iter().filter(|signal| ignored >> (signal - 1) & 1 == 0);
    let mut signals = signal_hook::iterator::Signals::new(wanted)?;
    std::thread::Builder::new().name("signals".into()).spawn(move || signals.forever().for_each(handle)).map(|_| ())
}

/// The mask of signals that this process was started to ignore, as nohup does with SIGHUP; 0 where nobody says.
#[cfg(unix)]
fn ignored_signals() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).unwrap_or(0)
}

#[cfg(not(unix))]
fn on_signal(handle: impl Fn(i32) + Send + 'static) -> Result<(), ctrlc::Error> {
    ctrlc::set_handler(move || handle(SIGINT))
}
