//! What hypotheses leave out. A picture of a scene with any of it is compared with Canaletto's own picture, too.

use super::display::error;
use super::student::StudentPicture;
use crate::film::develop;
use crate::job::{Job, JobError, Observer};
use crate::render::render;
use crate::world::World;
use glam::DVec3;

const FILTERING: &str = "filtering of textures";

/// The words for what a picture of this world and job has, and hypotheses leave out.
pub(super) fn left_out(world: &World, job: &Job) -> Vec<&'static str> {
    let is_rough = |material: &crate::material::PreparedMaterial| material.plain().classic.roughness > 0.0;
    let all = [
        ("the lens or motion of the camera", !job.camera.is_plain()),
        ("motion", world.moves()),
        ("roughness", world.materials().iter().any(is_rough)),
        ("random points of lights", world.lights.iter().any(|light| light.is_sampled())),
        (FILTERING, world.needs_differentials()),
    ];
    all.into_iter().filter(|(_, is_there)| *is_there).map(|(word, _)| word).collect()
}

/// The mean error of the student's picture against Canaletto's own, in steps of 8 bits. Where random numbers differ,
/// the means around each pixel are compared. Any colour between those of neighbours is right then, since filters
/// differ. None if the render was cancelled.
pub(super) fn own_error(
    world: &World,
    job: &Job,
    student: &StudentPicture,
    left_out: &[&str],
    observer: &dyn Observer,
) -> Result<Option<f64>, JobError> {
    let rendering = render(world, job, observer)?;
    if !rendering.complete {
        return Ok(None);
    }
    let own: Vec<[f32; 3]> = develop(&rendering.picture, &job.developing()).iter().map(|c| c.to_array()).collect();
    let is_noisy = left_out.iter().any(|word| *word != FILTERING);
    let [own, theirs] =
        [&own, &student.pixels].map(|pixels| means(pixels, student.width as usize, if is_noisy { 2 } else { 0 }));
    let (width, height) = (student.width as usize, student.height as usize);
    let by = usize::from(is_noisy);
    let range = |index: usize| {
        let around = |at: usize, side: usize| at.saturating_sub(by)..(at + by + 1).min(side);
        let beside =
            around(index / width, height).flat_map(|y| around(index % width, width).map(move |x| y * width + x));
        beside.fold([own[index]; 2], |[low, high], i| [low.min(own[i]), high.max(own[i])])
    };
    let errors = theirs.iter().enumerate().map(|(i, v)| error(range(i), v.as_vec3().to_array(), student.tolerance));
    Ok(Some(errors.sum::<f64>() / own.len().max(1) as f64))
}

/// The mean of the pixels that are at most `radius` columns and rows away from each pixel.
pub(super) fn means(pixels: &[[f32; 3]], width: usize, radius: usize) -> Vec<DVec3> {
    let height = pixels.len() / width.max(1);
    let around = |at: usize, side: usize| at.saturating_sub(radius)..(at + radius + 1).min(side);
    let mean = |index: usize| {
        let columns = around(index % width, width);
        let (mut sum, mut count) = (DVec3::ZERO, 0.0);
        for y in around(index / width, height) {
            for x in columns.clone() {
                sum += DVec3::from(pixels[y * width + x].map(f64::from));
                count += 1.0;
            }
        }
        sum / count
    };
    (0..pixels.len()).map(mean).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_stay_inside_the_picture() {
        let pixels: Vec<[f32; 3]> = (0..12).map(|i| [i as f32; 3]).collect();
        let means = means(&pixels, 4, 2);
        // All rows, and columns 0 to 2.
        assert_eq!(means[0], DVec3::splat(45.0 / 9.0));
        assert_eq!(means[5], DVec3::splat(66.0 / 12.0));
    }
}
