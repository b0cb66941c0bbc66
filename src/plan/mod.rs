//! What a run will do, decided before any Vulkan call: of the paper's box in [`room`], of a scene in [`scene`], made in [`planning`].
//! Every buffer is listed in [`buffers`], the radius is in [`radius`].

pub(crate) mod buffers;
pub(crate) mod capacity;
pub(crate) mod differences;
pub(crate) mod effects;
pub(crate) mod evidence;
pub(crate) mod extra_samples;
pub(crate) mod film;
pub(crate) mod latest_blocks;
pub(crate) mod light_choice;
mod maps;
pub(crate) mod planning;
pub(crate) mod radius;
pub mod room;
pub(crate) mod room_effects;
pub mod scene;
pub(crate) mod sensor;
pub(crate) mod traffic;
pub(crate) mod work_cost;
pub mod work_division;

pub(crate) use capacity::Limits;
pub(crate) use room::{EmissionRange, Grid, RoomPlan, photons_of};
pub(crate) use room_effects::Decision;
