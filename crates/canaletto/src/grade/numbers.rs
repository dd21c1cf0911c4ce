//! The numbers of a scene that a picture may have otherwise, and scenes in which they are changed.

use super::finding::{Finding, neat_numbers, times};
use super::mistake::Mistake;
use super::seen::{Seen, objects_of};
use crate::light::LightKind;
use crate::material::{Material, MaterialModel, Phong};
use crate::math::{Rgb, Transform};
use crate::scene::{CameraProjection, Content, Scene, Stage, View};
use crate::shape::Shape;
use crate::world::World;
use glam::{DVec3, Vec3};

/// A number of a scene, or something without numbers that may be otherwise.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Number {
    Eye,
    Center,
    /// The angle in degrees by which the camera is turned about its axis.
    Up,
    Fovy,
    /// The factor of all colours.
    Brightness,
    Background,
    Ambient,
    /// The position of a light, or the direction towards it, by its node.
    LightPosition(usize),
    LightIntensity(usize),
    /// The factor of all lights' intensities.
    AllIntensities,
    /// The coefficients l and q of all lights, with c as it is.
    Attenuation,
    /// A light is missing.
    NoLight(usize),
    /// Two lights have each other's intensities.
    LightsExchanged(usize, usize),
    /// The offset of an object, by its node.
    Position(usize),
    /// The factor of an object's size about its centre.
    Size(usize),
    /// An object is missing.
    NoObject(usize),
    /// A coefficient of a material, of one object or of all materials.
    Material(Coefficient, Whose),
    /// Two materials are exchanged.
    Exchanged(usize, usize),
    /// An object has another material.
    Assigned(usize, usize),
}

/// A coefficient of a material.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Coefficient {
    Kd,
    Ks,
    N,
    K,
    Eta,
    Opacity,
}

/// Whose coefficient it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Whose {
    /// That of all materials, by one factor.
    All,
    /// That of a material.
    Material(usize),
    /// That of an object alone, by its node.
    Object(usize),
}

use Coefficient::*;

/// A scene with the view that is graded.
#[derive(Clone, Copy)]
pub(super) struct Subject<'a> {
    pub(super) scene: &'a Scene,
    pub(super) view: &'a View,
    pub(super) world: &'a World,
}

/// The most nodes, triangles and texels of a scene that is built again with other numbers.
const MOST_NODES: usize = 200;
const MOST_PRIMITIVES: u64 = 2_000;
const MOST_TEXELS: usize = 1 << 14;
/// The most materials of which pairs are exchanged.
const MOST_EXCHANGED: usize = 12;

impl Subject<'_> {
    /// The numbers that may be otherwise, those with fewer values first.
    pub(super) fn numbers(&self, stage: Stage) -> Vec<Number> {
        let mut all = vec![Number::Up, Number::Fovy, Number::Brightness, Number::Eye, Number::Center];
        // An orthographic camera has no angle of view.
        all.retain(|n| *n != Number::Fovy || self.view.intrinsics.projection == CameraProjection::Perspective);
        let scene = self.scene;
        let texels: usize = scene.images.iter().map(|image| (image.width * image.height) as usize).sum();
        if scene.nodes.len() > MOST_NODES || self.world.primitives() > MOST_PRIMITIVES || texels > MOST_TEXELS {
            return all;
        }
        if scene.environment.is_none() && scene.background.max_component() > 0.0 {
            all.push(Number::Background);
        }
        let used = |c: Coefficient| scene.materials.iter().any(|m| is_phong(m) && is_used(c, &m.classic(), stage));
        let lights = self.lights();
        if stage > Stage::Unlit {
            all.push(Number::AllIntensities);
            all.push(Number::Attenuation);
            for (i, light) in lights.iter().enumerate() {
                all.extend([Number::LightPosition(*light), Number::LightIntensity(*light)]);
                if lights.len() > 1 {
                    all.push(Number::NoLight(*light));
                }
                all.extend(lights[..i].iter().map(|other| Number::LightsExchanged(*other, *light)));
            }
        }
        if stage >= Stage::Ambient {
            all.push(Number::Ambient);
        }
        for coefficient in [Kd, Ks, N, K] {
            if used(coefficient) {
                all.push(Number::Material(coefficient, Whose::All));
            }
        }
        let objects = self.objects();
        for (i, material) in scene.materials.iter().enumerate().filter(|(_, material)| is_phong(material)) {
            let users = objects.iter().filter(|node| scene.nodes[**node].material == Some(i as u32));
            let users: Vec<usize> = users.copied().collect();
            for coefficient in [N, Eta, Opacity, Kd, Ks, K] {
                if is_used(coefficient, &material.classic(), stage) {
                    all.push(Number::Material(coefficient, Whose::Material(i)));
                    if users.len() > 1 {
                        all.extend(users.iter().map(|node| Number::Material(coefficient, Whose::Object(*node))));
                    }
                }
            }
            if i < MOST_EXCHANGED {
                all.extend((0..i).map(|other| Number::Exchanged(other, i)));
                all.extend(objects.iter().map(|node| Number::Assigned(*node, i)));
            }
        }
        for node in objects {
            all.extend([Number::NoObject(node), Number::Position(node)]);
            if !matches!(scene.nodes[node].content, Content::Shape(Shape::Plane(_))) {
                all.push(Number::Size(node));
            }
        }
        all.sort_by_key(|number| number.is_hard());
        all
    }

    /// The nodes of lights at the root.
    fn lights(&self) -> Vec<usize> {
        let is_light = |i: &usize| matches!(self.scene.nodes[*i].content, Content::Light(_));
        (0..self.scene.nodes.len()).filter(is_light).collect()
    }

    /// The nodes of objects at the root.
    fn objects(&self) -> Vec<usize> {
        let is_object = |i: &usize| objects_of(self.scene, &self.scene.nodes[*i]) > 0;
        (0..self.scene.nodes.len()).filter(is_object).collect()
    }

    fn phong(&self, whose: Whose) -> Phong {
        let material = match whose {
            Whose::Material(i) => Some(i),
            Whose::Object(node) => self.scene.nodes[node].material.map(|i| i as usize),
            Whose::All => None,
        };
        material.map_or(Phong::default(), |i| self.scene.materials[i].classic())
    }

    /// The scene's own values.
    pub(super) fn own(&self, number: &Number) -> Vec<f64> {
        let (view, scene) = (self.view, self.scene);
        match number {
            Number::Eye => view.extrinsics.eye.to_array().to_vec(),
            Number::Center => view.extrinsics.center.to_array().to_vec(),
            Number::Up => vec![0.0],
            Number::Fovy => vec![view.intrinsics.fovy],
            Number::Brightness | Number::AllIntensities | Number::Size(_) | Number::Material(_, Whose::All) => {
                vec![1.0]
            }
            Number::Background => values(scene.background),
            Number::Ambient => values(scene.ambient),
            Number::LightPosition(node) => self.light_place(*node).map_or(Vec::new(), |p| p.to_array().to_vec()),
            Number::LightIntensity(node) => match &scene.nodes[*node].content {
                Content::Light(light) => values(light.intensity),
                _ => Vec::new(),
            },
            Number::Attenuation => {
                let first = self.lights().first().map(|node| &scene.nodes[*node].content);
                match first {
                    Some(Content::Light(light)) => light.attenuation[1..].iter().map(|v| f64::from(*v)).collect(),
                    _ => Vec::new(),
                }
            }
            Number::Position(_) => vec![0.0; 3],
            Number::Material(coefficient, whose) => {
                let phong = self.phong(*whose);
                match coefficient {
                    Kd => values(phong.kd),
                    Ks => values(phong.ks),
                    K => values(phong.k),
                    N => vec![f64::from(phong.n)],
                    Eta => vec![f64::from(phong.eta)],
                    Opacity => vec![f64::from(phong.opacity)],
                }
            }
            Number::NoLight(_)
            | Number::LightsExchanged(..)
            | Number::NoObject(_)
            | Number::Exchanged(..)
            | Number::Assigned(..) => Vec::new(),
        }
    }

    /// A light's position, or the direction towards it.
    fn light_place(&self, node: usize) -> Option<DVec3> {
        let Content::Light(light) = &self.scene.nodes[node].content else { return None };
        let place = match &light.kind {
            LightKind::Omni(omni) => {
                let [x, y, z, _] = omni.position;
                Vec3::new(x, y, z)
            }
            LightKind::Directional(light) => -light.towards,
            LightKind::Spot(spot) => spot.position,
            LightKind::Disk(light) => light.disk.center,
            LightKind::Sphere(light) => light.sphere.center,
            LightKind::Rectangle(light) => light.parallelogram.corner,
            LightKind::Mesh(_) => return None,
        };
        Some(place.as_dvec3())
    }

    /// The centre of what a node holds, and its size.
    fn extent(&self, node: usize) -> (DVec3, f64) {
        let whole = self.world.bounds();
        let size = (whole.max - whole.min).as_dvec3().length().clamp(1e-6, 1e12);
        let Content::Shape(shape) = &self.scene.nodes[node].content else { return (DVec3::ZERO, 0.2 * size) };
        let transform = &self.scene.nodes[node].transform;
        match shape {
            Shape::Sphere(sphere) => (transform.point(sphere.center.as_dvec3()), f64::from(sphere.radius)),
            Shape::Box(b) => {
                let middle = (b.min + b.max).as_dvec3() / 2.0;
                (transform.point(middle), (b.max - b.min).as_dvec3().length() / 2.0)
            }
            Shape::Triangle(t) => {
                let middle = (t.a + t.b + t.c).as_dvec3() / 3.0;
                (transform.point(middle), (t.a - t.b).as_dvec3().length())
            }
            Shape::Plane(plane) => (transform.point(plane.point.as_dvec3()), 0.1 * size),
            Shape::Disk(disk) => (transform.point(disk.center.as_dvec3()), 0.2 * size),
            _ => (DVec3::ZERO, 0.2 * size),
        }
    }

    /// How much a value changes a picture clearly.
    pub(super) fn scale(&self, number: &Number) -> f64 {
        let (view, whole) = (self.view, self.world.bounds());
        let size = (whole.max - whole.min).as_dvec3().length();
        let size = if size.is_finite() && size > 0.0 { size.min(1e12) } else { 1.0 };
        let own = self.own(number);
        match number {
            Number::Eye | Number::Center => 0.5 * (view.extrinsics.eye - view.extrinsics.center).length(),
            Number::Up => 30.0,
            Number::Fovy => 10.0,
            Number::LightPosition(node) => {
                self.light_place(*node).map_or(size, |p| p.length()).clamp(0.05 * size, 10.0 * size).max(1e-6) * 0.5
            }
            Number::Position(node) => self.extent(*node).1,
            Number::Attenuation => 0.5 / size,
            Number::Material(N, Whose::Material(_) | Whose::Object(_)) => own[0].max(4.0) * 0.5,
            Number::Material(Eta, _) => 0.3,
            _ => own.iter().copied().fold(0.3, f64::max),
        }
    }

    /// Values from which a fit begins besides the scene's own: what is typed or computed by mistake.
    pub(super) fn starts(&self, number: &Number) -> Vec<Vec<f64>> {
        let (own, scale) = (self.own(number), self.scale(number));
        let mut all: Vec<Vec<f64>> = Vec::new();
        match number {
            Number::Eye | Number::Center | Number::LightPosition(_) | Number::Position(_) => {
                let around = match number {
                    Number::Position(node) => self.extent(*node).0,
                    _ => DVec3::ZERO,
                };
                let place = DVec3::new(own[0], own[1], own[2]) + around;
                let [x, y, z] = place.to_array();
                for [a, b, c] in [[x, y, z], [x, z, y], [y, x, z], [z, y, x], [y, z, x], [z, x, y]] {
                    for signs in 0..8u32 {
                        let sign = |axis: u32| if signs >> axis & 1 == 1 { -1.0 } else { 1.0 };
                        all.push(vec![a * sign(0), b * sign(1), c * sign(2)]);
                    }
                }
                all.extend([2.0, 0.5, 10.0, 0.1, 0.0].map(|f| vec![x * f, y * f, z * f]));
                for step in [0.4 * scale, 1.2 * scale] {
                    for axis in 0..3 {
                        for sign in [-step, step] {
                            let mut p = [x, y, z];
                            p[axis] += sign;
                            all.push(p.to_vec());
                        }
                    }
                }
                for p in &mut all {
                    for (v, own) in p.iter_mut().zip(around.to_array()) {
                        *v -= own;
                    }
                }
            }
            Number::Up => all.extend((1..24).map(|i| vec![f64::from(i) * 15.0 - 180.0])),
            Number::Fovy => all.extend([0.5, 0.7, 1.4, 2.0].map(|f| vec![(own[0] * f).min(170.0)])),
            Number::Brightness | Number::AllIntensities | Number::Size(_) | Number::Material(_, Whose::All) => {
                all.extend([0.25, 0.5, 0.75, 1.4, 2.0, 4.0].map(|f| vec![f]));
            }
            Number::Material(N, _) => all.extend([0.25, 0.5, 2.0, 4.0].map(|f| vec![own[0] * f])),
            Number::Material(Eta, _) => all.extend([1.0, 1.15, 1.33, 1.5, 2.0].map(|f| vec![f])),
            Number::Material(Opacity, _) => all.extend([0.0, 0.25, 0.5, 0.75].map(|f| vec![f])),
            Number::Attenuation => {
                all.extend([vec![own[1], own[0]], vec![0.0, 0.0], vec![scale, 0.0], vec![0.0, scale * scale]]);
            }
            _ if own.len() == 3 => all.extend([0.5, 2.0].map(|f| own.iter().map(|v| v * f).collect())),
            _ => {}
        }
        all.retain(|start| *start != own);
        all
    }

    /// The scene with other values, or none if there is no such scene.
    pub(super) fn seen<'s>(&self, base: &'s Seen<'s>, number: &Number, x: &[f64]) -> Option<Seen<'s>> {
        if !x.iter().all(|v| v.is_finite()) {
            return None;
        }
        let mut view = self.view.clone();
        match number {
            Number::Eye => view.extrinsics.eye = DVec3::from_slice(x),
            Number::Center => view.extrinsics.center = DVec3::from_slice(x),
            Number::Up => {
                let axis = (view.extrinsics.eye - view.extrinsics.center).normalize_or_zero();
                let turn = Transform::rotate(axis, x[0]).ok()?;
                view.extrinsics.up = turn.vector(view.extrinsics.up);
            }
            Number::Fovy => view.intrinsics.fovy = x[0],
            Number::Brightness => return (x[0] > 0.0).then(|| base.brightened(x[0])),
            _ => {
                let scene = self.changed(number, x)?;
                return Seen::built(scene, &view);
            }
        }
        base.through(&view)
    }

    fn changed(&self, number: &Number, x: &[f64]) -> Option<Scene> {
        let mut scene = self.scene.clone();
        match number {
            Number::Background => scene.background = color(x)?,
            Number::Ambient => scene.ambient = color(x)?,
            Number::LightPosition(node) => {
                let p = DVec3::from_slice(x).as_vec3();
                let Content::Light(light) = &mut scene.nodes[*node].content else { return None };
                match &mut light.kind {
                    LightKind::Omni(omni) => omni.position[..3].copy_from_slice(&p.to_array()),
                    LightKind::Directional(light) => light.towards = -p,
                    LightKind::Spot(spot) => spot.position = p,
                    LightKind::Disk(light) => light.disk.center = p,
                    LightKind::Sphere(light) => light.sphere.center = p,
                    LightKind::Rectangle(light) => light.parallelogram.corner = p,
                    LightKind::Mesh(_) => return None,
                }
            }
            Number::LightIntensity(node) => {
                let Content::Light(light) = &mut scene.nodes[*node].content else { return None };
                light.intensity = color(x)?;
            }
            Number::AllIntensities | Number::Attenuation => {
                if x.iter().any(|v| *v < 0.0) {
                    return None;
                }
                for node in &mut scene.nodes {
                    let Content::Light(light) = &mut node.content else { continue };
                    if *number == Number::AllIntensities {
                        light.intensity *= x[0] as f32;
                    } else {
                        light.attenuation = [light.attenuation[0], x[0] as f32, x[1] as f32];
                    }
                }
            }
            Number::NoLight(node) | Number::NoObject(node) => {
                scene.nodes.remove(*node);
            }
            Number::LightsExchanged(a, b) => {
                let intensity = |node: usize| match &self.scene.nodes[node].content {
                    Content::Light(light) => Some(light.intensity),
                    _ => None,
                };
                let own = [intensity(*b)?, intensity(*a)?];
                if own[0] == own[1] {
                    return None;
                }
                for (node, other) in [*a, *b].into_iter().zip(own) {
                    if let Content::Light(light) = &mut scene.nodes[node].content {
                        light.intensity = other;
                    }
                }
            }
            Number::Position(node) => {
                let moved = scene.nodes.remove(*node).with_transform(&Transform::translate(DVec3::from_slice(x)));
                scene.nodes.insert(*node, moved);
            }
            Number::Size(node) => {
                let f = x[0];
                if f <= 1e-3 {
                    return None;
                }
                let center = self.extent(*node).0;
                let about = Transform::translate(center)
                    .after(&Transform::scale(DVec3::splat(f)).ok()?)
                    .after(&Transform::translate(-center));
                let sized = scene.nodes.remove(*node).with_transform(&about);
                scene.nodes.insert(*node, sized);
            }
            Number::Material(coefficient, whose) => match whose {
                Whose::All => {
                    for phong in scene.materials.iter_mut().filter_map(|material| material.model.phong_mut()) {
                        let f = x[0] as f32;
                        match coefficient {
                            Kd => phong.kd *= f,
                            Ks => phong.ks *= f,
                            K => phong.k *= f,
                            N => phong.n *= f,
                            Eta | Opacity => return None,
                        }
                        if f < 0.0 {
                            return None;
                        }
                    }
                    if *coefficient == Kd {
                        // The ambient term stays as it is.
                        scene.ambient *= 1.0 / x[0].max(1e-6) as f32;
                    }
                }
                Whose::Material(i) => set(scene.materials[*i].model.phong_mut()?, *coefficient, x)?,
                Whose::Object(node) => {
                    let mut own = scene.materials[scene.nodes[*node].material? as usize].clone();
                    set(own.model.phong_mut()?, *coefficient, x)?;
                    own.name = format!("{} of one object", own.name);
                    scene.nodes[*node].material = Some(scene.materials.len() as u32);
                    scene.materials.push(own);
                }
            },
            Number::Exchanged(a, b) => {
                let own = &self.scene.materials;
                (scene.materials[*a], scene.materials[*b]) = (own[*b].clone(), own[*a].clone());
                let names = [scene.materials[*a].name.clone(), scene.materials[*b].name.clone()];
                [scene.materials[*b].name, scene.materials[*a].name] = names;
            }
            Number::Assigned(node, material) => {
                if scene.nodes[*node].material == Some(*material as u32) {
                    return None;
                }
                scene.nodes[*node].material = Some(*material as u32);
            }
            Number::Eye | Number::Center | Number::Up | Number::Fovy | Number::Brightness => return None,
        }
        Some(scene)
    }

    /// How much is said by other values: simple hypotheses are light.
    pub(super) fn weight(&self, number: &Number, x: &[f64]) -> usize {
        match number {
            // What explains the picture by one object needs no other.
            Number::Material(_, Whose::All) | Number::AllIntensities | Number::Brightness => 4,
            Number::Material(_, Whose::Object(_)) => 4 + x.len(),
            _ if factor(&self.own(number), x).is_some() => 3,
            _ => 2 + 2 * x.len(),
        }
    }

    /// The name of the object of a node.
    fn object_name(&self, node: usize) -> String {
        let before: usize = self.scene.nodes[..node].iter().map(|node| objects_of(self.scene, node)).sum();
        let object = u32::try_from(before + 1).ok().and_then(|id| self.world.object_with_id(id));
        self.scene.nodes[node]
            .name
            .as_deref()
            .map(str::to_owned)
            .or(object.map(|object| object.name.clone()))
            .unwrap_or_default()
    }

    /// The name of the light of a node.
    fn light_name(&self, node: usize) -> String {
        let lights = self.lights();
        let number = lights.iter().position(|own| *own == node).map_or(0, |i| i + 1);
        match &self.scene.nodes[node].content {
            Content::Light(light) => match (&light.name, &self.scene.nodes[node].name) {
                (Some(name), _) | (_, Some(name)) => format!("the light \"{name}\""),
                _ if lights.len() == 1 => "the light".into(),
                _ => format!("light {number}"),
            },
            _ => "the light".into(),
        }
    }

    /// The names of the objects with a material.
    fn users(&self, material: usize) -> String {
        let scene = self.scene;
        let of = |node: &usize| scene.nodes[*node].material == Some(material as u32);
        let names: Vec<String> = self.objects().into_iter().filter(of).map(|node| self.object_name(node)).collect();
        match names.len() {
            0 => format!("the objects of material \"{}\"", scene.materials[material].name),
            1..=4 => names.join(", "),
            more => format!("{more} objects of material \"{}\"", scene.materials[material].name),
        }
    }

    fn whose_name(&self, whose: Whose) -> String {
        match whose {
            Whose::All => "all objects".into(),
            Whose::Material(i) => self.users(i),
            Whose::Object(node) => self.object_name(node),
        }
    }

    /// What is said about other values than the scene's.
    pub(super) fn finding(&self, number: &Number, x: &[f64]) -> Finding {
        let own = self.own(number);
        let (expected, found) = (neat_numbers(&own), neat_numbers(x));
        let factor = factor(&own, x);
        let as_bright = |what: &str| match factor {
            Some(f) => format!("{what} {} as bright as they should be", times(f)),
            None => format!("{what} of another colour than they should be"),
        };
        let (subject, words, look): (String, String, &str) = match number {
            Number::Eye => (
                "the camera".into(),
                format!("the picture is seen from {found}; the scene's eye is {expected}"),
                "look at the position of the eye and at the signs and the order of its coordinates",
            ),
            Number::Center => (
                "the camera".into(),
                format!("the camera looks at {found}; the scene's center is {expected}"),
                "look at the camera's direction",
            ),
            Number::Up => (
                "the camera".into(),
                format!("the camera is turned about its axis by {found} degrees"),
                "look at the vector up and at the order of its coordinates",
            ),
            Number::Fovy => (
                "the camera".into(),
                format!("the vertical angle of view is {found} degrees; the scene's fovy is {expected}"),
                "look at the window's height: half of the angle, in radians",
            ),
            Number::Brightness => (
                "the picture".into(),
                format!("all colours of the picture are {} as bright as they should be", times(x[0])),
                "look at a factor or a division of the final colours, such as by the largest one",
            ),
            Number::Background => (
                "the background".into(),
                format!("the background is {found}; the scene's is {expected}"),
                "look at the colour of rays without a hit",
            ),
            Number::Ambient => (
                "the ambient light".into(),
                match factor {
                    Some(f) => {
                        format!("the ambient term is {} as bright as it should be: {found}, not {expected}", times(f))
                    }
                    None => format!("the ambient light is {found}; the scene's is {expected}"),
                },
                "look at Ia, and at how often the ambient term is added",
            ),
            Number::LightPosition(node) => {
                let name = self.light_name(*node);
                let words = format!("{name} stands at {found}; in the scene it is at {expected}");
                (name, words, "look at the light's position and at the signs and the order of its coordinates")
            }
            Number::LightIntensity(node) => {
                let name = self.light_name(*node);
                let words = match factor {
                    Some(f) => format!("{name} is {} as bright as it should be: {found}, not {expected}", times(f)),
                    None => format!("{name} has the intensity {found}; in the scene it is {expected}"),
                };
                (name, words, "look at the light's intensity and at how often its terms are added")
            }
            Number::AllIntensities => (
                "all lights".into(),
                format!("all lights are {} as bright as they should be", times(x[0])),
                "look at the lights' intensities, and at a factor such as 1 / pi or 1 / the number of lights",
            ),
            Number::Attenuation => (
                "all lights".into(),
                format!("the light is divided by c + l d + q d^2 with l q = {found}; in the scene they are {expected}"),
                "look at the falloff: attenuation that is missing, linear or squared",
            ),
            Number::NoLight(node) => {
                let name = self.light_name(*node);
                (name.clone(), format!("{name} is missing in the picture"), "look at the sum over the lights")
            }
            Number::LightsExchanged(a, b) => {
                let names = format!("{} and {}", self.light_name(*a), self.light_name(*b));
                (names.clone(), format!("{names} have each other's intensities"), "look at the order of the lights")
            }
            Number::Position(node) => {
                let (name, place) = (self.object_name(*node), self.extent(*node).0);
                let kind = match &self.scene.nodes[*node].content {
                    Content::Shape(Shape::Sphere(_)) => "its centre",
                    _ => "its place",
                };
                let at = |offset: DVec3| neat_numbers(&(place + offset).to_array());
                let words = format!(
                    "{name} is at another position: {kind} is {}, not {}",
                    at(DVec3::from_slice(x)),
                    at(DVec3::ZERO)
                );
                (name, words, "look at the object's position and at the order of its transforms")
            }
            Number::Size(node) => {
                let name = self.object_name(*node);
                let words = match &self.scene.nodes[*node].content {
                    Content::Shape(Shape::Sphere(sphere)) => {
                        let radius = f64::from(sphere.radius);
                        let [found, own] = [radius * x[0], radius].map(|r| neat_numbers(&[r]));
                        format!(
                            "the radius of {name} is {found}, not {own}: it is {} as large as it should be",
                            times(x[0])
                        )
                    }
                    _ => format!("{name} is {} as large as it should be", times(x[0])),
                };
                (name, words, "look at the radius or size: a diameter for a radius, or a missing square")
            }
            Number::NoObject(node) => {
                let name = self.object_name(*node);
                (name.clone(), format!("{name} is missing in the picture"), "look at the list of objects")
            }
            Number::Material(coefficient, whose) => {
                let name = self.whose_name(*whose);
                let (word, what, look) = match coefficient {
                    Kd => ("kd", "diffuse colours", "look at kd, and at factors such as 1 / pi"),
                    Ks => ("ks", "highlights", "look at ks: it may be counted twice, or be that of another object"),
                    K => ("k", "reflections", "look at k"),
                    N => ("n", "highlights", "look at the exponent n of the highlights"),
                    Eta => ("eta", "", "look at the coefficient of refraction, and at which side is which"),
                    Opacity => ("opacity", "", "look at the opacity o and at 1 - o"),
                };
                let words = match coefficient {
                    N if *whose == Whose::All => {
                        format!("the exponents n of all highlights are {} as large as they should be", times(x[0]))
                    }
                    N | Eta | Opacity => format!("{word} of {name} is {found}, not {expected}"),
                    _ if *whose == Whose::All => as_bright(&format!("the {what} of {name} are")),
                    _ => format!(
                        "{}: {word} is {found}, not {expected}",
                        as_bright(&format!("the {what} of {name} are"))
                    ),
                };
                (name, words, look)
            }
            Number::Exchanged(a, b) => {
                let names = format!("{} and {}", self.users(*a), self.users(*b));
                let [a, b] = [*a, *b].map(|i| self.scene.materials[i].name.as_str());
                let words = format!("the materials \"{a}\" and \"{b}\" are exchanged ({names})");
                (names, words, "look at the order of the materials")
            }
            Number::Assigned(node, material) => {
                let name = self.object_name(*node);
                let words = format!("{name} has the material \"{}\"", self.scene.materials[*material].name);
                (name, words, "look at which object has which material")
            }
        };
        Finding { subject, words, look: look.into(), expected: own, found: x.to_vec(), factor }
    }
}

impl Number {
    /// The mistake of another value.
    pub(super) fn mistake(&self) -> Mistake {
        match self {
            Number::Eye => Mistake::Eye,
            Number::Center => Mistake::Center,
            Number::Up => Mistake::Up,
            Number::Fovy => Mistake::Fovy,
            Number::Brightness => Mistake::Brightness,
            Number::Background => Mistake::Background,
            Number::Ambient => Mistake::AmbientFactor,
            Number::LightPosition(_) => Mistake::LightPosition,
            Number::LightIntensity(_) | Number::AllIntensities => Mistake::LightIntensity,
            Number::Attenuation => Mistake::Falloff,
            Number::NoLight(_) => Mistake::MissingLight,
            Number::LightsExchanged(..) => Mistake::LightsExchanged,
            Number::Position(_) => Mistake::ObjectPosition,
            Number::Size(_) => Mistake::ObjectSize,
            Number::NoObject(_) => Mistake::MissingObject,
            Number::Material(coefficient, _) => match coefficient {
                Kd => Mistake::DiffuseFactor,
                Ks => Mistake::SpecularFactor,
                N => Mistake::Exponent,
                K => Mistake::ReflectionFactor,
                Eta => Mistake::Eta,
                Opacity => Mistake::Opacity,
            },
            Number::Exchanged(..) | Number::Assigned(..) => Mistake::MaterialsExchanged,
        }
    }

    /// Whether other values change only pixels that a small change changes, too.
    pub(super) fn is_local(&self) -> bool {
        match self {
            Number::Material(coefficient, _) => !matches!(coefficient, N | Eta),
            Number::Background | Number::Ambient | Number::LightIntensity(_) | Number::AllIntensities => true,
            _ => false,
        }
    }

    /// Whether the picture depends on the value by edges, so that a fit needs many beginnings.
    pub(super) fn is_hard(&self) -> bool {
        matches!(self, Number::Eye | Number::Center | Number::LightPosition(_) | Number::Position(_))
    }
}

/// Whether a coefficient shows at a stage.
fn is_used(coefficient: Coefficient, phong: &Phong, stage: Stage) -> bool {
    match coefficient {
        Kd => true,
        Ks => stage >= Stage::Specular,
        N => stage >= Stage::Specular && !phong.ks.is_black(),
        K => stage >= Stage::Reflection,
        Eta => stage >= Stage::Full && phong.opacity < 1.0,
        Opacity => stage >= Stage::Full,
    }
}

fn set(phong: &mut Phong, coefficient: Coefficient, x: &[f64]) -> Option<()> {
    match coefficient {
        Kd => phong.kd = color(x)?,
        Ks => phong.ks = color(x)?,
        K => phong.k = color(x)?,
        N => phong.n = x[0] as f32,
        Eta => phong.eta = x[0] as f32,
        Opacity => phong.opacity = x[0] as f32,
    }
    phong.check().ok()
}

fn values(c: Rgb) -> Vec<f64> {
    c.to_array().map(f64::from).to_vec()
}

fn color(x: &[f64]) -> Option<Rgb> {
    let [r, g, b] = [0, 1, 2].map(|i| x[i].max(0.0) as f32);
    (x.len() == 3).then(|| Rgb::new(r, g, b))
}

/// The factor between two lists of numbers, if it is one for all of them.
fn factor(own: &[f64], x: &[f64]) -> Option<f64> {
    let largest = own.iter().copied().fold(0.0, f64::max);
    let i = own.iter().position(|v| *v == largest && *v > 0.0)?;
    let f = x.get(i)? / own[i];
    let near = |(own, x): (&f64, &f64)| (x - own * f).abs() <= 0.04 * largest * f.max(0.1);
    own.iter().zip(x).all(near).then_some(f)
}

fn is_phong(material: &Material) -> bool {
    matches!(material.model, MaterialModel::Phong(_))
}
