//! Writes the lights that are not shapes.

use std::f64::consts::PI;

use super::colors::SpectrumUse;
use super::environment::{InfiniteImage, InfiniteLights};
use super::lexer::{PbrtError, PbrtResult};
use super::parameters::ParameterType;
use super::scene::PbrtConverter;
use super::state::PlacedEntity;
use crate::formats::rounding::shorten_color;
use crate::math::{DMat4, DVec3};
use crate::scene::nearest::nearest_name;

const LIGHTS: [&str; 6] = ["point", "spot", "distant", "infinite", "goniometric", "projection"];

impl PbrtConverter<'_> {
    /// Writes all lights.
    pub(super) fn convert_lights(&mut self) {
        let mut infinite = InfiniteLights::default();
        for light in &self.statements.lights {
            let written = self.convert_light(light, &mut infinite);
            self.value_or_record_error(written);
        }
        let written = self.convert_infinite_lights(&infinite);
        self.value_or_record_error(written);
    }

    fn convert_light(&mut self, light: &PlacedEntity, infinite: &mut InfiniteLights) -> PbrtResult<()> {
        let (entity, span) = (&light.entity, light.entity.span());
        let matrix = self.still_transform(light.transform, span.clone());
        let kind = &*entity.kind.text;
        if !matrix.is_finite() || matrix.determinant() == 0.0 {
            return Err(PbrtError::new(span, "the transform of this light is not invertible"));
        }
        self.document.set_span_for_next_values(span.clone());
        match kind {
            "point" => self.convert_point_light(light, &matrix)?,
            "spot" => self.convert_spot_light(light, &matrix)?,
            "distant" => self.convert_distant_light(light, &matrix)?,
            "infinite" => self.read_infinite_light(light, &matrix, infinite)?,
            "goniometric" => {
                let text = "a point light with the same intensity in every direction is used";
                self.notes.note_lighting_substitution("light `goniometric`", text, span);
                entity.parameters.ignore(&["filename"]);
                self.convert_point_light(light, &matrix)?;
            }
            "projection" => {
                self.notes.note_lighting_substitution("light `projection`", "skipped", span);
                entity.parameters.ignore(&["filename", "fov", "scale", "power"]);
            }
            other => {
                let error = PbrtError::new(entity.kind.span.clone(), "unknown light");
                return Err(error.with_suggestion(nearest_name(other, LIGHTS)));
            }
        }
        entity.parameters.check_all_used()
    }

    /// Returns a light's color times its `scale`. `names` are the parameter of the color and the one that
    /// normalizes it, `power` or `illuminance`, which is `unit` for a light with a luminance of 1.
    fn scaled_color(&self, light: &PlacedEntity, names: [&'static str; 2], unit: f64) -> PbrtResult<DVec3> {
        let [color_name, goal_name] = names;
        let (parameters, space) = (&light.entity.parameters, light.entity.color_space);
        let color = self.resolver.colors.color(parameters, color_name, space, SpectrumUse::Emission)?;
        let mut scale = parameters.float("scale", 1.0)?;
        if scale < 0.0 {
            return Err(PbrtError::new(parameters.span_of("scale"), "`scale` cannot be negative"));
        }
        if let Some(goal) = parameters.optional_float(goal_name)?.filter(|goal| *goal > 0.0) {
            scale *= goal / unit;
        }
        Ok(color.unwrap_or(DVec3::ONE) * scale)
    }

    fn convert_point_light(&mut self, light: &PlacedEntity, matrix: &DMat4) -> PbrtResult<()> {
        let from = light.entity.parameters.triple("from", ParameterType::Point3, DVec3::ZERO)?;
        let intensity = self.scaled_color(light, ["I", "power"], 4.0 * PI)?;
        self.document.start_list_table("light");
        self.document.set("type", "point");
        self.document.set("position", matrix.transform_point3(from));
        self.document.set("intensity", shorten_color(intensity));
        Ok(())
    }

    fn convert_spot_light(&mut self, light: &PlacedEntity, matrix: &DMat4) -> PbrtResult<()> {
        let parameters = &light.entity.parameters;
        let from = parameters.triple("from", ParameterType::Point3, DVec3::ZERO)?;
        let to = parameters.triple("to", ParameterType::Point3, DVec3::Z)?;
        let cone = parameters.positive_float("coneangle", 30.0)?;
        let delta = parameters.float("conedeltaangle", 5.0)?.clamp(0.0, cone);
        if cone >= 180.0 {
            let span = parameters.span_of("coneangle");
            return Err(PbrtError::new(span, "`coneangle` must be less than 180"));
        }
        if from == to {
            let span = parameters.span_of("to");
            return Err(PbrtError::new(span, "the spotlight has no direction: `from` and `to` are equal"));
        }
        let [end, start] = [cone, cone - delta].map(|angle| libm::cos(angle.to_radians()));
        // The smooth edge has a mean of 1/2.
        let solid_angle = 2.0 * PI * ((1.0 - start) + (start - end) / 2.0);
        let intensity = self.scaled_color(light, ["I", "power"], solid_angle)?;
        if delta > 0.0 {
            let text = "glimt's edge falls off linearly with the angle, pbrt's smoothly with the cosine";
            self.notes.note("light `spot`", text, light.entity.span());
        }
        self.document.start_list_table("light");
        self.document.set("type", "spot");
        self.document.set("position", matrix.transform_point3(from));
        self.document.set("look_at", matrix.transform_point3(to));
        self.document.set("intensity", shorten_color(intensity));
        self.document.set("angle", 2.0 * cone);
        self.document.set("blend", delta / cone);
        Ok(())
    }

    fn convert_distant_light(&mut self, light: &PlacedEntity, matrix: &DMat4) -> PbrtResult<()> {
        let parameters = &light.entity.parameters;
        let from = parameters.triple("from", ParameterType::Point3, DVec3::ZERO)?;
        let to = parameters.triple("to", ParameterType::Point3, DVec3::Z)?;
        let Some(direction) = matrix.transform_vector3(to - from).try_normalize() else {
            let span = parameters.span_of("to");
            return Err(PbrtError::new(span, "the light has no direction: `from` and `to` are equal"));
        };
        let irradiance = self.scaled_color(light, ["L", "illuminance"], 1.0)?;
        self.document.start_list_table("light");
        self.document.set("type", "directional");
        self.document.set("direction", direction);
        self.document.set("irradiance", shorten_color(irradiance));
        Ok(())
    }

    fn read_infinite_light(
        &mut self,
        light: &PlacedEntity,
        matrix: &DMat4,
        infinite: &mut InfiniteLights,
    ) -> PbrtResult<()> {
        let (parameters, span) = (&light.entity.parameters, light.entity.span());
        if parameters.find("portal").is_some() {
            let text = "light arrives from all directions, unless the scene blocks it outside the portal";
            self.notes.note("`portal`", text, parameters.span_of("portal"));
        }
        let Some(file) = parameters.string("filename")?.cloned() else {
            infinite.color += self.scaled_color(light, ["L", "illuminance"], PI)?;
            return Ok(());
        };
        if parameters.find("L").is_some() {
            let error =
                PbrtError::new(parameters.span_of("filename"), "`filename` cannot be combined with `L`");
            return Err(error.with_help("remove one of them"));
        }
        let illuminance = parameters.optional_float("illuminance")?.filter(|goal| *goal > 0.0);
        let scale = parameters.float("scale", 1.0)?;
        if scale < 0.0 {
            return Err(PbrtError::new(parameters.span_of("scale"), "`scale` cannot be negative"));
        }
        if self.tolerate_if_missing(&file, "map of an infinite light", "its light is gray") {
            infinite.color += DVec3::splat(0.5 * scale);
            return Ok(());
        }
        infinite.images.push(InfiniteImage { file, scale, illuminance, matrix: *matrix, span });
        Ok(())
    }
}
