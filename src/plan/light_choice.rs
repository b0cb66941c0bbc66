//! Which light a shadow ray asks: regions of the scene, and in each the share of rays that each cluster of lights has, learned from
//! what the clusters did at points of a trial (Vevoda, Kondapaneni and Krivanek 2018) and then frozen.
//! `glsl/world/scene/light_choice.glsl` looks it up.
//!
//! Clusters that the trial saw from a region share its shadow rays, so that a lamp in the next room costs a point none. For the
//! others, which a few rays may have missed, a quarter of the points cast a ray more, so that no light is impossible.
//!
//! Regions are leaves of a decision tree over positions and normals (Breiman et al. 1984), cut where the light to both sides is most
//! different: first at the wall between two rooms, or between its two faces.

use std::collections::BinaryHeap;

use crate::constants::NONE;
use crate::records::{Emitter, LightNode, LightRegion, Receiver};
use crate::scene::geometry::Geometry;
use crate::scene::light_tree::LightTree;
use crate::text::counted;

/// Units of a share: exact in f32, as is each sum of them.
const UNITS: u32 = 1 << 16;
/// Units of what a cluster does at a point, as integers decide.
const LIGHT_UNITS: f32 = 4096.0;
/// Part of the shares that follows power and number, not what was learned.
const PRIOR: f64 = 1.0 / 32.0;
/// Part of the photons that leave lights by what these add at the points of the trial and at what lights these. What is further away
/// has no more than a half fewer.
const EMISSION_BY_SIGHT: f64 = 0.5;
const MOST_REGIONS: usize = 256;
/// Shadow rays to a cluster that show its share in a region, and points that do at least; fewer do where they have next to nothing in
/// common with those beside them: by cosine.
const RAYS_OF_REGION: u32 = 32;
const POINTS_OF_REGION: u32 = 2;
const IN_COMMON: f64 = 0.1;
/// So many times as many points are the surroundings of a region, whose squared light has this part of the region's own: a shadow
/// may end between two points.
const SURROUNDINGS: usize = 8;
const OF_SURROUNDINGS: f64 = 1.0 / 64.0;
/// Squared distance of the mean directions of two regions that are worth telling apart.
const WORTH: f64 = 0.02;
/// Normals that differ by less are cut nowhere.
const NORMAL_STEP: f32 = 1.0 / 16.0;

#[derive(Debug, Clone, PartialEq)]
pub(crate) struct LightChoice {
    pub nodes: Vec<LightNode>,
    pub clusters: u32,
    pub regions: Vec<LightRegion>,
    /// Cumulative; two rows of clusters for each leaf of `regions`: those that the trial saw there, and the others. A row of none is
    /// all 0.
    pub shares: Vec<f32>,
    /// As photons choose them: half by power, half by what their clusters add at all points of the trial.
    pub emitters: Vec<Emitter>,
    /// By how much more a photon of relative flux 1 carries than where all choose by power.
    pub flux_scale: f64,
}

/// What clusters do at a point: its coordinates and those of its normal, shares of its light, these as a unit vector, and the light.
struct Sample {
    place: [f32; 6],
    shares: Vec<u32>,
    direction: Vec<f64>,
    light: f64,
}

impl Sample {
    /// `None` where no light arrived.
    fn new(point: &Receiver, found: &[f32]) -> Option<Sample> {
        let sum: f32 = found.iter().sum();
        if !(sum > 0.0 && sum.is_finite()) {
            return None;
        }
        let shares: Vec<u32> = found.iter().map(|light| (light / sum * LIGHT_UNITS).ceil() as u32).collect();
        let length = shares.iter().map(|share| f64::from(*share).powi(2)).sum::<f64>().sqrt();
        let direction = shares.iter().map(|share| f64::from(*share) / length).collect();
        let (at, normal) = (point.position, point.normal);
        Some(Sample { place: [at.x, at.y, at.z, normal.x, normal.y, normal.z], shares, direction, light: f64::from(sum) })
    }
}

/// A cut of some samples, which are given by their numbers.
#[derive(Debug, Clone, PartialEq)]
struct Cut {
    /// By how much less their directions differ within both sides than in all.
    gain: f64,
    /// Both sides have next to nothing in common.
    is_apart: bool,
    axis: usize,
    split: f32,
}

impl LightChoice {
    /// By power and number alone, everywhere.
    pub(crate) fn by_power(geometry: &Geometry, tree: LightTree) -> LightChoice {
        LightChoice::learned(geometry, tree, (&[], &[]), (&[], &[]), 1)
    }

    /// From what each cluster did at points, point after point: at those that are asked about, by so many rays, and at places that
    /// light these, which photons alone follow.
    pub(crate) fn learned(
        geometry: &Geometry,
        tree: LightTree,
        asked: (&[Receiver], &[f32]),
        places: (&[Receiver], &[f32]),
        rays: u32,
    ) -> LightChoice {
        let clusters = tree.cluster_count;
        let samples = |(points, found): (&[Receiver], &[f32])| -> Vec<Sample> {
            points.iter().zip(found.chunks_exact(clusters)).filter_map(|(point, found)| Sample::new(point, found)).collect()
        };
        let [samples, places] = [asked, places].map(samples);
        let power: Vec<f64> = tree.nodes[..clusters].iter().map(|node| f64::from(node.power)).collect();
        let least = RAYS_OF_REGION.div_ceil(rays).max(POINTS_OF_REGION) as usize;
        let (regions, leaves) = regions(&samples, least);
        let shares = leaves.iter().flat_map(|[leaf, around]| rows(&samples, leaf, around, &power)).collect();
        let (emitters, flux_scale) = geometry.emitters_by(&emission_shares(geometry, &tree, &[&samples, &places], &power));
        LightChoice { nodes: tree.nodes, clusters: clusters as u32, regions, shares, emitters, flux_scale }
    }

    fn region_count(&self) -> usize {
        self.shares.len() / (2 * self.clusters as usize)
    }

    pub(super) fn in_words(&self) -> String {
        let (clusters, regions) = (counted(self.clusters, "cluster"), counted(self.region_count(), "region"));
        format!("; chosen among {clusters} by what a trial saw of them in {regions}")
    }

    /// Shares as kernels have them: behind the number of clusters.
    pub(crate) fn words(&self) -> Vec<f32> {
        [&[f32::from_bits(self.clusters)], self.shares.as_slice()].concat()
    }

    /// Device memory that exists for it.
    pub(super) fn bytes(&self) -> u64 {
        (size_of_val(self.nodes.as_slice()) + size_of_val(self.regions.as_slice()) + size_of_val(self.shares.as_slice())) as u64
    }
}

/// Shares of photons that leave each emitter.
fn emission_shares(geometry: &Geometry, tree: &LightTree, samples: &[&[Sample]], power: &[f64]) -> Vec<f64> {
    let by_power: Vec<f64> = geometry.emitters.iter().map(|emitter| f64::from(emitter.probability)).collect();
    if samples.iter().all(|samples| samples.is_empty()) {
        return by_power;
    }
    let mut units = vec![0u64; power.len()];
    for sample in samples.iter().copied().flatten() {
        units.iter_mut().zip(&sample.shares).for_each(|(sum, share)| *sum += u64::from(*share));
    }
    let all = units.iter().sum::<u64>() as f64;
    let mut shares = by_power.clone();
    for (emitter, cluster) in tree.clusters_of_emitters() {
        let seen = by_power[emitter] * units[cluster] as f64 / (all * power[cluster]);
        shares[emitter] = (1.0 - EMISSION_BY_SIGHT) * by_power[emitter] + EMISSION_BY_SIGHT * seen;
    }
    shares
}

/// The tree of regions of at least so many samples, and by the number of each leaf its samples and those of its surroundings.
fn regions(samples: &[Sample], least: usize) -> (Vec<LightRegion>, Vec<[Vec<usize>; 2]>) {
    let leaf = LightRegion { axis: NONE, split: 0.0, next: 0 };
    let mut regions = vec![leaf];
    // Of each node, and the node that is its surroundings.
    let mut members: Vec<Vec<usize>> = vec![(0..samples.len()).collect()];
    let mut around = vec![0];
    let mut cuts = vec![best_cut(samples, &members[0], least)];
    let mut open = BinaryHeap::new();
    let entry = |cuts: &[Option<Cut>], node: usize| cuts[node].as_ref().map(|cut| (cut.gain.to_bits(), std::cmp::Reverse(node)));
    open.extend(entry(&cuts, 0));
    let mut leaf_count = 1;
    while leaf_count < MOST_REGIONS
        && let Some((_, std::cmp::Reverse(node))) = open.pop()
    {
        let Cut { axis, split, is_apart, .. } = cuts[node].clone().expect("it is open");
        regions[node] = LightRegion { axis: axis as u32, split, next: regions.len() as u32 };
        let (below, above): (Vec<usize>, Vec<usize>) = members[node].iter().partition(|sample| samples[**sample].place[axis] < split);
        for side in [below, above] {
            cuts.push(best_cut(samples, &side, least));
            let is_surroundings = is_apart || side.len() >= SURROUNDINGS * least;
            around.push(if is_surroundings { regions.len() } else { around[node] });
            members.push(side);
            regions.push(leaf);
            open.extend(entry(&cuts, regions.len() - 1));
        }
        leaf_count += 1;
    }
    let mut leaves = Vec::new();
    for (node, region) in regions.iter_mut().enumerate().filter(|(_, region)| region.axis == NONE) {
        region.next = leaves.len() as u32;
        leaves.push([node, around[node]].map(|node| members[node].clone()));
    }
    (regions, leaves)
}

fn best_cut(samples: &[Sample], members: &[usize], least: usize) -> Option<Cut> {
    let count = members.len();
    let clusters = samples.first()?.direction.len();
    let mut sum = vec![0.0; clusters];
    members.iter().for_each(|member| add(&mut sum, &samples[*member].direction));
    let squared = |vector: &[f64]| vector.iter().map(|x| x * x).sum::<f64>();
    let mut best: Option<Cut> = None;
    for axis in 0..6 {
        let at = |member: usize| samples[member].place[axis];
        let least_step = if axis < 3 { 0.0 } else { NORMAL_STEP };
        let mut order = members.to_vec();
        order.sort_by(|a, b| at(*a).total_cmp(&at(*b)).then(a.cmp(b)));
        let mut below = vec![0.0; clusters];
        for (k, pair) in order.windows(2).enumerate() {
            add(&mut below, &samples[pair[0]].direction);
            let (first, second) = (at(pair[0]), at(pair[1]));
            if second - first <= least_step {
                continue;
            }
            let (of_below, of_above) = ((k + 1) as f64, (count - k - 1) as f64);
            let dot: f64 = below.iter().zip(&sum).map(|(below, all)| below * (all - below)).sum();
            let (low, high) = (squared(&below), below.iter().zip(&sum).map(|(below, all)| (all - below).powi(2)).sum::<f64>());
            let apart = low / of_below.powi(2) + high / of_above.powi(2) - 2.0 * dot / (of_below * of_above);
            let gain = of_below * of_above / count as f64 * apart;
            let is_apart = dot <= IN_COMMON * (low * high).sqrt();
            let allowed = is_apart || (apart > WORTH && (k + 1).min(count - k - 1) >= least);
            if allowed && best.as_ref().is_none_or(|best| gain > best.gain) {
                let middle = 0.5 * (first + second);
                best = Some(Cut { gain, is_apart, axis, split: if middle > first { middle } else { second } });
            }
        }
    }
    best
}

fn add(sum: &mut [f64], of: &[f64]) {
    sum.iter_mut().zip(of).for_each(|(sum, of)| *sum += of);
}

/// The two rows of a region. The variance of a point's light is least for shares in proportion to the root of the mean square of
/// what each cluster adds. Points count by their light, between counting alike, as relative errors would have it, and by its square, as
/// absolute ones would: a patch of sun among points that see the sky keeps its rays.
fn rows(samples: &[Sample], members: &[usize], around: &[usize], power: &[f64]) -> Vec<f32> {
    let mut squares = vec![0.0; power.len()];
    for (members, weight) in [(members, 1.0), (around, OF_SURROUNDINGS)] {
        let light: f64 = members.iter().map(|member| samples[*member].light).sum();
        for member in members {
            let weight = weight * samples[*member].light / light;
            let add = |(sum, share): (&mut f64, &u32)| *sum += weight * f64::from(*share).powi(2);
            squares.iter_mut().zip(&samples[*member].shares).for_each(add);
        }
    }
    let is_blind = squares.iter().all(|square| *square == 0.0);
    let seen: Vec<bool> = squares.iter().map(|square| is_blind || *square > 0.0).collect();
    let of = |seen_or_not: bool| {
        let only = |value: &dyn Fn(usize) -> f64| -> Vec<f64> {
            let values: Vec<f64> = seen.iter().enumerate().map(|(k, seen)| if *seen == seen_or_not { value(k) } else { 0.0 }).collect();
            let sum: f64 = values.iter().sum();
            values.into_iter().map(|value| if sum > 0.0 { value / sum } else { 0.0 }).collect()
        };
        let (by_power, by_number) = (only(&|k| power[k]), only(&|_| 1.0));
        let learned = only(&|k| squares[k].sqrt());
        let prior = if seen_or_not && !is_blind { PRIOR } else { 1.0 };
        let weights = (0..power.len()).map(|k| (1.0 - prior) * learned[k] + prior * 0.5 * (by_power[k] + by_number[k]));
        dealt(&weights.collect::<Vec<_>>())
    };
    [of(true), of(false)].concat()
}

/// Cumulative shares in proportion to weights, at least one unit to each that is not 0.
fn dealt(weights: &[f64]) -> Vec<f32> {
    let count = weights.iter().filter(|weight| **weight > 0.0).count() as u32;
    if count == 0 {
        return vec![0.0; weights.len()];
    }
    let all: f64 = weights.iter().sum();
    let free = f64::from(UNITS - count);
    let (mut sum, mut least) = (0.0, 0);
    let last = weights.iter().rposition(|weight| *weight > 0.0).expect("one is not 0");
    (0..weights.len())
        .map(|k| {
            sum += weights[k];
            least += u32::from(weights[k] > 0.0);
            let units = if k >= last { UNITS } else { least + (sum / all * free).round().min(free) as u32 };
            units as f32 / UNITS as f32
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    #[test]
    fn shares_follow_the_weights_and_none_is_lost() {
        let shares = dealt(&[0.0, 1e-9, 3.0, 0.0, 1.0, 1e-12, 0.0]);
        let own: Vec<u32> = std::iter::once(0.0)
            .chain(shares.iter().copied())
            .zip(&shares)
            .map(|(before, share)| ((share - before) * UNITS as f32) as u32)
            .collect();
        assert_eq!(own.iter().sum::<u32>(), UNITS);
        assert_eq!((own[0], own[1], own[3], own[5], own[6]), (0, 1, 0, 1, 0));
        assert!(own[2].abs_diff(3 * UNITS / 4) <= 2 && own[4].abs_diff(UNITS / 4) <= 2, "{own:?}");
        assert_eq!(dealt(&[0.0; 3]), [0.0; 3]);
        assert_eq!(dealt(&[0.0, 5.0]), [0.0, 1.0]);
    }

    /// Samples with these shares of light, in a row along x.
    fn row(shares: &[[f32; 3]], normal: Vec3) -> Vec<Sample> {
        let point = |k: usize| Receiver { position: Vec3::X * k as f32, normal, shading_normal: normal };
        shares.iter().enumerate().filter_map(|(k, found)| Sample::new(&point(k), found)).collect()
    }

    fn region_of(regions: &[LightRegion], place: [f32; 6]) -> u32 {
        let mut region = regions[0];
        while region.axis != NONE {
            region = regions[(region.next + u32::from(place[region.axis as usize] >= region.split)) as usize];
        }
        region.next
    }

    /// Two points in a room of their own are distinguished from a hundred beside them, and none of those from each other.
    #[test]
    fn rooms_are_regions() {
        let samples = row(&[vec![[0.0, 1.0, 1e-6]; 2], vec![[1.0, 0.0, 1e-6]; 100]].concat(), Vec3::Y);
        let (regions, leaves) = regions(&samples, 8);
        assert_eq!(leaves.len(), 2);
        assert_eq!((regions[0].axis, regions[0].split), (0, 1.5));
        assert_eq!([leaves[0][0].len(), leaves[1][0].len()], [2, 100]);
        // What they have nothing in common with is not around them.
        assert!(leaves.iter().all(|[own, around]| own == around));
        let shares = rows(&samples, &leaves[0][0], &leaves[0][1], &[0.9, 0.05, 0.05]);
        // The third cluster was seen, if faintly; the first was not.
        assert!(shares[0] == 0.0 && shares[1] > 0.9 && shares[2] == 1.0, "{shares:?}");
        assert_eq!(shares[3..], [1.0, 1.0, 1.0]);
    }

    /// Both faces of a wall without thickness.
    #[test]
    fn the_faces_of_a_wall_are_regions() {
        let left = row(&[[0.0, 1.0, 0.0]; 10], Vec3::NEG_Z);
        let samples: Vec<Sample> = left.into_iter().chain(row(&[[1.0, 0.0, 0.0]; 10], Vec3::Z)).collect();
        let (regions, leaves) = regions(&samples, 8);
        assert_eq!((leaves.len(), regions[0].axis, regions[0].split), (2, 5, 0.0));
        assert_ne!(region_of(&regions, [3.0, 0.0, 0.0, 0.0, 0.0, -1.0]), region_of(&regions, [3.0, 0.0, 0.0, 0.0, 0.0, 1.0]));
    }

    /// Where the light changes little by little, a region knows what there is round about it.
    #[test]
    fn shadows_that_end_beyond_a_region_are_not_unseen() {
        let of_first = |k: u32| if k % 32 < 16 { f32::from(k >= 8) } else { 0.1 };
        let samples = row(&(0..64).map(|k| [of_first(k), 0.5, 0.0]).collect::<Vec<_>>(), Vec3::Y);
        let (regions, leaves) = regions(&samples, 8);
        let first = &leaves[region_of(&regions, [0.0; 6]) as usize];
        assert_eq!((first[0].len(), first[1].len()), (8, 64));
        let shares = rows(&samples, &first[0], &first[1], &[0.5, 0.4, 0.1]);
        assert!(shares[0] > 0.02 && shares[0] < 0.3, "{shares:?}");
        // Nobody has seen the third.
        assert_eq!(shares, [shares[0], 1.0, 1.0, 0.0, 0.0, 1.0]);
    }

    #[test]
    fn what_saw_nothing_follows_power_and_number() {
        let shares = rows(&[], &[], &[], &[0.9, 0.1]);
        assert!((shares[0] - 0.7).abs() < 1e-3 && shares[1] == 1.0 && shares[2..] == [0.0; 2], "{shares:?}");
        assert!(row(&[[0.0; 3], [f32::NAN; 3], [f32::INFINITY; 3]], Vec3::Y).is_empty());
    }
}
