//! The scattering of eight vertices of one kind of material.

use super::kernels::Arrived;
use super::{LANES, rgb};
use crate::material::{ConductorPoint, DiffuseBsdf, Ggx, Lobe, MetalFacets, ScatteringFrame, on_circle};
use crate::math::Rgb;
use crate::shape::{DVec3x8, Vec3x8, dvec3, set_dvec3, set_vec3};
use canaletto_bvh::{InstructionSet, Kernel};
use glam::{DMat3, DVec2, DVec3};

/// The scattering of eight vertices, as their viewers see them. The functions are those of single vertices.
pub(super) trait Scattering8 {
    /// The lobe of the directions that surfaces choose by themselves.
    const LOBE: Lobe;

    /// Whether a vertex scatters no light.
    fn is_black(&self, lane: usize) -> bool;

    /// [`Bsdf::eval`](crate::material::Bsdf::eval) of a vertex.
    fn eval(&self, lane: usize, wi: DVec3) -> Rgb;

    /// [`Bsdf::pdf`](crate::material::Bsdf::pdf) of a vertex.
    fn pdf(&self, lane: usize, wi: DVec3) -> f64;

    /// The direction that the vertex's random numbers choose.
    fn direction(&self, lane: usize) -> DVec3;
}

/// The materials of eight vertices of one kind.
pub(super) trait Materials8: Default {
    type Bsdfs<'a>: Scattering8
    where
        Self: 'a;

    /// The scattering of the vertices, as their viewers see them.
    fn bsdfs<'a>(&'a self, arrived: &'a Arrived) -> Self::Bsdfs<'a>;
}

/// The colours of eight diffuse vertices.
#[derive(Default)]
pub(in super::super) struct Diffuse {
    pub(super) kd: Vec3x8,
}

/// Eight diffuse vertices.
pub(super) struct DiffuseBsdfs<'a> {
    kd: &'a Vec3x8,
    arrived: &'a Arrived,
}

impl Materials8 for Diffuse {
    type Bsdfs<'a> = DiffuseBsdfs<'a>;

    fn bsdfs<'a>(&'a self, arrived: &'a Arrived) -> DiffuseBsdfs<'a> {
        DiffuseBsdfs { kd: &self.kd, arrived }
    }
}

impl DiffuseBsdfs<'_> {
    #[inline(always)]
    fn one(&self, lane: usize) -> DiffuseBsdf {
        let (normal, facing) = (dvec3(&self.arrived.normal, lane), dvec3(&self.arrived.facing, lane));
        DiffuseBsdf { kd: rgb(self.kd, lane), normal, facing }
    }
}

impl Scattering8 for DiffuseBsdfs<'_> {
    const LOBE: Lobe = Lobe::Diffuse;

    fn is_black(&self, lane: usize) -> bool {
        rgb(self.kd, lane).is_black()
    }

    #[inline(always)]
    fn eval(&self, lane: usize, wi: DVec3) -> Rgb {
        self.one(lane).eval(wi)
    }

    #[inline(always)]
    fn pdf(&self, lane: usize, wi: DVec3) -> f64 {
        self.one(lane).pdf(wi)
    }

    #[inline(always)]
    fn direction(&self, lane: usize) -> DVec3 {
        let [u, v] = &self.arrived.u_direction;
        self.one(lane).direction([u[lane], v[lane]])
    }
}

/// Eight rough metals.
#[derive(Default)]
pub(in super::super) struct Metals {
    pub(super) points: [ConductorPoint; LANES],
}

/// Eight vertices of rough metals.
pub(super) struct MetalBsdfs<'a> {
    eta: Vec3x8,
    k: Vec3x8,
    alpha: [f64; LANES],
    /// The factors of what one scattering reflects.
    returned: Vec3x8,
    facing: &'a DVec3x8,
    /// Whether the normal of any facets may be another one than the geometric one.
    may_be_bent: bool,
    /// The axes of the facets, and the viewers' directions in them.
    axes: [DVec3x8; 3],
    wo: DVec3x8,
    /// The points of the unit circle for the directions, and the other random number for them.
    circle: [[f64; LANES]; 2],
    u: &'a [f64; LANES],
}

/// Finds the axes of facets, and the viewers' directions in them.
struct FindAxes<'a>(&'a Arrived);

impl Kernel for FindAxes<'_> {
    type Answer = ([DVec3x8; 3], DVec3x8);

    #[inline(always)]
    fn run(self) -> Self::Answer {
        let Arrived { wo, normal, facing, .. } = self.0;
        let [mut x, mut y, mut z, mut local] = [[[0.0; LANES]; 3]; 4];
        for i in 0..LANES {
            let wo = dvec3(wo, i);
            let axes = ScatteringFrame::isotropic_facet_axes(dvec3(normal, i), dvec3(facing, i), wo);
            set_dvec3(&mut x, i, axes.x_axis);
            set_dvec3(&mut y, i, axes.y_axis);
            set_dvec3(&mut z, i, axes.z_axis);
            set_dvec3(&mut local, i, axes.transpose() * wo);
        }
        ([x, y, z], local)
    }
}

impl Materials8 for Metals {
    type Bsdfs<'a> = MetalBsdfs<'a>;

    fn bsdfs<'a>(&'a self, arrived: &'a Arrived) -> MetalBsdfs<'a> {
        let (axes, wo) = InstructionSet::run(FindAxes(arrived));
        let [turn, u] = &arrived.u_direction;
        let [mut eta, mut k, mut returned] = [[[0.0; LANES]; 3]; 3];
        let (mut alpha, mut circle) = ([0.0; LANES], [[0.0; LANES]; 2]);
        for (lane, point) in self.points.iter().enumerate() {
            set_vec3(&mut eta, lane, point.eta.to_array().into());
            set_vec3(&mut k, lane, point.k.to_array().into());
            set_vec3(&mut returned, lane, point.returned(wo[2][lane]).to_array().into());
            alpha[lane] = point.alpha;
            [circle[0][lane], circle[1][lane]] = on_circle(turn[lane]).to_array();
        }
        MetalBsdfs {
            eta,
            k,
            alpha,
            returned,
            facing: &arrived.facing,
            may_be_bent: arrived.normal != arrived.facing,
            axes,
            wo,
            circle,
            u,
        }
    }
}

impl MetalBsdfs<'_> {
    #[inline(always)]
    fn one(&self, lane: usize) -> MetalFacets {
        let [x, y, z] = &self.axes;
        MetalFacets {
            eta: rgb(&self.eta, lane),
            k: rgb(&self.k, lane),
            ggx: Ggx::isotropic(self.alpha[lane]),
            facing: dvec3(self.facing, lane),
            may_be_bent: self.may_be_bent,
            axes: DMat3::from_cols(dvec3(x, lane), dvec3(y, lane), dvec3(z, lane)),
            wo: dvec3(&self.wo, lane),
            returned: rgb(&self.returned, lane),
        }
    }
}

impl Scattering8 for MetalBsdfs<'_> {
    const LOBE: Lobe = Lobe::Mirror;

    fn is_black(&self, _: usize) -> bool {
        false
    }

    #[inline(always)]
    fn eval(&self, lane: usize, wi: DVec3) -> Rgb {
        self.one(lane).eval(wi)
    }

    #[inline(always)]
    fn pdf(&self, lane: usize, wi: DVec3) -> f64 {
        self.one(lane).pdf(wi)
    }

    #[inline(always)]
    fn direction(&self, lane: usize) -> DVec3 {
        let [x, y] = &self.circle;
        self.one(lane).direction(DVec2::new(x[lane], y[lane]), self.u[lane])
    }
}
