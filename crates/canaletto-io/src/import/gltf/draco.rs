//! Compressed primitives: KHR_draco_mesh_compression. A stream has a primitive's triangles and the elements of some of
//! its accessors. The others have elements of their own, in the order of the stream's points.

use super::accessor::{Accessors, Component, Elements, Unpacked, shape};
use super::fault::{Fault, named};
use super::schema::{AccessorInfo, DracoMesh, Index, PrimitiveInfo};
use crate::import::draco::{self, Attribute};

/// The triangles of a primitive with so many vertices, if it is compressed.
pub(super) fn triangles(accessors: &Accessors, vertices: usize) -> Result<Option<Vec<[u32; 3]>>, Fault> {
    match accessors.unpacked.mesh {
        Some(mesh) if mesh.points != vertices => {
            let message = format!("its stream has {} vertices, but POSITION has {vertices}", mesh.points);
            Err(Fault::new(message).at(PLACE))
        }
        mesh => Ok(mesh.map(|mesh| mesh.triangles.clone())),
    }
}

const PLACE: &str = "/extensions/KHR_draco_mesh_compression";

/// The accessors of a primitive, with what its stream has in their place.
///
/// A stream that can't be read is warned of where the accessors have all elements, too.
pub(super) fn unpacked<'a>(
    accessors: &Accessors<'a>,
    primitive: &PrimitiveInfo,
    warnings: &mut Vec<Fault>,
) -> Result<Accessors<'a>, Fault> {
    let Some(stream) = &primitive.extensions.draco else { return Ok(accessors.with(Unpacked::default())) };
    if !matches!(primitive.mode, None | Some(4 | 5)) {
        let mode = primitive.mode.unwrap_or_default();
        return Err(Fault::new(format!("is {mode}; compressed primitives are triangles: 4 or 5")).at("/mode"));
    }
    let mut said = Vec::new();
    match read(accessors, primitive, stream, &mut said) {
        Ok(unpacked) => {
            warnings.extend(said);
            Ok(accessors.with(unpacked))
        }
        Err(fault) if has_all(accessors, primitive, stream) => {
            warnings.push(fault.at_if_relative(PLACE).help("its accessors' own elements are taken"));
            Ok(accessors.with(Unpacked::default()))
        }
        Err(fault) => Err(fault.at_if_relative(PLACE)),
    }
}

/// Whether the accessors of a compressed primitive have elements of their own.
fn has_all(accessors: &Accessors, primitive: &PrimitiveInfo, stream: &DracoMesh) -> bool {
    let packed = stream.attributes.keys().filter_map(|name| primitive.attributes.get(name));
    packed.chain(&primitive.indices).all(|index| accessors.has_values(*index) == Ok(true))
}

fn read<'a>(
    accessors: &Accessors<'a>,
    primitive: &PrimitiveInfo,
    stream: &DracoMesh,
    warnings: &mut Vec<Fault>,
) -> Result<Unpacked<'a>, Fault> {
    let mesh = accessors.buffers.mesh(stream.buffer_view)?;
    let mut elements = Vec::new();
    for (name, id) in &stream.attributes {
        let place = format!("/attributes/{name}");
        let Some(&index) = primitive.attributes.get(name) else {
            return Err(Fault::new("the primitive has no such attribute").at(place));
        };
        let Some(attribute) = mesh.attributes.iter().find(|attribute| attribute.id == *id) else {
            let ids: Vec<String> = mesh.attributes.iter().map(|attribute| attribute.id.to_string()).collect();
            let message = format!("is {id}; its stream has the attributes {}", ids.join(", "));
            return Err(Fault::new(message).at(place));
        };
        let info = named(&accessors.document.accessors, index, "accessor").map_err(|fault| fault.at(&place))?;
        let own = elements_of(info, attribute).map_err(|fault| fault.at(format!("/accessors/{index}")))?;
        warn_of_difference(info, &own, index, warnings);
        elements.push((index, own));
    }
    if let Some(index) = primitive.indices.filter(|_| primitive.mode != Some(5)) {
        let own = named(&accessors.document.accessors, index, "accessor").map_err(|fault| fault.at("/indices"))?.count;
        warn_of_count(own, 3 * mesh.triangles.len(), index, warnings);
    }
    Ok(Unpacked { mesh: Some(mesh), elements })
}

/// The elements of an attribute in place of an accessor's.
fn elements_of<'a>(info: &'a AccessorInfo, attribute: &'a Attribute) -> Result<Elements<'a>, Fault> {
    let Attribute { component, is_normalized, width, .. } = *attribute;
    let Some(component) = component_of(component) else {
        let message = format!("its stream has numbers of the type {component:?}, which glTF doesn't have");
        return Err(Fault::new(message).at("/componentType"));
    };
    if shape(&info.kind).is_none_or(|[columns, rows]| columns * rows != width) {
        let message = format!("is {:?}, but the elements of its stream have {width} numbers", info.kind);
        return Err(Fault::new(message).at("/type"));
    }
    // Integers for an accessor of floats tell themselves whether they are fractions.
    let is_float = Component::of(info.component_type) == Some(Component::F32);
    let normalized = if is_float { is_normalized } else { info.normalized };
    Ok(Elements::unpacked(info, component, normalized, width, &attribute.bytes))
}

fn component_of(component: draco::Component) -> Option<Component> {
    Some(match component {
        draco::Component::I8 => Component::I8,
        draco::Component::U8 => Component::U8,
        draco::Component::I16 => Component::I16,
        draco::Component::U16 => Component::U16,
        draco::Component::U32 => Component::U32,
        draco::Component::F32 => Component::F32,
        _ => return None,
    })
}

/// Warns of an accessor that tells another count or type than its stream has.
fn warn_of_difference(info: &AccessorInfo, elements: &Elements, index: Index, warnings: &mut Vec<Fault>) {
    if Component::of(info.component_type) != Some(elements.component) {
        let message =
            format!("is {}, but its stream has numbers of the type {:?}", info.component_type, elements.component);
        warnings.push(Fault::new(message).at(format!("/accessors/{index}/componentType")));
    }
    warn_of_count(info.count, elements.count, index, warnings);
}

fn warn_of_count(own: usize, found: usize, index: Index, warnings: &mut Vec<Fault>) {
    if own != found {
        let message = format!("is {own}, but its stream has {found} elements, which are taken");
        warnings.push(Fault::new(message).at(format!("/accessors/{index}/count")));
    }
}
