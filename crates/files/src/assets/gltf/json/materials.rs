//! Materials and their extensions.

use std::fmt;

use serde::Deserialize;
use serde::de::{self, Deserializer, IgnoredAny, Visitor};

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(in crate::assets::gltf) struct TextureInfo {
    pub(in crate::assets::gltf) index: usize,
    #[serde(default)]
    pub(in crate::assets::gltf) tex_coord: usize,
    /// Scale factor for a normal map's slopes.
    #[serde(default = "default_one")]
    pub(in crate::assets::gltf) scale: f64,
    #[serde(default)]
    pub(in crate::assets::gltf) extensions: TextureInfoExtensions,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(in crate::assets::gltf) struct TextureInfoExtensions {
    #[serde(rename = "KHR_texture_transform")]
    pub(in crate::assets::gltf) transform: Option<TextureTransform>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(in crate::assets::gltf) struct TextureTransform {
    pub(in crate::assets::gltf) offset: [f64; 2],
    pub(in crate::assets::gltf) rotation: f64,
    pub(in crate::assets::gltf) scale: [f64; 2],
    pub(in crate::assets::gltf) tex_coord: Option<usize>,
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
pub(in crate::assets::gltf) struct JsonMaterial {
    pub(in crate::assets::gltf) name: String,
    pub(in crate::assets::gltf) pbr_metallic_roughness: Pbr,
    pub(in crate::assets::gltf) normal_texture: Option<TextureInfo>,
    pub(in crate::assets::gltf) emissive_texture: Option<TextureInfo>,
    pub(in crate::assets::gltf) emissive_factor: [f64; 3],
    pub(in crate::assets::gltf) alpha_mode: String,
    pub(in crate::assets::gltf) alpha_cutoff: f64,
    pub(in crate::assets::gltf) double_sided: bool,
    #[serde(deserialize_with = "deserialize_material_extensions")]
    pub(in crate::assets::gltf) extensions: MaterialExtensions,
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
pub(in crate::assets::gltf) struct Pbr {
    pub(in crate::assets::gltf) base_color_factor: [f64; 4],
    pub(in crate::assets::gltf) base_color_texture: Option<TextureInfo>,
    pub(in crate::assets::gltf) metallic_factor: f64,
    pub(in crate::assets::gltf) roughness_factor: f64,
    pub(in crate::assets::gltf) metallic_roughness_texture: Option<TextureInfo>,
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
pub(in crate::assets::gltf) struct MaterialExtensions {
    pub(in crate::assets::gltf) ior: Option<Ior>,
    pub(in crate::assets::gltf) transmission: Option<Transmission>,
    pub(in crate::assets::gltf) volume: Option<Volume>,
    pub(in crate::assets::gltf) clearcoat: Option<Clearcoat>,
    pub(in crate::assets::gltf) diffuse_transmission: Option<DiffuseTransmission>,
    pub(in crate::assets::gltf) specular: Option<Specular>,
    pub(in crate::assets::gltf) emissive_strength: Option<EmissiveStrength>,
    pub(in crate::assets::gltf) glossiness: Option<Glossiness>,
    pub(in crate::assets::gltf) unlit: bool,
    pub(in crate::assets::gltf) others: Vec<String>,
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
                    "KHR_materials_diffuse_transmission" => {
                        all.diffuse_transmission = Some(map.next_value()?);
                    }
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
pub(in crate::assets::gltf) struct Ior {
    #[serde(default = "default_ior")]
    pub(in crate::assets::gltf) ior: f64,
}

fn default_ior() -> f64 {
    1.5
}

#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(in crate::assets::gltf) struct Transmission {
    pub(in crate::assets::gltf) transmission_factor: f64,
    pub(in crate::assets::gltf) transmission_texture: Option<TextureInfo>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(in crate::assets::gltf) struct Volume {
    pub(in crate::assets::gltf) thickness_factor: f64,
    pub(in crate::assets::gltf) attenuation_color: [f64; 3],
    pub(in crate::assets::gltf) attenuation_distance: Option<f64>,
}

impl Default for Volume {
    fn default() -> Self {
        Self { thickness_factor: 0.0, attenuation_color: [1.0; 3], attenuation_distance: None }
    }
}

#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(in crate::assets::gltf) struct Clearcoat {
    pub(in crate::assets::gltf) clearcoat_factor: f64,
    pub(in crate::assets::gltf) clearcoat_texture: Option<TextureInfo>,
    pub(in crate::assets::gltf) clearcoat_roughness_factor: f64,
    pub(in crate::assets::gltf) clearcoat_roughness_texture: Option<TextureInfo>,
    pub(in crate::assets::gltf) clearcoat_normal_texture: Option<IgnoredAny>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(in crate::assets::gltf) struct DiffuseTransmission {
    pub(in crate::assets::gltf) diffuse_transmission_factor: f64,
    pub(in crate::assets::gltf) diffuse_transmission_texture: Option<TextureInfo>,
    pub(in crate::assets::gltf) diffuse_transmission_color_factor: [f64; 3],
    pub(in crate::assets::gltf) diffuse_transmission_color_texture: Option<TextureInfo>,
}

impl Default for DiffuseTransmission {
    fn default() -> Self {
        let (diffuse_transmission_texture, diffuse_transmission_color_texture) = (None, None);
        Self {
            diffuse_transmission_factor: 0.0,
            diffuse_transmission_texture,
            diffuse_transmission_color_factor: [1.0; 3],
            diffuse_transmission_color_texture,
        }
    }
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(in crate::assets::gltf) struct Specular {
    pub(in crate::assets::gltf) specular_factor: f64,
    pub(in crate::assets::gltf) specular_texture: Option<TextureInfo>,
    pub(in crate::assets::gltf) specular_color_factor: [f64; 3],
    pub(in crate::assets::gltf) specular_color_texture: Option<TextureInfo>,
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
pub(in crate::assets::gltf) struct EmissiveStrength {
    #[serde(default = "default_one")]
    pub(in crate::assets::gltf) emissive_strength: f64,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(in crate::assets::gltf) struct Glossiness {
    pub(in crate::assets::gltf) diffuse_factor: [f64; 4],
    pub(in crate::assets::gltf) diffuse_texture: Option<TextureInfo>,
    pub(in crate::assets::gltf) glossiness_factor: f64,
}

impl Default for Glossiness {
    fn default() -> Self {
        Self { diffuse_factor: [1.0; 4], diffuse_texture: None, glossiness_factor: 1.0 }
    }
}
