//! `--config FILE.toml`: a file's options, put into the command line beside those that are typed. `--print-config`: the options
//! of a command line as such a file.

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::path::{Path, PathBuf};

use clap::{Arg, ArgAction, ArgMatches, Args, Command, CommandFactory};
use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::Cli;
use super::selected::{Selected, was_typed};
use crate::scene::file;
use crate::text::echo;

/// Every command has them.
#[derive(Args)]
pub(super) struct ConfigArgs {
    /// Take options from a TOML file, named as they are here; those on the command line win
    #[arg(long, value_name = "FILE", global = true)]
    config: Option<PathBuf>,
    /// Print the options in force as a file for --config, with the defaults as comments, and exit
    #[arg(long, global = true)]
    print_config: bool,
}

impl ConfigArgs {
    pub(super) fn is_printed(&self) -> bool {
        self.print_config
    }
}

/// Name of the table of options for the paper's box, which has no command.
const BOX: &str = "open-box";
/// Arguments that stand in no file.
const NOT_IN_FILES: [&str; 4] = ["config", "print_config", "help", "version"];
/// Names this much alike may have been meant.
const ALIKE: f64 = 0.8;

/// Where a file says which option.
#[derive(Default)]
pub(super) struct Origins {
    path: PathBuf,
    /// By option with its dashes, or the name of an argument.
    lines: BTreeMap<String, usize>,
}

impl Origins {
    /// A complaint about an option, with the place in the file where it stands.
    pub(super) fn located(&self, complaint: String) -> String {
        let option = complaint.trim_start_matches("the argument '").split([' ', ':', '\'']).next().unwrap_or_default();
        match self.lines.get(option) {
            Some(line) => format!("{}: {complaint}", place(&self.path, *line)),
            // clap does not say of which option.
            None if complaint.starts_with("required: ") && !self.lines.is_empty() => {
                format!("with the options of {}: {complaint}", echo(self.path.display()))
            }
            None => complaint,
        }
    }
}

fn place(path: &Path, line: usize) -> String {
    format!("{}, line {line}", echo(path.display()))
}

/// The command line with the options of the file that it names.
pub(super) fn expanded(known: &Command, arguments: Vec<OsString>) -> Result<(Vec<OsString>, Origins), String> {
    let Some(matches) = lenient(&arguments) else { return Ok((arguments, Origins::default())) };
    let selected = Selected::of(&matches, known);
    let Some(path) = selected.matches.get_one::<PathBuf>("config") else { return Ok((arguments, Origins::default())) };
    let refuse = |reason: &str| format!("--config {}: {reason}", echo(path.display()));
    let content = file::read(path).map_err(|reason| refuse(&format!("{reason}; name a TOML file")))?;
    let text = String::from_utf8(content).map_err(|_| refuse("is no text; name a TOML file"))?;
    let line_of = |at: usize| text[..at.min(text.len())].matches('\n').count() + 1;
    let table = DeTable::parse(&text).map_err(|error| {
        let line = line_of(error.span().map_or(0, |span| span.start));
        format!("{}: is no TOML: {}", place(path, line), error.message().lines().collect::<Vec<_>>().join(", "))
    })?;
    let mut file =
        File { known, path, line_of: &line_of, given: Vec::new(), origins: Origins { path: path.clone(), ..Origins::default() } };
    file.take(table.get_ref(), &selected)?;
    Ok((file.insert(arguments, &selected), file.origins))
}

/// What clap understands of a command line that may lack what the file has; `None` where it asks for help.
fn lenient(arguments: &[OsString]) -> Option<ArgMatches> {
    Cli::command().ignore_errors(true).try_get_matches_from(arguments).ok()
}

/// Arguments of a command that may stand in files: by name, in the order of the help.
fn in_files(command: &Command) -> impl Iterator<Item = (String, &Arg)> {
    let name = |argument: &Arg| argument.get_long().unwrap_or(argument.get_id().as_str()).to_owned();
    command
        .get_arguments()
        .filter(|argument| !NOT_IN_FILES.contains(&argument.get_id().as_str()))
        .map(move |argument| (name(argument), argument))
}

/// All commands by the names of their tables.
fn tables(known: &Command) -> Vec<(String, &Command)> {
    let mut tables = vec![(BOX.to_owned(), known)];
    for command in known.get_subcommands() {
        tables.push((command.get_name().to_owned(), command));
        tables.extend(command.get_subcommands().map(|inner| (format!("{}.{}", command.get_name(), inner.get_name()), inner)));
    }
    tables
}

fn table_name(path: &[&str]) -> String {
    if path.is_empty() { BOX.to_owned() } else { path.join(".") }
}

/// An argument of the file.
struct GivenOption<'a> {
    argument: &'a Arg,
    /// `None` of a switch, and of an option without the value that it may have.
    values: Option<Vec<String>>,
}

struct File<'a> {
    known: &'a Command,
    path: &'a Path,
    line_of: &'a dyn Fn(usize) -> usize,
    given: Vec<GivenOption<'a>>,
    origins: Origins,
}

impl<'a> File<'a> {
    fn refuse(&self, at: usize, key: &str, reason: impl std::fmt::Display) -> String {
        format!("{}: {}: {reason}", place(self.path, (self.line_of)(at)), echo(key))
    }

    /// Those of the command's own table, then those for all commands, unless the command line or the former has others.
    fn take(&mut self, root: &DeTable, selected: &Selected<'a>) -> Result<(), String> {
        let tables = tables(self.known);
        let own = table_name(&selected.path);
        // From within outwards: `map.info`, `map`, the file.
        let mut own_table = None;
        for (key, value) in root {
            let (name, at) = (key.get_ref().as_ref(), key.span().start);
            let Some(table) = value.get_ref().as_table() else { continue };
            if !tables.iter().any(|(known, _)| known == name) {
                let meant = similar(name, tables.iter().map(|(known, _)| known.as_str()));
                return Err(self.refuse(at, name, format!("no such command; {meant}a table is named as the command whose options it has")));
            }
            for (name, table) in tables_within(name, table) {
                let Some((_, command)) = tables.iter().find(|(known, _)| *known == name) else {
                    return Err(self.refuse(at, &name, "no such command; a table is named as the command whose options it has"));
                };
                self.check(table, &name, &[*command])?;
                if name == own {
                    own_table = Some(table);
                }
            }
        }
        self.check(root, "any command", &tables.iter().map(|(_, command)| *command).collect::<Vec<_>>())?;
        for table in own_table.into_iter().chain([root]) {
            self.take_table(table, selected)?;
        }
        Ok(())
    }

    /// Refuses keys that no command has.
    fn check(&self, table: &DeTable, of: &str, commands: &[&Command]) -> Result<(), String> {
        let names: Vec<String> = commands.iter().flat_map(|command| in_files(command)).map(|(name, _)| name).collect();
        for (key, value) in table {
            let name = key.get_ref().as_ref();
            if value.get_ref().is_table() || names.iter().any(|known| known == name) {
                continue;
            }
            if NOT_IN_FILES.contains(&name.replace('-', "_").as_str()) {
                return Err(self.refuse(key.span().start, name, "stands in no file; type it on the command line"));
            }
            let meant = similar(name, names.iter().map(String::as_str));
            let help = if of.contains(' ') || of == BOX {
                "photonmill --help".to_owned()
            } else {
                format!("photonmill {} --help", of.replace('.', " "))
            };
            return Err(self.refuse(key.span().start, name, format!("no option of {of}; {meant}see {help}")));
        }
        Ok(())
    }

    fn take_table(&mut self, table: &DeTable, selected: &Selected<'a>) -> Result<(), String> {
        let mut found = Vec::new();
        for (name, argument) in in_files(selected.command) {
            let Some((key, value)) = table.iter().find(|(key, _)| key.get_ref().as_ref() == name) else { continue };
            let typed = selected.typed().chain(self.given.iter().map(|given| given.argument));
            if value.get_ref().is_table() || typed.into_iter().any(|other| excludes(selected.command, argument, other)) {
                continue;
            }
            let values = values(argument, value).map_err(|allowed| self.refuse(key.span().start, &name, allowed))?;
            if let Some(values) = values {
                found.push(GivenOption { argument, values });
                let shown = if argument.is_positional() { format!("<{}>", name.to_uppercase()) } else { format!("--{name}") };
                self.origins.lines.insert(shown, (self.line_of)(key.span().start));
            }
        }
        self.given.extend(found);
        Ok(())
    }

    /// Options follow the command's name. One without the value that it may have must not take the next word for it, so that it
    /// stands at the end, as do arguments without names, behind `--`.
    fn insert(&self, arguments: Vec<OsString>, selected: &Selected) -> Vec<OsString> {
        let (mut first, mut last, mut unnamed) = (Vec::new(), Vec::new(), Vec::new());
        for GivenOption { argument, values } in &self.given {
            match (argument.get_long(), values) {
                (Some(long), Some(values)) => first.extend(values.iter().map(|value| OsString::from(format!("--{long}={value}")))),
                (Some(long), None) => last.push(format!("--{long}").into()),
                (None, values) => unnamed.extend(values.iter().flatten().map(OsString::from)),
            }
        }
        let mut start = 1;
        for name in &selected.path {
            start += arguments[start..].iter().position(|word| word == name).map_or(0, |at| at + 1);
        }
        let end = arguments[start..].iter().position(|word| word == "--").map_or(arguments.len(), |at| start + at);
        let mut words = arguments[..start].to_vec();
        words.extend(first);
        words.extend_from_slice(&arguments[start..end]);
        words.extend(last);
        words.extend_from_slice(&arguments[end..]);
        if end == arguments.len() && !unnamed.is_empty() {
            words.push("--".into());
        }
        words.extend(unnamed);
        words
    }
}

/// A table and those in it, by their names.
fn tables_within<'a, 'i>(name: &str, table: &'a DeTable<'i>) -> Vec<(String, &'a DeTable<'i>)> {
    let mut all = vec![(name.to_owned(), table)];
    for (key, value) in table {
        let inner = value.get_ref().as_table().map(|inner| tables_within(&format!("{name}.{}", key.get_ref()), inner));
        all.extend(inner.into_iter().flatten());
    }
    all
}

/// Whether an argument and one that is given already are the same, or cannot both be given.
fn excludes(command: &Command, argument: &Arg, given: &Arg) -> bool {
    let conflicts = |one: &Arg, other: &Arg| command.get_arg_conflicts_with(one).iter().any(|conflict| conflict.get_id() == other.get_id());
    argument.get_id() == given.get_id() || conflicts(argument, given) || conflicts(given, argument)
}

fn similar<'a>(name: &str, known: impl Iterator<Item = &'a str>) -> String {
    let likeness = |known: &str| strsim::jaro(known, name);
    let best = known.max_by(|a, b| likeness(a).total_cmp(&likeness(b))).filter(|best| likeness(best) > ALIKE);
    best.map_or_else(String::new, |best| format!("did you mean {best}? "))
}

/// Values of a key: none of a switch that is on; nothing at all of one that is off.
fn values(argument: &Arg, value: &Spanned<DeValue>) -> Result<Option<Option<Vec<String>>>, String> {
    let takes_values = argument.get_action().takes_values();
    let may_lack_one = argument.get_num_args().is_some_and(|count| count.min_values() == 0);
    match value.get_ref() {
        DeValue::Boolean(is_on) if !takes_values || may_lack_one => Ok(is_on.then_some(None)),
        _ if !takes_values => Err("must be true or false".to_owned()),
        DeValue::Array(list) => {
            let parts = list.iter().map(|part| scalar(part.get_ref())).collect::<Result<Vec<String>, String>>()?;
            let is_several = matches!(argument.get_action(), ArgAction::Append) && argument.get_value_delimiter().is_none();
            let values = if is_several { parts } else { vec![parts.join(",")] };
            Ok((!list.is_empty()).then_some(Some(values)))
        }
        single => scalar(single).map(|value| Some(Some(vec![value]))),
    }
}

fn scalar(value: &DeValue) -> Result<String, String> {
    match value {
        DeValue::String(text) => Ok(text.clone().into_owned()),
        // Without the underscores that TOML allows.
        DeValue::Integer(number) => i128::from_str_radix(number.as_str(), number.radix())
            .map(|number| number.to_string())
            .map_err(|_| format!("{} is too large a number", echo(number.as_str()))),
        DeValue::Float(number) => Ok(number.as_str().to_owned()),
        _ => Err("must be a text in quotes, a number, or a list of these".to_owned()),
    }
}

/// The options of a command line as a file, which --config takes back.
pub(super) fn printed(known: &Command, matches: &ArgMatches) -> Result<String, String> {
    let selected = Selected::of(matches, known);
    let mut lines = Vec::new();
    for (name, argument) in in_files(selected.command) {
        let line = |value: String| format!("{name} = {value}");
        if was_typed(selected.matches, argument) {
            lines.push(line(written(argument, selected.matches).map_err(|reason| format!("--print-config: {name} {reason}"))?));
        } else if let Some(default) =
            default(argument).filter(|_| !selected.typed().any(|given| excludes(selected.command, argument, given)))
        {
            lines.push(format!("# {}", line(in_toml(&default))));
        }
    }
    let program = ["photonmill"].into_iter().chain(selected.path.iter().copied()).collect::<Vec<_>>().join(" ");
    let head = format!("# Options of `{program} --config FILE`. A comment is a default.\n[{}]", table_name(&selected.path));
    Ok([vec![head], lines].concat().join("\n"))
}

/// What a command line lacks does not keep it from being printed.
pub(super) fn incomplete(known: &Command, arguments: &[OsString]) -> Option<ArgMatches> {
    lenient(arguments).filter(|matches| Selected::of(matches, known).matches.get_one::<bool>("print_config") == Some(&true))
}

fn written(argument: &Arg, matches: &ArgMatches) -> Result<String, String> {
    if !argument.get_action().takes_values() {
        return Ok("true".to_owned());
    }
    let raw = matches.get_raw(argument.get_id().as_str()).into_iter().flatten();
    let values =
        raw.map(|value| value.to_str().map(in_toml).ok_or_else(|| format!("{}: is no Unicode, which TOML needs", value.display())));
    let values: Vec<String> = values.collect::<Result<_, _>>()?;
    Ok(match &values[..] {
        [value] if !matches!(argument.get_action(), ArgAction::Append) => value.clone(),
        values => format!("[{}]", values.join(", ")),
    })
}

/// Numbers as numbers where that says the same.
fn in_toml(value: &str) -> String {
    let is_same = |number: String| number == value;
    let is_number = value.parse::<i64>().is_ok_and(|number| is_same(number.to_string()))
        || (value.contains('.') && value.parse::<f64>().is_ok_and(|number| number.is_finite() && is_same(number.to_string())));
    if is_number { value.to_owned() } else { toml::Value::String(value.to_owned()).to_string() }
}

/// A default that is a plain value: clap's, or the one that the help names.
fn default(argument: &Arg) -> Option<String> {
    if !argument.get_action().takes_values() {
        return None;
    }
    let own = argument.get_default_values().first().map(|value| value.to_string_lossy().into_owned());
    own.or_else(|| {
        let help = argument.get_help()?.to_string();
        let (_, default) = help.rsplit_once("[default: ")?;
        let value = default.strip_suffix(']')?;
        // Words that stand for no value, or for one that depends on the run.
        let is_value = value.starts_with(|letter: char| letter.is_ascii_digit()) || names_choice(argument, value);
        (is_value && !value.contains([' ', ';'])).then(|| value.to_owned())
    })
}

fn names_choice(argument: &Arg, value: &str) -> bool {
    argument.get_possible_values().iter().any(|choice| choice.get_name() == value)
}

/// Refuses an option that names the file of --config too, as an output would write over it.
pub(super) fn check_not_named_again(known: &Command, matches: &ArgMatches) -> Result<(), String> {
    let selected = Selected::of(matches, known);
    let config = selected.matches.get_one::<PathBuf>("config").and_then(|path| path.canonicalize().ok());
    let Some(config) = config else { return Ok(()) };
    for (name, argument) in in_files(selected.command).filter(|(_, argument)| argument.get_action().takes_values()) {
        let mut values = selected.matches.get_raw(argument.get_id().as_str()).into_iter().flatten();
        if let Some(value) = values.find(|value| Path::new(value).canonicalize().is_ok_and(|path| path == config)) {
            return Err(format!("--{name} {}: is the file of --config; name another file", echo(value.display())));
        }
    }
    Ok(())
}
