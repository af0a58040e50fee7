//! The scene of a glTF file: a walk through its nodes.

use std::collections::HashMap;
use std::collections::hash_map::Entry;

use super::accessor::Numbers;
use super::description::{
    Alpha, ModelCamera, ModelInstance, ModelLight, ModelLightKind, ModelMaterial, ModelScene, Notes, Placed,
};
use super::json::{Camera, Light, Node, Primitive};
use super::materials::material;
use super::{Container, Wrong};
use crate::assets::AssetError;
use crate::control::{CancelToken, ignore_progress};
use crate::geometry::mesh::TriangleMesh;
use crate::math::{DMat3, DVec3};

/// Most vertices, those of instances counted, that are all measured.
const MOST_MEASURED: usize = 20_000_000;
/// Most that a coordinate, a factor of a placement or the intensity of a light may be: scenes take less than 10¹⁸, and cameras stand
/// some sizes of the model away.
const MOST: f64 = 1e15;
/// Most placed parts of a file.
const MOST_INSTANCES: usize = 1 << 20;

impl Container {
    /// Returns what the file's scene shows: the one that it names, else the first, else all nodes.
    ///
    /// # Errors
    /// [`AssetError::Malformed`] with the place in the JSON.
    pub fn scene(&self, token: &CancelToken) -> Result<ModelScene, AssetError> {
        let mut walk = Walk {
            container: self,
            scene: ModelScene::default(),
            notes: Notes::default(),
            materials: HashMap::new(),
        };
        walk.run().map_err(|wrong| self.wrong(wrong))?;
        let Walk { mut scene, notes, .. } = walk;
        scene.notes = notes.0;
        scene.images = self.root.images.iter().map(|image| image.name.clone()).collect();
        self.measure(&mut scene, token)?;
        Ok(scene)
    }

    /// Finds bounds and outline of the instances. Parts that are wrong are left to whoever loads them, unless all are.
    fn measure(&self, scene: &mut ModelScene, token: &CancelToken) -> Result<(), AssetError> {
        let mut parts: HashMap<usize, (TriangleMesh, Vec<DVec3>)> = HashMap::new();
        let (mut vertices, mut first_wrong) = (0, None);
        for instance in &scene.instances {
            let (mesh, extremes) = match parts.entry(instance.part) {
                Entry::Occupied(known) => &*known.into_mut(),
                Entry::Vacant(new) => match self.part(instance.part, &ignore_progress, token) {
                    Err(AssetError::Cancelled(cancelled)) => return Err(cancelled.into()),
                    loaded => {
                        let mesh = loaded.map(|loaded| loaded.mesh).unwrap_or_else(|wrong| {
                            first_wrong.get_or_insert(wrong);
                            TriangleMesh::default()
                        });
                        let extremes = mesh.extremes();
                        new.insert((mesh, extremes))
                    }
                },
            };
            let placed = &instance.placed;
            scene.outline.extend(extremes.iter().map(|at| placed.point(*at)));
            // All vertices count as long as they are not too many.
            vertices += mesh.positions.len();
            let all = mesh.positions.iter().map(|at| at.as_dvec3() + mesh.origin);
            let few = extremes.iter().copied();
            let places: &mut dyn Iterator<Item = DVec3> =
                if vertices <= MOST_MEASURED { &mut { all } } else { &mut { few } };
            for at in places.map(|at| placed.point(at)) {
                let [least, greatest] = scene.bounds.unwrap_or([at; 2]);
                scene.bounds = Some([least.min(at), greatest.max(at)]);
            }
            if let Some([least, greatest]) = scene.bounds
                && !(least.abs().max(greatest.abs()).max_element() < MOST)
            {
                let farthest = least.abs().max(greatest.abs()).max_element();
                let wrong =
                    Wrong::new(format!("its mesh reaches to {farthest:e}, and must stay below {MOST:e}"));
                return Err(self.wrong(wrong.inside(format!("nodes[{}]", instance.node))));
            }
            token.check()?;
        }
        match (scene.bounds, first_wrong) {
            (None, Some(wrong)) => Err(wrong),
            (None, None) | (Some(_), _) => Ok(()),
        }
    }
}

/// A walk through the nodes.
struct Walk<'a> {
    container: &'a Container,
    scene: ModelScene,
    notes: Notes,
    /// Index of each of the file's materials, or of the one for primitives without any, by the sets of coordinates.
    materials: HashMap<(Option<usize>, [usize; 2]), usize>,
}

impl Walk<'_> {
    fn run(&mut self) -> Result<(), Wrong> {
        let root = &self.container.root;
        // Find the nodes to begin with.
        let number = root.scene.unwrap_or_default();
        let roots: Vec<usize> = match root.scenes.get(number) {
            Some(scene) => scene.nodes.clone(),
            None if root.scenes.is_empty() => {
                let children: std::collections::HashSet<usize> =
                    root.nodes.iter().flat_map(|node| node.children.iter().copied()).collect();
                (0..root.nodes.len()).filter(|node| !children.contains(node)).collect()
            }
            None => return Err(Wrong::index("scenes", number, root.scenes.len())),
        };
        if roots.is_empty() && !root.nodes.is_empty() && root.scenes.is_empty() {
            return Err(Wrong::new("nodes: each is a child of another, so that there is none to begin with"));
        }
        if root.scenes.len() > 1 {
            let others = root.scenes.len() - 1;
            self.notes.add("scenes", &format!("{others} other than scenes[{number}] are left out"));
        }
        if !root.animations.is_empty() {
            let count = root.animations.len();
            self.notes.add("animations", &format!("{count} left out: the model is shown at rest"));
        }
        // Place every node. A node may have one parent: more, and circles, are met as a second visit.
        let worlds = self.worlds(&roots)?;
        for &(node, placed, is_visible) in &worlds.order {
            self.node(node, placed, is_visible, &worlds)
                .map_err(|wrong| wrong.inside(format!("nodes[{node}]")))?;
        }
        Ok(())
    }

    fn worlds(&self, roots: &[usize]) -> Result<Worlds, Wrong> {
        let nodes = &self.container.root.nodes;
        let mut worlds = Worlds { order: Vec::new(), of_node: vec![None; nodes.len()] };
        let mut waiting: Vec<(usize, Placed, bool)> =
            roots.iter().rev().map(|node| (*node, Placed::IDENTITY, true)).collect();
        while let Some((number, parent, is_parent_visible)) = waiting.pop() {
            let node = nodes.get(number).ok_or_else(|| Wrong::index("nodes", number, nodes.len()))?;
            if worlds.of_node[number].is_some() {
                return Err(Wrong::new(format!("nodes[{number}] is its own ancestor, or has two parents")));
            }
            let placed = parent.after(local(node));
            worlds.of_node[number] = Some(placed);
            let hides = node.extensions.visibility.as_ref().is_some_and(|visibility| !visibility.visible);
            let is_visible = is_parent_visible && !hides;
            worlds.order.push((number, placed, is_visible));
            waiting.extend(node.children.iter().rev().map(|child| (*child, placed, is_visible)));
        }
        Ok(worlds)
    }

    /// Adds what a node shows: a hidden one only its camera.
    fn node(
        &mut self,
        number: usize,
        placed: Placed,
        is_visible: bool,
        worlds: &Worlds,
    ) -> Result<(), Wrong> {
        let container = self.container;
        let root = &container.root;
        let node = &root.nodes[number];
        let place = format!("nodes[{number}]");
        let shows = node.mesh.is_some() || node.extensions.light.is_some();
        if node.camera.is_some() || (is_visible && shows) {
            check_reach(node, &placed)?;
        }
        if let Some(camera) = node.camera {
            let json = root
                .cameras
                .get(camera)
                .ok_or_else(|| Wrong::index("cameras", camera, root.cameras.len()))?;
            self.camera(json, &node.name, placed, &place);
        }
        if !is_visible {
            return Ok(());
        }
        if let Some(light) = &node.extensions.light {
            let lights = &root.extensions.lights.lights;
            let json =
                lights.get(light.light).ok_or_else(|| Wrong::index("lights", light.light, lights.len()))?;
            check_intensity(json, light.light)?;
            self.light(json, &node.name, placed, &place);
        }
        if node.extensions.instancing.is_some() {
            self.notes.add(
                &place,
                "its instances are left out: EXT_mesh_gpu_instancing is not read by this version",
            );
        }
        let Some(mesh) = node.mesh else { return Ok(()) };
        let json = root.meshes.get(mesh).ok_or_else(|| Wrong::index("meshes", mesh, root.meshes.len()))?;
        if json.weights.iter().chain(&node.weights).any(|weight| *weight != 0.0) {
            self.notes.add(&place, "its morph targets are left out: it has its first shape");
        }
        let placed = match node.skin {
            Some(skin) => self.at_rest(skin, worlds, &place)?.unwrap_or(placed),
            None => placed,
        };
        let is_usable = placed.translate.is_finite() && is_full(&placed.linear);
        if !is_usable {
            self.notes.add(&place, "it is left out: its placement makes it flat");
            return Ok(());
        }
        let first: usize = root.meshes[..mesh].iter().map(|mesh| mesh.primitives.len()).sum();
        let name = if node.name.is_empty() { &json.name } else { &node.name };
        for (index, primitive) in json.primitives.iter().enumerate() {
            if !primitive.has_faces() {
                self.notes
                    .add(&format!("meshes[{mesh}].primitives[{index}]"), "points and lines are left out");
                continue;
            }
            if self.scene.instances.len() >= MOST_INSTANCES {
                return Err(Wrong::new(format!("more than {MOST_INSTANCES} placed primitives")));
            }
            let material = self.material(primitive.material, container.coordinate_sets(primitive))?;
            let colors = container.attribute(primitive, "COLOR_0")?;
            self.note_attributes(
                &format!("meshes[{mesh}].primitives[{index}]"),
                primitive,
                material,
                &colors,
            );
            self.scene.instances.push(ModelInstance {
                name: name.clone(),
                node: number,
                part: container.built_as(first + index),
                placed,
                material,
                has_normals: primitive.attributes.contains_key("NORMAL"),
                has_colors: colors.is_some(),
            });
        }
        Ok(())
    }

    /// Notes what is not read of a primitive's attributes, where its material would show it.
    fn note_attributes(
        &mut self,
        place: &str,
        primitive: &Primitive,
        material: usize,
        colors: &Option<Numbers<'_>>,
    ) {
        let material = &self.scene.materials[material];
        let has_alpha = |colors: &Numbers<'_>| {
            colors.width == 4 && (0..colors.count).any(|vertex| colors.floats::<4>(vertex, 1.0)[3] < 1.0)
        };
        if material.alpha != Alpha::Opaque && colors.as_ref().is_some_and(has_alpha) {
            self.notes.add(place, "the alpha of its vertex colours is left out");
        }
        if material.normal.is_some() && primitive.attributes.contains_key("TANGENT") {
            self.notes.add(place, "its tangents are left out: its normal map lies along its coordinates");
        }
    }

    /// Index of a material, which is read when it is met first.
    fn material(&mut self, number: Option<usize>, sets: [usize; 2]) -> Result<usize, Wrong> {
        if let Some(known) = self.materials.get(&(number, sets)) {
            return Ok(*known);
        }
        let materials = &self.container.root.materials;
        let read = match number {
            Some(number) if number < materials.len() => {
                material(self.container, number, sets, &mut self.notes)?
            }
            Some(number) => return Err(Wrong::index("materials", number, materials.len())),
            None => ModelMaterial::named("default"),
        };
        self.scene.materials.push(read);
        let index = self.scene.materials.len() - 1;
        self.materials.insert((number, sets), index);
        Ok(index)
    }

    /// Placement of a skin at rest: that of its first joint, which is every joint's in the pose that the skin was bound in
    /// (glTF 2.0, 3.7.3).
    fn at_rest(&mut self, number: usize, worlds: &Worlds, place: &str) -> Result<Option<Placed>, Wrong> {
        let root = &self.container.root;
        let skin = root.skins.get(number).ok_or_else(|| Wrong::index("skins", number, root.skins.len()))?;
        self.notes.add(place, "its skin is shown as it was bound, without the pose of its joints");
        let joint = skin.joints.first().and_then(|joint| *worlds.of_node.get(*joint)?);
        let Some(joint) = joint else { return Ok(None) };
        let bind = match skin.inverse_bind_matrices {
            Some(accessor) => {
                let numbers = Numbers::of(self.container, accessor)?;
                if numbers.count == 0 || numbers.width != 16 {
                    return Err(Wrong::new("no matrix").inside(format!("accessors[{accessor}]")));
                }
                by_columns(numbers.floats::<16>(0, 0.0).map(f64::from))
            }
            None => Placed::IDENTITY,
        };
        Ok(Some(joint.after(bind)))
    }

    fn light(&mut self, json: &Light, node: &str, placed: Placed, place: &str) {
        let kind = match json.kind.as_str() {
            "point" => ModelLightKind::Point,
            "directional" => ModelLightKind::Directional,
            "spot" => {
                let outer = json.spot.outer_cone_angle.clamp(1e-3, std::f64::consts::FRAC_PI_2);
                let inner = json.spot.inner_cone_angle.clamp(0.0, outer);
                if inner < outer {
                    self.notes.add(place, "its light fades to the edge of its cone along the angle");
                }
                ModelLightKind::Spot { angle: 2.0 * outer.to_degrees(), blend: 1.0 - inner / outer }
            }
            other => {
                self.notes.add(place, &format!("a light of the kind {:?} is left out", super::shown(other)));
                return;
            }
        };
        if json.range.is_some() {
            self.notes.add(
                place,
                "the range of its light is left out: it falls off with the square of the distance",
            );
        }
        let intensity = DVec3::from(json.color) * json.intensity;
        let direction = (placed.linear * DVec3::NEG_Z).normalize_or(DVec3::NEG_Z);
        let usable = intensity.is_finite() && intensity.min_element() >= 0.0 && placed.translate.is_finite();
        if !usable {
            self.notes.add(place, "a light that is negative or nowhere is left out");
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

    fn camera(&mut self, json: &Camera, node: &str, placed: Placed, place: &str) {
        let direction = (placed.linear * DVec3::NEG_Z).try_normalize();
        let up = (placed.linear * DVec3::Y).try_normalize();
        let (Some(direction), Some(up)) = (direction, up) else { return };
        let position = placed.translate;
        let (fov, aspect, position) = match (&json.perspective, &json.orthographic) {
            (Some(lens), _) => (lens.yfov.to_degrees(), lens.aspect_ratio, position),
            (None, Some(lens)) => {
                self.notes
                    .add(place, "its camera is orthographic: one with a narrow angle far away stands for it");
                const NARROW: f64 = 5.0;
                let back = lens.ymag.abs() / libm::tan((NARROW * 0.5).to_radians());
                (NARROW, None, position - direction * back)
            }
            (None, None) => {
                let what = "its camera is left out: it is neither perspective nor orthographic";
                return self.notes.add(place, what);
            }
        };
        let is_usable = position.abs().max_element() < MOST && fov > 0.0 && fov < 180.0;
        if is_usable {
            let name = if json.name.is_empty() { node } else { &json.name };
            let aspect = aspect.filter(|aspect| *aspect > 0.05 && *aspect < 20.0);
            self.scene.cameras.push(ModelCamera {
                name: name.to_owned(),
                position,
                direction,
                up,
                fov,
                aspect,
            });
        } else {
            self.notes.add(place, "its camera is left out: it has no place or no angle");
        }
    }
}

/// Refuses a placement whose numbers no scene takes. It names the node's own number if that is the one.
fn check_reach(node: &Node, placed: &Placed) -> Result<(), Wrong> {
    let most = |numbers: &[f64]| numbers.iter().fold(0.0_f64, |most, number| most.max(number.abs()));
    let all = |placed: &Placed| most(&placed.linear.to_cols_array()).max(most(&placed.translate.to_array()));
    if all(placed) < MOST {
        return Ok(());
    }
    let own = [
        ("scale", node.scale.as_ref().map(|numbers| &numbers[..])),
        ("translation", node.translation.as_ref().map(|numbers| &numbers[..])),
        ("matrix", node.matrix.as_ref().map(|numbers| &numbers[..])),
    ];
    let of_own = own.into_iter().filter_map(|(name, numbers)| Some((name, most(numbers?))));
    Err(Wrong::new(match of_own.max_by(|a, b| a.1.total_cmp(&b.1)).filter(|(_, largest)| *largest >= MOST) {
        Some((name, largest)) => format!("its {name} has {largest:e}, and must stay below {MOST:e}"),
        None => format!(
            "with those of its ancestors, its placement has {:e}, and must stay below {MOST:e}",
            all(placed)
        ),
    }))
}

/// Refuses a light that no scene takes.
fn check_intensity(json: &Light, number: usize) -> Result<(), Wrong> {
    let brightest = json.color.iter().fold(0.0_f64, |most, part| most.max(*part)) * json.intensity;
    if brightest < MOST || !(json.intensity > 0.0) {
        return Ok(());
    }
    let name = if json.name.is_empty() { String::new() } else { format!(" {:?}", super::shown(&json.name)) };
    let intensity = json.intensity;
    Err(Wrong::new(format!(
        "its light lights[{number}]{name} has intensity {intensity:e}, and must stay below {MOST:e}"
    )))
}

/// Placements of all nodes.
struct Worlds {
    /// Nodes in the order of the walk, with their placement and whether they are visible (`KHR_node_visibility`).
    order: Vec<(usize, Placed, bool)>,
    /// Placement of each node; `None` for those that the scene does not have.
    of_node: Vec<Option<Placed>>,
}

/// Whether a map flattens nothing.
fn is_full(linear: &DMat3) -> bool {
    let [x, y, z] = [linear.x_axis, linear.y_axis, linear.z_axis];
    let (volume, edges) = (x.cross(y).dot(z), x.length() * y.length() * z.length());
    edges.is_finite() && volume.abs() > 1e-9 * edges && [x, y, z].iter().all(|axis| axis.length() > 1e-15)
}

/// The map of a node in its parent.
fn local(node: &Node) -> Placed {
    if let Some(matrix) = node.matrix {
        return by_columns(matrix);
    }
    let [x, y, z, w] = node.rotation.unwrap_or([0.0, 0.0, 0.0, 1.0]);
    let length = (x * x + y * y + z * z + w * w).sqrt();
    let [x, y, z, w] =
        if length > 0.0 { [x, y, z, w].map(|part| part / length) } else { [0.0, 0.0, 0.0, 1.0] };
    // The matrix of a unit quaternion, column by column.
    let rotation = DMat3::from_cols(
        DVec3::new(1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + z * w), 2.0 * (x * z - y * w)),
        DVec3::new(2.0 * (x * y - z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + x * w)),
        DVec3::new(2.0 * (x * z + y * w), 2.0 * (y * z - x * w), 1.0 - 2.0 * (x * x + y * y)),
    );
    let scale = DVec3::from(node.scale.unwrap_or([1.0; 3]));
    Placed {
        linear: rotation * DMat3::from_diagonal(scale),
        translate: DVec3::from(node.translation.unwrap_or_default()),
    }
}

/// The affine map of sixteen numbers, column by column.
fn by_columns(matrix: [f64; 16]) -> Placed {
    let column = |first: usize| DVec3::new(matrix[first], matrix[first + 1], matrix[first + 2]);
    Placed { linear: DMat3::from_cols(column(0), column(4), column(8)), translate: column(12) }
}
