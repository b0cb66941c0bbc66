//! What is packed by hand, packed by Rust and unpacked by the device and the other way round: to the bit, at random and at the ends.

use crate::common::prelude::*;
use obvhs::cwbvh::node::CwBvhNode;
use photonmill::constants::{FACE_COUNT, HIT_KINDS, NO_WALL};
use photonmill::gpu::Buffer;
use photonmill::gpu::kernels::{CheckPackingRoom, CheckPackingScene};
use photonmill::photon_state::{self, PackedPhotonState, PhotonState};
use photonmill::records::{BvhNode, PackingCase, Room, UnpackedRoom, UnpackedScene};
use photonmill::scene::bvh;
use photonmill::scene::geometry::{pack_normal, unpack_normal};

/// One word in eight is an end, and each end comes up some hundred times.
const CASES: u32 = 20_000;

/// Random words of a case, and ends in place of some of them.
struct Words {
    index: u32,
    taken: u32,
}

impl Words {
    fn word(&mut self) -> u32 {
        self.taken += 1;
        philox([self.index, self.taken, 7, 0], [1, 2])[0]
    }

    fn end_or<T: Copy, const N: usize>(&mut self, ends: [T; N], otherwise: impl Fn(u32) -> T) -> T {
        let word = self.word();
        if word.is_multiple_of(8) { ends[(word >> 8) as usize % N] } else { otherwise(self.word()) }
    }

    /// Any number but those that a device may take for 0.
    fn number(&mut self) -> f32 {
        let ends = [0.0, -0.0, 1.0, -1.0, f32::MAX, f32::MIN, f32::MIN_POSITIVE, f32::INFINITY, f32::NEG_INFINITY];
        self.end_or(ends, |word| f32::from_bits(word & 0xbfff_ffff | 0x0080_0000))
    }

    fn vector(&mut self) -> Vec3 {
        Vec3::new(self.number(), self.number(), self.number())
    }

    fn share(&mut self) -> f32 {
        self.end_or([0.0, 1.0, 1.0f32.next_down(), f32::MIN_POSITIVE], |word| word as f32 / 4_294_967_296.0)
    }

    fn bits(&mut self) -> u32 {
        self.end_or([0, 1, u32::MAX, 1 << 31], |word| word)
    }

    fn direction(&mut self) -> Vec3 {
        let signed = |word: u32| word as f32 / 2_147_483_648.0 - 1.0;
        let vector = Vec3::from_array([0; 3].map(|_| self.end_or([0.0, -0.0, 1.0, -1.0], signed)));
        vector.try_normalize().unwrap_or(Vec3::NEG_Z)
    }
}

fn case(index: u32) -> PackingCase {
    let mut words = Words { index, taken: 0 };
    let room = Room { min_corner: words.vector(), max_corner: words.vector() };
    let wall = words.end_or([NO_WALL], |word| word % FACE_COUNT);
    let mut position = words.vector();
    if wall != NO_WALL {
        // To the bit, as photons lie in their walls.
        let axis = wall as usize / 2;
        position[axis] = if wall % 2 == 1 { room.max_corner } else { room.min_corner }[axis];
    }
    PackingCase {
        position,
        wall,
        direction: words.direction(),
        photon: words.bits(),
        stream: UVec2::new(words.bits(), words.bits()),
        flux: words.share(),
        weight: words.share(),
        colour: words.vector(),
        normal_code: (words.bits() % 65_535) | ((words.bits() % 65_535) << 16),
        room,
    }
}

fn photon(case: &PackingCase) -> Photon {
    let PackingCase { position, wall, flux, weight, .. } = *case;
    Photon { position, wall, flux, weight, ..Photon::default() }
}

fn path(case: &PackingCase) -> PhotonState {
    let PackingCase { position, wall, direction, photon, stream, flux, .. } = *case;
    PhotonState { position, wall, direction, photon, stream, flux }
}

fn paths(cases: &[PackingCase]) -> Vec<PackedPhotonState> {
    let words = |first: &dyn Fn(&PackingCase) -> [u32; 4]| cases.iter().map(first).collect::<Vec<_>>();
    let beside = |vector: Vec3, word: u32| [vector.x.to_bits(), vector.y.to_bits(), vector.z.to_bits(), word];
    let all = [
        words(&|case| beside(case.position, case.wall)),
        words(&|case| beside(case.direction, case.photon)),
        words(&|case| [case.stream.x, case.stream.y, case.flux.to_bits(), 0]),
    ];
    bytemuck::cast_slice(&all.concat()).to_vec()
}

fn map_photon(case: &PackingCase) -> MapPhoton {
    MapPhoton { position: case.position, plane: case.photon, flux: case.colour, wi: case.stream.x }
}

/// A node whose bytes are those of a case: boxes of its children lie on a grid of powers of two.
fn node(index: u32) -> CwBvhNode {
    let mut words = Words { index, taken: 100 };
    let mut bytes = || -> [u8; 8] { bytemuck::cast([words.bits(), words.bits()]) };
    let mut node = CwBvhNode {
        child_meta: bytes(),
        child_min_x: bytes(),
        child_max_x: bytes(),
        child_min_y: bytes(),
        child_max_y: bytes(),
        child_min_z: bytes(),
        child_max_z: bytes(),
        ..CwBvhNode::default()
    };
    // From 2^-47 to 2^16.
    node.e = [bytes(), bytes(), bytes()].map(|bytes| 80 + bytes[0] % 64);
    node.imask = bytes()[0];
    node.p = Vec3::new(words.share(), -words.share(), words.share());
    (node.child_base_idx, node.primitive_base_idx) = (words.bits(), words.bits());
    node
}

/// Octahedral codes of a direction, `half_range` on either side of 0, one above the other.
fn octahedral(n: Vec3, half_range: f32, bits: u32) -> u32 {
    let sign = |x: f32| if x >= 0.0 { 1.0 } else { -1.0 };
    let flat = Vec2::new(n.x, n.y) / (n.x.abs() + n.y.abs() + n.z.abs());
    let folded = if n.z >= 0.0 { flat } else { Vec2::new((1.0 - flat.y.abs()) * sign(flat.x), (1.0 - flat.x.abs()) * sign(flat.y)) };
    let code = |x: f32| ((x.clamp(-1.0, 1.0) * half_range).round_ties_even() + half_range) as u32;
    code(folded.x) | code(folded.y) << bits
}

/// What the device packed and unpacked.
#[derive(Clone)]
struct Found {
    photons: Vec<StoredPhoton>,
    paths: Vec<PackedPhotonState>,
    map: Vec<MapPhoton>,
    room: Vec<UnpackedRoom>,
    scene: Vec<UnpackedScene>,
    single_hits: Vec<u32>,
}

fn ask(gpu: &Gpu, packed: &[PackingCase], nodes: &[BvhNode]) -> Found {
    fn empty<T: bytemuck::Pod>(gpu: &Gpu, commands: &mut Commands, count: usize) -> Buffer<T> {
        let buffer = gpu.buffer("unpacked", count as u64, Memory::Device).unwrap();
        commands.clear(&buffer);
        buffer
    }
    let count = packed.len();
    let commands = &mut Commands::new(gpu, Constants::new(128).set("STRICT_MATH", 1), Instant::now()).unwrap();
    let cases = &commands.uploaded("packed", packed).unwrap();
    let (sorted_photons, next_paths, sorted_map) =
        (&empty(gpu, commands, count), &empty(gpu, commands, count), &empty(gpu, commands, count));
    let (room, scene) = (&empty(gpu, commands, count), &empty(gpu, commands, count));
    let single_hits = &empty(gpu, commands, HIT_KINDS as usize * count);
    let photons = &commands.uploaded("packed", &packed.iter().map(|case| photon(case).stored()).collect::<Vec<_>>()).unwrap();
    let paths = &commands.uploaded("packed", &paths(packed)).unwrap();
    let kernel = CheckPackingRoom { cases, photons, paths, sorted_photons, next_paths, results: room };
    commands.dispatch(kernel, &(), Extent::Items(count as u64)).unwrap();
    let map = &commands.uploaded("packed", &packed.iter().map(map_photon).collect::<Vec<_>>()).unwrap();
    let node_cases = &commands.uploaded("packed", nodes).unwrap();
    let kernel = CheckPackingScene { cases, map, node_cases, single_hits, sorted_map, results: scene };
    commands.dispatch(kernel, &(), Extent::Items(count as u64)).unwrap();
    Found {
        photons: commands.read(sorted_photons, count).unwrap(),
        paths: commands.read(next_paths, count).unwrap(),
        map: commands.read(sorted_map, count).unwrap(),
        room: commands.read(room, count).unwrap(),
        scene: commands.read(scene, count).unwrap(),
        single_hits: commands.read(single_hits, HIT_KINDS as usize * count).unwrap(),
    }
}

fn same<T: bytemuck::Pod + std::fmt::Debug>(what: &str, found: T, expected: T) -> Check {
    require(bytemuck::bytes_of(&found) == bytemuck::bytes_of(&expected), || format!("{what}: {found:?} instead of {expected:?}"))
}

/// Everything that Rust and the device make of a case.
fn twins(found: &Found, index: usize, case: &PackingCase, node: &CwBvhNode) -> Check {
    let unpacked = found.room[index];
    // The place of an empty slot means nothing.
    let first = if case.wall == NO_WALL { 2 } else { 0 };
    require(found.photons[index].0[first..] == photon(case).stored().0[first..], || {
        format!("a packed photon: {:?} instead of {:?}", found.photons[index], photon(case).stored())
    })?;
    same("an unpacked wall", unpacked.wall, case.wall)?;
    if case.wall != NO_WALL {
        same("an unpacked place", unpacked.place, case.position)?;
        let back = found.photons[index].photon(Origin::default(), &case.room);
        same("a photon that Rust unpacks", back.position, case.position)?;
    }
    same("unpacked flux", [unpacked.flux, unpacked.weight], [case.flux, case.weight])?;
    // Neither -0 nor infinity is lost, so paths are compared by their words.
    let of_device = photon_state::unpack(&found.paths, index);
    let UnpackedRoom { position, path_wall: wall, direction, photon, stream, path_flux: flux, .. } = unpacked;
    let by_device = PhotonState { position, wall, direction, photon, stream, flux };
    for (what, found) in [("a path that Rust unpacks", of_device), ("a path that the device unpacks", by_device)] {
        let expected = path(case);
        same(what, found.position, expected.position)?;
        same(what, found.direction, expected.direction)?;
        same(what, [found.wall, found.photon, found.flux.to_bits()], [expected.wall, expected.photon, expected.flux.to_bits()])?;
        same(what, found.stream, expected.stream)?;
    }
    let unpacked = found.scene[index];
    same("a map photon", found.map[index], map_photon(case))?;
    let UnpackedScene { position, plane, flux, wi, .. } = unpacked;
    same("a map photon that the device unpacks", MapPhoton { position, plane, flux, wi }, map_photon(case))?;

    same("a packed normal", unpacked.normal_code, pack_normal(case.direction))?;
    same("the same by another rounding", octahedral(case.direction, 32_767.0, 16), pack_normal(case.direction))?;
    let back = unpack_normal(pack_normal(case.direction));
    let is_axis = case.direction.to_array().iter().filter(|along| **along == 0.0).count() == 2;
    require(back.distance(case.direction) < 8e-5 && (!is_axis || back == case.direction.round()), || {
        format!("a normal that is packed and unpacked: {back:?} instead of {:?}", case.direction)
    })?;
    let number = index as u32 & 3;
    same("a packed direction", unpacked.direction_code, octahedral(case.direction, 16_383.0, 15) | number << 30)?;
    let normal = unpack_normal(case.normal_code);
    require((unpacked.normal - normal).abs().max_element() <= 4.0 * f32::EPSILON, || {
        format!("an unpacked normal: {:?} instead of {normal:?}", unpacked.normal)
    })?;

    let child = index & 7;
    let spacing = Vec3::from_array(node.e.map(|exponent| 2f32.powi(i32::from(exponent) - 127)));
    let corner = |x: [u8; 8], y: [u8; 8], z: [u8; 8]| Vec3::from_array([x, y, z].map(|bytes| f32::from(bytes[child]))) * spacing;
    let p = node.p;
    same("a child's low corner", unpacked.low, corner(node.child_min_x, node.child_min_y, node.child_min_z) + p)?;
    same("a child's high corner", unpacked.high, corner(node.child_max_x, node.child_max_y, node.child_max_z) + p)?;
    same("a child's byte", unpacked.meta, u32::from(node.child_meta[child]))?;
    same("bits of child nodes", unpacked.child_nodes, u32::from(node.imask))?;

    let light = case.colour.max_element();
    let miss = if light > 0.0 { light.min(f32::MAX).to_bits() } else { 0 };
    same("what one hit would add", found.single_hits[HIT_KINDS as usize * index..][..3].try_into().unwrap(), [miss, u32::MAX, 0])
}

#[test]
fn what_rust_packs_the_device_unpacks_and_the_other_way_round() {
    let Some(gpu) = device() else { return };
    let cases: Vec<PackingCase> = (0..CASES).map(case).collect();
    let nodes: Vec<CwBvhNode> = (0..CASES).map(node).collect();
    let found = ask(&gpu, &cases, &nodes.iter().map(bvh::record).collect::<Vec<_>>());
    let holds = |found: &Found, index: usize| twins(found, index, &cases[index], &nodes[index]);
    for index in 0..cases.len() {
        assert_holds(index, holds(&found, index));
    }

    let on_wall = (0..cases.len()).find(|index| cases[*index].wall == 2).unwrap();
    type Spoil = fn(&mut Found, usize);
    let spoils: [(&str, Spoil); 9] = [
        ("a photon's two coordinates swapped", |found, index| found.photons[index].0.swap(0, 1)),
        ("a photon on the wall across", |found, index| found.photons[index].0[3] ^= 1 << 31),
        ("a path at its neighbour's place", |found, index| {
            bytemuck::cast_slice_mut::<_, [u32; 4]>(&mut found.paths).swap(index, index + 1);
        }),
        ("a map photon's words swapped", |found, index| {
            let [place, light]: [[u32; 4]; 2] = bytemuck::cast(found.map[index]);
            found.map[index] = bytemuck::cast([light, place]);
        }),
        ("an unpacked place off by a bit", |found, index| {
            let x = &mut found.room[index].place.x;
            *x = f32::from_bits(x.to_bits() ^ 1);
        }),
        ("a code cut instead of rounded", |found, index| found.scene[index].normal_code += 1),
        ("a number over a direction's code", |found, index| found.scene[index].direction_code ^= 1 << 30),
        ("a neighbour's box", |found, index| found.scene[index].low = found.scene[index + 1].low),
        ("a hit that was missed", |found, index| found.single_hits[HIT_KINDS as usize * index + 1] = 0),
    ];
    for (what, spoil) in spoils {
        let mut spoiled = found.clone();
        spoil(&mut spoiled, on_wall);
        assert_complains(what, holds(&spoiled, on_wall));
    }
}
