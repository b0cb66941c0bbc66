//! Direct light of a picture without its noise. Only there does the noise of a pixel say nothing of its neighbours'
//! (src/guide/accuracy.md), and only such noise does a denoiser distinguish from detail.

use glam::{DVec3, Vec3};

use super::events::Observer;
use crate::engine::run::saved::SavedRun;
use crate::engine::scene::SceneFilm;
use crate::error::{Result, require};
use crate::oidn::{Denoiser, Guides};
use crate::output::show::Surface;
use crate::settings::scene::{Illumination, Part, SceneSettings};

/// Of all parts.
const DIRECT: usize = 0;

/// Fails where the library is not installed, or a run of these settings has no direct light of its own.
pub(super) fn open(settings: &SceneSettings, resumed: Option<&SavedRun>) -> Result<Denoiser> {
    let needed = |is_so: bool, what: &str| require(is_so, "denoise", "on", what);
    needed(settings.part == Part::All, "is for pictures of all parts of the light; leave `part` out")?;
    let of_maps = "needs `illumination` split: photons give neighbouring pixels the same noise, which a denoiser takes for detail";
    needed(settings.illumination == Illumination::Split, of_maps)?;
    let apart = "needs a checkpoint of a run with -o FILE.exr or `denoise`, which keeps direct light apart";
    needed(resumed.is_none_or(SavedRun::has_parts), apart)?;
    Denoiser::open()
}

/// What metadata call it.
pub(super) fn name(denoiser: &Denoiser) -> String {
    format!("Open Image Denoise {}", denoiser.version)
}

/// Radiance of all pixels; `None` after a warning where it cannot be had.
pub(super) fn denoised(
    denoiser: &Denoiser,
    film: &SceneFilm,
    surfaces: &[Surface],
    size: (u32, u32),
    observer: &Observer,
) -> Option<Vec<Vec3>> {
    let direct: Option<Vec<_>> = (0..film.pixels()).map(|pixel| film.mean_of_part(DIRECT, pixel)).collect();
    let Some(direct) = direct else {
        observer.warn("`denoise`: is left out, as the run could not keep direct light apart; the picture is as it was rendered");
        return None;
    };
    if film.blocks < 2 {
        observer.warn("`denoise`: is left out, as errors are unknown before two blocks of rounds are whole; ask for more `rounds`");
        return None;
    }
    // What emits light in the pixel itself is no noise of shadow rays; its sharp edges stay.
    let scattered: Vec<DVec3> = direct
        .iter()
        .enumerate()
        .map(|(pixel, direct)| (direct - (film.mean(pixel) - film.surface_mean(pixel))).max(DVec3::ZERO))
        .collect();
    let light: Vec<Vec3> = scattered.iter().map(|light| light.as_vec3()).collect();
    let [albedo, normal]: [Vec<Vec3>; 2] =
        [|surface: &Surface| surface.albedo, |surface: &Surface| surface.normal].map(|layer| surfaces.iter().map(layer).collect());
    match denoiser.denoise(size, &light, &Guides { albedo: &albedo, normal: &normal }) {
        Ok(denoised) => {
            // A denoiser may take detail for noise, but not beyond what noise can be: so its own error vanishes with that of the run.
            let bounded = |(pixel, denoised): (usize, Vec3)| {
                let most = film.surface_error(pixel);
                film.mean(pixel) + (denoised.as_dvec3() - scattered[pixel]).clamp(-most, most)
            };
            Some(denoised.into_iter().enumerate().map(bounded).map(DVec3::as_vec3).collect())
        }
        Err(error) => {
            observer.warn(format!("{error}; the picture is as it was rendered"));
            None
        }
    }
}
