//! Converts participating media.

use super::graph::{ObjectKind, PluginInstance};
use super::reader::{ColorRole, ColorSource, SceneReader};
use super::xml::truncate_for_message;
use crate::math::DVec3;

impl<'a> SceneReader<'a> {
    /// Returns the transmittance per unit of length of the medium in a shape, if the medium only absorbs
    /// light and the shape is of solid glass. Substitutes other media.
    pub(super) fn interior_tint(&mut self, object: &'a PluginInstance) -> Option<DVec3> {
        let mut tint = None;
        for child in self.children_of_kind(object, ObjectKind::Medium) {
            let medium = self.object_by_index(child.target);
            let is_inside = matches!(child.name.as_deref(), None | Some("interior"));
            let absorption = if is_inside && self.is_solid_glass_shape(object) {
                self.pure_absorption_coefficient(medium)
            } else {
                None
            };
            match absorption {
                Some(absorption) => {
                    tint = Some(DVec3::from(absorption.to_array().map(|part| libm::exp(-part))));
                    self.report_unused(child.target);
                }
                None => {
                    let subject = format!("medium `{}`", truncate_for_message(&medium.plugin));
                    self.notes.note_lighting_substitution(
                        &subject,
                        "light passes it unchanged",
                        medium.span.clone(),
                    );
                }
            }
        }
        tint
    }

    /// Whether the BSDF of a shape is glass with an inside.
    fn is_solid_glass_shape(&self, object: &'a PluginInstance) -> bool {
        let bsdf = self.children_of_kind(object, ObjectKind::Bsdf).next();
        bsdf.is_some_and(|child| {
            matches!(&*self.object_by_index(child.target).plugin, "dielectric" | "roughdielectric")
        })
    }

    /// Returns the absorption of a medium that does not scatter light.
    fn pure_absorption_coefficient(&mut self, medium: &'a PluginInstance) -> Option<DVec3> {
        let mut color = |name: &str, default: f64| match self.color_or_texture(
            medium,
            name,
            ColorRole::Unbounded,
            default,
        ) {
            ColorSource::Constant(color) => Some(color),
            ColorSource::Texture(_) => None,
        };
        if medium.plugin != "homogeneous" || medium.property("material").is_some() {
            return None;
        }
        let absorption = if medium.property("sigma_a").is_some() || medium.property("sigma_s").is_some() {
            (color("sigma_s", 0.0)? == DVec3::ZERO).then_some(color("sigma_a", 0.0)?)
        } else {
            (color("albedo", 0.75)? == DVec3::ZERO).then_some(color("sigma_t", 1.0)?)
        };
        let scale = self.float(medium, "scale").unwrap_or(1.0);
        absorption.map(|absorption| (absorption * scale).max(DVec3::ZERO))
    }
}
