//! The tests of the whole, a module a subject. They are a part of the library's own tests, which see what is private to it.

pub mod common;
mod engine;
mod files;
mod light;
mod materials;
mod program;
