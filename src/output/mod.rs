//! What a run writes: pictures, irradiance, the report and the trace file.

pub mod colour;
#[cfg(feature = "lab")]
pub mod csv_table;
pub mod destination;
pub mod exr_file;
pub mod image;
pub mod lightmap;
pub mod merge_report;
pub mod metadata;
#[cfg(feature = "lab")]
pub mod page;
pub mod photon_map;
pub mod report;
pub mod room_report;
pub mod scene_report;
pub mod show;
#[cfg(feature = "lab")]
pub mod svg;
#[cfg(feature = "program")]
pub mod tev;
pub mod trace_file;
pub mod words;
