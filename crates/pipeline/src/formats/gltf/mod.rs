//! Reads and imports glTF files.

mod materials;

use std::collections::{BTreeSet, HashMap};
use std::io::Read;
use std::path::{Path, PathBuf};

use self::materials::{MaterialBuilder, TextureFileReference};
use super::foreign::ForeignError;
use super::frame::{CameraPose, FOV, frame_model, round_to_decimals_of_step};
use super::model::{
    DEFAULT_SIZE, Lighting, ModelViewOptions, POLISHED_ROUGHNESS, UsedNames, add_camera_table, add_ground,
    add_lighting, add_render_settings, file_name, model_warning,
};
use super::rounding::{shorten_color, shorten_number, shorten_vector};
use super::{ForeignReadContext, ForeignScene, ImportedScene, scene_from_document};
use crate::assets::gltf::{
    AlphaMode, GltfFile, ImageLocation, ModelCamera, ModelInstance, ModelLight, ModelLightKind,
    ModelMaterial, ModelProjection, ModelScene, TexturedValue,
};
use crate::assets::mesh::ply::write;
use crate::assets::{AssetError, Companion};
use crate::control::ignore_progress;
use crate::math::color::luminance;
use crate::math::{DMat3, DVec3};
use crate::messages::INVISIBLE_MODEL;
use crate::scene::SceneDocumentBuilder;
use crate::scene::diagnostic::{Diagnostic, Severity};
use crate::scene::keys::endings::MAPS;
use crate::settings::{UpAxis, ViewSide};

/// Where the generated scene's meshes and images are stored.
enum SceneAssetLocation<'a> {
    /// In the glTF file and the files it references.
    Inside,
    /// In separate files in this folder, next to the scene.
    Folder(&'a str),
}

/// Source of an exported file's content.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
enum GltfPartOrImage {
    /// A mesh part, written as PLY.
    Part(usize),
    /// An image, copied unchanged.
    Image(usize),
}

/// Reads a glTF file.
pub(super) fn read(path: &Path, context: &ForeignReadContext<'_>) -> Result<ForeignScene, ForeignError> {
    if context.view.up.is_some_and(|up| up != UpAxis::Y) {
        let reason = "glTF files are always y-up; `--up` applies to obj, off, ply and stl";
        return Err(AssetError::malformed(path, None, reason).into());
    }
    let (scene, _) = scene_of_file(path, &SceneAssetLocation::Inside, context)?;
    Ok(scene)
}

/// Converts a glTF file to a scene, and to files in `folder` that contain its meshes and images.
pub(super) fn convert(
    path: &Path,
    folder: &str,
    context: &ForeignReadContext<'_>,
) -> Result<ImportedScene, ForeignError> {
    let &ForeignReadContext { containers, token, .. } = context;
    let (ForeignScene { document, substitutions, .. }, assets) =
        scene_of_file(path, &SceneAssetLocation::Folder(folder), context)?;
    check_scene_before_import(path, context)?;
    let container = containers.open(path, &ignore_progress, token)?;
    let encode = |(name, content)| {
        let bytes = match content {
            GltfPartOrImage::Part(part) => {
                write::encode_ply(&container.build_part_mesh(part, &ignore_progress, token)?.mesh)
            }
            GltfPartOrImage::Image(image) => {
                // Check the content. Otherwise, a malicious glTF file could make the import copy arbitrary
                // files as images.
                container.check_image_decodes(image, token)?;
                container.read_embedded_or_external_image(image, token)?
            }
        };
        Ok((PathBuf::from(name), bytes))
    };
    let files = assets.into_iter().map(encode).collect::<Result<_, AssetError>>()?;
    Ok(ImportedScene { document, files, substitutions, notes: Vec::new() })
}

/// Rejects a file that `glimt check` would reject. Checks the scene that `glimt MODEL` would render instead
/// of the imported one, whose texture files have not been written yet.
fn check_scene_before_import(path: &Path, context: &ForeignReadContext<'_>) -> Result<(), ForeignError> {
    let errors = scene_from_document(read(path, context)?.document, path, &[]).err();
    // Ignore errors about file names, because the imported scene uses different file names.
    let is_relevant = |one: &Diagnostic| one.severity == Severity::Error && !one.message.contains("`file`");
    let first = errors.into_iter().flatten().find(is_relevant);
    first.map_or(Ok(()), |error| Err(AssetError::malformed(path, None, error.message).into()))
}

/// Generates the scene for a glTF file. Also returns the names and contents of the files that the scene
/// references but that do not exist yet. The names are relative to the scene.
fn scene_of_file(
    path: &Path,
    asset_location: &SceneAssetLocation<'_>,
    &ForeignReadContext { view, containers, token, .. }: &ForeignReadContext<'_>,
) -> Result<(ForeignScene, Vec<(String, GltfPartOrImage)>), AssetError> {
    let container = containers.open(path, &ignore_progress, token)?;
    let scene = container.convert_scene(token)?;
    let Some(bounds) = scene.bounds else {
        return Err(AssetError::malformed(path, None, "its scene has no visible faces"));
    };
    let mut builder = SceneBuilder {
        container: &container,
        path,
        asset_location,
        document: SceneDocumentBuilder::default(),
        files: UsedNames::default(),
        assets: Vec::new(),
        names: HashMap::new(),
        images: BTreeSet::new(),
        image_names: scene.images.clone(),
        companions: container.external_buffers().to_vec(),
    };
    builder.add_all(&scene, bounds, view);
    let SceneBuilder { document, assets, images, companions, .. } = builder;
    let is_fully_transparent =
        scene.instances.iter().all(|one| is_fully_transparent(&scene.materials[one.material]));
    let notes = is_fully_transparent.then(|| model_warning(path, INVISIBLE_MODEL)).into_iter().collect();
    let substitutions = scene.notes.into_iter().map(|note| model_warning(path, note)).collect();
    // Previews tolerate unreadable images, but imports do not.
    if let SceneAssetLocation::Folder(_) = asset_location {
        images.into_iter().try_for_each(|image| container.check_image_header(image, token))?;
    }
    let hash = container.main_file_hash();
    Ok((ForeignScene { document, hash, companions, notes, substitutions }, assets))
}

/// Builder for the scene of a glTF file.
struct SceneBuilder<'a> {
    container: &'a GltfFile,
    path: &'a Path,
    asset_location: &'a SceneAssetLocation<'a>,
    document: SceneDocumentBuilder,
    /// File names already used in the folder.
    files: UsedNames,
    /// Names and contents of files that the scene references but that do not exist yet.
    assets: Vec<(String, GltfPartOrImage)>,
    names: HashMap<GltfPartOrImage, String>,
    /// Images that materials use.
    images: BTreeSet<usize>,
    image_names: Vec<String>,
    /// Other files that the scene depends on.
    companions: Vec<Companion>,
}

impl SceneBuilder<'_> {
    fn add_all(&mut self, scene: &ModelScene, bounds: [DVec3; 2], view: ModelViewOptions) {
        // Describe the model and its approximations.
        self.document.add_comment_above_next_table(format!("{}, as glimt shows it.", file_name(self.path)));
        for note in &scene.notes {
            self.document.add_comment_above_next_table(note);
        }
        // Add the render settings, the camera and the lights.
        let own = scene.cameras.first().filter(|_| view.from.is_none());
        let aspect = view.aspect.or(own.and_then(|camera| camera.aspect));
        let size = own
            .and_then(|camera| camera.aspect)
            .map(|aspect| [(DEFAULT_SIZE[1] * aspect).round(), DEFAULT_SIZE[1]]);
        let lighting = match scene.lights.is_empty() {
            true => Lighting::Default { is_polished: scene.materials.iter().any(material_may_cast_caustics) },
            false => Lighting::from_file_light_irradiance(max_irradiance(&scene.lights, bounds)),
        };
        add_render_settings(&mut self.document, size, lighting);
        let eye = match own {
            Some(own) => {
                let eye = camera_pose(own, bounds);
                add_camera_table(&mut self.document, &eye, own.projection);
                eye
            }
            None => {
                let eye = frame_model(
                    bounds,
                    &scene.outline,
                    view.from.unwrap_or(ViewSide::Iso),
                    view.turns,
                    aspect.unwrap_or(DEFAULT_SIZE[0] / DEFAULT_SIZE[1]),
                );
                add_camera_table(&mut self.document, &eye, ModelProjection::Perspective { fov: FOV });
                eye
            }
        };
        add_lighting(&mut self.document, &eye, lighting);
        if !scene.lights.is_empty() {
            self.document
                .add_comment_above_next_table("1 cd in the file is treated as 1 W/sr, and 1 lx as 1 W/m².");
        }
        scene.lights.iter().for_each(|light| self.add_light(light));
        // Add the materials, then the meshes that use them.
        let mut names = UsedNames::default();
        let materials = MaterialBuilder::add_all(&scene.materials, &mut names, self);
        let mut shapes = UsedNames::default();
        for instance in &scene.instances {
            self.add_mesh_table(instance, &materials[instance.material], &mut shapes);
        }
        add_ground(&mut self.document, &mut names, bounds, &eye);
    }

    fn add_light(&mut self, light: &ModelLight) {
        let document = &mut self.document;
        document.start_list_table("light");
        if !light.name.is_empty() {
            document.add_comment_below_header(&light.name);
        }
        match light.kind {
            ModelLightKind::Point => {}
            ModelLightKind::Spot { .. } => document.set("type", "spot"),
            ModelLightKind::Directional => document.set("type", "directional"),
        }
        match light.kind {
            ModelLightKind::Directional => {
                document.set("direction", shorten_vector(light.direction));
                document.set("irradiance", shorten_color(light.intensity));
            }
            ModelLightKind::Point | ModelLightKind::Spot { .. } => {
                document.set("position", shorten_vector(light.position));
                document.set("intensity", shorten_color(light.intensity));
            }
        }
        if let ModelLightKind::Spot { angle, blend } = light.kind {
            document.set("look_at", shorten_vector(light.position + light.direction));
            document.set("angle", shorten_number(angle.min(359.0)));
            document.set("blend", shorten_number(blend));
        }
    }

    fn add_mesh_table(&mut self, instance: &ModelInstance, material: &str, shapes: &mut UsedNames) {
        self.document.start_list_table("mesh");
        if !instance.name.is_empty() {
            self.document.set("name", shapes.make_unique(&instance.name, "mesh"));
        }
        let base = if instance.name.is_empty() { "part" } else { &instance.name };
        match self.asset_location {
            SceneAssetLocation::Inside => {
                self.document.set("file", file_name(self.path));
                self.document.set("part", instance.part as f64);
            }
            SceneAssetLocation::Folder(_) => {
                let name = self.ensure_exported_file(GltfPartOrImage::Part(instance.part), base, "ply");
                self.document.set("file", name);
            }
        }
        self.document.set("material", material.to_owned());
        self.add_placement_keys(&instance.placed.linear, instance.placed.translate);
        if !instance.has_normals {
            self.document.set("smooth", false);
        }
        if instance.has_colors {
            self.document.set("vertex_colors", true);
        }
    }

    /// Adds the placement as `scale` and `translate` if possible, and as `matrix` if not.
    fn add_placement_keys(&mut self, linear: &DMat3, translate: DVec3) {
        let scale = DVec3::new(linear.x_axis.x, linear.y_axis.y, linear.z_axis.z);
        if *linear == DMat3::from_diagonal(scale) {
            if scale != DVec3::ONE {
                self.document.set("scale", shorten_color(scale));
            }
            if translate != DVec3::ZERO {
                self.document.set("translate", shorten_vector(translate));
            }
            return;
        }
        let rows = linear.transpose();
        let row =
            |axis: DVec3, last: f64| [axis.x, axis.y, axis.z, last].map(zero_if_tiny).map(shorten_number);
        let rows =
            [row(rows.x_axis, translate.x), row(rows.y_axis, translate.y), row(rows.z_axis, translate.z)];
        let matrix = [&rows[..], &[[0.0, 0.0, 0.0, 1.0]]].concat().concat();
        self.document.set("matrix", matrix);
    }

    /// Returns the file name for `content`, adding a file if the content is new.
    fn ensure_exported_file(&mut self, content: GltfPartOrImage, wanted: &str, ending: &str) -> String {
        if let Some(known) = self.names.get(&content) {
            return known.clone();
        }
        let folder = match self.asset_location {
            SceneAssetLocation::Inside => String::new(),
            SceneAssetLocation::Folder(folder) => format!("{folder}/"),
        };
        let plain: String =
            wanted.chars().map(|c| if c.is_alphanumeric() || "-_.".contains(c) { c } else { '_' }).collect();
        let plain = plain.trim_matches('.').chars().take(60).collect::<String>().to_lowercase();
        let name = format!("{folder}{}.{ending}", self.files.make_unique(&plain, "part"));
        self.assets.push((name.clone(), content));
        self.names.insert(content, name.clone());
        name
    }

    /// Returns the name of an image, without an extension.
    fn image_stem(&self, image: usize) -> String {
        let name = self.image_names.get(image).filter(|name| !name.is_empty()).cloned();
        let of_file = || match self.container.locate_image(image) {
            Ok(ImageLocation::File(path)) => path.file_stem().map(|stem| stem.to_string_lossy().into_owned()),
            Ok(ImageLocation::Inside(_)) | Err(_) => None,
        };
        name.or_else(of_file).unwrap_or_else(|| format!("image_{image}"))
    }

    /// Returns the file that contains an image.
    fn image_file_reference(&mut self, image: usize) -> TextureFileReference {
        self.images.insert(image);
        let bytes = self.container.locate_image(image);
        match (self.asset_location, bytes) {
            (SceneAssetLocation::Inside, Ok(ImageLocation::File(file)))
                if lowercase_image_extension(&file).is_some() && file.is_file() =>
            {
                let folder = self.path.parent().unwrap_or(Path::new(""));
                let name = file.strip_prefix(folder).unwrap_or(&file);
                TextureFileReference { file: name.to_string_lossy().into_owned(), image: None }
            }
            // A file without an image extension is read through the glTF file, so that its format is detected
            // from its content. A missing file is watched until it appears.
            (SceneAssetLocation::Inside, bytes) => {
                if let Ok(ImageLocation::File(file)) = bytes {
                    self.companions.push(Companion { path: file, hash: None, stamp: None });
                }
                TextureFileReference { file: file_name(self.path), image: Some(image) }
            }
            (SceneAssetLocation::Folder(_), bytes) => {
                let ending = match &bytes {
                    Ok(ImageLocation::Inside(bytes)) => sniff_image_extension(bytes).to_owned(),
                    Ok(ImageLocation::File(path)) => lowercase_image_extension(path).unwrap_or_else(|| {
                        sniff_image_extension(&read_first_four_bytes(path).unwrap_or_default()).to_owned()
                    }),
                    Err(_) => "png".to_owned(),
                };
                let wanted = self.image_stem(image);
                let name = self.ensure_exported_file(GltfPartOrImage::Image(image), &wanted, &ending);
                TextureFileReference { file: name, image: None }
            }
        }
    }
}

/// Returns a file's extension in lowercase if it is an image extension.
fn lowercase_image_extension(file: &Path) -> Option<String> {
    let extension = file.extension()?.to_string_lossy().to_lowercase();
    MAPS.contains(&extension.as_str()).then_some(extension)
}

/// Whether a material is fully transparent everywhere.
fn is_fully_transparent(material: &ModelMaterial) -> bool {
    let is_clear = match &material.alpha {
        AlphaMode::Opaque => false,
        AlphaMode::Mask { value, cutoff } => value.factor.x < *cutoff,
        AlphaMode::Blend(value) => value.factor.x == 0.0,
    };
    is_clear && material.glass.is_none()
}

/// Whether a material may cast caustics. Assumes that a texture may contain any value up to its factor.
fn material_may_cast_caustics(material: &ModelMaterial) -> bool {
    let is_smooth =
        |roughness: &TexturedValue| roughness.texture.is_some() || roughness.factor.x < POLISHED_ROUGHNESS;
    let reflects = material.metallic.factor.x > 0.0 || material.specular.factor.x > 0.0;
    let is_coated = material.clearcoat.factor.x > 0.0 && is_smooth(&material.clearcoat_roughness);
    is_coated || is_smooth(&material.roughness) && (reflects || material.transmission.factor.x > 0.0)
}

/// Upper bound on the total irradiance at the center of a bounding box, assuming normal incidence from all
/// lights. Distances to lights are clamped to at least a quarter of the box's diagonal.
fn max_irradiance(lights: &[ModelLight], [min, max]: [DVec3; 2]) -> f64 {
    let (middle, size) = ((min + max) * 0.5, (max - min).length());
    let of_light = |light: &ModelLight| {
        let luminance = f64::from(luminance(light.intensity.as_vec3()));
        match light.kind {
            ModelLightKind::Directional => luminance,
            ModelLightKind::Point | ModelLightKind::Spot { .. } => {
                let distance = light.position.distance(middle).max(size * 0.25).max(1e-12);
                luminance / (distance * distance)
            }
        }
    };
    lights.iter().map(of_light).sum()
}

/// Reads the first four bytes of a file, or returns `None` if this fails.
fn read_first_four_bytes(path: &Path) -> Option<[u8; 4]> {
    let (mut file, _) = crate::system::file::open_regular_file(path).ok()?.ok()?;
    let mut start = [0; 4];
    file.read_exact(&mut start).ok().map(|()| start)
}

/// Detects an image format from a file's first bytes and returns the extension for it.
fn sniff_image_extension(bytes: &[u8]) -> &'static str {
    if bytes.starts_with(b"\xff\xd8") {
        "jpg"
    } else if bytes.starts_with(b"RIFF") {
        "webp"
    } else {
        "png"
    }
}

/// Replaces near-zero values, which result from rotations by right angles, with zero.
fn zero_if_tiny(value: f64) -> f64 {
    if value.abs() < 1e-12 { 0.0 } else { value }
}

/// Converts a camera from the file. Places `look_at` on its view axis, at the depth of the model's center.
fn camera_pose(camera: &ModelCamera, [min, max]: [DVec3; 2]) -> CameraPose {
    let size = (max - min).length().max(1e-12);
    let depth = ((min + max) * 0.5 - camera.position).dot(camera.direction).max(size * 0.05);
    let look_at = camera.position + camera.direction * depth;
    let step = size.min(depth) * 1e-6;
    let tidy = |at: DVec3| DVec3::from(at.to_array().map(|part| round_to_decimals_of_step(part, step)));
    let up = if (camera.up - DVec3::Y).length() < 1e-6 || has_no_roll(camera) { DVec3::Y } else { camera.up };
    CameraPose { position: tidy(camera.position), look_at: tidy(look_at), up }
}

/// Whether the camera has no roll. If so, using the y axis as the up vector produces the same view.
fn has_no_roll(camera: &ModelCamera) -> bool {
    let side = camera.direction.cross(DVec3::Y);
    side.length() > 1e-3 && camera.up.dot(side.normalize()).abs() < 1e-6 && camera.up.y > 0.0
}
