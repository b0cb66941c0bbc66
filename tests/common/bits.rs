//! Films of `--math strict`, whose bits are written down here.

use super::prelude::*;
use photonmill::engine::scene::RunResult;
use photonmill::settings::scene::Kernel;

pub fn small() -> SceneSettings {
    SceneSettings { photons: 2000, caustic_photons: 2000, rounds: 2, shadow_rays: 2, math: Math::Strict, ..SceneSettings::default() }
}

pub fn picture(gpu: &Gpu, scene: &Scene, settings: &SceneSettings) -> RunResult {
    let camera = scene.first_camera();
    seen(gpu, scene, settings, &camera, [24, 24])
}

/// 64 bits of all sums and squares (FNV-1a).
fn fingerprint(sums: &[u64]) -> u64 {
    sums.iter()
        .flat_map(|sum| sum.to_le_bytes())
        .fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3))
}

/// A picture's film and the paper's films, whose bits every device must find. A change of any random number,
/// rounding or formula shows here; the bits are to be written anew only with a reason.
pub const BITS: [(&str, u64); 17] = [
    ("open-box", 0xcb9c_d77f_086c_b90d),
    ("open-box-phong", 0x2576_afb4_e9b2_52ff),
    ("cornell", 0x8bdc_84da_0af8_306f),
    ("cornell-spheres", 0xd6fe_de77_d144_7ab9),
    ("caustic-sphere", 0x29e0_0016_bad7_1d80),
    ("furnace", 0x0147_7255_9252_d81c),
    ("integrating-sphere", 0x6dd7_9903_c8c9_5d18),
    ("point-over-plane", 0xcfc6_d1b4_2452_985d),
    ("disc-over-plane", 0xef14_6657_5761_36ce),
    ("sun-over-plane", 0x2565_b130_3e56_86d8),
    ("sky-over-plane", 0x2819_8564_ee91_e27a),
    ("mirror-corridor", 0xd601_3a78_78a1_837c),
    ("glass-slab", 0x8dd4_c912_ee49_24f1),
    ("cornell-spheres from photons", 0xe1e4_2586_dc9d_502c),
    ("cornell-spheres gathered", 0xbe78_65cf_4f87_db4a),
    ("blender.glb", 0xe896_5a0e_2120_9912),
    ("the paper's box", 0x52ea_c413_af81_4929),
];

fn bits_of(gpu: &Gpu, name: &str) -> u64 {
    if name == "the paper's box" {
        return fingerprint(
            &run(gpu, &RoomSettings { math: Math::Strict, shininess: [Some(2.0); 5], ..RoomSettings::default() }).film.sums,
        );
    }
    let settings = match name {
        "cornell-spheres from photons" => SceneSettings { illumination: Illumination::Photons, kernel: Kernel::Epanechnikov, ..small() },
        "cornell-spheres gathered" => SceneSettings { final_gather: true, kernel: Kernel::Cone, builder: Some(Builder::Atomic), ..small() },
        _ => small(),
    };
    let scene = match name {
        "blender.glb" => Scene::open(&format!("{}/tests/scenes/blender.glb", env!("CARGO_MANIFEST_DIR")), false).unwrap(),
        _ => built_in::by_name(name.split(' ').next().unwrap()).unwrap(),
    };
    let film = picture(gpu, &scene, &settings).film;
    let squares = film.squares.iter().flat_map(|square| [*square as u64, (*square >> 64) as u64]);
    fingerprint(&film.sums.iter().copied().chain(squares).collect::<Vec<_>>())
}

/// The complaint is the line to write down.
pub fn check(gpu: &Gpu, name: &str) -> Check<Complaint> {
    let (_, expected) = BITS.iter().find(|(known, _)| *known == name).unwrap_or_else(|| panic!("no bits of {name} are written down"));
    let found = bits_of(gpu, name);
    if found == *expected { Ok(()) } else { Err(Complaint::new(Kind::OtherBits, format!("(\"{name}\", {found:#018x}),"))) }
}
