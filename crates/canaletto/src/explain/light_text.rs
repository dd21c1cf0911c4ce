//! The terms of lights as text.

use super::steps_text::write_light_steps;
use super::text_writer::{TextWriter, counted};
use super::tree::LightNode;
use crate::math::Rgb;

/// The most lights that are written one by one at a camera ray's hit, and at a deeper one, if the text is folded.
const MOST_LIGHTS: [usize; 2] = [8, 3];

/// Writes the lights of a hit of a ray at this level.
pub(super) fn write_lights(w: &mut TextWriter, lights: &[LightNode], level: u32, indent: &str) {
    if w.is_full {
        return lights.iter().for_each(|light| write_light(w, light, indent));
    }
    let groups: Vec<&[LightNode]> = by_light(lights).collect();
    let most = MOST_LIGHTS[usize::from(level > 1)];
    let mut by_size: Vec<usize> = (0..groups.len()).collect();
    by_size.sort_by(|&a, &b| size(sum_of(groups[b])).total_cmp(&size(sum_of(groups[a]))));
    // One light takes no more room than the sum of one.
    let kept = if groups.len() > most + 1 { most } else { groups.len() };
    let mut others = Rgb::BLACK;
    for (index, group) in groups.iter().enumerate() {
        match group {
            _ if !by_size[..kept].contains(&index) => others += sum_of(group),
            [light] if level == 1 => write_light(w, light, indent),
            [light] => write_light_in_a_line(w, light, indent),
            points => write_points(w, points, level, indent),
        }
    }
    if groups.len() > kept {
        writeln!(w, "{indent}    + {} other lights: {}", groups.len() - kept, w.rgb(others));
    }
}

/// The points of each light, which follow each other.
pub(super) fn by_light(lights: &[LightNode]) -> impl Iterator<Item = &[LightNode]> {
    lights.chunk_by(|a, b| a.light == b.light && a.point < b.point)
}

/// The light of these points at a hit.
pub(super) fn sum_of(points: &[LightNode]) -> Rgb {
    points.iter().fold(Rgb::BLACK, |sum, point| sum + point.contribution)
}

/// What lights are sorted by.
fn size(light: Rgb) -> f32 {
    light.r + light.g + light.b
}

fn write_light(w: &mut TextWriter, light: &LightNode, indent: &str) {
    let distance = if light.distance.is_finite() {
        format!("distance {}", w.number(light.distance))
    } else {
        "from infinity".into()
    };
    writeln!(
        w,
        "{indent}    + {}{}: {}",
        light.light,
        match light.position {
            Some(p) => format!(" (random point {} at {})", light.point, w.vector(p)),
            None if light.point > 0 => format!(" (point {})", light.point),
            None => String::new(),
        },
        w.rgb(light.contribution)
    );
    writeln!(
        w,
        "{indent}        L = {}, {distance}, l = {}, n.L = {}",
        w.vector(light.direction),
        w.rgb(light.intensity),
        w.number(light.n_dot_l)
    );
    if let Some(steps) = &light.steps {
        write_light_steps(w, steps, indent);
    }
    if let Some(reason) = dark(light) {
        writeln!(w, "{indent}        {reason}");
        return;
    }
    for blocker in &light.blockers {
        let passed = 1.0 - blocker.opacity;
        let how = if passed > 0.0 { "shadow ray passes" } else { "shadow ray is blocked by" };
        writeln!(w, "{indent}        {how} {}: 1 - o = {}", blocker.object, w.number(passed));
    }
    writeln!(w, "{indent}        f_s = {}  (5.39a)", w.number(light.f_s));
    writeln!(w, "{indent}        diffuse  l*kd*(n.L)    = {}  (5.32)", w.rgb(light.diffuse));
    writeln!(
        w,
        "{indent}        specular l*ks*(r.L)^n  = {}, r.L = {}  (5.38)",
        w.rgb(light.specular),
        w.number(light.r_dot_l)
    );
}

/// Whether n·L isn't positive.
fn has_back_turned(light: &LightNode) -> bool {
    light.n_dot_l.is_nan() || light.n_dot_l <= 0.0
}

/// Whether a light is behind the surface or its shading normal.
pub(super) fn is_behind(light: &LightNode) -> bool {
    has_back_turned(light) || light.behind
}

/// The reason why no light of a point arrives, besides shadows.
pub(super) fn dark(light: &LightNode) -> Option<&'static str> {
    if has_back_turned(light) {
        return Some("the light is behind the surface: n.L <= 0");
    }
    if light.behind {
        return Some("the light is behind the surface; only the bent normal faces it");
    }
    light.intensity.is_black().then_some("no light arrives: the point is outside the cone or beam")
}

fn write_light_in_a_line(w: &mut TextWriter, light: &LightNode, indent: &str) {
    let how = match dark(light) {
        Some(_) if is_behind(light) => "behind the surface".to_owned(),
        Some(_) => "outside the cone or beam".to_owned(),
        None => {
            let names: Vec<&str> = light.blockers.iter().map(|blocker| blocker.object.as_str()).collect();
            let by = if names.is_empty() { String::new() } else { format!(" by {}", names.join(", ")) };
            format!("n.L = {}, f_s = {}{by}", w.number(light.n_dot_l), w.number(light.f_s))
        }
    };
    writeln!(w, "{indent}    + {}: {}; {how}", light.light, w.rgb(light.contribution));
}

/// Writes many points of one light, as their sum and means.
fn write_points(w: &mut TextWriter, points: &[LightNode], level: u32, indent: &str) {
    let seen: Vec<&LightNode> = points.iter().filter(|point| dark(point).is_none()).collect();
    let blocked = seen.iter().filter(|point| point.f_s == 0.0).count();
    let dimmed = seen.iter().filter(|point| point.f_s > 0.0 && point.f_s < 1.0).count();
    let mut blockers: Vec<(&str, usize)> = Vec::new();
    for point in &seen {
        // A body that is crossed twice blocks one point.
        let mut names: Vec<&str> = point.blockers.iter().map(|blocker| blocker.object.as_str()).collect();
        names.sort_unstable();
        names.dedup();
        for name in names {
            match blockers.iter_mut().find(|(other, _)| *other == name) {
                Some((_, count)) => *count += 1,
                None => blockers.push((name, 1)),
            }
        }
    }
    let mut passed = format!("{} pass", seen.len() - blocked - dimmed);
    let name = &points[0].light;
    let what = counted(points.len(), if points[0].position.is_some() { "random point" } else { "point" });
    writeln!(w, "{indent}    + {name}, {what}: {}", w.rgb(sum_of(points)));
    if seen.is_empty() {
        writeln!(w, "{indent}        no light of these arrives: they are behind the surface or don't shine on it");
        return;
    }
    for (count, what) in [
        (dimmed, "are dimmed"),
        (blocked, "are blocked"),
        (points.len() - seen.len(), "are behind the surface or don't shine on it"),
    ] {
        if count > 0 {
            passed += &format!(", {count} {what}");
        }
    }
    if !blockers.is_empty() {
        let more = blockers.len().saturating_sub(MOST_BLOCKERS);
        let names: Vec<String> =
            blockers.iter().take(MOST_BLOCKERS).map(|(name, count)| format!("{name} {count}")).collect();
        let more = if more > 0 { format!(" and {more} others") } else { String::new() };
        passed += &format!(" ({}{more})", names.join(", "));
    }
    let mean = |of: &dyn Fn(&LightNode) -> f32| {
        let sum: f64 = seen.iter().map(|point| f64::from(of(point))).sum();
        (sum / seen.len() as f64) as f32
    };
    let (f_s, n_dot_l) = (w.number(mean(&|point| point.f_s)), w.number(mean(&|point| point.n_dot_l)));
    writeln!(w, "{indent}        {passed}; mean f_s = {f_s}  (5.39a), mean n.L = {n_dot_l}");
    if level == 1 {
        let after_shadows =
            |of: &dyn Fn(&LightNode) -> Rgb| seen.iter().fold(Rgb::BLACK, |sum, point| sum + of(point) * point.f_s);
        let [diffuse, specular] = [after_shadows(&|point| point.diffuse), after_shadows(&|point| point.specular)];
        writeln!(w, "{indent}        sum of f_s*l*kd*(n.L)    = {}  (5.32)", w.rgb(diffuse));
        writeln!(w, "{indent}        sum of f_s*l*ks*(r.L)^n  = {}  (5.38)", w.rgb(specular));
    }
}

/// The most objects that are named as blocking a light's points.
const MOST_BLOCKERS: usize = 4;
