//! An independent model of the paper's box in f64, the judge of the other builders: it shares no
//! code with them, follows the paper's text and the named choices of the numpy model
//! (`paper_reference.py`), and does everything the plain way. The one drand48 sequence is stepped
//! through draw by draw instead of leap-frogged, absorbed photons are kept beside stored ones, and
//! power is spread from each photon to the texels in reach instead of gathered at the texels.

/// Half the edge of the cube, metres.
pub const HALF_EDGE: f64 = 0.25;
/// Texels along a wall.
pub const MESH: usize = 64;
/// Left, right, floor, ceiling, back: the wall 2 * axis + (1 on the positive side). The sixth is open.
pub const WALL_COUNT: usize = 5;

/// Angular distribution of the light.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Emission {
    Uniform,
    Cosine,
}

#[derive(Debug, Clone)]
pub struct Model {
    pub photons: usize,
    pub bounces: usize,
    pub seed: u32,
    pub emission: Emission,
    /// Exponent of every wall; `None` is Lambertian.
    pub shininess: Option<f64>,
    pub light_radius: f64,
    pub reflectance: f64,
}

impl Default for Model {
    fn default() -> Model {
        Model { photons: 5000, bounces: 15, seed: 1, emission: Emission::Uniform, shininess: None, light_radius: 0.05, reflectance: 0.75 }
    }
}

/// A photon where it reached a wall.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Arrival {
    pub position: [f64; 3],
    pub wall: usize,
    pub photon: usize,
    pub bounce: usize,
    /// Reflected, and so in the photon map; else absorbed.
    pub stored: bool,
    /// Phong weight towards the eye.
    pub weight: f64,
}

/// The C library's 48-bit generator.
struct Drand48(u64);

impl Drand48 {
    fn new(seed: u32) -> Drand48 {
        Drand48((u64::from(seed) << 16) + 0x330E)
    }

    fn next(&mut self) -> f64 {
        self.0 = (self.0.wrapping_mul(25_214_903_917).wrapping_add(11)) % (1 << 48);
        self.0 as f64 / (1u64 << 48) as f64
    }
}

/// Sign of the side that a face lies on.
fn side(face: usize) -> f64 {
    if face.is_multiple_of(2) { -1.0 } else { 1.0 }
}

/// Into the room from a wall: along its axis by the cosine, along the two axes after it by the rest.
fn leaving(wall: usize, cosine: f64, turn: f64) -> [f64; 3] {
    let (axis, inward) = (wall / 2, -side(wall));
    let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
    let angle = std::f64::consts::TAU * turn;
    let mut direction = [0.0; 3];
    direction[axis] = inward * cosine;
    direction[(axis + 1) % 3] = sine * angle.cos();
    direction[(axis + 2) % 3] = sine * angle.sin();
    direction
}

/// Where a ray leaves the cube, and through which face; the face it starts on does not count.
fn exit(position: [f64; 3], direction: [f64; 3], on_face: usize) -> ([f64; 3], usize) {
    let (mut nearest, mut face) = (f64::INFINITY, usize::MAX);
    for candidate in 0..6 {
        let (axis, plane) = (candidate / 2, side(candidate) * HALF_EDGE);
        if candidate == on_face || direction[axis] * plane <= 0.0 {
            continue;
        }
        let distance = (plane - position[axis]) / direction[axis];
        if distance < nearest {
            (nearest, face) = (distance, candidate);
        }
    }
    let mut end: [f64; 3] = std::array::from_fn(|axis| (position[axis] + nearest * direction[axis]).clamp(-HALF_EDGE, HALF_EDGE));
    end[face / 2] = side(face) * HALF_EDGE;
    (end, face)
}

/// The cosine between the mirror direction and the direction to the eye at (0, 0, 1), to the power
/// of the shininess, and nothing for a mirror direction that points away from the eye.
fn phong(position: [f64; 3], arriving: [f64; 3], wall: usize, shininess: f64) -> f64 {
    let mut mirrored = arriving;
    mirrored[wall / 2] = -mirrored[wall / 2];
    let to_eye = [-position[0], -position[1], 1.0 - position[2]];
    let length = to_eye.iter().map(|x| x * x).sum::<f64>().sqrt();
    let cosine = (0..3).map(|axis| to_eye[axis] * mirrored[axis]).sum::<f64>() / length;
    if cosine > 0.0 { cosine.powf(shininess) } else { 0.0 }
}

impl Model {
    /// Every arrival at a wall in one round.
    pub fn trace(&self, round: usize) -> Vec<Arrival> {
        let draws_per_photon = 4 + 3 * self.bounces;
        let mut sequence = Drand48::new(self.seed);
        for _ in 0..round * draws_per_photon * self.photons {
            sequence.next();
        }
        // One row of draws at a time: number k of every photon, photon by photon.
        let mut row = || (0..self.photons).map(|_| sequence.next()).collect::<Vec<f64>>();

        struct Flight {
            photon: usize,
            position: [f64; 3],
            direction: [f64; 3],
            wall: usize,
        }
        let [radii, angles, cosines, turns] = [row(), row(), row(), row()];
        let mut flights: Vec<Flight> = (0..self.photons)
            .map(|photon| {
                // The floor's light has the first half, and the odd photon.
                let wall = if 2 * photon < self.photons { 2 } else { 0 };
                let distance = self.light_radius * radii[photon].sqrt();
                let angle = std::f64::consts::TAU * angles[photon];
                let mut position = [0.0; 3];
                position[wall / 2] = -HALF_EDGE;
                position[(wall / 2 + 1) % 3] = distance * angle.cos();
                position[(wall / 2 + 2) % 3] = distance * angle.sin();
                let cosine = match self.emission {
                    Emission::Uniform => cosines[photon],
                    Emission::Cosine => cosines[photon].sqrt(),
                };
                Flight { photon, position, direction: leaving(wall, cosine, turns[photon]), wall }
            })
            .collect();

        let mut arrivals = Vec::new();
        for bounce in 0..self.bounces {
            let [roulette, cosines, turns] = [row(), row(), row()];
            let mut next = Vec::with_capacity(flights.len());
            for flight in flights {
                let (position, face) = exit(flight.position, flight.direction, flight.wall);
                if face == WALL_COUNT {
                    continue;
                }
                let photon = flight.photon;
                let stored = roulette[photon] < self.reflectance;
                let weight = self.shininess.map_or(1.0, |shininess| phong(position, flight.direction, face, shininess));
                arrivals.push(Arrival { position, wall: face, photon, bounce, stored, weight });
                if stored {
                    next.push(Flight { photon, position, direction: leaving(face, cosines[photon].sqrt(), turns[photon]), wall: face });
                }
            }
            flights = next;
        }
        arrivals
    }

    /// Arrivals at each bounce.
    pub fn hits_per_bounce(&self, arrivals: &[Arrival]) -> Vec<u64> {
        (0..self.bounces).map(|bounce| arrivals.iter().filter(|arrival| arrival.bounce == bounce).count() as u64).collect()
    }

    /// Photons of the map at each bounce.
    pub fn stored_per_bounce(&self, arrivals: &[Arrival]) -> Vec<u64> {
        self.hits_per_bounce(&arrivals.iter().copied().filter(|arrival| arrival.stored).collect::<Vec<_>>())
    }
}

/// Coordinate of the centre of texel i along a wall.
fn texel_centre(i: usize) -> f64 {
    (i as f64 + 0.5) / MESH as f64 * (2.0 * HALF_EDGE) - HALF_EDGE
}

/// Texels of its own wall that an arrival lies within the radius of, as numbers in a table of all
/// walls: wall by wall, row by row, columns along the axis after the wall's own.
pub fn texels_in_reach(arrival: &Arrival, radius: f64) -> impl Iterator<Item = usize> {
    let axis = arrival.wall / 2;
    let [s, t] = [arrival.position[(axis + 1) % 3], arrival.position[(axis + 2) % 3]];
    let wall = arrival.wall;
    (0..MESH).flat_map(move |row| {
        let across = texel_centre(row) - t;
        // Whole rows out of reach cost one test.
        let columns = if across * across <= radius * radius { 0..MESH } else { 0..0 };
        columns
            .filter(move |&column| {
                let along = texel_centre(column) - s;
                along * along + across * across <= radius * radius
            })
            .map(move |column| (wall * MESH + row) * MESH + column)
    })
}

/// Weights of the stored photons within the radius of each texel, added to `table`.
pub fn add_power(table: &mut [f64], arrivals: &[Arrival], radius: f64) {
    for arrival in arrivals.iter().filter(|arrival| arrival.stored) {
        texels_in_reach(arrival, radius).for_each(|texel| table[texel] += arrival.weight);
    }
}

/// The same from nothing.
pub fn power_table(arrivals: &[Arrival], radius: f64) -> Vec<f64> {
    let mut table = vec![0.0; WALL_COUNT * MESH * MESH];
    add_power(&mut table, arrivals, radius);
    table
}
