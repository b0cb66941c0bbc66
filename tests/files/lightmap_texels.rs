//! Lightmaps without their light: coordinates that do not overlap, texels that lie on their triangles,
//! filled gutters, files that hold what they were given and open again.

use super::gltf::{assert_said, everything};
use crate::common::known::of_any_room;
use crate::common::layered::row_of_texels;
use crate::common::prelude::*;
use crate::common::program::entries;
use crate::common::rendered::light;
use photonmill::bake::{self, Layout, MAX_SIDE, Map, MeshLightmap, PHASE_COUNT, TexelEstimate};
use photonmill::engine::scene::Viewpoint;
use photonmill::output::destination::Folder;
use photonmill::scene::layers::{PARAMETERS, Parameter};
use photonmill::scene::material::{Coverage, Layers, Medium, NormalMap};
use photonmill::scene::texture::Filter;

const BLENDER: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/scenes/blender.glb");

pub fn open(path: impl AsRef<Path>) -> Scene {
    Scene::open(path.as_ref().to_str().unwrap(), false).unwrap()
}

/// A scene of one white mesh.
fn scene_of(mesh: Mesh) -> Scene {
    Scene { name: "one".into(), meshes: vec![mesh], materials: vec![matt(0.5)], ..Scene::default() }
}

/// The lightmap of one white mesh, and what was warned of.
fn lightmap_of(mesh: Mesh, texels_per_metre: f64) -> (MeshLightmap, Vec<String>) {
    let mut layout = Layout::new(&scene_of(mesh), texels_per_metre).unwrap();
    (layout.meshes.remove(0).unwrap(), layout.warnings)
}

/// A bumpy sheet with handles: no plane, no sphere.
fn torus(rings: u32, sides: u32) -> Mesh {
    let mut mesh = Mesh { name: "torus".into(), ..Mesh::default() };
    for ring in 0..rings {
        for side in 0..sides {
            let (a, b) = (f64::from(ring) / f64::from(rings) * TAU, f64::from(side) / f64::from(sides) * TAU);
            let radius = 0.35 * (1.0 + 0.2 * (3.0 * a).sin());
            let out = DVec3::new(a.cos(), 0.0, a.sin());
            mesh.positions.push(out * (1.0 + radius * b.cos()) + DVec3::Y * radius * b.sin());
            let vertex = |r: u32, s: u32| r % rings * sides + s % sides;
            let [p, q, r, s] = [vertex(ring, side), vertex(ring, side + 1), vertex(ring + 1, side + 1), vertex(ring + 1, side)];
            mesh.triangles.extend([[p, q, r], [p, r, s]]);
        }
    }
    mesh
}

/// Texel centres of a fine grid that lie well inside more than one triangle.
fn doubly_claimed(lightmap: &MeshLightmap) -> usize {
    let (columns, rows) = (4 * lightmap.width as usize, 4 * lightmap.height as usize);
    let mut claims = vec![0u8; columns * rows];
    for triangle in &lightmap.mesh.triangles {
        let size = DVec2::new(columns as f64, rows as f64);
        let [a, b, c] = triangle.map(|vertex| lightmap.uvs[vertex as usize] * size);
        let area = (b - a).perp_dot(c - a);
        let (low, high) = (a.min(b).min(c), a.max(b).max(c));
        for j in low.y.max(0.0) as usize..(high.y.ceil() as usize).min(rows) {
            for i in low.x.max(0.0) as usize..(high.x.ceil() as usize).min(columns) {
                let p = DVec2::new(i as f64 + 0.5, j as f64 + 0.5);
                let inside = [(a, b), (b, c), (c, a)].iter().all(|(from, to)| (*to - *from).perp_dot(p - *from) / area > 1e-3);
                claims[j * columns + i] += u8::from(inside);
            }
        }
    }
    claims.iter().filter(|claims| **claims > 1).count()
}

/// Area that the triangle has in the map, texels.
fn texel_area(lightmap: &MeshLightmap, triangle: usize) -> f64 {
    let size = DVec2::new(lightmap.width.into(), lightmap.height.into());
    let [a, b, c] = lightmap.mesh.triangles[triangle].map(|vertex| lightmap.uvs[vertex as usize] * size);
    0.5 * (b - a).perp_dot(c - a).abs()
}

#[test]
fn unwrapped_meshes_do_not_overlap_and_keep_their_density() {
    let meshes = [
        (Mesh::parallelogram("wall", DVec3::ZERO, DVec3::X * 2.0, DVec3::new(0.3, 0.0, 1.0), 0), 64.0),
        (Mesh::sphere("ball", DVec3::new(1e6, -2.0, 3.0), 0.5, 48, 0), 64.0),
        (torus(60, 24), 32.0),
        // Enough triangles to be cut and packed in the faster way.
        (torus(204, 50), 32.0),
        // As small as bacteria, as large as a country.
        (Mesh::sphere("spore", DVec3::ZERO, 1e-6, 24, 0), 64e6),
        (Mesh::parallelogram("land", DVec3::ZERO, DVec3::X * 1e6, DVec3::Z * 1e6, 0), 1e-4),
    ];
    for (mesh, density) in meshes {
        let (name, triangles, original) = (mesh.name.clone(), mesh.triangles.len(), mesh.clone());
        let (lightmap, warnings) = lightmap_of(mesh, density);
        assert_eq!(warnings, Vec::<String>::new(), "{name}");
        assert_eq!((lightmap.mesh.triangles.len(), lightmap.is_second_set), (triangles, false), "{name}");
        assert_eq!(lightmap.uvs.len(), lightmap.mesh.positions.len());
        assert!(lightmap.uvs.iter().all(|uv| uv.min_element() >= 0.0 && uv.max_element() <= 1.0), "{name}");
        assert_eq!(doubly_claimed(&lightmap), 0, "{name}");
        for triangle in 0..triangles {
            assert_eq!(lightmap.mesh.corners(triangle), original.corners(triangle), "{name} {triangle}");
            let share = texel_area(&lightmap, triangle) / (lightmap.mesh.area(triangle) * density * density);
            assert!((0.4..2.5).contains(&share), "{name}: triangle {triangle} has {share} of its texels");
        }
        let whole = (0..triangles).map(|triangle| texel_area(&lightmap, triangle)).sum::<f64>();
        let wanted = (0..triangles).map(|triangle| original.area(triangle)).sum::<f64>() * density * density;
        assert!((0.8..1.25).contains(&(whole / wanted)), "{name}: {whole} texels of {wanted}");
    }
}

#[test]
fn charts_stand_apart() {
    let (lightmap, _) = lightmap_of(torus(60, 24), 32.0);
    // Vertices that share a triangle share a chart, which has the number of its first vertex.
    let mut chart: Vec<usize> = (0..lightmap.uvs.len()).collect();
    let mut is_changed = true;
    while is_changed {
        is_changed = false;
        for triangle in &lightmap.mesh.triangles {
            let charts = triangle.map(|vertex| chart[vertex as usize]);
            let first = charts.into_iter().min().expect("there are three");
            is_changed |= charts != [first; 3];
            triangle.iter().for_each(|vertex| chart[*vertex as usize] = first);
        }
    }
    let vertex_of = |triangle: u32| lightmap.mesh.triangles[triangle as usize][0] as usize;
    let of_texel: BTreeMap<(u32, u32), usize> =
        lightmap.texels.iter().map(|texel| ((texel.x, texel.y), chart[vertex_of(texel.points[0].triangle)])).collect();
    let charts: BTreeSet<usize> = of_texel.values().copied().collect();
    assert!(charts.len() > 1, "a torus is cut into several charts");
    for ((x, y), own) in &of_texel {
        for (dx, dy) in (-2..=2).flat_map(|dx| (-2..=2).map(move |dy| (dx, dy))) {
            let place = (x.wrapping_add_signed(dx), y.wrapping_add_signed(dy));
            assert!(of_texel.get(&place).is_none_or(|other| other == own), "charts {own} and another within two texels of {x} {y}");
        }
    }
}

/// What is wrong with the points of a lightmap's texels.
fn wrong_points(lightmap: &MeshLightmap) -> Vec<String> {
    let mut wrong = Vec::new();
    let size = DVec2::new(lightmap.width.into(), lightmap.height.into());
    for texel in &lightmap.texels {
        for point in &texel.points {
            let sample = point.sample(&lightmap.mesh);
            let [a, b, c] = lightmap.mesh.corners(point.triangle as usize);
            // The three parts into which the point cuts its triangle have the triangle's area.
            let parts = [(a, b), (b, c), (c, a)].map(|(p, q)| 0.5 * (p - sample.position).cross(q - sample.position).length());
            let area = lightmap.mesh.area(point.triangle as usize);
            if (parts.iter().sum::<f64>() - area).abs() > 1e-5 * area {
                wrong.push(format!("{} lies beside its triangle", sample.position));
            }
            // Its place in the map is within the texel, unless the triangle is smaller than that.
            let [u, v, w] = lightmap.mesh.triangles[point.triangle as usize].map(|vertex| lightmap.uvs[vertex as usize] * size);
            let [second, third] = point.weights.map(f64::from);
            let place = u * (1.0 - second - third) + v * second + w * third;
            let beside = place - DVec2::new(f64::from(texel.x) + 0.5, f64::from(texel.y) + 0.5);
            if beside.abs().max_element() > 0.5 + 1e-3 {
                wrong.push(format!("{place} is no place in texel {} {}", texel.x, texel.y));
            }
            let unit = |normal: DVec3| (normal.length() - 1.0).abs() < 1e-9;
            if !unit(sample.geometric_normal) || !unit(sample.shading_normal) || sample.shading_normal.dot(sample.geometric_normal) <= 0.0 {
                wrong.push(format!("{sample:?} has wrong normals"));
            }
        }
    }
    wrong
}

#[test]
fn texels_lie_on_their_triangles_and_every_triangle_has_some() {
    let mut scene = open(BLENDER);
    // Apart: what lies in another solid has no texels.
    let mut torus = torus(60, 24);
    torus.positions.iter_mut().for_each(|position| *position += 100.0 * DVec3::X);
    scene.meshes.push(torus);
    scene.meshes.push(Mesh::sphere("ball", 200.0 * DVec3::X, 0.4, 32, 0));
    let layout = Layout::new(&scene, 32.0).unwrap();
    assert!(layout.lightmaps().count() > 3);
    for (_, lightmap) in layout.lightmaps() {
        let name = &lightmap.mesh.name;
        assert_eq!(wrong_points(lightmap), Vec::<String>::new(), "{name}");
        let places: BTreeSet<(u32, u32)> = lightmap.texels.iter().map(|texel| (texel.y, texel.x)).collect();
        assert_eq!(places.len(), lightmap.texels.len(), "{name}: a texel is listed twice");
        assert!(lightmap.texels.is_sorted_by_key(|texel| (texel.y, texel.x)), "{name}");
        let seen: BTreeSet<u32> = lightmap.texels.iter().flat_map(|texel| texel.points.map(|point| point.triangle)).collect();
        let size = DVec2::new(lightmap.width.into(), lightmap.height.into());
        for (index, triangle) in lightmap.mesh.triangles.iter().enumerate() {
            let centroid = triangle.iter().map(|vertex| lightmap.uvs[*vertex as usize] * size).sum::<DVec2>() / 3.0;
            assert!(places.contains(&(centroid.y as u32, centroid.x as u32)), "{name}: triangle {index} lies in no covered texel");
            // A triangle of two texels is looked at itself.
            assert!(texel_area(lightmap, index) < 4.0 || seen.contains(&(index as u32)), "{name}: triangle {index} has no point");
        }
    }

    let mut spoilt = layout.meshes.into_iter().flatten().next().unwrap();
    spoilt.texels[0].points[1].weights[0] += 0.7;
    assert!(!wrong_points(&spoilt).is_empty());
}

#[test]
fn phases_are_of_one_length_and_their_mean_is_the_texel() {
    let wall = Mesh::parallelogram("wall", DVec3::ZERO, DVec3::X, DVec3::Z * 0.5, 0);
    let scene = scene_of(wall);
    let layout = Layout::new(&scene, 40.0).unwrap();
    let phases = layout.phases();
    assert_eq!(phases.len(), PHASE_COUNT);
    let lightmap = layout.meshes[0].as_ref().unwrap();
    let (mut inner, mut four_points) = (0, 0);
    for (index, texel) in lightmap.texels.iter().enumerate() {
        let positions: Vec<DVec3> = phases.iter().map(|phase| phase[index].position).collect();
        assert!(phases.iter().all(|phase| phase.len() == layout.texel_count() && phase[index].geometric_normal == DVec3::NEG_Y));
        let has = |x: u32, y: u32| lightmap.texels.iter().any(|texel| (texel.x, texel.y) == (x, y));
        if [(1, 0), (0, 1), (-1, 0), (0, -1)].iter().all(|(x, y)| has(texel.x.wrapping_add_signed(*x), texel.y.wrapping_add_signed(*y))) {
            inner += 1;
            // Four different points, a quarter texel (of 1/40 m) apart at least.
            let apart = positions.iter().enumerate().flat_map(|(k, p)| positions[..k].iter().map(move |q| p.distance(*q)));
            four_points += usize::from(apart.fold(f64::INFINITY, f64::min) > 0.25 / 40.0);
        }
    }
    assert!(inner > 600 && four_points == inner, "{four_points} of {inner}");
}

/// A wall of two triangles, its second set given.
fn wall_with(second_set: [[f64; 2]; 4]) -> Mesh {
    let mut wall = Mesh::parallelogram("bake wall", DVec3::ZERO, DVec3::X * 2.0, DVec3::Y, 0);
    wall.uvs[1] = second_set.map(DVec2::from).to_vec();
    wall
}

#[test]
fn a_good_second_set_is_taken() {
    let (lightmap, warnings) = lightmap_of(wall_with([[0.1, 0.1], [0.9, 0.1], [0.9, 0.9], [0.1, 0.9]]), 32.0);
    assert_eq!((lightmap.is_second_set, warnings), (true, Vec::new()));
    assert_eq!(lightmap.uvs, lightmap.mesh.uvs[1]);
    // Two metres on 0.8 of the width, one on 0.8 of the height.
    assert_eq!((lightmap.width, lightmap.height), (80, 40));
    assert_eq!(doubly_claimed(&lightmap), 0);
    // A mirrored one is none the worse.
    let (mirrored, warnings) = lightmap_of(wall_with([[1.0, 0.0], [0.0, 0.0], [0.0, 1.0], [1.0, 1.0]]), 32.0);
    assert_eq!((mirrored.is_second_set, warnings, mirrored.width), (true, Vec::new(), 64));
}

#[test]
fn a_bad_second_set_is_named_and_replaced() {
    let bad = [
        ("overlaps itself", [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 0.2]]),
        ("leaves the range", [[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [0.0, 1.0]]),
        ("not finite", [[0.0, 0.0], [f64::NAN, 0.0], [1.0, 1.0], [0.0, 1.0]]),
        ("no area", [[0.5, 0.5]; 4]),
        ("no area", [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.5, 0.5]]),
    ];
    for (reason, second_set) in bad {
        let (lightmap, warnings) = lightmap_of(wall_with(second_set), 32.0);
        let [warning] = warnings.as_slice() else { panic!("{reason}: {warnings:?}") };
        assert!(warning.contains("'bake wall'") && warning.contains(reason), "{warning}");
        assert!(!lightmap.is_second_set && doubly_claimed(&lightmap) == 0, "{reason}");
    }
    // The check of this file sees what the layout refuses.
    let (mut spoilt, _) = lightmap_of(wall_with(bad[0].1), 32.0);
    spoilt.uvs = bad[0].1.map(DVec2::from)[..].to_vec();
    spoilt.mesh = wall_with(bad[0].1);
    assert!(doubly_claimed(&spoilt) > 100);
}

/// A cube of one metre whose faces have vertices of their own. `place` takes a corner of a face, from 0 to 1, to the second set.
fn cube_with(place: impl Fn(usize, DVec2) -> DVec2) -> Mesh {
    let mut cube = Mesh { name: "cube".into(), ..Mesh::default() };
    for face in 0..6 {
        let normal = DVec3::AXES[face % 3] * if face < 3 { 1.0 } else { -1.0 };
        let (u, v) = (DVec3::AXES[(face + 1) % 3], normal.cross(DVec3::AXES[(face + 1) % 3]));
        let first = cube.positions.len() as u32;
        for corner in [DVec2::ZERO, DVec2::X, DVec2::ONE, DVec2::Y] {
            cube.positions.push(0.5 * normal + u * (corner.x - 0.5) + v * (corner.y - 0.5));
            cube.uvs[0].push(corner);
            cube.uvs[1].push(place(face, corner));
        }
        cube.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
    }
    cube
}

#[test]
fn a_second_set_whose_charts_would_bleed_is_replaced() {
    // Faces of 8 x 8 texels in a grid of 3 x 2, so many texels apart.
    let apart = |texels: f64| {
        let size = DVec2::new(24.0 + 3.0 * texels, 16.0 + 2.0 * texels);
        move |face: usize, corner: DVec2| {
            (DVec2::new((face % 3) as f64, (face / 3) as f64) * (8.0 + texels) + 0.5 * texels + 8.0 * corner) / size
        }
    };
    for (texels, is_good) in [(0.0, false), (1.0, false), (2.0, true), (4.0, true)] {
        let (lightmap, warnings) = lightmap_of(cube_with(apart(texels)), 8.0);
        assert_eq!((lightmap.is_second_set, warnings.is_empty()), (is_good, is_good), "{texels} texels apart: {warnings:?}");
        assert!(is_good || warnings[0].contains("'cube'") && warnings[0].contains("bleed"), "{warnings:?}");
    }
    // A map twice as coarse has half the distance.
    assert!(!lightmap_of(cube_with(apart(2.0)), 4.0).0.is_second_set);
    // Where the surface goes on, charts touch as they like: half a wall on the other, with vertices that do not meet.
    let mut wall = Mesh { name: "wall".into(), ..Mesh::default() };
    for [left, right, low, high] in [[0.0, 1.0, 0.0, 0.5], [0.0, 0.3, 0.5, 1.0], [0.3, 1.0, 0.5, 1.0]] {
        let first = wall.positions.len() as u32;
        wall.uvs[1].extend([[left, low], [right, low], [right, high], [left, high]].map(DVec2::from));
        wall.positions = wall.uvs[1].iter().map(|at| (2.0 * *at).extend(0.0)).collect();
        wall.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
    }
    let (lightmap, warnings) = lightmap_of(wall.clone(), 16.0);
    assert_eq!((lightmap.is_second_set, warnings), (true, Vec::new()));
    // With the upper parts exchanged in space they do not.
    wall.positions[4..8].iter_mut().for_each(|position| *position += DVec3::Z);
    assert!(!lightmap_of(wall, 16.0).0.is_second_set);
}

#[test]
fn no_map_is_finer_than_requested() {
    // Faces in one row are too long for the map, in several they are not.
    let scene = scene_of(cube_with(|_, _| DVec2::ZERO));
    let layout = |max_side: u32| Layout::of_file(&scene, None, 8.0, max_side).unwrap();
    let texels = |layout: &Layout| (layout.texel_count(), layout.warnings.iter().any(|warning| warning.contains("fewer texels")));
    assert_eq!(texels(&layout(MAX_SIDE)), (6 * 64, false));
    assert_eq!(texels(&layout(61)), (6 * 64, false));
    let small = layout(61);
    assert!(small.objects[0].width.max(small.objects[0].height) <= 61 && doubly_claimed(small.meshes[0].as_ref().unwrap()) == 0);
    // In no way do they fit.
    let (count, is_coarse) = texels(&layout(24));
    assert!(count < 6 * 64 && is_coarse, "{count}");

    // Nor is that of meshes that are smaller than a few texels, with new charts and with their own but for a whole texel.
    for size in [1.0, 0.1, 0.01] {
        let mut cube = cube_with(|_, _| DVec2::ZERO);
        cube.positions.iter_mut().for_each(|position| *position *= size);
        let (lightmap, _) = lightmap_of(cube, 8.0);
        // Of texels per metre, the mean of both directions.
        let densities: Vec<f64> = (0..12).map(|k| (texel_area(&lightmap, k) / lightmap.mesh.area(k)).sqrt()).collect();
        assert!(densities.iter().all(|density| (7.0..9.0).contains(density)), "{size} m: {densities:?} texels per metre");
        assert!(doubly_claimed(&lightmap) == 0 && wrong_points(&lightmap).is_empty() && lightmap.texels.len() >= 6);
    }
    let mut wall = wall_with([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]);
    wall.positions.iter_mut().for_each(|position| *position *= 0.1);
    let area = wall.area(0) + wall.area(1);
    let (lightmap, _) = lightmap_of(wall, 8.0);
    assert!(lightmap.is_second_set && f64::from(lightmap.width * lightmap.height) <= (64.0 * area).ceil(), "{lightmap:?}");
}

#[test]
fn large_maps_are_coarser_and_too_many_texels_are_refused() {
    let wall = || Mesh::parallelogram("great wall", DVec3::ZERO, DVec3::X * 100.0, DVec3::Y * 10.0, 0);
    let low = || Mesh::parallelogram("great wall", DVec3::ZERO, DVec3::X * 100.0, DVec3::Y * 0.25, 0);
    for mesh in [low(), Mesh { uvs: [Vec::new(), low().uvs[0].clone()], ..low() }] {
        let (lightmap, warnings) = lightmap_of(mesh, 100.0);
        assert!(lightmap.width.max(lightmap.height) == MAX_SIDE, "{} x {}", lightmap.width, lightmap.height);
        assert!(matches!(warnings.as_slice(), [warning] if warning.contains("4096") && warning.contains("'great wall'")), "{warnings:?}");
    }
    // Far less than a texel a mesh is still a map.
    let (tiny, warnings) = lightmap_of(torus(12, 8), 1e-9);
    assert!(warnings.is_empty() && tiny.width.min(tiny.height) >= 4 && !tiny.texels.is_empty(), "{} x {}", tiny.width, tiny.height);
    for density in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let error = Layout::new(&scene_of(wall()), density).unwrap_err();
        assert!(error.exit_code() == 2 && error.to_string().contains("`texels_per_metre`"), "{error}");
    }
    let mut scene = scene_of(wall());
    scene.meshes = (0..42).map(|_| Mesh { uvs: [Vec::new(), wall().uvs[0].clone()], ..wall() }).collect();
    let error = Layout::new(&scene, 1e4).unwrap_err().to_string();
    assert!(error.contains("`texels_per_metre` 10000") && !error.contains('\n'), "{error}");
}

#[test]
fn mirrors_and_glass_have_no_map() {
    let scene = open("cornell-spheres");
    let layout = Layout::new(&scene, 64.0).unwrap();
    for (mesh, lightmap) in pairs(&scene.meshes, &layout.meshes) {
        assert_eq!(lightmap.is_none(), scene.materials[mesh.material].surface.is_specular(), "{}", mesh.name);
    }
    let mut mirrors = scene_of(Mesh::sphere("ball", DVec3::ZERO, 1.0, 8, 0));
    mirrors.materials[0].surface = Surface::Mirror;
    let layout = Layout::new(&mirrors, 64.0).unwrap();
    assert_eq!((layout.texel_count(), layout.warnings.len()), (0, 0));
}

/// Results that name their texel.
pub fn numbered(layout: &Layout) -> Vec<TexelEstimate> {
    let estimate = |index: usize| TexelEstimate {
        irradiance: Vec3::new(index as f32 + 1.0, 0.5, 0.25),
        standard_error: Vec3::new(0.125, index as f32 + 1.0, 0.0),
        unseen: index as f32 + 2.0,
    };
    (0..layout.texel_count()).map(estimate).collect()
}

#[test]
fn gutters_are_filled_from_the_nearest_texel() {
    let scene = scene_of(torus(24, 10));
    let layout = Layout::new(&scene, 12.0).unwrap();
    let [map] = &layout.maps(&numbered(&layout), Default::default())[..] else { panic!("one map") };
    let lightmap = layout.meshes[0].as_ref().unwrap();
    assert_eq!(map.irradiance.len(), (map.width * map.height) as usize);
    assert!(lightmap.texels.len() < map.irradiance.len(), "there is a gutter");
    for (place, (irradiance, error)) in pairs(&map.irradiance, &map.error).enumerate() {
        let (x, y) = (place as u32 % map.width, place as u32 / map.width);
        let distance = |index: usize| {
            let texel = &lightmap.texels[index];
            texel.x.abs_diff(x).pow(2) + texel.y.abs_diff(y).pow(2)
        };
        let least = (0..lightmap.texels.len()).map(distance).min().unwrap();
        let source = irradiance.x as usize - 1;
        assert_eq!(distance(source), least, "texel {x} {y}");
        assert_eq!((irradiance.y, irradiance.z, error.y), (0.5, 0.25, irradiance.x), "texel {x} {y}");
        if least == 0 {
            assert_eq!((lightmap.texels[source].x, lightmap.texels[source].y), (x, y));
        }
    }
}

#[test]
fn the_same_scene_gives_the_same_layout() {
    let scene = open(BLENDER);
    let layouts = [1, 4].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| Layout::new(&scene, 16.0).unwrap())
    });
    let [first, second] = &layouts;
    assert_eq!(first.phases(), second.phases());
    for ((_, a), (_, b)) in pairs(first.lightmaps(), second.lightmaps()) {
        assert_eq!((a.width, a.height, &a.uvs, &a.texels), (b.width, b.height, &b.uvs, &b.texels));
    }
    let folders = layouts.each_ref().map(|layout| write(&scene, layout, &numbered(layout), 0.01).0);
    let names = entries(folders[0].path());
    assert_eq!(names, entries(folders[1].path()));
    for name in names {
        let [one, two] = folders.each_ref().map(|folder| std::fs::read(folder.path().join(&name)).unwrap());
        assert!(one == two, "{name} differs");
    }
}

fn write(scene: &Scene, layout: &Layout, results: &[TexelEstimate], exposure: f32) -> (tempfile::TempDir, Vec<Map>) {
    let folder = tempfile::tempdir().unwrap();
    let maps = layout.maps(results, Default::default());
    bake::write(&Folder::open("-o", folder.path()).unwrap(), scene, layout, &maps, exposure).unwrap();
    (folder, maps)
}

/// Both written scenes hold the geometry of the one they were made from.
fn assert_same_geometry(written: &Scene, scene: &Scene) {
    let (low, high) = scene.bounds();
    let extent = (high - low).max_element();
    for (written, mesh) in pairs(&written.meshes, &scene.meshes) {
        assert_eq!((&written.name, written.normals.is_empty()), (&mesh.name, mesh.normals.is_empty()));
        for (corner, (new, old)) in pairs(written.triangles.as_flattened(), mesh.triangles.as_flattened()).enumerate() {
            let (new, old) = (*new as usize, *old as usize);
            let difference = written.positions[new].distance(mesh.positions[old]);
            assert!(difference < 1e-6 * extent, "{}: corner {corner} moved by {difference}", mesh.name);
            if !mesh.normals.is_empty() {
                assert!(written.normals[new].distance(mesh.normals[old]) < 1e-5, "{}: normal of corner {corner}", mesh.name);
            }
            if !mesh.uvs[0].is_empty() {
                assert!(written.uvs[0][new].distance(mesh.uvs[0][old]) < 1e-5, "{}: coordinates of corner {corner}", mesh.name);
            }
        }
    }
    for (written, camera) in pairs(&written.cameras, &scene.cameras) {
        assert_eq!(written.name, camera.name);
        assert!(written.eye.distance(camera.eye) < 1e-5 * extent && written.forward.distance(camera.forward) < 1e-5, "{}", camera.name);
        assert!(written.up.distance(camera.up) < 1e-5 && (written.half_height() - camera.half_height()).abs() < 1e-6, "{}", camera.name);
    }
}

/// What is nearest to a material among those of glTF.
fn as_gltf(material: &Material) -> Material {
    let layers = match material.surface {
        Surface::Layered => material.layers,
        Surface::Lambert | Surface::PaperPhong { .. } => Layers { metallic: 0.0, specular: 0.0, ..Layers::default() },
        Surface::Glossy { exponent } => Layers { roughness: (2.0 / (exponent + 2.0)).powf(0.25), ..Layers::default() },
        Surface::Mirror => Layers { roughness: 0.0, ..Layers::default() },
        Surface::Dielectric { ior } => {
            let medium = Some(Medium::CLEAR);
            Layers { metallic: 0.0, roughness: 0.0, transmission: 1.0, ior, medium, ..Layers::default() }
        }
    };
    let material = Material { surface: Surface::Layered, layers, ..material.clone() };
    Material { surface: if material.is_lambertian() { Surface::Lambert } else { Surface::Layered }, ..material }
}

/// The uses of textures that a material has, taken out of it.
fn take_textures(material: &mut Material) -> Vec<Option<TextureUse>> {
    let one = |map: &mut Option<NormalMap>| map.as_mut().map(|map| std::mem::replace(&mut map.texture, TextureUse::of(0, 0)));
    let layers = &mut material.layers;
    let of_layers = PARAMETERS.iter().flat_map(|(_, members)| *members).filter_map(|(_, parameter)| match parameter {
        Parameter::NumberTexture(_, of) | Parameter::ColourTexture(_, of) => Some(of(layers).take()),
        Parameter::NormalMap(_, of) => Some(one(of(layers))),
        Parameter::Number(..) | Parameter::Colour(..) => None,
    });
    let plain = [one(&mut material.normal_map), material.base_colour_texture.take(), material.emission_texture.take()];
    plain.into_iter().chain(of_layers).collect()
}

fn assert_same_materials(written: &Scene, scene: &Scene) {
    for (written_mesh, mesh) in pairs(&written.meshes, &scene.meshes) {
        let (mut new, mut old) = (written.materials[written_mesh.material].clone(), as_gltf(&scene.materials[mesh.material]));
        let coordinates = |mesh: &Mesh, used: TextureUse| {
            let uv = |vertex: &u32| mesh.uvs[used.uv_set].get(*vertex as usize).copied().unwrap_or_default();
            mesh.triangles.as_flattened().iter().map(uv).collect::<Vec<DVec2>>()
        };
        // A lightmap takes the place of the second set, and no third is read.
        let are_both_used = [0, 1].iter().all(|set| old.textures().any(|used| used.uv_set == *set));
        for (slot, (new, old)) in pairs(take_textures(&mut new), take_textures(&mut old)).enumerate() {
            let (Some(new), Some(old)) = (new, old) else {
                assert_eq!(new, old, "{}: {slot}", mesh.name);
                continue;
            };
            let (from, to) = (new.transform, old.transform);
            assert!((from.scale - to.scale).length() + (from.offset - to.offset).length() + (from.rotation - to.rotation).abs() < 1e-6);
            assert!(are_both_used || coordinates(written_mesh, new) == coordinates(mesh, old), "{}: {slot}", mesh.name);
            let (new, old) = (&written.textures[new.texture], &scene.textures[old.texture]);
            assert_eq!((new.width, new.height, new.wrap, new.filter), (old.width, old.height, old.wrap, old.filter));
            match &old.texels {
                // Written as colours of eight bits each.
                Texels::Float(_) => assert!((0..old.texels.count()).all(|k| new.texels.at(k) == old.texels.at(k)), "{slot}"),
                texels => assert_eq!(new.texels, *texels, "{}: {slot}", mesh.name),
            }
        }
        assert!((new.emission - old.emission).abs().max_element() <= 1e-6 * old.emission.max_element(), "{}", old.name);
        new.emission = old.emission;
        assert_eq!(new, old);
    }
}

/// Coordinates of the lightmap as another reader of glTF sees them.
fn assert_lightmap_coordinates(path: &Path, layout: &Layout) {
    let (document, buffers, images) = gltf::import(path).unwrap();
    assert!(!images.is_empty());
    for (mesh, lightmap) in pairs(document.meshes(), &layout.meshes) {
        let primitive = mesh.primitives().next().unwrap();
        let reader = primitive.reader(|buffer| Some(&buffers[buffer.index()]));
        let Some(lightmap) = lightmap else { continue };
        let read: Vec<[f32; 2]> = reader.read_tex_coords(1).expect("TEXCOORD_1").into_f32().collect();
        assert_eq!(read, lightmap.uvs.iter().map(|uv| uv.as_vec2().to_array()).collect::<Vec<_>>(), "{}", lightmap.mesh.name);
        assert_eq!(reader.read_indices().unwrap().into_u32().count(), 3 * lightmap.mesh.triangles.len());
        assert!(primitive.attributes().all(|(_, accessor)| accessor.count() == lightmap.mesh.positions.len()));
    }
}

#[test]
fn written_scenes_open_again() {
    for name in ["cornell-spheres", "cornell", BLENDER] {
        let scene = open(name);
        let layout = Layout::new(&scene, 32.0).unwrap();
        let (folder, _) = write(&scene, &layout, &numbered(&layout), 1e-3);
        for file in ["scene.gltf", "scene_lightmap.gltf"] {
            let written = open(folder.path().join(file));
            assert_same_geometry(&written, &scene);
            assert_lightmap_coordinates(&folder.path().join(file), &layout);
        }
        let with_lightmaps = open(folder.path().join("scene_lightmap.gltf"));
        assert_same_materials(&with_lightmaps, &scene);
        assert!(with_lightmaps.lights.is_empty());

        let emissive = open(folder.path().join("scene.gltf"));
        for ((mesh, before), lightmap) in pairs(pairs(&emissive.meshes, &scene.meshes), &layout.meshes) {
            let material = &emissive.materials[mesh.material];
            assert_eq!(material.coverage, scene.materials[before.material].coverage, "{}", mesh.name);
            let Some(TextureUse { texture, uv_set, .. }) = material.emission_texture.filter(|_| lightmap.is_some()) else {
                assert!(lightmap.is_none(), "{}: no radiance", mesh.name);
                continue;
            };
            let lightmap = lightmap.as_ref().unwrap();
            assert_eq!((material.base_colour, material.emission, uv_set), (Vec3::ZERO, Vec3::ONE, 1));
            assert_eq!((emissive.textures[texture].width, emissive.textures[texture].height), (lightmap.width, lightmap.height));
        }
        assert_same_lights(&emissive, &scene);
    }
}

fn assert_same_lights(written: &Scene, scene: &Scene) {
    let near = |a: Vec3, b: Vec3| (a - b).abs().max_element() <= 1e-5 * b.max_element();
    let close = |a: DVec3, b: DVec3| a.distance(b) < 1e-5 * (1.0 + b.length());
    // Position, direction, strength, and the angles of a cone, as far as a kind has them.
    let parts = |light: &Light| match light.kind {
        LightKind::Point { position, intensity } => (position, DVec3::ZERO, intensity, None),
        LightKind::Directional { direction, irradiance } => (DVec3::ZERO, direction, irradiance, None),
        LightKind::Spot { position, direction, intensity, inner_angle, outer_angle } => {
            (position, direction, intensity, Some([inner_angle, outer_angle]))
        }
        _ => panic!("{light:?} is none of glTF's"),
    };
    for (written, light) in pairs(&written.lights, &scene.lights) {
        let ((position, direction, strength, cone), expected) = (parts(written), parts(light));
        let is_same = close(position, expected.0) && close(direction, expected.1) && near(strength, expected.2) && cone == expected.3;
        assert!(is_same && written.name == light.name, "{written:?} was {light:?}");
    }
}

/// One mesh of every kind of surface, a texture on both sets, all lights.
fn zoo() -> Scene {
    let square = |place: usize, material: usize| {
        let mut mesh = Mesh::parallelogram("a square", DVec3::X * (2 * place) as f64, DVec3::X, DVec3::Y, material);
        mesh.uvs[1] = [[0.25, 0.0], [0.75, 0.0], [0.75, 3.0], [0.25, 3.0]].map(DVec2::from).to_vec();
        if place == 1 {
            mesh.colours = [DVec3::X, DVec3::Y, DVec3::Z, DVec3::ONE].to_vec();
        }
        mesh
    };
    let material = |name: &str, surface: Surface| Material { surface, ..Material::lambert(name, Vec3::new(0.5, 0.25, 1.0)) };
    let used = |texture, uv_set| Some(TextureUse::of(texture, uv_set));
    let mut lamp = Material { emission: Vec3::new(0.5, 8.0, 2.0), two_sided: true, ..material("lamp", Surface::Lambert) };
    let transform = UvTransform { scale: DVec2::new(2.0, -0.5), rotation: 0.75, offset: DVec2::new(0.25, 3.0) };
    (lamp.base_colour_texture, lamp.emission_texture) = (used(2, 0), Some(TextureUse { transform, ..TextureUse::of(1, 1) }));
    let second = Material { base_colour_texture: used(2, 1), ..material("second", Surface::Lambert) };
    let texture = |name: &str, texels: Vec<Vec3>, wrap| {
        let width = texels.len() as u32;
        Texture { name: name.into(), width, texels: texels.into(), wrap, ..row_of_texels(&[], Filter::Bilinear) }
    };
    let light = |name: &str, kind| Light { name: format!("light '{name}'"), kind };
    let (position, direction, intensity) = (DVec3::ONE, DVec3::Z, Vec3::splat(0.5));
    Scene {
        name: "zoo".into(),
        meshes: (0..6).map(|place| square(place, place)).collect(),
        materials: vec![
            lamp,
            second,
            material("metal", Surface::Glossy { exponent: 40.0 }),
            material("mirror", Surface::Mirror),
            material("glass", Surface::Dielectric { ior: 1.33 }),
            material("white", Surface::Lambert),
        ],
        textures: vec![
            texture("unused", vec![Vec3::ONE], [Wrap::Repeat; 2]),
            texture("glow", vec![Vec3::X, Vec3::ONE], [Wrap::Clamp, Wrap::Repeat]),
            texture("checker", vec![Vec3::ONE, Vec3::ZERO, Vec3::Y], [Wrap::MirroredRepeat; 2]),
        ],
        lights: vec![
            light("bulb", LightKind::Point { position: DVec3::Y, intensity: Vec3::new(1.0, 2.0, 3.0) }),
            light("sun", LightKind::Directional { direction: DVec3::new(0.6, -0.8, 0.0), irradiance: Vec3::splat(5.0) }),
            light("beam", LightKind::Spot { position, direction, intensity, inner_angle: 0.25, outer_angle: 0.5 }),
        ],
        cameras: vec![Camera::looking_at("eye", DVec3::new(3.0, 4.0, 5.0), DVec3::ZERO, DVec3::Y, 0.8)],
        ..Scene::default()
    }
}

#[test]
fn every_surface_light_and_texture_round_trips() {
    let scene = zoo();
    let layout = Layout::new(&scene, 16.0).unwrap();
    let (folder, _) = write(&scene, &layout, &numbered(&layout), 1.0);
    let written = open(folder.path().join("scene_lightmap.gltf"));
    assert_same_materials(&written, &scene);
    assert_same_lights(&open(folder.path().join("scene.gltf")), &scene);
    assert!(!folder.path().join("texture_0.png").exists(), "nothing uses it");

    let (second, original) = (&written.meshes[1], &scene.meshes[1]);
    for (new, old) in pairs(second.triangles.as_flattened(), original.triangles.as_flattened()) {
        assert_eq!(second.colours[*new as usize], original.colours[*old as usize]);
    }
    assert!(written.meshes[0].colours.is_empty());
    // Only the second set is used: it is the first one now.
    assert_eq!(written.materials[second.material].base_colour_texture.unwrap().uv_set, 0);
    assert!(second.uvs[0].iter().any(|uv| uv.y == 3.0), "{:?}", second.uvs[0]);
    // Both are used, and the second was no lightmap.
    let (document, buffers, _) = gltf::import(folder.path().join("scene_lightmap.gltf")).unwrap();
    let lamp = document.meshes().next().unwrap().primitives().next().unwrap();
    let moved: Vec<[f32; 2]> = lamp.reader(|buffer| Some(&buffers[buffer.index()])).read_tex_coords(2).unwrap().into_f32().collect();
    assert!(moved.contains(&[0.75, 3.0]), "{moved:?}");
    assert_eq!(lamp.material().emissive_texture().unwrap().tex_coord(), 2);
    assert_eq!(lamp.material().pbr_metallic_roughness().base_color_texture().unwrap().tex_coord(), 0);
}

/// Every field of a layered material, and tangents, alphas and samplers of the meshes, come back.
#[test]
fn layered_materials_round_trip() {
    let mut textures = Vec::new();
    let used = |k: u8, is_colour: bool| {
        let place = textures.len();
        let codes = (0..4u8).map(|texel| [texel, k, 7 * texel, 255 - (k % 3) * texel]).collect();
        textures.push(Texture {
            name: format!("{k}"),
            width: 2,
            height: 2,
            texels: if is_colour { Texels::Srgb(codes) } else { Texels::Linear(codes) },
            wrap: [[Wrap::Repeat, Wrap::Clamp], [Wrap::MirroredRepeat, Wrap::Repeat]][place % 2],
            filter: [Filter::Bilinear, Filter::Nearest][place % 2],
        });
        let transform = UvTransform { scale: DVec2::new(1.0, place as f64 + 1.0), rotation: 0.25, offset: DVec2::new(0.5, 0.0) };
        TextureUse { transform, ..TextureUse::of(place, 0) }
    };
    let everything = Material { coverage: Coverage::Mask { alpha: 0.7, cutoff: 0.3 }, ..everything(used) };
    let layers = everything.layers;
    // Each part alone, so that what decides whether an extension is written does.
    let usual = Layers::default();
    let tinted = Vec3::new(0.2, 0.4, 0.6);
    let medium = Some(Medium { transmittance: tinted, metres: 1.0 });
    let alone = [
        Layers { ior: 0.0, ..usual },
        Layers { diffuse_transmission: 0.5, ..usual },
        Layers { iridescence: 0.5, ..usual },
        Layers { anisotropy: 0.5, ..usual },
        Layers { film_thickness: [0.0, 400.0], ..usual },
        Layers { diffuse_transmission_colour: tinted, ..usual },
        Layers { dispersion: 0.5, transmission: 0.5, medium, ..usual },
        Layers { specular: 0.5, ..usual },
        Layers { specular_colour: tinted, ..usual },
        Layers { specular_texture: layers.specular_texture, ..usual },
        Layers { transmission: 0.5, ..usual },
        Layers { transmission: 0.5, medium, ..usual },
        Layers { coat: 0.5, ..usual },
        Layers { coat_normal_map: layers.coat_normal_map, coat: 1.0, ..usual },
        Layers { sheen_colour: tinted, ..usual },
        Layers { is_unlit: true, ..usual },
    ];
    let material = |(k, layers): (usize, &Layers)| Material {
        coverage: Coverage::Blend { alpha: 0.5 },
        ..Material::layered(&k.to_string(), tinted, *layers)
    };
    let materials: Vec<Material> = std::iter::once(everything).chain(alone.iter().enumerate().map(material)).collect();
    let mesh = |(k, material): (usize, &Material)| {
        let mut mesh = Mesh::parallelogram(&format!("square {k}"), DVec3::X * (2 * k) as f64, DVec3::X, DVec3::Y, k);
        mesh.normals = vec![DVec3::Z; 4];
        mesh.alphas = vec![1.0, 0.5, 0.25, 0.0];
        // The first mesh has colours beside alphas. Its tangents are not those of its texture coordinates.
        if k == 0 {
            mesh.colours = vec![DVec3::X, DVec3::Y, DVec3::Z, DVec3::ONE];
        }
        if material.tangent_coordinates().is_some() {
            mesh.tangents = vec![[DVec4::new(0.6, 0.8, 0.0, -1.0); 3]; 2];
        }
        mesh
    };
    let meshes = materials.iter().enumerate().map(mesh).collect();
    let scene = Scene { name: "layers".into(), meshes, materials: materials.clone(), textures, ..Scene::default() };
    let layout = Layout::new(&scene, 8.0).unwrap();
    let (folder, _) = write(&scene, &layout, &numbered(&layout), 1.0);
    let written = open(folder.path().join("scene_lightmap.gltf"));
    assert_same_materials(&written, &scene);
    // Squares are no solids.
    let is_expected = |warning: &String| ["MOZ_lightmap", "solids with holes"].iter().any(|part| warning.contains(part));
    assert!(written.warnings.iter().all(is_expected), "{:?}", written.warnings);
    for (new, old) in pairs(&written.meshes, &scene.meshes) {
        for (new_vertex, old_vertex) in pairs(new.triangles.as_flattened(), old.triangles.as_flattened()) {
            let (new_vertex, old_vertex) = (*new_vertex as usize, *old_vertex as usize);
            assert_eq!(new.alphas[new_vertex], old.alphas[old_vertex], "{}", old.name);
            assert_eq!(new.colours[new_vertex], old.colours.get(old_vertex).copied().unwrap_or(DVec3::ONE), "{}", old.name);
        }
        let near = |new: &DVec4, old: &DVec4| new.distance(*old) < 1e-6;
        assert_eq!(new.tangents.len(), old.tangents.len(), "{}", old.name);
        assert!(new.tangents.as_flattened().iter().zip(old.tangents.as_flattened()).all(|(new, old)| near(new, old)), "{}", old.name);
    }
    // Corners of one vertex that have several tangents are computed from the texture coordinates when the file is read.
    let mut torn = scene.clone();
    torn.meshes[0].tangents[1] = [DVec4::new(1.0, 0.0, 0.0, 1.0); 3];
    let layout = Layout::new(&torn, 8.0).unwrap();
    let (folder, _) = write(&torn, &layout, &numbered(&layout), 1.0);
    let written = open(folder.path().join("scene_lightmap.gltf"));
    assert!(written.meshes[0].tangents[0][0].distance(scene.meshes[0].tangents[0][0]) > 0.1, "{:?}", written.meshes[0].tangents);
}

#[test]
fn pictures_hold_what_they_were_given() {
    let mut scene = scene_of(Mesh::parallelogram("wall", DVec3::ZERO, DVec3::X, DVec3::Y, 0));
    scene.materials[0].base_colour = Vec3::new(0.5, 1.0, 0.25);
    scene.materials[0].emission = Vec3::new(0.0, 0.0, 0.125);
    let layout = Layout::new(&scene, 16.0).unwrap();
    let pi = std::f32::consts::PI;
    let mut results =
        vec![TexelEstimate { irradiance: Vec3::splat(pi), standard_error: Vec3::new(1e-7, 2e6, 0.1), unseen: 0.5 }; layout.texel_count()];
    results[5].irradiance = Vec3::new(-0.0, 1e-30, 7e7);
    let (folder, maps) = write(&scene, &layout, &results, 0.5);
    let open = |name: &str| image::open(folder.path().join(name)).unwrap();
    for (name, values) in [("wall_irradiance.exr", &maps[0].irradiance), ("wall_error.exr", &maps[0].error)] {
        let read = open(name).into_rgb32f();
        assert_eq!((read.width(), read.height()), (maps[0].width, maps[0].height));
        assert!(bytemuck::cast_slice::<f32, u32>(read.as_raw()) == bytemuck::cast_slice::<Vec3, u32>(values), "{name}");
    }
    let texel = layout.meshes[0].as_ref().unwrap().texels[100];
    let pixel = |name: &str| open(name).into_rgb8().get_pixel(texel.x, texel.y).0;
    // Half of irradiance / pi = 1; half of 0.5, 1 and 0.25 + 0.125; both as sRGB.
    assert_eq!(pixel("wall.png"), [188, 188, 188]);
    assert_eq!(pixel("wall_radiance.png"), [137, 188, 120]);

    // Linear times intensity is irradiance times the exposure.
    let document: serde_json::Value = serde_json::from_slice(&std::fs::read(folder.path().join("scene_lightmap.gltf")).unwrap()).unwrap();
    let extension = &document["materials"][0]["extensions"]["MOZ_lightmap"];
    assert_eq!(extension["texCoord"], 1);
    let intensity = extension["intensity"].as_f64().unwrap();
    let shown = intensity * f64::from(pixel("wall_lightmap.png")[0]) / 255.0;
    assert!((shown - 0.5 * PI).abs() < 0.5 / 255.0 * intensity + 1e-6, "{shown}");
    let texture = extension["index"].as_u64().unwrap() as usize;
    let image = document["textures"][texture]["source"].as_u64().unwrap() as usize;
    assert_eq!(document["images"][image]["uri"], "wall_lightmap.png");
    // A matt wall is one that reflects nothing.
    assert_eq!(document["extensionsUsed"], serde_json::json!(["KHR_materials_specular", "MOZ_lightmap"]));
}

#[test]
fn a_texture_is_seen_in_the_radiance() {
    let mut scene = scene_of(Mesh::parallelogram("wall", DVec3::ZERO, DVec3::X, DVec3::Y, 0));
    let halves = row_of_texels(&[[255, 0, 0, 255], [0, 255, 0, 255]], Filter::Bilinear);
    scene.textures.push(Texture { wrap: [Wrap::Clamp; 2], ..halves });
    scene.materials[0].base_colour = Vec3::ONE;
    scene.materials[0].base_colour_texture = Some(TextureUse::of(0, 0));
    let layout = Layout::new(&scene, 32.0).unwrap();
    let results = vec![TexelEstimate { irradiance: Vec3::splat(std::f32::consts::PI), ..TexelEstimate::default() }; layout.texel_count()];
    let (folder, _) = write(&scene, &layout, &results, 1.0);
    let picture = image::open(folder.path().join("wall_radiance.png")).unwrap().into_rgb8();
    for texel in &layout.meshes[0].as_ref().unwrap().texels {
        let x = texel.points.iter().map(|point| point.sample(&scene.meshes[0]).position.x).sum::<f64>() / 4.0;
        let [red, green, _] = picture.get_pixel(texel.x, texel.y).0;
        let is_right = (x >= 0.2 || (red, green) == (255, 0)) && (x <= 0.8 || (red, green) == (0, 255));
        assert!(is_right, "{x}: {red} {green}");
    }
}

#[test]
fn names_are_unique_and_stay_in_the_folder() {
    let names = ["wall", "WALL", "wall", "wall_radiance", "wall_2", "../wall", "scene", "texture_0", "", "Würfel 1"];
    let mut scene = scene_of(Mesh::default());
    scene.meshes =
        names.iter().enumerate().map(|(k, name)| Mesh::parallelogram(name, DVec3::X * (2 * k) as f64, DVec3::X, DVec3::Y, 0)).collect();
    let layout = Layout::new(&scene, 4.0).unwrap();
    let (folder, _) = write(&scene, &layout, &numbered(&layout), 1.0);
    let written = entries(folder.path());
    // Five pictures a mesh, two documents and their numbers, and none twice even without case.
    assert_eq!(written.len(), 5 * names.len() + 3, "{written:?}");
    assert_eq!(written.iter().map(|name| name.to_lowercase()).collect::<BTreeSet<_>>().len(), written.len(), "{written:?}");
    assert!(written.contains(&"Würfel_1_irradiance.exr".to_owned()), "{written:?}");
    assert_same_geometry(&open(folder.path().join("scene.gltf")), &scene);
}

#[test]
fn nothing_is_written_where_something_cannot_be() {
    let scene = open("cornell");
    let layout = Layout::new(&scene, 8.0).unwrap();
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("scene.bin")).unwrap();
    let maps = layout.maps(&numbered(&layout), Default::default());
    let result = bake::write(&Folder::open("-o", folder.path()).unwrap(), &scene, &layout, &maps, 1.0);
    let Err(Error::Saved { folder: saved, .. }) = result else { panic!("{result:?}") };
    let written = entries(&saved.join("output"));
    assert!(written.contains(&"scene.gltf".to_owned()), "{written:?}");
    std::fs::remove_dir_all(saved).unwrap();
    assert_eq!(entries(folder.path()), ["scene.bin"]);
}

/// Whether every point of a scene's first mesh is looked at from this side of its triangles: in front of (1) or behind (-1) them; and
/// what is warned of.
fn side_of(scene: &Scene) -> (f64, Vec<String>) {
    let layout = Layout::new(scene, 8.0).unwrap();
    let lightmap = layout.meshes[0].as_ref().unwrap();
    let triangles = lightmap.texels.iter().map(|texel| lightmap.mesh.normal(texel.points[0].triangle as usize));
    let sides: Vec<f64> =
        layout.phase(0).iter().zip(triangles).map(|(sample, front)| sample.geometric_normal.dot(front).signum()).collect();
    assert!(sides.iter().all(|side| *side == sides[0]), "{sides:?}");
    let of_sides = |line: &String| line.contains("is baked of") || line.contains("is dark of");
    (sides[0], layout.warnings.into_iter().filter(of_sides).collect())
}

/// Light reaches the outside of a closed shell whose faces look inwards; of a sheet the side is baked that cameras see, or that is lit.
#[test]
fn the_side_that_is_seen_is_baked() {
    let sky = lamp(LightKind::Environment { radiance: Vec3::ONE });
    let point = |at: DVec3| lamp(LightKind::Point { position: at, intensity: Vec3::ONE });
    let cube = cube_with(|_, _| DVec2::ZERO);
    let mut turned = cube.clone();
    turned.triangles.iter_mut().for_each(|corners| corners.swap(1, 2));
    let sheet = level(0.0, [1.0, 1.0], false, 0);
    let with = |mesh: &Mesh, two_sided: bool, light: &Light| {
        let mut scene = scene_of(mesh.clone());
        scene.materials[0].two_sided = two_sided;
        scene.lights.push(light.clone());
        scene
    };
    let above = point(DVec3::Y * 3.0);
    assert_eq!(side_of(&with(&cube, true, &sky)), (1.0, vec![]));
    let (side, warnings) = side_of(&with(&turned, true, &sky));
    assert!(side == -1.0 && warnings.len() == 1 && warnings[0].contains("the back is baked of 'cube'"), "{side}, {warnings:?}");
    // A room, whose lamp is inside.
    assert_eq!(side_of(&with(&turned, true, &point(DVec3::ZERO))), (1.0, vec![]));
    // Nothing else can be baked of one side, which is dark.
    let (side, warnings) = side_of(&with(&turned, false, &sky));
    assert_eq!((side, warnings.len()), (1.0, 1), "{warnings:?}");
    assert_said(&warnings, &["dark of 'cube'", "turn them"]);
    assert_eq!(side_of(&with(&turned, false, &point(DVec3::ZERO))), (1.0, vec![]));
    // Without one of its sides, too.
    let open = Mesh { triangles: turned.triangles[2..].to_vec(), ..turned.clone() };
    let (_, warnings) = side_of(&with(&open, false, &above));
    assert!(warnings.len() == 1 && warnings[0].contains("dark of 'cube'"), "{warnings:?}");
    assert_eq!(side_of(&with(&sheet, true, &above)).0, -1.0);
    // Both sides are lit, and the cameras are above the back.
    let mut seen = with(&sheet, true, &sky);
    assert_eq!(side_of(&seen).0, 1.0);
    seen.cameras.push(Camera::looking_at("above", DVec3::new(1.0, 2.0, 0.0), DVec3::ZERO, DVec3::Y, 1.0));
    assert_eq!(side_of(&seen).0, -1.0);
    seen.cameras.push(Camera::looking_at("below", DVec3::new(1.0, -2.0, 0.0), DVec3::ZERO, DVec3::Y, 1.0));
    assert_eq!(side_of(&seen).0, 1.0);
}

/// A block of .4 m that begins at this height.
fn block(lowest: f64, height: f64) -> Mesh {
    let mut cube = cube_with(|_, _| DVec2::ZERO);
    let size = DVec3::new(0.403, height, 0.403);
    cube.positions.iter_mut().for_each(|position| *position = (*position + 0.5 * DVec3::Y) * size + lowest * DVec3::Y);
    cube
}

/// A block of .4 m that stands on a floor, goes through it, or hangs .2 mm above it, of one side and of two: no point below it or in it
/// counts, and a texel of which none is left is as its neighbour. A ledge high above the floor hides nothing.
#[test]
fn points_that_nobody_sees_count_for_nothing() {
    let floor = |blocks: Vec<Mesh>, two_sided: bool| {
        let mut scene = scene_of(level(0.0, [2.0, 2.0], true, 0));
        scene.meshes.extend(blocks);
        scene.materials[0].two_sided = two_sided;
        Layout::new(&scene, 16.0).unwrap()
    };
    let all = floor(vec![], false).meshes[0].as_ref().unwrap().texels.len();
    for two_sided in [false, true] {
        for lowest in [0.0, -0.25, 2e-4] {
            let layout = floor(vec![block(lowest, 0.5)], two_sided);
            let texels = &layout.meshes[0].as_ref().unwrap().texels;
            let is_wrong = |at: DVec3| {
                let out = at.x.abs().max(at.z.abs());
                // Further inside than a texel nothing of a block that goes through the floor is near.
                out < 0.2015 && (lowest >= 0.0 || out > 0.2015 - 1.0 / 16.0)
            };
            let of_floor = |phase: usize| layout.phase(phase)[..texels.len()].to_vec();
            let wrong = (0..PHASE_COUNT).flat_map(of_floor).filter(|sample| is_wrong(sample.position)).count();
            let left = texels.len();
            assert!(wrong == 0 && left <= all - 16, "{two_sided}, {lowest}: {wrong} points below, {left} texels of {all}");
        }
        let ledge = floor(vec![block(0.2, 0.1)], two_sided);
        assert_eq!(ledge.meshes[0].as_ref().unwrap().texels.len(), all);
    }
    // A sheet that crosses the floor: each texel has points of one side.
    let wall = Mesh::parallelogram("wall", DVec3::new(0.004, -0.5, -1.0), DVec3::Y, 2.0 * DVec3::Z, 0);
    let layout = floor(vec![wall], false);
    let count = layout.meshes[0].as_ref().unwrap().texels.len();
    let phases = layout.phases();
    let is_left = |texel: usize| phases.iter().map(|phase| phase[texel].position.x < 0.004).collect::<BTreeSet<bool>>().len();
    assert!(count == all && (0..count).all(|texel| is_left(texel) == 1));
}

/// Irradiance that an engine finds in a map at a point of a mesh: between four texels.
fn looked_up(layout: &Layout, maps: &[Map], mesh: usize, at: DVec3) -> f64 {
    let lightmap = layout.meshes[mesh].as_ref().unwrap();
    let map = maps.iter().find(|map| layout.objects[map.object].meshes.contains(&mesh)).unwrap();
    let weights = |triangle: usize| {
        let [a, b, c] = lightmap.mesh.corners(triangle);
        let normal = (b - a).cross(c - a);
        let of = |p: DVec3, q: DVec3| (q - p).cross(at - p).dot(normal) / normal.length_squared();
        (normal.normalize().dot(at - a).abs() < 1e-6).then(|| [of(b, c), of(c, a), of(a, b)])
    };
    let found = (0..lightmap.mesh.triangles.len()).find_map(|triangle| {
        let weights = weights(triangle).filter(|weights| weights.iter().all(|weight| *weight >= -1e-9))?;
        Some(
            pairs(lightmap.mesh.triangles[triangle], weights).map(|(vertex, weight)| lightmap.uvs[vertex as usize] * weight).sum::<DVec2>(),
        )
    });
    let place = found.expect("the point lies on the mesh") * DVec2::new(map.width.into(), map.height.into()) - 0.5;
    let (low, share) = (place.floor(), place - place.floor());
    let texel = |x: f64, y: f64| {
        let [column, row] = [(x, map.width), (y, map.height)].map(|(at, side)| at.clamp(0.0, f64::from(side - 1)) as usize);
        f64::from(map.irradiance[row * map.width as usize + column].x)
    };
    let of_row = |y: f64| texel(low.x, y) * (1.0 - share.x) + texel(low.x + 1.0, y) * share.x;
    of_row(low.y) * (1.0 - share.y) + of_row(low.y + 1.0) * share.y
}

/// Sun from straight above: the floor is as bright beside a block as elsewhere, whether the block stands on it or goes through it, and a
/// block whose faces look inwards is bright on top.
#[test]
fn lightmaps_are_not_dark_at_the_foot_of_things() {
    // Where they begin, and whether their faces look inwards.
    let blocks = of_run::<&[_]>(&[(-0.25, true)], &[(0.0, false), (-0.25, true)]);
    let Some(gpu) = device() else { return };
    let down = lamp(LightKind::Directional { direction: DVec3::NEG_Y, irradiance: Vec3::ONE });
    for &(lowest, is_turned) in blocks {
        let mut block = block(lowest, 0.5);
        if is_turned {
            block.triangles.iter_mut().for_each(|corners| corners.swap(1, 2));
        }
        let mut scene = scene_of(level(0.0, [1.0, 1.0], true, 0));
        scene.meshes.push(block);
        scene.materials[0] = Material { two_sided: is_turned, ..matt(0.0) };
        scene.lights.push(down.clone());
        let layout = Layout::new(&scene, 16.0).unwrap();
        let settings = of_any_room(SceneSettings { photons: 500, rounds: 8, part: Part::Direct, ..by_rounds() });
        let sensor = Sensor::Receivers { count: layout.texel_count() as u32 };
        let (geometry, plan) = scene_plan(&gpu, &scene, &settings, sensor).unwrap();
        let phases = layout.receivers(settings.rounds, &geometry);
        let result = light(&gpu, &Viewpoint { geometry: &geometry, camera: None, phases: &phases }, plan);
        let maps = layout.maps(&bake::estimates(&result), result.film.error_source());
        let beside = [0.001, 0.005, 0.02, 0.05].into_iter().flat_map(|far| {
            [(0.2015 + far, 0.07), (-0.2015 - far, 0.011), (0.033, 0.2015 + far), (0.2015 + far, -0.2015 - far)]
                .map(|(x, z)| looked_up(&layout, &maps, 0, DVec3::new(x, 0.0, z)))
        });
        let darkest = beside.fold(f64::INFINITY, f64::min);
        let on_top = looked_up(&layout, &maps, 1, DVec3::new(0.05, lowest + 0.5, 0.02));
        println!("{lowest}, {is_turned}: at least {darkest:.3} on the floor, {on_top:.3} on top");
        assert!(darkest > 0.95 && (on_top - 1.0).abs() < 0.05, "{lowest}, {is_turned}: {darkest} on the floor, {on_top} on top");
    }
}
