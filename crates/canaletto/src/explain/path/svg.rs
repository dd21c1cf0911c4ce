//! A path as a drawing: its rays one below the other, with the shadow rays to sampled lights.

use super::{Arrival, PathRay, PathSample, PathStep, PathTree, SampledNode};
use crate::explain::outside::OutsideView;
use crate::explain::tree::{HitNode, LightNode, Outcome, RayNode, Side};
use crate::explain::tree_svg::drawing;
use crate::material::Phong;
use crate::math::Rgb;

impl PathTree {
    /// The path of the sample with an index as SVG, or of the one nearest to the pixel's colour. `levels` is the number
    /// of rays. Beside it stands the scene from outside, if a view is given with the address of its picture.
    pub fn svg(
        &self,
        chosen: Option<usize>,
        levels: Option<u32>,
        outside: Option<(&OutsideView, &str)>,
    ) -> Option<String> {
        let sample = self.samples.get(chosen.or_else(|| self.nearest_to_mean())?)?;
        let [x, y] = self.pixel;
        let title = format!("pixel ({x}, {y}), path {} of {}", sample.number, self.samples.len());
        Some(drawing(&sample.as_tree()?, levels, &title, outside))
    }
}

impl PathSample {
    /// The path as a tree in which every ray has one child. A ray's colour is the light that the path finds from its
    /// end on, divided by its throughput.
    pub(in crate::explain) fn as_tree(&self) -> Option<RayNode> {
        let mut below: Option<(RayNode, Rgb)> = None;
        let mut found = Rgb::BLACK;
        for ray in self.rays.iter().rev() {
            found += ray.contributions();
            let color = divided(found, ray.throughput);
            let child =
                below.take().map(|(node, throughput)| RayNode { factor: divided(throughput, ray.throughput), ..node });
            below = Some((ray.as_node(color, child), ray.throughput));
        }
        below.map(|(node, _)| node)
    }
}

/// A quotient, and 0 where nothing is divided.
fn divided(a: Rgb, b: Rgb) -> Rgb {
    let [a, b] = [a, b].map(Rgb::to_array);
    let quotient: [f32; 3] = std::array::from_fn(|c| if b[c] > 0.0 { a[c] / b[c] } else { 0.0 });
    quotient.into()
}

impl PathRay {
    /// The light that the path finds at the end of the ray.
    pub(super) fn contributions(&self) -> Rgb {
        let mut sum = Rgb::BLACK;
        for step in &self.steps {
            match step {
                PathStep::Found { contribution, .. } | PathStep::Overlay { contribution, .. } => sum += *contribution,
                PathStep::Sampled(node) => sum += node.contribution,
                _ => {}
            }
        }
        sum
    }

    fn as_node(&self, color: Rgb, child: Option<RayNode>) -> RayNode {
        let (name, point, surface) = match &self.arrival {
            Arrival::Miss => (None, [0.0; 3], None),
            Arrival::Medium { point } => (Some("medium"), *point, None),
            Arrival::Surface(surface) => (Some(surface.object.as_str()), surface.point, Some(surface)),
        };
        let outcome = match name {
            None => Outcome::Miss { background: color, environment: None },
            Some(name) => Outcome::Hit(Box::new(HitNode {
                object: name.to_owned(),
                object_id: surface.map_or(0, |surface| surface.object_id),
                kind: "",
                primitive: 0,
                t: 0.0,
                point,
                normal: surface.map_or([0.0; 3], |surface| surface.normal),
                shading_normal: surface.map_or([0.0; 3], |surface| surface.normal),
                uv: [0.0; 2],
                side: surface.map_or(Side::Outside, |surface| surface.side),
                steps: None,
                material: surface.map_or(String::new(), |surface| surface.material.clone()),
                phong: Phong::default(),
                textures: Vec::new(),
                unlit: None,
                ambient: None,
                radiosity: None,
                emitters: None,
                emission: None,
                lights: self.steps.iter().filter_map(PathStep::as_light).collect(),
                children: child.into_iter().collect(),
                overlay: None,
                coverage: None,
                behind: None,
                cut: Vec::new(),
            })),
        };
        RayNode {
            kind: self.kind,
            depth: self.depth,
            factor: Rgb::WHITE,
            origin: self.origin,
            direction: self.direction,
            lobe: None,
            media: None,
            hidden: Vec::new(),
            holes: Vec::new(),
            steps: None,
            outcome,
            color,
        }
    }
}

impl PathStep {
    /// A sampled source as a light of a hit.
    fn as_light(&self) -> Option<LightNode> {
        let PathStep::Sampled(node) = self else { return None };
        let SampledNode { source, direction, distance, radiance, visible, contribution, .. } = &**node;
        Some(LightNode {
            light: source.clone(),
            point: 0,
            position: None,
            direction: direction.map(|v| v as f32),
            distance: distance.map_or(f32::INFINITY, |distance| distance as f32),
            intensity: *radiance,
            steps: None,
            n_dot_l: 1.0,
            behind: false,
            r_dot_l: 0.0,
            blockers: Vec::new(),
            f_s: visible.max_component(),
            diffuse: *contribution,
            specular: Rgb::BLACK,
            contribution: *contribution,
        })
    }
}
