//! Converts groups and their instances.

use super::graph::{GraphObjectIndex, ObjectKind, PluginInstance};
use super::reader::SceneReader;
use super::shapes::ShapeTarget;
use super::xml::truncate_for_message;

impl<'a> SceneReader<'a> {
    /// Adds an instance, and its group if it is new.
    pub(super) fn add_instance(&mut self, object: &'a PluginInstance, target: ShapeTarget<'_>) -> bool {
        let Some(matrix) = self.shape_transform(object) else { return false };
        let Some(child) = self.children_of_kind(object, ObjectKind::Shape).next() else {
            let help = "add a <ref> to a `shapegroup`".to_owned();
            self.report_error(object.span.clone(), "the instance has no shape group", Some(help));
            return false;
        };
        let group = self.object_by_index(child.target);
        if group.plugin != "shapegroup" {
            let message =
                format!("an instance needs a `shapegroup`, found `{}`", truncate_for_message(&group.plugin));
            self.report_error(child.span.clone(), message, None);
            return false;
        }
        let Some(name) = self.add_group_if_new(child.target, target.depth + 1) else { return false };
        self.document.set_span_for_next_values(object.span.clone());
        match target.group {
            Some(group) => self.document.start_group_list_table(group, "instance"),
            None => self.document.start_list_table("instance"),
        }
        self.document.set("group", name);
        if let Some(id) = &object.id {
            let name = self.shape_names.make_unique(id, "instance");
            self.document.set("name", name);
        }
        self.set_matrix(&matrix);
        true
    }

    /// Returns the name of a group, adding it if it is new. Returns `None` if it has no visible shapes.
    fn add_group_if_new(&mut self, index: GraphObjectIndex, depth: u32) -> Option<String> {
        if let Some(known) = self.groups.get(&index) {
            return known.clone();
        }
        let object = self.object_by_index(index);
        let name = self.group_names.make_unique(object.id.as_deref().unwrap_or("group"), "group");
        let target = ShapeTarget { group: Some(&name), depth };
        let is_added = self.add_shapes_of(object, target);
        let name = is_added.then_some(name);
        self.groups.insert(index, name.clone());
        name
    }
}
