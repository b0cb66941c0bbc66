//! Faults that are planted in place of Vulkan calls, so that tests see what becomes of a run on a device that fails.
//!
//! The variable `PHOTONMILL_FAULTS` of the environment lists them: `vkQueueSubmit2@20=lost` is a device that is lost in the 20th
//! submission of the process, and `vkAllocateMemory@3+=device-memory` one without memory from the third allocation on.

use std::sync::{LazyLock, Mutex, PoisonError};

use ash::vk;

use crate::error::{Error, Result};

/// What the environment asks for; without it, no call looks further.
static PLANTED: LazyLock<Option<Mutex<Vec<Fault>>>> =
    LazyLock::new(|| asked_for().ok().filter(|faults| !faults.is_empty()).map(Mutex::new));

const VARIABLE: &str = "PHOTONMILL_FAULTS";

fn asked_for() -> Result<Vec<Fault>> {
    let text = std::env::var(VARIABLE).unwrap_or_default();
    let read = |fault: &str| {
        fault.parse().map_err(|()| {
            let allowed = "must be CALL@N=FAULT, or CALL@N+=FAULT from the N-th call on: a Vulkan call, N from 1, and lost, device-memory or host-memory";
            Error::setting(VARIABLE, fault, allowed)
        })
    };
    text.split(',').filter(|_| !text.is_empty()).map(read).collect()
}

/// Refuses a list that cannot be read.
pub(super) fn check() -> Result<()> {
    asked_for().map(drop)
}

/// A call of this name fails, at its `at`-th time, or from then on.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Fault {
    call: String,
    at: u64,
    stays: bool,
    code: vk::Result,
    calls: u64,
}

impl std::str::FromStr for Fault {
    type Err = ();

    fn from_str(text: &str) -> std::result::Result<Fault, ()> {
        let (call, rest) = text.split_once('@').ok_or(())?;
        let (at, code) = rest.split_once('=').ok_or(())?;
        let code = match code {
            "lost" => vk::Result::ERROR_DEVICE_LOST,
            "device-memory" => vk::Result::ERROR_OUT_OF_DEVICE_MEMORY,
            "host-memory" => vk::Result::ERROR_OUT_OF_HOST_MEMORY,
            _ => return Err(()),
        };
        let number = at.strip_suffix('+').unwrap_or(at).parse().ok().filter(|number| *number > 0).ok_or(())?;
        Ok(Fault { call: call.to_owned(), at: number, stays: at.ends_with('+'), code, calls: 0 })
    }
}

impl Fault {
    /// Counts a call of a name; says whether it fails.
    fn strikes(&mut self, call: &str) -> bool {
        if self.call != call {
            return false;
        }
        self.calls += 1;
        if self.stays { self.calls >= self.at } else { self.calls == self.at }
    }
}

/// Whether a call, which is about to be made, fails in its place.
pub(super) fn planted(call: &str) -> std::result::Result<(), vk::Result> {
    let Some(faults) = PLANTED.as_ref() else { return Ok(()) };
    let mut faults = faults.lock().unwrap_or_else(PoisonError::into_inner);
    // All of them count, whichever strikes.
    let struck: Vec<vk::Result> = faults.iter_mut().filter_map(|fault| fault.strikes(call).then_some(fault.code)).collect();
    struck.first().map_or(Ok(()), |code| Err(*code))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faults_strike_at_their_call() {
        let strikes = |text: &str| {
            let mut fault: Fault = text.parse().unwrap();
            ["a", "b", "a", "a", "a"].map(|call| fault.strikes(call))
        };
        assert_eq!(strikes("a@2=lost"), [false, false, true, false, false]);
        assert_eq!(strikes("a@2+=host-memory"), [false, false, true, true, true]);
        for text in ["a", "a@=lost", "a@2", "a@2=gone", "a@x=lost", "a@0=lost", ""] {
            assert!(text.parse::<Fault>().is_err(), "{text}");
        }
    }
}
