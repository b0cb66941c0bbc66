//! Validation accepts what the documented ranges allow, and nothing else: every field set to the edges of its range,
//! their neighbours and anything between, alone and together, judged by rules that are written down here again.

use crate::common::prelude::*;
use crate::fuzz::change::Random;
use photonmill::error::Result;
use photonmill::text::echo;

const CASES: usize = 40_000;

fn word(random: &mut Random) -> u64 {
    random.below(1);
    random.0 ^ random.0 >> 33
}

/// An end of what is allowed, a neighbour of one, or any number.
fn count(random: &mut Random, least: u32, most: u32) -> u32 {
    let any = word(random) as u32 >> random.below(32);
    random.pick(&[least, least + 1, least.wrapping_sub(1), most, most.wrapping_sub(1), most.wrapping_add(1), 0, u32::MAX, any])
}

fn number(random: &mut Random, least: f64, most: f64) -> f64 {
    let any = f64::from_bits(word(random) << 32 | word(random) >> 32);
    let between = least + (most - least) * random.below(1 << 20) as f64 / f64::from(1 << 20);
    let odd = [0.0, -0.0, -least, -most, f64::MIN_POSITIVE, f64::MAX, f64::INFINITY, f64::NEG_INFINITY, f64::NAN, any];
    match random.below(3) {
        0 => random.pick(&[least, least.next_up(), least.next_down(), most, most.next_down(), most.next_up()]),
        1 => between,
        _ => random.pick(&odd),
    }
}

fn number_f32(random: &mut Random, least: f32, most: f32) -> f32 {
    let edges = [least, least.next_up(), least.next_down(), most, most.next_down(), most.next_up()];
    if random.below(2) == 0 { random.pick(&edges) } else { number(random, f64::from(least), f64::from(most)) as f32 }
}

/// What one rule says: whether it holds, and how the line starts that refuses what breaks it.
struct Rule {
    holds: bool,
    refusal: String,
}

fn rule(field: &str, value: impl ToString, holds: bool) -> Rule {
    Rule { holds, refusal: format!("`{field}` {}: ", echo(value.to_string())) }
}

/// Compares validation with the rules, case by case. Every rule must have been the only broken one somewhere, else
/// the cases prove less than they seem to.
fn judge<S: std::fmt::Debug>(make: impl Fn(&mut Random) -> S, rules: impl Fn(&S) -> Vec<Rule>, validate: impl Fn(&S) -> Result<()>) {
    let mut never: BTreeSet<usize> = (0..rules(&make(&mut Random(1))).len()).collect();
    let (mut random, mut accepted) = (Random(1), 0);
    for _ in 0..CASES {
        let settings = make(&mut random);
        let rules = rules(&settings);
        let broken: Vec<usize> = (0..rules.len()).filter(|k| !rules[*k].holds).collect();
        match validate(&settings) {
            Ok(()) => assert!(broken.is_empty(), "accepted, though {:?} must be refused: {settings:?}", rules[broken[0]].refusal),
            Err(error) => {
                let line = error.to_string();
                assert!(matches!(error, Error::Setting { .. }) && error.exit_code() == 2, "{error:?}");
                assert!(line.lines().count() == 1 && !line.chars().any(char::is_control), "{line:?}");
                let named = |k: &usize| line.starts_with(&rules[*k].refusal) && line.len() > rules[*k].refusal.len() + 3;
                assert!(broken.iter().any(named), "{line:?} names nothing that is wrong in {settings:?}");
            }
        }
        accepted += usize::from(broken.is_empty());
        if let [only] = broken[..] {
            never.remove(&only);
        }
    }
    assert!(accepted > CASES / 20 && accepted < CASES, "{accepted} of {CASES} were accepted");
    assert!(never.is_empty(), "rules that were never broken alone: {never:?}");
}

fn any_settings(random: &mut Random) -> RoomSettings {
    let mut settings = RoomSettings::preset(random.pick(&[Preset::Naive, Preset::Modified, Preset::Phong, Preset::Rounds]));
    settings.rng = random.pick(&[Rng::Rand48, Rng::Mt, Rng::Sobol, Rng::Philox, Rng::Philox]);
    for _ in 0..=random.below(3) {
        match random.below(18) {
            16 => settings.nearest = Some(count(random, 2, 1024)),
            17 => {
                settings.gather = Gather::KdTree;
                settings.nearest = Some(count(random, 2, 1024));
                match random.below(3) {
                    0 => settings.chunk = Some(count(random, 2, settings.photons)),
                    1 => settings.rounds = random.pick(&[1 << 21, (1 << 21) + 1, 1 << 30]),
                    _ => {}
                }
            }
            0 => settings.photons = count(random, 2, 1 << 31),
            1 => settings.rounds = count(random, 1, u32::MAX),
            2 => settings.bounces = count(random, 1, 10_000),
            3 => settings.mesh = count(random, 1, 1024),
            4 => settings.radius = number(random, 0.5 / 65_536.0, 0.5),
            5 => settings.full_light = number(random, 1e-12, 1e12),
            6 => settings.light_power[random.below(2)] = number(random, 1e-12, 1e12),
            7 => settings.light_radius = number(random, 0.0, 0.25),
            8 => settings.reflectance = number_f32(random, 0.0, 1.0),
            9 => settings.shininess[random.below(5)] = Some(number_f32(random, 0.0, f32::MAX)),
            10 => settings.eye[random.below(3)] = number_f32(random, -1e15, 1e15),
            11 => settings.threads = count(random, 1, 1024) as usize,
            12 => settings.group_size = if random.below(2) == 0 { 1 << random.below(12) } else { count(random, 32, 1024) },
            13 => settings.counters = Some(if random.below(2) == 0 { 1 << random.below(8) } else { count(random, 1, 64) }),
            14 => settings.chunk = Some(count(random, 2, 1 << 31)),
            _ => settings.seed = random.pick(&[0, u64::from(u32::MAX), 1 << 32, u64::MAX]),
        }
    }
    // A weaker light close to a millionth of the stronger.
    if random.below(8) == 0 {
        settings.light_power = [1.0, random.pick(&[1e-6, 0.999e-6, 1.001e-6, 1e6, 0.99e6])];
    }
    settings
}

/// The box: `photonmill --help`, and what refusals say.
#[test]
fn settings_are_accepted_exactly_within_their_ranges() {
    let rules = |settings: &RoomSettings| {
        let RoomSettings { photons, rounds, bounces, light_power: [floor, left], eye: [x, y, z], .. } = *settings;
        let is_power = |power: f64| (1e-12..=1e12).contains(&power);
        let powers_are_allowed = is_power(floor) && is_power(left);
        let is_coordinate = |coordinate: &f32| (-1e15..=1e15).contains(coordinate);
        let wrong = settings.shininess.iter().flatten().copied().find(|shininess| !(0.0..=f32::MAX).contains(shininess));
        let all_photons = u128::from(photons) * u128::from(rounds);
        // Four for where a photon starts, three a bounce.
        let draws = all_photons * (4 + 3 * u128::from(bounces));
        let counters = settings.counters.unwrap_or(1);
        let nearest = settings.nearest.unwrap_or_default();
        let chunk_or_all = settings.chunk.unwrap_or(photons);
        let is_mt = settings.rng == Rng::Mt;
        let is_rand48 = settings.rng == Rng::Rand48;
        let is_sobol = settings.rng == Rng::Sobol;
        vec![
            rule("photons", photons, (2..=1 << 31).contains(&photons)),
            rule("rounds", rounds, rounds >= 1),
            rule("bounces", bounces, (1..=10_000).contains(&bounces)),
            rule("mesh", settings.mesh, (1..=1024).contains(&settings.mesh)),
            rule("radius", settings.radius, (0.5 / 65_536.0..=0.5).contains(&settings.radius)),
            rule("full_light", settings.full_light, (1e-12..=1e12).contains(&settings.full_light)),
            rule("light_power", floor, is_power(floor)),
            rule("light_power", left, is_power(left)),
            rule("light_power", format!("{floor},{left}"), !powers_are_allowed || floor.min(left) >= 1e-6 * (floor + left)),
            rule("light_radius", settings.light_radius, settings.light_radius > 0.0 && settings.light_radius <= 0.25),
            rule("reflectance", settings.reflectance, (0.0..=1.0).contains(&settings.reflectance)),
            rule("shininess", wrong.unwrap_or_default(), wrong.is_none()),
            rule("eye", format!("{x},{y},{z}"), settings.eye.iter().all(is_coordinate)),
            rule("threads", settings.threads, (1..=1024).contains(&settings.threads)),
            rule("group_size", settings.group_size, [32, 64, 128, 256, 512, 1024].contains(&settings.group_size)),
            rule("counters", counters, [1, 2, 4, 8, 16, 32, 64].contains(&counters)),
            rule("chunk", settings.chunk.unwrap_or_default(), settings.chunk.is_none_or(|chunk| (2..=1 << 31).contains(&chunk))),
            rule("nearest", nearest, settings.nearest.is_none_or(|nearest| (2..=1024).contains(&nearest))),
            rule("nearest", nearest, settings.nearest.is_none() || settings.gather == Gather::KdTree),
            rule("chunk", chunk_or_all, settings.nearest.is_none() || chunk_or_all >= photons),
            rule("rounds", rounds, u64::from(nearest) * u64::from(rounds) <= 1 << 31),
            rule("seed", settings.seed, !is_rand48 || settings.seed <= u64::from(u32::MAX)),
            rule("rng", "rand48", !is_rand48 || draws <= 1 << 48),
            rule("bounces", bounces, !is_mt || bounces <= photonmill::rng::MT_MAX_BOUNCES),
            rule("rng", "mt", !is_mt || all_photons <= 1 << 32),
            rule("rng", "sobol", !is_sobol || all_photons <= 1 << 32),
            rule("rounds", rounds, all_photons * u128::from(bounces) <= 1 << 47),
        ]
    };
    judge(any_settings, rules, RoomSettings::validate);
}

fn any_transport_settings(random: &mut Random) -> SceneSettings {
    let mut settings = by_rounds();
    for _ in 0..=random.below(3) {
        match random.below(13) {
            0 => settings.photons = count(random, 1, 1 << 31),
            1 => settings.caustic_photons = count(random, 1, 1 << 31),
            2 => settings.rounds = count(random, 1, 1 << 20),
            3 => settings.bounces = count(random, 1, 10_000),
            4 => settings.shadow_rays = count(random, 1, MAX_SHADOW_RAYS),
            5 => settings.radius = Some(number(random, f64::MIN_POSITIVE, f64::MAX)),
            6 => settings.caustic_radius = Some(number(random, f64::MIN_POSITIVE, f64::MAX)),
            7 => settings.alpha = number(random, f64::MIN_POSITIVE, 1.0),
            8 => settings.group_size = if random.below(2) == 0 { 1 << random.below(12) } else { count(random, 32, 1024) },
            9 => settings.chunk = Some(count(random, 1, 1 << 31)),
            10 => settings.samples = if random.below(2) == 0 { 1 << random.below(12) } else { count(random, 1, 1024) },
            11 => settings.builder = Some(random.pick(&Builder::ALL)),
            _ => {
                settings.with = (0..random.below(4)).map(|_| random.pick(&Effect::ALL)).collect();
                settings.without = (0..random.below(4)).map(|_| random.pick(&Effect::ALL)).collect();
            }
        }
    }
    settings
}

const MAX_SHADOW_RAYS: u32 = 64;

/// Scenes of triangles: `photonmill render --help`, and what refusals say.
#[test]
fn transport_settings_are_accepted_exactly_within_their_ranges() {
    let rules = |settings: &SceneSettings| {
        let is_radius = |radius: Option<f64>| radius.is_none_or(|radius| radius > 0.0 && radius <= f64::MAX);
        let both = settings.with.iter().find(|effect| settings.without.contains(effect));
        let builder = settings.builder;
        let is_for_scenes = |builder| builder != Builder::Cpu;
        vec![
            rule("photons", settings.photons, (1..=1 << 31).contains(&settings.photons)),
            rule("caustic_photons", settings.caustic_photons, (1..=1 << 31).contains(&settings.caustic_photons)),
            rule("rounds", settings.rounds, (1..=1 << 20).contains(&settings.rounds)),
            rule("bounces", settings.bounces, (1..=10_000).contains(&settings.bounces)),
            rule("variant", builder.map_or("", Builder::name), builder.is_none_or(is_for_scenes)),
            rule("shadow_rays", settings.shadow_rays, (1..=MAX_SHADOW_RAYS).contains(&settings.shadow_rays)),
            rule("samples", settings.samples, (0..=10).any(|k| settings.samples == 1 << k)),
            rule("radius", settings.radius.unwrap_or_default(), is_radius(settings.radius)),
            rule("caustic_radius", settings.caustic_radius.unwrap_or_default(), is_radius(settings.caustic_radius)),
            rule("alpha", settings.alpha, settings.alpha > 0.0 && settings.alpha <= 1.0),
            rule("group_size", settings.group_size, [32, 64, 128, 256, 512, 1024].contains(&settings.group_size)),
            rule("chunk", settings.chunk.unwrap_or_default(), settings.chunk.is_none_or(|chunk| (1..=1 << 31).contains(&chunk))),
            rule("without", both.map_or("", |effect| effect.name()), both.is_none()),
        ]
    };
    judge(any_transport_settings, rules, SceneSettings::validate);
}
