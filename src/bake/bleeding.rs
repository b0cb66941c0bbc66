//! Whether a bilinear look-up on one chart of a set of coordinates finds the light of another.

use std::collections::HashMap;

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::part::Part;
use super::{SurfacePoint, gutters, texels};
use crate::scene::Mesh;
use crate::scene::connected::connected;

/// What a texel holds of a chart: one of its points.
#[derive(Debug, Clone, Copy)]
struct Seen {
    x: u32,
    y: u32,
    part: u32,
    chart: u32,
    point: SurfacePoint,
}

/// Whether some look-up does. Charts may touch where the surface goes on from one to the other: there a look-up finds what
/// lies near it in space.
pub(crate) fn bleeds(meshes: &[&Mesh], parts: &[Part], width: u32, height: u32) -> bool {
    let charts = charts(meshes, parts);
    // A single one, which is common, has nothing to bleed into.
    if charts.iter().flatten().all(|chart| *chart == 0) {
        return false;
    }
    let mut seen: Vec<Seen> = Vec::new();
    for (part, (mesh, charts)) in meshes.iter().zip(&charts).enumerate() {
        for texel in texels::covered(mesh, &parts[part].uvs, width, height) {
            let chart = |point: &SurfacePoint| charts[point.triangle as usize];
            // One point a chart.
            let is_first = |k: usize| texel.points[..k].iter().all(|other| chart(other) != chart(&texel.points[k]));
            let of = |point: SurfacePoint| Seen { x: texel.x, y: texel.y, part: part as u32, chart: chart(&point), point };
            seen.extend((0..texel.points.len()).filter(|k| is_first(*k)).map(|k| of(texel.points[k])));
        }
    }
    seen.sort_by_key(|seen| (seen.y, seen.x, seen.chart));
    seen.dedup_by_key(|seen| (seen.y, seen.x, seen.chart));
    let texels: Vec<&[Seen]> = seen.chunk_by(|a, b| (a.y, a.x) == (b.y, b.x)).collect();
    let nearest = gutters::nearest(width, height, texels.iter().map(|texel| (texel[0].x, texel[0].y)));
    let place = |seen: &Seen| seen.place(meshes[seen.part as usize], &parts[seen.part as usize], DVec2::new(width.into(), height.into()));
    texels.par_iter().any(|texel| {
        let Seen { x, y, .. } = texel[0];
        let around = (y.saturating_sub(1)..=(y + 1).min(height - 1))
            .flat_map(|row| (x.saturating_sub(1)..=(x + 1).min(width - 1)).map(move |column| (row * width + column) as usize));
        let found = around.flat_map(|place| texels[nearest[place] as usize]);
        found.into_iter().any(|found| texel.iter().any(|own| found.chart != own.chart && place(own).is_far_from(&place(found))))
    })
}

/// A point of the surface.
struct Place {
    /// Texels.
    uv: DVec2,
    /// Metres.
    position: DVec3,
    /// Metres that a texel along u, and one along v, is long.
    step: DVec2,
}

impl Seen {
    fn place(&self, mesh: &Mesh, part: &Part, size: DVec2) -> Place {
        let triangle = self.point.triangle as usize;
        let [a, b, c] = part.triangles[triangle].map(|vertex| part.uvs[vertex as usize] * size);
        let [p, q, r] = mesh.corners(triangle);
        let [v, w] = self.point.weights.map(f64::from);
        let (s, t, along_s, along_t) = (b - a, c - a, q - p, r - p);
        let determinant = s.perp_dot(t);
        let step = DVec2::new((along_s * t.y - along_t * s.y).length(), (along_t * s.x - along_s * t.x).length()) / determinant.abs();
        Place { uv: a + s * v + t * w, position: p + along_s * v + along_t * w, step }
    }
}

impl Place {
    /// Whether two points lie farther apart in space than in the map, by more than a texel.
    fn is_far_from(&self, other: &Place) -> bool {
        let texels = (self.uv - other.uv).abs() + 1.0;
        // A triangle of no area in the map gives no length.
        self.position.distance(other.position) > (texels * self.step.max(other.step)).element_sum()
    }
}

/// The chart of every triangle: triangles that share an edge in space and in the map are of one.
fn charts(meshes: &[&Mesh], parts: &[Part]) -> Vec<Vec<u32>> {
    // Vertices of the same place, however often a file has it. Adding zero makes -0 the same as 0.
    let mut known: HashMap<[u64; 5], u32> = HashMap::new();
    let mut edges = |(mesh, part, corners): (&Mesh, &Part, &[u32; 3])| {
        let [a, b, c] = corners.map(|vertex| {
            let (DVec3 { x, y, z }, uv) = (mesh.positions[vertex as usize], part.uvs[vertex as usize]);
            let count = known.len() as u32;
            *known.entry([x, y, z, uv.x, uv.y].map(|number| (number + 0.0).to_bits())).or_insert(count)
        });
        [(a, b), (b, c), (c, a)].map(|(from, to)| [from.min(to), from.max(to)])
    };
    let triangles = meshes.iter().zip(parts).flat_map(|(mesh, part)| part.triangles.iter().map(move |corners| (*mesh, part, corners)));
    let groups = connected(triangles.map(&mut edges));
    let mut charts = vec![0; groups.iter().map(Vec::len).sum()];
    for (chart, group) in (0..).zip(groups) {
        group.into_iter().for_each(|triangle| charts[triangle] = chart);
    }
    let mut rest = charts.into_iter();
    let of_part = |part: &Part| rest.by_ref().take(part.triangles.len()).collect();
    parts.iter().map(of_part).collect()
}
