//! Keyword arguments as a request: each is called as the program's option of the same meaning, with _ for - in it.

use photonmill::render::Request;
use photonmill::settings::scene::{Effect, Filter, Illumination, Kernel, Part};
use photonmill::settings::stop::Measure;
use photonmill::settings::{Builder, Math};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict};

use crate::error;

/// Every name that [`request`] knows.
const NAMES: [&str; 31] = [
    "error",
    "measure",
    "confidence",
    "time",
    "total_photons",
    "rounds",
    "block",
    "photons",
    "caustic_photons",
    "bounces",
    "seed",
    "neighbours",
    "caustic_neighbours",
    "radius",
    "caustic_radius",
    "alpha",
    "kernel",
    "edge_correction",
    "samples",
    "shadow_rays",
    "final_gather",
    "aim",
    "illumination",
    "part",
    "filter",
    "variant",
    "math",
    "paranoid",
    "chunk",
    "with_",
    "without",
];

/// What is asked for; `of_picture`: samples, part and filter mean something.
pub fn request(py: Python<'_>, settings: Option<&Bound<'_, PyDict>>, of_picture: bool) -> PyResult<Request> {
    let mut request = Request::default();
    for (key, value) in settings.into_iter().flatten() {
        let name: String = key.extract()?;
        let value = Value { py, name: &name, value: &value };
        if !of_picture && ["samples", "part", "filter"].contains(&name.as_str()) {
            return Err(PyTypeError::new_err(format!("'{name}' is of pictures only; leave it out")));
        }
        // As if it were not given.
        if value.value.is_none() && NAMES.contains(&name.as_str()) {
            continue;
        }
        match name.as_str() {
            "error" => request.stop.error = Some(value.number()?),
            "measure" => request.stop.measure = value.choice(&[("rmse", Measure::Rmse), ("relmse", Measure::RelMse)])?,
            "confidence" => request.stop.confidence = value.number()?,
            "time" => request.stop.seconds = Some(value.number()?),
            "total_photons" => request.stop.photons = Some(value.integer()?),
            "rounds" => request.rounds = Some(value.integer()?),
            "block" => request.block = Some(value.integer()?),
            "photons" => request.photons = Some(value.integer()?),
            "caustic_photons" => request.caustic_photons = Some(value.integer()?),
            "bounces" => request.bounces = Some(value.integer()?),
            "seed" => request.seed = Some(value.integer()?),
            "neighbours" => request.neighbours = Some(value.integer()?),
            "caustic_neighbours" => request.caustic_neighbours = Some(value.integer()?),
            "radius" => request.radius = Some(value.number()?),
            "caustic_radius" => request.caustic_radius = Some(value.number()?),
            "alpha" => request.alpha = Some(value.number()?),
            "kernel" => {
                request.kernel =
                    Some(value.choice(&[("box", Kernel::Box), ("cone", Kernel::Cone), ("epanechnikov", Kernel::Epanechnikov)])?);
            }
            "edge_correction" => request.edge_correction = Some(value.switch()?),
            "samples" => request.samples = Some(value.integer()?),
            "shadow_rays" => request.shadow_rays = Some(value.integer()?),
            "final_gather" => request.final_gather = value.switch()?,
            "aim" => request.aim = Some(value.switch()?),
            "illumination" => {
                request.illumination = Some(value.choice(&[("split", Illumination::Split), ("photons", Illumination::Photons)])?);
            }
            "part" => {
                let parts = [Part::All, Part::Direct, Part::Specular, Part::Caustic, Part::Indirect];
                let names = ["all", "direct", "specular", "caustic", "indirect"];
                request.part = Some(value.choice(&names.into_iter().zip(parts).collect::<Vec<_>>())?);
            }
            "filter" => {
                request.filter = Some(value.choice(&[("box", Filter::Box), ("tent", Filter::Tent), ("gaussian", Filter::Gaussian)])?);
            }
            "variant" => {
                let builders = Builder::ON_GPU.into_iter().map(|builder| (builder.name(), Some(builder)));
                request.builder = value.choice(&[("auto", None)].into_iter().chain(builders).collect::<Vec<_>>())?;
            }
            "math" => request.math = Some(value.choice(&[("fast", Math::Fast), ("strict", Math::Strict)])?),
            "paranoid" => request.paranoid = value.switch()?,
            "chunk" => request.chunk = Some(value.integer()?),
            "with_" => request.with = value.effects()?,
            "without" => request.without = value.effects()?,
            _ => return Err(unknown(&name)),
        }
    }
    Ok(request)
}

/// As Python refuses what a function does not take.
fn unknown(name: &str) -> PyErr {
    let likeness = |known: &&str| strsim::jaro(known, name);
    let meant = NAMES.into_iter().max_by(|a, b| likeness(a).total_cmp(&likeness(b))).filter(|best| likeness(best) > 0.8);
    let meant = meant.map_or_else(|| format!("; the settings are {}", NAMES.join(", ")), |meant| format!(". Did you mean '{meant}'?"));
    PyTypeError::new_err(format!("got an unexpected keyword argument '{name}'{meant}"))
}

/// An argument and what it is called.
struct Value<'a, 'py> {
    py: Python<'py>,
    name: &'a str,
    value: &'a Bound<'py, PyAny>,
}

impl Value<'_, '_> {
    fn wrong_type(&self, wanted: &str) -> PyErr {
        let found = self.value.get_type().name().map_or_else(|_| "another type".to_owned(), |name| name.to_string());
        PyTypeError::new_err(format!("{} must be {wanted}, not {found}", self.name))
    }

    fn refused(&self, allowed: &str) -> PyErr {
        let shown = self.value.repr().map_or_else(|_| String::new(), |shown| shown.to_string());
        error::argument(self.py, format!("{} {shown}: {allowed}", self.name))
    }

    fn number(&self) -> PyResult<f64> {
        let number = if self.value.is_instance_of::<PyBool>() { None } else { self.value.extract().ok() };
        number.ok_or_else(|| self.wrong_type("a number"))
    }

    /// What is out of range of its type is refused here, and what the setting does not allow by its validation.
    fn integer<T: TryFrom<i128> + Bounded>(&self) -> PyResult<T> {
        let number = if self.value.is_instance_of::<PyBool>() { None } else { self.value.call_method0("__index__").ok() };
        let number = number.ok_or_else(|| self.wrong_type("an int"))?;
        let fits = number.extract::<i128>().ok().and_then(|number| T::try_from(number).ok());
        fits.ok_or_else(|| self.refused(&format!("must be from 0 to {}", T::LARGEST)))
    }

    fn switch(&self) -> PyResult<bool> {
        self.value.extract().map_err(|_| self.wrong_type("a bool"))
    }

    fn choice<T: Copy>(&self, all: &[(&str, T)]) -> PyResult<T> {
        let name: String = self.value.extract().map_err(|_| self.wrong_type("a str"))?;
        let names: Vec<&str> = all.iter().map(|(name, _)| *name).collect();
        let found = all.iter().find(|(known, _)| *known == name).map(|(_, value)| *value);
        found.ok_or_else(|| self.refused(&format!("must be one of {}", names.join(", "))))
    }

    fn effects(&self) -> PyResult<Vec<Effect>> {
        let one = self.value.extract::<String>().ok().map(|name| vec![name]);
        let names: Vec<String> =
            one.map_or_else(|| self.value.extract(), Ok).map_err(|_| self.wrong_type("the name of an effect or a sequence of names"))?;
        let known = Effect::ALL.map(Effect::name).join(", ");
        let effect = |name: &String| Effect::ALL.into_iter().find(|effect| effect.name() == name);
        names.iter().map(|name| effect(name).ok_or_else(|| self.refused(&format!("must be among {known}")))).collect()
    }
}

trait Bounded {
    const LARGEST: u64;
}

impl Bounded for u32 {
    const LARGEST: u64 = u32::MAX as u64;
}

impl Bounded for u64 {
    const LARGEST: u64 = u64::MAX;
}
