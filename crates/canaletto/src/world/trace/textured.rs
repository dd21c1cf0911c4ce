//! The third stage of a hit: the effect of textures on the material and the shading normal. A world without textures
//! has no such stage.

use crate::material::{
    MaterialPoint, Place, PreparedMaterial, Space, Target, TexCoord, TexCoords, TextureUse, apply_bump,
    apply_normal_map, clamp_to_hemisphere,
};
use crate::math::{DRay, Transform};
use crate::shape::{Mesh, Shape, Surface, SurfaceDifferential};
use crate::texture::{Footprint, Lookup, PreparedTexture};
use crate::world::GeometryProbe;
use crate::world::data::geometry::Geometry;
use crate::world::{Hit, MeshFacet, World};
use glam::{DVec2, DVec3};
use std::cell::OnceCell;

/// A texture lookup at a hit.
#[derive(Clone, Copy, Debug)]
pub struct TextureRead<'a> {
    /// The use, with the index of the texture in [`World::textures`].
    pub used: &'a TextureUse,
    /// The texture's name.
    pub name: &'a str,
    /// The places of the lookups, with their weights.
    pub readings: &'a [Reading],
    /// The texture's value, the weighted mean of the readings.
    pub value: [f32; 4],
    /// The material before this texture.
    pub before: &'a MaterialPoint,
    /// The material after this texture.
    pub after: &'a MaterialPoint,
    /// The unit shading normals before and after this texture, on the outer side.
    pub normals: [DVec3; 2],
}

/// One place at which a texture was read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reading {
    /// The place and its footprint.
    pub lookup: Lookup,
    /// The weight of this reading in the value.
    pub weight: f64,
    /// The footprint on the texture's image, if it has one.
    pub footprint: Option<Footprint>,
}

/// A hit in the space of its object.
struct Local<'w> {
    surface: Surface,
    /// The surface's derivatives, once something has asked for them, and what has them.
    surface_differential: OnceCell<SurfaceDifferential>,
    derived_from: Derived<'w>,
    hit: Hit,
    to_world: Option<Transform>,
    /// The geometry, which has bounds, and the primitive.
    bounded: Option<(&'w Geometry, u32)>,
    /// The origin of the object's coordinates.
    origin: DVec3,
    on_mesh: Option<OnMesh<'w>>,
}

/// What a hit's surface is a part of.
enum Derived<'w> {
    Shape(&'w Shape),
    Geometry(&'w Geometry),
    Facet(&'w MeshFacet<'w>),
}

/// A hit on a mesh.
#[derive(Clone, Copy)]
struct OnMesh<'w> {
    mesh: &'w Mesh,
    triangle: usize,
    /// The weights of the triangle's corners.
    weights: [f64; 3],
    time: f32,
}

impl Local<'_> {
    fn surface_differential(&self) -> &SurfaceDifferential {
        let Hit { primitive, uv: [u, v], time, .. } = self.hit;
        self.surface_differential.get_or_init(|| match self.derived_from {
            Derived::Shape(shape) => shape.surface_differential(&self.surface, &self.hit.shape_hit()),
            Derived::Geometry(geometry) => {
                geometry.surface_differential(primitive, &self.hit.shape_hit(), &self.surface, time)
            }
            Derived::Facet(facet) => facet.mesh.surface_differential(facet.triangle as usize, u, v, time),
        })
    }

    /// The tangent and the bitangent of normal maps: those of the mesh's vertices, or along growing u and falling v.
    fn tangent_frame(&self) -> [DVec3; 2] {
        let of_vertices = self.on_mesh.and_then(|OnMesh { mesh, triangle, weights, time }| {
            mesh.tangent_frame(triangle, weights, self.surface.shading_normal, time)
        });
        of_vertices.unwrap_or_else(|| {
            let [along, down] = self.surface_differential().tangents(self.surface.normal);
            [along, -down]
        })
    }

    /// A normal bent by the value of a normal map. Its frame is perpendicular in the world, so that meshes look alike
    /// whether their vertices are in the world's space or in one that is stretched.
    fn bent(&self, normal: DVec3, value: [f64; 3]) -> DVec3 {
        let frame = self.tangent_frame();
        match &self.to_world {
            Some(t) if t.uniform_scale().is_none() => {
                let bent = apply_normal_map(t.normal(normal).normalize(), frame.map(|v| t.vector(v)), value);
                t.inverse().normal(bent).normalize_or(normal)
            }
            _ => apply_normal_map(normal, frame, value),
        }
    }

    fn vertex_color(&self) -> [f32; 4] {
        self.on_mesh.map_or([1.0; 4], |hit| hit.mesh.vertex_color(hit.triangle, hit.weights))
    }
}

impl World {
    /// Whether rays should carry ray differentials.
    pub fn needs_differentials(&self) -> bool {
        self.shading.needs_differentials
    }

    /// The surface differential at a hit of this line's ray, in the world's space.
    pub fn surface_differential(&self, line: impl Into<DRay>, hit: &Hit) -> SurfaceDifferential {
        let local = self.local(line.into(), hit, None);
        match &local.to_world {
            None => *local.surface_differential(),
            Some(t) => local.surface_differential().transformed(t, &local.surface),
        }
    }

    /// The tangent and the bitangent at a hit of this line's ray: those of the mesh's vertices, or along growing u and
    /// falling v. Zero where the texture coordinates don't span the surface.
    pub(crate) fn tangent_frame(&self, line: DRay, hit: &Hit) -> [DVec3; 2] {
        let local = self.local(line, hit, None);
        let frame = local.tangent_frame();
        match &local.to_world {
            None => frame,
            Some(t) => frame.map(|direction| t.vector(direction)),
        }
    }

    /// The material at a hit: with its textures if it has any, which may bend the surface's shading normal. `material`
    /// is that of the hit, and `step` the footprint.
    #[inline]
    pub(crate) fn material_point<P: GeometryProbe + ?Sized>(
        &self,
        material: &PreparedMaterial,
        (line, hit): (DRay, &Hit),
        surface: &mut Surface,
        step: Option<[DVec3; 2]>,
        probe: &mut P,
    ) -> MaterialPoint {
        if material.is_plain() { material.at(surface) } else { self.textured(line, hit, surface, step, probe) }
    }

    /// The material at a hit of this line's ray. Textures bend the shading normal of `surface`, and its uv becomes the
    /// object's. `step` holds the offsets along the surface to the neighbouring samples.
    #[inline(never)]
    pub(crate) fn textured<P: GeometryProbe + ?Sized>(
        &self,
        line: DRay,
        hit: &Hit,
        surface: &mut Surface,
        step: Option<[DVec3; 2]>,
        probe: &mut P,
    ) -> MaterialPoint {
        let material = self.material(hit);
        let mut point = material.at(surface);
        self.texture_at(&self.local(line, hit, None), hit, (surface, &mut point), step, probe);
        material.finish(&mut point);
        point
    }

    /// The surface at a hit. `point` becomes [`World::textured`] of an opaque material, for integrators of physics: a
    /// standard surface comes without the classic numbers nearest to it. `step` finds the offsets along the surface to
    /// the neighbouring samples.
    #[inline(never)]
    pub(crate) fn textured_physics(
        &self,
        line: DRay,
        hit: &Hit,
        step: impl FnOnce(&Surface) -> Option<[DVec3; 2]>,
        point: &mut MaterialPoint,
    ) -> Surface {
        let local = self.local(line, hit, None);
        let mut surface = match local.to_world {
            None if hit.instance != Hit::UNBOUNDED => local.surface,
            _ => self.surface_without_uv(line, hit),
        };
        let step = step(&surface);
        *point = self.material(hit).at(&surface);
        self.texture_at(&local, hit, (&mut surface, point), step, &mut ());
        surface
    }

    /// [`World::textured`] on a facet, with the facet's own normal and texture coordinates.
    pub(crate) fn textured_facet<P: GeometryProbe + ?Sized>(
        &self,
        line: DRay,
        (hit, facet): (&Hit, &MeshFacet),
        surface: &mut Surface,
        step: Option<[DVec3; 2]>,
        probe: &mut P,
    ) -> MaterialPoint {
        let material = self.material(hit);
        let mut point = material.at(surface);
        self.texture_at(&self.local(line, hit, Some(facet)), hit, (surface, &mut point), step, probe);
        material.finish(&mut point);
        point
    }

    /// Applies the textures of a hit to its surface and to its material, which is to be
    /// [finished](PreparedMaterial::finish).
    #[inline(always)]
    fn texture_at<P: GeometryProbe + ?Sized>(
        &self,
        local: &Local,
        hit: &Hit,
        (surface, point): (&mut Surface, &mut MaterialPoint),
        step: Option<[DVec3; 2]>,
        probe: &mut P,
    ) {
        let material = self.material(hit);
        (surface.uv, surface.uv_rest) = (local.surface.uv, local.surface.uv_rest);
        let at = At::new(self, local, step);
        let mut normal = local.surface.shading_normal;
        let mut coat = normal;
        // Displacement was applied when the world was built.
        for used in material.textures.iter().filter(|used| !matches!(used.target, Target::Displace { .. })) {
            let pattern = &self.textures[used.texture as usize];
            let mut coords = None;
            let before = probe.is_active().then_some((*point, normal));
            let mut readings = [Reading { lookup: Lookup::default(), weight: 0.0, footprint: None }; 3];
            let room = if probe.is_active() { &mut readings[..] } else { &mut [] };
            let value = match at.own_lookup(used).filter(|_| !probe.is_active()) {
                Some(lookup) => at.read(pattern, used, &lookup),
                None => at.value(pattern, used, coords.insert(at.coords(used)), room),
            };
            match used.target {
                Target::Bump => normal = apply_bump(normal, at.slope(pattern, used, &at.coords(used))),
                Target::Normal { strength, down } => {
                    normal = local.bent(normal, tangent_space(value, strength, down));
                }
                Target::CoatNormal { strength, down } => {
                    let bent = local.bent(coat, tangent_space(value, strength, down));
                    coat = clamp_to_hemisphere(bent, local.surface.normal);
                }
                _ => used.apply(value, point),
            }
            if used.target.bends_normal() {
                normal = clamp_to_hemisphere(normal, local.surface.normal);
                point.normal_bent = true;
            }
            if let Some((before, was)) = before {
                let outwards = |n: DVec3| local.to_world.as_ref().map_or(n, |t| t.normal(n).normalize());
                probe.texture(&TextureRead {
                    used,
                    name: &self.shading.texture_names[used.texture as usize],
                    readings: &readings[..coords.map_or(0, |coords| coords.len())],
                    value,
                    before: &before,
                    after: point,
                    normals: [was, normal].map(outwards),
                });
            }
        }
        let in_world = |normal: DVec3, surface: &Surface| match &local.to_world {
            None => normal,
            Some(t) => clamp_to_hemisphere(t.normal(normal).normalize(), surface.normal),
        };
        if coat != normal && point.standard.is_some_and(|standard| standard.coat.weight > 0.0) {
            point.coat_normal = in_world(coat, surface).as_vec3();
        }
        if point.normal_bent {
            surface.shading_normal = in_world(normal, surface);
        }
    }

    /// The share of light that a surface blocks when light crosses it. Only textures that change this share are read.
    #[inline(never)]
    pub(crate) fn opacity_at(&self, line: DRay, hit: &Hit, step: Option<[DVec3; 2]>) -> f32 {
        self.crossed_by(|| self.local(line, hit, None), hit, step).opacity_with_coverage()
    }

    /// The coverage at a hit of this line's ray, without a footprint.
    pub(crate) fn coverage_at(&self, line: DRay, hit: &Hit) -> f32 {
        self.crossed_by(|| self.local(line, hit, None), hit, None).coverage
    }

    /// The material of a facet as far as light that crosses the surface needs it, without a footprint.
    pub(crate) fn crossed_facet(&self, line: DRay, hit: &Hit, facet: &MeshFacet) -> MaterialPoint {
        self.crossed_by(|| self.local(line, hit, Some(facet)), hit, None)
    }

    /// The material at a hit as far as light that crosses the surface needs it.
    #[inline(always)]
    fn crossed_by<'w>(
        &'w self,
        local: impl FnOnce() -> Local<'w>,
        hit: &Hit,
        step: Option<[DVec3; 2]>,
    ) -> MaterialPoint {
        let material = self.material(hit);
        let mut point = *material.plain();
        if material.textures.is_empty() || material.is_opaque() {
            return point;
        }
        let local = local();
        let at = At::new(self, &local, step);
        // The opacity of a clear standard surface follows from several of its numbers.
        let is_clear_standard = point.standard.is_some() && point.classic.opacity < 1.0;
        let counts =
            |target: &Target| target.may_transmit() || is_clear_standard && matches!(target, Target::Standard(_));
        for used in material.textures.iter().filter(|used| counts(&used.target)) {
            let pattern = &self.textures[used.texture as usize];
            let value = at.value(pattern, used, &at.coords(used), &mut []);
            used.apply(value, &mut point);
        }
        material.finish(&mut point);
        point
    }

    fn local<'w>(&'w self, line: DRay, hit: &Hit, facet: Option<&'w MeshFacet<'w>>) -> Local<'w> {
        let shape_hit = hit.shape_hit();
        if hit.instance == Hit::UNBOUNDED {
            let unbounded = &self.geometry.unbounded[hit.primitive as usize];
            let (shape, to_world) = unbounded.own.as_ref().map_or((&unbounded.shape, None), |(s, t)| (s, Some(*t)));
            let line = to_world.as_ref().map_or(line, |t| line.to_local(t));
            return Local {
                surface: shape.surface(line, &shape_hit),
                surface_differential: OnceCell::new(),
                derived_from: Derived::Shape(shape),
                hit: *hit,
                to_world,
                bounded: None,
                origin: unbounded.origin,
                on_mesh: None,
            };
        }
        let (index, to_world) = self.with_instance(hit.instance, |instance| {
            (instance.geometry, instance.placed(&self.geometry.chains, hit.time))
        });
        let geometry = &self.geometry.geometries[index as usize];
        let local_line = to_world.as_ref().map_or(line, |t| line.to_local(t));
        let (surface, derived_from) = match facet {
            Some(facet) => (facet.surface(&local_line, hit), Derived::Facet(facet)),
            None => {
                let surface = geometry.surface(local_line, hit.primitive, &shape_hit, hit.time);
                (surface, Derived::Geometry(geometry))
            }
        };
        Local {
            surface,
            surface_differential: OnceCell::new(),
            derived_from,
            hit: *hit,
            to_world,
            bounded: Some((geometry, hit.primitive)),
            origin: self.geometry.local_origins.get(&index).copied().unwrap_or_default(),
            on_mesh: match geometry {
                Geometry::Mesh { mesh, .. } => {
                    let (triangle, time) = (hit.primitive as usize, hit.time);
                    let weights = mesh.weights_at(triangle, &local_line, &shape_hit, time);
                    Some(OnMesh { mesh, triangle, weights, time })
                }
                _ => None,
            },
        }
    }
}

/// The vector of a normal map's colour in tangent space.
fn tangent_space([r, g, b, _]: [f32; 4], strength: f32, down: bool) -> [f64; 3] {
    let s = f64::from(strength);
    let [x, y, z] = [r, g, b].map(|v| 2.0 * f64::from(v) - 1.0);
    [x * s, if down { -y } else { y } * s, z]
}

/// A hit as the input of texture mappings.
struct At<'a> {
    local: &'a Local<'a>,
    /// The surface's own coordinates.
    uv: DVec2,
    /// The positions of the origin of coordinates: in the object's space, and in the world's.
    origins: [DVec3; 2],
    /// The steps to the neighbouring samples in the object's space; zero without a footprint.
    steps: [DVec3; 2],
}

impl<'a> At<'a> {
    fn new(world: &World, local: &'a Local<'a>, step: Option<[DVec3; 2]>) -> At<'a> {
        debug_assert!(step.is_none() || world.shading.needs_differentials);
        let steps = match (step, &local.to_world) {
            (None, _) => [DVec3::ZERO; 2],
            (Some(step), None) => step,
            (Some(step), Some(t)) => step.map(|s| t.inverse().vector(s)),
        };
        let uv = local.surface.uv.as_dvec2() + local.surface.uv_rest.as_dvec2();
        At { local, uv, origins: [local.origin, world.geometry.origin], steps }
    }

    /// The input of a use's mapping.
    fn place(&self, used: &TextureUse) -> Place<'a> {
        let Local { surface, to_world, bounded, .. } = self.local;
        let bounded = bounded.filter(|_| used.mapping.space == Space::Bounds);
        Place {
            point: surface.exact,
            normal: surface.normal,
            uv: self.uv,
            surface_differential: self.local.surface_differential(),
            to_world: to_world.as_ref(),
            bounds: bounded.and_then(|(geometry, primitive)| geometry.object_bounds(primitive)),
            origins: self.origins,
        }
    }

    /// The texture coordinates of a use.
    fn coords(&self, used: &TextureUse) -> TexCoords {
        let in_set = |OnMesh { mesh, triangle, weights, time }: OnMesh| {
            mesh.uv_in_set(used.mapping.uv_set, triangle, weights, time)
        };
        if used.mapping.uv_set > 0
            && let Some((uv, gradients)) = self.local.on_mesh.and_then(in_set)
        {
            let surface_differential = &SurfaceDifferential { gradients, ..*self.local.surface_differential() };
            return used.mapping.coords(&Place { uv, surface_differential, ..self.place(used) });
        }
        used.mapping.coords(&self.place(used))
    }

    /// The lookup at the surface's own coordinates, if they are those of the use, and there is no footprint.
    fn own_lookup(&self, used: &TextureUse) -> Option<Lookup> {
        let is_still = self.steps == [DVec3::ZERO; 2];
        let at = self.uv.extend(0.0);
        (is_still && used.mapping.is_own()).then_some(Lookup { at, ..Lookup::default() })
    }

    /// The texture's value at one place.
    fn read(&self, pattern: &PreparedTexture, used: &TextureUse, lookup: &Lookup) -> [f32; 4] {
        match used.target.takes_color() {
            _ if pattern.is_vertex_color() => self.local.vertex_color(),
            true => pattern.color(lookup),
            false => pattern.eval(lookup),
        }
    }

    fn lookup(&self, spot: &TexCoord) -> Lookup {
        let [dx, dy] = self.steps.map(|step| if step == DVec3::ZERO { step } else { spot.change(step) });
        Lookup { at: spot.at, dx, dy }
    }

    /// The weighted mean of the texture at `coords`. The readings are stored as far as `readings` has room.
    fn value(
        &self,
        pattern: &PreparedTexture,
        used: &TextureUse,
        coords: &TexCoords,
        readings: &mut [Reading],
    ) -> [f32; 4] {
        if pattern.is_vertex_color() {
            return self.local.vertex_color();
        }
        let one = |spot: &TexCoord, reading: Option<&mut Reading>| {
            let lookup = self.lookup(spot);
            if let Some(reading) = reading {
                *reading = Reading { lookup, weight: spot.weight, footprint: pattern.footprint(&lookup) };
            }
            self.read(pattern, used, &lookup)
        };
        if let [spot] = &coords[..] {
            return one(spot, readings.first_mut());
        }
        // Colours are weighted by their alpha.
        let by_alpha = used.target.takes_color();
        let mut sum = [0.0; 4];
        for (i, spot) in coords.iter().enumerate() {
            let value = one(spot, readings.get_mut(i));
            let weight = spot.weight as f32;
            let share = if by_alpha { weight * value[3] } else { weight };
            for (channel, sum) in sum.iter_mut().enumerate() {
                *sum += value[channel] * if channel < 3 { share } else { weight };
            }
        }
        if by_alpha && sum[3] > 0.0 {
            let alpha = sum[3];
            sum[..3].iter_mut().for_each(|c| *c /= alpha);
        }
        sum
    }

    /// The gradient of a texture's height, in the object's space. Differences are taken over the footprint, or over a
    /// texel if that is larger. Between texels the slope would be that of the filter only.
    fn slope(&self, pattern: &PreparedTexture, used: &TextureUse, coords: &TexCoords) -> DVec3 {
        let spacing = pattern.spacing().unwrap_or([SMALLEST_STEP; 2]);
        let spacing = [spacing[0], spacing[1], SMALLEST_STEP];
        let mut slope = DVec3::ZERO;
        for spot in coords.iter() {
            let lookup = self.lookup(spot);
            for (axis, gradient) in spot.gradients().into_iter().enumerate() {
                if gradient == DVec3::ZERO {
                    continue;
                }
                let reach = 0.5 * spacing[axis].max(lookup.dx[axis].abs() + lookup.dy[axis].abs());
                let height = |side: f64| {
                    let at = lookup.at + DVec3::AXES[axis] * (side * reach);
                    f64::from(used.number(pattern.eval(&Lookup { at, ..lookup })))
                };
                let rise = (height(1.0) - height(-1.0)) / (2.0 * reach);
                if rise.is_finite() {
                    slope += gradient * (rise * spot.weight);
                }
            }
        }
        slope
    }
}

/// The step for heights without texels or footprint, in the texture's own units.
const SMALLEST_STEP: f64 = 1.0 / 1024.0;
