//! The run's spans in the Chrome trace event format, for chrome://tracing and Perfetto.

use serde_json::json;

use crate::timings::{Clock, Timings};

pub fn chrome_trace(timings: &Timings, device: &str) -> Vec<u8> {
    let track = |clock: Clock| match clock {
        Clock::Wall => 0,
        Clock::Gpu => 1,
    };
    let name_track =
        |clock: Clock, name: &str| json!({"ph": "M", "name": "thread_name", "pid": 0, "tid": track(clock), "args": {"name": name}});
    let mut events = vec![name_track(Clock::Wall, "host"), name_track(Clock::Gpu, device)];
    events.extend(timings.spans().iter().map(|span| {
        json!({
            "ph": "X",
            "name": span.name.rsplit('/').next().unwrap_or(&span.name),
            "pid": 0,
            "tid": track(span.clock),
            "ts": span.start.as_secs_f64() * 1e6,
            "dur": span.duration.as_secs_f64() * 1e6,
            "args": {"path": &*span.name},
        })
    }));
    let trace = json!({
        "displayTimeUnit": "ms",
        "otherData": {"spans_left_out": timings.spans_left_out()},
        "traceEvents": events,
    });
    serde_json::to_vec(&trace).expect("a trace is plain data")
}
