//! The command line: clap structs turned into settings, one file a subcommand. Nothing else knows
//! clap.

mod bake;
mod bench;
mod devices;
mod paper;
mod plan;
mod probe;
mod render;
mod run;
mod selfcheck;
mod stop;
mod study;
mod transport;

use std::io::{ErrorKind, Write};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use clap::error::{ContextKind, ContextValue, ErrorKind as ParseErrorKind};
use clap::{Args, Parser, Subcommand};

use crate::error::{Error, Result};
use crate::gpu::{Gpu, Options};
use crate::transport::{self as transport_line, Lit};

/// Photon mapping on any Vulkan GPU.
///
/// Without a subcommand, lights the open box of the paper 'Photon Mapping On The GPU' and writes its
/// picture, a timing table and the photon ledger. With no option at all that is the paper's modified
/// implementation with 15 bounces.
#[derive(Parser)]
#[command(version, args_conflicts_with_subcommands = true, max_term_width = 100)]
struct Cli {
    #[command(subcommand)]
    command: Option<Command>,
    #[command(flatten)]
    run: run::RunArgs,
}

#[derive(Subcommand)]
enum Command {
    /// Lists Vulkan devices with the limits that matter here
    Devices(devices::DevicesArgs),
    /// Renders what a camera sees of a scene
    Render(render::RenderArgs),
    /// Bakes the irradiance of every surface into lightmaps
    Bake(bake::BakeArgs),
    /// Asks for the irradiance at given points of a scene
    Probe(probe::ProbeArgs),
    /// Prints which effects a scene calls for, and why
    Plan(plan::PlanArgs),
    /// Holds this device against closed forms, in under a minute
    Selfcheck(selfcheck::SelfcheckArgs),
    /// Measures what accuracy costs in time on this device, choice by choice, and writes a page of it
    Study(study::StudyArgs),
    /// Measures how near every pass comes to what this device can do
    Bench(bench::BenchArgs),
    /// Regenerates every figure and table of the paper as images, CSV and one HTML page
    Paper(paper::PaperArgs),
}

/// Which device, and how closely it is watched.
#[derive(Args)]
#[command(next_help_heading = "Device")]
struct DeviceArgs {
    /// Vulkan device, by index or part of its name; see `photonmill devices` [default: a discrete GPU
    /// if there is one]
    #[arg(long, value_name = "INDEX|NAME")]
    device: Option<String>,
    /// Turn on the Vulkan validation layer with synchronisation validation; any message is an error
    #[arg(long)]
    validate: bool,
}

impl DeviceArgs {
    fn options(&self) -> Options {
        Options { device: self.device.clone(), validate: self.validate, ..Options::default() }
    }

    /// The same for a command that measures.
    fn steady(&self) -> Options {
        Options { warm_up: true, ..self.options() }
    }

    /// The device, or `None` after one line on stderr if there is no Vulkan and none was asked for.
    fn open(&self, options: &Options) -> Result<Option<Gpu>> {
        match Gpu::open(options) {
            Ok(gpu) => Ok(Some(gpu)),
            Err(error @ (Error::NoVulkan { .. } | Error::DeviceLacks { .. })) if self.device.is_none() => {
                complain(&format!("{error}; running the CPU builder instead"));
                Ok(None)
            }
            Err(error) => Err(error),
        }
    }
}

/// How a run is timed.
#[derive(Args)]
#[command(next_help_heading = "Timing")]
struct TimingArgs {
    /// Time every dispatch on the device, not only every pass
    #[arg(long)]
    time_dispatches: bool,
    /// Keep the device busy before the first round, so that GPU times are those at the clock of work, to which a card that
    /// idled takes 0.3 s to come; in no time of the report but that of --bias
    #[arg(long)]
    warm_up: bool,
}

impl TimingArgs {
    fn options(&self, device: &DeviceArgs) -> Options {
        Options { time_dispatches: self.time_dispatches, warm_up: self.warm_up, ..device.options() }
    }
}

/// How a command ended that did not fail.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum End {
    Finished,
    /// By Ctrl-C, with what was finished saved.
    Cancelled,
}

impl End {
    fn of(lit: &Lit) -> End {
        if lit.end == transport_line::End::Cancelled { End::Cancelled } else { End::Finished }
    }
}

/// Runs the program on the process's arguments and returns its exit code.
pub fn main() -> u8 {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) if !error.use_stderr() => {
            // Help or version: what was asked for.
            let _ = error.print();
            return 0;
        }
        Err(error) => {
            complain(&one_line(&error));
            return 2;
        }
    };
    let cancelled = cancel_on_interrupt();
    let result = match cli.command {
        None => hearing(|| run::run(&cli.run, &cancelled)),
        Some(Command::Devices(args)) => devices::run(&args).map(|()| End::Finished),
        Some(Command::Render(args)) => render::run(&args, &cancelled),
        Some(Command::Bake(args)) => bake::run(&args, &cancelled),
        Some(Command::Probe(args)) => probe::run(&args, &cancelled),
        Some(Command::Plan(args)) => plan::run(&args).map(|()| End::Finished),
        Some(Command::Selfcheck(args)) => hearing(|| selfcheck::run(&args, &cancelled)),
        Some(Command::Study(args)) => hearing(|| study::run(&args, &cancelled)),
        Some(Command::Bench(args)) => hearing(|| bench::run(&args, &cancelled)),
        Some(Command::Paper(args)) => hearing(|| paper::run(&args, &cancelled)),
    };
    match result {
        Ok(End::Finished) => 0,
        Ok(End::Cancelled) => 130,
        Err(error) => {
            complain(&error.to_string());
            error.exit_code()
        }
    }
}

/// One line on stderr. Where nobody can read it, the exit code still tells.
fn complain(line: &str) {
    // Names of files and of things in them may hold anything; a complaint stays one line.
    let line: String = line.chars().map(|letter| if letter.is_control() { ' ' } else { letter }).collect();
    let _ = writeln!(std::io::stderr(), "photonmill: {line}");
}

/// Text on stdout; a reader that has gone away, as `head` does, has seen enough.
fn say(text: &str) -> Result<()> {
    match writeln!(std::io::stdout(), "{text}") {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => {
            Err(Error::Output { option: "standard output", path: PathBuf::from("(stdout)"), reason: error.kind().to_string() })
        }
        _ => Ok(()),
    }
}

/// Whether what is under way looks at the flag; a scene that is being read does not.
static HEARS_CANCELLING: AtomicBool = AtomicBool::new(false);

/// Runs `body`, which looks at the flag.
fn hearing<T>(body: impl FnOnce() -> T) -> T {
    HEARS_CANCELLING.store(true, Ordering::Relaxed);
    let result = body();
    HEARS_CANCELLING.store(false, Ordering::Relaxed);
    result
}

/// The first Ctrl-C (or SIGTERM) ends the run after the photons that are under way, the second at
/// once; no temporary file exists before the end.
fn cancel_on_interrupt() -> Arc<AtomicBool> {
    let cancelled = Arc::new(AtomicBool::new(false));
    let flag = cancelled.clone();
    let handler = move || {
        if flag.swap(true, Ordering::Relaxed) || !HEARS_CANCELLING.load(Ordering::Relaxed) {
            std::process::exit(130);
        }
        complain("ending after the photons under way; Ctrl-C again to end at once");
    };
    // Without a handler Ctrl-C ends the program at once, and files still appear whole or not at all.
    let _ = ctrlc::set_handler(handler);
    cancelled
}

/// clap's complaint as one sentence with option, value and what is allowed.
fn one_line(error: &clap::Error) -> String {
    let context = |kind: ContextKind| match error.get(kind) {
        Some(ContextValue::String(text)) => text.clone(),
        Some(ContextValue::Strings(texts)) => texts.join(", "),
        _ => String::new(),
    };
    let argument = context(ContextKind::InvalidArg);
    let value = context(ContextKind::InvalidValue);
    let option = argument.split([' ', '=']).next().unwrap_or_default();
    match error.kind() {
        ParseErrorKind::InvalidValue if !context(ContextKind::ValidValue).is_empty() => {
            let shown = if value.is_empty() { "(no value)" } else { &value };
            format!("{option} {shown}: must be one of {}", context(ContextKind::ValidValue))
        }
        ParseErrorKind::ValueValidation => {
            let reason = std::error::Error::source(error).map(ToString::to_string).unwrap_or_default();
            format!("{option} {value}: {reason}")
        }
        ParseErrorKind::UnknownArgument => format!("{argument}: there is no such option; see --help"),
        ParseErrorKind::InvalidSubcommand => {
            format!("{}: there is no such subcommand; see --help", context(ContextKind::InvalidSubcommand))
        }
        _ => {
            let rendered = error.render().to_string();
            let sentence: Vec<&str> = rendered.lines().take_while(|line| !line.is_empty()).map(str::trim).collect();
            sentence.join(" ").trim_start_matches("error: ").to_owned()
        }
    }
}
