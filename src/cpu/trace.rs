//! Photons of a chunk on the CPU: the modified algorithm with its two arrays that swap.

use glam::UVec2;
use rayon::prelude::*;

use super::bsdf::view_weight;
use super::emission::emit_from_disc;
use super::room::intersect_room;
use super::sampling::{sample_cosine_hemisphere, to_world};
use crate::plan::{EmissionRange, Plan};
use crate::records::{DiscLight, Path, Photon, RandomKey, Room, Tally, Wall};
use crate::rng::{self, Rng, words};
use crate::scene::room::RoomScene;

/// The scene and settings as the tracing functions read them.
pub struct Tracer<'a> {
    plan: &'a Plan,
    room: Room,
    walls: Vec<Wall>,
    lights: Vec<DiscLight>,
}

/// What one bounce made of the paths that entered it.
#[derive(Default)]
pub struct Bounced {
    pub photons: Vec<Photon>,
    pub paths: Vec<Path>,
    pub tally: Tally,
}

/// Fewest paths that are worth a thread of their own.
const MIN_PATHS_PER_THREAD: usize = 256;

impl<'a> Tracer<'a> {
    pub fn new(scene: &RoomScene, plan: &'a Plan) -> Tracer<'a> {
        Tracer { plan, room: scene.room_record(), walls: scene.wall_records(), lights: scene.light_records(&plan.relative_flux) }
    }

    /// Paths of a chunk as they leave their lights.
    pub fn emit(&self, round: u32, ranges: &[EmissionRange]) -> Vec<Path> {
        let key = self.plan.streams().key(round);
        let one_range = |range: &EmissionRange| {
            // The host reaches each photon's first rand48 state by itself, without a prepared set.
            let streams = self.plan.streams();
            let light = self.lights[range.light as usize];
            let first_state = words(streams.jump(round, range.first_photon + 1).apply(rng::srand48(streams.seed as u32)));
            let first_sample = self.plan.first_sample(round, range);
            let mut rand48_state = first_state;
            (0..range.count)
                .map(|k| {
                    let photon = range.first_photon + k;
                    let start = match streams.rng {
                        Rng::Sobol => UVec2::new(first_sample.wrapping_add(k), range.light),
                        _ => rand48_state,
                    };
                    let path = self.emit_one(&key, &light, photon, start);
                    rand48_state = rng::rand48_step(rand48_state);
                    path
                })
                .collect::<Vec<Path>>()
        };
        ranges.iter().flat_map(one_range).collect()
    }

    fn emit_one(&self, key: &RandomKey, light: &DiscLight, photon: u32, start: UVec2) -> Path {
        let settings = &self.plan.settings;
        let mut stream = rng::open_stream(settings.rng, key, photon, start);
        let u = rng::draw_emission(settings.rng, key, photon, &mut stream);
        let (position, direction) = emit_from_disc(light, &self.walls[light.wall as usize], settings.emission, u);
        Path { position, wall: light.wall, direction, photon, stream, flux: light.flux }
    }

    /// One bounce of every path, on the threads of the current pool.
    pub fn bounce(&self, paths: &[Path], round: u32, bounce: u32) -> Bounced {
        let threads = rayon::current_num_threads();
        if threads == 1 || paths.len() < 2 * MIN_PATHS_PER_THREAD {
            return self.bounce_block(paths, round, bounce);
        }
        let block = paths.len().div_ceil(threads).max(MIN_PATHS_PER_THREAD);
        let parts: Vec<Bounced> = paths.par_chunks(block).map(|part| self.bounce_block(part, round, bounce)).collect();
        parts.into_iter().fold(Bounced::default(), Bounced::join)
    }

    fn bounce_block(&self, paths: &[Path], round: u32, bounce: u32) -> Bounced {
        let settings = &self.plan.settings;
        let key = self.plan.streams().key(round);
        let mut bounced = Bounced::default();
        for path in paths {
            let mut path = *path;
            let hit = intersect_room(&self.room, path.position, path.direction, path.wall);
            let wall = &self.walls[hit.wall as usize];
            let u = rng::draw_bounce(settings.rng, &key, path.photon, bounce, &mut path.stream);
            if wall.is_open != 0 {
                bounced.tally.escaped += 1;
                continue;
            }
            if u[0] >= wall.albedo {
                bounced.tally.absorbed += 1;
                continue;
            }
            let arriving = path.direction;
            path.position = hit.position;
            path.direction = to_world(sample_cosine_hemisphere(u[1], u[2]), wall);
            path.wall = hit.wall;
            let weight = view_weight(wall, hit.position, arriving, path.direction, settings.eye.into(), settings.phong_direction);
            bounced.tally.stored += 1;
            bounced.photons.push(Photon { position: hit.position, wall: hit.wall, flux: path.flux, weight, photon: path.photon, bounce });
            bounced.paths.push(path);
        }
        bounced
    }
}

impl Bounced {
    fn join(mut self, other: Bounced) -> Bounced {
        self.photons.extend(other.photons);
        self.paths.extend(other.paths);
        self.tally.stored += other.tally.stored;
        self.tally.absorbed += other.tally.absorbed;
        self.tally.escaped += other.tally.escaped;
        self.tally.dropped += other.tally.dropped;
        self
    }
}
