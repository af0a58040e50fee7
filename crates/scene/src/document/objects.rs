//! Collects the objects of a scene: its shapes and the contents of its instances.

use super::super::description::{Instance, MeshFile, Object, ObjectTransform, Shape};
use super::super::toml::TableId;
use super::context::FileContext;
use super::groups::{DefinedGroups, InstanceTable, read_groups, read_instances};
use super::materials::MaterialList;
use super::shape_table::MeshFileRegistry;
use super::shapes::read_shape_objects;
use super::table::TableReader;

/// The objects of a scene.
pub(super) struct ObjectList {
    /// All objects, in file order.
    pub(super) objects: Vec<Object>,
    /// The top-level instances.
    pub(super) instances: Vec<Instance>,
    /// The mesh files of the objects.
    pub(super) mesh_files: Vec<MeshFile>,
    pub(super) groups: DefinedGroups,
}

/// Reads all shapes, groups and instances. Returns `None` if any is invalid.
pub(super) fn read_objects(root: &TableReader<'_>, materials: &MaterialList) -> Option<ObjectList> {
    let mut files = MeshFileRegistry::default();
    let (mut order, mut objects) = (Vec::new(), Vec::new());
    let are_shapes_valid = read_shape_objects(root, materials, &mut files, |id, object| {
        order.push(id);
        objects.push(object.with_outer_transform(&ObjectTransform::IDENTITY));
    });
    let groups = read_groups(root, materials, &mut files);
    let tables = read_instances(root, &groups.names);
    if !are_shapes_valid {
        return None;
    }
    if !order.is_sorted() {
        let mut sorted: Vec<_> = order.into_iter().zip(objects).collect();
        sorted.sort_unstable_by_key(|(table, _)| *table);
        (order, objects) = sorted.into_iter().unzip();
    }
    let mut list = ObjectList { objects, instances: Vec::new(), mesh_files: files.into_list(), groups };
    list.groups.list.as_ref()?;
    list.insert_instances(root.context, order, tables?)?;
    list.drop_unused_mesh_files();
    Some(list)
}

impl ObjectList {
    /// Inserts the objects of all instances in file order. `order` contains the table IDs of the other
    /// objects.
    fn insert_instances(
        &mut self,
        context: &FileContext<'_>,
        order: Vec<TableId>,
        tables: Vec<InstanceTable>,
    ) -> Option<()> {
        if tables.is_empty() {
            return Some(());
        }
        let copied = self.groups.count_objects_from_instances(context, &tables)?;
        let mut objects = Vec::with_capacity(order.len() + copied);
        let mut shapes = order.into_iter().zip(std::mem::take(&mut self.objects)).peekable();
        for table in tables {
            while let Some((_, shape)) = shapes.next_if(|(id, _)| *id < table.id) {
                objects.push(shape);
            }
            let start = objects.len();
            self.groups.expand_instance(context, &table, &mut objects)?;
            let InstanceTable { name, span, .. } = table;
            self.instances.push(Instance { objects: start..objects.len(), name, span });
        }
        objects.extend(shapes.map(|(_, shape)| shape));
        self.objects = objects;
        Some(())
    }

    /// Drops the files of meshes in groups without instances.
    fn drop_unused_mesh_files(&mut self) {
        let mut is_used = vec![false; self.mesh_files.len()];
        let files = self.objects.iter().filter_map(|object| object.shape.as_mesh()).map(|mesh| mesh.file);
        files.for_each(|file| is_used[file] = true);
        if is_used.iter().all(|used| *used) {
            return;
        }
        let up_to = |count: &mut usize, is_used: &bool| {
            *count += usize::from(*is_used);
            Some(*count)
        };
        let counts: Vec<usize> = is_used.iter().scan(0, up_to).collect();
        for object in &mut self.objects {
            if let Shape::Mesh(mesh) = &mut object.shape {
                mesh.file = counts[mesh.file] - 1;
            }
        }
        let mut used = is_used.into_iter();
        self.mesh_files.retain(|_| used.next() == Some(true));
    }
}
