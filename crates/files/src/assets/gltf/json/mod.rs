//! JSON schema for the subset of glTF 2.0 that glimt uses (Khronos, *glTF 2.0 Specification*). Only types are
//! checked here. Indices are checked when they are used.

mod materials;
mod uri;

use std::collections::BTreeMap;

use serde::Deserialize;
use serde::de::IgnoredAny;

pub(super) use self::materials::*;
pub(super) use self::uri::*;

/// Root object of a glTF file.
#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct Root {
    pub(super) asset: JsonAsset,
    pub(super) extensions_required: Vec<String>,
    pub(super) scene: Option<usize>,
    pub(super) scenes: Vec<JsonScene>,
    pub(super) nodes: Vec<JsonNode>,
    pub(super) meshes: Vec<JsonMesh>,
    pub(super) accessors: Vec<Accessor>,
    pub(super) buffer_views: Vec<BufferView>,
    pub(super) buffers: Vec<Buffer>,
    pub(super) materials: Vec<JsonMaterial>,
    pub(super) textures: Vec<JsonTexture>,
    pub(super) samplers: Vec<Sampler>,
    pub(super) images: Vec<JsonImage>,
    pub(super) cameras: Vec<JsonCamera>,
    pub(super) skins: Vec<Skin>,
    pub(super) animations: Vec<IgnoredAny>,
    pub(super) extensions: RootExtensions,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct JsonAsset {
    pub(super) version: String,
    /// Minimum glTF version that a reader must support. Empty if unspecified.
    #[serde(rename = "minVersion")]
    pub(super) min_version: String,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct RootExtensions {
    #[serde(rename = "KHR_lights_punctual")]
    pub(super) lights: JsonLights,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct JsonLights {
    pub(super) lights: Vec<JsonLight>,
}

#[derive(Debug, Deserialize)]
#[serde(default)]
pub(super) struct JsonLight {
    pub(super) name: String,
    #[serde(rename = "type")]
    pub(super) kind: String,
    pub(super) color: [f64; 3],
    pub(super) intensity: f64,
    pub(super) range: Option<f64>,
    pub(super) spot: JsonSpot,
}

impl Default for JsonLight {
    fn default() -> Self {
        let (name, kind, spot) = (String::new(), String::new(), JsonSpot::default());
        Self { name, kind, color: [1.0; 3], intensity: 1.0, range: None, spot }
    }
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct JsonSpot {
    pub(super) inner_cone_angle: f64,
    pub(super) outer_cone_angle: f64,
}

impl Default for JsonSpot {
    fn default() -> Self {
        Self { inner_cone_angle: 0.0, outer_cone_angle: std::f64::consts::FRAC_PI_4 }
    }
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct JsonScene {
    pub(super) nodes: Vec<usize>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct JsonNode {
    pub(super) name: String,
    pub(super) children: Vec<usize>,
    pub(super) mesh: Option<usize>,
    pub(super) skin: Option<usize>,
    pub(super) camera: Option<usize>,
    pub(super) matrix: Option<[f64; 16]>,
    pub(super) translation: Option<[f64; 3]>,
    pub(super) rotation: Option<[f64; 4]>,
    pub(super) scale: Option<[f64; 3]>,
    pub(super) weights: Vec<f64>,
    pub(super) extensions: NodeExtensions,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct NodeExtensions {
    #[serde(rename = "KHR_lights_punctual")]
    pub(super) light: Option<NodeLight>,
    #[serde(rename = "EXT_mesh_gpu_instancing")]
    pub(super) instancing: Option<IgnoredAny>,
    #[serde(rename = "KHR_node_visibility")]
    pub(super) visibility: Option<NodeVisibility>,
}

#[derive(Debug, Deserialize)]
#[serde(default)]
pub(super) struct NodeVisibility {
    pub(super) visible: bool,
}

impl Default for NodeVisibility {
    fn default() -> Self {
        Self { visible: true }
    }
}

#[derive(Debug, Deserialize)]
pub(super) struct NodeLight {
    pub(super) light: usize,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct JsonMesh {
    pub(super) name: String,
    pub(super) primitives: Vec<Primitive>,
    pub(super) weights: Vec<f64>,
}

#[derive(Debug, Deserialize)]
#[serde(default)]
pub(super) struct Primitive {
    pub(super) attributes: BTreeMap<String, usize>,
    pub(super) indices: Option<usize>,
    pub(super) material: Option<usize>,
    pub(super) mode: u32,
    pub(super) extensions: BTreeMap<String, IgnoredAny>,
}

/// Primitive mode for separate triangles.
pub(super) const TRIANGLES: u32 = 4;

impl Default for Primitive {
    fn default() -> Self {
        let (attributes, extensions) = Default::default();
        Self { attributes, indices: None, material: None, mode: TRIANGLES, extensions }
    }
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Accessor {
    pub(super) buffer_view: Option<usize>,
    #[serde(default)]
    pub(super) byte_offset: u64,
    pub(super) component_type: u32,
    #[serde(default)]
    pub(super) normalized: bool,
    pub(super) count: u64,
    #[serde(rename = "type")]
    pub(super) kind: String,
    pub(super) sparse: Option<Sparse>,
}

#[derive(Debug, Deserialize)]
pub(super) struct Sparse {
    pub(super) count: u64,
    pub(super) indices: SparseIndices,
    pub(super) values: SparseValues,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct SparseIndices {
    pub(super) buffer_view: usize,
    #[serde(default)]
    pub(super) byte_offset: u64,
    pub(super) component_type: u32,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct SparseValues {
    pub(super) buffer_view: usize,
    #[serde(default)]
    pub(super) byte_offset: u64,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct BufferView {
    pub(super) buffer: usize,
    #[serde(default)]
    pub(super) byte_offset: u64,
    pub(super) byte_length: u64,
    pub(super) byte_stride: Option<u64>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Buffer {
    #[serde(default)]
    pub(super) uri: Option<Uri>,
    pub(super) byte_length: u64,
}

#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct JsonImage {
    pub(super) name: String,
    pub(super) uri: Option<Uri>,
    pub(super) buffer_view: Option<usize>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct JsonTexture {
    pub(super) sampler: Option<usize>,
    pub(super) source: Option<usize>,
    pub(super) extensions: TextureExtensions,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct TextureExtensions {
    #[serde(rename = "EXT_texture_webp")]
    pub(super) webp: Option<TextureSourceExtension>,
    #[serde(rename = "KHR_texture_basisu")]
    pub(super) basis: Option<IgnoredAny>,
}

#[derive(Debug, Deserialize)]
pub(super) struct TextureSourceExtension {
    pub(super) source: usize,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct Sampler {
    pub(super) mag_filter: Option<u32>,
    pub(super) wrap_s: u32,
    pub(super) wrap_t: u32,
}

impl Default for Sampler {
    fn default() -> Self {
        Self { mag_filter: None, wrap_s: REPEAT, wrap_t: REPEAT }
    }
}

/// OpenGL constants for wrap modes and nearest-neighbor filtering.
pub(super) const REPEAT: u32 = 10497;
pub(super) const CLAMP: u32 = 33071;
pub(super) const MIRROR: u32 = 33648;
pub(super) const NEAREST: u32 = 9728;

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct JsonCamera {
    pub(super) name: String,
    pub(super) perspective: Option<Perspective>,
    pub(super) orthographic: Option<Orthographic>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Perspective {
    pub(super) yfov: f64,
    pub(super) aspect_ratio: Option<f64>,
}

#[derive(Debug, Deserialize)]
pub(super) struct Orthographic {
    pub(super) xmag: Option<f64>,
    pub(super) ymag: f64,
}

#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct Skin {
    pub(super) joints: Vec<usize>,
    pub(super) inverse_bind_matrices: Option<usize>,
}
