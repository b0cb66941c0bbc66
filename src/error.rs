//! Everything that can go wrong, each as one sentence: what, which value, what is allowed. A field of a request stands in backticks, as in
//! "use a smaller `radius`".

use std::fmt::Display;
use std::ops::RangeInclusive;
use std::path::PathBuf;

use crate::ledger::Ledger;
use crate::text::{counted, echo};

/// What a machine without Vulkan lacks: the loader, a driver, or both.
pub(crate) const INSTALL_VULKAN: &str = if cfg!(target_os = "macos") {
    "install the Vulkan loader and MoltenVK (brew install vulkan-loader molten-vk)"
} else if cfg!(windows) {
    "install the current graphics driver of your GPU's vendor, which brings the Vulkan loader"
} else {
    "install the Vulkan loader and a driver: your GPU vendor's, or Mesa's, which can also run on the CPU \
     (Debian, Ubuntu: apt install libvulkan1 mesa-vulkan-drivers; Fedora: dnf install vulkan-loader mesa-vulkan-drivers)"
};

pub type Result<T> = std::result::Result<T, Error>;

#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The value of a request's field, or of a command's option, is not allowed.
    #[error("{} {}: {allowed}", named(option), echo(value))]
    Setting { option: &'static str, value: String, allowed: String },

    /// A file or folder that an option names cannot be written.
    #[error("{} {}: cannot be written ({reason}); choose a place that can be written", named(option), echo(path.display()))]
    Output { option: &'static str, path: PathBuf, reason: String },

    /// The same after a run, whose results went somewhere else.
    #[error("{} {}: cannot be written ({reason}); everything is saved in {} instead", named(option), echo(path.display()), folder.display())]
    Saved { option: &'static str, path: PathBuf, reason: String, folder: PathBuf },

    /// A scene file, or something in it, cannot be used.
    #[error("{}: {object} {reason}", echo(path.display()))]
    Scene { path: PathBuf, object: String, reason: String },

    /// A picture that is compared cannot be used.
    #[error("{}: {reason}", echo(path.display()))]
    Image { path: PathBuf, reason: String },

    /// Two pictures differ by more than the user allows.
    #[error("`fail_above` {allowed}: the RMSE of {} is {found}", echo(path.display()))]
    PictureAbove { allowed: String, path: PathBuf, found: String },

    /// A picture that was run again has other values.
    #[error("{}: {differing} of {of} values differ from those of the repeated run: {why}", echo(path.display()))]
    NotRepeated { path: PathBuf, differing: usize, of: usize, why: String },

    /// There is no Vulkan loader, or no device behind it.
    #[error("no Vulkan device: {reason}; {INSTALL_VULKAN}")]
    NoVulkan { reason: String },

    /// `--device` names a device that is not there, or several.
    #[error("`device` {}: must match exactly one Vulkan device; available: {present}", echo(wanted))]
    DeviceAbsent { wanted: String, present: String },

    /// A device lacks something that every kernel needs.
    #[error(
        "{device}: does not support {what}, which photonmill needs; choose another device with `device`, or trace the paper's box with `variant` cpu"
    )]
    DeviceLacks { device: String, what: String },

    /// A device fails the start-up check.
    #[error(
        "{device}: failed the start-up check, so its results cannot be trusted: {what}; update its driver, or choose another device with `device`"
    )]
    DeviceWrong { device: String, what: String },

    /// There is no window, or nothing that shows pictures in it.
    #[error("no window: {reason}; `photonmill render` makes pictures without one, and `render --display` shows them on another machine")]
    NoWindow { reason: String },

    /// A measurement of a device's limits came out wrong.
    #[error(
        "{device}: computes {what} wrongly, so its measurements are not valid; update its driver, or choose another device with `device`"
    )]
    Miscalculated { device: String, what: String },

    /// A Vulkan call failed.
    #[error("{call} failed on the device: {reason}")]
    Device { call: &'static str, reason: String },

    /// The device is gone, or its driver has reset it.
    #[error("{}; the system's log says why; a run with `checkpoint` can go on from its file with `resume`", self.what())]
    DeviceLost { call: &'static str },

    /// Memory of the device or of the host ran out.
    #[error("{}; ask for a smaller picture or fewer photons, or choose another device with `device`", self.what())]
    OutOfMemory { call: &'static str, what: String },

    /// The device lost photons or counted them twice.
    #[error(
        "the photon ledger does not close: {ledger}; the device or its driver loses work: update the driver, or choose another device with `device`"
    )]
    LedgerOpen { ledger: Ledger },

    /// Results differ from closed forms.
    #[error(
        "{device}: {failed} of {of} checks failed, the first: {first}; its results cannot be trusted: update its driver, or choose another device with `device`"
    )]
    SelfcheckFailed { device: String, failed: usize, of: usize, first: String },

    /// The user interrupted it before there was anything to write.
    #[error("interrupted before the first result; nothing was written")]
    Interrupted,

    /// The denoiser was asked for and cannot be had.
    #[error("`denoise`: Open Image Denoise {reason}")]
    Denoiser { reason: String },

    /// The validation layer was asked for and is not installed.
    #[error("`validate`: the layer VK_LAYER_KHRONOS_validation is not installed; install the Vulkan validation layers, or omit `validate`")]
    NoValidationLayer,

    /// The validation layer reported errors.
    #[error("`validate`: {} from the validation layer, the first: {first}", counted(count, "message"))]
    Validation { count: usize, first: String },
}

/// A field in backticks, for whoever writes it in another way; all other names as they are: `-o`, `FILE`.
pub(crate) fn named(option: &str) -> String {
    if option.starts_with(|letter: char| letter.is_ascii_lowercase()) { format!("`{option}`") } else { option.to_owned() }
}

impl Error {
    /// 2 for input that the user can mend, 1 for everything else.
    pub fn exit_code(&self) -> u8 {
        match self {
            Error::Setting { .. }
            | Error::Output { .. }
            | Error::Saved { .. }
            | Error::Scene { .. }
            | Error::Image { .. }
            | Error::DeviceAbsent { .. }
            | Error::Denoiser { .. }
            | Error::NoValidationLayer => 2,
            Error::Interrupted => 130,
            _ => 1,
        }
    }

    /// What failed, without a remedy.
    pub fn what(&self) -> String {
        match self {
            Error::DeviceLost { call } => format!("{call} failed on the device: the device was lost"),
            Error::OutOfMemory { call, what } => format!("{call} failed on the device: {what}"),
            other => other.to_string(),
        }
    }

    pub(crate) fn setting(option: &'static str, value: impl ToString, allowed: impl Into<String>) -> Error {
        Error::Setting { option, value: value.to_string(), allowed: allowed.into() }
    }
}

/// Refuses the value of an option that is not allowed.
pub(crate) fn require(is_allowed: bool, option: &'static str, value: impl ToString, allowed: impl Into<String>) -> Result<()> {
    if is_allowed { Ok(()) } else { Err(Error::setting(option, value, allowed)) }
}

/// Refuses what is out of range; `what` says what the numbers are.
pub(crate) fn within<T: PartialOrd + Display>(option: &'static str, value: T, allowed: RangeInclusive<T>, what: &str) -> Result<()> {
    let (least, most) = (allowed.start(), allowed.end());
    require(allowed.contains(&value), option, &value, format!("must be from {least} to {most} ({what})"))
}
