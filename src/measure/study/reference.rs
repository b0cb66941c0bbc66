//! References from methods other than photon mapping: radiosity for the paper's box, closed forms for floors, path tracing
//! for images.

use std::fmt::Write;
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use bytemuck::cast_slice;
use glam::DVec3;
use rayon::prelude::*;
use sha2::{Digest, Sha256};

use crate::error::{Error, Result};
use crate::scene::closed_forms::floor_irradiance;
use crate::scene::{Camera, Scene};
use crate::settings::{EmissionLaw, RoomSettings, WALL_NAMES};
use crate::verify::judge::Judge;
use crate::verify::judge::radiosity::{Law, Radiosity};

/// Values and their standard errors; places where `counts` is false are left out.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Reference {
    pub method: String,
    pub values: Vec<f64>,
    /// Of chance alone: 0 where no chance is in it.
    pub standard_errors: Vec<f64>,
    pub counts: Vec<bool>,
    /// How well it is known, over its root mean square.
    pub relative_error: f64,
}

impl Reference {
    /// Mean of a function of the place, over all that count.
    pub(crate) fn mean_over(&self, f: impl Fn(usize) -> f64) -> f64 {
        let counted = (0..self.values.len()).filter(|place| self.counts[*place]);
        let (sum, count) = counted.fold((0.0, 0usize), |(sum, count), place| (sum + f(place), count + 1));
        sum / count.max(1) as f64
    }

    /// Of the values, without what their own noise adds.
    pub(crate) fn mean_square(&self) -> f64 {
        self.mean_over(|place| self.values[place].powi(2) - self.standard_errors[place].powi(2)).max(f64::MIN_POSITIVE)
    }

    /// Of what is off, without what the reference's own noise adds.
    pub(crate) fn squared_error(&self, found: &[f64]) -> f64 {
        self.mean_over(|place| (found[place] - self.values[place]).powi(2) - self.standard_errors[place].powi(2))
    }

    /// Smallest relative error that this can judge. Its noise is taken out of what it judges, in squares, and what that leaves is a quarter of
    /// the square at most, as the noise is known to a few percent; of other errors of its own nothing is known.
    pub(crate) fn least_error(&self) -> f64 {
        let noise = self.mean_over(|place| self.standard_errors[place].powi(2)) / self.mean_square();
        let rest = (self.relative_error.powi(2) - noise).max(0.0);
        (0.25 * noise + 4.0 * rest).sqrt()
    }

    /// With the relative error that its own noise makes at the places that count.
    pub(crate) fn with_own_error(self) -> Reference {
        let noise = self.mean_over(|place| self.standard_errors[place].powi(2));
        Reference { relative_error: (noise / self.mean_square()).sqrt(), ..self }
    }

    /// Irradiance of the walls of the paper's box at the middle of each texel, of all reflections, W/m2, by radiosity in
    /// f64. Its error is taken to be the difference from half as many cells.
    pub(crate) fn walls(settings: &RoomSettings, mesh: u32) -> Result<Reference> {
        let key = format!("walls {RADIOSITY_VERSION} {:?} {} {} {mesh}", settings.emission, settings.reflectance, settings.light_radius);
        cached(&key, || {
            let law = match settings.emission {
                EmissionLaw::Uniform => Law::Uniform,
                EmissionLaw::Cosine => Law::Cosine,
            };
            let [fine, coarse] = [CELLS, CELLS / 2].map(|cells| {
                let solution = Radiosity::solve(law, f64::from(settings.reflectance), cells, ORDERS);
                wall_points(mesh)
                    .into_par_iter()
                    .map(|(wall, point)| solution.direct_at(wall, point) + solution.reflected_at(wall, point))
                    .collect::<Vec<f64>>()
            });
            let square = |values: &mut dyn Iterator<Item = f64>| values.map(|value| value * value).sum::<f64>();
            let difference = square(&mut fine.iter().zip(&coarse).map(|(fine, coarse)| fine - coarse));
            Ok(Reference {
                method: String::new(),
                standard_errors: vec![0.0; fine.len()],
                counts: vec![true; fine.len()],
                relative_error: (difference / square(&mut fine.iter().copied())).sqrt(),
                values: fine,
            })
        })
        .map(|reference| reference.by(format!("radiosity in float64 with {CELLS} x {CELLS} cells per wall and {ORDERS} reflections")))
    }

    /// Irradiance of a square of floor in closed form, and its points and normals, for scenes that have one.
    pub(crate) fn floor(name: &str, size: u32) -> Option<(Vec<(DVec3, DVec3)>, Reference)> {
        // The furnace's floor goes from 0 to 1 m; planes are around the origin.
        let place = |i: u32| (f64::from(i) + 0.5) / f64::from(size) - if name == "furnace" { 0.0 } else { 0.5 };
        let points: Vec<DVec3> = (0..size * size).map(|k| DVec3::new(place(k % size), 0.0, place(k / size))).collect();
        let values: Option<Vec<f64>> = points.iter().map(|point| floor_irradiance(name, point.x, point.z)).collect();
        let reference = Reference {
            method: "closed form".to_owned(),
            values: values?,
            standard_errors: vec![0.0; points.len()],
            counts: vec![true; points.len()],
            relative_error: SINGLE_PRECISION,
        };
        Some((points.into_iter().map(|point| (point, DVec3::Y)).collect(), reference))
    }

    /// Radiance of a picture, three channels a pixel, W/m2/sr, by path tracing in f64. Pixels in which a light is seen
    /// straight are left out: their light is known beforehand and would drown the rest.
    pub(crate) fn picture(
        scene: &Scene,
        camera: &Camera,
        (width, height): (u32, u32),
        samples: u32,
        cancelled: &AtomicBool,
        report: &mut dyn FnMut(&str),
    ) -> Result<Reference> {
        let key = digest(format_args!("{JUDGE_VERSION} {scene:?} {camera:?} {width} {height} {samples}"));
        cached(&format!("picture {key}"), || {
            let (batch, batches) = (samples / BATCHES, BATCHES);
            let judge = Judge::new(scene, u32::MAX);
            let places = 3 * (width * height) as usize;
            let (mut values, mut variances) = (vec![0.0; places], vec![0.0; places]);
            for number in 0..batches {
                if cancelled.load(Ordering::Relaxed) {
                    return Err(Error::Interrupted);
                }
                report(&format!("reference: {} of {samples} samples per pixel", number * batch));
                let image = judge.image(camera, width, height, batch, SEED + u64::from(number));
                for (place, (value, variance)) in values.iter_mut().zip(&mut variances).enumerate() {
                    let pixel = &image.pixels[place / 3];
                    *value += pixel.mean.total()[place % 3] / f64::from(batches);
                    *variance += (pixel.total_standard_error[place % 3] / f64::from(batches)).powi(2);
                }
            }
            let emitted = Judge::new(scene, 0).image(camera, width, height, 64, SEED);
            let reference = Reference {
                method: String::new(),
                values,
                standard_errors: variances.into_iter().map(f64::sqrt).collect(),
                counts: (0..places).map(|place| emitted.pixels[place / 3].mean.direct == DVec3::ZERO).collect(),
                relative_error: 0.0,
            };
            Ok(reference.with_own_error())
        })
        .map(|reference| reference.by(format!("path tracing in float64 on the CPU with {} samples per pixel", samples / BATCHES * BATCHES)))
    }

    /// Named anew on every run: a cached file may have been written with other words.
    fn by(self, method: String) -> Reference {
        Reference { method, ..self }
    }
}

/// What positions in f32 leave of a closed form.
const SINGLE_PRECISION: f64 = 1e-6;

/// Parts of a path-traced reference; it can be interrupted between them.
const BATCHES: u32 = 8;

/// Seed of references: no run that they judge has its random numbers, as those come from another generator.
const SEED: u64 = 0x5eed;
/// To be raised when a method's results change, so that nothing old is read.
const RADIOSITY_VERSION: u32 = 1;
const JUDGE_VERSION: u32 = 2;
const CELLS: usize = 16;
/// Light that was reflected 40 times is less than 1e-6 of all in the paper's box.
const ORDERS: usize = 40;

/// Middles of all texels in the order of the film's walls, with the number of their wall.
pub(crate) fn wall_points(mesh: u32) -> Vec<(usize, DVec3)> {
    let scene = crate::scene::open_box::open_box(&RoomSettings::default());
    let walls = scene.walls().zip(0..WALL_NAMES.len());
    walls
        .flat_map(|((face, _), wall)| scene.rectangle(face).texel_centres(mesh, mesh).map(move |point| (wall, point)).collect::<Vec<_>>())
        .collect()
}

/// Of a text that may be too long to hold.
pub(crate) fn digest(text: std::fmt::Arguments) -> String {
    let mut hash = Hash(Sha256::new());
    hash.write_fmt(text).expect("hashing cannot fail");
    format!("{:x}", hash.0.finalize())
}

struct Hash(Sha256);

impl Write for Hash {
    fn write_str(&mut self, text: &str) -> std::fmt::Result {
        self.0.update(text);
        Ok(())
    }
}

/// A reference from the user's cache, else made and put there. A cache that cannot be read or written costs time only.
fn cached(key: &str, make: impl FnOnce() -> Result<Reference>) -> Result<Reference> {
    let Some(path) = path_of(key) else { return make() };
    if let Some(known) = std::fs::read(&path).ok().and_then(|bytes| decode(&bytes)) {
        return Ok(known);
    }
    let made = make()?;
    let _ = replace_file(&path, &encode(&made));
    Ok(made)
}

/// Writes a file; it stands as it was until the new one is whole.
pub(crate) fn replace_file(path: &Path, content: &[u8]) -> io::Result<File> {
    let folder = path.parent().expect("the file lies in a folder");
    std::fs::create_dir_all(folder)?;
    let mut file = tempfile::NamedTempFile::new_in(folder)?;
    io::Write::write_all(&mut file, content)?;
    Ok(file.persist(path)?)
}

fn path_of(key: &str) -> Option<PathBuf> {
    let folders = directories::ProjectDirs::from("", "", "photonmill")?;
    Some(folders.cache_dir().join("references").join(format!("{:x}.f64", Sha256::digest(key))))
}

/// A digest of the rest, then the relative error, the values, their standard errors, and 1 or 0 for each place that counts
/// or does not.
fn encode(reference: &Reference) -> Vec<u8> {
    let counts: Vec<f64> = reference.counts.iter().map(|counts| f64::from(u8::from(*counts))).collect();
    let numbers = [&[reference.relative_error][..], &reference.values, &reference.standard_errors, &counts].concat();
    let body: &[u8] = cast_slice(&numbers);
    [Sha256::digest(body).as_slice(), body].concat()
}

fn decode(bytes: &[u8]) -> Option<Reference> {
    let (digest, body) = bytes.split_at_checked(32)?;
    let (words, []) = body.as_chunks::<8>() else { return None };
    let numbers: Vec<f64> = words.iter().map(|word| f64::from_ne_bytes(*word)).collect();
    let (relative_error, places) = numbers.split_first().filter(|_| Sha256::digest(body).as_slice() == digest)?;
    let [values, standard_errors, counts] = [0, 1, 2].map(|part| &places[part * places.len() / 3..(part + 1) * places.len() / 3]);
    Some(Reference {
        method: String::new(),
        values: values.to_vec(),
        standard_errors: standard_errors.to_vec(),
        counts: counts.iter().map(|counts| *counts != 0.0).collect(),
        relative_error: *relative_error,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn reference() -> Reference {
        Reference {
            method: String::new(),
            values: vec![1.0, 2.0, 30.0],
            standard_errors: vec![0.1, 0.2, 3.0],
            counts: vec![true, true, false],
            relative_error: 0.1,
        }
    }

    #[test]
    fn a_spoiled_file_is_made_anew() {
        let bytes = encode(&reference());
        assert_eq!(decode(&bytes), Some(reference()));
        for place in [0, 40, 60, bytes.len() - 1] {
            let mut spoiled = bytes.clone();
            spoiled[place] ^= 1;
            assert_eq!(decode(&spoiled), None, "byte {place}");
        }
        assert_eq!(decode(&bytes[..50]), None);
    }

    #[test]
    fn the_references_own_noise_is_no_error_of_what_it_judges() {
        let reference = reference();
        assert!(reference.squared_error(&[1.1, 1.8, -7.0]).abs() < 1e-15);
        assert!((reference.mean_square() - (0.99 + 3.96) / 2.0).abs() < 1e-12);
    }
}
