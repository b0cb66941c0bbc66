//! The program as its users meet it, its guide, and the shape of its source.

pub mod architecture;
pub mod bench;
pub mod cli;
pub mod config;
pub mod display;
pub mod gallery;
pub mod guide;
pub mod package;
pub mod render_and_probe;
pub mod study;
pub mod tools;
pub mod view;
