//! Lightmap coordinates of an object: a set of its own that is fit for a lightmap, else charts by the crate `uvunwrap`
//! (conformal maps, split where they distort, packed with padding).

use glam::{DVec2, Vec2};
use uvunwrap::{Atlas, Density, MeshInput, Options, Packing};

use super::part::Part;
use super::raster::Lattice;
use super::{MAX_SIDE, MIN_SIDE, bleeding};
use crate::scene::{Mesh, bounds_of};

/// The meshes of an object with lightmap coordinates that share one map.
#[derive(Debug, Clone)]
pub(crate) struct Unwrapped {
    pub parts: Vec<Part>,
    /// Texels.
    pub width: u32,
    pub height: u32,
    /// Which of the file's sets the coordinates are; `None` for new ones.
    pub set: Option<usize>,
    /// What takes coordinates of the set to those of the map: offset + scale * uv.
    pub offset: DVec2,
    pub scale: DVec2,
    /// Why the second set, where there is one, was not taken.
    pub refused: Option<&'static str>,
    /// The map is as large as may be and has fewer texels per metre than asked for.
    pub is_coarse: bool,
}

/// Free texels around each chart; so charts are twice as far apart.
pub(crate) const PADDING: u32 = 2;
/// A chart is split where one of its triangles gets more (or less) texels than its share by this
/// factor.
const MAX_DISTORTION: f32 = 2.0;
/// Meshes of more triangles get smaller charts than curvature asks for, and a faster packing that leaves
/// more of the map free: flattening takes more than twice the time for a chart of twice the triangles.
const MANY_TRIANGLES: usize = 20_000;
/// Triangles that a chart of such a mesh has, were all of one size.
const CHART_TRIANGLES: usize = 1500;

/// The first of the sets that can be used, else new charts. `sets`: numbers of sets, and coordinates for each mesh. Fails with
/// what is wrong with the meshes.
pub(crate) fn unwrap(
    meshes: &[&Mesh],
    sets: &[(usize, Vec<Vec<DVec2>>)],
    texels_per_metre: f64,
    max_side: u32,
) -> Result<Unwrapped, String> {
    let mut refused = None;
    for (set, uvs) in sets {
        match existing_set(meshes, *set, uvs, texels_per_metre, max_side) {
            Ok(unwrapped) => return Ok(unwrapped),
            Err(reason) => refused = refused.or(Some(reason)),
        }
    }
    Ok(Unwrapped { refused, ..charts(meshes, texels_per_metre, max_side)? })
}

/// How far outside [0, 1] coordinates may lie: less than a texel of the largest map.
const SLACK: f64 = 1.0 / (2 * MAX_SIDE) as f64;
/// Share of the surface, or of the map, in which an existing set may fail: rounding, not intent.
const TOLERATED: f64 = 1e-3;
/// A set that fills less than this share of its range is one of a map that many objects share: the object's map is that part.
const LEAST_SHARE: f64 = 0.5;

/// A set of coordinates that the meshes have, or why it cannot be used.
fn existing_set(meshes: &[&Mesh], set: usize, uvs: &[Vec<DVec2>], texels_per_metre: f64, max_side: u32) -> Result<Unwrapped, &'static str> {
    let triangles = || meshes.iter().zip(uvs).flat_map(|(mesh, uvs)| (0..mesh.triangles.len()).map(move |triangle| (*mesh, uvs, triangle)));
    let corners = |(mesh, uvs, triangle): (&Mesh, &Vec<DVec2>, usize)| mesh.triangles[triangle].map(|vertex| uvs[vertex as usize]);
    if triangles().flat_map(corners).any(|uv| !uv.is_finite()) {
        return Err("is not finite");
    }
    let (low, high) =
        triangles().flat_map(corners).fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(low, high), uv| (low.min(uv), high.max(uv)));
    if low.min_element() < -SLACK || high.max_element() > 1.0 + SLACK {
        return Err("leaves the range from 0 to 1");
    }
    // Metres along u and v, the mean over the surface.
    let (mut area, mut flat, mut metres) = (0.0, 0.0, DVec2::ZERO);
    for place in triangles() {
        let (mesh, _, triangle) = place;
        let [a, b, c] = mesh.corners(triangle);
        let [uv_a, uv_b, uv_c] = corners(place);
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
    let extent = high - low;
    let is_part = extent.x * extent.y < LEAST_SHARE;
    let (low, extent) = if is_part { (low, extent) } else { (DVec2::ZERO, DVec2::ONE) };
    let sides = texels_per_metre * extent * metres / (area - flat);
    // Rounded, so that the coordinates of an earlier bake give its map again.
    let side = |wanted: f64| wanted.round().clamp(MIN_SIDE.into(), max_side.into()) as u32;
    let (width, height) = (side(sides.x), side(sides.y));
    let in_map = |uv: &DVec2| ((*uv - low) / extent).clamp(DVec2::ZERO, DVec2::ONE);
    let part = |(mesh, uvs): (&&Mesh, &Vec<DVec2>)| Part {
        vertices: Vec::new(),
        triangles: mesh.triangles.clone(),
        uvs: uvs.iter().map(in_map).collect(),
    };
    let parts: Vec<Part> = meshes.iter().zip(uvs).map(part).collect();
    if overlap(&parts, width, height) {
        return Err("overlaps itself");
    }
    if bleeding::bleeds(meshes, &parts, width, height) {
        return Err("has fewer than two free texels between charts, so that light would bleed");
    }
    let is_coarse = sides.max_element().round() > max_side.into();
    Ok(Unwrapped { parts, width, height, set: Some(set), offset: -low / extent, scale: 1.0 / extent, refused: None, is_coarse })
}

/// Whether two triangles claim the same place, seen four times as finely as the map's texels.
fn overlap(parts: &[Part], width: u32, height: u32) -> bool {
    let fine = |side: u32| (4 * side).min(MAX_SIDE);
    let lattice = Lattice { columns: fine(width), rows: fine(height) };
    let mut is_taken = vec![false; lattice.columns as usize * lattice.rows as usize];
    let (mut taken, mut doubled) = (0u64, 0u64);
    for (part, vertices) in parts.iter().flat_map(|part| part.triangles.iter().map(move |vertices| (part, vertices))) {
        let Some(triangle) = lattice.triangle(vertices.map(|vertex| part.uvs[vertex as usize])) else { continue };
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
fn charts(meshes: &[&Mesh], texels_per_metre: f64, max_side: u32) -> Result<Unwrapped, String> {
    let used = meshes.iter().flat_map(|mesh| mesh.triangles.iter().flatten().map(|vertex| mesh.positions[*vertex as usize]));
    let (low, high) = bounds_of(used);
    // Around the origin and of size one, so that 32-bit floats hold a mesh of any size anywhere.
    let (centre, extent) = (0.5 * (low + high), (high - low).max_element());
    let positions = |mesh: &&Mesh| -> Vec<[f32; 3]> {
        mesh.positions.iter().map(|position| ((position - centre) / extent).as_vec3().to_array()).collect()
    };
    let positions: Vec<Vec<[f32; 3]>> = meshes.iter().map(positions).collect();
    let indices: Vec<&[u32]> = meshes.iter().map(|mesh| mesh.triangles.as_flattened()).collect();
    let inputs: Vec<MeshInput> = positions.iter().zip(indices).map(|(positions, indices)| MeshInput::new(positions, indices)).collect();
    let area: f64 = meshes.iter().map(|mesh| mesh.whole_area()).sum();
    let triangle_count: usize = meshes.iter().map(|mesh| mesh.triangles.len()).sum();

    // Above 0 as a 32-bit float, however small the mesh.
    let wanted = (texels_per_metre * extent).max(1e-6);
    let is_large = triangle_count > MANY_TRIANGLES;
    let share = CHART_TRIANGLES as f64 / triangle_count as f64;
    let options = Options {
        padding: PADDING,
        packing: if is_large { Packing::Fast } else { Packing::Shape },
        max_chart_area: if is_large { (share * area / (extent * extent)) as f32 } else { 0.0 },
        max_area_distortion: MAX_DISTORTION,
        ..Options::default()
    };
    let wanted = wanted as f32;
    let generate = |density: Density| uvunwrap::generate(&inputs, &Options { density, ..options });
    // Near a square, with charts no longer than allowed.
    let square = || {
        let density = Density::Fixed { texels_per_unit: wanted, page_size: None };
        uvunwrap::generate(&inputs, &Options { density, max_chart_size: max_side - 2 * PADDING, ..options })
            .ok()
            // A map as long as the longest chart may be has charts that were made smaller.
            .filter(|atlas| atlas.width.max(atlas.height) < max_side)
    };
    // In another arrangement, as wide as is allowed.
    let wide = || {
        let density = Density::Fixed { texels_per_unit: wanted, page_size: Some(max_side) };
        generate(density).ok().filter(|atlas| atlas.page_count <= 1).map(cropped)
    };
    // What cannot fit is not tried: the map would be of any size.
    let fits = texels_per_metre * area.sqrt() < max_side.into();
    let atlas = match if fits { square().or_else(wide) } else { None } {
        Some(atlas) => atlas,
        None => generate(Density::Auto { page_size: max_side }).map_err(|error| format!("cannot be unwrapped ({error})"))?,
    };
    let is_coarse = atlas.texels_per_unit < wanted;
    if atlas.page_count > 1 {
        return Err(format!(
            "unwraps into {} pieces, too many for a lightmap of {max_side} texels per side; split the mesh",
            atlas.chart_count
        ));
    }
    // Texels that a map gains on its way to the smallest one allowed lie beyond its charts.
    let (width, height) = (atlas.width.max(MIN_SIDE), atlas.height.max(MIN_SIDE));
    let shrink = DVec2::new(f64::from(atlas.width) / f64::from(width), f64::from(atlas.height) / f64::from(height));
    let part = |output: &uvunwrap::OutputMesh| Part {
        vertices: output.vertices.iter().map(|vertex| vertex.xref).collect(),
        triangles: output.indices.as_chunks().0.to_vec(),
        uvs: output.vertices.iter().map(|vertex| DVec2::from(vertex.uv.map(f64::from)) * shrink).collect(),
    };
    let parts = atlas.meshes.iter().map(part).collect();
    Ok(Unwrapped { parts, width, height, set: None, offset: DVec2::ZERO, scale: DVec2::ONE, refused: None, is_coarse })
}

/// A page without its free columns and rows.
fn cropped(mut atlas: Atlas) -> Atlas {
    let size = Vec2::new(atlas.width as f32, atlas.height as f32);
    let vertices = || atlas.meshes.iter().flat_map(|mesh| &mesh.vertices);
    let used = vertices().map(|vertex| Vec2::from(vertex.uv) * size).fold(Vec2::ZERO, Vec2::max);
    let side = |used: f32, side: u32| (used.ceil() as u32 + PADDING).min(side);
    let (width, height) = (side(used.x, atlas.width), side(used.y, atlas.height));
    let grow = size / Vec2::new(width as f32, height as f32);
    atlas.meshes.iter_mut().flat_map(|mesh| &mut mesh.vertices).for_each(|vertex| vertex.uv = (Vec2::from(vertex.uv) * grow).to_array());
    (atlas.width, atlas.height) = (width, height);
    atlas
}
