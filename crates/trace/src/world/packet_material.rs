//! Plain materials: hits on them are shaded in packets instead of one by one.

use super::World;
use crate::materials::texture::Texture;
use crate::materials::{BxdfKind, Material, NonSpecular, UvSet};
use crate::math::Vec3;

/// Data for shading a plain material in packets.
#[derive(Clone, Copy, Debug)]
pub struct PacketShadingMaterial {
    /// Kind of BSDF.
    pub kind: BxdfKind,
    /// UV set for the BSDF texture used in packet shading, or `None` without a texture.
    pub row_texture: Option<UvSet>,
    /// Ambient reflectance, if the BSDF is constant over the surface and the same on both sides.
    pub ambient: Option<Vec3>,
    /// Emitted radiance.
    pub emission: Vec3,
    /// Whether both sides emit.
    pub is_two_sided: bool,
    /// Whether only the front scatters light.
    pub is_black_from_behind: bool,
}

impl PacketShadingMaterial {
    /// Creates the packet-shading data for a material. Returns `None` if the material perturbs normals, has
    /// textured or coated emission, may be a null interaction, or has a BSDF that does not support packets.
    pub(super) fn from_material(material: &Material) -> Option<Self> {
        let Material { bsdf, sides: _, emission, normal_perturbation, opacity } = material;
        let is_black_from_behind = material.may_be_black_from_behind();
        let is_even = emission.texture.is_none() && emission.coat.is_none();
        let rough = bsdf.as_purely_non_specular().filter(|rough| rough.supports_packets())?;
        (is_even && normal_perturbation.is_none() && opacity.is_none()).then(|| Self {
            kind: rough.kind(),
            row_texture: rough.texture_for_packets().map(Texture::uv_set),
            ambient: rough
                .as_untextured()
                .filter(|_| !is_black_from_behind)
                .map(|bsdf| bsdf.ambient_reflectance()),
            emission: emission.scale,
            is_two_sided: emission.is_two_sided(),
            is_black_from_behind,
        })
    }
}

impl PacketShadingMaterial {
    /// Whether the material emits light.
    #[inline(always)]
    pub fn is_emissive(&self) -> bool {
        self.emission != Vec3::ZERO
    }
}

impl World {
    /// Packet-shading data and BSDF of a material, or `None` if the material is not plain.
    #[inline(always)]
    pub fn material_for_packet_shading(
        &self,
        material: usize,
    ) -> Option<(&PacketShadingMaterial, &NonSpecular)> {
        let packet_material = self.packet_material[material].as_ref()?;
        Some((packet_material, self.materials[material].bsdf.as_purely_non_specular()?))
    }
}
