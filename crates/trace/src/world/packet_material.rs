//! Plain materials: hits on them are shaded in packets instead of one by one.

use super::World;
use crate::materials::texture::Texture;
use crate::materials::{Bsdf, Material, Rough, RoughKind, UvSet};
use crate::math::Vec3;

/// Data for shading a plain material in packets.
#[derive(Clone, Copy, Debug)]
pub struct PacketMaterial {
    /// Kind of BSDF.
    pub kind: RoughKind,
    /// UV set for the BSDF texture used in packet shading. `None` without a texture.
    pub row_texture: Option<UvSet>,
    /// Ambient reflectance, if the BSDF is constant over the surface.
    pub ambient: Option<Vec3>,
    /// Emitted radiance.
    pub emission: Vec3,
    /// Whether both sides emit.
    pub is_two_sided: bool,
}

impl PacketMaterial {
    /// Creates the packet-shading data for a material. Returns `None` if the material perturbs normals, has
    /// textured or coated emission, may be a null interaction, or has a BSDF that does not support packets.
    pub(super) fn of(material: &Material) -> Option<Self> {
        let Material { bsdf, emission, normal_perturbation, opacity } = material;
        let is_even = emission.texture.is_none() && emission.coat.is_none();
        let rough = rough_of(bsdf).filter(|rough| rough.supports_packets())?;
        (is_even && normal_perturbation.is_none() && opacity.is_none()).then(|| Self {
            kind: rough.kind(),
            row_texture: rough.row_texture().map(Texture::uv_set),
            ambient: rough.constant().map(|bsdf| bsdf.ambient()),
            emission: emission.scale,
            is_two_sided: emission.is_two_sided(),
        })
    }
}

#[inline(always)]
fn rough_of(bsdf: &Bsdf) -> Option<&Rough> {
    match bsdf {
        Bsdf::Rough(rough) => Some(rough),
        Bsdf::Mirror(_) | Bsdf::Dielectric(_) | Bsdf::ThinDielectric(_) | Bsdf::Coated(_) => None,
    }
}

impl PacketMaterial {
    /// Whether the material emits light.
    #[inline(always)]
    pub fn is_emissive(&self) -> bool {
        self.emission != Vec3::ZERO
    }
}

impl World {
    /// A plain material and its BSDF. `None` if the material is not plain.
    #[inline(always)]
    pub fn packet_material(&self, material: usize) -> Option<(&PacketMaterial, &Rough)> {
        let packet_material = self.packet_material[material].as_ref()?;
        Some((packet_material, rough_of(&self.materials[material].bsdf)?))
    }
}
