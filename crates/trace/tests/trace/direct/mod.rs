//! Next-event estimation and MIS at a single vertex, without a camera or a receiving surface.

mod estimators;
mod light_tree;
mod lights;
mod mis_weights;
mod occlusion;

use crate::control::CancelToken;
use crate::film::Rect;
use crate::geometry::Ray;
use crate::integrators::behavior::PathBehavior;
use crate::integrators::direct::all_lights::SampleAllLights;
use crate::integrators::direct::light_sums::LightSums;
use crate::integrators::direct::lobe_rays::LobeRayTracingKernel;
use crate::integrators::direct::mis::CompetingTechnique;
use crate::integrators::direct::shadow_rays::ShadowRayQueue;
use crate::integrators::transport::batch::{ALL, BatchVertex, VertexBatch};
use crate::integrators::transport::interiors::InteriorListPool;
use crate::integrators::transport::ray::PathRay;
use crate::integrators::transport::scatter::{BounceContinuationRules, BsdfSampler};
use crate::integrators::transport::tile::{SampleBlock, TileContext};
use crate::integrators::{LayerSet, PathAov, RenderSettings, ViewMode};
use crate::materials::bsdf::{LobesToSample, ShownLobes};
use crate::materials::bxdf::ShadingGeometry;
use crate::materials::microfacet::MicrofacetDistribution;
use crate::materials::{BxdfPoint, Footprint, RoughDielectricPoint};
use crate::math::lanes::PACKET_SIZE;
use crate::math::soa::Soa;
use crate::math::{DVec3, Vec3};
use crate::test_world::TestWorldBuilder;
use crate::world::World;
use lights::{ReferenceLight, emitter_shapes, reference_lights};

/// Normal of the vertices, which are at the origin.
pub const NORMAL: Vec3 = Vec3::Y;
/// Direction to the viewer.
pub const WO: Vec3 = Vec3::new(-0.6, 0.8, 0.0);

/// Materials with every kind of reflective BSDF.
pub const MATERIALS: [(&str, &str); 8] = [
    ("diffuse", "diffuse = 0.7"),
    ("phong", PHONG),
    ("metal", "type = 'metal'\ncolor = 0.8\nroughness = 0.6"),
    ("brushed metal", "type = 'metal'\ncolor = 0.8\nroughness = 0.6\nanisotropy = 0.7"),
    ("plastic", "type = 'plastic'\ndiffuse = 0.5\nroughness = 0.5"),
    (
        "principled",
        "type = 'principled'\ncolor = 0.6\nmetallic = 0.3\nroughness = 0.6\nclearcoat = 0.5\nclearcoat_roughness = 0.4",
    ),
    (
        "coated phong",
        "diffuse = 0.4\nspecular = 0.3\nshininess = 5\ncoat = 0.8\ncoat_roughness = 0.6\ncoat_tint = 0.7",
    ),
    ("rough glass", "type = 'glass'\nroughness = 0.7"),
];

/// The Phong material whose values [`lights::phong_f`] computes.
pub const PHONG: &str = "diffuse = 0.3\nspecular = 0.5\nshininess = 20";

/// Mean over the lanes of a packet, which have independent scrambles, and its standard error.
#[derive(Clone, Copy, Debug)]
pub struct Estimate {
    pub mean: f64,
    pub error: f64,
}

impl Estimate {
    pub fn over_lanes(lanes: &[f64; PACKET_SIZE]) -> Self {
        let n = PACKET_SIZE as f64;
        let mean = lanes.iter().sum::<f64>() / n;
        let variance = lanes.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / (n - 1.0);
        Self { mean, error: (variance / n).sqrt() }
    }

    /// Checks that the estimate is precise, and that it equals a value to within four standard errors.
    #[track_caller]
    pub fn assert_equals(self, what: &str, exact: f64, max_relative_error: f64) {
        self.assert_same(what, Self { mean: exact, error: 0.0 }, max_relative_error);
    }

    /// Checks that the difference to another estimate is precise, and that it is at most four standard
    /// errors.
    #[track_caller]
    pub fn assert_same(self, what: &str, other: Self, max_relative_error: f64) {
        let error = self.error.hypot(other.error);
        assert!(other.mean > 0.0, "{what}: {other:?}");
        assert!(error <= max_relative_error * other.mean, "{what}: too noisy: {self:?} and {other:?}");
        let allowed = (4.0 * error).max(1e-4 * other.mean);
        assert!((self.mean - other.mean).abs() <= allowed, "{what}: {self:?} instead of {other:?}");
    }
}

/// A scene that contains only lights and occluders, and the samples to take at vertices in it.
pub struct LitScene {
    pub world: World,
    settings: RenderSettings,
    block: SampleBlock,
    token: CancelToken,
    bsdf: BxdfPoint,
}

impl LitScene {
    /// Creates a scene with vertices of this material. `settings` are lines of the `[render]` table. Each
    /// lane takes `samples` samples.
    pub fn new(settings: &str, material: &str, light: &ReferenceLight, samples: u32) -> Self {
        let text = format!(
            "[render]\n{settings}\n[camera]\nposition = [0, 5, 9]\nlook_at = [0, 0, 0]\n\
             [materials.receiver]\n{material}\n[materials.lamp]\ndiffuse = 0\nemission = 2\n\
             [materials.black]\ndiffuse = 0\n{}",
            light.text
        );
        let mut builder = TestWorldBuilder::from_text(&text);
        if let Some(mesh) = &light.mesh {
            let material = builder.material("lamp");
            builder = builder.mesh(mesh.clone(), [DVec3::ONE, DVec3::ZERO, DVec3::ZERO], material);
        }
        if let Some(texels) = &light.sky {
            builder = builder.sky(texels);
        }
        let (render, number) = (builder.scene.render, builder.material("receiver"));
        let world = builder.world();
        let settings = RenderSettings {
            render,
            dof: true,
            view: ViewMode::Beauty,
            photons: None,
            layers: LayerSet::NONE,
        };
        let pixels = Rect { x: 0, y: 0, width: PACKET_SIZE as u32, height: 1 }.into();
        let bsdf = match world.materials[number].bsdf.as_purely_non_specular() {
            Some(material) => material.with_white_textures(),
            None => BxdfPoint::DielectricReflection(RoughDielectricPoint {
                near: 1.0,
                far: 1.5,
                alpha: 0.5,
                distribution: MicrofacetDistribution::Ggx,
            }),
        };
        let block = SampleBlock { pixels, samples: 0..samples, mirrored_width: None };
        Self { world, settings, block, token: CancelToken::new(), bsdf }
    }

    pub fn tile(&self) -> TileContext<'_> {
        let behavior = PathBehavior::from_settings(&self.settings, false);
        TileContext::new(&self.world, &self.settings, &self.block, &self.token, behavior)
    }

    /// A packet of equal vertices.
    pub fn vertices(&self) -> VertexBatch {
        let normal = self.bsdf.lobe_shading_normal(NORMAL, WO);
        let vertex = BatchVertex {
            from: Vec3::ZERO,
            normal,
            throughput: Vec3::ONE,
            path: 1,
            roulette_throughput: 1.0,
            start: Ray::NO_TRIANGLE,
            ..BatchVertex::default()
        };
        let mut row = VertexBatch::empty();
        row.bsdf.set_kind(self.bsdf.kind());
        row.reset();
        for i in 0..PACKET_SIZE {
            vertex.set(&mut row, i);
            let directions = ShadingGeometry { normal, wo: WO, tangent: Vec3::X };
            row.bsdf.set_bsdf(i, &self.bsdf, ShownLobes::ALL, &directions);
        }
        row.used = ALL;
        self.select_sample(&mut row, 0);
        row
    }

    /// Makes the vertices take sample `number` of their pixels.
    pub fn select_sample(&self, row: &mut VertexBatch, number: u32) {
        for i in 0..PACKET_SIZE {
            row.slot[i] = i as u32 * self.block.samples.end + number;
        }
    }

    /// Light from light samples at a packet of vertices.
    pub fn sample_lights(&self, row: &VertexBatch, competing: CompetingTechnique) -> LightSums {
        let tile = &self.tile();
        let lighting = SampleAllLights::<true> {
            tile,
            row,
            used: row.used,
            aov: PathAov::ALL,
            competing,
            interior_lists: None,
            only_infinite: false,
            splits_lobes: false,
        };
        let mut pool = ShadowRayQueue::default();
        let mut sums = [lighting.sample_all_or_picked_lights(0, &mut pool)];
        pool.trace(tile, PathAov::ALL, &mut sums);
        let [sums] = sums;
        sums
    }

    /// Returns the red channel of `sums` plus the light found by lobe rays.
    fn trace_lobe_rays(&self, row: &VertexBatch, sharp: u32, sums: &LightSums) -> [f32; PACKET_SIZE] {
        let (tile, mut sums) = (&self.tile(), sums.clone());
        let (aov, interior_lists) = (PathAov::ALL, None);
        LobeRayTracingKernel { tile, row, sharp, aov, interior_lists, sums: &mut sums }.trace();
        sums.light[0]
    }

    /// Rays in BSDF-sampled directions.
    fn scattered_paths(&self, row: &VertexBatch, lobes: LobesToSample) -> Vec<PathRay> {
        let continuation = BounceContinuationRules { continues: true, uses_roulette: false, lobes };
        let tile = &self.tile();
        let mut paths = Vec::new();
        BsdfSampler { tile, row, used: row.used, continuation, has_fractions: false }.queue_scattered_paths(
            &InteriorListPool::default(),
            &[],
            &mut paths,
            None,
        );
        paths
    }

    /// Radiance along a BSDF-sampled ray times its MIS weight. The weight is 1 if the path's pdf is 0.
    pub fn weighted_radiance(&self, path: &PathRay) -> Vec3 {
        let (world, tile) = (&self.world, self.tile());
        let Some(hit) = world.geometry.closest_hit(&path.ray) else {
            return tile.mis_weighted_infinite_light(path);
        };
        let emission = &world.materials[world.material_index(&hit)].emission;
        let surface = world.geometry.surface(&path.ray, &hit);
        let cosine = surface.normal.dot(path.ray.direction);
        if !emission.is_emissive() || !emission.emits_on_side(cosine < 0.0) {
            return Vec3::ZERO;
        }
        let at = world.texture_point(&hit, &surface, |_| Footprint::POINT);
        emission.radiance_at_cosine(&at, cosine, &mut 0) * tile.emitter_mis_weight(path, &hit)
    }

    /// Reflected light, estimated from all samples of all lanes.
    pub fn estimate(&self, technique: Technique) -> Estimate {
        let mut row = self.vertices();
        let mut lanes = [0.0; PACKET_SIZE];
        for sample in 0..self.block.samples.end {
            self.select_sample(&mut row, sample);
            let mut add = |light: &[f32; PACKET_SIZE]| {
                for i in 0..PACKET_SIZE {
                    lanes[i] += f64::from(light[i]) / f64::from(self.block.samples.end);
                }
            };
            match technique {
                Technique::Lights => add(&self.sample_lights(&row, CompetingTechnique::Nothing).light[0]),
                Technique::Bsdf => add(&self.bsdf_sampled_light(&row, LobesToSample::All, false)),
                Technique::LightsAndPaths => {
                    add(&self.sample_lights(&row, CompetingTechnique::Paths).light[0]);
                    add(&self.bsdf_sampled_light(&row, LobesToSample::All, true));
                }
                Technique::LightsAndNarrowPaths => {
                    add(&self.sample_lights(&row, CompetingTechnique::NarrowPaths).light[0]);
                    add(&self.bsdf_sampled_light(&row, LobesToSample::Narrow, true));
                }
                Technique::LightsAndLobeRays => {
                    let sums = self.sample_lights(&row, CompetingTechnique::Lobes(ALL));
                    add(&self.trace_lobe_rays(&row, ALL, &sums));
                }
            }
        }
        Estimate::over_lanes(&lanes)
    }

    fn bsdf_sampled_light(
        &self,
        row: &VertexBatch,
        lobes: LobesToSample,
        has_mis: bool,
    ) -> [f32; PACKET_SIZE] {
        let mut light = [0.0; PACKET_SIZE];
        for mut path in self.scattered_paths(row, lobes) {
            if !has_mis {
                path.state.pdf = 0.0;
            }
            let lane = (path.slot / self.block.samples.end) as usize;
            light[lane] += path.throughput.x * self.weighted_radiance(&path).x;
        }
        light
    }
}

/// A combination of sampling techniques that accounts for all light.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Technique {
    /// Only light samples.
    Lights,
    /// Only BSDF samples.
    Bsdf,
    /// MIS of light samples and continuing paths.
    LightsAndPaths,
    /// MIS of light samples and paths that continue in narrow lobes.
    LightsAndNarrowPaths,
    /// MIS of light samples and rays in narrow lobes.
    LightsAndLobeRays,
}
