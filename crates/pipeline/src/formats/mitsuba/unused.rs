//! Reports nested objects and settings that no function has read.

use super::graph::{Child, GraphObjectIndex, ObjectKind, PluginInstance};
use super::reader::SceneReader;
use super::xml::truncate_for_message;

impl<'a> SceneReader<'a> {
    /// Notes nested objects of an object that no function has read.
    pub(super) fn report_unused_children(&mut self, index: GraphObjectIndex) {
        let object = self.object_by_index(index);
        if self.reported_children.insert(index) {
            object.children.iter().filter(|child| !child.is_used.get()).for_each(|child| {
                self.report_unused_child(object, child);
            });
        }
    }

    fn report_unused_child(&mut self, object: &'a PluginInstance, child: &'a Child) {
        let inner = self.object_by_index(child.target);
        let parent = truncate_for_message(&object.plugin);
        let subject = match &child.name {
            Some(name) => format!("`{}` of `{parent}`", truncate_for_message(name)),
            None => format!("`{}` in `{parent}`", truncate_for_message(&inner.plugin)),
        };
        self.notes.note(&subject, "ignored", child.span.clone());
    }

    /// Notes a nested object of the scene that is not converted and cannot be referred to.
    pub(super) fn report_child_if_unreachable(&mut self, scene: &'a PluginInstance, child: &'a Child) {
        let inner = self.object_by_index(child.target);
        // Without a name, only the scene itself could use the object.
        let is_definition =
            inner.id.is_some() && !matches!(inner.kind, ObjectKind::Integrator | ObjectKind::Scene);
        if !child.is_used.get() && !is_definition {
            self.report_unused_child(scene, child);
        }
    }

    /// Notes unused properties and nested objects of the sensor, the integrator, and the objects in them.
    pub(super) fn report_unused_settings(&mut self, scene: &'a PluginInstance, sensor: GraphObjectIndex) {
        let integrators = scene.children.iter().filter(|child| {
            child.is_used.get() && self.object_by_index(child.target).kind == ObjectKind::Integrator
        });
        let mut pending: Vec<GraphObjectIndex> = integrators.map(|child| child.target).collect();
        pending.push(sensor);
        while let Some(index) = pending.pop() {
            let object = self.object_by_index(index);
            let known: &[&str] = match object.kind {
                ObjectKind::Sampler => &["seed", "jitter", "scramble", "dimension"],
                ObjectKind::Filter => &["radius", "b", "c", "stddev", "lobes"],
                ObjectKind::Integrator => &["aovs", "samples_per_pass", "block_size", "spp", "hide_emitters"],
                // A lens without a radius has no focus.
                ObjectKind::Sensor if matches!(object.plugin.as_str(), "thinlens" | "telecentric") => {
                    &["focus_distance", "far_clip"]
                }
                ObjectKind::Sensor
                | ObjectKind::Scene
                | ObjectKind::Bsdf
                | ObjectKind::Emitter
                | ObjectKind::Film
                | ObjectKind::Medium
                | ObjectKind::Phase
                | ObjectKind::Shape
                | ObjectKind::Spectrum
                | ObjectKind::Subsurface
                | ObjectKind::Texture
                | ObjectKind::Volume => &[],
            };
            for name in known {
                object.property(name);
            }
            self.report_unused(index);
            self.report_unused_children(index);
            let is_setting = |child: &&Child| {
                let kind = self.object_by_index(child.target).kind;
                child.is_used.get() && kind != ObjectKind::Medium && kind != ObjectKind::Spectrum
            };
            pending.extend(object.children.iter().filter(is_setting).map(|child| child.target));
        }
    }
}
