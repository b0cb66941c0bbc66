//! The arguments of a command that decide its picture, as the user typed them: what a picture of the paper's box says of them, and
//! what `photonmill repeat` reads back; and what a window takes over.

use clap::parser::ValueSource;
use clap::{Arg, ArgMatches, Command};

use crate::render::options::{Decides, row};
use crate::text::quoted;

/// Headings of options of the paper's box that change no pixel: where results go, how they are made and watched, and when the run ends, of
/// which the rounds that it had say enough.
const WITHOUT_EFFECT: [&str; 6] = ["Output", "Messages", "Checks", "Device", "When to stop", "Implementation"];
/// Options under them that do change the file.
const WITH_EFFECT: [&str; 7] = ["exposure", "tone", "measure", "confidence", "math", "sums", "gather"];
/// Options under other headings in whose place the metadata has what came of them.
const IN_FORCE: [&str; 3] = ["rounds", "config", "print_config"];

#[derive(Debug, Clone, PartialEq)]
struct Argument {
    /// With its dashes; `None` where it is known by its place.
    option: Option<String>,
    /// `None` of a switch.
    value: Option<String>,
}

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

/// Of one command.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Typed {
    /// Empty for the paper's box.
    pub(super) command: String,
    arguments: Vec<Argument>,
}

fn is_kept(argument: &Arg, is_of_box: bool) -> bool {
    let id = argument.get_id().as_str();
    if let Some(row) = row(id).filter(|_| !is_of_box) {
        return row.decides == Decides::Picture;
    }
    let is_under = argument.get_help_heading().is_some_and(|heading| WITHOUT_EFFECT.contains(&heading));
    (!is_under || WITH_EFFECT.contains(&id)) && !IN_FORCE.contains(&id)
}

impl Typed {
    pub(super) fn of(matches: &ArgMatches, command: &Command) -> Typed {
        let selected = Selected::of(matches, command);
        let name = selected.path.join(" ");
        let matches = selected.matches;
        let of_argument = |argument: &Arg| -> Vec<Argument> {
            let values = matches.get_raw(argument.get_id().as_str()).into_iter().flatten();
            let values: Vec<String> = values.map(|value| value.to_string_lossy().into_owned()).collect();
            match argument.get_long() {
                Some(long) => {
                    let value = argument.get_action().takes_values().then(|| values.join(","));
                    vec![Argument { option: Some(format!("--{long}")), value }]
                }
                None => values.into_iter().map(|value| Argument { option: None, value: Some(value) }).collect(),
            }
        };
        let known = selected.typed().filter(|argument| is_kept(argument, name.is_empty()));
        let mut arguments: Vec<Argument> = known.flat_map(of_argument).collect();
        // The scene first.
        arguments.sort_by_key(|argument| argument.option.is_some());
        Typed { command: name, arguments }
    }

    /// As clap takes them.
    pub(super) fn words(&self) -> Vec<String> {
        let word = |Argument { option, value }: &Argument| match (option, value) {
            (Some(option), Some(value)) => format!("{option}={value}"),
            (option, value) => option.as_ref().or(value.as_ref()).cloned().unwrap_or_default(),
        };
        self.arguments.iter().map(word).collect()
    }

    /// The command line for a shell, with options behind it.
    pub(super) fn line(&self, more: &[(&str, String)]) -> String {
        let own = self.arguments.iter().flat_map(|argument| [&argument.option, &argument.value]).flatten().cloned();
        let more = more.iter().flat_map(|(option, value)| [(*option).to_owned(), value.clone()]);
        let words = ["photonmill".to_owned(), self.command.clone()].into_iter().filter(|word| !word.is_empty()).chain(own).chain(more);
        words.map(quoted).collect::<Vec<String>>().join(" ")
    }
}
