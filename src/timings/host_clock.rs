//! Nested scopes on the host's clock.

use std::time::{Duration, Instant};

use super::{Span, Timings};

/// Times nested scopes on the host's clock.
pub(crate) struct HostClock {
    started: Instant,
    /// Name of the whole, and of the scopes that are open.
    whole: &'static str,
    open: Vec<String>,
    timings: Timings,
}

impl HostClock {
    /// `whole` names the row that spans everything.
    pub(crate) fn start(whole: &'static str) -> HostClock {
        let mut timings = Timings::default();
        timings.count(whole);
        HostClock { started: Instant::now(), whole, open: Vec::new(), timings }
    }

    pub(crate) fn time<T>(&mut self, name: &str, body: impl FnOnce(&mut Self) -> T) -> T {
        let path = self.open.last().map_or_else(|| name.to_owned(), |outer| format!("{outer}/{name}"));
        self.timings.count(&path);
        self.open.push(path);
        let begin = Instant::now();
        let result = body(self);
        let (start, duration) = (begin.duration_since(self.started), begin.elapsed());
        let name = self.open.pop().expect("pushed above");
        self.timings.add(Span::of_host(&name, start, duration));
        result
    }

    pub(crate) fn finish(mut self) -> Timings {
        self.timings.add(Span::of_host(self.whole, Duration::ZERO, self.started.elapsed()));
        self.timings
    }
}
