//! Plain materials, whose surfaces are shaded in rows without a look at each of them.

use super::World;
use crate::materials::texture::Texture;
use crate::materials::{Bsdf, Material, Rough, RoughKind, UvSet};
use crate::math::Vec3;

/// What rows need to know of a plain material.
#[derive(Clone, Copy, Debug)]
pub struct PlainMaterial {
    /// Kind of its BSDF.
    pub kind: RoughKind,
    /// The coordinates by which rows look a texture up for its BSDF. `None` if they look up none.
    pub row_texture: Option<UvSet>,
    /// Its ambient reflectance, if its BSDF is the same everywhere.
    pub ambient: Option<Vec3>,
    /// Its emission.
    pub emission: Vec3,
    /// Whether both of its sides emit.
    pub is_two_sided: bool,
}

impl PlainMaterial {
    /// `None` if anything bends the material's normals, its emission is not the same everywhere, light may pass it straight on, or
    /// rows are not filled with the BSDF.
    pub(super) fn of(material: &Material) -> Option<Self> {
        let Material { bsdf, emission, relief, opacity } = material;
        let is_even = emission.texture.is_none() && emission.coat.is_none();
        let rough = rough_of(bsdf).filter(|rough| rough.fills_rows())?;
        (is_even && relief.is_none() && opacity.is_none()).then(|| Self {
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
        Bsdf::Mirror(_) | Bsdf::Glass(_) | Bsdf::Pane(_) | Bsdf::Coated(_) => None,
    }
}

impl PlainMaterial {
    /// Whether it emits.
    #[inline(always)]
    pub fn shines(&self) -> bool {
        self.emission != Vec3::ZERO
    }
}

impl World {
    /// A plain material, with its rough BSDF. `None` if the material is not plain.
    #[inline(always)]
    pub fn plain(&self, material: usize) -> Option<(&PlainMaterial, &Rough)> {
        let plain = self.plain[material].as_ref()?;
        Some((plain, rough_of(&self.materials[material].bsdf)?))
    }
}
