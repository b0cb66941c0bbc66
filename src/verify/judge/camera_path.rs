//! Camera paths.

use std::f64::consts::PI;

use glam::DVec3;

use super::geometry::{Hit, Ray, Vertex};
use super::light::{Arriving, Scattering};
use super::lobes::Class;
use super::material::sample_lobe;
use super::media::{Media, is_solid};
use super::{Judge, Part, Parts, Random, uniform};
use crate::scene::{Material, Surface};

/// Bounces before Russian roulette begins, and the most that survive one.
const FREE_BOUNCES: u32 = 4;
const MAX_SURVIVAL: f64 = 0.95;

/// What lies between the eye and the start of a ray.
struct Prefix<'a> {
    /// Share of the radiance along the ray that reaches the eye.
    beta: DVec3,
    /// A sharp lobe comes before the first rough one.
    saw_sharp: bool,
    /// A sharp lobe comes after it.
    is_caustic: bool,
    rough_count: u32,
    /// Some lobe was no delta: discs are seen from then on.
    was_spread: bool,
    last: Scattering,
    media: Media<'a>,
    /// The only one with light, once colours have parted.
    channel: Option<usize>,
}

impl Prefix<'_> {
    /// Where light belongs that the ray meets, or that is sampled where it starts.
    fn part(&self) -> Part {
        match self.rough_count {
            _ if self.saw_sharp => Part::Specular,
            0 => Part::Direct,
            1 if self.is_caustic => Part::Caustic,
            1 => Part::Direct,
            _ => Part::Indirect,
        }
    }

    /// No rough lobe lies between it and the eye.
    fn is_seen(&self) -> bool {
        self.rough_count == 0
    }

    fn add(&mut self, class: Class) {
        match class {
            Class::Passing => {}
            Class::Sharp if self.rough_count == 0 => self.saw_sharp = true,
            Class::Sharp => self.is_caustic = true,
            Class::Rough => self.rough_count += 1,
        }
    }

    /// Colours part, and each has a chance of a third.
    fn keep_channel(&mut self, channel: usize) {
        self.beta *= 3.0 * DVec3::AXES[channel];
        self.channel = Some(channel);
    }

    /// Goes on where the ray meets a surface, into a direction with this weight and density. Whether it survives roulette.
    fn scattered(&mut self, vertex: &Vertex, weight: DVec3, density: f64, axis: DVec3, bounce: u32, rng: &mut Random) -> bool {
        self.beta *= weight;
        self.last = Scattering { position: vertex.position, axis, density };
        if bounce < FREE_BOUNCES {
            return true;
        }
        let survival = self.beta.max_element().min(MAX_SURVIVAL);
        let survives = uniform(rng) < survival;
        self.beta /= survival;
        survives
    }
}

impl<'a> Judge<'a> {
    /// One sample of the radiance that arrives along a ray, W/m2/sr.
    pub(crate) fn radiance(&self, origin: DVec3, direction: DVec3, rng: &mut Random) -> Parts {
        let last = Scattering { position: origin, axis: direction, density: f64::INFINITY };
        let prefix = self.start(origin, last, 0);
        self.follow(Ray { origin, direction }, prefix, rng)
    }

    /// One sample of the irradiance at a point, on the side of its unit normal, W/m2.
    pub(crate) fn irradiance(&self, point: DVec3, normal: DVec3, rng: &mut Random) -> Parts {
        let prefix = self.start(point + self.geometry.offset * normal, Scattering { position: point, axis: normal, density: 0.0 }, 1);
        let direct = self.direct_light(&prefix, (point, normal), normal, |_| (DVec3::ONE, 0.0), rng);
        let ray = self.geometry.leaving(point, normal, sample_lobe(normal, 1.0, rng));
        let parts = self.follow(ray, prefix, rng);
        Parts { direct, specular: DVec3::ZERO, caustic: PI * parts.caustic, indirect: PI * parts.indirect }
    }

    fn start(&self, position: DVec3, last: Scattering, rough_count: u32) -> Prefix<'a> {
        let media = if self.has_solids { Media::around(&self.geometry, self.by_size.clone(), position) } else { Media::default() };
        Prefix {
            beta: DVec3::ONE,
            saw_sharp: false,
            is_caustic: false,
            rough_count,
            was_spread: rough_count > 0,
            last,
            media,
            channel: None,
        }
    }

    fn follow(&self, mut ray: Ray, mut prefix: Prefix<'a>, rng: &mut Random) -> Parts {
        let mut parts = Parts::default();
        let mut bounce = 0;
        loop {
            let hit = self.geometry.closest_hit(&ray, f64::INFINITY);
            let way = hit.map_or(f64::INFINITY, |hit| hit.t);
            if prefix.was_spread {
                let left = |metres| prefix.media.transmittance(metres);
                parts[prefix.part()] += prefix.beta * self.emitters.discs_along(&self.geometry, &ray, way, &prefix.last, left);
            }
            prefix.beta *= prefix.media.transmittance(way);
            let Some(hit) = hit else {
                parts[prefix.part()] += prefix.beta * self.emitters.environment(ray.direction, &prefix.last);
                break;
            };
            let vertex = self.geometry.vertex(&hit, -ray.direction);
            let is_layered = vertex.surface == Surface::Layered;
            if is_layered && self.is_gap(&hit, &vertex, prefix.is_seen(), rng) {
                ray = self.geometry.leaving(vertex.position, vertex.ng, ray.direction);
                continue;
            }
            if is_layered && self.material(&hit).layers.is_unlit {
                if prefix.is_seen() {
                    parts[prefix.part()] += prefix.beta * vertex.base_colour;
                }
                break;
            }
            if vertex.emission != DVec3::ZERO {
                let weight = self.emitters.weight_of_triangle(&self.geometry, &hit, &prefix.last);
                parts[prefix.part()] += weight * prefix.beta * vertex.emission;
            }
            if !vertex.scatters {
                break;
            }
            let next = if is_layered {
                self.pass_lobe(&hit, &vertex, &mut prefix, &mut bounce, &mut parts, rng)
            } else {
                self.pass_surface(&vertex, &mut prefix, &mut bounce, &mut parts, rng)
            };
            let Some(wi) = next else { break };
            ray = self.geometry.leaving(vertex.position, vertex.ng, wi);
        }
        parts
    }

    fn material(&self, hit: &Hit) -> &'a Material {
        self.geometry.triangles[hit.triangle].material
    }

    /// Whether a path goes on as if a layered surface were not there: by chance, or at backs that an eye does not see.
    fn is_gap(&self, hit: &Hit, vertex: &Vertex, is_seen: bool, rng: &mut Random) -> bool {
        if is_seen && !vertex.scatters {
            return true;
        }
        let coverage = self.geometry.coverage(&self.geometry.triangles[hit.triangle], hit.weights);
        coverage < 1.0 && uniform(rng) >= coverage
    }

    /// Light at a surface that is not layered, and where the path goes on.
    fn pass_surface(
        &self,
        vertex: &Vertex,
        prefix: &mut Prefix<'a>,
        bounce: &mut u32,
        parts: &mut Parts,
        rng: &mut Random,
    ) -> Option<DVec3> {
        if *bounce >= self.max_bounces {
            return None;
        }
        let towards_eye = prefix.is_seen();
        let is_specular = vertex.surface.is_specular();
        prefix.add(if is_specular { Class::Sharp } else { Class::Rough });
        if !is_specular {
            prefix.was_spread = true;
            let brdf = |wi| (vertex.brdf(wi, towards_eye), 0.0);
            let light = self.direct_light(prefix, (vertex.position, vertex.ng), vertex.ns, brdf, rng);
            parts[prefix.part()] += prefix.beta * light;
        }
        let (wi, weight) = vertex.scatter(*bounce, towards_eye, rng)?;
        let density = if is_specular { f64::INFINITY } else { 0.0 };
        let survives = prefix.scattered(vertex, weight, density, vertex.ns, *bounce, rng);
        *bounce += 1;
        survives.then_some(wi)
    }

    /// Light of one lobe of a layered surface, and where the path goes on.
    fn pass_lobe(
        &self,
        hit: &Hit,
        vertex: &Vertex,
        prefix: &mut Prefix<'a>,
        bounce: &mut u32,
        parts: &mut Parts,
        rng: &mut Random,
    ) -> Option<DVec3> {
        let material = self.material(hit);
        if prefix.channel.is_none() && is_solid(material) {
            let before = prefix.media.clone().before(material, vertex.is_front);
            if before.is_dispersive() || before.beyond(material, vertex.is_front).is_dispersive() {
                prefix.keep_channel(((3.0 * uniform(rng)) as usize).min(2));
            }
        }
        let lobes = self.geometry.lobes(hit, vertex, &prefix.media, prefix.channel, *bounce);
        let (kind, chance) = lobes.choose(rng)?;
        let class = lobes.class(kind);
        if class == Class::Passing {
            prefix.beta *= lobes.passed() / chance;
            return Some(-vertex.wo);
        }
        if *bounce >= self.max_bounces {
            return None;
        }
        prefix.beta /= chance;
        prefix.add(class);
        if is_solid(material) {
            let media = std::mem::take(&mut prefix.media).before(material, vertex.is_front);
            prefix.media = if kind.is_beyond() { media.beyond(material, vertex.is_front) } else { media };
        }
        let axis = lobes.axis(kind);
        if !lobes.is_delta(kind) {
            prefix.was_spread = true;
            let ng = if kind.is_beyond() { -vertex.ng } else { vertex.ng };
            let bsdf = |wi| (lobes.evaluate(kind, wi), lobes.density(kind, wi));
            let light = self.direct_light(prefix, (vertex.position, ng), axis, bsdf, rng);
            parts[prefix.part()] += prefix.beta * light;
        }
        let scattered = lobes.sample(kind, rng)?;
        let survives = prefix.scattered(vertex, scattered.weight, scattered.density, axis, *bounce, rng);
        *bounce += 1;
        survives.then_some(scattered.wi)
    }

    /// One sample of what arrives straight from the lights on the side of a point's normal, times the BSDF and the cosine to
    /// `axis`. `bsdf` has also the density of the rays that may meet the same light.
    fn direct_light(
        &self,
        prefix: &Prefix<'a>,
        (position, normal): (DVec3, DVec3),
        axis: DVec3,
        bsdf: impl Fn(DVec3) -> (DVec3, f64),
        rng: &mut Random,
    ) -> DVec3 {
        let Some(light) = self.emitters.sample(&self.geometry, position, axis, rng) else { return DVec3::ZERO };
        let cosine = light.wi.dot(axis);
        if cosine <= 0.0 || light.wi.dot(normal) <= 0.0 {
            return DVec3::ZERO;
        }
        let (value, density) = bsdf(light.wi);
        if value == DVec3::ZERO {
            return DVec3::ZERO;
        }
        cosine * light.weight(density) * light.irradiance * value * self.passed(prefix, position, normal, &light)
    }

    /// The share of light that reaches a point from its place: alpha and thin smooth walls let some through.
    fn passed(&self, prefix: &Prefix<'a>, position: DVec3, normal: DVec3, light: &Arriving) -> DVec3 {
        let start = self.geometry.leaving(position, normal, light.wi);
        let mut left = prefix.media.transmittance(light.place.map_or(f64::INFINITY, |place| place.distance(position)));
        let mut origin = start.origin;
        loop {
            // Up to its place a ray towards a light has t from 0 to 1.
            let (ray, t_max) = match light.place {
                Some(place) => (Ray { origin, direction: place - origin }, 1.0),
                None => (Ray { origin, direction: light.wi }, f64::INFINITY),
            };
            let Some(hit) = self.geometry.closest_hit(&ray, t_max) else { return left };
            left *= self.passed_surface(prefix, &hit, -light.wi);
            if left == DVec3::ZERO {
                return left;
            }
            let triangle = &self.geometry.triangles[hit.triangle];
            origin = self.geometry.leaving(triangle.point(hit.weights), triangle.normal, light.wi).origin;
        }
    }

    fn passed_surface(&self, prefix: &Prefix<'a>, hit: &Hit, wo: DVec3) -> DVec3 {
        let triangle = &self.geometry.triangles[hit.triangle];
        if triangle.material.surface != Surface::Layered {
            return DVec3::ZERO;
        }
        let vertex = self.geometry.vertex(hit, wo);
        if prefix.is_seen() && !vertex.scatters {
            return DVec3::ONE;
        }
        let coverage = self.geometry.coverage(triangle, hit.weights);
        let layers = &triangle.material.layers;
        let is_clear = layers.transmission > 0.0 && !is_solid(triangle.material) && !layers.is_unlit;
        let wall = if is_clear { self.geometry.lobes(hit, &vertex, &prefix.media, prefix.channel, 0).passed() } else { DVec3::ZERO };
        1.0 - coverage + coverage * wall
    }
}
