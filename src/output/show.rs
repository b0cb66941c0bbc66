//! A scene's film as a picture: radiance, and its standard error.

use glam::{DVec3, Vec3};

use super::colour::{ColourImage, Format, Tone};
use super::exr_file::{self, Channel, channels};
use super::metadata::Metadata;
use super::white_balance::{Kelvin, adaptation};
use crate::constants::PART_COUNT;
use crate::engine::scene::SceneFilm;
use crate::scene::{Camera, Scene};
use crate::settings::named;
use crate::verify::judge::{FirstSurface, first_surfaces};

const RGB: [&str; 3] = ["R", "G", "B"];
/// Parts of the light, by their numbers.
const PARTS: [Layer; PART_COUNT as usize] = [Layer::Direct, Layer::Specular, Layer::Caustic, Layer::Indirect];

named! {
    /// Of an EXR, beside the light.
    pub enum Layer {
        Direct = "direct",
        Specular = "specular",
        Caustic = "caustic",
        Indirect = "indirect",
        StandardError = "standard_error",
        /// The most light that was not seen may add.
        Unseen = "unseen",
        Albedo = "albedo",
        Normal = "normal",
        Depth = "depth",
    }
}

impl Layer {
    /// A part of the light.
    pub fn is_part(self) -> bool {
        PARTS.contains(&self)
    }

    /// Of what is seen first.
    pub fn is_of_surface(self) -> bool {
        [Layer::Albedo, Layer::Normal, Layer::Depth].contains(&self)
    }
}

/// What a pixel sees first.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Surface {
    pub albedo: Vec3,
    /// In the scene's axes.
    pub normal: Vec3,
    /// Metres along the ray; infinite where there is nothing.
    pub depth: f32,
}

/// What each pixel of a picture sees first.
pub(crate) fn surfaces(scene: &Scene, camera: &Camera, size: (u32, u32)) -> Vec<Surface> {
    let surface = |seen: FirstSurface| Surface { albedo: seen.albedo.as_vec3(), normal: seen.normal.as_vec3(), depth: seen.depth as f32 };
    first_surfaces(scene, camera, size).into_iter().map(surface).collect()
}

/// What a file's values are.
pub(crate) fn units(format: Format, stops: f32, show: &Show) -> String {
    let white = show.white_balance.map_or_else(String::new, |kelvin| format!(", white balance {kelvin} K"));
    let tone = match show.tone {
        Tone::Neutral => "Khronos PBR Neutral",
        Tone::Linear => "linear",
    };
    match format {
        Format::Exr => "radiance, W/m2/sr, linear, Rec. 709 primaries".to_owned(),
        Format::Png => format!("sRGB; exposure {stops:+.2} stops, tone curve {tone}{white}"),
    }
}

/// How a film is shown.
#[derive(Clone)]
pub(crate) struct Show {
    pub size: (u32, u32),
    /// In stops; `None`: what makes the mean middle grey.
    pub exposure: Option<f32>,
    pub tone: Tone,
    /// Of a PNG: what is white.
    pub white_balance: Option<Kelvin>,
    /// Of an EXR.
    pub layers: Vec<Layer>,
    /// Radiance in place of the film's; layers are the film's in any case.
    pub denoised: Option<Vec<Vec3>>,
}

impl Show {
    /// Whether an EXR has layers of what is seen first.
    pub(crate) fn shows_surfaces(&self) -> bool {
        self.layers.iter().any(|layer| layer.is_of_surface())
    }

    /// The picture alone, as one is shown while the run goes on.
    pub(crate) fn so_far(&self, film: &SceneFilm, format: Format) -> Vec<u8> {
        let image = if format == Format::Png { self.balanced(film) } else { self.image(film) };
        image.encode(format, self.stops(&image), self.tone, None)
    }

    /// A PNG, and its exposure in stops; what its file says of it follows from these.
    pub(crate) fn png(&self, film: &SceneFilm, metadata: impl FnOnce(f32) -> Metadata) -> (Vec<u8>, f32) {
        let image = self.balanced(film);
        let stops = self.stops(&image);
        (image.encode(Format::Png, stops, self.tone, Some(&metadata(stops))), stops)
    }

    /// The image for the eye.
    fn balanced(&self, film: &SceneFilm) -> ColourImage {
        let mut image = self.image(film);
        if let Some(kelvin) = self.white_balance {
            let adaptation = adaptation(kelvin).as_mat3();
            image.pixels.iter_mut().for_each(|pixel| *pixel = adaptation * *pixel);
        }
        image
    }

    /// An EXR.
    pub(crate) fn exr(&self, film: &SceneFilm, surfaces: &[Surface], metadata: Option<&Metadata>) -> Vec<u8> {
        exr_file::encode(self.size, self.channels(film, surfaces), metadata)
    }

    /// The light, and the layers that are asked for: parts where the film has them, and what is seen first where `surfaces` are given.
    pub(crate) fn channels(&self, film: &SceneFilm, surfaces: &[Surface]) -> Vec<Channel> {
        let light = channels("", RGB, (0..film.pixels()).map(|pixel| self.radiance(film, pixel)));
        light.into_iter().chain(self.layers.iter().flat_map(|layer| self.layer(*layer, film, surfaces))).collect()
    }

    fn layer(&self, layer: Layer, film: &SceneFilm, surfaces: &[Surface]) -> Vec<Channel> {
        let name = layer.name();
        let pixels = || 0..film.pixels();
        match layer {
            Layer::StandardError => channels(name, RGB, pixels().map(film.stated_errors()).map(DVec3::as_vec3)),
            Layer::Unseen => channels(name, RGB, pixels().map(film.unseen_bounds()).map(|most| Vec3::splat(most as f32))),
            Layer::Albedo | Layer::Normal | Layer::Depth if surfaces.is_empty() => Vec::new(),
            Layer::Albedo => channels(name, RGB, surfaces.iter().map(|surface| surface.albedo)),
            Layer::Normal => channels(name, ["X", "Y", "Z"], surfaces.iter().map(|surface| surface.normal)),
            Layer::Depth => {
                vec![Channel { name: format!("{name}.Z"), values: surfaces.iter().map(|surface| surface.depth).collect() }]
            }
            Layer::Direct | Layer::Specular | Layer::Caustic | Layer::Indirect => {
                let part = PARTS.iter().position(|part| *part == layer).expect("it is a part");
                let values: Option<Vec<Vec3>> = pixels().map(|pixel| Some(film.mean_of_part(part, pixel)?.as_vec3())).collect();
                values.map_or_else(Vec::new, |values| channels(name, RGB, values.into_iter()))
            }
        }
    }

    fn radiance(&self, film: &SceneFilm, pixel: usize) -> Vec3 {
        self.denoised.as_ref().map_or_else(|| film.mean(pixel).as_vec3(), |denoised| denoised[pixel])
    }

    fn image(&self, film: &SceneFilm) -> ColourImage {
        self.of(film, |pixel| self.radiance(film, pixel))
    }

    fn stops(&self, image: &ColourImage) -> f32 {
        self.exposure.unwrap_or_else(|| image.usual_exposure())
    }

    /// Standard errors, infinite where they are not known, and what may be unseen in a layer of its own.
    pub(crate) fn errors(&self, film: &SceneFilm) -> Vec<u8> {
        let errors = channels("", RGB, (0..film.pixels()).map(film.stated_errors()).map(DVec3::as_vec3));
        let all = errors.into_iter().chain(self.layer(Layer::Unseen, film, &[])).collect();
        exr_file::encode_errors(self.size, all, film.error_source())
    }

    fn of(&self, film: &SceneFilm, value: impl Fn(usize) -> Vec3) -> ColourImage {
        let (width, height) = self.size;
        ColourImage { width, height, pixels: (0..film.pixels()).map(value).collect() }
    }
}
