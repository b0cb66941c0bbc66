//! Settings as the command line that repeats them: the options in which they differ from the defaults. `cli` reads the
//! lines back in its tests.

use std::fmt::Display;

use crate::settings::scene::{Effect, SceneSettings};
use crate::settings::{Preset, RoomSettings};

struct Line(String);

impl Line {
    fn option(&mut self, name: &str, value: impl Display) {
        self.0.push_str(&format!(" --{name} {value}"));
    }

    fn differing<T: PartialEq + Display>(&mut self, name: &str, value: T, usual: T) {
        if value != usual {
            self.option(name, value);
        }
    }

    /// Of an enum, whose options are spelt as the names of its values.
    fn named<T: PartialEq + std::fmt::Debug>(&mut self, name: &str, value: T, usual: T) {
        self.differing(name, lower_case(value), lower_case(usual));
    }
}

/// Options are spelt as the names of the enums' values.
pub fn lower_case(value: impl std::fmt::Debug) -> String {
    format!("{value:?}").to_lowercase()
}

fn switch(on: bool) -> &'static str {
    if on { "on" } else { "off" }
}

/// `photonmill` on the paper's box.
pub fn main_job(preset: Preset, settings: &RoomSettings) -> String {
    let usual = RoomSettings::preset(preset);
    let mut line = Line("photonmill".to_owned());
    line.named("preset", preset, Preset::Modified);
    line.differing("variant", settings.builder.name(), usual.builder.name());
    line.differing("photons", settings.photons, usual.photons);
    line.differing("rounds", settings.rounds, usual.rounds);
    line.differing("bounces", settings.bounces, usual.bounces);
    line.differing("radius", settings.radius, usual.radius);
    line.differing("seed", settings.seed, usual.seed);
    // The generator is chosen by the photons unless it is named.
    if settings.rng != usual.rng || settings.photons != usual.photons {
        line.option("rng", lower_case(settings.rng));
    }
    line.named("gather", settings.gather, usual.gather);
    settings.nearest.into_iter().for_each(|nearest| line.option("nearest", nearest));
    line.named("sums", settings.sums, usual.sums);
    line.named("math", settings.math, usual.math);
    line.differing("mesh", settings.mesh, usual.mesh);
    line.differing("edge-correction", switch(settings.edge_correction), switch(usual.edge_correction));
    if let (Some(shininess), true) = (settings.shininess[0], settings.shininess != usual.shininess) {
        line.option("shininess", shininess);
    }
    line.differing("threads", settings.threads, usual.threads);
    line.0
}

/// A subcommand with its scene and other arguments, such as `render cornell -o a.exr`, on a scene of triangles.
pub fn on_scene(subcommand: &str, settings: &SceneSettings) -> String {
    let usual = SceneSettings::default();
    let mut line = Line(format!("photonmill {subcommand}"));
    line.differing("photons", settings.photons, usual.photons);
    line.differing("caustic-photons", settings.caustic_photons, settings.photons);
    line.differing("rounds", settings.rounds, usual.rounds);
    settings.block.into_iter().for_each(|block| line.option("block", block));
    line.differing("bounces", settings.bounces, usual.bounces);
    line.differing("seed", settings.seed, usual.seed);
    settings.radius.into_iter().for_each(|radius| line.option("radius", radius));
    settings.caustic_radius.into_iter().for_each(|radius| line.option("caustic-radius", radius));
    line.differing("alpha", settings.alpha, usual.alpha);
    line.named("kernel", settings.kernel, usual.kernel);
    line.differing("edge-correction", switch(settings.edge_correction), switch(usual.edge_correction));
    line.differing("samples", settings.samples, usual.samples);
    line.differing("shadow-rays", settings.shadow_rays, usual.shadow_rays);
    if settings.final_gather {
        line.0.push_str(" --final-gather");
    }
    line.differing("aim", switch(settings.aim), switch(usual.aim));
    line.named("illumination", settings.illumination, usual.illumination);
    if let Some(builder) = settings.builder {
        line.differing("variant", builder.name(), "auto");
    }
    line.named("math", settings.math, usual.math);
    let names = |effects: &[Effect]| effects.iter().map(|effect| effect.name()).collect::<Vec<_>>().join(",");
    line.differing("with", names(&settings.with), String::new());
    line.differing("without", names(&settings.without), String::new());
    line.0
}
