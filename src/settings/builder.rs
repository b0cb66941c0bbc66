//! The builders of photon maps, in both worlds.

use serde::Serialize;

/// How a photon map is built: how photons are traced, and how they are appended to the map.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Builder {
    /// The paper's first: one slot per photon and bounce, empty ones included.
    Naive,
    /// The paper's second: survivors only, one atomic per thread.
    Atomic,
    /// Survivors only, one atomic per subgroup.
    Ballot,
    /// Survivors only, one atomic per work group.
    Group,
    /// Survivors only, by prefix sums over all of them: photons keep their order.
    Scan,
    /// Each photon from its light to its end by one invocation, which keeps it in registers.
    Persistent,
    /// On the CPU, survivors only, photons side by side in vectors.
    Cpu,
}

impl Builder {
    /// Those that trace either world.
    pub const ON_GPU: [Builder; 6] = [Builder::Naive, Builder::Atomic, Builder::Ballot, Builder::Group, Builder::Scan, Builder::Persistent];

    /// Every way, the CPU's last.
    pub fn all() -> impl Iterator<Item = Builder> {
        Builder::ON_GPU.into_iter().chain([Builder::Cpu])
    }

    pub fn name(self) -> &'static str {
        match self {
            Builder::Naive => "naive",
            Builder::Atomic => "atomic",
            Builder::Ballot => "ballot",
            Builder::Group => "group",
            Builder::Scan => "scan",
            Builder::Persistent => "persistent",
            Builder::Cpu => "cpu",
        }
    }
}
