//! What a run writes: pictures, irradiance, the report and the trace file.

pub mod colour;
pub mod command;
pub mod destination;
pub mod image;
pub mod light_report;
pub mod lightmap;
pub mod report;
pub mod svg;
pub mod trace_file;
pub mod words;
