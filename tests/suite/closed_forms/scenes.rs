//! Scenes built in code, and their rendered pixels.

use std::path::PathBuf;
use std::sync::Arc;

use glimt::assets::image::mipmaps;
use glimt::assets::{FileMaterial, LoadedMesh};
use glimt::control::{CancelToken, ignore_progress};
use glimt::film::Rect;
use glimt::geometry::mesh::TriangleMesh;
use glimt::integrators::{
    self, LayerSet, PhotonPassesBySample, PhotonSettings, RenderSettings, ViewMode, render_tile_with_photons,
};
use glimt::materials::texels::{TexelData, Texels};
use glimt::math::{DVec3, Vec2, Vec3};
use glimt::scene::description::light::{Falloff, PointLight};
use glimt::scene::description::{
    Accel, AffineMap, Camera, CoatSource, ColorSource, ConductorFresnelSource, EmissionSource, Environment,
    ImageShiftAndMirror, ImageSource, Integrator, Light, MapOrientation, MapRowPlacement, Material,
    MaterialKind, MeshFile, MeshReference, MicrofacetDistribution, NumberSource, Object, ObjectTransform,
    OpacitySource, Pattern, PhongParameters, PhotonOptions, PixelFilter, Projection, ReflectingSides,
    RenderOptions, Scene, ShadowMode, Shape, Sky, Spanned, Texture, TextureEncoding, TextureFilter,
    TextureSource, Tonemap, UvSet, Wrap,
};
use glimt::world::{
    EnvironmentSource, Geometry, MeshTree, TexelsAndMipmaps, TextureRolesNeededByRender, World, WorldInputs,
    build_environment_map, build_lights, build_sky, choose_origin_near_camera_target,
    separate_coincident_emitters, textures_needed,
};

use super::v;

/// A scene under construction, with render settings.
#[derive(Clone)]
pub struct Build {
    pub scene: Scene,
    pub parts: WorldInputs,
    pub view: ViewMode,
    texels: Vec<Arc<Texels>>,
    sky: Option<Arc<Texels>>,
}

/// An empty scene, viewed from (0, 0, 0) along −z through a single narrow pixel.
pub fn scene() -> Build {
    let render = RenderOptions {
        error: 0.0,
        width: 1,
        height: 1,
        samples: 1,
        shadow_samples: 1,
        max_depth: 8,
        integrator: Integrator::Whitted,
        shadows: ShadowMode::Soft,
        clamp: 0.0,
        ambient: Vec3::ZERO,
        background: Vec3::ZERO,
        filter: PixelFilter::Box,
        gain: 1.0,
        exposure: 0.0,
        tonemap: Tonemap::None,
        accel: Accel::Bvh,
        seed: 0,
    };
    let scene = Scene {
        render,
        output: None,
        camera: look_at(DVec3::ZERO, DVec3::NEG_Z, NARROW),
        photons: PhotonOptions { enabled: false, count: 1, radius: 0.0, bounces: 1 },
        textures: Vec::new(),
        materials: Vec::new(),
        mesh_files: Vec::new(),
        objects: Vec::new(),
        instances: Vec::new(),
        lights: Vec::new(),
        environment: None,
    };
    Build { scene, parts: WorldInputs::default(), view: ViewMode::Beauty, texels: Vec::new(), sky: None }
}

/// A field of view so narrow that a pixel is effectively a point.
const NARROW: f64 = 1e-6;

fn look_at(position: DVec3, look_at: DVec3, fov: f64) -> Camera {
    let along = (look_at - position).normalize();
    let up = if along.y.abs() > 0.9 { DVec3::X } else { DVec3::Y };
    Camera::LookAt {
        position,
        look_at,
        up,
        projection: Projection::Perspective { fov },
        window: ImageShiftAndMirror::default(),
        aperture: 0.0,
        focus: (look_at - position).length(),
    }
}

impl Build {
    /// Renders a single pixel looking at a point.
    pub fn seen(self, from: DVec3, at: DVec3) -> Self {
        self.pictured(from, at, NARROW, 1, 1)
    }

    pub fn pictured(mut self, from: DVec3, at: DVec3, fov: f64, width: u32, height: u32) -> Self {
        self.scene.camera = look_at(from, at, fov);
        (self.scene.render.width, self.scene.render.height) = (width, height);
        self
    }

    pub fn with(mut self, change: impl FnOnce(&mut Scene)) -> Self {
        change(&mut self.scene);
        self
    }

    pub fn viewed(mut self, view: ViewMode) -> Self {
        self.view = view;
        self
    }

    pub fn shadows(self, shadows: ShadowMode, samples: u32) -> Self {
        self.with(|scene| (scene.render.shadows, scene.render.shadow_samples) = (shadows, samples))
    }

    pub fn accel(self, accel: Accel) -> Self {
        self.with(|scene| scene.render.accel = accel)
    }

    pub fn depth(self, max_depth: u32) -> Self {
        self.with(|scene| scene.render.max_depth = max_depth)
    }

    /// Enables photon mapping with `count` photons per pass and a gather radius of `radius` in the first
    /// pass.
    pub fn photons(self, count: u64, radius: f64) -> Self {
        self.with(|scene| scene.photons = PhotonOptions { enabled: true, count, radius, bounces: 10_000 })
    }

    pub fn background(self, radiance: f32) -> Self {
        self.with(|scene| scene.render.background = Vec3::splat(radiance))
    }

    pub fn point_light(self, position: DVec3, intensity: f32, falloff: Falloff) -> Self {
        let light = PointLight { position, intensity: Vec3::splat(intensity), falloff };
        self.with(|scene| scene.lights.push(Light::Point(light)))
    }

    pub fn shape(mut self, shape: Shape, material: Material) -> Self {
        self.scene.materials.push(material);
        let material = Some(self.scene.materials.len() - 1);
        self.scene.objects.push(Object { shape, material, placement: None, name: None, span: 0..0 });
        self
    }

    /// Adds a shape with a texture in its own coordinates, and a matrix.
    pub fn shape_with_matrix(self, shape: Shape, matrix: AffineMap, material: Material) -> Self {
        let mut build = self.shape(shape, material).with_placements();
        let object = build.scene.objects.pop().expect("the shape");
        build.scene.objects.push(object.with_outer_transform(&ObjectTransform::Matrix(matrix)));
        build
    }

    /// Prepares all objects for textures in their own coordinates.
    pub fn with_placements(self) -> Self {
        let identity = Box::new(ObjectTransform::IDENTITY.to_affine_map());
        self.with(|scene| {
            scene.objects.iter_mut().for_each(|object| object.placement = Some(identity.clone()));
        })
    }

    /// The image of a texture.
    pub fn image_mut(&mut self, texture: usize) -> &mut ImageSource {
        self.scene.textures[texture].as_image_mut().expect("an image")
    }

    /// Adds a pattern. Returns its index.
    pub fn pattern(&mut self, pattern: Pattern, colors: [Vec3; 2], filter: TextureFilter) -> usize {
        let content = TextureSource::Pattern { colors, pattern };
        let name = format!("pattern {}", self.scene.textures.len());
        self.scene.textures.push(Texture { name, filter, factor: Vec3::ONE, content });
        self.scene.textures.len() - 1
    }

    pub fn sphere(self, center: DVec3, radius: f64, material: Material) -> Self {
        self.shape(Shape::Sphere { center, radius }, material)
    }

    pub fn quad(self, corner: DVec3, u: DVec3, v: DVec3, material: Material) -> Self {
        self.shape(Shape::Quad { corner, u, v }, material)
    }

    pub fn cuboid(self, center: DVec3, size: DVec3, rotate: DVec3, material: Material) -> Self {
        self.shape(Shape::Box { center, size, rotate }, material)
    }

    pub fn triangle(self, [a, b, c]: [DVec3; 3], material: Material) -> Self {
        self.shape(Shape::Triangle { a, b, c }, material)
    }

    /// Adds a flat-shaded instance of a mesh. `placed` is its scale, rotation and translation.
    pub fn mesh(self, mesh: TriangleMesh, placed: [DVec3; 3], material: Material) -> Self {
        self.loaded(LoadedMesh { mesh, ..LoadedMesh::default() }, placed, material)
    }

    /// Adds an instance of a mesh that was read from a file.
    pub fn loaded(mut self, loaded: LoadedMesh, placed: [DVec3; 3], material: Material) -> Self {
        let loaded = distinct_lights(loaded, material.emits());
        let tree = MeshTree::build(Arc::new(loaded), self.scene.render.accel, &CancelToken::new())
            .expect("not canceled");
        self.parts.meshes.push(Arc::new(tree));
        self.scene.mesh_files.push(MeshFile { value: PathBuf::new(), span: 0..0, part: None, subdivide: 0 });
        let [scale, rotate, translate] = placed;
        let file = self.parts.meshes.len() - 1;
        let placed = ObjectTransform::Steps { scale, rotate, translate };
        self.shape(Shape::Mesh(MeshReference { file, placed, smooth: false, vertex_colors: false }), material)
    }

    /// Enables smooth shading for the last mesh.
    pub fn smooth(self) -> Self {
        self.with(|scene| {
            if let Some(Shape::Mesh(mesh)) = scene.objects.last_mut().map(|object| &mut object.shape) {
                mesh.smooth = true;
            }
        })
    }

    /// Adds a flat-shaded instance of a mesh with the materials from its file.
    pub fn own_mesh(self, mesh: TriangleMesh, materials: Vec<FileMaterial>) -> Self {
        let mut build = self.mesh(mesh, IDENTITY_PLACEMENT, matte(0.5));
        let file = build.parts.meshes.len() - 1;
        let loaded = LoadedMesh { materials, ..build.parts.meshes[file].loaded_mesh().clone() };
        let loaded = distinct_lights(loaded, false);
        let tree = MeshTree::build(Arc::new(loaded), Accel::Bvh, &CancelToken::new()).expect("not canceled");
        build.parts.meshes[file] = Arc::new(tree);
        build.with(|scene| scene.objects.last_mut().expect("the mesh").material = None)
    }

    /// Adds a texture, top row first. Returns its index.
    pub fn texture(&mut self, rows: &[&[Vec3]], filter: TextureFilter, wrap: Wrap, repeat: Vec2) -> usize {
        let number = self.texels.len();
        self.texels.push(Arc::new(Texels {
            width: rows[0].len() as u32,
            height: rows.len() as u32,
            data: TexelData::Float(rows.concat()),
            unusable: 0,
        }));
        let image = ImageSource {
            file: Spanned { value: PathBuf::from(format!("{number}.exr")), span: 0..0 },
            wrap,
            repeat,
            rotate: 0.0,
            offset: Vec2::ZERO,
            uv: UvSet::First,
            encoding: TextureEncoding::Linear,
            image: None,
        };
        let (name, content) = (format!("{number}"), TextureSource::Image(image));
        self.scene.textures.push(Texture { name, filter, factor: Vec3::ONE, content });
        number
    }

    /// Adds an environment with constant radiance.
    pub fn environment(self, radiance: f32) -> Self {
        let color = Vec3::splat(radiance);
        self.with(|scene| {
            let (orientation, rows) = (MapOrientation::Turn(0.0), MapRowPlacement::Centers);
            scene.environment = Some(Environment { color, file: None, sky: None, orientation, rows });
        })
    }

    /// Adds an equirectangular environment map with `width` columns, top row first.
    pub fn sky(self, width: u32, texels: Vec<Vec3>, rotate: f64) -> Self {
        self.oriented_sky(width, texels, MapOrientation::Turn(rotate))
    }

    /// Adds an equirectangular environment map with `width` columns, top row first.
    pub fn oriented_sky(mut self, width: u32, texels: Vec<Vec3>, orientation: MapOrientation) -> Self {
        let height = texels.len() as u32 / width;
        self.sky = Some(Arc::new(Texels { width, height, data: TexelData::Float(texels), unusable: 0 }));
        let file = Some(Spanned { value: PathBuf::from("sky.exr"), span: 0..0 });
        self.with(|scene| {
            let rows = MapRowPlacement::Centers;
            scene.environment = Some(Environment { color: Vec3::ONE, file, sky: None, orientation, rows });
        })
    }

    /// Adds a sky with a sun.
    pub fn clear_sky(self, sky: Sky, rotate: f64) -> Self {
        let environment = Environment {
            color: Vec3::ONE,
            file: None,
            sky: Some(sky),
            orientation: MapOrientation::Turn(rotate),
            rows: MapRowPlacement::Centers,
        };
        self.with(|scene| scene.environment = Some(environment))
    }

    pub fn world(&self) -> World {
        let mut parts = self.parts.clone();
        for needed in textures_needed(&self.scene, &[], TextureRolesNeededByRender::ALL) {
            let texels = match needed.declared {
                Some(number) => &self.texels[number],
                None => self.sky.as_ref().expect("an environment map"),
            };
            let levels = || Arc::new(mipmaps(texels, &CancelToken::new()).expect("not canceled"));
            let image =
                TexelsAndMipmaps { texels: Arc::clone(texels), mipmaps: needed.has_mipmaps.then(levels) };
            parts.images.insert(needed.source, image);
        }
        let origin = choose_origin_near_camera_target(&self.scene.camera, None);
        let geometry = Geometry::from_scene(&self.scene, &parts.meshes, origin, &CancelToken::new());
        let geometry = Arc::new(geometry.expect("not canceled"));
        let sky = self.scene.environment.as_ref().and_then(|environment| environment.sky.as_ref());
        let map =
            || self.sky.as_ref().and_then(|texels| build_environment_map(texels, MapRowPlacement::Centers));
        let map = || map().map(EnvironmentSource::Map);
        let sky = sky.map(|sky| EnvironmentSource::Sky(build_sky(sky))).or_else(map);
        let lights = build_lights(&self.scene, &geometry, &parts.images, sky, &CancelToken::new())
            .expect("not canceled");
        World::new(&self.scene, &parts, geometry, lights)
    }

    /// Values of the only pixel seen from each position toward the origin, with one sample. Geometry and
    /// lights are built only once.
    pub fn values_from(&self, positions: &[DVec3]) -> Vec<f64> {
        let mut build = self.clone().seen(positions[0], DVec3::ZERO);
        let (first, settings) = (build.world(), build.settings(0));
        let rect = Rect { x: 0, y: 0, width: 1, height: 1 };
        let value = |&position: &DVec3| {
            build.scene.camera = look_at(position, DVec3::ZERO, NARROW);
            let (geometry, lights) = (Arc::clone(&first.geometry), Arc::clone(&first.lights));
            tile(&World::new(&build.scene, &build.parts, geometry, lights), &settings, rect, 1)[0].x
        };
        positions.iter().map(value).collect()
    }

    pub fn settings(&self, seed: u32) -> RenderSettings {
        let render = RenderOptions { seed, ..self.scene.render };
        let PhotonOptions { enabled, count, radius, bounces } = self.scene.photons;
        let photons = PhotonSettings { count: count as u32, radius: radius as f32, bounces };
        RenderSettings {
            render,
            dof: true,
            view: self.view,
            photons: enabled.then_some(photons),
            layers: LayerSet::NONE,
        }
    }

    /// The whole image. Each pixel is the mean of its samples.
    pub fn picture(&self, samples: u32, seed: u32) -> Vec<DVec3> {
        self.pictures(samples, [seed]).remove(0)
    }

    /// The whole image with each seed.
    pub fn pictures(&self, samples: u32, seeds: impl IntoIterator<Item = u32>) -> Vec<Vec<DVec3>> {
        let world = self.world();
        let (width, height) = (self.scene.render.width, self.scene.render.height);
        let rect = Rect { x: 0, y: 0, width, height };
        seeds.into_iter().map(|seed| tile(&world, &self.settings(seed), rect, samples)).collect()
    }

    /// The mean of the whole image's red components with each of 16 seeds.
    pub fn mean_reds(&self, samples: u32) -> Vec<f64> {
        let mean =
            |picture: Vec<DVec3>| picture.iter().map(|pixel| pixel.x).sum::<f64>() / picture.len() as f64;
        self.pictures(samples, 0..16).into_iter().map(mean).collect()
    }

    /// Color of the only pixel, with one sample.
    pub fn color(&self) -> DVec3 {
        self.picture(1, 0)[0]
    }

    /// Value of the only pixel of a gray image, with one sample.
    pub fn value(&self) -> f64 {
        self.color().x
    }

    /// Values of the first pixel, one for each seed.
    pub fn values(&self, samples: u32, seeds: u32) -> Vec<f64> {
        let world = self.world();
        let rect = Rect { x: 0, y: 0, width: 1, height: 1 };
        (0..seeds).map(|seed| tile(&world, &self.settings(seed), rect, samples)[0].x).collect()
    }
}

/// Renders a tile. Returns the mean of each pixel's samples.
pub fn tile(world: &World, settings: &RenderSettings, rect: Rect, samples: u32) -> Vec<DVec3> {
    tile_with_photons(maps(world, settings, samples).as_ref(), world, settings, rect, samples)
}

/// Photon maps for `samples` samples. `None` if no photons are gathered.
pub fn maps(world: &World, settings: &RenderSettings, samples: u32) -> Option<PhotonPassesBySample> {
    let token = CancelToken::new();
    settings.without_ineffective_settings().photons.filter(|_| settings.gathers_photons()).map(|of_photons| {
        let photons = integrators::PhotonPassTracer::new_and_trace_first_pass(
            world,
            settings,
            of_photons,
            &ignore_progress,
            &token,
        );
        let (photons, _) = photons.expect("not canceled");
        photons.trace_passes_for_samples(world, settings, 0..samples, &token).expect("not canceled")
    })
}

/// Renders a tile like [`tile`], with existing photon maps.
pub fn tile_with_photons(
    maps: Option<&PhotonPassesBySample>,
    world: &World,
    settings: &RenderSettings,
    rect: Rect,
    samples: u32,
) -> Vec<DVec3> {
    let token = CancelToken::new();
    let (tile, _) =
        render_tile_with_photons(maps, world, settings, rect, 0..samples, &token).expect("not canceled");
    let sums = tile.radiance.chunks(samples as usize);
    sums.map(|pixel| pixel.iter().map(|c| c.as_dvec3()).sum::<DVec3>() / f64::from(samples)).collect()
}

/// A material without emission, normal map, bump map or transparency.
pub fn plain(kind: MaterialKind) -> Material {
    Material {
        name: String::new(),
        kind,
        sides: ReflectingSides::Both,
        emission: EmissionSource::NONE,
        normal_map: None,
        bump: None,
        opacity: OpacitySource::FULL,
        coat: CoatSource::NONE,
    }
}

/// The material under a coat with these weight and roughness.
pub fn coated(weight: f32, roughness: f32, material: Material) -> Material {
    let [weight, roughness] = [weight, roughness].map(NumberSource::Constant);
    Material { coat: CoatSource { weight, roughness, ..CoatSource::NONE }, ..material }
}

/// A blend of two materials. `weight` is the weight of the second one.
pub fn blend(first: Material, second: Material, weight: NumberSource) -> Material {
    plain(MaterialKind::Blend { weight, parts: Box::new([first, second]) })
}

pub fn phong(diffuse: f32, specular: f32, shininess: f32, emission: f32) -> Material {
    let gray = |x| ColorSource::Constant(Vec3::splat(x));
    let kind = MaterialKind::Phong(PhongParameters {
        diffuse: gray(diffuse),
        specular: gray(specular),
        shininess,
        ambient: None,
        diffuse_transmission: ColorSource::BLACK,
    });
    Material { emission: EmissionSource::from_constant(Vec3::splat(emission)), ..plain(kind) }
}

pub fn matte(reflectance: f32) -> Material {
    phong(reflectance, 0.0, 1.0, 0.0)
}

pub fn emitter(radiance: f32) -> Material {
    phong(0.0, 0.0, 1.0, radiance)
}

pub fn mirror(reflectance: f32) -> Material {
    plain(MaterialKind::Mirror { reflectance: ColorSource::Constant(Vec3::splat(reflectance)) })
}

/// Metal with a gray reflectance at normal incidence.
pub fn metal(reflectance: f32, roughness: f32, anisotropy: f32) -> Material {
    plain(MaterialKind::Metal {
        fresnel: ConductorFresnelSource::Schlick(ColorSource::Constant(Vec3::splat(reflectance))),
        roughness: NumberSource::Constant(roughness),
        anisotropy: NumberSource::Constant(anisotropy),
        distribution: MicrofacetDistribution::Ggx,
    })
}

/// The material with the Beckmann distribution.
pub fn beckmann(mut material: Material) -> Material {
    match &mut material.kind {
        MaterialKind::Metal { distribution, .. }
        | MaterialKind::Plastic { distribution, .. }
        | MaterialKind::Glass { distribution, .. } => *distribution = MicrofacetDistribution::Beckmann,
        MaterialKind::Phong(_)
        | MaterialKind::Mirror { .. }
        | MaterialKind::Pane { .. }
        | MaterialKind::Principled { .. }
        | MaterialKind::Blend { .. } => {}
    }
    material
}

/// Plastic with IOR 1.5 and full specular reflection.
pub fn plastic(diffuse: f32, roughness: f32) -> Material {
    plain(MaterialKind::Plastic {
        diffuse: ColorSource::Constant(Vec3::splat(diffuse)),
        specular: ColorSource::Constant(Vec3::ONE),
        ior: 1.5,
        roughness: NumberSource::Constant(roughness),
        distribution: MicrofacetDistribution::Ggx,
        nonlinear: true,
    })
}

/// A principled material with a clear coat of weight 0.5.
pub fn principled(color: f32, metallic: f32, roughness: f32) -> Material {
    let number = NumberSource::Constant;
    let uncoated = plain(MaterialKind::Principled {
        color: ColorSource::Constant(Vec3::splat(color)),
        metallic: number(metallic),
        roughness: number(roughness),
        ior: 1.5,
        specular: number(1.0),
        specular_color: ColorSource::Constant(Vec3::ONE),
        transmission: number(0.0),
        diffuse_transmission: ColorSource::BLACK,
    });
    coated(0.5, 0.1, uncoated)
}

pub fn glass(ior: f32) -> Material {
    tinted(ior, DVec3::ONE)
}

/// Rough glass.
pub fn frosted(ior: f32, roughness: f32) -> Material {
    let roughness = NumberSource::Constant(roughness);
    let distribution = MicrofacetDistribution::Ggx;
    plain(MaterialKind::Glass { ior, tint: DVec3::ONE, roughness, distribution })
}

/// A principled material with a clear coat and the specified transmission.
pub fn translucent(color: f32, roughness: f32, transmission: f32) -> Material {
    let mut material = principled(color, 0.0, roughness);
    if let MaterialKind::Principled { transmission: own, .. } = &mut material.kind {
        *own = NumberSource::Constant(transmission);
    }
    material
}

/// Glass with the given transmittance per unit length.
pub fn tinted(ior: f32, tint: DVec3) -> Material {
    let (roughness, distribution) = (NumberSource::Constant(0.0), MicrofacetDistribution::Ggx);
    plain(MaterialKind::Glass { ior, tint, roughness, distribution })
}

/// A material from a mesh file with the given illumination model: 2 is matte gray, 9 is glass.
pub fn file_material(illumination_model: u8, ior: f32) -> FileMaterial {
    FileMaterial {
        name: String::new(),
        diffuse: Vec3::splat(0.5),
        specular: Vec3::ZERO,
        shininess: 1.0,
        emission: Vec3::ZERO,
        ior,
        illumination_model: Some(illumination_model),
        opacity: 1.0,
        opacity_texture: None,
        diffuse_texture: None,
        specular_texture: None,
        emission_texture: None,
        normal_texture: None,
        normal_strength: 1.0,
        physical: None,
    }
}

/// An upward-facing receiver with reflectance ρ at a point. The camera is so close that nothing can be in
/// between.
pub fn receiver(at: DVec3, reflectance: f32) -> Build {
    let half = 0.125;
    let corner = at + v(-half, 0.0, half);
    scene()
        .quad(corner, v(2.0 * half, 0.0, 0.0), v(0.0, 0.0, -2.0 * half), matte(reflectance))
        .seen(at + v(2e-5, 5e-5, 3e-5), at)
}

/// A closed latitude-longitude sphere with outward-facing triangles.
pub fn lat_long_sphere(rings: u32, steps: u32, radius: f64, center: DVec3) -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    let at = |ring: u32, step: u32| {
        let (theta, phi) = (
            std::f64::consts::PI * f64::from(ring) / f64::from(rings),
            std::f64::consts::TAU * f64::from(step) / f64::from(steps),
        );
        (center + v(theta.sin() * phi.cos(), theta.cos(), theta.sin() * phi.sin()) * radius).as_vec3()
    };
    mesh.positions.push((center + v(0.0, radius, 0.0)).as_vec3());
    for ring in 1..rings {
        mesh.positions.extend((0..steps).map(|step| at(ring, step)));
    }
    mesh.positions.push((center - v(0.0, radius, 0.0)).as_vec3());
    let id = |ring: u32, step: u32| match ring {
        0 => 0,
        ring if ring == rings => 1 + (rings - 1) * steps,
        ring => 1 + (ring - 1) * steps + step % steps,
    };
    for ring in 0..rings {
        for step in 0..steps {
            let (a, b) = (id(ring, step), id(ring, step + 1));
            let (c, d) = (id(ring + 1, step), id(ring + 1, step + 1));
            if ring > 0 {
                mesh.triangles.push([a, b, d]);
            }
            if ring + 1 < rings {
                mesh.triangles.push([a, d, c]);
            }
        }
    }
    mesh
}

/// The identity transform.
pub const IDENTITY_PLACEMENT: [DVec3; 3] = [DVec3::ONE, DVec3::ZERO, DVec3::ZERO];

/// The mesh as the pipeline prepares it for its tree.
fn distinct_lights(loaded: LoadedMesh, all_emit: bool) -> LoadedMesh {
    let distinct =
        separate_coincident_emitters(&loaded, all_emit, &CancelToken::new()).expect("never canceled");
    distinct.unwrap_or(loaded)
}
