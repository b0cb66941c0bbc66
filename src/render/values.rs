//! Values of options: how each type is read from text, written as text, and described. Ranges that depend on nothing else are judged
//! here; all others by the settings that follow.

use std::ffi::OsStr;
use std::fmt::Display;
use std::num::IntErrorKind;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use glam::DVec3;

use crate::engine::run::blocks;
use crate::output::colour::Tone;
use crate::output::show::Layer;
use crate::output::white_balance::Kelvin;
use crate::rng::Rng;
use crate::scene::image_size::{ImageSize, parse_size};
use crate::scene::surroundings::Environment;
use crate::settings::scene::{Effect, Filter, Illumination, Kernel, Part};
use crate::settings::stop::Measure;
use crate::settings::{Builder, EmissionLaw, Gather, Math, PhongDirection, Preset, Sums, WALL_NAMES};

type Parsed<T> = Result<T, String>;

/// What kind of value an option takes, for whoever reads it from something other than text.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Form {
    /// Given or not; takes no value.
    Flag,
    /// `on` or `off`.
    Switch,
    Integer,
    Number,
    /// Per cent; a number stands for a share of 1.
    Percent,
    /// A number stands for seconds.
    Time,
    Text,
    /// Text in a form of its own.
    Other,
    /// The path of a file.
    File,
    /// So many numbers.
    Numbers(usize),
    /// One of these names; each with what it means, where the name alone does not say it.
    Choice(&'static [(&'static str, &'static str)]),
    /// Some of these names.
    Names(&'static [&'static str]),
}

/// A field of a request.
pub trait Value {
    fn form(&self) -> Form;

    /// Takes a value as it is written on the command line; fails with what is allowed.
    fn read(&mut self, text: &str) -> Parsed<()>;

    /// The same of a name of the system's, which need not be Unicode.
    fn read_os(&mut self, text: &OsStr) -> Parsed<()> {
        self.read(text.to_str().ok_or("must be Unicode")?)
    }

    /// The value as [`Value::read`] takes it; `None` where none is given.
    fn text(&self) -> Option<String>;
}

/// A share of a whole, such as an error or a confidence: `2%`.
///
/// ```
/// use photonmill::render::Percent;
///
/// assert_eq!("2%".parse(), Ok(Percent::new(2.0)));
/// assert_eq!("0.02".parse::<Percent>().unwrap_err(), "did you mean 2% or 0.02%? Write it with %");
/// ```
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd)]
pub struct Percent(f64);

impl Percent {
    /// So many per cent.
    pub fn new(percent: f64) -> Percent {
        Percent(percent / 100.0)
    }

    /// A share of 1.
    pub fn of_share(share: f64) -> Percent {
        Percent(share)
    }

    /// As a share of 1.
    pub fn share(self) -> f64 {
        self.0
    }
}

impl Display for Percent {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        // Rounded to twelve digits, as 0.05 / 100 * 100 is not quite 0.05.
        write!(formatter, "{}%", (self.0 * 1e14).round() / 1e12)
    }
}

impl FromStr for Percent {
    type Err = String;

    /// `1%`, or `1` for the same. A number below 1 without the sign may mean a share of 1, too, and is refused.
    fn from_str(text: &str) -> Parsed<Percent> {
        let (number, has_sign) = text.strip_suffix('%').map_or((text, false), |number| (number, true));
        let percent: f64 = number.trim().parse().map_err(|_| "must be a number of per cent, such as 1%".to_owned())?;
        if !has_sign && percent > 0.0 && percent < 1.0 {
            return Err(format!("did you mean {} or {}? Write it with %", Percent(percent), Percent::new(percent)));
        }
        Ok(Percent::new(percent))
    }
}

/// A time in seconds: `2s`, `500ms`, `3m`, `1h`.
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd)]
pub struct Seconds(pub f64);

impl Display for Seconds {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(formatter, "{}s", self.0)
    }
}

impl FromStr for Seconds {
    type Err = String;

    fn from_str(text: &str) -> Parsed<Seconds> {
        let units = [("ms", 1e-3), ("s", 1.0), ("m", 60.0), ("h", 3600.0)];
        let (number, unit) = units.iter().find_map(|(name, unit)| Some((text.strip_suffix(name)?, *unit))).unwrap_or((text, 1.0));
        number.trim().parse().map(|count: f64| Seconds(count * unit)).map_err(|_| "must be a time, such as 2s, 500ms or 3m".to_owned())
    }
}

/// Exposure, each stop of which doubles the brightness.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stops(pub f32);

/// Where the sun stands: degrees clockwise from -z as seen from above, and above the horizon.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SunPosition {
    pub azimuth: f64,
    pub elevation: f64,
}

/// Phong exponents of the box's walls.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shininess(pub [f32; 5]);

/// Power of the two lights of the box.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Watts(pub [f64; 2]);

/// Threads of the CPU.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Threads(pub usize);

/// Layers of an EXR.
#[derive(Debug, Clone, PartialEq)]
pub struct Layers(pub Vec<Layer>);

/// A value that is one word of a command line.
trait Word: Sized {
    const FORM: Form;
    fn parse(text: &str) -> Parsed<Self>;
    fn word(&self) -> String;
}

impl<T: Word> Value for Option<T> {
    fn form(&self) -> Form {
        T::FORM
    }

    fn read(&mut self, text: &str) -> Parsed<()> {
        *self = Some(T::parse(text)?);
        Ok(())
    }

    fn text(&self) -> Option<String> {
        self.as_ref().map(T::word)
    }
}

impl Value for bool {
    fn form(&self) -> Form {
        Form::Flag
    }

    fn read(&mut self, text: &str) -> Parsed<()> {
        *self = <bool as Word>::parse(text)?;
        Ok(())
    }

    fn text(&self) -> Option<String> {
        self.then(|| self.word())
    }
}

impl Value for Option<PathBuf> {
    fn form(&self) -> Form {
        Form::File
    }

    fn read(&mut self, text: &str) -> Parsed<()> {
        self.read_os(text.as_ref())
    }

    fn read_os(&mut self, text: &OsStr) -> Parsed<()> {
        *self = Some(PathBuf::from(text));
        Ok(())
    }

    fn text(&self) -> Option<String> {
        self.as_ref().map(|path| path.to_string_lossy().into_owned())
    }
}

/// Read again and again, and several at once: with commas between them.
impl Value for Vec<Effect> {
    fn form(&self) -> Form {
        const NAMES: [&str; Effect::ALL.len()] = {
            let mut names = [""; Effect::ALL.len()];
            let mut place = 0;
            while place < names.len() {
                names[place] = Effect::ALL[place].name();
                place += 1;
            }
            names
        };
        Form::Names(&NAMES)
    }

    fn read(&mut self, text: &str) -> Parsed<()> {
        let effect = |name: &str| Effect::ALL.into_iter().find(|effect| effect.name() == name);
        let known = || format!("must be among {}", Effect::ALL.map(Effect::name).join(", "));
        let effects = text.split(',').map(|name| effect(name.trim()).ok_or_else(known)).collect::<Parsed<Vec<Effect>>>()?;
        self.extend(effects);
        Ok(())
    }

    fn text(&self) -> Option<String> {
        let names: Vec<&str> = self.iter().map(|effect| effect.name()).collect();
        (!names.is_empty()).then(|| names.join(","))
    }
}

impl Word for bool {
    const FORM: Form = Form::Switch;

    fn parse(text: &str) -> Parsed<bool> {
        match text {
            "on" => Ok(true),
            "off" => Ok(false),
            _ => Err("must be one of on, off".to_owned()),
        }
    }

    fn word(&self) -> String {
        (if *self { "on" } else { "off" }).to_owned()
    }
}

/// A whole number that `T` does not hold becomes 0, which no setting allows: validation, which knows the range, then refuses it.
pub(crate) fn parse_integer<T: TryFrom<i128> + Default>(text: &str) -> Parsed<T> {
    match text.parse::<i128>() {
        Ok(number) => Ok(T::try_from(number).unwrap_or_default()),
        Err(error) if matches!(error.kind(), IntErrorKind::PosOverflow | IntErrorKind::NegOverflow) => Ok(T::default()),
        Err(_) => Err("must be a whole number".to_owned()),
    }
}

impl Word for u32 {
    const FORM: Form = Form::Integer;

    fn parse(text: &str) -> Parsed<u32> {
        parse_integer(text)
    }

    fn word(&self) -> String {
        self.to_string()
    }
}

/// Every number of 64 bits is allowed, so that none stands for those that are not.
impl Word for u64 {
    const FORM: Form = Form::Integer;

    fn parse(text: &str) -> Parsed<u64> {
        text.parse().map_err(|_| format!("must be a whole number from 0 to {}", u64::MAX))
    }

    fn word(&self) -> String {
        self.to_string()
    }
}

pub(crate) fn parse_number<T: FromStr>(text: &str) -> Parsed<T> {
    text.parse().map_err(|_| "must be a number".to_owned())
}

/// `1,2,3`.
pub(crate) fn parse_numbers<T: FromStr + Copy, const N: usize>(text: &str) -> Parsed<[T; N]> {
    let wanted = format!("must be {N} numbers separated by commas");
    let parts: Option<Vec<T>> = text.split(',').map(|part| part.trim().parse().ok()).collect();
    parts.and_then(|parts| parts.try_into().ok()).ok_or(wanted)
}

/// One number for all three channels, or three.
pub(crate) fn parse_colour(text: &str) -> Parsed<[f32; 3]> {
    let all = match parse_numbers::<f32, 1>(text) {
        Ok([grey]) => [grey; 3],
        Err(_) => parse_numbers::<f32, 3>(text).map_err(|_| "must be one number, or three separated by commas".to_owned())?,
    };
    if all.iter().all(|value| value.is_finite() && *value >= 0.0) { Ok(all) } else { Err("must be 0 or more and finite".to_owned()) }
}

fn commas<T: Display>(numbers: &[T]) -> String {
    numbers.iter().map(T::to_string).collect::<Vec<_>>().join(",")
}

/// Types whose words are those of [`FromStr`] and [`Display`], or of two functions.
macro_rules! words {
    ($($type:ty as $form:expr, $parse:expr, $word:expr;)*) => {
        $(impl Word for $type {
            const FORM: Form = $form;

            fn parse(text: &str) -> Parsed<$type> {
                let parse: fn(&str) -> Parsed<$type> = $parse;
                parse(text)
            }

            fn word(&self) -> String {
                let word: fn(&$type) -> String = $word;
                word(self)
            }
        })*
    };
}

words! {
    f32 as Form::Number, parse_number, f32::to_string;
    f64 as Form::Number, parse_number, f64::to_string;
    String as Form::Text, |text| Ok(text.to_owned()), String::clone;
    Percent as Form::Percent, str::parse, Percent::to_string;
    Seconds as Form::Time, str::parse, Seconds::to_string;
    Kelvin as Form::Number, str::parse, Kelvin::to_string;
    Stops as Form::Number, parse_stops, |stops| stops.0.to_string();
    DVec3 as Form::Numbers(3), |text| parse_numbers(text).map(DVec3::from_array), |point| commas(&point.to_array());
    SunPosition as Form::Numbers(2), parse_sun, |sun| commas(&[sun.azimuth, sun.elevation]);
    Environment as Form::Other, parse_environment, environment_word;
    ImageSize as Form::Other, parse_size, size_word;
    blocks::Share as Form::Other, parse_shard, |shard| format!("{}/{}", shard.number + 1, shard.of);
    Layers as Form::Other, parse_layers, layers_word;
    Shininess as Form::Other, parse_shininess, |shininess| commas(&shininess.0);
    Watts as Form::Numbers(2), |text| parse_numbers(text).map(Watts), |watts| commas(&watts.0);
    Threads as Form::Other, parse_threads, |threads| threads.0.to_string();
}

fn parse_shininess(text: &str) -> Parsed<Shininess> {
    match parse_numbers::<f32, 1>(text) {
        Ok([all]) => Ok(Shininess([all; 5])),
        Err(_) => parse_numbers(text).map(Shininess).map_err(|_| format!("must be one number, or five for {}", WALL_NAMES.join(","))),
    }
}

pub(crate) fn parse_threads(text: &str) -> Parsed<Threads> {
    if text == "all" {
        return Ok(Threads(std::thread::available_parallelism().map_or(1, usize::from)));
    }
    parse_integer(text).map(Threads).map_err(|_| "must be a number of threads, or all".to_owned())
}

pub(crate) fn parse_stops(text: &str) -> Parsed<Stops> {
    let stops = parse_number(text)?;
    if (-64.0..=64.0).contains(&stops) { Ok(Stops(stops)) } else { Err("must be from -64 to 64 stops".to_owned()) }
}

fn parse_sun(text: &str) -> Parsed<SunPosition> {
    let position = parse_numbers::<f64, 2>(text).map(|[azimuth, elevation]| SunPosition { azimuth, elevation });
    let is_allowed = |sun: &SunPosition| sun.azimuth.is_finite() && sun.elevation > 0.0 && sun.elevation <= 90.0;
    let allowed = || "must be two numbers, AZIMUTH,ELEVATION in degrees; the elevation above 0 and at most 90".to_owned();
    position.ok().filter(is_allowed).ok_or_else(allowed)
}

fn parse_environment(text: &str) -> Parsed<Environment> {
    let path = Path::new(text);
    let is_picture =
        path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("hdr") || extension.eq_ignore_ascii_case("exr"));
    match is_picture {
        true => Ok(Environment::Image(path.to_owned())),
        false => parse_colour(text).map(Environment::Colour).map_err(|reason| format!("{reason}; or a file that ends in .hdr or .exr")),
    }
}

fn environment_word(environment: &Environment) -> String {
    match environment {
        Environment::Colour(colour) => commas(colour),
        Environment::Image(path) => path.to_string_lossy().into_owned(),
    }
}

fn size_word(size: &ImageSize) -> String {
    match size {
        ImageSize::Width(width) => width.to_string(),
        ImageSize::WidthAndHeight(width, height) => format!("{width}x{height}"),
    }
}

/// `3/8`, counted from 1.
fn parse_shard(text: &str) -> Parsed<blocks::Share> {
    let shard = text.split_once('/').and_then(|(number, of)| {
        let (number, of): (u32, u32) = (number.trim().parse().ok()?, of.trim().parse().ok()?);
        (1..=of).contains(&number).then(|| blocks::Share { number: number - 1, of })
    });
    shard.ok_or_else(|| "must be K/N, a shard and their number, such as 3/8: K is from 1 to N".to_owned())
}

fn parse_layers(text: &str) -> Parsed<Layers> {
    let names: Vec<&str> = match text {
        "all" => Layer::ALL.map(Layer::name).into(),
        "none" => Vec::new(),
        _ => text.split(',').map(str::trim).collect(),
    };
    let known = Layer::ALL.map(Layer::name);
    if names.iter().any(|name| !known.contains(name)) {
        return Err(format!("must be all, none, or some of {}, with commas between them", known.join(", ")));
    }
    Ok(Layers(Layer::ALL.into_iter().filter(|layer| names.contains(&layer.name())).collect()))
}

fn layers_word(Layers(layers): &Layers) -> String {
    if layers.is_empty() { "none".to_owned() } else { layers.iter().map(|layer| layer.name()).collect::<Vec<_>>().join(",") }
}

/// Names of an enum's values, and what each means.
macro_rules! choices {
    ($($type:ty { $($value:path = $name:literal, $meaning:literal;)* })*) => {
        $(impl Word for $type {
            const FORM: Form = Form::Choice(&[$(($name, $meaning)),*]);

            fn parse(text: &str) -> Parsed<$type> {
                match text {
                    $($name => Ok($value),)*
                    _ => Err(format!("must be one of {}", [$($name),*].join(", "))),
                }
            }

            fn word(&self) -> String {
                [$(($value, $name)),*].iter().find(|(value, _)| value == self).map_or_else(String::new, |(_, name)| (*name).to_owned())
            }
        })*
    };
}

choices! {
    Measure {
        Measure::Rmse = "rmse", "The root of the mean square of errors, over the mean";
        Measure::RelMse = "relmse", "Root mean square of the relative errors (epsilon: 1 % of the mean)";
    }
    Math {
        Math::Fast = "fast", "As fast as the device can";
        Math::Strict = "strict", "The same bits on every device that rounds to nearest";
    }
    Preset {
        Preset::Naive = "naive", "Figure 1: the naive implementation, 2 bounces";
        Preset::Modified = "modified", "Figure 2: the modified implementation, 15 bounces";
        Preset::Phong = "phong", "Figure 3: the same with Phong walls of exponent 2";
        Preset::Rounds = "rounds", "Figure 4: 100 rounds, radius 0.025 m, Phong exponent 5";
    }
    Rng {
        Rng::Rand48 = "rand48", "The paper's drand48, leap-frogged";
        Rng::Mt = "mt", "The paper's alternative, the Mersenne Twister";
        Rng::Philox = "philox", "Counter-based";
        Rng::Sobol = "sobol", "Owen-scrambled Sobol' points (quasi-Monte Carlo)";
    }
    Gather {
        Gather::Brute = "brute", "Test every photon, as in the paper";
        Gather::Grid = "grid", "A sorted uniform grid; the CPU builder splats photons onto texels instead";
        Gather::KdTree = "kdtree", "A kd-tree";
    }
    Sums {
        Sums::Integer = "integer", "64-bit fixed point: the same bits in any order of addition";
        Sums::F32 = "f32", "32-bit floats";
        Sums::Compensated = "compensated", "Pairs of 32-bit floats (compensated summation)";
    }
    EmissionLaw {
        EmissionLaw::Uniform = "uniform", "";
        EmissionLaw::Cosine = "cosine", "";
    }
    PhongDirection {
        PhongDirection::Mirror = "mirror", "";
        PhongDirection::Sampled = "sampled", "";
    }
    Illumination {
        Illumination::Split = "split", "Direct light by shadow rays, caustics from a map of their own, the rest from the global map";
        Illumination::Photons = "photons", "Everything from one photon map, as in the paper";
    }
    Kernel {
        Kernel::Box = "box", "";
        Kernel::Cone = "cone", "";
        Kernel::Epanechnikov = "epanechnikov", "";
    }
    Filter {
        Filter::Box = "box", "The square of the pixel";
        Filter::Tent = "tent", "A tent two pixels wide";
        Filter::Gaussian = "gaussian", "A Gaussian with a standard deviation of half a pixel";
    }
    Tone {
        Tone::Neutral = "neutral", "Highlights keep their shape: Khronos PBR Neutral";
        Tone::Linear = "linear", "What is brighter than white is white";
    }
    Part {
        Part::All = "all", "The whole picture";
        Part::Direct = "direct", "Lamps that are seen directly, and what lamps light directly";
        Part::Specular = "specular", "Everything that is seen in mirrors and through glass";
        Part::Caustic = "caustic", "Light that came from lamps through glass or over mirrors to the surface that is seen";
        Part::Indirect = "indirect", "Light that other surfaces scattered onto the surface that is seen";
    }
}

/// What each builder of photon maps does.
pub(crate) const fn meaning(builder: Builder) -> &'static str {
    match builder {
        Builder::Naive => "One slot per photon and bounce, empty slots included (the paper's first)",
        Builder::Atomic => "Only surviving photons, one atomic per thread (the paper's second)",
        Builder::Ballot => "Only surviving photons, one atomic per subgroup",
        Builder::Group => "Only surviving photons, one atomic per work group",
        Builder::Scan => "Only surviving photons, in their original order, by prefix sums",
        Builder::Persistent => "One invocation traces each photon from emission to its end",
        Builder::Cpu => "The paper's CPU implementation, on one thread or on `threads`",
    }
}

/// Which builder of photon maps.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Variant {
    /// For scenes as if none were given; for the paper's box the one that is fastest on the device.
    Auto,
    Of(Builder),
}

impl Variant {
    pub fn builder(self) -> Option<Builder> {
        match self {
            Variant::Auto => None,
            Variant::Of(builder) => Some(builder),
        }
    }
}

impl Word for Variant {
    const FORM: Form = {
        const CHOICES: [(&str, &str); Builder::ALL.len() + 1] = {
            let auto = "Of scenes persistent, but ballot with `math` strict and where the device fails the check of what persistent needs; of the paper's box the fastest, timed on the first photons";
            let mut choices = [("auto", auto); Builder::ALL.len() + 1];
            let mut place = 0;
            while place < Builder::ALL.len() {
                choices[place] = (Builder::ALL[place].name(), meaning(Builder::ALL[place]));
                place += 1;
            }
            choices
        };
        Form::Choice(&CHOICES)
    };

    fn parse(text: &str) -> Parsed<Variant> {
        let found = Builder::ALL.into_iter().find(|builder| builder.name() == text).map(Variant::Of);
        let known = || format!("must be one of {}, auto", Builder::ALL.map(Builder::name).join(", "));
        found.or((text == "auto").then_some(Variant::Auto)).ok_or_else(known)
    }

    fn word(&self) -> String {
        self.builder().map_or("auto", Builder::name).to_owned()
    }
}
