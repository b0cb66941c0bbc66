//! The sorted uniform grid on the CPU. Twin of `glsl/grid.glsl` and the index kernels.

use glam::{UVec3, Vec3};

use crate::plan::Grid;
use crate::records::{Photon, SortedPhoton};

/// Photons in cell order.
pub struct Index {
    grid: Grid,
    /// One past the last photon of each cell.
    cells: Vec<u32>,
    pub sorted_photons: Vec<SortedPhoton>,
}

fn cell_of(grid: &Grid, position: Vec3) -> UVec3 {
    let cell = ((position - Vec3::from(grid.origin)) * grid.cells_per_metre).floor();
    let last = (UVec3::from(grid.cell_count) - 1).as_vec3();
    cell.clamp(Vec3::ZERO, last).as_uvec3()
}

fn cell_number(grid: &Grid, cell: UVec3) -> usize {
    let [columns, rows, _] = grid.cell_count;
    ((cell.z * rows + cell.y) * columns + cell.x) as usize
}

impl Index {
    pub fn build(grid: Grid, photons: &[Photon]) -> Index {
        let mut cells = vec![0u32; grid.cells() as usize];
        let cell_of_photon = |photon: &Photon| cell_number(&grid, cell_of(&grid, photon.position));
        for photon in photons {
            cells[cell_of_photon(photon)] += 1;
        }
        // Now cells[c] = first place of cell c ...
        let mut before = 0;
        for cell in &mut cells {
            before += std::mem::replace(cell, before);
        }
        // ... and after this, one past its last.
        let mut sorted_photons = vec![SortedPhoton::default(); photons.len()];
        for photon in photons {
            let place = &mut cells[cell_of_photon(photon)];
            sorted_photons[*place as usize] =
                SortedPhoton { position: photon.position, wall: photon.wall, flux: photon.flux, weight: photon.weight };
            *place += 1;
        }
        Index { grid, cells, sorted_photons }
    }

    /// Runs of photons that hold all within reach of a position.
    pub fn runs(&self, position: Vec3) -> impl Iterator<Item = &[SortedPhoton]> {
        let first = cell_of(&self.grid, position - self.grid.reach);
        let last = cell_of(&self.grid, position + self.grid.reach);
        (first.z..=last.z).flat_map(move |z| {
            (first.y..=last.y).map(move |y| {
                let begin = cell_number(&self.grid, UVec3::new(first.x, y, z));
                let end = cell_number(&self.grid, UVec3::new(last.x, y, z));
                let begin = if begin == 0 { 0 } else { self.cells[begin - 1] };
                &self.sorted_photons[begin as usize..self.cells[end] as usize]
            })
        })
    }
}
