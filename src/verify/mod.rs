//! What is known without the engine, and the engine held against it: a path tracer that shares nothing with it, closed forms,
//! radiosity.

pub mod judge;
pub mod selfcheck;
