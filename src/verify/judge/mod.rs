//! A reference path tracer that shares no code with the photon maps that it checks.
//!
//! A scene goes in; estimates of radiance and irradiance come out, each with its standard error. It is
//! unidirectional (from the eye, with light sampling at every surface that is not specular, and at layered
//! ones multiple importance sampling), in f64, and without bias but for two limits: paths of more than
//! `max_bounces` bounces are left out, and so are caustics of point, spot and directional lights, which no
//! path from the eye can meet.
//!
//! Standard errors show little where few samples carry the light: in caustics of small lamps, and next
//! to emissive triangles that meet other surfaces, where 1 / distance^2 has no bound.

mod albedo;
mod camera_path;
mod first_surface;
mod geometry;
mod layered;
mod light;
pub(crate) mod lobes;
mod material;
mod media;
mod microfacets;
pub(crate) mod radiosity;
mod verdict;

use std::cell::Cell;
use std::f64::consts::PI;
use std::ops::{Add, Index, IndexMut};

use bytemuck::{Pod, Zeroable};
use glam::{DVec2, DVec3};
use rand_pcg::rand_core::{Rng, SeedableRng};
use rayon::prelude::*;

use crate::scene::{Camera, Scene};
pub(crate) use crate::settings::scene::Part;
pub(crate) use first_surface::{FirstSurface, first_surfaces};
use geometry::Geometry;
use light::Emitters;
#[cfg(test)]
pub(crate) use material::fresnel;
use media::{BySize, is_solid};
pub(crate) use verdict::Verdict;

/// Radiance (W/m2/sr) or irradiance (W/m2) by [`Part`], linear RGB. Irradiance has no specular part.
///
/// A camera path runs through specular surfaces (mirrors, glass) to the first one that is not: x. Light is classified by what
/// lies before and behind x. Of layered surfaces it is the lobe that counts, sharp or rough: see the guide's page on materials.
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct Parts {
    /// Emission that is seen as such, and light that reaches x straight from where it is emitted.
    pub direct: DVec3,
    /// All that is seen through specular surfaces.
    pub specular: DVec3,
    /// What reaches x from its emitter through specular surfaces only, one or more.
    pub caustic: DVec3,
    /// All else that reaches x.
    pub indirect: DVec3,
}

/// The mean of independent samples.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Estimate {
    pub mean: Parts,
    /// Standard error of each part's mean, and of the total's; infinite for less than two samples.
    pub standard_error: Parts,
    pub total_standard_error: DVec3,
}

/// Radiance by pixel, row by row from the top.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Image {
    pub width: u32,
    pub height: u32,
    pub pixels: Vec<Estimate>,
}

/// A scene, ready for rays.
pub(crate) struct Judge<'a> {
    geometry: Geometry<'a>,
    emitters: Emitters<'a>,
    /// Some material encloses a medium.
    has_solids: bool,
    by_size: Option<BySize<'a>>,
    max_bounces: u32,
}

/// Random numbers of one pixel or point.
pub(crate) type Random = rand_pcg::Pcg64;

/// The random numbers `index` of a seed: what a pixel's result depends on, whichever thread computes it.
pub(crate) fn random(seed: u64, index: u64) -> Random {
    Random::seed_from_u64(seed.rotate_left(32) ^ index)
}

/// Uniform in [0, 1).
fn uniform(rng: &mut Random) -> f64 {
    (rng.next_u64() >> 11) as f64 / (1u64 << 53) as f64
}

thread_local! {
    static PATHS: Cell<u64> = const { Cell::new(0) };
}

/// Paths that this thread has asked judges for so far, a count that no clock disturbs.
#[cfg(test)]
pub(crate) fn paths_traced() -> u64 {
    PATHS.get()
}

fn count_paths(paths: u64) {
    PATHS.set(PATHS.get() + paths);
}

impl<'a> Judge<'a> {
    /// `max_bounces`: surfaces that may scatter light on its way from the emitter to the eye, or to the
    /// point that irradiance is asked for; `u32::MAX` for no limit.
    pub(crate) fn new(scene: &'a Scene, max_bounces: u32) -> Judge<'a> {
        let geometry = Geometry::new(scene);
        let emitters = Emitters::new(scene, &geometry);
        let has_solids = scene.materials.iter().any(is_solid);
        let by_size = media::by_size(scene);
        Judge { geometry, emitters, has_solids, by_size, max_bounces }
    }

    /// A picture. Samples are spread evenly over each pixel's square.
    pub(crate) fn image(&self, camera: &Camera, width: u32, height: u32, samples_per_pixel: u32, seed: u64) -> Image {
        count_paths(u64::from(width) * u64::from(height) * u64::from(samples_per_pixel));
        let aspect = f64::from(width) / f64::from(height);
        let pixel = |number: u32| {
            let (column, row) = (f64::from(number % width), f64::from(number / width));
            let mut rng = random(seed, u64::from(number));
            Estimate::of(samples_per_pixel, || {
                let x = 2.0 * (column + uniform(&mut rng)) / f64::from(width) - 1.0;
                let y = 1.0 - 2.0 * (row + uniform(&mut rng)) / f64::from(height);
                let on_lens = camera.lens.map_or(DVec2::ZERO, |_| {
                    let (radius, azimuth) = (uniform(&mut rng).sqrt(), 2.0 * PI * uniform(&mut rng));
                    radius * DVec2::new(azimuth.cos(), azimuth.sin())
                });
                let (origin, direction) = camera.ray(x, y, aspect, on_lens);
                self.radiance(origin, direction, &mut rng)
            })
        };
        Image { width, height, pixels: (0..width * height).into_par_iter().map(pixel).collect() }
    }

    /// Irradiance at points, each with the unit normal of the side that is lit.
    pub(crate) fn irradiance_at(&self, points: &[(DVec3, DVec3)], samples: u32, seed: u64) -> Vec<Estimate> {
        count_paths(points.len() as u64 * u64::from(samples));
        let estimate = |(index, (point, normal)): (usize, &(DVec3, DVec3))| {
            let mut rng = random(seed, index as u64);
            Estimate::of(samples, || self.irradiance(*point, *normal, &mut rng))
        };
        points.par_iter().enumerate().map(estimate).collect()
    }
}

impl Estimate {
    /// Means and variances of `samples` draws (Welford's recurrence).
    fn of(samples: u32, mut draw: impl FnMut() -> Parts) -> Estimate {
        let (mut mean, mut squares, mut total_squares) = (Parts::default(), Parts::default(), DVec3::ZERO);
        for count in 1..=samples {
            let sample = draw();
            let before = sample.zip(mean, |a, b| a - b);
            let total_before = before.total();
            mean = mean.zip(before, |a, b| a + b / f64::from(count));
            let after = sample.zip(mean, |a, b| a - b);
            squares = squares + before.zip(after, |a, b| a * b);
            total_squares += total_before * after.total();
        }
        let of_mean = |squares: DVec3| match samples {
            0 | 1 => DVec3::INFINITY,
            // Rounding may leave a sum of products a hair below nothing.
            _ => (squares / (f64::from(samples) * f64::from(samples - 1))).max(DVec3::ZERO).map(f64::sqrt),
        };
        Estimate { mean, standard_error: squares.zip(squares, |a, _| of_mean(a)), total_standard_error: of_mean(total_squares) }
    }
}

impl Parts {
    pub(crate) fn total(&self) -> DVec3 {
        self.direct + self.specular + self.caustic + self.indirect
    }

    fn zip(self, other: Parts, f: impl Fn(DVec3, DVec3) -> DVec3) -> Parts {
        let [one, two]: [[DVec3; 4]; 2] = [self, other].map(bytemuck::cast);
        bytemuck::cast::<[DVec3; 4], Parts>(std::array::from_fn(|part| f(one[part], two[part])))
    }
}

impl Add for Parts {
    type Output = Parts;

    fn add(self, other: Parts) -> Parts {
        self.zip(other, |a, b| a + b)
    }
}

/// Where a part stands among [`Parts`].
fn place(part: Part) -> usize {
    Part::EACH.iter().position(|each| *each == part).expect("one part, not all of them")
}

impl Index<Part> for Parts {
    type Output = DVec3;

    fn index(&self, part: Part) -> &DVec3 {
        &bytemuck::cast_ref::<Parts, [DVec3; 4]>(self)[place(part)]
    }
}

impl IndexMut<Part> for Parts {
    fn index_mut(&mut self, part: Part) -> &mut DVec3 {
        &mut bytemuck::cast_mut::<Parts, [DVec3; 4]>(self)[place(part)]
    }
}
