//! What the program prints: complaints on stderr, reports on stdout; and how a command ends.

use std::io::{ErrorKind, Write};
use std::path::PathBuf;

use super::progress::print_line;
use crate::engine::run::RunResult;
use crate::error::{Error, Result};
use crate::output::destination::Destination;
use crate::render::names::{as_option, spelled};

/// How a command ended that did not fail.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum End {
    Finished,
    /// By Ctrl-C, with what was finished saved.
    Cancelled,
}

impl End {
    pub(super) fn of<Plan, Film>(run: &RunResult<Plan, Film>) -> End {
        if run.is_cancelled() { End::Cancelled } else { End::Finished }
    }
}

/// A text of the library with its fields as options.
pub(super) fn spell(text: &str) -> String {
    spelled(text, as_option)
}

/// One line on stderr. Where nobody can read it there still is the exit code.
pub(super) fn complain(line: &str) {
    // Names of files and of things in them may hold anything; a complaint stays one line.
    let line: String = spell(line).chars().map(|letter| if letter.is_control() { ' ' } else { letter }).collect();
    print_line(&format!("photonmill: {line}"));
}

/// Text on stdout; a reader that has gone away, as `head` does, has seen enough.
pub(super) fn say(text: &str) -> Result<()> {
    match writeln!(std::io::stdout(), "{}", spell(text)) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => {
            Err(Error::Output { option: "standard output", path: PathBuf::from("(stdout)"), reason: error.kind().to_string() })
        }
        _ => Ok(()),
    }
}

/// A report for people: on stdout, unless one of the files goes there.
pub(super) fn say_beside<'a>(files: impl IntoIterator<Item = &'a Destination>, text: &str) -> Result<()> {
    if files.into_iter().any(Destination::is_standard_output) {
        print_line(&spell(text));
        return Ok(());
    }
    say(text)
}

/// What came of a run, and what was written of it, or why it could not be.
pub(super) fn say_written(files: &[Destination], text: &str, written: Result<String>) -> Result<()> {
    match written {
        Ok(wrote) => say_beside(files, &format!("{text}{wrote}")),
        Err(error) => say_beside(files, text).and(Err(error)),
    }
}

/// A destination that may be left out.
pub(super) fn optional_file(option: &'static str, path: Option<&PathBuf>) -> Result<Option<Destination>> {
    path.map(|path| Destination::open(option, path)).transpose()
}
