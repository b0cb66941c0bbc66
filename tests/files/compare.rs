//! `photonmill compare`: measures with closed forms, z-scores of known noise, FLIP against NVIDIA's own tool, and refusals.

use crate::common::prelude::*;
use image::{ExtendedColorType, ImageFormat};
use photonmill::output::colour::exr;
use photonmill::verify::compare::Comparison;
use photonmill::verify::compare::false_colour::Show;
use photonmill::verify::compare::flip::Flip;
use photonmill::verify::compare::image::{Image, Values};
use photonmill::verify::compare::pair::Pair;
use photonmill::verify::compare::z_scores::ZScores;

fn linear(width: u32, height: u32, colour: impl Fn(u32, u32) -> Vec3) -> Image {
    let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| colour(x, y)).collect();
    Image { path: "a.exr".into(), width, height, values: Values::Linear, pixels, warnings: Vec::new() }
}

/// Independent of each other, by number and seed: standard normal (Box and Muller 1958).
fn normal(seed: u32, number: u32) -> f64 {
    let [a, b, ..] = philox([number, 0, 0, 0], [seed, 0]).map(|word| (f64::from(word) + 0.5) / 2f64.powi(32));
    (-2.0 * a.ln()).sqrt() * (TAU * b).cos()
}

const SIZE: u32 = 64;

/// Errors that differ from pixel to pixel and from channel to channel.
fn errors(scale: f32) -> Image {
    linear(SIZE, SIZE, |x, y| scale * (0.01 + 0.002 * (x % 8) as f32 + 0.001 * (y % 5) as f32) * Vec3::new(1.0, 2.0, 0.5))
}

/// Light, and noise of these errors.
fn noisy(seed: u32, errors: &Image) -> Image {
    let mut picture = linear(errors.width, errors.height, |x, y| Vec3::new(1.0 + 0.01 * x as f32, 1.0, 0.5 + 0.02 * y as f32));
    for (pixel, (colour, error)) in picture.pixels.iter_mut().zip(&errors.pixels).enumerate() {
        *colour += Vec3::from_array([0, 1, 2].map(|channel| error[channel] * normal(seed, 3 * pixel as u32 + channel as u32) as f32));
    }
    picture
}

fn scores(a: &Image, b: &Image, errors: [Option<&Image>; 2]) -> ZScores {
    ZScores::of(&Pair::new(a, b).unwrap(), errors, None).unwrap()
}

/// A quarter more everywhere than a reference of 1/2 and 3/2.
fn offset_check(offset: f32) -> Check {
    let b = linear(8, 4, |x, _| Vec3::splat(if x < 4 { 0.5 } else { 1.5 }));
    let mut a = b.clone();
    a.pixels.iter_mut().for_each(|colour| *colour += offset);
    let comparison = Comparison::new(Pair::new(&a, &b).unwrap(), None);
    let deviation = comparison.deviation;
    let relative = deviation.relative.unwrap();
    let is = |what: &str, found: f64, expected: f64| require(found == expected, || format!("{what}: {found}, not {expected}"));
    is("the mean", deviation.mean_b, 1.0)?;
    is("the RMSE", deviation.rmse, 0.25)?;
    is("the relative RMSE", relative.rmse, 0.25)?;
    is("the bias", relative.bias, 0.25)?;
    is("the largest deviation", deviation.largest.deviation, 0.25)?;
    is("epsilon", relative.epsilon, 0.01f64.powi(2))?;
    relative_check("relMSE", relative.relmse, 0.0625 * (0.5 / 0.2501 + 0.5 / 2.2501), 1e-14)
}

#[test]
fn a_constant_offset_has_closed_forms() {
    assert_holds("an offset of 1/4", offset_check(0.25));
    assert_complains("an offset of 0.251", offset_check(0.251));
}

#[test]
fn the_largest_deviation_is_where_it_is() {
    let b = linear(7, 5, |x, _| Vec3::splat(0.1 * x as f32));
    let mut a = b.clone();
    a.pixels[3 * 7 + 2].y -= 3.0;
    a.pixels[7 + 6].x += 2.0;
    let largest = Comparison::new(Pair::new(&a, &b).unwrap(), None).deviation.largest;
    assert_eq!((largest.x, largest.y, largest.channel), (2, 3, "green"));
    assert!((largest.deviation - 3.0).abs() < 1e-6 && largest.a < 0.0 && largest.b > 0.0, "{largest:?}");
}

/// z-scores of noise of which the errors are known have a mean of 0 and a deviation of 1, within five standard errors of these.
fn unit_check(z: &ZScores) -> Check {
    let count = z.count as f64;
    require(z.count == 3 * (SIZE * SIZE) as usize, || format!("{} z-scores", z.count))?;
    require(z.mean.abs() < 5.0 / count.sqrt(), || format!("mean {}", z.mean))?;
    let deviation = z.standard_deviation;
    require((deviation - 1.0).abs() < 5.0 / (2.0 * count).sqrt(), || format!("standard deviation {deviation}"))?;
    for (found, expected, known) in [(z.beyond_2, z.expected_beyond_2, 0.0455003), (z.beyond_3, z.expected_beyond_3, 0.0026998)] {
        relative_check("the share of a normal distribution", expected, known, 1e-5)?;
        require((found - expected).abs() < 5.0 * (expected / count).sqrt(), || format!("{found} beyond, not {expected}"))?;
    }
    require(z.agree, || format!("they disagree: {:?}, mean {} (p = {:?})", z.largest, z.mean, z.mean_p))
}

#[test]
fn known_noise_has_unit_z_scores() {
    let (of_a, of_b) = (errors(1.0), errors(2.5));
    let (a, b) = (noisy(1, &of_a), noisy(2, &of_b));
    let exact = noisy(0, &errors(0.0));
    assert_holds("both are noisy", unit_check(&scores(&a, &b, [Some(&of_a), Some(&of_b)])));
    assert_holds("the reference is exact", unit_check(&scores(&a, &exact, [Some(&of_a), None])));
    assert_holds("only the reference is noisy", unit_check(&scores(&exact, &b, [None, Some(&of_b)])));

    assert_complains("errors a tenth too small", unit_check(&scores(&a, &exact, [Some(&errors(0.9)), None])));
    assert_complains("errors a tenth too large", unit_check(&scores(&a, &exact, [Some(&errors(1.1)), None])));
    assert_complains("errors of one picture only", unit_check(&scores(&a, &b, [Some(&of_a), None])));
    let mut brighter = a.clone();
    brighter.pixels.iter_mut().for_each(|colour| *colour *= 1.002);
    assert_complains("0.2 % too bright", unit_check(&scores(&brighter, &exact, [Some(&of_a), None])));
}

/// What is wrong by far less than one standard error of a pixel shows in the mean, and a single pixel in the largest z-score.
#[test]
fn pictures_that_differ_disagree() {
    let of_a = errors(1.0);
    let (a, exact) = (noisy(3, &of_a), noisy(0, &errors(0.0)));
    let mut brighter = a.clone();
    brighter.pixels.iter_mut().for_each(|colour| *colour *= 1.004);
    let z = scores(&brighter, &exact, [Some(&of_a), None]);
    assert!(!z.agree && !z.has_outlier() && z.mean_p.unwrap() < 1e-6 && z.mean > 5.0 * z.mean_error.unwrap(), "{}", z.mean);

    let mut spark = a.clone();
    spark.pixels[5 * SIZE as usize + 9].z = exact.pixels[5 * SIZE as usize + 9].z - 7.0 * of_a.pixels[5 * SIZE as usize + 9].z;
    let z = scores(&spark, &exact, [Some(&of_a), None]);
    assert!(!z.agree && z.has_outlier() && z.mean_p.unwrap() > 0.01, "{:?}", z.largest);
    assert_eq!((z.largest.x, z.largest.y, z.largest.channel), (9, 5, "blue"));
    // Both tails beyond 7 are 2.5596e-12, for each of 12288.
    assert!((z.largest.z + 7.0).abs() < 1e-3 && (z.largest.p / (12288.0 * 2.5596e-12) - 1.0).abs() < 0.01, "{:?}", z.largest);
}

/// One pair in a hundred that differs by chance alone is said to disagree: more than 12 of 400 in one run of 1500.
#[test]
fn false_alarms_are_as_rare_as_stated() {
    let error = linear(24, 24, |_, _| Vec3::splat(0.1));
    let exact = noisy(0, &linear(24, 24, |_, _| Vec3::ZERO));
    let disagree = |seed: &u32| !scores(&noisy(1000 + seed, &error), &exact, [Some(&error), None]).agree;
    let alarms = (0..400).filter(disagree).count();
    assert!(alarms <= 12, "{alarms} of 400");
}

/// Errors from the spread of few blocks are uncertain: z-scores are then larger than normal ones, and Student's distribution knows it.
#[test]
fn errors_of_few_blocks_need_their_number() {
    const BLOCKS: u32 = 6;
    let exact = linear(SIZE, SIZE, |_, _| Vec3::ONE);
    let (mut a, mut of_a) = (exact.clone(), exact.clone());
    for pixel in 0..(SIZE * SIZE) as usize {
        for channel in 0..3 {
            let of_block = |block: u32| 1.0 + 0.1 * normal(50 + block, 3 * pixel as u32 + channel as u32);
            let blocks: Vec<f64> = (0..BLOCKS).map(of_block).collect();
            let mean = blocks.iter().sum::<f64>() / f64::from(BLOCKS);
            let squares: f64 = blocks.iter().map(|value| (value - mean).powi(2)).sum();
            a.pixels[pixel][channel] = mean as f32;
            of_a.pixels[pixel][channel] = (squares / f64::from(BLOCKS * (BLOCKS - 1))).sqrt() as f32;
        }
    }
    let pair = Pair::new(&a, &exact).unwrap();
    let of = |blocks| ZScores::of(&pair, [Some(&of_a), None], blocks).unwrap();
    let (without, with) = (of(None), of(Some(BLOCKS)));
    assert!(!without.agree && without.largest.p < 1e-6, "{:?}", without.largest);
    assert!(with.agree && with.largest.p > 0.01, "{:?}", with.largest);
    // Student's distribution with five degrees of freedom has 10.19 % beyond 2 and 3.01 % beyond 3.
    assert!((with.expected_beyond_2 - 0.1019).abs() < 1e-4 && (with.expected_beyond_3 - 0.0301).abs() < 1e-4);
    assert!((with.beyond_2 - 0.1019).abs() < 0.015 && (with.beyond_3 - 0.0301).abs() < 0.008, "{} {}", with.beyond_2, with.beyond_3);
    // Of many blocks it is the normal one.
    let many = of(Some(1 << 20));
    assert!((many.largest.p / without.largest.p - 1.0).abs() < 0.01, "{:?}", many.largest);
}

#[test]
fn unknown_errors_and_exact_values_have_no_z_score() {
    let mut of_a = errors(1.0);
    let (mut a, mut exact) = (noisy(1, &of_a), noisy(0, &errors(0.0)));
    of_a.pixels[0] = Vec3::splat(f32::INFINITY);
    of_a.pixels[1].y = f32::NAN;
    for pixel in 2..12 {
        (of_a.pixels[pixel], a.pixels[pixel], exact.pixels[pixel]) = (Vec3::ZERO, Vec3::ZERO, Vec3::ZERO);
    }
    a.pixels[12].x = f32::NAN;
    let z = scores(&a, &exact, [Some(&of_a), None]);
    assert_eq!((z.unknown_pixels, z.exact_values, z.count), (2, 30, 3 * (SIZE * SIZE) as usize - 9 - 30));
    assert!(z.agree);
    // Where both are certain and differ by more than rounding, that is no chance.
    a.pixels[5].x = 1e-9;
    assert!(!scores(&a, &exact, [Some(&of_a), None]).agree);
    (a.pixels[5].x, exact.pixels[5].x) = (1.0, 1.0 + f32::EPSILON);
    assert!(scores(&a, &exact, [Some(&of_a), None]).agree);
    // Nothing at all.
    let none = linear(SIZE, SIZE, |_, _| Vec3::splat(f32::INFINITY));
    assert_eq!(ZScores::of(&Pair::new(&a, &exact).unwrap(), [Some(&none), None], None), None);
}

#[test]
fn pixels_that_are_no_numbers_are_left_out() {
    let b = linear(20, 10, |x, y| Vec3::new(0.5, 0.1 * x as f32, 0.1 * y as f32));
    let mut a = b.clone();
    a.pixels.iter_mut().for_each(|colour| *colour += 0.125);
    let whole = Comparison::new(Pair::new(&a, &b).unwrap(), None);
    let (mut a_broken, mut b_broken) = (a.clone(), b.clone());
    for (pixel, value) in [(0, f32::NAN), (57, f32::INFINITY), (58, f32::NEG_INFINITY)] {
        a_broken.pixels[pixel].y = value;
    }
    b_broken.pixels[58].z = f32::NAN;
    b_broken.pixels[199] = Vec3::NAN;
    let part = Comparison::new(Pair::new(&a_broken, &b_broken).unwrap(), None);
    let left_out = part.pair.left_out;
    assert_eq!((left_out.a, left_out.b, left_out.pixels), (3, 2, 4));
    assert!((part.deviation.rmse - whole.deviation.rmse).abs() < 1e-6 && part.deviation.mean_a.is_finite());
    let flip = part.flip.unwrap();
    assert!(flip.mean.is_finite() && flip.mean > 0.0 && flip.map.iter().all(|value| value.is_finite()));
    let nothing = linear(20, 10, |_, _| Vec3::NAN);
    let refusal = Pair::new(&nothing, &b).err().unwrap().to_string();
    assert!(refusal.contains("no pixel that is finite"), "{refusal}");
}

/// Codes from 0 to 1 of a picture, and of one that has noise and a greener block. They are higher than what is computed as one.
fn display_pair() -> [Image; 2] {
    let codes = |x: u32, y: u32| [0, 1, 2].map(|channel| ((2 * x + 3 * y + 60 * channel) % 256) as i32);
    let test = |x: u32, y: u32| {
        let mut codes = codes(x, y).map(|code| code + ((31 * x + 17 * y) % 5) as i32 - 2);
        codes[1] += if (30..60).contains(&x) && (50..90).contains(&y) { 20 } else { 0 };
        codes
    };
    let colour = |codes: [i32; 3]| Vec3::from_array(codes.map(|code| code.clamp(0, 255) as f32 / 255.0));
    [linear(96, 150, |x, y| colour(test(x, y))), linear(96, 150, |x, y| colour(codes(x, y)))]
        .map(|picture| Image { values: Values::Display, ..picture })
}

/// Light over 15 stops, and the same with noise.
fn linear_pair() -> [Image; 2] {
    let light = |x: u32, y: u32| ((x + y) as f32 / 16.0 - 4.0).exp2() * Vec3::new(1.0, 0.7, 0.4);
    let noise = |x: u32, y: u32| 1.0 + 0.05 * (((31 * x + 17 * y) % 5) as f32 - 2.0);
    [linear(96, 150, |x, y| noise(x, y) * light(x, y)), linear(96, 150, light)]
}

fn flip_of([a, b]: &[Image; 2]) -> Flip {
    Flip::of(&Pair::new(a, b).unwrap()).unwrap()
}

/// Numbers of NVIDIA's `flip-evaluator` 1.7 at 67 pixels per degree. It keeps floats where pictures have 8 bits here.
#[test]
fn flip_is_that_of_its_authors() {
    let largest = |flip: &Flip| flip.map.iter().copied().fold(0.0, f32::max);
    let display = flip_of(&display_pair());
    assert!((display.mean - 0.0355928).abs() < 2e-6, "{}", display.mean);
    assert!((largest(&display) - 0.453969).abs() < 1e-5 && (display.map[70 * 96 + 45] - 0.370424).abs() < 1e-5);
    assert!((display.map[64 * 96 + 10] - 0.0051526).abs() < 1e-6 && display.exposures.is_empty());

    let linear = flip_of(&linear_pair());
    assert_eq!(linear.exposures.len(), 8);
    assert!((linear.exposures[0] + 9.73643).abs() < 1e-4 && (linear.exposures[7] + 2.11143).abs() < 1e-4, "{:?}", linear.exposures);
    // The same with the tool's inputs rounded to 8 bits.
    assert!((linear.mean - 0.018262).abs() < 5e-5 && (largest(&linear) - 0.070774).abs() < 1e-3, "{}", linear.mean);
    assert!((linear.mean - 0.010952).abs() < 0.008);
}

#[test]
fn flip_sees_differences_only() {
    for [a, b] in [display_pair(), linear_pair()] {
        let same = flip_of(&[b.clone(), b.clone()]);
        assert!(same.mean == 0.0 && same.map.iter().all(|value| *value == 0.0));
        let other = flip_of(&[a, b]);
        assert!(other.map.iter().all(|value| (0.0..=1.0).contains(value)) && other.mean > 0.0);
    }
    // A reference that is mostly black still has exposures, a black one has none.
    let [dot, black] = [1.0, 0.0].map(|light| linear(9, 9, |x, y| Vec3::splat(if (x, y) == (4, 4) { light } else { 0.0 })));
    assert!(flip_of(&[black.clone(), dot.clone()]).mean > 0.0);
    assert_eq!(Flip::of(&Pair::new(&dot, &black).unwrap()), None);
    // Values that no tone curve expects.
    let odd = linear(9, 9, |x, _| Vec3::splat(if x < 4 { -1.0 } else { f32::MAX }));
    assert!(flip_of(&[dot, odd]).mean.is_finite());
}

#[test]
fn false_colours_are_the_map_s() {
    let b = linear(6, 1, |_, _| Vec3::ONE);
    let a = linear(6, 1, |x, _| match x {
        0 => Vec3::ONE,
        1 => Vec3::new(1.0, 3.0, 1.0),
        2 => Vec3::splat(1.0 + 10f32.powf(-1.5)),
        3 => Vec3::splat(0.5),
        4 => Vec3::splat(0.9),
        _ => Vec3::NAN,
    });
    let error = linear(6, 1, |x, _| Vec3::splat(if x == 4 { f32::INFINITY } else { 0.1 }));
    let pair = || Pair::new(&a, &b).unwrap();
    let comparison = Comparison::new(pair(), ZScores::of(&pair(), [Some(&error), None], None));
    let colours = |show| {
        let picture = image::load_from_memory(&comparison.false_colour(show).unwrap()).unwrap().into_rgb8();
        picture.pixels().map(|pixel| pixel.0).collect::<Vec<_>>()
    };
    let (black, yellow, grey) = ([0, 0, 4], [252, 253, 191], [128; 3]);
    let difference = colours(Show::Difference);
    assert_eq!((difference[0], difference[1], difference[5]), (black, yellow, grey));
    // The middle of the scale is magma's.
    assert!(difference[2][0].abs_diff(182) < 4 && difference[2][1].abs_diff(55) < 4 && difference[2][2].abs_diff(122) < 4);
    let z = colours(Show::Z);
    assert_eq!((z[0], z[1], z[3], z[4], z[5]), (black, yellow, yellow, grey, grey));
    assert_eq!(colours(Show::Flip).len(), 6);
    // Numbers that do not exist have no picture.
    let black = linear(6, 1, |_, _| Vec3::ZERO);
    let comparison = Comparison::new(Pair::new(&a, &black).unwrap(), None);
    assert!([Show::Difference, Show::Z, Show::Flip].into_iter().all(|show| comparison.false_colour(show).is_none()));
}

/// A folder with pictures of 16 x 12 pixels: `b.exr`, `a.exr` 1/8 brighter, errors of 1/8, and 8-bit codes.
fn place_with_pictures() -> Place {
    let place = Place::new();
    let light = |x: u32, y: u32| Vec3::new(0.25 + 0.125 * (x % 4) as f32, 0.5, 0.125 * (1 + y % 8) as f32);
    let write = |name: &str, picture: &Image| place.write(name, exr(picture.width, picture.height, &picture.pixels));
    write("b.exr", &linear(16, 12, light));
    write("a.exr", &linear(16, 12, |x, y| light(x, y) + 0.125));
    write("e.exr", &linear(16, 12, |_, _| Vec3::splat(0.125)));
    write("small.exr", &linear(8, 12, light));
    write("unknown.exr", &linear(16, 12, |_, _| Vec3::splat(f32::INFINITY)));
    write("negative.exr", &linear(16, 12, |x, y| Vec3::splat(if (x, y) == (3, 2) { -0.5 } else { 1.0 })));
    write("nan.exr", &linear(16, 12, |_, _| Vec3::NAN));
    write("black.exr", &linear(16, 12, |_, _| Vec3::ZERO));
    let codes = |name: &str, kind: ExtendedColorType, codes: &[u8]| {
        image::save_buffer_with_format(place.at(name), codes, 16, 12, kind, ImageFormat::Png).unwrap();
    };
    codes("rgb.png", ExtendedColorType::Rgb8, &[100; 16 * 12 * 3]);
    codes("brighter.png", ExtendedColorType::Rgb8, &[151; 16 * 12 * 3]);
    codes("rgba.png", ExtendedColorType::Rgba8, &[100; 16 * 12 * 4]);
    codes("grey.png", ExtendedColorType::L8, &[100; 16 * 12]);
    codes("fine.png", ExtendedColorType::Rgb16, &[100; 16 * 12 * 6]);
    let with_alpha = image::Rgba32FImage::from_fn(16, 12, |x, y| image::Rgba(light(x, y).extend(0.5).to_array()));
    image::DynamicImage::from(with_alpha).save_with_format(place.at("rgba.exr"), ImageFormat::OpenExr).unwrap();
    let shared_exponent = image::Rgb32FImage::from_fn(16, 12, |x, y| image::Rgb(light(x, y).to_array()));
    image::DynamicImage::from(shared_exponent).save_with_format(place.at("b.hdr"), ImageFormat::Hdr).unwrap();
    place.write("empty.exr", "");
    place.write("text.exr", "not a picture\n");
    for (name, whole) in [("cut.exr", "b.exr"), ("cut.png", "rgb.png")] {
        let whole = std::fs::read(place.at(whole)).unwrap();
        place.write(name, &whole[..whole.len() - 30]);
    }
    place
}

/// Neither a device nor its options are needed.
#[track_caller]
fn compared(place: &Place, line: &str) -> (String, String) {
    let output = place.run_without_vulkan(&format!("compare {line}"));
    assert!(output.status.success(), "{line}: {}", text(&output.stderr));
    (text(&output.stdout), text(&output.stderr))
}

#[test]
fn a_comparison_is_printed_and_written() {
    let place = place_with_pictures();
    let (stdout, stderr) = compared(&place, "a.exr b.exr --errors-a e.exr --error-blocks 64 -o z.png --show z --json j.json");
    assert!(stderr.is_empty(), "{stderr}");
    for line in [
        "a.exr against the reference b.exr: 16 x 12 pixels of linear values",
        "RMSE: 0.1250, 26.5 % of the reference's mean",
        "relMSE: ",
        "bias: +26.471 % of the reference's mean (means 0.5972 and 0.4722)",
        "largest deviation: 0.1250 at column 0, row 0, red: 0.3750 instead of 0.2500",
        "FLIP: ",
        "z-scores: mean +1.000 +- 0.000, standard deviation 0.000, 0 % beyond 2 and 0 % beyond 3 (by chance 4.98 % and 0.386 %)",
        "largest z-score: +1.00 at column 0, row 0, red; p = 1.000 for the largest of 576 (Sidak)",
        "verdict: the pictures DISAGREE beyond their errors: the mean z-score is farther from 0 than by chance",
        "wrote z.png: the z-score's size from 0 (black) to 5 (pale yellow)",
    ] {
        assert!(stdout.lines().any(|found| found.starts_with(line)), "{line}: {stdout}");
    }
    assert_eq!(place.picture("z.png").into_rgb8().dimensions(), (16, 12));
    let json = place.json("j.json");
    let number = |at: &str| json.pointer(at).and_then(serde_json::Value::as_f64).unwrap_or_else(|| panic!("{at}: {json}"));
    assert_eq!((number("/rmse"), number("/z/mean"), number("/z/degrees_of_freedom"), number("/left_out/pixels")), (0.125, 1.0, 63.0, 0.0));
    assert!((number("/relative/bias") - 0.26471).abs() < 1e-5 && number("/flip/mean") > 0.0 && number("/relative/relmse") > 0.0);
    assert_eq!((&json["a"], &json["values"], &json["z"]["agree"]), (&"a.exr".into(), &"linear".into(), &false.into()));

    // Where standard output is the JSON, people read on standard error.
    let (stdout, stderr) = compared(&place, "b.exr b.exr --json");
    let json: serde_json::Value = serde_json::from_str(&stdout).unwrap();
    assert_eq!((&json["rmse"], &json["flip"]["mean"], &json["z"]), (&0.0.into(), &0.0.into(), &serde_json::Value::Null));
    assert!(stderr.contains("largest deviation: none, all values are equal"), "{stderr}");
}

#[test]
fn pictures_of_codes_are_compared_as_they_are_shown() {
    let place = place_with_pictures();
    let (stdout, stderr) = compared(&place, "brighter.png rgb.png");
    assert!(stdout.contains("display values") && stdout.contains("RMSE: 0.2000, 51.0 %") && stderr.is_empty(), "{stdout}{stderr}");
    for (line, warning) in [
        ("rgba.png rgb.png", "photonmill: warning: rgba.png: its alpha channel is ignored\n"),
        ("grey.png rgb.png", "photonmill: warning: grey.png: it is grey, and compared as three equal channels\n"),
        ("rgba.exr b.exr", "photonmill: warning: rgba.exr: its alpha channel is ignored\n"),
        ("b.hdr b.exr", ""),
        ("fine.png rgb.png", ""),
    ] {
        let (stdout, stderr) = compared(&place, line);
        assert!(stdout.contains("all values are equal"), "{line}: {stdout}");
        assert_eq!(stderr, warning, "{line}");
    }
    // A black reference is compared, though nothing is relative to it.
    let (stdout, _) = compared(&place, "a.exr black.exr");
    assert!(stdout.contains("the reference's mean is not above 0") && stdout.contains("FLIP: none"), "{stdout}");
}

/// Whatever was found, a comparison is a success, unless a limit is set and exceeded.
#[test]
fn a_limit_decides_the_exit_code() {
    let place = place_with_pictures();
    let code = |line: &str| {
        let output = place.run_without_vulkan(&format!("compare {line}"));
        (output.status.code(), text(&output.stdout), text(&output.stderr))
    };
    assert_eq!(code("a.exr b.exr").0, Some(0));
    assert_eq!(code("a.exr b.exr --fail-above 27%").0, Some(0));
    assert_eq!(code("b.exr b.exr --fail-above 0").0, Some(0));
    assert_eq!(code("black.exr black.exr --fail-above 0").0, Some(0));
    assert_eq!(code("a.exr black.exr --fail-above 100%").0, Some(1));
    let (failed, stdout, stderr) = code("a.exr b.exr --fail-above 25% --json j.json -o d.png");
    assert_eq!((failed, &*stderr), (Some(1), "photonmill: --fail-above 25.0 %: the RMSE of a.exr is 26.5 % of the reference's mean\n"));
    assert!(stdout.contains("RMSE: ") && place.at("j.json").exists() && place.at("d.png").exists(), "{stdout}");
}

#[test]
fn what_cannot_be_compared_is_refused_in_one_line() {
    let place = place_with_pictures();
    let cases: [(&str, &[&str]); 30] = [
        ("", &["required: <A> and <B>", "photonmill compare picture.exr reference.exr"]),
        ("a.exr", &["required: <B>", "photonmill compare picture.exr reference.exr"]),
        ("absent.exr b.exr", &["absent.exr: cannot be read", "no such file"]),
        ("a.exr absent.exr", &["absent.exr: cannot be read", "no such file"]),
        (". b.exr", &[".: is no file"]),
        ("empty.exr b.exr", &["empty.exr: is empty"]),
        ("text.exr b.exr", &["text.exr: is no OpenEXR (.exr), Radiance (.hdr) or PNG picture", "convert"]),
        ("cut.exr b.exr", &["cut.exr: is cut off", "again"]),
        ("cut.png rgb.png", &["cut.png: ", "again"]),
        ("a.exr small.exr", &["a.exr: is 16 x 12", "small.exr is 8 x 12", "same size"]),
        ("rgb.png b.exr", &["rgb.png: has display values", "b.exr has linear values", "two .exr"]),
        ("a.exr rgb.png", &["a.exr: has linear values", "rgb.png has display values", "two .png"]),
        ("nan.exr b.exr", &["nan.exr: has no pixel that is finite", "again"]),
        ("a.exr b.exr --errors-a absent.exr", &["--errors-a absent.exr: cannot be read", "no such file"]),
        ("a.exr b.exr --errors-b small.exr", &["--errors-b small.exr: is 8 x 12", "16 x 12", "same render"]),
        ("a.exr b.exr --errors-b rgb.png", &["--errors-b rgb.png: has display values", "render --error-image"]),
        ("a.exr b.exr --errors-a negative.exr", &["--errors-a negative.exr: is negative at column 3, row 2", "render --error-image"]),
        ("a.exr b.exr --errors-a unknown.exr", &["--errors-a unknown.exr: has no finite error", "eight blocks"]),
        ("rgb.png rgb.png --errors-a e.exr", &["--errors-a e.exr: is for linear pictures", "rgb.png", ".exr"]),
        ("a.exr b.exr --error-blocks 5", &["--error-blocks 5: needs --errors-a"]),
        ("a.exr b.exr --errors-a e.exr --error-blocks 1", &["--error-blocks 1: must be from 2 to 1048576"]),
        ("a.exr b.exr -o d.exr", &["-o d.exr: must be a file name that ends in .png"]),
        ("a.exr b.exr --show flip", &["--show flip: needs -o FILE"]),
        ("a.exr b.exr --show z -o d.png", &["--show z: needs --errors-a"]),
        ("a.exr b.exr --show heat -o d.png", &["--show heat", "difference, z, flip"]),
        ("a.exr black.exr -o d.png", &["-o d.png: ", "black reference"]),
        ("rgb.png rgba.png -o ./rgb.png", &["-o ./rgb.png: cannot be written", "it is also read"]),
        ("a.exr b.exr --errors-a e.exr --json e.exr", &["--json e.exr: cannot be written", "it is also read"]),
        ("a.exr b.exr -o d.png --json ./d.png", &["-o writes it too"]),
        ("a.exr b.exr --fail-above -1%", &["--fail-above -1%: must be 0 % or more"]),
    ];
    place.assert_refused(cases.map(|(line, words)| (format!("compare {line}"), words)));
    assert!(place.refusal("compare a.exr b.exr").is_err(), "what can be compared is not refused");
}

/// Files whose bytes were changed: a picture, or one line.
#[test]
fn pictures_of_any_bytes_are_read_or_refused() {
    let place = place_with_pictures();
    for name in ["b.exr", "b.hdr", "rgba.png", "fine.png"] {
        let whole = std::fs::read(place.at(name)).unwrap();
        assert!(Image::read(&place.at(name)).is_ok(), "{name}");
        let refused = (0..300u32).filter(|number| {
            let [place_of, value, is_head, _] = philox([*number, 0, 0, 0], [7, 0]);
            let mut content = whole.clone();
            let within = if is_head % 2 == 0 { content.len().min(100) } else { content.len() };
            content[place_of as usize % within] = value as u8;
            place.write("changed", &content);
            let read = Image::read(&place.at("changed"));
            match &read {
                Ok(picture) => assert_eq!(picture.pixels.len(), (picture.width * picture.height) as usize, "{name} {number}"),
                Err(reason) => assert_eq!(reason.lines().count(), 1, "{name} {number}: {reason}"),
            }
            read.is_err()
        });
        assert!(refused.count() > 10, "{name}");
    }
}
