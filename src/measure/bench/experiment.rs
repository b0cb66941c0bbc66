//! The names of the experiments, and what each finds.

use serde::Serialize;

use super::pass::Pass;

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub enum Experiment {
    OpenBox,
    Builders,
    Compaction,
    Table1,
    Index,
    Gather,
    Cornell,
    CornellSpheres,
    CausticSphere,
    Mesh,
    Effects,
    Tuning,
}

impl Experiment {
    /// What runs where nothing is asked for; tuning takes long.
    pub const USUAL: [Experiment; 11] = [
        Experiment::OpenBox,
        Experiment::Builders,
        Experiment::Table1,
        Experiment::Index,
        Experiment::Gather,
        Experiment::Cornell,
        Experiment::CornellSpheres,
        Experiment::CausticSphere,
        Experiment::Mesh,
        Experiment::Effects,
        // Takes all the time that is left.
        Experiment::Compaction,
    ];

    pub fn all() -> impl Iterator<Item = Experiment> {
        Experiment::USUAL.into_iter().chain([Experiment::Tuning])
    }

    pub fn name(self) -> &'static str {
        self.words().0
    }

    pub fn title(self) -> &'static str {
        self.words().1
    }

    fn words(self) -> (&'static str, &'static str) {
        match self {
            Experiment::OpenBox => ("open-box", "open box, 15 bounces, every builder"),
            Experiment::Builders => ("builders", "the paper's workload, 2 and 15 bounces, every builder"),
            Experiment::Compaction => ("compaction", "fastest builder by photon count and survival"),
            Experiment::Table1 => ("table-1", "last row of table 1"),
            Experiment::Index => ("index", "index of a large photon map"),
            Experiment::Gather => ("gather", "gather at the points of a picture"),
            Experiment::Cornell => ("cornell", "cornell, 16 bounces"),
            Experiment::CornellSpheres => ("cornell-spheres", "cornell-spheres: time to an error"),
            Experiment::CausticSphere => ("caustic-sphere", "caustic-sphere: time to an error"),
            Experiment::Mesh => ("mesh", "many triangles"),
            Experiment::Effects => ("effects", "effects that a scene lacks"),
            Experiment::Tuning => ("tuning", "what a pilot chooses beside the best of a search"),
        }
    }
}

/// Passes, and for each target (found, limit, how).
pub type Found = (Vec<Pass>, Vec<(f64, Option<f64>, String)>);
