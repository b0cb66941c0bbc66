//! Light sources: emissive triangles and lights without geometry.

use std::f64::consts::PI;

use glam::{DVec3, Vec3};

use super::geometry::{Geometry, Hit, Ray};
use super::material::{around, sample_lobe};
use super::{Random, uniform};
use crate::scene::Scene;
use crate::scene::light::LightKind;
use crate::scene::sky::Sky;
use crate::settings::EmissionLaw;

enum Emitter<'a> {
    /// Number of a triangle.
    Triangle(usize),
    Light(&'a LightKind),
}

pub(crate) struct Emitters<'a> {
    emitters: Vec<Emitter<'a>>,
    /// The share of power of this emitter and all before it.
    cumulative: Vec<f64>,
    /// The probability that a triangle is chosen.
    of_triangles: Vec<f64>,
    sky: Option<SkyCells<'a>>,
}

/// The texels of a sky, from which half of the samples come; the others leave by the cosine.
struct SkyCells<'a> {
    sky: &'a Sky,
    /// The share of each and all before it.
    cumulative: Vec<f64>,
    /// Integral of the radiance over all directions, all channels together.
    total: f64,
}

impl SkyCells<'_> {
    fn new(sky: &Sky) -> SkyCells<'_> {
        let (width, height) = (i64::from(sky.texture.width), i64::from(sky.texture.height));
        let value = |i: i64, j: i64| {
            let place = j.clamp(0, height - 1) * width + i.rem_euclid(width);
            (sky.texture.texels.at(place as usize).truncate() * sky.strength).as_dvec3().element_sum()
        };
        let mut total = 0.0;
        let mut below = 0.0;
        let mut cumulative = Vec::with_capacity((width * height) as usize);
        for (j, i) in (0..height).flat_map(|j| (0..width).map(move |i| (j, i))) {
            let angle = SkyCells::solid_angle(sky, j);
            total += angle * value(i, j);
            // What emits light within a texel comes from its neighbours, too.
            let near: f64 = (-1..2).flat_map(|dj| (-1..2).map(move |di| (di, dj))).map(|(di, dj)| value(i + di, j + dj)).sum();
            below += angle * near;
            cumulative.push(below);
        }
        cumulative.iter_mut().for_each(|share| *share /= below.max(f64::MIN_POSITIVE));
        SkyCells { sky, cumulative, total }
    }

    fn solid_angle(sky: &Sky, row: i64) -> f64 {
        let edge = |row: i64| (PI * row as f64 / f64::from(sky.texture.height)).cos();
        2.0 * PI / f64::from(sky.texture.width) * (edge(row) - edge(row + 1))
    }

    fn density_of(&self, cell: usize) -> f64 {
        let share = self.cumulative[cell] - if cell > 0 { self.cumulative[cell - 1] } else { 0.0 };
        share / SkyCells::solid_angle(self.sky, cell as i64 / i64::from(self.sky.texture.width))
    }

    fn sample(&self, ns: DVec3, rng: &mut Random) -> DVec3 {
        if uniform(rng) < 0.5 {
            return sample_lobe(ns, 1.0, rng);
        }
        let u = uniform(rng);
        let cell = self.cumulative.partition_point(|share| *share <= u).min(self.cumulative.len() - 1);
        let (width, height) = (self.sky.texture.width as usize, f64::from(self.sky.texture.height));
        let edge = |row: usize| (PI * row as f64 / height).cos();
        let row = cell / width;
        let cosine = edge(row) + uniform(rng) * (edge(row + 1) - edge(row));
        let azimuth = 2.0 * PI * (((cell % width) as f64 + uniform(rng)) / width as f64 - 0.5);
        let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
        self.sky.turn * DVec3::new(sine * azimuth.cos(), cosine, sine * azimuth.sin())
    }

    fn density(&self, ns: DVec3, wi: DVec3) -> f64 {
        let local = self.sky.turn.inverse() * wi;
        let (width, height) = (self.sky.texture.width as usize, self.sky.texture.height as usize);
        let place = |share: f64, count: usize| ((share * count as f64).max(0.0) as usize).min(count - 1);
        let column = place(0.5 + local.z.atan2(local.x) / (2.0 * PI), width);
        let row = place(local.y.clamp(-1.0, 1.0).acos() / PI, height);
        0.5 * self.density_of(row * width + column) + 0.5 * wi.dot(ns).max(0.0) / PI
    }
}

/// The last place where a path was scattered, as far as it matters to the light that its ray meets.
#[derive(Clone, Copy)]
pub(crate) struct Scattering {
    pub position: DVec3,
    /// Of the lobe's cosine.
    pub axis: DVec3,
    /// Of the ray's direction, per solid angle: infinite for deltas and for the eye, where no light is sampled; 0 where all
    /// light is sampled.
    pub density: f64,
}

impl Scattering {
    /// The weight of light that the ray meets, which would have been sampled with this density (balance heuristic, Veach and
    /// Guibas 1995).
    fn weight(&self, of_light: f64) -> f64 {
        if self.density.is_infinite() { 1.0 } else { self.density / (self.density + of_light).max(f64::MIN_POSITIVE) }
    }
}

/// What arrives at a point from one sampled place.
pub(crate) struct Arriving {
    /// Unit, towards the light.
    pub wi: DVec3,
    /// On a surface that faces the light, W/m2, over the density of the sample.
    pub irradiance: DVec3,
    /// The place; `None` beyond the scene.
    pub place: Option<DVec3>,
    /// Density of the direction per solid angle; infinite where no ray meets the light by chance.
    pub density: f64,
}

impl Arriving {
    /// Its weight where rays of this density may meet the light as well.
    pub(super) fn weight(&self, of_ray: f64) -> f64 {
        if self.density.is_infinite() { 1.0 } else { self.density / (self.density + of_ray) }
    }
}

fn sum(colour: Vec3) -> f64 {
    colour.as_dvec3().element_sum()
}

/// Watts, roughly for some; no estimate depends on it but by its noise.
fn power(light: &LightKind, scene_radius: f64, sky: Option<&SkyCells>) -> f64 {
    let cross_section = PI * scene_radius * scene_radius;
    match light {
        LightKind::Point { intensity, .. } => 4.0 * PI * sum(*intensity),
        LightKind::Spot { intensity, outer_angle, .. } => 2.0 * PI * versine(*outer_angle) * sum(*intensity),
        LightKind::Directional { irradiance, .. } => cross_section * sum(*irradiance),
        LightKind::Disc { power, .. } => sum(*power),
        LightKind::Environment { radiance } => 4.0 * PI * cross_section * sum(*radiance),
        LightKind::Sky(_) => cross_section * sky.map_or(0.0, |sky| sky.total),
    }
}

/// 1 - cosine of an angle, of which small ones keep their digits.
fn versine(angle: f32) -> f64 {
    2.0 * (0.5 * f64::from(angle)).sin().powi(2)
}

/// glTF's falloff between the cones, in a direction from the light.
fn spot_falloff(direction: DVec3, axis: DVec3, inner_angle: f32, outer_angle: f32) -> f64 {
    let (inner, outer) = (versine(inner_angle), versine(outer_angle));
    let off = 0.5 * direction.distance_squared(axis);
    if off <= inner { 1.0 } else { ((outer - off) / (outer - inner)).max(0.0).powi(2) }
}

/// A disc's radiant intensity over its power in a direction at this cosine to its normal, 1/sr.
fn disc_intensity(law: EmissionLaw, cosine: f64) -> f64 {
    match law {
        EmissionLaw::Cosine => cosine.max(0.0) / PI,
        EmissionLaw::Uniform => 0.5 / PI * f64::from(cosine > 0.0),
    }
}

impl<'a> Emitters<'a> {
    pub(super) fn new(scene: &'a Scene, geometry: &Geometry<'a>) -> Emitters<'a> {
        let (min, max) = scene.bounds();
        let radius = if geometry.triangles.is_empty() { 1.0 } else { 0.5 * (max - min).length() };
        let of_triangles = geometry.triangles.iter().enumerate().map(|(number, triangle)| {
            let material = triangle.material;
            let sides = if material.has_two_sides() { 2.0 } else { 1.0 };
            let emission = if material.layers.is_unlit { 0.0 } else { sum(material.emission) };
            (Emitter::Triangle(number), sides * PI * triangle.area * emission)
        });
        let sky = scene.lights.iter().find_map(|light| if let LightKind::Sky(sky) = &light.kind { Some(SkyCells::new(sky)) } else { None });
        let of_lights = scene.lights.iter().map(|light| (Emitter::Light(&light.kind), power(&light.kind, radius, sky.as_ref())));
        let (emitters, powers): (Vec<_>, Vec<_>) = of_triangles.chain(of_lights).filter(|(_, power)| *power > 0.0).unzip();
        let total: f64 = powers.iter().sum();
        let mut of_triangles = vec![0.0; geometry.triangles.len()];
        for (emitter, power) in emitters.iter().zip(&powers) {
            if let Emitter::Triangle(number) = emitter {
                of_triangles[*number] = power / total;
            }
        }
        let mut below = 0.0;
        let cumulative = powers.iter().map(|power| {
            below += power / total;
            below
        });
        Emitters { cumulative: cumulative.collect(), emitters, of_triangles, sky }
    }

    fn probability(&self, emitter: usize) -> f64 {
        self.cumulative[emitter] - if emitter > 0 { self.cumulative[emitter - 1] } else { 0.0 }
    }

    /// Light straight from one emitter, chosen by power, at a point with this shading normal. `None`
    /// where nothing can arrive. What lies between is not looked at.
    pub(super) fn sample(&self, geometry: &Geometry, position: DVec3, ns: DVec3, rng: &mut Random) -> Option<Arriving> {
        let last = self.emitters.len().checked_sub(1)?;
        let u = uniform(rng);
        // The last sum may round to less than 1.
        let choice = self.cumulative.partition_point(|share| *share <= u).min(last);
        let probability = self.probability(choice);
        let from = |place: DVec3, intensity: &dyn Fn(DVec3) -> DVec3| {
            let (wi, distance) = (place - position).normalize_and_length();
            Arriving { wi, irradiance: intensity(-wi) / (distance * distance), place: Some(place), density: f64::INFINITY }
        };
        let mut arriving = match self.emitters[choice] {
            Emitter::Triangle(number) => {
                let triangle = &geometry.triangles[number];
                let (root, share) = (uniform(rng).sqrt(), uniform(rng));
                let weights = DVec3::new(1.0 - root, root * (1.0 - share), root * share);
                let point = triangle.point(weights);
                let is_front = (position - point).dot(triangle.normal) > 0.0;
                if !is_front && !triangle.material.has_two_sides() {
                    return None;
                }
                let normal = if is_front { triangle.normal } else { -triangle.normal };
                let radiance = geometry.coverage(triangle, weights) * geometry.emission(triangle, weights);
                let arriving = from(point + geometry.offset * normal, &|w| radiance * triangle.area * w.dot(normal).max(0.0));
                Arriving { density: area_density(triangle.area, position, point, normal), ..arriving }
            }
            Emitter::Light(light) => match light {
                LightKind::Point { position: place, intensity } => from(*place, &|_| intensity.as_dvec3()),
                LightKind::Spot { position: place, direction, intensity, inner_angle, outer_angle } => {
                    from(*place, &|w| intensity.as_dvec3() * spot_falloff(w, *direction, *inner_angle, *outer_angle))
                }
                LightKind::Directional { direction, irradiance } => {
                    Arriving { wi: -*direction, irradiance: irradiance.as_dvec3(), place: None, density: f64::INFINITY }
                }
                LightKind::Disc { centre, normal, radius, power, law } => {
                    let (distance, azimuth) = (radius * uniform(rng).sqrt(), 2.0 * PI * uniform(rng));
                    let place = centre + around(*normal, DVec3::new(distance * azimuth.cos(), distance * azimuth.sin(), geometry.offset));
                    let arriving = from(place, &|w| power.as_dvec3() * disc_intensity(*law, w.dot(*normal)));
                    Arriving { density: area_density(PI * radius * radius, position, place, *normal), ..arriving }
                }
                LightKind::Sky(sky) => {
                    let cells = self.sky.as_ref()?;
                    let wi = cells.sample(ns, rng);
                    let density = cells.density(ns, wi).max(f64::MIN_POSITIVE);
                    Arriving { wi, irradiance: sky.radiance(wi) / density, place: None, density }
                }
                LightKind::Environment { radiance } => {
                    let wi = sample_lobe(ns, 1.0, rng);
                    let cosine = wi.dot(ns);
                    Arriving { wi, irradiance: PI / cosine * radiance.as_dvec3(), place: None, density: cosine / PI }
                }
            },
        };
        arriving.irradiance /= probability;
        arriving.density *= probability;
        Some(arriving)
    }

    /// The weight of emission that a ray meets on a triangle.
    pub(super) fn weight_of_triangle(&self, geometry: &Geometry, hit: &Hit, from: &Scattering) -> f64 {
        let triangle = &geometry.triangles[hit.triangle];
        let point = triangle.point(hit.weights);
        from.weight(self.of_triangles[hit.triangle] * area_density(triangle.area, from.position, point, triangle.normal))
    }

    /// Radiance that arrives from beyond the scene, with its weights.
    pub(super) fn environment(&self, direction: DVec3, from: &Scattering) -> DVec3 {
        let radiance = |(number, emitter): (usize, &Emitter)| match emitter {
            Emitter::Light(LightKind::Environment { radiance }) => {
                let density = direction.dot(from.axis).max(0.0) / PI;
                from.weight(self.probability(number) * density) * radiance.as_dvec3()
            }
            Emitter::Light(LightKind::Sky(sky)) => {
                let density = self.sky.as_ref().map_or(0.0, |cells| cells.density(from.axis, direction));
                from.weight(self.probability(number) * density) * sky.radiance(direction)
            }
            _ => DVec3::ZERO,
        };
        self.emitters.iter().enumerate().map(radiance).sum()
    }

    /// Radiance of all discs whose front a ray crosses before `t_max`, with its weights and what is left of it after its way.
    pub(super) fn discs_along(&self, geometry: &Geometry, ray: &Ray, t_max: f64, from: &Scattering, left: impl Fn(f64) -> DVec3) -> DVec3 {
        let radiance = |(number, emitter): (usize, &Emitter)| {
            let Emitter::Light(LightKind::Disc { centre, normal, radius, power, law }) = emitter else { return DVec3::ZERO };
            // A hair in front of the wall that it may lie in.
            let centre = centre + geometry.offset * normal;
            let cosine = -ray.direction.dot(*normal);
            let t = (ray.origin - centre).dot(*normal) / cosine;
            let crosses = cosine > 0.0 && t > 0.0 && t < t_max;
            let (place, area) = (ray.origin + t * ray.direction, PI * radius * radius);
            if crosses && place.distance(centre) <= *radius {
                let weight = from.weight(self.probability(number) * area_density(area, from.position, place, *normal));
                weight * left(t) * power.as_dvec3() * disc_intensity(*law, cosine) / (cosine * area)
            } else {
                DVec3::ZERO
            }
        };
        self.emitters.iter().enumerate().map(radiance).sum()
    }
}

/// Density per solid angle, as `from` sees it, of a place that is even over an area with this normal.
fn area_density(area: f64, from: DVec3, place: DVec3, normal: DVec3) -> f64 {
    let to = place - from;
    to.length().powi(3) / (area * to.dot(normal).abs()).max(f64::MIN_POSITIVE)
}
