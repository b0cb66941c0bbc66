//! The builders of photon maps, in both worlds.

named! {
    /// How a photon map is built: how photons are traced, and how they are appended to the map.
    pub enum Builder {
        /// The paper's first: one slot per photon and bounce, empty ones included.
        Naive = "naive",
        /// The paper's second: survivors only, one atomic per thread.
        Atomic = "atomic",
        /// Survivors only, one atomic per subgroup.
        Ballot = "ballot",
        /// Survivors only, one atomic per work group.
        Group = "group",
        /// Survivors only, by prefix sums over all of them: photons keep their order.
        Scan = "scan",
        /// Each photon from its light to its end by one invocation, which keeps it in registers.
        Persistent = "persistent",
        /// On the CPU, survivors only, photons side by side in vectors.
        Cpu = "cpu",
    }
}

impl Builder {
    /// Those that trace either world.
    pub const ON_GPU: [Builder; 6] = [Builder::Naive, Builder::Atomic, Builder::Ballot, Builder::Group, Builder::Scan, Builder::Persistent];
}
