//! Performance targets for an NVIDIA H200, and the measured values.

use serde::Serialize;

use super::Lab;
use super::Size;
use super::experiment::Experiment;

#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Wanted {
    AtLeast(f64),
    AtMost(f64),
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Target {
    #[serde(skip)]
    pub experiment: Experiment,
    pub work: &'static str,
    pub wanted: Wanted,
    pub unit: &'static str,
    /// What other programs reach, with the source.
    pub peer: &'static str,
}

/// The device that targets are for.
const REFERENCE_DEVICE: &str = "H200";

impl Target {
    const fn of(experiment: Experiment, wanted: Wanted, unit: &'static str) -> Target {
        Target { experiment, wanted, unit, work: "", peer: "-" }
    }
}

/// In the order of their experiments.
pub const TARGETS: [Target; 12] = [
    Target {
        work: "open box, 15 bounces, 2^24 photons per round, best builder: photon-wall events",
        ..Target::of(Experiment::OpenBox, Wanted::AtLeast(20e9), "/s")
    },
    Target {
        work: "map pass, 2^22 photons, 2 bounces: time of atomic over naive",
        peer: "the paper: 6.5 x",
        ..Target::of(Experiment::Builders, Wanted::AtMost(1.1), "x")
    },
    Target {
        work: "map pass, 2^22 photons, 15 bounces: time of naive over atomic",
        ..Target::of(Experiment::Builders, Wanted::AtLeast(2.0), "x")
    },
    Target {
        work: "last row of table 1, 50 rounds of 5000 photons: device time of the run",
        peer: "the paper: 105.64 s",
        ..Target::of(Experiment::Table1, Wanted::AtMost(0.010), "s")
    },
    Target {
        work: "index of 10 M photons of the open box",
        peer: "Vulkan radix sort on an RTX 5080: 1.1 ms for the sort alone",
        ..Target::of(Experiment::Index, Wanted::AtMost(0.001), "s")
    },
    Target {
        work: "index of 10 M photons of a scene of triangles",
        peer: "a kd-tree on an RTX 4090: 200 ms",
        ..Target::of(Experiment::Index, Wanted::AtMost(0.001), "s")
    },
    Target {
        work: "gather at 1920 x 1080 visible points, 1 M photons, 50 per estimate",
        ..Target::of(Experiment::Gather, Wanted::AtMost(0.001), "s")
    },
    Target {
        work: "cornell, 16 bounces: photons traced and stored",
        peer: "Mitsuba 3, light tracing at depth 16, same device: 77 M/s",
        ..Target::of(Experiment::Cornell, Wanted::AtLeast(1.5e9), "/s")
    },
    Target {
        work: "cornell-spheres, 256 x 256: time to 1 % relative RMSE",
        peer: "Mitsuba 3, same device: path 31 s, light tracing 4.5 s",
        ..Target::of(Experiment::CornellSpheres, Wanted::AtMost(0.3), "s")
    },
    Target {
        work: "caustic-sphere, 256 x 256: time to 1 % relative RMSE",
        peer: "Mitsuba 3, same device: path 58 s, light tracing 19 s",
        ..Target::of(Experiment::CausticSphere, Wanted::AtMost(0.2), "s")
    },
    Target {
        work: "250 000 triangles: photons traced, indexed and gathered",
        peer: "best published, scaled by bandwidth: 81 M/s",
        ..Target::of(Experiment::Mesh, Wanted::AtLeast(150e6), "/s")
    },
    Target {
        work: "effects that cornell lacks: time when the plan drops them over time with --without",
        ..Target::of(Experiment::Effects, Wanted::AtMost(1.02), "x")
    },
];

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Finding {
    #[serde(flatten)]
    pub target: Target,
    pub found: f64,
    /// What the device allows by what the work cannot do without.
    pub limit: Option<f64>,
    /// Found is the same work at the size wanted, on the device that the target is for; else nothing is judged.
    pub met: Option<bool>,
    /// What exactly was measured.
    pub how: String,
}

/// What an experiment found of each of its targets, in their order: (found, limit, how).
pub fn findings(lab: &Lab, experiment: Experiment, found: Vec<(f64, Option<f64>, String)>) -> impl Iterator<Item = Finding> {
    let judges = lab.size == Size::Full && lab.gpu.facts().name.contains(REFERENCE_DEVICE);
    let targets: Vec<Target> = TARGETS.into_iter().filter(|target| target.experiment == experiment).collect();
    assert_eq!(targets.len(), found.len(), "{}", experiment.name());
    let meets = |target: &Target, found: f64| match target.wanted {
        Wanted::AtLeast(least) => found >= least,
        Wanted::AtMost(most) => found <= most,
    };
    targets.into_iter().zip(found).map(move |(target, (found, limit, how))| Finding {
        met: judges.then(|| meets(&target, found)),
        target,
        found,
        limit,
        how,
    })
}
