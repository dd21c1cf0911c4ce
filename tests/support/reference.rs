//! A second implementation of the chapter, as plain as possible, in `f64`. It has no hierarchy and no error bounds. It
//! shares only the description of a scene with the library. It supports spheres, boxes and omni lights, and serves as
//! reference for the classic integrator.

use canaletto::integrator::describe;
use canaletto::light::LightKind;
use canaletto::material::Phong;
use canaletto::scene::{Content, Node, Scene, Stage};
use canaletto::shape::Shape;
use glam::{DMat3, DVec3};

/// A colour, and a hash of every decision behind it: the hit, its side, and the blocked lights. Where it is equal for
/// neighbouring rays, the picture is smooth.
pub struct Sample {
    /// The linear RGB colour.
    pub color: DVec3,
    /// The hash of the decisions.
    pub decisions: u64,
}

/// The chapter's program for one scene.
pub struct Reference<'a> {
    scene: &'a Scene,
    objects: Vec<(Shape, Phong)>,
    lights: Vec<(DVec3, DVec3, bool)>,
}

struct Hit {
    t: f64,
    normal: DVec3,
    object: usize,
    face: u64,
}

impl<'a> Reference<'a> {
    /// Collects the scene's spheres, boxes and omni lights. Panics at any other content, which the reference doesn't
    /// support.
    pub fn new(scene: &'a Scene) -> Reference<'a> {
        let mut reference = Reference { scene, objects: Vec::new(), lights: Vec::new() };
        scene.nodes.iter().for_each(|node| reference.add(node));
        reference
    }

    fn add(&mut self, node: &Node) {
        assert!(node.transform.is_identity(), "the reference knows no transforms");
        match &node.content {
            Content::Shape(shape) => {
                let material = node.material.expect("the chapter's objects have materials") as usize;
                self.objects.push((*shape, self.scene.materials[material].classic()));
            }
            Content::Light(light) => {
                let LightKind::Omni(omni) = &light.kind else { panic!("the reference knows omni lights only") };
                let p = glam::Vec4::from_array(omni.position).as_dvec4();
                let intensity = light.intensity.to_array().map(f64::from);
                self.lights.push((p.truncate() / p.w, DVec3::from(intensity), light.shadows));
            }
            Content::Instance(index) => self.add(&self.scene.prototypes[*index as usize]),
            other => panic!("the reference doesn't know {other:?}"),
        }
    }

    /// The colour of the eye ray through (x, y) in pixels, y upwards: (5.10) and box 5.8.
    pub fn pixel(&self, x: f64, y: f64) -> Sample {
        let view = &self.scene.views[0];
        let (i, e) = (&view.intrinsics, &view.extrinsics);
        let z = (e.eye - e.center).normalize();
        let x_e = e.up.cross(z).normalize();
        let basis = DMat3::from_cols(x_e, z.cross(x_e), z);
        let near = i.near.unwrap_or(canaletto::scene::Intrinsics::DEFAULT_NEAR);
        let height = 2.0 * near * (i.fovy.to_radians() / 2.0).tan();
        let width = f64::from(i.width) / f64::from(i.height) * height;
        let d = DVec3::new(width * (x / f64::from(i.width) - 0.5), height * (y / f64::from(i.height) - 0.5), -near);
        let mut decisions = 1469598103934665603;
        let color = self.trace(e.eye, (basis * d).normalize(), 1, &mut decisions);
        Sample { color, decisions }
    }

    fn trace(&self, o: DVec3, d: DVec3, depth: u32, decisions: &mut u64) -> DVec3 {
        let Some(hit) = self.nearest(o, d) else {
            note(decisions, 1);
            return rgb(self.scene.background);
        };
        let outside = hit.normal.dot(d) < 0.0;
        note(decisions, 2 + 2 * hit.object as u64 + u64::from(outside) + 1000 * hit.face);
        let n = if outside { hit.normal } else { -hit.normal };
        let (p, v) = (o + d * hit.t, -d);
        let m = &self.objects[hit.object].1;
        let kd = rgb(m.kd);
        let settings = describe(&self.scene.integrator).whitted().unwrap();
        let stage = settings.stage;
        if stage == Stage::Unlit {
            return kd;
        }
        let mut color = DVec3::ZERO;
        if stage >= Stage::Ambient {
            color += rgb(self.scene.ambient) * kd;
        }
        let r = 2.0 * v.dot(n) * n - v;
        for (position, intensity, shadows) in &self.lights {
            let to_light = position - p;
            let l = to_light.normalize();
            let lit = n.dot(l) > 0.0;
            note(decisions, u64::from(lit));
            if !lit {
                continue;
            }
            let mut term = *intensity * kd * n.dot(l);
            if stage >= Stage::Specular {
                let cos = r.dot(l);
                note(decisions, u64::from(cos > 0.0));
                term += *intensity * rgb(m.ks) * cos.max(0.0).powf(f64::from(m.n));
            }
            let mut f_s = 1.0;
            if stage >= Stage::Shadow && settings.shadows && *shadows {
                let start = p + n * 1e-7;
                for (index, (shape, material)) in self.objects.iter().enumerate() {
                    for (t, ..) in roots(shape, start, position - start) {
                        if t > 0.0 && t < 1.0 {
                            f_s *= 1.0 - f64::from(material.opacity);
                            note(decisions, 7 + index as u64);
                        }
                    }
                }
            }
            color += term * f_s;
        }
        if depth >= settings.max_depth {
            return color;
        }
        if stage >= Stage::Reflection && !m.k.is_black() {
            color += rgb(m.k) * self.trace(p + n * 1e-7, r, depth + 1, decisions);
        }
        if stage >= Stage::Full && m.opacity < 1.0 {
            let clear = 1.0 - f64::from(m.opacity);
            let ratio = if outside { 1.0 / f64::from(m.eta) } else { f64::from(m.eta) };
            let cos_i = v.dot(n);
            let sin2_t = ratio * ratio * (1.0 - cos_i * cos_i);
            note(decisions, u64::from(sin2_t < 1.0));
            color += clear
                * if sin2_t < 1.0 {
                    let t = -v * ratio + n * (ratio * cos_i - (1.0 - sin2_t).sqrt());
                    self.trace(p - n * 1e-7, t, depth + 1, decisions)
                } else {
                    self.trace(p + n * 1e-7, r, depth + 1, decisions)
                };
        }
        color
    }

    fn nearest(&self, o: DVec3, d: DVec3) -> Option<Hit> {
        let mut best: Option<Hit> = None;
        for (object, (shape, _)) in self.objects.iter().enumerate() {
            for (t, normal, face) in roots(shape, o, d) {
                if t > 0.0 && best.as_ref().is_none_or(|b| t < b.t) {
                    best = Some(Hit { t, normal, object, face });
                }
            }
        }
        best
    }
}

fn rgb(c: canaletto::math::Rgb) -> DVec3 {
    DVec3::from(c.to_array().map(f64::from))
}

fn note(decisions: &mut u64, what: u64) {
    *decisions = (*decisions ^ what).wrapping_mul(1099511628211);
}

/// Every intersection of the line with a shape: parameter, outward normal, face.
fn roots(shape: &Shape, o: DVec3, d: DVec3) -> Vec<(f64, DVec3, u64)> {
    match shape {
        Shape::Sphere(s) => {
            let (c, r) = (s.center.as_dvec3(), f64::from(s.radius));
            let oc = o - c;
            let (a, b, c2) = (d.dot(d), 2.0 * d.dot(oc), oc.dot(oc) - r * r);
            let delta = b * b - 4.0 * a * c2;
            if delta < 0.0 {
                return Vec::new();
            }
            [-1.0, 1.0].map(|sign| (-b + sign * delta.sqrt()) / (2.0 * a)).map(|t| (t, (oc + d * t) / r, 0)).to_vec()
        }
        Shape::Box(b) => {
            // Each face is a plane, kept if the point lies inside the other two slabs.
            let (min, max) = (b.min.as_dvec3(), b.max.as_dvec3());
            let mut found = Vec::new();
            for axis in 0..3 {
                for (side, bound) in [(-1.0, min[axis]), (1.0, max[axis])] {
                    if d[axis] == 0.0 {
                        continue;
                    }
                    let t = (bound - o[axis]) / d[axis];
                    let p = o + d * t;
                    let inside = (0..3).filter(|&i| i != axis).all(|i| p[i] >= min[i] && p[i] <= max[i]);
                    if inside {
                        let mut normal = DVec3::ZERO;
                        normal[axis] = side;
                        found.push((t, normal, 1 + axis as u64 * 2 + u64::from(side > 0.0)));
                    }
                }
            }
            found
        }
        other => panic!("the reference doesn't know {other:?}"),
    }
}
