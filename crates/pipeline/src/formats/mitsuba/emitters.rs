//! Converts emitters other than area lights.

use std::f64::consts::PI;

use super::graph::PluginInstance;
use super::reader::{ColorRole, ColorSource, SceneReader};
use super::settings::span_of;
use super::textures::extension;
use super::xml::truncate_for_message;
use crate::formats::foreign::import::TableEntries;
use crate::formats::foreign::transform::linear_part;
use crate::formats::rounding::{shorten_color, shorten_number};
use crate::math::{DMat3, DMat4, DVec3};
use crate::scene::SceneDocumentValue;

/// Emitter plugins of Mitsuba 3, 2 and 0.6.
const KNOWN_EMITTERS: [&str; 12] = [
    "area",
    "point",
    "spot",
    "directional",
    "constant",
    "envmap",
    "sunsky",
    "sky",
    "sun",
    "projector",
    "directionalarea",
    "collimated",
];

impl<'a> SceneReader<'a> {
    /// Whether an emitter is an area light that shapes can refer to.
    pub(super) fn is_named_area_light(&self, index: usize) -> bool {
        let object = self.object_by_index(index);
        object.plugin == "area" && object.id.is_some()
    }

    /// Adds an emitter that does not belong to a shape.
    pub(super) fn add_emitter(&mut self, index: usize) {
        let object = self.object_by_index(index);
        self.document.set_span_for_next_values(object.span.clone());
        match object.plugin.as_str() {
            "area" => {
                let help = "put it in a <shape>".to_owned();
                self.report_error(object.span.clone(), "an area light needs a shape", Some(help));
            }
            "point" => self.add_point_light(object),
            "spot" => self.add_spot_light(object),
            "directional" => self.add_directional_light(object),
            "constant" => self.add_constant_environment(object),
            "envmap" => self.add_environment_map(object),
            "sunsky" | "sky" | "sun" | "timed_sunsky" => self.add_sky(object),
            "projector" => self.add_projector(object),
            "directionalarea" | "collimated" => self.refuse(object, "collimated light"),
            _ => self.report_unknown_plugin(object, "emitter", &KNOWN_EMITTERS),
        }
        self.report_unused(index);
        self.report_unused_children(index);
    }

    /// Returns the color of a light. Replaces textures with white and reports them.
    fn light_color(&mut self, object: &'a PluginInstance, name: &str) -> DVec3 {
        match self.color_or_texture(object, name, ColorRole::Emission, 1.0) {
            ColorSource::Constant(color) => color,
            ColorSource::Texture(_) => {
                let subject = format!("a texture in `{}`", truncate_for_message(&object.plugin));
                self.notes.note_lighting_substitution(&subject, "replaced by white", span_of(object, name));
                DVec3::ONE
            }
        }
    }

    fn add_point_light(&mut self, object: &'a PluginInstance) {
        let intensity = self.light_color(object, "intensity");
        let position = match self.vector_property(object, "position") {
            Some(position) => position,
            None => self.world_matrix(object).w_axis.truncate(),
        };
        self.document.start_list_table("light");
        self.add_light_id_comment(object);
        self.document.set("position", position);
        self.document.set("intensity", shorten_color(intensity));
    }

    fn add_light_id_comment(&mut self, object: &'a PluginInstance) {
        if let Some(id) = &object.id {
            self.document.add_comment_below_header(truncate_for_message(id));
        }
    }

    fn add_spot_light(&mut self, object: &'a PluginInstance) {
        let intensity = self.light_color(object, "intensity");
        let transform = self.transform_value(object, "to_world");
        let matrix = transform.map_or(DMat4::IDENTITY, |transform| transform.matrix);
        let cutoff = self.float(object, "cutoff_angle").unwrap_or(20.0);
        let beam = self.float(object, "beam_width").unwrap_or(cutoff * 0.75);
        if !(cutoff > 0.0 && cutoff < 180.0) || beam > cutoff {
            let message =
                "the angles must satisfy 0 < `cutoff_angle` < 180 and `beam_width` ≤ `cutoff_angle`";
            return self.report_error(span_of(object, "cutoff_angle"), message, None);
        }
        let position = matrix.w_axis.truncate();
        let Some(axis) = matrix.z_axis.truncate().try_normalize() else {
            return self.report_error(object.span.clone(), "the light's `to_world` is degenerate", None);
        };
        if let Some(texture) = object.named_child("texture")
            && !self.add_spot_texture(object, texture.target, cutoff)
        {
            let text = "the texture is left out";
            self.notes.note_lighting_substitution("a spot light with a texture", text, object.span.clone());
        }
        self.document.start_list_table("light");
        self.add_light_id_comment(object);
        self.document.set("type", "spot");
        self.document.set("position", position);
        self.document.set("look_at", position + axis);
        self.document.set("intensity", shorten_color(intensity));
        self.document.set("angle", shorten_number(2.0 * cutoff));
        self.document.set("blend", shorten_number(((cutoff - beam) / cutoff).clamp(0.0, 1.0)));
    }

    fn add_directional_light(&mut self, object: &'a PluginInstance) {
        let irradiance = self.light_color(object, "irradiance");
        let direction = match self.vector_property(object, "direction") {
            Some(direction) => direction,
            None => self.world_matrix(object).z_axis.truncate(),
        };
        let Some(direction) = direction.try_normalize() else {
            return self.report_error(object.span.clone(), "the light's direction is zero", None);
        };
        self.document.start_list_table("light");
        self.add_light_id_comment(object);
        self.document.set("type", "directional");
        self.document.set("direction", direction);
        self.document.set("irradiance", shorten_color(irradiance));
    }

    /// Starts the `[environment]` table. Reports an error and returns false if there is one already.
    fn start_environment(&mut self, object: &'a PluginInstance) -> bool {
        if std::mem::replace(&mut self.has_environment, true) {
            let help = "remove one of them".to_owned();
            self.report_error(object.span.clone(), "the scene has two environments", Some(help));
            return false;
        }
        self.document.start_table("environment");
        true
    }

    fn add_constant_environment(&mut self, object: &'a PluginInstance) {
        let radiance = self.light_color(object, "radiance");
        if self.start_environment(object) {
            self.document.set("color", shorten_color(radiance));
        }
    }

    fn add_environment_map(&mut self, object: &'a PluginInstance) {
        let Some((name, span)) = self.text(object, "filename") else {
            return self.report_error(object.span.clone(), "the environment map needs `filename`", None);
        };
        let scale = self.float(object, "scale").unwrap_or(1.0);
        let matrix = self.world_matrix(object);
        for name in ["cache", "gamma"] {
            object.property(name);
        }
        if object.property("mis_compensation").is_some() {
            self.boolean(object, "mis_compensation", false);
        }
        let known = ["exr", "hdr", "rgbe", "pfm", "png", "jpg", "jpeg", "tga", "bmp", "ppm", "webp"];
        let kind = extension(name);
        if !known.contains(&kind.as_str()) {
            let help = format!("convert it to one of {}", known.join(", "));
            return self.report_error(
                span,
                format!("glimt cannot read .{} images", truncate_for_message(&kind)),
                Some(help),
            );
        }
        let Some(file) = self.resolve_asset_reference(name, &span, "image") else {
            if self.options.missing == crate::formats::foreign::MissingAssetMode::Note
                && self.start_environment(object)
            {
                self.document.set("color", shorten_number(0.5 * scale));
            }
            return;
        };
        if !self.start_environment(object) {
            return;
        }
        self.document.set_span_for_next_values(span);
        self.document.set("file", file);
        self.document.set_span_for_next_values(object.span.clone());
        self.document.set("rows", "poles");
        if scale != 1.0 {
            self.document.set("color", shorten_number(scale.max(0.0)));
        }
        // Mitsuba's u = 0 is at −z, the center of glimt's map.
        let half_turn = DMat3::from_diagonal(DVec3::new(-1.0, 1.0, -1.0));
        self.set_environment_matrix(object, linear_part(&matrix) * half_turn);
    }

    /// Adds the rotation of the environment, unless it is the identity.
    fn set_environment_matrix(&mut self, object: &'a PluginInstance, matrix: DMat3) {
        let axes = [matrix.x_axis, matrix.y_axis, matrix.z_axis].map(DVec3::try_normalize);
        let [Some(x), Some(y), Some(z)] = axes else {
            return self.report_error(
                object.span.clone(),
                "the environment's `to_world` is degenerate",
                None,
            );
        };
        if x.cross(y).dot(z) < 0.0 || x.dot(y).abs().max(x.dot(z).abs()).max(y.dot(z).abs()) > 1e-4 {
            let text = "the map is only rotated, not mirrored or skewed";
            self.notes.note_lighting_substitution(
                "an environment with a mirroring or skewed `to_world`",
                text,
                object.span.clone(),
            );
        }
        // Orthonormalize the axes.
        let Some(x) = (x - y * x.dot(y)).try_normalize() else { return };
        let z = x.cross(y);
        let rows = DMat3::from_cols(x, y, z).transpose().to_cols_array();
        let rows = rows.map(|entry| if entry.abs() < 1e-12 { 0.0 } else { entry });
        if rows != DMat3::IDENTITY.to_cols_array() {
            self.document.set("matrix", rows);
        }
    }

    fn add_sky(&mut self, object: &'a PluginInstance) {
        let turbidity = self.float(object, "turbidity").unwrap_or(3.0);
        let scale = self.float(object, "scale").unwrap_or(1.0);
        let mut sun_scale = self.float(object, "sun_scale").unwrap_or(1.0) * scale;
        let mut sky_scale = self.float(object, "sky_scale").unwrap_or(1.0) * scale;
        match object.plugin.as_str() {
            "sky" => sun_scale = 0.0,
            "sun" => sky_scale = 0.0,
            _ => {}
        }
        let ground = match self.color_or_texture(
            object,
            "albedo",
            ColorRole::Reflectance,
            if object.is_old { 0.15 } else { 0.3 },
        ) {
            ColorSource::Constant(color) => color.min(DVec3::ONE),
            ColorSource::Texture(_) => DVec3::splat(0.3),
        };
        let matrix = self.world_matrix(object);
        let direction = self.vector_property(object, "sun_direction");
        let angle = self.float(object, "sun_aperture").unwrap_or(0.5338)
            * self.float(object, "sun_radius_scale").unwrap_or(1.0);
        for name in [
            "resolution",
            "stretch",
            "extend",
            "complex_sun",
            "latitude",
            "longitude",
            "timezone",
            "year",
            "month",
            "day",
            "hour",
            "minute",
            "second",
        ] {
            object.property(name);
        }
        // An explicit direction is in world space, but one computed from a time and place is in local space.
        let direction = match direction {
            Some(direction) => linear_part(&matrix).inverse() * direction,
            None => self.sun_direction(object),
        };
        if !self.start_environment(object) {
            return;
        }
        // In local space, the up axis is z in Mitsuba 3 and y in version 0.6.
        let to_local =
            if object.is_old { DMat3::IDENTITY } else { DMat3::from_cols(DVec3::X, DVec3::NEG_Z, DVec3::Y) };
        let local = to_local * direction;
        let Some(local) = local.try_normalize().filter(|local| local.y > 0.0) else {
            let help = "choose a direction above the horizon".to_owned();
            return self.report_error(
                span_of(object, "sun_direction"),
                "the sun is below the horizon",
                Some(help),
            );
        };
        if !(1.0..=10.0).contains(&turbidity) {
            return self.report_error(
                span_of(object, "turbidity"),
                "`turbidity` must be between 1 and 10",
                None,
            );
        }
        let mut sky: TableEntries = vec![
            ("sun", local.into()),
            ("turbidity", shorten_number(turbidity).into()),
            ("ground", shorten_color(ground)),
        ];
        if (angle - 0.5338).abs() > 1e-9 {
            sky.push(("sun_angle", shorten_number(angle.clamp(0.001, 90.0)).into()));
        }
        for (key, value) in [("sun_scale", sun_scale), ("sky_scale", sky_scale)] {
            if value != 1.0 {
                sky.push((key, shorten_number(value.max(0.0)).into()));
            }
        }
        // In Mitsuba, the lower hemisphere is black.
        sky.push(("ground_scale", 0.0.into()));
        self.document.set("sky", SceneDocumentValue::Table(sky));
        self.set_environment_matrix(object, linear_part(&matrix) * to_local.transpose());
        let text = "the sun is up to 8.5 % dimmer than in Mitsuba's RGB mode";
        self.notes.note(&format!("`{}`", object.plugin), text, object.span.clone());
    }

    /// Direction toward the sun at a time and place, with z up and x to the south in Mitsuba 3, or y up and x
    /// to the east in version 0.6. Uses the algorithm of Blanco-Muriel et al., Computing the Solar Vector,
    /// Solar Energy 70(5), 2001.
    fn sun_direction(&mut self, object: &'a PluginInstance) -> DVec3 {
        let mut number = |name: &str, default: f64| self.float(object, name).unwrap_or(default);
        let (latitude, longitude) = (number("latitude", 35.6894), number("longitude", 139.6917));
        let timezone = number("timezone", 9.0);
        let (year, month, day) = (number("year", 2010.0), number("month", 7.0), number("day", 10.0));
        let hour =
            number("hour", 15.0) - timezone + (number("minute", 0.0) + number("second", 0.0) / 60.0) / 60.0;
        let month_term = ((month - 14.0) / 12.0).trunc();
        let days = (1461.0 * (year + 4800.0 + month_term) / 4.0).trunc()
            + (367.0 * (month - 2.0 - 12.0 * month_term) / 12.0).trunc()
            - (3.0 * ((year + 4900.0 + month_term) / 100.0).trunc() / 4.0).trunc()
            + day
            - 32_075.0;
        let elapsed = days - 0.5 + hour / 24.0 - 2_451_545.0;
        let omega = 2.1429 - 0.001_039_459_4 * elapsed;
        let mean_longitude = 4.895_063 + 0.017_202_791_698 * elapsed;
        let anomaly = 6.240_06 + 0.017_201_969_9 * elapsed;
        let ecliptic_longitude =
            mean_longitude + 0.033_416_07 * libm::sin(anomaly) + 0.000_348_94 * libm::sin(2.0 * anomaly)
                - 0.000_113_4
                - 0.000_020_3 * libm::sin(omega);
        let obliquity = 0.409_092_8 - 6.2140e-9 * elapsed + 0.000_039_6 * libm::cos(omega);
        let sine = libm::sin(ecliptic_longitude);
        let mut ascension = libm::atan2(libm::cos(obliquity) * sine, libm::cos(ecliptic_longitude));
        if ascension < 0.0 {
            ascension += 2.0 * PI;
        }
        let declination = libm::asin(libm::sin(obliquity) * sine);
        let greenwich = 6.697_424_324_2 + 0.065_709_828_3 * elapsed + hour;
        let hour_angle = (greenwich * 15.0 + longitude).to_radians() - ascension;
        let latitude = latitude.to_radians();
        let (sin_latitude, cos_latitude) = (libm::sin(latitude), libm::cos(latitude));
        let cos_hour = libm::cos(hour_angle);
        let zenith = libm::acos(
            (cos_latitude * cos_hour * libm::cos(declination) + libm::sin(declination) * sin_latitude)
                .clamp(-1.0, 1.0),
        );
        let azimuth = libm::atan2(
            -libm::sin(hour_angle),
            libm::tan(declination) * cos_latitude - sin_latitude * cos_hour,
        );
        // Correct for parallax.
        let zenith = zenith + 6_371.01 / 149_597_890.0 * libm::sin(zenith);
        let (sin_zenith, cos_zenith) = (libm::sin(zenith), libm::cos(zenith));
        if object.is_old {
            DVec3::new(libm::sin(azimuth) * sin_zenith, cos_zenith, -libm::cos(azimuth) * sin_zenith)
        } else {
            DVec3::new(-libm::cos(azimuth) * sin_zenith, -libm::sin(azimuth) * sin_zenith, cos_zenith)
        }
    }
}
