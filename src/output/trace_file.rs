//! The run's spans in the Chrome trace event format, for chrome://tracing and Perfetto.

use serde_json::{Value, json};

use crate::timings::{Clock, Handled, Span, Timings};

/// What is known of a span, and by the second.
fn arguments(span: &Span) -> Value {
    let Handled { photons, stored, bytes } = span.handled;
    let seconds = span.duration.as_secs_f64();
    let mut arguments = json!({"path": &*span.name});
    let counts = [
        ("photons", photons, "photons_per_second", 1.0),
        ("stored_photons", stored, "stored_photons_per_second", 1.0),
        ("bytes", bytes, "gigabytes_per_second", 1e-9),
    ];
    for (name, count, rate, unit) in counts.into_iter().filter(|(_, count, ..)| *count > 0) {
        arguments[name] = count.into();
        if seconds > 0.0 {
            arguments[rate] = (count as f64 * unit / seconds).into();
        }
    }
    arguments
}

pub(crate) fn chrome_trace(timings: &Timings, device: &str) -> Vec<u8> {
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
            "args": arguments(span),
        })
    }));
    let trace = json!({
        "displayTimeUnit": "ms",
        "otherData": {"spans_left_out": timings.spans_left_out()},
        "traceEvents": events,
    });
    serde_json::to_vec(&trace).expect("a trace is plain data")
}
