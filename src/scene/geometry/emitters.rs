//! What emits light: emissive triangles and lights without geometry, each with the probability that a photon starts there.

use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::{PI, TAU};

use glam::{DVec3, Vec2, Vec3};
use rayon::prelude::*;

use super::lamp_pieces::{Brightness, Cut, EmissiveTexture, Lamp, Piece, cut};
use super::{Geometry, MAX_TEXELS, area, refuse, texture_record};
use crate::constants::*;
use crate::error::Result;
use crate::records::{Emitter, LayeredMaterial, SurfaceMaterial, TextureInfo, Triangle};
use crate::scene::Scene;
use crate::scene::choices::{CHOICES, deal};
use crate::scene::light::LightKind;
use crate::scene::sky::Sky;
use crate::settings::EmissionLaw;

const MAX_EMITTERS: usize = 1 << 22;

impl Geometry {
    pub(super) fn add_emitters(&mut self, scene: &Scene) -> Result<()> {
        let mut found = self.emissive_triangles(scene);
        let mut sky = Vec3::ZERO;
        let mut pictured = None;
        for light in &scene.lights {
            match &light.kind {
                LightKind::Environment { radiance } => {
                    sky += *radiance;
                    continue;
                }
                LightKind::Sky(picture) => {
                    if pictured.is_some() {
                        return Err(refuse(scene, &light.name, "is the scene's second picture of a sky; allowed is one".into()));
                    }
                    pictured = Some(picture);
                    continue;
                }
                _ => {}
            }
            let emitter = self.emitter_of(&light.kind);
            if !(emitter.emitter.strength.is_finite() && emitter.weight.is_finite() && emitter.emitter.position.is_finite()) {
                let wide = self.unit;
                let reason =
                    format!("leaves the range of numbers: the scene is {wide} metres wide, which its strength or place does not fit");
                return Err(refuse(scene, &light.name, reason));
            }
            found.push(emitter);
        }
        // One environment, the sum of all, comes last, where the kernels look for it.
        if let Some(picture) = pictured {
            if sky != Vec3::ZERO {
                return Err(refuse(scene, "the sky", "is both a colour and a picture; leave one out".into()));
            }
            let sky = self.add_sky(scene, picture)?;
            found.push(sky);
        }
        found.push(self.emitter_of(&LightKind::Environment { radiance: sky }));
        found.retain(|found| found.weight > 0.0);
        if found.len() > MAX_EMITTERS {
            let reason = format!("has {} triangles and lights that emit, at most {MAX_EMITTERS} can be chosen from", found.len());
            return Err(refuse(scene, "the scene", reason));
        }
        self.power = found.iter().map(|found| found.weight).sum();
        let choices = deal(&found.iter().map(|found| found.weight / self.power).collect::<Vec<_>>());
        let mut before = 0;
        for (found, choices) in found.iter_mut().zip(&choices) {
            found.emitter.probability = *choices as f32 / CHOICES as f32;
            found.flux /= f64::from(found.emitter.probability);
            before += choices;
            found.emitter.cumulative = before as f32 / CHOICES as f32;
        }
        self.flux_unit = found.iter().map(|found| found.flux.max_element() * found.brightest).fold(0.0, f64::max);
        if self.flux_unit == 0.0 {
            self.flux_unit = 1.0;
        }
        self.emitters = found.into_iter().map(|found| Emitter { flux: (found.flux / self.flux_unit).as_vec3(), ..found.emitter }).collect();
        Ok(())
    }

    /// The emitters where photons choose them by other shares, and by how much more than now a photon of relative flux 1 then carries.
    pub(crate) fn emitters_by(&self, shares: &[f64]) -> (Vec<Emitter>, f64) {
        let mut emitters = self.emitters.clone();
        let mut before = 0;
        for (emitter, choices) in emitters.iter_mut().zip(deal(shares)) {
            before += choices;
            let probability = choices as f32 / CHOICES as f32;
            emitter.flux *= emitter.probability / probability;
            emitter.probability = probability;
            emitter.cumulative = before as f32 / CHOICES as f32;
        }
        let gains = emitters.iter().zip(&self.emitters).map(|(new, old)| f64::from(old.probability) / f64::from(new.probability));
        let scale = gains.fold(1.0, f64::max);
        emitters.iter_mut().for_each(|emitter| emitter.flux /= scale as f32);
        (emitters, scale)
    }

    /// Those that emit by a texture in pieces, each by how bright it is.
    fn emissive_triangles(&mut self, scene: &Scene) -> Vec<Found> {
        let emissive = emissive_textures(scene);
        let found_in = |(index, triangle): (usize, &Triangle)| {
            let material = &scene.materials[triangle.material as usize];
            if triangle.plane >= HIDDEN || !material.is_emissive() {
                return None;
            }
            let sides = if material.has_two_sides() { 2.0 } else { 1.0 };
            let flux = PI * sides * area(triangle) * material.emission.as_dvec3();
            let (position, strength) = (piece_record(Piece::WHOLE), material.emission);
            let emitter = Emitter { kind: EMITTER_TRIANGLE, triangle: index as u32, strength, position, ..Emitter::default() };
            Some(Found { emitter, flux, weight: flux.element_sum(), brightest: 1.0 })
        };
        let found: Vec<Found> = self.triangles.par_iter().enumerate().filter_map(found_in).collect();
        if emissive.is_empty() {
            return found;
        }
        let texture_of = |found: &Found| {
            let triangle = &self.triangles[found.emitter.triangle as usize];
            emissive.get(&scene.materials[triangle.material as usize].emission_texture?.texture)
        };
        let textured = found.iter().filter_map(|found| {
            let uvs = &self.uvs[found.emitter.triangle as usize];
            let uvs = [uvs.emission_a, uvs.emission_b, uvs.emission_c].map(Vec2::as_dvec2);
            Some(Lamp { emissive: texture_of(found)?, uvs, flux: found.weight })
        });
        let Cut { pieces, left } = cut(&textured.collect::<Vec<_>>());
        let mut pieces = pieces.into_iter();
        let in_pieces = |found: Found| {
            let Some(emissive) = texture_of(&found) else { return vec![found] };
            let of_piece = |(piece, brightness): (Piece, Brightness)| {
                let flux = found.flux * piece.width * piece.width;
                // A hundredth of the whole texture's steers a choice, so that no part is without a chance.
                let mean = 0.99 * brightness.mean + 0.01 * emissive.all.mean;
                let emitter = Emitter { position: piece_record(piece), ..found.emitter };
                Found { emitter, flux, weight: (flux * mean).element_sum(), brightest: brightness.most }
            };
            pieces.next().into_iter().flatten().map(of_piece).collect()
        };
        let found = found.into_iter().flat_map(in_pieces).collect();
        self.coarse_pieces = left;
        found
    }

    /// Of an emissive triangle, or the piece of it that an emitter is.
    pub(crate) fn lamp_corners(&self, light: &Emitter) -> [Vec3; 3] {
        let Triangle { a, b, c, .. } = self.triangles[light.triangle as usize];
        let piece = Piece { corner: light.position.as_dvec3().truncate(), width: f64::from(light.position.z) };
        if piece == Piece::WHOLE { [a, b, c] } else { piece.corners([a, b, c].map(Vec3::as_dvec3)).map(DVec3::as_vec3) }
    }

    /// The emitter of a sky from a picture, which becomes the last two textures: its texels, and the words of its table.
    fn add_sky(&mut self, scene: &Scene, sky: &Sky) -> Result<Found> {
        let table = sky.table();
        let first_texel = self.texels.len() as u32;
        let words = sky.texture.texels.word_count() + table.words.len();
        if self.texels.len() + words > MAX_TEXELS {
            let reason = format!(
                "has {words} texels and places for its samples, beside {first_texel} of textures; at most {MAX_TEXELS} can be kept"
            );
            return Err(refuse(scene, "the environment", reason));
        }
        let picture = self.textures.len() as u32;
        self.textures.push(TextureInfo { first_texel, ..texture_record(&sky.texture) });
        self.texels.par_extend(sky.texture.texels.words());
        self.textures.push(TextureInfo {
            width: table.columns,
            height: table.rows,
            first_texel: self.texels.len() as u32,
            ..TextureInfo::default()
        });
        self.texels.extend(&table.words);
        self.sky_most = table.most;
        let all = PI * self.radius * self.radius * sky.strength.as_dvec3();
        let turn = sky.turn.as_quat();
        let emitter = Emitter {
            kind: EMITTER_ENVIRONMENT,
            triangle: picture,
            strength: sky.strength,
            position: turn.xyz(),
            size: turn.w,
            outer_versine: table.share as f32,
            direction: (sky.turn * table.sun.0).as_vec3(),
            sun_versine: table.sun.1 as f32,
            ..Emitter::default()
        };
        let weight = (all * table.integral).element_sum();
        Ok(Found { emitter, flux: 2.0 * TAU * all, weight, brightest: table.most_over_density })
    }

    fn emitter_of(&self, kind: &LightKind) -> Found {
        let area_unit = self.unit * self.unit;
        let (own, flux) = match *kind {
            LightKind::Point { position, intensity } => {
                let strength = intensity.as_dvec3() / area_unit;
                let own = Emitter { position: self.to_local(position), strength: strength.as_vec3(), ..Emitter::default() };
                (own, 2.0 * TAU * strength)
            }
            LightKind::Spot { position, direction, intensity, inner_angle, outer_angle } => {
                let strength = intensity.as_dvec3() / area_unit;
                // f32 holds a solid angle of so much, and its inverse.
                let (inner, outer) = (versine(inner_angle), versine(outer_angle).max(1e-36));
                let own = Emitter {
                    position: self.to_local(position),
                    direction: direction.as_vec3(),
                    strength: strength.as_vec3(),
                    size: inner as f32,
                    outer_versine: outer as f32,
                    ..Emitter::default()
                };
                // The square of a falloff that is linear in the cosine has a third of the ring's light.
                (own, TAU * (inner + (outer - inner) / 3.0) * strength)
            }
            LightKind::Directional { direction, irradiance } => {
                let own = Emitter { direction: direction.as_vec3(), strength: irradiance, ..Emitter::default() };
                (own, PI * self.radius * self.radius * irradiance.as_dvec3())
            }
            LightKind::Disc { centre, normal, radius, power, law } => {
                let flux = power.as_dvec3() / area_unit;
                let radius = radius / self.unit;
                let disc = PI * radius * radius;
                let strength = match law {
                    EmissionLaw::Cosine => flux / (PI * disc),
                    EmissionLaw::Uniform => flux / (TAU * disc),
                };
                let own = Emitter {
                    position: self.to_local(centre),
                    direction: normal.as_vec3(),
                    strength: strength.as_vec3(),
                    size: radius as f32,
                    ..Emitter::default()
                };
                (own, flux)
            }
            LightKind::Sky(_) => unreachable!("a picture is added by itself"),
            LightKind::Environment { radiance } => (
                Emitter { strength: radiance, triangle: NONE, ..Emitter::default() },
                2.0 * TAU * PI * self.radius * self.radius * radiance.as_dvec3(),
            ),
        };
        let emitter = Emitter { kind: kind.code(), ..own };
        Found { emitter, flux, weight: flux.element_sum(), brightest: 1.0 }
    }

    /// Whether the environment is a picture.
    pub(crate) fn has_sky_picture(&self) -> bool {
        self.emitters.last().is_some_and(|emitter| emitter.kind == EMITTER_ENVIRONMENT && emitter.triangle != NONE)
    }

    /// Radiance of the brightest thing that a camera can see, W/m2/sr, or the irradiance a sixteenth of the scene's
    /// unit from a point or spot light: what a narrow spot lights is far brighter than its power over the scene's area.
    pub(crate) fn brightest(&self) -> f64 {
        let small = self.emitters.iter().filter(|emitter| matches!(emitter.kind, EMITTER_POINT | EMITTER_SPOT));
        let irradiance = small.map(|emitter| 2f64.powi(8) * f64::from(emitter.strength.max_element()));
        self.shown_radiances().map(|radiance| f64::from(radiance.max_element())).chain(irradiance).fold(0.0, f64::max)
    }

    /// Radiance of the brightest surface or sky that a path can meet, W/m2/sr, the root of the sum of its channels' squares.
    pub(crate) fn brightest_shown(&self) -> f64 {
        self.shown_radiances().map(|radiance| f64::from(radiance.length())).fold(0.0, f64::max)
    }

    fn shown_radiances(&self) -> impl Iterator<Item = Vec3> {
        let of_material = |(material, layered): (&SurfaceMaterial, &LayeredMaterial)| {
            let shown = if layered.is_unlit != 0 { material.base_colour } else { Vec3::ZERO };
            material.emission + shown
        };
        let emitted = self.materials.iter().zip(&self.layered_materials).map(of_material);
        let environment = self.emitters.iter().filter(|emitter| emitter.kind == EMITTER_ENVIRONMENT);
        emitted.chain(environment.map(|emitter| if emitter.triangle == NONE { emitter.strength } else { self.sky_most * emitter.strength }))
    }
}

/// 1 - cosine of an angle, with all digits of a small one.
fn versine(angle: f32) -> f64 {
    2.0 * (0.5 * f64::from(angle)).sin().powi(2)
}

/// An emitter before its probability is known.
struct Found {
    emitter: Emitter,
    /// Per channel, texture left out.
    flux: DVec3,
    weight: f64,
    /// Largest value of its texture.
    brightest: f64,
}

/// How an emitter's record holds a piece of a triangle.
fn piece_record(piece: Piece) -> Vec3 {
    piece.corner.extend(piece.width).as_vec3()
}

/// Those that something emits by, by number.
fn emissive_textures(scene: &Scene) -> BTreeMap<usize, EmissiveTexture<'_>> {
    let emissive = scene.materials.iter().filter(|material| material.is_emissive());
    let textures: BTreeSet<usize> = emissive.filter_map(|material| Some(material.emission_texture?.texture)).collect();
    textures.into_iter().map(|texture| (texture, EmissiveTexture::new(&scene.textures[texture]))).collect()
}

#[cfg(test)]
mod tests {
    use glam::DVec2;

    use super::*;
    use crate::scene::texture::Wrap;
    use crate::scene::{Material, Mesh, Texture, built_in, work};

    fn texture(width: u32, height: u32, texels: Vec<Vec3>) -> Texture {
        Texture { name: "t".into(), width, height, texels: texels.into(), wrap: [Wrap::Repeat; 2], filter: Default::default() }
    }

    /// A strip of so many triangles that emits by a texture.
    fn textured_lamp(triangles: u32, texture: Texture) -> Scene {
        let mut lamp = Mesh { name: "lamp".into(), ..Mesh::default() };
        for k in 0..triangles {
            let at = f64::from(k) / f64::from(triangles);
            lamp.positions.extend([DVec3::X * at, DVec3::new(at, 1.0, 0.0), DVec3::new(at + 1.0 / f64::from(triangles), 1.0, 0.0)]);
            lamp.uvs[0].extend([DVec2::new(at, 0.0), DVec2::new(at, 1.0), DVec2::new(at, 1.0)]);
            lamp.triangles.push([3 * k, 3 * k + 1, 3 * k + 2]);
        }
        let mut material = Material::lambert("lamp", Vec3::ONE);
        material.emission = Vec3::ONE;
        material.emission_texture = Some(crate::scene::material::TextureUse::of(0, 0));
        Scene { meshes: vec![lamp], materials: vec![material], textures: vec![texture], ..Scene::default() }
    }

    /// A texture is summed once and not for every triangle.
    #[test]
    fn many_triangles_emit_by_a_large_texture() {
        let scene = textured_lamp(6036, texture(2048, 2048, vec![Vec3::splat(0.25); 1 << 22]));
        let (geometry, summed) = work::of(|| Geometry::new(&scene).unwrap());
        assert_eq!(geometry.emitters.len(), 6036);
        let watts = geometry.power * geometry.unit * geometry.unit;
        assert!((watts / (3.0 * PI * 0.25 * 0.5) - 1.0).abs() < 1e-4, "{watts} W");
        assert!((1 << 22..2 << 22).contains(&summed), "{summed} texels summed");
    }

    /// No sample of a texture exceeds what photons' fluxes are scaled by.
    #[test]
    fn no_sample_is_brighter_than_the_brightest() {
        let texel = |k: u32| Vec3::new(0.1, 0.2 + 0.7 * (k % 997) as f32 / 997.0, 0.3);
        let texture = texture(700, 100, (0..70_000).map(texel).collect());
        let summary = EmissiveTexture::new(&texture).all;
        let texels = || (0..70_000).map(|place| texture.texels.at(place).truncate().as_dvec3());
        let brightest = texels().map(|texel| texel.y).fold(0.0, f64::max);
        assert_eq!(summary.most, brightest);
        let mean = texels().sum::<DVec3>() / 70_000.0;
        assert!((summary.mean - mean).abs().max_element() < 1e-12, "{} {mean}", summary.mean);
        let geometry = Geometry::new(&textured_lamp(3, texture)).unwrap();
        assert!(geometry.emitters.iter().all(|emitter| f64::from(emitter.flux.max_element()) * brightest <= 1.0 + 1e-6));
    }

    /// Photons that choose lights otherwise carry the same flux together, and none carries more than 1.
    #[test]
    fn other_shares_leave_the_flux() {
        let geometry = Geometry::new(&textured_lamp(5, texture(2, 2, vec![Vec3::ONE; 4]))).unwrap();
        let (emitters, scale) = geometry.emitters_by(&[0.5, 0.25, 0.125, 0.125 - 1e-12, 1e-12]);
        assert!(emitters[0].probability > 0.49 && emitters[4].probability < 1e-6 && emitters[4].cumulative == 1.0);
        for (old, new) in geometry.emitters.iter().zip(&emitters) {
            let flux = |emitter: &Emitter, unit: f64| f64::from(emitter.flux.x) * f64::from(emitter.probability) * unit;
            assert!((flux(new, scale) / flux(old, 1.0) - 1.0).abs() < 1e-5, "{old:?}, {new:?}");
            assert!(new.flux.max_element() <= 1.0 + 1e-6);
        }
        let (same, scale) = geometry.emitters_by(&[0.2; 5]);
        assert_eq!((same, scale), (geometry.emitters.clone(), 1.0));
    }

    #[test]
    fn emitters_hold_all_power() {
        let scene = built_in::by_name("cornell").unwrap();
        let geometry = Geometry::new(&scene).unwrap();
        let watts = geometry.power * geometry.unit * geometry.unit;
        let exact = PI * 0.09 * (17.0 + 12.0 + 4.0);
        assert!((watts / exact - 1.0).abs() < 1e-5, "{watts} W, {exact} W");
        // Every photon of these two equal triangles carries the same.
        assert_eq!(geometry.emitters.len(), 2);
        assert!(geometry.emitters.iter().all(|emitter| (emitter.flux.max_element() - 1.0).abs() < 1e-6));
        assert_eq!(geometry.emitters[1].cumulative, 1.0);
    }
}
