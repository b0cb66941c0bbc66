//! Surfaces that lie in one plane and overlap, as a rug on its floor or a lamp that was exported twice. Where they
//! overlap one of them counts, and of the others only what is visible beside it: [`find`] says what that is.

use std::collections::{BTreeMap, HashMap};

use glam::{DVec2, DVec3, Vec3, Vec4};
use i_overlay::core::fill_rule::FillRule;
use i_overlay::core::overlay_rule::OverlayRule;
use i_overlay::float::single::SingleFloatOverlay as _;
use i_triangle::float::triangulatable::Triangulatable as _;
use rayon::prelude::*;

use super::{Material, Scene, Surface};

/// Corners that are no further from a plane lie in it: 16 units in the last place of a coordinate of 0.5, where
/// normalised scenes end. Rounding of positions and of their heights takes half of that (`glsl/scene/belongs.glsl`).
const IN_PLANE: f64 = 1.0 / 2_097_152.0;

/// Overlaps and triangles that are no wider are rounding of edges that only touch.
const WIDTH: f64 = 1.0 / 1_048_576.0;

/// Width of the classes of normals and of distances from the origin: only triangles of one class are compared.
const CLASS: f64 = 1.0 / 512.0;

/// Normal and distance from the origin, in steps of [`CLASS`].
type Class = [i16; 4];

/// A triangle of which a part is hidden by others in its plane.
#[derive(Debug, Clone, PartialEq)]
pub struct Covered {
    pub triangle: usize,
    /// Those that hide it and face as it does; more may hide it whose back is seen.
    pub by: Vec<usize>,
    /// What remains visible: barycentric weights of the triangle's corners at the corners of each piece.
    pub pieces: Vec<[DVec3; 3]>,
}

/// Planes of triangles, those that agree to a few units in the last place as one.
pub struct Planes {
    /// Unit normal n of the front, then what makes n . p + offset = 0.
    pub planes: Vec<Vec4>,
    /// Each triangle's number among them.
    pub of_triangles: Vec<u32>,
}

impl Planes {
    /// Of the fronts of normalised triangles.
    pub fn of(corners: &[[Vec3; 3]]) -> Planes {
        // A quarter of what two surfaces must be apart.
        const STEP: f64 = 0.25 * IN_PLANE;
        let plane = |corners: &[Vec3; 3]| {
            let [a, b, c] = corners.map(Vec3::as_dvec3);
            // Of the very normal that is stored, so that the plane goes through the triangle's middle.
            let normal = (b - a).cross(c - a).normalize().as_vec3();
            (normal, -normal.as_dvec3().dot((a + b + c) / 3.0))
        };
        let rounded = |(place, corners): (usize, &[Vec3; 3])| {
            let (normal, offset) = plane(corners);
            ((normal.as_dvec3().extend(offset) / STEP).round().as_ivec4().to_array(), place as u32)
        };
        let mut order: Vec<([i32; 4], u32)> = corners.par_iter().enumerate().map(rounded).collect();
        order.par_sort_unstable();
        let mut planes = Vec::new();
        let mut of_triangles = vec![0; corners.len()];
        for alike in order.chunk_by(|a, b| a.0 == b.0) {
            alike.iter().for_each(|(_, triangle)| of_triangles[*triangle as usize] = planes.len() as u32);
            let (normal, offset) = plane(&corners[alike[0].1 as usize]);
            planes.push(normal.extend(offset as f32));
        }
        Planes { planes, of_triangles }
    }
}

/// Which of two overlapping surfaces counts, by mesh: the smaller number. What shines wins over what does not, so that a
/// lamp in a ceiling's plane is seen; what is opaque over glass, as nothing would be lit through it; a small mesh over a
/// large one, as rugs lie on floors; and at last the first. What is hidden is so from both sides: from behind, a rug with
/// one side on a floor with two is the rug's back.
pub fn ranks(scene: &Scene) -> Vec<u32> {
    let class = |material: &Material| match material.surface {
        _ if material.is_emissive() => 0,
        Surface::Dielectric { .. } => 2,
        _ => 1,
    };
    let key = |mesh: usize| {
        let of = &scene.meshes[mesh];
        let area: f64 = (0..of.triangles.len()).map(|triangle| of.area(triangle)).sum();
        (class(&scene.materials[of.material]), area)
    };
    let keys: Vec<(i32, f64)> = (0..scene.meshes.len()).map(key).collect();
    let mut order: Vec<usize> = (0..scene.meshes.len()).collect();
    order.sort_by(|a, b| keys[*a].0.cmp(&keys[*b].0).then(keys[*a].1.total_cmp(&keys[*b].1)));
    let mut ranks = vec![0; order.len()];
    (0..).zip(order).for_each(|(rank, mesh)| ranks[mesh] = rank);
    ranks
}

/// A triangle with what is known of its plane.
struct Sheet<'a> {
    corners: [DVec3; 3],
    normal: DVec3,
    /// The height over its longest side: how well the corners tell the normal.
    altitude: f64,
    mesh: u32,
    material: &'a Material,
}

impl Sheet<'_> {
    fn height(&self, point: DVec3) -> f64 {
        self.normal.dot(point - self.corners[0])
    }

    /// Whether both lie in one plane and some side shows both.
    fn competes(&self, other: &Sheet) -> bool {
        let cosine = self.normal.dot(other.normal);
        if cosine.abs() < 0.9 {
            return false;
        }
        // A block of glass that stands on a table and the table's top are a boundary with two sides.
        let is_clear = |sheet: &Sheet| matches!(sheet.material.surface, Surface::Dielectric { .. });
        let shows_both = cosine > 0.0 || (!is_clear(self) && !is_clear(other) && (self.material.two_sided || other.material.two_sided));
        let (wide, narrow) = if self.altitude > other.altitude { (self, other) } else { (other, self) };
        shows_both && narrow.corners.iter().all(|corner| wide.height(*corner).abs() <= IN_PLANE)
    }

    /// Whether two triangles of one plane overlap by more than rounding: no side of either separates them.
    fn overlaps(&self, other: &Sheet) -> bool {
        let is_separated = |sheet: &Sheet| {
            (0..3).any(|side| {
                let axis = self.normal.cross(sheet.corners[(side + 1) % 3] - sheet.corners[side]).normalize();
                let extent = |of: &Sheet| {
                    let [a, b, c] = of.corners.map(|corner| axis.dot(corner));
                    (a.min(b).min(c), a.max(b).max(c))
                };
                let (own, others) = (extent(self), extent(other));
                own.1.min(others.1) - own.0.max(others.0) <= WIDTH
            })
        };
        !is_separated(self) && !is_separated(other)
    }

    /// Classes of planes that it may be in: one, but for what rounding may shift.
    fn classes(&self) -> Vec<Class> {
        let is_exact = (0..3).any(|axis| self.corners.iter().all(|corner| corner[axis] == self.corners[0][axis]));
        let uncertain = if is_exact { IN_PLANE } else { (0.25 * IN_PLANE / self.altitude).min(0.5 * CLASS) + IN_PLANE };
        let n = self.normal;
        let size = n.abs();
        // A plane has two normals: that with its largest component above 0, and both where that is in doubt.
        let largest = size.max_element();
        let signs =
            [1.0, -1.0].into_iter().filter(|sign| (0..3).any(|axis| size[axis] >= largest - 2.0 * uncertain && sign * n[axis] > 0.0));
        let mut classes = Vec::with_capacity(1);
        for sign in signs {
            let values = [n.x, n.y, n.z, n.dot(self.corners[0])].map(|value| sign * value);
            let ends = values.map(|value| [-uncertain, uncertain].map(|off| ((value + off) / CLASS).floor() as i16));
            for choice in 0..16 {
                let class = [0, 1, 2, 3].map(|k| ends[k][choice >> k & 1]);
                // Ends that are equal are one choice.
                if (0..4).all(|k| choice >> k & 1 == 0 || ends[k][0] != ends[k][1]) {
                    classes.push(class);
                }
            }
        }
        classes
    }

    /// Weights of the second and third corner at a point of its plane.
    fn place(&self, point: DVec3) -> [f64; 2] {
        let [a, b, c] = self.corners;
        let doubled = (b - a).cross(c - a);
        let off = point - a;
        [off.cross(c - a).dot(doubled) / doubled.length_squared(), (b - a).cross(off).dot(doubled) / doubled.length_squared()]
    }

    /// What others leave of it; `None` if that is all.
    fn without(&self, others: &[&Sheet]) -> Option<Vec<[DVec3; 3]>> {
        let own = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]].to_vec();
        let clips: Vec<Vec<[f64; 2]>> = others.iter().map(|other| other.corners.map(|corner| self.place(corner)).to_vec()).collect();
        // Clips may run either way.
        let visible = vec![own].overlay_as::<i64>(&clips, OverlayRule::Difference, FillRule::NonZero);
        let mesh = visible.triangulate_as::<i64>().to_triangulation::<u32>();
        let corner = |index: u32| {
            let [u, v] = mesh.points[index as usize];
            DVec3::new(1.0 - u - v, u, v)
        };
        let pieces: Vec<[DVec3; 3]> = mesh.indices.chunks_exact(3).map(|of| [corner(of[0]), corner(of[1]), corner(of[2])]).collect();
        let share = |[a, b, c]: &[DVec3; 3]| DVec2::new(b.y - a.y, b.z - a.z).perp_dot(DVec2::new(c.y - a.y, c.z - a.z));
        if 1.0 - pieces.iter().map(share).sum::<f64>() < 1e-9 {
            return None;
        }
        let at = |weights: &DVec3| self.corners[0] * weights.x + self.corners[1] * weights.y + self.corners[2] * weights.z;
        Some(pieces.into_iter().filter(|piece| altitude(&[at(&piece[0]), at(&piece[1]), at(&piece[2])]) > WIDTH).collect())
    }
}

/// Height of a triangle over its longest side.
fn altitude([a, b, c]: &[DVec3; 3]) -> f64 {
    let longest = (*b - *a).length_squared().max((*c - *b).length_squared()).max((*a - *c).length_squared());
    (*b - *a).cross(*c - *a).length() / longest.sqrt()
}

/// Finds the triangles of a scene, normalised, that others of their plane hide in part or whole. `sources` are the
/// triangles' meshes and numbers there, `ranks` those of [`ranks`].
///
/// Triangles are sorted by classes of planes, then by place, so that the time goes with their number.
pub fn find(scene: &Scene, ranks: &[u32], sources: &[(u32, u32)], corners: &[[Vec3; 3]]) -> Vec<Covered> {
    let sheet = |triangle: u32| {
        let corners = corners[triangle as usize].map(Vec3::as_dvec3);
        let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize();
        let (mesh, _) = sources[triangle as usize];
        let material = &scene.materials[scene.meshes[mesh as usize].material];
        Sheet { corners, normal, altitude: altitude(&corners), mesh, material }
    };
    let classes_of = |triangle: u32| {
        let sheet = sheet(triangle);
        let classes = if sheet.altitude > WIDTH { sheet.classes() } else { Vec::new() };
        classes.into_iter().map(move |class| (class, triangle))
    };
    let mut members: Vec<(Class, u32)> = (0..corners.len() as u32).into_par_iter().flat_map_iter(classes_of).collect();
    members.par_sort_unstable();
    let classes: Vec<&[(Class, u32)]> = members.chunk_by(|a, b| a.0 == b.0).filter(|members| members.len() > 1).collect();
    let pairs_of = |class: &&[(Class, u32)]| {
        let sheets: Vec<Sheet> = class.iter().map(|(_, triangle)| sheet(*triangle)).collect();
        let overlap = |a: usize, b: usize| sheets[a].competes(&sheets[b]) && sheets[a].overlaps(&sheets[b]);
        near(&sheets, overlap).into_iter().map(|(a, b)| (class[a].1, class[b].1)).collect::<Vec<_>>()
    };
    let mut hidden: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    for (a, b) in classes.par_iter().flat_map_iter(pairs_of).collect::<Vec<_>>() {
        let place = |triangle: u32| (ranks[sources[triangle as usize].0 as usize], sources[triangle as usize].1);
        let (winner, loser) = if place(a) < place(b) { (a, b) } else { (b, a) };
        hidden.entry(loser).or_default().push(winner);
    }
    let visible = |(triangle, mut by): (u32, Vec<u32>)| {
        by.sort_unstable();
        by.dedup();
        let others: Vec<Sheet> = by.iter().map(|other| sheet(*other)).collect();
        let pieces = sheet(triangle).without(&others.iter().collect::<Vec<_>>())?;
        let normal = sheet(triangle).normal;
        let alike = by.iter().zip(&others).filter(|(_, other)| other.normal.dot(normal) > 0.0);
        Some(Covered { triangle: triangle as usize, by: alike.map(|(other, _)| *other as usize).collect(), pieces })
    };
    hidden.into_iter().collect::<Vec<_>>().into_par_iter().filter_map(visible).collect()
}

/// What is visible of each triangle of a scene, by mesh and number, that others of its plane hide in part or whole.
pub fn of_scene(scene: &Scene) -> HashMap<(u32, u32), Vec<[DVec3; 3]>> {
    let (min, max) = scene.bounds();
    let (centre, extent) = (0.5 * (min + max), (max - min).max_element());
    if !extent.is_normal() {
        return HashMap::new();
    }
    let numbers = |mesh: usize| (0..scene.meshes[mesh].triangles.len() as u32).map(move |triangle| (mesh as u32, triangle));
    let sources: Vec<(u32, u32)> = (0..scene.meshes.len()).flat_map(numbers).collect();
    let local = |position: DVec3| ((position - centre) / extent).as_vec3();
    let corners: Vec<[Vec3; 3]> =
        sources.iter().map(|(mesh, triangle)| scene.meshes[*mesh as usize].corners(*triangle as usize).map(local)).collect();
    let covered = find(scene, &ranks(scene), &sources, &corners);
    covered.into_iter().map(|covered| (sources[covered.triangle], covered.pieces)).collect()
}

/// Triangles in a cell of which those of one mesh are not compared: so many meet in a corner, as in the middle of a disc,
/// and to compare all would take time with the square of their number.
const CROWD: usize = 1024;

/// Pairs of triangles of about one plane whose boxes overlap and that `is_wanted` holds for.
fn near(sheets: &[Sheet], is_wanted: impl Fn(usize, usize) -> bool + Sync) -> Vec<(usize, usize)> {
    // Along the two axes in which the plane is widest.
    let across = sheets[0].normal.abs().max_position();
    let flat = |point: DVec3| DVec2::new(point[(across + 1) % 3], point[(across + 2) % 3]);
    let boxes: Vec<(DVec2, DVec2)> = sheets
        .iter()
        .map(|sheet| {
            let [a, b, c] = sheet.corners.map(flat);
            (a.min(b).min(c), a.max(b).max(c))
        })
        .collect();
    let is_near = |a: usize, b: usize| boxes[a].1.min(boxes[b].1).cmpgt(boxes[a].0.max(boxes[b].0)).all();
    let count = sheets.len();
    if count <= 16 {
        return (0..count).flat_map(|b| (0..b).map(move |a| (a, b))).filter(|(a, b)| is_near(*a, *b) && is_wanted(*a, *b)).collect();
    }
    // A grid of about as many cells as triangles.
    let low = boxes.iter().fold(DVec2::INFINITY, |low, of| low.min(of.0));
    let high = boxes.iter().fold(DVec2::NEG_INFINITY, |high, of| high.max(of.1));
    let size = ((high - low).max(DVec2::splat(WIDTH)).element_product() / count as f64).sqrt();
    let last = ((high - low) / size).floor().as_u64vec2();
    let cell = |point: DVec2| ((point - low) / size).floor().as_u64vec2().min(last);
    let mut cells: Vec<(u64, u32)> = Vec::with_capacity(2 * count);
    for (sheet, of) in boxes.iter().enumerate() {
        let (first, end) = (cell(of.0), cell(of.1));
        cells.extend((first.y..=end.y).flat_map(|y| (first.x..=end.x).map(move |x| (y * (last.x + 1) + x, sheet as u32))));
    }
    cells.par_sort_unstable();
    let pairs_of = |members: &[(u64, u32)]| {
        let mut pairs = Vec::new();
        for (place, (number, b)) in members.iter().enumerate() {
            // A mesh's triangles stand side by side.
            let others = match members.len() {
                0..=CROWD => place,
                _ => members.partition_point(|(_, a)| sheets[*a as usize].mesh < sheets[*b as usize].mesh),
            };
            for (_, a) in &members[..others] {
                let (a, b) = (*a as usize, *b as usize);
                // In the one cell that holds the lower corner of what both boxes share.
                let corner = cell(boxes[a].0.max(boxes[b].0));
                if is_near(a, b) && corner.y * (last.x + 1) + corner.x == *number && is_wanted(a, b) {
                    pairs.push((a, b));
                }
            }
        }
        pairs
    };
    cells.chunk_by(|a, b| a.0 == b.0).collect::<Vec<_>>().into_par_iter().flat_map_iter(pairs_of).collect()
}
