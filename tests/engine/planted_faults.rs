//! Checks that can fail: faults are planted in the kernels' sources, and the checks of the other tests must complain,
//! each of what the fault does. Checks of numbers on the host show it beside themselves (`assert_complains`).

use std::sync::atomic::AtomicBool;
use std::sync::{Arc, LazyLock, Mutex};
use std::time::Duration;

use crate::common::Kind::*;
use crate::common::layered;
use crate::common::prelude::*;
use crate::common::{MANY_PHOTONS, aimed, bits, estimate_check, known, lamps, noticed_as, planted, sheets};
use crate::tests::engine::film::pairs_count_on;
use crate::tests::engine::ledger::closed_fates;
use crate::tests::engine::paranoid::{box_is_finite, scene_is_finite};
use crate::tests::engine::strict::{film_agrees, photons_agree, rounding_check};
use crate::tests::engine::unseen_light;
use crate::tests::light::closed_form::closed_form_check;
use crate::tests::light::hard_cases::readme_and_guide;
use crate::tests::light::overlap::floor_beside;
use crate::tests::light::transport::{appends_agree, dense_points_check};
use crate::tests::light::{openings, skies};
use crate::tests::materials::{dispersion, media, translucent};
use photonmill::engine::room::film;
use photonmill::measure::compaction;

/// What is asked of a device: checks of other tests.
#[derive(Debug, Clone, Copy)]
enum Question {
    /// A builder's photon map is the CPU builder's, bit for bit.
    Photons(Builder),
    /// So is the film.
    RoomFilm(Gather),
    /// The ledger closes and nothing is dropped.
    Ledger(Builder),
    /// A closed form of `selfcheck`, by name.
    ClosedForm(&'static str),
    /// Aimed photons bring as much light as others: a scene of `common::aimed`.
    AimedLight(&'static str),
    /// Any other, by what it is about.
    Of(FaultArea, Run, &'static str, fn(&Gpu) -> Check<Complaint>),
}

/// What a fault spoils; tests of its own each, as they run side by side.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum FaultArea {
    Room,
    Scenes,
    Lamps,
    Aiming,
    Layers,
}

/// The run in which a device without a fault is asked.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Run {
    Short,
    /// In which a device with a fault is asked, too: the question takes kernels of its own that are long in the making.
    Long,
    /// Another test asks.
    Neither,
}

use FaultArea::*;
use Question::*;
use Run::*;

impl Question {
    fn area(self) -> FaultArea {
        match self {
            Photons(_) | RoomFilm(_) | Ledger(_) | ClosedForm(_) => Room,
            AimedLight(_) => Aiming,
            Of(area, ..) => area,
        }
    }

    fn run(self) -> Run {
        match self {
            Photons(_) | RoomFilm(_) | Ledger(_) | ClosedForm(_) => Short,
            AimedLight(_) => Neither,
            Of(_, run, ..) => run,
        }
    }

    fn name(self) -> String {
        if let Of(_, _, name, _) = self { name.to_owned() } else { format!("{self:?}") }
    }

    fn ask(self, gpu: &Gpu) -> Check<Complaint> {
        match self {
            Photons(builder @ Builder::Persistent) => {
                builds(gpu, &RoomSettings { builder, photons: MANY_PHOTONS, chunk: Some(MANY_PHOTONS), ..strict() })
            }
            Photons(builder) => builds(gpu, &RoomSettings { builder, ..strict() }),
            RoomFilm(gather) => gathers(gpu, &RoomSettings { gather, ..strict() }),
            Ledger(builder) => {
                let settings = RoomSettings { builder, mesh: 1, ..strict() };
                closed_fates(gpu, &open_box(&settings), &settings).map(|_| ())
            }
            ClosedForm(name) => closed_form_check(gpu, name),
            AimedLight(kind) => aimed::same_light(gpu, kind),
            Of(.., check) => check(gpu),
        }
    }
}

// Questions by which several faults are noticed.
const NEAREST: Question =
    Of(Room, Short, "the nearest photons", |gpu| gathers(gpu, &RoomSettings { gather: Gather::KdTree, nearest: Some(20), ..strict() }));
const STRIPED_COUNTERS: Question = Of(Room, Short, "several counters of the atomic builder", striped_counters);
const BUILDERS: Question = Of(Room, Short, "builders under the clock", builders_under_the_clock);
const STRICT_MATH: Question = Of(Room, Short, "strict quotients and roots", rounding_check);
const APPENDS: Question = Of(Scenes, Long, "survivors in any order", |gpu| appends_agree(gpu, &scene("cornell"), &small()));
const FINITE: Question =
    Of(Scenes, Long, "finite numbers", |gpu| scene_is_finite(gpu, &SceneSettings { rounds: 1, builder: Some(Builder::Ballot), ..small() }));
const DENSE_POINTS: Question = Of(Scenes, Short, "points with many photons near", dense_points_check);
const BITS: Question = Of(Scenes, Neither, "the bits written down", |gpu| bits::check(gpu, "cornell"));
const LEANING_PLANE: Question = Of(Scenes, Short, "a leaning plane", |gpu| known::leaning_plane(gpu, Illumination::Photons));
const COARSE_GLASS: Question = Of(Scenes, Long, "coarse glass", |gpu| known::coarse_sphere_in_a_furnace(gpu, glass(1.5), 8));
const GLASS_IN_FURNACE: Question = Of(Scenes, Long, "glass in a furnace", |gpu| known::glass_in_a_furnace(gpu, 4, false));
const MANY_LAMPS: Question = Of(Lamps, Neither, "many lamps", |gpu| lamps::many_lamps(gpu, 16, true));
const WINDOW: Question = Of(Scenes, Long, "light through a window", openings::light_through_a_window);
const BARE_PLATES: Question = Of(Layers, Short, "bare plates in the sun", |gpu| plates(gpu, false, false));
const COVERED_PLATES: Question = Of(Layers, Short, "covered plates in the sun", |gpu| plates(gpu, true, false));
const TRANSMISSIVE_PLATES: Question = Of(Layers, Short, "transmissive plates in the sun", |gpu| plates(gpu, false, true));
const METALS: Question = Of(Layers, Long, "metals under the sky", |gpu| layered::furnace(gpu, &layered::glossy_metals(), false));
const LAYER_TEXTURES: Question = Of(Layers, Short, "textures of layers", layered::textures_in_the_sun);
const FLOOR_THROUGH_SHEETS: Question = Of(Layers, Long, "a floor through sheets", sheets::floor_through_sheets);
const OVERLAPPING_SLABS: Question = Of(Layers, Short, "overlapping slabs", media::overlapping_slabs);
const HALF_A_DOME: Question = Of(Layers, Short, "transmission in half a dome", layered::transmission_in_half_a_dome);
const EYE_IN_GLASS: Question = Of(Layers, Long, "an eye in glass", media::eye_in_glass);
const LAMP_IN_A_MEDIUM: Question = Of(Layers, Long, "a lamp in a medium", media::lamp_in_a_medium);
const LAMP_BETWEEN_SHEETS: Question = Of(Layers, Long, "a lamp between sheets", sheets::lamp_between_sheets);
const COATS_AND_BACKS: Question = Of(Layers, Short, "coats and backs", layered::coats_and_backs_in_the_sun);

struct Fault {
    what: &'static str,
    /// Under `glsl/`.
    file: &'static str,
    from: &'static str,
    to: &'static str,
    /// Kernels that run the spoiled source.
    kernels: &'static [&'static str],
    /// Questions that must be answered wrong, and in which way.
    noticed_by: &'static [(Question, Kind)],
}

// Kernels that several faults spoil.
const LOOKUPS: &[&str] = &["gather_visible_points_u64", "gather_visible_points_two_words"];
const SCENE_TRACERS: &[&str] = &["trace_persistent_scene", "trace_scene_ballot"];
const SCENE_EMITTERS: &[&str] = &["trace_persistent_scene", "emit_scene"];
const GRID_GATHERS: &[&str] = &["gather_grid_u64", "gather_grid_two_words"];
const NEAREST_GATHERS: &[&str] = &["nearest_u64", "nearest_two_words"];

#[rustfmt::skip]
const FAULTS: [Fault; 143] = [
    // The first of their areas, which the short run plants, are kept here: their questions share most of their kernels with others.
    Fault { what: "8-bit codes of textures are taken for linear values",
        file: "material/textures.glsl", from: "return uintBitsToFloat(texels[code & 255]);", to: "return float(code & 255) * (1.0 / 255.0);",
        kernels: &["camera_paths"], noticed_by: &[(Of(Scenes, Short, "a repeated texture", |gpu| known::wrapped_texture(gpu, [Wrap::Repeat; 2], false)), WrongTexel)] },
    Fault { what: "the sky beside the openings that are known counts as seen",
        file: "world/scene/lights.glsl", from: "arriving.is_beside = !sampled.is_aimed;", to: "",
        kernels: &["receive"], noticed_by: &[(Of(Lamps, Short, "a second opening", openings::second_opening), TooDark)] },
    Fault { what: "media absorb nothing on the way from the eye",
        file: "world/scene/camera_path.glsl", from: "chain.weight *= transmittance(chain.media, hit.t);", to: "",
        kernels: &["camera_paths"], noticed_by: &[(Of(Layers, Short, "an absorbing slab", |gpu| media::absorbing_slab(gpu, 1.0, 0.5, 1.0)), TooBright)] },
    Fault { what: "what rounding takes from a pair of floats is forgotten",
        file: "film/float_u64.glsl", from: "precise float rest = sum.y + (", to: "precise float rest = 0.0 * (",
        kernels: &["gather_brute_u64", "gather_grid_u64"],
        noticed_by: &[(Of(Room, Short, "pairs of floats where one float has stopped", pairs_count_on), SumsTooSmall)] },
    Fault { what: "what one sample looks up for all counts for itself alone",
        file: "kernels/flux_to_radiance.comp", from: "? float(samples_of(pixel)) : 1.0", to: "? 1.0 : 1.0",
        kernels: &["flux_to_radiance"], noticed_by: &[(GLASS_IN_FURNACE, TooDark)] },
    Fault { what: "what one sample gathers for all counts for itself alone",
        file: "world/scene/camera_path.glsl", from: "chain.weight *= for_all ? float(own.count) : 1.0;", to: "",
        kernels: &["camera_paths"],
        noticed_by: &[(Of(Scenes, Long, "glass in a furnace, by gather rays", |gpu| known::glass_in_a_furnace(gpu, 4, true)), TooDark)] },
    Fault { what: "what emits light counts for the path that was taken and for the others",
        file: "world/scene/camera_path.glsl", from: "light = chain.chance * chain.weight", to: "light = chain.weight",
        kernels: &["camera_paths"], noticed_by: &[(GLASS_IN_FURNACE, TooBright)] },
    Fault { what: "ways that a path did not take at layered glass are forgotten",
        file: "world/scene/splitting.glsl", from: "add_way(surface, other, coverage * other.weight, media, depth);", to: "",
        kernels: &["camera_paths"], noticed_by: &[(EYE_IN_GLASS, TooDark)] },
    Fault { what: "every other lane of a subgroup writes over its neighbour",
        file: "builder/place.glsl", from: "subgroupBallotExclusiveBitCount(survivors);",
        to: "(subgroupBallotExclusiveBitCount(survivors) & 0xfffffffeu);",
        kernels: &["trace_persistent_scene", "trace_persistent_room"],
        noticed_by: &[(Photons(Builder::Persistent), OtherPhotons), (APPENDS, OtherSums)] },
    Fault { what: "a subgroup's second paths write over its first ones'",
        file: "builder/ballot.glsl", from: "count + subgroupBallotExclusiveBitCount", to: "subgroupBallotExclusiveBitCount",
        kernels: &["trace_room_ballot"], noticed_by: &[(Photons(Builder::Ballot), OtherPhotons), (BUILDERS, BuildersDisagree)] },
    Fault { what: "the path in the middle of an odd number is left out",
        file: "builder/compact.glsl", from: "(path_count + PLACES - 1) / PLACES", to: "path_count / PLACES",
        kernels: &["trace_room_ballot"], noticed_by: &[(Ledger(Builder::Ballot), LedgerOpen), (Photons(Builder::Ballot), PhotonsLost)] },
    Fault { what: "a gap of several counters is taken for a photon",
        file: "kernels/fill_gaps.comp", from: "photons[first_photon + place] = pack_photon(Photon(vec3(0.0), NO_WALL, 0.0, 0.0, 0, 0));",
        to: "",
        kernels: &["fill_gaps"], noticed_by: &[(STRIPED_COUNTERS, PhotonsAdded)] },
    Fault { what: "a gap of several counters is taken for a path",
        file: "kernels/fill_gaps.comp", from: "next_paths[path_word(0, place, push.path_capacity)].w = NO_WALL;", to: "",
        kernels: &["fill_gaps"], noticed_by: &[(STRIPED_COUNTERS, OtherPhotons)] },
    Fault { what: "the last block of the counter that is ahead is left out",
        file: "kernels/fill_gaps.comp", from: "? 0 : striped_place(turn, taken - 1)", to: "? 0 : striped_place(0, taken - 1)",
        kernels: &["fill_gaps"], noticed_by: &[(STRIPED_COUNTERS, PhotonsLost)] },
    Fault { what: "a row of cells is taken for narrower than the disc",
        file: "gather/bucket_rows.glsl", from: "range.reach * range.reach", to: "0.9 * range.reach * range.reach",
        kernels: &["gather_visible_points_u64"], noticed_by: &[(BITS, OtherBits)] },
    Fault { what: "a lane is lost",
        file: "builder/compact.glsl", from: "bool fits = stored[k] &&", to: "bool fits = stored[k] && gl_SubgroupInvocationID != 3u &&",
        kernels: &["trace_room_atomic"], noticed_by: &[(Ledger(Builder::Atomic), LedgerOpen), (Photons(Builder::Atomic), OtherPhotons)] },
    Fault { what: "the last invocation of each work group finds no place of its own",
        file: "builder/group_prefix.glsl", from: "before += s < gl_SubgroupID", to: "before += s + 1 < gl_SubgroupID",
        kernels: &["trace_room_group"], noticed_by: &[(Photons(Builder::Group), OtherPhotons), (BUILDERS, BuildersDisagree)] },
    Fault { what: "survivors of one work group are not counted",
        file: "builder/scan.glsl", from: "= prefix.total;", to: "= work_group_index() == 3u ? 0u : prefix.total;",
        kernels: &["trace_room_scan"], noticed_by: &[(Photons(Builder::Scan), PhotonsLost), (Ledger(Builder::Scan), LedgerOpen)] },
    Fault { what: "an invocation that took a photon starts it at the bounce at which the last one ended",
        file: "builder/persistent.glsl", from: "            bounce = first_bounce();\n", to: "",
        kernels: &["trace_persistent_room"], noticed_by: &[(Photons(Builder::Persistent), PhotonsLost)] },
    Fault { what: "a photon's last bounce is not counted",
        file: "builder/persistent.glsl", from: "if (under_way) {\n            count_fate(",
        to: "if (under_way && !taken.escaped) {\n            count_fate(",
        kernels: &["trace_persistent_room"], noticed_by: &[(Ledger(Builder::Persistent), LedgerOpen)] },
    Fault { what: "a survivor's path is forgotten",
        file: "builder/naive.glsl", from: "store_path(index, path);", to: "if (index % 10u != 7u) store_path(index, path);",
        kernels: &["trace_room_naive"], noticed_by: &[(Ledger(Builder::Naive), LedgerOpen), (Photons(Builder::Naive), OtherPhotons)] },
    Fault { what: "a photon is gathered twice",
        file: "gather/grid.glsl", from: "gather_photon(gathered, photon);",
        to: "gather_photon(gathered, photon);\n if (i == 100u) gather_photon(gathered, photon);",
        kernels: GRID_GATHERS, noticed_by: &[(RoomFilm(Gather::Grid), SumsTooLarge)] },
    Fault { what: "a photon in fifty is stored twice",
        file: "builder/compact.glsl", from: "            store_photon(photon_place, taken[k].photon);",
        to: "            store_photon(photon_place, taken[k].photon);\n\
            if (path[k].photon % 50u == 0u) store_photon(atomicAdd(counters[0], 1), taken[k].photon);",
        kernels: &["trace_scene_atomic"], noticed_by: &[(APPENDS, SumsTooLarge)] },
    Fault { what: "a photon that flies to its end begins with its second bounce's random numbers",
        file: "builder/persistent.glsl", from: "bounce = first_bounce();", to: "bounce = first_bounce() + 1;",
        kernels: &["trace_persistent_scene"], noticed_by: &[(APPENDS, OtherSums)] },
    Fault { what: "a slot of a scene in which nothing landed is taken for a photon",
        file: "kernels/map_count.comp", from: "!HAS_SLOTS || place.w != NONE", to: "true",
        kernels: &["map_count"], noticed_by: &[(APPENDS, OtherSums)] },
    Fault { what: "a scene's photon of a later bounce takes the slot of an earlier one",
        file: "world/scene/bounce.glsl", from: "push.list * photon_count + index", to: "(push.list % 2u) * photon_count + index",
        kernels: &["trace_scene_naive"], noticed_by: &[(APPENDS, OtherSums)] },
    Fault { what: "a scene's photons in order overwrite those of the bounce before",
        file: "builder/scan.glsl", from: "survivors[group_count()] = counters[0];", to: "survivors[group_count()] = 0;",
        kernels: &["trace_scene_scan"], noticed_by: &[(APPENDS, SumsTooSmall)] },
    Fault { what: "a point that others help keeps its first slice twice",
        file: "gather/visible_points.glsl", from: "slice_begin = slice * GATHER_SLICE", to: "slice_begin = gl_WorkGroupID.y * GATHER_SLICE",
        kernels: LOOKUPS, noticed_by: &[(DENSE_POINTS, OtherSums)] },
    Fault { what: "the last slice of dense points is left out",
        file: "kernels/dense_points_size.comp", from: "min(slice_count - 1, push.max_groups)", to: "min(slice_count - 2, push.max_groups)",
        kernels: &["dense_points_size"], noticed_by: &[(DENSE_POINTS, SumsTooSmall)] },
    Fault { what: "survivors in order overwrite those of the bounce before",
        file: "builder/scan_move.glsl", from: "photon_place = counters[0] + path_place;", to: "photon_place = path_place;",
        kernels: &["scan_move_room"], noticed_by: &[(Photons(Builder::Scan), OtherPhotons)] },
    Fault { what: "stored photons forget which of two walls that face each other is theirs",
        file: "world/room/photon.glsl", from: " | photon.wall << 31", to: "",
        kernels: &["trace_room_atomic"], noticed_by: &[(Photons(Builder::Atomic), OtherPhotons)] },
    Fault { what: "points look for photons in the first layer of cells, whatever their wall",
        file: "gather/grid_rows.glsl", from: "box.first[axis] = layer;\n    box.last[axis] = layer;",
        to: "box.first[axis] = 0u;\n    box.last[axis] = 0u;",
        kernels: GRID_GATHERS, noticed_by: &[(RoomFilm(Gather::Grid), SumsTooSmall)] },
    Fault { what: "two photons share a place in their cell",
        file: "kernels/cell_count.comp", from: "push.cell_count)], 1)", to: "push.cell_count)], 1) & 0xfffffffeu",
        kernels: &["cell_count"], noticed_by: &[(RoomFilm(Gather::Grid), OtherSums)] },
    Fault { what: "the radius is 1 % too large over the grid",
        file: "gather/estimate.glsl", from: "<= push.radius_squared", to: "<= 1.0201 * push.radius_squared",
        kernels: GRID_GATHERS, noticed_by: &[(RoomFilm(Gather::Grid), SumsTooLarge)] },
    Fault { what: "the radius is 1 % too small by brute force",
        file: "gather/estimate.glsl", from: "<= push.radius_squared", to: "<= 0.9801 * push.radius_squared",
        kernels: &["gather_brute_u64", "gather_brute_two_words"], noticed_by: &[(RoomFilm(Gather::Brute), SumsTooSmall)] },
    Fault { what: "the radius of a lookup is 1 % too small",
        file: "gather/visible_points.glsl", from: "<= radius * radius", to: "<= 0.9801 * radius * radius",
        kernels: LOOKUPS, noticed_by: &[(ClosedForm("furnace, Photons, Ballot: irradiance"), TooDark)] },
    Fault { what: "shadow rays count the cosine twice",
        file: "world/scene/direct.glsl", from: "(cosine * lobe_weight", to: "(cosine * cosine * lobe_weight",
        kernels: &["receive", "camera_paths"], noticed_by: &[(ClosedForm("point light, 0.5 m off axis: irradiance"), TooDark),
                      (ClosedForm("point light: radiance of the plane"), TooDark)] },
    Fault { what: "reflected directions have the cosine thrice",
        file: "rng/sampling.glsl", from: "(sqrt(u), 1.0 - u, azimuth)", to: "(sqrt(sqrt(u)), 1.0 - sqrt(u), azimuth)",
        kernels: &["trace_persistent_scene", "trace_room_ballot", "emit_scene", "trace_scene_ballot"],
        noticed_by: &[(ClosedForm("open box, ballot builder, uniform lights: hits stored per photon"), TooDark),
                      (ClosedForm("disc light, photons: irradiance"), TooBright)] },
    Fault { what: "the probability of a light is taken for twice its value",
        file: "world/scene/lights.glsl", from: "(light.strength, light.probability)", to: "(light.strength, 2.0 * light.probability)",
        kernels: &["receive"], noticed_by: &[(ClosedForm("disc light: irradiance"), TooDark)] },
    Fault { what: "photons are sorted into the cell beside theirs",
        file: "kernels/map_scatter.comp", from: "bucket_of(cell_at(uintBitsToFloat(map[2 * index].xyz), push), push)",
        to: "((bucket_of(cell_at(uintBitsToFloat(map[2 * index].xyz), push), push) + uint(index % 3u == 0u)) & push.bucket_mask)",
        kernels: &["map_scatter"], noticed_by: &[(ClosedForm("furnace, Photons, Ballot: irradiance"), TooDark)] },
    Fault { what: "one photon in sixteen is sorted into the cell beside its own",
        file: "kernels/cell_scatter.comp", from: "cell_number(cell, push.cell_count)",
        to: "(cell_number(cell, push.cell_count) ^ uint(index % 16 == 11))",
        kernels: &["cell_scatter"], noticed_by: &[(RoomFilm(Gather::Grid), OtherSums)] },
    Fault { what: "nodes of the kd-tree are taken to be split along the wrong axis",
        file: "index/tree.glsl", from: "(wall / 2 + 1 + (height & 1)) % 3", to: "(wall / 2 + 1 + (height >> 1 & 1)) % 3",
        kernels: &["gather_tree_u64", "gather_tree_two_words", "nearest_u64", "nearest_two_words"],
        noticed_by: &[(RoomFilm(Gather::KdTree), SumsTooSmall), (NEAREST, OtherSums)] },
    Fault { what: "one photon goes to the wrong half of its node",
        file: "kernels/tree_sides.comp", from: "tree_ranks[keys[place].y] < node_at(place).middle",
        to: "(tree_ranks[keys[place].y] < node_at(place).middle) != (push.height == 3u && place == 100u)",
        kernels: &["tree_sides"], noticed_by: &[(RoomFilm(Gather::KdTree), OtherSums)] },
    Fault { what: "the sort along an axis leaves out a digit",
        file: "index/tree_digits.glsl", from: "(key.x >> (4 * push.digit))", to: "push.digit == 6u ? 0 : (key.x >> (4 * push.digit))",
        kernels: &["tree_count", "tree_order"], noticed_by: &[(RoomFilm(Gather::KdTree), SumsTooSmall), (NEAREST, OtherSums)] },
    Fault { what: "the farthest of the nearest photons counts",
        file: "gather/nearest.glsl", from: "is_full ? 1 : 0", to: "0",
        kernels: NEAREST_GATHERS, noticed_by: &[(NEAREST, SumsTooLarge)] },
    Fault { what: "the disc of the nearest photons reaches over the edge",
        file: "gather/nearest.glsl", from: "covered_disc(point.position, point.wall, sqrt(farthest), rooms[0])", to: "3.14159265",
        kernels: NEAREST_GATHERS, noticed_by: &[(NEAREST, SumsTooSmall)] },
    Fault { what: "sums are kept in f32",
        file: "film/film.glsl", from: "uaddCarry(sum.x, amount, carry);", to: "uint(float(sum.x) + float(amount)); carry = 0;",
        kernels: GRID_GATHERS, noticed_by: &[(RoomFilm(Gather::Grid), OtherSums)] },
    Fault { what: "edges are not corrected",
        file: "kernels/flux_to_radiance.comp", from: "if (HAS_EDGE_CORRECTION) {", to: "if (false) {",
        kernels: &["flux_to_radiance"], noticed_by: &[(ClosedForm("furnace, Photons, Ballot: irradiance"), TooDark),
                      (ClosedForm("sun-over-plane, Photons: irradiance"), TooDark)] },
    Fault { what: "rays start a fixed length off their surface",
        file: "world/scene/bvh.glsl", from: "position + way", to: "position + 1e-3 * normal * (dot(direction, normal) < 0.0 ? -1.0 : 1.0)",
        kernels: &["trace_persistent_scene", "emit_scene", "trace_scene_ballot", "trace_scene_atomic", "receive", "camera_paths"],
        noticed_by: &[(Of(Scenes, Short, "a lamp in a box, by photons", |gpu| known::lamp_in_a_box(gpu, Illumination::Photons)), Leak)] },
    Fault { what: "glass reflects one and a half times as much",
        file: "material/lobes/glass.glsl", from: "? fresnel(cos_i, cos_t, eta)", to: "? min(1.5 * fresnel(cos_i, cos_t, eta), 1.0)",
        kernels: &["camera_paths"], noticed_by: &[(ClosedForm("glass slab, at 60 degrees: radiance"), TooDark)] },
    Fault { what: "strict quotients are cut instead of rounded",
        file: "math/math.glsl", from: "quotient += uint(off) + uint(2 * remainder > d);", to: "quotient += uint(off);",
        kernels: &["check_math"], noticed_by: &[(STRICT_MATH, Misrounded)] },
    Fault { what: "a light in 50 emits no number",
        file: "world/scene/lights.glsl", from: "    return arriving;",
        to: "    if (u.y < 0.02) arriving.radiance.x = uintBitsToFloat(0x7fc00000u);\n    return arriving;",
        kernels: &["camera_paths"], noticed_by: &[(FINITE, NoNumber)] },
    Fault { what: "a photon in 500 starts nowhere",
        file: "world/scene/step.glsl", from: "surface.ng, scatter.direction);",
        to: "surface.ng, scatter.direction);\n            if (u.z < 0.002) start.y = uintBitsToFloat(0x7fc00000u);",
        kernels: SCENE_TRACERS, noticed_by: &[(FINITE, NoNumber)] },
    Fault { what: "a photon in 500 carries no number into the map",
        file: "builder/compact.glsl", from: "store_photon(photon_place, taken[k].photon);",
        to: "if (path[k].photon % 500u == 7u) taken[k].photon.flux.y = uintBitsToFloat(0x7fc00000u);\n\
            store_photon(photon_place, taken[k].photon);",
        kernels: &["trace_scene_ballot"], noticed_by: &[(FINITE, NoNumber)] },
    Fault { what: "a path from the eye goes on nowhere",
        file: "world/scene/camera_path.glsl", from: "chain.direction = scatter.direction;",
        to: "chain.direction = scatter.direction;\n        if (own.pixel % 5u == 0u) chain.direction.z = uintBitsToFloat(0x7fc00000u);",
        kernels: &["camera_paths"], noticed_by: &[(FINITE, NoNumber)] },
    Fault { what: "a path from the eye goes on from nowhere",
        file: "world/scene/camera_path.glsl", from: "chain.direction = scatter.direction;",
        to: "chain.direction = scatter.direction;\n        if (own.pixel % 5u == 0u) chain.position.z = uintBitsToFloat(0x7fc00000u);",
        kernels: &["camera_paths"], noticed_by: &[(FINITE, NoNumber)] },
    Fault { what: "a reflected direction of the paper's box is no number",
        file: "world/room/step.glsl", from: "path.wall = hit.wall;",
        to: "path.wall = hit.wall;\n        if (u.x < 0.002) path.direction.y = uintBitsToFloat(0x7fc00000u);",
        kernels: &["trace_room_atomic"],
        noticed_by: &[(Of(Room, Short, "finite numbers in the paper's box", |gpu| box_is_finite(gpu, &strict())), NoNumber)] },
    Fault { what: "rays do not start one float further than their surface's error",
        file: "world/scene/bvh.glsl", from: "return mix(intBitsToFloat(bits + away), start, equal(start, vec3(0.0)));", to: "return start;",
        // The error alone is 16 times what the rounding of the start may take from it: no answer is wrong for it.
        kernels: &["trace_persistent_scene", "emit_scene", "trace_scene_ballot", "camera_paths"], noticed_by: &[(BITS, OtherBits)] },
    Fault { what: "rays meet what they leave, where its height is lost in rounding",
        file: "world/scene/bvh.glsl", from: "height * height > 0.0625 * error * error * dot(normal, normal) && ", to: "",
        kernels: SCENE_TRACERS, noticed_by: &[(Of(Scenes, Short, "a patch in a plane", known::patch_in_a_plane), PhotonsAdded)] },
    Fault { what: "of triangles equally near, the first that is tested is met",
        file: "world/scene/bvh.glsl", from: "t < hit.t || (t == hit.t && index < hit.triangle)", to: "t < hit.t",
        kernels: &["camera_paths"], noticed_by: &[(Of(Scenes, Long, "triangles of one corner", known::triangles_of_one_corner), OtherSums)] },
    Fault { what: "rays of a far eye start at the eye",
        file: "kernels/camera_paths.comp", from: "if (distance_to_middle > FAR_EYE) {", to: "if (false) {",
        kernels: &["camera_paths"], noticed_by: &[(Of(Scenes, Short, "a stack from afar", known::stack_from_afar), TooDark)] },
    Fault { what: "shadow rays end 0.5 % before their lamp",
        file: "world/scene/direct.glsl", from: "arriving.wi : arriving.target - start;", to: "arriving.wi : 0.995 * (arriving.target - start);",
        kernels: &["receive"], noticed_by: &[(Of(Scenes, Long, "a lamp in a box", |gpu| known::lamp_in_a_box(gpu, Illumination::Split)), Leak)] },
    Fault { what: "what lies a sixteenth of the radius below belongs to an estimate",
        file: "gather/belongs.glsl", from: "+ HEIGHT_ERROR;", to: "+ radius * (1.0 / 16.0);",
        kernels: LOOKUPS, noticed_by: &[(Of(Scenes, Short, "a shelf", known::shelf), Leak)] },
    Fault { what: "normals 78 degrees apart belong together",
        file: "gather/belongs.glsl", from: "MIN_NORMAL_COSINE = 0.75", to: "MIN_NORMAL_COSINE = 0.2",
        kernels: &["gather_visible_points_u64", "gather_visible_points_two_words", "flux_to_radiance"],
        noticed_by: &[(Of(Scenes, Short, "a ridge", known::ridge), TooDark)] },
    Fault { what: "a photon's weight knows no shading normal",
        file: "material/scatter.glsl", from: SHADING_GAIN, to: "return 1.0;",
        kernels: LOOKUPS, noticed_by: &[(LEANING_PLANE, TooBright)] },
    Fault { what: "a scattered photon knows no shading normal",
        file: "material/scatter.glsl", from: SHADING_GAIN, to: "return 1.0;",
        kernels: SCENE_TRACERS, noticed_by: &[(Of(Scenes, Short, "a leaning scatterer", known::leaning_scatterer), TooBright)] },
    Fault { what: "rays that smooth normals send to the wrong side of a triangle are lost",
        file: "material/scatter.glsl", from: "return direction - 2.0 * min(dot(direction, side), 0.0) * side;", to: "return direction;",
        kernels: &["camera_paths"],
        noticed_by: &[(Of(Scenes, Long, "a coarse mirror", |gpu| known::coarse_sphere_in_a_furnace(gpu, mirror(1.0), 8)), TooDark), (COARSE_GLASS, TooDark)] },
    Fault { what: "all points have the widest radius",
        file: "gather/radius_class.glsl", from: "uintBitsToFloat((127u - own_class) << 23)", to: "1.0",
        kernels: &["disc_cuts", "gather_visible_points_u64", "gather_visible_points_two_words", "flux_to_radiance"],
        noticed_by: &[(Of(Scenes, Short, "a room beside a hall", known::room_beside_a_hall), TooBright)] },
    Fault { what: "photons behind a wall count before it",
        file: "gather/cuts.glsl", from: "return beyond;", to: "return false;",
        kernels: LOOKUPS,
        noticed_by: &[(Of(Scenes, Short, "a floor behind a wall", known::behind_a_wall), Leak)] },
    Fault { what: "the floor behind a wall is taken for floor before it",
        file: "gather/cover.glsl", from: "if (line.w < cuts.reach) {", to: "if (false) {",
        kernels: &["flux_to_radiance"],
        noticed_by: &[(Of(Scenes, Short, "a floor beside a box", known::beside_a_box), TooDark)] },
    Fault { what: "what keeps no photons counts as area that they lie on",
        file: "gather/cover.glsl", from: "|| !keeps_photons(triangle.material)", to: "",
        kernels: &["flux_to_radiance"],
        noticed_by: &[(Of(Scenes, Neither, "a floor beside a mirror", |gpu| floor_beside(gpu, "mirror", mirror(1.0))), TooDark)] },
    Fault { what: "smooth normals alone reflect totally in glass for ever",
        file: "material/lobes/glass.glsl", from: "&& depth >= SMOOTH_TOTAL_REFLECTIONS", to: "&& false",
        kernels: &["camera_paths", "go_on"], noticed_by: &[(COARSE_GLASS, TooDark)] },
    Fault { what: "a ray to the sky weighs as if half as many were aimed at openings",
        file: "world/scene/openings.glsl", from: "density += divide(share * cones,", to: "density += divide(0.5 * share * cones,",
        kernels: &["receive"], noticed_by: &[(WINDOW, TooBright)] },
    Fault { what: "photons aimed at openings carry as much as any",
        file: "world/scene/openings.glsl", from: "emission.flux *= divide(1.0, 1.0 - OPENING_SHARE + divide(OPENING_SHARE * discs * whole, sum));", to: "",
        kernels: SCENE_EMITTERS, noticed_by: &[(WINDOW, TooBright)] },
    Fault { what: "rays to a picture of the sky weigh by the table alone",
        file: "world/scene/sky.glsl", from: "found.density = (1.0 - by_table) * cosine_density(ns, found.wi) + by_table * found.density;", to: "",
        kernels: &["receive"], noticed_by: &[(Of(Scenes, Short, "a sky from all sides", skies::facing_all_ways), TooDark)] },
    Fault { what: "photons of a picture of the sky come from where it is not bright",
        file: "world/scene/sky.glsl", from: "turns < 0.5 ? turns + 0.5 : turns - 0.5", to: "turns",
        kernels: SCENE_EMITTERS, noticed_by: &[(Of(Scenes, Long, "photons of a sky", skies::photons_and_rays), TooDark)] },
    Fault { what: "a spot falls off by its share, not by the square of it",
        file: "world/scene/lights.glsl", from: "return share * share;", to: "return share;",
        kernels: &["receive"], noticed_by: &[(Of(Scenes, Short, "a spot", known::spot), TooBright)] },
    Fault { what: "a mirrored texture is a texel off",
        file: "material/textures.glsl", from: "period - 1 - folded", to: "period - folded",
        kernels: &["camera_paths"],
        noticed_by: &[(Of(Scenes, Short, "a texture mirrored along u", |gpu| known::wrapped_texture(gpu, [Wrap::MirroredRepeat, Wrap::Repeat], false)), WrongTexel),
                      (Of(Scenes, Short, "a texture mirrored along v", |gpu| known::wrapped_texture(gpu, [Wrap::Clamp, Wrap::MirroredRepeat], false)), WrongTexel)] },
    Fault { what: "a shading normal is kept where it is seen from below",
        file: "material/surface.glsl", from: "dot(smooth_normal, wo) > 0.0 ? smooth_normal : surface.ng", to: "smooth_normal",
        kernels: &["camera_paths"], noticed_by: &[(LEANING_PLANE, TooDark)] },
    Fault { what: "large integers are cut instead of rounded",
        file: "check/check_math.comp", from: "float(floatBitsToUint(a))", to: "float(floatBitsToUint(a) & ~0xffu)",
        kernels: &["check_math"], noticed_by: &[(STRICT_MATH, Misrounded)] },
    Fault { what: "a light of a cluster is weighed as if its cluster had no other",
        file: "world/scene/light_choice.glsl", from: "chosen.probability *= is_left ? share : 1.0 - share;", to: "",
        kernels: &["receive"], noticed_by: &[(MANY_LAMPS, TooDark)] },
    Fault { what: "a cluster's share is taken with those before it",
        file: "world/scene/light_choice.glsl", from: "light_shares[row + low] - before", to: "light_shares[row + low]",
        kernels: &["receive"], noticed_by: &[(MANY_LAMPS, TooDark)] },
    Fault { what: "one of two lights is as likely from afar as from near by",
        file: "world/scene/light_choice.glsl", from: "vec3 way = node.centre - position;", to: "vec3 way = node.centre - vec3(0.3);",
        kernels: &["receive"], noticed_by: &[(Of(Lamps, Neither, "a hundred thousand lamps", |gpu| lamps::many_lamps(gpu, 224, true)), TooNoisy)] },
    Fault { what: "rays to lights that the trial has not seen count once, though one place in four casts them",
        file: "world/scene/direct.glsl", from: "count = float(SAMPLES_PER_UNSEEN * work.shadow_rays);", to: "count = float(work.shadow_rays);",
        kernels: &["receive"], noticed_by: &[(Of(Lamps, Long, "a missed lamp", lamps::missed_lamp), TooDark)] },
    Fault { what: "shadow rays to a part of a textured lamp go to all of it",
        file: "world/scene/lights.glsl", from: "return light.position.xy + light.position.z * at;", to: "return at;",
        kernels: &["receive"],
        noticed_by: &[(Of(Lamps, Neither, "a bright spot", |gpu| lamps::bright_spot(gpu, Wrap::Repeat, Illumination::Split)), TooDark)] },
    Fault { what: "a trial sees lights through walls",
        file: "kernels/try_lights.comp", from: "&& !shadow_ray.is_hidden && added > 0.0", to: "&& added > 0.0",
        kernels: &["try_lights"], noticed_by: &[(Of(Lamps, Neither, "a dim room", |gpu| lamps::dim_room(gpu, 1e3, true)), TooNoisy)] },
    Fault { what: "rays of a trial are taken to meet nothing",
        file: "kernels/trial_rays.comp", from: "position, normal, uint(escapes));", to: "position, normal, 1);",
        kernels: &["trial_rays"], noticed_by: &[(Of(Lamps, Neither, "a hidden lamp", |gpu| lamps::hidden_lamp(gpu, 1e4, true)), TooDark)] },
    Fault { what: "a surface that is tiny beside the radius is taken for a larger one",
        file: "kernels/flux_to_radiance.comp", from: "areas * (1.0 / 262144.0)", to: "areas * (1.0 / 4096.0)",
        kernels: &["flux_to_radiance"], noticed_by: &[(Of(Scenes, Short, "tiny plates", known::tiny_plates), TooDark)] },
    Fault { what: "a triangle has the vertex colour of its first corner",
        file: "material/surface.glsl", from: "at.a + hit.u * (at.b - at.a) + hit.v * (at.c - at.a);", to: "at.a;",
        kernels: &["camera_paths"], noticed_by: &[(Of(Scenes, Short, "colours of vertices", known::vertex_colours), WrongTexel)] },
    Fault { what: "where no known opening shows the sun, the sky's table is not asked",
        file: "world/scene/openings.glsl", from: "const float LEAST_BY_TABLE = 0.25;", to: "const float LEAST_BY_TABLE = 0.0;",
        kernels: &["receive"], noticed_by: &[(Of(Lamps, Short, "a skylight", openings::sun_through_a_small_window), TooDark)] },
    Fault { what: "what stands before hidden lamps is forgotten",
        file: "world/scene/direct.glsl", from: "stopped_unseen_light = is_unseen ? max(stopped_unseen_light, stopped) : stopped_unseen_light;", to: "",
        kernels: &["receive"], noticed_by: &[(Of(Lamps, Short, "a lamp behind a hole", unseen_light::hidden_lamp), TooDark)] },
    Fault { what: "dim photons count as bright ones",
        file: "kernels/flux_to_radiance.comp", from: "* float(DIM_PHOTONS) >= 1.0", to: "* float(DIM_PHOTONS) >= 0.0",
        kernels: &["flux_to_radiance"], noticed_by: &[(Of(Lamps, Long, "dim photons", unseen_light::dim_photons), TooDark)] },
    Fault { what: "directions within two cones are weighed as if only one could have chosen them",
        file: "world/scene/aim.glsl", from: " || versine_between(emission.direction, other.axis) <= other.versine", to: "",
        kernels: SCENE_EMITTERS, noticed_by: &[(AimedLight("overlapping cones"), TooBright)] },
    Fault { what: "places on two discs are weighed as if only one could have chosen them",
        file: "world/scene/aim.glsl", from: "k == chosen || dot(off, off) <= radius * radius", to: "k == chosen",
        kernels: SCENE_EMITTERS, noticed_by: &[(AimedLight("overlapping discs"), TooBright)] },
    Fault { what: "aimed photons forget the cosine of their lamp",
        file: "world/scene/aim.glsl", from: "max(cosine, 0.0) * 0.31830988618379067", to: "cosine > 0.0 ? 0.31830988618379067 : 0.0",
        kernels: SCENE_EMITTERS, noticed_by: &[(AimedLight("cosine disc"), TooBright), (AimedLight("two-sided triangles"), TooBright)] },
    Fault { what: "facets are as dense as if alpha were its square root",
        file: "material/ggx.glsl", from: "float squared = alpha * alpha;", to: "float squared = alpha;",
        kernels: &["camera_paths"], noticed_by: &[(BARE_PLATES, TooBright)] },
    Fault { what: "facets that hide from the eye and from the light are taken for others",
        file: "material/ggx.glsl",
        from: "divide(0.5, cos_l * ggx_root(alpha, cos_v) + cos_v * ggx_root(alpha, cos_l))",
        to: "divide(1.0, (cos_l + ggx_root(alpha, cos_l)) * (cos_v + ggx_root(alpha, cos_v)))",
        kernels: &["camera_paths"], noticed_by: &[(BARE_PLATES, TooDark)] },
    Fault { what: "the diffuse lobe forgets what reflection takes from it on the way out",
        file: "material/bsdf.glsl",
        from: "(0.31830988618379067 * divide(below_diffuse, max(left, 1e-6)))",
        to: "0.31830988618379067",
        kernels: &["camera_paths"], noticed_by: &[(BARE_PLATES, TooDark)] },
    Fault { what: "metals that keep the diffuse lobe",
        file: "material/lobes/reflection.glsl", from: "= dielectric * (1.0 - layers.transmission)", to: "= 1.0 - layers.transmission",
        kernels: &["camera_paths"], noticed_by: &[(BARE_PLATES, TooBright)] },
    Fault { what: "all dielectrics reflect as one of index 1.5",
        file: "material/lobes/reflection.glsl", from: "along * along * layers.specular_colour", to: "0.04 * layers.specular_colour",
        kernels: &["camera_paths"], noticed_by: &[(BARE_PLATES, TooBright)] },
    Fault { what: "a coat takes nothing from what lies below it",
        file: "material/layering.glsl", from: "below = 1.0 - max(cover.coat_albedo, towards_light.coat);", to: "below = 1.0;",
        kernels: &["camera_paths"], noticed_by: &[(COVERED_PLATES, TooBright)] },
    Fault { what: "the fibres of sheen are spread by the square of their sine",
        file: "material/lobes/sheen.glsl", from: "divide(0.5, alpha)", to: "divide(1.0, alpha)",
        kernels: &["camera_paths"], noticed_by: &[(COVERED_PLATES, TooDark)] },
    Fault { what: "thin walls turn what they transmit by half a circle instead of mirroring it",
        file: "material/lobes/transmission.glsl", from: "wi - 2.0 * dot(wi, surface.ns) * surface.ns);", to: "-wi);",
        kernels: &["camera_paths"], noticed_by: &[(TRANSMISSIVE_PLATES, TooBright)] },
    Fault { what: "thin walls and solids transmit what they reflect",
        file: "material/lobes/transmission.glsl",
        from: "return lobes.transmitted * (1.0 - exact);", to: "return lobes.transmitted;",
        kernels: &["camera_paths"], noticed_by: &[(TRANSMISSIVE_PLATES, TooBright)] },
    Fault { what: "refraction does not compress radiance",
        file: "material/lobes/transmission.glsl", from: "float value = eta * eta * both", to: "float value = both",
        kernels: &["camera_paths"], noticed_by: &[(TRANSMISSIVE_PLATES, TooBright)] },
    Fault { what: "the jacobian of refraction has the wrong sign",
        file: "material/lobes/transmission.glsl", from: "float spread = eta * v_h - l_h;", to: "float spread = eta * v_h + l_h;",
        kernels: &["camera_paths"], noticed_by: &[(TRANSMISSIVE_PLATES, TooDark)] },
    Fault { what: "solids reflect by the approximation instead of Fresnel's equations",
        file: "material/lobes/reflection.glsl",
        from: "        share = clamp(divide(reflectance_at(cosine, base.eta) - along, 1.0 - along), 0.0, 1.0);\n",
        to: "",
        kernels: &["camera_paths"],
        noticed_by: &[(Of(Layers, Short, "solids from inside", |gpu| layered::lobes_in_the_sun(gpu, &layered::rough_solids(), true)), TooDark)] },
    Fault { what: "normals of facets are sampled from a view that is not stretched",
        file: "material/ggx.glsl", from: "vec3 stretched = normalize(vec3(alpha * v.xy, v.z));", to: "vec3 stretched = v;",
        kernels: &["camera_paths"], noticed_by: &[(METALS, TooDark)] },
    Fault { what: "light samples count in full beside paths that meet the same light",
        file: "material/scatter.glsl",
        from: "return light_density > 0.0 ? divide(light_density, light_density + lobe_density) : 1.0;",
        to: "return 1.0;",
        kernels: &["camera_paths"], noticed_by: &[(METALS, TooBright)] },
    Fault { what: "light samples of rough lobes count in full beside rays of these lobes",
        file: "material/bsdf.glsl", from: "        if (asks_rough) {", to: "        if (false) {",
        kernels: &["camera_paths"], noticed_by: &[(METALS, TooBright)] },
    Fault { what: "paths that meet a light take several shadow rays for one",
        file: "world/scene/camera_path.glsl", from: "+ float(work.shadow_rays) * light_density", to: "+ light_density",
        kernels: &["camera_paths"], noticed_by: &[(METALS, TooBright)] },
    Fault { what: "paths that meet a lamp are weighed as if it were the only one",
        file: "world/scene/lights.glsl", from: "return light.probability * lamp_density(", to: "return lamp_density(",
        kernels: &["camera_paths"], noticed_by: &[(HALF_A_DOME, TooDark)] },
    Fault { what: "who leaves a solid leaves those around it",
        file: "material/media.glsl", from: "return (media & below) | above;", to: "return media & below;",
        kernels: &["camera_paths"], noticed_by: &[(Of(Layers, Short, "nested slabs", media::nested_slabs), TooBright)] },
    Fault { what: "who leaves a solid leaves the one entered last",
        file: "material/media.glsl", from: "if (((media >> place) & MEDIUM_MASK) == medium) {", to: "if (((media >> place) & MEDIUM_MASK) != 0) {",
        kernels: &["camera_paths"], noticed_by: &[(OVERLAPPING_SLABS, TooBright)] },
    Fault { what: "of solids partly in one another the one entered last counts",
        file: "material/media.glsl", from: "if (HAS_MEDIA_BY_SIZE) {", to: "if (false) {",
        kernels: &["camera_paths"], noticed_by: &[(OVERLAPPING_SLABS, TooDark)] },
    Fault { what: "mirrored normal maps are not mirrored",
        file: "material/surface.glsl", from: "at.is_turned ? cross(tangent, normal) : cross(normal, tangent)", to: "cross(normal, tangent)",
        kernels: &["camera_paths"], noticed_by: &[(Of(Layers, Short, "normal maps", layered::normal_maps_in_the_sun), TooBright)] },
    Fault { what: "textures are looked up by the first set of coordinates alone",
        file: "material/surface.glsl", from: "vec2 uv = lookup.uv_set == 0 ? first : second;", to: "vec2 uv = first;",
        kernels: &["camera_paths"], noticed_by: &[(LAYER_TEXTURES, TooDark)] },
    Fault { what: "rows of a texture's transform are swapped",
        file: "material/surface.glsl", from: "(lookup.row_u, uv), dot(lookup.row_v, uv)", to: "(lookup.row_v, uv), dot(lookup.row_u, uv)",
        kernels: &["camera_paths"], noticed_by: &[(LAYER_TEXTURES, TooBright)] },
    Fault { what: "unlit surfaces are towards_light",
        file: "material/bsdf.glsl",
        from: " && !layers.is_unlit;\n    lobes.base.film.is_rough = uint(is_in_map);\n    \
            lobes.rough.f0 = is_in_map ? lobes.base.f0 : vec3(0.0);\n    lobes.rough.f90 = is_in_map ? lobes.base.f90 : 0.0;\n    \
            if (layers.is_unlit) {\n",
        to: ";\n    lobes.base.film.is_rough = uint(is_in_map);\n    \
            lobes.rough.f0 = is_in_map ? lobes.base.f0 : vec3(0.0);\n    lobes.rough.f90 = is_in_map ? lobes.base.f90 : 0.0;\n    \
            if (false) {\n",
        kernels: &["camera_paths"], noticed_by: &[(LAYER_TEXTURES, TooBright)] },
    Fault { what: "panes pass light in the gaps of alpha, too",
        file: "material/bsdf.glsl", from: "passing += layers.coverage * below", to: "passing += below",
        kernels: &["camera_paths"], noticed_by: &[(FLOOR_THROUGH_SHEETS, TooBright)] },
    Fault { what: "paths that do not pass weigh as if none did",
        file: "world/scene/camera_path.glsl",
        from: "        chain.weight *= divide(vertex.surface.layers.coverage, 1.0 - vertex.lobes.pass_chance);\n",
        to: "",
        kernels: &["camera_paths"], noticed_by: &[(Of(Layers, Neither, "clear balls", |gpu| layered::clear_furnace(gpu, true)), TooDark)] },
    Fault { what: "of several sheets shadow rays count the last one",
        file: "world/scene/direct.glsl", from: "share *= passing_at(hit, wo, media);", to: "share = passing_at(hit, wo, media);",
        kernels: &["receive"], noticed_by: &[(LAMP_BETWEEN_SHEETS, TooBright)] },
    Fault { what: "alpha at the cutoff is a hole",
        file: "material/surface.glsl", from: "(alpha >= layered.cutoff ? 1.0 : 0.0)", to: "(alpha > layered.cutoff ? 1.0 : 0.0)",
        kernels: &["camera_paths"], noticed_by: &[(FLOOR_THROUGH_SHEETS, TooBright)] },
    Fault { what: "rough refraction has the density of its facets",
        file: "material/lobes/transmission.glsl", from: "facet.density *= facet.along * divide(l_h, max(spread * spread, 1e-12));", to: "",
        kernels: &["camera_paths"], noticed_by: &[(HALF_A_DOME, TooDark)] },
    Fault { what: "photons on a coated plate are weighed as if it were bare",
        file: "gather/visible_points.glsl", from: "(lobes.alpha, cover, cosine", to: "(lobes.alpha, no_cover(), cosine",
        kernels: LOOKUPS, noticed_by: &[(Of(Layers, Long, "photons on a plate", layered::photons_on_a_plate), TooBright)] },
    Fault { what: "refraction does not compress the radiance of paths",
        file: "material/bsdf.glsl",
        from: "scatter.weight *= carries_radiance && is_beyond && layers.is_solid ? lobes.base.eta * lobes.base.eta : 1.0;", to: "",
        kernels: &["camera_paths"], noticed_by: &[(EYE_IN_GLASS, TooDark)] },
    Fault { what: "media absorb no photons",
        file: "world/scene/step.glsl", from: "arriving *= transmittance(path.media, hit.t);", to: "",
        kernels: SCENE_TRACERS, noticed_by: &[(Of(Layers, Long, "photons through a slab", media::photons_through_a_slab), TooBright)] },
    Fault { what: "red has the index of blue",
        file: "material/media.glsl", from: "(float(channel) - 1.0) * spread", to: "(1.0 - float(channel)) * spread",
        kernels: &["camera_paths"], noticed_by: &[(Of(Layers, Short, "a prism", |gpu| dispersion::prism_check(gpu, 1.0)), TooDark)] },
    Fault { what: "the channel that a path keeps stands for itself alone",
        file: "material/media.glsl", from: "kept[channel] = count * light[channel];", to: "kept[channel] = light[channel];",
        kernels: SCENE_TRACERS, noticed_by: &[(Of(Layers, Long, "photons through a prism", dispersion::prism_photons), TooDark)] },
    Fault { what: "diffuse transmission weighs as if no other lobe had a chance",
        file: "material/bsdf.glsl", from: "divide(3.14159265358979324, chosen.chance);",
        to: "divide(3.14159265358979324, is_beyond ? 1.0 : chosen.chance);",
        kernels: SCENE_TRACERS, noticed_by: &[(Of(Layers, Long, "a sheet over a floor", translucent::sheet_over_a_floor), TooDark)] },
    Fault { what: "films add to what lies under them",
        file: "material/film.glsl", from: "return (1.0 - film.share) * colour + film.share * interference;", to: "return colour + film.share * interference;",
        kernels: &["camera_paths"], noticed_by: &[(BARE_PLATES, TooBright)] },
    Fault { what: "the diffuse lobe has what its film reflects",
        file: "material/lobes/diffuse.glsl", from: "e0 += layers.iridescence * (layers.film_bound - e0);", to: "",
        kernels: &["camera_paths"], noticed_by: &[(BARE_PLATES, TooBright)] },
    Fault { what: "light samples behind paper lose a tenth",
        file: "material/lobes/diffuse_transmission.glsl", from: "(-cosine * light_share(light_density, density))", to: "(-0.9 * cosine * light_share(light_density, density))",
        kernels: &["camera_paths"], noticed_by: &[(TRANSMISSIVE_PLATES, TooDark)] },
    Fault { what: "shadow rays run through media as through air",
        file: "world/scene/direct.glsl", from: "left = t_max == 1.0 ? transmittance(media, norm(way)) : left;", to: "",
        kernels: &["receive"], noticed_by: &[(LAMP_IN_A_MEDIUM, TooBright)] },
    Fault { what: "of the solids around a point the outermost counts",
        file: "material/media.glsl", from: ": media | medium << count;", to: ": (media << MEDIUM_BITS) | medium;",
        kernels: &["receive"], noticed_by: &[(LAMP_IN_A_MEDIUM, TooBright)] },
    Fault { what: "shadow rays through sheets end beyond their lamp",
        file: "world/scene/direct.glsl", from: "way = start + way - next;", to: "",
        kernels: &["receive"], noticed_by: &[(LAMP_BETWEEN_SHEETS, TooDark)] },
    Fault { what: "normal maps are not turned over on the back",
        file: "material/surface.glsl", from: "mat3 frame = tangent_frame(tangents, n, front, u, v);",
        to: "front = true;\n    mat3 frame = tangent_frame(tangents, n, front, u, v);",
        kernels: &["camera_paths"], noticed_by: &[(COATS_AND_BACKS, TooBright)] },
    Fault { what: "a coat has the normal of what lies below it",
        file: "material/surface.glsl", from: "if ((found & (1u << LAYER_COAT_NORMAL)) != 0) {", to: "layers.coat_normal = surface.ns;\n        if (false) {",
        kernels: &["camera_paths"], noticed_by: &[(COATS_AND_BACKS, TooBright)] },
    Fault { what: "a coat counts the cosine to what lies below it",
        file: "material/lobes/coat.glsl", from: "* divide(max(dot(wi, coat_normal), 0.0), max(dot(wi, n), 1e-6))", to: "",
        kernels: &["camera_paths"], noticed_by: &[(COATS_AND_BACKS, TooDark)] },
    Fault { what: "transmission is looked up in the wrong channel",
        file: "material/surface.glsl", from: "values[LAYER_TRANSMISSION].r", to: "values[LAYER_TRANSMISSION].g",
        kernels: &["camera_paths"], noticed_by: &[(LAYER_TEXTURES, TooBright)] },
    Fault { what: "paths through thin rough walls turn by half a circle",
        file: "material/lobes/transmission.glsl", from: "return wi - 2.0 * dot(wi, surface.ns) * surface.ns;", to: "return -wi;",
        kernels: &["camera_paths"], noticed_by: &[(HALF_A_DOME, TooDark)] },
    Fault { what: "photons that do not pass weigh as if none did",
        file: "world/scene/step.glsl",
        from: "scatter.weight *= scatter.passes ? 1.0 : divide(surface.layers.coverage, 1.0 - lobes.pass_chance);", to: "",
        kernels: SCENE_TRACERS, noticed_by: &[(Of(Layers, Long, "photons off a pane", sheets::photons_off_a_pane), TooDark)] },
    Fault { what: "gaps of alpha emit light",
        file: "material/surface.glsl", from: "share *= coverage_of(material, index, u, v);", to: "",
        kernels: &["receive"], noticed_by: &[(Of(Layers, Long, "a blended lamp", |gpu| sheets::blended_lamp(gpu, Illumination::Split)), TooBright)] },
];

/// Of `shading_gain`.
const SHADING_GAIN: &str = "return min(divide(abs(shading_cosine), max(abs(geometric_cosine), 1e-6)), float(MAX_SHADING_GAIN));";

fn strict() -> RoomSettings {
    RoomSettings { math: Math::Strict, shininess: [Some(2.0); 5], mesh: 16, ..RoomSettings::default() }
}

fn small() -> SceneSettings {
    SceneSettings { photons: 3000, rounds: 2, shadow_rays: 2, illumination: Illumination::Photons, ..by_rounds() }
}

/// A builder stores the photons of the CPU builder, which are traced once of each number: of builders that are asked for, nothing else
/// differs.
fn builds(gpu: &Gpu, settings: &RoomSettings) -> Check<Complaint> {
    static KNOWN: LazyLock<Mutex<HashMap<u32, Arc<Vec<Photon>>>>> = LazyLock::new(Mutex::default);
    let traced = || Arc::new(photons_on_cpu(&RoomSettings { chunk: None, ..settings.clone() }));
    let expected = KNOWN.lock().unwrap().entry(settings.photons).or_insert_with(traced).clone();
    photons_agree(gpu, settings, &expected)
}

/// The same of films, by the number of nearest photons.
fn gathers(gpu: &Gpu, settings: &RoomSettings) -> Check<Complaint> {
    static KNOWN: LazyLock<Mutex<HashMap<Option<u32>, Arc<film::RoomFilm>>>> = LazyLock::new(Mutex::default);
    let expected = KNOWN.lock().unwrap().entry(settings.nearest).or_insert_with(|| Arc::new(run_on_cpu(settings).film)).clone();
    film_agrees(gpu, settings, &expected)
}

fn striped_counters(gpu: &Gpu) -> Check<Complaint> {
    // One counter leaves no gaps: in those of eight, photons lie then.
    [1, 8]
        .into_iter()
        .try_for_each(|counters| builds(gpu, &RoomSettings { builder: Builder::Atomic, counters: Some(counters), ..strict() }))
}

fn builders_under_the_clock(gpu: &Gpu) -> Check<Complaint> {
    let forever = Duration::from_secs(3600);
    let request = compaction::CompactionRequest {
        survivals: vec![0.75],
        bounces: 4,
        turns: 1,
        ..compaction::CompactionRequest::up_to(1 << 12, forever)
    };
    compaction::measure(gpu, &request, None, &AtomicBool::new(false), &mut |_| {}).map(|_| ()).map_err(|error| match error {
        Error::Miscalculated { what, .. } => Complaint::new(BuildersDisagree, what),
        error => error.into(),
    })
}

fn plates(gpu: &Gpu, covered: bool, transmissive: bool) -> Check<Complaint> {
    layered::lobes_in_the_sun(gpu, &layered::mixtures_of(covered, transmissive), false)
}

/// The kernels with a fault in them.
fn spoiled(fault: &Fault) -> Vec<(String, Vec<u32>)> {
    planted::kernels(fault.kernels, fault.file, &[(fault.from, fault.to)])
}

/// Faults of an area.
fn faults_of(area: FaultArea) -> impl Iterator<Item = &'static Fault> {
    FAULTS.iter().filter(move |fault| fault.noticed_by[0].0.area() == area)
}

/// The questions that faults are noticed by are answered right by a device without one.
fn questions_hold(area: FaultArea) {
    let Some(gpu) = device() else { return };
    let questions = faults_of(area).flat_map(|fault| fault.noticed_by).map(|(question, _)| (format!("{question:?}"), question));
    for question in questions
        .filter(|(_, question)| question.run() == Short || is_long_run() && question.run() == Long)
        .collect::<BTreeMap<_, _>>()
        .into_values()
    {
        assert_holds(format!("{} of a device without a fault", question.name()), question.ask(&gpu));
    }
}

/// How many faults are planted depends on the run: each is a kernel that the device compiles anew. In the short run every kernel of the
/// room gets one, and each other area its first; only questions that are not kept for the long run are asked.
fn faults_are_noticed(area: FaultArea) {
    let Some(mut gpu) = device() else { return };
    let mut spoiled_before: BTreeSet<&str> = BTreeSet::new();
    for fault in faults_of(area) {
        // All of them count, whichever is seen first.
        let new = fault.kernels.iter().filter(|kernel| spoiled_before.insert(kernel)).count();
        let is_first = spoiled_before.len() == new;
        if !is_long_run() && (new == 0 || area != Room && !is_first) {
            continue;
        }
        gpu.replace(spoiled(fault));
        let asked: Vec<_> = fault.noticed_by.iter().filter(|(question, _)| is_long_run() || question.run() != Long).collect();
        assert!(!asked.is_empty(), "{}: is noticed in the long run alone", fault.what);
        for (question, kind) in asked {
            assert_complains_of(*kind, &format!("{}, asked for {},", fault.what, question.name()), question.ask(&gpu));
        }
        // A fault is wrong in what it computes, and not in its use of Vulkan.
        assert_holds(fault.what, gpu.check_validation());
    }
}

#[test]
fn questions_about_the_room_are_answered_right() {
    questions_hold(Room);
}

#[test]
fn faults_of_the_room_are_noticed() {
    faults_are_noticed(Room);
}

#[test]
fn questions_about_scenes_are_answered_right() {
    questions_hold(Scenes);
}

#[test]
fn faults_of_scenes_are_noticed() {
    faults_are_noticed(Scenes);
}

#[test]
fn questions_about_lamps_are_answered_right() {
    questions_hold(Lamps);
}

#[test]
fn faults_of_lamps_are_noticed() {
    faults_are_noticed(Lamps);
}

#[test]
fn faults_of_aiming_are_noticed() {
    faults_are_noticed(Aiming);
}

#[test]
fn questions_about_layered_materials_are_answered_right() {
    questions_hold(Layers);
}

#[test]
fn faults_of_layered_materials_are_noticed() {
    faults_are_noticed(Layers);
}

/// How many faults are planted is said, and with no other number.
fn count_check(texts: &[String], count: usize) -> Check {
    let text = texts.join(" ");
    let words: Vec<&str> = text.split_whitespace().collect();
    let counted = words.windows(3).filter(|three| three[0] == "plants" && three[2].starts_with("fault"));
    let said: BTreeSet<&str> = counted.map(|three| three[1]).collect();
    require(said == BTreeSet::from([count.to_string().as_str()]), || format!("{said:?} faults are said to be planted, and {count} are"))
}

#[test]
fn readme_and_guide_count_the_faults() {
    let written = readme_and_guide();
    assert_holds("README and the guide", count_check(&written, FAULTS.len()));
    assert_complains("another number", count_check(&["It plants 64\nfaults in kernels".to_owned()], 65));
}

/// A run that ends with an error answers no question, and a complaint of another kind is not the one that was wanted.
#[test]
fn what_only_breaks_is_not_noticed() {
    let is_noticed = |kind, check| noticed_as(kind, "a fault", check).is_ok();
    let complaint = |kind| Err(Complaint::new(kind, "what was found"));
    assert!(is_noticed(PhotonsLost, complaint(PhotonsLost)));
    assert!(is_noticed(OtherPhotons, complaint(PhotonsLost)) && is_noticed(OtherSums, complaint(SumsTooLarge)));
    for (wanted, found) in [(PhotonsLost, SumsTooSmall), (PhotonsLost, PhotonsAdded), (SumsTooLarge, OtherSums), (OtherSums, OtherPhotons)]
    {
        assert!(!is_noticed(wanted, complaint(found)), "{found:?} for {wanted:?}");
    }
    assert!(!is_noticed(PhotonsLost, Ok(())));
    let lost = Error::Device { call: "vkQueueSubmit", reason: "device lost".into() };
    assert_eq!(Complaint::from(lost).kind, Broken);
    for kind in [Broken, LedgerOpen, PhotonsLost] {
        assert!(!is_noticed(kind, complaint(Broken)), "{kind:?}");
    }

    // A run that leaves nothing is no sign either.
    for check in [
        same_sums("a film", &[0, 0], &[0, 7]),
        same_photons(&[], &photons_on_cpu(&RoomSettings { photons: 2, reflectance: 1.0, ..strict() })),
        estimate_check("light", 0.0, 1.0, 0.1),
    ] {
        assert_eq!(check.unwrap_err().kind, Broken);
    }

    let Some(gpu) = open(Options::default()) else { return };
    // More bounces than the persistent builder has: refused before anything is traced.
    let settings = RoomSettings { builder: Builder::Persistent, bounces: 321, ..strict() };
    for check in [closed_fates(&gpu, &open_box(&settings), &settings).map(|_| ()), photons_agree(&gpu, &settings, &[])] {
        assert_eq!(check.unwrap_err().kind, Broken);
    }
}
