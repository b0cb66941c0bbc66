//! `photonmill completions` and `photonmill man`: what clap knows of the commands, for shells and for man.

use std::path::PathBuf;

use clap::builder::PossibleValuesParser;
use clap::{Args, Command};
use clap_complete::Shell;
use clap_mangen::Man;
use clap_mangen::roff::{Roff, roman};

use super::say;
use crate::error::Result;
use crate::output::destination::{Folder, write_all};
use crate::scene::built_in;

#[derive(Args)]
pub(super) struct CompletionsArgs {
    /// The shell
    #[arg(value_enum, value_name = "SHELL")]
    shell: Shell,
}

#[derive(Args)]
pub(super) struct ManArgs {
    /// Write photonmill.1 and a page for each command into this folder
    #[arg(value_name = "DIR")]
    folder: Option<PathBuf>,
}

const NAME: &str = "photonmill";

pub(super) fn completions(args: &CompletionsArgs, command: Command) -> Result<()> {
    // Of all shells only bash still offers files where names are known.
    let mut command = if args.shell == Shell::Bash { with_scene_names(command) } else { command };
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut command, NAME, &mut script);
    say(String::from_utf8_lossy(&script).trim_end())
}

fn with_scene_names(command: Command) -> Command {
    let names: Vec<String> = command.get_subcommands().map(|command| command.get_name().to_owned()).collect();
    names.into_iter().fold(command, |command, name| {
        command.mut_subcommand(name, |command| {
            let has_scene = command.get_positionals().any(|argument| argument.get_id() == "scene");
            let named = |argument: clap::Arg| argument.value_parser(PossibleValuesParser::new(built_in::names()));
            if has_scene { command.mut_arg("scene", named) } else { command }
        })
    })
}

pub(super) fn man(args: &ManArgs, command: Command) -> Result<()> {
    let mut command = command.disable_help_subcommand(true);
    command.build();
    let Some(path) = &args.folder else { return say(String::from_utf8_lossy(&page(&manual(&command), &command)).trim_end()) };
    let folder = Folder::open("DIR", path)?;
    std::fs::create_dir_all(path).map_err(|error| folder.itself().failed(&error))?;
    let pages = pages(&command);
    let count = pages.len();
    write_all(pages.into_iter().map(|(name, page)| (folder.file(&name), page)))?;
    say(&format!("wrote {count} pages into {}", path.display()))
}

fn manual(command: &Command) -> Man {
    Man::new(command.clone()).source(concat!("photonmill ", env!("CARGO_PKG_VERSION")))
}

/// Name and page of a command, and of those within it.
fn pages(command: &Command) -> Vec<(String, Vec<u8>)> {
    let man = manual(command);
    let own = (man.get_filename(), page(&man, command));
    [own].into_iter().chain(command.get_subcommands().flat_map(pages)).collect()
}

/// A page with its examples as lines that keep their ends.
fn page(man: &Man, command: &Command) -> Vec<u8> {
    let examples = command.get_after_help().map(ToString::to_string).unwrap_or_default();
    let mut page = Vec::new();
    let render = |page: &mut Vec<u8>| -> std::io::Result<()> {
        man.render_title(page)?;
        man.render_name_section(page)?;
        man.render_synopsis_section(page)?;
        man.render_description_section(page)?;
        man.render_options_section(page)?;
        if command.has_subcommands() {
            man.render_subcommands_section(page)?;
        }
        let mut roff = Roff::new();
        roff.control("SH", ["EXAMPLES"]).control("nf", []);
        examples.lines().filter(|line| *line != "Examples:").for_each(|line| {
            roff.text([roman(line)]);
        });
        roff.control("fi", []).to_writer(page)
    };
    render(&mut page).expect("memory takes all that is written");
    page
}
