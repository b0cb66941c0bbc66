//! The command of a command line, and what was typed for it.

use clap::parser::ValueSource;
use clap::{Arg, ArgMatches, Command};

/// The innermost command of a command line: `map info` of `photonmill map info FILE`.
pub(super) struct Selected<'a> {
    /// The commands' names; none for the paper's box.
    pub(super) path: Vec<&'a str>,
    pub(super) matches: &'a ArgMatches,
    pub(super) command: &'a Command,
}

impl<'a> Selected<'a> {
    pub(super) fn of(matches: &'a ArgMatches, command: &'a Command) -> Selected<'a> {
        let mut selected = Selected { path: Vec::new(), matches, command };
        while let Some((name, matches)) = selected.matches.subcommand() {
            selected.path.push(name);
            let command = selected.command.find_subcommand(name).unwrap_or(selected.command);
            selected = Selected { path: selected.path, matches, command };
        }
        selected
    }

    /// Arguments that the user gave, in the order of the help.
    pub(super) fn typed(&self) -> impl Iterator<Item = &'a Arg> {
        let matches = self.matches;
        self.command.get_arguments().filter(move |argument| was_typed(matches, argument))
    }
}

pub(super) fn was_typed(matches: &ArgMatches, argument: &Arg) -> bool {
    matches!(matches.try_get_raw(argument.get_id().as_str()), Ok(Some(_)))
        && matches.value_source(argument.get_id().as_str()) == Some(ValueSource::CommandLine)
}
