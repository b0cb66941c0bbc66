//! What a run is asked to do: counts, radius, seed, builder. Defaults are the paper's, each choice
//! that the paper leaves open is a field here, and [`RoomSettings::validate`] is the one place that
//! judges values.

/// An enum whose values have one name each, in reports and on the command line.
macro_rules! named {
    ($(#[$doc:meta])* pub enum $type:ident { $($(#[$note:meta])* $value:ident = $name:literal),* $(,)? }) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, serde::Serialize, serde::Deserialize)]
        pub enum $type {
            $($(#[$note])* #[serde(rename = $name)] $value),*
        }

        impl $type {
            pub const ALL: [$type; [$($name),*].len()] = [$($type::$value),*];

            pub const fn name(self) -> &'static str {
                match self { $($type::$value => $name),* }
            }
        }
    };
}
pub(crate) use named;

/// A struct whose fields stand with their defaults.
macro_rules! with_defaults {
    ($(#[$doc:meta])* $seen:vis struct $type:ident { $($(#[$note:meta])* $shown:vis $field:ident: $kind:ty = $usual:expr,)* }) => {
        $(#[$doc])*
        $seen struct $type {
            $($(#[$note])* $shown $field: $kind,)*
        }

        impl Default for $type {
            fn default() -> $type {
                $type { $($field: $usual,)* }
            }
        }
    };
}

pub mod builder;
pub mod scene;
pub mod stop;
pub mod tile_samples;

use serde::Serialize;

use crate::constants;
use crate::error::{Result, require, within};
use crate::rng::{self, Rng};
pub use builder::Builder;
use stop::Stop;

/// How photons near a point are found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Gather {
    /// Step through the whole photon list, as the paper does.
    Brute,
    /// Look into the cells of a sorted uniform grid.
    Grid,
    /// Walk down a kd-tree.
    KdTree,
}

/// How the film adds; each as the kernels' number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
#[repr(u32)]
pub enum Sums {
    /// 64-bit fixed point: the same bits in whatever order photons come.
    Integer = constants::SUMS_INTEGER,
    /// 32-bit floats: a sum's last digits depend on the order of addition, and it stops growing once
    /// what is added is less than half its last digit.
    F32 = constants::SUMS_F32,
    /// Pairs of 32-bit floats, the second what the first lost to rounding: some 48 bits, of which the
    /// last depend on the order of addition.
    Compensated = constants::SUMS_COMPENSATED,
}

/// Radiant intensity of a light; each as the kernels' number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
#[repr(u32)]
pub enum EmissionLaw {
    /// The same in all directions of the hemisphere.
    Uniform = constants::EMISSION_UNIFORM,
    /// Proportional to the cosine (Lambertian).
    Cosine = constants::EMISSION_COSINE,
}

/// How quotients, roots and logarithms are rounded; each as the kernels' STRICT_MATH.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Math {
    /// As the device has them.
    Fast,
    /// The same bits on every device that rounds to nearest, and on the CPU builder.
    Strict,
}

/// Which direction the Phong weight compares with the direction to the eye; each as the kernels' number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
#[repr(u32)]
pub enum PhongDirection {
    /// The mirror direction of the arriving photon.
    Mirror = constants::PHONG_MIRROR,
    /// The direction in which the photon left.
    Sampled = constants::PHONG_SAMPLED,
}

/// The paper's experiments.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Preset {
    /// Figure 1: naive slots, 2 bounces.
    Naive,
    /// Figure 2: the modified implementation, 15 bounces.
    Modified,
    /// Figure 3: the same with Phong walls, shininess 2.
    Phong,
    /// Figure 4: rounds of 5000 photons, radius 0.025 m, shininess 5.
    Rounds,
}

/// Walls of the open box in the order of their numbers; the sixth face is the opening.
pub(crate) const WALL_NAMES: [&str; 5] = ["left", "right", "floor", "ceiling", "back"];

with_defaults! {
    #[derive(Debug, Clone, PartialEq, Serialize)]
    pub struct RoomSettings {
        pub builder: Builder = Builder::Atomic,
        /// Photons emitted in a round, by all lights together.
        pub photons: u32 = PAPER_PHOTONS,
        pub rounds: u32 = 1,
        /// Most bounces of a photon.
        pub bounces: u32 = 15,
        /// Radius of the density estimate, metres.
        pub radius: f64 = 0.05,
        /// Photons within the radius, a round, that count as full illumination.
        pub full_light: f64 = 90.0,
        pub seed: u64 = 1,
        pub rng: Rng = Rng::Rand48,
        pub gather: Gather = Gather::Grid,
        pub sums: Sums = Sums::Integer,
        /// Estimate with this many nearest photons of a round within the radius; `None`: with all of them.
        pub nearest: Option<u32> = None,
        pub math: Math = Math::Fast,
        pub emission: EmissionLaw = EmissionLaw::Uniform,
        /// Phong exponent of each wall in the order of [`WALL_NAMES`]; `None` is Lambertian.
        pub shininess: [Option<f32>; 5] = [None; 5],
        pub phong_direction: PhongDirection = PhongDirection::Mirror,
        /// Eye of the Phong weight, metres.
        pub eye: [f32; 3] = [0.0, 0.0, 1.0],
        /// Radius of each disc of light, metres.
        pub light_radius: f64 = 0.05,
        /// Power of the floor's and of the left wall's light, watts.
        pub light_power: [f64; 2] = [1.0, 1.0],
        /// Share of photons that each wall reflects.
        pub reflectance: f32 = 0.75,
        /// Texels along each side of a wall.
        pub mesh: u32 = 64,
        /// Divide irradiance by the part of the disc that lies on the wall.
        pub edge_correction: bool = true,
        /// Threads of the CPU builder.
        pub threads: usize = 1,
        /// Look for values that are infinite or no number.
        pub paranoid: bool = false,
        pub stop: Stop = Stop::default(),
        /// Invocations of a work group.
        pub group_size: u32 = 128,
        /// Counters that the atomic builder's work groups use round-robin; `None`: as many as serve the device.
        pub counters: Option<u32> = None,
        /// Most photons traced at once; `None`: as many as the device's buffers hold.
        pub chunk: Option<u32> = None,
    }
}

/// Half the edge of the open box, metres.
pub(crate) const HALF_WIDTH: f64 = 0.25;

/// Photons of the paper's round, to which its `full_light` refers.
pub(crate) const PAPER_PHOTONS: u32 = 5000;

impl RoomSettings {
    pub(crate) fn preset(preset: Preset) -> RoomSettings {
        let modified = RoomSettings::default();
        match preset {
            Preset::Modified => modified,
            Preset::Naive => RoomSettings { builder: Builder::Naive, bounces: 2, ..modified },
            Preset::Phong => RoomSettings { shininess: [Some(2.0); 5], ..modified },
            Preset::Rounds => RoomSettings { rounds: 100, radius: 0.025, full_light: 10.0, shininess: [Some(5.0); 5], ..modified },
        }
    }

    /// The same full light for another photon count: as many photons within the radius in
    /// proportion.
    pub fn full_light_for(&self, photons: u32) -> f64 {
        self.full_light * f64::from(photons) / f64::from(self.photons)
    }

    /// Photons of the whole run.
    pub fn total_photons(&self) -> u64 {
        u64::from(self.photons) * u64::from(self.rounds)
    }

    /// Random numbers that one photon may draw.
    pub fn draws_per_photon(&self) -> u64 {
        u64::from(constants::EMISSION_DRAWS) + u64::from(constants::BOUNCE_DRAWS) * u64::from(self.bounces)
    }

    /// Whether some wall follows the paper's Phong model.
    pub fn has_phong(&self) -> bool {
        self.shininess.iter().any(Option::is_some)
    }

    /// Refuses settings that no run can satisfy; each error names the option, its value and the remedy.
    pub fn validate(&self) -> Result<()> {
        let width = 2.0 * HALF_WIDTH;
        within("photons", self.photons, 2..=MAX_PHOTONS, "photons per round, at least one for each of the two lights")?;
        let most_bounces = if self.builder == Builder::Persistent { MAX_PERSISTENT_BOUNCES } else { MAX_BOUNCES };
        let of_builder = if self.builder == Builder::Persistent { " with `variant` persistent" } else { "" };
        within("bounces", self.bounces, 1..=most_bounces, &format!("bounces{of_builder}"))?;
        check_common((self.rounds, u32::MAX), self.group_size, &self.stop)?;
        within("mesh", self.mesh, 1..=MAX_MESH, "texels along a wall")?;
        let in_box = format!("must be from {MIN_RADIUS:e} to {width} metres (the box's width)");
        require((MIN_RADIUS..=width).contains(&self.radius), "radius", self.radius, in_box)?;
        let quantity = |option, value: f64, unit: &str| {
            let (least, most) = (1.0 / MAX_QUANTITY, MAX_QUANTITY);
            require((least..=most).contains(&value), option, value, format!("must be from {least:e} to {most:e} {unit}"))
        };
        quantity("full_light", self.full_light, "(photons within the radius)")?;
        let [floor, left] = self.light_power;
        quantity("light_power", floor, "watts (floor light)")?;
        quantity("light_power", left, "watts (left light)")?;
        let few = "the weaker light must have at least a millionth of the total power";
        require(floor.min(left) / (floor + left) >= 1e-6, "light_power", format!("{floor},{left}"), few)?;
        let fits = format!("must be above 0 and at most {HALF_WIDTH} metres, so that the disc fits its wall");
        require(self.light_radius > 0.0 && self.light_radius <= HALF_WIDTH, "light_radius", self.light_radius, fits)?;
        require((0.0..=1.0).contains(&self.reflectance), "reflectance", self.reflectance, "must be from 0 to 1")?;
        for shininess in self.shininess.iter().flatten() {
            let is_exponent = shininess.is_finite() && *shininess >= 0.0;
            require(is_exponent, "shininess", shininess, "must be 0 or more; omit it for Lambertian walls")?;
        }
        let [x, y, z] = self.eye;
        let is_near = self.eye.iter().all(|coordinate| coordinate.abs() <= MAX_EYE);
        require(is_near, "eye", format!("{x},{y},{z}"), format!("must be three numbers from -{MAX_EYE:e} to {MAX_EYE:e}"))?;
        within("threads", self.threads as u64, 1..=1024, "threads")?;
        if let Some(counters) = self.counters {
            let is_allowed = counters.is_power_of_two() && counters <= MAX_COUNTERS;
            require(is_allowed, "counters", counters, format!("must be a power of two up to {MAX_COUNTERS}"))?;
        }
        if let Some(chunk) = self.chunk {
            within("chunk", chunk, 2..=MAX_PHOTONS, "photons traced at once, at least one for each of the two lights")?;
        }
        self.validate_nearest()?;
        if let Some(error) = self.stop.error {
            let needs = "needs `sums` integer, because float sums have no error estimate";
            require(self.sums == Sums::Integer, "error", error, needs)?;
        }
        self.validate_random_numbers()?;
        let events = self.total_photons().saturating_mul(u64::from(self.bounces));
        let most = format!("photons * rounds * bounces is {events}, but the film's 64-bit sums hold at most {MAX_EVENTS}; ask for fewer");
        require(events <= MAX_EVENTS, "rounds", self.rounds, most)
    }

    fn validate_nearest(&self) -> Result<()> {
        let Some(nearest) = self.nearest else { return Ok(()) };
        within("nearest", nearest, 2..=constants::MAX_NEAREST, "photons; the farthest of them sets the radius of the disc")?;
        let by_tree = self.gather == Gather::KdTree;
        require(by_tree, "nearest", nearest, "needs `gather` kdtree, which finds the nearest photons")?;
        require(self.sums == Sums::Integer, "nearest", nearest, "always uses integer sums; omit `sums`")?;
        let (photons, chunk) = (self.photons, self.chunk.unwrap_or(self.photons));
        let whole = format!("must be `photons` {photons} or more with `nearest`, which searches all photons of a round at once");
        require(chunk >= photons, "chunk", chunk, whole)?;
        let wanted = u64::from(self.rounds) * u64::from(nearest);
        let most =
            format!("rounds * nearest is {wanted}, but the film's 64-bit sums hold at most {MAX_NEAREST_SUMMED}; ask for fewer rounds");
        require(wanted <= MAX_NEAREST_SUMMED, "rounds", self.rounds, most)
    }

    /// Rounds of a run that ends by itself: as many as its photons take, or as film and random numbers allow, and no
    /// more than `MOST_ROUNDS`.
    pub fn most_rounds(&self) -> u32 {
        let photons = u64::from(self.photons).max(1);
        let bounces = u64::from(self.bounces).max(1);
        let by_random_numbers = match self.rng {
            Rng::Rand48 => ((1 << 48) / u128::from(self.draws_per_photon())) as u64 / photons,
            Rng::Mt | Rng::Sobol => (1 << 32) / photons,
            Rng::Philox => u64::MAX,
        };
        let by_total = self.stop.photons.map_or(u64::MAX, |total| total.div_ceil(photons));
        let by_nearest = self.nearest.map_or(u64::MAX, |nearest| MAX_NEAREST_SUMMED / u64::from(nearest).max(1));
        let fits = (MAX_EVENTS / bounces / photons).min(by_random_numbers).min(by_total).min(by_nearest);
        fits.clamp(1, u64::from(MOST_ROUNDS)) as u32
    }

    fn validate_random_numbers(&self) -> Result<()> {
        let few = self.total_photons() <= 1 << 32;
        match self.rng {
            Rng::Philox => Ok(()),
            Rng::Rand48 => {
                within("seed", self.seed, 0..=u64::from(u32::MAX), "with `rng` rand48, whose seed has 32 bits")?;
                let draws = u128::from(self.total_photons()) * u128::from(self.draws_per_photon());
                let period = format!(
                    "the run draws {draws} numbers, but the generator has a period of 2^48, so its streams would overlap; use `rng` philox"
                );
                require(draws <= 1 << 48, "rng", "rand48", period)
            }
            Rng::Mt => {
                let most = rng::MT_MAX_BOUNCES;
                let short = format!("must be at most {most} with `rng` mt, whose streams hold 227 numbers; use `rng` philox");
                require(self.bounces <= most, "bounces", self.bounces, short)?;
                require(few, "rng", "mt", "has 2^32 streams, but the run has more photons; use `rng` philox")
            }
            Rng::Sobol => require(few, "rng", "sobol", "has 2^32 points, but the run has more photons; use `rng` philox"),
        }
    }

    /// A remark on settings that are allowed and unwise.
    pub fn warning(&self) -> Option<String> {
        let twos = self.photons.trailing_zeros();
        (self.rng == Rng::Rand48 && twos >= 10).then(|| {
            format!(
                "rand48 gives correlated streams for {} = {} * 2^{twos} photons per round, a multiple of a large power of two; use an odd `photons` or `rng` philox",
                self.photons,
                self.photons >> twos
            )
        })
    }
}

/// Most counters that photons are appended by.
const MAX_COUNTERS: u32 = 64;
/// Photons of a round: their numbers and the counters of a round are 32-bit.
const MAX_PHOTONS: u32 = 1 << 31;
const MAX_BOUNCES: u32 = 10_000;
/// A photon's bounces are one loop there, of at most [`constants::LOOP_LIMIT`] iterations with those of its random numbers.
const MAX_PERSISTENT_BOUNCES: u32 = 320;
/// Metres; the square of a larger one would come close to what f32 holds.
const MAX_EYE: f32 = 1e15;
/// Watts and photons: far from what f64 and f32 hold, either way.
const MAX_QUANTITY: f64 = 1e12;
/// Texels along a wall; points are numbered in 32 bits and held in one buffer of 128 MiB.
const MAX_MESH: u32 = 1024;
/// Smallest radius relative to the box: below it the squares of f32 distances lose their meaning.
/// Smallest radius at which a bias is measured, over the smallest that a run allows: there is room for the smaller radius.
pub(crate) const ROOM_BELOW: f64 = 1.415;
const MIN_RADIUS_SHARE: f64 = 1.0 / 65_536.0;
/// The same in metres.
pub(crate) const MIN_RADIUS: f64 = 2.0 * HALF_WIDTH * MIN_RADIUS_SHARE;
/// Rounds of a run that ends by itself.
pub(crate) const MOST_ROUNDS: u32 = 1 << 20;
/// Photons * bounces that a film sum can hold with 16 bits after the binary point.
pub(crate) const MAX_EVENTS: u64 = 1 << 47;
/// Rounds * nearest photons that a film sum can hold, each scaled up by 2^`NEAREST_GAIN_BITS`, with 10 bits after
/// the binary point.
pub(crate) const MAX_NEAREST_SUMMED: u64 = 1 << 31;

/// Checks what both worlds have and allow alike, but for the most rounds.
fn check_common((rounds, most_rounds): (u32, u32), group_size: u32, stop: &Stop) -> Result<()> {
    within("rounds", rounds, 1..=most_rounds, "rounds")?;
    let is_allowed = group_size.is_power_of_two() && (32..=1024).contains(&group_size);
    require(is_allowed, "group_size", group_size, "must be a power of two from 32 to 1024")?;
    stop.validate()
}
