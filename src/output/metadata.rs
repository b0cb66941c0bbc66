//! What a picture's file says of the run that made it, and of how to run it again: in a PNG as text, in an EXR as attributes.

use std::fmt::Write;
use std::io::Cursor;

use exr::meta::MetaData;
use exr::meta::attribute::{AttributeValue, Text};
use exr::meta::header::LayerAttributes;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use crate::engine::error::bound::{ErrorSource, FilmError};
use crate::gpu::DeviceFacts;
use crate::plan::work_division::Division;
use crate::settings::tile_samples::TileSamples;

/// Keyword of a PNG's text, and name of an EXR's attribute, that hold all of it as JSON.
pub(crate) const KEY: &str = "photonmill";
/// No picture of this program has more of it.
const MOST_BYTES: usize = 1 << 24;

/// Nothing in it depends on when, where or on how many devices of a kind the run was made: equal results are equal files.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Metadata {
    /// The program's version.
    pub photonmill: String,
    /// Devices and their drivers.
    pub devices: Vec<String>,
    pub scene: String,
    /// SHA-256 of the scene as kernels read it; `None` for the paper's box, which follows from the settings.
    pub scene_hash: Option<String>,
    pub seed: u64,
    /// Rounds that the picture holds.
    pub rounds: u32,
    /// Independent numbers that give each standard error: the blocks of rounds less one.
    pub degrees_of_freedom: u32,
    /// Relative error of the noise, and what it is at most with this confidence; `None` where it is not known.
    pub error: Option<f64>,
    pub error_bound: Option<f64>,
    pub confidence: f64,
    /// What has changed direct light since, of which the errors know nothing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub denoiser: Option<String>,
    /// Of the values.
    pub units: String,
    /// The command line that makes the same picture.
    pub command: String,
    /// Those that decide a bit.
    pub settings: Map<String, Value>,
    pub repeat: Repeat,
}

/// What `photonmill repeat` takes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Repeat {
    /// `command` is the subcommand; `arguments` are those that decide the picture, as they were typed; `division` is what each round did,
    /// as a pilot may have chosen it, and `tiles` have more samples.
    With { command: String, arguments: Vec<String>, division: Division, tiles: Option<TileSamples> },
    /// It cannot be repeated, for this reason.
    Not(String),
}

/// Of the devices of a run, each kind once.
pub(crate) fn devices<'a>(facts: impl Iterator<Item = &'a DeviceFacts>) -> Vec<String> {
    let mut names: Vec<String> = facts.map(|facts| format!("{}, {}", facts.name, facts.driver)).collect();
    names.sort();
    names.dedup();
    names
}

fn known(value: f64) -> Option<f64> {
    Some(value).filter(|value| value.is_finite())
}

/// Noise, and its bound, where they are known.
pub(crate) fn errors(error: &FilmError, confidence: f64) -> [Option<f64>; 2] {
    [known(error.noise), known(error.noise).and_then(|_| known(error.bound(confidence)))]
}

/// The JSON of anything, in ASCII, which every reader of both formats takes.
fn ascii_json(value: &impl Serialize) -> String {
    let json = serde_json::to_string(value).expect("metadata is plain data");
    let mut ascii = String::with_capacity(json.len());
    for letter in json.chars() {
        if letter.is_ascii() {
            ascii.push(letter);
        } else {
            letter.encode_utf16(&mut [0; 2]).iter().for_each(|unit| write!(ascii, "\\u{unit:04x}").unwrap());
        }
    }
    ascii
}

impl Metadata {
    fn software(&self) -> String {
        format!("photonmill {}", self.photonmill)
    }

    /// For people, a line each.
    fn comment(&self) -> String {
        let percent = |value: Option<f64>| value.map_or("unknown".to_owned(), |value| format!("{:.2} %", 100.0 * value));
        let mut text = format!("Command: {}\nScene: {}\n", self.command, self.scene);
        if let Some(hash) = &self.scene_hash {
            writeln!(text, "Scene SHA-256: {hash}").unwrap();
        }
        writeln!(text, "Device: {}", self.devices.join("; ")).unwrap();
        writeln!(text, "Seed: {}\nRounds: {}", self.seed, self.rounds).unwrap();
        let (error, bound) = (percent(self.error), percent(self.error_bound));
        let source = ErrorSource { degrees_of_freedom: self.degrees_of_freedom, confidence: self.confidence };
        writeln!(text, "{}", source.in_words()).unwrap();
        writeln!(text, "Relative error: {error}, at most {bound} ({} % confidence)", 100.0 * self.confidence).unwrap();
        if let Some(denoiser) = &self.denoiser {
            writeln!(text, "Denoised: direct light, by {denoiser}; the errors are those before it").unwrap();
        }
        write!(text, "Values: {}", self.units).unwrap();
        text
    }

    /// Keywords of a PNG and their texts.
    pub(super) fn texts(&self) -> [(&'static str, String); 3] {
        [("Software", self.software()), ("Comment", self.comment()), (KEY, ascii_json(self))]
    }

    /// An EXR's attributes. One holds all values: the writer keeps others in an order that differs from run to run.
    pub(super) fn set(&self, attributes: &mut LayerAttributes) {
        let text = |text: &str| Text::from_slice_unchecked(text.as_bytes());
        attributes.software_name = Some(text(&self.software()));
        attributes.comments = Some(text(&self.comment()));
        attributes.other.insert(text(KEY), AttributeValue::Text(text(&ascii_json(self))));
    }

    /// Of the content of a .png or .exr; fails with why there is none.
    pub fn read(content: &[u8]) -> Result<Metadata, String> {
        let absent = || "holds nothing of how it was made: either photonmill did not write it, or another program has saved it since";
        let json = if content.starts_with(b"\x89PNG") { png_text(content)? } else { exr_attribute(content)? }.ok_or_else(absent)?;
        if json.len() > MOST_BYTES {
            return Err(absent().into());
        }
        // Before anything else of it is read, which may look otherwise in another version.
        let value: Value = serde_json::from_str(&json).map_err(|_| absent())?;
        let (version, own) = (value[KEY].as_str().unwrap_or("of unknown version"), env!("CARGO_PKG_VERSION"));
        if version != own {
            return Err(format!(
                "was made by photonmill {version}, and this is photonmill {own}; only the same version makes the same bits"
            ));
        }
        serde_json::from_value(value).map_err(|error| format!("says otherwise than photonmill {own} how it was made ({error})"))
    }
}

fn png_text(content: &[u8]) -> Result<Option<String>, String> {
    let reader = png::Decoder::new(Cursor::new(content)).read_info().map_err(|error| format!("is no whole PNG ({error})"))?;
    let info = reader.info();
    let plain = info.uncompressed_latin1_text.iter().find(|chunk| chunk.keyword == KEY).map(|chunk| chunk.text.clone());
    Ok(plain)
}

fn exr_attribute(content: &[u8]) -> Result<Option<String>, String> {
    let headers =
        MetaData::read_from_buffered(content, false).map_err(|error| format!("is neither a PNG nor an OpenEXR ({error})"))?.headers;
    let attribute = headers.first().and_then(|header| header.own_attributes.other.get(KEY.as_bytes()));
    Ok(match attribute {
        Some(AttributeValue::Text(text)) => String::from_utf8(text.bytes().to_vec()).ok(),
        _ => None,
    })
}
