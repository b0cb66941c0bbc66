//! `photonmill selfcheck`: known solutions on the user's own device.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use clap::Args;

use super::progress::{ProgressArgs, ProgressReporter};
use super::{DeviceArgs, End, JsonOrStdoutArg, complain, optional_file, say};
use crate::error::{Error, Result};
use crate::output::destination::{Destination, write_all};
use crate::verify::selfcheck::{self, Finding};

#[derive(Args)]
pub(super) struct SelfcheckArgs {
    #[command(flatten)]
    json: JsonOrStdoutArg,
    #[command(flatten)]
    progress: ProgressArgs,
    #[command(flatten)]
    device: DeviceArgs,
}

pub(super) fn run(args: &SelfcheckArgs, cancelled: &AtomicBool) -> Result<End> {
    let json = optional_file("--json", args.json.json.as_ref())?;
    let reporter = ProgressReporter::new(&args.progress);
    let gpu = args.device.open(&args.device.options())?;
    reporter.device(gpu.as_ref());
    let device = gpu.as_ref().map_or("CPU".to_owned(), |gpu| gpu.facts().label());
    let began = Instant::now();
    // Where standard output is the JSON there is no table.
    let has_table = !json.as_ref().is_some_and(Destination::is_standard_output);
    let say_row = |text: &str| if has_table { say(text) } else { Ok(()) };
    say_row(&format!("{device}\n{:<58} {:>11} {:>11} {:>10} {:>6} verdict", "case", "expected", "found", "std error", "z"))?;
    let mut written = Ok(());
    let mut done = 0;
    let count = selfcheck::cases().iter().filter(|case| !case.on_gpu || gpu.is_some()).count();
    reporter.note(&format!("plan: {count} cases, less than a minute"));
    reporter.status(&format!("0 of {count} cases done"));
    let findings = selfcheck::run(gpu.as_ref(), cancelled, |finding| {
        done += 1;
        reporter.status(&format!("{done} of {count} cases done"));
        if written.is_ok() {
            written = say_row(&row(finding));
        }
    })?;
    reporter.finish();
    written?;
    if let Some(json) = json {
        let text = serde_json::to_string_pretty(&findings).expect("findings are plain data");
        write_all([(json, (text + "\n").into_bytes())])?;
    }
    let failed: Vec<&str> = findings.iter().filter(|finding| !finding.passed).map(|finding| finding.name.as_str()).collect();
    if !failed.is_empty() {
        return Err(Error::SelfcheckFailed { device, failed: failed.len(), of: findings.len(), first: failed[0].to_owned() });
    }
    if cancelled.load(Ordering::Relaxed) {
        complain("ended before the last case");
        return Ok(End::Cancelled);
    }
    say_row(&format!("{} of {} cases passed in {:.1} s", findings.len(), findings.len(), began.elapsed().as_secs_f64()))?;
    Ok(End::Finished)
}

fn row(finding: &Finding) -> String {
    let verdict = if finding.passed { "passed" } else { "FAILED" };
    let Finding { name, expected, found, standard_error, z, .. } = finding;
    format!("{name:<58} {expected:>11.6} {found:>11.6} {standard_error:>10.2e} {z:>6.2} {verdict}")
}
