//! The options of a request as clap's arguments, from their rows.

use std::path::PathBuf;

use clap::builder::{PossibleValue, PossibleValuesParser, ValueParser};
use clap::{Arg, ArgAction, ArgMatches, Args, Command, FromArgMatches, value_parser};

use super::{help, spell};
use crate::render::RenderRequest;
use crate::render::options::{self, ROWS, Row};
use crate::render::values::Form;

/// The request of a command, whose number this is.
pub(super) struct RequestArgs<const COMMAND: u32>(pub(super) RenderRequest);

pub(super) const RENDER: u32 = options::Command::Render as u32;
pub(super) const VIEW: u32 = options::Command::View as u32;
pub(super) const BAKE: u32 = options::Command::Bake as u32;
pub(super) const PROBE: u32 = options::Command::Probe as u32;
pub(super) const MAP: u32 = options::Command::Map as u32;
pub(super) const PLAN: u32 = options::Command::Plan as u32;
#[cfg(feature = "lab")]
pub(super) const STUDY: u32 = options::Command::Study as u32;
pub(super) const BOX: u32 = options::Command::Box as u32;
pub(super) const MERGE: u32 = options::Command::Merge as u32;

/// What a command line calls the scene.
const SCENE: &str = "scene";

impl<const COMMAND: u32> Args for RequestArgs<COMMAND> {
    fn augment_args(command: Command) -> Command {
        let scene = Arg::new(SCENE).value_name("SCENE").help(help::scene()).required(true);
        let scene = has_scene(COMMAND).then_some(scene);
        scene.into_iter().chain(rows(COMMAND).map(|row| argument(row, COMMAND))).fold(command, Command::arg)
    }

    fn augment_args_for_update(command: Command) -> Command {
        RequestArgs::<COMMAND>::augment_args(command)
    }
}

impl<const COMMAND: u32> FromArgMatches for RequestArgs<COMMAND> {
    fn from_arg_matches(matches: &ArgMatches) -> Result<RequestArgs<COMMAND>, clap::Error> {
        let scene = if has_scene(COMMAND) { matches.get_one::<String>(SCENE) } else { None };
        let mut request = RenderRequest::of(scene.cloned().unwrap_or_default());
        for row in rows(COMMAND) {
            let value = (row.of)(&mut request);
            let read = "clap has read it once";
            match row.form() {
                Form::Flag if matches.get_flag(row.field) => value.read("on").expect(read),
                Form::Flag => {}
                _ => matches.get_raw(row.field).into_iter().flatten().for_each(|text| value.read_os(text).expect(read)),
            }
        }
        Ok(RequestArgs(request))
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
        *self = RequestArgs::from_arg_matches(matches)?;
        Ok(())
    }
}

fn has_scene(command: u32) -> bool {
    command & (BOX | MERGE) == 0
}

fn rows(command: u32) -> impl Iterator<Item = &'static Row> {
    ROWS.iter().filter(move |row| row.is_of(command))
}

fn argument(row: &'static Row, command: u32) -> Arg {
    let argument = Arg::new(row.field)
        .long(row.option())
        .help(spell(&row.help(command)))
        .help_heading(row.group.heading())
        .requires_all(row.requires)
        .conflicts_with_all(row.conflicts.iter().filter(|other| rows(command).any(|row| row.field == **other)));
    let form = row.form();
    if form == Form::Flag {
        return argument.action(ArgAction::SetTrue);
    }
    let argument = argument.value_name(row.value).value_parser(parser(row));
    match form {
        Form::Names(_) => argument.value_delimiter(',').action(ArgAction::Append),
        // What begins with a hyphen is another option, and not the name that was forgotten.
        Form::Text | Form::File | Form::Choice(_) | Form::Switch => argument,
        _ => argument.allow_hyphen_values(true),
    }
}

fn parser(row: &'static Row) -> ValueParser {
    match row.form() {
        Form::File => value_parser!(PathBuf),
        Form::Choice(choices) => {
            let value = |(name, meaning): &(&'static str, &'static str)| {
                let value = PossibleValue::new(*name);
                if meaning.is_empty() { value } else { value.help(spell(meaning)) }
            };
            PossibleValuesParser::new(choices.iter().map(value)).into()
        }
        Form::Switch => PossibleValuesParser::new(["on", "off"]).into(),
        Form::Names(names) => PossibleValuesParser::new(names).into(),
        _ => ValueParser::new(move |text: &str| (row.of)(&mut RenderRequest::default()).read(text).map(|()| text.to_owned())),
    }
}
