//! Materials: their lobes, media and textures.

pub mod dispersion;
pub mod furnace;
pub mod hard_materials;
pub mod iridescence;
pub mod layers;
pub mod lobe_sampling;
pub mod lobes;
pub mod media;
pub mod scattering;
pub mod translucent;
