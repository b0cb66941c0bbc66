//! Files of runs and of photons, small and made without a device: what fuzzing begins with.

use std::fs::File;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use glam::Vec3;
use photonmill::constants::{HIT_KINDS, RADIUS_CLASSES};
use photonmill::engine::Control;
use photonmill::engine::error::differences::Differences;
use photonmill::engine::film::{BlockSums, KeptBlock, LatestBlocks};
use photonmill::engine::room;
use photonmill::engine::run::blocks::{Blocks, Share};
use photonmill::engine::run::identity::{Hash, Identity};
use photonmill::engine::run::saved::SavedRun;
use photonmill::engine::run::watch::{Checkpointing, SaveRun};
use photonmill::engine::scene::SceneFilm;
use photonmill::engine::scene::map_file::MapWriter;
use photonmill::ledger::Fates;
use photonmill::photon::MapPhoton;
use photonmill::plan::Limits;
use photonmill::plan::buffers::{ANOMALY_WORDS, PART_VALUES};
use photonmill::plan::differences::difference_count;
use photonmill::plan::scene::ScenePlan;
use photonmill::plan::sensor::Sensor;
use photonmill::rng::Rng;
use photonmill::scene::geometry::Geometry;
use photonmill::scene::open_box::open_box;
use photonmill::scene::{Scene, Surface, built_in};
use photonmill::settings::scene::SceneSettings;
use photonmill::settings::{Builder, RoomSettings};

/// Keeps all that a run saves.
#[derive(Default)]
pub(crate) struct Saved(pub(crate) Vec<SavedRun>);

impl SaveRun for Saved {
    fn save(&mut self, run: &Arc<SavedRun>, _: bool) -> photonmill::error::Result<()> {
        self.0.push(SavedRun::clone(run));
        Ok(())
    }
}

/// A part of a run of the paper's box, so small that it takes no time; it goes on with what there is of it.
pub(crate) fn part_of_box(share: Share, resume: Option<SavedRun>) -> photonmill::error::Result<SavedRun> {
    let settings = RoomSettings { photons: 101, rounds: 4, mesh: 2, builder: Builder::Cpu, rng: Rng::Philox, ..RoomSettings::default() };
    let (never, mut saved) = (AtomicBool::new(false), Saved::default());
    let resume = resume.map(|run| ("seed".into(), run));
    let checkpointing = Checkpointing { scene: "open-box", share, resume, every: Duration::ZERO, save: Some(&mut saved), dealt: None };
    room::run(None, &open_box(&settings), &settings, &mut Control { cancelled: &never, progress: &mut |_| {}, checkpointing })?;
    Ok(saved.0.pop().expect("a run saves its end"))
}

/// A box with a mirror for a wall, so that photons make a caustic map too.
pub(crate) fn scene() -> (Scene, Geometry) {
    let mut scene = built_in::by_name("cornell").expect("it is built in");
    scene.materials[2].surface = Surface::Mirror;
    Geometry::new(&scene).map(|geometry| (scene, geometry)).expect("it has triangles")
}

/// A part of eight blocks of a picture of four pixels, as far as what it holds must fit.
pub(crate) fn part_of_picture(share: Share, keeps_parts: bool) -> SavedRun {
    let ((scene, geometry), settings) = (scene(), SceneSettings { keeps_parts, ..SceneSettings::default() });
    let sensor = Sensor::Picture { width: 2, height: 2 };
    let plan = ScenePlan::new(&scene, &geometry, &settings, sensor, &Limits::of_host()).expect("it can be planned").film;
    let (mut done, mut latest) = (Blocks::default(), LatestBlocks::default());
    for number in (share.number..8).step_by(share.of as usize) {
        done.insert(number);
        latest.push(KeptBlock { number, values: (0..4 * PART_VALUES as u32).map(|k| ((5 * number + 7 * k) % 11) as f32).collect() });
    }
    let (blocks, rounds) = (u64::from(done.count()), done.count() * plan.rounds_per_block);
    // Each block has left a sum of 7 or so.
    let sums = || BlockSums { rounds, blocks: done.count(), sums: vec![7 * blocks; 12], squares: vec![50 * u128::from(blocks); 12] };
    let mut fates = Fates { emitted: 4 * blocks, ..Fates::of_scene(4) };
    fates.bounces[0].absorbed = 4 * blocks;
    let mut anomalies = [0; ANOMALY_WORDS];
    // Samples that met a surface.
    anomalies[8] = 4 * rounds * plan.samples;
    let single_hits = [0, u32::MAX, 0.5f32.to_bits(), 3f32.to_bits(), 0].into_iter().cycle().take(4 * HIT_KINDS as usize).collect();
    let film = SceneFilm {
        of_blocks: sums(),
        of_surfaces: Some(sums()),
        latest,
        differences: Differences((0..difference_count(4) as u64).map(|k| k % 3).collect()),
        single_hits,
        part_totals: vec![3; 4],
        // Three of the four parts; what a pixel has beyond them is the fourth.
        parts: keeps_parts.then(|| vec![blocks; 4 * (PART_VALUES as usize - 3)]),
        anomalies,
        class_counts: vec![1; 2 * RADIUS_CLASSES as usize],
        stored: [1, 0, 1],
        plan,
    };
    let identity = Identity::new(&scene.name, Hash::default(), &settings, Hash::default(), None, settings.math);
    SavedRun { identity, share, wanted: 8, done, sensor: Some(sensor), fates: vec![fates; 2], film: film.into() }
}

/// Whole runs, a shard of each, and pairs of shards, one behind the other. Pictures are with and without the parts of their light.
pub fn runs() -> Vec<Vec<u8>> {
    let of_box = |share| part_of_box(share, None).expect("the box can be run").to_bytes();
    let of_picture = |share| part_of_picture(share, false).to_bytes();
    let with_parts = |share| part_of_picture(share, true).to_bytes();
    let shard = |number| Share { number, of: 2 };
    let pair = |of: &dyn Fn(Share) -> Vec<u8>| [of(shard(0)), of(shard(1))].concat();
    let of_each: [&dyn Fn(Share) -> Vec<u8>; 3] = [&of_box, &of_picture, &with_parts];
    let mut runs: Vec<Vec<u8>> = of_each.into_iter().flat_map(|of| [of(Share::default()), of(shard(0)), pair(of)]).collect();
    // Merged, they have no parts.
    runs.push([with_parts(shard(0)), of_picture(shard(1))].concat());
    runs
}

/// A file of photons of two rounds.
pub fn photon_map(path: &Path) -> Vec<u8> {
    let (scene, geometry) = scene();
    let settings = SceneSettings { photons: 4, caustic_photons: 4, bounces: 3, ..SceneSettings::default() };
    let sensor = Sensor::Picture { width: 2, height: 2 };
    let plan = ScenePlan::new(&scene, &geometry, &settings, sensor, &Limits::of_host()).expect("it can be planned");
    let write = || {
        let mut file = File::create(path)?;
        let mut writer = MapWriter::new(&mut file, &scene.name, &geometry, &plan, "none")?;
        for _ in 0..2 {
            // As many as no other map has.
            for (stored, _) in (5..).zip(plan.maps()) {
                writer.begin_map();
                (0..stored).try_for_each(|_| writer.add(&[MapPhoton { flux: Vec3::ONE, ..MapPhoton::default() }]))?;
                let mut fates = Fates { emitted: 4, ..Fates::of_scene(3) };
                fates.bounces[0].absorbed = 4;
                fates.totals.get_or_insert_default().stored = stored;
                writer.end_map(fates);
            }
            writer.end_round();
        }
        writer.finish()?;
        std::fs::read(path)
    };
    write().expect("the file can be written")
}
