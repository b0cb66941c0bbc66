//! What lighting a scene of triangles is asked to do.

use serde::{Deserialize, Serialize};

use super::stop::LEAST_BLOCKS;
pub use super::stop::Stop;
use super::tile_samples::{MAX_SAMPLES, TileSamples};
use super::{Builder, MAX_PHOTONS, Math, check_common};
use crate::constants::{self, MAX_BOUNCES};
use crate::error::{Error, Result, require, within};

/// Where direct light and caustics come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Illumination {
    /// Direct light by shadow rays, caustics from a map of their own, the rest from the global map
    /// (Jensen 1996).
    Split,
    /// Everything from one photon map, as the paper has it.
    Photons,
}

/// Parts of a picture; each as the kernels' mask.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
#[repr(u32)]
pub enum Part {
    All = constants::PART_DIRECT | constants::PART_SPECULAR | constants::PART_CAUSTIC | constants::PART_INDIRECT,
    /// Light that comes straight from a lamp to what the camera sees, and lamps themselves.
    Direct = constants::PART_DIRECT,
    /// Whatever is seen in mirrors and through glass.
    Specular = constants::PART_SPECULAR,
    /// Light that reached what the camera sees over mirrors and glass alone.
    Caustic = constants::PART_CAUSTIC,
    /// Light that was scattered before.
    Indirect = constants::PART_INDIRECT,
}

impl Part {
    pub const EACH: [Part; 4] = [Part::Direct, Part::Specular, Part::Caustic, Part::Indirect];
}

/// How a photon's weight falls with its distance; each as the kernels' number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
#[repr(u32)]
pub enum Kernel {
    Box = constants::KERNEL_BOX,
    Cone = constants::KERNEL_CONE,
    Epanechnikov = constants::KERNEL_EPANECHNIKOV,
}

/// How a pixel weighs the picture around its centre; each as the kernels' number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
#[repr(u32)]
pub enum Filter {
    /// Its own square.
    Box = constants::FILTER_BOX,
    /// A tent two pixels wide.
    Tent = constants::FILTER_TENT,
    /// A Gaussian of half a pixel's deviation.
    Gaussian = constants::FILTER_GAUSSIAN,
}

named! {
    /// What a scene may call for; each can be forced on or left out.
    pub enum Effect {
        Direct = "direct",
        Indirect = "indirect",
        Glossy = "glossy",
        Layers = "layers",
        Transmission = "transmission",
        DiffuseTransmission = "diffuse-transmission",
        Iridescence = "iridescence",
        Anisotropy = "anisotropy",
        Media = "media",
        Dispersion = "dispersion",
        ClearCoat = "clear-coat",
        Sheen = "sheen",
        NormalMaps = "normal-maps",
        Alpha = "alpha",
        ReflectiveCaustics = "reflective-caustics",
        RefractiveCaustics = "refractive-caustics",
        SpecularChains = "specular-chains",
        Textures = "textures",
        VertexColours = "vertex-colours",
        Environment = "environment",
        MeshLights = "mesh-lights",
        PointLights = "point-lights",
        SpotLights = "spot-lights",
        DirectionalLights = "directional-lights",
        DiscLights = "disc-lights",
        Bvh = "bvh",
        TwoSided = "two-sided",
        SmoothNormals = "smooth-normals",
    }
}

impl Effect {
    pub fn is_caustic(self) -> bool {
        matches!(self, Effect::ReflectiveCaustics | Effect::RefractiveCaustics)
    }
}

with_defaults! {
    #[derive(Debug, Clone, PartialEq, Serialize)]
    pub struct SceneSettings {
        /// Photons of the global map, each pass.
        pub photons: u32 = 1 << 17,
        /// Photons of the caustic map, each pass.
        pub caustic_photons: u32 = 1 << 17,
        /// Independent passes, of which the result is the mean: whole blocks, or less than one.
        pub rounds: u32 = LEAST_BLOCKS * SAMPLES_PER_BLOCK,
        /// Rounds of a block, a power of two, over all of which samples are even; `None`: so many that a pixel has
        /// [`SAMPLES_PER_BLOCK`] samples in it. What is known of errors comes from the spread of blocks.
        pub block: Option<u32> = None,
        /// Bounces after which a photon is cut off; by default roulette ends it long before, which is null in JSON.
        #[serde(serialize_with = "cap")]
        pub bounces: u32 = MAX_BOUNCES,
        pub seed: u64 = 1,
        /// Photons of a round that the first radius of the global map is to hold at the median point, where a trial finds it.
        pub neighbours: u32 = NEIGHBOURS,
        /// The same of the caustic map.
        pub caustic_neighbours: u32 = CAUSTIC_NEIGHBOURS,
        /// Radius of the first pass's density estimate, metres; `None`: by a trial round
        /// (`engine::scene::trial`), or by the scene's area and the photons where none is made.
        pub radius: Option<f64> = None,
        /// The same of the caustic map.
        pub caustic_radius: Option<f64> = None,
        /// How fast the radius shrinks, r_(i+1)^2 = r_i^2 (i + alpha) / (i + 1) (Knaus and Zwicker 2011);
        /// 1 keeps it.
        pub alpha: f64 = 2.0 / 3.0,
        pub kernel: Kernel = Kernel::Box,
        pub edge_correction: bool = true,
        /// Paths from the camera through each pixel, each pass, a power of two; of a picture.
        pub samples: u32 = 1,
        /// Tiles of a picture that have more; `None`: none.
        pub tiles: Option<TileSamples> = None,
        /// Shadow rays from each visible point, each pass.
        pub shadow_rays: u32 = 4,
        /// Indirect light by a ray to the next surface instead of the map where the camera looks.
        pub final_gather: bool = false,
        /// Lights emit photons of the caustic map only towards mirrors and glass (projection maps, Jensen 1996).
        pub aim: bool = true,
        pub illumination: Illumination = Illumination::Split,
        pub part: Part = Part::All,
        /// Keep the parts of each pixel's light apart beside the whole: of a picture of all parts.
        pub keeps_parts: bool = false,
        pub filter: Filter = Filter::Box,
        /// `None`: persistent; ballot where subgroup votes in loops return wrong results, and with strict arithmetic, which needs so many registers
        /// that few photons would be under way.
        pub builder: Option<Builder> = None,
        pub math: Math = Math::Fast,
        /// Look for values that are infinite or no number.
        pub paranoid: bool = false,
        pub stop: Stop = Stop::default(),
        pub group_size: u32 = 128,
        /// Most photons traced at once; `None`: as many as the device's buffers hold.
        pub chunk: Option<u32> = None,
        /// Effects forced on, and effects left out, whatever the scene holds.
        pub with: Vec<Effect> = Vec::new(),
        pub without: Vec<Effect> = Vec::new(),
    }
}

fn cap<S: serde::Serializer>(bounces: &u32, serializer: S) -> std::result::Result<S::Ok, S::Error> {
    Some(*bounces).filter(|bounces| *bounces < MAX_BOUNCES).serialize(serializer)
}

pub(crate) const MAX_ROUNDS: u32 = 1 << 20;
/// Photons of a round within the first radius of a point of the global map, by default: about what a radius by the scene's area leaves of
/// light that was scattered before, in closed rooms.
pub(crate) const NEIGHBOURS: u32 = 24;
/// A caustic has edges: half the radius.
pub(crate) const CAUSTIC_NEIGHBOURS: u32 = 6;
/// Camera paths through a pixel in a block of rounds, at least.
pub(crate) const SAMPLES_PER_BLOCK: u32 = 4;
pub(crate) const MAX_BLOCK: u32 = 1 << 10;
const MAX_NEIGHBOURS: u32 = 10_000;
/// A visible point's rays are one loop.
const MAX_SHADOW_RAYS: u32 = 64;

impl SceneSettings {
    pub fn validate(&self) -> Result<()> {
        within("photons", self.photons, 1..=MAX_PHOTONS, "photons of the global map, each round")?;
        within("caustic_photons", self.caustic_photons, 1..=MAX_PHOTONS, "photons of the caustic map, each round")?;
        within("bounces", self.bounces, 1..=MAX_BOUNCES, "bounces")?;
        check_common((self.rounds, MAX_ROUNDS), self.group_size, &self.stop)?;
        if let Some(builder) = self.builder {
            let known = Builder::ON_GPU.map(Builder::name).join(", ");
            let allowed = format!("traces the paper's box only; for a scene choose one of {known}");
            require(Builder::ON_GPU.contains(&builder), "variant", builder.name(), allowed)?;
        }
        for (option, neighbours) in [("neighbours", self.neighbours), ("caustic_neighbours", self.caustic_neighbours)] {
            within(option, neighbours, 1..=MAX_NEIGHBOURS, "photons of a round within the first radius")?;
        }
        within("shadow_rays", self.shadow_rays, 1..=MAX_SHADOW_RAYS, "shadow rays from each visible point, each round")?;
        if let Some(block) = self.block {
            let is_allowed = block.is_power_of_two() && block <= MAX_BLOCK;
            require(is_allowed, "block", block, format!("must be a power of two up to {MAX_BLOCK}"))?;
        }
        let is_share = self.samples.is_power_of_two() && self.samples <= MAX_SAMPLES;
        require(is_share, "samples", self.samples, format!("must be a power of two up to {MAX_SAMPLES}"))?;
        for (option, radius) in [("radius", self.radius), ("caustic_radius", self.caustic_radius)] {
            if let Some(radius) = radius {
                require(radius.is_finite() && radius > 0.0, option, radius, "must be a number of metres above 0")?;
            }
        }
        let is_rate = self.alpha > 0.0 && self.alpha <= 1.0;
        require(is_rate, "alpha", self.alpha, "must be above 0 and at most 1 (1 keeps the radius fixed)")?;
        if let Some(chunk) = self.chunk {
            within("chunk", chunk, 1..=MAX_PHOTONS, "photons traced at once")?;
        }
        match self.with.iter().find(|effect| self.without.contains(effect)) {
            Some(both) => Err(Error::setting("without", both.name(), "is also in `with`; choose one of the two")),
            None => Ok(()),
        }
    }

    /// Rounds of a block of a picture, or of points that are asked about.
    pub fn rounds_per_block(&self, of_picture: bool) -> u32 {
        let samples = if of_picture { self.samples } else { 1 };
        self.block.unwrap_or((SAMPLES_PER_BLOCK / samples).max(1))
    }

    /// With as many rounds as whole blocks have, unless there are fewer than one has.
    pub fn in_whole_blocks(&self, of_picture: bool) -> SceneSettings {
        let block = self.rounds_per_block(of_picture);
        let rounds = if self.rounds > block { self.rounds.next_multiple_of(block) } else { self.rounds };
        SceneSettings { rounds, ..self.clone() }
    }

    pub fn forces(&self, effect: Effect) -> bool {
        self.with.contains(&effect)
    }

    pub fn leaves_out(&self, effect: Effect) -> bool {
        self.without.contains(&effect)
    }
}
