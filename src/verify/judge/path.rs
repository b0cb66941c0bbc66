//! Camera paths.

use std::f64::consts::PI;

use glam::DVec3;

use super::geometry::Ray;
use super::material::sample_lobe;
use super::{Judge, Part, Parts, Random, uniform};

/// Bounces before Russian roulette begins, and the most that survive one.
const FREE_BOUNCES: u32 = 4;
const MAX_SURVIVAL: f64 = 0.95;

/// What lies between the eye and the start of a ray.
struct Prefix {
    /// Share of the radiance along the ray that reaches the eye.
    beta: DVec3,
    /// A specular surface comes before the first one that is not.
    saw_specular: bool,
    /// Surfaces that are not specular.
    rough_count: u32,
    /// The ray leaves the eye or a specular surface: no light sampling has counted what shines there.
    counts_emission: bool,
}

impl Prefix {
    /// Where emission belongs that the ray meets.
    fn part_of_emission(&self) -> Part {
        match self.rough_count {
            _ if self.saw_specular => Part::Specular,
            0 => Part::Direct,
            1 => Part::Caustic,
            _ => Part::Indirect,
        }
    }

    /// Where light belongs that is sampled at the next surface, which is not specular.
    fn part_of_sampled_light(&self) -> Part {
        match self.rough_count {
            _ if self.saw_specular => Part::Specular,
            0 => Part::Direct,
            _ => Part::Indirect,
        }
    }
}

impl Judge<'_> {
    /// One sample of the radiance that arrives along a ray, W/m2/sr.
    pub fn radiance(&self, origin: DVec3, direction: DVec3, rng: &mut Random) -> Parts {
        let prefix = Prefix { beta: DVec3::ONE, saw_specular: false, rough_count: 0, counts_emission: true };
        self.follow(Ray { origin, direction }, prefix, rng)
    }

    /// One sample of the irradiance at a point, on the side of its unit normal, W/m2.
    pub fn irradiance(&self, point: DVec3, normal: DVec3, rng: &mut Random) -> Parts {
        let direct = self.direct_light(point, normal, normal, |_| DVec3::ONE, rng);
        let prefix = Prefix { beta: DVec3::ONE, saw_specular: false, rough_count: 1, counts_emission: false };
        let ray = self.geometry.leaving(point, normal, sample_lobe(normal, 1.0, rng));
        let parts = self.follow(ray, prefix, rng);
        Parts { direct, specular: DVec3::ZERO, caustic: PI * parts.caustic, indirect: PI * parts.indirect }
    }

    fn follow(&self, mut ray: Ray, mut prefix: Prefix, rng: &mut Random) -> Parts {
        let mut parts = Parts::default();
        for bounce in 0.. {
            let hit = self.geometry.closest_hit(&ray, f64::INFINITY);
            let emitted_to = prefix.part_of_emission();
            // Discs are seen by other surfaces, never by the eye.
            if prefix.counts_emission && prefix.rough_count > 0 {
                let t_max = hit.map_or(f64::INFINITY, |hit| hit.t);
                parts[emitted_to] += prefix.beta * self.emitters.discs_along(&self.geometry, &ray, t_max);
            }
            let Some(hit) = hit else {
                if prefix.counts_emission {
                    parts[emitted_to] += prefix.beta * self.emitters.environment();
                }
                break;
            };
            let vertex = self.geometry.vertex(&hit, -ray.direction);
            if prefix.counts_emission {
                parts[emitted_to] += prefix.beta * vertex.emission;
            }
            if bounce >= self.max_bounces || !vertex.scatters {
                break;
            }
            let towards_eye = prefix.rough_count == 0;
            prefix.counts_emission = vertex.surface.is_specular();
            if vertex.surface.is_specular() {
                prefix.saw_specular |= towards_eye;
            } else {
                let brdf = |wi| vertex.brdf(wi, towards_eye);
                let light = self.direct_light(vertex.position, vertex.ng, vertex.ns, brdf, rng);
                parts[prefix.part_of_sampled_light()] += prefix.beta * light;
                prefix.rough_count += 1;
            }
            let Some((wi, weight)) = vertex.scatter(bounce, towards_eye, rng) else { break };
            prefix.beta *= weight;
            if bounce >= FREE_BOUNCES {
                let survival = prefix.beta.max_element().min(MAX_SURVIVAL);
                if uniform(rng) >= survival {
                    break;
                }
                prefix.beta /= survival;
            }
            ray = self.geometry.leaving(vertex.position, vertex.ng, wi);
        }
        parts
    }

    /// One sample of what arrives straight from the lights on the side of `ng`, times `brdf` and the
    /// cosine to `ns`.
    fn direct_light(&self, position: DVec3, ng: DVec3, ns: DVec3, brdf: impl Fn(DVec3) -> DVec3, rng: &mut Random) -> DVec3 {
        let Some(light) = self.emitters.sample(&self.geometry, position, ns, rng) else { return DVec3::ZERO };
        let cosine = light.wi.dot(ns);
        if cosine <= 0.0 || light.wi.dot(ng) <= 0.0 {
            return DVec3::ZERO;
        }
        let start = self.geometry.leaving(position, ng, light.wi);
        // Up to its place a ray towards a light has t from 0 to 1.
        let (ray, t_max) = match light.place {
            Some(place) => (Ray { direction: place - start.origin, ..start }, 1.0),
            None => (start, f64::INFINITY),
        };
        if self.geometry.closest_hit(&ray, t_max).is_some() { DVec3::ZERO } else { cosine * light.irradiance * brdf(light.wi) }
    }
}
