//! Emission, opacity and interior media of shapes.

use super::colors::SpectrumUse;
use super::lexer::{PbrtError, PbrtResult};
use super::material_tables::{Emission, ShapeProperties};
use super::parameters::Parameters;
use super::scene::PbrtConverter;
use super::shapes::round_shape_area;
use super::state::{ShapeEntity, TypedStatement};
use super::texture_nodes::{ImageFilter, ImageNode, ImageWrap, TextureNode, TextureValueKind, UvMapping};
use crate::formats::foreign::meshes::MeshData;
use crate::math::{DMat4, DVec3};
use crate::scene::nearest::nearest_name;
use crate::scene::sanitize::escape_and_truncate;

/// The light of an `AreaLightSource`.
struct AreaLight {
    emission: Emission,
    /// Power of each shape, from which the radiance is derived if it is set.
    power: Option<f64>,
    /// Mean luminance of the image if there is a `power`, otherwise 1.
    mean: f64,
}

impl PbrtConverter<'_> {
    /// Reads the properties that belong to shapes in pbrt, and to materials in glimt. Returns `None` if the
    /// shape is invisible and does not emit light.
    pub(super) fn shape_properties(
        &mut self,
        shape: &ShapeEntity,
        data: Option<&MeshData>,
        matrix: &DMat4,
        is_in_object: bool,
    ) -> PbrtResult<Option<ShapeProperties>> {
        let entity = &shape.placed.entity;
        let area_light = shape.area_light.map(|index| &self.statements.area_lights[index]);
        let emission = match area_light {
            Some(light) if is_in_object => {
                self.notes.note("area lights in objects", "they do not emit light, as in pbrt", light.span());
                None
            }
            Some(light) => self.read_shape_emission(light, entity, data, matrix)?,
            None => None,
        };
        let (parameters, space) = (&entity.parameters, entity.color_space);
        let notes = &mut self.notes;
        let alpha =
            self.resolver.texture_or_constant(parameters, "alpha", TextureValueKind::Number, space, notes)?;
        let alpha = alpha.filter(|alpha| alpha.as_constant().is_none_or(|alpha| alpha.x < 1.0));
        let is_hidden = alpha.as_ref().and_then(TextureNode::as_constant).is_some_and(|alpha| alpha.x <= 0.0);
        let tint = self.read_inside_transmittance(shape)?;
        match (is_hidden, emission) {
            (true, None) => Ok(None),
            (true, emission) => {
                let text = "it is visible";
                self.notes.note_lighting_substitution("a light hidden by `alpha`", text, entity.span());
                Ok(Some(ShapeProperties { emission, alpha: None, tint }))
            }
            (false, emission) => Ok(Some(ShapeProperties { emission, alpha, tint })),
        }
    }

    /// Returns the emission of a shape, or `None` if it is black.
    fn read_shape_emission(
        &mut self,
        light: &TypedStatement,
        shape: &TypedStatement,
        data: Option<&MeshData>,
        matrix: &DMat4,
    ) -> PbrtResult<Option<Emission>> {
        if light.kind.text != "diffuse" {
            let error = PbrtError::new(light.kind.span.clone(), "unknown area light");
            return Err(error.with_label("only \"diffuse\" is supported"));
        }
        let AreaLight { mut emission, power, mean } = self.read_area_light_parameters(light)?;
        if let Some(power) = power {
            let sides = if emission.is_two_sided { 2.0 } else { 1.0 };
            let area = self.area_for_power(shape, data, matrix)?;
            emission.color *= power / (mean * sides * area * std::f64::consts::PI);
        }
        Ok(Some(emission).filter(|emission| emission.color != DVec3::ZERO))
    }

    fn read_area_light_parameters(&mut self, light: &TypedStatement) -> PbrtResult<AreaLight> {
        let (parameters, space) = (&light.parameters, light.color_space);
        let color = self.resolver.colors.color(parameters, "L", space, SpectrumUse::Emission)?;
        let file = parameters.string("filename")?;
        let scale = parameters.float("scale", 1.0)?;
        if scale < 0.0 {
            return Err(PbrtError::new(parameters.span_of("scale"), "`scale` cannot be negative"));
        }
        let is_two_sided = parameters.bool("twosided", false)?;
        let power = parameters.optional_float("power")?.filter(|power| *power > 0.0);
        parameters.check_all_used()?;
        let image = match file {
            Some(_) if color.is_some() => {
                let span = parameters.span_of("filename");
                let error = PbrtError::new(span, "`filename` cannot be combined with `L`");
                return Err(error.with_help("remove one of them"));
            }
            Some(file) if self.tolerate_if_missing(file, "image of a light", "the light is white") => None,
            Some(file) => Some(ImageNode {
                file: file.clone(),
                mapping: UvMapping::IDENTITY,
                wrap: ImageWrap::Clamp,
                filter: ImageFilter::Bilinear,
                is_linear: false,
                is_number: false,
                factor: DVec3::ONE,
                is_inverted: false,
            }),
            None => None,
        };
        let mean = match (&image, power) {
            (Some(image), Some(_)) => self.mean_luminance(image)?,
            _ => 1.0,
        };
        let color = color.unwrap_or(DVec3::ONE) * scale;
        let image = image.map(TextureNode::Image);
        Ok(AreaLight { emission: Emission { color, image, is_two_sided }, power, mean })
    }

    /// Returns the area that emits `power`. In pbrt, each triangle of a mesh is a light with this power, so
    /// the area is the mean area of the triangles.
    fn area_for_power(
        &mut self,
        shape: &TypedStatement,
        data: Option<&MeshData>,
        matrix: &DMat4,
    ) -> PbrtResult<f64> {
        let (parameters, span) = (&shape.parameters, shape.span());
        let loaded;
        let data = match (&*shape.kind.text, data) {
            (_, Some(data)) => data,
            ("plymesh", None) => {
                let Some(mesh) = self.load_mesh_file(parameters)? else { return Ok(1.0) };
                loaded = mesh;
                &loaded
            }
            // pbrt ignores the transform of these shapes.
            (kind, None) => return positive_area(round_shape_area(kind, parameters)?, parameters),
        };
        let areas: Vec<f64> =
            data.triangles.iter().map(|triangle| data.transformed_triangle_area(*triangle, matrix)).collect();
        let mean = areas.iter().sum::<f64>() / areas.len().max(1) as f64;
        let is_equal = areas.iter().all(|area| (area / mean - 1.0).abs() < 0.01);
        if !is_equal {
            let text = "every triangle has the same radiance instead of the same power";
            self.notes.note_lighting_substitution("`power` of a mesh", text, span);
        }
        positive_area(mean, parameters)
    }

    /// Returns the transmittance per unit length of the medium inside a shape, if the medium only absorbs
    /// light. Adds substitutions for other media.
    fn read_inside_transmittance(&mut self, shape: &ShapeEntity) -> PbrtResult<Option<DVec3>> {
        let [inside, outside] = &shape.media;
        let span = shape.placed.entity.span();
        let mut tint = None;
        for (name, is_inside) in [(inside, true), (outside, false)] {
            if name.is_empty() || !is_inside && name == inside {
                continue;
            }
            let Some(medium) = self.statements.media.get(&**name) else {
                let shown = escape_and_truncate(name, 40);
                let near = nearest_name(name, self.statements.media.keys().map(String::as_str));
                let error = PbrtError::new(span, format!("there is no medium \"{shown}\""));
                return Err(error.with_suggestion(near));
            };
            let absorption = self.pure_absorption_coefficient(medium)?;
            match absorption.filter(|_| is_inside && inside != outside) {
                Some(absorption) => {
                    tint = Some(DVec3::from(absorption.to_array().map(|part| libm::exp(-part))));
                }
                None => {
                    let kind = medium.parameters.string("type")?.map_or("", |kind| &kind.text);
                    let subject = format!("medium `{kind}`");
                    self.notes.note_lighting_substitution(
                        &subject,
                        "light passes through it unchanged",
                        medium.span(),
                    );
                }
            }
        }
        Ok(tint)
    }

    /// Returns the absorption coefficient of a medium, or `None` if the medium scatters or emits light.
    fn pure_absorption_coefficient(&self, medium: &TypedStatement) -> PbrtResult<Option<DVec3>> {
        let parameters = &medium.parameters;
        let kind = parameters.string("type")?.map_or("", |kind| &kind.text);
        let color = |name, default: f64| {
            let (colors, usage) = (self.resolver.colors, SpectrumUse::Unbounded);
            let color = colors.color(parameters, name, medium.color_space, usage)?;
            PbrtResult::Ok(color.unwrap_or(DVec3::splat(default)))
        };
        let (scattering, absorption) = (color("sigma_s", 1.0)?, color("sigma_a", 1.0)?);
        let scale = parameters.float("scale", 1.0)?;
        let is_clear = kind == "homogeneous"
            && scattering == DVec3::ZERO
            && parameters.find("preset").is_none()
            && parameters.find("Le").is_none();
        Ok(is_clear.then_some((absorption * scale).max(DVec3::ZERO)))
    }
}

fn positive_area(area: f64, parameters: &Parameters) -> PbrtResult<f64> {
    if area > 0.0 {
        return Ok(area);
    }
    Err(PbrtError::new(parameters.span.clone(), "a light without area cannot have a `power`"))
}
