//! Files: what is read, what is written.

pub mod baked_files;
pub mod compare;
pub mod denoise;
pub mod extensions;
pub mod far_away;
pub mod fuzz;
pub mod gltf;
pub mod info;
pub mod lightmap_texels;
pub mod map;
pub mod other_readers;
pub mod picture_files;
