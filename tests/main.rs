//! The integration tests, a module a subject. They are one program: it is linked once, and no core waits for the last test of
//! a subject.

mod common;

mod aim;
mod architecture;
mod bake;
mod bench;
mod bias;
mod calibration;
mod cli;
mod closed_form;
mod closed_rooms;
mod counts;
mod cpu;
mod engine;
mod extremes;
mod film;
mod gltf;
mod hard_cases;
mod hard_materials;
mod judge;
mod large_scene;
mod layout;
mod ledger;
mod memory;
mod optics;
mod paranoid;
mod photons;
mod primitives;
mod radiosity;
mod random_numbers;
mod red;
mod reference;
mod sampling;
mod scattering;
mod scenes;
mod settings;
mod stop;
mod strict;
mod study;
mod transport;
mod tree;
mod trial;
mod unknown;
