//! What a run writes: pictures, irradiance, the report and the trace file.

pub mod colour;
pub mod command;
pub mod csv_table;
pub mod destination;
pub mod exr_file;
pub mod image;
pub mod lightmap;
pub mod merge_report;
pub mod metadata;
pub mod page;
pub mod photon_map;
pub mod report;
pub mod room_report;
pub mod scene_report;
pub mod show;
pub mod svg;
pub mod tev;
pub mod trace_file;
pub mod words;
