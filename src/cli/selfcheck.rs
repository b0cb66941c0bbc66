//! `photonmill selfcheck`: closed forms on the user's own device.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use clap::Args;

use super::{DeviceArgs, End, complain, say};
use crate::error::{Error, Result};
use crate::selfcheck::{self, Finding};

#[derive(Args)]
pub(super) struct SelfcheckArgs {
    /// Print JSON
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    device: DeviceArgs,
}

pub(super) fn run(args: &SelfcheckArgs, cancelled: &AtomicBool) -> Result<End> {
    let gpu = args.device.open(&args.device.options())?;
    let device = gpu.as_ref().map_or("CPU".to_owned(), |gpu| format!("{}, {}", gpu.facts().name, gpu.facts().driver));
    let began = Instant::now();
    if !args.json {
        say(&format!("{device}\n{:<58} {:>11} {:>11} {:>10} {:>6} verdict", "case", "expected", "found", "std error", "z"))?;
    }
    let mut written = Ok(());
    let findings = selfcheck::run(gpu.as_ref(), cancelled, |finding| {
        if !args.json && written.is_ok() {
            written = say(&row(finding));
        }
    })?;
    written?;
    if args.json {
        say(&serde_json::to_string_pretty(&findings).expect("findings are plain data"))?;
    }
    let failed: Vec<&str> = findings.iter().filter(|finding| !finding.passed).map(|finding| finding.name.as_str()).collect();
    if !failed.is_empty() {
        return Err(Error::SelfcheckFailed { device, failed: failed.len(), of: findings.len(), first: failed[0].to_owned() });
    }
    if cancelled.load(Ordering::Relaxed) {
        complain("ended before the last case");
        return Ok(End::Cancelled);
    }
    if !args.json {
        say(&format!("{} of {} cases passed in {:.1} s", findings.len(), findings.len(), began.elapsed().as_secs_f64()))?;
    }
    Ok(End::Finished)
}

fn row(finding: &Finding) -> String {
    let verdict = if finding.passed { "passed" } else { "FAILED" };
    let Finding { name, expected, found, standard_error, z, .. } = finding;
    format!("{name:<58} {expected:>11.6} {found:>11.6} {standard_error:>10.2e} {z:>6.2} {verdict}")
}
