//! `--math strict`: functions that are right and the same on every device, photons that the CPU builder traces to
//! the bit, and films whose bits are written down in `tests/common/bits.rs`.

use std::f32::consts::{FRAC_PI_2, PI};

use crate::common::bits::{self, BITS, picture, small};
use crate::common::planted;
use crate::common::prelude::*;
use photonmill::cpu;
use photonmill::engine::room;
use photonmill::engine::room::film::RoomFilm;
use photonmill::gpu::check;
use photonmill::records::MathResults;

/// Numbers of every size, evenly over exponents and mantissas, and those at which functions change their ways.
fn operands() -> Vec<Vec2> {
    #[rustfmt::skip]
    let odd = [
        0.0, 1.0, 2.0, 3.0, 0.5, 1.0 - f32::EPSILON / 2.0, 1.0 + f32::EPSILON, 2.0 - f32::EPSILON, 16_777_215.0, 16_777_217.0,
        f32::MIN_POSITIVE, 1e-40, f32::from_bits(1), f32::MAX, f32::INFINITY, std::f32::consts::SQRT_2, 0.414_213_57, 1e-30, 1e30,
        125.5, 127.5, 128.0,
    ];
    let signed: Vec<f32> = odd.iter().flat_map(|number| [*number, -number]).collect();
    let pairs = signed.iter().flat_map(|a| signed.iter().map(|b| Vec2::new(*a, *b)));
    let random = (0..1 << 17).map(|k| {
        let words = philox([k, 0, 0, 0], [7, 7]);
        // Half of them near 1, where angles and exponentials are used.
        let number = |word: u32| {
            let exponent = if k % 2 == 0 { 1 + (word >> 8) % 254 } else { 117 + (word >> 8) % 17 };
            f32::from_bits((word << 31) | (exponent << 23) | (word >> 9))
        };
        Vec2::new(number(words[0]), number(words[1]))
    });
    pairs.chain(random).collect()
}

/// What IEEE 754 rounds to nearest, with results too small for a normal number taken for 0.
fn flushed(x: f32) -> f32 {
    if x.is_subnormal() { 0.0f32.copysign(x) } else { x }
}

fn same_number(what: &str, operand: Vec2, found: f32, expected: f32) -> Check {
    // The smallest normal number may be what a still smaller one was rounded up to.
    let same = found.to_bits() == expected.to_bits()
        || (found.is_nan() && expected.is_nan())
        || (found == 0.0 && expected.abs() == f32::MIN_POSITIVE && found.is_sign_negative() == expected.is_sign_negative());
    if same { Ok(()) } else { Err(format!("{what} of {operand:?}: {found:e} instead of {expected:e}")) }
}

/// Off the f64 value by at most `ulps` units in the last place.
fn near(what: &str, operand: Vec2, found: f32, expected: f64, ulps: f64) -> Check {
    let unit = f64::from(f32::from_bits((expected as f32).abs().to_bits() + 1)) - f64::from((expected as f32).abs());
    let off = (f64::from(found) - expected).abs() / unit;
    if off <= ulps { Ok(()) } else { Err(format!("{what} of {operand:?}: {found:e} instead of {expected:e}, {off:.1} units off")) }
}

/// a b + a, of a device that keeps subnormal operands, products and sums, or takes them for 0. Whether a result is
/// subnormal may be asked before it is rounded.
fn check_sum(operand: Vec2, found: f32) -> Check {
    let of = |kinds: u32| {
        let kept = |kind: u32, x: f32, exact: f64| {
            let tiny = exact.abs() < f64::from(f32::MIN_POSITIVE);
            if kinds & kind != 0 && tiny { 0.0f32.copysign(x) } else { x }
        };
        let [a, b] = [operand.x, operand.y].map(|x| kept(1, x, f64::from(x)));
        let product = kept(2, a * b, f64::from(a) * f64::from(b));
        kept(4, product + a, f64::from(product) + f64::from(a))
    };
    let expected = of(0);
    let same = |expected: f32| found.to_bits() == expected.to_bits() || (found.is_nan() && expected.is_nan());
    if expected.is_nan() || (0..8).any(|kinds| same(of(kinds))) {
        return Ok(());
    }
    Err(format!("a b + a of {operand:?}: {found:e} instead of {expected:e}"))
}

/// In [-pi, pi], 0 for the origin, and above 0 where y is -0.
fn check_angle(y: f32, x: f32, found: f32) -> Check {
    let zeroed = |x: f32| if x == 0.0 || x.is_subnormal() { 0.0 } else { f64::from(x) };
    let expected = zeroed(y).atan2(zeroed(x));
    if expected.abs() < f64::from(f32::MIN_POSITIVE) && found.abs() <= f32::MIN_POSITIVE {
        return Ok(());
    }
    near("angle", Vec2::new(y, x), found, expected, 3.0)
}

fn check_functions(operand: Vec2, found: &MathResults) -> Check {
    same_number("conversion", operand, found.converted, operand.x.to_bits() as f32)?;
    check_sum(operand, found.sum_of_product)?;
    if !(operand.x.is_infinite() && operand.y.is_infinite()) {
        check_angle(operand.x, operand.y, found.angle)?;
        same_number("angle, against its twin", operand, found.angle, flushed(cpu::math::angle_of(operand.x, operand.y)))?;
    }
    let (a, b) = (flushed(operand.x), flushed(operand.y));
    same_number("a / b", operand, found.quotient, flushed(a / b))?;
    same_number("root", operand, found.root, flushed(a.sqrt()))?;
    if a > 0.0 && a.is_finite() {
        same_number("inverse root", operand, found.inverse_root, flushed(1.0 / a.sqrt()))?;
        same_number("logarithm, against its twin", operand, found.log2, cpu::math::log2(a))?;
        // Near 1 the logarithm's own size is the measure.
        near("logarithm", operand, found.log2, f64::from(a).log2(), 3.0)?;
    }
    if a.is_finite() {
        same_number("power", operand, found.exp2, cpu::math::exp2(a))?;
        if (-125.0..128.0).contains(&a) {
            near("power", operand, found.exp2, f64::from(a).exp2(), 2.0)?;
        }
        if a.abs() > 1e-18 && a.abs() < 1e18 {
            near("asinh", operand, found.asinh, f64::from(a).asinh(), 6.0)?;
        }
    }
    Ok(())
}

/// Quotients and roots as IEEE 754 rounds them; the other functions within their bounds, and as their twins have them.
#[test]
fn functions_are_right_to_the_bit() {
    let Some(gpu) = device() else { return };
    let operands = operands();
    let results = check::math(&gpu, &operands).unwrap();
    for (operand, found) in pairs(&operands, &results) {
        assert_holds("strict", check_functions(*operand, found));
    }
    let (operand, found) = (Vec2::new(3.0, 7.0), check::math(&gpu, &[Vec2::new(3.0, 7.0)]).unwrap()[0]);
    assert_holds("three sevenths", check_functions(operand, &found));
    let next = |x: f32| f32::from_bits(x.to_bits() + 1);
    assert_complains("a quotient one unit off", check_functions(operand, &MathResults { quotient: next(found.quotient), ..found }));
    assert_complains("a root one unit off", check_functions(operand, &MathResults { root: next(found.root), ..found }));
    assert_complains("a power off its twin", check_functions(operand, &MathResults { exp2: next(found.exp2), ..found }));
    assert_complains("an angle 0.001 % off", check_functions(operand, &MathResults { angle: 1.00001 * found.angle, ..found }));
    let fused = |at: &Vec2| at.x.mul_add(at.y, at.x);
    let place = operands.iter().position(|at| fused(at).is_normal() && fused(at) != at.x * at.y + at.x).unwrap();
    let fused = MathResults { sum_of_product: fused(&operands[place]), ..results[place] };
    assert_complains("a product and a sum in one", check_functions(operands[place], &fused));
    assert_complains("an integer one unit off", check_functions(operand, &MathResults { converted: next(found.converted), ..found }));
    let tiny = f32::from_bits(1);
    for (y, x, angle) in [
        (0.0, 0.0, 0.0),
        (-0.0, -0.0, 0.0),
        (0.0, 2.0, 0.0),
        (0.0, -1.0, PI),
        (-0.0, -1.0, PI),
        (-tiny, -1.0, PI),
        (3.0, -0.0, FRAC_PI_2),
        (-3.0, tiny, -FRAC_PI_2),
        (tiny, -tiny, 0.0),
    ] {
        let found = check::math(&gpu, &[Vec2::new(y, x)]).unwrap()[0].angle;
        assert_eq!(found, angle, "angle of ({x:e}, {y:e})");
    }
    assert_complains("a negative half turn", check_angle(0.0, -1.0, -PI));
    assert_complains("no number at the origin", check_angle(tiny, tiny, f32::NAN));
}

/// The functions with guesses of quotients and roots that are so many units off. The quotient's comes from a long
/// division, so that it is off by that much whatever the device's own is.
fn spoiled_guesses(quotient: i32, root: i32) -> Vec<(String, Vec<u32>)> {
    // As many units in the last place, of what is not 0.
    let spoiled = |name: &str, value: &str, units: i32| {
        format!(
            "{name} {{ float exact = {value}; return exact == 0.0 ? exact : uintBitsToFloat(floatBitsToUint(exact) + uint({units})); }}"
        )
    };
    let long_division = format!(
        "uint quotient = 0, rest = dividend;
         for (uint i = 0; i <= shift; i++) {{
             uint digit = uint(rest >= divisor);
             quotient = 2 * quotient + digit;
             rest = 2 * (rest - digit * divisor);
         }}
         quotient += uint({quotient});"
    );
    let changes = [
        (
            "float native_quotient(float a, float b) { return a / b; }",
            // Of which roots are made too.
            spoiled("float native_quotient(float a, float b)", "a / b", quotient),
        ),
        ("float native_root(float x) { return sqrt(x); }", spoiled("float native_root(float x)", "sqrt(x)", root)),
        ("uint quotient = uint(native_quotient(float(dividend), float(divisor)) * float(1u << shift));", long_division),
    ];
    planted::kernels(&["check_math"], "math/math.glsl", &changes.each_ref().map(|(from, to)| (*from, to.as_str())))
}

/// Corrections that never run where a device guesses right. Vulkan allows a quotient 2.5 units in the last place, 3 once
/// it is cut to an integer, and a root those of 1 / inversesqrt, 6.5 units of the root.
#[test]
fn guesses_as_far_off_as_vulkan_allows_change_no_bit() {
    let Some(mut gpu) = device() else { return };
    let operands = operands();
    let expected = check::math(&gpu, &operands).unwrap();
    let mut results_of = |quotient, root| {
        gpu.replace(spoiled_guesses(quotient, root));
        check::math(&gpu, &operands).unwrap()
    };
    let same = |found: &[MathResults]| {
        let differing = pairs(&operands, pairs(found, &expected)).find(|(_, (a, b))| bytemuck::bytes_of(*a) != bytemuck::bytes_of(*b));
        differing.map_or(Ok(()), |(operand, (a, b))| Err(format!("of {operand:?}: {a:?} instead of {b:?}")))
    };
    for (quotient, root) in [(-3, -7), (-1, 0), (1, 1), (3, 7)] {
        let found = results_of(quotient, root);
        assert_holds(format!("guesses {quotient} and {root} off"), same(&found));
        for (operand, found) in pairs(&operands, &found) {
            assert_holds("strict", check_functions(*operand, found));
        }
    }
    assert_complains("a quotient six off", same(&results_of(6, 0)));
    assert_complains("a root a hundred units off", same(&results_of(0, 100)));
}

/// The check at the start of every strict run.
pub fn rounding_check(gpu: &Gpu) -> Check<Complaint> {
    check::strict_math(gpu).map_err(|error| match error {
        Error::DeviceWrong { what, .. } => Complaint::new(Kind::Misrounded, what),
        error => error.into(),
    })
}

fn strict(settings: &RoomSettings) -> RoomSettings {
    RoomSettings { math: Math::Strict, ..settings.clone() }
}

/// A builder of the device stores the photons that are expected, bit for bit.
pub fn photons_agree(gpu: &Gpu, settings: &RoomSettings, expected: &[Photon]) -> Check<Complaint> {
    same_photons(&room::photons_on_gpu(gpu, &open_box(settings), settings)?, expected)
}

/// A run on the device leaves the film that is expected, bit for bit.
pub fn film_agrees(gpu: &Gpu, settings: &RoomSettings, expected: &RoomFilm) -> Check<Complaint> {
    same_sums("the film", &room_result_of(gpu, &open_box(settings), settings)?.film.sums, &expected.sums)
}

/// The paper's box: the device's photons and films are the CPU builder's, bit for bit; in the long run those of every builder under each of
/// these settings, and not only under the first.
#[test]
fn the_cpu_builder_agrees_to_the_bit() {
    let Some(gpu) = device() else { return };
    for (emission, shininess, rng) in [
        (EmissionLaw::Uniform, [None; 5], Rng::Rand48),
        (EmissionLaw::Cosine, [Some(0.01), Some(0.5), Some(2.0), Some(5.0), Some(1e4)], Rng::Rand48),
        (EmissionLaw::Uniform, [None; 5], Rng::Sobol),
    ] {
        let settings = strict(&RoomSettings { photons: 50_001, emission, shininess, rng, threads: 2, mesh: 32, ..RoomSettings::default() });
        assert_holds(format!("{emission:?}"), photons_agree(&gpu, &settings, &photons_on_cpu(&settings)));
        let on_cpu = run_on_cpu(&settings).film;
        let is_first = emission == EmissionLaw::Uniform && rng == Rng::Rand48;
        for builder in Builder::ON_GPU.into_iter().filter(|builder| is_long_run() || is_first || *builder == settings.builder) {
            let settings = RoomSettings { builder, ..settings.clone() };
            assert_holds(format!("{emission:?}, {builder:?}"), film_agrees(&gpu, &settings, &on_cpu));
        }
    }
}

/// In the short run of mirrors, glass and caustics, and of the paper's box.
#[test]
fn every_device_finds_these_bits() {
    let Some(gpu) = device() else { return };
    let names = of_run(vec!["cornell-spheres", "the paper's box"], BITS.map(|(name, _)| name).to_vec());
    let differing: Vec<String> = names.iter().filter_map(|name| bits::check(&gpu, name).err()).map(|complaint| complaint.text).collect();
    assert!(differing.is_empty(), "{} of {} differ:\n{}", differing.len(), names.len(), differing.join("\n"));
}

/// Rounding changes which way single paths go, and nothing on the whole.
#[test]
#[ignore = "long: kernels of both arithmetics"]
fn fast_and_strict_differ_by_far_less_than_the_noise() {
    let Some(gpu) = device() else { return };
    let scene = built_in::by_name("cornell-spheres").unwrap();
    let settings = SceneSettings { rounds: 4, ..small() };
    let result = [Math::Fast, Math::Strict].map(|math| picture(&gpu, &scene, &SceneSettings { math, ..settings.clone() }));
    let rms = |f: &dyn Fn(usize) -> f64| (0..result[0].film.pixels()).map(|pixel| f(pixel).powi(2)).sum::<f64>().sqrt();
    let difference = rms(&|pixel| (result[0].film.mean(pixel) - result[1].film.mean(pixel)).length());
    let noise = rms(&|pixel| result[1].film.standard_error(pixel).length());
    println!("difference over noise: {:.2e}", difference / noise);
    assert!(difference < 1e-3 * noise, "{difference} against {noise}");
}
