//! Density estimates end at walls: what stands on a surface parts its photons and its area alike.

use crate::common::known;
use crate::common::prelude::*;
use glam::dvec3;

const RADII: [Option<f64>; 2] = [None, Some(0.1)];

#[test]
fn a_dark_half_of_a_room_is_dark_right_behind_the_wall() {
    let Some(gpu) = device() else { return };
    let (y, z) = (DVec3::Y, DVec3::Z);
    let upright = |x: f64| Mesh::parallelogram("wall", DVec3::X * x, z, y, 2);
    // From x = 1/2 at the floor to x = 0.4 or 0.6 at the ceiling.
    let leaning = |lean: f64| Mesh::parallelogram("wall", DVec3::X * 0.5, z, dvec3(lean, 1.0, 0.0), 2);
    let walls = [
        ("a sheet", known::sheet()),
        ("1 mm", vec![upright(0.499), upright(0.5)]),
        ("1 cm", vec![upright(0.49), upright(0.5)]),
        ("a fine mesh", vec![Mesh { material: 2, ..tessellated("wall", DVec3::X * 0.5, z, y, 40) }]),
        ("leaning away", vec![leaning(0.1)]),
        ("leaning over", vec![leaning(-0.1)]),
        ("from below the floor", vec![Mesh::parallelogram("wall", dvec3(0.5, -0.3, 0.0), z, 1.3 * y, 2)]),
    ];
    for (name, walls) in walls {
        for radius in RADII {
            assert_holds(format!("{name}, radius {radius:?}"), known::behind_a_wall(&gpu, walls.clone(), radius));
        }
    }
}

/// However little of the disc a surface is, its photons lie on its own area.
#[test]
fn what_is_tiny_beside_the_radius_is_as_light_as_all_of_the_furnace() {
    let Some(gpu) = device() else { return };
    assert_holds("tiny plates", known::tiny_plates(&gpu));
}

#[test]
fn the_floor_beside_a_box_is_as_light_as_all_of_the_furnace() {
    let Some(gpu) = device() else { return };
    for radius in RADII {
        assert_holds(format!("radius {radius:?}"), known::beside_a_box(&gpu, radius));
    }
}
