//! The buffers of a plan, each listed once: resources are made from this list, and what a run takes is said and checked by it.

use std::marker::PhantomData;

use bytemuck::Pod;
use glam::{UVec2, Vec2, Vec4};

use super::RoomPlan;
use super::differences::{difference_count, row_length};
use super::film::BiasPlan;
use super::latest_blocks::{kept_count, kept_values};
use super::scene::{MapPlan, ScenePlan};
use super::sensor::Sensor;
use crate::constants::{
    FACE_COUNT, HIT_KINDS, MAX_NONFINITE_VALUES, NONFINITE_ESTIMATE, PART_COUNT, RADIUS_CLASSES, SCAN_ITEMS, TALLY_COPIES, TOTAL_WORDS,
    TREE_LEAF, TREE_RUN,
};
use crate::photon::{MapPhoton, Origin, StoredPhoton};
use crate::photon_state::PackedPhotonState;
use crate::records::*;
use crate::scene::albedo;
use crate::scene::geometry::Geometry;
use crate::settings::Builder;
use crate::settings::scene::Effect;

/// A buffer that a run will have.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct PlannedBuffer {
    /// Several that are alike have the same.
    pub name: &'static str,
    /// What it holds, and so what it is for.
    pub why: &'static str,
    pub element_bytes: u64,
    /// Elements; 0 where nobody reads any.
    pub count: u64,
}

impl PlannedBuffer {
    /// Vulkan has no empty buffers, so there is one element at least.
    pub(crate) fn bytes(&self) -> u64 {
        self.count.max(1) * self.element_bytes
    }
}

/// A buffer by its name and the type of its elements: declared once below, listed by a plan with its length, and made by the engine.
#[derive(Debug)]
pub(crate) struct Declared<T> {
    pub name: &'static str,
    element: PhantomData<T>,
}

impl<T> Clone for Declared<T> {
    fn clone(&self) -> Declared<T> {
        *self
    }
}

impl<T> Copy for Declared<T> {}

impl<T: Pod> Declared<T> {
    fn listed(self, count: u64, why: &'static str) -> PlannedBuffer {
        PlannedBuffer { name: self.name, why, element_bytes: size_of::<T>() as u64, count }
    }
}

macro_rules! declare {
    ($($declared:ident: $element:ty = $name:literal),* $(,)?) => {
        $(pub(crate) const $declared: Declared<$element> = Declared { name: $name, element: PhantomData };)*
    };
}

/// Buffers of the paper's box.
pub(crate) mod room {
    use super::*;

    declare! {
        ROOMS: Room = "rooms",
        WALLS: Wall = "walls",
        LIGHTS: DiscLight = "lights",
        POINTS: Point = "points",
        STREAM_SEEDS: UVec2 = "stream seeds",
        PATHS: PackedPhotonState = "paths",
        PHOTONS: StoredPhoton = "photons",
        ORIGINS: Origin = "origins",
        COUNTERS: u32 = "counters",
        DISPATCH_ARGS: DispatchArgs = "dispatch args",
        TALLIES: Tally = "tallies",
        TALLIES_OF_ROUNDS: Tally = "tallies of rounds",
        FILM: u64 = "film",
        SURVIVORS: u32 = "survivors",
        WEIGHTS: f32 = "weights",
        CELLS: u32 = "cells",
        RANKS: u32 = "ranks",
        SORTED_PHOTONS: StoredPhoton = "sorted photons",
        LONGEST: u32 = "longest",
        TREE_LISTS: UVec2 = "tree lists",
        TREE_RANKS: u32 = "tree ranks",
        TREE_COUNTS: u32 = "tree counts",
        ITEM_ARGS: DispatchArgs = "item args",
        RUN_ARGS: DispatchArgs = "run args",
        SCAN_ARGS: DispatchArgs = "scan args",
        WALL_BEGINS: u32 = "wall begins",
        PLANES: f32 = "planes",
        TREE_PHOTONS: StoredPhoton = "tree photons",
        TREE_ORIGINS: Origin = "tree origins",
        NEAREST_PHOTONS: UVec2 = "nearest photons",
        SEARCHES: Search = "searches",
        UNFINISHED: u32 = "unfinished",
        FILM_TOTALS: u64 = "film totals",
        LOW_SQUARES: u64 = "low squares",
        HIGH_SQUARES: u64 = "high squares",
        LATEST_BLOCKS: f32 = "latest blocks",
        SUMS_OF_SURVIVORS: u32 = "sums of survivors",
        SUMS_OF_CELLS: u32 = "sums of cells",
        SUMS_OF_TREE_COUNTS: u32 = "sums of tree counts",
    }
}

/// Buffers of a scene.
pub(crate) mod scene {
    use super::*;

    declare! {
        NODES: BvhNode = "nodes",
        TRIANGLES: Triangle = "triangles",
        NORMALS: TriangleNormals = "normals",
        UVS: TriangleUvs = "uvs",
        VERTEX_COLOURS: TriangleColours = "vertex colours",
        MATERIALS: SurfaceMaterial = "materials",
        LAYERED_MATERIALS: LayeredMaterial = "layered materials",
        TRIANGLE_LAYERS: TriangleLayers = "triangle layers",
        TEXTURES: TextureInfo = "textures",
        EMITTERS: Emitter = "emitters",
        OPENINGS: CausticTarget = "openings",
        CAUSTIC_TARGETS: CausticTarget = "caustic targets",
        TEXELS: u32 = "texels",
        PLANES: Vec4 = "planes",
        ALBEDOS: Vec2 = "albedos",
        LIGHT_NODES: LightNode = "light nodes",
        LIGHT_REGIONS: LightRegion = "light regions",
        LIGHT_SHARES: f32 = "light shares",
        EXTRA_SAMPLES: u32 = "extra samples",
        SUMS_OF_BLOCK: u64 = "sums of block",
        FILM_SUMS: u64 = "film sums",
        FILM_SQUARES: u64 = "film squares",
        SURFACE_SUMS_OF_BLOCK: u64 = "surface sums of block",
        SURFACE_SUMS: u64 = "surface sums",
        SURFACE_SQUARES: u64 = "surface squares",
        PART_TOTALS: u64 = "part totals",
        PART_SUMS: u64 = "part sums",
        LATEST_BLOCKS: f32 = "latest blocks",
        SINGLE_HITS: u32 = "single hits",
        SINGLE_HITS_OF_BLOCKS: u32 = "single hits of blocks",
        PASS_SUMS: u64 = "pass sums",
        VISIBLE_POINTS: VisiblePoint = "visible points",
        ROUGH_LOBES: RoughLobes = "rough lobes",
        ROUGH_COVERS: RoughCover = "rough covers",
        ESTIMATES: u64 = "estimates",
        NEAR_SUMS: u64 = "near sums",
        DIFFERENCES: u64 = "differences",
        RADIUS_CLASSES: u32 = "radius classes",
        CLEARANCES: f32 = "clearances",
        CLASS_COUNTS: u32 = "class counts",
        DISC_CUTS: [u32; 4] = "disc cuts",
        CAMERA_PATHS: CameraPath = "camera paths",
        RECEIVERS: Receiver = "receivers",
        PATHS: PhotonState = "paths",
        MAP: MapPhoton = "map",
        SORTED_MAP: MapPhoton = "sorted map",
        COUNTERS: u32 = "counters",
        DISPATCH_ARGS: DispatchArgs = "dispatch args",
        CELLS: u32 = "cells",
        RANKS: u32 = "ranks",
        DENSE_POINTS: u32 = "dense points",
        TALLIES: Tally = "tallies",
        TOTALS: u32 = "totals",
        TALLIES_OF_BLOCKS: Tally = "tallies of blocks",
        TOTALS_OF_BLOCKS: u32 = "totals of blocks",
        SURVIVORS: u32 = "survivors",
        CAMERA_PATH_COUNTS: u32 = "camera path counts",
        PART_TOTALS_OF_BLOCKS: u64 = "part totals of blocks",
        ANOMALIES: u32 = "anomalies",
        ANOMALIES_OF_BLOCKS: u32 = "anomalies of blocks",
        SUMS_OF_CELLS: u32 = "sums of cells",
        SUMS_OF_SURVIVORS: u32 = "sums of survivors",
    }
}

pub(crate) fn bytes_of(buffers: &[PlannedBuffer]) -> u64 {
    buffers.iter().map(PlannedBuffer::bytes).sum()
}

/// Words of a kind of nonfinite values: how many there were, and three for each of the first ones.
pub(crate) const NONFINITE_KIND_WORDS: usize = 1 + 3 * MAX_NONFINITE_VALUES as usize;

pub(crate) const NONFINITE_VALUES: Declared<u32> = Declared { name: "nonfinite values", element: PhantomData };

fn nonfinite_values() -> PlannedBuffer {
    let kinds = NONFINITE_ESTIMATE as u64 + 1;
    NONFINITE_VALUES.listed(kinds * NONFINITE_KIND_WORDS as u64, "the nonfinite values that `paranoid` found")
}

/// Words that kernels count clamped values, lost camera paths, samples of surfaces and what these
/// cost in (`glsl/world/scene/film_units.glsl`).
pub(crate) const ANOMALY_WORDS: usize = 14;

/// Values of a place that are kept of a block: three channels of each part of light.
pub(crate) const PART_VALUES: u64 = 3 * PART_COUNT as u64;

/// Sums of each level of a prefix sum over `items`: sums of blocks of the level below, down to one block.
pub(crate) fn block_sum_counts(items: u64, group_size: u32) -> Vec<u64> {
    let block = u64::from(group_size * SCAN_ITEMS);
    let up = |count: &u64| (*count > 1).then(|| count.div_ceil(block));
    std::iter::successors(Some(items.div_ceil(block).max(1)), up).collect()
}

/// One buffer a level, from the finest.
fn block_sums(declared: Declared<u32>, items: u64, group_size: u32) -> impl Iterator<Item = PlannedBuffer> {
    block_sum_counts(items, group_size).into_iter().map(move |count| declared.listed(count, "sums of blocks, for prefix sums"))
}

/// Work groups of the largest chunk's paths.
pub(crate) fn group_count(plan: &RoomPlan) -> u32 {
    plan.path_capacity.div_ceil(plan.settings.group_size)
}

/// Survivors of each work group of so many paths in a scene, with those before them: of the paths that go on and of the photons
/// that are stored, each with a sum behind.
pub(crate) fn survivor_count(plan: &ScenePlan, paths: u32) -> u32 {
    2 * (paths.div_ceil(plan.settings.group_size) + 1)
}

/// Photons that the searches under way may hold: 32 MiB, less than any device's largest buffer.
const SEARCH_ENTRIES: u64 = 1 << 22;

/// Points whose `nearest` photons are searched for at once.
fn searches_at_once(plan: &RoomPlan, nearest: u32) -> u64 {
    let group = u64::from(plan.settings.group_size);
    (SEARCH_ENTRIES / u64::from(nearest) / group * group).clamp(group, (plan.points.len() as u64).next_multiple_of(group))
}

impl RoomPlan {
    /// Every buffer of a run.
    pub(crate) fn buffers(&self) -> Vec<PlannedBuffer> {
        let bounces = u64::from(self.settings.bounces);
        let group_size = self.settings.group_size;
        let (paths, photons) = (u64::from(self.path_array_length()), u64::from(self.photon_capacity));
        let origins = u64::from(self.origin_array_length());
        let points = self.points.len() as u64;
        let sums = points * u64::from(self.channel_count);
        let states = self.streams().first_state_count(self.path_capacity);
        let mut buffers = vec![
            room::ROOMS.listed(1, "the room's corners"),
            room::WALLS.listed(u64::from(FACE_COUNT), "the walls"),
            room::LIGHTS.listed(self.light_photons.len() as u64, "the lights"),
            room::POINTS.listed(points, "the texels of the walls"),
            room::STREAM_SEEDS.listed(states, "the first state of each photon's random numbers"),
            room::PATHS.listed(paths, "paths that enter even bounces"),
            room::PATHS.listed(paths, "paths that enter odd bounces"),
            room::PHOTONS.listed(photons, "the photon map"),
            room::ORIGINS.listed(origins, "which photon each entry of the photon map is"),
            room::COUNTERS.listed(self.counter_array_length(), "lengths of the photon map and of the lists of paths"),
            room::DISPATCH_ARGS.listed(1, "the size of the next dispatch"),
            room::TALLIES.listed(bounces * u64::from(TALLY_COPIES), "fates of photons"),
            room::TALLIES_OF_ROUNDS.listed(bounces * u64::from(TALLY_COPIES), "fates as the latest whole round left them"),
            room::FILM.listed(sums, "sums of the round under way"),
            nonfinite_values(),
        ];
        if self.settings.builder == Builder::Scan {
            let sums = u64::from(group_count(self)) + 1;
            let weights = if self.settings.has_phong() { paths } else { 1 };
            buffers.extend([
                room::SURVIVORS.listed(sums, "survivors of each work group"),
                room::WEIGHTS.listed(weights, "each path's weight at the eye"),
            ]);
            buffers.extend(block_sums(room::SUMS_OF_SURVIVORS, sums, group_size));
        }
        if self.gathers_by_grid() {
            let cells = u64::from(self.grid.cells()) + 1;
            buffers.extend([
                room::CELLS.listed(cells, "the first photon of each cell"),
                room::RANKS.listed(photons, "each photon's place in its cell"),
                room::SORTED_PHOTONS.listed(photons, "the photon map by cells"),
                room::LONGEST.listed(1, "candidates of the busiest point"),
            ]);
            buffers.extend(block_sums(room::SUMS_OF_CELLS, cells, group_size));
        }
        if self.gathers_by_tree() {
            // A word a photon, up to whole runs of the radix sort.
            let counts = u64::from(self.photon_capacity.next_multiple_of(TREE_RUN));
            buffers.extend([room::TREE_LISTS.listed(photons, "photons in the order along an axis"); 3]);
            buffers.extend([
                room::TREE_RANKS.listed(photons, "each photon's place in that order"),
                room::TREE_COUNTS.listed(counts, "photons of each digit and run"),
                room::ITEM_ARGS.listed(1, "the size of a dispatch over photons"),
                room::RUN_ARGS.listed(1, "the size of a dispatch over runs"),
                room::SCAN_ARGS.listed(1, "the size of a dispatch of a prefix sum"),
                room::WALL_BEGINS.listed(u64::from(FACE_COUNT) + 1, "the first photon of each wall"),
                room::LONGEST.listed(1, "photons of the fullest wall"),
                room::PLANES.listed(photons / u64::from(TREE_LEAF) + 1, "planes that split the tree's nodes"),
                room::TREE_PHOTONS.listed(photons, "the photon map in the tree's order"),
                room::TREE_ORIGINS.listed(origins, "which photon each of them is"),
            ]);
            buffers.extend(block_sums(room::SUMS_OF_TREE_COUNTS, counts, group_size));
            if let Some(nearest) = self.settings.nearest {
                let at_once = searches_at_once(self, nearest);
                buffers.extend([
                    room::NEAREST_PHOTONS.listed(at_once * u64::from(nearest), "the nearest photons of points"),
                    room::SEARCHES.listed(at_once, "searches under way"),
                    room::UNFINISHED.listed(1, "whether some search goes on"),
                ]);
            }
        }
        if self.keeps_squares() {
            buffers.extend([
                room::FILM_TOTALS.listed(sums, "sums of all rounds"),
                room::LOW_SQUARES.listed(sums, "lower halves of their squares"),
                room::HIGH_SQUARES.listed(sums, "upper halves of their squares"),
                room::LATEST_BLOCKS.listed(kept_values(self.points.len()) as u64, "some points of the latest rounds"),
            ]);
        }
        buffers
    }

    /// Bytes of all of them.
    pub(crate) fn bytes(&self) -> u64 {
        bytes_of(&self.buffers())
    }
}

impl ScenePlan {
    /// Sums of what lies within a smaller radius of visible points, three channels of each map.
    pub fn near_sums(&self) -> u64 {
        let maps = if self.film.bias == BiasPlan::Blocks { 1 + u64::from(self.caustic.is_some()) } else { 0 };
        3 * u64::from(self.visible_points()) * maps
    }

    /// Values of all pixels' parts of light: three channels of each but direct light. 0 where they are not kept apart.
    pub fn part_sums(&self) -> u64 {
        if self.keeps_parts() { (PART_VALUES - 3) * u64::from(self.sensor.pixels()) } else { 0 }
    }

    /// Totals of all pixels, values of kept ones, and values of all.
    fn part_totals(&self) -> u64 {
        u64::from(PART_COUNT) + PART_VALUES * kept_count(self.sensor.pixels() as usize) as u64 + self.part_sums()
    }

    /// Every buffer of a run, with one set of receivers where points are asked.
    pub(crate) fn buffers(&self, geometry: &Geometry) -> Vec<PlannedBuffer> {
        [self.scene_buffers(geometry), self.sensor_buffers(), self.photon_buffers(), self.count_buffers()].concat()
    }

    /// The scene, written once.
    pub(super) fn scene_buffers(&self, geometry: &Geometry) -> Vec<PlannedBuffer> {
        fn of<T: Pod>(declared: Declared<T>, content: &[T], is_kept: bool, why: &'static str) -> PlannedBuffer {
            declared.listed(if is_kept { content.len() as u64 } else { 0 }, why)
        }
        let (textured, layered) = (self.simulates(Effect::Textures), self.simulates(Effect::Layers));
        let has_tangents = textured || self.simulates(Effect::Anisotropy);
        let has_texels = textured || (self.simulates(Effect::Environment) && geometry.has_sky_picture());
        let (nodes, regions, shares) = self.lights().map_or((0, 0, 0), |of| (of.nodes.len(), of.regions.len(), of.shares.len() + 1));
        vec![
            of(scene::NODES, &geometry.nodes, self.simulates(Effect::Bvh), "the triangles' hierarchy"),
            of(scene::TRIANGLES, &geometry.triangles, true, "triangles"),
            scene::PLANES.listed(geometry.planes.len() as u64 + 1, "the triangles' planes"),
            of(scene::NORMALS, &geometry.normals, self.simulates(Effect::SmoothNormals), "the triangles' normals"),
            of(scene::UVS, &geometry.uvs, textured, "the triangles' texture coordinates"),
            of(scene::VERTEX_COLOURS, &geometry.colours, self.simulates(Effect::VertexColours), "the triangles' vertex colours"),
            of(scene::MATERIALS, &geometry.materials, true, "materials"),
            of(scene::LAYERED_MATERIALS, &geometry.layered_materials, layered, "layers of materials"),
            of(scene::TRIANGLE_LAYERS, &geometry.triangle_layers, layered && has_tangents, "texture coordinates and tangents of layers"),
            scene::ALBEDOS.listed(if layered { albedo::TABLE.len() as u64 } else { 0 }, "directional albedos"),
            of(scene::TEXTURES, &geometry.textures, has_texels, "sizes of textures"),
            of(scene::EMITTERS, &geometry.emitters, true, "emitters"),
            of(scene::OPENINGS, &self.openings(), true, "openings that light comes in through"),
            of(scene::CAUSTIC_TARGETS, &self.targets, true, "spheres that photons are aimed at"),
            scene::LIGHT_NODES.listed(nodes as u64, "the tree of lights"),
            scene::LIGHT_REGIONS.listed(regions as u64, "regions in which lights are chosen alike"),
            scene::LIGHT_SHARES.listed(shares as u64, "shares of lights in each region"),
        ]
        .into_iter()
        .chain(geometry.texel_parts().map(|part| of(scene::TEXELS, part, has_texels, "textures")))
        .collect()
    }

    fn has_covers(&self) -> bool {
        self.simulates(Effect::ClearCoat) || self.simulates(Effect::Sheen) || self.simulates(Effect::Iridescence)
    }

    /// What grows with the pixels or receivers.
    pub(super) fn sensor_buffers(&self) -> Vec<PlannedBuffer> {
        let (pixels, points) = (u64::from(self.sensor.pixels()), u64::from(self.visible_points()));
        let seen = if self.film.sees_light { pixels } else { 0 };
        let measures_bias = self.film.bias == BiasPlan::Blocks;
        let difference_words = (difference_count(pixels as usize) + row_length(pixels as usize)) as u64;
        let mut buffers = vec![
            scene::EXTRA_SAMPLES.listed(self.extra_samples.table.len() as u64, "samples of tiles that have more"),
            scene::SUMS_OF_BLOCK.listed(3 * pixels, "sums of the block under way"),
            scene::FILM_SUMS.listed(3 * pixels, "sums of all blocks"),
            scene::FILM_SQUARES.listed(6 * pixels, "sums of their squares"),
            scene::SURFACE_SUMS_OF_BLOCK.listed(3 * seen, "the same of light that surfaces scatter"),
            scene::SURFACE_SUMS.listed(3 * seen, "sums of all blocks of it"),
            scene::SURFACE_SQUARES.listed(6 * seen, "sums of their squares"),
            scene::PART_TOTALS.listed(self.part_totals(), "light of each part of a path: in all, in some pixels, and where asked in each"),
            scene::PART_SUMS.listed(self.part_sums(), "sums of all blocks of parts of each pixel's light"),
            scene::LATEST_BLOCKS.listed(PART_VALUES * kept_values(pixels as usize) as u64, "some pixels of the latest blocks"),
            scene::SINGLE_HITS.listed(u64::from(HIT_KINDS) * pixels, "what one hit would add where none has"),
            scene::SINGLE_HITS_OF_BLOCKS.listed(u64::from(HIT_KINDS) * pixels, "the same as the latest whole block left it"),
            scene::PASS_SUMS
                .listed(3 * (if self.film.sees_light { 2 } else { 1 }) * u64::from(self.paths()), "samples of pixels in a round"),
            scene::VISIBLE_POINTS.listed(points, "where photons are looked up"),
            scene::ROUGH_LOBES.listed(if self.simulates(Effect::Layers) { points } else { 0 }, "how layered points weigh light"),
            scene::ROUGH_COVERS.listed(if self.has_covers() { points } else { 0 }, "coats, sheen and films of visible points"),
            scene::ESTIMATES.listed(3 * points * u64::from(self.arrival_sets), "what photons add there"),
            scene::NEAR_SUMS.listed(self.near_sums(), "the same within a smaller radius"),
            scene::DIFFERENCES.listed(if measures_bias { difference_words } else { 0 }, "sums that tell the bias"),
        ];
        let classed = if self.has_classes() { points } else { 0 };
        buffers.extend([
            scene::RADIUS_CLASSES.listed(classed, "which radius each visible point has"),
            scene::CLEARANCES.listed(classed, "how far it is from there to the next wall or edge"),
            scene::CLASS_COUNTS.listed(2 * u64::from(RADIUS_CLASSES), "visible points of each class"),
        ]);
        let cuts = if self.cuts_discs() { points * self.maps().count() as u64 } else { 0 };
        buffers.push(scene::DISC_CUTS.listed(cuts, "where walls end what a visible point looks through"));
        let camera_paths = scene::CAMERA_PATHS.listed(self.camera_path_capacity(), "paths that one dispatch leaves");
        buffers.extend([camera_paths; 2]);
        if let Sensor::Receivers { count } = self.sensor {
            buffers.push(scene::RECEIVERS.listed(u64::from(count), "points that are asked about"));
        }
        buffers
    }

    /// Photons of a chunk and their map; both maps of a round use the same buffers in turn.
    fn photon_buffers(&self) -> Vec<PlannedBuffer> {
        let Some(counters) = self.maps().map(MapPlan::counter_count).max() else { return Vec::new() };
        let most = |size: fn(&MapPlan) -> u32| self.maps().map(size).max().map_or(0, u64::from);
        let (paths, buckets) = (most(|map| map.path_array_length), most(|map| map.bucket_count));
        // In the first round the map holds the trial's photons first.
        let of_trial = self.trial.iter().flat_map(|trial| &trial.photons).map(|photons| photons.kept.len() as u64).max();
        let capacity = most(|map| map.capacity).max(of_trial.unwrap_or(0));
        let tallies = u64::from(self.tally_rows() * TALLY_COPIES);
        let totals = u64::from(TOTAL_WORDS * TALLY_COPIES);
        let mut buffers = vec![
            scene::PATHS.listed(paths, "paths that enter even bounces"),
            scene::PATHS.listed(paths, "paths that enter odd bounces"),
            scene::MAP.listed(capacity, "the photon map"),
            scene::SORTED_MAP.listed(capacity, "the photon map by buckets"),
            scene::COUNTERS.listed(counters, "lengths of the photon map and of the lists of paths"),
            scene::DISPATCH_ARGS.listed(1, "the size of the next dispatch"),
            scene::CELLS.listed(buckets + 1, "the first photon of each bucket"),
            scene::RANKS.listed(capacity, "each photon's place in its bucket"),
            scene::DENSE_POINTS.listed(2 + 2 * u64::from(self.points_at_once()), "points with many candidates"),
            scene::TALLIES.listed(tallies, "fates of the global map's photons"),
            scene::TALLIES.listed(tallies, "fates of the caustic map's photons"),
            scene::TOTALS.listed(totals, "what limits cost the global map"),
            scene::TOTALS.listed(totals, "what limits cost the caustic map"),
            scene::TALLIES_OF_BLOCKS.listed(tallies, "fates as the latest whole block left them"),
            scene::TALLIES_OF_BLOCKS.listed(tallies, "fates as the latest whole block left them"),
            scene::TOTALS_OF_BLOCKS.listed(totals, "what limits cost as the latest whole block left it"),
            scene::TOTALS_OF_BLOCKS.listed(totals, "what limits cost as the latest whole block left it"),
        ];
        buffers.extend(block_sums(scene::SUMS_OF_CELLS, buckets + 1, self.settings.group_size));
        if self.builder() == Builder::Scan {
            let survivors = u64::from(survivor_count(self, most(|map| map.chunk_photons) as u32));
            buffers.push(scene::SURVIVORS.listed(survivors, "survivors and stored photons of each work group"));
            buffers.extend(block_sums(scene::SUMS_OF_SURVIVORS, survivors, self.settings.group_size));
        }
        buffers
    }

    /// What kernels count, whatever the sizes.
    fn count_buffers(&self) -> Vec<PlannedBuffer> {
        vec![
            scene::CAMERA_PATH_COUNTS.listed(1, "how many camera paths a dispatch leaves"),
            scene::PART_TOTALS_OF_BLOCKS.listed(u64::from(PART_COUNT), "the same as the latest whole block left it"),
            scene::ANOMALIES.listed(ANOMALY_WORDS as u64, "clamped values, lost camera paths, and what these cost"),
            scene::ANOMALIES_OF_BLOCKS.listed(ANOMALY_WORDS as u64, "the same as the latest whole block left them"),
            nonfinite_values(),
        ]
    }

    /// Bytes of all buffers of a run that asks `phases` sets of receivers in turn; of a picture there are none.
    pub fn bytes_of(&self, phases: usize) -> u64 {
        let receivers = self.sensor_buffers().into_iter().find(|buffer| buffer.name == scene::RECEIVERS.name);
        self.bytes + (phases as u64).saturating_sub(1) * receivers.map_or(0, |receivers| receivers.bytes())
    }
}
