//! What the user of a window chooses: what is shown, and of which run.

use super::{ViewedScene, WindowRequest};
use crate::render::RenderRequest;
use crate::render::values::Variant;
use crate::settings::scene::{Effect, SceneSettings};
use crate::settings::{Builder, RoomSettings};

#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Choices {
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
pub(crate) struct RunChoices {
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
    /// What was asked for, or is usual on a class of devices.
    pub(super) fn of(window: &WindowRequest, kind: &str) -> RunChoices {
        let request = &window.request;
        let (builder, own) = match &window.viewed {
            ViewedScene::Scene { .. } => (request.variant.and_then(Variant::builder), SceneSettings::default().photons),
            ViewedScene::Box => {
                let settings = request.room_settings();
                (Some(settings.builder), settings.photons)
            }
        };
        let is_slow = kind == "cpu" && matches!(window.viewed, ViewedScene::Scene { .. });
        let usual = if is_slow { own.min(PHOTONS_ON_CPU) } else { own };
        let usual_photons = request.photons.is_none().then_some(usual);
        let without = request.without.clone();
        RunChoices { builder, photons: request.photons.unwrap_or(usual), usual_photons, radius_factor: 1.0, without }
    }

    pub(super) fn toggle(&mut self, effect: Effect) {
        match self.without.iter().position(|without| *without == effect) {
            Some(place) => drop(self.without.remove(place)),
            None => self.without.push(effect),
        }
    }

    pub(super) fn scale_radius(&mut self, factor: f64) {
        self.radius_factor = (self.radius_factor * factor).clamp(0.01, 100.0);
    }

    fn neighbours(&self, usual: u32) -> u32 {
        (f64::from(usual) * self.radius_factor * self.radius_factor).round().clamp(1.0, 1e6) as u32
    }

    fn caustic_photons(&self, usual: &SceneSettings) -> u32 {
        let share = f64::from(usual.caustic_photons) / f64::from(usual.photons.max(1));
        (share * f64::from(self.photons)).round().max(1.0) as u32
    }

    /// What a picture of a scene in a file is asked for.
    pub(super) fn of_scene(&self, request: &RenderRequest) -> RenderRequest {
        let usual = request.settings(None);
        let other = |is_other: bool, value: u32| is_other.then_some(value);
        let (photons, radius) = (self.usual_photons != Some(self.photons), self.radius_factor != 1.0);
        RenderRequest {
            variant: self.builder.map(Variant::Of),
            photons: other(photons, self.photons),
            caustic_photons: other(photons, self.caustic_photons(&usual)),
            neighbours: other(radius, self.neighbours(usual.neighbours)).or(request.neighbours),
            caustic_neighbours: other(radius, self.neighbours(usual.caustic_neighbours)).or(request.caustic_neighbours),
            without: self.without.clone(),
            ..request.clone()
        }
    }

    /// What a run without end is asked for, which the window shows.
    pub(super) fn live(&self, request: &RenderRequest) -> RenderRequest {
        let usual = request.settings(None);
        RenderRequest {
            photons: Some(self.photons),
            caustic_photons: Some(self.caustic_photons(&usual)),
            error: None,
            time: None,
            rounds: Some(ROUNDS),
            ..self.of_scene(request)
        }
    }

    /// What the paper's box is asked for; it ends after so many rounds, or none are given.
    pub(super) fn of_box(&self, request: &RenderRequest, rounds: Option<u32>) -> RenderRequest {
        let usual = RenderRequest { photons: None, ..request.clone() }.room_settings();
        RenderRequest {
            variant: Some(Variant::Of(self.builder.unwrap_or(usual.builder))),
            photons: Some(self.photons),
            radius: Some(usual.radius * self.radius_factor),
            // As many more photons lie within the radius.
            full_light: Some(usual.full_light * f64::from(self.photons) / f64::from(usual.photons) * self.radius_factor.powi(2)),
            rounds: rounds.map(|rounds| rounds.max(1)),
            ..request.clone()
        }
    }

    /// The same for a run without end.
    pub(super) fn live_box(&self, request: &RenderRequest) -> RoomSettings {
        RenderRequest { error: None, time: None, ..self.of_box(request, Some(ROUNDS_OF_BOX)) }.room_settings()
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
        let words = |run: &RunChoices| run.of_scene(&RenderRequest::default()).words();
        run.toggle(Effect::Direct);
        assert_eq!(run.without, [Effect::Direct]);
        assert_eq!(words(&run), ["--without=direct"]);
        run.toggle(Effect::Direct);
        assert_eq!(run, choices());
        assert_eq!(words(&run), [""; 0]);
    }

    /// A radius of twice the width holds four times the photons; light of the box stays as bright, and so it does with fewer photons.
    #[test]
    fn radii_and_photons_keep_the_brightness() {
        let mut run = choices();
        run.scale_radius(2.0);
        let usual = SceneSettings::default();
        assert_eq!(run.live(&RenderRequest::default()).neighbours, Some(4 * usual.neighbours));
        let of_box = RoomSettings::default();
        let settings = RunChoices { photons: of_box.photons, ..run }.live_box(&RenderRequest::default());
        assert_eq!((settings.radius, settings.full_light), (2.0 * of_box.radius, 4.0 * of_box.full_light));
        let settings = RunChoices { photons: of_box.photons / 5, ..choices() }.live_box(&RenderRequest::default());
        assert_eq!((settings.photons, settings.full_light), (of_box.photons / 5, of_box.full_light / 5.0));
    }
}
