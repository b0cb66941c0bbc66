//! What a command prints while it runs: device, plan and progress, all on stderr.

use std::cell::{Cell, RefCell};
use std::io::{IsTerminal, Write};
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use clap::{Args, ValueEnum};
use indicatif::{ProgressBar, ProgressStyle};

use super::interrupt::set_interruptible;
use super::{complain, spell};
use crate::engine::Progress;
use crate::gpu::{DeviceFacts, Gpu};
use crate::output::scene_report;
use crate::render::Event;
use crate::text::counted;

#[derive(Args)]
#[command(next_help_heading = "Messages")]
pub(super) struct ProgressArgs {
    /// How progress is shown on stderr
    #[arg(long, value_enum, value_name = "FORM", default_value = "auto")]
    progress: ProgressForm,
    /// Before the report print only warnings and errors: no device, plan or progress
    #[arg(short, long, conflicts_with = "progress")]
    quiet: bool,
    /// Also print every step with the time when it begins, what the device can do, and what a run of a scene explains with
    /// --explain
    #[arg(short, long, conflicts_with = "quiet")]
    pub(super) verbose: bool,
}

/// What a run prints.
#[derive(Args)]
pub(super) struct MessageArgs {
    /// Also print which effects were kept or dropped and why, with the time and the light of each, and what a pilot chose
    #[arg(long, help_heading = "Messages")]
    explain: bool,
    #[command(flatten)]
    pub(super) progress: ProgressArgs,
}

impl MessageArgs {
    pub(super) fn explains(&self) -> bool {
        self.explain || self.progress.verbose
    }
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum ProgressForm {
    /// A bar on a terminal, elsewhere a line every few seconds
    #[value(alias = "bar")]
    Auto,
    /// One JSON object per step
    Json,
}

/// Prints device, plan and progress of a command.
pub(super) struct ProgressReporter {
    form: Form,
    status: Arc<Mutex<String>>,
    /// Prints the status every few seconds; ends when the sender goes.
    ticker: RefCell<Option<(Sender<()>, JoinHandle<()>)>>,
    is_verbose: bool,
    /// Whether what a pilot chooses is explained.
    explains: bool,
    started: Instant,
}

enum Form {
    Quiet,
    /// And whether it now has the style of a run.
    Bar(ProgressBar, Cell<bool>),
    Lines,
    Json,
}

/// Time between two lines.
const INTERVAL: Duration = Duration::from_secs(3);
/// Of the bar.
const BAR_STEPS: u64 = 1000;

/// The bar on the terminal, which must step aside for any other line.
static BAR: Mutex<Option<ProgressBar>> = Mutex::new(None);

/// Prints a line on stderr, above the bar if there is one. Where nobody can read it, the run goes on.
pub(super) fn print_line(line: &str) {
    let print = || drop(writeln!(std::io::stderr(), "{line}"));
    match BAR.lock().unwrap_or_else(PoisonError::into_inner).as_ref() {
        Some(bar) => bar.suspend(print),
        None => print(),
    }
}

impl ProgressReporter {
    pub(super) fn new(args: &ProgressArgs) -> ProgressReporter {
        let status = Arc::new(Mutex::new(String::new()));
        let form = match args.progress {
            _ if args.quiet => Form::Quiet,
            ProgressForm::Json => Form::Json,
            ProgressForm::Auto if std::io::stderr().is_terminal() && takes_escapes() => {
                let bar = ProgressBar::new(BAR_STEPS).with_style(style("{spinner} {elapsed} {msg}"));
                bar.enable_steady_tick(Duration::from_millis(200));
                *BAR.lock().unwrap_or_else(PoisonError::into_inner) = Some(bar.clone());
                Form::Bar(bar, Cell::new(false))
            }
            ProgressForm::Auto => Form::Lines,
        };
        let ticker = matches!(form, Form::Lines).then(|| {
            let (end, ended) = channel::<()>();
            let (status, started) = (status.clone(), Instant::now());
            let thread = std::thread::spawn(move || {
                while ended.recv_timeout(INTERVAL) == Err(RecvTimeoutError::Timeout) {
                    let status = status.lock().unwrap_or_else(PoisonError::into_inner).clone();
                    if !status.is_empty() {
                        complain(&format!("{:.0} s: {status}", started.elapsed().as_secs_f64()));
                    }
                }
            });
            (end, thread)
        });
        ProgressReporter { form, status, ticker: RefCell::new(ticker), is_verbose: args.verbose, explains: false, started: Instant::now() }
    }

    /// The same of a command that explains, where asked.
    pub(super) fn explaining(args: &MessageArgs) -> ProgressReporter {
        let mut reporter = ProgressReporter::new(&args.progress);
        reporter.explains = args.explains();
        reporter
    }

    /// Prints what a run says of itself.
    pub(super) fn event(&self, event: Event) {
        match event {
            Event::Warning(text) => complain(&format!("warning: {text}")),
            Event::Remark(text) => complain(text),
            Event::Note(text) => self.note(&spell(text)),
            Event::Status(text) => self.status(&spell(text)),
            Event::Step(text) => self.step(&spell(text)),
            Event::Pilot(pilot, stop, point) => {
                self.note(&spell(&scene_report::pilot(pilot, stop, point)));
                if self.explains {
                    spell(&scene_report::pilot_table(pilot, stop, point)).lines().for_each(|line| self.note(line));
                }
            }
            Event::Progress(progress, unit) => self.report(progress, unit),
            Event::Interruptible(is_so) => set_interruptible(is_so),
        }
    }

    /// One line, printed now.
    pub(super) fn note(&self, line: &str) {
        match &self.form {
            Form::Quiet => {}
            Form::Json => print_json(&serde_json::json!({ "message": line })),
            Form::Bar(..) | Form::Lines => complain(line),
        }
    }

    /// The device in use; `None` is the CPU builder.
    pub(super) fn device(&self, gpu: Option<&Gpu>) {
        self.note(&format!("device: {}", gpu.map_or_else(|| "CPU".to_owned(), |gpu| gpu.facts().label())));
        if let Some(gpu) = gpu.filter(|_| self.is_verbose) {
            self.note(&abilities(gpu.facts()));
        }
    }

    /// What is being done from now on; printed every few seconds.
    pub(super) fn status(&self, what: &str) {
        self.set_status(what);
        if self.is_verbose && !matches!(self.form, Form::Json) {
            self.note(&format!("{:.2} s: {what}", self.started.elapsed().as_secs_f64()));
        }
        match &self.form {
            Form::Bar(bar, is_run) => {
                if is_run.replace(false) {
                    bar.set_style(style("{spinner} {elapsed} {msg}"));
                }
                bar.set_message(what.to_owned());
            }
            Form::Json => print_json(&serde_json::json!({ "message": what })),
            Form::Quiet | Form::Lines => {}
        }
    }

    /// A step of several, printed now and every few seconds until the next one.
    pub(super) fn step(&self, what: &str) {
        if !self.is_verbose && !matches!(self.form, Form::Json) {
            self.note(what);
        }
        self.status(what);
    }

    /// How far a run has come, in rounds or photons.
    pub(super) fn report(&self, progress: &Progress, unit: &str) {
        match &self.form {
            Form::Quiet => {}
            Form::Lines => self.set_status(&progress_line(progress, unit)),
            Form::Bar(bar, is_run) => {
                if !is_run.replace(true) {
                    bar.set_style(style("{bar:32} {msg}\n{prefix}"));
                }
                bar.set_position((share_done(progress) * BAR_STEPS as f64) as u64);
                bar.set_message(progress_line(progress, unit));
                bar.set_prefix(ledger_line(progress));
            }
            Form::Json => print_json(progress),
        }
    }

    fn set_status(&self, what: &str) {
        what.clone_into(&mut self.status.lock().unwrap_or_else(PoisonError::into_inner));
    }

    /// Ends all output, before the results are printed; so does dropping it.
    pub(super) fn finish(&self) {
        if let Some((end, thread)) = self.ticker.take() {
            drop(end);
            // It only sleeps and prints.
            let _ = thread.join();
        }
        if let Form::Bar(bar, _) = &self.form {
            *BAR.lock().unwrap_or_else(PoisonError::into_inner) = None;
            bar.finish_and_clear();
        }
    }
}

impl Drop for ProgressReporter {
    fn drop(&mut self) {
        self.finish();
    }
}

/// Whether the user's terminal takes the escape sequences of a bar: https://no-color.org, and terminals that only print.
pub(super) fn takes_escapes() -> bool {
    let is_plain = std::env::var_os("TERM").is_some_and(|kind| kind == "dumb");
    !is_plain && std::env::var_os("NO_COLOR").is_none_or(|value| value.is_empty())
}

/// What decides how work is divided.
fn abilities(facts: &DeviceFacts) -> String {
    let DeviceFacts { kind, vulkan, subgroup_size, work_group_size, usable_memory_bytes, device_memory_bytes, .. } = facts;
    let mebibytes = |bytes: &u64| bytes >> 20;
    let atomics = if facts.int64_atomics { "64-bit atomics" } else { "no 64-bit atomics" };
    let [usable, all] = [usable_memory_bytes, device_memory_bytes].map(mebibytes);
    format!(
        "device: {kind}, Vulkan {vulkan}, subgroups of {subgroup_size}, work groups up to {work_group_size}, {atomics}, {usable} of {all} MiB"
    )
}

fn style(template: &str) -> ProgressStyle {
    ProgressStyle::with_template(template).expect("the template is valid")
}

fn print_json(value: &impl serde::Serialize) {
    print_line(&serde_json::to_string(value).expect("progress is plain data"));
}

/// By the time that is predicted, as a run may end before its last round.
fn share_done(progress: &Progress) -> f64 {
    progress.seconds_left.map_or(0.0, |left| progress.seconds / (progress.seconds + left).max(1e-9))
}

/// Amount done, rate, error now and wanted, and the predicted end.
fn progress_line(progress: &Progress, unit: &str) -> String {
    let Progress { done, seconds, photons, .. } = progress;
    let rate = *photons as f64 / seconds.max(1e-9);
    let wanted = progress.error_wanted.map_or_else(String::new, |wanted| format!(" (goal {:.3} %)", 100.0 * wanted));
    let error = progress.error.map_or_else(String::new, |error| format!(", error {:.3} %{wanted}", 100.0 * error));
    let left = progress.seconds_left.map_or_else(String::new, |left| format!(", {left:.0} s left"));
    format!("{}, {rate:.2e} photons/s{error}{left}", counted(done, unit))
}

fn ledger_line(progress: &Progress) -> String {
    let ledger = &progress.ledger;
    format!(
        "{} emitted = {} absorbed + {} escaped + {} cut off; {} stored",
        ledger.emitted, ledger.absorbed, ledger.escaped, ledger.cut_off, ledger.stored
    )
}
