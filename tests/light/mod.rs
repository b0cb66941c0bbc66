//! Light in scenes of triangles: closed forms, symmetries, the path tracer.

pub mod aim;
pub mod cameras;
pub mod choosing_lights;
pub mod closed_form;
pub mod closed_rooms;
pub mod extremes;
pub mod hard_cases;
pub mod judge;
pub mod large_scene;
pub mod openings;
pub mod optics;
pub mod overlap;
pub mod radiosity;
pub mod random_rooms;
pub mod skies;
pub mod strangers_scenes;
pub mod transport;
