//! A scene's film as a picture: radiance, and its standard error.

use glam::DVec3;

use super::colour::{ColourPicture, Format, Tone};
use super::metadata::Metadata;
use crate::engine::scene::SceneFilm;

/// How a film is shown.
pub struct Show {
    pub size: (u32, u32),
    /// In stops; `None`: what makes the mean middle grey.
    pub exposure: Option<f32>,
    pub tone: Tone,
}

impl Show {
    /// The picture, and its exposure in stops; what its file says of it follows from these.
    pub fn picture(&self, film: &SceneFilm, format: Format, metadata: impl FnOnce(f32) -> Option<Metadata>) -> (Vec<u8>, f32) {
        let image = self.of(film, |pixel| film.mean(pixel));
        let stops = self.exposure.unwrap_or_else(|| image.usual_exposure());
        (image.encode(format, stops, self.tone, metadata(stops).as_ref()), stops)
    }

    /// Standard errors, infinite where they are not known.
    pub fn errors(&self, film: &SceneFilm) -> Vec<u8> {
        self.of(film, film.stated_errors()).encode(Format::Exr, 0.0, Tone::Linear, None)
    }

    fn of(&self, film: &SceneFilm, value: impl Fn(usize) -> DVec3) -> ColourPicture {
        let (width, height) = self.size;
        ColourPicture { width, height, pixels: (0..film.pixels()).map(|pixel| value(pixel).as_vec3()).collect() }
    }
}
