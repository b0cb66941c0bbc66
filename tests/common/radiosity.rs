pub use photonmill::judge::radiosity::*;
