//! The tree of nodes: places, meshes, cameras and lights in the scene's space.

use super::accessor::Accessors;
use super::deform::Deformation;
use super::fault::{Fault, named};
use super::material::Materials;
use super::primitive::{self, Body, Wanted};
use super::schema::{Document, Index, Instancing, MeshInfo, NodeInfo, PunctualLight};
use crate::import::staging::FRAMING;
use canaletto::light::{Directional, Falloff, Light, LightKind, Omni, Spot};
use canaletto::math::{Rgb, Transform};
use canaletto::scene::{CameraProjection, Content, Extrinsics, Fragment, Intrinsics, Node, View};
use glam::{DAffine3, DMat3, DMat4, DQuat, DVec3, Vec3};
use std::collections::HashMap;
use std::f32::consts::FRAC_1_PI;

/// The content of a document's scene so far.
pub(super) struct SceneReader<'a> {
    pub(super) document: &'a Document,
    pub(super) accessors: &'a Accessors<'a>,
    pub(super) materials: Materials<'a>,
    pub(super) fragment: Fragment,
    pub(super) warnings: Vec<Fault>,
    /// The place of each node in the scene, and whether it is shown; none for nodes outside of the scene.
    places: Vec<Option<(DAffine3, bool)>>,
    /// The variant of materials, by its number.
    variant: Option<Index>,
    /// The vertices and corners of the bodies so far.
    elements: usize,
    /// The bodies of primitives that were built: those of equal keys are one.
    bodies: HashMap<String, Option<Content>>,
}

impl<'a> SceneReader<'a> {
    pub(super) fn new(
        document: &'a Document,
        accessors: &'a Accessors<'a>,
        materials: Materials<'a>,
        variant: Option<Index>,
        warnings: Vec<Fault>,
    ) -> SceneReader<'a> {
        let (fragment, bodies) = (Fragment::default(), HashMap::new());
        SceneReader {
            document,
            accessors,
            materials,
            fragment,
            warnings,
            places: Vec::new(),
            variant,
            elements: 0,
            bodies,
        }
    }

    /// Reads the scene.
    pub(super) fn read(&mut self) -> Result<(), Fault> {
        let document = self.document;
        let roots = self.roots()?;
        self.places = self.placed(roots)?;
        for (i, node) in document.nodes.iter().enumerate() {
            let Some((place, is_shown)) = self.places[i] else { continue };
            let pointer = format!("/nodes/{i}");
            if let Some(camera) = node.camera {
                self.camera(node, camera, &place).map_err(|fault| fault.at_if_relative(&pointer))?;
            }
            if !is_shown {
                continue;
            }
            if let Some(light) = &node.extensions.light {
                self.light(node, light.light, &place).map_err(|fault| fault.at_if_relative(&pointer))?;
            }
            if let Some(mesh) = node.mesh {
                self.mesh_node(node, mesh, &place).map_err(|fault| fault.at_if_relative(&pointer))?;
            }
        }
        Ok(())
    }

    /// The nodes that the scene starts from. Without scenes these are all nodes that have no parent.
    fn roots(&mut self) -> Result<Vec<Index>, Fault> {
        let (document, count) = (self.document, self.document.nodes.len());
        let mut parents: Vec<Option<Index>> = vec![None; count];
        for (i, node) in document.nodes.iter().enumerate() {
            for (k, &child) in node.children.iter().enumerate() {
                let slot = parents
                    .get_mut(child as usize)
                    .ok_or_else(|| Fault::missing("node", child, count).at(format!("/nodes/{i}/children/{k}")))?;
                slot.get_or_insert(i as Index);
            }
        }
        let index = document.scene.unwrap_or(0);
        if document.scenes.is_empty() && document.scene.is_none() {
            return Ok((0..count as u32).filter(|i| parents[*i as usize].is_none()).collect());
        }
        let scene = named(&document.scenes, index, "scene").map_err(|fault| fault.at("/scene"))?;
        let mut is_listed = vec![false; count];
        for (k, &root) in scene.nodes.iter().enumerate() {
            let pointer = || format!("/scenes/{index}/nodes/{k}");
            let slot = is_listed.get_mut(root as usize);
            *slot.ok_or_else(|| Fault::missing("node", root, count).at(pointer()))? = true;
        }
        let mut roots = Vec::new();
        for (k, &root) in scene.nodes.iter().enumerate() {
            let pointer = format!("/scenes/{index}/nodes/{k}");
            // Some programs list all nodes, or children without their parents.
            let ancestors = std::iter::successors(parents[root as usize], |node| parents[*node as usize]);
            match ancestors.take(count).find(|node| is_listed[*node as usize]) {
                Some(own) if own == root => {
                    let message = format!("node {root} is below itself: its parents form a circle");
                    return Err(Fault::new(message).at(pointer));
                }
                Some(listed) => {
                    let message = format!("node {root} is below node {listed}, which is listed, too; it is drawn once");
                    self.warnings.push(Fault::new(message).at(pointer));
                }
                None => {
                    if let Some(parent) = parents[root as usize] {
                        let message = format!("node {root} is a child of node {parent}, which isn't listed");
                        self.warnings.push(Fault::new(message).at(pointer));
                    }
                    roots.push(root);
                }
            }
        }
        Ok(roots)
    }

    /// The place of each node below these roots.
    fn placed(&mut self, roots: Vec<Index>) -> Result<Vec<Option<(DAffine3, bool)>>, Fault> {
        let document = self.document;
        let mut places: Vec<Option<(DAffine3, bool)>> = vec![None; document.nodes.len()];
        let mut left: Vec<(Index, DAffine3, bool)> =
            roots.into_iter().rev().map(|root| (root, DAffine3::IDENTITY, true)).collect();
        while let Some((index, parent, is_shown)) = left.pop() {
            let node = &document.nodes[index as usize];
            let slot = &mut places[index as usize];
            if slot.is_some() {
                let message = "it is met twice, below two nodes or in a circle; it is drawn at the first place";
                self.warnings.push(Fault::new(message).at(format!("/nodes/{index}")));
                continue;
            }
            let own = local(node).map_err(|fault| fault.at(format!("/nodes/{index}")))?;
            let place = parent * own;
            let is_shown = is_shown && node.extensions.visibility.visible;
            *slot = Some((place, is_shown));
            left.extend(node.children.iter().rev().map(|child| (*child, place, is_shown)));
        }
        Ok(places)
    }

    /// Adds the objects of a node's mesh.
    fn mesh_node(&mut self, node: &NodeInfo, index: Index, place: &DAffine3) -> Result<(), Fault> {
        let document = self.document;
        let mesh = named(&document.meshes, index, "mesh").map_err(|fault| fault.at("/mesh"))?;
        let joints = match node.skin {
            Some(skin) => Some(self.joints(skin)?),
            None => None,
        };
        let weights = node.weights.as_deref().unwrap_or(&mesh.weights);
        let deformation = Deformation { weights, joints: joints.as_deref() };
        let pose = format!("{:?} {:?}", node.skin, weights);
        let mut parts = self.primitives(mesh, index, &deformation, &pose)?;
        if parts.is_empty() {
            return Ok(());
        }
        let name = first_name(&node.name, &mesh.name).map(Box::from);
        if let Some(instancing) = &node.extensions.instancing {
            return self.instances(instancing, name, parts, place);
        }
        // The joints place a skinned mesh, whatever its node's place.
        let place = if joints.is_some() { &DAffine3::IDENTITY } else { place };
        let Ok(transform) = Transform::new(*place) else {
            let message = "its scale is 0, or its numbers are too large: nothing of it is seen";
            self.warnings.push(Fault::new(message).at(format!("/meshes/{index}")));
            return Ok(());
        };
        let node = match parts.len() {
            1 => parts.remove(0),
            _ => Node::new(Content::Group(parts)),
        };
        self.fragment.nodes.push(Node { name, ..node }.with_transform(&transform));
        Ok(())
    }

    /// The primitives of a mesh in a pose as nodes.
    fn primitives(
        &mut self,
        mesh: &MeshInfo,
        index: Index,
        deformation: &Deformation,
        pose: &str,
    ) -> Result<Vec<Node>, Fault> {
        let mut parts = Vec::new();
        for (k, primitive) in mesh.primitives.iter().enumerate() {
            let pointer = format!("/meshes/{index}/primitives/{k}");
            let mut build = || -> Result<Option<Node>, Fault> {
                let variants = primitive.extensions.variants.mappings.iter();
                let own =
                    variants.clone().find(|mapping| self.variant.is_some_and(|own| mapping.variants.contains(&own)));
                let material = own.map(|mapping| mapping.material).or(primitive.material);
                let traits = self.materials.of_primitive(material).map_err(|fault| fault.at("/material"))?;
                let key = format!(
                    "{:?} {:?} {:?} {:?} {:?} {pose} {traits:?}",
                    primitive.attributes,
                    primitive.indices,
                    primitive.mode,
                    primitive.targets,
                    primitive.extensions.draco
                );
                let content = match self.bodies.get(&key) {
                    Some(known) => known.clone(),
                    None => {
                        let name = mesh.name.clone().unwrap_or_else(|| format!("mesh {index}"));
                        let wanted = Wanted {
                            name: &name,
                            deformation,
                            tangent_set: traits.tangent_set,
                            one_sided: traits.one_sided,
                            color: traits.color,
                        };
                        let mut said = Vec::new();
                        let body = primitive::build(self.accessors, primitive, &wanted, &mut said)?;
                        self.warnings.extend(said.into_iter().map(|fault| fault.at_if_relative(&pointer)));
                        self.count(body.as_ref())?;
                        let content = body.map(|body| self.add(body));
                        self.bodies.insert(key, content.clone());
                        content
                    }
                };
                let Some(content) = content else { return Ok(None) };
                let has_colors = matches!(content, Content::Mesh(_)) && primitive.attributes.contains_key("COLOR_0");
                let material = self.materials.material(material, has_colors, &mut self.warnings)?;
                Ok(Some(Node { material, ..Node::new(content) }))
            };
            parts.extend(build().map_err(|fault| fault.at_if_relative(&pointer))?);
        }
        Ok(parts)
    }

    /// Counts a body.
    ///
    /// # Errors
    /// Primitives use the same bytes so often that they would fill the memory.
    fn count(&mut self, body: Option<&Body>) -> Result<(), Fault> {
        const FREE: usize = 1 << 22;
        const PER_BYTE: usize = 16;
        self.elements += match body {
            Some(Body::Mesh(mesh)) => mesh.positions.len() + 3 * mesh.len(),
            Some(Body::Spheres(cloud)) => cloud.centers.len(),
            Some(Body::Cylinders(cloud)) => 2 * cloud.axes.len(),
            None => 0,
        };
        let most = FREE.saturating_add(self.accessors.buffers.size().saturating_mul(PER_BYTE));
        if self.elements > most {
            let message = format!(
                "the primitives up to here have {} vertices and corners, more than {most}: they use the same bytes too \
                 often",
                self.elements
            );
            return Err(Fault::new(message));
        }
        Ok(())
    }

    fn add(&mut self, body: Body) -> Content {
        fn push<T>(list: &mut Vec<T>, item: T) -> u32 {
            list.push(item);
            list.len() as u32 - 1
        }
        match body {
            Body::Mesh(mesh) => Content::Mesh(push(&mut self.fragment.meshes, mesh)),
            Body::Spheres(cloud) => Content::Spheres(push(&mut self.fragment.spheres, cloud)),
            Body::Cylinders(cloud) => Content::Cylinders(push(&mut self.fragment.cylinders, cloud)),
        }
    }

    /// Adds the instances of EXT_mesh_gpu_instancing.
    fn instances(
        &mut self,
        instancing: &Instancing,
        name: Option<Box<str>>,
        parts: Vec<Node>,
        place: &DAffine3,
    ) -> Result<(), Fault> {
        const PLACE: &str = "/extensions/EXT_mesh_gpu_instancing/attributes";
        fn attribute<const N: usize>(
            accessors: &Accessors,
            instancing: &Instancing,
            word: &str,
        ) -> Result<Option<Vec<[f32; N]>>, Fault> {
            let numbers = instancing.attributes.get(word).map(|index| accessors.numbers::<N>(*index)).transpose();
            numbers.map_err(|fault| fault.at_if_relative(&format!("{PLACE}/{word}")))
        }
        let translations = attribute::<3>(self.accessors, instancing, "TRANSLATION")?;
        let rotations = attribute::<4>(self.accessors, instancing, "ROTATION")?;
        let scales = attribute::<3>(self.accessors, instancing, "SCALE")?;
        let counts =
            [translations.as_ref().map(Vec::len), rotations.as_ref().map(Vec::len), scales.as_ref().map(Vec::len)];
        let Some(count) = counts.into_iter().flatten().max() else {
            return Err(Fault::new("it has none of TRANSLATION, ROTATION and SCALE").at(PLACE));
        };
        if let Some(other) = counts.into_iter().flatten().find(|other| *other != count) {
            return Err(
                Fault::new(format!("its attributes have {count} and {other} elements; they must be as many")).at(PLACE)
            );
        }
        let prototype = self.fragment.prototypes.len() as u32;
        self.fragment.prototypes.push(Node::new(Content::Group(parts)));
        let vector = |list: &Option<Vec<[f32; 3]>>, i: usize, or: Vec3| {
            list.as_ref().map_or(or, |list| Vec3::from(list[i])).as_dvec3()
        };
        let mut lost = 0;
        for i in 0..count {
            let rotation = rotations.as_ref().map_or(DQuat::IDENTITY, |list| quaternion(list[i].map(f64::from)));
            let own = DAffine3::from_scale_rotation_translation(
                vector(&scales, i, Vec3::ONE),
                rotation,
                vector(&translations, i, Vec3::ZERO),
            );
            let Ok(transform) = Transform::new(*place * own) else {
                lost += 1;
                continue;
            };
            let node = Node { name: name.clone(), ..Node::new(Content::Instance(prototype)) };
            self.fragment.nodes.push(node.with_transform(&transform));
        }
        if lost > 0 {
            let message = format!("{lost} instances have a scale of 0 or numbers that aren't finite, and are left out");
            self.warnings.push(Fault::new(message).at(PLACE));
        }
        Ok(())
    }

    /// The matrices of a skin's joints: from the bind pose to the scene.
    fn joints(&mut self, index: Index) -> Result<Vec<DAffine3>, Fault> {
        let skin = named(&self.document.skins, index, "skin").map_err(|fault| fault.at("/skin"))?;
        let pointer = format!("/skins/{index}");
        let inverse = match skin.inverse_bind_matrices {
            Some(accessor) => {
                let place = format!("{pointer}/inverseBindMatrices");
                let matrices = self.accessors.numbers::<16>(accessor).map_err(|fault| fault.at_if_relative(&place))?;
                if matrices.len() < skin.joints.len() {
                    let message = format!("it has {} matrices for {} joints", matrices.len(), skin.joints.len());
                    return Err(Fault::new(message).at(place));
                }
                matrices
            }
            None => Vec::new(),
        };
        let mut joints = Vec::with_capacity(skin.joints.len());
        for (k, &joint) in skin.joints.iter().enumerate() {
            let place = self
                .places
                .get(joint as usize)
                .ok_or_else(|| Fault::missing("node", joint, self.places.len()).at(format!("{pointer}/joints/{k}")))?;
            let Some((place, _)) = place else {
                let message = format!("node {joint} isn't in the scene, so that its place is unknown");
                return Err(Fault::new(message).at(format!("{pointer}/joints/{k}")));
            };
            let bind = inverse.get(k).map_or(DAffine3::IDENTITY, |matrix| affine(&matrix.map(f64::from)));
            joints.push(*place * bind);
        }
        Ok(joints)
    }

    fn camera(&mut self, node: &NodeInfo, index: Index, place: &DAffine3) -> Result<(), Fault> {
        let camera = named(&self.document.cameras, index, "camera").map_err(|fault| fault.at("/camera"))?;
        let pointer = format!("/cameras/{index}");
        let name = first_name(&node.name, &camera.name).map_or_else(|| format!("camera {index}"), str::to_owned);
        let is_taken = self.fragment.views.iter().any(|view| view.name == name);
        let name = if is_taken { format!("{name} ({})", self.fragment.views.len()) } else { name };
        let height = |aspect: f64| (f64::from(FRAMING.width) / aspect).round().clamp(1.0, MOST_PIXELS) as u32;
        let clipped = |near: Option<f64>, far: Option<f64>| Intrinsics {
            near: near.filter(|near| *near > 0.0),
            far: far.filter(|far| near.is_none_or(|near| *far > near)),
            ..FRAMING
        };
        let intrinsics = match (camera.kind.as_str(), &camera.perspective, &camera.orthographic) {
            ("perspective", Some(lens), _) => {
                if !(lens.yfov > 0.0 && lens.yfov < std::f64::consts::PI) {
                    let message = format!("is {} radians; it must be more than 0 and less than π", lens.yfov);
                    return Err(Fault::new(message).at(format!("{pointer}/perspective/yfov")));
                }
                let aspect = lens.aspect_ratio.filter(|aspect| *aspect > 0.0 && aspect.is_finite());
                Intrinsics {
                    fovy: lens.yfov.to_degrees(),
                    height: aspect.map_or(FRAMING.height, height),
                    ..clipped(lens.znear, lens.zfar)
                }
            }
            ("orthographic", _, Some(lens)) => {
                let [xmag, ymag] = [lens.xmag, lens.ymag].map(f64::abs);
                if !(xmag > 0.0 && ymag > 0.0 && xmag.is_finite() && ymag.is_finite()) {
                    let message = format!("xmag is {} and ymag {}; both must be more than 0", lens.xmag, lens.ymag);
                    return Err(Fault::new(message).at(format!("{pointer}/orthographic")));
                }
                Intrinsics {
                    projection: CameraProjection::Orthographic { height: 2.0 * ymag },
                    height: height(xmag / ymag),
                    ..clipped(lens.znear, lens.zfar)
                }
            }
            (kind, ..) => {
                let message = format!("its type is {kind:?} without the numbers of that type");
                return Err(Fault::new(message).at(pointer));
            }
        };
        let [eye, ahead, up] = [place.translation, place.matrix3 * DVec3::NEG_Z, place.matrix3 * DVec3::Y];
        let Some(ahead) = ahead.try_normalize() else {
            self.warnings.push(Fault::new("the scale of its node is 0; it is left out").at(pointer));
            return Ok(());
        };
        let extrinsics = Extrinsics { eye, center: eye + ahead, up };
        self.fragment.views.push(View { name, intrinsics, extrinsics, motion: Vec::new() });
        Ok(())
    }

    /// Adds a light of KHR_lights_punctual.
    fn light(&mut self, node: &NodeInfo, index: Index, place: &DAffine3) -> Result<(), Fault> {
        let lights = &self.document.extensions.lights.lights;
        let light: &PunctualLight =
            named(lights, index, "light").map_err(|fault| fault.at("/extensions/KHR_lights_punctual/light"))?;
        let pointer = format!("/extensions/KHR_lights_punctual/lights/{index}");
        let name: Option<Box<str>> = first_name(&node.name, &light.name).map(Box::from);
        let color = light.color.map(|c| if c.is_finite() { c.max(0.0) } else { 0.0 });
        if !(light.intensity.is_finite() && light.intensity >= 0.0) {
            let message = format!("is {}; it must be 0 or more", light.intensity);
            return Err(Fault::new(message).at(format!("{pointer}/intensity")));
        }
        let (position, ahead) = (place.translation.as_vec3(), place.matrix3 * DVec3::NEG_Z);
        let ahead = ahead.normalize_or(DVec3::NEG_Z);
        let range = light.range.unwrap_or(0.0);
        if light.range.is_some() && !(range > 0.0 && range.is_finite()) {
            return Err(Fault::new(format!("is {range}; it must be more than 0")).at(format!("{pointer}/range")));
        }
        let kind = match light.kind.as_str() {
            "point" => LightKind::Omni(Omni { range, ..Omni::at(position) }),
            "directional" => LightKind::Directional(Directional { towards: ahead.as_vec3(), beam: None }),
            "spot" => {
                let [inner, outer] = [light.spot.inner_cone_angle, light.spot.outer_cone_angle];
                if !(0.0 <= inner && inner < outer && outer <= std::f64::consts::FRAC_PI_2) {
                    let message = format!(
                        "innerConeAngle is {inner} and outerConeAngle {outer}; the former must be 0 or more, and less \
                         than the latter, which is at most π/2"
                    );
                    return Err(Fault::new(message).at(format!("{pointer}/spot")));
                }
                let [inner, outer] = [inner, outer].map(|angle| (angle.to_degrees() as f32).min(90.0));
                let target = (place.translation + ahead * aim(place.translation)).as_vec3();
                Spot { position, target, falloff: Falloff::Squared { inner, outer }, range }.into()
            }
            other => {
                let message = format!("is {other:?}; it must be \"point\", \"spot\" or \"directional\"");
                return Err(Fault::new(message).at(format!("{pointer}/type")));
            }
        };
        // A light of intensity l gives l kd cos θ; glTF's gives I (ρ / π) cos θ / d².
        let mut made = Light::new(kind, Rgb::from(color) * (light.intensity * FRAC_1_PI));
        if light.kind != "directional" {
            made.attenuation = [0.0, 0.0, 1.0];
        }
        made.name = name.clone();
        let points = [place.translation, place.translation + ahead * aim(place.translation)];
        let node = Node { name, ..Node::from(made) };
        self.fragment.nodes.push(node.with_points(&points));
        Ok(())
    }
}

/// The most pixels along a side of a picture that a camera asks for.
const MOST_PIXELS: f64 = 16384.0;

/// The first of two names that isn't missing or empty.
fn first_name<'n>(own: &'n Option<String>, other: &'n Option<String>) -> Option<&'n str> {
    [own, other].into_iter().flatten().map(String::as_str).find(|name| !name.is_empty())
}

/// The distance of a point on a spotlight's axis, far enough that `f32` tells it from the light.
fn aim(position: DVec3) -> f64 {
    position.abs().max_element().max(1.0)
}

/// The transform of a node from its space to its parent's.
fn local(node: &NodeInfo) -> Result<DAffine3, Fault> {
    let finite = |numbers: &[f64], place: &str| match numbers.iter().find(|v| !v.is_finite()) {
        Some(bad) => Err(Fault::new(format!("holds {bad}; all numbers must be finite")).at(place)),
        None => Ok(()),
    };
    if let Some(matrix) = &node.matrix {
        finite(matrix, "/matrix")?;
        if [matrix[3], matrix[7], matrix[11], matrix[15]] != [0.0, 0.0, 0.0, 1.0] {
            return Err(Fault::new("its last row isn't 0 0 0 1: the transform isn't affine").at("/matrix"));
        }
        return Ok(affine(matrix));
    }
    let translation = node.translation.unwrap_or_default();
    let scale = node.scale.unwrap_or([1.0; 3]);
    let rotation = node.rotation.unwrap_or([0.0, 0.0, 0.0, 1.0]);
    finite(&translation, "/translation")?;
    finite(&scale, "/scale")?;
    finite(&rotation, "/rotation")?;
    Ok(DAffine3::from_scale_rotation_translation(scale.into(), quaternion(rotation), translation.into()))
}

/// The unit quaternion of x, y, z and w; no rotation if they have no direction.
fn quaternion(xyzw: [f64; 4]) -> DQuat {
    let q = DQuat::from_array(xyzw);
    let length = q.length();
    if length > 0.0 && length.is_finite() { q * (1.0 / length) } else { DQuat::IDENTITY }
}

/// The affine part of a matrix in columns.
fn affine(columns: &[f64; 16]) -> DAffine3 {
    let matrix = DMat4::from_cols_array(columns);
    DAffine3 { matrix3: DMat3::from_mat4(matrix), translation: matrix.w_axis.truncate() }
}
