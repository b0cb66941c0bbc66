//! What a run will do, decided before any Vulkan call: of the paper's box in [`room`], of a scene in [`scene`], made in [`planning`].
//! Every buffer is listed in [`buffers`], the radius is in [`radius`].

pub mod buffers;
pub mod capacity;
pub mod differences;
pub mod effects;
pub mod evidence;
pub mod extra_samples;
pub mod film;
pub mod latest_blocks;
pub mod light_choice;
mod maps;
pub mod planning;
pub mod radius;
pub mod room;
pub mod room_effects;
pub mod scene;
pub mod sensor;
pub mod traffic;
pub mod work_cost;
pub mod work_division;

pub use capacity::{Limits, Persistence, Work};
pub use room::{EmissionRange, Grid, RoomPlan, photons_of};
pub use room_effects::Decision;
