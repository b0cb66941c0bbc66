//! Skies that a file brings as the six sides of a cube (EXT_lights_image_based).

use std::f64::consts::{PI, TAU};
use std::sync::Arc;

use glam::{DQuat, DVec3, Vec3};
use gltf::Document;
use rayon::prelude::*;
use serde::Deserialize;
use serde_json::Value;

use super::malformed::REMEDY;
use super::{Loader, called, printable};
use crate::error::Result;
use crate::scene::light::{Light, LightKind};
use crate::scene::sky::Sky;
use crate::scene::texture::LINEAR_OF_SRGB;

const EXTENSION: &str = "EXT_lights_image_based";

/// Texels along a side: of a sky of 8192 x 4096.
const MAX_SIZE: u32 = 2048;

/// What the extension says of a light.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct ImageLight {
    name: Option<String>,
    #[serde(default = "one")]
    intensity: f32,
    #[serde(default = "no_turn")]
    rotation: [f64; 4],
    /// From sharp to blurred pictures, each of six sides. The first is what the sky is; the rest, and coefficients of irradiance, are for
    /// renderers that do not sample it.
    specular_images: Vec<[usize; 6]>,
}

fn one() -> f32 {
    1.0
}

fn no_turn() -> [f64; 4] {
    [0.0, 0.0, 0.0, 1.0]
}

/// The light of the scene that is read, as its JSON, and its number.
pub(super) fn of(root: &Value) -> Option<(usize, Value)> {
    let scene = root["scene"].as_u64().unwrap_or(0) as usize;
    let number = root["scenes"][scene]["extensions"][EXTENSION]["light"].as_u64()? as usize;
    Some((number, root["extensions"][EXTENSION]["lights"][number].clone()))
}

/// Numbers of the pictures that it shows.
pub(super) fn images(root: &Value) -> Vec<usize> {
    let sides = of(root).and_then(|(_, light)| light["specularImages"][0].as_array().cloned());
    sides.into_iter().flatten().filter_map(|side| side.as_u64()).map(|side| side as usize).collect()
}

impl Loader {
    /// Adds the sky of [`of`].
    pub(super) fn read_image_light(&mut self, document: &Document, (number, light): (usize, Value)) -> Result<()> {
        let what = called("environment", light["name"].as_str(), number);
        let light = ImageLight::deserialize(light).map_err(|error| self.refuse(&what, format!("is not valid: {error}; {REMEDY}")))?;
        let reason = || format!("has the intensity {}; it must be 0 or more", light.intensity);
        self.require(light.intensity.is_finite() && light.intensity >= 0.0, &what, reason)?;
        let turn = DQuat::from_array(light.rotation).normalize();
        self.require(turn.is_finite(), &what, || format!("has the rotation {:?}; its length must not be 0", light.rotation))?;
        let Some(sides) = light.specular_images.first() else {
            return Err(self.refuse(&what, format!("has no pictures; {REMEDY}")));
        };
        let mut cube = Vec::new();
        for side in sides {
            let Some(image) = document.images().nth(*side) else {
                return Err(self.refuse(&what, format!("shows the picture {side} of {}", document.images().len())));
            };
            let (name, bytes) = self.encoded_image(&image)?;
            let picture = self.decoded(&name, &bytes)?;
            let (width, height) = picture.dimensions();
            let size = cube.first().map_or(width, |(size, _)| *size);
            self.require(width == size && height == size && size <= MAX_SIZE, &name, || {
                format!("is {width} x {height}; the sides of an environment must be six squares of one size, of {MAX_SIZE} texels at most")
            })?;
            cube.push((size, picture));
        }
        let size = cube[0].0;
        let texel = |side: usize, x: u32, y: u32| {
            let [red, green, blue, divisor] = cube[side].1.get_pixel(x, y).0;
            // Colours of more than 1 were multiplied by what alpha holds.
            Vec3::from([red, green, blue].map(|code| LINEAR_OF_SRGB[usize::from(code)])) * (255.0 / f32::from(divisor))
        };
        let width = (8 * size).min(4 * MAX_SIZE);
        let height = width / 2;
        let at = |column: f64, row: f64| {
            let angle = PI * row / f64::from(height);
            let (sine, cosine) = (TAU * (column / f64::from(width) - 0.5)).sin_cos();
            let (side, [x, y]) = on_cube(DVec3::new(angle.sin() * cosine, angle.cos(), angle.sin() * sine));
            let (x, y) = (x * f64::from(size) - 0.5, y * f64::from(size) - 0.5);
            let within = |place: f64| place.clamp(0.0, f64::from(size - 1)) as u32;
            let row = |y: f64| {
                let share = (x - x.floor()) as f32;
                texel(side, within(x.floor()), within(y)).lerp(texel(side, within(x.floor() + 1.0), within(y)), share)
            };
            row(y.floor()).lerp(row(y.floor() + 1.0), (y - y.floor()) as f32)
        };
        // The mean of four places, as texels near the corners of a cube are small.
        let colour = |place: u32| {
            let (column, row) = (f64::from(place % width), f64::from(place / width));
            let sum: Vec3 =
                [(0.25, 0.25), (0.75, 0.25), (0.25, 0.75), (0.75, 0.75)].map(|(x, y)| at(column + x, row + y)).into_iter().sum();
            0.25 * sum
        };
        let colours: Vec<Vec3> = (0..width * height).into_par_iter().map(colour).collect();
        let mut sky = Sky::of(light.name.as_deref().map_or_else(|| what.clone(), printable), width, height, colours);
        sky.strength *= light.intensity;
        sky.turn = turn;
        self.scene.warnings.append(&mut sky.warnings);
        if light.intensity > 0.0 {
            self.scene.lights.push(Light { name: what, kind: LightKind::Sky(Arc::new(sky)) });
        }
        Ok(())
    }
}

/// The side of a cube map that a direction meets, by OpenGL's order and axes, and the place there, from the left and from the top.
fn on_cube(direction: DVec3) -> (usize, [f64; 2]) {
    let DVec3 { x, y, z } = direction;
    let most = direction.abs().max_element();
    let (side, across, down) = if x.abs() == most {
        if x > 0.0 { (0, -z, -y) } else { (1, z, -y) }
    } else if y.abs() == most {
        if y > 0.0 { (2, x, z) } else { (3, x, -z) }
    } else if z > 0.0 {
        (4, x, -y)
    } else {
        (5, -x, -y)
    };
    (side, [across, down].map(|along| 0.5 + 0.5 * along / most))
}
