//! Records that Rust and GLSL share. Twin of `glsl/records.glsl`; `tests/layout.rs` compares the two
//! field by field with what reflection finds in the kernels.
//!
//! Lengths are in metres, directions point along the photon's flight, `flux` is relative: the power
//! of a photon divided by that of the strongest photon of the run (see [`crate::engine::room::film`]).

use bytemuck::{Pod, Zeroable};
use glam::{UVec2, UVec3, Vec2, Vec3};

use crate::constants::MAX_GROUPS;

/// One field of a record, as reflection names it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Field {
    pub name: &'static str,
    pub kind: &'static str,
    pub offset: usize,
}

/// A record's name, size in bytes and fields.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Layout {
    pub name: &'static str,
    pub size_bytes: usize,
    pub fields: &'static [Field],
}

/// A Rust type that stands for a GLSL type inside a record.
pub trait GlslType {
    const KIND: &'static str;
}

macro_rules! glsl_types {
    ($($rust:ty => $kind:literal),* $(,)?) => { $(impl GlslType for $rust { const KIND: &'static str = $kind; })* };
}

glsl_types!(f32 => "f32", u32 => "u32", Vec2 => "vec2<f32>", Vec3 => "vec3<f32>", UVec2 => "vec2<u32>", UVec3 => "vec3<u32>");

macro_rules! records {
    ($($(#[$doc:meta])* $name:ident { $($(#[$field_doc:meta])* $field:ident: $kind:ty,)* })*) => {
        $(
            $(#[$doc])*
            #[repr(C)]
            #[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable)]
            pub struct $name { $($(#[$field_doc])* pub $field: $kind,)* }

            impl GlslType for $name { const KIND: &'static str = stringify!($name); }
        )*

        /// Every record above.
        pub const LAYOUTS: &[Layout] = &[$(Layout {
            name: stringify!($name),
            size_bytes: size_of::<$name>(),
            fields: &[$(Field {
                name: stringify!($field),
                kind: <$kind as GlslType>::KIND,
                offset: std::mem::offset_of!($name, $field),
            }),*],
        }),*];
    };
}

records! {
    /// The axis-aligned room that holds the walls.
    Room {
        min_corner: Vec3,
        max_corner: Vec3,
    }

    /// One face of the room: a diffuse wall, or an opening.
    Wall {
        /// Into the room.
        normal: Vec3,
        /// Share of arriving photons that is reflected.
        albedo: f32,
        tangent: Vec3,
        /// Exponent of the Phong lobe; below 0 the wall is Lambertian.
        shininess: f32,
        bitangent: Vec3,
        /// 1: photons leave the scene here.
        is_open: u32,
    }

    /// A disc of light flush with a wall.
    DiscLight {
        centre: Vec3,
        radius: f32,
        wall: u32,
        /// Relative flux of each of its photons, in (0, 1].
        flux: f32,
    }

    /// A point at which light is estimated.
    Point {
        position: Vec3,
        wall: u32,
    }

    /// Fates of the paths that entered one bounce.
    Tally {
        stored: u32,
        absorbed: u32,
        escaped: u32,
        dropped: u32,
    }

    /// `VkDispatchIndirectCommand`.
    DispatchArgs {
        x: u32,
        y: u32,
        z: u32,
    }

    /// What a photon's random numbers depend on beside its number.
    RandomKey {
        seed: UVec2,
        round: u32,
        /// Photons of the rounds before this one, mod 2^32; mt seeds by the number in the run.
        photons_before: u32,
        /// rand48: multiplier and increment, 48 bits each, that lead from one draw of a photon to
        /// its next.
        leap_multiplier: UVec2,
        leap_increment: UVec2,
    }

    /// Photons of one light, in the order of their numbers.
    PhotonRange {
        light: u32,
        first_photon: u32,
        count: u32,
        /// Number of `first_photon` among its light's photons of the run, mod 2^32.
        first_sample: u32,
        /// rand48: from the prepared state of photon i to the first state of photon
        /// `first_photon` + i in this round.
        jump_multiplier: UVec2,
        jump_increment: UVec2,
    }

    EmitPush {
        key: RandomKey,
        range: PhotonRange,
        path_offset: u32,
        path_capacity: u32,
    }

    TracePush {
        key: RandomKey,
        bounce: u32,
        bounces: u32,
        path_capacity: u32,
        photon_capacity: u32,
        eye: Vec3,
    }

    EndBouncePush {
        bounce: u32,
        photon_capacity: u32,
        items_per_group: u32,
        max_groups: u32,
    }

    FillGapsPush {
        bounce: u32,
        bounces: u32,
        path_capacity: u32,
        photon_capacity: u32,
    }

    TracePersistentPush {
        key: RandomKey,
        range: PhotonRange,
        /// Invocations that take photons: each every so many.
        stride: u32,
        bounces: u32,
        photon_capacity: u32,
        eye: Vec3,
    }

    DispatchSizePush {
        counter: u32,
        capacity: u32,
        items_per_group: u32,
        max_groups: u32,
    }

    ClearancePush {
        point_count: u32,
    }

    CrowdSizePush {
        items_per_group: u32,
        max_groups: u32,
    }

    IndexPush {
        origin: Vec3,
        cells_per_metre: f32,
        cell_count: UVec3,
        photon_capacity: u32,
    }

    ScanPush {
        item_count: u32,
    }

    GatherPush {
        /// Points `first_point` to `end_point` - 1 and slices from `first_slice` on: what one dispatch
        /// covers.
        first_point: u32,
        end_point: u32,
        first_slice: u32,
        photon_capacity: u32,
        radius_squared: f32,
        /// A little over the radius: how far from the point a cell may lie.
        reach: f32,
        /// Fixed-point units in 1.
        film_scale: f32,
        origin: Vec3,
        cells_per_metre: f32,
        cell_count: UVec3,
    }

    /// A step of building the kd-tree.
    TreePush {
        photon_capacity: u32,
        /// 0: along the first axis of each wall, 1: along the second.
        axis: u32,
        /// Digit of the radix sort, `TREE_DIGITS`: the wall.
        digit: u32,
        /// Of the nodes that are split: they hold `TREE_LEAF` << `height` photons.
        height: u32,
    }

    NearestPush {
        /// Points `first_point` to `end_point` - 1.
        first_point: u32,
        end_point: u32,
        /// How many photons are wanted.
        nearest: u32,
        /// 1: the searches begin.
        is_first: u32,
        /// Of the full radius: how far the nearest photons are looked for.
        radius_squared: f32,
        /// log2 of the film's units in 1.
        film_shift: u32,
    }

    /// A search for a point's nearest photons, between two dispatches.
    Search {
        /// Leaves before it are done; `NONE`: all are.
        next_leaf: u32,
        /// Photons found.
        found: u32,
        /// Squared distance beyond which no photon is wanted.
        limit: f32,
    }

    /// Node of a compressed wide BVH (Ylitie, Karras and Laine 2017): eight children in boxes of 8-bit
    /// planes.
    BvhNode {
        origin: Vec3,
        /// Exponents of the planes' spacing along x, y, z, and the mask of children that are nodes, a
        /// byte each.
        spacing: u32,
        first_child: u32,
        first_triangle: u32,
        /// A byte a child: where it is, or how many triangles it holds.
        meta: UVec2,
        min_x: UVec2,
        max_x: UVec2,
        min_y: UVec2,
        max_y: UVec2,
        min_z: UVec2,
        max_z: UVec2,
    }

    /// In the order of the BVH's leaves; its front is where it runs counter-clockwise.
    Triangle {
        a: Vec3,
        b: Vec3,
        c: Vec3,
        material: u32,
        /// Number of its front's plane; plus `HIDDEN` if others that lie in it hide a part: then it counts as no surface,
        /// triangles of their own stand for what is visible of it, and rays meet it only between those.
        plane: u32,
    }

    /// Shading normals at a triangle's corners, octahedral; all `NONE` on a flat triangle.
    TriangleNormals {
        a: u32,
        b: u32,
        c: u32,
    }

    /// Texture coordinates at a triangle's corners.
    TriangleUvs {
        base_a: Vec2,
        base_b: Vec2,
        base_c: Vec2,
        emission_a: Vec2,
        emission_b: Vec2,
        emission_c: Vec2,
    }

    SurfaceMaterial {
        base_colour: Vec3,
        /// `SURFACE_...`.
        surface: u32,
        /// Radiance of the front, W/m2/sr.
        emission: Vec3,
        /// Exponent or index of refraction.
        parameter: f32,
        base_texture: u32,
        emission_texture: u32,
        two_sided: u32,
    }

    TextureInfo {
        width: u32,
        height: u32,
        first_texel: u32,
        /// 0 repeat, 1 mirrored, 2 clamp: of u, and of v times 4.
        wrap: u32,
    }

    /// A light, or a triangle that shines. Lengths are those of the normalised scene.
    Emitter {
        /// `EMITTER_...`.
        kind: u32,
        triangle: u32,
        /// Share of the emitters up to and with this one.
        cumulative: f32,
        probability: f32,
        /// Relative flux of each of its photons.
        flux: Vec3,
        /// Radiance, radiant intensity or irradiance, as its kind has it; of a uniform disc the
        /// intensity of a unit of area.
        strength: Vec3,
        position: Vec3,
        /// Its axis or normal; a directional light's flight.
        direction: Vec3,
        /// Radius of a disc; versine (1 - cosine) of a spot's inner cone, of which a narrow one keeps its digits.
        size: f32,
        /// Versine of a spot's outer cone.
        outer_versine: f32,
    }

    /// A sphere around surfaces that make caustics, which photons are aimed at.
    CausticTarget {
        centre: Vec3,
        radius: f32,
    }

    /// A photon in flight through a scene of triangles.
    LightPath {
        position: Vec3,
        /// Number within its round.
        photon: u32,
        direction: Vec3,
        /// `ARRIVED_...`, were it stored at its next hit.
        arrival: u32,
        flux: Vec3,
    }

    /// A path from the camera or a receiver, under way over mirrors and glass.
    CameraPath {
        position: Vec3,
        /// Of its sample among all of all pixels.
        place: u32,
        direction: Vec3,
        /// Bits 0 to 3: it saw a specular surface, it gathers, it starts at no surface, emission counts at its next one; bits 4
        /// and 5: visible points found; from bit 8 on: surfaces that it has met.
        state: u32,
        weight: Vec3,
    }

    /// A point whose light the photon maps are asked for.
    VisiblePoint {
        position: Vec3,
        /// That it lies in: twice its number, plus 1 on its back.
        plane: u32,
        /// What a unit of flux density that arrives adds to the pixel, W/m2/sr per W/m2.
        weight: Vec3,
        /// Octahedral; `NONE`: the plane's.
        shading_normal: u32,
        /// Towards the eye, octahedral.
        wo: u32,
        exponent: f32,
        surface: u32,
        /// Mask of the arrivals that count, and `SEEN_...`; 0: no point.
        arrivals: u32,
    }

    /// A point and its normals, of which irradiance is asked.
    Receiver {
        position: Vec3,
        normal: Vec3,
        shading_normal: Vec3,
    }

    /// Whose random numbers are drawn: seed, round, and a `DOMAIN_...`.
    Draws {
        seed: UVec2,
        round: u32,
        domain: u32,
    }

    /// Photons that leave the lights of a scene.
    PhotonEmission {
        first_photon: u32,
        photon_count: u32,
        emitter_count: u32,
        /// Of a sphere around the scene.
        scene_radius: f32,
        /// Spheres that they are aimed at; 0: at none.
        target_count: u32,
        /// What aimed photons' flux is multiplied by; see [`crate::plan::scene::MapPlan::flux_gain`].
        flux_gain: f32,
    }

    /// Which photons a map holds.
    PhotonStore {
        photon_capacity: u32,
        /// Mask of the arrivals that are stored.
        stored: u32,
        /// 1: photons end where they scatter, as those of a caustic map do.
        caustic_only: u32,
        /// Mask of the surfaces (1 << `SURFACE_...`) whose caustics are wanted.
        caustic_surfaces: u32,
    }

    EmissionPush {
        draws: Draws,
        emission: PhotonEmission,
    }

    FlightPush {
        draws: Draws,
        map: PhotonStore,
        bounce: u32,
        /// Number of the list that its paths come from: [`crate::engine::scene::trace`] counts them from 0 in each segment.
        list: u32,
        /// 1: no path goes on after it.
        is_last: u32,
        /// 1: the naive builder says how many paths are left.
        counts_left: u32,
        path_capacity: u32,
    }

    SceneTracePersistentPush {
        draws: Draws,
        emission: PhotonEmission,
        map: PhotonStore,
        /// Bounces after which photons are cut off.
        bounces: u32,
        /// Bounces that its photons have behind them; 0: they come from their lights.
        first_bounce: u32,
        /// Most flights of a photon in this dispatch.
        flights: u32,
        /// Invocations that take photons: each every so many.
        stride: u32,
    }

    GoOnPush {
        draws: Draws,
        path_count: u32,
        pixel_count: u32,
        emitter_count: u32,
        film_scale: f32,
        film_limit: f32,
        rounding: u32,
    }

    ViewPush {
        draws: Draws,
        /// Hash of the seed and the round that decides what is rounded up.
        rounding: u32,
        width: u32,
        height: u32,
        first_pixel: u32,
        end_pixel: u32,
        eye: Vec3,
        forward: Vec3,
        /// To the picture's right and upper edge, at unit distance.
        right: Vec3,
        up: Vec3,
        emitter_count: u32,
        /// Film units in 1 W/m2/sr.
        film_scale: f32,
        /// Largest sum of one pass, film units.
        film_limit: f32,
    }

    ReceivePush {
        draws: Draws,
        /// Hash of the seed and the round that decides what is rounded up.
        rounding: u32,
        first_point: u32,
        end_point: u32,
        point_count: u32,
        emitter_count: u32,
        film_scale: f32,
        film_limit: f32,
        /// Within which a surface makes a point one of its own.
        radius: f32,
    }

    /// A hashed grid: cells of a row lie side by side.
    CellPush {
        origin: Vec3,
        cells_per_unit: f32,
        bucket_mask: u32,
        photon_capacity: u32,
    }

    SceneGatherPush {
        first_point: u32,
        end_point: u32,
        point_count: u32,
        pixel_count: u32,
        /// Index of the arrival that the map holds, where it holds one only: where its sums stand.
        arrival: u32,
        round: u32,
        /// Hash of the seed and the round that decides what is rounded up.
        rounding: u32,
        /// Of the picture; 0 where points are receivers, in an order of their own.
        width: u32,
        height: u32,
        /// 0: the first slice of candidates of every point; 1: all others of those that have more.
        first_slice: u32,
        /// Invocations that share a point.
        lanes: u32,
        radius: f32,
        cells: CellPush,
    }

    FluxToRadiancePush {
        first_point: u32,
        end_point: u32,
        point_count: u32,
        pixel_count: u32,
        /// Of the picture; 0 where points are receivers, in an order of their own.
        width: u32,
        height: u32,
        /// Mask of the arrivals that some map holds.
        arrivals: u32,
        round: u32,
        /// Hash of the seed and the round that decides what is rounded up.
        rounding: u32,
        film_scale: f32,
        film_limit: f32,
        global_radius: f32,
        caustic_radius: f32,
        /// Flux of a photon of relative flux 1, over the photons of the round.
        global_flux: f32,
        caustic_flux: f32,
    }

    ResolvePush {
        first_pixel: u32,
        end_pixel: u32,
        pixel_count: u32,
        /// Visible points that photons may have lit.
        points_per_pixel: u32,
    }

    EndRoundPush {
        sum_count: u32,
    }

    CheckPush {
        iteration_count: u32,
        addend_low: u32,
        addend_high: u32,
        add_count: u32,
        /// Photons of a loop in which lanes vote, and invocations that take them.
        photon_count: u32,
        stride: u32,
    }

    /// Functions of `glsl/math/math.glsl` at (a, b).
    MathResults {
        /// The bits of a, taken for an integer.
        converted: f32,
        /// a b + a
        sum_of_product: f32,
        /// a / b
        quotient: f32,
        /// Of a.
        root: f32,
        inverse_root: f32,
        exp2: f32,
        log2: f32,
        /// Angle of (b, a).
        angle: f32,
        asinh: f32,
    }

    /// What the functions that sample are asked at.
    SamplingCase {
        /// Two random words, as the generator gives them.
        words: UVec2,
        /// Of a disc, and of what is made into a frame or packed; a unit vector.
        normal: Vec3,
        /// Of a lobe.
        exponent: f32,
        /// Unit vectors: corners of a spherical triangle.
        a: Vec3,
        b: Vec3,
        c: Vec3,
    }

    /// What the functions of `glsl/rng/sampling.glsl`, `glsl/world/scene/filter.glsl` and `glsl/scene` make of a case.
    Samples {
        /// Around the z axis.
        cosine_hemisphere: Vec3,
        uniform_hemisphere: Vec3,
        sphere: Vec3,
        lobe: Vec3,
        /// A point of the unit disc around the origin.
        disc: Vec3,
        /// Barycentric.
        triangle: Vec2,
        filter_offset: Vec2,
        /// A direction within the spherical triangle, and the angle that it was chosen from.
        in_triangle: Vec3,
        solid_angle: f32,
        tangent: Vec3,
        bitangent: Vec3,
        /// The normal, packed in 2 x 16 and in 2 x 15 bits.
        unpacked_normal: Vec3,
        unpacked_direction: Vec3,
    }

    /// What `glsl/check/check_packing_...` pack.
    PackingCase {
        /// In the plane of its wall, where it has one.
        position: Vec3,
        wall: u32,
        /// A unit vector.
        direction: Vec3,
        photon: u32,
        stream: UVec2,
        flux: f32,
        weight: f32,
        /// Flux of a map's photon, and what one hit adds.
        colour: Vec3,
        /// Of a normal that is only unpacked.
        normal_code: u32,
        room: Room,
    }

    /// An entry of the room's photon map and a path, unpacked.
    UnpackedRoom {
        place: Vec3,
        wall: u32,
        flux: f32,
        weight: f32,
        position: Vec3,
        path_wall: u32,
        direction: Vec3,
        photon: u32,
        stream: UVec2,
        path_flux: f32,
    }

    /// An entry of the map of a scene of triangles, unit vectors packed and unpacked, and a child of a node.
    UnpackedScene {
        position: Vec3,
        plane: u32,
        flux: Vec3,
        wi: u32,
        normal_code: u32,
        normal: Vec3,
        direction_code: u32,
        low: Vec3,
        high: Vec3,
        meta: u32,
        child_nodes: u32,
    }

    /// A measurement of a device's limits; see `glsl/kernels/measure_...`.
    MeasurePush {
        item_count: u32,
        /// What one invocation does, times over.
        step_count: u32,
        /// Of random places, which are below a power of two.
        mask: u32,
    }
}

impl DispatchSizePush {
    /// An invocation for each of what a counter counts, `capacity` at most.
    pub fn new(counter: u32, capacity: u32, items_per_group: u32) -> DispatchSizePush {
        DispatchSizePush { counter, capacity, items_per_group, max_groups: MAX_GROUPS }
    }
}
