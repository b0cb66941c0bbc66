//! A run that is looked at, of either world, and what is said of it.

use std::time::Instant;

use glam::{DVec3, Vec3};

use super::panel::Status;
use crate::engine::room::live::LiveRoom;
use crate::engine::scene::live::LiveScene;
use crate::error::Result;
use crate::gpu::Commands;
use crate::output::colour::ColourImage;
use crate::scene::Camera;
use crate::timings::{Row, Timings};

/// The two kinds of runs.
pub(crate) enum Live<'a> {
    Scene(Box<LiveScene<'a>>),
    Room(Box<LiveRoom<'a>>),
}

/// The same of either.
macro_rules! either {
    ($run:expr, $live:ident => $value:expr) => {
        match $run {
            Live::Scene($live) => $value,
            Live::Room($live) => $value,
        }
    };
}

/// Rounds per second, over the last ones.
#[derive(Default)]
pub(crate) struct Rate {
    since: Option<(Instant, u32)>,
    pub per_second: f64,
}

impl Rate {
    pub(super) fn take(&mut self, rounds: u32) {
        let (since, before) = *self.since.get_or_insert((Instant::now(), rounds));
        let seconds = since.elapsed().as_secs_f64();
        // A camera that moved has begun anew.
        if rounds < before {
            self.since = None;
        } else if seconds >= 0.5 {
            self.per_second = f64::from(rounds - before) / seconds;
            self.since = Some((Instant::now(), rounds));
        }
    }
}

impl Status {
    /// Takes what the latest round has left.
    pub(super) fn take(&mut self, live: &mut Live) {
        self.ledger = either!(live, live => live.run.state.ledger());
        if let Live::Scene(live) = live {
            (self.cached_rounds, self.cached_bytes) = live.cached();
        }
        let timings = live.take_timings();
        let of_round = |row: &Row| row.name.strip_prefix("round").map(str::to_owned);
        let rounds = timings.row("round").map_or(1, |row| row.count.max(1)) as f64;
        let passes: Vec<(String, usize, f64)> = timings
            .rows()
            .iter()
            .filter_map(|row| Some((of_round(row)?, row.gpu_ms.or(row.wall_ms)? / rounds)))
            .map(|(path, ms)| {
                let depth = path.matches('/').count();
                (path.rsplit('/').next().filter(|name| !name.is_empty()).unwrap_or("round").to_owned(), depth, ms)
            })
            .collect();
        if !passes.is_empty() {
            self.passes = passes;
        }
    }
}

/// What a look at the film shows.
pub(crate) struct Look {
    pub noise: f64,
    pub bias: Option<f64>,
    /// At most, of light that no path or photon has met so far.
    pub unseen: f64,
    pub mean: f64,
    /// The exposure that a picture file would have.
    pub stops: f32,
}

impl<'a> Live<'a> {
    /// One more round; whether there are more.
    pub(super) fn round(&mut self) -> Result<bool> {
        either!(self, live => live.round())?;
        Ok(!self.has_ended())
    }

    pub(super) fn has_ended(&self) -> bool {
        either!(self, live => live.run.has_ended())
    }

    pub(super) fn rounds(&self) -> u32 {
        either!(self, live => live.run.state.rounds())
    }

    pub(super) fn take_timings(&mut self) -> Timings {
        either!(self, live => std::mem::take(live.run.recorder.timings()))
    }

    /// The room's light is on its walls, whoever looks.
    pub(super) fn look_from(&mut self, camera: &Camera) -> Result<()> {
        match self {
            Live::Scene(live) => live.look_from(camera),
            Live::Room(_) => Ok(()),
        }
    }

    pub(super) fn commands(&mut self) -> &mut Commands<'a> {
        either!(self, live => &mut live.run.recorder)
    }

    pub(super) fn look(&mut self) -> Result<Look> {
        match self {
            Live::Scene(live) => {
                let (film, error) = live.run.look()?;
                let pixels: Vec<Vec3> = film.means().map(DVec3::as_vec3).collect();
                let mean = film.surface_means().map(|mean| mean.element_sum() / 3.0).sum::<f64>() / pixels.len().max(1) as f64;
                let picture = ColourImage { width: pixels.len() as u32, height: 1, pixels };
                let unseen = error.unseen.hypot(error.unknown.relative);
                Ok(Look { noise: error.noise, bias: error.bias.map(|bias| bias.relative), unseen, mean, stops: picture.usual_exposure() })
            }
            Live::Room(live) => {
                let (noise, mean) = live.look()?;
                Ok(Look { noise, bias: None, unseen: 0.0, mean, stops: 0.0 })
            }
        }
    }
}
