//! Photons as the maps of both worlds hold them: in the room 16 bytes, twin of `glsl/world/room/photon.glsl`; in a scene of triangles 32,
//! twin of `glsl/world/scene/photon.glsl`.

use bytemuck::{Pod, Zeroable};
use glam::Vec3;

use crate::constants::NO_WALL;
use crate::records::Room;

/// A photon where a wall reflected it.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable)]
pub(crate) struct Photon {
    pub position: Vec3,
    /// Wall, or `NO_WALL` in an empty slot.
    pub wall: u32,
    /// In (0, 1].
    pub flux: f32,
    /// Phong weight towards the eye, in [0, 1]; 1 on Lambertian walls.
    pub weight: f32,
    pub photon: u32,
    pub bounce: u32,
}

/// One entry of the photon map on the device; `glsl/world/room/photon.glsl` describes its bits.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Pod, Zeroable)]
pub(crate) struct StoredPhoton(pub [u32; 4]);

/// Which photon an entry of the photon map is.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Pod, Zeroable)]
pub(crate) struct Origin {
    pub photon: u32,
    pub bounce: u32,
}

/// A photon where it arrived at a surface that scatters: one entry of the map of a scene of triangles.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable)]
pub(crate) struct MapPhoton {
    pub position: Vec3,
    /// That it arrived at: twice its number, plus 1 on its back.
    pub plane: u32,
    pub flux: Vec3,
    /// Where it came from, octahedral in 2 x 15 bits, and log2 of `ARRIVED_...` above.
    pub wi: u32,
}

impl MapPhoton {
    /// Towards where it came from, to a ten-thousandth of a radian. Twin of `unpack_direction` in `glsl/math/directions.glsl`.
    pub(crate) fn came_from(&self) -> Vec3 {
        let coordinate = |code: u32| ((code & 0x7fff) as f32 - 16383.0) / 16383.0;
        let (x, y) = (coordinate(self.wi), coordinate(self.wi >> 15));
        let z = 1.0 - x.abs() - y.abs();
        let (x, y) = if z >= 0.0 { (x, y) } else { ((1.0 - y.abs()) * 1f32.copysign(x), (1.0 - x.abs()) * 1f32.copysign(y)) };
        Vec3::new(x, y, z).normalize()
    }

    /// Mask of the way in which its light arrived, one of `ARRIVED_...`.
    pub(crate) fn arrival(&self) -> u32 {
        1 << (self.wi >> 30)
    }
}

impl Photon {
    /// Of a photon in its wall's plane to the bit, as any that was traced is.
    #[cfg(test)]
    pub(crate) fn stored(&self) -> StoredPhoton {
        let axis = (self.wall / 2) & 3;
        let place = [1, 2].map(|after| self.position[(axis as usize + after) % 3].to_bits());
        StoredPhoton([
            place[0],
            place[1],
            self.flux.to_bits() & 0x3fff_ffff | axis << 30,
            self.weight.to_bits() & 0x7fff_ffff | self.wall << 31,
        ])
    }

    #[cfg(test)]
    pub(crate) fn origin(&self) -> Origin {
        Origin { photon: self.photon, bounce: self.bounce }
    }
}

impl StoredPhoton {
    /// `NO_WALL` of an empty slot.
    pub(crate) fn wall(self) -> u32 {
        let [.., flux, weight] = self.0;
        if flux >> 30 == 3 { NO_WALL } else { flux >> 30 << 1 | weight >> 31 }
    }

    /// The photon as it was, to the bit; of an empty slot nothing but that it is one.
    pub(crate) fn photon(self, origin: Origin, room: &Room) -> Photon {
        let StoredPhoton([first, second, flux, weight]) = self;
        let wall = self.wall();
        let mut position = Vec3::ZERO;
        if wall != NO_WALL {
            let axis = wall as usize / 2;
            position[axis] = if wall % 2 == 1 { room.max_corner[axis] } else { room.min_corner[axis] };
            position[(axis + 1) % 3] = f32::from_bits(first);
            position[(axis + 2) % 3] = f32::from_bits(second);
        }
        Photon {
            position,
            wall,
            flux: f32::from_bits(flux & 0x3fff_ffff),
            weight: f32::from_bits(weight & 0x7fff_ffff),
            photon: origin.photon,
            bounce: origin.bounce,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::constants::FACE_COUNT;

    fn bits(photon: &Photon) -> [u32; 8] {
        bytemuck::cast(*photon)
    }

    #[test]
    fn photons_come_back_to_the_bit() {
        let room = Room { min_corner: Vec3::new(-0.1, -1e30, -0.0), max_corner: Vec3::new(0.3, f32::MAX, 1e-40) };
        let smallest = f32::from_bits(1);
        let coordinates = [0.0, -0.0, smallest, -smallest, 0.1, -0.25, f32::MAX, f32::MIN, f32::INFINITY];
        let shares = [0.0, smallest, f32::MIN_POSITIVE, 1e-3, 0.5, 1.0f32.next_down(), 1.0];
        for wall in 0..FACE_COUNT {
            let axis = wall as usize / 2;
            for (a, b) in coordinates.into_iter().flat_map(|a| coordinates.map(|b| (a, b))) {
                for (flux, weight) in shares.into_iter().flat_map(|flux| shares.map(|weight| (flux, weight))) {
                    let mut position = if wall % 2 == 1 { room.max_corner } else { room.min_corner };
                    position[(axis + 1) % 3] = a;
                    position[(axis + 2) % 3] = b;
                    let photon = Photon { position, wall, flux, weight, photon: u32::MAX, bounce: 77 };
                    let stored = photon.stored();
                    assert_eq!(stored.wall(), wall);
                    assert_eq!(bits(&stored.photon(photon.origin(), &room)), bits(&photon), "{photon:?}");
                }
            }
        }
    }

    #[test]
    fn empty_slots_stay_empty() {
        for share in [0.0, 0.5, 1.0] {
            let empty = Photon { wall: NO_WALL, flux: share, weight: share, ..Photon::default() };
            assert_eq!(empty.stored().wall(), NO_WALL);
            assert_eq!(empty.stored().photon(empty.origin(), &Room::default()), empty);
        }
    }
}
