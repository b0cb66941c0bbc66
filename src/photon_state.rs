//! Photons in flight, and their paths between bounces as the device holds them: 48 bytes each, twin of `glsl/world/room/photon_state.glsl`.

use bytemuck::{Pod, Zeroable};
use glam::{UVec2, Vec3};

/// A photon in flight.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PhotonState {
    pub position: Vec3,
    /// Wall it stands on, or `NO_WALL` once it has died in its slot.
    pub wall: u32,
    pub direction: Vec3,
    /// Number within its round.
    pub photon: u32,
    /// State of its random stream.
    pub stream: UVec2,
    pub flux: f32,
}

/// Room for one path on the device. Its three words of four do not stand side by side: [`unpack`].
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Pod, Zeroable)]
pub(crate) struct PackedPhotonState(pub [[u32; 4]; 3]);

/// Path `index` of an array that is full: the first words of all paths, then the second ones, then the third ones.
pub(crate) fn unpack(array: &[PackedPhotonState], index: usize) -> PhotonState {
    let words: &[[u32; 4]] = bytemuck::cast_slice(array);
    let [[x, y, z, wall], [dx, dy, dz, photon], [low, high, flux, _]] = [0, 1, 2].map(|k| words[k * array.len() + index]);
    let vector = |bits: [u32; 3]| Vec3::from_array(bits.map(f32::from_bits));
    PhotonState {
        position: vector([x, y, z]),
        wall,
        direction: vector([dx, dy, dz]),
        photon,
        stream: UVec2::new(low, high),
        flux: f32::from_bits(flux),
    }
}
