//! Writes the shapes, in file order, then the objects and their instances.

use std::collections::HashMap;

use super::lexer::PbrtError;
use super::scene::PbrtConverter;
use crate::formats::foreign::transform::{is_invertible_affine, matrix_value};
use crate::formats::model::UsedNames;
use crate::math::DMat4;
use crate::scene::nearest::nearest_name;
use crate::scene::sanitize::escape_and_truncate;

impl PbrtConverter<'_> {
    /// Writes all shapes, objects and instances.
    pub(super) fn convert_objects(&mut self) {
        let statements = self.statements;
        for shape in &statements.shapes {
            self.convert_shape(shape, None);
            if self.has_too_many_errors() || self.token.is_canceled() {
                return;
            }
        }
        let (mut groups, mut names) = (HashMap::new(), UsedNames::default());
        let used: std::collections::HashSet<&str> =
            statements.instances.iter().map(|instance| &*instance.name.text).collect();
        for object in &statements.objects {
            let name = names.make_unique(&object.name.text, "object");
            groups.insert(&*object.name.text, name.clone());
            if !used.contains(&*object.name.text) {
                continue;
            }
            self.document.set_span_for_next_values(object.name.span.clone());
            self.document.start_named_table("groups", &name);
            for shape in &object.shapes {
                self.convert_shape(shape, Some(&name));
                if self.has_too_many_errors() || self.token.is_canceled() {
                    return;
                }
            }
        }
        for instance in &statements.instances {
            let Some(group) = groups.get(&*instance.name.text) else {
                let near = nearest_name(&instance.name.text, groups.keys().copied());
                let shown = escape_and_truncate(&instance.name.text, 40);
                let error =
                    PbrtError::new(instance.name.span.clone(), format!("there is no object \"{shown}\""));
                let _ = self.value_or_record_error::<()>(Err(error.with_suggestion(near)));
                continue;
            };
            let matrix = self.still_transform(instance.transform, instance.name.span.clone());
            if !is_invertible_affine(&matrix) {
                self.notes.note(
                    "an instance with a singular transform",
                    "skipped",
                    instance.name.span.clone(),
                );
                continue;
            }
            self.document.set_span_for_next_values(instance.name.span.clone());
            self.document.start_list_table("instance");
            self.document.set("group", group.clone());
            if matrix != DMat4::IDENTITY {
                self.document.set("matrix", matrix_value(&matrix));
            }
        }
    }
}
