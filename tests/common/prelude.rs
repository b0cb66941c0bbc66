//! What most tests name, in one line: `use crate::common::prelude::*;`. What a test alone is about it names itself.

pub use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};
pub use std::f64::consts::{FRAC_PI_2, PI, TAU};
pub use std::path::{Path, PathBuf};
pub use std::time::Instant;

pub use glam::{DMat3, DQuat, DVec2, DVec3, DVec4, UVec2, Vec2, Vec3, Vec4};
pub(crate) use photonmill::engine::{self, Control};
pub(crate) use photonmill::error::Error;
pub(crate) use photonmill::gpu::{Commands, Constants, Extent, Gpu, Memory, Options};
pub(crate) use photonmill::photon::{MapPhoton, Origin, Photon, StoredPhoton};
pub(crate) use photonmill::plan::scene::ScenePlan;
pub(crate) use photonmill::plan::sensor::Sensor;
pub(crate) use photonmill::plan::{Limits, RoomPlan};
pub(crate) use photonmill::rng::{Rng, philox};
pub(crate) use photonmill::scene::geometry::Geometry;
pub(crate) use photonmill::scene::light::LightKind;
pub(crate) use photonmill::scene::material::{TextureUse, UvTransform};
pub(crate) use photonmill::scene::open_box::open_box;
pub(crate) use photonmill::scene::room::RoomScene;
pub(crate) use photonmill::scene::texture::{Texels, Wrap};
pub(crate) use photonmill::scene::{Camera, Light, Material, Mesh, Scene, Surface, Texture, built_in};
pub(crate) use photonmill::settings::scene::{Effect, Illumination, Part, SceneSettings};
pub(crate) use photonmill::settings::{Builder, EmissionLaw, Gather, Math, Preset, RoomSettings, Sums};
pub(crate) use photonmill::verify::judge::Judge;

pub use super::aimed::{mean_and_error, mean_of_all};
pub use super::family::Family;
pub use super::program::{Place, text};
pub use super::rendered::{
    BOTH, assert_builders_agree, beam, by_rounds, cone, disc, emissive, every_kind_of_light, fixed_radius, flights, glass, grid,
    irradiances, lamp, level, mapped, matt, mean_red, means, mirror, moved, point, radiances, received, red, red_check, render, same_light,
    scene, scene_of, scene_plan, scene_plan_within, seen, shaft, square_picture, standard_errors, sun, tessellated, texture,
};
pub use super::{
    Check, Complaint, Device, JUDGED, Kind, assert_complains, assert_complains_of, assert_holds, closed_box, device, device_with, draws_of,
    equal_sums, fresh_device, gathered, in_order, is_long_run, no_gpu, of_run, on_back_wall, open, pairs, photons, photons_on_cpu,
    plan_for, plan_for_host, relative_check, require, room_result_of, run, run_on_cpu, run_scene, run_scene_on_cpu, same_photons,
    same_sums, share_check, streams_of, z_check,
};
