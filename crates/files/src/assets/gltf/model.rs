//! Traverses the nodes in a glTF file to find its instances, lights and cameras.

mod bounds;
mod cameras;
mod lights;
mod transforms;

use std::collections::HashMap;

use super::accessor::AccessorReader;
use super::description::{AffineMap, AlphaMode, ImportNotes, ModelInstance, ModelMaterial, ModelScene};
use super::json::Primitive;
use super::materials::convert_material;
use super::{GltfError, GltfFile};
use crate::assets::AssetError;
use crate::control::CancelToken;
use lights::check_intensity_limit;
use transforms::{WorldTransforms, check_transform_magnitude, is_invertible};

/// Limit on coordinates, transform entries and light intensities. It is lower than the limit of 10¹⁸ for
/// scenes because cameras are placed several model sizes away.
const MAX_MAGNITUDE: f64 = 1e15;
/// Maximum number of instances per file.
const MAX_INSTANCES: usize = 1 << 20;

impl GltfFile {
    /// Converts the file's default scene, or the first scene if there is no default, or all nodes if there
    /// are no scenes.
    ///
    /// # Errors
    /// [`AssetError::Malformed`] with the location in the JSON.
    pub fn convert_scene(&self, token: &CancelToken) -> Result<ModelScene, AssetError> {
        let mut walk = SceneWalk {
            container: self,
            scene: ModelScene::default(),
            notes: ImportNotes::default(),
            materials: HashMap::new(),
        };
        walk.add_default_scene_nodes().map_err(|wrong| self.malformed_error(wrong))?;
        let SceneWalk { mut scene, notes, .. } = walk;
        scene.notes = notes.0;
        scene.images = self.root.images.iter().map(|image| image.name.clone()).collect();
        self.measure_bounds_and_outline(&mut scene, token)?;
        Ok(scene)
    }
}

/// State of a node hierarchy traversal, including the results so far.
struct SceneWalk<'a> {
    container: &'a GltfFile,
    scene: ModelScene,
    notes: ImportNotes,
    /// Maps a material's index in the file and its texture coordinate sets to the index of the converted
    /// material. Primitives without a material share a default material.
    materials: HashMap<(Option<usize>, [usize; 2]), usize>,
}

impl SceneWalk<'_> {
    fn add_default_scene_nodes(&mut self) -> Result<(), GltfError> {
        let root = &self.container.root;
        // Find the root nodes.
        let number = root.scene.unwrap_or_default();
        let roots: Vec<usize> = match root.scenes.get(number) {
            Some(scene) => scene.nodes.clone(),
            None if root.scenes.is_empty() => {
                let children: std::collections::HashSet<usize> =
                    root.nodes.iter().flat_map(|node| node.children.iter().copied()).collect();
                (0..root.nodes.len()).filter(|node| !children.contains(node)).collect()
            }
            None => return Err(GltfError::index_out_of_range("scenes", number, root.scenes.len())),
        };
        if roots.is_empty() && !root.nodes.is_empty() && root.scenes.is_empty() {
            return Err(GltfError::new("nodes: there is no root because every node is a child"));
        }
        if root.scenes.len() > 1 {
            let others = root.scenes.len() - 1;
            self.notes.add("scenes", &format!("{others} skipped; only scenes[{number}] is shown"));
        }
        if !root.animations.is_empty() {
            let count = root.animations.len();
            self.notes.add("animations", &format!("{count} skipped; the model is shown at rest"));
        }
        // Place all nodes. Visiting a node twice means a cycle or a second parent.
        let worlds = self.world_transforms(&roots)?;
        for &(node, placed, is_visible) in &worlds.order {
            self.add_node_contents(node, placed, is_visible, &worlds)
                .map_err(|wrong| wrong.add_location(format!("nodes[{node}]")))?;
        }
        Ok(())
    }

    /// Adds the contents of a node. A hidden node contributes only its camera.
    fn add_node_contents(
        &mut self,
        number: usize,
        placed: AffineMap,
        is_visible: bool,
        worlds: &WorldTransforms,
    ) -> Result<(), GltfError> {
        let container = self.container;
        let root = &container.root;
        let node = &root.nodes[number];
        let place = format!("nodes[{number}]");
        let shows = node.mesh.is_some() || node.extensions.light.is_some();
        if node.camera.is_some() || (is_visible && shows) {
            check_transform_magnitude(node, &placed)?;
        }
        if let Some(camera) = node.camera {
            let json = root
                .cameras
                .get(camera)
                .ok_or_else(|| GltfError::index_out_of_range("cameras", camera, root.cameras.len()))?;
            self.add_camera(json, &node.name, placed, &place);
        }
        if !is_visible {
            return Ok(());
        }
        if let Some(light) = &node.extensions.light {
            let lights = &root.extensions.lights.lights;
            let json = lights
                .get(light.light)
                .ok_or_else(|| GltfError::index_out_of_range("lights", light.light, lights.len()))?;
            check_intensity_limit(json, light.light)?;
            self.add_light(json, &node.name, placed, &place);
        }
        if node.extensions.instancing.is_some() {
            self.notes.add(&place, "instances are skipped: EXT_mesh_gpu_instancing is not supported");
        }
        let Some(mesh) = node.mesh else { return Ok(()) };
        let json = root
            .meshes
            .get(mesh)
            .ok_or_else(|| GltfError::index_out_of_range("meshes", mesh, root.meshes.len()))?;
        if json.weights.iter().chain(&node.weights).any(|weight| *weight != 0.0) {
            self.notes.add(&place, "morph targets are ignored; the base shape is shown");
        }
        let placed = match node.skin {
            Some(skin) => self.bind_pose_transform(skin, worlds, &place)?.unwrap_or(placed),
            None => placed,
        };
        let is_usable = placed.translate.is_finite() && is_invertible(&placed.linear);
        if !is_usable {
            self.notes.add(&place, "skipped: its transform is singular");
            return Ok(());
        }
        let first: usize = root.meshes[..mesh].iter().map(|mesh| mesh.primitives.len()).sum();
        let name = if node.name.is_empty() { &json.name } else { &node.name };
        for (index, primitive) in json.primitives.iter().enumerate() {
            if !primitive.has_faces() {
                self.notes
                    .add(&format!("meshes[{mesh}].primitives[{index}]"), "points and lines are skipped");
                continue;
            }
            if self.scene.instances.len() >= MAX_INSTANCES {
                return Err(GltfError::new(format!("more than {MAX_INSTANCES} primitive instances")));
            }
            let material =
                self.find_or_convert_material(primitive.material, container.select_two_uv_sets(primitive))?;
            let colors = container.open_attribute_accessor(primitive, "COLOR_0")?;
            self.note_ignored_attributes(
                &format!("meshes[{mesh}].primitives[{index}]"),
                primitive,
                material,
                &colors,
            );
            self.scene.instances.push(ModelInstance {
                name: name.clone(),
                node: number,
                part: container.first_part_with_same_mesh(first + index),
                placed,
                material,
                has_normals: primitive.attributes.contains_key("NORMAL"),
                has_colors: colors.is_some(),
            });
        }
        Ok(())
    }

    /// Adds notes about ignored vertex attributes that would affect the primitive's material.
    fn note_ignored_attributes(
        &mut self,
        place: &str,
        primitive: &Primitive,
        material: usize,
        colors: &Option<AccessorReader<'_>>,
    ) {
        let material = &self.scene.materials[material];
        let has_alpha = |colors: &AccessorReader<'_>| {
            colors.width == 4
                && (0..colors.count).any(|vertex| colors.element_floats::<4>(vertex, 1.0)[3] < 1.0)
        };
        if material.alpha != AlphaMode::Opaque && colors.as_ref().is_some_and(has_alpha) {
            self.notes.add(place, "vertex color alpha is ignored");
        }
        if material.normal.is_some() && primitive.attributes.contains_key("TANGENT") {
            self.notes.add(place, "tangents are ignored; the normal map follows the texture coordinates");
        }
    }

    /// Returns the index of a material, converting the material on first use.
    fn find_or_convert_material(
        &mut self,
        number: Option<usize>,
        sets: [usize; 2],
    ) -> Result<usize, GltfError> {
        if let Some(known) = self.materials.get(&(number, sets)) {
            return Ok(*known);
        }
        let materials = &self.container.root.materials;
        let read = match number {
            Some(number) if number < materials.len() => {
                convert_material(self.container, number, sets, &mut self.notes)?
            }
            Some(number) => return Err(GltfError::index_out_of_range("materials", number, materials.len())),
            None => ModelMaterial::named_gray_dielectric("default"),
        };
        self.scene.materials.push(read);
        let index = self.scene.materials.len() - 1;
        self.materials.insert((number, sets), index);
        Ok(index)
    }
}

/// Error message for a node that is visited twice.
pub(super) fn node_visited_twice_message(node: usize) -> String {
    format!("nodes[{node}] is its own ancestor or has two parents")
}

/// Note about a camera whose type is unknown.
pub(super) const UNKNOWN_CAMERA: &str = "the camera is skipped: it is neither perspective nor orthographic";
