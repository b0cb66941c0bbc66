//! The functions that sample, as the kernels have them: every density integrates to 1, the samples pass a chi-square
//! test against it, and the random words at the ends of their range give finite unit directions.

use crate::common::chi_square::{Grid, ONE, counts_check, density_check, even};
use crate::common::densities::{AXIS, ULP, disc_check, frame, hemisphere_check, is_unit, lobe_check, sphere_check, triangle_check};
use crate::common::prelude::*;
use photonmill::gpu::check;
use photonmill::records::{Samples, SamplingCase};
use photonmill::settings::scene::Filter;

/// Cases of each function.
const SAMPLES: u32 = 1 << 17;
const BOTH: [Math; 2] = [Math::Fast, Math::Strict];

/// Words for a number of cases.
fn words(seed: u32) -> impl Iterator<Item = [u32; 4]> {
    (0..SAMPLES).map(move |k| philox([k, 0, 0, 0], [seed, 0x5a]))
}

fn case(words: [u32; 4]) -> SamplingCase {
    let normal = AXIS.normalize().as_vec3();
    SamplingCase { words: UVec2::new(words[0], words[1]), normal, a: Vec3::X, b: Vec3::Y, c: Vec3::Z, exponent: 1.0 }
}

fn ask(gpu: &Gpu, math: Math, filter: Filter, cases: &[SamplingCase]) -> Vec<Samples> {
    check::sampling(gpu, &[("STRICT_MATH", math as u32), ("FILTER", filter as u32)], cases).unwrap()
}

/// Random words at the ends of their range, in pairs: what is 0 and the largest number below 1, and their neighbours.
fn edge_words() -> impl Iterator<Item = [u32; 4]> {
    const ENDS: [u32; 7] = [0, 0xff, 0x100, 0x8000_0000, 0xffff_feff, 0xffff_ff7f, 0xffff_ffff];
    ENDS.into_iter().flat_map(|x| ENDS.into_iter().map(move |y| [x, y, 0, 0]))
}

#[test]
fn the_chi_square_test_complains_on_both_sides() {
    assert_complains("a loaded die", counts_check("die", &[1000, 1000, 1000, 1000, 1000, 1300], &[1.0 / 6.0; 6]));
    // What is more even than chance allows is no random sample.
    assert_complains("a stratified sample", counts_check("strata", &[1000; 100], &[0.01; 100]));
}

fn mapped<T>(samples: &[Samples], of: impl Fn(&Samples) -> T) -> Vec<T> {
    samples.iter().map(of).collect()
}

#[test]
fn directions_and_points_follow_their_densities() {
    let Some(gpu) = device() else { return };
    let up = DMat3::IDENTITY;
    let cosine_law = |wi: DVec3| wi.z / PI;
    for math in BOTH {
        let cases: Vec<SamplingCase> = words(1).map(case).collect();
        let samples = ask(&gpu, math, Filter::Box, &cases);
        let cosine = mapped(&samples, |at| at.cosine_hemisphere);
        let uniform = mapped(&samples, |at| at.uniform_hemisphere);
        let discs = mapped(&samples, |at| at.disc.as_dvec3());
        let triangles = mapped(&samples, |at| at.triangle.as_dvec2());
        for (what, directions) in [("cosine", &cosine), ("uniform", &uniform), ("sphere", &mapped(&samples, |at| at.sphere))] {
            directions.iter().for_each(|direction| assert_holds(format!("{math:?}"), is_unit(what, *direction, 4.0 * ULP)));
        }
        assert_holds(format!("{math:?}"), hemisphere_check("cosine hemisphere", &cosine, up, cosine_law));
        assert_holds(format!("{math:?}"), hemisphere_check("uniform hemisphere", &uniform, up, |_| 1.0 / TAU));
        assert_holds(format!("{math:?}"), sphere_check("sphere", &mapped(&samples, |at| at.sphere)));
        assert_holds(format!("{math:?}"), disc_check("disc", &discs, AXIS, 1.0));
        assert_holds(format!("{math:?}"), triangle_check("triangle", &triangles));

        assert_complains("uniform directions for cosines", hemisphere_check("fault", &uniform, up, cosine_law));
        assert_complains("cosines for uniform directions", hemisphere_check("fault", &cosine, up, |_| 1.0 / TAU));
        assert_complains("a density 2 % off", hemisphere_check("fault", &cosine, up, |wi| 1.02 * wi.z / PI));
        assert_complains("half of the sphere", sphere_check("fault", &uniform));
        let lopsided = |wi: DVec3| wi.z / PI * (1.0 + 0.1 * wi.x);
        assert_complains("a side that is preferred by 10 %", hemisphere_check("fault", &cosine, up, lopsided));
        let linear: Vec<DVec3> = discs.iter().map(|point| point.length() * *point).collect();
        assert_complains("r = u in place of its root", disc_check("fault", &linear, AXIS, 1.0));
        let folded: Vec<DVec2> = words(2)
            .map(|[x, y, ..]| DVec2::new(f64::from(x), f64::from(y) * (1.0 - f64::from(x) / 2f64.powi(32))) / 2f64.powi(32))
            .collect();
        assert_complains("a triangle without the root", triangle_check("fault", &folded));
    }
}

#[test]
fn lobes_of_every_width_follow_their_density() {
    let Some(gpu) = device() else { return };
    for (seed, exponent) in [0.0, 0.01, 0.5, 1.0, 5.0, 50.0, 1e4, 48_826.0, 1e6, 1e8].into_iter().enumerate() {
        let math = BOTH[seed % 2];
        let cases: Vec<SamplingCase> = words(seed as u32).map(|words| SamplingCase { exponent: exponent as f32, ..case(words) }).collect();
        let directions = mapped(&ask(&gpu, math, Filter::Box, &cases), |at| at.lobe);
        directions.iter().for_each(|direction| assert_holds(exponent, is_unit("lobe", *direction, 4.0 * ULP)));
        assert_holds(format!("{math:?}"), lobe_check(&format!("lobe {exponent}"), &directions, exponent));
        assert_complains("an exponent 5 % off", lobe_check("fault", &directions, 1.05 * (exponent + 1.0) - 1.0));
    }
}

#[test]
fn frames_are_orthonormal_and_packed_directions_near() {
    let Some(gpu) = device() else { return };
    let random = words(3).take(20_000).map(|[x, y, ..]| {
        let (z, azimuth) = (f64::from(x) / 2f64.powi(31) - 1.0, TAU * f64::from(y) / 2f64.powi(32));
        DVec3::new(azimuth.cos() * (1.0 - z * z).sqrt(), azimuth.sin() * (1.0 - z * z).sqrt(), z)
    });
    let steps = [0.0, 1e-30, 1e-12, 1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 0.1];
    let hard = [-1.0, 1.0].into_iter().flat_map(|z| {
        steps.into_iter().flat_map(move |x| {
            [(x, 0.0), (0.0, -x), (x, x), (-x, 1e-7)].into_iter().flat_map(move |(x, y)| {
                let near_pole = DVec3::new(x, y, z).normalize();
                [near_pole, DVec3::new(near_pole.z, near_pole.x, near_pole.y), DVec3::new(near_pole.x, near_pole.z, -near_pole.y)]
            })
        })
    });
    let cases: Vec<SamplingCase> =
        random.chain(hard).map(|normal| SamplingCase { normal: normal.as_vec3(), ..case([0x4000_0000; 4]) }).collect();
    let frame_check = |normal: Vec3, tangent: Vec3, bitangent: Vec3| {
        let [n, t, b] = [normal, tangent, bitangent].map(Vec3::as_dvec3);
        let off = [t.dot(t) - 1.0, b.dot(b) - 1.0, t.dot(b), t.dot(n), b.dot(n), t.cross(b).dot(n) - 1.0];
        require(off.iter().all(|off| off.abs() <= 5.0 * ULP), || format!("{normal:?}, {tangent:?}, {bitangent:?}: {off:?} off a frame"))
    };
    let angle_check = |normal: Vec3, unpacked: Vec3, bound: f64| {
        let (n, u) = (normal.as_dvec3(), unpacked.as_dvec3());
        let angle = n.cross(u).length().atan2(n.dot(u));
        require(angle <= bound, || format!("{unpacked:?} is {angle:e} radians off {normal:?}"))
    };
    for math in BOTH {
        for (case, samples) in pairs(&cases, ask(&gpu, math, Filter::Box, &cases)) {
            assert_holds(format!("{math:?}"), frame_check(case.normal, samples.tangent, samples.bitangent));
            assert_holds(format!("{math:?}"), angle_check(case.normal, samples.unpacked_normal, 7e-5));
            assert_holds(format!("{math:?}"), angle_check(case.normal, samples.unpacked_direction, 1.4e-4));
        }
    }
    // As a frame made without regard for the south pole is, and a code of a bit less.
    assert_complains("a frame of the south pole", frame_check(Vec3::NEG_Z, Vec3::X, Vec3::new(0.0, 1.0, 1e-6)));
    assert_complains("a left-handed frame", frame_check(Vec3::Z, Vec3::X, Vec3::NEG_Y));
    assert_complains("a code of a bit less", angle_check(Vec3::Z, Vec3::new(1e-4, 0.0, 1.0), 7e-5));
}

/// Van Oosterom and Strackee 1983.
fn solid_angle([a, b, c]: [DVec3; 3]) -> f64 {
    2.0 * a.dot(b.cross(c)).abs().atan2(1.0 + a.dot(b) + b.dot(c) + c.dot(a))
}

fn turned_left([a, b, c]: [DVec3; 3]) -> [DVec3; 3] {
    if a.dot(b.cross(c)) < 0.0 { [a, c, b] } else { [a, b, c] }
}

/// A spherical triangle in three parts around its incentre, and each of those in 4^depth by the middles of its sides:
/// their areas are known without a quadrature.
fn parts(triangle: [DVec3; 3], depth: u32) -> Vec<[DVec3; 3]> {
    let [a, b, c] = turned_left(triangle);
    let centre = (b.cross(c).length() * a + c.cross(a).length() * b + a.cross(b).length() * c).normalize();
    let quarters = |[a, b, c]: [DVec3; 3]| {
        let [ab, bc, ca] = [(a + b).normalize(), (b + c).normalize(), (c + a).normalize()];
        [[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]
    };
    (0..depth).fold(vec![[a, b, centre], [b, c, centre], [c, a, centre]], |parts, _| parts.into_iter().flat_map(quarters).collect())
}

/// Directions against the even density over a spherical triangle.
fn spherical_triangle_check(what: &str, triangle: [DVec3; 3], directions: &[Vec3]) -> Check {
    let parts = parts(triangle, 3);
    let whole = solid_angle(triangle);
    let sum: f64 = parts.iter().map(|part| solid_angle(*part)).sum();
    require((sum / whole - 1.0).abs() <= 1e-6, || format!("{what}: the parts make {sum}, the whole is {whole}"))?;
    let planes: Vec<[DVec3; 3]> = parts.iter().map(|[a, b, c]| [a.cross(*b), b.cross(*c), c.cross(*a)].map(DVec3::normalize)).collect();
    let mut counts = vec![0u64; parts.len()];
    for direction in directions {
        let depth = |planes: &[DVec3; 3]| planes.iter().map(|normal| normal.dot(direction.as_dvec3())).fold(f64::INFINITY, f64::min);
        let (place, deepest) = planes.iter().map(depth).enumerate().max_by(|a, b| a.1.total_cmp(&b.1)).unwrap();
        require(deepest >= -2048.0 * ULP && direction.is_finite(), || format!("{what}: {direction:?} lies {deepest:e} outside"))?;
        counts[place] += 1;
    }
    counts_check(what, &counts, &parts.iter().map(|part| solid_angle(*part) / whole).collect::<Vec<_>>())
}

/// Corners on a cone around AXIS: (azimuth in turns, height over the plane).
fn corners(places: [(f64, f64); 3]) -> [Vec3; 3] {
    let frame = frame(AXIS, DVec3::X);
    places.map(|(turns, height)| {
        let (sin, cos) = (turns * TAU).sin_cos();
        (frame * DVec3::new(cos, sin, height).normalize()).normalize().as_vec3()
    })
}

#[test]
fn spherical_triangles_are_sampled_evenly() {
    let Some(gpu) = device() else { return };
    let triangles = [
        ("an octant", [Vec3::X, Vec3::Y, Vec3::Z]),
        ("a fat one", corners([(0.0, 1.0), (0.3, 0.7), (0.7, 0.4)])),
        ("a small one", corners([(0.0, 5.0), (0.35, 5.0), (0.7, 4.5)])),
        ("a thin one", corners([(0.0, 0.1), (0.25, 0.12), (0.1, 0.3)])),
        ("a needle", corners([(0.0, 0.0), (0.02, 0.0), (0.35, 4.0)])),
        ("nearly a hemisphere", corners([(0.0, 0.05), (0.3, 0.05), (0.65, 0.05)])),
        ("still more nearly", corners([(0.0, 1e-3), (0.33, 1e-3), (0.67, 1e-3)])),
        ("with a side of nearly half a turn", corners([(0.0, 0.01), (0.497, 0.01), (0.7, 1.0)])),
    ];
    for (seed, (what, triangle)) in triangles.into_iter().enumerate() {
        let math = BOTH[seed % 2];
        let exact = triangle.map(|corner| corner.as_dvec3().normalize());
        let [a, b, c] = triangle;
        let cases: Vec<SamplingCase> = words(seed as u32).step_by(2).map(|words| SamplingCase { a, b, c, ..case(words) }).collect();
        let samples = ask(&gpu, math, Filter::Box, &cases);
        let directions = mapped(&samples, |at| at.in_triangle);
        let off = (f64::from(samples[0].solid_angle) - solid_angle(exact)).abs();
        println!("{math:?}, {what}: {:.4} sr, {off:.1e} off", solid_angle(exact));
        assert!(off < 6e-6, "{math:?}, {what}: {} instead of {} sr", samples[0].solid_angle, solid_angle(exact));
        // Opposite of the second corner little is left of what is made perpendicular to it. Where a light is sampled only
        // the point that the direction leads to counts.
        directions.iter().for_each(|direction| assert_holds(format!("{math:?}"), is_unit(what, *direction, 2048.0 * ULP)));
        assert_holds(format!("{math:?}"), spherical_triangle_check(what, exact, &directions));
        // Evenly by area of the flat triangle is not evenly by solid angle.
        let flat: Vec<Vec3> = samples.iter().map(|at| (a + at.triangle.x * (b - a) + at.triangle.y * (c - a)).normalize()).collect();
        if what != "a small one" {
            assert_complains(&format!("{what} by area"), spherical_triangle_check("fault", exact, &flat));
        }
        let [a, b, c] = exact;
        let wrong = [a, b, (c + 0.1 * b).normalize()];
        assert_complains(&format!("a corner of {what} moved"), spherical_triangle_check("fault", wrong, &directions));
    }
}

/// Triangles of all sizes, those too small to be worth it included.
#[test]
fn solid_angles_are_right_for_every_triangle() {
    let Some(gpu) = device() else { return };
    let cases: Vec<SamplingCase> = words(9)
        .take(30_000)
        .enumerate()
        .map(|(k, at)| {
            let number = |word: u32| f64::from(word) / 2f64.powi(31) - 1.0;
            let spread = 2f64.powi(-((k % 12) as i32));
            let more = philox([k as u32, 1, 0, 0], [9, 9]);
            let centre = DVec3::new(number(at[2]), number(at[3]), number(more[0])).normalize();
            let corner = |word: u32| {
                let offset = philox([word, 2, 0, 0], [9, 9]);
                (centre + spread * DVec3::new(number(offset[0]), number(offset[1]), number(offset[2]))).normalize().as_vec3()
            };
            SamplingCase { a: corner(more[1]), b: corner(more[2]), c: corner(more[3]), ..case(at) }
        })
        .collect();
    for math in BOTH {
        let samples = ask(&gpu, math, Filter::Box, &cases);
        let (mut worst, mut sampled) = (0.0f64, 0);
        for (case, at) in pairs(&cases, samples) {
            let exact = [case.a, case.b, case.c].map(|corner| corner.as_dvec3().normalize());
            let expected = solid_angle(exact);
            if at.solid_angle == 0.0 {
                assert!(expected < 0.05 + 1e-6, "{math:?}: {case:?} has {expected} sr");
                continue;
            }
            assert!(expected > 0.05 - 1e-6, "{math:?}: {case:?} has {expected} sr");
            sampled += 1;
            worst = worst.max((f64::from(at.solid_angle) - expected).abs());
            assert_holds(format!("{math:?}"), is_unit("in a triangle", at.in_triangle, 64.0 * ULP));
            let [a, b, c] = turned_left(exact);
            let depth = [a.cross(b), b.cross(c), c.cross(a)].map(|normal| normal.normalize().dot(at.in_triangle.as_dvec3()));
            let outside = -depth.into_iter().fold(f64::INFINITY, f64::min);
            assert!(outside < 64.0 * ULP, "{math:?}: {:?} lies {outside:e} outside of {case:?}", at.in_triangle);
        }
        println!("{math:?}: {sampled} sampled, solid angles up to {worst:.1e} off");
        assert!(sampled > 3000 && worst < 1e-5, "{math:?}: {sampled} sampled, {worst:e} off");
    }
}

/// One filter's offsets, in pixels.
fn filter_check(what: &str, filter: Filter, offsets: &[(f64, f64)]) -> Check {
    let square = |half: f64| Grid { x: even(-half, half, 20), y: even(-half, half, 20) };
    match filter {
        Filter::Box => density_check(what, offsets, offsets.len(), &square(0.5), ONE, &|_, _| 1.0),
        Filter::Tent => density_check(what, offsets, offsets.len(), &square(1.0), ONE, &|x, y| (1.0 - x.abs()) * (1.0 - y.abs())),
        Filter::Gaussian => {
            let (deviation, end) = (0.5f64, 2.0f64);
            let whole = 1.0 - (-0.5 * (end / deviation).powi(2)).exp();
            let places: Vec<(f64, f64)> = offsets.iter().map(|(x, y)| (x.hypot(*y), y.atan2(*x))).collect();
            let density = |r: f64, _: f64| r * (-0.5 * (r / deviation).powi(2)).exp() / (TAU * deviation * deviation * whole);
            density_check(what, &places, places.len(), &Grid { x: even(0.0, end, 24), y: even(-PI, PI, 12) }, ONE, &density)
        }
    }
}

#[test]
fn pixels_are_sampled_as_their_filters_weigh() {
    let Some(gpu) = device() else { return };
    for (math, filter) in [(Math::Fast, Filter::Box), (Math::Strict, Filter::Tent), (Math::Fast, Filter::Gaussian)] {
        let what = format!("{math:?}, {filter:?} filter");
        let offsets = |cases: &[SamplingCase]| -> Vec<(f64, f64)> {
            mapped(&ask(&gpu, math, filter, cases), |at| (at.filter_offset.x.into(), at.filter_offset.y.into()))
        };
        let found = offsets(&words(4).map(case).collect::<Vec<_>>());
        assert_holds(&what, filter_check(&what, filter, &found));
        let wider: Vec<(f64, f64)> = found.iter().map(|(x, y)| (x * 0.98, y * 0.98)).collect();
        assert_complains("a filter 2 % too narrow", filter_check("fault", filter, &wider));
        let reach = if filter == Filter::Box { 0.5 } else { 2.0 };
        for (x, y) in offsets(&edge_words().map(case).collect::<Vec<_>>()) {
            assert!(x.hypot(y) <= 1.415 * reach && x.abs() <= reach && y.abs() <= reach, "{what}: {x}, {y}");
        }
    }
}

/// All-zero and all-one random words.
#[test]
fn random_words_at_their_ends_give_directions() {
    let Some(gpu) = device() else { return };
    let exponents = [0.0, 0.01, 1.0, 48_826.0, 1e8];
    let cases: Vec<SamplingCase> =
        edge_words().flat_map(|words| exponents.map(|exponent| SamplingCase { exponent, ..case(words) })).collect();
    for math in BOTH {
        for (case, at) in pairs(&cases, ask(&gpu, math, Filter::Box, &cases)) {
            for (what, direction) in [("cosine", at.cosine_hemisphere), ("uniform", at.uniform_hemisphere), ("lobe", at.lobe)] {
                assert_holds(format!("{math:?}, {case:?}"), is_unit(what, direction, 4.0 * ULP));
                assert!(direction.z > 0.0, "{math:?}, {what} of {case:?}: {direction:?} lies in the surface");
            }
            assert_holds(format!("{math:?}, {case:?}"), is_unit("sphere", at.sphere, 4.0 * ULP));
            assert_holds(format!("{math:?}, {case:?}"), is_unit("in a triangle", at.in_triangle, 64.0 * ULP));
            assert!(at.in_triangle.min_element() > -1e-6, "{math:?}, {case:?}: {:?} lies outside of an octant", at.in_triangle);
            assert!(at.disc.is_finite() && at.disc.length() < 1.0 + 1e-6, "{math:?}, {case:?}: {:?}", at.disc);
            let sum = at.triangle.x + at.triangle.y;
            assert!(at.triangle.min_element() >= 0.0 && sum <= 1.0 + 1e-6, "{math:?}, {case:?}: {:?}", at.triangle);
        }
    }
    assert_complains("a vector of no length", is_unit("fault", Vec3::ZERO, 4.0 * ULP));
    assert_complains("what is no number", is_unit("fault", Vec3::splat(f32::NAN), 4.0 * ULP));
}
