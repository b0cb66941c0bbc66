//! The command line: arguments become requests, one file per subcommand. Nothing else knows clap.

mod bake;
#[cfg(feature = "lab")]
mod bench;
mod compare;
mod config;
mod devices;
mod display;
#[cfg(feature = "lab")]
mod gallery;
mod help;
mod info;
mod interrupt;
#[cfg(feature = "lab")]
mod lab;
mod manual;
mod map;
mod merge;
mod messages;
mod options;
#[cfg(feature = "lab")]
mod paper;
mod plan;
mod probe;
mod progress;
mod render;
mod repeat;
mod request;
mod run;
mod selected;
mod selfcheck;
#[cfg(feature = "lab")]
mod study;
mod usage;
mod values;
#[cfg(feature = "window")]
mod view;

use std::ffi::OsString;
use std::path::PathBuf;

use clap::error::ErrorKind as ClapErrorKind;
use clap::{ArgMatches, Args, ColorChoice, CommandFactory, FromArgMatches, Parser, Subcommand};

use crate::error::{Error, Result};
use crate::gpu::{Gpu, Options};
use interrupt::{cancel_on_signal, exit_code, interruptible};
use messages::{End, complain, optional_file, say, say_beside, say_written, spell};
use values::parse_bytes;

/// Photon mapping on any Vulkan GPU.
///
/// `photonmill render` makes a picture of a scene, `photonmill bake` lightmaps. With options but no command, photonmill lights the
/// open box of the paper 'Photon Mapping On The GPU', writes its picture and prints the photon ledger and the time of
/// every pass; the options below belong to that box.
#[derive(Parser)]
#[command(version, args_conflicts_with_subcommands = true, max_term_width = 100, after_help = help::MAIN)]
struct Cli {
    #[command(subcommand)]
    command: Option<Command>,
    #[command(flatten)]
    config: config::ConfigArgs,
    #[command(flatten)]
    run: run::RunArgs,
}

#[derive(Subcommand)]
enum Command {
    /// Render a picture of a scene
    #[command(after_help = help::RENDER)]
    Render(Box<render::RenderArgs>),
    /// Look at a scene, or at the paper's box, while its picture is refined, and fly through it
    #[cfg(feature = "window")]
    #[command(after_help = view::HELP, mut_arg("scene", |argument| argument.help(format!("{}; or `box`, the paper's", help::scene()))))]
    View(view::ViewArgs),
    /// Bake the irradiance of all surfaces of a scene into lightmaps
    #[command(after_help = help::BAKE)]
    Bake(bake::BakeArgs),
    /// Compute the irradiance at given points of a scene
    #[command(after_help = help::PROBE)]
    Probe(probe::ProbeArgs),
    /// Run a picture again from what its file says of how it was made, and check that the same bits come out
    #[command(after_help = help::REPEAT)]
    Repeat(repeat::RepeatArgs),
    /// Add the parts of a run that --shard or --checkpoint left, to the bits of one run
    #[command(after_help = help::MERGE)]
    Merge(merge::MergeArgs),
    /// Write the photons of a scene into a file, for `render --map`; print or export what such a file holds
    #[command(after_help = help::MAP)]
    Map(map::MapArgs),
    /// Print which effects a scene needs, and why
    #[command(after_help = help::PLAN)]
    Plan(plan::PlanArgs),
    /// Print what a scene's file holds, and what became of its materials
    #[command(after_help = help::INFO)]
    Info(info::InfoArgs),
    /// Compare two pictures: deviations, bias, FLIP, and whether they agree within their errors
    #[command(after_help = help::COMPARE)]
    Compare(compare::CompareArgs),
    /// List the Vulkan devices and their limits
    #[command(after_help = help::DEVICES)]
    Devices(devices::DevicesArgs),
    /// Check the results of a device against known solutions, in less than a minute
    #[command(after_help = help::SELFCHECK)]
    Selfcheck(selfcheck::SelfcheckArgs),
    #[cfg(feature = "lab")]
    #[command(flatten)]
    Lab(lab::Command),
    /// Print a script by which a shell completes commands and options
    #[command(after_help = help::COMPLETIONS)]
    Completions(manual::CompletionsArgs),
    /// Print the manual page, or write those of all commands into a folder
    #[command(after_help = help::MAN)]
    Man(manual::ManArgs),
}

/// Which device, and how closely it is watched.
#[derive(Args)]
#[command(next_help_heading = "Device")]
struct DeviceArgs {
    /// Vulkan device: its number or a part of its name, as `photonmill devices` lists them [default: a discrete
    /// GPU if there is one]
    #[arg(long, value_name = "NUMBER|NAME", allow_negative_numbers = true)]
    device: Option<String>,
    /// Most device memory that buffers may take, as 512M or 2G; work is done in smaller pieces to keep to it, with the same result to
    /// the bit [default: half of the device's]
    #[arg(long, value_name = "BYTES", value_parser = parse_bytes, allow_hyphen_values = true)]
    memory: Option<u64>,
    /// Turn on the Vulkan validation layer with synchronization validation; any message is an error
    #[arg(long)]
    validate: bool,
}

impl DeviceArgs {
    fn options(&self) -> Options {
        Options { device: self.device.clone(), validate: self.validate, memory: self.memory, ..Options::default() }
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

/// Reports as files.
#[derive(Args)]
struct JsonArg {
    /// Write the report as JSON; `-` is standard output
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    json: Option<PathBuf>,
}

/// The same for commands that print what they find, where the file may be left out.
#[derive(Args)]
struct JsonOrStdoutArg {
    /// Write the report as JSON; `-`, or no FILE, is standard output
    #[arg(long, value_name = "FILE", num_args = 0..=1, default_missing_value = "-", help_heading = "Output")]
    json: Option<PathBuf>,
}

/// How a run is timed.
#[derive(Args)]
#[command(next_help_heading = "Device")]
struct TimingArgs {
    /// Time every dispatch on the device, not only every pass
    #[arg(long)]
    time_dispatches: bool,
    /// Run warm-up work first, so that times are taken at full clock; it is excluded from all reported times but that of
    /// --bias
    #[arg(long)]
    warm_up: bool,
}

impl TimingArgs {
    fn options(&self, device: &DeviceArgs) -> Options {
        Options { time_dispatches: self.time_dispatches, warm_up: self.warm_up, ..device.options() }
    }
}

/// Runs the program on the process's arguments and returns its exit code.
pub fn main() -> u8 {
    let mut arguments: Vec<OsString> = std::env::args_os().collect();
    if arguments.len() == 1 {
        return print_start();
    }
    // `help --help` is `help`, and `help render --help` is `help render`.
    if arguments[1] == "help" {
        arguments.retain(|argument| argument != "--help" && argument != "-h");
    }
    // clap colours a plain terminal of a machine that says it runs tests, too.
    let colours = if progress::takes_escapes() { ColorChoice::Auto } else { ColorChoice::Never };
    let mut command = Cli::command().color(colours);
    command.build();
    let refuse = |reason: &str| {
        complain(reason);
        2
    };
    let (arguments, origins) = match config::expanded(&command, arguments) {
        Ok(expanded) => expanded,
        Err(reason) => return refuse(&reason),
    };
    let parsed = command.clone().try_get_matches_from(&arguments).and_then(|matches| Ok((Cli::from_arg_matches(&matches)?, matches)));
    let (cli, matches) = match parsed {
        Ok(parsed) => parsed,
        Err(error) if !error.use_stderr() => {
            // Help or version: what was asked for.
            let _ = error.print();
            return 0;
        }
        Err(error) => {
            let is_incomplete = error.kind() == ClapErrorKind::MissingRequiredArgument;
            return match config::incomplete(&command, &arguments).filter(|_| is_incomplete) {
                Some(matches) => print_config(&command, &matches),
                None => refuse(&origins.located(usage::one_line(&error, &command, &arguments))),
            };
        }
    };
    if cli.config.is_printed() {
        return print_config(&command, &matches);
    }
    if let Err(reason) = config::check_not_named_again(&command, &matches) {
        return refuse(&origins.located(reason));
    }
    let cancelled = cancel_on_signal();
    let result = match cli.command {
        None => interruptible(|| run::run(&cli.run, &cancelled)),
        Some(Command::Devices(args)) => devices::run(&args).map(|()| End::Finished),
        Some(Command::Render(args)) => render::run(&args, &cancelled),
        #[cfg(feature = "window")]
        Some(Command::View(args)) => view::run(&args, &cancelled),
        Some(Command::Repeat(args)) => repeat::run(args, &cancelled),
        Some(Command::Bake(args)) => bake::run(&args, &cancelled),
        Some(Command::Probe(args)) => probe::run(&args, &cancelled),
        Some(Command::Map(args)) => map::run(&args, &cancelled),
        Some(Command::Merge(args)) => merge::run(&args).map(|()| End::Finished),
        Some(Command::Plan(args)) => plan::run(&args).map(|()| End::Finished),
        Some(Command::Info(args)) => info::run(&args).map(|()| End::Finished),
        Some(Command::Compare(args)) => compare::run(&args).map(|()| End::Finished),
        Some(Command::Selfcheck(args)) => interruptible(|| selfcheck::run(&args, &cancelled)),
        #[cfg(feature = "lab")]
        Some(Command::Lab(command)) => interruptible(|| lab::run(&command, &cancelled)),
        Some(Command::Completions(args)) => manual::completions(&args, Cli::command()).map(|()| End::Finished),
        Some(Command::Man(args)) => manual::man(&args, Cli::command()).map(|()| End::Finished),
    };
    match result {
        Ok(End::Finished) => 0,
        Ok(End::Cancelled) => exit_code(),
        Err(error) => {
            let error = usage::as_typed(error, &matches, &command);
            complain(&origins.located(spell(&error.to_string())));
            if matches!(error, Error::Interrupted) { exit_code() } else { error.exit_code() }
        }
    }
}

fn print_start() -> u8 {
    printed(say(help::START))
}

fn print_config(command: &clap::Command, matches: &ArgMatches) -> u8 {
    match config::printed(command, matches) {
        Ok(text) => printed(say(&text)),
        Err(reason) => {
            complain(&reason);
            2
        }
    }
}

/// The exit code of a program that only prints.
fn printed(result: Result<()>) -> u8 {
    result.map_or_else(
        |error| {
            complain(&error.to_string());
            error.exit_code()
        },
        |()| 0,
    )
}
