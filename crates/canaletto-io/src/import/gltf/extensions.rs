//! The extensions that are read, and what the others would change.

use super::fault::Fault;
use super::schema::Document;

/// The extensions that are read.
const READ: &[&str] = &[
    "EXT_mesh_gpu_instancing",
    "EXT_meshopt_compression",
    "EXT_texture_webp",
    "KHR_animation_pointer",
    "KHR_draco_mesh_compression",
    "KHR_lights_punctual",
    "KHR_materials_anisotropy",
    "KHR_materials_clearcoat",
    "KHR_materials_diffuse_transmission",
    "KHR_materials_dispersion",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_iridescence",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_sheen",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_materials_variants",
    "KHR_materials_volume",
    "KHR_mesh_quantization",
    "KHR_meshopt_compression",
    "KHR_node_visibility",
    "KHR_texture_basisu",
    "KHR_texture_transform",
    "KHR_xmp_json_ld",
];

/// Extensions that aren't read, and what a picture lacks without them.
const LACKS: &[(&str, &str)] = &[
    ("EXT_lights_ies", "lights have no profiles"),
    ("EXT_lights_image_based", "the light around the model isn't the file's"),
    ("KHR_materials_volume_scatter", "bodies scatter no light inside"),
    ("MSFT_lod", "its finest level of detail is shown"),
    ("MSFT_texture_dds", "textures in DDS are missing"),
];

/// Checks the extensions of a document. Those that are used and not read are warned of.
///
/// # Errors
/// An extension that the document requires isn't read.
pub(super) fn check(document: &Document, warnings: &mut Vec<Fault>) -> Result<(), Fault> {
    let is_read = |name: &str| READ.contains(&name);
    for (i, name) in document.extensions_required.iter().enumerate() {
        if !is_read(name) {
            let fault = Fault::new(format!("it requires {name}, which isn't read"));
            let help = "export the model without it, or open and save it with Blender or glTF Transform";
            return Err(fault.help(help).at(format!("/extensionsRequired/{i}")));
        }
    }
    for (i, name) in document.extensions_used.iter().enumerate().filter(|(_, name)| !is_read(name)) {
        let lacks = LACKS.iter().find(|(known, _)| known == name).map_or("what it adds is left out", |(_, lack)| lack);
        warnings.push(Fault::new(format!("{name} isn't read: {lacks}")).at(format!("/extensionsUsed/{i}")));
    }
    Ok(())
}
