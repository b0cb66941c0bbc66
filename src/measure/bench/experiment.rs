//! The names of the experiments, and what each measures.

use serde::Serialize;

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub enum Experiment {
    OpenBox,
    Builders,
    Table1,
    Index,
    Gather,
    Cornell,
    Mesh,
    Compaction,
}

impl Experiment {
    /// The last takes all the time that is left.
    pub const ALL: [Experiment; 8] = [
        Experiment::OpenBox,
        Experiment::Builders,
        Experiment::Table1,
        Experiment::Index,
        Experiment::Gather,
        Experiment::Cornell,
        Experiment::Mesh,
        Experiment::Compaction,
    ];

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
            Experiment::Table1 => ("table-1", "last row of table 1"),
            Experiment::Index => ("index", "index of a large photon map"),
            Experiment::Gather => ("gather", "gather at the points of a picture"),
            Experiment::Cornell => ("cornell", "cornell, 16 bounces"),
            Experiment::Mesh => ("mesh", "many triangles"),
            Experiment::Compaction => ("compaction", "fastest builder by photon count and survival"),
        }
    }
}
