//! `photonmill devices`: the Vulkan devices and their limits.

use clap::Args;

use super::{JsonOrStdoutArg, optional_file, say};
use crate::constants::LOOP_LIMIT;
use crate::error::{Error, INSTALL_VULKAN, Result};
use crate::gpu::{DeviceFacts, Gpu, Options, Reconvergence, check};
use crate::output::destination::write_all;

#[derive(Args)]
pub(super) struct DevicesArgs {
    #[command(flatten)]
    json: JsonOrStdoutArg,
}

pub(super) fn run(args: &DevicesArgs) -> Result<()> {
    let json = optional_file("--json", args.json.json.as_ref())?;
    let (devices, reason) = match Gpu::list() {
        Err(Error::NoVulkan { reason }) => (Vec::new(), reason),
        devices => (devices?, "the Vulkan loader finds none".to_owned()),
    };
    if let Some(json) = json {
        let text = serde_json::to_string_pretty(&devices).expect("device facts are plain data");
        return write_all([(json, (text + "\n").into_bytes())]);
    }
    if devices.is_empty() {
        return say(&format!("no Vulkan device: {reason}; {INSTALL_VULKAN}. Without one only the paper's box runs, by the CPU builder."));
    }
    say(&devices.iter().map(description).collect::<Vec<_>>().join("\n"))
}

fn description(facts: &DeviceFacts) -> String {
    let mut text = format!("{} {} ({})", facts.index, facts.name, facts.kind);
    let mut line = |what: &str, value: String| text.push_str(&format!("\n    {what:<26} {value}"));
    line("driver", facts.driver.clone());
    line("Vulkan", facts.vulkan.clone());
    line("subgroup size", facts.subgroup_size.to_string());
    line("storage buffer range", mebibytes(facts.storage_buffer_range_bytes));
    line("largest allocation", mebibytes(facts.allocation_bytes));
    line("device memory", mebibytes(facts.device_memory_bytes));
    line("storage buffers per stage", facts.storage_buffers_per_stage.to_string());
    line("work groups in x and y", format!("{} x {}", facts.work_group_count_x, facts.work_group_count_y));
    line("work-group size", facts.work_group_size.to_string());
    line(
        "timestamps",
        match facts.timestamp_bits {
            0 => "none".to_owned(),
            bits => format!("{bits} bits of {} ns", facts.timestamp_period_ns),
        },
    );
    line("64-bit atomics", if facts.int64_atomics { "yes" } else { "no, photonmill uses two 32-bit words" }.to_owned());
    line(
        "lanes reconverge",
        match facts.reconvergence {
            Reconvergence::Maximal => "as the source reads (maximal reconvergence)",
            Reconvergence::UniformControlFlow => "where all went in together (subgroup uniform control flow)",
            Reconvergence::None => "without a promise",
        }
        .to_owned(),
    );
    line("start-up check", verdict(facts));
    text
}

/// Opens the device, which runs the check, and asks how far its loops count.
fn verdict(facts: &DeviceFacts) -> String {
    const WANTED: u32 = 100_000;
    let opened = Gpu::open(&Options { device: Some(facts.index.to_string()), ..Options::default() });
    match opened.and_then(|gpu| Ok((check::loop_count(&gpu, WANTED)?, gpu.facts().votes_in_loops))) {
        Ok((_, false)) => "passed, but subgroup votes in loops return wrong results on this driver: no --variant persistent".to_owned(),
        Ok((count, true)) if count.done == WANTED => "passed".to_owned(),
        Ok((count, true)) => format!("passed; loops end after {} iterations (photonmill needs at most {LOOP_LIMIT})", count.done),
        Err(error) => error.to_string(),
    }
}

fn mebibytes(bytes: u64) -> String {
    format!("{} MiB", bytes >> 20)
}
