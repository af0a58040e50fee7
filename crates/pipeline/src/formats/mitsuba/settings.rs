//! Converts the integrator, the sensor, its film and its sampler.

use std::ops::Range;

use super::graph::{Child, ObjectKind, PluginInstance};
use super::reader::SceneReader;
use super::xml::truncate_for_message;
use crate::formats::foreign::transform::{is_mirroring, linear_part};
use crate::math::{DMat4, DVec3};

/// Default size of Mitsuba's films.
const DEFAULT_FILM_SIZE: [i64; 2] = [768, 576];
/// Maximum width and height of an image.
const MAX_SIZE: i64 = 65_536;
/// Diagonal of 35 mm film in millimeters, the reference for focal lengths.
const FILM_DIAGONAL: f64 = 43.266_615_305_567_87;
/// `max_depth` for integrators without a depth limit.
const UNLIMITED_DEPTH: f64 = 1000.0;

/// Integrators that solve the whole rendering equation.
const PATH_INTEGRATORS: [&str; 21] = [
    "path",
    "volpath",
    "volpathmis",
    "volpath_simple",
    "bdpt",
    "mlt",
    "pssmlt",
    "erpt",
    "ptracer",
    "vpl",
    "prb",
    "prbvolpath",
    "prb_basic",
    "prb_projective",
    "emission_projective",
    "projective_path",
    "pathsimple",
    "path_mis",
    "guided_path",
    "moment",
    "aov",
];
/// Integrators with photon maps.
const PHOTON_INTEGRATORS: [&str; 3] = ["photonmapper", "ppm", "sppm"];
/// Integrators that render another integrator's light and add channels.
const WRAPPERS: [&str; 6] = ["moment", "aov", "multichannel", "adaptive", "irrcache", "stokes"];

/// The pixels of a film and the part that is rendered.
pub(super) struct FilmWindow {
    /// Size of the whole film.
    size: [f64; 2],
    /// Offset of the crop window.
    crop_offset: [f64; 2],
    /// Size of the crop window.
    crop_size: [f64; 2],
}

impl FilmWindow {
    /// The whole of a film.
    pub(super) fn full(width: f64, height: f64) -> Self {
        Self { size: [width, height], crop_offset: [0.0; 2], crop_size: [width, height] }
    }

    /// Width divided by height of the whole film.
    pub(super) fn aspect(&self) -> f64 {
        self.size[0] / self.size[1]
    }

    /// Fraction of the film's height that is rendered.
    fn height_fraction(&self) -> f64 {
        self.crop_size[1] / self.size[1]
    }

    /// Offset of the crop window's center from the film's center, to the right and up, in units of the crop
    /// window's height.
    fn lens_shift(&self) -> [f64; 2] {
        let offset =
            |axis: usize| self.crop_offset[axis] + self.crop_size[axis] / 2.0 - self.size[axis] / 2.0;
        [offset(0) / self.crop_size[1], -offset(1) / self.crop_size[1]]
    }
}

impl<'a> SceneReader<'a> {
    /// Adds the `[render]` and `[camera]` tables.
    pub(super) fn add_render_and_camera_tables(&mut self, scene: &'a PluginInstance) {
        let Some(sensor) = self.select_sensor(scene) else { return };
        let sensor_index = sensor.target;
        let sensor = self.object_by_index(sensor_index);
        if let Some(medium) = self.children_of_kind(sensor, ObjectKind::Medium).next() {
            let text = "the camera is in a vacuum";
            self.notes.note_lighting_substitution("a sensor in a medium", text, medium.span.clone());
        }
        let film = self.children_of_kind(sensor, ObjectKind::Film).next().map(|child| child.target);
        let window = self.film_window(film.map(|index| self.object_by_index(index)));
        self.document.set_span_for_next_values(sensor.span.clone());
        self.document.start_table("render");
        self.document.set("width", window.crop_size[0]);
        self.document.set("height", window.crop_size[1]);
        let sampler = self.children_of_kind(sensor, ObjectKind::Sampler).next();
        let samples = sampler.map(|child| self.object_by_index(child.target));
        let count = samples.and_then(|object| self.integer(object, "sample_count")).unwrap_or(4);
        if count < 1
            && let Some(sampler) = samples
        {
            self.notes.note("`sample_count` below 1", "replaced by 1", span_of(sampler, "sample_count"));
        }
        self.document.set("samples", count.clamp(1, i64::from(u32::MAX)) as f64);
        self.add_integrator(scene);
        self.add_filter(film.map(|index| self.object_by_index(index)));
        self.add_camera(scene, sensor, &window);
        self.report_unused_settings(scene, sensor_index);
    }

    /// Returns the sensor selected with `--sensor`, or the first one.
    fn select_sensor(&mut self, scene: &'a PluginInstance) -> Option<&'a Child> {
        let sensors: Vec<&Child> = self.children_of_kind(scene, ObjectKind::Sensor).collect();
        if sensors.is_empty() {
            let help = "add a <sensor>, or open the file that includes this one".to_owned();
            self.report_error(scene.span.clone(), "the scene has no sensor", Some(help));
            return None;
        }
        let wanted = self.options.sensor.as_deref();
        let Some(wanted) = wanted else {
            if let Some(second) = sensors.get(1) {
                let text = "only the first is used; choose another with --sensor";
                self.notes.note("several sensors", text, second.span.clone());
            }
            return sensors.first().copied();
        };
        let by_name =
            sensors.iter().find(|child| self.object_by_index(child.target).id.as_deref() == Some(wanted));
        let by_number = || sensors.get(wanted.parse::<usize>().ok()?.checked_sub(1)?);
        let found = by_name.or_else(by_number).copied();
        if found.is_none() {
            let name = |(index, child): (usize, &&Child)| match &self.object_by_index(child.target).id {
                Some(id) => format!("{} ({})", index + 1, truncate_for_message(id)),
                None => (index + 1).to_string(),
            };
            let names: Vec<_> = sensors.iter().enumerate().take(20).map(name).collect();
            let help = format!("the sensors are {}", names.join(", "));
            let span = sensors[0].span.clone();
            self.report_error(
                span,
                format!("--sensor: there is no sensor `{}`", truncate_for_message(wanted)),
                Some(help),
            );
        }
        found
    }

    fn film_window(&mut self, film: Option<&'a PluginInstance>) -> FilmWindow {
        let [default_width, default_height] = DEFAULT_FILM_SIZE;
        let full = |width: i64, height: i64| FilmWindow::full(width as f64, height as f64);
        let Some(film) = film else { return full(default_width, default_height) };
        match film.plugin.as_str() {
            "hdrfilm" | "ldrfilm" | "mfilm" | "tiledhdrfilm" | "pngfilm" | "exrfilm" => {}
            "specfilm" => {
                let text = "rendered with the colors of the CIE observer instead of the film's channels";
                self.notes.note_lighting_substitution("`specfilm`", text, film.span.clone());
            }
            _ => self.report_unknown_plugin(film, "film", &["hdrfilm", "ldrfilm", "specfilm"]),
        }
        for name in ["pixel_format", "component_format", "file_format", "compensate", "banner", "attach_log"]
        {
            film.property(name);
        }
        for name in ["gamma", "exposure", "tonemap_method", "key", "burn"] {
            if let Some(property) = film.property(name) {
                let subject = format!("`{name}` of the film");
                self.notes.note(&subject, "ignored; use `exposure` and `tonemap`", property.span.clone());
            }
        }
        if self.boolean(film, "sample_border", false) || self.boolean(film, "high_quality_edges", false) {
            self.notes.note(
                "`sample_border`",
                "glimt does not sample pixels outside the image",
                film.span.clone(),
            );
        }
        let mut size = |name: &str, default: i64| {
            let value = self.integer(film, name).unwrap_or(default);
            if !(1..=MAX_SIZE).contains(&value) {
                let span = film.property(name).map_or(film.span.clone(), |property| property.span.clone());
                self.report_error(span, format!("`{name}` must be between 1 and {MAX_SIZE}"), None);
                return default;
            }
            value
        };
        let (width, height) = (size("width", default_width), size("height", default_height));
        let (crop_width, crop_height) = (size("crop_width", width), size("crop_height", height));
        let x = self.integer(film, "crop_offset_x").unwrap_or(0);
        let y = self.integer(film, "crop_offset_y").unwrap_or(0);
        if x < 0 || y < 0 || x.saturating_add(crop_width) > width || y.saturating_add(crop_height) > height {
            self.report_error(film.span.clone(), "the crop window extends beyond the film", None);
            return full(width, height);
        }
        FilmWindow {
            crop_offset: [x as f64, y as f64],
            crop_size: [crop_width as f64, crop_height as f64],
            ..full(width, height)
        }
    }

    fn add_filter(&mut self, film: Option<&'a PluginInstance>) {
        let filter = film.and_then(|film| self.children_of_kind(film, ObjectKind::Filter).next());
        let Some(filter) = filter.map(|child| self.object_by_index(child.target)) else {
            self.document.set("filter", "gaussian");
            return;
        };
        self.document.set_span_for_next_values(filter.span.clone());
        let name = match filter.plugin.as_str() {
            "box" => "box",
            "tent" => "tent",
            "gaussian" => {
                if let Some(deviation) = self.float(filter, "stddev")
                    && deviation != 0.5
                {
                    let text = "glimt's filter has a standard deviation of 0.5";
                    self.notes.note("`stddev` of `gaussian`", text, filter.span.clone());
                }
                "gaussian"
            }
            "mitchell" => "mitchell",
            "catmullrom" | "lanczos" => {
                self.notes.note(
                    &format!("`{}`", filter.plugin),
                    "replaced by `mitchell`",
                    filter.span.clone(),
                );
                "mitchell"
            }
            _ => {
                self.report_unknown_plugin(
                    filter,
                    "filter",
                    &["box", "tent", "gaussian", "mitchell", "catmullrom", "lanczos"],
                );
                "box"
            }
        };
        if filter.property("radius").is_some()
            || filter.property("b").is_some()
            || filter.property("c").is_some()
        {
            self.notes.note(
                "parameters of the filter",
                "ignored; glimt's filters have no parameters",
                filter.span.clone(),
            );
        }
        self.document.set("filter", name);
    }

    fn add_integrator(&mut self, scene: &'a PluginInstance) {
        let mut integrator = self.children_of_kind(scene, ObjectKind::Integrator).next();
        let mut nested = 0;
        // Integrators that add channels wrap the integrator that computes the light.
        while let Some(child) = integrator {
            let object = self.object_by_index(child.target);
            if !WRAPPERS.contains(&object.plugin.as_str()) || nested > 8 {
                break;
            }
            let text = match object.plugin.as_str() {
                "aov" | "multichannel" => Some("only the light is rendered; --layers adds channels"),
                "stokes" => Some("only the light is rendered, without polarization"),
                _ => None,
            };
            if let Some(text) = text {
                self.notes.note(&format!("`{}`", object.plugin), text, object.span.clone());
            }
            let inner = self.children_of_kind(object, ObjectKind::Integrator).next();
            if inner.is_none() {
                break;
            }
            (integrator, nested) = (inner, nested + 1);
        }
        let Some(integrator) = integrator.map(|child| self.object_by_index(child.target)) else {
            self.document.set("integrator", "path");
            self.document.set("max_depth", UNLIMITED_DEPTH);
            return;
        };
        self.document.set_span_for_next_values(integrator.span.clone());
        // Mitsuba's differentiable path tracers stop after 6 segments by default.
        let default_depth = if integrator.plugin.starts_with("prb") { 6 } else { -1 };
        let depth = self.integer(integrator, "max_depth").unwrap_or(default_depth);
        let depth = if depth < 0 { UNLIMITED_DEPTH } else { (depth - 1).clamp(0, 10_000) as f64 };
        let plugin = integrator.plugin.as_str();
        if self.boolean(integrator, "hide_emitters", false) {
            let text = "emitters stay visible to the camera";
            self.notes.note_substitution("`hide_emitters`", text, integrator.span.clone());
        }
        match plugin {
            "direct" | "direct_projective" => {
                for name in ["emitter_samples", "shading_samples", "bsdf_samples"] {
                    let count = self.integer(integrator, name);
                    if name != "bsdf_samples" && count.is_some_and(|count| count > 1) {
                        let text = "Mitsuba counts point, spot and directional lights once per emitter sample; glimt counts them once";
                        self.notes.note(
                            "`direct` with several emitter samples",
                            text,
                            integrator.span.clone(),
                        );
                    }
                }
                self.document.set("integrator", "path");
                self.document.set("max_depth", 1.0);
            }
            _ if PATH_INTEGRATORS.contains(&plugin) => {
                self.document.set("integrator", "path");
                self.document.set("max_depth", depth);
            }
            _ if PHOTON_INTEGRATORS.contains(&plugin) => {
                self.document.set("integrator", "whitted");
                self.document.set("max_depth", depth);
                self.document.start_table("photons");
                self.document.set("enabled", true);
                self.document.start_table("render");
            }
            "depth" | "ao" | "field" | "normals" | "albedo" => {
                let text = "replaced by `path`; --view shows normals, albedo and depth";
                self.notes.note_lighting_substitution(&format!("`{plugin}`"), text, integrator.span.clone());
                self.document.set("integrator", "path");
                self.document.set("max_depth", depth);
            }
            _ => {
                let known =
                    ["path", "direct", "volpath", "aov", "moment", "ptracer", "bdpt", "photonmapper", "sppm"];
                self.report_unknown_plugin(integrator, "integrator", &known);
            }
        }
        for name in ["samples_per_pass", "block_size", "spp", "rr_depth"] {
            integrator.property(name);
        }
    }

    fn add_camera(&mut self, scene: &'a PluginInstance, sensor: &'a PluginInstance, window: &FilmWindow) {
        self.document.set_span_for_next_values(sensor.span.clone());
        let transform = self.transform_value(sensor, "to_world");
        let matrix = transform.map_or(DMat4::IDENTITY, |transform| transform.matrix);
        let linear = linear_part(&matrix);
        let [Some(across), Some(up), Some(forward)] =
            [linear.x_axis, linear.y_axis, linear.z_axis].map(|axis| axis.try_normalize())
        else {
            self.report_error(sensor.span.clone(), "the sensor's `to_world` is degenerate", None);
            return;
        };
        let skew = across.dot(up).abs().max(across.dot(forward).abs()).max(up.dot(forward).abs());
        let [width, height, depth] = [linear.x_axis, linear.y_axis, linear.z_axis].map(DVec3::length);
        if skew > 1e-4 || (width / height - 1.0).abs() > 1e-4 {
            let text = "rendered without skew or stretch";
            self.notes.note_lighting_substitution(
                "a sensor with a skewed or stretched `to_world`",
                text,
                sensor.span.clone(),
            );
        }
        let position = self.camera_in_front_of_panes(scene, matrix.w_axis.truncate(), forward);
        let target = transform.and_then(|transform| transform.target);
        let distance =
            target.map(|target| (target - position).dot(forward)).filter(|distance| *distance > 0.0);
        self.document.start_table("camera");
        self.camera_position = Some(position);
        self.document.set("position", position);
        self.document.set("look_at", position + forward * distance.unwrap_or(width.max(1.0)));
        self.document.set("up", up);
        let is_mirrored = is_mirroring(&matrix);
        let plugin = sensor.plugin.as_str();
        let offset = [("principal_point_offset_x", 0), ("principal_point_offset_y", 1)];
        let offset = offset.map(|(name, axis)| {
            self.float(sensor, name).unwrap_or(0.0) * window.crop_size[axis] / window.crop_size[1]
        });
        match plugin {
            "perspective" | "thinlens" | "perspective_rdist" => {
                if plugin == "perspective_rdist" {
                    let text = "rendered without lens distortion";
                    self.notes.note_substitution("`perspective_rdist`", text, sensor.span.clone());
                }
                let half_height = self.half_height_of_perspective(sensor, window) * height / depth;
                let fov = 2.0 * libm::atan(half_height * window.height_fraction()).to_degrees();
                self.document.set("fov", fov);
                if plugin == "thinlens" {
                    self.add_lens(sensor, height, depth);
                }
            }
            "orthographic" | "telecentric" => {
                // The film spans −1 to 1 along x in the sensor's space.
                self.document.set("projection", "orthographic");
                self.document.set("view_height", 2.0 * width / window.aspect() * window.height_fraction());
                if plugin == "telecentric" {
                    self.add_lens(sensor, height, depth);
                }
            }
            "spherical" | "envmap" => self.document.set("projection", "panorama"),
            "irradiancemeter" | "radiancemeter" | "fluencemeter" | "distant" | "batch" => {
                self.refuse(sensor, "this kind of sensor");
                return;
            }
            _ => {
                self.report_unknown_plugin(
                    sensor,
                    "sensor",
                    &["perspective", "thinlens", "orthographic", "spherical"],
                );
                return;
            }
        }
        let [right, upward] = window.lens_shift();
        let shift = [right + offset[0], upward - offset[1]];
        if shift != [0.0; 2] {
            self.document.set("shift", [if is_mirrored { -shift[0] } else { shift[0] }, shift[1]]);
        }
        if is_mirrored {
            self.document.set("mirror", true);
        }
        for name in ["near_clip", "far_clip"] {
            sensor.property(name);
        }
    }

    fn add_lens(&mut self, sensor: &'a PluginInstance, scale: f64, depth: f64) {
        let radius = self.float(sensor, "aperture_radius").unwrap_or(0.0) * scale;
        if radius <= 0.0 {
            return;
        }
        self.document.set("aperture", radius);
        match self.float(sensor, "focus_distance") {
            Some(distance) if distance > 0.0 => self.document.set("focus", distance * depth),
            // Without a focus distance, Mitsuba focuses on the far clipping plane.
            Some(_) | None => {
                let far = self.float(sensor, "far_clip").unwrap_or(10_000.0);
                self.document.set("focus", far * depth);
            }
        }
    }

    /// Tangent of half the vertical field of view of the whole film.
    pub(super) fn half_height_of_perspective(
        &mut self,
        sensor: &'a PluginInstance,
        window: &FilmWindow,
    ) -> f64 {
        let aspect = window.aspect();
        let (angle, axis, span) = match self.float(sensor, "fov") {
            Some(fov) => {
                let axis = self.text(sensor, "fov_axis");
                let span = axis.as_ref().map_or(sensor.span.clone(), |(_, span)| span.clone());
                (fov.to_radians(), axis.map_or("x", |(name, _)| name), span)
            }
            None => {
                let length = self.focal_length_in_millimeters(sensor);
                (2.0 * libm::atan(FILM_DIAGONAL / (2.0 * length)), "diagonal", sensor.span.clone())
            }
        };
        if !(angle > 0.0 && angle < std::f64::consts::PI) {
            let span = sensor.property("fov").map_or(sensor.span.clone(), |property| property.span.clone());
            self.report_error(span, "`fov` must be between 0 and 180 degrees", None);
            return 0.5;
        }
        let half = libm::tan(angle / 2.0);
        match axis {
            "x" => half / aspect,
            "y" => half,
            "smaller" if aspect > 1.0 => half,
            "smaller" => half / aspect,
            "larger" if aspect > 1.0 => half / aspect,
            "larger" => half,
            "diagonal" => half / libm::sqrt(1.0 + aspect * aspect),
            other => {
                let help = "expected x, y, diagonal, smaller or larger".to_owned();
                self.report_error(
                    span,
                    format!("unknown axis `{}`", truncate_for_message(other)),
                    Some(help),
                );
                half
            }
        }
    }

    /// Focal length in millimeters, 50 by default.
    fn focal_length_in_millimeters(&mut self, sensor: &'a PluginInstance) -> f64 {
        const DEFAULT: f64 = 50.0;
        let Some((text, span)) = self.text(sensor, "focal_length") else { return DEFAULT };
        let number = text.trim().trim_end_matches("mm").trim().parse::<f64>().ok();
        number.filter(|length| *length > 0.0 && length.is_finite()).unwrap_or_else(|| {
            self.report_error(span, "expected a focal length such as 50mm", None);
            DEFAULT
        })
    }
}

/// Span of a property, or of the object if it has no such property.
pub(super) fn span_of(object: &PluginInstance, name: &str) -> Range<usize> {
    object.property(name).map_or(object.span.clone(), |property| property.span.clone())
}
