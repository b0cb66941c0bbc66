//! Films of `--math strict`, whose bits are written down here.

use photonmill::gpu::Gpu;
use photonmill::scene::{Camera, Scene, built_in};
use photonmill::settings::transport::{Append, Illumination, Kernel, TransportSettings};
use photonmill::settings::{Math, Settings};
use photonmill::transport::Lit;

use super::lit::seen;
use super::{Check, run};

pub fn small() -> TransportSettings {
    TransportSettings {
        photons: 2000,
        caustic_photons: 2000,
        rounds: 2,
        shadow_rays: 2,
        math: Math::Strict,
        ..TransportSettings::default()
    }
}

pub fn picture(gpu: &Gpu, scene: &Scene, settings: &TransportSettings) -> Lit {
    let camera = scene.cameras.first().cloned().unwrap_or_else(|| Camera::around(scene.bounds().0, scene.bounds().1));
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
    ("open-box", 0x9bb9_f0b3_675a_cbc9),
    ("open-box-phong", 0xceb8_138a_5c4b_9944),
    ("cornell", 0x432b_4da1_da79_00e3),
    ("cornell-spheres", 0x1e92_16d5_b101_ded2),
    ("caustic-sphere", 0x5c8d_b563_d6d7_b179),
    ("furnace", 0xa172_51b4_26c3_f9c4),
    ("integrating-sphere", 0xe15c_c174_2e1b_83ce),
    ("point-over-plane", 0x1da1_bd21_c95a_a475),
    ("disc-over-plane", 0x1492_1799_9280_6a4c),
    ("sun-over-plane", 0xae02_e708_4f65_4e7d),
    ("sky-over-plane", 0xc1c6_3176_685f_5add),
    ("mirror-corridor", 0x62a0_a2ab_40b6_b3ed),
    ("glass-slab", 0x7f92_1919_ec03_a7cd),
    ("cornell-spheres from photons", 0x45ae_1ec9_e3fb_5d65),
    ("cornell-spheres gathered", 0x1294_8aa1_a0d5_d096),
    ("blender.glb", 0x032d_8e35_dc7e_b124),
    ("the paper's box", 0x52ea_c413_af81_4929),
];

fn bits_of(gpu: &Gpu, name: &str) -> u64 {
    if name == "the paper's box" {
        return fingerprint(&run(gpu, &Settings { math: Math::Strict, shininess: [Some(2.0); 5], ..Settings::default() }).film.sums);
    }
    let settings = match name {
        "cornell-spheres from photons" => {
            TransportSettings { illumination: Illumination::Photons, kernel: Kernel::Epanechnikov, ..small() }
        }
        "cornell-spheres gathered" => TransportSettings { final_gather: true, kernel: Kernel::Cone, append: Append::Atomic, ..small() },
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
pub fn check(gpu: &Gpu, name: &str) -> Check {
    let (_, expected) = BITS.iter().find(|(known, _)| *known == name).unwrap_or_else(|| panic!("no bits of {name} are written down"));
    let found = bits_of(gpu, name);
    if found == *expected { Ok(()) } else { Err(format!("(\"{name}\", {found:#018x}),")) }
}
