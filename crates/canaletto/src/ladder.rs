//! The ladder: the chapter's pictures from flat colour to the whole equation, each with one term more than the one
//! before. The first seven rungs are the stages of (5.39b). Textures (5.5) and anti-aliasing (5.6) follow.

use crate::named;
use crate::render::Job;
use crate::scene::{Sampling, Scene, Stage, WhittedSettings};

/// A rung of the ladder. Each contains the earlier ones.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[non_exhaustive]
pub enum Rung {
    /// [`Stage::Unlit`].
    Unlit,
    /// [`Stage::Diffuse`].
    Diffuse,
    /// [`Stage::Ambient`].
    Ambient,
    /// [`Stage::Specular`].
    Specular,
    /// [`Stage::Shadow`].
    Shadow,
    /// [`Stage::Reflection`].
    Reflection,
    /// [`Stage::Full`].
    Refraction,
    /// The materials' textures. The rungs before have none.
    Textures,
    /// Several rays for each pixel. The rungs before have one.
    AntiAliasing,
}

named!(Rung {
    Unlit => "unlit": "the diffuse colour alone, without any light",
    Diffuse => "diffuse": "the diffuse light of each light source",
    Ambient => "ambient": "light from everywhere",
    Specular => "specular": "highlights",
    Shadow => "shadow": "light that something blocks is taken away",
    Reflection => "reflection": "what mirrors show",
    Refraction => "refraction": "what is seen through clear bodies",
    Textures => "textures": "colours, bumps and holes from pictures and functions",
    AntiAliasing => "anti-aliasing": "the mean of several rays in each pixel",
});

impl Rung {
    /// The term that the rung adds to the shading equation, in ASCII.
    pub fn term(self) -> &'static str {
        match self {
            Rung::Unlit => "I = kd",
            Rung::Diffuse => "I = sum of l kd (n.L)",
            Rung::Ambient => "+ Ia kd",
            Rung::Specular => "+ sum of l ks (r.L)^n",
            Rung::Shadow => "each l times f_s",
            Rung::Reflection => "+ k I(r)",
            Rung::Refraction => "+ (1 - o) I(t)",
            Rung::Textures => "kd, n, ... from textures",
            Rung::AntiAliasing => "the mean of several rays",
        }
    }

    /// The stage of the classic integrator.
    pub fn stage(self) -> Stage {
        match self {
            Rung::Unlit => Stage::Unlit,
            Rung::Diffuse => Stage::Diffuse,
            Rung::Ambient => Stage::Ambient,
            Rung::Specular => Stage::Specular,
            Rung::Shadow => Stage::Shadow,
            Rung::Reflection => Stage::Reflection,
            Rung::Refraction | Rung::Textures | Rung::AntiAliasing => Stage::Full,
        }
    }

    /// Whether the rung's world is that of the scene itself, not that of [`without_textures`].
    pub fn has_textures(self) -> bool {
        self >= Rung::Textures
    }

    /// The rung's job, with all other settings of `job`. Integrators other than the classic one are replaced by the
    /// most similar classic one. The last rung keeps the job's sampling if that has several rays for each pixel. Else
    /// it takes 4 × 4 jittered rays.
    pub fn job(self, job: &Job) -> Job {
        let settings = WhittedSettings { stage: self.stage(), ..job.description().nearest_whitted() };
        let sampling = match (self, job.film.sampling) {
            (Rung::AntiAliasing, own) if own.is_single() => Sampling::Jittered(4),
            (Rung::AntiAliasing, own) => own,
            (_, Sampling::Corner) => Sampling::Corner,
            _ => Sampling::Center,
        };
        let mut job = Job { integrator: settings.into(), ..job.clone() };
        job.film.sampling = sampling;
        job
    }
}

/// Whether a material of the scene has a texture.
pub fn has_textures(scene: &Scene) -> bool {
    scene.materials.iter().any(|material| !material.textures.is_empty())
}

/// The scene without the textures of its materials.
pub fn without_textures(scene: &Scene) -> Scene {
    let mut scene = scene.clone();
    scene.materials.iter_mut().for_each(|material| material.textures.clear());
    scene
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Named;
    use crate::camera::Camera;
    use crate::scene::{Extrinsics, FilmSettings, Intrinsics, ZbufferSettings};

    fn job(sampling: Sampling) -> Job {
        let camera = Camera::new(&Intrinsics::default(), &Extrinsics::default()).unwrap();
        Job::new(camera, FilmSettings { sampling, ..FilmSettings::default() }, WhittedSettings::default())
    }

    #[test]
    fn every_stage_has_a_rung_in_order() {
        let mut stages: Vec<Stage> = Rung::ALL.iter().map(|rung| rung.stage()).collect();
        assert!(stages.is_sorted());
        stages.dedup();
        assert_eq!(stages, Stage::ALL);
    }

    #[test]
    fn only_the_last_rung_has_several_rays() {
        let of = |rung: Rung, sampling| rung.job(&job(sampling)).film.sampling;
        for &rung in &Rung::ALL[..Rung::ALL.len() - 1] {
            assert_eq!(of(rung, Sampling::Corner), Sampling::Corner);
            assert_eq!(of(rung, Sampling::Sampled(64)), Sampling::Center);
        }
        assert_eq!(of(Rung::AntiAliasing, Sampling::Sampled(64)), Sampling::Sampled(64));
        for single in [Sampling::Corner, Sampling::Center, Sampling::Sampled(1), Sampling::Regular(1)] {
            assert_eq!(of(Rung::AntiAliasing, single), Sampling::Jittered(4));
        }
    }

    #[test]
    fn settings_of_the_job_are_kept() {
        let mut own = job(Sampling::Center);
        own.integrator = WhittedSettings { max_depth: 3, shadows: false, ..WhittedSettings::default() }.into();
        let settings = *Rung::Shadow.job(&own).description().whitted().unwrap();
        assert_eq!(settings, WhittedSettings { stage: Stage::Shadow, max_depth: 3, shadows: false, ..settings });
        own.integrator = ZbufferSettings::default().into();
        assert_eq!(Rung::Refraction.job(&own).integrator, WhittedSettings::default().into());
    }
}
