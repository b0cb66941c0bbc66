//! Solids whose index of refraction differs from colour to colour: prisms and balls against closed forms, by rays from the eye and by
//! photons.

use super::media::solid;
use crate::common::layered::without_maps;
use crate::common::prelude::*;
use crate::common::{colour_check, estimate_check};
use photonmill::scene::material::Layers;
use photonmill::verify::judge::fresnel;

/// Of glass with an Abbe number of 5, which no real one has: effects are large.
const IOR: f32 = 1.6;
const DISPERSION: f32 = 4.0;

/// For red, green and blue (KHR_materials_dispersion): half of (n - 1) / V less and more.
fn indices() -> [f64; 3] {
    let half = 0.5 * (f64::from(IOR) - 1.0) / 5.0;
    [-1.0, 0.0, 1.0].map(|step| f64::from(IOR) + step * half)
}

fn dispersive(transmittance: Vec3) -> Material {
    let glass = solid("glass", IOR, transmittance);
    Material { layers: Layers { dispersion: DISPERSION, ..glass.layers }, ..glass }
}

/// Its edge lies along z in the origin, its base below; two faces of a metre. Light comes from the left, at this angle to the normal.
struct Prism {
    half: f64,
    incidence: f64,
}

/// What becomes of a ray of one colour.
struct Passed {
    /// Where it leaves, and its direction then.
    at: DVec3,
    along: DVec3,
    /// Angle to the normal of the right face.
    leaving: f64,
    transmitted: f64,
    way: f64,
}

const PRISM: Prism = Prism { half: PI / 6.0, incidence: 0.95 };

impl Prism {
    fn normals(&self) -> [DVec3; 2] {
        let (sin, cos) = self.half.sin_cos();
        [DVec3::new(-cos, sin, 0.0), DVec3::new(cos, sin, 0.0)]
    }

    /// Of light that comes in.
    fn direction(&self) -> DVec3 {
        let (sin, cos) = self.half.sin_cos();
        -self.incidence.cos() * self.normals()[0] + self.incidence.sin() * DVec3::new(sin, cos, 0.0)
    }

    /// On the left face, so far from the edge.
    fn entry(&self, off: f64) -> DVec3 {
        -off * DVec3::new(self.half.sin(), self.half.cos(), 0.0)
    }

    /// Snell's law at both faces: r = asin(sin i / n), e = asin(n sin(A - r)).
    fn pass(&self, off: f64, ior: f64) -> Passed {
        let (sin, cos) = self.half.sin_cos();
        let [left, right] = self.normals();
        let inside = (self.incidence.sin() / ior).asin();
        let refracted = -inside.cos() * left + inside.sin() * DVec3::new(sin, cos, 0.0);
        let within = 2.0 * self.half - inside;
        let leaving = (ior * within.sin()).asin();
        let entry = self.entry(off);
        let way = -entry.dot(right) / refracted.dot(right);
        let along = leaving.cos() * right + leaving.sin() * DVec3::new(sin, -cos, 0.0);
        let transmitted = (1.0 - fresnel(self.incidence.cos(), 1.0, ior)) * (1.0 - fresnel(leaving.cos(), 1.0, ior));
        Passed { at: entry + way * refracted, along, leaving, transmitted, way }
    }

    /// Its base is black, so that nothing goes on that is reflected inside. The first material is the glass, the second is black.
    fn meshes(&self, depth: f64) -> Vec<Mesh> {
        let (sin, cos) = self.half.sin_cos();
        let (edge, z) = (DVec3::NEG_Z * 0.5 * depth, DVec3::Z * depth);
        let (to_left, to_right) = (DVec3::new(-sin, -cos, 0.0), DVec3::new(sin, -cos, 0.0));
        let side = |name: &str, u, v| Mesh::parallelogram(name, edge, u, v, 0);
        let base = Mesh::parallelogram("base", edge + to_left, DVec3::X * 2.0 * sin, z, 1);
        vec![side("left", to_left, z), side("right", z, to_right), base]
    }
}

/// A screen across the x axis there, that shows a height from `low` to `high` as a share of white.
fn scale(at: f64, [low, high]: [f64; 2], material: usize) -> Mesh {
    let corner = DVec3::new(at, low, -2.0);
    let mut screen = Mesh::parallelogram("scale", corner, DVec3::Z * 4.0, DVec3::Y * (high - low), material);
    screen.colours = screen.positions.iter().map(|place| DVec3::splat((place.y - low) / (high - low))).collect();
    screen
}

fn unlit() -> Material {
    Material { two_sided: true, ..Material::layered("scale", Vec3::ONE, Layers { is_unlit: true, ..Layers::default() }) }
}

/// Of the ray from an eye: means and errors of what is seen of a white screen, and at which height each colour sees it.
fn heights_seen(gpu: &Gpu, meshes: &[Mesh], materials: Vec<Material>, [eye, target]: [DVec3; 2], screen: Mesh) -> [(f64, f64, f64); 3] {
    let settings = without_maps(SceneSettings { rounds: 16, samples: 16, ..by_rounds() });
    let see = |screen: Mesh| {
        // So little that it counts for nothing: other questions have lights, and so the same kernels.
        let sky = LightKind::Environment { radiance: Vec3::splat(1e-9) };
        let scene = scene_of([meshes, &[screen]].concat(), materials.clone(), vec![sky]);
        let camera = Camera::looking_at("ray", eye, target, DVec3::Z, 1e-5);
        means(&seen(gpu, &scene, &settings, &camera, [16, 16]))
    };
    let white = see(Mesh { colours: vec![DVec3::ONE; 4], ..screen.clone() });
    // The same paths.
    let scaled = see(screen.clone());
    let (low, high) = (screen.positions[0].y, screen.positions[2].y);
    let ((mean, error), (share, _)) = (mean_of_all(&white), mean_of_all(&scaled));
    [0, 1, 2].map(|channel| (mean[channel], error[channel], low + (high - low) * share[channel] / mean[channel]))
}

pub fn prism_check(gpu: &Gpu, transmittance: f32) -> Check<Complaint> {
    let (off, at) = (0.4, 3.0);
    let materials = vec![dispersive(Vec3::splat(transmittance)), matt(0.0), unlit()];
    let entry = PRISM.entry(off);
    let expected = indices().map(|ior| {
        let passed = PRISM.pass(off, ior);
        let height = passed.at.y + (at - passed.at.x) * passed.along.y / passed.along.x;
        (passed.transmitted * f64::from(transmittance).powf(passed.way), height)
    });
    let range = [expected[2].1 - 0.3, expected[0].1 + 0.3];
    let rays = [entry - 2.0 * PRISM.direction(), entry];
    let found = heights_seen(gpu, &PRISM.meshes(2.0), materials, rays, scale(at, range, 2));
    for (channel, ((mean, error, height), (transmitted, of_height))) in pairs(found, expected).enumerate() {
        println!("prism, channel {channel}: {mean} +- {error} at {height}, {transmitted} at {of_height} expected");
        estimate_check(&format!("light through a prism, channel {channel}"), mean, transmitted, error)?;
        estimate_check(&format!("where a prism shows, channel {channel}"), height, of_height, 5e-5)?;
    }
    Ok(())
}

/// What is seen through a prism is deviated by i + e - A, for each colour by its own index; absorption follows the way of that colour.
#[test]
fn a_prism_deviates_each_colour_by_its_index() {
    let Some(gpu) = device() else { return };
    assert_holds("a prism", prism_check(&gpu, 0.3));
}

/// A ray beside the axis crosses it behind a ball of radius 1 at h / sin(2 (i - r)), sin i = h and sin r = h / n.
///
/// In the short run `a_prism_deviates_each_colour_by_its_index` has an index for each colour.
#[test]
#[ignore = "long: minutes on a software device"]
fn a_ball_has_a_focal_length_for_each_colour_and_height() {
    let Some(gpu) = device() else { return };
    let at = 3.0;
    let ball = Mesh::sphere("ball", DVec3::ZERO, 1.0, 256, 0);
    for height in [0.05, 0.4] {
        let rays = [DVec3::new(-9.0, height, 0.0), DVec3::new(0.0, height, 0.0)];
        let materials = vec![dispersive(Vec3::ONE), unlit()];
        let deviation = |ior: f64| 2.0 * (f64::asin(height) - (height / ior).asin());
        let [most, _, least] = indices().map(|ior| (height - at * deviation(ior).sin()) / deviation(ior).cos());
        // What is reflected inside leaves it elsewhere.
        let found = heights_seen(&gpu, std::slice::from_ref(&ball), materials, rays, scale(at, [least - 0.1, most + 0.1], 1));
        for (channel, ((_, _, seen), ior)) in pairs(found, indices()).enumerate() {
            // x sin d + y cos d = h holds along what leaves.
            let focus = height / ((height / at.hypot(seen)).asin() - seen.atan2(at)).sin();
            let expected = height / deviation(ior).sin();
            println!("ball, channel {channel}, {height} beside the axis: {focus}, {expected} expected");
            assert_holds("focus", relative_check("focal length", focus, expected, 1e-3));
        }
    }
}

/// Sunlight that a prism sends to a floor of its own for each colour: next to the edge's image red arrives alone, then green, too.
pub fn prism_photons(gpu: &Gpu) -> Check<Complaint> {
    let at = 2.0;
    let mut meshes = PRISM.meshes(6.0);
    meshes.push(Mesh::parallelogram("screen", DVec3::new(at, -4.0, -3.0), DVec3::Z * 6.0, DVec3::Y * 4.0, 1));
    let materials = vec![dispersive(Vec3::ONE), matt(0.0)];
    let scene = scene_of(meshes, materials, vec![sun(PRISM.direction())]);
    let passed = indices().map(|ior| PRISM.pass(0.0, ior));
    let edges = passed.each_ref().map(|of| at * of.along.y / of.along.x);
    println!("images of the edge at {edges:?}");
    let heights = [edges[0] + 0.1, 0.5 * (edges[0] + edges[1]), 0.5 * (edges[1] + edges[2]), edges[2] - 0.1]
        .map(|y| (DVec3::new(at, y, 0.0), DVec3::NEG_X));
    let settings = SceneSettings { part: Part::Caustic, caustic_photons: 150_000, caustic_radius: Some(0.07), alpha: 1.0, ..by_rounds() };
    let result = received(gpu, &scene, &settings, &heights);
    // The beam's width is that of the face, times the cosines on either side.
    let irradiance = passed.map(|of| of.transmitted * PRISM.incidence.cos() / of.leaving.cos() * of.along.x);
    for (place, (found, error)) in pairs(means(&result), standard_errors(&result)).enumerate() {
        let expected = DVec3::from_array([0, 1, 2].map(|channel| if place > channel { irradiance[channel] } else { 0.0 }));
        println!("point {place}: {found} +- {error}, {expected} expected");
        colour_check(&format!("photons of a prism, point {place}"), found, expected, error.max(DVec3::splat(1e-6)))?;
    }
    Ok(())
}

/// What has no dispersion has the same bits beside what has: its kernels have more code, and no photon chooses a colour, nor any path
/// from the eye.
#[test]
#[ignore = "long: minutes on a software device"]
fn glass_without_dispersion_keeps_its_bits() {
    let Some(gpu) = device() else { return };
    let clear = Material { layers: Layers { dispersion: 0.0, ..dispersive(Vec3::ONE).layers }, ..dispersive(Vec3::ONE) };
    let meshes = vec![Mesh::sphere("ball", DVec3::Y * 0.5, 0.4, 16, 0), level(0.0, [2.0; 2], true, 1)];
    let scene = scene_of(meshes, vec![clear, matt(0.5)], vec![LightKind::Environment { radiance: Vec3::ONE }]);
    let camera = Camera::looking_at("eye", DVec3::new(0.0, 1.0, 3.0), DVec3::Y * 0.4, DVec3::Y, 0.6);
    let sums = [vec![], vec![Effect::Dispersion]].map(|with| {
        let settings = SceneSettings { with, ..mapped(5000, 2, 8, 0.2) };
        [received(&gpu, &scene, &settings, &grid(0.0, DVec3::Y, 4)), seen(&gpu, &scene, &settings, &camera, [16, 16])]
            .map(|result| result.film.sums.clone())
    });
    assert!(sums[0].iter().all(|sums| sums.iter().any(|sum| *sum > 0)));
    assert_eq!(sums[0], sums[1]);
}
