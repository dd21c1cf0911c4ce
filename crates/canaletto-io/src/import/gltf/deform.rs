//! Morph targets and skins: the vertices of a primitive in a pose (glTF 2.0, 3.7.2.2 and 3.7.3).

use super::accessor::Accessors;
use super::fault::Fault;
use super::schema::{Index, PrimitiveInfo};
use glam::{DAffine3, DMat3, DVec3, Vec2, Vec3, Vec4};
use std::collections::BTreeMap;

/// The attributes of vertices: each list has an element for each vertex, or none.
#[derive(Debug, Default)]
pub(super) struct Vertices {
    pub(super) positions: Vec<Vec3>,
    pub(super) normals: Vec<Vec3>,
    pub(super) tangents: Vec<Vec4>,
    /// The sets of texture coordinates. A missing one before others is empty until [`Vertices::repair`].
    pub(super) uvs: Vec<Vec<Vec2>>,
    pub(super) colors: Vec<[f32; 4]>,
    pub(super) joints: Vec<Vec<[u32; 4]>>,
    pub(super) weights: Vec<Vec<[f32; 4]>>,
}

/// The pose of a mesh.
#[derive(Debug, Default)]
pub(super) struct Deformation<'a> {
    /// The weights of the morph targets.
    pub(super) weights: &'a [f32],
    /// The matrices of the skin's joints, from the mesh's space in the bind pose to the scene's.
    pub(super) joints: Option<&'a [DAffine3]>,
}

impl Vertices {
    /// Fills missing sets of texture coordinates, and replaces numbers that aren't finite by 0. Returns their count.
    /// Positions are left to the caller, and joints' weights to the skin.
    pub(super) fn repair(&mut self) -> usize {
        let count = self.positions.len();
        for uvs in self.uvs.iter_mut().filter(|uvs| uvs.is_empty()) {
            *uvs = vec![Vec2::ZERO; count];
        }
        let uvs = self.uvs.iter_mut().flatten().flat_map(|uv| uv.as_mut());
        let normals = self.normals.iter_mut().flat_map(|n| n.as_mut());
        let tangents = self.tangents.iter_mut().flat_map(|t| t.as_mut());
        let strange = uvs.chain(normals).chain(tangents).chain(self.colors.iter_mut().flatten());
        strange.filter(|v| !v.is_finite()).map(|v| *v = 0.0).count()
    }

    /// The vertices that `corners` use, in their order. The corners are renumbered.
    pub(super) fn used_by(self, corners: &mut [u32]) -> Vertices {
        let mut is_used = vec![false; self.positions.len()];
        corners.iter().for_each(|corner| is_used[*corner as usize] = true);
        let order: Vec<usize> = (0..is_used.len()).filter(|i| is_used[*i]).collect();
        if order.len() == is_used.len() {
            return self;
        }
        let mut places = vec![0; is_used.len()];
        order.iter().enumerate().for_each(|(place, i)| places[*i] = place as u32);
        corners.iter_mut().for_each(|corner| *corner = places[*corner as usize]);
        fn pick<T: Copy>(list: &[T], order: &[usize]) -> Vec<T> {
            if list.is_empty() { Vec::new() } else { order.iter().map(|i| list[*i]).collect() }
        }
        Vertices {
            positions: pick(&self.positions, &order),
            normals: pick(&self.normals, &order),
            tangents: pick(&self.tangents, &order),
            uvs: self.uvs.iter().map(|uvs| pick(uvs, &order)).collect(),
            colors: pick(&self.colors, &order),
            joints: Vec::new(),
            weights: Vec::new(),
        }
    }
}

impl Deformation<'_> {
    /// The vertices in the pose: morph targets first, then the skin.
    pub(super) fn apply(
        &self,
        accessors: &Accessors,
        primitive: &PrimitiveInfo,
        mut vertices: Vertices,
    ) -> Result<Vertices, Fault> {
        for (i, (target, &weight)) in primitive.targets.iter().zip(self.weights).enumerate() {
            if weight != 0.0 {
                morph(accessors, target, weight, &mut vertices)
                    .map_err(|fault| fault.at_if_relative(&format!("/targets/{i}")))?;
            }
        }
        if let Some(joints) = self.joints {
            skin(joints, &mut vertices)?;
        }
        Ok(vertices)
    }
}

/// Adds a morph target's differences, times its weight.
fn morph(
    accessors: &Accessors,
    target: &BTreeMap<String, Index>,
    weight: f32,
    vertices: &mut Vertices,
) -> Result<(), Fault> {
    fn add<const N: usize>(
        accessors: &Accessors,
        index: Index,
        weight: f32,
        list: &mut [impl AsMut<[f32; N]>],
    ) -> Result<(), Fault> {
        let own = accessors.count(index)?;
        if !list.is_empty() && own != list.len() {
            return Err(Fault::new(format!("it has {own} elements, but POSITION has {}", list.len())));
        }
        for (value, difference) in list.iter_mut().zip(accessors.numbers::<N>(index)?) {
            value.as_mut().iter_mut().zip(difference).for_each(|(v, d)| *v += weight * d);
        }
        Ok(())
    }
    for (name, &index) in target {
        let result = match name.as_str() {
            "POSITION" => add::<3>(accessors, index, weight, &mut vertices.positions),
            "NORMAL" => add::<3>(accessors, index, weight, &mut vertices.normals),
            "TANGENT" => {
                let mut along: Vec<Vec3> = vertices.tangents.iter().map(|t| t.truncate()).collect();
                let added = add::<3>(accessors, index, weight, &mut along);
                vertices.tangents.iter_mut().zip(along).for_each(|(t, along)| *t = along.extend(t.w));
                added
            }
            "COLOR_0" if accessors.width(index) == Ok(3) => {
                let mut colors: Vec<Vec3> = vertices.colors.iter().map(|c| Vec4::from(*c).truncate()).collect();
                let added = add::<3>(accessors, index, weight, &mut colors);
                vertices.colors.iter_mut().zip(colors).for_each(|(c, own)| *c = own.extend(c[3]).to_array());
                added
            }
            "COLOR_0" => {
                let mut colors: Vec<Vec4> = vertices.colors.iter().map(|c| Vec4::from(*c)).collect();
                let added = add::<4>(accessors, index, weight, &mut colors);
                vertices.colors = colors.into_iter().map(|c| c.to_array()).collect();
                added
            }
            _ => match name.strip_prefix("TEXCOORD_").and_then(|set| set.parse::<usize>().ok()) {
                Some(set) if set < vertices.uvs.len() => add::<2>(accessors, index, weight, &mut vertices.uvs[set]),
                _ => Ok(()),
            },
        };
        result.map_err(|fault| fault.at_if_relative(&format!("/{name}")))?;
    }
    Ok(())
}

/// Moves vertices with their joints: the sum of the joints' matrices, weighted.
fn skin(joints: &[DAffine3], vertices: &mut Vertices) -> Result<(), Fault> {
    if vertices.joints.is_empty() || vertices.weights.is_empty() {
        return Ok(());
    }
    for i in 0..vertices.positions.len() {
        let mut sum = DAffine3 { matrix3: DMat3::ZERO, translation: DVec3::ZERO };
        let mut total = 0.0;
        for (set, (own, weights)) in vertices.joints.iter().zip(&vertices.weights).enumerate() {
            let Some((own, weights)) = own.get(i).zip(weights.get(i)) else { continue };
            for (joint, weight) in own.iter().zip(weights) {
                let weight = f64::from(*weight);
                if weight == 0.0 || !weight.is_finite() {
                    continue;
                }
                let matrix = joints.get(*joint as usize).ok_or_else(|| {
                    let message = format!("vertex {i} names joint {joint}, but the skin has {}", joints.len());
                    Fault::new(message).at(format!("/attributes/JOINTS_{set}"))
                })?;
                sum.matrix3 += matrix.matrix3 * weight;
                sum.translation += matrix.translation * weight;
                total += weight;
            }
        }
        // Weights are rounded, so that their sum isn't always 1. A vertex without weights follows the first joint.
        let matrix = match total > 0.0 {
            true => DAffine3 { matrix3: sum.matrix3 * (1.0 / total), translation: sum.translation / total },
            false => joints.first().copied().unwrap_or(DAffine3::IDENTITY),
        };
        vertices.positions[i] = matrix.transform_point3(vertices.positions[i].as_dvec3()).as_vec3();
        if let Some(normal) = vertices.normals.get_mut(i) {
            // The matrix of cofactors turns normals, also where the matrix has no inverse.
            let DMat3 { x_axis: x, y_axis: y, z_axis: z } = matrix.matrix3;
            let cofactors = DMat3::from_cols(y.cross(z), z.cross(x), x.cross(y));
            *normal = (cofactors * normal.as_dvec3()).normalize_or_zero().as_vec3();
        }
        if let Some(tangent) = vertices.tangents.get_mut(i) {
            let along = matrix.matrix3 * tangent.truncate().as_dvec3();
            *tangent = along.normalize_or_zero().as_vec3().extend(tangent.w);
        }
    }
    Ok(())
}
