//! The chapter's numbers as lines.

use super::intersection::{Intersection, TriedObject};
use super::steps::{CameraSteps, HitSteps, LightSteps, RaySteps, RefractionSteps};
use super::term::{Line, line};

impl CameraSteps {
    pub(super) fn lines<'t>(&self) -> [Line<'t>; 2] {
        let ([x, y, z], eye) = (self.axes, self.eye);
        let start = line!("camera: eye {eye}, x_e = {x_e:5.3}, y_e = {y_e:5.3}, z_e = {z_e:5.3}  (5.3)", eye, x, y, z);
        let near = line!("    d_f = near = {d_f:5.2}", self.d_f);
        let height = match self.orthographic {
            false => line!(", height = 2*d_f*tan(fovy/2) = {height:5.2}", self.height),
            true => line!(", orthographic: height = {height:5.2}", self.height),
        };
        [start, near.and(height).and(line!(", base = w/h*height = {base:5.2}  (5.2)", self.base))]
    }
}

impl RaySteps {
    /// How a ray's hit is found.
    pub(super) fn lines(&self) -> Vec<Line<'_>> {
        let mut lines: Vec<Line> = self.refraction.iter().flat_map(|refraction| refraction.lines()).collect();
        if !self.tried.is_empty() {
            lines.push(line!("  each object, with t of p = o + t*d, d = {}  (box 5.1)", self.direction));
        }
        lines.extend(self.tried.iter().map(|tried| {
            let TriedObject { object, object_id, kind, t, missed, is_nearest } = tried;
            let nearest = if *is_nearest { "  <- the ray's hit" } else { "" };
            let what = match (t, missed) {
                (Some(t), _) => line!("t = {}", *t),
                (None, Some(missed)) => line!("missed: {}", missed),
                (None, None) => line!("missed"),
            };
            line!("    {} {} ({}): ", *object_id, object, *kind).and(what).and(line!("{}", nearest))
        }));
        if self.more_tried > 0 {
            lines.push(line!("    {} others: missed", self.more_tried));
        }
        lines.extend(self.intersection.iter().flat_map(|intersection| intersection.lines()));
        lines
    }
}

impl Intersection {
    fn lines<'t>(&self) -> Vec<Line<'t>> {
        match *self {
            Intersection::Sphere { center, radius, a, b, c, discriminant, roots } => {
                let start = line!("    delta = b^2 - 4ac = {}  (5.18)", discriminant);
                let roots = roots.map_or(line!(""), |[t1, t2]| line!(", t1 = {}, t2 = {}  (5.20)", t1, t2));
                vec![
                    line!("  sphere with c = {}, r = {}", center, radius),
                    line!("    a = d.d = {}, b = 2d.(o - c) = {}, c = |o - c|^2 - r^2 = {}  (5.16)", a, b, c),
                    start.and(roots),
                ]
            }
            Intersection::Triangle { corners: [p1, p2, p3], normal, t, areas: [a1, a2, a3], barycentric } => vec![
                line!("  triangle {}, {}, {}", p1, p2, p3),
                line!("    n = {}  (5.23), t = {}  (5.27)", normal, t),
                line!("    A1 = {}, A2 = {}, A3 = {}  (5.30), L = {}  (5.31)", a1, a2, a3, barycentric),
            ],
            Intersection::Box { min, max, faces, entering, leaving } => {
                let faces = faces.into_iter().zip(["x", "y", "z"]).map(|(pair, axis)| match pair {
                    Some([first, last]) => line!("{} {} to {}", axis, first, last),
                    None => line!("{} along the faces", axis),
                });
                vec![
                    line!("  box from {} to {}", min, max),
                    line!("    t between the faces in ").list(faces),
                    line!("    in all three from t = {} to {}  (fig. 5.16)", entering, leaving),
                ]
            }
            Intersection::Frustum { base, axis, length, radii, a, b, c, discriminant, roots, heights, caps } => {
                let [r1, r2] = radii;
                let round = line!("  round about {} + y*{}, 0 <= y <= {}, r = {}", base, axis, length, r1);
                let side = match (roots, heights) {
                    (Some([t1, t2]), Some([y1, y2])) => line!(", t1 = {} at y = {}, t2 = {} at y = {}", t1, y1, t2, y2),
                    _ => line!(""),
                };
                let mut lines = vec![
                    if r1 == r2 { round } else { round.and(line!(" to {}", r2)) },
                    line!("    a = {}, b = {}, c = {} of the distance from the axis (exercise 14)", a, b, c),
                    line!("    delta = b^2 - 4ac = {}  (5.18)", discriminant).and(side),
                ];
                let caps = ["base", "top"].into_iter().zip(caps);
                lines.extend(caps.filter_map(|(cap, t)| Some(line!("    disk of the {} at t = {}", cap, t?))));
                lines
            }
            Intersection::Torus { center, axis, radius, tube, coefficients: [c0, c1, c2, c3, c4], roots } => {
                vec![
                    line!("  torus with c = {}, axis {}, R = {}, r = {}", center, axis, radius, tube),
                    line!("    {}*t^4 + {}*t^3 + {}*t^2 + {}*t + {} = 0", c4, c3, c2, c1, c0),
                    line!("    roots ").list(roots.into_iter().flatten().map(|t| line!("{}", t))),
                ]
            }
            Intersection::Rectangle { corner, u, v, normal, t, shares: [a, b] } => vec![
                line!("  rectangle {} + a*{} + b*{}", corner, u, v),
                line!("    n = {}, t = {}  (5.27), a = {}, b = {}", normal, t, a, b),
            ],
            Intersection::Plane { point, normal, d_dot_n, t } => vec![
                line!("  plane through {}, n = {}", point, normal),
                line!("    d.n = {}, t = (p1 - o).n / d.n = {}  (5.27)", d_dot_n, t),
            ],
        }
    }
}

impl RefractionSteps {
    fn lines<'t>(&self) -> [Line<'t>; 3] {
        let RefractionSteps { v_t, sin_i, sin_t, cos_t, t, r_t } = *self;
        [
            line!("  v_t = (v.n)n - v = {}  (5.41), sin i = |v_t| = {}  (5.42)", v_t, sin_i),
            line!("  sin t = eta_i/eta_t * sin i = {}, cos t = {}  (5.43)", sin_t, cos_t),
            line!("  t = {}, r_t = sin t * t - cos t * n = {}  (5.44)", t, r_t),
        ]
    }
}

impl HitSteps {
    pub(super) fn line<'t>(&self) -> Line<'t> {
        line!("    v = {}, v.n = {}, r = 2(v.n)n - v = {}  (5.37)", self.v, self.v_dot_n, self.r)
    }
}

impl LightSteps {
    pub(super) fn line<'t>(&self) -> Line<'t> {
        let [c, l, q] = self.coefficients;
        let intensity = line!("        l = {intensity of the light}", self.intensity);
        let attenuation = line!(" * attenuation 1/({} + {}*d + {}*d^2) = {attenuation}", c, l, q, self.attenuation);
        let line = intensity.and(attenuation);
        let line = match self.range {
            Some(range) => line.and(line!(" * range 1-(d/range)^4 = {range}", range)),
            None => line,
        };
        line.and(line!(" * cone {cone factor}", self.cone)).of_ray()
    }
}
