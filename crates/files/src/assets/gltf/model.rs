//! Traverses the nodes in a glTF file to find its instances, lights and cameras.

use std::collections::HashMap;
use std::collections::hash_map::Entry;

use super::accessor::AccessorReader;
use super::description::{
    AffineMap, AlphaMode, ImportNotes, ModelCamera, ModelInstance, ModelLight, ModelLightKind, ModelMaterial,
    ModelProjection, ModelScene,
};
use super::json::{JsonCamera, JsonLight, JsonNode, Primitive};
use super::materials::convert_material;
use super::{GltfError, GltfFile};
use crate::assets::AssetError;
use crate::control::{CancelToken, ignore_progress};
use crate::geometry::mesh::TriangleMesh;
use crate::math::{DMat3, DVec3};

/// Maximum total number of instance vertices for which the bounds are exact.
const MAX_MEASURED: usize = 20_000_000;
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
        walk.add_all_nodes().map_err(|wrong| self.malformed_error(wrong))?;
        let SceneWalk { mut scene, notes, .. } = walk;
        scene.notes = notes.0;
        scene.images = self.root.images.iter().map(|image| image.name.clone()).collect();
        self.measure_bounds_and_outline(&mut scene, token)?;
        Ok(scene)
    }

    /// Computes the bounds and outline of the instances. Unless all parts are invalid, skips the invalid
    /// parts, whose errors are reported when they are loaded.
    fn measure_bounds_and_outline(
        &self,
        scene: &mut ModelScene,
        token: &CancelToken,
    ) -> Result<(), AssetError> {
        let mut parts: HashMap<usize, (TriangleMesh, Vec<DVec3>)> = HashMap::new();
        let (mut vertices, mut first_wrong) = (0, None);
        for instance in &scene.instances {
            let (mesh, extremes) = match parts.entry(instance.part) {
                Entry::Occupied(known) => &*known.into_mut(),
                Entry::Vacant(new) => match self.build_part_mesh(instance.part, &ignore_progress, token) {
                    Err(AssetError::Canceled(canceled)) => return Err(canceled.into()),
                    loaded => {
                        let mesh = loaded.map(|loaded| loaded.mesh).unwrap_or_else(|wrong| {
                            first_wrong.get_or_insert(wrong);
                            TriangleMesh::default()
                        });
                        let extremes = mesh.extreme_vertices();
                        new.insert((mesh, extremes))
                    }
                },
            };
            let placed = &instance.placed;
            scene.outline.extend(extremes.iter().map(|at| placed.transform_point(*at)));
            // Measure every vertex until the limit is reached, then only extreme points.
            vertices += mesh.positions.len();
            let all = mesh.positions.iter().map(|at| at.as_dvec3() + mesh.origin);
            let few = extremes.iter().copied();
            let places: &mut dyn Iterator<Item = DVec3> =
                if vertices <= MAX_MEASURED { &mut { all } } else { &mut { few } };
            for at in places.map(|at| placed.transform_point(at)) {
                let [min, max] = scene.bounds.unwrap_or([at; 2]);
                scene.bounds = Some([min.min(at), max.max(at)]);
            }
            if let Some([min, max]) = scene.bounds
                && !(min.abs().max(max.abs()).max_element() < MAX_MAGNITUDE)
            {
                let farthest = min.abs().max(max.abs()).max_element();
                let wrong = GltfError::new(format!(
                    "its mesh extends to {farthest:e}, but must stay below {MAX_MAGNITUDE:e}"
                ));
                return Err(self.malformed_error(wrong.add_location(format!("nodes[{}]", instance.node))));
            }
            token.check_pause_and_cancel()?;
        }
        match (scene.bounds, first_wrong) {
            (None, Some(wrong)) => Err(wrong),
            (None, None) | (Some(_), _) => Ok(()),
        }
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
    fn add_all_nodes(&mut self) -> Result<(), GltfError> {
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
            self.add_node(node, placed, is_visible, &worlds)
                .map_err(|wrong| wrong.add_location(format!("nodes[{node}]")))?;
        }
        Ok(())
    }

    fn world_transforms(&self, roots: &[usize]) -> Result<WorldTransforms, GltfError> {
        let nodes = &self.container.root.nodes;
        let mut worlds = WorldTransforms { order: Vec::new(), of_node: vec![None; nodes.len()] };
        let mut pending: Vec<(usize, AffineMap, bool)> =
            roots.iter().rev().map(|node| (*node, AffineMap::IDENTITY, true)).collect();
        while let Some((number, parent, is_parent_visible)) = pending.pop() {
            let node = nodes
                .get(number)
                .ok_or_else(|| GltfError::index_out_of_range("nodes", number, nodes.len()))?;
            if worlds.of_node[number].is_some() {
                return Err(GltfError::new(node_visited_twice_message(number)));
            }
            let placed = parent.compose(local_transform(node));
            worlds.of_node[number] = Some(placed);
            let hides = node.extensions.visibility.as_ref().is_some_and(|visibility| !visibility.visible);
            let is_visible = is_parent_visible && !hides;
            worlds.order.push((number, placed, is_visible));
            pending.extend(node.children.iter().rev().map(|child| (*child, placed, is_visible)));
        }
        Ok(worlds)
    }

    /// Adds the contents of a node. A hidden node contributes only its camera.
    fn add_node(
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

    /// Transform of a skin in its bind pose (glTF 2.0, 3.7.3). In this pose, all joints yield the same
    /// transform, so only the first joint is evaluated.
    fn bind_pose_transform(
        &mut self,
        number: usize,
        worlds: &WorldTransforms,
        place: &str,
    ) -> Result<Option<AffineMap>, GltfError> {
        let root = &self.container.root;
        let skin = root
            .skins
            .get(number)
            .ok_or_else(|| GltfError::index_out_of_range("skins", number, root.skins.len()))?;
        self.notes.add(place, "the skin is shown in its bind pose");
        let joint = skin.joints.first().and_then(|joint| *worlds.of_node.get(*joint)?);
        let Some(joint) = joint else { return Ok(None) };
        let bind = match skin.inverse_bind_matrices {
            Some(accessor) => {
                let numbers = AccessorReader::open(self.container, accessor)?;
                if numbers.count == 0 || numbers.width != 16 {
                    return Err(
                        GltfError::new("expected a matrix").add_location(format!("accessors[{accessor}]"))
                    );
                }
                affine_from_column_major(numbers.element_floats::<16>(0, 0.0).map(f64::from))
            }
            None => AffineMap::IDENTITY,
        };
        Ok(Some(joint.compose(bind)))
    }

    fn add_light(&mut self, json: &JsonLight, node: &str, placed: AffineMap, place: &str) {
        let kind = match json.kind.as_str() {
            "point" => ModelLightKind::Point,
            "directional" => ModelLightKind::Directional,
            "spot" => {
                let outer = json.spot.outer_cone_angle.clamp(1e-3, std::f64::consts::FRAC_PI_2);
                let inner = json.spot.inner_cone_angle.clamp(0.0, outer);
                if inner < outer {
                    self.notes
                        .add(place, "the falloff between the light's inner and outer cones is approximate");
                }
                ModelLightKind::Spot { angle: 2.0 * outer.to_degrees(), blend: 1.0 - inner / outer }
            }
            other => {
                self.notes.add(
                    place,
                    &format!("a light of unknown type {:?} is skipped", super::truncate_for_message(other)),
                );
                return;
            }
        };
        if json.range.is_some() {
            self.notes.add(place, "the light's range is ignored; it falls off with the squared distance");
        }
        let intensity = DVec3::from(json.color) * json.intensity;
        let direction = (placed.linear * DVec3::NEG_Z).normalize_or(DVec3::NEG_Z);
        let usable = intensity.is_finite() && intensity.min_element() >= 0.0 && placed.translate.is_finite();
        if !usable {
            self.notes.add(place, "a light with negative or nonfinite values is skipped");
            return;
        }
        let name = if json.name.is_empty() { node } else { &json.name };
        self.scene.lights.push(ModelLight {
            name: name.to_owned(),
            kind,
            intensity,
            position: placed.translate,
            direction,
        });
    }

    fn add_camera(&mut self, json: &JsonCamera, node: &str, placed: AffineMap, place: &str) {
        let direction = (placed.linear * DVec3::NEG_Z).try_normalize();
        let up = (placed.linear * DVec3::Y).try_normalize();
        let (Some(direction), Some(up)) = (direction, up) else { return };
        let position = placed.translate;
        let (projection, is_in_range, aspect) = match (&json.perspective, &json.orthographic) {
            (Some(lens), _) => {
                let fov = lens.yfov.to_degrees();
                (ModelProjection::Perspective { fov }, fov > 0.0 && fov < 180.0, lens.aspect_ratio)
            }
            (None, Some(lens)) => {
                let view_height = 2.0 * lens.ymag.abs();
                let is_in_range = view_height > 1.0 / MAX_MAGNITUDE && view_height < MAX_MAGNITUDE;
                let aspect = lens.xmag.map(|xmag| (xmag / lens.ymag).abs());
                (ModelProjection::Orthographic { view_height }, is_in_range, aspect)
            }
            (None, None) => {
                return self.notes.add(place, UNKNOWN_CAMERA);
            }
        };
        if position.abs().max_element() < MAX_MAGNITUDE && is_in_range {
            let name = if json.name.is_empty() { node } else { &json.name };
            let aspect = aspect.filter(|aspect| *aspect > 0.05 && *aspect < 20.0);
            self.scene.cameras.push(ModelCamera {
                name: name.to_owned(),
                position,
                direction,
                up,
                projection,
                aspect,
            });
        } else {
            self.notes.add(place, "the camera is skipped: invalid position, field of view or size");
        }
    }
}

/// Error message for a node that is visited twice.
pub(super) fn node_visited_twice_message(node: usize) -> String {
    format!("nodes[{node}] is its own ancestor or has two parents")
}

/// Note about a camera whose type is unknown.
pub(super) const UNKNOWN_CAMERA: &str = "the camera is skipped: it is neither perspective nor orthographic";

/// Rejects transforms with entries above the limit. If one of the node's own properties exceeds the limit,
/// the error names that property.
fn check_transform_magnitude(node: &JsonNode, placed: &AffineMap) -> Result<(), GltfError> {
    let largest = |numbers: &[f64]| numbers.iter().fold(0.0_f64, |largest, number| largest.max(number.abs()));
    let all = |placed: &AffineMap| {
        largest(&placed.linear.to_cols_array()).max(largest(&placed.translate.to_array()))
    };
    if all(placed) < MAX_MAGNITUDE {
        return Ok(());
    }
    let own = [
        ("scale", node.scale.as_ref().map(|numbers| &numbers[..])),
        ("translation", node.translation.as_ref().map(|numbers| &numbers[..])),
        ("matrix", node.matrix.as_ref().map(|numbers| &numbers[..])),
    ];
    let of_own = own.into_iter().filter_map(|(name, numbers)| Some((name, largest(numbers?))));
    Err(GltfError::new(
        match of_own.max_by(|a, b| a.1.total_cmp(&b.1)).filter(|(_, value)| *value >= MAX_MAGNITUDE) {
            Some((name, value)) => {
                format!("its {name} contains {value:e}, but must stay below {MAX_MAGNITUDE:e}")
            }
            None => format!(
                "its transform, including its ancestors', contains {:e}, but must stay below {MAX_MAGNITUDE:e}",
                all(placed)
            ),
        },
    ))
}

/// Rejects lights with an intensity above the limit.
fn check_intensity_limit(json: &JsonLight, number: usize) -> Result<(), GltfError> {
    let brightest = json.color.iter().fold(0.0_f64, |max, part| max.max(*part)) * json.intensity;
    if brightest < MAX_MAGNITUDE || !(json.intensity > 0.0) {
        return Ok(());
    }
    let name = if json.name.is_empty() {
        String::new()
    } else {
        format!(" {:?}", super::truncate_for_message(&json.name))
    };
    let intensity = json.intensity;
    Err(GltfError::new(format!(
        "its light lights[{number}]{name} has intensity {intensity:e}, but must stay below {MAX_MAGNITUDE:e}"
    )))
}

/// World transforms of all nodes.
struct WorldTransforms {
    /// Nodes in traversal order, each with its transform and visibility (`KHR_node_visibility`).
    order: Vec<(usize, AffineMap, bool)>,
    /// Transform of each node, or `None` for nodes outside the scene.
    of_node: Vec<Option<AffineMap>>,
}

/// Whether a matrix is neither singular nor nearly singular.
fn is_invertible(linear: &DMat3) -> bool {
    let [x, y, z] = [linear.x_axis, linear.y_axis, linear.z_axis];
    let (volume, edges) = (x.cross(y).dot(z), x.length() * y.length() * z.length());
    edges.is_finite() && volume.abs() > 1e-9 * edges && [x, y, z].iter().all(|axis| axis.length() > 1e-15)
}

/// Transform of a node relative to its parent.
fn local_transform(node: &JsonNode) -> AffineMap {
    if let Some(matrix) = node.matrix {
        return affine_from_column_major(matrix);
    }
    let [x, y, z, w] = node.rotation.unwrap_or([0.0, 0.0, 0.0, 1.0]);
    let length = (x * x + y * y + z * z + w * w).sqrt();
    let [x, y, z, w] =
        if length > 0.0 { [x, y, z, w].map(|part| part / length) } else { [0.0, 0.0, 0.0, 1.0] };
    // Convert the unit quaternion to a matrix.
    let rotation = DMat3::from_cols(
        DVec3::new(1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + z * w), 2.0 * (x * z - y * w)),
        DVec3::new(2.0 * (x * y - z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + x * w)),
        DVec3::new(2.0 * (x * z + y * w), 2.0 * (y * z - x * w), 1.0 - 2.0 * (x * x + y * y)),
    );
    let scale = DVec3::from(node.scale.unwrap_or([1.0; 3]));
    AffineMap {
        linear: rotation * DMat3::from_diagonal(scale),
        translate: DVec3::from(node.translation.unwrap_or_default()),
    }
}

/// Affine transform from a column-major 4 × 4 matrix.
fn affine_from_column_major(matrix: [f64; 16]) -> AffineMap {
    let column = |first: usize| DVec3::new(matrix[first], matrix[first + 1], matrix[first + 2]);
    AffineMap { linear: DMat3::from_cols(column(0), column(4), column(8)), translate: column(12) }
}
