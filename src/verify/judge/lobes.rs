//! The lobes of a layered surface at a point: what each scatters, how it is sampled, with which density. The guide's page on
//! materials has the formulas.

use std::f64::consts::{FRAC_1_PI, TAU};
use std::sync::LazyLock;

use glam::DVec3;

use super::albedo::{gauss_legendre, ggx, sheen};
use super::material::{around, fresnel, mirrored, sample_lobe};
use super::microfacets::{Facets, is_delta, schlick, sheen_distribution, sheen_masking};
use super::{Random, uniform};
use crate::constants::MAP_ALPHA_PER_MILLE;
use crate::scene::film;

/// What F0 and F90 of a clear coat are.
const COAT_F0: f64 = 0.04;

/// Rough lobes have at least this share of the largest lobe's chance: their albedos are estimates.
const LEAST_CHANCE: f64 = 0.02;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    Diffuse,
    Reflection,
    Transmission,
    Coat,
    Sheen,
    DiffuseTransmission,
}

impl Kind {
    /// Whether it scatters to the side away from the eye.
    pub(crate) fn is_beyond(self) -> bool {
        matches!(self, Kind::Transmission | Kind::DiffuseTransmission)
    }
}

/// What a lobe is to a path that follows it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Class {
    /// The path goes straight on as if nothing were there.
    Passing,
    Sharp,
    Rough,
}

/// What lies beyond a transmissive surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Wall {
    Thin,
    /// Indices of refraction on the side of `wo` and on the other one.
    Solid {
        from: f64,
        to: f64,
    },
}

/// A thin film on the base.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Film {
    /// How much of it is there.
    pub share: f64,
    pub ior: f64,
    /// Nanometres.
    pub thickness: f64,
    /// [`crate::scene::material::Layers::film_bound`].
    pub bound: f64,
}

impl Film {
    /// What it makes of `bare` reflectance over a base of this F0.
    fn over(&self, bare: DVec3, f0: DVec3, cosine: f64) -> DVec3 {
        if self.share == 0.0 {
            return bare;
        }
        bare.lerp(film::reflectance(f0, self.ior, self.thickness, cosine), self.share)
    }
}

/// A material at a point, its textures included.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Inputs {
    pub base_colour: DVec3,
    pub metalness: f64,
    /// Squared roughness.
    pub alpha: f64,
    /// Of an anisotropic base: a unit vector in the surface, and the alpha along it. That across it is [`Inputs::alpha`].
    pub stretch: Option<(DVec3, f64)>,
    pub ior: f64,
    pub specular: f64,
    pub specular_colour: DVec3,
    pub transmission: f64,
    /// Share of the diffuse lobes.
    pub diffuse_transmission: f64,
    pub diffuse_transmission_colour: DVec3,
    pub film: Film,
    pub wall: Wall,
    pub coat: f64,
    /// Squared roughness.
    pub coat_alpha: f64,
    pub sheen_colour: DVec3,
    /// Squared roughness.
    pub sheen_s: f64,
}

/// Unit vectors: towards the eye, and normals on its side.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Frame {
    pub wo: DVec3,
    /// Of the triangle.
    pub ng: DVec3,
    pub n: DVec3,
    pub coat_n: DVec3,
}

pub(crate) struct Lobes {
    inputs: Inputs,
    frame: Frame,
    /// F0d and F0t.
    f0: DVec3,
    f0_transmission: DVec3,
    /// (1 - E(n.v)) (1 - C(n.v)) / N.
    diffuse: f64,
    /// 1 - C and 1 - S towards the eye. S has no bound at grazing angles, and nothing is left where it is above 1.
    coat_leaves: f64,
    sheen_leaves: f64,
    /// Of being chosen.
    chances: [(Kind, f64); 6],
}

/// Where a path goes on.
pub(crate) struct Scattered {
    pub wi: DVec3,
    /// BSDF times cosine over the density.
    pub weight: DVec3,
    /// Per solid angle; infinite for a delta.
    pub density: f64,
}

/// (1 - E) (1 - C) is smooth enough for few places.
static COSINES: LazyLock<Vec<(f64, f64)>> = LazyLock::new(|| gauss_legendre(16));

impl Inputs {
    /// Whether light enters what lies behind.
    fn transmits(&self) -> bool {
        self.transmission > 0.0 && self.metalness < 1.0
    }

    /// Of diffuse reflection: (1 - m) (1 - t) (1 - d) b.
    fn diffuse_colour(&self) -> DVec3 {
        (1.0 - self.metalness) * (1.0 - self.transmission) * (1.0 - self.diffuse_transmission) * self.base_colour
    }

    /// Of diffuse transmission.
    fn colour_beyond(&self) -> DVec3 {
        (1.0 - self.metalness) * (1.0 - self.transmission) * self.diffuse_transmission * self.diffuse_transmission_colour
    }

    /// F0 of a dielectric whose reflectance along the normal is this.
    fn f0(&self, along_normal: f64) -> DVec3 {
        (along_normal * self.specular_colour).min(DVec3::ONE) * self.specular
    }

    /// What a coat of these reflects at a cosine: C.
    fn coat_albedo(&self, cosine: f64) -> f64 {
        if self.coat == 0.0 {
            return 0.0;
        }
        let albedo = ggx(cosine, self.coat_alpha);
        self.coat * (COAT_F0 * albedo.a + albedo.b)
    }

    /// S.
    fn sheen_albedo(&self, cosine: f64) -> f64 {
        let colour = self.sheen_colour.max_element();
        if colour == 0.0 { 0.0 } else { colour * sheen(cosine, self.sheen_s).min(1.0) }
    }
}

/// Reflectance along the normal.
fn along_normal(from: f64, to: f64) -> f64 {
    ((from - to) / (from + to)).powi(2)
}

impl Lobes {
    pub(crate) fn new(inputs: &Inputs, frame: Frame) -> Lobes {
        // An ior of 0 stands for an infinite one.
        let f0 = inputs.f0(if inputs.ior == 0.0 { 1.0 } else { along_normal(inputs.ior, 1.0) });
        let f0_transmission = match inputs.wall {
            Wall::Thin => f0,
            Wall::Solid { from, to } => inputs.f0(along_normal(from, to)),
        };
        let coat_leaves = (1.0 - inputs.coat_albedo(frame.coat_n.dot(frame.wo))).max(0.0);
        let sheen_leaves = (1.0 - inputs.sheen_albedo(frame.n.dot(frame.wo))).max(0.0);
        let mut lobes = Lobes {
            inputs: *inputs,
            frame,
            f0,
            f0_transmission,
            diffuse: 0.0,
            coat_leaves,
            sheen_leaves,
            chances: [(Kind::Diffuse, 0.0); 6],
        };
        let n_v = frame.n.dot(frame.wo);
        if inputs.diffuse_colour().max_element() > 0.0 || inputs.colour_beyond().max_element() > 0.0 {
            // As of one normal: of two, no more gets through.
            let norm: f64 = COSINES.iter().map(|(cosine, weight)| 2.0 * weight * cosine * lobes.reaches_diffuse(*cosine, *cosine)).sum();
            lobes.diffuse = if norm > 0.0 { lobes.leaves_diffuse() / norm } else { 0.0 };
        }
        lobes.set_chances(n_v);
        lobes
    }

    /// In proportion to albedos towards the eye.
    fn set_chances(&mut self, n_v: f64) {
        let Inputs { base_colour, metalness, transmission, .. } = self.inputs;
        let albedo = ggx(n_v, self.inputs.alpha);
        let dielectric = 1.0 - metalness;
        let both = albedo.a + albedo.b;
        let through = self.fresnel_of_transmission(n_v);
        let mut reflection = metalness * (base_colour * albedo.a + albedo.b)
            + dielectric * (1.0 - transmission) * (self.f0 * albedo.a + self.inputs.specular * albedo.b)
            + dielectric * transmission * through * both;
        if self.inputs.film.share > 0.0 {
            // Elsewhere the film may reflect what it does not here.
            reflection = self.reflectance(n_v).max(DVec3::splat(0.02)) * both;
        }
        let transmitted = dielectric * transmission * base_colour * (1.0 - through) * both;
        // The norm of diffuse reflection is left out here.
        let leaves_diffuse = self.leaves_diffuse();
        let diffuse = self.inputs.diffuse_colour() * leaves_diffuse;
        let beyond = self.inputs.colour_beyond() * leaves_diffuse;
        let under_coat = self.coat_leaves;
        let under = under_coat * self.sheen_leaves;
        let [diffuse, beyond, reflection] = [diffuse, beyond, reflection].map(DVec3::max_element);
        let is_clear = dielectric * transmission * base_colour.max_element() > 0.0;
        // Albedos, and whether the lobes are there.
        let albedos = [
            (Kind::Diffuse, diffuse * self.sheen_leaves, diffuse > 0.0),
            (Kind::Reflection, reflection * under, reflection > 0.0),
            (Kind::Transmission, transmitted.max_element() * under, is_clear),
            (Kind::Coat, self.inputs.coat_albedo(self.frame.coat_n.dot(self.frame.wo)), self.inputs.coat > 0.0),
            (Kind::Sheen, self.inputs.sheen_albedo(n_v) * under_coat, self.inputs.sheen_colour.max_element() > 0.0),
            (Kind::DiffuseTransmission, beyond * self.sheen_leaves, beyond > 0.0),
        ];
        let largest = albedos.iter().fold(0.0f64, |largest, (_, albedo, _)| largest.max(*albedo));
        let raised = albedos.map(|(kind, albedo, is_there)| {
            // What deltas scatter is known exactly.
            (kind, if is_there && !self.is_delta(kind) { albedo.max(LEAST_CHANCE * largest) } else { albedo })
        });
        let sum: f64 = raised.iter().map(|(_, albedo)| albedo).sum();
        self.chances = raised.map(|(kind, albedo)| (kind, if sum > 0.0 { albedo / sum } else { 0.0 }));
    }

    /// What reaches the diffuse lobe at cosines to the normals of base and coat, or gets out of it: (1 - E) (1 - C).
    fn reaches_diffuse(&self, cosine: f64, coat_cosine: f64) -> f64 {
        self.leaves_base(cosine, 0.0) * (1.0 - self.inputs.coat_albedo(coat_cosine)).max(0.0)
    }

    /// The same towards the eye. A stretched base may reflect more there than E, which is that of an even one.
    fn leaves_diffuse(&self) -> f64 {
        let (n_v, coat_v) = (self.frame.n.dot(self.frame.wo), self.frame.coat_n.dot(self.frame.wo));
        let excess = if self.inputs.stretch.is_some() { 0.004 + 0.1 * (1.0 - 4.5 * n_v).max(0.0) } else { 0.0 };
        self.leaves_base(n_v, excess) * (1.0 - self.inputs.coat_albedo(coat_v)).max(0.0)
    }

    /// What the base's reflection leaves, if it is so much above E.
    fn leaves_base(&self, cosine: f64, excess: f64) -> f64 {
        let albedo = ggx(cosine, self.inputs.alpha);
        let Film { share, bound, .. } = self.inputs.film;
        let (f0, f90) = (self.f0.max_element(), self.inputs.specular);
        let (f0, f90) = (f0 + share * (bound - f0), f90 + share * (1.0 - f90));
        (1.0 - f0 * albedo.a - f90 * (albedo.b + excess)).max(0.0)
    }

    /// What the coat leaves to all but the diffuse lobe, by the cosines to its own normal.
    fn under_coat(&self, wi: DVec3) -> f64 {
        self.coat_leaves.min((1.0 - self.inputs.coat_albedo(self.frame.coat_n.dot(wi).abs())).max(0.0))
    }

    fn under_sheen(&self, wi: DVec3) -> f64 {
        self.sheen_leaves.min((1.0 - self.inputs.sheen_albedo(self.frame.n.dot(wi).abs())).max(0.0))
    }

    /// Ft.
    fn fresnel_of_transmission(&self, v_h: f64) -> DVec3 {
        let (f0, f90) = (self.f0_transmission, self.inputs.specular);
        let film = self.inputs.film;
        match self.inputs.wall {
            Wall::Thin => film.over(f0 + (f90 - f0) * schlick(v_h), f0, v_h),
            Wall::Solid { from, to } if from == to => film.over(DVec3::ZERO, f0, v_h),
            Wall::Solid { from, to } => {
                let (reflected, least) = (fresnel(v_h, from, to), along_normal(from, to));
                // In total reflection, and for an index of 0, which reflects all.
                if reflected >= 1.0 || least >= 1.0 {
                    return DVec3::ONE;
                }
                // By the angle in the rarer medium, so that it is the same from both sides.
                let ratio = (from / to).max(1.0);
                let outside = (1.0 - ratio * ratio * (1.0 - v_h * v_h)).max(0.0).sqrt();
                film.over(f0 + (f90 - f0) * ((reflected - least) / (1.0 - least)), f0, outside)
            }
        }
    }

    /// The bracket of base reflection.
    fn reflectance(&self, v_h: f64) -> DVec3 {
        let Inputs { base_colour, metalness, transmission, specular, .. } = self.inputs;
        let grazing = schlick(v_h);
        let metal = base_colour + (1.0 - base_colour) * grazing;
        let metal = self.inputs.film.over(metal, base_colour, v_h);
        let opaque = self.inputs.film.over(self.f0 + (specular - self.f0) * grazing, self.f0, v_h);
        let clear = if transmission > 0.0 { self.fresnel_of_transmission(v_h) } else { DVec3::ZERO };
        metalness * metal + (1.0 - metalness) * ((1.0 - transmission) * opaque + transmission * clear)
    }

    /// (1 - m) t b (1 - Ft).
    fn transmittance(&self, v_h: f64) -> DVec3 {
        let Inputs { base_colour, metalness, transmission, .. } = self.inputs;
        (1.0 - metalness) * transmission * base_colour * (1.0 - self.fresnel_of_transmission(v_h))
    }

    fn coat_reflectance(&self, v_h: f64) -> f64 {
        self.inputs.coat * (COAT_F0 + (1.0 - COAT_F0) * schlick(v_h))
    }

    /// Lobes and the probabilities with which a path chooses them.
    pub(crate) fn chances(&self) -> impl Iterator<Item = (Kind, f64)> {
        self.chances.into_iter().filter(|(_, chance)| *chance > 0.0)
    }

    /// A lobe and its probability; `None` where all is black.
    pub(crate) fn choose(&self, rng: &mut Random) -> Option<(Kind, f64)> {
        let mut left = uniform(rng);
        let mut chosen = None;
        for (kind, chance) in self.chances() {
            // The last one stays where rounding leaves a rest.
            chosen = Some((kind, chance));
            left -= chance;
            if left < 0.0 {
                break;
            }
        }
        chosen
    }

    pub(crate) fn is_delta(&self, kind: Kind) -> bool {
        match kind {
            Kind::Diffuse | Kind::Sheen | Kind::DiffuseTransmission => false,
            Kind::Reflection => is_delta(self.inputs.alpha),
            Kind::Transmission => is_delta(self.inputs.alpha) || self.same_index(),
            Kind::Coat => is_delta(self.inputs.coat_alpha),
        }
    }

    fn same_index(&self) -> bool {
        matches!(self.inputs.wall, Wall::Solid { from, to } if from == to)
    }

    pub(crate) fn class(&self, kind: Kind) -> Class {
        let by_alpha = |alpha: f64| if alpha * 1000.0 < f64::from(MAP_ALPHA_PER_MILLE) { Class::Sharp } else { Class::Rough };
        match kind {
            Kind::Diffuse | Kind::Sheen => Class::Rough,
            // Rays follow all that a solid does.
            Kind::Reflection if matches!(self.inputs.wall, Wall::Solid { .. }) && self.inputs.transmits() => Class::Sharp,
            Kind::Reflection if self.inputs.stretch.is_some() => Class::Sharp,
            Kind::Reflection => by_alpha(self.inputs.alpha),
            Kind::Coat => by_alpha(self.inputs.coat_alpha),
            Kind::Transmission if self.inputs.wall == Wall::Thin && self.is_delta(kind) => Class::Passing,
            Kind::Transmission | Kind::DiffuseTransmission => Class::Sharp,
        }
    }

    /// The normal that a lobe's cosine is taken with, on the side that it scatters to.
    pub(crate) fn axis(&self, kind: Kind) -> DVec3 {
        match kind {
            Kind::Coat => self.frame.coat_n,
            _ if kind.is_beyond() => -self.frame.n,
            _ => self.frame.n,
        }
    }

    /// What reflects and transmits under coat and sheen.
    fn base(&self) -> Facets {
        Facets { n: self.frame.n, alpha: self.inputs.alpha, stretch: self.inputs.stretch }
    }

    fn coat(&self) -> Facets {
        Facets { n: self.frame.coat_n, alpha: self.inputs.coat_alpha, stretch: None }
    }

    /// Whether a lobe scatters that way at all.
    fn reaches(&self, kind: Kind, wi: DVec3) -> bool {
        let ng = if kind.is_beyond() { -self.frame.ng } else { self.frame.ng };
        wi.dot(ng) > 0.0 && wi.dot(self.axis(kind)) > 0.0
    }

    /// The half vector on the side of the eye, for a lobe that may scatter light that way.
    fn half(&self, kind: Kind, wi: DVec3) -> Option<DVec3> {
        let Frame { wo, n, .. } = self.frame;
        match (kind, self.inputs.wall) {
            (Kind::DiffuseTransmission, _) => Some(wo),
            (Kind::Transmission, Wall::Thin) => Some((wo + mirrored_in(wi, n)).normalize()),
            (Kind::Transmission, Wall::Solid { from, to }) => {
                let h = (from * wo + to * wi).normalize();
                let h = if h.dot(n) < 0.0 { -h } else { h };
                (wo.dot(h) > 0.0 && wi.dot(h) < 0.0).then_some(h)
            }
            _ => Some((wo + wi).normalize()),
        }
    }

    /// BSDF of a lobe that is no delta, 1/sr.
    pub(crate) fn evaluate(&self, kind: Kind, wi: DVec3) -> DVec3 {
        if !self.reaches(kind, wi) || self.is_delta(kind) {
            return DVec3::ZERO;
        }
        let Frame { wo, n, .. } = self.frame;
        let Inputs { sheen_colour, sheen_s, .. } = self.inputs;
        // Sheen has no bound at the horizon.
        let (n_v, n_l) = (n.dot(wo).max(1e-9), n.dot(wi).abs());
        let Some(h) = self.half(kind, wi) else { return DVec3::ZERO };
        let v_h = wo.dot(h);
        let d_v = |facets: Facets| facets.distribution(h) * facets.visibility(wo, wi);
        let under = || self.under_coat(wi) * self.under_sheen(wi);
        match kind {
            Kind::Diffuse | Kind::DiffuseTransmission => {
                let share = self.diffuse * self.reaches_diffuse(n_l, self.frame.coat_n.dot(wi).abs()) * self.under_sheen(wi);
                FRAC_1_PI * share * if kind.is_beyond() { self.inputs.colour_beyond() } else { self.inputs.diffuse_colour() }
            }
            Kind::Reflection => d_v(self.base()) * under() * self.reflectance(v_h),
            Kind::Transmission => {
                let stretch = match self.inputs.wall {
                    Wall::Thin => 1.0,
                    Wall::Solid { from, to } => {
                        let l_h = wi.dot(h);
                        4.0 * v_h * -l_h * (from / (from * v_h + to * l_h)).powi(2)
                    }
                };
                d_v(self.base()) * under() * stretch * self.transmittance(v_h)
            }
            Kind::Coat => DVec3::splat(d_v(self.coat()) * self.coat_reflectance(v_h)),
            Kind::Sheen => {
                let masking = 1.0 + sheen_masking(sheen_s, n_v) + sheen_masking(sheen_s, n_l);
                let distribution = sheen_distribution(sheen_s, n.cross(h).length_squared());
                // Where fitted masking would return more than it receives.
                let excess = sheen(n_v, sheen_s).max(sheen(n_l, sheen_s)).max(1.0);
                distribution / (masking * 4.0 * n_v * n_l * excess) * self.under_coat(wi) * sheen_colour
            }
        }
    }

    /// Density of a lobe's samples per solid angle; 0 for a delta.
    pub(crate) fn density(&self, kind: Kind, wi: DVec3) -> f64 {
        if !self.reaches(kind, wi) || self.is_delta(kind) {
            return 0.0;
        }
        let Frame { wo, n, .. } = self.frame;
        let Some(h) = self.half(kind, wi) else { return 0.0 };
        match (kind, self.inputs.wall) {
            (Kind::Diffuse | Kind::DiffuseTransmission, _) => FRAC_1_PI * n.dot(wi).abs(),
            (Kind::Sheen, _) => 0.5 * FRAC_1_PI,
            (Kind::Coat, _) => self.coat().mirrored_density(wo, h),
            (Kind::Transmission, Wall::Solid { from, to }) => {
                let (v_h, l_h) = (wo.dot(h), wi.dot(h));
                self.base().mirrored_density(wo, h) * 4.0 * v_h * -l_h * (to / (from * v_h + to * l_h)).powi(2)
            }
            _ => self.base().mirrored_density(wo, h),
        }
    }

    /// A direction of a lobe; `None` where the sample lies on the wrong side.
    pub(crate) fn sample(&self, kind: Kind, rng: &mut Random) -> Option<Scattered> {
        if self.is_delta(kind) {
            return self.follow_delta(kind);
        }
        let Frame { wo, n, .. } = self.frame;
        let wi = match (kind, self.inputs.wall) {
            (Kind::Diffuse, _) => sample_lobe(n, 1.0, rng),
            (Kind::DiffuseTransmission, _) => sample_lobe(-n, 1.0, rng),
            (Kind::Sheen, _) => {
                let (height, azimuth) = (1.0 - uniform(rng), TAU * uniform(rng));
                let sine = (1.0 - height * height).max(0.0).sqrt();
                around(n, DVec3::new(sine * azimuth.cos(), sine * azimuth.sin(), height))
            }
            (Kind::Coat, _) => mirrored(wo, self.coat().visible_normal(wo, rng)),
            (Kind::Reflection, _) => mirrored(wo, self.base().visible_normal(wo, rng)),
            (Kind::Transmission, Wall::Thin) => mirrored_in(mirrored(wo, self.base().visible_normal(wo, rng)), n),
            (Kind::Transmission, Wall::Solid { from, to }) => refracted(wo, self.base().visible_normal(wo, rng), from / to)?,
        };
        let density = self.density(kind, wi);
        let weight = self.evaluate(kind, wi) * (wi.dot(self.axis(kind)) / density);
        (density > 0.0 && weight.max_element() > 0.0).then_some(Scattered { wi, weight, density })
    }

    fn follow_delta(&self, kind: Kind) -> Option<Scattered> {
        let Frame { wo, ng, n, coat_n } = self.frame;
        let n_v = n.dot(wo);
        let (wi, weight) = match (kind, self.inputs.wall) {
            (Kind::Coat, _) => (mirrored(wo, coat_n), DVec3::splat(self.coat_reflectance(coat_n.dot(wo)))),
            (Kind::Transmission, Wall::Solid { from, to }) if from != to => {
                (refracted(wo, n, from / to)?, (from / to).powi(2) * self.transmittance(n_v))
            }
            (Kind::Transmission, _) => (-wo, self.transmittance(n_v)),
            _ => (mirrored(wo, n), self.reflectance(n_v)),
        };
        // What a turned normal sends to the wrong side is mirrored in the triangle's plane.
        let height = wi.dot(ng);
        let wi = if (height < 0.0) != (kind == Kind::Transmission) { wi - 2.0 * height * ng } else { wi };
        let under = if kind == Kind::Coat { 1.0 } else { self.under_coat(wi) * self.under_sheen(wi) };
        (under * weight.max_element() > 0.0).then_some(Scattered { wi, weight: under * weight, density: f64::INFINITY })
    }

    /// What a shadow ray keeps: the share of a thin smooth wall.
    pub(crate) fn passed(&self) -> DVec3 {
        let passing = Kind::Transmission;
        let passes = self.class(passing) == Class::Passing;
        passes.then(|| self.follow_delta(passing)).flatten().map_or(DVec3::ZERO, |straight| straight.weight)
    }
}

/// Mirrored in the plane with this unit normal.
fn mirrored_in(w: DVec3, normal: DVec3) -> DVec3 {
    w - 2.0 * w.dot(normal) * normal
}

/// The direction beyond a boundary, by the index on the side of `wo` over the other one; `None` in total reflection.
fn refracted(wo: DVec3, normal: DVec3, eta: f64) -> Option<DVec3> {
    let cosine = wo.dot(normal);
    let squared = 1.0 - eta * eta * (1.0 - cosine * cosine);
    (squared > 0.0).then(|| (eta * cosine - squared.sqrt()) * normal - eta * wo)
}
