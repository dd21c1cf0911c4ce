//! The JSON of glTF 2.0 and of the extensions that are read, with the specification's names and defaults.

use serde::Deserialize;
use std::collections::BTreeMap;

/// An index into one of the document's lists.
pub(super) type Index = u32;

/// The whole document.
#[derive(Debug, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct Document {
    pub(super) asset: AssetInfo,
    pub(super) extensions_used: Vec<String>,
    pub(super) extensions_required: Vec<String>,
    pub(super) extensions: DocumentExtensions,
    pub(super) scene: Option<Index>,
    pub(super) scenes: Vec<SceneInfo>,
    pub(super) nodes: Vec<NodeInfo>,
    pub(super) meshes: Vec<MeshInfo>,
    pub(super) skins: Vec<Skin>,
    pub(super) animations: Vec<Animation>,
    pub(super) cameras: Vec<Camera>,
    pub(super) materials: Vec<MaterialInfo>,
    pub(super) textures: Vec<TextureInfo>,
    pub(super) images: Vec<ImageInfo>,
    pub(super) samplers: Vec<Sampler>,
    pub(super) accessors: Vec<AccessorInfo>,
    pub(super) buffer_views: Vec<BufferView>,
    pub(super) buffers: Vec<Buffer>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct AssetInfo {
    pub(super) version: String,
    pub(super) min_version: Option<String>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct DocumentExtensions {
    #[serde(rename = "KHR_lights_punctual")]
    pub(super) lights: Lights,
    #[serde(rename = "KHR_materials_variants")]
    pub(super) variants: Variants,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Variants {
    pub(super) variants: Vec<Variant>,
}

#[derive(Debug, Deserialize)]
pub(super) struct Variant {
    pub(super) name: String,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Lights {
    pub(super) lights: Vec<PunctualLight>,
}

/// A light of KHR_lights_punctual.
#[derive(Debug, Deserialize)]
pub(super) struct PunctualLight {
    #[serde(default)]
    pub(super) name: Option<String>,
    #[serde(default = "white")]
    pub(super) color: [f32; 3],
    #[serde(default = "one")]
    pub(super) intensity: f32,
    #[serde(rename = "type")]
    pub(super) kind: String,
    #[serde(default)]
    pub(super) range: Option<f32>,
    #[serde(default)]
    pub(super) spot: SpotCone,
}

#[derive(Debug, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct SpotCone {
    pub(super) inner_cone_angle: f64,
    pub(super) outer_cone_angle: f64,
}

impl Default for SpotCone {
    fn default() -> SpotCone {
        SpotCone { inner_cone_angle: 0.0, outer_cone_angle: std::f64::consts::FRAC_PI_4 }
    }
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct SceneInfo {
    pub(super) nodes: Vec<Index>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct NodeInfo {
    pub(super) name: Option<String>,
    pub(super) children: Vec<Index>,
    pub(super) matrix: Option<[f64; 16]>,
    pub(super) translation: Option<[f64; 3]>,
    pub(super) rotation: Option<[f64; 4]>,
    pub(super) scale: Option<[f64; 3]>,
    pub(super) mesh: Option<Index>,
    pub(super) skin: Option<Index>,
    pub(super) camera: Option<Index>,
    pub(super) weights: Option<Vec<f32>>,
    pub(super) extensions: NodeExtensions,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct NodeExtensions {
    #[serde(rename = "KHR_lights_punctual")]
    pub(super) light: Option<LightOfNode>,
    #[serde(rename = "EXT_mesh_gpu_instancing")]
    pub(super) instancing: Option<Instancing>,
    #[serde(rename = "KHR_node_visibility")]
    pub(super) visibility: Visibility,
}

#[derive(Debug, Deserialize)]
pub(super) struct LightOfNode {
    pub(super) light: Index,
}

#[derive(Debug, Deserialize)]
pub(super) struct Instancing {
    pub(super) attributes: BTreeMap<String, Index>,
}

#[derive(Debug, Deserialize)]
#[serde(default)]
pub(super) struct Visibility {
    pub(super) visible: bool,
}

impl Default for Visibility {
    fn default() -> Visibility {
        Visibility { visible: true }
    }
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct MeshInfo {
    pub(super) name: Option<String>,
    pub(super) primitives: Vec<PrimitiveInfo>,
    pub(super) weights: Vec<f32>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct PrimitiveInfo {
    pub(super) attributes: BTreeMap<String, Index>,
    pub(super) indices: Option<Index>,
    pub(super) material: Option<Index>,
    pub(super) mode: Option<u32>,
    pub(super) targets: Vec<BTreeMap<String, Index>>,
    pub(super) extensions: PrimitiveExtensions,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct PrimitiveExtensions {
    #[serde(rename = "KHR_materials_variants")]
    pub(super) variants: VariantMappings,
    #[serde(rename = "KHR_draco_mesh_compression")]
    pub(super) draco: Option<DracoMesh>,
}

/// The stream of a compressed primitive.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct DracoMesh {
    pub(super) buffer_view: Index,
    /// The identifiers of attributes in the stream.
    pub(super) attributes: BTreeMap<String, u32>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct VariantMappings {
    pub(super) mappings: Vec<VariantMapping>,
}

#[derive(Debug, Deserialize)]
pub(super) struct VariantMapping {
    pub(super) material: Index,
    pub(super) variants: Vec<Index>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct Skin {
    pub(super) inverse_bind_matrices: Option<Index>,
    pub(super) joints: Vec<Index>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Animation {
    pub(super) name: Option<String>,
    pub(super) channels: Vec<AnimationChannel>,
    pub(super) samplers: Vec<AnimationSampler>,
}

#[derive(Debug, Deserialize)]
pub(super) struct AnimationChannel {
    pub(super) sampler: Index,
    pub(super) target: AnimationTarget,
}

#[derive(Debug, Deserialize)]
pub(super) struct AnimationTarget {
    #[serde(default)]
    pub(super) node: Option<Index>,
    pub(super) path: String,
    #[serde(default)]
    pub(super) extensions: AnimationTargetExtensions,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct AnimationTargetExtensions {
    #[serde(rename = "KHR_animation_pointer")]
    pub(super) pointer: Option<AnimationPointer>,
}

#[derive(Debug, Deserialize)]
pub(super) struct AnimationPointer {
    pub(super) pointer: String,
}

#[derive(Debug, Deserialize)]
pub(super) struct AnimationSampler {
    pub(super) input: Index,
    pub(super) output: Index,
    #[serde(default)]
    pub(super) interpolation: Option<String>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Camera {
    #[serde(default)]
    pub(super) name: Option<String>,
    #[serde(rename = "type")]
    pub(super) kind: String,
    #[serde(default)]
    pub(super) perspective: Option<Perspective>,
    #[serde(default)]
    pub(super) orthographic: Option<Orthographic>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Perspective {
    pub(super) yfov: f64,
    #[serde(default)]
    pub(super) aspect_ratio: Option<f64>,
    #[serde(default)]
    pub(super) znear: Option<f64>,
    #[serde(default)]
    pub(super) zfar: Option<f64>,
}

#[derive(Debug, Deserialize)]
pub(super) struct Orthographic {
    pub(super) xmag: f64,
    pub(super) ymag: f64,
    #[serde(default)]
    pub(super) znear: Option<f64>,
    #[serde(default)]
    pub(super) zfar: Option<f64>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct MaterialInfo {
    pub(super) name: Option<String>,
    pub(super) pbr_metallic_roughness: MetallicRoughness,
    pub(super) normal_texture: Option<TextureRef>,
    pub(super) emissive_texture: Option<TextureRef>,
    pub(super) emissive_factor: [f32; 3],
    pub(super) alpha_mode: Option<String>,
    pub(super) alpha_cutoff: Option<f32>,
    pub(super) double_sided: bool,
    pub(super) extensions: MaterialExtensions,
}

#[derive(Debug, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct MetallicRoughness {
    pub(super) base_color_factor: [f32; 4],
    pub(super) base_color_texture: Option<TextureRef>,
    pub(super) metallic_factor: f32,
    pub(super) roughness_factor: f32,
    pub(super) metallic_roughness_texture: Option<TextureRef>,
}

impl Default for MetallicRoughness {
    fn default() -> MetallicRoughness {
        MetallicRoughness {
            base_color_factor: [1.0; 4],
            base_color_texture: None,
            metallic_factor: 1.0,
            roughness_factor: 1.0,
            metallic_roughness_texture: None,
        }
    }
}

/// The use of a texture.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct TextureRef {
    pub(super) index: Index,
    #[serde(default)]
    pub(super) tex_coord: u32,
    /// The strength of a normal map.
    #[serde(default = "one")]
    pub(super) scale: f32,
    #[serde(default)]
    pub(super) extensions: TextureRefExtensions,
}

impl TextureRef {
    /// The set of texture coordinates, which KHR_texture_transform may replace.
    pub(super) fn uv_set(&self) -> u32 {
        self.extensions.transform.and_then(|transform| transform.tex_coord).unwrap_or(self.tex_coord)
    }
}

#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct TextureRefExtensions {
    #[serde(rename = "KHR_texture_transform")]
    pub(super) transform: Option<TextureTransform>,
}

#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct TextureTransform {
    pub(super) offset: [f64; 2],
    pub(super) rotation: f64,
    pub(super) scale: [f64; 2],
    pub(super) tex_coord: Option<u32>,
}

impl Default for TextureTransform {
    fn default() -> TextureTransform {
        TextureTransform { offset: [0.0; 2], rotation: 0.0, scale: [1.0; 2], tex_coord: None }
    }
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct MaterialExtensions {
    #[serde(rename = "KHR_materials_emissive_strength")]
    pub(super) emissive_strength: Option<EmissiveStrength>,
    #[serde(rename = "KHR_materials_unlit")]
    pub(super) unlit: Option<Unlit>,
    #[serde(rename = "KHR_materials_ior")]
    pub(super) ior: Option<Ior>,
    #[serde(rename = "KHR_materials_specular")]
    pub(super) specular: Option<Specular>,
    #[serde(rename = "KHR_materials_clearcoat")]
    pub(super) clearcoat: Option<Clearcoat>,
    #[serde(rename = "KHR_materials_sheen")]
    pub(super) sheen: Option<Sheen>,
    #[serde(rename = "KHR_materials_transmission")]
    pub(super) transmission: Option<Transmission>,
    #[serde(rename = "KHR_materials_volume")]
    pub(super) volume: Option<Volume>,
    #[serde(rename = "KHR_materials_dispersion")]
    pub(super) dispersion: Option<Dispersion>,
    #[serde(rename = "KHR_materials_iridescence")]
    pub(super) iridescence: Option<Iridescence>,
    #[serde(rename = "KHR_materials_anisotropy")]
    pub(super) anisotropy: Option<Anisotropy>,
    #[serde(rename = "KHR_materials_diffuse_transmission")]
    pub(super) diffuse_transmission: Option<DiffuseTransmission>,
    #[serde(rename = "KHR_materials_pbrSpecularGlossiness")]
    pub(super) specular_glossiness: Option<SpecularGlossiness>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct DiffuseTransmission {
    #[serde(default)]
    pub(super) diffuse_transmission_factor: f32,
    #[serde(default)]
    pub(super) diffuse_transmission_texture: Option<TextureRef>,
    #[serde(default = "white")]
    pub(super) diffuse_transmission_color_factor: [f32; 3],
    #[serde(default)]
    pub(super) diffuse_transmission_color_texture: Option<TextureRef>,
}

#[derive(Debug, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct SpecularGlossiness {
    pub(super) diffuse_factor: [f32; 4],
    pub(super) diffuse_texture: Option<TextureRef>,
    pub(super) specular_factor: [f32; 3],
    pub(super) glossiness_factor: f32,
    pub(super) specular_glossiness_texture: Option<TextureRef>,
}

impl Default for SpecularGlossiness {
    fn default() -> SpecularGlossiness {
        SpecularGlossiness {
            diffuse_factor: [1.0; 4],
            diffuse_texture: None,
            specular_factor: [1.0; 3],
            glossiness_factor: 1.0,
            specular_glossiness_texture: None,
        }
    }
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct EmissiveStrength {
    #[serde(default = "one")]
    pub(super) emissive_strength: f32,
}

#[derive(Debug, Deserialize)]
pub(super) struct Unlit {}

#[derive(Debug, Deserialize)]
pub(super) struct Ior {
    #[serde(default = "usual_ior")]
    pub(super) ior: f32,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Specular {
    #[serde(default = "one")]
    pub(super) specular_factor: f32,
    #[serde(default)]
    pub(super) specular_texture: Option<TextureRef>,
    #[serde(default = "white")]
    pub(super) specular_color_factor: [f32; 3],
    #[serde(default)]
    pub(super) specular_color_texture: Option<TextureRef>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct Clearcoat {
    pub(super) clearcoat_factor: f32,
    pub(super) clearcoat_texture: Option<TextureRef>,
    pub(super) clearcoat_roughness_factor: f32,
    pub(super) clearcoat_roughness_texture: Option<TextureRef>,
    pub(super) clearcoat_normal_texture: Option<TextureRef>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct Sheen {
    pub(super) sheen_color_factor: [f32; 3],
    pub(super) sheen_color_texture: Option<TextureRef>,
    pub(super) sheen_roughness_factor: f32,
    pub(super) sheen_roughness_texture: Option<TextureRef>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct Transmission {
    pub(super) transmission_factor: f32,
    pub(super) transmission_texture: Option<TextureRef>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Volume {
    #[serde(default)]
    pub(super) thickness_factor: f32,
    #[serde(default)]
    pub(super) attenuation_distance: Option<f32>,
    #[serde(default = "white")]
    pub(super) attenuation_color: [f32; 3],
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Dispersion {
    pub(super) dispersion: f32,
}

#[derive(Debug, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct Iridescence {
    pub(super) iridescence_factor: f32,
    pub(super) iridescence_texture: Option<TextureRef>,
    pub(super) iridescence_ior: f32,
    pub(super) iridescence_thickness_minimum: f32,
    pub(super) iridescence_thickness_maximum: f32,
    pub(super) iridescence_thickness_texture: Option<TextureRef>,
}

impl Default for Iridescence {
    fn default() -> Iridescence {
        Iridescence {
            iridescence_factor: 0.0,
            iridescence_texture: None,
            iridescence_ior: 1.3,
            iridescence_thickness_minimum: 100.0,
            iridescence_thickness_maximum: 400.0,
            iridescence_thickness_texture: None,
        }
    }
}

#[derive(Debug, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct Anisotropy {
    pub(super) anisotropy_strength: f32,
    pub(super) anisotropy_rotation: f32,
    pub(super) anisotropy_texture: Option<TextureRef>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct TextureInfo {
    pub(super) name: Option<String>,
    pub(super) sampler: Option<Index>,
    pub(super) source: Option<Index>,
    pub(super) extensions: TextureExtensions,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct TextureExtensions {
    #[serde(rename = "KHR_texture_basisu")]
    pub(super) basisu: Option<Source>,
    #[serde(rename = "EXT_texture_webp")]
    pub(super) webp: Option<Source>,
}

#[derive(Debug, Deserialize)]
pub(super) struct Source {
    pub(super) source: Index,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct ImageInfo {
    pub(super) name: Option<String>,
    pub(super) uri: Option<String>,
    pub(super) buffer_view: Option<Index>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct Sampler {
    pub(super) mag_filter: Option<u32>,
    pub(super) wrap_s: Option<u32>,
    pub(super) wrap_t: Option<u32>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct AccessorInfo {
    #[serde(default)]
    pub(super) buffer_view: Option<Index>,
    #[serde(default)]
    pub(super) byte_offset: usize,
    pub(super) component_type: u32,
    #[serde(default)]
    pub(super) normalized: bool,
    pub(super) count: usize,
    #[serde(rename = "type")]
    pub(super) kind: String,
    #[serde(default)]
    pub(super) sparse: Option<Sparse>,
}

#[derive(Debug, Deserialize)]
pub(super) struct Sparse {
    pub(super) count: usize,
    pub(super) indices: SparseIndices,
    pub(super) values: SparseValues,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct SparseIndices {
    pub(super) buffer_view: Index,
    #[serde(default)]
    pub(super) byte_offset: usize,
    pub(super) component_type: u32,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct SparseValues {
    pub(super) buffer_view: Index,
    #[serde(default)]
    pub(super) byte_offset: usize,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct BufferView {
    pub(super) buffer: Index,
    #[serde(default)]
    pub(super) byte_offset: usize,
    pub(super) byte_length: usize,
    #[serde(default)]
    pub(super) byte_stride: Option<usize>,
    #[serde(default)]
    pub(super) extensions: BufferViewExtensions,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct BufferViewExtensions {
    #[serde(rename = "KHR_meshopt_compression")]
    pub(super) meshopt: Option<CompressedView>,
    #[serde(rename = "EXT_meshopt_compression")]
    pub(super) meshopt_ext: Option<CompressedView>,
}

impl BufferViewExtensions {
    /// The compressed bytes that the view has in place of its own, and the extension that says so.
    pub(super) fn compressed(&self) -> Option<(&CompressedView, &'static str)> {
        let khr = self.meshopt.as_ref().map(|view| (view, "KHR_meshopt_compression"));
        khr.or_else(|| self.meshopt_ext.as_ref().map(|view| (view, "EXT_meshopt_compression")))
    }
}

/// A buffer view of EXT_meshopt_compression or KHR_meshopt_compression.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct CompressedView {
    pub(super) buffer: Index,
    #[serde(default)]
    pub(super) byte_offset: usize,
    pub(super) byte_length: usize,
    pub(super) byte_stride: usize,
    pub(super) count: usize,
    pub(super) mode: CompressionMode,
    #[serde(default)]
    pub(super) filter: CompressionFilter,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "UPPERCASE")]
pub(super) enum CompressionMode {
    Attributes,
    Triangles,
    Indices,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "UPPERCASE")]
pub(super) enum CompressionFilter {
    #[default]
    None,
    Octahedral,
    Quaternion,
    Exponential,
    Color,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Buffer {
    #[serde(default)]
    pub(super) uri: Option<String>,
    pub(super) byte_length: usize,
}

fn one() -> f32 {
    1.0
}

fn white() -> [f32; 3] {
    [1.0; 3]
}

fn usual_ior() -> f32 {
    1.5
}
