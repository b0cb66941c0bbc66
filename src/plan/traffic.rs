//! Bytes that passes of a scene cannot do without: those of records that are each read and written once. What is read again and
//! again, as photons by a gather are, counts once.

use super::scene::{MapPlan, ScenePlan};
use crate::photon::MapPhoton;
use crate::records::VisiblePoint;

const POINT: u64 = size_of::<VisiblePoint>() as u64;
const PHOTON: u64 = size_of::<MapPhoton>() as u64;
/// Of three sums of 64 bits.
const SUMS: u64 = 24;
/// Of a photon's place in its bucket.
const RANK: u64 = 4;

impl ScenePlan {
    /// To see the points of a camera path.
    pub fn bytes_of_path(&self) -> u64 {
        SUMS + u64::from(self.points_per_path) * POINT
    }

    /// To turn the flux of a point into light.
    pub fn bytes_of_point(&self) -> u64 {
        POINT + SUMS * (1 + u64::from(self.arrival_sets)) + 8 * self.near_sums() / u64::from(self.visible_points().max(1))
    }

    /// To end a round in a pixel: sums of its paths and points are read, and sums and squares of both films read and written.
    pub fn bytes_of_pixel(&self) -> u64 {
        let points = if self.maps().next().is_some() { self.points_per_path } else { 0 };
        SUMS * u64::from(self.samples()) * u64::from(1 + points) + 2 * 3 * SUMS
    }
}

impl MapPlan {
    /// To count stored photons by bucket: by their first half, and numbered.
    pub(crate) fn bytes_of_counting(&self, stored: u64) -> u64 {
        stored * (PHOTON / 2 + RANK) + 4 * u64::from(self.bucket_count)
    }

    /// To sum the counts up: read and written twice.
    pub(crate) fn bytes_of_scanning(&self) -> u64 {
        16 * u64::from(self.bucket_count)
    }

    /// To write stored photons in order.
    pub(crate) fn bytes_of_sorting(&self, stored: u64) -> u64 {
        stored * (2 * PHOTON + RANK)
    }

    /// To read all stored photons.
    pub(crate) fn bytes_of_reading(&self, stored: u64) -> u64 {
        stored * PHOTON
    }
}
