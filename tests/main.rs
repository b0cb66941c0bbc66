//! The integration tests, a module a subject. They are one program: it is linked once, and no core waits for the last test of
//! a subject.

mod common;

mod engine;
mod files;
mod light;
mod materials;
mod program;
