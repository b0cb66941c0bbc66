//! Settings as the command line that repeats them.

use crate::settings::{Gather, Preset, Settings};

/// `photonmill` with a preset and the options in which `settings` differ from it. Knows the options
/// that the paper's experiments use.
pub fn line(preset: Preset, settings: &Settings) -> String {
    let defaults = Settings::preset(preset);
    let mut line = "photonmill".to_owned();
    let mut option = |name: &str, value: String| line.push_str(&format!(" --{name} {value}"));
    if preset != Preset::Modified {
        option("preset", lower_case(preset));
    }
    if settings.variant != defaults.variant {
        option("variant", settings.variant.name().to_owned());
    }
    if settings.photons != defaults.photons {
        option("photons", settings.photons.to_string());
    }
    if settings.rounds != defaults.rounds {
        option("rounds", settings.rounds.to_string());
    }
    if settings.bounces != defaults.bounces {
        option("bounces", settings.bounces.to_string());
    }
    if settings.rng != defaults.rng {
        option("rng", lower_case(settings.rng));
    }
    if settings.gather != defaults.gather {
        option("gather", gather_name(settings.gather));
    }
    if let (Some(shininess), true) = (settings.shininess[0], settings.shininess != defaults.shininess) {
        option("shininess", shininess.to_string());
    }
    if settings.threads != defaults.threads {
        option("threads", settings.threads.to_string());
    }
    line
}

pub fn gather_name(gather: Gather) -> String {
    lower_case(gather)
}

/// Options are spelt as the names of the enums' values.
fn lower_case(value: impl std::fmt::Debug) -> String {
    format!("{value:?}").to_lowercase()
}
