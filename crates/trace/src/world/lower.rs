//! Converts the materials of scene files into renderable materials. `file_materials` converts those of mesh
//! files.

use std::sync::Arc;

use super::Images;
use super::lower_texture::lower_texture;
use super::textures::{HashableAlphaCutoff, cutoff_for_mip_coverage};
use crate::materials::microfacet::MicrofacetDistribution;
use crate::materials::texture::{ColorOrTexture, Texture};
use crate::materials::{
    Blend, Bsdf, Bump, Coat, CoatTexturedParameters, CoatedMaterial, Conductor, ConductorFresnel, Dielectric,
    Emission, Material, Mirror, NonSpecular, NormalMap, NormalPerturbation, Opacity, Phong, Plastic,
    Principled, PrincipledInputs, ScalarParameter, SpecularLayer, SpecularOverBase, ThinDielectric,
    TranslucentPhong,
};
use crate::math::Vec3;
use crate::scene::description::{
    self, ChannelSelector, CoatSource, ColorSource, ConductorFresnelSource, MaterialKind, NumberSource,
    PhongParameters, Scene, TextureRole,
};

/// Converts a material from the scene file.
pub fn lower_material(scene: &Scene, images: &Images, material: &description::Material) -> Material {
    let of = MaterialParameterConverter { scene, images, material };
    let color = |source: &ColorSource| of.lower_color(source);
    let number = |source: &NumberSource| of.lower_number(source, TextureRole::Roughness);
    let bsdf = match &material.kind {
        MaterialKind::Phong(parameters) => Bsdf::NonSpecular(lower_phong(parameters, color)),
        MaterialKind::Mirror { reflectance } => Bsdf::Mirror(Mirror::Constant(color(reflectance))),
        MaterialKind::Metal { fresnel, roughness, anisotropy, distribution } => {
            lower_metal(lower_fresnel(fresnel, color), number(roughness), number(anisotropy), *distribution)
        }
        MaterialKind::Plastic { diffuse, specular, ior, roughness, distribution, nonlinear } => {
            let coat = PlasticCoat { ior: *ior, distribution: *distribution, is_base_linear: !nonlinear };
            lower_plastic(color(diffuse), color(specular), number(roughness), coat)
        }
        MaterialKind::Principled {
            color: base,
            metallic,
            roughness,
            ior,
            specular,
            specular_color,
            transmission,
            diffuse_transmission,
        } => Bsdf::NonSpecular(NonSpecular::Principled(Box::new(Principled::new(PrincipledInputs {
            color: color(base),
            metallic: number(metallic),
            roughness: number(roughness),
            ior: *ior,
            specular: number(specular),
            specular_color: color(specular_color),
            transmission: number(transmission),
            diffuse_transmission: color(diffuse_transmission),
        })))),
        MaterialKind::Glass { ior, tint, roughness, distribution } => {
            Bsdf::Dielectric(Dielectric::new(*ior, *tint).with_roughness(number(roughness), *distribution))
        }
        MaterialKind::Pane { ior, tint } => {
            Bsdf::ThinDielectric(ThinDielectric { ior: *ior, tint: color(tint) })
        }
        MaterialKind::Blend { weight, parts } => Bsdf::Blend(Box::new(Blend {
            weight: lower_blend_weight(scene, images, material, weight),
            parts: parts.each_ref().map(|part| lower_material(scene, images, part)),
        })),
    };
    let coat = of.lower_coat(&material.coat, TextureRole::Roughness);
    let bsdf = match coat {
        Some(coat) => add_coat_to_bsdf(coat, bsdf),
        None => bsdf,
    };
    let emission = lower_emission(scene, images, material);
    let normal_map = material.normal_map.map(|map| NormalMap {
        texture: of.lower_texture(map.texture, TextureRole::NormalMap),
        strength: map.strength,
    });
    let bump = material.bump.map(|bump| Bump {
        texture: of.lower_texture(bump.texture, TextureRole::Bump(bump.height_channel_selector())),
        scale: bump.scale,
    });
    let normal_perturbation = NormalPerturbation::new(normal_map, bump);
    let opacity = lower_opacity(scene, images, material);
    Material { bsdf, sides: material.sides, emission, normal_perturbation, opacity }
}

/// Opacity of a material from the scene file, or `None` if it is fully opaque.
pub fn lower_opacity(scene: &Scene, images: &Images, material: &description::Material) -> Option<Opacity> {
    let source = &material.opacity;
    if source.is_opaque() {
        return None;
    }
    let (value, cutoff) = match source.texture_index_and_channel() {
        None => (ScalarParameter::Constant(source.value.as_constant()?), source.cutoff),
        Some((index, number)) => {
            let of = MaterialParameterConverter { scene, images, material };
            let texture = of.lower_texture(index, TextureRole::Opacity(number));
            // If mip levels preserve coverage, the cutoff already includes the factor.
            let coverage = cutoff_for_mip_coverage(scene, index, source.cutoff);
            let texture = Arc::unwrap_or_clone(texture);
            let texture = Arc::new(texture.map_image_factor(|factor| factor.filter(|_| coverage.is_none())));
            (ScalarParameter::Texture(texture), coverage.map_or(source.cutoff, HashableAlphaCutoff::value))
        }
    };
    Some(Opacity { value, cutoff })
}

fn lower_phong(parameters: &PhongParameters, color: impl Fn(&ColorSource) -> ColorOrTexture) -> NonSpecular {
    let PhongParameters { diffuse, specular, shininess, ambient, diffuse_transmission } = parameters;
    let reflection = Phong {
        diffuse: color(diffuse),
        specular: color(specular),
        shininess: *shininess,
        ambient: ambient.as_ref().map(&color),
    };
    if *diffuse_transmission == ColorSource::BLACK {
        return NonSpecular::Phong(reflection);
    }
    NonSpecular::TranslucentPhong(TranslucentPhong { reflection, transmission: color(diffuse_transmission) })
}

/// BSDF of a metal: a mirror if its roughness is 0, and otherwise a microfacet conductor.
fn lower_metal(
    fresnel: ConductorFresnel,
    roughness: ScalarParameter,
    anisotropy: ScalarParameter,
    distribution: MicrofacetDistribution,
) -> Bsdf {
    if roughness.as_untextured() == Some(0.0) {
        return Bsdf::Mirror(Mirror::Conductor(fresnel));
    }
    let is_brushed = anisotropy.as_untextured() != Some(0.0);
    let metal = Conductor { fresnel, roughness, anisotropy };
    Bsdf::NonSpecular(match distribution {
        MicrofacetDistribution::Ggx if is_brushed => NonSpecular::BrushedConductor(metal),
        MicrofacetDistribution::Ggx => NonSpecular::Conductor(metal),
        MicrofacetDistribution::Beckmann => NonSpecular::BeckmannConductor(metal),
    })
}

/// Constants of plastic.
#[derive(Clone, Copy, Debug)]
pub(super) struct PlasticCoat {
    /// Index of refraction of the coat.
    pub(super) ior: f32,
    /// Distribution of the coat's facets.
    pub(super) distribution: MicrofacetDistribution,
    /// Whether the base's reflectance is proportional to its color.
    pub(super) is_base_linear: bool,
}

/// Converts plastic. With roughness 0, the coat becomes a δ lobe over the diffuse base.
pub(super) fn lower_plastic(
    diffuse: ColorOrTexture,
    specular: ColorOrTexture,
    roughness: ScalarParameter,
    PlasticCoat { ior, distribution, is_base_linear }: PlasticCoat,
) -> Bsdf {
    let is_smooth = roughness.as_untextured() == Some(0.0);
    let base = Plastic::new(diffuse, specular.clone(), roughness, ior, distribution);
    let base = if is_base_linear { base.with_linear_base() } else { base };
    if is_smooth {
        let specular = SpecularLayer::SmoothCoat { tint: specular, ior };
        return Bsdf::SpecularOverBase(SpecularOverBase {
            specular,
            coat: None,
            base: NonSpecular::Plastic(base),
        });
    }
    Bsdf::NonSpecular(match distribution {
        MicrofacetDistribution::Ggx => NonSpecular::Plastic(base),
        MicrofacetDistribution::Beckmann => NonSpecular::BeckmannPlastic(base),
    })
}

/// Weight of the second part of a blend.
pub fn lower_blend_weight(
    scene: &Scene,
    images: &Images,
    material: &description::Material,
    weight: &NumberSource,
) -> ScalarParameter {
    MaterialParameterConverter { scene, images, material }.lower_number(weight, TextureRole::BlendWeight)
}

/// Adds a clear coat to a BSDF. Glass, panes and blends are returned unchanged.
fn add_coat_to_bsdf(coat: Coat, bsdf: Bsdf) -> Bsdf {
    match bsdf {
        Bsdf::NonSpecular(base) => Bsdf::NonSpecular(add_coat_to_lobes(coat, base)),
        Bsdf::SpecularOverBase(SpecularOverBase { specular, coat: _, base }) => {
            Bsdf::SpecularOverBase(SpecularOverBase {
                specular,
                base: add_coat_to_lobes(coat.clone(), base),
                coat: Some(coat),
            })
        }
        Bsdf::Mirror(mirror) => {
            let black = ColorOrTexture::Constant(Vec3::ZERO);
            let none = Phong { diffuse: black.clone(), specular: black, shininess: 1.0, ambient: None };
            let base = add_coat_to_lobes(coat.clone(), NonSpecular::Phong(none));
            Bsdf::SpecularOverBase(SpecularOverBase {
                specular: SpecularLayer::Mirror(mirror),
                coat: Some(coat),
                base,
            })
        }
        Bsdf::Dielectric(_) | Bsdf::ThinDielectric(_) | Bsdf::Blend(_) => bsdf,
    }
}

/// Adds a clear coat to non-specular lobes. Lobes that already have one are returned unchanged.
pub(super) fn add_coat_to_lobes(coat: Coat, base: NonSpecular) -> NonSpecular {
    match base {
        NonSpecular::Phong(base) => NonSpecular::CoatedPhong(Box::new(CoatedMaterial { coat, base })),
        NonSpecular::TranslucentPhong(base) => {
            NonSpecular::CoatedTranslucent(Box::new(CoatedMaterial { coat, base }))
        }
        NonSpecular::BeckmannConductor(base) => {
            NonSpecular::CoatedBeckmannConductor(Box::new(CoatedMaterial { coat, base }))
        }
        NonSpecular::BeckmannPlastic(base) => {
            NonSpecular::CoatedBeckmannPlastic(Box::new(CoatedMaterial { coat, base }))
        }
        NonSpecular::Conductor(base) | NonSpecular::BrushedConductor(base) => {
            NonSpecular::CoatedConductor(Box::new(CoatedMaterial { coat, base }))
        }
        NonSpecular::Plastic(base) => NonSpecular::CoatedPlastic(Box::new(CoatedMaterial { coat, base })),
        NonSpecular::Principled(base) => {
            NonSpecular::CoatedPrincipled(Box::new(CoatedMaterial { coat, base: *base }))
        }
        NonSpecular::CoatedPhong(_)
        | NonSpecular::CoatedTranslucent(_)
        | NonSpecular::CoatedConductor(_)
        | NonSpecular::CoatedBeckmannConductor(_)
        | NonSpecular::CoatedPlastic(_)
        | NonSpecular::CoatedBeckmannPlastic(_)
        | NonSpecular::CoatedPrincipled(_) => base,
    }
}

fn lower_fresnel(
    source: &ConductorFresnelSource,
    color: impl Fn(&ColorSource) -> ColorOrTexture,
) -> ConductorFresnel {
    match source {
        ConductorFresnelSource::Schlick(reflectance) => ConductorFresnel::Schlick(color(reflectance)),
        ConductorFresnelSource::Index { eta, k } => ConductorFresnel::Index { eta: color(eta), k: color(k) },
    }
}

/// Emission of a material from the scene file.
pub fn lower_emission(scene: &Scene, images: &Images, material: &description::Material) -> Emission {
    let (emission, of) = (&material.emission, MaterialParameterConverter { scene, images, material });
    let coat = material.emitter_coat().and_then(|coat| of.lower_coat(coat, TextureRole::EmissionCoat));
    let texture = emission.texture.map(|index| of.lower_texture(index, TextureRole::Emission));
    Emission { scale: emission.scale, texture, sides: emission.sides, coat: coat.map(Arc::new) }
}

/// Converts the colors, numbers and textures of a material from the scene file.
#[derive(Clone, Copy)]
struct MaterialParameterConverter<'a> {
    scene: &'a Scene,
    images: &'a Images,
    material: &'a description::Material,
}

impl MaterialParameterConverter<'_> {
    fn lower_color(self, source: &ColorSource) -> ColorOrTexture {
        match source {
            ColorSource::Constant(color) => ColorOrTexture::Constant(*color),
            // The choice of color role does not matter because all of them use textures in the same way.
            ColorSource::Texture(index) => {
                ColorOrTexture::Texture(self.lower_texture(*index, TextureRole::Facets))
            }
        }
    }

    /// Converts a coat. Returns `None` if its weight is 0. `role` is the role of its textured numbers.
    fn lower_coat(self, source: &CoatSource, role: fn(ChannelSelector) -> TextureRole) -> Option<Coat> {
        let CoatSource { weight, roughness, ior, tint } = source;
        source
            .exists()
            .then(|| CoatTexturedParameters {
                weight: self.lower_number(weight, role),
                roughness: self.lower_number(roughness, role),
                ior: *ior,
                tint: self.lower_color(tint),
            })
            .and_then(Coat::new)
    }

    /// Converts a number to a scalar parameter, which uses the texture's luminance if the scene does not
    /// specify a channel.
    fn lower_number(
        self,
        source: &NumberSource,
        role: fn(ChannelSelector) -> TextureRole,
    ) -> ScalarParameter {
        match (source.as_constant(), source.texture_index_and_channel(ChannelSelector::Luminance)) {
            (Some(number), _) => ScalarParameter::Constant(number),
            (None, Some((texture, number))) => {
                ScalarParameter::Texture(self.lower_texture(texture, role(number)))
            }
            (None, None) => ScalarParameter::Constant(1.0),
        }
    }

    fn lower_texture(self, index: usize, role: TextureRole) -> Arc<Texture> {
        Arc::new(lower_texture(self.scene, self.images, self.material, (index, role)))
    }
}
