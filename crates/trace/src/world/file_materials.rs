//! Converts the materials of mesh files into renderable materials.

use std::sync::Arc;

use super::Images;
use super::lower::{PlasticCoat, add_coat_to_lobes, lower_plastic};
use super::lower_texture::lower_mesh_file_texture;
use super::textures::{FILE_NUMBER, color_or_cutout_interpretation, opacity_pixel_interpretation};
use crate::assets::{FileMaterial, FileMaterialKind, FileTexture, PhysicalMaterial};
use crate::materials::microfacet::MicrofacetDistribution;
use crate::materials::texture::{ColorOrTexture, ValueScaleAndOffset};
use crate::materials::{
    Bsdf, Coat, CoatTexturedParameters, Conductor, ConductorFresnel, Dielectric, Emission, Material, Mirror,
    NonSpecular, NormalMap, NormalPerturbation, Opacity, Phong, Principled, PrincipledInputs,
    ReflectingSides, ScalarParameter,
};
use crate::math::{DVec3, Vec3};
use crate::scene::description::PixelInterpretation;

/// Index of refraction and transmittance per unit length of a mesh file's glass, or `None` for other
/// materials.
pub fn file_material_glass_properties(own: &FileMaterial) -> Option<(f32, DVec3)> {
    own.is_glass().then(|| (own.ior.clamp(1.0, FileMaterial::MAX_IOR), DVec3::ONE))
}

/// Emission of a mesh file's material, which is one-sided.
pub fn file_material_emission(images: &Images, own: &FileMaterial) -> Emission {
    if !own.emits() {
        return Emission::NONE;
    }
    let coat = own.physical.as_ref().and_then(|own| file_material_coat(images, own)).map(Arc::new);
    let constant = Emission { coat, ..Emission::from_constant(own.emission) };
    match &own.emission_texture {
        None => constant,
        // If the emission map could not be read, emit nothing rather than from the whole surface.
        Some(texture) => {
            match lower_mesh_file_texture(images, texture, color_or_cutout_interpretation(own, texture)) {
                None => Emission::NONE,
                texture => Emission { texture, ..constant },
            }
        }
    }
}

/// Opacity of a mesh file's material, or `None` if it is fully opaque or glass.
pub fn file_material_opacity(images: &Images, own: &FileMaterial) -> Option<Opacity> {
    if own.is_glass() {
        return None;
    }
    let texture = own.opacity_texture.as_ref();
    let value = match texture.and_then(|texture| {
        lower_mesh_file_texture(images, texture, opacity_pixel_interpretation(own, texture))
    }) {
        Some(texture) => ScalarParameter::Texture(texture),
        None if own.opacity < 1.0 => ScalarParameter::Constant(own.opacity),
        None => return None,
    };
    Some(Opacity { value, cutoff: 0.0 })
}

/// Converts a material from a mesh file. A highlight of strength k becomes ks = 2k/(α + 2).
pub fn lower_file_material(images: &Images, own: &FileMaterial) -> Material {
    let bsdf = match (own.kind(), file_material_glass_properties(own)) {
        (FileMaterialKind::Mirror, _) => {
            Bsdf::Mirror(Mirror::Constant(ColorOrTexture::Constant(own.specular.min(Vec3::ONE))))
        }
        (FileMaterialKind::Coated, _) => file_material_mirror_over_diffuse(images, own),
        (FileMaterialKind::Glass, Some((ior, tint))) => {
            let roughness = own.physical.as_ref().map_or(0.0, |physical| physical.roughness);
            let roughness = ScalarParameter::Constant(roughness);
            Bsdf::Dielectric(
                Dielectric::new(ior, tint).with_roughness(roughness, MicrofacetDistribution::Ggx),
            )
        }
        (FileMaterialKind::Principled(physical), _) => {
            return non_specular_file_material(images, own, file_material_principled(images, own, physical));
        }
        (FileMaterialKind::Phong | FileMaterialKind::Glass, _) => {
            return non_specular_file_material(images, own, file_material_phong(images, own));
        }
    };
    Material {
        bsdf,
        sides: ReflectingSides::Both,
        emission: Emission::NONE,
        normal_perturbation: None,
        opacity: file_material_opacity(images, own),
    }
}

/// Non-specular material from a mesh file, including its emission and normal map.
fn non_specular_file_material(images: &Images, own: &FileMaterial, rough: NonSpecular) -> Material {
    let normals = own.normal_texture.as_ref().and_then(|texture| {
        let texture = lower_mesh_file_texture(images, texture, PixelInterpretation::Normal)?;
        Some(NormalMap { texture, strength: own.normal_strength })
    });
    // Gray images are height maps. Ignore them because the file does not specify the scale.
    let is_gray = |map: &NormalMap| map.texture.as_image().is_some_and(|image| image.texels.are_all_gray());
    let normals = normals.filter(|map| !is_gray(map));
    Material {
        bsdf: Bsdf::NonSpecular(rough),
        sides: ReflectingSides::Both,
        emission: file_material_emission(images, own),
        normal_perturbation: NormalPerturbation::new(normals, None),
        opacity: file_material_opacity(images, own),
    }
}

fn file_material_color_parameter(
    images: &Images,
    own: &FileMaterial,
    texture: Option<&FileTexture>,
    constant: Vec3,
) -> ColorOrTexture {
    let texture = texture.and_then(|texture| {
        lower_mesh_file_texture(images, texture, color_or_cutout_interpretation(own, texture))
    });
    texture.map_or(ColorOrTexture::Constant(constant), ColorOrTexture::Texture)
}

/// A mirror over a diffuse color, represented as a coat that reflects the fraction `Ks` of light at normal
/// incidence.
fn file_material_mirror_over_diffuse(images: &Images, own: &FileMaterial) -> Bsdf {
    let specular = own.specular.min(Vec3::ONE);
    let root = specular.max_element().min(FileMaterial::MAX_COAT).sqrt();
    let diffuse =
        file_material_color_parameter(images, own, own.diffuse_texture.as_ref(), own.diffuse.min(Vec3::ONE));
    let tint = ColorOrTexture::Constant(specular / specular.max_element());
    let (roughness, ior) = (ScalarParameter::Constant(0.0), (1.0 + root) / (1.0 - root));
    let coat = PlasticCoat { ior, distribution: MicrofacetDistribution::Ggx, is_base_linear: false };
    lower_plastic(diffuse, tint, roughness, coat)
}

fn file_material_phong(images: &Images, own: &FileMaterial) -> NonSpecular {
    let scale = 2.0 / (own.shininess + 2.0);
    let specular = match own.allows_specular_highlight() {
        true => match file_material_color_parameter(images, own, own.specular_texture.as_ref(), own.specular)
        {
            ColorOrTexture::Constant(specular) => ColorOrTexture::Constant(specular * scale),
            ColorOrTexture::Texture(texture) => {
                let scaled = |factor: Option<ValueScaleAndOffset>| {
                    Some(factor.unwrap_or(ValueScaleAndOffset::IDENTITY).scaled_by(scale))
                };
                ColorOrTexture::Texture(Arc::new(Arc::unwrap_or_clone(texture).map_image_factor(scaled)))
            }
        },
        false => ColorOrTexture::Constant(Vec3::ZERO),
    };
    NonSpecular::Phong(Phong {
        diffuse: file_material_color_parameter(images, own, own.diffuse_texture.as_ref(), own.diffuse),
        specular,
        shininess: own.shininess,
        ambient: None,
    })
}

/// Number from a mesh file, with the value to use if there is no texture.
fn file_material_number_parameter(
    images: &Images,
    texture: Option<&FileTexture>,
    constant: f32,
) -> ScalarParameter {
    let texture = texture.and_then(|texture| lower_mesh_file_texture(images, texture, FILE_NUMBER));
    texture.map_or(ScalarParameter::Constant(constant), ScalarParameter::Texture)
}

/// Clear coat of a principled material from a mesh file.
fn file_material_coat(images: &Images, physical: &PhysicalMaterial) -> Option<Coat> {
    let PhysicalMaterial { clearcoat, clearcoat_roughness, .. } = *physical;
    let roughness = physical.clearcoat_roughness_texture.as_ref();
    Coat::new(CoatTexturedParameters {
        weight: file_material_number_parameter(images, physical.clearcoat_texture.as_ref(), clearcoat),
        roughness: file_material_number_parameter(images, roughness, clearcoat_roughness),
        ior: FileMaterial::DEFAULT_IOR,
        tint: ColorOrTexture::Constant(Vec3::ONE),
    })
}

/// Principled material from a mesh file. An index of refraction of 1 or less means "unspecified".
fn file_material_principled(images: &Images, own: &FileMaterial, physical: &PhysicalMaterial) -> NonSpecular {
    let base = file_material_principled_base(images, own, physical);
    match file_material_coat(images, physical) {
        Some(coat) => add_coat_to_lobes(coat, base),
        None => base,
    }
}

/// Principled material without its coat. An anisotropic metal is a brushed conductor instead.
fn file_material_principled_base(
    images: &Images,
    own: &FileMaterial,
    physical: &PhysicalMaterial,
) -> NonSpecular {
    let constant = own.diffuse.min(Vec3::ONE);
    let color = file_material_color_parameter(images, own, own.diffuse_texture.as_ref(), constant);
    let roughness =
        file_material_number_parameter(images, physical.roughness_texture.as_ref(), physical.roughness);
    if physical.anisotropy != 0.0 && roughness.as_untextured() != Some(0.0) {
        let (fresnel, anisotropy) =
            (ConductorFresnel::Schlick(color), ScalarParameter::Constant(physical.anisotropy));
        return NonSpecular::BrushedConductor(Conductor { fresnel, roughness, anisotropy });
    }
    NonSpecular::Principled(Box::new(Principled::new(PrincipledInputs {
        color,
        metallic: file_material_number_parameter(
            images,
            physical.metallic_texture.as_ref(),
            physical.metallic,
        ),
        roughness,
        ior: if own.ior > 1.0 { own.ior.min(FileMaterial::MAX_IOR) } else { FileMaterial::DEFAULT_IOR },
        specular: ScalarParameter::Constant(1.0),
        specular_color: ColorOrTexture::Constant(Vec3::ONE),
        transmission: ScalarParameter::Constant(0.0),
        diffuse_transmission: ColorOrTexture::Constant(physical.diffuse_transmission),
    })))
}

/// Material for triangles to which the mesh file does not assign a material.
pub fn fallback_material() -> Material {
    let phong = Phong {
        diffuse: ColorOrTexture::Constant(Vec3::splat(0.7)),
        specular: ColorOrTexture::Constant(Vec3::ZERO),
        shininess: 1.0,
        ambient: None,
    };
    Material {
        bsdf: Bsdf::NonSpecular(NonSpecular::Phong(phong)),
        sides: ReflectingSides::Both,
        emission: Emission::NONE,
        normal_perturbation: None,
        opacity: None,
    }
}
