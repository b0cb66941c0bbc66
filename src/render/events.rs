//! What a run says of itself on the way. Who calls it decides how that is shown.

use std::sync::atomic::AtomicBool;

use crate::engine::Progress;
use crate::engine::run::retry::in_words;
use crate::engine::scene::pilot::Pilot;
use crate::error::Error;
use crate::gpu::Gpu;
use crate::settings::stop::Stop;

/// Texts name fields of a request in backticks ([`super::names`]).
pub enum Event<'a> {
    /// What the user should know, as the result may not be what they want.
    Warning(&'a str),
    /// What was assumed of the scene, or that a run ended early.
    Remark(&'a str),
    /// What came of a step.
    Note(&'a str),
    /// What is being done from now on: a detail, or a step that takes long.
    Status(&'a str),
    Step(&'a str),
    /// What a pilot has chosen, for a run with these goals; and whether it is of a pixel, a texel or a point.
    Pilot(&'a Pilot, &'a Stop, &'static str),
    /// How far a run has come, in rounds or photons.
    Progress(&'a Progress, &'static str),
    /// From now on `cancelled` is looked at, or no longer.
    Interruptible(bool),
}

pub type Report<'a> = &'a dyn Fn(Event<'_>);

/// Whoever watches a run, and may end it early.
#[derive(Clone, Copy)]
pub struct Observer<'a> {
    /// Set from outside to end the run after the photons, or the round, under way.
    pub cancelled: &'a AtomicBool,
    pub report: Report<'a>,
}

/// Lets a run go on to its end, in silence.
impl Default for Observer<'_> {
    fn default() -> Self {
        static NEVER: AtomicBool = AtomicBool::new(false);
        Observer { cancelled: &NEVER, report: &|_| {} }
    }
}

impl Observer<'_> {
    pub fn report(&self, event: Event) {
        (self.report)(event);
    }

    pub(super) fn warn(&self, warning: impl AsRef<str>) {
        self.report(Event::Warning(warning.as_ref()));
    }

    /// Does what looks at `cancelled`.
    pub(super) fn interruptible<T>(&self, body: impl FnOnce() -> T) -> T {
        self.report(Event::Interruptible(true));
        let result = body();
        self.report(Event::Interruptible(false));
        result
    }

    /// Reports a device that failed while it was at work.
    pub(super) fn failed(&self) -> impl Fn(&Gpu, &Error, crate::engine::run::retry::Remedy) {
        |gpu: &Gpu, error: &Error, remedy| self.warn(in_words(gpu, error, remedy))
    }
}
