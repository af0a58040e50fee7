//! Materials from mesh files.

use std::path::PathBuf;

use crate::materials::ChannelSelector;
use crate::math::{DVec2, Vec2, Vec3};

/// A material from an MTL file.
#[derive(Clone, Debug, PartialEq)]
pub struct FileMaterial {
    /// Material name in the file.
    pub name: String,
    /// Diffuse reflectance, `Kd`.
    pub diffuse: Vec3,
    /// Specular reflectance, `Ks`. Scales the unnormalized Phong lobe.
    pub specular: Vec3,
    /// Phong exponent, `Ns`.
    pub shininess: f32,
    /// Emitted radiance, `Ke`. Scales the emission texture, if any.
    pub emission: Vec3,
    /// Index of refraction, `Ni`.
    pub ior: f32,
    /// Illumination model, `illum`.
    pub illumination_model: Option<u8>,
    /// Opacity in [0, 1]: `d`, or 1 − `Tr`.
    pub opacity: f32,
    /// Opacity texture, `map_d`. Overrides `opacity`.
    pub opacity_texture: Option<FileTexture>,
    /// Diffuse texture, `map_Kd`.
    pub diffuse_texture: Option<FileTexture>,
    /// Specular texture, `map_Ks`.
    pub specular_texture: Option<FileTexture>,
    /// Emission texture, `map_Ke`.
    pub emission_texture: Option<FileTexture>,
    /// Normal map, `norm` or `map_Bump`.
    pub normal_texture: Option<FileTexture>,
    /// Scale factor for the normal map's slopes, ≥ 0. Set by the option `-bm`, 1 by default.
    pub normal_strength: f32,
    /// Parameters of the PBR extension, or `None` if the material has no PBR statements.
    pub physical: Option<PhysicalMaterial>,
}

impl FileMaterial {
    /// Maximum index of refraction.
    pub const MAX_IOR: f32 = 10.0;
    /// Maximum reflectance of a coat. A higher reflectance would require a larger index of refraction.
    pub const MAX_COAT: f32 = 0.66;
    /// Index of refraction for principled materials, unless the file specifies one above 1.
    pub const DEFAULT_IOR: f32 = 1.5;

    /// Whether the material has a specular highlight. Illumination models 0 and 1 have none. Materials with
    /// an exponent of 0 are also excluded: their highlight would cover the hemisphere at full strength.
    pub fn allows_specular_highlight(&self) -> bool {
        self.shininess > 0.0 && !matches!(self.illumination_model, Some(0 | 1))
    }

    /// Determines the kind of material. MTL illumination models 4, 6, 7 and 9 are glass, unless there is an
    /// opacity texture. Materials with PBR statements are principled. Of the rest, models 3, 5 and 8 with a
    /// specular color are either coated ([`Self::has_specular_coat`]) or mirrors. All others are Phong
    /// materials.
    pub fn kind(&self) -> FileMaterialKind<'_> {
        match (self.illumination_model, &self.physical) {
            (Some(4 | 6 | 7 | 9), _) if self.opacity_texture.is_none() => FileMaterialKind::Glass,
            (_, Some(physical)) => FileMaterialKind::Principled(physical),
            (Some(3 | 5 | 8), None) if self.specular.max_element() > 0.0 => match self.has_specular_coat() {
                true => FileMaterialKind::Coated,
                false => FileMaterialKind::Mirror,
            },
            (_, None) => FileMaterialKind::Phong,
        }
    }

    /// Whether the material is glass.
    pub fn is_glass(&self) -> bool {
        matches!(self.kind(), FileMaterialKind::Glass)
    }

    /// Whether the material emits light.
    pub fn emits(&self) -> bool {
        match self.kind() {
            FileMaterialKind::Phong | FileMaterialKind::Principled(_) => self.emission != Vec3::ZERO,
            FileMaterialKind::Mirror | FileMaterialKind::Coated | FileMaterialKind::Glass => false,
        }
    }

    /// Whether any texture affects the material.
    pub fn has_textures(&self) -> bool {
        let textures = [
            &self.opacity_texture,
            &self.diffuse_texture,
            &self.specular_texture,
            &self.emission_texture,
            &self.normal_texture,
        ];
        let physical = self.physical.iter().flat_map(PhysicalMaterial::textures);
        textures.into_iter().chain(physical).any(Option::is_some)
    }

    /// Removes the textures that do not affect this kind of material.
    pub(super) fn drop_unused_textures(&mut self) {
        let (keeps_diffuse, keeps_specular, keeps_surface) = match self.kind() {
            FileMaterialKind::Phong => (true, self.allows_specular_highlight(), true),
            FileMaterialKind::Principled(_) => (true, false, true),
            FileMaterialKind::Coated => (true, false, false),
            FileMaterialKind::Mirror | FileMaterialKind::Glass => (false, false, false),
        };
        let keep =
            |texture: &mut Option<FileTexture>, is_kept: bool| *texture = texture.take().filter(|_| is_kept);
        keep(&mut self.diffuse_texture, keeps_diffuse);
        keep(&mut self.specular_texture, keeps_specular);
        keep(&mut self.emission_texture, keeps_surface);
        keep(&mut self.normal_texture, keeps_surface);
        if let Some(own) = &mut self.physical {
            keep(&mut own.roughness_texture, keeps_surface);
            keep(&mut own.metallic_texture, keeps_surface);
            keep(&mut own.clearcoat_texture, keeps_surface);
            keep(&mut own.clearcoat_roughness_texture, keeps_surface);
        }
    }

    /// Whether the specular reflection is a coat: there is a diffuse texture, or the diffuse color is
    /// stronger than the specular color.
    pub fn has_specular_coat(&self) -> bool {
        self.diffuse_texture.is_some() || self.diffuse.max_element() > self.specular.max_element()
    }
}

/// Kind of material in a mesh file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FileMaterialKind<'a> {
    /// Diffuse and glossy.
    Phong,
    /// The PBR extension.
    Principled(&'a PhysicalMaterial),
    /// A smooth coat over a diffuse color.
    Coated,
    /// A mirror.
    Mirror,
    /// Solid glass.
    Glass,
}

/// A line in a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FileLine {
    /// The file.
    pub path: PathBuf,
    /// Line number, starting at 1.
    pub line: usize,
}

impl std::fmt::Display for FileLine {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}:{}", self.path.display(), self.line)
    }
}

/// A texture with map options in an MTL material.
#[derive(Clone, Debug, PartialEq)]
pub struct FileTexture {
    /// Image file, relative to the MTL file's folder.
    pub path: PathBuf,
    /// Scale of the texture coordinates, `-s`.
    pub repeat: Vec2,
    /// Offset added to the scaled texture coordinates, `-o`.
    pub offset: DVec2,
    /// Whether coordinates outside [0, 1] are clamped, `-clamp on`.
    pub is_clamped: bool,
    /// Offset and scale applied to the values, `-mm`.
    pub range: (f32, f32),
    /// Channel to read as a scalar, `-imfchan`.
    pub number: Option<ChannelSelector>,
    /// The MTL statement.
    pub statement: FileLine,
}

impl FileTexture {
    /// A texture without options.
    pub fn new(path: PathBuf, statement: FileLine) -> Self {
        Self {
            path,
            repeat: Vec2::ONE,
            offset: DVec2::ZERO,
            is_clamped: false,
            range: (0.0, 1.0),
            number: None,
            statement,
        }
    }

    /// Whether both textures show the same image at the same texture coordinates.
    pub fn has_same_image_and_mapping(&self, other: &Self) -> bool {
        let at = |texture: &Self| (texture.repeat, texture.offset, texture.is_clamped);
        self.path == other.path && at(self) == at(other)
    }
}

/// Parameters of MTL's PBR extension, and of glTF materials.
#[derive(Clone, Debug, PartialEq)]
pub struct PhysicalMaterial {
    /// Roughness in [0, 1], `Pr`.
    pub roughness: f32,
    /// Metallic weight in [0, 1], `Pm`.
    pub metallic: f32,
    /// Stretch of the highlight along u in [−1, 1], `aniso`. 0 unless the surface is a metal.
    pub anisotropy: f32,
    /// Diffuse transmittance, from glTF.
    pub diffuse_transmission: Vec3,
    /// Clear coat weight in [0, 1], `Pc`.
    pub clearcoat: f32,
    /// Clear coat roughness in [0, 1], `Pcr`.
    pub clearcoat_roughness: f32,
    /// Roughness texture, `map_Pr`.
    pub roughness_texture: Option<FileTexture>,
    /// Metallic texture, `map_Pm`.
    pub metallic_texture: Option<FileTexture>,
    /// Clear coat weight texture, `map_Pc`.
    pub clearcoat_texture: Option<FileTexture>,
    /// Clear coat roughness texture, `map_Pcr`.
    pub clearcoat_roughness_texture: Option<FileTexture>,
}

impl Default for PhysicalMaterial {
    fn default() -> Self {
        Self {
            roughness: 0.5,
            metallic: 0.0,
            anisotropy: 0.0,
            diffuse_transmission: Vec3::ZERO,
            clearcoat: 0.0,
            clearcoat_roughness: 0.0,
            roughness_texture: None,
            metallic_texture: None,
            clearcoat_texture: None,
            clearcoat_roughness_texture: None,
        }
    }
}

impl PhysicalMaterial {
    /// The textures, all of which are numbers.
    pub fn textures(&self) -> [&Option<FileTexture>; 4] {
        [
            &self.roughness_texture,
            &self.metallic_texture,
            &self.clearcoat_texture,
            &self.clearcoat_roughness_texture,
        ]
    }

    /// Whether the surface is a metal everywhere.
    pub fn is_metal(&self) -> bool {
        self.metallic == 1.0 && self.metallic_texture.is_none()
    }

    /// Whether there is a clear coat.
    pub fn has_clearcoat(&self) -> bool {
        self.clearcoat > 0.0 || self.clearcoat_texture.is_some()
    }
}
