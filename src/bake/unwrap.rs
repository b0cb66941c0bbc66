//! Lightmap coordinates of a mesh: its own second set where that is fit for a lightmap, else charts
//! by the crate `uvunwrap` (conformal maps, split where they distort, packed with padding).

use glam::{DVec2, DVec3};
use uvunwrap::{Density, MeshInput, Options, Packing};

use super::raster::Lattice;
use super::{MAX_SIDE, MIN_SIDE};
use crate::scene::Mesh;

/// A mesh with lightmap coordinates.
#[derive(Debug, Clone)]
pub struct Unwrapped {
    /// The same triangles in the same order, vertices doubled along seams.
    pub mesh: Mesh,
    /// From 0 to 1, one a vertex.
    pub uvs: Vec<DVec2>,
    /// Texels.
    pub width: u32,
    pub height: u32,
    pub is_second_set: bool,
    /// Why the second set, where there is one, was not taken.
    pub refused: Option<&'static str>,
    /// The map is as large as may be and has fewer texels per metre than asked for.
    pub is_coarse: bool,
}

/// Free texels around each chart; so charts are twice as far apart.
const PADDING: u32 = 2;
/// A chart is split where one of its triangles gets more (or less) texels than its share by this
/// factor.
const MAX_DISTORTION: f32 = 2.0;
/// Meshes of more triangles get smaller charts than curvature asks for, and a faster packing that leaves
/// more of the map free: flattening takes more than twice the time for a chart of twice the triangles.
const MANY_TRIANGLES: usize = 20_000;
/// Triangles that a chart of such a mesh has, were all of one size.
const CHART_TRIANGLES: usize = 1500;

/// The second set if it can be used, else new charts. Fails with what is wrong with the mesh.
pub fn unwrap(mesh: &Mesh, texels_per_metre: f64) -> Result<Unwrapped, String> {
    if mesh.uvs[1].is_empty() {
        return charts(mesh, texels_per_metre);
    }
    match second_set(mesh, texels_per_metre) {
        Ok(unwrapped) => Ok(unwrapped),
        Err(reason) => Ok(Unwrapped { refused: Some(reason), ..charts(mesh, texels_per_metre)? }),
    }
}

/// How far outside [0, 1] coordinates may lie: less than a texel of the largest map.
const SLACK: f64 = 1.0 / (2 * MAX_SIDE) as f64;
/// Share of the surface, or of the map, in which a second set may fail: rounding, not intent.
const TOLERATED: f64 = 1e-3;

/// The second set of coordinates, or why it cannot be used.
fn second_set(mesh: &Mesh, texels_per_metre: f64) -> Result<Unwrapped, &'static str> {
    let uvs = &mesh.uvs[1];
    let used = || mesh.triangles.iter().flatten().map(|vertex| uvs[*vertex as usize]);
    if used().any(|uv| !uv.is_finite()) {
        return Err("is not finite");
    }
    if used().any(|uv| uv.min_element() < -SLACK || uv.max_element() > 1.0 + SLACK) {
        return Err("leaves the range from 0 to 1");
    }
    // Metres along u and v, the mean over the surface.
    let (mut area, mut flat, mut metres) = (0.0, 0.0, DVec2::ZERO);
    for (triangle, vertices) in mesh.triangles.iter().enumerate() {
        let [a, b, c] = mesh.corners(triangle);
        let [uv_a, uv_b, uv_c] = vertices.map(|vertex| uvs[vertex as usize]);
        let (p, q, s, t) = (b - a, c - a, uv_b - uv_a, uv_c - uv_a);
        let (own, determinant) = (mesh.area(triangle), s.perp_dot(t));
        area += own;
        if determinant.abs() <= f64::EPSILON * (s.length_squared() + t.length_squared()) || determinant == 0.0 {
            flat += own;
            continue;
        }
        let (along_u, along_v) = ((p * t.y - q * s.y) / determinant, (q * s.x - p * t.x) / determinant);
        metres += own * DVec2::new(along_u.length(), along_v.length());
    }
    if flat > TOLERATED * area {
        return Err("gives triangles no area");
    }
    let sides = texels_per_metre * metres / (area - flat);
    let side = |wanted: f64| wanted.ceil().clamp(MIN_SIDE.into(), MAX_SIDE.into()) as u32;
    let (width, height) = (side(sides.x), side(sides.y));
    if overlaps(mesh, width, height) {
        return Err("overlaps itself");
    }
    let uvs = uvs.iter().map(|uv| uv.clamp(DVec2::ZERO, DVec2::ONE)).collect();
    let is_coarse = sides.max_element() > MAX_SIDE.into();
    Ok(Unwrapped { mesh: mesh.clone(), uvs, width, height, is_second_set: true, refused: None, is_coarse })
}

/// Whether two triangles of the second set claim the same place, seen four times as finely as the
/// map's texels.
fn overlaps(mesh: &Mesh, width: u32, height: u32) -> bool {
    let fine = |side: u32| (4 * side).min(MAX_SIDE);
    let lattice = Lattice { columns: fine(width), rows: fine(height) };
    let mut is_taken = vec![false; lattice.columns as usize * lattice.rows as usize];
    let (mut taken, mut doubled) = (0u64, 0u64);
    for vertices in &mesh.triangles {
        let Some(triangle) = lattice.triangle(vertices.map(|vertex| mesh.uvs[1][vertex as usize])) else { continue };
        for row in triangle.rows() {
            for column in triangle.columns(row) {
                // Neighbours share what lies on their edge.
                if triangle.weights(column, row).min_element() < 1e-4 {
                    continue;
                }
                let place = &mut is_taken[row as usize * lattice.columns as usize + column as usize];
                doubled += u64::from(*place);
                taken += 1;
                *place = true;
            }
        }
    }
    doubled as f64 > TOLERATED * taken as f64
}

/// New charts.
fn charts(mesh: &Mesh, texels_per_metre: f64) -> Result<Unwrapped, String> {
    let (low, high) = mesh.triangles.iter().flatten().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), vertex| {
        let position = mesh.positions[*vertex as usize];
        (low.min(position), high.max(position))
    });
    // Around the origin and of size one, so that 32-bit floats hold a mesh of any size anywhere.
    let (centre, extent) = (0.5 * (low + high), (high - low).max_element());
    let positions: Vec<[f32; 3]> = mesh.positions.iter().map(|position| ((position - centre) / extent).as_vec3().to_array()).collect();
    let indices: Vec<u32> = mesh.triangles.iter().flatten().copied().collect();
    let area: f64 = (0..mesh.triangles.len()).map(|triangle| mesh.area(triangle)).sum();

    let wanted = (texels_per_metre * extent).max(MIN_SIDE.into());
    let is_large = mesh.triangles.len() > MANY_TRIANGLES;
    let share = CHART_TRIANGLES as f64 / mesh.triangles.len() as f64;
    let options = Options {
        padding: PADDING,
        packing: if is_large { Packing::Fast } else { Packing::Shape },
        max_chart_area: if is_large { (share * area / (extent * extent)) as f32 } else { 0.0 },
        max_area_distortion: MAX_DISTORTION,
        max_chart_size: MAX_SIDE - 2 * PADDING,
        ..Options::default()
    };
    let generate = |density: Density| {
        uvunwrap::generate(&[MeshInput::new(&positions, &indices)], &Options { density, ..options })
            .map_err(|error| format!("cannot be unwrapped ({error})"))
    };
    let largest = Density::Auto { page_size: MAX_SIDE };
    // What cannot fit is not tried: the map would be of any size.
    let fits = texels_per_metre * area.sqrt() < MAX_SIDE.into();
    let (atlas, is_coarse) = match fits {
        true => {
            let atlas = generate(Density::Fixed { texels_per_unit: wanted as f32, page_size: None })?;
            // A map as long as the longest chart may be has charts that were made smaller.
            if atlas.width.max(atlas.height) < MAX_SIDE { (atlas, false) } else { (generate(largest)?, true) }
        }
        false => (generate(largest)?, true),
    };
    if atlas.page_count > 1 {
        return Err(format!(
            "unwraps into {} pieces, too many for a lightmap of {MAX_SIDE} texels per side; split the mesh",
            atlas.chart_count
        ));
    }
    // Texels that a map gains on its way to the smallest one allowed lie beyond its charts.
    let (width, height) = (atlas.width.max(MIN_SIDE), atlas.height.max(MIN_SIDE));
    let shrink = DVec2::new(f64::from(atlas.width) / f64::from(width), f64::from(atlas.height) / f64::from(height));
    let output = &atlas.meshes[0];
    let source = |vertex: &uvunwrap::OutputVertex| vertex.xref as usize;
    let kept = |of_vertices: &[DVec3]| match of_vertices.is_empty() {
        true => Vec::new(),
        false => output.vertices.iter().map(|vertex| of_vertices[source(vertex)]).collect(),
    };
    let of_set = |set: &Vec<DVec2>| if set.is_empty() { Vec::new() } else { output.vertices.iter().map(|v| set[source(v)]).collect() };
    Ok(Unwrapped {
        mesh: Mesh {
            name: mesh.name.clone(),
            positions: kept(&mesh.positions),
            normals: kept(&mesh.normals),
            uvs: mesh.uvs.each_ref().map(of_set),
            colours: kept(&mesh.colours),
            alphas: if mesh.alphas.is_empty() { Vec::new() } else { output.vertices.iter().map(|v| mesh.alphas[source(v)]).collect() },
            // Triangles keep their order.
            tangents: mesh.tangents.clone(),
            coat_tangents: mesh.coat_tangents.clone(),
            triangles: output.indices.chunks_exact(3).map(|corners| [corners[0], corners[1], corners[2]]).collect(),
            material: mesh.material,
        },
        uvs: output.vertices.iter().map(|vertex| DVec2::from(vertex.uv.map(f64::from)) * shrink).collect(),
        width,
        height,
        is_second_set: false,
        refused: None,
        is_coarse,
    })
}
