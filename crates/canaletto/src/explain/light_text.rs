//! The terms of lights, and their text.

use super::number::{Digits, Number};
use super::term::{Line, Term, line, of_ray, summand};
use super::text_writer::{TextWriter, counted};
use super::tree::{HitNode, LightNode};
use crate::math::Rgb;
use glam::DVec3;

/// The most lights that are written one by one at a camera ray's hit, and at a deeper one, if the text is folded.
const MOST_LIGHTS: [usize; 2] = [8, 3];

/// Writes the lights of a hit of a ray at this level.
pub(super) fn write_lights(w: &mut TextWriter, hit: &HitNode, level: u32, indent: &str) {
    if w.is_full {
        return hit.lights.iter().for_each(|light| w.lines(indent, light.lines(hit)));
    }
    let groups: Vec<&[LightNode]> = by_light(&hit.lights).collect();
    let most = MOST_LIGHTS[usize::from(level > 1)];
    let mut by_size: Vec<usize> = (0..groups.len()).collect();
    by_size.sort_by(|&a, &b| size(sum_of(groups[b])).total_cmp(&size(sum_of(groups[a]))));
    // One light takes no more room than the sum of one.
    let kept = if groups.len() > most + 1 { most } else { groups.len() };
    let mut others = Rgb::BLACK;
    for (index, group) in groups.iter().enumerate() {
        match group {
            _ if !by_size[..kept].contains(&index) => others += sum_of(group),
            [light] if level == 1 => w.lines(indent, light.lines(hit)),
            [light] => w.line(indent, &light_in_a_line(light)),
            points => write_points(w, points, level, indent),
        }
    }
    if groups.len() > kept {
        w.line(indent, &line!("    + {} other lights: {}", groups.len() - kept, others));
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

impl LightNode {
    /// The terms of a point of a light at a hit.
    pub(super) fn lines<'t>(&'t self, hit: &'t HitNode) -> Vec<Line<'t>> {
        let (distance, intensity, n_dot_l, r_dot_l) = (self.distance, self.intensity, self.n_dot_l, self.r_dot_l);
        let factors = move || line!("n.L = {}, r.L = {}, f_s = {}, l = {}", n_dot_l, r_dot_l, self.f_s, intensity);
        let sum = summand(self.contribution).because(move || Some(factors()));
        let which = match self.position {
            Some(position) => line!(" (random point {} at {})", self.point, position),
            None if self.point > 0 => line!(" (point {})", self.point),
            None => line!(""),
        };
        let distance =
            if distance.is_finite() { line!("distance {distance}", distance) } else { line!("from infinity") };
        let towards = Term::from(self.direction).because(|| Some(line!("{}", self.place(hit))));
        let towards = line!("        L = {L}, ", towards).and(distance);
        let mut lines = vec![
            line!("    + {}", &self.light).and(which).and(line!(": {f_s (diffuse + specular):5.39a}", sum)),
            towards.and(line!(", l = {}, n.L = {n.L}", intensity, n_dot_l)).of_ray(),
        ];
        lines.extend(self.steps.iter().map(|steps| steps.line()));
        let side = if is_behind(self) { "behind the surface" } else { "in front" };
        let side = Term::from(side).because(move || Some(line!("n.L = {}", n_dot_l)));
        lines.push(line!("{l}{side of the light}", of_ray(intensity), side).written_if(false));
        let dark = dark(self);
        lines.extend(dark.map(|reason| line!("        {}", reason)));
        for blocker in self.blockers.iter().filter(|_| dark.is_none()) {
            let passed = 1.0 - blocker.opacity;
            let how = if passed > 0.0 { "shadow ray passes" } else { "shadow ray is blocked by" };
            lines.push(line!("        {} {}: 1 - o = {}", how, &blocker.object, passed));
        }
        let f_s = Term::from(self.f_s).because(|| Some(line!("{}", self.shadow())));
        let specular = line!("        specular l*ks*(r.L)^n  = {specular l*ks*(r.L)^n:5.38}", self.specular);
        let sums = [
            line!("        f_s = {f_s:5.39a}  (5.39a)", f_s),
            line!("        diffuse  l*kd*(n.L)    = {diffuse l*kd*(n.L):5.32}  (5.32)", self.diffuse).of_ray(),
            specular.and(line!(", r.L = {r.L}  (5.38)", r_dot_l)).of_ray(),
        ];
        lines.extend(sums.map(|line| line.written_if(dark.is_none())));
        lines
    }

    /// Where a light is, as seen from a hit.
    fn place(&self, hit: &HitNode) -> String {
        if !self.distance.is_finite() {
            return "the light is at infinity".into();
        }
        let towards = DVec3::from(self.direction.map(f64::from)) * f64::from(self.distance);
        let place = self.position.map_or(DVec3::from(hit.point) + towards, DVec3::from);
        // The place is known to the digits of a distance in f32.
        let unit = libm::pow(10.0, (libm::log10(place.abs().max_element().max(f64::MIN_POSITIVE))).floor() - 4.0);
        let [x, y, z] = place.to_array().map(|v| Number((v / unit).round() * unit, Digits::Significant(5)));
        format!("the light is at ({x}, {y}, {z})")
    }

    /// What stands between a hit and a light.
    fn shadow(&self) -> String {
        let names: Vec<&str> = self.blockers.iter().map(|blocker| blocker.object.as_str()).collect();
        match names[..] {
            [] if is_behind(self) => "the light is behind the surface".into(),
            [] => "nothing blocks it".into(),
            _ if self.f_s == 0.0 => format!("blocked by {}", names.join(", ")),
            _ => format!("weakened by {}", names.join(", ")),
        }
    }
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

fn light_in_a_line(light: &LightNode) -> Line<'_> {
    let start = line!("    + {}: {}; ", &light.light, light.contribution);
    start.and(match dark(light) {
        Some(_) if is_behind(light) => line!("behind the surface"),
        Some(_) => line!("outside the cone or beam"),
        None => {
            let names = line!(" by ").list(light.blockers.iter().map(|blocker| line!("{}", &blocker.object)));
            let factors = line!("n.L = {}, f_s = {}", light.n_dot_l, light.f_s);
            if light.blockers.is_empty() { factors } else { factors.and(names) }
        }
    })
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
    w.line(indent, &line!("    + {}, {}: {}", name, what, sum_of(points)));
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
    let (f_s, n_dot_l) = (mean(&|point| point.f_s), mean(&|point| point.n_dot_l));
    w.line(indent, &line!("        {}; mean f_s = {}  (5.39a), mean n.L = {}", passed, f_s, n_dot_l));
    if level == 1 {
        let after_shadows =
            |of: &dyn Fn(&LightNode) -> Rgb| seen.iter().fold(Rgb::BLACK, |sum, point| sum + of(point) * point.f_s);
        let [diffuse, specular] = [after_shadows(&|point| point.diffuse), after_shadows(&|point| point.specular)];
        w.line(indent, &line!("        sum of f_s*l*kd*(n.L)    = {}  (5.32)", diffuse));
        w.line(indent, &line!("        sum of f_s*l*ks*(r.L)^n  = {}  (5.38)", specular));
    }
}

/// The most objects that are named as blocking a light's points.
const MOST_BLOCKERS: usize = 4;
