//! Keyword arguments as a request: each is an option of the program, with `_` for `-` in its name.

use std::path::PathBuf;

use photonmill::render::options::{Command, ROWS, Row};
use photonmill::render::scene::READ_WITH;
use photonmill::render::values::Form;
use photonmill::render::{Percent, RenderRequest};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict};

use crate::error::{self, keyword};

/// Rows of other arguments: the camera and the size of its picture, and what a picture's file is written with.
const ELSEWHERE: [&str; 6] = ["camera", "size", "exposure", "tone", "white_balance", "layers"];

/// The keyword arguments of a command's call.
fn rows(command: Command) -> impl Iterator<Item = &'static Row> {
    ROWS.iter().filter(move |row| row.is_of(command as u32) && !ELSEWHERE.contains(&row.field) && !READ_WITH.contains(&row.field))
}

/// What is asked for.
pub fn request(py: Python<'_>, settings: Option<&Bound<'_, PyDict>>, command: Command) -> PyResult<RenderRequest> {
    let mut request = RenderRequest::default();
    for (key, value) in settings.into_iter().flatten() {
        let name: String = key.extract()?;
        let Some(row) = rows(command).find(|row| keyword(row.field) == name) else {
            let is_of_pictures = rows(Command::Render).any(|row| keyword(row.field) == name);
            return Err(match is_of_pictures {
                true => PyTypeError::new_err(format!("'{name}' is of pictures only; leave it out")),
                false => unknown(&name, rows(command).map(|row| keyword(row.field)).collect()),
            });
        };
        // None is as if it were not given.
        if !value.is_none() {
            Argument { py, name: &name, value: &value }.set(row, &mut request)?;
        }
    }
    Ok(request)
}

/// An image's request with the keyword arguments that its file is written with, some of the rows.
pub fn style(py: Python<'_>, request: &RenderRequest, style: Option<&Bound<'_, PyDict>>, fields: &[&str]) -> PyResult<RenderRequest> {
    let mut request = request.clone();
    for (key, value) in style.into_iter().flatten() {
        let name: String = key.extract()?;
        let row = ROWS.iter().find(|row| row.field == name && fields.contains(&row.field));
        let row = row.ok_or_else(|| unknown(&name, fields.to_vec()))?;
        if !value.is_none() {
            Argument { py, name: &name, value: &value }.set(row, &mut request)?;
        }
    }
    Ok(request)
}

/// As Python refuses what a function does not take.
fn unknown(name: &str, names: Vec<&str>) -> PyErr {
    let likeness = |known: &&str| strsim::jaro(known, name);
    let meant = names.iter().max_by(|a, b| likeness(a).total_cmp(&likeness(b))).filter(|best| likeness(best) > 0.8);
    let meant = meant.map_or_else(|| format!("; the settings are {}", names.join(", ")), |meant| format!(". Did you mean '{meant}'?"));
    PyTypeError::new_err(format!("got an unexpected keyword argument '{name}'{meant}"))
}

/// An argument and what it is called.
struct Argument<'a, 'py> {
    py: Python<'py>,
    name: &'a str,
    value: &'a Bound<'py, PyAny>,
}

impl Argument<'_, '_> {
    fn wrong_type(&self, wanted: &str) -> PyErr {
        let found = self.value.get_type().name().map_or_else(|_| "another type".to_owned(), |name| name.to_string());
        PyTypeError::new_err(format!("{} must be {wanted}, not {found}", self.name))
    }

    fn refused(&self, allowed: &str) -> PyErr {
        let shown = self.value.repr().map_or_else(|_| String::new(), |shown| shown.to_string());
        error::argument(self.py, format!("{}={shown}: {allowed}", self.name))
    }

    fn set(&self, row: &Row, request: &mut RenderRequest) -> PyResult<()> {
        let text = self.text(row)?;
        if text.is_empty() && matches!(row.form(), Form::Names(_)) {
            return Ok(());
        }
        let field = (row.of)(request);
        field.read_os(text.as_ref()).map_err(|allowed| self.refused(&allowed))?;
        // What does not fit was not taken.
        let is_cut = row.form() == Form::Integer && field.text().as_ref() != Some(&text);
        if is_cut { Err(self.refused("must be 0 or more, and at most 4294967295")) } else { Ok(()) }
    }

    /// The value as the command line has it.
    fn text(&self, row: &Row) -> PyResult<String> {
        let text = || self.value.extract::<String>();
        match row.form() {
            Form::Flag | Form::Switch => {
                let is_on: bool = self.value.extract().map_err(|_| self.wrong_type("a bool"))?;
                if !is_on && row.form() == Form::Flag { Ok("off".to_owned()) } else { Ok(if is_on { "on" } else { "off" }.to_owned()) }
            }
            Form::Integer => {
                let number = if self.value.is_instance_of::<PyBool>() { None } else { self.value.call_method0("__index__").ok() };
                number.ok_or_else(|| self.wrong_type("an int")).map(|number| number.to_string())
            }
            Form::Number => self.number().map(|number| number.to_string()).ok_or_else(|| self.wrong_type("a number")),
            Form::Percent => match self.number() {
                Some(share) => self.share(share),
                None => text().map_err(|_| self.wrong_type("a number, or a str such as '2%'")),
            },
            Form::Time => match self.number() {
                Some(seconds) => Ok(format!("{seconds}s")),
                None => text().map_err(|_| self.wrong_type("a number of seconds, or a str such as '2m'")),
            },
            Form::Numbers(count) => {
                let numbers: Vec<f64> = self.value.extract().map_err(|_| self.wrong_type(&format!("{count} numbers")))?;
                Ok(numbers.iter().map(f64::to_string).collect::<Vec<_>>().join(","))
            }
            Form::File => {
                let path: PathBuf = self.value.extract().map_err(|_| self.wrong_type("a str or a path"))?;
                path.into_os_string().into_string().map_err(|_| self.refused("must be in UTF-8"))
            }
            Form::Names(_) => {
                let names = text().map(|name| vec![name]).or_else(|_| self.value.extract::<Vec<String>>());
                names.map(|names| names.join(",")).map_err(|_| self.wrong_type("the name of an effect or a sequence of names"))
            }
            Form::Other if row.field == "layers" => {
                let names: Vec<String> = self.value.extract().map_err(|_| self.wrong_type("a sequence of names"))?;
                Ok(if names.is_empty() { "none".to_owned() } else { names.join(",") })
            }
            Form::Text | Form::Other | Form::Choice(_) => text().map_err(|_| self.wrong_type("a str")),
        }
    }

    fn number(&self) -> Option<f64> {
        if self.value.is_instance_of::<PyBool>() { None } else { self.value.extract().ok() }
    }

    /// A share of 1. An error of more than a half is more likely one in per cent, as is a confidence of more than 1.
    fn share(&self, share: f64) -> PyResult<String> {
        let most = if self.name == "confidence" { 1.0 } else { 0.5 };
        if share > most {
            let (meant, as_given) = (Percent::new(share), Percent::of_share(share));
            return Err(self.refused(&format!("did you mean {} or {as_given}? Write {} or '{as_given}'", meant, share / 100.0)));
        }
        Ok(Percent::of_share(share).to_string())
    }
}
