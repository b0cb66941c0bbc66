//! A tree over the lights of a scene, and clusters of them: lights that lie near each other, of which a shadow ray chooses one
//! (Conty Estevez and Kulla 2018). `glsl/world/scene/light_choice.glsl` descends in it. Which way lights face, and what stands
//! before them, a trial finds out cluster by cluster ([`crate::plan::light_choice`]).

use std::collections::{BTreeSet, BinaryHeap};
use std::ops::Range;

use glam::Vec3;

use super::geometry::Geometry;
use super::targets::groups_of;
use crate::constants::*;
use crate::records::{Emitter, LightNode};

/// Most clusters: each is tried at all points of the trial, and has its share in each region.
const MAX_CLUSTERS: usize = 64;
/// Triangles of a flat lamp that needs no choice.
const LAMP_TRIANGLES: usize = 8;
/// A half of no node has less than this share of its lights, so that the tree is not deep.
const LEAST_HALF: usize = 8;
/// What is beyond the scene lies about all of it, and far outside: such a light stays alone.
const FAR: f32 = 8.0;

#[derive(Debug, Clone, PartialEq)]
pub(crate) struct LightTree {
    /// The clusters first.
    pub nodes: Vec<LightNode>,
    pub cluster_count: usize,
}

/// Whether all light comes from one light, or from triangles of a plane that hang together, as the two of a rectangle do: by power is
/// then as good a choice as any.
pub(crate) fn is_one_lamp(geometry: &Geometry) -> bool {
    let emitters = &geometry.emitters;
    if emitters.len() < 2 {
        return true;
    }
    if emitters.iter().any(|emitter| emitter.kind != EMITTER_TRIANGLE) {
        return false;
    }
    // In pieces or whole.
    let numbers: BTreeSet<u32> = emitters.iter().map(|emitter| emitter.triangle).collect();
    if numbers.len() > LAMP_TRIANGLES {
        return false;
    }
    let triangles = || numbers.iter().map(|number| &geometry.triangles[*number as usize]);
    let plane = geometry.triangles[emitters[0].triangle as usize].plane;
    triangles().all(|triangle| triangle.plane == plane)
        && groups_of(&triangles().map(|triangle| [triangle.a, triangle.b, triangle.c]).collect::<Vec<_>>()).len() == 1
}

/// Where a light is, and its share of the power.
#[derive(Debug, Clone, Copy)]
struct Place {
    emitter: u32,
    min: Vec3,
    max: Vec3,
    power: f32,
}

impl Place {
    fn of(geometry: &Geometry, (emitter, light): (usize, &Emitter)) -> Place {
        let (min, max) = match light.kind {
            EMITTER_TRIANGLE => {
                let [a, b, c] = geometry.lamp_corners(light);
                (a.min(b).min(c), a.max(b).max(c))
            }
            EMITTER_DIRECTIONAL | EMITTER_ENVIRONMENT => (Vec3::splat(-FAR), Vec3::splat(FAR)),
            // Of a point or spot light the size is none of a disc.
            EMITTER_POINT | EMITTER_SPOT => (light.position, light.position),
            _ => (light.position - light.size, light.position + light.size),
        };
        Place { emitter: emitter as u32, min, max, power: light.probability }
    }

    fn centre(&self) -> Vec3 {
        0.5 * (self.min + self.max)
    }
}

/// A node under construction: its places, and its halves where it has been cut.
struct Part {
    places: Range<usize>,
    node: LightNode,
    halves: Option<usize>,
}

impl Part {
    fn of(places: &[Place], range: Range<usize>) -> Part {
        let own = &places[range.clone()];
        let min = own.iter().fold(Vec3::INFINITY, |min, place| min.min(place.min));
        let max = own.iter().fold(Vec3::NEG_INFINITY, |max, place| max.max(place.max));
        let power: f64 = own.iter().map(|place| f64::from(place.power)).sum();
        let node = LightNode {
            centre: 0.5 * (min + max),
            radius_squared: 0.25 * (max - min).length_squared(),
            power: power as f32,
            child: LIGHT_LEAF | own[0].emitter,
        };
        Part { places: range, node, halves: None }
    }

    /// What is wide and strong is cut first; a weak one in a room of its own is not forgotten.
    fn priority(&self) -> f32 {
        self.node.radius_squared * self.node.power.sqrt().sqrt()
    }
}

/// Cuts places in two at the middle of their longest axis, or where that leaves next to none on one side, by their number; says how
/// many come first.
fn cut(places: &mut [Place]) -> usize {
    let min = places.iter().fold(Vec3::INFINITY, |min, place| min.min(place.centre()));
    let max = places.iter().fold(Vec3::NEG_INFINITY, |max, place| max.max(place.centre()));
    let axis = (max - min).max_position();
    let middle = 0.5 * (min[axis] + max[axis]);
    let mut below = 0;
    for k in 0..places.len() {
        if places[k].centre()[axis] < middle {
            places.swap(k, below);
            below += 1;
        }
    }
    if below.min(places.len() - below) * LEAST_HALF >= places.len() {
        return below;
    }
    let half = places.len() / 2;
    places.select_nth_unstable_by(half, |a, b| a.centre()[axis].total_cmp(&b.centre()[axis]).then(a.emitter.cmp(&b.emitter)));
    half
}

impl LightTree {
    pub(crate) fn new(geometry: &Geometry) -> LightTree {
        let mut places: Vec<Place> = geometry.emitters.iter().enumerate().map(|emitter| Place::of(geometry, emitter)).collect();
        let mut parts = vec![Part::of(&places, 0..places.len())];
        let mut next = 0;
        while next < parts.len() {
            let range = parts[next].places.clone();
            if range.len() > 1 {
                let middle = range.start + cut(&mut places[range.clone()]);
                parts[next].halves = Some(parts.len());
                parts.push(Part::of(&places, range.start..middle));
                parts.push(Part::of(&places, middle..range.end));
            }
            next += 1;
        }
        let clusters = clusters(&parts);

        // Clusters side by side are near each other.
        let mut order = clusters.clone();
        let mut nodes: Vec<LightNode> = Vec::with_capacity(parts.len());
        let mut next = 0;
        while next < order.len() {
            let part = &parts[order[next]];
            let child = part.halves.map_or(part.node.child, |_| order.len() as u32);
            order.extend(part.halves.into_iter().flat_map(|halves| [halves, halves + 1]));
            nodes.push(LightNode { child, ..part.node });
            next += 1;
        }
        LightTree { nodes, cluster_count: clusters.len() }
    }

    /// Each emitter with its cluster.
    pub(crate) fn clusters_of_emitters(&self) -> Vec<(usize, usize)> {
        let mut clusters: Vec<usize> = (0..self.cluster_count).collect();
        let mut found = Vec::new();
        for (node, LightNode { child, .. }) in self.nodes.iter().enumerate() {
            let cluster = clusters[node];
            // Children follow in the order of their parents.
            if child & LIGHT_LEAF == 0 { clusters.extend([cluster; 2]) } else { found.push(((child & !LIGHT_LEAF) as usize, cluster)) }
        }
        found
    }
}

/// The parts that are clusters, in the order of their places.
fn clusters(parts: &[Part]) -> Vec<usize> {
    let entry = |part: usize| (parts[part].priority().to_bits(), part);
    let mut open = BinaryHeap::from([entry(0)]);
    let mut done = Vec::new();
    while open.len() + done.len() < MAX_CLUSTERS
        && let Some((_, part)) = open.pop()
    {
        match parts[part].halves {
            None => done.push(part),
            Some(halves) => open.extend([entry(halves), entry(halves + 1)]),
        }
    }
    done.extend(open.into_iter().map(|(_, part)| part));
    done.sort_unstable_by_key(|part| parts[*part].places.start);
    done
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::scene::{Light, LightKind, Material, Mesh, Scene, built_in};

    /// Small square lamps over a floor of 1 m, so many a side, with a point light far off and an environment.
    fn lamps(side: u32) -> Geometry {
        let mut mesh = Mesh::parallelogram("floor", DVec3::new(0.0, -1.0, 0.0), DVec3::Z, DVec3::X, 0);
        let mut scene = Scene { meshes: vec![mesh.clone()], ..Scene::default() };
        let width = 1.0 / f64::from(side);
        for k in 0..side * side {
            let corner = DVec3::new(f64::from(k % side) * width, 0.0, f64::from(k / side) * width);
            mesh = Mesh::parallelogram("lamp", corner, 0.5 * width * DVec3::X, 0.5 * width * DVec3::Z, 1);
            scene.meshes.push(mesh.clone());
        }
        scene.materials =
            vec![Material::lambert("matt", Vec3::ONE), Material { emission: Vec3::ONE, ..Material::lambert("lamp", Vec3::ZERO) }];
        let kinds = [
            LightKind::Point { position: DVec3::new(0.0, 30.0, 0.0), intensity: Vec3::splat(1e-6) },
            LightKind::Environment { radiance: Vec3::splat(1e-9) },
        ];
        scene.lights = kinds.map(|kind| Light { name: "light".into(), kind }).into();
        Geometry::new(&scene).unwrap()
    }

    /// Emitters below a node, by its number; returns in how many levels they are.
    fn below(tree: &LightTree, node: usize, found: &mut Vec<u32>) -> u32 {
        let child = tree.nodes[node].child;
        if child & LIGHT_LEAF != 0 {
            found.push(child & !LIGHT_LEAF);
            return 1;
        }
        1 + below(tree, child as usize, found).max(below(tree, child as usize + 1, found))
    }

    /// Of a hundred thousand lights, too, whose tree is made in no time.
    #[test]
    fn every_light_is_in_one_cluster() {
        for side in [1, 2, 5, 40, 224] {
            let geometry = lamps(side);
            let began = std::time::Instant::now();
            let tree = LightTree::new(&geometry);
            let seconds = began.elapsed().as_secs_f64();
            let count = geometry.emitters.len();
            assert!(count > 2 * (side * side) as usize && seconds < 1.0, "{count} lights in {seconds} s");
            assert_eq!(tree.cluster_count, count.min(MAX_CLUSTERS), "{side}");
            assert_eq!(tree.nodes.len(), 2 * count - tree.cluster_count, "{side}");
            let clusters: Vec<Vec<u32>> = (0..tree.cluster_count)
                .map(|cluster| {
                    let mut found = Vec::new();
                    assert!(below(&tree, cluster, &mut found) < 24, "{side}: cluster {cluster} is too deep");
                    found
                })
                .collect();
            let mut all = clusters.concat();
            all.sort_unstable();
            assert_eq!(all, (0..count as u32).collect::<Vec<_>>(), "{side}");
            // However weak, what is not among the others is alone.
            for kind in [EMITTER_POINT, EMITTER_ENVIRONMENT] {
                let alone = geometry.emitters.iter().position(|emitter| emitter.kind == kind).unwrap() as u32;
                assert!(clusters.contains(&vec![alone]), "{side}: {kind}");
            }
            let power: f32 = tree.nodes[..tree.cluster_count].iter().map(|node| node.power).sum();
            assert!((power - 1.0).abs() < 1e-5, "{power}");
            for node in tree.nodes.iter().filter(|node| node.child & LIGHT_LEAF == 0) {
                for half in &tree.nodes[node.child as usize..][..2] {
                    let reach = node.radius_squared.sqrt();
                    assert!((half.centre - node.centre).length() <= 1.001 * reach && half.radius_squared <= node.radius_squared);
                }
            }
        }
    }

    #[test]
    fn a_rectangle_is_one_lamp_and_two_are_not() {
        let of = |scene: &Scene| is_one_lamp(&Geometry::new(scene).unwrap());
        for name in ["cornell", "cornell-spheres", "caustic-sphere", "sky-over-plane", "point-over-plane"] {
            assert!(of(&built_in::by_name(name).unwrap()), "{name}");
        }
        let mut cornell = built_in::by_name("cornell").unwrap();
        let mut second = cornell.meshes.iter().find(|mesh| mesh.name == "lamp").unwrap().clone();
        second.positions.iter_mut().for_each(|position| position.x -= 0.32);
        cornell.meshes.push(second);
        assert!(!of(&cornell));
        assert!(!of(&built_in::by_name("furnace").unwrap()));
    }
}
