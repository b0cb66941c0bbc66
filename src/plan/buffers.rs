//! The buffers of a plan, each listed once: resources are made from this list, and what a run takes is said and checked by it.

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
use crate::path::StoredPath;
use crate::photon::{MapPhoton, Origin, StoredPhoton};
use crate::records::*;
use crate::scene::albedo;
use crate::scene::geometry::Geometry;
use crate::settings::Builder;
use crate::settings::scene::Effect;

/// A buffer that a run will have.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PlannedBuffer {
    /// Several that are alike have the same.
    pub name: &'static str,
    /// What it holds, and so what it is for.
    pub why: &'static str,
    /// Rust's name of the type of its elements.
    pub element: &'static str,
    pub element_bytes: u64,
    /// Elements; 0 where nobody reads any.
    pub count: u64,
}

impl PlannedBuffer {
    /// Vulkan has no empty buffers, so there is one element at least.
    pub fn bytes(&self) -> u64 {
        self.count.max(1) * self.element_bytes
    }
}

fn buffer<T: Pod>(name: &'static str, count: u64, why: &'static str) -> PlannedBuffer {
    PlannedBuffer { name, why, element: std::any::type_name::<T>(), element_bytes: size_of::<T>() as u64, count }
}

pub fn bytes_of(buffers: &[PlannedBuffer]) -> u64 {
    buffers.iter().map(PlannedBuffer::bytes).sum()
}

/// Words of a kind of nonfinite values: how many there were, and three for each of the first ones.
pub const NONFINITE_KIND_WORDS: usize = 1 + 3 * MAX_NONFINITE_VALUES as usize;

fn nonfinite_values() -> PlannedBuffer {
    let kinds = NONFINITE_ESTIMATE as u64 + 1;
    buffer::<u32>("nonfinite values", kinds * NONFINITE_KIND_WORDS as u64, "the nonfinite values that `paranoid` found")
}

/// Words that kernels count clamped values, lost camera paths, samples of surfaces and what these
/// cost in (`glsl/world/scene/film_units.glsl`).
pub const ANOMALY_WORDS: usize = 14;

/// Values of a place that are kept of a block: three channels of each part of light.
pub const PART_VALUES: u64 = 3 * PART_COUNT as u64;

/// Sums of each level of a prefix sum over `items`: sums of blocks of the level below, down to one block.
pub fn block_sum_counts(items: u64, group_size: u32) -> Vec<u64> {
    let block = u64::from(group_size * SCAN_ITEMS);
    let up = |count: &u64| (*count > 1).then(|| count.div_ceil(block));
    std::iter::successors(Some(items.div_ceil(block).max(1)), up).collect()
}

/// One buffer a level, from the finest.
fn block_sums(name: &'static str, items: u64, group_size: u32) -> impl Iterator<Item = PlannedBuffer> {
    block_sum_counts(items, group_size).into_iter().map(move |count| buffer::<u32>(name, count, "sums of blocks, for prefix sums"))
}

/// Work groups of the largest chunk's paths.
pub fn group_count(plan: &RoomPlan) -> u32 {
    plan.path_capacity.div_ceil(plan.settings.group_size)
}

/// Survivors of each work group of so many paths in a scene, with those before them: of the paths that go on and of the photons
/// that are stored, each with a sum behind.
pub fn survivor_count(plan: &ScenePlan, paths: u32) -> u32 {
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
    pub fn buffers(&self) -> Vec<PlannedBuffer> {
        let bounces = u64::from(self.settings.bounces);
        let group_size = self.settings.group_size;
        let (paths, photons) = (u64::from(self.path_array_length()), u64::from(self.photon_capacity));
        let origins = u64::from(self.origin_array_length());
        let points = self.points.len() as u64;
        let sums = points * u64::from(self.channel_count);
        let states = self.streams().first_state_count(self.path_capacity);
        let mut buffers = vec![
            buffer::<Room>("rooms", 1, "the room's corners"),
            buffer::<Wall>("walls", u64::from(FACE_COUNT), "the walls"),
            buffer::<DiscLight>("lights", self.light_photons.len() as u64, "the lights"),
            buffer::<Point>("points", points, "the texels of the walls"),
            buffer::<UVec2>("stream seeds", states, "the first state of each photon's random numbers"),
            buffer::<StoredPath>("even paths", paths, "paths that enter even bounces"),
            buffer::<StoredPath>("odd paths", paths, "paths that enter odd bounces"),
            buffer::<StoredPhoton>("photons", photons, "the photon map"),
            buffer::<Origin>("origins", origins, "which photon each entry of the photon map is"),
            buffer::<u32>("counters", self.counter_array_length(), "lengths of the photon map and of the lists of paths"),
            buffer::<DispatchArgs>("dispatch args", 1, "the size of the next dispatch"),
            buffer::<Tally>("tallies", bounces * u64::from(TALLY_COPIES), "fates of photons"),
            buffer::<Tally>("tallies of rounds", bounces * u64::from(TALLY_COPIES), "fates as the latest whole round left them"),
            buffer::<u64>("film", sums, "sums of the round under way"),
            nonfinite_values(),
        ];
        if self.settings.builder == Builder::Scan {
            let sums = u64::from(group_count(self)) + 1;
            let weights = if self.settings.has_phong() { paths } else { 1 };
            buffers.extend([
                buffer::<u32>("survivors", sums, "survivors of each work group"),
                buffer::<f32>("weights", weights, "each path's weight at the eye"),
            ]);
            buffers.extend(block_sums("sums of survivors", sums, group_size));
        }
        if self.gathers_by_grid() {
            let cells = u64::from(self.grid.cells()) + 1;
            buffers.extend([
                buffer::<u32>("cells", cells, "the first photon of each cell"),
                buffer::<u32>("ranks", photons, "each photon's place in its cell"),
                buffer::<StoredPhoton>("sorted photons", photons, "the photon map by cells"),
                buffer::<u32>("longest", 1, "candidates of the busiest point"),
            ]);
            buffers.extend(block_sums("sums of cells", cells, group_size));
        }
        if self.gathers_by_tree() {
            // A word a photon, up to whole runs of the radix sort.
            let counts = u64::from(self.photon_capacity.next_multiple_of(TREE_RUN));
            buffers.extend([buffer::<UVec2>("tree list", photons, "photons in the order along an axis"); 3]);
            buffers.extend([
                buffer::<u32>("tree ranks", photons, "each photon's place in that order"),
                buffer::<u32>("tree counts", counts, "photons of each digit and run"),
                buffer::<DispatchArgs>("item args", 1, "the size of a dispatch over photons"),
                buffer::<DispatchArgs>("run args", 1, "the size of a dispatch over runs"),
                buffer::<DispatchArgs>("scan args", 1, "the size of a dispatch of a prefix sum"),
                buffer::<u32>("wall begins", u64::from(FACE_COUNT) + 1, "the first photon of each wall"),
                buffer::<u32>("longest", 1, "photons of the fullest wall"),
                buffer::<f32>("planes", photons / u64::from(TREE_LEAF) + 1, "planes that split the tree's nodes"),
                buffer::<StoredPhoton>("tree photons", photons, "the photon map in the tree's order"),
                buffer::<Origin>("tree origins", origins, "which photon each of them is"),
            ]);
            buffers.extend(block_sums("sums of tree counts", counts, group_size));
            if let Some(nearest) = self.settings.nearest {
                let at_once = searches_at_once(self, nearest);
                buffers.extend([
                    buffer::<UVec2>("nearest photons", at_once * u64::from(nearest), "the nearest photons of points"),
                    buffer::<Search>("searches", at_once, "searches under way"),
                    buffer::<u32>("unfinished", 1, "whether some search goes on"),
                ]);
            }
        }
        if self.keeps_squares() {
            buffers.extend([
                buffer::<u64>("film totals", sums, "sums of all rounds"),
                buffer::<u64>("low squares", sums, "lower halves of their squares"),
                buffer::<u64>("high squares", sums, "upper halves of their squares"),
                buffer::<f32>("latest blocks", kept_values(self.points.len()) as u64, "some points of the latest rounds"),
            ]);
        }
        buffers
    }

    /// Bytes of all of them.
    pub fn bytes(&self) -> u64 {
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
    pub fn buffers(&self, geometry: &Geometry) -> Vec<PlannedBuffer> {
        [self.scene_buffers(geometry), self.sensor_buffers(), self.photon_buffers(), self.count_buffers()].concat()
    }

    /// The scene, written once.
    pub(super) fn scene_buffers(&self, geometry: &Geometry) -> Vec<PlannedBuffer> {
        fn of<T: Pod>(name: &'static str, content: &[T], is_kept: bool, why: &'static str) -> PlannedBuffer {
            buffer::<T>(name, if is_kept { content.len() as u64 } else { 0 }, why)
        }
        let (textured, layered) = (self.keeps(Effect::Textures), self.keeps(Effect::Layers));
        let has_tangents = textured || self.keeps(Effect::Anisotropy);
        let has_texels = textured || (self.keeps(Effect::Environment) && geometry.has_sky_picture());
        let (nodes, regions, shares) = self.lights().map_or((0, 0, 0), |of| (of.nodes.len(), of.regions.len(), of.shares.len() + 1));
        vec![
            of("nodes", &geometry.nodes, self.keeps(Effect::Bvh), "the triangles' hierarchy"),
            of("triangles", &geometry.triangles, true, "triangles"),
            buffer::<Vec4>("planes", geometry.planes.len() as u64 + 1, "the triangles' planes"),
            of("normals", &geometry.normals, self.keeps(Effect::SmoothNormals), "the triangles' normals"),
            of("texture coordinates", &geometry.uvs, textured, "the triangles' texture coordinates"),
            of("vertex colours", &geometry.colours, self.keeps(Effect::VertexColours), "the triangles' vertex colours"),
            of("materials", &geometry.materials, true, "materials"),
            of("layered materials", &geometry.layered_materials, layered, "layers of materials"),
            of("layers of triangles", &geometry.triangle_layers, layered && has_tangents, "texture coordinates and tangents of layers"),
            buffer::<Vec2>("albedos", if layered { albedo::TABLE.len() as u64 } else { 0 }, "directional albedos"),
            of("textures", &geometry.textures, has_texels, "sizes of textures"),
            of("emitters", &geometry.emitters, true, "emitters"),
            of("openings", &self.openings(), true, "openings that light comes in through"),
            of("caustic targets", &self.targets, true, "spheres that photons are aimed at"),
            buffer::<LightNode>("light nodes", nodes as u64, "the tree of lights"),
            buffer::<LightRegion>("light regions", regions as u64, "regions in which lights are chosen alike"),
            buffer::<f32>("light shares", shares as u64, "shares of lights in each region"),
        ]
        .into_iter()
        .chain(geometry.texel_parts().map(|part| of::<u32>("texels", part, has_texels, "textures")))
        .collect()
    }

    fn has_covers(&self) -> bool {
        self.keeps(Effect::ClearCoat) || self.keeps(Effect::Sheen) || self.keeps(Effect::Iridescence)
    }

    /// What grows with the pixels or receivers.
    pub(super) fn sensor_buffers(&self) -> Vec<PlannedBuffer> {
        let (pixels, points) = (u64::from(self.sensor.pixels()), u64::from(self.visible_points()));
        let seen = if self.film.sees_light { pixels } else { 0 };
        let measures_bias = self.film.bias == BiasPlan::Blocks;
        let difference_words = (difference_count(pixels as usize) + row_length(pixels as usize)) as u64;
        let mut buffers = vec![
            buffer::<u32>("extra samples", self.extra_samples.table.len() as u64, "samples of tiles that have more"),
            buffer::<u64>("block sums", 3 * pixels, "sums of the block under way"),
            buffer::<u64>("film sums", 3 * pixels, "sums of all blocks"),
            buffer::<u64>("film squares", 6 * pixels, "sums of their squares"),
            buffer::<u64>("surface block sums", 3 * seen, "the same of light that surfaces scatter"),
            buffer::<u64>("surface sums", 3 * seen, "sums of all blocks of it"),
            buffer::<u64>("surface squares", 6 * seen, "sums of their squares"),
            buffer::<u64>(
                "part totals",
                self.part_totals(),
                "light of each part of a path: in all, in some pixels, and where asked in each",
            ),
            buffer::<u64>("part sums", self.part_sums(), "sums of all blocks of parts of each pixel's light"),
            buffer::<f32>("latest blocks", PART_VALUES * kept_values(pixels as usize) as u64, "some pixels of the latest blocks"),
            buffer::<u32>("one hits", u64::from(HIT_KINDS) * pixels, "what one hit would add where none has"),
            buffer::<u32>("one hits of blocks", u64::from(HIT_KINDS) * pixels, "the same as the latest whole block left it"),
            buffer::<u64>(
                "pass sums",
                3 * (if self.film.sees_light { 2 } else { 1 }) * u64::from(self.paths()),
                "samples of pixels in a round",
            ),
            buffer::<VisiblePoint>("visible points", points, "where photons are looked up"),
            buffer::<MattLobes>("matt lobes", if self.keeps(Effect::Layers) { points } else { 0 }, "how layered points weigh light"),
            buffer::<MattCover>("matt covers", if self.has_covers() { points } else { 0 }, "coats, sheen and films of visible points"),
            buffer::<u64>("estimates", 3 * points * u64::from(self.arrival_sets), "what photons add there"),
            buffer::<u64>("near sums", self.near_sums(), "the same within a smaller radius"),
            buffer::<u64>("differences", if measures_bias { difference_words } else { 0 }, "sums that tell the bias"),
        ];
        let classed = if self.has_classes() { points } else { 0 };
        buffers.extend([
            buffer::<u32>("radius classes", classed, "which radius each visible point has"),
            buffer::<f32>("clearances", classed, "how far it is from there to the next wall or edge"),
            buffer::<u32>("class counts", 2 * u64::from(RADIUS_CLASSES), "visible points of each class"),
        ]);
        let cuts = if self.cuts_discs() { points * self.maps().count() as u64 } else { 0 };
        buffers.push(buffer::<[u32; 4]>("disc cuts", cuts, "where walls end what a visible point looks through"));
        let camera_paths = buffer::<CameraPath>("camera paths", self.camera_path_capacity(), "paths that one dispatch leaves");
        buffers.extend([camera_paths; 2]);
        if let Sensor::Receivers { count } = self.sensor {
            buffers.push(buffer::<Receiver>("receivers", u64::from(count), "points that are asked about"));
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
            buffer::<LightPath>("even light paths", paths, "paths that enter even bounces"),
            buffer::<LightPath>("odd light paths", paths, "paths that enter odd bounces"),
            buffer::<MapPhoton>("map", capacity, "the photon map"),
            buffer::<MapPhoton>("sorted map", capacity, "the photon map by buckets"),
            buffer::<u32>("counters", counters, "lengths of the photon map and of the lists of paths"),
            buffer::<DispatchArgs>("dispatch args", 1, "the size of the next dispatch"),
            buffer::<u32>("cells", buckets + 1, "the first photon of each bucket"),
            buffer::<u32>("ranks", capacity, "each photon's place in its bucket"),
            buffer::<u32>("crowded points", 2 + 2 * u64::from(self.points_at_once()), "points with many candidates"),
            buffer::<Tally>("global tallies", tallies, "fates of the global map's photons"),
            buffer::<Tally>("caustic tallies", tallies, "fates of the caustic map's photons"),
            buffer::<u32>("global totals", totals, "what limits cost the global map"),
            buffer::<u32>("caustic totals", totals, "what limits cost the caustic map"),
            buffer::<Tally>("global tallies of blocks", tallies, "fates as the latest whole block left them"),
            buffer::<Tally>("caustic tallies of blocks", tallies, "fates as the latest whole block left them"),
            buffer::<u32>("global totals of blocks", totals, "what limits cost as the latest whole block left it"),
            buffer::<u32>("caustic totals of blocks", totals, "what limits cost as the latest whole block left it"),
        ];
        buffers.extend(block_sums("sums of cells", buckets + 1, self.settings.group_size));
        if self.builder() == Builder::Scan {
            let survivors = u64::from(survivor_count(self, most(|map| map.chunk_photons) as u32));
            buffers.push(buffer::<u32>("survivors", survivors, "survivors and stored photons of each work group"));
            buffers.extend(block_sums("sums of survivors", survivors, self.settings.group_size));
        }
        buffers
    }

    /// What kernels count, whatever the sizes.
    fn count_buffers(&self) -> Vec<PlannedBuffer> {
        vec![
            buffer::<u32>("camera path counts", 1, "how many camera paths a dispatch leaves"),
            buffer::<u64>("part totals of blocks", u64::from(PART_COUNT), "the same as the latest whole block left it"),
            buffer::<u32>("anomalies", ANOMALY_WORDS as u64, "clamped values, lost camera paths, and what these cost"),
            buffer::<u32>("anomalies of blocks", ANOMALY_WORDS as u64, "the same as the latest whole block left them"),
            nonfinite_values(),
        ]
    }

    /// Bytes of all buffers of a run that asks `phases` sets of receivers in turn; of a picture there are none.
    pub fn bytes_of(&self, phases: usize) -> u64 {
        let receivers = self.sensor_buffers().into_iter().find(|buffer| buffer.name == "receivers");
        self.bytes + (phases as u64).saturating_sub(1) * receivers.map_or(0, |receivers| receivers.bytes())
    }
}
