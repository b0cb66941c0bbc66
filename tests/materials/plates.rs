//! Plates of layered materials, many in a picture, against closed forms.

use crate::common::prelude::*;
use crate::common::{known, layered, sheets};

#[test]
fn plates_in_the_sun_have_the_lobes_of_the_guide() {
    let Some(gpu) = device() else { return };
    assert_holds("lobes", layered::lobes_in_the_sun(&gpu, &layered::mixtures(), false));
}

#[test]
fn rough_solids_in_the_sun_have_the_lobes_of_the_guide() {
    let Some(gpu) = device() else { return };
    for is_inside in [false, true] {
        assert_holds("rough solids", layered::lobes_in_the_sun(&gpu, &layered::rough_solids(), is_inside));
    }
}

#[test]
fn normal_maps_and_textures_are_looked_up_as_gltf_has_it() {
    let Some(gpu) = device() else { return };
    assert_holds("normal maps", layered::normal_maps_in_the_sun(&gpu));
    assert_holds("coats and backs", layered::coats_and_backs_in_the_sun(&gpu));
    assert_holds("a ball", layered::mapped_ball_in_the_sun(&gpu));
    assert_holds("textures", layered::textures_in_the_sun(&gpu));
}

#[test]
fn backs_are_not_there_for_the_eye() {
    let Some(gpu) = device() else { return };
    assert_holds("backs", layered::backs_in_the_sun(&gpu));
}

#[test]
fn alphas_of_vertices_are_looked_up_without_colours() {
    let sheet = Mesh { alphas: vec![0.5; 4], ..level(0.0, [1.0; 2], true, 0) };
    let scene = scene_of(vec![sheet], vec![layered::dull(0.5)], vec![sun(DVec3::NEG_Y)]);
    let plan = scene_plan_within(&Limits::of_host(), &scene, &by_rounds(), square_picture(1)).unwrap();
    assert!(plan.keeps(Effect::VertexColours));
    assert!(scene.without(&[Effect::VertexColours]).meshes[0].alphas.is_empty());
}

#[test]
fn sheets_let_their_share_pass() {
    let Some(gpu) = device() else { return };
    for illumination in BOTH {
        assert_holds("the sun", sheets::sun_through_sheets(&gpu, illumination));
    }
    assert_holds("photons", sheets::photons_off_a_pane(&gpu));
    for illumination in BOTH {
        assert_holds("a lamp with gaps", sheets::blended_lamp(&gpu, illumination));
    }
    assert_holds("a lamp", sheets::lamp_between_sheets(&gpu));
    assert_holds("the eye", sheets::floor_through_sheets(&gpu));
}

#[test]
fn plates_return_what_the_sky_sends() {
    let Some(gpu) = device() else { return };
    for within_a_dome in [false, true] {
        assert_holds("the sky", layered::furnace(&gpu, &layered::opaque(), within_a_dome));
    }
}

#[test]
fn photons_land_where_no_lobe_is() {
    let Some(gpu) = device() else { return };
    assert_holds("photons", layered::photons_land_beside_lobes(&gpu));
}

#[test]
fn rough_plates_let_the_light_of_half_a_dome_through() {
    let Some(gpu) = device() else { return };
    assert_holds("rough plates", layered::transmission_in_half_a_dome(&gpu));
}

#[test]
fn photon_maps_have_the_lobes_of_the_guide() {
    let Some(gpu) = device() else { return };
    assert_holds("photons", layered::photons_on_a_plate(&gpu));
}

#[test]
fn clear_balls_are_not_to_be_seen_in_a_furnace() {
    let Some(gpu) = device() else { return };
    for is_lossless in [true, false] {
        assert_holds("balls", layered::clear_furnace(&gpu, is_lossless));
    }
}

/// As `SURFACE_DIELECTRIC` has it: smooth normals alone reflect totally for ever.
#[test]
fn coarse_layered_glass_loses_no_light() {
    let Some(gpu) = device() else { return };
    for segments in [32, 16, 8] {
        let glass = layered::layered(Vec3::ONE, &layered::smooth_glass());
        assert_holds("glass", known::coarse_sphere_in_a_furnace(&gpu, glass.clone(), segments));
        assert_holds("glass", known::coarse_sphere_in_the_sun(&gpu, glass, segments));
    }
}
