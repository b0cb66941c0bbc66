//! Complaints about the command line, as one sentence with option, value as typed, and what is allowed.

use std::ffi::OsString;

use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::{Arg, ArgMatches, Command};

use super::selected::{Selected, was_typed};
use crate::error::Error;
use crate::output::words::list;
use crate::render::names::as_option;
use crate::scene::built_in;
use crate::text::echo;

/// What clap complains of, in one line.
pub(super) fn one_line(error: &clap::Error, command: &Command, arguments: &[OsString]) -> String {
    let context = |kind: ContextKind| match error.get(kind) {
        Some(ContextValue::String(text)) => echo(text),
        Some(ContextValue::Strings(texts)) => texts.join(", "),
        _ => String::new(),
    };
    // clap has the best one last.
    let similar = |kind: ContextKind| match error.get(kind) {
        Some(ContextValue::String(text)) => format!("did you mean {text}? "),
        Some(ContextValue::Strings(texts)) if !texts.is_empty() => {
            format!("did you mean {}? ", texts.iter().rev().cloned().collect::<Vec<_>>().join(" or "))
        }
        _ => String::new(),
    };
    let argument = context(ContextKind::InvalidArg);
    let value = context(ContextKind::InvalidValue);
    let option = argument.split([' ', '=']).next().unwrap_or_default();
    match error.kind() {
        ErrorKind::InvalidValue if !context(ContextKind::ValidValue).is_empty() => {
            let shown = if value.is_empty() { "(no value)" } else { &value };
            format!("{option} {shown}: {}must be one of {}", similar(ContextKind::SuggestedValue), context(ContextKind::ValidValue))
        }
        ErrorKind::ValueValidation => {
            let reason = std::error::Error::source(error).map(ToString::to_string).unwrap_or_default();
            format!("{option} {value}: {reason}")
        }
        ErrorKind::UnknownArgument => scene_without_command(&argument)
            .or_else(|| of_other_commands(&argument, command))
            .unwrap_or_else(|| format!("{argument}: no such option; {}see --help", similar(ContextKind::SuggestedArg))),
        ErrorKind::MissingRequiredArgument => {
            let used = arguments.iter().find_map(|argument| command.find_subcommand(argument)).unwrap_or(command);
            let missing = match error.get(ContextKind::InvalidArg) {
                Some(ContextValue::Strings(names)) => names.join(" and "),
                _ => argument,
            };
            let help = used.get_after_help().map(ToString::to_string).unwrap_or_default();
            let example = help.lines().nth(1).unwrap_or_default().trim();
            format!("required: {missing}; for example: {example}")
        }
        ErrorKind::InvalidSubcommand => {
            let name = context(ContextKind::InvalidSubcommand);
            scene_without_command(&name)
                .unwrap_or_else(|| format!("{name}: no such command; {}see --help", similar(ContextKind::SuggestedSubcommand)))
        }
        _ => {
            let name = context(ContextKind::InvalidSubcommand);
            let rendered = error.render().to_string();
            let sentence = rendered.lines().take_while(|line| !line.is_empty()).flat_map(str::split_whitespace).skip(1);
            match scene_without_command(&name) {
                Some(meant) => meant,
                None if !name.is_empty() => {
                    format!("{name}: options stand after the command: photonmill {name} ... {}", context(ContextKind::PriorArg))
                }
                None => sentence.map(echo).collect::<Vec<_>>().join(" "),
            }
        }
    }
}

/// Where an option belongs that this command does not know.
fn of_other_commands(option: &str, command: &Command) -> Option<String> {
    let knows = |command: &&Command| command.get_arguments().filter_map(Arg::get_long).any(|long| option.strip_prefix("--") == Some(long));
    let main = knows(&command).then_some("photonmill without a command");
    let names: Vec<String> = command.get_subcommands().filter(knows).map(Command::get_name).chain(main).map(str::to_owned).collect();
    let first = command.get_subcommands().find(knows).map_or_else(String::new, |first| format!("{} ", first.get_name()));
    (!names.is_empty()).then(|| format!("{option}: is an option of {}; see photonmill {first}--help", list(&names)))
}

/// What to type for a scene that stands where a command is expected.
fn scene_without_command(name: &str) -> Option<String> {
    let is_file = [".gltf", ".glb"].iter().any(|ending| name.to_lowercase().ends_with(ending));
    (is_file || built_in::names().contains(&name))
        .then(|| format!("{name}: a scene needs a command; to render it: photonmill render {name} -o picture.png"))
}

/// The same error with the option's value as the user typed it. Settings hold what was understood: 0.0095 of
/// `--confidence 0.95`, in which nobody finds the fault.
pub(super) fn as_typed(error: Error, matches: &ArgMatches, command: &Command) -> Error {
    let Error::Setting { option, value, allowed } = error else { return error };
    let Selected { matches, command, .. } = Selected::of(matches, command);
    let argument = command
        .get_arguments()
        .filter(|argument| argument.get_long().is_some_and(|long| as_option(option.trim_start_matches("--")) == format!("--{long}")))
        .find(|argument| argument.get_action().takes_values())
        .filter(|argument| was_typed(matches, argument));
    let typed: Vec<_> = argument.and_then(|argument| matches.get_raw(argument.get_id().as_str())).into_iter().flatten().collect();
    // Of a list, the value already is the entry in question.
    let value = if let [typed] = typed[..] { typed.to_string_lossy().into_owned() } else { value };
    Error::Setting { option, value, allowed }
}
