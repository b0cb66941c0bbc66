//! Films of `--math strict`, whose bits are written down here.

use super::prelude::*;
use photonmill::engine::scene::RunResult;
use photonmill::settings::scene::Kernel;

pub fn small() -> SceneSettings {
    SceneSettings { photons: 2000, caustic_photons: 2000, rounds: 2, shadow_rays: 2, math: Math::Strict, ..by_rounds() }
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
    ("open-box", 0xae32_98a5_04f5_635f),
    ("open-box-phong", 0x6e0d_674b_0226_2ea8),
    ("cornell", 0x2990_2df7_52ae_59dc),
    ("cornell-spheres", 0x7a35_4643_ea3d_40fb),
    ("caustic-sphere", 0x5f38_28be_7b9b_9036),
    ("furnace", 0x3796_cfaf_728d_03dc),
    ("integrating-sphere", 0x9adc_a644_6265_0f0a),
    ("point-over-plane", 0x7015_d1a9_f9d9_ba36),
    ("disc-over-plane", 0xfb6a_33ca_c08c_0841),
    ("sun-over-plane", 0x91be_4ea8_6619_dd96),
    ("sky-over-plane", 0x31b1_55af_2b87_2a5e),
    ("mirror-corridor", 0x4a08_4fe5_b0ee_7fbe),
    ("glass-slab", 0x172e_6c61_93c0_95d1),
    ("cornell-spheres from photons", 0x5926_5be3_8040_acd6),
    ("cornell-spheres gathered", 0x9315_3323_ff87_693b),
    ("blender.glb", 0xfae7_969d_be76_b489),
    ("the paper's box", 0x012e_4cd3_65fd_a4f8),
];

fn bits_of(gpu: &Gpu, name: &str) -> u64 {
    if name == "the paper's box" {
        let settings = RoomSettings { math: Math::Strict, shininess: [Some(2.0); 5], ..RoomSettings::default() };
        return fingerprint(&run(gpu, &settings).film.sums);
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
    Kind::OtherBits.unless(found == *expected, || format!("(\"{name}\", {found:#018x}),"))
}
