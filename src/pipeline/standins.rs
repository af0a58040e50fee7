//! STAND-INS for rooms that are being built: each module has the path and the signatures of the real one.
//! To be removed: replace `crate::pipeline::standins::` by `crate::` and delete this file.

pub mod scene {
    use std::collections::HashMap;
    use std::ops::Range;
    use std::path::{Path, PathBuf};
    use std::sync::Arc;

    use toml::Spanned;
    use toml::de::{DeTable, DeValue};

    use crate::math::{DVec3, Vec2, Vec3};
    use crate::scene::description::*;
    use crate::scene::diagnostic::{Diagnostic, Place, Severity};

    #[derive(Clone, Debug)]
    pub struct Loaded {
        pub scene: Scene,
        pub source: Arc<str>,
        pub path: PathBuf,
        pub warnings: Vec<Diagnostic>,
    }

    impl Loaded {
        pub fn diagnostic_at(
            &self,
            span: Range<usize>,
            severity: Severity,
            message: impl Into<String>,
            help: Option<String>,
        ) -> Diagnostic {
            let message = message.into();
            let place = Some(Place { source: self.source.clone(), span, label: String::new() });
            Diagnostic { severity, message, path: self.path.clone(), place, help }
        }
    }

    pub fn starter() -> &'static str {
        "[camera]\nposition = [0, 1, 4]\nlook_at = [0, 1, 0]\n\n[materials.ball]\ntype = \"phong\"\n\n\
         [[sphere]]\ncenter = [0, 0, 0]\nradius = 1.0\nmaterial = \"ball\"\n"
    }

    pub mod sanitize {
        pub fn visible(text: &str) -> std::borrow::Cow<'_, str> {
            text.chars().map(|c| if c.is_control() { '\u{fffd}' } else { c }).collect::<String>().into()
        }
    }

    pub mod report {
        use crate::scene::diagnostic::{Diagnostic, Severity};

        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum Style {
            Plain,
            Ansi,
        }

        pub fn render(diagnostics: &[Diagnostic], _width: usize, _style: Style) -> String {
            let mut text = String::new();
            for one in diagnostics {
                let kind = if one.severity == Severity::Error { "error" } else { "warning" };
                let place = one.place.as_ref().map_or(String::new(), |place| {
                    let before = &place.source[..place.span.start];
                    let line = before.matches('\n').count() + 1;
                    let column = before.rsplit('\n').next().map_or(0, |s| s.chars().count()) + 1;
                    format!(":{line}:{column}")
                });
                text += &format!("{kind}: {}\n  --> {}{place}\n", one.message, one.path.display());
            }
            text
        }
    }

    type Errors = Vec<Diagnostic>;

    pub fn load(path: &Path) -> Result<Loaded, Errors> {
        let fail = |message: String, place| {
            vec![Diagnostic { severity: Severity::Error, message, path: path.to_owned(), place, help: None }]
        };
        let text = std::fs::read_to_string(path)
            .map_err(|error| fail(format!("cannot read {}: {error}", path.display()), None))?;
        let source: Arc<str> = text.as_str().into();
        let table = DeTable::parse(&text).map_err(|error| {
            let span = error.span().unwrap_or(0..0);
            fail(
                error.message().to_owned(),
                Some(Place { source: source.clone(), span, label: String::new() }),
            )
        })?;
        let scene = lower(table.get_ref(), path).map_err(|(message, span)| {
            fail(message, Some(Place { source: source.clone(), span, label: String::new() }))
        })?;
        Ok(Loaded { scene, source, path: path.to_owned(), warnings: Vec::new() })
    }

    type Wrong = (String, Range<usize>);

    fn number(value: &DeValue<'_>) -> Option<f64> {
        match value {
            DeValue::Integer(i) => i.as_str().replace('_', "").parse().ok(),
            DeValue::Float(f) => f.as_str().parse().ok(),
            _ => None,
        }
    }

    fn vector(value: &DeValue<'_>) -> Option<DVec3> {
        let all: Vec<f64> = value.as_array()?.iter().filter_map(|v| number(v.get_ref())).collect();
        (all.len() == 3).then(|| DVec3::new(all[0], all[1], all[2]))
    }

    fn color(table: &DeTable<'_>, key: &str) -> Option<Vec3> {
        table.get(key).and_then(|v| vector(v.get_ref())).map(|v| v.as_vec3())
    }

    fn real(table: &DeTable<'_>, key: &str, default: f64) -> f64 {
        table.get(key).and_then(|v| number(v.get_ref())).unwrap_or(default)
    }

    fn named(table: &DeTable<'_>, key: &str, names: &HashMap<String, usize>) -> Result<Option<usize>, Wrong> {
        table
            .get(key)
            .map(|v| {
                let name = v.get_ref().as_str().unwrap_or("");
                names.get(name).copied().ok_or((format!("no {key} named `{name}`"), v.span()))
            })
            .transpose()
    }

    fn file(v: &Spanned<DeValue<'_>>, path: &Path) -> Located<PathBuf> {
        let folder = path.parent().unwrap_or(Path::new(""));
        Located { value: folder.join(v.get_ref().as_str().unwrap_or("")), span: v.span() }
    }

    fn tables<'a>(root: &'a DeTable<'a>, key: &str) -> Vec<(Range<usize>, &'a DeTable<'a>)> {
        let array = root.get(key).and_then(|v| v.get_ref().as_array());
        array
            .into_iter()
            .flat_map(|all| all.iter())
            .filter_map(|v| Some((v.span(), v.get_ref().as_table()?)))
            .collect()
    }

    fn lower(root: &DeTable<'_>, path: &Path) -> Result<Scene, Wrong> {
        let known = [
            "render",
            "camera",
            "photons",
            "textures",
            "materials",
            "sphere",
            "mesh",
            "light",
            "quad",
            "plane",
        ];
        for (key, _) in root.iter() {
            if !known.contains(&key.get_ref().as_ref()) {
                return Err((format!("unknown key `{}`", key.get_ref()), key.span()));
            }
        }
        let empty = DeTable::new();
        let sub = |key: &str| root.get(key).and_then(|v| v.get_ref().as_table()).unwrap_or(&empty);
        let (render, camera) = (sub("render"), sub("camera"));
        let mut textures = Vec::new();
        let mut texture_names = HashMap::new();
        for (name, value) in sub("textures").iter() {
            let Some(named) = value.get_ref().as_table().and_then(|t| t.get("file")) else { continue };
            texture_names.insert(name.get_ref().to_string(), textures.len());
            textures.push(Texture {
                name: name.get_ref().to_string(),
                file: file(named, path),
                filter: TextureFilter::Bilinear,
                wrap: Wrap::Repeat,
                repeat: Vec2::ONE,
                encoding: Encoding::Auto,
            });
        }
        let mut materials = Vec::new();
        let mut material_names = HashMap::new();
        for (name, value) in sub("materials").iter() {
            let table = value.get_ref().as_table().unwrap_or(&empty);
            material_names.insert(name.get_ref().to_string(), materials.len());
            let inner = table.get("diffuse").and_then(|v| v.get_ref().as_table());
            let diffuse = match inner.map(|t| named(t, "texture", &texture_names)).transpose()?.flatten() {
                Some(texture) => ColorSource::Texture(texture),
                None => ColorSource::Constant(color(table, "diffuse").unwrap_or(Vec3::ONE)),
            };
            materials.push(Material {
                name: name.get_ref().to_string(),
                kind: MaterialKind::Phong {
                    diffuse,
                    specular: ColorSource::Constant(Vec3::ZERO),
                    shininess: 32.0,
                    ambient: None,
                    emission: color(table, "emission").unwrap_or(Vec3::ZERO),
                    normal_map: None,
                },
            });
        }
        let mut objects = Vec::new();
        let mut mesh_files: Vec<Located<PathBuf>> = Vec::new();
        for (span, table) in tables(root, "sphere") {
            let shape = Shape::Sphere {
                center: table.get("center").and_then(|v| vector(v.get_ref())).unwrap_or_default(),
                radius: real(table, "radius", 1.0),
            };
            objects.push(Object { shape, material: named(table, "material", &material_names)?, span });
        }
        for (span, table) in tables(root, "mesh") {
            let Some(named_file) = table.get("file") else { continue };
            let located = file(named_file, path);
            let index = mesh_files.iter().position(|f| f.value == located.value).unwrap_or(mesh_files.len());
            if index == mesh_files.len() {
                mesh_files.push(located);
            }
            let shape = Shape::Mesh {
                file: index,
                scale: DVec3::ONE,
                rotate: DVec3::ZERO,
                translate: table.get("translate").and_then(|v| vector(v.get_ref())).unwrap_or_default(),
                smooth: true,
            };
            objects.push(Object { shape, material: named(table, "material", &material_names)?, span });
        }
        let lights = tables(root, "light")
            .into_iter()
            .map(|(_, table)| PointLight {
                position: table.get("position").and_then(|v| vector(v.get_ref())).unwrap_or_default(),
                intensity: color(table, "intensity").unwrap_or(Vec3::ONE),
                falloff: Falloff::Square,
            })
            .collect();
        let at = |key: &str| camera.get(key).and_then(|v| vector(v.get_ref()));
        Ok(Scene {
            render: Render {
                width: real(render, "width", 640.0) as u32,
                height: real(render, "height", 480.0) as u32,
                samples: real(render, "samples", 64.0) as u32,
                shadow_samples: 1,
                max_depth: real(render, "max_depth", 8.0) as u32,
                integrator: Integrator::Whitted,
                shadows: Shadows::Soft,
                ambient: Vec3::ZERO,
                background: color(render, "background").unwrap_or(Vec3::ZERO),
                filter: PixelFilter::Box,
                exposure: real(render, "exposure", 0.0) as f32,
                tonemap: Tonemap::None,
                accel: Accel::Bvh,
                seed: 0,
                output: render.get("output").and_then(|v| v.get_ref().as_str()).map(PathBuf::from),
            },
            camera: Camera::LookAt {
                position: at("position").ok_or(("missing key `position`".to_owned(), 0..0))?,
                look_at: at("look_at").ok_or(("missing key `look_at`".to_owned(), 0..0))?,
                up: DVec3::Y,
                fov: real(camera, "fov", 40.0),
                aperture: real(camera, "aperture", 0.0),
                focus: 4.0,
            },
            photons: Photons {
                enabled: sub("photons").get("enabled").is_some_and(|v| v.get_ref().as_bool() == Some(true)),
                count: 1,
                radius: 0.0,
                bounces: 1,
            },
            textures,
            materials,
            mesh_files,
            objects,
            lights,
        })
    }
}

pub mod assets {
    pub mod mesh {
        use std::path::Path;

        use crate::assets::{AssetError, Dropped, LoadedMesh};
        use crate::control::{CancelToken, Progress};
        use crate::geometry::mesh::TriangleMesh;
        use crate::math::Vec3;

        pub fn load(
            path: &Path,
            progress: Progress<'_>,
            token: &CancelToken,
        ) -> Result<LoadedMesh, AssetError> {
            token.check()?;
            let text = std::fs::read_to_string(path)
                .map_err(|e| AssetError::Unreadable { path: path.to_owned(), reason: e.to_string() })?;
            progress(1, 2);
            if !text.lines().any(|line| line.starts_with("f ")) {
                let reason = "no usable face".to_owned();
                return Err(AssetError::Malformed { path: path.to_owned(), line: None, reason });
            }
            let companions = text.lines().filter_map(|line| line.strip_prefix("mtllib "));
            let folder = path.parent().unwrap_or(Path::new(""));
            Ok(LoadedMesh {
                mesh: TriangleMesh {
                    positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
                    triangles: vec![[0, 1, 2]],
                    ..Default::default()
                },
                dropped: Dropped { non_finite: text.matches("nan").count() as u64, degenerate: 0 },
                companions: companions.map(|name| folder.join(name)).collect(),
                ..Default::default()
            })
        }
    }

    pub mod image {
        use std::path::Path;

        use crate::assets::AssetError;
        use crate::control::{CancelToken, Progress};
        use crate::materials::texels::{TexelData, Texels};

        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum ImageEncoding {
            Color,
            Srgb,
            Linear,
        }

        pub fn load(
            path: &Path,
            _encoding: ImageEncoding,
            progress: Progress<'_>,
            token: &CancelToken,
        ) -> Result<Texels, AssetError> {
            token.check()?;
            let bytes = std::fs::read(path)
                .map_err(|e| AssetError::Unreadable { path: path.to_owned(), reason: e.to_string() })?;
            progress(1, 3);
            let Some(&first) = bytes.first() else {
                let reason = "the file is empty".to_owned();
                return Err(AssetError::Malformed { path: path.to_owned(), line: None, reason });
            };
            Ok(Texels { width: 1, height: 1, data: TexelData::Srgb8(vec![[first; 3]]) })
        }
    }

    pub mod orbiter {
        use std::path::Path;

        use crate::assets::{AssetError, OrbiterCamera};

        pub fn load(path: &Path) -> Result<OrbiterCamera, AssetError> {
            Err(AssetError::Unreadable { path: path.to_owned(), reason: "not yet".to_owned() })
        }
    }
}

pub mod world {
    use std::sync::Arc;

    use crate::assets::LoadedMesh;
    use crate::scene::description::{ColorSource, MaterialKind, Scene};
    use crate::world::{NeededTexture, SourceEncoding, TextureSource};

    pub fn textures_needed(scene: &Scene, _meshes: &[Arc<LoadedMesh>]) -> Vec<NeededTexture> {
        let mut needed: Vec<NeededTexture> = Vec::new();
        for object in &scene.objects {
            let Some(MaterialKind::Phong { diffuse: ColorSource::Texture(index), .. }) =
                object.material.map(|m| &scene.materials[m].kind)
            else {
                continue;
            };
            let texture = &scene.textures[*index];
            let source = TextureSource { path: texture.file.value.clone(), encoding: SourceEncoding::Color };
            if needed.iter().all(|other| other.source != source) {
                let name = texture.name.clone();
                needed.push(NeededTexture { source, name, declared: Some(*index), mesh_file: None });
            }
        }
        needed
    }
}

pub mod integrators {
    use std::ops::Range;

    use crate::control::{CancelToken, Cancelled};
    use crate::film::{Rect, TileSamples};
    use crate::integrators::{RayCounters, RenderSettings};
    use crate::math::Vec3;
    use crate::world::World;

    pub fn render_tile(
        world: &World,
        settings: &RenderSettings,
        tile: Rect,
        samples: Range<u32>,
        token: &CancelToken,
    ) -> Result<(TileSamples, RayCounters), Cancelled> {
        let mut radiance = Vec::with_capacity(tile.area() * samples.len());
        for y in tile.y..tile.y + tile.height {
            token.check()?;
            for x in tile.x..tile.x + tile.width {
                for sample in samples.clone() {
                    let mut bits = x ^ (y << 11) ^ (sample << 22) ^ settings.seed.rotate_left(7);
                    bits = (bits ^ (bits >> 16)).wrapping_mul(0x045d_9f3b);
                    bits = (bits ^ (bits >> 16)).wrapping_mul(0x045d_9f3b);
                    let noise = (bits >> 8) as f32 / (1 << 24) as f32;
                    let place = Vec3::new(x as f32, y as f32, noise) / settings.width as f32;
                    radiance.push(world.background + place * noise);
                }
            }
        }
        let rays = RayCounters { camera_rays: radiance.len() as u64, ..Default::default() };
        Ok((TileSamples { rect: tile, samples: samples.len() as u32, radiance }, rays))
    }
}

pub mod film {
    use crate::film::{RadianceImage, Rect, TileSamples};
    use std::sync::{Mutex, MutexGuard, PoisonError};

    use crate::math::{DVec3, Vec3};

    pub mod tone {
        use crate::film::{Picture, RadianceImage};
        use crate::math::color::linear_to_srgb8;

        #[derive(Clone, Copy, Debug, PartialEq)]
        pub enum Curve {
            None,
            Reinhard,
            Aces,
            Agx,
        }

        #[derive(Clone, Copy, Debug, PartialEq)]
        pub struct ToneMapping {
            pub exposure_stops: f32,
            pub curve: Curve,
        }

        pub fn develop(image: &RadianceImage, tone: &ToneMapping) -> Picture {
            let gain = tone.exposure_stops.exp2();
            let pixels = image.pixels.iter().map(|p| (*p * gain).to_array().map(linear_to_srgb8)).collect();
            Picture { width: image.width, height: image.height, pixels }
        }
    }

    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct SampleStats {
        pub min: u32,
        pub mean: f64,
        pub max: u32,
    }

    #[derive(Debug, thiserror::Error)]
    #[error("no memory for a picture of {0}×{1} pixels")]
    pub struct FilmError(u32, u32);

    #[derive(Debug)]
    pub struct Film {
        width: u32,
        height: u32,
        area: Rect,
        sums: Mutex<Vec<(DVec3, u32)>>,
    }

    const TILE: u32 = 16;

    impl Film {
        pub fn new(width: u32, height: u32, crop: Option<Rect>) -> Result<Self, FilmError> {
            let mut sums = Vec::new();
            let pixels = width as usize * height as usize;
            sums.try_reserve_exact(pixels).map_err(|_| FilmError(width, height))?;
            sums.resize(pixels, (DVec3::ZERO, 0));
            Ok(Self {
                width,
                height,
                area: crop.unwrap_or(Rect { x: 0, y: 0, width, height }),
                sums: Mutex::new(sums),
            })
        }

        fn sums(&self) -> MutexGuard<'_, Vec<(DVec3, u32)>> {
            self.sums.lock().unwrap_or_else(PoisonError::into_inner)
        }

        pub fn tile_count(&self) -> usize {
            self.area.width.div_ceil(TILE) as usize * self.area.height.div_ceil(TILE) as usize
        }

        pub fn tile_order(&self) -> Vec<usize> {
            (0..self.tile_count()).rev().collect()
        }

        pub fn tile_rect(&self, i: usize) -> Option<Rect> {
            let across = self.area.width.div_ceil(TILE);
            let (x, y) = (i as u32 % across * TILE, i as u32 / across * TILE);
            (i < self.tile_count()).then(|| Rect {
                x: self.area.x + x,
                y: self.area.y + y,
                width: TILE.min(self.area.width - x),
                height: TILE.min(self.area.height - y),
            })
        }

        pub fn add(&self, _tile: usize, samples: &TileSamples) {
            let mut sums = self.sums();
            for (i, values) in samples.radiance.chunks(samples.samples as usize).enumerate() {
                let (x, y) = (i as u32 % samples.rect.width, i as u32 / samples.rect.width);
                let at = (samples.rect.y + y) as usize * self.width as usize + (samples.rect.x + x) as usize;
                for value in values {
                    sums[at].0 += value.as_dvec3();
                    sums[at].1 += 1;
                }
            }
        }

        pub fn radiance(&self) -> RadianceImage {
            let mean = |(sum, count): &(DVec3, u32)| (*sum / f64::from((*count).max(1))).as_vec3();
            let pixels = self.sums().iter().map(mean).collect();
            RadianceImage { width: self.width, height: self.height, pixels }
        }

        pub fn preview(&self, width: u32, height: u32, base: Option<&RadianceImage>) -> RadianceImage {
            let mut pixels = Vec::new();
            for y in 0..height {
                for x in 0..width {
                    let at = (y * self.height / height * self.width + x * self.width / width) as usize;
                    let (sum, count) = self.sums()[at];
                    let fallback = base.map_or(Vec3::ZERO, |b| b.pixels[(y * width + x) as usize]);
                    pixels.push(if count == 0 { fallback } else { (sum / f64::from(count)).as_vec3() });
                }
            }
            RadianceImage { width, height, pixels }
        }

        pub fn samples(&self) -> SampleStats {
            let sums = self.sums();
            let inside = |i: &usize| {
                let (x, y) = (*i as u32 % self.width, *i as u32 / self.width);
                x >= self.area.x
                    && y >= self.area.y
                    && x < self.area.x + self.area.width
                    && y < self.area.y + self.area.height
            };
            let counts: Vec<u32> = (0..sums.len()).filter(inside).map(|i| sums[i].1).collect();
            let sum: f64 = counts.iter().map(|c| f64::from(*c)).sum();
            let (min, max) = (counts.iter().min().copied(), counts.iter().max().copied());
            SampleStats { min: min.unwrap_or(0), mean: sum / counts.len() as f64, max: max.unwrap_or(0) }
        }

        pub fn set_complete(&self, _complete: bool) {}

        pub fn non_finite_samples(&self) -> u64 {
            0
        }
    }
}

pub mod output {
    use std::path::{Path, PathBuf};

    use super::film::tone::{ToneMapping, develop};
    use crate::film::RadianceImage;

    #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
    pub enum Format {
        Png,
        Exr,
        Hdr,
        Jpeg,
        Ppm,
    }

    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
    pub enum BitDepth {
        #[default]
        Eight,
        Sixteen,
    }

    impl TryFrom<u8> for BitDepth {
        type Error = OutputError;

        fn try_from(bits: u8) -> Result<Self, OutputError> {
            Ok(if bits == 16 { Self::Sixteen } else { Self::Eight })
        }
    }

    #[derive(Debug, thiserror::Error)]
    #[error("cannot write {}: {reason}", path.display())]
    pub struct OutputError {
        pub path: PathBuf,
        pub reason: String,
    }

    impl Format {
        pub fn check_picture(self, _width: u32, _height: u32, _depth: BitDepth) -> Result<(), OutputError> {
            Ok(())
        }

        pub fn of(path: &Path) -> Result<Self, OutputError> {
            match path.extension().and_then(|e| e.to_str()).unwrap_or("") {
                "png" => Ok(Self::Png),
                "exr" => Ok(Self::Exr),
                "hdr" => Ok(Self::Hdr),
                "jpg" => Ok(Self::Jpeg),
                "ppm" => Ok(Self::Ppm),
                _ => {
                    let reason = "unknown ending; known are png, exr, hdr, jpg, ppm".to_owned();
                    Err(OutputError { path: path.to_owned(), reason })
                }
            }
        }
    }

    #[derive(Clone, Debug)]
    pub struct EncodeOptions {
        pub tone: ToneMapping,
        pub bit_depth: BitDepth,
        pub metadata: Vec<(String, String)>,
    }

    pub fn encode(
        image: &RadianceImage,
        options: &EncodeOptions,
        _format: Format,
    ) -> Result<Vec<u8>, OutputError> {
        let picture = develop(image, &options.tone);
        let mut bytes = format!("P6 {} {} 255\n", picture.width, picture.height).into_bytes();
        bytes.extend(picture.pixels.iter().flatten());
        Ok(bytes)
    }

    pub fn check_target(path: &Path) -> Result<Format, OutputError> {
        let format = Format::of(path)?;
        let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
        if path.is_dir() || !folder.is_dir() {
            let reason = "the folder does not exist, or the name is a folder".to_owned();
            return Err(OutputError { path: path.to_owned(), reason });
        }
        Ok(format)
    }

    pub mod write {
        use std::path::Path;

        use super::OutputError;

        pub fn prepare_process() {}

        pub fn atomic(path: &Path, bytes: &[u8]) -> Result<(), OutputError> {
            let failed = |e: std::io::Error| OutputError { path: path.to_owned(), reason: e.to_string() };
            let temporary = path.with_extension("tmp");
            std::fs::write(&temporary, bytes).map_err(failed)?;
            std::fs::rename(&temporary, path).map_err(failed)
        }
    }
}

pub mod tui {
    use std::path::PathBuf;
    use std::sync::mpsc::Receiver;
    use std::time::Instant;

    use crate::pipeline::protocol::{Command, Event, PreviewSlot};
    use crate::pipeline::settings::Overrides;

    pub enum ColorChoice {
        Auto,
        TrueColor,
        Indexed256,
        Ansi16,
        None,
    }

    pub enum PreviewChoice {
        Auto,
        HalfBlock,
        Ascii,
        None,
    }

    pub struct Changed {
        pub noticed: Instant,
    }

    pub struct Options {
        pub scene: PathBuf,
        pub overrides: Overrides,
        pub color: ColorChoice,
        pub preview: PreviewChoice,
        pub cell_aspect: Option<f32>,
        pub commands: Box<dyn FnMut(Command)>,
        pub events: Receiver<Event>,
        pub previews: PreviewSlot,
        pub changes: Receiver<Changed>,
    }

    pub struct ExitStatus(pub u8);

    #[derive(Debug, thiserror::Error)]
    #[error("standard output is not a terminal: use `--once` to render without one")]
    pub struct TuiError;

    #[allow(clippy::needless_pass_by_value)]
    pub fn run(_options: Options) -> Result<ExitStatus, TuiError> {
        Err(TuiError)
    }
}
