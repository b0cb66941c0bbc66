//! What a run writes: pictures, irradiance, the report and the trace file.

pub mod colour;
#[cfg(feature = "lab")]
pub(crate) mod csv_table;
pub mod destination;
pub(crate) mod exr_file;
pub(crate) mod image;
pub(crate) mod lightmap;
pub(crate) mod merge_report;
pub mod metadata;
#[cfg(feature = "lab")]
pub(crate) mod page;
pub(crate) mod photon_map;
pub(crate) mod report;
pub(crate) mod room_report;
pub mod scene_report;
pub mod show;
#[cfg(feature = "lab")]
pub(crate) mod svg;
#[cfg(feature = "program")]
pub(crate) mod tev;
pub(crate) mod trace_file;
pub mod white_balance;
pub(crate) mod words;
