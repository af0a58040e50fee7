//! Materials and their extensions.

use std::fmt;

use serde::Deserialize;
use serde::de::{self, Deserializer, IgnoredAny, Visitor};

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(crate) struct TextureInfo {
    pub(crate) index: usize,
    #[serde(default)]
    pub(crate) tex_coord: usize,
    /// Scale factor for a normal map's slopes.
    #[serde(default = "default_one")]
    pub(crate) scale: f64,
    #[serde(default)]
    pub(crate) extensions: TextureInfoExtensions,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(crate) struct TextureInfoExtensions {
    #[serde(rename = "KHR_texture_transform")]
    pub(crate) transform: Option<TextureTransform>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(crate) struct TextureTransform {
    pub(crate) offset: [f64; 2],
    pub(crate) rotation: f64,
    pub(crate) scale: [f64; 2],
    pub(crate) tex_coord: Option<usize>,
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
pub(crate) struct JsonMaterial {
    pub(crate) name: String,
    pub(crate) pbr_metallic_roughness: Pbr,
    pub(crate) normal_texture: Option<TextureInfo>,
    pub(crate) emissive_texture: Option<TextureInfo>,
    pub(crate) emissive_factor: [f64; 3],
    pub(crate) alpha_mode: String,
    pub(crate) alpha_cutoff: f64,
    pub(crate) double_sided: bool,
    #[serde(deserialize_with = "deserialize_material_extensions")]
    pub(crate) extensions: MaterialExtensions,
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
pub(crate) struct Pbr {
    pub(crate) base_color_factor: [f64; 4],
    pub(crate) base_color_texture: Option<TextureInfo>,
    pub(crate) metallic_factor: f64,
    pub(crate) roughness_factor: f64,
    pub(crate) metallic_roughness_texture: Option<TextureInfo>,
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
pub(crate) struct MaterialExtensions {
    pub(crate) ior: Option<Ior>,
    pub(crate) transmission: Option<Transmission>,
    pub(crate) volume: Option<Volume>,
    pub(crate) clearcoat: Option<Clearcoat>,
    pub(crate) diffuse_transmission: Option<DiffuseTransmission>,
    pub(crate) specular: Option<Specular>,
    pub(crate) emissive_strength: Option<EmissiveStrength>,
    pub(crate) glossiness: Option<SpecularGlossiness>,
    pub(crate) unlit: bool,
    pub(crate) others: Vec<String>,
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
pub(crate) struct Ior {
    #[serde(default = "default_ior")]
    pub(crate) ior: f64,
}

fn default_ior() -> f64 {
    1.5
}

#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(crate) struct Transmission {
    pub(crate) transmission_factor: f64,
    pub(crate) transmission_texture: Option<TextureInfo>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(crate) struct Volume {
    pub(crate) thickness_factor: f64,
    pub(crate) attenuation_color: [f64; 3],
    pub(crate) attenuation_distance: Option<f64>,
}

impl Default for Volume {
    fn default() -> Self {
        Self { thickness_factor: 0.0, attenuation_color: [1.0; 3], attenuation_distance: None }
    }
}

#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(crate) struct Clearcoat {
    pub(crate) clearcoat_factor: f64,
    pub(crate) clearcoat_texture: Option<TextureInfo>,
    pub(crate) clearcoat_roughness_factor: f64,
    pub(crate) clearcoat_roughness_texture: Option<TextureInfo>,
    pub(crate) clearcoat_normal_texture: Option<IgnoredAny>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(crate) struct DiffuseTransmission {
    pub(crate) diffuse_transmission_factor: f64,
    pub(crate) diffuse_transmission_texture: Option<TextureInfo>,
    pub(crate) diffuse_transmission_color_factor: [f64; 3],
    pub(crate) diffuse_transmission_color_texture: Option<TextureInfo>,
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
pub(crate) struct Specular {
    pub(crate) specular_factor: f64,
    pub(crate) specular_texture: Option<TextureInfo>,
    pub(crate) specular_color_factor: [f64; 3],
    pub(crate) specular_color_texture: Option<TextureInfo>,
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
pub(crate) struct EmissiveStrength {
    #[serde(default = "default_one")]
    pub(crate) emissive_strength: f64,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(crate) struct SpecularGlossiness {
    pub(crate) diffuse_factor: [f64; 4],
    pub(crate) diffuse_texture: Option<TextureInfo>,
    pub(crate) glossiness_factor: f64,
}

impl Default for SpecularGlossiness {
    fn default() -> Self {
        Self { diffuse_factor: [1.0; 4], diffuse_texture: None, glossiness_factor: 1.0 }
    }
}
