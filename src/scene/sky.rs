//! A sky from a picture of all directions (equirectangular). Light is sampled from it by a table ([`super::sky_table`]); kernels have both
//! in `glsl/world/scene/sky.glsl`.

use std::f64::consts::{PI, TAU};
use std::path::Path;

use glam::{DQuat, DVec2, DVec3, Vec3};
use rayon::prelude::*;

use super::linear_image::{self, LinearImage};
use super::texture::{Filter, Texels, Texture, Wrap};
use crate::text::counted;

/// Left to right from -x over -z, +x and +z (y is up): +x is in the middle; from the top row, which is up, to the bottom.
#[derive(Debug, Clone, PartialEq)]
pub struct Sky {
    pub texture: Texture,
    /// W/m2/sr of a texel of 1.
    pub strength: Vec3,
    /// From the picture's axes to the scene's.
    pub turn: DQuat,
    /// What the picture holds that is no radiance.
    pub warnings: Vec<String>,
}

impl Sky {
    /// Reads a Radiance (`.hdr`) or OpenEXR (`.exr`) file; an error says what is wrong with it, and what to do.
    pub fn read(path: &Path) -> Result<Sky, String> {
        let content = super::file::read(path)?;
        if !linear_image::is_one(&content) {
            return Err("is neither a Radiance (.hdr) nor an OpenEXR (.exr) picture; convert it to one of them".into());
        }
        let LinearImage { width, height, colours, exposure, .. } = LinearImage::decode(content)?;
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let mut sky = Sky::of(name, width, height, colours);
        sky.strength /= exposure;
        Ok(sky)
    }

    /// The radiance of its brightest texel, W/m2/sr.
    pub fn brightest(&self) -> f32 {
        let texel = |place: usize| self.texture.texels.at(place).max_element();
        let count = (self.texture.width * self.texture.height) as usize;
        (0..count).into_par_iter().map(texel).reduce(|| 0.0, f32::max) * self.strength.max_element()
    }

    /// From pixels, row by row from the top. What is no number, infinite or negative is black, and a warning counts it.
    pub fn of(name: impl Into<String>, width: u32, height: u32, mut colours: Vec<Vec3>) -> Sky {
        let clean = |colour: &mut Vec3| {
            let counts = [usize::from(!colour.is_finite()), usize::from(colour.is_finite() && colour.min_element() < 0.0)];
            *colour = if colour.is_finite() { colour.max(Vec3::ZERO) } else { Vec3::ZERO };
            (counts, colour.max_element())
        };
        let joined = |a: ([usize; 2], f32), b: ([usize; 2], f32)| ([a.0[0] + b.0[0], a.0[1] + b.0[1]], a.1.max(b.1));
        let ([infinite, negative], most) = colours.par_iter_mut().map(clean).reduce(|| ([0; 2], 0.0), joined);
        let mut warnings = Vec::new();
        if infinite > 0 {
            warnings.push(format!("{} of the environment infinite or no number; black instead", counted(infinite, "pixel")));
        }
        if negative > 0 {
            warnings.push(format!("{} of the environment with negative values; 0 instead", counted(negative, "pixel")));
        }
        if width != 2 * height {
            let size = format!("{width} x {height}");
            warnings.push(format!(
                "the environment is {size}; a picture of all directions is twice as wide as high, and this one is stretched"
            ));
        }
        // The largest texel has the largest exponent that there is, so that dark ones keep their digits beside the sun.
        let power = if most > 0.0 { f64::from(most).log2().floor() as i32 - 14 } else { 0 };
        let (shrink, grow) = (2f64.powi(-power), 2f64.powi(power));
        let texture = Texture {
            name: name.into(),
            width,
            height,
            texels: Texels::scaled(&colours, shrink),
            wrap: [Wrap::Repeat, Wrap::Clamp],
            filter: Filter::Bilinear,
        };
        Sky { texture, strength: Vec3::splat(grow as f32), turn: DQuat::IDENTITY, warnings }
    }

    /// Turned about the vertical, counter-clockwise as seen from above.
    pub fn turned(self, degrees: f64) -> Sky {
        Sky { turn: DQuat::from_rotation_y(degrees.to_radians()) * self.turn, ..self }
    }

    /// Radiance from a unit direction, W/m2/sr.
    pub fn radiance(&self, direction: DVec3) -> DVec3 {
        let local = self.turn.inverse() * direction;
        let turns = local.z.atan2(local.x) / TAU;
        let angle = local.x.hypot(local.z).atan2(local.y);
        (self.texture.sample(DVec2::new(0.5 + turns, angle / PI)).truncate() * self.strength).as_dvec3()
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    pub fn sky(width: u32, height: u32, colour: impl Fn(u32, u32) -> Vec3) -> Sky {
        let colours = (0..height).flat_map(|j| (0..width).map(move |i| (i, j))).map(|(i, j)| colour(i, j)).collect();
        Sky::of("sky", width, height, colours)
    }

    #[test]
    fn the_picture_lies_where_the_guide_says() {
        let sky = sky(8, 4, |i, j| Vec3::new(i as f32, j as f32, 1.0));
        let near = |direction: DVec3, expected: DVec3| {
            let found = sky.radiance(direction.normalize());
            assert!((found - expected).abs().max_element() < 0.01 * expected.length(), "{direction}: {found}, not {expected}");
        };
        near(DVec3::X, DVec3::new(3.5, 1.5, 1.0));
        near(DVec3::Z, DVec3::new(5.5, 1.5, 1.0));
        near(DVec3::NEG_Z, DVec3::new(1.5, 1.5, 1.0));
        near(DVec3::new(1e-9, 1.0, 0.0), DVec3::new(3.5, 0.0, 1.0));
        near(DVec3::new(1e-9, -1.0, 0.0), DVec3::new(3.5, 3.0, 1.0));
        // What was seen along +x turns to -z, counter-clockwise from above.
        let turned = sky.clone().turned(90.0);
        assert!((turned.radiance(DVec3::NEG_Z) - sky.radiance(DVec3::X)).abs().max_element() < 1e-6);
    }

    /// A Radiance file of 8 x 2 pixels, each with another red, and these lines.
    fn radiance_file(lines: &str) -> Vec<u8> {
        let pixels = (0..16u8).flat_map(|k| [8 * k + 1, 128, 64, 129]);
        lines.bytes().chain(pixels).collect()
    }

    fn read(content: &[u8]) -> Result<Sky, String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.hdr");
        std::fs::write(&path, content).unwrap();
        Sky::read(&path)
    }

    /// Rows from below, and from the right, exposures and ends of lines as other programs write them.
    #[test]
    fn radiance_files_of_all_programs_are_read() {
        let red = |lines: &str| -> Vec<f32> {
            let sky = read(&radiance_file(lines)).unwrap();
            (0..16).map(|place| sky.texture.texels.at(place).x * sky.strength.x).collect()
        };
        let usual = red("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 2 +X 8\n");
        assert_eq!((usual[0], usual[15]), (2.0 * 1.0 / 256.0, 2.0 * 121.0 / 256.0));
        assert_eq!(red("#?RGBE\r\nFORMAT = 32-bit_rle_rgbe\r\n\r\n-Y 2 +X 8\r\n"), usual);
        let halves = red("#?RADIANCE\nEXPOSURE=4\nEXPOSURE= 0.5\n\n-Y 2 +X 8\n");
        assert!(halves.iter().zip(&usual).all(|(half, whole)| 2.0 * half == *whole), "{halves:?}");
        let turned = red("#?RADIANCE\n\n+Y 2 -X 8\n");
        assert!(turned.iter().rev().eq(&usual), "{turned:?}");
        let upside_down = red("#?RADIANCE\n\n+Y 2 +X 8\n");
        assert_eq!((&upside_down[..8], &upside_down[8..]), (&usual[8..], &usual[..8]));
    }

    #[test]
    fn pictures_that_are_no_skies_are_refused_in_plain_words() {
        for (lines, words) in [
            ("#?RADIANCE\n\n+X 8 -Y 2\n", "has the size '+X 8 -Y 2'; it must be as -Y 512 +X 1024"),
            ("#?RADIANCE\n\n-Y 0 +X 8\n", "is 8 x 0; allowed are 1 to"),
            ("#?RADIANCE\n\n-Y 100000 +X 100000\n", "is 100000 x 100000; allowed are 1 to"),
            ("#?RADIANCE\nFORMAT=32-bit_rle_xyze\n\n-Y 2 +X 8\n", "format 32-bit_rle_xyze; only 32-bit_rle_rgbe is read"),
            ("#?RADIANCE\nEXPOSURE=0\n\n-Y 2 +X 8\n", "EXPOSURE=0; the product of all must be above 0"),
            ("#?RADIANCE\nEXPOSURE=1e30\nEXPOSURE=1e30\n\n-Y 2 +X 8\n", "EXPOSURE=1e30; the product"),
            ("#?RADIANCE\n\n-Y 20 +X 8\n", "is cut off; export it again"),
            ("#?RADIANCE\n", "is cut off"),
            ("P6\n8 2\n255\n", "neither a Radiance (.hdr) nor an OpenEXR (.exr) picture"),
        ] {
            let reason = read(&radiance_file(lines)).unwrap_err();
            assert!(reason.contains(words), "{lines:?}: {reason}");
        }
    }

    #[test]
    fn radiances_of_any_size_keep_their_digits() {
        for scale in [1e-20f32, 1e-3, 1.0, 1e9, 1e30] {
            let sky = sky(4, 2, |i, _| Vec3::new(1.0, 1e-3, 1.0) * scale * if i == 0 { 1e6 } else { 1.0 });
            let found = sky.radiance(DVec3::X + 1e-9 * DVec3::Z) / f64::from(scale);
            assert!((found - DVec3::new(1.0, 1e-3, 1.0)).abs().max_element() < 0.002, "{scale}: {found}");
        }
    }

    #[test]
    fn what_is_no_radiance_is_counted() {
        let bad = [f32::NAN, f32::INFINITY, -1.0, 2.0];
        let sky = sky(4, 2, |i, _| Vec3::splat(bad[i as usize]));
        assert_eq!(sky.warnings.len(), 2, "{:?}", sky.warnings);
        assert!(sky.warnings[0].starts_with("4 pixels") && sky.warnings[1].starts_with("2 pixels"), "{:?}", sky.warnings);
        assert!(sky.table().integral.is_finite());
    }
}
