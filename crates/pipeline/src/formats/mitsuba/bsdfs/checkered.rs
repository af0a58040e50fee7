//! Anisotropic roughness, from numbers or checkerboards.

use super::{BsdfContext, MaterialBuilder};
use crate::formats::foreign::import::TableEntries;
use crate::formats::mitsuba::graph::PluginInstance;
use crate::formats::mitsuba::reader::{NumberSource, SceneReader, luminance};
use crate::formats::rounding::shorten_number;
use crate::math::{DMat4, DVec3};
use crate::scene::SceneDocumentValue;

/// The values of α along u and v in the two kinds of cells of a checkerboard, from the cell at (0, 0).
type CellAlphas = [[f64; 2]; 2];

impl<'a> SceneReader<'a> {
    /// Adds `roughness` and `anisotropy` for values of α along u and v.
    pub(super) fn add_roughness_from_alphas(
        &mut self,
        keys: &mut TableEntries,
        object: &'a PluginInstance,
        [u, v]: [f64; 2],
        may_be_anisotropic: bool,
    ) {
        let (u, v) = (u.clamp(1e-4, 1.0), v.clamp(1e-4, 1.0));
        keys.push(("roughness", shorten_number(libm::sqrt(libm::sqrt(u * v))).into()));
        let ratio = if v > u { u / v } else { v / u };
        let anisotropy = (1.0 - ratio) / 0.9;
        if anisotropy > 1.0 {
            let text = "the ratio is limited to 10";
            self.notes.note_substitution(
                "`alpha_u` and `alpha_v` that differ by more than a factor of 10",
                text,
                object.span.clone(),
            );
        }
        let signed = if v > u { -anisotropy } else { anisotropy };
        if may_be_anisotropic && signed != 0.0 {
            keys.push(("anisotropy", shorten_number(signed.clamp(-1.0, 1.0)).into()));
        } else if signed != 0.0 {
            let text = "replaced by its mean";
            self.notes.note_lighting_substitution(
                "anisotropic roughness of glass",
                text,
                object.span.clone(),
            );
        }
    }

    /// Returns the values of α if `alpha_u`, `alpha_v` or both are checkerboards with the same cells, and the
    /// name of a texture that is 0 in the cell at (0, 0) and 1 in the other one.
    fn checkered_alphas(
        &mut self,
        object: &'a PluginInstance,
        context: BsdfContext,
    ) -> Option<(CellAlphas, String)> {
        let mut cells = [[0.1; 2]; 2];
        let mut board: Option<(&'a PluginInstance, DMat4)> = None;
        for (axis, name) in ["alpha_u", "alpha_v"].into_iter().enumerate() {
            match self.number_or_texture(object, name, 0.1) {
                NumberSource::Constant(alpha) => cells.iter_mut().for_each(|cell| cell[axis] = alpha),
                NumberSource::Texture(texture) => {
                    let inner = self.object_by_index(texture);
                    if inner.plugin != "checkerboard" {
                        return None;
                    }
                    let matrix = self.transform_value(inner, "to_uv");
                    let matrix = matrix.map_or(DMat4::IDENTITY, |transform| transform.matrix);
                    if board.is_some_and(|(_, known)| known != matrix) {
                        return None;
                    }
                    let mut colors = self.checker_colors(inner).map(luminance);
                    // Mitsuba swaps the colors when it evaluates a checkerboard as a number.
                    colors.reverse();
                    cells.iter_mut().zip(colors).for_each(|(cell, alpha)| cell[axis] = alpha);
                    board = Some((inner, matrix));
                    self.report_unused(texture);
                }
            }
        }
        let (board, _) = board?;
        let keys = self.checker_keys_with_colors(board, [DVec3::ZERO, DVec3::ONE], context.uv);
        Some((cells, self.find_or_add_texture_table(keys, "cells", [board.span.clone(), board.span.clone()])))
    }

    /// Converts a conductor whose `alpha_u` or `alpha_v` is a checkerboard to a blend of two metals. `keys`
    /// are the other keys of the metals.
    pub(super) fn checkered_metal(
        &mut self,
        keys: &TableEntries,
        object: &'a PluginInstance,
        context: BsdfContext,
    ) -> Option<MaterialBuilder> {
        object.named_child("alpha_u").or(object.named_child("alpha_v"))?;
        let (cells, weight) = self.checkered_alphas(object, context)?;
        let mut names = Vec::new();
        for alphas in cells {
            let mut keys = keys.clone();
            self.add_distribution_name(&mut keys, object);
            self.add_roughness_from_alphas(&mut keys, object, alphas, true);
            let mut metal = MaterialBuilder::one_sided("metal", keys);
            metal.is_one_sided &= !context.is_two_sided;
            self.add_enclosing_keys(&mut metal, context);
            let wanted = object.id.as_deref().unwrap_or(&object.plugin);
            names.push(SceneDocumentValue::from(self.add_material(metal, wanted, object.span.clone())));
        }
        let weight = SceneDocumentValue::Table(vec![("texture", weight.into())]);
        let keys = vec![("materials", SceneDocumentValue::Array(names)), ("weight", weight)];
        Some(MaterialBuilder { is_blend: true, ..MaterialBuilder::new("blend", keys) })
    }
}
