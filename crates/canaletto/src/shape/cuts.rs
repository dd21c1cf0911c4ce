//! Where surfaces of revolution are cut into triangles: evenly, or more finely where they are seen from near.
//!
//! Columns lie around the axis, rows along the profile. All triangles of a shape lie between the same columns and rows,
//! so that neighbours share whole edges and no crack opens.

use super::tessellate::{FrustumFrame, torus_end};
use super::{Cone, Cylinder, Disk, Shape, Sphere, Torus, solve};
use glam::DVec3;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// The fractions 0 to 1 at which a surface is cut along one direction, in order.
#[derive(Clone, Debug)]
pub(super) struct Cuts {
    numerators: Vec<f64>,
    denominator: f64,
}

impl Cuts {
    /// Equal parts.
    pub(super) fn even(parts: usize) -> Cuts {
        Cuts { numerators: (0..=parts).map(|i| i as f64).collect(), denominator: parts as f64 }
    }

    /// The number of parts.
    pub(super) fn len(&self) -> usize {
        self.numerators.len() - 1
    }

    /// A cut.
    pub(super) fn at(&self, i: usize) -> f64 {
        self.times(1.0, i)
    }

    /// A cut of a length.
    pub(super) fn times(&self, length: f64, i: usize) -> f64 {
        length * self.numerators[i] / self.denominator
    }

    /// The middle of a part; behind the last cut, of one as long as the last part.
    pub(super) fn middle(&self, i: usize) -> f64 {
        let part = i.min(self.len() - 1);
        let length = self.numerators[part + 1] - self.numerators[part];
        (self.numerators[i] + length * 0.5) / self.denominator
    }
}

/// The largest deviation of triangles that a view of a shape allows, in the shape's space: of all points within a
/// radius of a point, the least.
pub(crate) type Allowed<'a> = &'a dyn Fn(DVec3, f64) -> f64;

/// The most parts of a surface that are looked at for its cuts.
const MOST_CELLS: u32 = 1 << 18;

/// The most halvings of a surface, and of a part that is looked at.
const MOST_HALVINGS: u32 = 48;

/// A curve that turns around an axis.
enum Profile {
    /// An arc of a circle at this distance from the axis. Its angles begin at the outer equator.
    Arc { ring: f64, radius: f64, angles: [f64; 2] },
    /// A line between two points, each with its distance from the axis and its height.
    Line([[f64; 2]; 2]),
}

/// A surface of revolution.
struct Revolution {
    center: DVec3,
    /// The directions for (5.45a), with y along the axis.
    axes: [DVec3; 3],
    profile: Profile,
}

/// Columns and rows that are fine enough for a view.
pub(super) struct ViewCuts {
    pub(super) columns: Cuts,
    pub(super) rows: Cuts,
}

impl ViewCuts {
    /// The cuts of a curved shape. None for other shapes.
    pub(super) fn new(shape: &Shape, allowed: Allowed) -> Option<ViewCuts> {
        let surface = Revolution::of(shape)?;
        let mut search = Search { surface: &surface, allowed, cells: MOST_CELLS };
        let columns = search.columns();
        let rows = search.rows();
        Some(ViewCuts { columns, rows })
    }
}

impl Revolution {
    fn of(shape: &Shape) -> Option<Revolution> {
        let frustum = |frame: FrustumFrame| {
            let ends = frame.ends();
            Revolution { center: frame.base, axes: [frame.x, frame.axis, frame.z], profile: Profile::Line(ends) }
        };
        Some(match shape {
            Shape::Sphere(Sphere { center, radius }) => Revolution {
                center: center.as_dvec3(),
                axes: DVec3::AXES,
                profile: Profile::Arc { ring: 0.0, radius: (*radius).into(), angles: [-FRAC_PI_2, FRAC_PI_2] },
            },
            Shape::Torus(torus @ Torus { center, axis, radius, tube }) => {
                let (frame, end) = (solve::Frame::around(axis.as_dvec3()), torus_end(torus));
                Revolution {
                    center: center.as_dvec3(),
                    axes: [frame.x, frame.y, frame.z],
                    profile: Profile::Arc { ring: (*radius).into(), radius: (*tube).into(), angles: [-end, end] },
                }
            }
            Shape::Cylinder(Cylinder { base, top, radius, .. }) => {
                frustum(FrustumFrame::new([*base, *top], [*radius; 2]))
            }
            Shape::Cone(Cone { base, top, radius, top_radius, .. }) => {
                frustum(FrustumFrame::new([*base, *top], [*radius, *top_radius]))
            }
            Shape::Disk(Disk { center, normal, radius }) => {
                let frame = solve::Frame::around(normal.as_dvec3());
                Revolution {
                    center: center.as_dvec3(),
                    axes: [frame.x, frame.y, frame.z],
                    profile: Profile::Line([[0.0; 2], [(*radius).into(), 0.0]]),
                }
            }
            Shape::Box(_) | Shape::Triangle(_) | Shape::Rectangle(_) | Shape::Plane(_) | Shape::Partial(_) => {
                return None;
            }
        })
    }

    /// The distance from the axis and the height at a fraction of the profile.
    fn profile_at(&self, v: f64) -> [f64; 2] {
        match self.profile {
            Profile::Arc { ring, radius, angles: [from, to] } => {
                let (sin, cos) = libm::sincos(from + (to - from) * v);
                [ring + radius * cos, -radius * sin]
            }
            Profile::Line([from, to]) => [0, 1].map(|i: usize| from[i] + (to[i] - from[i]) * v),
        }
    }

    fn profile_length(&self) -> f64 {
        match self.profile {
            Profile::Arc { radius, angles: [from, to], .. } => radius * (to - from),
            Profile::Line([from, to]) => libm::hypot(to[0] - from[0], to[1] - from[1]),
        }
    }

    /// A ball around the part of the surface between two columns and two rows, and its largest distance from the axis.
    fn ball(&self, [columns, rows]: [[f64; 2]; 2]) -> (DVec3, f64, f64) {
        let [u, v] = [columns, rows].map(|[from, to]| (from + to) * 0.5);
        let ([across, height], half_row) = (self.profile_at(v), 0.5 * self.profile_length() * (rows[1] - rows[0]));
        let (sin, cos) = libm::sincos(TAU * (u - 0.5));
        let [x, y, z] = self.axes;
        let most = across.max(0.0) + half_row;
        let half_column = most * (PI * (columns[1] - columns[0])).min(2.0);
        (self.center + (x * sin + z * cos) * across + y * height, half_row + half_column, most)
    }
}

/// How far a chord of this angle is from its circle, over the circle's radius: 1 − cos φ = 2 sin² (φ/2) of half the
/// angle φ.
fn sagitta(angle: f64) -> f64 {
    let sin = libm::sin(0.25 * angle);
    2.0 * sin * sin
}

/// The search for the cuts of a surface.
struct Search<'a> {
    surface: &'a Revolution,
    allowed: Allowed<'a>,
    /// How many parts may still be looked at.
    cells: u32,
}

impl Search<'_> {
    fn columns(&mut self) -> Cuts {
        // Columns and rows of an arc take half of the deviation each.
        let share = if matches!(self.surface.profile, Profile::Arc { .. }) { 0.5 } else { 1.0 };
        self.cuts(4, |search, [from, to]| {
            let sagitta = sagitta(TAU * (to - from)) / share;
            search.is_too_coarse([[from, to], [0.0, 1.0]], &|most| most * sagitta, 0)
        })
    }

    fn rows(&mut self) -> Cuts {
        let Profile::Arc { radius, angles: [low, high], .. } = self.surface.profile else { return Cuts::even(1) };
        self.cuts(4, |search, [from, to]| {
            let deviation = 2.0 * radius * sagitta((high - low) * (to - from));
            search.is_too_coarse([[0.0, 1.0], [from, to]], &|_| deviation, 0)
        })
    }

    /// Equal parts, each of which is halved until it is fine enough.
    fn cuts(&mut self, parts: u32, mut is_too_coarse: impl FnMut(&mut Self, [f64; 2]) -> bool) -> Cuts {
        let width = 1.0 / f64::from(parts);
        let mut numerators = vec![0.0];
        let mut waiting: Vec<([f64; 2], u32)> =
            (0..parts).rev().map(|i| ([f64::from(i) * width, f64::from(i + 1) * width], 0)).collect();
        while let Some((part @ [from, to], halvings)) = waiting.pop() {
            if halvings < MOST_HALVINGS && is_too_coarse(self, part) {
                let middle = (from + to) * 0.5;
                waiting.extend([([middle, to], halvings + 1), ([from, middle], halvings + 1)]);
            } else {
                numerators.push(to);
            }
        }
        Cuts { numerators, denominator: 1.0 }
    }

    /// Whether triangles deviate by more than is allowed anywhere in a part of the surface. `deviation` is that of the
    /// triangles at a distance from the axis.
    fn is_too_coarse(&mut self, cell: [[f64; 2]; 2], deviation: &dyn Fn(f64) -> f64, halvings: u32) -> bool {
        let (center, radius, most) = self.surface.ball(cell);
        let (deviation_here, least) = (deviation(most), (self.allowed)(center, radius));
        if self.cells == 0 || deviation_here <= least {
            return false;
        }
        self.cells -= 1;
        // A smaller part would have nearly the same answer.
        if least >= 0.5 * (self.allowed)(center, 0.0) || halvings >= 2 * MOST_HALVINGS {
            return true;
        }
        let [columns, rows] = cell;
        let lengths = [TAU * most * (columns[1] - columns[0]), self.surface.profile_length() * (rows[1] - rows[0])];
        let halves = |[from, to]: [f64; 2]| [[from, (from + to) * 0.5], [(from + to) * 0.5, to]];
        let parts = if lengths[0] > lengths[1] {
            halves(columns).map(|columns| [columns, rows])
        } else {
            halves(rows).map(|rows| [columns, rows])
        };
        parts.into_iter().any(|part| self.is_too_coarse(part, deviation, halvings + 1))
    }
}
