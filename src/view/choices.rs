//! What the user of a window chooses: what is shown, and of which run.

use super::Subject;
use crate::settings::scene::{Effect, SceneSettings};
use crate::settings::{Builder, RoomSettings};

#[derive(Debug, Clone, PartialEq)]
pub struct Choices {
    /// `SHOW_...`
    pub shows: u32,
    pub stops: f32,
    pub has_photons: bool,
    pub is_open: bool,
    /// Window pixels along each side of one of the picture.
    pub zoom: u32,
    pub run: RunChoices,
}

/// What makes another run.
#[derive(Debug, Clone, PartialEq)]
pub struct RunChoices {
    /// `None`: what is usual.
    pub builder: Option<Builder>,
    /// Of the global map, per round; the caustic map has as many more or less as it had.
    pub photons: u32,
    /// What a run has where nobody says; `None` where the user has typed a number.
    usual_photons: Option<u32>,
    /// Of the usual radius; its square multiplies the photons that a radius holds.
    pub radius_factor: f64,
    pub without: Vec<Effect>,
}

/// Photons per round with which a CPU shows a picture several times a second.
const PHOTONS_ON_CPU: u32 = 1 << 13;
/// Rounds of a run that nobody ends.
const ROUNDS: u32 = 1 << 16;
/// The box's random numbers of the paper go no farther.
const ROUNDS_OF_BOX: u32 = 1 << 12;

impl RunChoices {
    /// What was asked for, or is usual on a class of devices. `photons` is what the user has typed.
    pub fn of(subject: &Subject, photons: Option<u32>, kind: &str) -> RunChoices {
        let (builder, own, without) = match subject {
            Subject::Scene { settings, .. } => (settings.builder, settings.photons, settings.without.clone()),
            Subject::Box(settings) => (Some(settings.builder), settings.photons, Vec::new()),
        };
        let is_slow = kind == "cpu" && matches!(subject, Subject::Scene { .. });
        let usual = if is_slow { own.min(PHOTONS_ON_CPU) } else { own };
        let usual_photons = photons.is_none().then_some(usual);
        RunChoices { builder, photons: photons.unwrap_or(usual), usual_photons, radius_factor: 1.0, without }
    }

    pub fn toggle(&mut self, effect: Effect) {
        match self.without.iter().position(|without| *without == effect) {
            Some(place) => drop(self.without.remove(place)),
            None => self.without.push(effect),
        }
    }

    pub fn scale_radius(&mut self, factor: f64) {
        self.radius_factor = (self.radius_factor * factor).clamp(0.01, 100.0);
    }

    fn neighbours(&self, usual: u32) -> u32 {
        (f64::from(usual) * self.radius_factor * self.radius_factor).round().clamp(1.0, 1e6) as u32
    }

    fn caustic_photons(&self, usual: &SceneSettings) -> u32 {
        let share = f64::from(usual.caustic_photons) / f64::from(usual.photons.max(1));
        (share * f64::from(self.photons)).round().max(1.0) as u32
    }

    /// Settings of a run without end.
    pub fn of_scene(&self, usual: &SceneSettings) -> SceneSettings {
        SceneSettings {
            builder: self.builder,
            photons: self.photons,
            caustic_photons: self.caustic_photons(usual),
            neighbours: self.neighbours(usual.neighbours),
            caustic_neighbours: self.neighbours(usual.caustic_neighbours),
            without: self.without.clone(),
            rounds: ROUNDS,
            keeps_parts: true,
            ..usual.clone()
        }
    }

    pub fn of_box(&self, usual: &RoomSettings) -> RoomSettings {
        RoomSettings {
            builder: self.builder.unwrap_or(usual.builder),
            photons: self.photons,
            radius: usual.radius * self.radius_factor,
            // As many more photons lie within the radius.
            full_light: usual.full_light * f64::from(self.photons) / f64::from(usual.photons) * self.radius_factor.powi(2),
            rounds: ROUNDS_OF_BOX,
            ..usual.clone()
        }
    }

    /// The same as options of `photonmill render`.
    pub fn options(&self, usual: &SceneSettings) -> Vec<(&'static str, String)> {
        let settings = self.of_scene(usual);
        let mut options: Vec<(&str, String)> = self.builder.map(|builder| ("--variant", builder.name().to_owned())).into_iter().collect();
        if self.usual_photons != Some(self.photons) {
            options.push(("--photons", settings.photons.to_string()));
            options.push(("--caustic-photons", settings.caustic_photons.to_string()));
        }
        if self.radius_factor != 1.0 {
            options.push(("--neighbours", settings.neighbours.to_string()));
            options.push(("--caustic-neighbours", settings.caustic_neighbours.to_string()));
        }
        if !self.without.is_empty() {
            options.push(("--without", self.without.iter().map(|effect| effect.name()).collect::<Vec<_>>().join(",")));
        }
        options
    }

    /// The same as options of the box, of so many rounds, where nothing else ends it.
    pub fn options_of_box(&self, usual: &RoomSettings, rounds: Option<u32>) -> Vec<(&'static str, String)> {
        let settings = self.of_box(usual);
        let rounds = rounds.map(|rounds| ("--rounds", rounds.max(1).to_string()));
        let others = [
            ("--variant", settings.builder.name().to_owned()),
            ("--photons", settings.photons.to_string()),
            ("--radius", settings.radius.to_string()),
            ("--full-light", settings.full_light.to_string()),
        ];
        others.into_iter().chain(rounds).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn choices() -> RunChoices {
        RunChoices { builder: None, photons: 1 << 13, usual_photons: Some(1 << 13), radius_factor: 1.0, without: Vec::new() }
    }

    #[test]
    fn an_effect_goes_and_comes_back() {
        let mut run = choices();
        run.toggle(Effect::Direct);
        assert_eq!(run.without, [Effect::Direct]);
        assert_eq!(run.options(&SceneSettings::default()), [("--without", "direct".to_owned())]);
        run.toggle(Effect::Direct);
        assert_eq!(run, choices());
        assert_eq!(run.options(&SceneSettings::default()), []);
    }

    /// A radius of twice the width holds four times the photons; light of the box stays as bright, and so it does with fewer photons.
    #[test]
    fn radii_and_photons_keep_the_brightness() {
        let mut run = choices();
        run.scale_radius(2.0);
        let usual = SceneSettings::default();
        assert_eq!(run.of_scene(&usual).neighbours, 4 * usual.neighbours);
        let of_box = RoomSettings::default();
        let settings = RunChoices { photons: of_box.photons, ..run }.of_box(&of_box);
        assert_eq!((settings.radius, settings.full_light), (2.0 * of_box.radius, 4.0 * of_box.full_light));
        let settings = RunChoices::of(&Subject::Box(Box::new(of_box.clone())), Some(of_box.photons / 5), "cpu").of_box(&of_box);
        assert_eq!((settings.photons, settings.full_light), (of_box.photons / 5, of_box.full_light / 5.0));
    }
}
