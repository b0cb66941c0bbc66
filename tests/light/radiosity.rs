//! The paper's box against a radiosity solution of its own (`photonmill::verify::judge::radiosity`): photons an order of reflection, wall
//! by wall and cell by cell, and irradiance in W/m2, for every builder and both laws of emission.

use std::ops::Range;
use std::sync::OnceLock;

use crate::common::family::chi_squared_z;
use crate::common::known::kept;
use crate::common::prelude::*;
use crate::common::rendered::light;
use photonmill::bake::{Layout, Map, TexelEstimate, estimates};
use photonmill::engine::room::film::estimate_walls;
use photonmill::engine::scene::Viewpoint;
use photonmill::verify::judge::radiosity::{ByLamp, Law, Radiosity, WALLS, cells_of, exchange, form_factor_from, inward, on_wall};

const ALBEDO: f64 = 0.75;
/// Bounces of the paper's modified implementation: orders of reflection that are stored.
const BOUNCES: usize = 15;
/// Cells along a wall in the solution that is compared with.
const CELLS: usize = 32;

const LAWS: [(Law, EmissionLaw); 2] = [(Law::Uniform, EmissionLaw::Uniform), (Law::Cosine, EmissionLaw::Cosine)];

/// Both lamps have half of the photons.
fn mean_of_lamps(by_lamp: ByLamp) -> f64 {
    0.5 * (by_lamp[0] + by_lamp[1])
}

/// The solution of a law, made once for all tests.
fn solution(law: Law) -> &'static Radiosity {
    static SOLUTIONS: [OnceLock<Radiosity>; 2] = [OnceLock::new(), OnceLock::new()];
    SOLUTIONS[law as usize].get_or_init(|| Radiosity::solve(law, ALBEDO, CELLS, BOUNCES))
}

/// Faces of a unit cube see 0.1998248957 of each other across and 0.2000437761 around an edge (Howell's catalogue of
/// radiation configuration factors, C-11 and C-14), and so does the sum over their cells; all that leaves a
/// cell arrives somewhere.
#[test]
fn form_factors_are_known_and_lose_nothing() {
    let face = |wall: usize| cells_of(wall, 1).next().unwrap();
    for (other, expected) in [(1, 0.199_824_895_7), (2, 0.200_043_776_1), (3, 0.200_043_776_1), (4, 0.200_043_776_1)] {
        let whole = face(0).form_factor(&face(other));
        assert!((whole - expected).abs() < 1e-9, "{whole}");
        let of_cells: f64 = cells_of(0, 4).flat_map(|one| cells_of(other, 4).map(move |two| exchange(&one, &two))).sum();
        assert!((4.0 * of_cells - expected).abs() < 1e-9, "{of_cells}");
    }
    for one in cells_of(2, 4) {
        let all: f64 = (0..6).filter(|wall| *wall != 2).map(|wall| one.form_factor(&face(wall))).sum();
        assert!((all - 1.0).abs() < 1e-12, "{one:?}: {all}");
        // A small cell's form factor is that of its middle.
        let middle = on_wall(2, 0.5 * (one.s[0] + one.s[1]), 0.5 * (one.t[0] + one.t[1]));
        let all: f64 = (0..6).filter(|wall| *wall != 2).map(|wall| form_factor_from(middle, DVec3::Y, &face(wall))).sum();
        assert!((all - 1.0).abs() < 1e-12, "{one:?}: {all}");
    }
}

/// Twice as many cells along a wall move no wall's mean of no order by 0.2 %, nor the irradiance at any of the discs
/// that the film is asked for; the stored photons an order are those of another solution, extrapolated from 16, 32 and
/// 64 cells along a wall (uniform 1.502371 in all, cosine 1.542715).
#[test]
fn the_solution_has_converged() {
    let laws = of_run(1, 2);
    let published: [[f64; 6]; 2] = [
        [0.586_425_3, 0.354_047_5, 0.217_227_2, 0.133_102_6, 0.081_816_5, 0.050_300_1],
        [0.607_142_8, 0.363_597_9, 0.221_502_8, 0.135_508_8, 0.083_171_9, 0.051_108_9],
    ];
    for ((law, _), (published, all)) in LAWS.into_iter().zip(published.into_iter().zip([1.502_371, 1.542_715])).take(laws) {
        let (coarse, used) = (Radiosity::solve(law, ALBEDO, CELLS / 2, BOUNCES), solution(law));
        let mut worst: f64 = 0.0;
        for order in 0..BOUNCES {
            for wall in 0..WALLS {
                let [a, b] = [&coarse, used].map(|solution| mean_of_lamps(solution.arrives(order, solution.wall(wall))));
                worst = worst.max((a / b - 1.0).abs());
            }
        }
        println!("{law:?}: from {} to {CELLS} cells the walls' means change by {worst:.1e}", CELLS / 2);
        assert!(worst < 0.002, "{law:?}: {worst}");

        let stored = |order: usize| ALBEDO * mean_of_lamps(used.arrives(order, 0..WALLS * CELLS * CELLS));
        for (order, expected) in published.into_iter().enumerate() {
            let found = stored(order);
            println!("{law:?}, order {order}: {found:.7}, published {expected}");
            assert!((found / expected - 1.0).abs() < 0.0005, "{law:?}, order {order}: {found} where {expected} is known");
        }
        let found: f64 = (0..BOUNCES).map(stored).sum();
        assert!((found / all - 1.0).abs() < 0.0005, "{law:?}: {found} in all where {all} is known");

        let mut worst: f64 = 0.0;
        for wall in 0..WALLS {
            for at in disc_middles().step_by(5) {
                let [a, b] = [&coarse, used].map(|solution| solution.reflected_over_disc(wall, at, DISC_RADIUS));
                worst = worst.max((a / b - 1.0).abs());
            }
        }
        println!("{law:?}: irradiance of discs changes by {worst:.1e}");
        assert!(worst < 0.002, "{law:?}: {worst}");
    }
}

/// Texels along a wall and a radius at which discs around their middles neither overlap nor leave the wall, so that
/// the estimate of a texel is the mean over its disc, and that of others has nothing of it.
const MESH: usize = 8;
const DISC_RADIUS: f64 = 0.03;

fn disc_middles() -> impl Iterator<Item = [f64; 2]> {
    let middle = |i: usize| (i as f64 + 0.5) / MESH as f64 * 0.5 - 0.25;
    (0..MESH * MESH).map(move |k| [middle(k % MESH), middle(k / MESH)])
}

/// Photons of a run.
const PHOTONS: u32 = 1 << 18;

fn settings(builder: Builder, emission: EmissionLaw) -> RoomSettings {
    let discs = RoomSettings { mesh: MESH as u32, radius: DISC_RADIUS, ..RoomSettings::default() };
    RoomSettings { builder, emission, photons: PHOTONS, rng: Rng::Philox, threads: 2, ..discs }
}

fn photons_of(gpu: Option<&Device>, settings: &RoomSettings) -> Vec<Photon> {
    match gpu.filter(|_| settings.builder != Builder::Cpu) {
        Some(gpu) => photons(gpu, settings),
        None => photons_on_cpu(settings),
    }
}

/// Each law with each builder that can run here; in the short run the first of them.
fn ways(gpu: Option<&Device>) -> impl Iterator<Item = (Law, EmissionLaw, Builder)> {
    let every = LAWS.into_iter().flat_map(|(law, emission)| JUDGED.map(|builder| (law, emission, builder)));
    every.filter(move |(.., builder)| gpu.is_some() || *builder == Builder::Cpu).take(of_run(1, usize::MAX))
}

/// Squares of cells along a wall in which photons are counted.
const SQUARES: usize = 8;

/// Photons stored by order and square.
struct Counts {
    photons: f64,
    squares: Vec<Vec<u64>>,
}

impl Counts {
    fn of(gpu: Option<&Device>, builder: Builder, emission: EmissionLaw, seeds: u64) -> Counts {
        let squares = vec![vec![0; WALLS * SQUARES * SQUARES]; BOUNCES];
        let mut counts = Counts { photons: f64::from(PHOTONS) * seeds as f64, squares };
        for seed in 1..=seeds {
            for photon in photons_of(gpu, &RoomSettings { seed, ..settings(builder, emission) }) {
                let wall = photon.wall as usize;
                let place =
                    |axis: usize| (((f64::from(photon.position[axis % 3]) + 0.25) * 2.0 * SQUARES as f64) as usize).min(SQUARES - 1);
                let square = (wall * SQUARES + place(wall / 2 + 2)) * SQUARES + place(wall / 2 + 1);
                counts.squares[photon.bounce as usize][square] += 1;
            }
        }
        counts
    }

    fn stored(&self, order: usize, squares: Range<usize>) -> f64 {
        self.squares[order][squares].iter().sum::<u64>() as f64
    }
}

/// Chance that a photon of each lamp is stored in a square of cells at an order of reflection.
fn stored_in_square(solution: &Radiosity, order: usize, square: usize) -> ByLamp {
    let width = CELLS / SQUARES;
    let (wall_row, column) = (square / SQUARES, square % SQUARES);
    let cells = (0..width * width).map(|k| (wall_row * width + k / width) * CELLS + column * width + k % width);
    solution.arrives(order, cells).map(|chance| ALBEDO * chance)
}

/// Mean and standard error of a count of photons, half of them of each lamp: of one order a photon is stored once or
/// not at all.
fn binomial(photons: f64, chance: ByLamp) -> (f64, f64) {
    let variance: f64 = chance.iter().map(|p| 0.5 * photons * p * (1.0 - p)).sum();
    (photons * mean_of_lamps(chance), variance.sqrt())
}

/// Number of standard errors that the pattern of an order is off: a chi-squared sum over squares and over photons
/// that were not stored, whose mean is known exactly.
fn pattern_z(counts: &Counts, order: usize, chance: impl Fn(usize) -> ByLamp) -> f64 {
    let (mut sum, mut freedom, mut left) = (0.0, 0.0, [1.0; 2]);
    let mut add = |found: f64, chance: ByLamp| {
        let (expected, error) = binomial(counts.photons, chance);
        sum += (found - expected).powi(2) / expected;
        freedom += error * error / expected;
    };
    for (square, found) in counts.squares[order].iter().enumerate() {
        add(*found as f64, chance(square));
        (0..2).for_each(|lamp| left[lamp] -= chance(square)[lamp]);
    }
    add(counts.photons - counts.stored(order, 0..counts.squares[order].len()), left);
    chi_squared_z(sum, freedom)
}

/// Stored photons of each order, of each order and wall, and in squares of 1/16 m, for 262 144 photons a seed: g_(k+1) = K g_k, a
/// photon being stored at order k with the chance albedo g_k.
///
/// A share is noticed that is wrong by `detected` in the orders up to the fourth, which have 86 % of all photons, and by twice that in what
/// a wall stores of the first; the later ones have too few for that and notice what is printed. A pattern is noticed that is brighter by twice as much at
/// one end of each wall than in the middle, up to the third order.
///
/// In the short run the first of [`ways`] stands for all, which store the same photons
/// (`tests/engine/strict.rs`).
#[test]
fn photons_of_every_order_land_as_radiosity_says() {
    let (seeds, detected) = of_run((4, 0.02), (16, 0.01));
    let gpu = device();
    for (law, emission, builder) in ways(gpu.as_ref()) {
        let solution = solution(law);
        let chances: Vec<Vec<ByLamp>> = (0..BOUNCES)
            .map(|order| (0..WALLS * SQUARES * SQUARES).map(|square| stored_in_square(solution, order, square)).collect())
            .collect();
        let chance = |order: usize, squares: Range<usize>| -> ByLamp {
            [0, 1].map(|lamp| chances[order][squares.clone()].iter().map(|by_lamp| by_lamp[lamp]).sum())
        };
        let counts = Counts::of(gpu.as_ref(), builder, emission, seeds);
        let name = builder.name();
        let all = 0..WALLS * SQUARES * SQUARES;
        let of_wall = |wall: usize| wall * SQUARES * SQUARES..(wall + 1) * SQUARES * SQUARES;
        let mut family = Family::default();
        for (order, of_squares) in chances.iter().enumerate() {
            let (expected, error) = binomial(counts.photons, chance(order, all.clone()));
            let scale = 1.0 / counts.photons;
            let what = format!("{law:?}, {name}, order {}", order + 1);
            family.expect(&what, scale * counts.stored(order, all.clone()), scale * expected, scale * error);
            for wall in 0..WALLS {
                let (expected, error) = binomial(counts.photons, chance(order, of_wall(wall)));
                let found = counts.stored(order, of_wall(wall));
                family.expect(format!("{what}, wall {wall}"), scale * found, scale * expected, scale * error);
            }
            let z = pattern_z(&counts, order, |square| of_squares[square]);
            family.expect(format!("{what}, pattern"), z, 0.0, 1.0);
            let tilt = |square: usize| {
                let end = (square % SQUARES) as f64 / (0.5 * (SQUARES as f64 - 1.0)) - 1.0;
                of_squares[square].map(|chance| chance * (1.0 + 2.0 * detected * end))
            };
            let tilted = pattern_z(&counts, order, tilt);
            assert!(order >= 3 || tilted > 6.0, "{what}: a tilt by {detected} is not noticed, z = {tilted}");
        }
        let is_bright = |what: &str| (1..=4).any(|order| what.ends_with(&format!("order {order}")));
        family.assert_detects(detected, is_bright);
        family.assert_detects(2.0 * detected, |what| what.contains("order 1, wall"));
    }
}

/// Irradiance of the film, W/m2, from stored photons over the albedo, in 64 discs of 3 cm a wall: direct light by
/// intensity * cosine / distance^2, the rest by the walls' radiosity and the exact form factors of a point, each as the
/// mean over the disc, which is what photons within a radius show. The mean of a wall notices `detected`.
#[test]
fn the_film_has_the_irradiance_of_radiosity() {
    let (photons, detected) = of_run((1 << 15, 0.03), (1 << 18, 0.01));
    let gpu = device();
    for (law, emission, builder) in ways(gpu.as_ref()) {
        let rounds = 16;
        let settings = RoomSettings { photons, rounds, seed: 7, ..settings(builder, emission) };
        let result = match gpu.as_ref().filter(|_| builder != Builder::Cpu) {
            Some(gpu) => run(gpu, &settings),
            None => run_on_cpu(&settings),
        };
        let mut family = Family::default();
        for (k, wall) in estimate_walls(&result.film, &open_box(&settings), &result.plan).into_iter().enumerate() {
            let exact: f64 = disc_middles().map(|at| solution(law).over_disc(k, at, DISC_RADIUS)).sum();
            // Few photons are stored in two discs of a wall.
            let error = wall.irradiance_error.iter().map(|error| error * error).sum::<f64>().sqrt();
            let what = format!("{law:?}, {}, wall {k}", builder.name());
            family.expect_estimate(what, wall.irradiance.iter().sum(), error, rounds, exact);
        }
        family.assert_detects(detected, |_| true);
    }
}

/// The same box as triangles: at the middles of the discs direct light by shadow rays, or by photons as the mean over the disc;
/// scattered light by photons. What a wall has on average notices 1 %.
#[test]
#[ignore = "long: millions of photons of each builder"]
fn the_box_of_triangles_has_the_irradiance_of_radiosity() {
    let Some(gpu) = device() else { return };
    let points: Vec<(DVec3, DVec3)> =
        (0..WALLS).flat_map(|wall| disc_middles().map(move |[s, t]| (on_wall(wall, s, t), inward(wall)))).collect();
    for (law, illumination, builder) in [
        (Law::Uniform, Illumination::Split, Builder::Ballot),
        (Law::Cosine, Illumination::Photons, Builder::Persistent),
        (Law::Uniform, Illumination::Photons, Builder::Atomic),
        (Law::Cosine, Illumination::Split, Builder::Atomic),
    ] {
        let mut family = Family::default();
        let solution = solution(law);
        let mut scene = built_in::by_name("open-box").unwrap();
        for light in &mut scene.lights {
            if let LightKind::Disc { law: of_light, .. } = &mut light.kind {
                *of_light = LAWS[law as usize].1;
            }
        }
        let settings = SceneSettings { illumination, shadow_rays: 8, ..kept(mapped(200_000, 1, BOUNCES as u32, DISC_RADIUS)) };
        let runs = irradiances(&gpu, &scene, &SceneSettings { builder: Some(builder), ..settings }, &points, 1..17);
        for wall in 0..WALLS {
            let expected: f64 = disc_middles()
                .map(|at| match illumination {
                    Illumination::Photons => solution.over_disc(wall, at, DISC_RADIUS),
                    Illumination::Split => {
                        solution.direct_at(wall, on_wall(wall, at[0], at[1])) + solution.reflected_over_disc(wall, at, DISC_RADIUS)
                    }
                })
                .sum();
            let of_wall = wall * MESH * MESH..(wall + 1) * MESH * MESH;
            let means: Vec<f64> = runs.iter().map(|run| run[of_wall.clone()].iter().map(|light| light.x).sum()).collect();
            family.expect_mean(format!("{law:?}, {illumination:?}, {builder:?}, wall {wall}"), &means, expected);
        }
        family.assert_detects_one_per_cent();
    }
}

/// Texels along a wall of a baked box, and how many there are a metre.
const TEXELS: usize = 16;
const TEXELS_PER_METRE: f64 = TEXELS as f64 / 0.5;

/// The box baked, with the walls' own coordinates as lightmap coordinates or with new charts: its layout, and what was found for each
/// texel.
fn baked_box(gpu: &Device, illumination: Illumination, has_set: bool) -> (Layout, Vec<TexelEstimate>) {
    let mut scene = built_in::by_name("open-box").unwrap();
    if has_set {
        scene.meshes.iter_mut().for_each(|mesh| mesh.uvs[1] = mesh.uvs[0].clone());
    }
    let layout = Layout::new(&scene, TEXELS_PER_METRE).unwrap();
    assert!(layout.objects.len() == WALLS && layout.objects.iter().all(|object| object.set.is_some() == has_set));
    let settings = SceneSettings { shadow_rays: 16, ..kept(fixed_radius(illumination, 1 << 16, 8, BOUNCES as u32, DISC_RADIUS)) };
    let geometry = Geometry::new(&scene).unwrap();
    let phases = layout.receivers(settings.rounds, &geometry);
    let sensor = Sensor::Receivers { count: layout.texel_count() as u32 };
    let plan = ScenePlan::new(&scene, &geometry, &settings, sensor, &engine::limits(gpu.facts())).unwrap();
    let result = light(gpu, &Viewpoint { geometry: &geometry, camera: None, phases: &phases }, plan);
    (layout, estimates(&result))
}

/// Texels of all walls, each with the points that it is looked at in.
fn texels(layout: &Layout) -> Vec<(usize, Vec<DVec3>)> {
    let of_wall = |(wall, lightmap): (usize, &photonmill::bake::MeshLightmap)| {
        let points =
            |texel: &photonmill::bake::CoveredTexel| texel.points.iter().map(|point| point.sample(&lightmap.mesh).position).collect();
        lightmap.texels.iter().map(|texel| (wall, points(texel))).collect::<Vec<_>>()
    };
    layout.lightmaps().flat_map(of_wall).collect()
}

/// Every texel within five standard errors and 4 % of what is right, and the mean of every wall within 1 %.
fn agrees(wanted: &[(usize, f64, f64)], found: &[f64], errors: &[f64]) -> Check {
    require(wanted.len() == found.len(), || format!("{} texels of {}", found.len(), wanted.len()))?;
    for (texel, ((wall, wanted, own_error), (found, error))) in wanted.iter().zip(found.iter().zip(errors)).enumerate() {
        let allowed = 5.0 * own_error.hypot(*error) + 0.04 * wanted;
        require((found - wanted).abs() <= allowed, || {
            format!("texel {texel} of wall {wall}: {found} instead of {wanted} within {allowed}")
        })?;
    }
    for wall in 0..WALLS {
        let of_wall = |values: &dyn Fn(usize) -> f64| (0..wanted.len()).filter(|texel| wanted[*texel].0 == wall).map(values).sum::<f64>();
        let (sum, right) = (of_wall(&|texel| found[texel]), of_wall(&|texel| wanted[texel].1));
        require((sum / right - 1.0).abs() < 0.01, || format!("wall {wall}: {} of the light", sum / right))?;
    }
    Ok(())
}

/// What a picture shows at a place, filtered as engines do it.
fn bilinear(map: &Map, at: DVec2) -> f64 {
    f64::from(texture(map.width, map.irradiance.clone(), [Wrap::Clamp; 2]).sample(at).x)
}

/// What was found for each texel, and its error.
fn columns(estimates: &[TexelEstimate]) -> (Vec<f64>, Vec<f64>) {
    estimates.iter().map(|texel| (f64::from(texel.irradiance.x), f64::from(texel.standard_error.x))).unzip()
}

/// The box baked on its five walls, texel by texel, borders too: light by photons within a radius is what the room's own film has there.
#[test]
fn the_baked_box_has_the_irradiance_of_the_room() {
    let Some(gpu) = device() else { return };
    let room_settings = RoomSettings {
        mesh: TEXELS as u32,
        radius: DISC_RADIUS,
        photons: PHOTONS / 2,
        rounds: 8,
        seed: 3,
        rng: Rng::Philox,
        ..RoomSettings::default()
    };
    let result = run(&gpu, &room_settings);
    let room = open_box(&room_settings);
    let walls = estimate_walls(&result.film, &room, &result.plan);
    let (layout, estimates) = baked_box(&gpu, Illumination::Photons, true);
    let in_room = |(wall, points): &(usize, Vec<DVec3>)| {
        let rectangle = room.rectangle(walls[*wall].face);
        let middle = points.iter().sum::<DVec3>() / points.len() as f64 - rectangle.origin;
        let place = |along: DVec3| (middle.dot(along) / along.length_squared() * TEXELS as f64) as usize;
        let texel = place(rectangle.v) * TEXELS + place(rectangle.u);
        (*wall, walls[*wall].irradiance[texel], walls[*wall].irradiance_error[texel])
    };
    let wanted: Vec<(usize, f64, f64)> = texels(&layout).iter().map(in_room).collect();
    assert_eq!(wanted.len(), WALLS * TEXELS * TEXELS);
    let (found, errors) = columns(&estimates);
    let worst = wanted.iter().zip(&found).map(|((_, wanted, _), found)| (found / wanted - 1.0).abs()).fold(0.0, f64::max);
    println!("from the room's film texels differ by {worst:.3} at most");
    assert_holds("the room's film", agrees(&wanted, &found, &errors));
    let mut shifted = found.clone();
    shifted.rotate_left(2);
    assert_complains("a shift by two texels", agrees(&wanted, &shifted, &errors));
}

/// Direct light by shadow rays and the rest by photons is that of the points themselves, in new charts, borders and gutters too.
#[test]
#[ignore = "long: radiosity at every point of every texel"]
fn the_baked_box_has_the_irradiance_of_radiosity() {
    let Some(gpu) = device() else { return };
    let emission = RoomSettings::default().emission;
    let (law, _) = LAWS.into_iter().find(|(_, known)| *known == emission).unwrap();
    let solution = solution(law);
    let (layout, estimates) = baked_box(&gpu, Illumination::Split, false);
    let at = |(wall, points): &(usize, Vec<DVec3>)| {
        let light = |point: &DVec3| solution.direct_at(*wall, *point) + solution.reflected_at(*wall, *point);
        (*wall, points.iter().map(light).sum::<f64>() / points.len() as f64, 0.0)
    };
    let all = texels(&layout);
    let wanted: Vec<(usize, f64, f64)> = all.iter().map(at).collect();
    let (found, errors) = columns(&estimates);
    let squares = wanted.iter().zip(&found).map(|((_, wanted, _), found)| (found / wanted - 1.0).powi(2));
    println!("from radiosity {} texels differ by {:.4} (RMS)", all.len(), (squares.sum::<f64>() / all.len() as f64).sqrt());
    assert_holds("radiosity", agrees(&wanted, &found, &errors));
    // Along the edges of walls it is darker than that by a quarter without an edge correction.
    let is_border = |points: &[DVec3]| {
        points.iter().any(|point| point.abs().to_array().iter().filter(|x| **x > 0.25 - 0.5 / TEXELS as f64).count() > 1)
    };
    let border = all.iter().filter(|(_, points)| is_border(points)).count();
    assert!(border >= WALLS * (4 * TEXELS - 4), "{border} texels at borders");
    let dark: Vec<f64> = all.iter().zip(&found).map(|((_, points), found)| if is_border(points) { 0.75 * found } else { *found }).collect();
    assert_complains("dark borders", agrees(&wanted, &dark, &errors));

    // A filter at the very edge mixes the border with the gutter.
    const EDGE_TOLERANCE: f64 = 0.05;
    let edges = |maps: &[Map]| -> Check {
        let mut worst = 0.0f64;
        for (wall, lightmap) in layout.lightmaps() {
            let [[a, b, c], [_, _, d]] = lightmap.mesh.triangles[..] else { panic!("wall {wall} is no parallelogram") };
            let corners = [a, b, c, d].map(|vertex| (lightmap.mesh.positions[vertex as usize], lightmap.uvs[vertex as usize]));
            let centre = corners.iter().map(|(corner, _)| corner).sum::<DVec3>() / 4.0;
            for k in 0..4 {
                let ((from, uv_from), (to, uv_to)) = (corners[k], corners[(k + 1) % 4]);
                let inwards = (centre - 0.5 * (from + to)).normalize();
                let (mut shown, mut right) = (0.0, 0.0);
                for step in 1..TEXELS {
                    let share = step as f64 / TEXELS as f64;
                    // Beyond the middle of the last texel a map shows that texel.
                    let point = from.lerp(to, share) + 0.5 / TEXELS_PER_METRE * inwards;
                    shown += bilinear(&maps[wall], uv_from.lerp(uv_to, share));
                    right += solution.direct_at(wall, point) + solution.reflected_at(wall, point);
                }
                worst = worst.max((shown / right - 1.0).abs());
            }
        }
        println!("at no edge more than {worst:.4} beside the light of radiosity");
        require(worst < EDGE_TOLERANCE, || format!("at an edge {worst} beside the light"))
    };
    let maps = layout.maps(&estimates, Default::default());
    assert_holds("edges", edges(&maps));
    let mut black = maps.clone();
    for (wall, lightmap) in layout.lightmaps() {
        let covered: HashSet<usize> = lightmap.texels.iter().map(|texel| (texel.y * lightmap.width + texel.x) as usize).collect();
        let gutters = black[wall].irradiance.iter_mut().enumerate().filter(|(place, _)| !covered.contains(place));
        gutters.for_each(|(_, value)| *value = Vec3::ZERO);
    }
    assert_complains("black gutters", edges(&black));
}
