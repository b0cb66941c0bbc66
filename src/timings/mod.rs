//! Timings as nested scopes, each with its time on the device, on the host, or both.

mod host_clock;
mod spread;

use std::collections::HashMap;
use std::sync::Arc;
use std::time::Duration;

pub(crate) use host_clock::HostClock;
use serde::Serialize;
pub(crate) use spread::Spread;

/// One line of the timing table: everything that ran under one name.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Row {
    /// Path from the outermost scope, such as `round/build/bounce 3`.
    pub name: String,
    pub count: u64,
    /// Time on the device, all counts together; `None` where nothing ran there or the device has no
    /// timestamps.
    pub gpu_ms: Option<f64>,
    /// Time on the host's clock, all counts together; `None` for what happens inside a submission,
    /// which the host cannot see.
    pub wall_ms: Option<f64>,
}

/// Which clock saw a span.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Clock {
    Gpu,
    Wall,
}

/// One run of one scope, for the trace file.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Span {
    pub name: Arc<str>,
    pub clock: Clock,
    /// Since the start of the run. Device spans are placed by the host's time of their submission.
    pub start: Duration,
    pub duration: Duration,
    pub handled: Handled,
}

impl Span {
    /// Of what the host's clock saw.
    pub(crate) fn of_host(name: &str, start: Duration, duration: Duration) -> Span {
        Span { name: name.into(), clock: Clock::Wall, start, duration, handled: Handled::default() }
    }
}

/// What a scope is known to have handled; 0 where the host does not know it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct Handled {
    /// Photons that left their lights in it.
    pub photons: u64,
    /// Photons of a map that it sorted or looked up.
    pub stored: u64,
    /// Read and written: of copies and fills all, of kernels what they cannot do without.
    pub bytes: u64,
}

/// Timings of a run, in the order in which scopes first appeared.
#[derive(Debug, Clone, Default)]
pub struct Timings {
    rows: Vec<Row>,
    by_name: HashMap<Arc<str>, usize>,
    spans: Vec<Span>,
    spans_left_out: u64,
}

/// Spans kept for the trace file; a longer run keeps its sums only.
const MAX_SPANS: usize = 200_000;

impl Timings {
    /// Every scope, in the order of calls.
    pub fn rows(&self) -> &[Row] {
        &self.rows
    }

    pub(crate) fn spans(&self) -> &[Span] {
        &self.spans
    }

    /// Spans that did not fit.
    pub fn spans_left_out(&self) -> u64 {
        self.spans_left_out
    }

    /// A scope by its path, such as `round/caustic/trace`.
    pub fn row(&self, name: &str) -> Option<&Row> {
        self.by_name.get(name).map(|&index| &self.rows[index])
    }

    fn row_mut(&mut self, name: &str) -> &mut Row {
        let index = self.by_name.get(name).copied().unwrap_or_else(|| {
            self.rows.push(Row { name: name.to_owned(), count: 0, gpu_ms: None, wall_ms: None });
            self.by_name.insert(name.into(), self.rows.len() - 1);
            self.rows.len() - 1
        });
        &mut self.rows[index]
    }

    /// Counts one more run of a scope, before its time is known, so that rows stand in call order.
    pub(crate) fn count(&mut self, name: &str) {
        self.row_mut(name).count += 1;
    }

    /// Adds time to a scope.
    pub(crate) fn add(&mut self, span: Span) {
        let milliseconds = span.duration.as_secs_f64() * 1e3;
        let row = self.row_mut(&span.name);
        let sum = match span.clock {
            Clock::Gpu => &mut row.gpu_ms,
            Clock::Wall => &mut row.wall_ms,
        };
        *sum = Some(sum.unwrap_or(0.0) + milliseconds);
        if self.spans.len() < MAX_SPANS {
            // All spans of a scope share its name.
            let name = self.by_name.get_key_value(&span.name).expect("the row is there").0.clone();
            self.spans.push(Span { name, ..span });
        } else {
            self.spans_left_out += 1;
        }
    }

    /// Adds those of another device, which ran at the same time; its spans are left out of the trace.
    pub(crate) fn join(&mut self, other: &Timings) {
        for row in &other.rows {
            let own = self.row_mut(&row.name);
            own.count += row.count;
            for (sum, time) in [(&mut own.gpu_ms, row.gpu_ms), (&mut own.wall_ms, row.wall_ms)] {
                *sum = time.map(|time| sum.unwrap_or(0.0) + time).or(*sum);
            }
        }
        self.spans_left_out += other.spans.len() as u64 + other.spans_left_out;
    }

    /// Milliseconds of a scope on the device, else on the host's clock.
    pub fn best_ms(&self, name: &str) -> Option<f64> {
        self.row(name).and_then(|row| row.gpu_ms.or(row.wall_ms))
    }
}
