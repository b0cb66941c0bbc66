//! What work costs on a class of devices, weighed by what a pilot counts: not by any run's own times, so that the same is chosen on each
//! device of its class.

use super::scene::ScenePlan;

/// What paths and photons meet on their way.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Counted {
    /// Nodes of the hierarchy for a path from the camera, and for a shadow ray.
    pub nodes: f64,
    pub nodes_of_ray: f64,
    /// Triangles that the discs of a path's estimates are cut to, at the pilot's radius.
    pub triangles: f64,
    /// From one surface to the next, of each photon of the global and of the caustic map.
    pub flights: [f64; 2],
}

/// What a round takes, nanoseconds.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Cost {
    /// In any case.
    pub round: f64,
    /// Of a path through each pixel, and of a shadow ray of each.
    pub paths: f64,
    pub shadow_rays: f64,
    /// Of a path's lookups in each map with the usual neighbours, and to cut its discs to the surface at the pilot's radius.
    pub lookups: f64,
    pub discs: f64,
    /// Of the global and of the caustic map.
    pub photons: [f64; 2],
}

/// What work costs on a class of devices, nanoseconds.
struct Costs {
    /// A path from the camera and its share of the picture, without its rays.
    path: f64,
    /// A node of the hierarchy on the way of a path or a shadow ray.
    node: f64,
    /// A shadow ray's light at a surface with layers, of which it asks each.
    layers: f64,
    /// How many times as long a path takes that meets layers, and then, as a shadow ray, through gaps of their coverage.
    of_layers: f64,
    of_passing: f64,
    /// A lookup in a map, and a triangle that a disc is cut to.
    lookup: f64,
    triangle: f64,
    /// A photon's flight from one surface to the next, and a node on its way.
    flight: f64,
    node_of_flight: f64,
    /// What a round and each of its maps take in any case.
    round: f64,
    map: f64,
    /// Of paths and photons over mirrors and glass the longest ones, for which all others wait.
    chains: f64,
}

/// Of GPUs on an NVIDIA H100 in ten scenes, of CPUs on lavapipe with two cores (November 2026). GPUs that share the host's memory were not
/// measured.
fn costs(kind: &str) -> Costs {
    match kind {
        "cpu" => Costs {
            path: 500.0,
            node: 280.0,
            layers: 300.0,
            of_layers: 1.5,
            of_passing: 1.2,
            lookup: 550.0,
            triangle: 180.0,
            flight: 400.0,
            node_of_flight: 80.0,
            round: 1e6,
            map: 2e6,
            chains: 0.0,
        },
        "discrete" => Costs {
            path: 0.25,
            node: 0.14,
            layers: 0.4,
            of_layers: 2.2,
            of_passing: 4.0,
            lookup: 0.2,
            triangle: 0.4,
            flight: 0.05,
            node_of_flight: 0.19,
            round: 1.5e5,
            map: 1.5e5,
            chains: 1.6e6,
        },
        _ => Costs {
            path: 4.0,
            node: 2.5,
            layers: 6.0,
            of_layers: 2.2,
            of_passing: 4.0,
            lookup: 3.0,
            triangle: 4.0,
            flight: 1.0,
            node_of_flight: 3.0,
            round: 3e5,
            map: 3e5,
            chains: 3e6,
        },
    }
}

/// How many times as long a flight takes of a photon that is sent through mirrors and glass.
const OF_CAUSTIC_PHOTON: f64 = 1.7;

/// How much a pilot looks at.
#[derive(Clone, Copy)]
pub(crate) struct PilotSize {
    /// Rounds of the first look, and its pixels at most, spread over the picture. On a GPU many take hardly longer than few.
    pub rounds: u32,
    pub pixels: u32,
    /// Photons of each map in all looks: about so many that they take as long as all else.
    pub photons: u32,
    /// Photons within the first radius, over the usual number. The radius is then two to three times the usual one: so large that the bias
    /// stands out, and so small that discs over fine meshes do not cover too many triangles.
    pub neighbours: f64,
}

pub(crate) fn pilot_size(kind: &str) -> PilotSize {
    match kind {
        "cpu" => PilotSize { rounds: 4, pixels: 1 << 10, photons: 1 << 13, neighbours: 0.5 },
        "discrete" => PilotSize { rounds: 8, pixels: 1 << 14, photons: 1 << 16, neighbours: 2.0 },
        _ => PilotSize { rounds: 8, pixels: 1 << 12, photons: 1 << 14, neighbours: 1.0 },
    }
}

/// Of a plan's scene and pixels on a class of devices.
pub(crate) fn cost(plan: &ScenePlan, counted: &Counted, kind: &str) -> Cost {
    let Costs { path, node, layers, of_layers, of_passing, lookup, triangle, flight, node_of_flight, round, map, chains } = costs(kind);
    let has = |constant: &str| f64::from(plan.constant(constant));
    let Counted { nodes, nodes_of_ray, triangles, flights } = *counted;
    let times = |of: f64, constant: &str| 1.0 + (of - 1.0) * has(constant);
    let layered = times(of_layers, "HAS_LAYERS");
    let passing = times(of_passing, "HAS_PASSING");
    let pixels = f64::from(plan.sensor.pixels());
    // Nodes on the way of a photon are not counted, but about those of a path and a shadow ray.
    let of_flight = flight + node_of_flight * (nodes + nodes_of_ray);
    let maps = plan.maps().count() as f64;
    Cost {
        round: round + map * maps + layered.min(2.0) * chains * has("HAS_SPECULAR_CHAINS"),
        paths: pixels * (path + layered * passing * node * nodes),
        shadow_rays: if plan.shadow_rays() == 0 { 0.0 } else { pixels * passing * (node * nodes_of_ray + layers * has("HAS_LAYERS")) },
        lookups: pixels * lookup,
        discs: pixels * triangle * triangles,
        photons: [flights[0] * of_flight, OF_CAUSTIC_PHOTON * flights[1] * of_flight],
    }
}
