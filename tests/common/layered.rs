//! Layered materials whose light is known, each as a question to a device: `tests/engine/planted_faults.rs` asks them of devices with
//! faults and without.

use super::plates::{COSINES, Place, Plates};
use super::prelude::*;
use super::{colour_check, estimate_check};
use photonmill::scene::material::{Coverage, Layers, Medium, NormalMap};
use photonmill::scene::texture::Filter;
use photonmill::verify::judge::lobes::{Film, Frame, Inputs, Kind as Lobe, Lobes, Wall};
use photonmill::verify::judge::{Random, random};

pub const LOBES: [Lobe; 6] = [Lobe::Diffuse, Lobe::Reflection, Lobe::Transmission, Lobe::Coat, Lobe::Sheen, Lobe::DiffuseTransmission];

pub const SHEEN: Vec3 = Vec3::new(0.2, 0.4, 0.9);

/// A dielectric that reflects nothing by itself: a Lambertian surface of this albedo, if no more is asked for.
pub fn dull(albedo: f32) -> Material {
    layered(Vec3::splat(albedo), &Layers { metallic: 0.0, specular: 0.0, ..Layers::default() })
}

pub fn layered(base_colour: Vec3, layers: &Layers) -> Material {
    Material::layered("plate", base_colour, *layers)
}

pub fn plastic(roughness: f32) -> Layers {
    Layers { metallic: 0.0, roughness, ..Layers::default() }
}

pub fn metal(roughness: f32) -> Layers {
    Layers { roughness, ..Layers::default() }
}

/// All of it under a film of so many nanometres.
pub fn film(film_ior: f32, nanometres: f32, layers: &Layers) -> Layers {
    Layers { iridescence: 1.0, film_ior, film_thickness: [0.0, nanometres], ..*layers }
}

/// What the path tracer makes of a material without textures, of which the front is seen.
pub fn inputs(material: &Material) -> Inputs {
    let of = &material.layers;
    let squared = |roughness: f32| f64::from(roughness).powi(2);
    let [share, ior, thickness] = [of.iridescence, of.film_ior, of.film_thickness[1]].map(f64::from);
    Inputs {
        base_colour: material.base_colour.as_dvec3(),
        metalness: f64::from(of.metallic),
        alpha: squared(of.roughness),
        stretch: None,
        ior: f64::from(of.ior),
        specular: f64::from(of.specular),
        specular_colour: of.specular_colour.as_dvec3(),
        transmission: f64::from(of.transmission),
        diffuse_transmission: f64::from(of.diffuse_transmission),
        diffuse_transmission_colour: of.diffuse_transmission_colour.as_dvec3(),
        film: Film { share, ior, thickness, bound: of.film_bound() },
        wall: of.medium.map_or(Wall::Thin, |_| Wall::Solid { from: 1.0, to: f64::from(of.ior) }),
        coat: f64::from(of.coat),
        coat_alpha: squared(of.coat_roughness),
        sheen_colour: of.sheen_colour.as_dvec3(),
        sheen_s: squared(of.sheen_roughness).max(0.01),
    }
}

/// Its lobes where a normal map, of the coat too, has turned the normal.
pub fn lobes_at(material: &Material, place: &Place, n: DVec3) -> Lobes {
    Lobes::new(&inputs(material), Frame { wo: place.wo, ng: place.normal, n, coat_n: n })
}

/// Radiance towards the eye under a sun of 1 W/m2 in this direction: each lobe times the cosine to its own normal.
pub fn in_the_sun(lobes: &Lobes, sun: DVec3) -> DVec3 {
    LOBES.into_iter().map(|kind| lobes.evaluate(kind, sun) * lobes.axis(kind).dot(sun).max(0.0)).sum()
}

/// Of each lobe alone, at several roughnesses, and of each pair of them.
pub fn mixtures() -> Vec<Material> {
    let base = Vec3::new(0.8, 0.5, 0.2);
    let sheen_colour = SHEEN;
    let of = [
        plastic(0.3),
        plastic(0.6),
        plastic(1.0),
        metal(0.2),
        metal(0.45),
        metal(0.7),
        metal(1.0),
        Layers { metallic: 0.5, ..plastic(0.4) },
        Layers { ior: 0.0, ..plastic(0.6) },
        Layers { ior: 2.0, specular: 0.7, specular_colour: Vec3::new(1.0, 3.0, 0.4), ..plastic(0.5) },
        Layers { coat: 1.0, coat_roughness: 0.3, ..metal(0.7) },
        Layers { coat: 0.8, coat_roughness: 0.6, ..plastic(0.4) },
        Layers { coat: 0.5, ..plastic(0.6) },
        Layers { sheen_colour, sheen_roughness: 0.3, ..plastic(0.8) },
        Layers { sheen_colour, sheen_roughness: 1.0, ..metal(0.4) },
        Layers { sheen_colour, sheen_roughness: 0.6, coat: 0.7, coat_roughness: 0.5, metallic: 0.3, ..plastic(0.5) },
        film(1.4, 380.0, &plastic(0.5)),
        Layers { iridescence: 0.8, ..film(1.9, 250.0, &metal(0.4)) },
        film(1.3, 500.0, &Layers { metallic: 0.4, coat: 0.6, coat_roughness: 0.5, ..plastic(0.8) }),
        Layers { iridescence: 0.7, transmission: 0.7, ..film(1.8, 300.0, &plastic(0.4)) },
        Layers { iridescence: 0.9, transmission: 0.9, medium: CLEAR, ..film(1.3, 400.0, &plastic(0.4)) },
        Layers { transmission: 0.6, ..plastic(0.5) },
        Layers { diffuse_transmission: 0.6, diffuse_transmission_colour: Vec3::new(0.3, 0.9, 0.6), ..plastic(0.5) },
        Layers { diffuse_transmission: 1.0, sheen_colour, sheen_roughness: 0.6, coat: 0.7, coat_roughness: 0.5, ..plastic(0.7) },
        Layers { transmission: 1.0, coat: 1.0, coat_roughness: 0.4, ..plastic(0.35) },
        Layers { transmission: 0.8, medium: CLEAR, ..plastic(0.4) },
        Layers { transmission: 1.0, medium: CLEAR, sheen_colour, sheen_roughness: 0.5, ior: 1.2, ..plastic(0.3) },
    ];
    of.map(|layers| layered(base, &layers)).to_vec()
}

/// Solids so rough that photon maps know what they reflect.
pub fn rough_solids() -> Vec<Material> {
    let of = [
        // From inside, this one sends light through beyond the angle at which a smooth one would reflect all.
        Layers { transmission: 1.0, medium: CLEAR, ior: 1.8, ..plastic(0.3) },
        Layers { transmission: 0.8, medium: CLEAR, ..plastic(0.6) },
        Layers { transmission: 1.0, medium: CLEAR, ior: 1.8, ..plastic(0.9) },
        Layers { transmission: 1.0, medium: CLEAR, coat: 1.0, ..plastic(1.0) },
    ];
    of.map(|layers| layered(Vec3::new(0.8, 0.5, 0.2), &layers)).to_vec()
}

/// Those of all these materials that lie under coat or sheen, or do not, and are thin walls and solids, or opaque.
pub fn mixtures_of(covered: bool, transmissive: bool) -> Vec<Material> {
    let is_covered = |layers: &Layers| layers.coat > 0.0 || layers.sheen_colour != Vec3::ZERO;
    let is_transmissive = |layers: &Layers| layers.transmission.max(layers.diffuse_transmission) > 0.0;
    let is_asked = |layers: &Layers| (is_covered(layers), is_transmissive(layers)) == (covered, transmissive);
    mixtures().into_iter().chain(rough_solids()).filter(|material| is_asked(&material.layers)).collect()
}

pub const CLEAR: Option<Medium> = Some(Medium::CLEAR);

/// Towards the suns: before all plates, below them, and behind them. No plate is in the way of another's light.
pub const SUNS: [DVec3; 3] = [DVec3::new(0.35, 0.92, 0.17), DVec3::new(0.6, -0.75, -0.2), DVec3::new(0.1, -0.3, -1.0)];

/// No light from photon maps, and kernels with all that layered materials may need and with the lights of these questions, also where a
/// scene lacks it, which changes no bit (`tests/light/transport.rs`): so questions share them, and a software device compiles them once.
pub fn without_maps(settings: SceneSettings) -> SceneSettings {
    let without = [&settings.without[..], &[Effect::Indirect, Effect::ReflectiveCaustics, Effect::RefractiveCaustics]].concat();
    let as_needed = [Effect::Direct, Effect::Glossy, Effect::Alpha, Effect::SpecularChains, Effect::SpotLights, Effect::DiscLights];
    let kept = Effect::ALL.into_iter().filter(|effect| !without.contains(effect) && !as_needed.contains(effect));
    let with = settings.with.iter().copied().chain(kept).collect();
    SceneSettings { with, without, aim: false, ..settings }
}

/// Only light that comes straight from the sun, nothing of which is random.
pub fn straight() -> SceneSettings {
    without_maps(SceneSettings { rounds: 1, shadow_rays: 1, without: vec![Effect::SpecularChains], ..by_rounds() })
}

/// What is seen of each plate against what should be, channel by channel. Nothing of it is random.
pub fn compare(what: &str, found: &[DVec3], expected: &[DVec3], tolerance: f64) -> Check<Complaint> {
    let scale = |expected: DVec3| expected.max(DVec3::splat(1e-3));
    let off = pairs(found, expected).map(|(found, expected)| ((*found - *expected) / scale(*expected)).abs().max_element());
    println!("{what}: up to {:.1e} off", off.fold(0.0, f64::max));
    pairs(found, expected).enumerate().try_for_each(|(k, (found, expected))| {
        // A check allows five standard errors.
        colour_check(&format!("{what}, plate {k}"), *found, *expected, 0.2 * tolerance * scale(*expected))
    })
}

/// Plates in one sun after the other against their lobes, each with what it shows in any light.
pub fn in_each_sun(gpu: &Gpu, what: &str, mut plates: Plates, lobes: &[(Lobes, DVec3)], tolerance: f64) -> Check<Complaint> {
    for way in SUNS {
        plates.scene.lights = vec![lamp(sun(-way))];
        let found = plates.seen(gpu, &straight()).0;
        let expected: Vec<DVec3> = lobes.iter().map(|(lobes, shown)| *shown + in_the_sun(lobes, way.normalize())).collect();
        compare(&format!("{what}, the sun at {way}"), &found, &expected, tolerance)?;
    }
    Ok(())
}

/// The same seen from inside a solid.
fn from_inside(material: &Material) -> Inputs {
    let Inputs { ior, .. } = inputs(material);
    Inputs { wall: Wall::Solid { from: ior, to: 1.0 }, ..inputs(material) }
}

/// Every material at every angle, from the front or from inside, before the sun and behind it, has the BSDF of the guide.
pub fn lobes_in_the_sun(gpu: &Gpu, materials: &[Material], is_inside: bool) -> Check<Complaint> {
    let mut plates = Plates::new(materials.len(), Vec::new());
    // Of white, which changes nothing: other questions have textures.
    plates.scene.textures = vec![row_of_texels(&[[255; 4]], Filter::Nearest)];
    let metallic_roughness_texture = Some(TextureUse::of(0, 0));
    let mut lobes = Vec::new();
    for row in 0..COSINES.len() {
        for material in materials {
            let used = Material { layers: Layers { metallic_roughness_texture, ..material.layers }, ..material.clone() };
            let (place, mesh) = plates.add(row, used);
            let n = place.normal;
            if is_inside {
                mesh.triangles.iter_mut().for_each(|corners| corners.swap(1, 2));
            }
            let inputs = if is_inside { from_inside(material) } else { inputs(material) };
            lobes.push((Lobes::new(&inputs, Frame { wo: place.wo, ng: n, n, coat_n: n }), DVec3::ZERO));
        }
    }
    // What the kernels interpolate in tables, and refraction within the width of a pixel.
    in_each_sun(gpu, &format!("lobes, from inside: {is_inside}"), plates, &lobes, 5e-3)
}

/// A texture of one row, linear.
pub fn row_of_texels(texels: &[[u8; 4]], filter: Filter) -> Texture {
    let wrap = [Wrap::Repeat; 2];
    Texture { name: "row".into(), width: texels.len() as u32, height: 1, texels: Texels::Linear(texels.to_vec()), wrap, filter }
}

/// A normal map's normal as the guide has it.
pub fn mapped_normal(texel: [u8; 4], scale: f64, (x, y, normal): (DVec3, DVec3, DVec3), wo: DVec3) -> DVec3 {
    let code = |k: usize| 2.0 * f64::from(texel[k]) / 255.0 - 1.0;
    let n = (scale * (code(0) * x + code(1) * y) + code(2) * normal).normalize();
    let cosine = n.dot(wo);
    if cosine < 0.01 { (n + (0.01 - cosine) * wo).normalize() } else { n }
}

/// Codes of normal maps: level, leaning, in the surface along each axis, and away from it.
pub const LEANS: [[u8; 4]; 6] =
    [[128, 128, 255, 255], [220, 100, 230, 255], [255, 128, 128, 255], [128, 0, 128, 255], [250, 60, 170, 255], [150, 255, 90, 255]];

pub fn map_of(texture: usize, scale: f32) -> NormalMap {
    NormalMap { texture: TextureUse::of(texture, 0), scale }
}

/// Plates whose normal maps have one texel each, on one side of the seam of a mirrored texture or on the other: what a sun in front
/// and one behind make of them, matt or glossy, is in closed form. None is black where its own normal sees the sun.
pub fn normal_maps_in_the_sun(gpu: &Gpu) -> Check<Complaint> {
    let mut plates = Plates::new(2 * LEANS.len() + 5, Vec::new());
    plates.scene.textures = LEANS.map(|texel| row_of_texels(&[texel], Filter::Bilinear)).to_vec();
    let mut lobes = Vec::new();
    let mut add = |row: usize, texture: usize, scale: f32, sign: f64, material: Material| {
        let (place, mesh) = plates.add(row, Material { normal_map: Some(map_of(texture, scale)), ..material.clone() });
        mesh.tangents = vec![[place.x.extend(sign); 3]; 2];
        let n = mapped_normal(LEANS[texture], f64::from(scale), (place.x, sign * place.y, place.normal), place.wo);
        lobes.push((lobes_at(&material, &place, n), DVec3::ZERO));
    };
    let shiny = layered(Vec3::new(0.9, 0.6, 0.3), &Layers { metallic: 0.5, ..plastic(0.6) });
    for row in 0..4 {
        for texture in 0..LEANS.len() {
            for sign in [1.0, -1.0] {
                add(row, texture, 1.0, sign, dull(0.6));
            }
        }
        for scale in [0.0, 0.5, -1.0, 2.5] {
            add(row, 1, scale, 1.0, dull(0.6));
        }
        add(row, 1, 1.0, 1.0, shiny.clone());
    }
    in_each_sun(gpu, "normal maps", plates, &lobes, 3e-3)
}

/// Plates whose coats have a normal map of their own, and plates with normal maps that are seen from behind.
pub fn coats_and_backs_in_the_sun(gpu: &Gpu) -> Check<Complaint> {
    let mut plates = Plates::new(4, Vec::new());
    plates.scene.textures = LEANS.map(|texel| row_of_texels(&[texel], Filter::Bilinear)).to_vec();
    let base = Vec3::new(0.9, 0.6, 0.3);
    let mut lobes = Vec::new();
    for row in 0..4 {
        for (sign, coat_roughness) in [(1.0, 0.3), (-1.0, 0.6)] {
            let coat_normal_map = Some(map_of(4, 0.7));
            let layers = Layers { coat: 0.8, coat_roughness, coat_normal_map, metallic: 0.5, ..plastic(0.6) };
            let material = Material { normal_map: Some(map_of(1, 1.0)), ..layered(base, &layers) };
            let (place, mesh) = plates.add(row, material.clone());
            (mesh.tangents, mesh.coat_tangents) = (vec![[place.x.extend(1.0); 3]; 2], vec![[place.x.extend(sign); 3]; 2]);
            let n = mapped_normal(LEANS[1], 1.0, (place.x, place.y, place.normal), place.wo);
            let coat_n = mapped_normal(LEANS[4], f64::from(0.7f32), (place.x, sign * place.y, place.normal), place.wo);
            lobes.push((Lobes::new(&inputs(&material), Frame { wo: place.wo, ng: place.normal, n, coat_n }), DVec3::ZERO));

            let material = Material { normal_map: Some(map_of(1, 1.0)), two_sided: true, ..dull(0.6) };
            let (place, mesh) = plates.add(row, material.clone());
            mesh.triangles.iter_mut().for_each(|corners| corners.swap(1, 2));
            mesh.tangents = vec![[place.x.extend(sign); 3]; 2];
            // What the map has on the front, turned over.
            let n = mapped_normal(LEANS[1], 1.0, (-place.x, sign * place.y, place.normal), place.wo);
            lobes.push((lobes_at(&material, &place, n), DVec3::ZERO));
        }
    }
    in_each_sun(gpu, "coats and backs", plates, &lobes, 5e-3)
}

/// Textures of all that a material may have, each looked up in its own way; vertex colours; unlit plates.
pub fn textures_in_the_sun(gpu: &Gpu) -> Check<Complaint> {
    let mut plates = Plates::new(9, Vec::new());
    let halves = [[51, 102, 204, 255], [230, 178, 76, 128]];
    plates.scene.textures = vec![row_of_texels(&halves, Filter::Nearest), row_of_texels(&halves, Filter::Bilinear)];
    let texels = halves.map(|texel| Vec4::from_array(texel.map(f32::from)) / 255.0);
    let base = Vec3::new(0.9, 0.6, 0.3);
    let of_first = Some(TextureUse::of(0, 0));
    // Roughness and metalness of a texel, found by either set of coordinates.
    let of_set = |uv_set: usize, transform: UvTransform| {
        let metallic_roughness_texture = Some(TextureUse { texture: 0, uv_set, transform });
        layered(base, &Layers { metallic: 0.8, roughness: 0.9, metallic_roughness_texture, ..Layers::default() })
    };
    let plain = texels.map(|texel| layered(base, &Layers { metallic: 0.8 * texel.z, roughness: 0.9 * texel.y, ..plastic(1.0) }));
    // 0.4 becomes 0.45, 0.9 becomes 0.7.
    let shrunk = UvTransform { scale: DVec2::new(0.5, 1.0), rotation: 0.0, offset: DVec2::new(0.25, 0.0) };
    // A turn by half a circle about the origin, and back by one: 1 - 0.4.
    let turned = UvTransform { rotation: PI, offset: DVec2::new(1.0, 1.0), ..UvTransform::NONE };
    // Three tenths of the way from the first texel's middle to the second's.
    let mixed = (0.7 * texels[0] + 0.3 * texels[1]).truncate();
    // The factors of a coat and of sheen.
    let coated = Layers { coat: 0.9, coat_roughness: 0.8, sheen_colour: Vec3::ONE, sheen_roughness: 0.9, ..plastic(0.6) };
    let textured = Layers {
        coat_texture: of_first,
        coat_roughness_texture: of_first,
        sheen_colour_texture: of_first,
        sheen_roughness_texture: of_first,
        specular_texture: of_first,
        specular_colour_texture: of_first,
        ..coated
    };
    let (texel, colour) = (texels[1], texels[1].truncate());
    let as_textured = Layers {
        coat: 0.9 * texel.x,
        coat_roughness: 0.8 * texel.y,
        sheen_colour: colour,
        sheen_roughness: 0.9 * texel.w,
        specular: texel.w,
        specular_colour: colour,
        ..coated
    };
    let thin = Layers { transmission: 0.9, transmission_texture: of_first, ..plastic(0.6) };
    // What is used, where each set of coordinates leads, and what that is.
    let cases = [
        (of_set(0, UvTransform::NONE), [0.4, 0.9], plain[0].clone()),
        (of_set(1, UvTransform::NONE), [0.4, 0.9], plain[1].clone()),
        (of_set(0, shrunk), [0.4, 0.9], plain[0].clone()),
        (of_set(1, shrunk), [0.4, 0.9], plain[1].clone()),
        (of_set(0, turned), [0.4, 0.9], plain[1].clone()),
        (
            Material { base_colour_texture: Some(TextureUse::of(1, 0)), ..dull(0.9) },
            [0.4, 0.0],
            Material { base_colour: 0.9 * mixed, ..dull(1.0) },
        ),
        (layered(base, &textured), [0.9, 0.0], layered(base, &as_textured)),
        (layered(base, &thin), [0.9, 0.0], layered(base, &Layers { transmission: 0.9 * texel.x, ..thin })),
    ];
    let mut lobes = Vec::new();
    for row in 0..4 {
        for (used, u, plain) in &cases {
            let (place, mesh) = plates.add(row, used.clone());
            mesh.uvs = u.map(|u| vec![DVec2::new(u, 0.5); 4]);
            lobes.push((lobes_at(plain, &place, place.normal), DVec3::ZERO));
        }
        // Unlit: its colour whatever the light, that of its corners included.
        let (place, mesh) = plates.add(row, layered(base, &Layers { is_unlit: true, coat: 1.0, ..metal(0.5) }));
        mesh.colours = vec![DVec3::new(0.5, 1.0, 0.25); 4];
        lobes.push((lobes_at(&dull(0.0), &place, place.normal), base.as_dvec3() * mesh.colours[0]));
    }
    in_each_sun(gpu, "textures", plates, &lobes, 3e-3)
}

/// Alpha of white metals, and what they send back at each of [`COSINES`], by quadrature.
pub const METALS: [(f64, [f64; 5]); 8] = [
    (0.0, [1.0; 5]),
    (0.01, [1.0000, 1.0000, 0.9998, 0.9986, 0.9763]),
    (0.05, [0.9972, 0.9964, 0.9927, 0.9626, 0.8899]),
    (0.1, [0.9883, 0.9846, 0.9692, 0.9046, 0.9118]),
    (0.25, [0.9158, 0.8973, 0.8573, 0.8482, 0.9331]),
    (0.5, [0.6878, 0.6820, 0.6983, 0.7899, 0.9125]),
    (0.75, [0.4639, 0.4923, 0.5646, 0.7155, 0.8806]),
    (1.0, [0.3069, 0.3513, 0.4507, 0.6416, 0.8478]),
];

/// A material, and what it sends back of an even sky at each of [`COSINES`], where that is known.
pub type Returns = (Material, Option<[f64; 5]>);

/// White metals, matt and sharp.
pub fn glossy_metals() -> Vec<Returns> {
    white_metals().into_iter().filter(|(material, _)| material.layers.roughness > 0.0 && material.layers.roughness < 0.75).collect()
}

pub fn white_metals() -> Vec<Returns> {
    METALS.map(|(alpha, albedos)| (layered(Vec3::ONE, &metal(alpha.sqrt() as f32)), Some(albedos))).to_vec()
}

/// What one of the path tracer's lobes makes of a sky, by so many samples, and the square of its error.
pub fn sampled(lobes: &Lobes, kind: Lobe, count: u32, rng: &mut Random, radiance: impl Fn(DVec3) -> f64) -> (DVec3, DVec3) {
    let (mut sum, mut squares) = (DVec3::ZERO, DVec3::ZERO);
    for _ in 0..count {
        let weight = lobes.sample(kind, rng).map_or(DVec3::ZERO, |scattered| radiance(scattered.wi) * scattered.weight);
        sum += weight;
        squares += weight * weight;
    }
    let n = f64::from(count);
    (sum / n, (squares / n - (sum / n) * (sum / n)).max(DVec3::ZERO) / n)
}

/// The same of all lobes together, and the error.
fn under_the_sky(lobes: &Lobes, radiance: impl Fn(DVec3) -> f64) -> (DVec3, DVec3) {
    let mut rng = random(1, 1);
    let all = LOBES.map(|kind| sampled(lobes, kind, 4000, &mut rng, &radiance));
    (all.iter().map(|(mean, _)| *mean).sum(), all.iter().map(|(_, squared)| *squared).sum::<DVec3>().map(f64::sqrt))
}

/// Far around all plates, seen from inside: where x is below 0.
fn half_a_dome(material: usize) -> Mesh {
    let mut dome = Mesh::sphere("dome", DVec3::ZERO, 200.0, 8, material);
    dome.normals.clear();
    dome.triangles.iter_mut().for_each(|corners| corners.swap(1, 2));
    dome.triangles.retain(|corners| corners.map(|k| dome.positions[k as usize].x).iter().sum::<f64>() < 0.0);
    dome
}

/// Light straight from the sky or a dome, by samples of it and of the lobes.
fn under_samples() -> SceneSettings {
    without_maps(SceneSettings { samples: 16, rounds: 24, shadow_rays: 4, ..by_rounds() })
}

/// The error of a difference.
fn of_both(error: DVec3, other: DVec3) -> DVec3 {
    (error * error + other * other).map(f64::sqrt)
}

/// Opaque plates under a sky that is 1 everywhere, or of which a dome that emits as much hides one half. Where they have a direction,
/// it is along their rows.
pub fn furnace(gpu: &Gpu, materials: &[Returns], within_a_dome: bool) -> Check<Complaint> {
    let mut plates = Plates::new(materials.len(), vec![LightKind::Environment { radiance: Vec3::ONE }]);
    for (material, _) in materials {
        for row in 0..COSINES.len() {
            let (place, mesh) = plates.add(row, material.clone());
            mesh.tangents = vec![[place.x.extend(1.0); 3]; 2];
        }
    }
    if within_a_dome {
        plates.scene.meshes.push(half_a_dome(plates.scene.materials.len()));
        plates.scene.materials.push(emissive(0.0));
    }
    let settings = under_samples();
    let (found, errors) = plates.seen(gpu, &settings);
    for (k, ((found, error), place)) in pairs(pairs(found, errors), &plates.places).enumerate() {
        let ((material, albedos), row) = (&materials[k / COSINES.len()], k % COSINES.len());
        let Layers { metallic, roughness, coat, coat_roughness, .. } = material.layers;
        let (expected, own_error) = match albedos {
            Some(albedos) => (DVec3::splat(albedos[row]), DVec3::ZERO),
            None => under_the_sky(&lobes_at(material, place, place.normal), |_| 1.0),
        };
        println!("plate {k}: {found:.4} +- {error:.4}, {expected:.4} expected");
        // Few paths follow a delta that sends little back: rounds that all count as many of them do not show how uncertain that is.
        let one_path = 1.0 / f64::from(settings.samples * settings.rounds);
        let least = if metallic < 1.0 && (roughness == 0.0 || coat > 0.0 && coat_roughness == 0.0) { one_path } else { 0.0 };
        // Tables are interpolated.
        let error = of_both(error, own_error).max(6e-4 * expected).max(DVec3::splat(least));
        colour_check(&format!("plate {k}, within a dome: {within_a_dome}"), found, expected, error)?;
    }
    Ok(())
}

/// Rough plates that let light through, each alone within half a dome, on the side away from the eye: what lies before and behind them
/// is found by light samples and by paths.
pub fn transmission_in_half_a_dome(gpu: &Gpu) -> Check<Complaint> {
    let wo = DVec3::new(0.8, 0.6, 0.0);
    let half = half_a_dome(1);
    let paper = Layers { diffuse_transmission: 0.7, diffuse_transmission_colour: Vec3::new(0.3, 0.9, 0.6), ..plastic(0.4) };
    for layers in [Layers { transmission: 0.6, ..plastic(0.4) }, Layers { transmission: 1.0, medium: CLEAR, ..plastic(0.4) }, paper] {
        let material = layered(Vec3::new(0.8, 0.5, 0.2), &layers);
        let scene = scene_of(vec![level(0.0, [0.1; 2], true, 0), half.clone()], vec![material.clone(), emissive(0.0)], Vec::new());
        let camera = Camera::looking_at("eye", wo, DVec3::ZERO, DVec3::Y, 1e-3);
        let result = seen(gpu, &scene, &under_samples(), &camera, [4, 4]);
        let (expected, own) = under_the_sky(&lobes_at(&material, &Place::of_normal(DVec3::Y, wo), DVec3::Y), |wi| f64::from(wi.x < 0.0));
        let (found, error) = mean_of_all(&means(&result));
        println!("{layers:?}: {found} +- {error}, {expected} +- {own} expected");
        let error = of_both(error, own).max(6e-4 * expected);
        colour_check(&format!("transmission {}", layers.transmission), found, expected, error)?;
    }
    Ok(())
}

/// Photons of the sun on a large plate under coat and sheen: maps weigh them by all of its lobes.
pub fn photons_on_a_plate(gpu: &Gpu) -> Check<Complaint> {
    let layers = Layers { sheen_colour: SHEEN, sheen_roughness: 0.6, coat: 0.7, coat_roughness: 0.6, metallic: 0.3, ..plastic(0.6) };
    let material = layered(Vec3::new(0.8, 0.5, 0.2), &layers);
    let way = DVec3::new(0.8, 0.5, 0.3).normalize();
    let plate = scene_of(vec![level(0.0, [2.0; 2], true, 0)], vec![material.clone()], vec![sun(-way)]);
    let wo = DVec3::new(0.6, 0.6, -0.5).normalize();
    let camera = Camera::looking_at("eye", wo, DVec3::ZERO, DVec3::Y, 1e-4);
    let result = seen(gpu, &plate, &mapped(20_000, 32, 1, 0.5), &camera, [1, 1]);
    let expected = in_the_sun(&lobes_at(&material, &Place::of_normal(DVec3::Y, wo), DVec3::Y), way);
    let (found, error) = (result.film.mean(0), result.film.standard_error(0));
    println!("photons on a plate: {found} +- {error}, {expected} expected");
    assert!((error / expected).max_element() < 0.02, "{error}");
    colour_check("photons on a plate", found, expected, error)
}

/// What keeps all light, seen from the front in a row: clear balls, also with films and gaps and of few triangles, or white paper.
fn white_things(is_clear: bool) -> Vec<(Mesh, Material)> {
    let ball = |segments: u32| Mesh::sphere("ball", DVec3::ZERO, 0.9, segments, 0);
    let white = |layers: Layers| layered(Vec3::ONE, &layers);
    if !is_clear {
        let paper = |medium| white(Layers { diffuse_transmission: 0.5, medium, ..plastic(0.7) });
        let sheet = Mesh::parallelogram("sheet", DVec3::new(-0.9, -0.9, 0.0), DVec3::X * 1.8, DVec3::Y * 1.8, 0);
        return vec![(ball(32), paper(None)), (ball(32), paper(CLEAR)), (sheet, paper(None))];
    }
    let clear = |medium| Layers { transmission: 1.0, medium, ..plastic(0.0) };
    let blended = |material: Material| Material { coverage: Coverage::Blend { alpha: 0.5 }, ..material };
    vec![
        (ball(32), white(clear(None))),
        (ball(32), white(clear(CLEAR))),
        (ball(32), blended(white(metal(0.0)))),
        (ball(32), blended(white(clear(None)))),
        (ball(32), white(film(1.33, 500.0, &clear(None)))),
        (ball(32), white(film(1.38, 100.0, &clear(CLEAR)))),
        (ball(8), white(clear(CLEAR))),
    ]
}

/// What loses no light is not to be seen under a sky that is 1 everywhere.
pub fn clear_furnace(gpu: &Gpu, is_clear: bool) -> Check<Complaint> {
    let things = white_things(is_clear);
    let count = things.len();
    let mut scene = scene_of(Vec::new(), Vec::new(), vec![LightKind::Environment { radiance: Vec3::ONE }]);
    for (k, (mut mesh, material)) in things.into_iter().enumerate() {
        mesh.positions.iter_mut().for_each(|at| at.x += 2.0 * k as f64 - (count - 1) as f64);
        mesh.material = k;
        scene.meshes.push(mesh);
        scene.materials.push(material);
    }
    let camera = Camera::looking_at("front", DVec3::Z * 100.0, DVec3::ZERO, DVec3::Y, 0.02);
    let (settings, blurred) = match is_clear {
        true => (without_maps(SceneSettings { samples: 16, shadow_rays: 2, ..by_rounds() }), 1e-4),
        // Rough reflection of a single scattering leaves 0.1 % of what the dielectric mirrors, and density estimates blur.
        false => (SceneSettings { samples: 4, photons: 20_000, caustic_photons: 20_000, ..by_rounds() }, 2e-3),
    };
    let result = seen(gpu, &scene, &settings, &camera, [8 * count as u32, 8]);
    for k in 0..count {
        let pixels = || (0..8).flat_map(move |row| (0..8).map(move |column| 8 * (row * count + k) + column));
        let mean = pixels().map(|at| result.film.mean(at).x).sum::<f64>() / 64.0;
        let error = pixels().map(|at| result.film.standard_error(at).x.powi(2)).sum::<f64>().sqrt() / 64.0;
        println!("thing {k}, clear: {is_clear}: {mean} +- {error}");
        estimate_check(&format!("thing {k}, clear: {is_clear}"), mean, 1.0, error.max(blurred))?;
    }
    Ok(())
}
