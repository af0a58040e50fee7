//! The table of non-specular BSDFs, and enums over all of them for materials, points, and packets.

pub mod coated;
pub mod conductor;
#[cfg(test)]
mod lane_tests;
#[cfg(test)]
mod lobe_tests;
pub mod phong;
pub mod plastic;
pub mod principled;
#[cfg(test)]
mod reference_tests;
pub mod rough_dielectric;
#[cfg(test)]
mod test_packet;
pub mod translucent;
mod transmission;

pub use coated::CoatedMaterial;
pub use conductor::{Conductor, ConductorFresnel};
pub use phong::Phong;
pub use plastic::Plastic;
pub use principled::{Principled, PrincipledInputs};
pub use rough_dielectric::RoughDielectricPoint;
pub use translucent::TranslucentPhong;

use std::sync::Arc;

use crate::materials::bsdf::{
    BsdfValuePacket, BxdfParameters, LobesToSample, NarrowLobe, ShownLobes, SpatiallyVaryingBxdf, UvPacket,
};
use crate::materials::bxdf::{Bxdf, ShadingGeometry, lobe_shading_normal};
use crate::materials::bxdf_packet::BxdfPacket;
use crate::materials::footprint::TexturePoint;
use crate::materials::lookup::{MaterialTextureCollector, PointTextureEvaluator, WhiteTextureLookup};
use crate::materials::texture::{ColorOrTexture, Texture};
use crate::math::Vec3;
use crate::math::lanes::{F32x16, Mask, Simd, Vec3x16};
use coated::CoatedBxdf;
use conductor::ConductorBxdf;
use phong::PhongBxdf;
use plastic::PlasticBxdf;
use principled::PrincipledBxdf;
use rough_dielectric::DielectricBxdf;
use translucent::TranslucentBxdf;

/// Generates enums over all kinds. Their methods dispatch to the trait methods of the same name. `materials`
/// lists kinds that are entire materials. `parts` lists kinds that other materials use for part of their
/// light. `kept` is the type in which a [`BsdfPacket`] stores a packet. The most common kind is stored
/// inline. Others are boxed to keep packets small in scenes without them.
macro_rules! kinds {
    (
        materials { $($(#[$doc:meta])* $kind:ident($material:ty, $bxdf:ty, kept: $kept:ty)),+ $(,)? }
        parts { $($(#[$part_doc:meta])* $part:ident($part_bxdf:ty)),+ $(,)? }
    ) => {
        /// The kind of a non-specular BSDF.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum BxdfKind { $($(#[$doc])* $kind,)+ $($(#[$part_doc])* $part),+ }

        impl BxdfKind {
            /// All kinds.
            pub const ALL: &[Self] = &[$(Self::$kind,)+ $(Self::$part),+];
        }

        /// A non-specular material of any kind.
        #[derive(Clone, Debug, PartialEq)]
        pub enum NonSpecular { $($(#[$doc])* $kind($material)),+ }

        /// A non-specular material of any kind at one point.
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub enum BxdfPoint {
            $($(#[$doc])* $kind(<$bxdf as Bxdf>::Point),)+
            $($(#[$part_doc])* $part(<$part_bxdf as Bxdf>::Point)),+
        }

        /// A packet of non-specular surfaces of one kind. Phong packets are stored inline because boxing them
        /// would slow down every scene.
        #[allow(clippy::large_enum_variant)]
        #[derive(Clone, Debug)]
        pub enum BsdfPacket { $($(#[$doc])* $kind($kept),)+ $($(#[$part_doc])* $part(Box<BxdfPacket<$part_bxdf>>)),+ }

        impl NonSpecular {
            /// The kind of the material.
            #[inline(always)]
            pub fn kind(&self) -> BxdfKind {
                match self { $(Self::$kind(_) => BxdfKind::$kind),+ }
            }

            /// Looks up the textures at a point. Counts texture lookups in `lookups`.
            #[inline(always)]
            pub fn evaluate_textures(&self, point: &TexturePoint, lookups: &mut u64) -> BxdfPoint {
                let lookup = &mut PointTextureEvaluator { point, lookups };
                match self { $(Self::$kind(material) => BxdfPoint::$kind(material.look_up_parameters(lookup))),+ }
            }

            /// The material with white textures.
            #[inline]
            pub fn with_white_textures(&self) -> BxdfPoint {
                match self { $(Self::$kind(material) => BxdfPoint::$kind(material.look_up_parameters(&mut WhiteTextureLookup))),+ }
            }

            /// The material's main color. Counts texture lookups in `lookups`.
            #[inline]
            pub fn main_color(&self, point: &TexturePoint, lookups: &mut u64) -> Vec3 {
                let lookup = &mut PointTextureEvaluator { point, lookups };
                match self { $(Self::$kind(material) => material.main_color(lookup)),+ }
            }

            /// Reflectance for ambient light. Counts texture lookups in `lookups`.
            #[inline]
            pub fn look_up_ambient(&self, point: &TexturePoint, lookups: &mut u64) -> Vec3 {
                let lookup = &mut PointTextureEvaluator { point, lookups };
                match self { $(Self::$kind(material) => material.look_up_ambient_reflectance(lookup)),+ }
            }

            /// Collects all textures by use.
            fn collect_textures(&self) -> MaterialTextureCollector<'_> {
                let mut textures = MaterialTextureCollector::default();
                match self { $(Self::$kind(material) => { material.look_up_parameters(&mut textures); }),+ }
                textures
            }

            /// [`SpatiallyVaryingBxdf::color_to_look_up`].
            #[inline]
            fn packet_color_parameter(&self) -> Option<&ColorOrTexture> {
                match self { $(Self::$kind(material) => material.color_to_look_up()),+ }
            }

            /// [`SpatiallyVaryingBxdf::is_anisotropic`].
            #[inline]
            pub fn is_anisotropic(&self) -> bool {
                match self { $(Self::$kind(material) => material.is_anisotropic()),+ }
            }

            /// [`SpatiallyVaryingBxdf::is_transmissive`].
            pub fn is_transmissive(&self) -> bool {
                match self { $(Self::$kind(material) => material.is_transmissive()),+ }
            }
        }

        impl BxdfPoint {
            /// The kind of the BSDF.
            #[inline(always)]
            pub fn kind(&self) -> BxdfKind {
                match self {
                    $(Self::$kind(_) => BxdfKind::$kind,)+
                    $(Self::$part(_) => BxdfKind::$part),+
                }
            }

            /// [`lobe_shading_normal`].
            #[inline(always)]
            pub fn lobe_shading_normal(&self, normal: Vec3, wo: Vec3) -> Vec3 {
                match self {
                    $(Self::$kind(_) => lobe_shading_normal::<$bxdf>(normal, wo),)+
                    $(Self::$part(_) => lobe_shading_normal::<$part_bxdf>(normal, wo)),+
                }
            }

            /// [`BxdfParameters::is_black`].
            #[inline(always)]
            pub fn is_black(&self) -> bool {
                match self {
                    $(Self::$kind(own) => own.is_black(),)+
                    $(Self::$part(own) => own.is_black()),+
                }
            }

            /// [`BxdfParameters::ambient_reflectance`].
            #[inline(always)]
            pub fn ambient_reflectance(&self) -> Vec3 {
                match self {
                    $(Self::$kind(own) => own.ambient_reflectance(),)+
                    $(Self::$part(own) => own.ambient_reflectance()),+
                }
            }

            /// [`BxdfParameters::tinted`].
            pub fn tinted(self, color: Vec3) -> Self {
                match self {
                    $(Self::$kind(own) => Self::$kind(own.tinted(color)),)+
                    $(Self::$part(own) => Self::$part(own.tinted(color))),+
                }
            }
        }

        impl BsdfPacket {
            /// The kind of all surfaces in the packet.
            #[inline(always)]
            pub fn kind(&self) -> BxdfKind {
                match self {
                    $(Self::$kind(_) => BxdfKind::$kind,)+
                    $(Self::$part(_) => BxdfKind::$part),+
                }
            }

            /// [`Bxdf::SENDS_RAYS`].
            #[inline(always)]
            pub fn extends_narrow_lobe_paths(&self) -> bool {
                match self {
                    $(Self::$kind(_) => <$bxdf as Bxdf>::SENDS_RAYS,)+
                    $(Self::$part(_) => <$part_bxdf as Bxdf>::SENDS_RAYS),+
                }
            }

            /// Changes the packet to a different kind. Its contents are then unspecified.
            #[inline(always)]
            pub fn set_kind(&mut self, kind: BxdfKind) {
                if self.kind() != kind {
                    *self = match kind {
                        $(BxdfKind::$kind => Self::$kind(<$kept>::default()),)+
                        $(BxdfKind::$part => Self::$part(Box::default())),+
                    };
                }
            }

            /// [`BxdfPacket::prepare_for_reuse`].
            #[inline(always)]
            pub fn prepare_for_reuse(&mut self) {
                match self {
                    $(Self::$kind(row) => row.prepare_for_reuse(),)+
                    $(Self::$part(row) => row.prepare_for_reuse()),+
                }
            }

            /// [`BxdfPacket::set_bsdf`] for a BSDF of the same kind as the packet.
            #[inline(always)]
            pub fn set_bsdf(
                &mut self,
                i: usize,
                bsdf: &BxdfPoint,
                shown: ShownLobes,
                directions: &ShadingGeometry,
            ) {
                match self {
                    $(Self::$kind(row) => {
                        if let BxdfPoint::$kind(bsdf) = bsdf {
                            row.set_bsdf_out_of_line(i, bsdf, shown, directions);
                        }
                    })+
                    $(Self::$part(row) => {
                        if let BxdfPoint::$part(bsdf) = bsdf {
                            row.set_bsdf_out_of_line(i, bsdf, shown, directions);
                        }
                    })+
                }
            }

            /// [`BxdfPacket::evaluate_material_into_lanes`] for a material of the same kind as the packet.
            #[inline(always)]
            pub fn evaluate_material_into_lanes(
                &mut self,
                material: &NonSpecular,
                uv: Option<&UvPacket>,
                shown: &[(u32, ShownLobes)],
                simd: impl Simd,
            ) -> u32 {
                let colors = material.texture_for_packets().zip(uv).map(|(texture, uv)| texture.lookup_packet(uv));
                match self {
                    $(Self::$kind(row) => {
                        let NonSpecular::$kind(material) = material else { return 0 };
                        let point = material.look_up_parameters(&mut WhiteTextureLookup);
                        row.evaluate_material_into_lanes_out_of_line(&point, colors.as_ref(), shown, simd)
                    })+
                    $(Self::$part(_) => 0),+
                }
            }

            /// [`BxdfPacket::set_normals_and_ray_directions`].
            #[inline(always)]
            pub fn set_normals_and_ray_directions(
                &mut self,
                of: Option<&Mask>,
                normals: &mut Vec3x16,
                directions: &Vec3x16,
                simd: impl Simd,
            ) {
                match self {
                    $(Self::$kind(row) => row.set_normals_and_directions_out_of_line(of, normals, directions, simd),)+
                    $(Self::$part(_) => {}),+
                }
            }

            /// [`BxdfPacket::copy_lane`] from a packet of the same kind.
            #[inline(always)]
            pub fn copy_lane(&mut self, i: usize, other: &Self, from: usize) {
                match self {
                    $(Self::$kind(row) => if let Self::$kind(other) = other { row.copy_lane(i, other, from) },)+
                    $(Self::$part(row) => if let Self::$part(other) = other { row.copy_lane(i, other, from) },)+
                }
            }

            /// [`BxdfPacket::f`].
            #[inline(always)]
            pub fn f(&self, wi: &Vec3x16, simd: impl Simd) -> BsdfValuePacket {
                match self {
                    $(Self::$kind(row) => row.f_out_of_line(wi, simd),)+
                    $(Self::$part(row) => row.f_out_of_line(wi, simd)),+
                }
            }

            /// [`BxdfPacket::pdf`].
            #[inline(always)]
            pub fn pdf(
                &self,
                lobes: LobesToSample,
                normals: &Vec3x16,
                wi: &Vec3x16,
                values: &BsdfValuePacket,
                simd: impl Simd,
            ) -> F32x16 {
                match self {
                    $(Self::$kind(row) => row.pdf_out_of_line(lobes, normals, wi, values, simd),)+
                    $(Self::$part(row) => row.pdf_out_of_line(lobes, normals, wi, values, simd)),+
                }
            }

            /// [`BxdfPacket::sample`].
            #[inline(always)]
            pub fn sample(
                &self,
                lobes: LobesToSample,
                normals: &Vec3x16,
                choices: &F32x16,
                u: &[F32x16; 2],
                simd: impl Simd,
            ) -> Vec3x16 {
                match self {
                    $(Self::$kind(row) => row.sample_out_of_line(lobes, normals, choices, u, simd),)+
                    $(Self::$part(row) => row.sample_out_of_line(lobes, normals, choices, u, simd)),+
                }
            }

            /// [`BxdfPacket::any_has_narrow_lobe`].
            #[inline(always)]
            pub fn has_narrow_lobes(&self) -> bool {
                match self {
                    $(Self::$kind(row) => row.any_has_narrow_lobe(),)+
                    $(Self::$part(row) => row.any_has_narrow_lobe()),+
                }
            }

            /// [`BxdfPacket::uses_lobe_choices`].
            #[inline(always)]
            pub fn uses_lobe_choices(&self) -> bool {
                match self {
                    $(Self::$kind(row) => row.uses_lobe_choices(),)+
                    $(Self::$part(row) => row.uses_lobe_choices()),+
                }
            }

            /// [`BxdfPacket::any_has_wide_lobe`].
            #[inline(always)]
            pub fn has_wide_lobes(&self) -> bool {
                match self {
                    $(Self::$kind(row) => row.any_has_wide_lobe(),)+
                    $(Self::$part(row) => row.any_has_wide_lobe()),+
                }
            }

            /// [`BxdfPacket::narrow_lobe_mask`].
            #[inline(always)]
            pub fn narrow_lobe_mask(&self) -> u32 {
                match self {
                    $(Self::$kind(row) => row.narrow_lobe_mask(),)+
                    $(Self::$part(row) => row.narrow_lobe_mask()),+
                }
            }

            /// [`BxdfPacket::narrow_lobe_at_lane`].
            #[inline(always)]
            pub fn narrow_lobe_at_lane(&self, i: usize) -> Option<NarrowLobe> {
                match self {
                    $(Self::$kind(row) => row.narrow_lobe_at_lane(i),)+
                    $(Self::$part(row) => row.narrow_lobe_at_lane(i)),+
                }
            }

            /// [`BxdfPacket::mask_of_lanes_narrower_than`].
            #[inline(always)]
            pub fn mask_of_lanes_narrower_than(&self, of: u32, exponent: f32) -> u32 {
                match self {
                    $(Self::$kind(row) => row.mask_of_lanes_narrower_than(of, exponent),)+
                    $(Self::$part(row) => row.mask_of_lanes_narrower_than(of, exponent)),+
                }
            }

            /// [`BxdfPacket::constant_f`].
            #[inline(always)]
            pub fn constant_f(&self, i: usize) -> Option<Vec3> {
                match self {
                    $(Self::$kind(row) => row.constant_f(i),)+
                    $(Self::$part(row) => row.constant_f(i)),+
                }
            }

            /// [`BxdfPacket::lane_f_by_lobe_set`].
            #[inline(always)]
            pub fn lane_f_by_lobe_set(&self, i: usize, wi: Vec3) -> [Vec3; 3] {
                match self {
                    $(Self::$kind(row) => row.lane_f_by_lobe_set(i, wi),)+
                    $(Self::$part(row) => row.lane_f_by_lobe_set(i, wi)),+
                }
            }
        }
    };
}

kinds! {
    materials {
    /// The normalized Phong model.
    Phong(Phong, PhongBxdf, kept: BxdfPacket<PhongBxdf>),
    /// The Phong model with diffuse transmission.
    TranslucentPhong(TranslucentPhong, TranslucentBxdf<false>, kept: Box<BxdfPacket<TranslucentBxdf<false>>>),
    /// An isotropic microfacet conductor.
    Conductor(Conductor, ConductorBxdf<false, false>, kept: Box<BxdfPacket<ConductorBxdf<false, false>>>),
    /// A microfacet conductor whose lobe is stretched along u or v.
    BrushedConductor(Conductor, ConductorBxdf<true, false>, kept: Box<BxdfPacket<ConductorBxdf<true, false>>>),
    /// A conductor with the Beckmann distribution, whose lobe may be stretched along u or v.
    BeckmannConductor(Conductor, ConductorBxdf<true, true>, kept: Box<BxdfPacket<ConductorBxdf<true, true>>>),
    /// A diffuse base under a microfacet coat.
    Plastic(Plastic, PlasticBxdf<false>, kept: Box<BxdfPacket<PlasticBxdf<false>>>),
    /// Plastic whose coat has the Beckmann distribution.
    BeckmannPlastic(Plastic, PlasticBxdf<true>, kept: Box<BxdfPacket<PlasticBxdf<true>>>),
    /// A material with the parameters of glTF.
    Principled(Box<Principled>, PrincipledBxdf<false>, kept: Box<BxdfPacket<PrincipledBxdf<false>>>),
    /// Phong under a clear coat.
    CoatedPhong(Box<CoatedMaterial<Phong>>, CoatedBxdf<PhongBxdf>, kept: Box<BxdfPacket<CoatedBxdf<PhongBxdf>>>),
    /// Translucent Phong under a clear coat.
    CoatedTranslucent(Box<CoatedMaterial<TranslucentPhong>>, CoatedBxdf<TranslucentBxdf<false>>, kept: Box<BxdfPacket<CoatedBxdf<TranslucentBxdf<false>>>>),
    /// A conductor under a clear coat, brushed or not.
    CoatedConductor(Box<CoatedMaterial<Conductor>>, CoatedBxdf<ConductorBxdf<true, false>>, kept: Box<BxdfPacket<CoatedBxdf<ConductorBxdf<true, false>>>>),
    /// A conductor with the Beckmann distribution under a clear coat.
    CoatedBeckmannConductor(Box<CoatedMaterial<Conductor>>, CoatedBxdf<ConductorBxdf<true, true>>, kept: Box<BxdfPacket<CoatedBxdf<ConductorBxdf<true, true>>>>),
    /// Plastic under a clear coat.
    CoatedPlastic(Box<CoatedMaterial<Plastic>>, CoatedBxdf<PlasticBxdf<false>>, kept: Box<BxdfPacket<CoatedBxdf<PlasticBxdf<false>>>>),
    /// Plastic with the Beckmann distribution under a clear coat.
    CoatedBeckmannPlastic(Box<CoatedMaterial<Plastic>>, CoatedBxdf<PlasticBxdf<true>>, kept: Box<BxdfPacket<CoatedBxdf<PlasticBxdf<true>>>>),
    /// A material with the parameters of glTF under a clear coat.
    CoatedPrincipled(Box<CoatedMaterial<Principled>>, CoatedBxdf<PrincipledBxdf<false>>, kept: Box<BxdfPacket<CoatedBxdf<PrincipledBxdf<false>>>>),
    }
    parts {
    /// Transmission through a translucent Phong surface.
    PhongTransmission(TranslucentBxdf<true>),
    /// Reflection from rough glass.
    DielectricReflection(DielectricBxdf<false, false>),
    /// Transmission through rough glass.
    DielectricTransmission(DielectricBxdf<true, false>),
    /// Reflection from rough glass with the Beckmann distribution.
    BeckmannReflection(DielectricBxdf<false, true>),
    /// Transmission through rough glass with the Beckmann distribution.
    BeckmannTransmission(DielectricBxdf<true, true>),
    /// Transmission through a principled material.
    PrincipledTransmission(PrincipledBxdf<true>),
    /// Transmission through translucent Phong under a clear coat.
    CoatedPhongTransmission(CoatedBxdf<TranslucentBxdf<true>>),
    /// Transmission through a principled material under a clear coat.
    CoatedPrincipledTransmission(CoatedBxdf<PrincipledBxdf<true>>),
    }
}

impl NonSpecular {
    /// All textures.
    pub fn textures(&self) -> impl Iterator<Item = &Arc<Texture>> {
        let MaterialTextureCollector { scattering, ambient } = self.collect_textures();
        scattering.into_iter().chain(ambient)
    }

    /// The BSDF, if the material has no textures.
    pub fn as_untextured(&self) -> Option<BxdfPoint> {
        self.textures().next().is_none().then(|| self.with_white_textures())
    }

    /// Whether packets can be filled with the material by looking up at most one texture,
    /// [`NonSpecular::texture_for_packets`].
    pub fn supports_packets(&self) -> bool {
        let color = self.texture_for_packets();
        // Packets are lit from only one side.
        !self.is_anisotropic()
            && !self.is_transmissive()
            && color.is_none_or(Texture::supports_packets)
            && self.collect_textures().scattering.len() == usize::from(color.is_some())
    }

    /// The texture that packets look up, or `None` if there is no such texture.
    #[inline]
    pub fn texture_for_packets(&self) -> Option<&Texture> {
        self.packet_color_parameter()?.texture().map(|texture| &**texture)
    }
}

impl Default for BsdfPacket {
    fn default() -> Self {
        Self::Phong(BxdfPacket::default())
    }
}
