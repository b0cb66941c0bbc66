//! Every number that the paper prints about time and memory, with the section it is from.

/// Section 4.2: what the paper was measured on.
pub(crate) const HARDWARE: &str = "Intel Core 2 Duo at 2.00 GHz and NVIDIA GeForce 8600M GT (two multiprocessors)";

/// Section 4.2: photons of a run, beyond which the 8600M's memory did not go.
pub(crate) const PHOTONS: u32 = 5000;

/// Section 4.3: bounces of the comparison.
pub(crate) const BOUNCES: u32 = 2;

/// Section 4.3: the map pass, milliseconds.
pub(crate) const MAP_MS: Passes = Passes { naive: 1.7, modified: 11.0, cpu: 15.0 };

/// Section 4.3: the rendering pass, milliseconds.
pub(crate) const RENDERING_MS: Passes = Passes { naive: 3000.0, modified: 2000.0, cpu: 8000.0 };

/// Section 4.5, table 1: (rounds of 5000 photons, milliseconds of the whole run).
pub(crate) const TABLE_1: [(u32, f64); 5] = [(1, 2130.0), (5, 10_670.0), (10, 20_850.0), (25, 53_280.0), (50, 105_640.0)];

/// Section 4.5: rounds of figure 4.
pub(crate) const FIGURE_4_ROUNDS: [u32; 6] = [1, 5, 10, 25, 50, 100];

/// Section 4.4: shininess of figure 3, from left to right.
pub(crate) const FIGURE_3_SHININESS: [f32; 3] = [2.0, 0.5, 0.01];

/// One pass by implementation, milliseconds.
pub(crate) struct Passes {
    pub naive: f64,
    pub modified: f64,
    pub cpu: f64,
}
