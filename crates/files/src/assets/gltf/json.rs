//! JSON schema for the subset of glTF 2.0 that glimt uses (Khronos, *glTF 2.0 Specification*). Only types are
//! checked here. Indices are checked when they are used.

use std::collections::BTreeMap;
use std::fmt;

use base64::alphabet::STANDARD;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};
use base64::{DecodeError, Engine};
use serde::de::{self, Deserializer, IgnoredAny, Visitor};
use serde::{Deserialize, de::Error};

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

/// URI of a buffer or image.
#[derive(Debug)]
pub(super) enum Uri {
    /// Decoded bytes of a data URI.
    Data(Vec<u8>),
    /// URI of a file, as written in the JSON.
    File(String),
}

impl<'de> Deserialize<'de> for Uri {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct UriVisitor;
        impl Visitor<'_> for UriVisitor {
            type Value = Uri;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a URI")
            }

            fn visit_str<E: Error>(self, text: &str) -> Result<Uri, E> {
                let Some(data) = text.strip_prefix("data:") else { return Ok(Uri::File(text.to_owned())) };
                let (kind, coded) =
                    data.split_once(',').ok_or_else(|| E::custom("a data URI without a comma"))?;
                if !kind.ends_with(";base64") {
                    return Err(E::custom("a data URI that is not base64"));
                }
                decode_base64(coded).map(Uri::Data).map_err(E::custom)
            }
        }
        deserializer.deserialize_str(UriVisitor)
    }
}

/// Base64 decoder for data URIs (RFC 4648, section 4). Padding is optional.
const BASE64: GeneralPurpose = GeneralPurpose::new(
    &STANDARD,
    GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent),
);

fn decode_base64(coded: &str) -> Result<Vec<u8>, String> {
    BASE64.decode(coded).map_err(|error| match error {
        DecodeError::InvalidByte(at, byte) => invalid_base64_message(byte, at),
        DecodeError::InvalidLength(digits) => format!("invalid base64 length: {digits} digits"),
        DecodeError::InvalidLastSymbol { .. } | DecodeError::InvalidPadding => "truncated base64".to_owned(),
    })
}

pub(super) fn invalid_base64_message(byte: u8, at: usize) -> String {
    format!("invalid base64 byte {byte:#04x} at {at}")
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

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct TextureInfo {
    pub(super) index: usize,
    #[serde(default)]
    pub(super) tex_coord: usize,
    /// Scale factor for a normal map's slopes.
    #[serde(default = "default_one")]
    pub(super) scale: f64,
    #[serde(default)]
    pub(super) extensions: TextureInfoExtensions,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct TextureInfoExtensions {
    #[serde(rename = "KHR_texture_transform")]
    pub(super) transform: Option<TextureTransform>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct TextureTransform {
    pub(super) offset: [f64; 2],
    pub(super) rotation: f64,
    pub(super) scale: [f64; 2],
    pub(super) tex_coord: Option<usize>,
}

impl Default for TextureTransform {
    fn default() -> Self {
        Self { offset: [0.0; 2], rotation: 0.0, scale: [1.0; 2], tex_coord: None }
    }
}

fn default_one() -> f64 {
    1.0
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct JsonMaterial {
    pub(super) name: String,
    pub(super) pbr_metallic_roughness: Pbr,
    pub(super) normal_texture: Option<TextureInfo>,
    pub(super) emissive_texture: Option<TextureInfo>,
    pub(super) emissive_factor: [f64; 3],
    pub(super) alpha_mode: String,
    pub(super) alpha_cutoff: f64,
    pub(super) double_sided: bool,
    #[serde(deserialize_with = "deserialize_material_extensions")]
    pub(super) extensions: MaterialExtensions,
}

impl Default for JsonMaterial {
    fn default() -> Self {
        Self {
            name: String::new(),
            pbr_metallic_roughness: Pbr::default(),
            normal_texture: None,
            emissive_texture: None,
            emissive_factor: [0.0; 3],
            alpha_mode: "OPAQUE".to_owned(),
            alpha_cutoff: 0.5,
            double_sided: false,
            extensions: MaterialExtensions::default(),
        }
    }
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct Pbr {
    pub(super) base_color_factor: [f64; 4],
    pub(super) base_color_texture: Option<TextureInfo>,
    pub(super) metallic_factor: f64,
    pub(super) roughness_factor: f64,
    pub(super) metallic_roughness_texture: Option<TextureInfo>,
}

impl Default for Pbr {
    fn default() -> Self {
        Self {
            base_color_factor: [1.0; 4],
            base_color_texture: None,
            metallic_factor: 1.0,
            roughness_factor: 1.0,
            metallic_roughness_texture: None,
        }
    }
}

/// Supported material extensions, and the names of all others.
#[derive(Debug, Default)]
pub(super) struct MaterialExtensions {
    pub(super) ior: Option<Ior>,
    pub(super) transmission: Option<Transmission>,
    pub(super) volume: Option<Volume>,
    pub(super) clearcoat: Option<Clearcoat>,
    pub(super) specular: Option<Specular>,
    pub(super) emissive_strength: Option<EmissiveStrength>,
    pub(super) glossiness: Option<Glossiness>,
    pub(super) unlit: bool,
    pub(super) others: Vec<String>,
}

fn deserialize_material_extensions<'de, D: Deserializer<'de>>(
    deserializer: D,
) -> Result<MaterialExtensions, D::Error> {
    struct ExtensionsVisitor;
    impl<'de> Visitor<'de> for ExtensionsVisitor {
        type Value = MaterialExtensions;

        fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            f.write_str("an object with extensions")
        }

        fn visit_map<A: de::MapAccess<'de>>(self, mut map: A) -> Result<MaterialExtensions, A::Error> {
            let mut all = MaterialExtensions::default();
            while let Some(name) = map.next_key::<String>()? {
                match name.as_str() {
                    "KHR_materials_ior" => all.ior = Some(map.next_value()?),
                    "KHR_materials_transmission" => all.transmission = Some(map.next_value()?),
                    "KHR_materials_volume" => all.volume = Some(map.next_value()?),
                    "KHR_materials_clearcoat" => all.clearcoat = Some(map.next_value()?),
                    "KHR_materials_specular" => all.specular = Some(map.next_value()?),
                    "KHR_materials_emissive_strength" => all.emissive_strength = Some(map.next_value()?),
                    "KHR_materials_pbrSpecularGlossiness" => all.glossiness = Some(map.next_value()?),
                    "KHR_materials_unlit" => {
                        map.next_value::<IgnoredAny>()?;
                        all.unlit = true;
                    }
                    _ => {
                        map.next_value::<IgnoredAny>()?;
                        all.others.push(name);
                    }
                }
            }
            Ok(all)
        }
    }
    deserializer.deserialize_map(ExtensionsVisitor)
}

#[derive(Debug, Deserialize)]
pub(super) struct Ior {
    #[serde(default = "default_ior")]
    pub(super) ior: f64,
}

fn default_ior() -> f64 {
    1.5
}

#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct Transmission {
    pub(super) transmission_factor: f64,
    pub(super) transmission_texture: Option<TextureInfo>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct Volume {
    pub(super) thickness_factor: f64,
    pub(super) attenuation_color: [f64; 3],
    pub(super) attenuation_distance: Option<f64>,
}

impl Default for Volume {
    fn default() -> Self {
        Self { thickness_factor: 0.0, attenuation_color: [1.0; 3], attenuation_distance: None }
    }
}

#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct Clearcoat {
    pub(super) clearcoat_factor: f64,
    pub(super) clearcoat_texture: Option<TextureInfo>,
    pub(super) clearcoat_roughness_factor: f64,
    pub(super) clearcoat_roughness_texture: Option<TextureInfo>,
    pub(super) clearcoat_normal_texture: Option<IgnoredAny>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct Specular {
    pub(super) specular_factor: f64,
    pub(super) specular_texture: Option<TextureInfo>,
    pub(super) specular_color_factor: [f64; 3],
    pub(super) specular_color_texture: Option<TextureInfo>,
}

impl Default for Specular {
    fn default() -> Self {
        let (specular_texture, specular_color_texture) = (None, None);
        Self {
            specular_factor: 1.0,
            specular_texture,
            specular_color_factor: [1.0; 3],
            specular_color_texture,
        }
    }
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct EmissiveStrength {
    #[serde(default = "default_one")]
    pub(super) emissive_strength: f64,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct Glossiness {
    pub(super) diffuse_factor: [f64; 4],
    pub(super) diffuse_texture: Option<TextureInfo>,
    pub(super) glossiness_factor: f64,
}

impl Default for Glossiness {
    fn default() -> Self {
        Self { diffuse_factor: [1.0; 4], diffuse_texture: None, glossiness_factor: 1.0 }
    }
}

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
