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

/// In the order of their experiments.
pub const TARGETS: [Target; 12] = [
    Target {
        experiment: Experiment::OpenBox,
        work: "open box, 15 bounces, 2^24 photons per round, best builder: photon-wall events",
        wanted: Wanted::AtLeast(20e9),
        unit: "/s",
        peer: "-",
    },
    Target {
        experiment: Experiment::Builders,
        work: "map pass, 2^22 photons, 2 bounces: time of atomic over naive",
        wanted: Wanted::AtMost(1.1),
        unit: "x",
        peer: "the paper: 6.5 x",
    },
    Target {
        experiment: Experiment::Builders,
        work: "map pass, 2^22 photons, 15 bounces: time of naive over atomic",
        wanted: Wanted::AtLeast(2.0),
        unit: "x",
        peer: "-",
    },
    Target {
        experiment: Experiment::Table1,
        work: "last row of table 1, 50 rounds of 5000 photons: device time of the run",
        wanted: Wanted::AtMost(0.010),
        unit: "s",
        peer: "the paper: 105.64 s",
    },
    Target {
        experiment: Experiment::Index,
        work: "index of 10 M photons of the open box",
        wanted: Wanted::AtMost(0.001),
        unit: "s",
        peer: "Vulkan radix sort on an RTX 5080: 1.1 ms for the sort alone",
    },
    Target {
        experiment: Experiment::Index,
        work: "index of 10 M photons of a scene of triangles",
        wanted: Wanted::AtMost(0.001),
        unit: "s",
        peer: "a kd-tree on an RTX 4090: 200 ms",
    },
    Target {
        experiment: Experiment::Gather,
        work: "gather at 1920 x 1080 visible points, 1 M photons, 50 per estimate",
        wanted: Wanted::AtMost(0.001),
        unit: "s",
        peer: "-",
    },
    Target {
        experiment: Experiment::Cornell,
        work: "cornell, 16 bounces: photons traced and stored",
        wanted: Wanted::AtLeast(1.5e9),
        unit: "/s",
        peer: "Mitsuba 3, light tracing at depth 16, same device: 77 M/s",
    },
    Target {
        experiment: Experiment::CornellSpheres,
        work: "cornell-spheres, 256 x 256: time to 1 % relative RMSE",
        wanted: Wanted::AtMost(0.3),
        unit: "s",
        peer: "Mitsuba 3, same device: path 31 s, light tracing 4.5 s",
    },
    Target {
        experiment: Experiment::CausticSphere,
        work: "caustic-sphere, 256 x 256: time to 1 % relative RMSE",
        wanted: Wanted::AtMost(0.2),
        unit: "s",
        peer: "Mitsuba 3, same device: path 58 s, light tracing 19 s",
    },
    Target {
        experiment: Experiment::Mesh,
        work: "250 000 triangles: photons traced, indexed and gathered",
        wanted: Wanted::AtLeast(150e6),
        unit: "/s",
        peer: "best published, scaled by bandwidth: 81 M/s",
    },
    Target {
        experiment: Experiment::Effects,
        work: "effects that cornell lacks: time when the plan drops them over time with --without",
        wanted: Wanted::AtMost(1.02),
        unit: "x",
        peer: "-",
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
pub fn findings(lab: &Lab, experiment: Experiment, found: &[(f64, Option<f64>, String)]) -> Vec<Finding> {
    let judges = lab.size == Size::Full && lab.gpu.facts().name.contains(REFERENCE_DEVICE);
    let targets: Vec<Target> = TARGETS.into_iter().filter(|target| target.experiment == experiment).collect();
    assert_eq!(targets.len(), found.len(), "{}", experiment.name());
    let meets = |target: &Target, found: f64| match target.wanted {
        Wanted::AtLeast(least) => found >= least,
        Wanted::AtMost(most) => found <= most,
    };
    let finding = |(target, (found, limit, how)): (Target, &(f64, Option<f64>, String))| Finding {
        met: judges.then(|| meets(&target, *found)),
        target,
        found: *found,
        limit: *limit,
        how: how.clone(),
    };
    targets.into_iter().zip(found).map(finding).collect()
}
