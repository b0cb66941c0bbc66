//! What a plan's buffers take on the device: one list for each line, by the names that the engine gives them.
//! `resources` and `transport::resources` make them; `tests/memory.rs` holds what they made against these lists.

use bytemuck::Pod;
use glam::UVec2;

use super::RoomPlan;
use super::scene::{MapPlan, ScenePlan};
use super::sensor::Sensor;
use crate::constants::{
    FACE_COUNT, HIT_KINDS, MAX_NONFINITE_VALUES, NONFINITE_ESTIMATE, PART_COUNT, SCAN_ITEMS, TALLY_COPIES, TOTAL_WORDS, TREE_LEAF, TREE_RUN,
};
use crate::path::StoredPath;
use crate::photon::{MapPhoton, Origin, StoredPhoton};
use crate::records::*;
use crate::scene::geometry::Geometry;
use crate::settings::Builder;
use crate::settings::scene::Effect;

/// A buffer, or several of one name, and all their bytes.
pub type Stated = (&'static str, u64);

/// Bytes of `count` records; Vulkan has no empty buffers, so there is one at least.
fn array<T: Pod>(count: u64) -> u64 {
    count.max(1) * size_of::<T>() as u64
}

/// Words of the buffer in which kernels note what is odd: of each kind a count and the first ones.
const NONFINITE_WORDS: u64 = (NONFINITE_ESTIMATE as u64 + 1) * (1 + 3 * MAX_NONFINITE_VALUES as u64);

/// Sums of each level of a prefix sum over `items`: sums of blocks of the level below, down to one block.
pub fn block_sum_counts(items: u64, group_size: u32) -> Vec<u64> {
    let block = u64::from(group_size * SCAN_ITEMS);
    let up = |count: &u64| (*count > 1).then(|| count.div_ceil(block));
    std::iter::successors(Some(items.div_ceil(block).max(1)), up).collect()
}

fn block_sum_bytes(items: u64, group_size: u32) -> u64 {
    block_sum_counts(items, group_size).into_iter().map(array::<u32>).sum()
}

/// Counts of a list of the kd-tree: a word a photon, up to whole runs of the radix sort.
pub fn tree_count_capacity(plan: &RoomPlan) -> u32 {
    plan.photon_capacity.next_multiple_of(TREE_RUN)
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
pub fn searches_at_once(plan: &RoomPlan, nearest: u32) -> u64 {
    let group = u64::from(plan.settings.group_size);
    (SEARCH_ENTRIES / u64::from(nearest) / group * group).clamp(group, (plan.points.len() as u64).next_multiple_of(group))
}

impl RoomPlan {
    /// Every buffer of the paper's line.
    pub fn buffers(&self) -> Vec<Stated> {
        let bounces = u64::from(self.settings.bounces);
        let (paths, photons) = (u64::from(self.path_array_length()), u64::from(self.photon_capacity));
        let origins = u64::from(self.origin_array_length());
        let points = self.points.len() as u64;
        let sums = points * u64::from(self.channel_count);
        let mut buffers = vec![
            ("rooms", array::<Room>(1)),
            ("walls", array::<Wall>(u64::from(FACE_COUNT))),
            ("lights", array::<DiscLight>(self.light_photons.len() as u64)),
            ("points", array::<Point>(points)),
            ("stream seeds", array::<UVec2>(self.streams().first_state_count(self.path_capacity))),
            ("paths", 2 * array::<StoredPath>(paths)),
            ("photons", array::<StoredPhoton>(photons)),
            ("origins", array::<Origin>(origins)),
            ("counters", array::<u32>(self.counter_array_length())),
            ("dispatch args", array::<DispatchArgs>(1)),
            ("tallies", array::<Tally>(bounces * u64::from(TALLY_COPIES))),
            ("film", array::<u64>(sums)),
            ("nonfinite_values", array::<u32>(NONFINITE_WORDS)),
        ];
        if self.settings.builder == Builder::Scan {
            let sums = u64::from(group_count(self)) + 1;
            buffers.extend([
                ("survivors", array::<u32>(sums)),
                ("block sums", block_sum_bytes(sums, self.settings.group_size)),
                ("weights", array::<f32>(if self.settings.has_phong() { paths } else { 1 })),
            ]);
        }
        if self.gathers_by_grid() {
            let cells = u64::from(self.grid.cells()) + 1;
            buffers.extend([
                ("cells", array::<u32>(cells)),
                ("ranks", array::<u32>(photons)),
                ("block sums", block_sum_bytes(cells, self.settings.group_size)),
                ("sorted photons", array::<StoredPhoton>(photons)),
                ("longest", array::<u32>(1)),
            ]);
        }
        if self.gathers_by_tree() {
            let counts = u64::from(tree_count_capacity(self));
            buffers.extend([
                ("tree lists", 3 * array::<UVec2>(photons)),
                ("tree ranks", array::<u32>(photons)),
                ("tree counts", array::<u32>(counts)),
                ("block sums", block_sum_bytes(counts, self.settings.group_size)),
                ("tree dispatch args", 3 * array::<DispatchArgs>(1)),
                ("wall begins", array::<u32>(u64::from(FACE_COUNT) + 1)),
                ("longest", array::<u32>(1)),
                ("planes", array::<f32>(photons / u64::from(TREE_LEAF) + 1)),
                ("tree photons", array::<StoredPhoton>(photons)),
                ("tree origins", array::<Origin>(origins)),
            ]);
            if let Some(nearest) = self.settings.nearest {
                let at_once = searches_at_once(self, nearest);
                buffers.extend([
                    ("nearest photons", array::<UVec2>(at_once * u64::from(nearest))),
                    ("searches", array::<Search>(at_once)),
                    ("unfinished", array::<u32>(1)),
                ]);
            }
        }
        if self.keeps_squares() {
            buffers.push(("film totals and squares", 3 * array::<u64>(sums)));
        }
        buffers
    }

    /// Bytes of all of them.
    pub fn bytes(&self) -> u64 {
        self.buffers().iter().map(|(_, bytes)| bytes).sum()
    }
}

/// Bytes of a pixel on the film: sums and squares of three channels.
const FILM_PIXEL_BYTES: u64 = 3 * 8 + 3 * 16;

/// Every buffer of lighting a scene of triangles, with one set of receivers where points are asked.
pub(super) fn of_transport(plan: &ScenePlan, geometry: &Geometry, keeps: &dyn Fn(Effect) -> bool) -> Vec<Stated> {
    fn kept<T: Pod>(content: &[T], is_kept: bool) -> u64 {
        array::<T>(if is_kept { content.len() as u64 } else { 0 })
    }
    let pixels = u64::from(plan.sensor.pixels());
    let points = u64::from(plan.visible_points());
    let textured = keeps(Effect::Textures);
    let mut buffers = vec![
        ("nodes", kept(&geometry.nodes, keeps(Effect::Bvh))),
        ("triangles", kept(&geometry.triangles, true)),
        ("planes", kept(&geometry.planes, true)),
        ("normals", kept(&geometry.normals, keeps(Effect::SmoothNormals))),
        ("texture coordinates", kept(&geometry.uvs, textured)),
        ("materials", kept(&geometry.materials, true)),
        ("textures", kept(&geometry.textures, textured)),
        ("texels", kept(&geometry.texels, textured)),
        ("emitters", kept(&geometry.emitters, true)),
        ("caustic targets", kept(&plan.targets, true)),
        ("visible points", array::<VisiblePoint>(points)),
        ("pass sums", array::<u64>(3 * pixels * u64::from(plan.samples()))),
        ("camera paths", 2 * array::<CameraPath>(plan.camera_path_capacity())),
        ("camera path counts", array::<u32>(1)),
        ("estimates", array::<u64>(3 * points * u64::from(plan.arrival_sets))),
        ("one hits", array::<u32>(u64::from(HIT_KINDS) * pixels)),
        ("film", pixels.max(1) * FILM_PIXEL_BYTES),
        ("part totals", array::<u64>(u64::from(PART_COUNT))),
        ("anomalies", array::<u32>(8)),
        ("nonfinite_values", array::<u32>(NONFINITE_WORDS)),
    ];
    if let Sensor::Receivers { count } = plan.sensor {
        buffers.push(("receivers", array::<Receiver>(u64::from(count))));
    }
    if plan.maps().next().is_some() {
        // Both maps of a round use the same buffers in turn.
        let most = |size: fn(&MapPlan) -> u32| plan.maps().map(size).max().map_or(0, u64::from);
        let (paths, capacity, buckets) = (most(|map| map.path_array_length), most(|map| map.capacity), most(|map| map.bucket_count));
        let counters = plan.maps().map(MapPlan::counter_count).max().unwrap_or(2);
        buffers.extend([
            ("light paths", 2 * array::<LightPath>(paths)),
            ("map", array::<MapPhoton>(capacity)),
            ("sorted map", array::<MapPhoton>(capacity)),
            ("counters", array::<u32>(counters)),
            ("dispatch args", array::<DispatchArgs>(1)),
            ("cells", array::<u32>(buckets + 1)),
            ("ranks", array::<u32>(capacity)),
            ("block sums", block_sum_bytes(buckets + 1, plan.settings.group_size)),
            ("crowded points", array::<u32>(2 + 2 * u64::from(plan.points_at_once()))),
            ("tallies", 2 * array::<Tally>(u64::from(plan.tally_rows()) * u64::from(TALLY_COPIES))),
            ("totals", 2 * array::<u32>(u64::from(TOTAL_WORDS) * u64::from(TALLY_COPIES))),
        ]);
        if plan.builder() == Builder::Scan {
            let survivors = u64::from(survivor_count(plan, most(|map| map.chunk_photons) as u32));
            buffers.extend([("survivors", array::<u32>(survivors)), ("block sums", block_sum_bytes(survivors, plan.settings.group_size))]);
        }
    }
    buffers
}

impl ScenePlan {
    /// Bytes of all buffers of a run that asks `phases` sets of receivers in turn; of a picture there are none.
    pub fn bytes_of(&self, phases: usize) -> u64 {
        match self.sensor {
            Sensor::Picture { .. } => self.bytes,
            Sensor::Receivers { count } => self.bytes + (phases as u64).saturating_sub(1) * array::<Receiver>(u64::from(count)),
        }
    }
}
