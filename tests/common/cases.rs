//! Known failures of renderers, and the tests that show that they do not happen here: the table of the guide's page on
//! hard cases, which `tests/light/hard_cases.rs` checks.

/// One known failure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Case {
    /// Of a catalogue: rays and triangles (G), sampling (S), random numbers (R), accumulation (A), density estimation (E),
    /// lobes (B), indices (I), scheduling (D), cameras (C), glass (L), many photons (M), families of scenes (F).
    pub number: &'static str,
    pub failure: &'static str,
    pub shown: Shown,
}

/// Why it does not happen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Shown {
    /// These tests show it.
    Tests(&'static [&'static str]),
    /// The program has nothing to which it could happen. Once a source has one of these words, that may no longer be so,
    /// and the case needs a test.
    Absent { why: &'static str, words: &'static [&'static str] },
}

use Shown::{Absent, Tests};

/// Cases of each group.
pub const COUNTS: [(char, usize); 12] =
    [('G', 15), ('S', 19), ('R', 9), ('A', 11), ('E', 22), ('B', 7), ('I', 8), ('D', 7), ('C', 3), ('L', 8), ('M', 3), ('F', 10)];

#[rustfmt::skip]
pub const CASES: [Case; 122] = [
    Case { number: "G1", failure: "Rays start at a fixed distance from the surface they leave", shown: Tests(&["photons_leave_a_surface_once_and_for_all", "a_patch_in_a_plane_is_left_with_the_plane", "photons_on_edges_and_in_corners_stay_in_the_room"]) },
    Case { number: "G2", failure: "Rays start on the surface they leave", shown: Tests(&["grazing_and_straight_directions_end_in_the_room"]) },
    Case { number: "G3", failure: "Ray offsets too large for a small scene", shown: Tests(&["thin_walls_and_sheets_let_no_light_through", "a_lamp_in_a_flat_box_lights_nothing_outside", "small_lamps_shine_by_their_area"]) },
    Case { number: "G4", failure: "A lamp lies in a wall, which its photons hit at distance 0", shown: Tests(&["black_walls_absorb_the_first_flights_hits", "a_light_flush_with_a_wall_shines_into_the_room", "flat_lamps_light_nothing_of_their_own_plane"]) },
    Case { number: "G5", failure: "Rays through an edge that two triangles share miss both", shown: Tests(&["rays_at_edges_and_corners_meet_a_wall"]) },
    Case { number: "G6", failure: "A fused multiply-add breaks a watertight triangle test", shown: Tests(&["every_operation_is_rounded_by_itself"]) },
    Case { number: "G7", failure: "The slab test of a box: 0 times infinity", shown: Tests(&["axis_parallel_rays_meet_the_same_by_tree_and_list"]) },
    Case { number: "G8", failure: "Triangles without area, and slivers", shown: Tests(&["flat_doubled_and_reordered_triangles_change_no_bit", "triangles_without_area_go"]) },
    Case { number: "G9", failure: "Cancellation in the quadratic of a ray and a sphere", shown: Absent { why: "spheres are meshes, and no ray is intersected with a quadric", words: &["discriminant", "ray_sphere", "sphere_hit"] } },
    Case { number: "G10", failure: "Tangent frames of normals near an axis", shown: Tests(&["a_furnace_glows_alike_however_it_is_turned"]) },
    Case { number: "G11", failure: "Normalising vectors that are very long or very short", shown: Tests(&["the_smallest_lamps_shine_into_the_room_or_are_left_out"]) },
    Case { number: "G12", failure: "Scenes far from the origin", shown: Tests(&["ten_thousand_sizes_away_the_light_is_the_same_to_the_bit", "size_and_place_do_not_change_the_light"]) },
    Case { number: "G13", failure: "Scenes of any scale", shown: Tests(&["every_power_of_two_is_the_same_light_to_the_bit", "the_open_box_of_any_power_of_two_stores_the_same_photons"]) },
    Case { number: "G14", failure: "Coincident surfaces: which one is hit", shown: Tests(&["flat_doubled_and_reordered_triangles_change_no_bit", "sheets_in_one_plane_are_met_alike_by_tree_and_list", "two_sheets_at_one_place_show_each_its_own_side", "a_rug_on_the_floor_is_lit_like_the_floor", "a_lamp_that_is_given_twice_shines_once"]) },
    Case { number: "G15", failure: "A thin wall that is lit from one side", shown: Tests(&["thin_walls_and_sheets_let_no_light_through", "no_light_leaks_from_one_shelf_to_the_next"]) },
    Case { number: "S1", failure: "A random number of exactly 1", shown: Tests(&["unit_floats_stay_below_one"]) },
    Case { number: "S2", failure: "A random number of exactly 0", shown: Tests(&["grazing_and_straight_directions_end_in_the_room"]) },
    Case { number: "S3", failure: "Points on a disc", shown: Tests(&["discs_and_hemispheres_have_their_moments"]) },
    Case { number: "S4", failure: "Directions on a sphere", shown: Tests(&["discs_and_hemispheres_have_their_moments"]) },
    Case { number: "S5", failure: "Sine and cosine outside the range that Vulkan guarantees", shown: Tests(&["discs_and_hemispheres_have_their_moments"]) },
    Case { number: "S6", failure: "The cumulative distribution of many lights in f32", shown: Tests(&["choices_follow_the_shares_and_leave_none_out"]) },
    Case { number: "S7", failure: "A weak light beside a strong one gets no photon", shown: Tests(&["photons_are_dealt_by_power_and_none_is_lost"]) },
    Case { number: "S8", failure: "Russian roulette at reflectance 0 and 1", shown: Tests(&["a_closed_white_room_stores_everything", "appending_at_survival_none_and_all"]) },
    Case { number: "S9", failure: "Russian roulette of coloured light", shown: Tests(&["each_channel_has_its_own_reflectance"]) },
    Case { number: "S10", failure: "Long paths that a limit on bounces cuts", shown: Tests(&["a_thousand_bounces_store_a_geometric_series", "reflectances_and_bounces_at_their_ends_are_right", "bright_rooms_lose_no_light"]) },
    Case { number: "S11", failure: "Uniform and cosine emission mixed up", shown: Tests(&["a_million_photons_have_the_exact_shares"]) },
    Case { number: "S12", failure: "Glossy lobes that reach below the horizon", shown: Tests(&["lobes_reflect_what_lies_above_the_horizon"]) },
    Case { number: "S13", failure: "Glossy lobes of very large exponents", shown: Tests(&["lobes_of_any_width_throw_their_share"]) },
    Case { number: "S14", failure: "Quasi-Monte Carlo points whose dimensions mix", shown: Tests(&["sobol_points_stratify_every_aligned_run", "sobol_scrambles_are_uniform_and_independent", "sobol_photons_are_as_many_with_less_noise"]) },
    Case { number: "S15", failure: "Lamps behind a wall that are a million times as strong", shown: Tests(&["a_dim_room_beside_a_bright_one_is_lit_as_if_it_were_alone", "scattered_light_of_a_dim_room_has_photons_of_its_own"]) },
    Case { number: "S16", failure: "A hundred thousand lamps, of which each shadow ray asks one", shown: Tests(&["a_hundred_thousand_lamps_light_as_one_does", "no_light_is_impossible_and_probabilities_add_up_to_one"]) },
    Case { number: "S17", failure: "A sky that is seen through a small window", shown: Tests(&["a_small_window_lights_a_room_in_a_tenth_of_the_time", "a_sky_through_a_window_is_as_light_as_the_closed_form_says"]) },
    Case { number: "S18", failure: "A lamp that lights no point itself, but what lights it", shown: Tests(&["a_lamp_that_lights_what_lights_the_points_has_photons_too"]) },
    Case { number: "S19", failure: "A small bright spot of a lamp's texture", shown: Tests(&["a_small_bright_spot_of_a_textured_lamp_is_found", "pieces_are_as_bright_as_they_say"]) },
    Case { number: "R1", failure: "48-bit arithmetic in two words", shown: Tests(&["rand48_gives_the_c_librarys_numbers", "rand48_jumps_and_steps_meet_across_2_to_the_48"]) },
    Case { number: "R2", failure: "Low bits of a linear congruential generator", shown: Tests(&["draws_are_even_alone_in_pairs_and_in_triples"]) },
    Case { number: "R3", failure: "Leapfrogging with a stride that is a power of two", shown: Tests(&["neighbouring_photons_do_not_resemble_each_other"]) },
    Case { number: "R4", failure: "Consecutive seeds give correlated streams", shown: Tests(&["neighbouring_photons_do_not_resemble_each_other"]) },
    Case { number: "R5", failure: "48 random bits rounded up to 1", shown: Tests(&["no_two_bounces_draw_the_same_numbers"]) },
    Case { number: "R6", failure: "Seeds of 32 bits that collide", shown: Tests(&["no_two_photons_draw_the_same_numbers", "sixteen_million_photons_are_all_different"]) },
    Case { number: "R7", failure: "A random state per thread, which compaction hands to other photons", shown: Tests(&["two_naive_bounces_are_the_first_two_of_fifteen"]) },
    Case { number: "R8", failure: "A counter-based generator that misses its known answers", shown: Tests(&["philox_gives_the_known_answers"]) },
    Case { number: "R9", failure: "A generator's period is used up, or blocks of it overlap", shown: Tests(&["a_run_draws_the_whole_period_and_no_number_twice"]) },
    Case { number: "A1", failure: "A count in f32 stops at 2^24", shown: Tests(&["a_texel_counts_beyond_2_to_the_24"]) },
    Case { number: "A2", failure: "Many small terms", shown: Tests(&["mixed_weights_are_summed_to_half_a_unit_each"]) },
    Case { number: "A3", failure: "A compensated sum that the compiler simplifies to a plain one", shown: Tests(&["f32_stops_counting_where_integers_and_pairs_go_on", "floats_and_integers_agree_within_rounding"]) },
    Case { number: "A4", failure: "Sums that depend on their order", shown: Tests(&["runs_and_builders_and_gathers_give_the_same_bits"]) },
    Case { number: "A5", failure: "Fixed-point sums that overflow", shown: Tests(&["film_sums_cannot_overflow", "film_sums_are_refused_before_they_could_overflow"]) },
    Case { number: "A6", failure: "Devices without 64-bit atomics", shown: Tests(&["the_start_up_check_passes", "a_texel_counts_beyond_2_to_the_24"]) },
    Case { number: "A7", failure: "Devices without float atomics", shown: Tests(&["a_device_without_abilities_gives_the_same_bits"]) },
    Case { number: "A8", failure: "The variance as a difference of two large numbers", shown: Tests(&["standard_errors_survive_a_mean_far_above_them"]) },
    Case { number: "A9", failure: "A running mean that no longer changes", shown: Tests(&["a_run_is_the_sum_of_rounds_that_differ"]) },
    Case { number: "A10", failure: "Faint light beside bright light", shown: Tests(&["faint_light_is_right_to_half_a_film_unit", "light_is_linear_in_power_over_24_decades"]) },
    Case { number: "A11", failure: "Products in pairs of floats, which rest on a fused multiply-add", shown: Absent { why: "sums are integers, and compensated sums only add", words: &["two_product", "dekker", " fma("] } },
    Case { number: "E1", failure: "Edges: part of the disc lies beyond the wall", shown: Tests(&["edges_and_corners_are_dark_by_what_lies_beyond_them", "edge_correction_divides_by_what_lies_on_the_wall"]) },
    Case { number: "E2", failure: "Corners: most of the disc lies beyond the wall", shown: Tests(&["edges_and_corners_are_dark_by_what_lies_beyond_them", "disc_at_an_edge_and_in_a_corner"]) },
    Case { number: "E3", failure: "Photons of the wall around the corner", shown: Tests(&["a_lit_floor_does_not_light_the_foot_of_the_wall", "each_half_of_a_roof_keeps_its_own_light"]) },
    Case { number: "E4", failure: "Photons exactly at the radius", shown: Tests(&["a_photon_on_the_rim_counts"]) },
    Case { number: "E5", failure: "The density of the k nearest photons is biased", shown: Tests(&["the_estimate_has_no_bias", "builders_and_the_cpu_take_the_same_nearest_photons"]) },
    Case { number: "E6", failure: "Fewer than k photons, all at one point, or equally far", shown: Tests(&["the_nearest_photons_are_those_that_f64_finds", "ties_are_broken_by_the_photons_number_in_any_order", "a_search_goes_on_for_as_long_as_it_takes"]) },
    Case { number: "E7", failure: "A filter kernel that does not integrate to 1", shown: Tests(&["every_kernel_of_every_radius_integrates_to_one"]) },
    Case { number: "E8", failure: "An empty photon map, and one of a single photon", shown: Tests(&["an_empty_map_and_a_map_of_one", "a_map_of_one_photon_is_one_disc"]) },
    Case { number: "E9", failure: "Photons on the border of the grid", shown: Tests(&["the_index_holds_every_photon_in_its_cell", "device_and_cpu_gather_the_same_photons_to_the_same_bits"]) },
    Case { number: "E10", failure: "Cells of the grid that share a hash bucket", shown: Tests(&["no_split_and_no_builder_changes_a_bit"]) },
    Case { number: "E11", failure: "Radii that are very small or larger than the scene", shown: Tests(&["radii_from_the_whole_scene_to_below_the_photons_spacing_are_right"]) },
    Case { number: "E12", failure: "The progressive radius as a product in f32", shown: Tests(&["radii_of_ten_thousand_rounds_follow_the_gamma_function"]) },
    Case { number: "E13", failure: "Error bars that take stored photons for independent", shown: Tests(&["stated_errors_are_the_spread_over_seeds"]) },
    Case { number: "E14", failure: "Gathering and splatting disagree", shown: Tests(&["the_film_holds_every_photon_once_for_each_texel_in_reach"]) },
    Case { number: "E15", failure: "One radius for a hall and for a room 50 times as small", shown: Tests(&["a_room_has_radii_of_its_own_beside_a_hall"]) },
    Case { number: "E16", failure: "Light from before a wall on the floor behind it, and floor below a box that no photon reaches", shown: Tests(&["a_dark_half_of_a_room_is_dark_right_behind_the_wall", "the_floor_beside_a_box_is_as_light_as_all_of_the_furnace"]) },
    Case { number: "E17", failure: "Error bars of runs that have not met the brightest light yet", shown: Tests(&["claims_hold_once_the_tail_is_known", "a_run_goes_on_while_what_is_unseen_may_be_more_than_is_wanted"]) },
    Case { number: "E18", failure: "A surface that is tiny beside the radius", shown: Tests(&["what_is_tiny_beside_the_radius_is_as_light_as_all_of_the_furnace"]) },
    Case { number: "E19", failure: "Error bars of few photons, none of which had the colour that is missing", shown: Tests(&["few_hits_say_little_of_colours_that_they_lack"]) },
    Case { number: "E20", failure: "A lamp seen through a gap that every ray misses, where another lamp lights the place", shown: Tests(&["lamps_that_no_ray_has_met_are_said_to_be_hidden"]) },
    Case { number: "E21", failure: "A place that many dim photons reach and bright ones almost never", shown: Tests(&["points_that_only_dim_photons_have_met_are_said_to_be_so", "light_that_the_ground_scatters_into_a_room_is_said_to_be_missing"]) },
    Case { number: "E22", failure: "A second opening to the sky, which few of the points see", shown: Tests(&["a_second_opening_that_few_points_see_is_said_to_be_hidden"]) },
    Case { number: "B1", failure: "A power of a negative cosine", shown: Tests(&["phong_weights_have_their_mean_and_vanish_behind", "a_sun_in_a_plate_is_a_power_of_the_cosine"]) },
    Case { number: "B2", failure: "An exponent of 0: pow(0, 0)", shown: Tests(&["phong_weights_have_their_mean_and_vanish_behind"]) },
    Case { number: "B3", failure: "Weights that grow with the exponent", shown: Tests(&["phong_weights_have_their_mean_and_vanish_behind"]) },
    Case { number: "B4", failure: "The normalisation of a lobe", shown: Tests(&["lobes_reflect_what_lies_above_the_horizon", "plates_in_the_sun_have_the_lobes_of_the_guide"]) },
    Case { number: "B5", failure: "Powers of numbers near 1", shown: Tests(&["phong_weights_are_powers_of_the_cosine", "a_sun_in_a_plate_is_a_power_of_the_cosine"]) },
    Case { number: "B6", failure: "A material that reflects more than arrives", shown: Tests(&["lobes_reflect_what_lies_above_the_horizon", "plates_return_what_the_sky_sends", "white_surfaces_return_all_that_single_scattering_leaves"]) },
    Case { number: "B7", failure: "Smooth normals that send rays to the wrong side of a coarse mesh", shown: Tests(&["coarse_mirrors_with_smooth_normals_lose_no_light", "coarse_glass_with_smooth_normals_loses_no_light"]) },
    Case { number: "I1", failure: "Slot numbers beyond 32 bits", shown: Tests(&["slots_of_a_chunk_are_numbered_in_32_bits", "maps_of_a_chunk_are_numbered_in_32_bits"]) },
    Case { number: "I2", failure: "More work groups than one dispatch may have", shown: Tests(&["rounds_around_a_full_row_of_groups_lose_no_photon", "photons_of_a_second_row_of_groups_reach_the_map"]) },
    Case { number: "I3", failure: "A buffer larger than a shader may address", shown: Tests(&["slots_of_a_chunk_are_numbered_in_32_bits", "a_round_larger_than_a_buffer_splits_and_drops_nothing"]) },
    Case { number: "I4", failure: "A counter that runs past the end of its buffer", shown: Tests(&["a_full_map_drops_counts_and_keeps_to_its_room"]) },
    Case { number: "I5", failure: "Counts that are no multiple of the work group", shown: Tests(&["builders_store_the_same_photons_at_every_count", "pictures_of_any_shape_are_whole"]) },
    Case { number: "I6", failure: "An index that is rounded to f32", shown: Tests(&["photons_of_the_largest_numbers_are_their_own"]) },
    Case { number: "I7", failure: "Code for one subgroup size", shown: Tests(&["group_sizes_and_chunks_change_no_photon", "the_prefix_sum_is_the_running_sum"]) },
    Case { number: "I8", failure: "Totals beyond 32 bits", shown: Tests(&["totals_exceed_32_bits", "a_trillion_photons_merge_into_the_same_light"]) },
    Case { number: "D1", failure: "Loops that lavapipe ends after 65 535 iterations", shown: Tests(&["long_photon_lists_are_gathered_to_the_end", "loops_count_right_up_to_the_limit"]) },
    Case { number: "D2", failure: "Dispatches so long that a watchdog ends them", shown: Tests(&["a_gather_that_is_cut_into_parts_is_whole"]) },
    Case { number: "D3", failure: "Photons that are stored in another order each run", shown: Tests(&["the_order_of_appending_changes_no_photon"]) },
    Case { number: "D4", failure: "A memory barrier that is missing", shown: Tests(&["a_validation_message_is_an_error", "runs_and_builders_and_gathers_give_the_same_bits"]) },
    Case { number: "D5", failure: "Spin locks", shown: Tests(&["no_kernel_waits_for_another_invocation"]) },
    Case { number: "D6", failure: "Work that was interrupted and is resumed", shown: Tests(&["the_open_box_is_studied_against_radiosity_and_goes_on_where_it_ended", "a_study_that_is_cancelled_keeps_what_it_has", "an_interrupt_saves_what_is_finished"]) },
    Case { number: "D7", failure: "Timestamps that wrap", shown: Tests(&["tick_counts_wrap_at_their_valid_bits", "timings_nest_and_count"]) },
    Case { number: "C1", failure: "A field of view of 0 or 180 degrees", shown: Tests(&["views_too_wide_or_too_narrow_are_left_out_by_name"]) },
    Case { number: "C2", failure: "A camera that looks along its up vector", shown: Tests(&["frames_are_orthonormal_even_straight_down"]) },
    Case { number: "C3", failure: "An eye on a surface or on a photon", shown: Tests(&["an_eye_on_a_photon_sees_no_weight_and_no_nan", "an_eye_on_a_surface_sees_numbers"]) },
    Case { number: "L1", failure: "Total internal reflection", shown: Tests(&["total_reflection_begins_at_the_critical_angle"]) },
    Case { number: "L2", failure: "Fresnel reflectance at grazing angles", shown: Tests(&["glass_reflects_by_fresnel_up_to_the_horizon"]) },
    Case { number: "L3", failure: "Glass of refractive index 1", shown: Tests(&["an_index_of_one_reflects_nothing_at_any_angle", "glass_of_the_air_s_own_index_is_not_there"]) },
    Case { number: "L4", failure: "Refraction near the critical angle", shown: Tests(&["total_reflection_begins_at_the_critical_angle"]) },
    Case { number: "L5", failure: "Repeated reflection inside a glass slab", shown: Tests(&["every_closed_form_holds"]) },
    Case { number: "L6", failure: "Scaling flux by the square of the refractive index", shown: Tests(&["diffuse_light_crosses_glass_by_its_mean_transmittance"]) },
    Case { number: "L7", failure: "Absorption by the way inside, and of solids in one another", shown: Tests(&["slabs_absorb_by_the_way_inside", "nested_solids_of_one_index_make_one_slab", "what_lies_in_a_medium_agrees_with_the_judge"]) },
    Case { number: "L8", failure: "Light that coarse glass with smooth normals catches for ever", shown: Tests(&["coarse_glass_with_smooth_normals_loses_no_light", "coarse_layered_glass_loses_no_light"]) },
    Case { number: "M1", failure: "Parts of a run of unequal size that are averaged as equal", shown: Tests(&["work_groups_and_chunks_give_the_same_bits"]) },
    Case { number: "M2", failure: "A part of a run that is counted twice", shown: Tests(&["parts_of_a_run_come_to_the_bits_of_one", "parts_of_the_box_come_to_the_bits_of_one"]) },
    Case { number: "M3", failure: "Photon numbers beyond 32 bits", shown: Tests(&["photons_of_the_largest_numbers_are_their_own", "a_billion_photons_have_the_exact_share"]) },
    Case { number: "F1", failure: "Lamps, walls and points too near each other", shown: Tests(&["what_is_too_near_is_right_within_what_is_stated"]) },
    Case { number: "F2", failure: "Lamps and objects too far apart, or too small for their scene", shown: Tests(&["what_is_too_far_is_right_within_what_is_stated"]) },
    Case { number: "F3", failure: "Slits, corridors, strips and needles", shown: Tests(&["what_is_too_thin_is_right_within_what_is_stated"]) },
    Case { number: "F4", failure: "Lamps too bright and too dim beside each other", shown: Tests(&["what_is_too_bright_or_too_dim_is_right_within_what_is_stated"]) },
    Case { number: "F5", failure: "Thousands of lamps and blocks", shown: Tests(&["what_is_too_many_is_right_within_what_is_stated"]) },
    Case { number: "F6", failure: "Lamps and blocks that touch, hide or cross each other", shown: Tests(&["what_touches_or_overlaps_is_right_within_what_is_stated"]) },
    Case { number: "F7", failure: "Rooms within rooms, and inside out", shown: Tests(&["what_is_nested_is_right_within_what_is_stated"]) },
    Case { number: "F8", failure: "Single triangles, grazing suns, mirrored and squeezed instances", shown: Tests(&["what_is_degenerate_is_right_within_what_is_stated", "a_squeezed_mirrored_instance_is_as_bright_as_ever"]) },
    Case { number: "F9", failure: "Options at their ends", shown: Tests(&["extreme_options_are_right_within_what_is_stated"]) },
    Case { number: "F10", failure: "A room that nobody thought of", shown: Tests(&["ten_random_rooms_are_right_within_their_errors", "two_hundred_random_rooms_are_right_within_their_errors"]) },
];

/// Cases that tests show, and cases that cannot occur.
pub fn counts(cases: &[Case]) -> (usize, usize) {
    let shown = cases.iter().filter(|case| matches!(case.shown, Tests(_))).count();
    (shown, cases.len() - shown)
}

/// The cases as a table of Markdown.
pub fn table() -> String {
    let row = |case: &Case| {
        let shown = match case.shown {
            Tests(names) => names.iter().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", "),
            Absent { why, .. } => format!("cannot occur: {why}"),
        };
        format!("| {} | {} | {shown} |\n", case.number, case.failure)
    };
    let rows: String = CASES.iter().map(row).collect();
    format!("| case | what fails elsewhere | tests that show that it does not fail here |\n| --- | --- | --- |\n{rows}")
}
