//! The chapter's numbers as text.

use super::intersection::{Intersection, TriedObject};
use super::steps::{CameraSteps, HitSteps, LightSteps, RaySteps, RefractionSteps};
use super::text_writer::TextWriter;

pub(super) fn write_camera_steps(w: &mut TextWriter, camera: &CameraSteps) {
    let CameraSteps { eye, axes, d_f, height, base } = camera;
    let [x, y, z] = axes.map(|axis| w.vector(axis));
    writeln!(w, "camera: eye {}, x_e = {x}, y_e = {y}, z_e = {z}  (5.3)", w.vector(*eye));
    writeln!(
        w,
        "    d_f = near = {}, height = 2*d_f*tan(fovy/2) = {}, base = w/h*height = {}  (5.2)",
        w.number(*d_f),
        w.number(*height),
        w.number(*base)
    );
}

/// Writes how a ray's hit is found.
pub(super) fn write_ray_steps(w: &mut TextWriter, steps: &RaySteps, indent: &str) {
    if let Some(refraction) = &steps.refraction {
        write_refraction(w, refraction, indent);
    }
    if !steps.tried.is_empty() {
        writeln!(w, "{indent}  each object, with t of p = o + t*d, d = {}  (box 5.1)", w.vector(steps.direction));
    }
    for TriedObject { object, object_id, kind, t, missed, is_nearest } in &steps.tried {
        let nearest = if *is_nearest { "  <- the ray's hit" } else { "" };
        let what = match (t, missed) {
            (Some(t), _) => format!("t = {}", w.number(*t)),
            (None, Some(missed)) => format!("missed: {missed}"),
            (None, None) => "missed".to_owned(),
        };
        writeln!(w, "{indent}    {object_id} {object} ({kind}): {what}{nearest}");
    }
    if steps.more_tried > 0 {
        writeln!(w, "{indent}    {} others: missed", steps.more_tried);
    }
    if let Some(intersection) = &steps.intersection {
        write_intersection(w, intersection, indent);
    }
}

fn write_intersection(w: &mut TextWriter, intersection: &Intersection, indent: &str) {
    match intersection {
        Intersection::Sphere { center, radius, a, b, c, discriminant, roots } => {
            writeln!(w, "{indent}  sphere with c = {}, r = {}", w.vector(*center), w.number(*radius));
            let [a, b, c] = [a, b, c].map(|v| w.number(*v));
            writeln!(w, "{indent}    a = d.d = {a}, b = 2d.(o - c) = {b}, c = |o - c|^2 - r^2 = {c}  (5.16)");
            let roots = roots
                .map_or(String::new(), |[t1, t2]| format!(", t1 = {}, t2 = {}  (5.20)", w.number(t1), w.number(t2)));
            writeln!(w, "{indent}    delta = b^2 - 4ac = {}  (5.18){roots}", w.number(*discriminant));
        }
        Intersection::Triangle { corners, normal, t, areas, barycentric } => {
            let [p1, p2, p3] = corners.map(|p| w.vector(p));
            writeln!(w, "{indent}  triangle {p1}, {p2}, {p3}");
            writeln!(w, "{indent}    n = {}  (5.23), t = {}  (5.27)", w.vector(*normal), w.number(*t));
            let [a1, a2, a3] = areas.map(|area| w.number(area));
            writeln!(w, "{indent}    A1 = {a1}, A2 = {a2}, A3 = {a3}  (5.30), L = {}  (5.31)", w.vector(*barycentric));
        }
        Intersection::Box { min, max, faces, entering, leaving } => {
            writeln!(w, "{indent}  box from {} to {}", w.vector(*min), w.vector(*max));
            let pairs: Vec<String> = faces
                .iter()
                .zip(["x", "y", "z"])
                .map(|(pair, axis)| match pair {
                    Some([first, last]) => format!("{axis} {} to {}", w.number(*first), w.number(*last)),
                    None => format!("{axis} along the faces"),
                })
                .collect();
            let (entering, leaving) = (w.number(*entering), w.number(*leaving));
            writeln!(w, "{indent}    t between the faces in {}", pairs.join(", "));
            writeln!(w, "{indent}    in all three from t = {entering} to {leaving}  (fig. 5.16)");
        }
        Intersection::Frustum { base, axis, length, radii, a, b, c, discriminant, roots, heights, caps } => {
            let [r1, r2] = radii.map(|r| w.number(r));
            let radius = if radii[0] == radii[1] { format!("r = {r1}") } else { format!("r = {r1} to {r2}") };
            let (base, axis, length) = (w.vector(*base), w.vector(*axis), w.number(*length));
            writeln!(w, "{indent}  round about {base} + y*{axis}, 0 <= y <= {length}, {radius}");
            let [a, b, c] = [a, b, c].map(|v| w.number(*v));
            writeln!(w, "{indent}    a = {a}, b = {b}, c = {c} of the distance from the axis (exercise 14)");
            let side = match (roots, heights) {
                (Some([t1, t2]), Some([y1, y2])) => {
                    let [t1, t2, y1, y2] = [t1, t2, y1, y2].map(|v| w.number(*v));
                    format!(", t1 = {t1} at y = {y1}, t2 = {t2} at y = {y2}")
                }
                _ => String::new(),
            };
            writeln!(w, "{indent}    delta = b^2 - 4ac = {}  (5.18){side}", w.number(*discriminant));
            for (cap, t) in ["base", "top"].into_iter().zip(caps).filter_map(|(cap, t)| Some((cap, (*t)?))) {
                writeln!(w, "{indent}    disk of the {cap} at t = {}", w.number(t));
            }
        }
        Intersection::Torus { center, axis, radius, tube, coefficients, roots } => {
            let [radius, tube] = [radius, tube].map(|r| w.number(*r));
            writeln!(
                w,
                "{indent}  torus with c = {}, axis {}, R = {radius}, r = {tube}",
                w.vector(*center),
                w.vector(*axis)
            );
            let [c0, c1, c2, c3, c4] = coefficients.map(|c| w.number(c));
            writeln!(w, "{indent}    {c4}*t^4 + {c3}*t^3 + {c2}*t^2 + {c1}*t + {c0} = 0");
            let roots: Vec<String> = roots.iter().flatten().map(|t| w.number(*t).to_string()).collect();
            writeln!(w, "{indent}    roots {}", roots.join(", "));
        }
        Intersection::Rectangle { corner, u, v, normal, t, shares } => {
            let [corner, u, v, normal] = [corner, u, v, normal].map(|p| w.vector(*p));
            writeln!(w, "{indent}  rectangle {corner} + a*{u} + b*{v}");
            let [a, b] = shares.map(|share| w.number(share));
            writeln!(w, "{indent}    n = {normal}, t = {}  (5.27), a = {a}, b = {b}", w.number(*t));
        }
        Intersection::Plane { point, normal, d_dot_n, t } => {
            writeln!(w, "{indent}  plane through {}, n = {}", w.vector(*point), w.vector(*normal));
            writeln!(w, "{indent}    d.n = {}, t = (p1 - o).n / d.n = {}  (5.27)", w.number(*d_dot_n), w.number(*t));
        }
    }
}

fn write_refraction(w: &mut TextWriter, steps: &RefractionSteps, indent: &str) {
    let RefractionSteps { v_t, sin_i, sin_t, cos_t, t, r_t } = steps;
    writeln!(
        w,
        "{indent}  v_t = (v.n)n - v = {}  (5.41), sin i = |v_t| = {}  (5.42)",
        w.vector(*v_t),
        w.number(*sin_i)
    );
    writeln!(w, "{indent}  sin t = eta_i/eta_t * sin i = {}, cos t = {}  (5.43)", w.number(*sin_t), w.number(*cos_t));
    writeln!(w, "{indent}  t = {}, r_t = sin t * t - cos t * n = {}  (5.44)", w.vector(*t), w.vector(*r_t));
}

pub(super) fn write_hit_steps(w: &mut TextWriter, steps: &HitSteps, indent: &str) {
    let HitSteps { v, v_dot_n, r } = steps;
    writeln!(
        w,
        "{indent}    v = {}, v.n = {}, r = 2(v.n)n - v = {}  (5.37)",
        w.vector(*v),
        w.number(*v_dot_n),
        w.vector(*r)
    );
}

pub(super) fn write_light_steps(w: &mut TextWriter, steps: &LightSteps, indent: &str) {
    let LightSteps { intensity, attenuation, coefficients, cone } = steps;
    let [c, l, q] = coefficients.map(|v| w.number(v));
    writeln!(
        w,
        "{indent}        l = {} * attenuation 1/({c} + {l}*d + {q}*d^2) = {} * cone {}",
        w.rgb(*intensity),
        w.number(*attenuation),
        w.number(*cone)
    );
}
