//! What is known without the engine, and the engine checked against it: a path tracer that shares nothing with it, closed forms,
//! radiosity; and any picture against another one.

#[cfg(any(feature = "program", feature = "lab"))]
pub(crate) mod compare;
pub(crate) mod judge;
pub(crate) mod selfcheck;
