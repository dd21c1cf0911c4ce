//! The variance of halves, averaged over pixels that show alike surfaces: the noise of a lamp's edge says nothing of
//! the dark wall beside it.
#![allow(clippy::needless_range_loop)] // Lanes of several arrays go in step.

use super::features::FeaturePlanes;
use super::plane::{MARGIN, Plane, falloff};
use canaletto_bvh::{InstructionSet, Kernel};
use rayon::prelude::*;

/// The window is (2 RADIUS + 1)² pixels.
const RADIUS: i32 = 4;
/// Tolerances of normals and albedos.
const NORMAL: f32 = 0.4;
const ALBEDO: f32 = 0.2;
/// The number of pixels side by side.
const LANES: usize = 16;

type Lanes = [f32; LANES];

/// The means of planes over pixels of similar normals and albedos.
pub(super) fn averaged<const N: usize>(planes: &[Plane; N], features: &FeaturePlanes) -> [Plane; N] {
    let size = features.inside.size;
    let rows: Vec<Vec<[f32; N]>> = (0..size[1])
        .into_par_iter()
        .map(|y| {
            let mut row = vec![[0.0; N]; size[0].next_multiple_of(LANES)];
            InstructionSet::run(Row { planes, features, y, row: &mut row });
            row
        })
        .collect();
    let mut number = 0;
    [(); N].map(|()| {
        let mut plane = Plane::new(size);
        plane.fill(|x, y| rows[y][x][number]);
        number += 1;
        plane
    })
}

/// The pixels of a row.
struct Row<'a, const N: usize> {
    planes: &'a [Plane; N],
    features: &'a FeaturePlanes,
    y: usize,
    row: &'a mut [[f32; N]],
}

#[inline(always)]
fn load(plane: &Plane, index: usize) -> Lanes {
    let mut lanes = [0.0; LANES];
    lanes.copy_from_slice(&plane.values[index..index + LANES]);
    lanes
}

impl<const N: usize> Kernel for Row<'_, N> {
    type Answer = ();

    #[inline(always)]
    fn run(self) {
        let Row { planes, features, y, row } = self;
        let FeaturePlanes { normal, root: albedo, inside, .. } = features;
        for x in (0..row.len()).step_by(LANES) {
            let center = inside.index(x, y);
            let [normal_p, albedo_p] =
                [normal, albedo].map(|planes| [0, 1, 2].map(|c: usize| load(&planes[c], center)));
            let (mut sums, mut total) = ([[0.0; LANES]; N], [0.0; LANES]);
            for dy in -RADIUS..=RADIUS {
                for dx in -RADIUS..=RADIUS {
                    let q = (center as isize + dy as isize * inside.stride as isize + dx as isize) as usize;
                    let mut weight = [0.0; LANES];
                    for c in 0..3 {
                        let (normal_q, albedo_q) = (load(&normal[c], q), load(&albedo[c], q));
                        for i in 0..LANES {
                            let (n, a) = (normal_p[c][i] - normal_q[i], albedo_p[c][i] - albedo_q[i]);
                            weight[i] += n * n * (1.0 / (NORMAL * NORMAL)) + a * a * (1.0 / (ALBEDO * ALBEDO));
                        }
                    }
                    let inside_q = load(inside, q);
                    let place = ((RADIUS + 1 - dx.abs()) * (RADIUS + 1 - dy.abs())) as f32;
                    for i in 0..LANES {
                        weight[i] = place * falloff(weight[i]) * inside_q[i];
                        total[i] += weight[i];
                    }
                    for (sum, plane) in sums.iter_mut().zip(planes) {
                        let values = load(plane, q);
                        for i in 0..LANES {
                            sum[i] += weight[i] * values[i];
                        }
                    }
                }
            }
            for i in 0..LANES {
                let scale = if total[i] > 0.0 { 1.0 / total[i] } else { 0.0 };
                for n in 0..N {
                    row[x + i][n] = sums[n][i] * scale;
                }
            }
        }
    }
}

const _: () = assert!(RADIUS as usize <= MARGIN);
