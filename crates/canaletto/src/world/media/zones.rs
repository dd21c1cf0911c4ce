//! Zones: boxes in which a clear surface may coincide with another surface. They are found at build time, so that rays
//! outside need no test for contacts.
//!
//! Each clear shape, and each clear mesh as a whole, has a zone around all places where it may touch something else or
//! itself. Zones are in the world's space and hold at all times. They have a margin relative to their coordinates, far
//! larger than the distance at which rays treat surfaces as coinciding. Where nothing is known, as in worlds of groups,
//! the zone is everywhere.

use crate::math::{DRay, Transform};
use crate::shape::{Cuboid, Plane, Shape, Sphere};
use crate::world::World;
use crate::world::data::folds::{NEAR, largest, with_margin};
use crate::world::data::geometry::Geometry;
use crate::world::data::instance::{Instance, NONE};
use crate::world::data::motion::around;
use crate::world::trace::query::Hit;
use canaletto_bvh::Aabb;
use canaletto_parallel::prelude::*;
use glam::{DMat3, DVec3};

/// The index of the empty box, and of the box around all zones.
const NOWHERE: u32 = 0;
const ALL: u32 = 1;

/// The distance of a ray's point from the surface that it hits, relative to the coordinates.
const ROUNDING: f64 = 1.0 / (1 << 20) as f64;

/// The most clear shapes that have a zone each.
const MOST: usize = 1 << 22;

/// The number of neighbours tested for all clear objects together. An object that needs more has its whole box as zone.
const PATIENCE: usize = 1 << 22;

/// The zones of a world's clear objects.
#[derive(Debug)]
pub(in crate::world) struct Zones {
    /// For each of the root's instances: the index of its first entry in `numbers`, and whether each primitive has an
    /// entry.
    rows: Vec<(u32, bool)>,
    numbers: Vec<u32>,
    /// The boxes of the zones. The first is empty, the second is the union of the others.
    boxes: Vec<Aabb>,
}

impl Zones {
    /// The zones of a world of which nothing is known: everywhere.
    pub(in crate::world) const UNKNOWN: Zones = Zones { rows: Vec::new(), numbers: Vec::new(), boxes: Vec::new() };
}

/// A clear object with a zone of its own.
struct Clear {
    instance: u32,
    /// The primitive in its geometry, or [`NONE`] for a whole mesh.
    primitive: u32,
}

/// A primitive or geometry with its bounds in the world.
struct Placement<'a> {
    bounds: Aabb,
    /// The shape, if it has the identity transform.
    shape: Option<&'a Shape>,
}

impl World {
    /// Whether any other surface may coincide with the one at a hit. The hit is on a clear surface, or from inside a
    /// body.
    #[inline]
    pub(crate) fn may_touch(&self, line: &DRay, hit: &Hit) -> bool {
        let Some(&(row, each)) = self.media.zones.rows.get(hit.instance as usize) else { return true };
        let number = self.media.zones.numbers[row as usize + if each { hit.primitive as usize } else { 0 }];
        let zone = &self.media.zones.boxes[number as usize];
        let way = line.direction * f64::from(hit.t);
        let (p, error) = (line.origin + way, (line.origin.abs() + way.abs()).max_element() * ROUNDING);
        (p + error).cmpge(zone.min.as_dvec3()).all() && (p - error).cmple(zone.max.as_dvec3()).all()
    }

    /// The zones of all clear objects.
    pub(in crate::world) fn find_zones(&self) -> Zones {
        let instances = &self.geometry.root.instances;
        let clear: Vec<bool> = (0..instances.len() as u32).map(|number| self.may_let_light_through(number)).collect();
        let each = |instance: &Instance| {
            !matches!(self.geometry.geometries[instance.geometry as usize], Geometry::Mesh { .. })
        };
        let len = |instance: &Instance| self.geometry.geometries[instance.geometry as usize].len();
        if !self.media.has_clear || !self.geometry.root.is_flat() {
            return Zones::UNKNOWN;
        }
        let mut zones = Zones { rows: Vec::new(), numbers: vec![ALL], boxes: vec![Aabb::EMPTY; 2] };
        let mut things = Vec::new();
        for (number, instance) in (0..).zip(instances) {
            match (clear[number as usize], each(instance)) {
                (false, _) => zones.rows.push((0, false)),
                (true, false) => {
                    zones.rows.push((zones.numbers.len() as u32, false));
                    zones.numbers.push(NOWHERE);
                    things.push(Clear { instance: number, primitive: NONE });
                }
                (true, true) => {
                    let count = len(instance);
                    if zones.numbers.len() + count > MOST {
                        return Zones::UNKNOWN;
                    }
                    zones.rows.push((zones.numbers.len() as u32, true));
                    for primitive in 0..count as u32 {
                        let opaque = self.material_at(instance, primitive).is_opaque();
                        zones.numbers.push(if opaque { ALL } else { NOWHERE });
                        if !opaque {
                            things.push(Clear { instance: number, primitive });
                        }
                    }
                }
            }
        }
        let patience = PATIENCE / things.len().max(1) + 256;
        let found: Vec<Aabb> = things.par_iter().map(|thing| self.zone(thing, patience)).collect();
        for (thing, zone) in things.iter().zip(found) {
            if !zone.is_empty() {
                let place =
                    zones.rows[thing.instance as usize].0 + if thing.primitive == NONE { 0 } else { thing.primitive };
                zones.numbers[place as usize] = zones.boxes.len() as u32;
                zones.boxes[ALL as usize] = zones.boxes[ALL as usize].union(zone);
                zones.boxes.push(zone);
            }
        }
        zones
    }

    /// The zone of a clear object. At most `patience` neighbours are tested.
    fn zone(&self, thing: &Clear, mut patience: usize) -> Aabb {
        let instance = &self.geometry.root.instances[thing.instance as usize];
        let own = self.placed(instance, thing.primitive);
        if !self.is_precise(instance, &own.bounds) {
            return own.bounds;
        }
        let mut zone = Aabb::EMPTY;
        for unbounded in &self.geometry.unbounded {
            zone = zone.union(match &unbounded.shape {
                Shape::Plane(plane) => where_cut(&own, plane),
                _ => own.bounds,
            });
        }
        self.geometry.root.tree.overlapping(&own.bounds, |leaf| {
            leaf.slots().all(|slot| {
                let number = self.geometry.root.tree.order()[slot as usize];
                let neighbour = &self.geometry.root.instances[number as usize];
                let bounds = with_margin(&self.geometry.root.slot_bounds[slot as usize]);
                if !bounds.overlaps(&own.bounds) {
                    return true;
                }
                let same = number == thing.instance;
                let near = match &neighbour.to_world {
                    _ if same && thing.primitive == NONE => {
                        let folds =
                            self.media.shells[neighbour.geometry as usize].as_ref().map_or(own.bounds, |s| s.folds());
                        if !folds.is_empty() {
                            zone = zone.union(with_margin(&neighbour.bounds(&self.geometry.chains, folds)));
                        }
                        return true;
                    }
                    _ if neighbour.motion != NONE => {
                        zone = zone.union(bounds.intersection(&own.bounds));
                        return true;
                    }
                    None => own.bounds,
                    Some(to_world) => moved(&to_world.inverse(), &own.bounds),
                };
                let mut goes_on = true;
                self.geometry.geometries[neighbour.geometry as usize].overlapping(&near, |primitive| {
                    if same && primitive == thing.primitive {
                        return true;
                    }
                    let other = self.placed(neighbour, primitive);
                    if self.may_meet(thing, &own, &other) {
                        zone = zone.union(own.bounds.intersection(&other.bounds));
                    }
                    patience = patience.saturating_sub(1);
                    if patience == 0 {
                        zone = own.bounds;
                    }
                    goes_on = zone != own.bounds;
                    goes_on
                });
                goes_on
            })
        });
        zone
    }

    /// Whether rounding is far smaller than the zones' margin. It isn't where a transform cancels large coordinates. It
    /// isn't, either, where a transform flattens a mesh, whose sides may then touch.
    fn is_precise(&self, instance: &Instance, bounds: &Aabb) -> bool {
        let Some(to_world) = &instance.to_world else { return true };
        let (geometry, matrix) = (&self.geometry.geometries[instance.geometry as usize], to_world.matrix());
        let local = geometry.bounds();
        let most = local.min.abs().max(local.max.abs()).as_dvec3();
        let sum = |m: &DMat3, v: DVec3| m.x_axis.abs() * v.x + m.y_axis.abs() * v.y + m.z_axis.abs() * v.z;
        let error = (sum(&matrix.matrix3, most) + matrix.translation.abs()).max_element() * ROUNDING * 4.0;
        let is_fine = |error: f64, bounds: &Aabb| error < f64::from(largest(bounds) * NEAR);
        is_fine(error, bounds)
            && (!matches!(geometry, Geometry::Mesh { .. })
                || instance.motion == NONE
                    && is_fine(error * sum(&to_world.inverse().matrix().matrix3, DVec3::ONE).max_element(), &local))
    }

    /// The bounds of an instance's primitive, or of the whole instance.
    fn placed(&self, instance: &Instance, primitive: u32) -> Placement<'_> {
        let geometry = &self.geometry.geometries[instance.geometry as usize];
        let local = if primitive == NONE { geometry.bounds() } else { geometry.primitive_bounds(primitive) };
        let shape = match geometry {
            Geometry::Shapes { shapes, .. } if instance.to_world.is_none() => Some(&shapes[primitive as usize]),
            _ => None,
        };
        Placement { bounds: with_margin(&instance.bounds(&self.geometry.chains, local)), shape }
    }

    /// Whether the surface of a clear object may coincide with another surface.
    fn may_meet(&self, thing: &Clear, own: &Placement, other: &Placement) -> bool {
        if !own.bounds.overlaps(&other.bounds) || surfaces_are_apart(own, other) || surfaces_are_apart(other, own) {
            return false;
        }
        // The triangles of a mesh give a tighter test than its box.
        let instance = &self.geometry.root.instances[thing.instance as usize];
        if thing.primitive != NONE || instance.motion != NONE {
            return true;
        }
        let near = instance.to_world.map_or(other.bounds, |to_world| moved(&to_world.inverse(), &other.bounds));
        let mut any = false;
        self.geometry.geometries[instance.geometry as usize].overlapping(&near, |triangle| {
            any = self.placed(instance, triangle).bounds.overlaps(&other.bounds);
            !any
        });
        any
    }
}

/// Whether the surface of a shape is certainly away from another one.
fn surfaces_are_apart(a: &Placement, b: &Placement) -> bool {
    let near = f64::from(largest(&a.bounds).max(largest(&b.bounds)) * NEAR) * 4.0;
    let (min, max) = (b.bounds.min.as_dvec3() - near, b.bounds.max.as_dvec3() + near);
    match (a.shape, b.shape) {
        (Some(Shape::Sphere(a)), Some(Shape::Sphere(b))) => {
            let [(c, r), (d, s)] = [ball(a), ball(b)];
            let distance = (c - d).length();
            distance > r + s + near || distance < (r - s).abs() - near
        }
        (Some(Shape::Sphere(a)), _) => {
            let (c, r) = ball(a);
            let (low, high) = (min - c, max - c);
            let nearest = low.max(-high).max(DVec3::ZERO).length();
            nearest > r || low.abs().max(high.abs()).length() < r
        }
        (Some(Shape::Box(Cuboid { min: low, max: high })), _) => {
            min.cmpgt(low.as_dvec3()).all() && max.cmplt(high.as_dvec3()).all()
        }
        _ => false,
    }
}

fn ball(sphere: &Sphere) -> (DVec3, f64) {
    (sphere.center.as_dvec3(), sphere.radius.into())
}

/// The box around a box in another space, with a margin.
fn moved(to: &Transform, Aabb { min, max }: &Aabb) -> Aabb {
    let (min, max) = (min.as_dvec3(), max.as_dvec3());
    let (center, half) = around(to, (min + max) * 0.5, (max - min) * 0.5);
    with_margin(&Aabb { min: (center - half).as_vec3(), max: (center + half).as_vec3() })
}

/// The part of a box that a plane intersects.
fn where_cut(placed: &Placement, plane: &Plane) -> Aabb {
    let Aabb { min, max } = placed.bounds;
    let (low, high) = (min.as_dvec3(), max.as_dvec3());
    let n = plane.normal.as_dvec3().normalize_or_zero();
    let through = n.dot(plane.point.as_dvec3());
    let near = f64::from(min.abs().max(max.abs()).max(plane.point.abs()).max_element() * NEAR);
    let [least, most] = [(low * n).min(high * n), (low * n).max(high * n)];
    let sum = |v: DVec3| v.element_sum();
    if through < sum(least) - near || through > sum(most) + near {
        return Aabb::EMPTY;
    }
    if let Some(Shape::Sphere(sphere)) = placed.shape {
        let (c, r) = ball(sphere);
        if (c.dot(n) - through).abs() > r + near {
            return Aabb::EMPTY;
        }
    }
    // n·x = through, solved for each coordinate with the others anywhere in the box.
    let mut cut = placed.bounds;
    for axis in (0..3).filter(|&axis| n[axis].abs() > 1e-6) {
        let others = |all: DVec3| sum(all) - all[axis];
        let ends = [through - others(most) - near, through - others(least) + near].map(|end| end / n[axis]);
        let (from, to) = (ends[0].min(ends[1]) as f32, ends[0].max(ends[1]) as f32);
        cut.min[axis] = cut.min[axis].max(from.next_down());
        cut.max[axis] = cut.max[axis].min(to.next_up());
    }
    cut
}
