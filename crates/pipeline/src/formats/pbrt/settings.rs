//! Writes the `[render]`, `[camera]` and `[photons]` tables.

use super::lexer::{PbrtError, PbrtResult};
use super::parameters::{ParameterType, Parameters};
use super::scene::PbrtConverter;
use super::state::{PlacedEntity, TypedStatement};
use crate::formats::foreign::transform::{is_mirroring, linear_part};
use crate::math::{DMat3, DMat4, DVec2, DVec3};
use crate::scene::nearest::nearest_name;

/// Size, crop and exposure of the film.
struct FilmSettings {
    size: [i64; 2],
    /// The rendered part: its first column and row, and the column and row after its last.
    crop: [i64; 4],
    /// Exposure factor, without the exposure time.
    gain: f64,
}

impl PbrtConverter<'_> {
    pub(super) fn convert_settings_and_camera(&mut self) -> PbrtResult<()> {
        let statements = self.statements;
        let film = match &statements.film {
            Some(film) => self.read_film(film)?,
            None => FilmSettings { size: [1280, 720], crop: [0, 0, 1280, 720], gain: 1.0 },
        };
        let exposure = match &statements.camera {
            Some(camera) => exposure_time(&camera.entity.parameters)?,
            None => 1.0,
        };
        self.document.start_table("render");
        self.document.set("width", (film.crop[2] - film.crop[0]) as f64);
        self.document.set("height", (film.crop[3] - film.crop[1]) as f64);
        self.convert_sampler()?;
        self.convert_integrator()?;
        self.convert_filter()?;
        let gain = film.gain * exposure;
        if gain != 1.0 {
            self.document.set("gain", gain);
        }
        self.convert_camera(&film)
    }

    fn read_film(&mut self, film: &TypedStatement) -> PbrtResult<FilmSettings> {
        let parameters = &film.parameters;
        if !["rgb", "gbuffer", "spectral"].contains(&&*film.kind.text) {
            let near = nearest_name(&film.kind.text, ["rgb", "gbuffer", "spectral"]);
            return Err(PbrtError::new(film.kind.span.clone(), "unknown film").with_suggestion(near));
        }
        let width = parameters.integer("xresolution", 1280, 1..=65_536)?;
        let height = parameters.integer("yresolution", 720, 1..=65_536)?;
        let crop = read_crop(parameters, [width, height])?;
        let sensor = parameters.string("sensor")?.map_or("cie1931", |name| &name.text);
        if sensor != "cie1931" {
            let text = "its response is not simulated; colors differ by a few percent";
            self.notes.note(&format!("sensor `{sensor}`"), text, parameters.span_of("sensor"));
        }
        let white = parameters.float("whitebalance", 0.0)?;
        if white != 0.0 && (white - 6500.0).abs() > 50.0 {
            let text = "the image is not white balanced";
            self.notes.note_substitution("`whitebalance`", text, parameters.span_of("whitebalance"));
        }
        if parameters.optional_float("maxcomponentvalue")?.is_some() {
            let text = "samples are not clamped, so fireflies may remain";
            self.notes.note("`maxcomponentvalue`", text, parameters.span_of("maxcomponentvalue"));
        }
        let gain = parameters.positive_float("iso", 100.0)? / 100.0;
        let ignored =
            ["filename", "diagonal", "savefp16", "coordinatesystem", "nbuckets", "lambdamin", "lambdamax"];
        parameters.ignore(&ignored);
        parameters.check_all_used()?;
        Ok(FilmSettings { size: [width, height], crop, gain })
    }

    fn convert_sampler(&mut self) -> PbrtResult<()> {
        let Some(sampler) = &self.statements.sampler else {
            self.document.set("samples", 16.0);
            return Ok(());
        };
        let parameters = &sampler.parameters;
        const NAMES: [&str; 7] =
            ["zsobol", "paddedsobol", "halton", "sobol", "pmj02bn", "independent", "stratified"];
        let most = i64::from(u32::MAX);
        let samples = match &*sampler.kind.text {
            "stratified" => {
                parameters.integer("xsamples", 4, 1..=65_535)?
                    * parameters.integer("ysamples", 4, 1..=65_535)?
            }
            "independent" => parameters.integer("pixelsamples", 4, 1..=most)?,
            known if NAMES.contains(&known) => parameters.integer("pixelsamples", 16, 1..=most)?,
            other => {
                let error = PbrtError::new(sampler.kind.span.clone(), "unknown sampler");
                return Err(error.with_suggestion(nearest_name(other, NAMES)));
            }
        };
        parameters.ignore(&["seed", "randomization", "jitter", "pixelsamples"]);
        parameters.check_all_used()?;
        self.document.set_span_for_next_values(parameters.span_of("pixelsamples"));
        self.document.set("samples", samples as f64);
        Ok(())
    }

    fn convert_integrator(&mut self) -> PbrtResult<()> {
        let Some(integrator) = &self.statements.integrator else {
            self.document.set("integrator", "path");
            self.document.set("max_depth", 5.0);
            return Ok(());
        };
        let parameters = &integrator.parameters;
        let kind = &*integrator.kind.text;
        const PATHS: [&str; 8] =
            ["path", "volpath", "bdpt", "mlt", "simplepath", "simplevolpath", "randomwalk", "lightpath"];
        self.document.set_span_for_next_values(integrator.span());
        match kind {
            "sppm" => self.convert_photons(parameters)?,
            "ao" | "function" => {
                let text = "path tracing is used instead";
                self.notes.note_lighting_substitution(
                    &format!("integrator `{kind}`"),
                    text,
                    integrator.span(),
                );
                self.document.set("integrator", "path");
            }
            _ if PATHS.contains(&kind) => self.document.set("integrator", "path"),
            "directlighting" | "whitted" => {
                let error = PbrtError::new(integrator.kind.span.clone(), "this is a pbrt-v3 integrator");
                return Err(error.with_help(super::parameters::V3_HELP));
            }
            _ => {
                let near = nearest_name(kind, PATHS.into_iter().chain(["sppm", "ao"]));
                let error = PbrtError::new(integrator.kind.span.clone(), "unknown integrator");
                return Err(error.with_suggestion(near));
            }
        }
        let depth = parameters.integer("maxdepth", 5, 0..=i64::from(i32::MAX))?;
        // Longer paths contribute no visible light.
        self.document.set_span_for_next_values(parameters.span_of("maxdepth"));
        self.document.set("max_depth", depth.min(1000) as f64);
        if parameters.bool("regularize", false)? {
            let text = "surfaces are not made rougher after the first bounce";
            self.notes.note("`regularize`", text, parameters.span_of("regularize"));
        }
        parameters.ignore(&[
            "lightsampler",
            "samplelights",
            "samplebsdf",
            "bootstrapsamples",
            "chains",
            "mutationsperpixel",
            "largestepprobability",
            "sigma",
            "streamcount",
            "visualizestrategies",
            "visualizeweights",
            "cossample",
            "maxdistance",
            "seed",
            "photonsperiteration",
            "radius",
            "iterations",
            "rr",
            "pixelbounds",
            "function",
            "filename",
            "illuminant",
        ]);
        parameters.check_all_used()
    }

    fn convert_photons(&mut self, parameters: &Parameters) -> PbrtResult<()> {
        let count = parameters.integer("photonsperiteration", -1, -1..=i64::from(i32::MAX))?;
        let radius = parameters.positive_float("radius", 1.0)?;
        self.document.set("integrator", "whitted");
        self.document.start_table("photons");
        self.document.set("enabled", true);
        if count > 0 {
            self.document.set("count", count as f64);
        }
        self.document.set("radius", radius);
        self.document.start_table("render");
        Ok(())
    }

    fn convert_filter(&mut self) -> PbrtResult<()> {
        let Some(filter) = &self.statements.filter else {
            self.document.set("filter", "gaussian");
            return Ok(());
        };
        let parameters = &filter.parameters;
        let radius = |default| {
            PbrtResult::Ok([parameters.float("xradius", default)?, parameters.float("yradius", default)?])
        };
        let near = |a: f64, b: f64| (a - b).abs() < 1e-3;
        let (name, is_equal) = match &*filter.kind.text {
            "box" => ("box", radius(0.5)? == [0.5; 2]),
            "triangle" => ("tent", radius(2.0)? == [1.0; 2]),
            "gaussian" => {
                let is_narrow = near(parameters.float("sigma", 0.5)?, 0.5);
                ("gaussian", is_narrow && radius(1.5)? == [1.5; 2])
            }
            "mitchell" => {
                let third = 1.0 / 3.0;
                let is_usual =
                    near(parameters.float("B", third)?, third) && near(parameters.float("C", third)?, third);
                ("mitchell", is_usual && radius(2.0)? == [2.0; 2])
            }
            "sinc" => {
                parameters.ignore(&["tau"]);
                radius(4.0)?;
                ("mitchell", false)
            }
            other => {
                let near = nearest_name(other, ["box", "triangle", "gaussian", "mitchell", "sinc"]);
                let error = PbrtError::new(filter.kind.span.clone(), "unknown pixel filter");
                return Err(error.with_suggestion(near));
            }
        };
        if !is_equal {
            let text = format!("glimt's `{name}` filter has a different width; edges differ by a pixel");
            self.notes.note(&format!("filter `{}`", filter.kind.text), &text, filter.span());
        }
        parameters.check_all_used()?;
        self.document.set("filter", name);
        Ok(())
    }

    fn convert_camera(&mut self, film: &FilmSettings) -> PbrtResult<()> {
        self.document.start_table("camera");
        let Some(camera) = &self.statements.camera else {
            return self.write_camera_keys(DMat4::IDENTITY, film, &Lens::PINHOLE, "perspective", 90.0, None);
        };
        let PlacedEntity { entity, transform } = camera;
        let (parameters, span) = (&entity.parameters, entity.span());
        self.document.set_span_for_next_values(span.clone());
        let still = self.still_transform(*transform, span.clone());
        let matrix = still.inverse();
        if !matrix.is_finite() || camera_scale(&matrix).is_none() {
            let error =
                PbrtError::new(span, "this camera's transform is singular or has shear or non-uniform scale");
            return Err(error.with_help("it can combine translation, rotation, reflection and uniform scale"));
        }
        let lens = Lens {
            radius: parameters.float("lensradius", 0.0)?,
            focus: parameters.positive_float("focaldistance", 1e6)?,
        };
        let aspect = parameters.optional_float("frameaspectratio")?;
        let screen = parameters.floats("screenwindow")?.to_vec();
        let window = self.screen_window_bounds(film, aspect, &screen, parameters)?;
        let kind = &*entity.kind.text;
        let fov = parameters.float("fov", 90.0)?;
        if !(fov > 0.0 && fov < 180.0) {
            return Err(PbrtError::new(parameters.span_of("fov"), "`fov` must be between 0 and 180"));
        }
        match kind {
            "perspective" | "orthographic" | "spherical" => {}
            "realistic" => {
                let error = PbrtError::new(entity.kind.span.clone(), "glimt does not simulate lens systems");
                return Err(error.with_help("use a \"perspective\" camera with `lensradius`"));
            }
            other => {
                let near = nearest_name(other, ["perspective", "orthographic", "spherical", "realistic"]);
                let error = PbrtError::new(entity.kind.span.clone(), "unknown camera");
                return Err(error.with_suggestion(near));
            }
        }
        if kind == "spherical"
            && parameters.string("mapping")?.is_none_or(|mapping| mapping.text != "equirectangular")
        {
            let text = "the panorama is equirectangular";
            self.notes.note_substitution("`mapping` \"equalarea\" of a camera", text, entity.span());
        }
        parameters.ignore(&["shutteropen", "shutterclose", "mapping"]);
        parameters.check_all_used()?;
        let kind = if kind == "spherical" { "panorama" } else { kind };
        self.write_camera_keys(matrix, film, &lens, kind, fov, Some(window))
    }

    /// Returns the screen window [x0, x1, y0, y1] of the whole film. For a field of view of 90 degrees, it is
    /// on the plane at distance 1.
    fn screen_window_bounds(
        &mut self,
        film: &FilmSettings,
        aspect: Option<f64>,
        screen: &[f64],
        parameters: &Parameters,
    ) -> PbrtResult<[f64; 4]> {
        let pixels = film.size[0] as f64 / film.size[1] as f64;
        let frame = aspect.unwrap_or(pixels);
        if frame <= 0.0 {
            let span = parameters.span_of("frameaspectratio");
            return Err(PbrtError::new(span, "`frameaspectratio` must be greater than 0"));
        }
        let window = match *screen {
            [] if frame > 1.0 => [-frame, frame, -1.0, 1.0],
            [] => [-1.0, 1.0, -1.0 / frame, 1.0 / frame],
            [x0, x1, y0, y1] if x1 > x0 && y1 > y0 => [x0, x1, y0, y1],
            _ => {
                let error = PbrtError::new(parameters.span_of("screenwindow"), "invalid `screenwindow`");
                return Err(error.with_help("it needs four numbers: left < right, then bottom < top"));
            }
        };
        let shape = (window[1] - window[0]) / (window[3] - window[2]);
        if (shape / pixels - 1.0).abs() > 1e-3 {
            let text = "pixels are square, so the window is cropped or extended at the sides";
            self.notes.note_substitution("non-square pixels", text, parameters.span.clone());
        }
        Ok(window)
    }

    /// Writes the camera's keys. `matrix` transforms from the camera to the world.
    fn write_camera_keys(
        &mut self,
        matrix: DMat4,
        film: &FilmSettings,
        lens: &Lens,
        projection: &str,
        fov: f64,
        window: Option<[f64; 4]>,
    ) -> PbrtResult<()> {
        let frame = film.size[0] as f64 / film.size[1] as f64;
        let [x0, x1, y0, y1] = window.unwrap_or([-frame.max(1.0), frame.max(1.0), -1.0, 1.0]);
        let scale = camera_scale(&matrix).unwrap_or(1.0);
        let axis = |axis: DVec3| matrix.transform_vector3(axis).normalize_or_zero();
        let [forward, up] = match projection {
            "panorama" => [axis(DVec3::NEG_X), axis(DVec3::Y)],
            _ => [axis(DVec3::Z), axis(DVec3::Y)],
        };
        let position = matrix.w_axis.truncate();
        // Far from the origin, a short distance between the two points would be lost to rounding.
        let distance = (position.length() * 1e-3).max(1.0);
        self.document.set("position", position);
        self.document.set("look_at", position + forward * distance);
        self.document.set("up", up);
        if !is_mirroring(&matrix) {
            self.document.set("mirror", true);
        }
        // Compute the height and the center of the rendered part of the window.
        let pixel = DVec2::new((x1 - x0) / film.size[0] as f64, (y1 - y0) / film.size[1] as f64);
        let [left, top, right, bottom] = film.crop.map(|edge| edge as f64);
        let height = (bottom - top) * pixel.y;
        let center = DVec2::new(x0 + 0.5 * (left + right) * pixel.x, y1 - 0.5 * (top + bottom) * pixel.y);
        match projection {
            "panorama" => {
                self.document.set("projection", "panorama");
                return Ok(());
            }
            "orthographic" => {
                self.document.set("projection", "orthographic");
                self.document.set("view_height", height * scale);
            }
            _ => {
                // The field of view is along the shorter side of the whole film.
                let half = libm::tan(fov.to_radians() * 0.5) * height * 0.5;
                self.document.set("fov", 2.0 * libm::atan(half).to_degrees());
            }
        }
        // A left-handed camera flips the image after the shift.
        let sign = if is_mirroring(&matrix) { 1.0 } else { -1.0 };
        let shift = DVec2::new(center.x * sign, center.y) / height;
        if shift.length() > 1e-9 {
            self.document.set("shift", [shift.x, shift.y]);
        }
        if lens.radius > 0.0 {
            self.document.set("aperture", lens.radius * scale);
            self.document.set("focus", (lens.focus * scale).min(1e12));
        }
        Ok(())
    }
}

/// Returns the scale factor of a rotation or reflection with a uniform scale. The tolerance is large because
/// files often contain matrices with few digits.
fn camera_scale(matrix: &DMat4) -> Option<f64> {
    const TOLERANCE: f64 = 5e-3;
    let linear = linear_part(matrix);
    let scale = libm::cbrt(linear.determinant().abs());
    let product = linear.transpose() * linear * (1.0 / (scale * scale));
    let error = (product - DMat3::IDENTITY).to_cols_array();
    (scale > 1e-12 && error.iter().all(|entry| entry.abs() < TOLERANCE)).then_some(scale)
}

/// A thin lens.
struct Lens {
    radius: f64,
    focus: f64,
}

impl Lens {
    const PINHOLE: Self = Self { radius: 0.0, focus: 1.0 };
}

/// Reads `pixelbounds` or `cropwindow`. Returns the crop in pixels, as in [`FilmSettings::crop`].
fn read_crop(parameters: &Parameters, [width, height]: [i64; 2]) -> PbrtResult<[i64; 4]> {
    let bounds = parameters.integers("pixelbounds")?;
    let window = match parameters.find("cropwindow") {
        Some(found) if found.kind == ParameterType::Float => found.numbers()?.to_vec(),
        Some(found) => {
            return Err(PbrtError::new(found.span.clone(), "`cropwindow` must have the type float"));
        }
        None => Vec::new(),
    };
    let clamp = |edge: i64, most: i64| edge.clamp(0, most);
    let crop = match (&bounds[..], &window[..]) {
        ([], []) => [0, 0, width, height],
        (&[x0, x1, y0, y1], _) => [clamp(x0, width), clamp(y0, height), clamp(x1, width), clamp(y1, height)],
        ([], &[x0, x1, y0, y1]) => {
            let edge = |part: f64, size: i64| (part.clamp(0.0, 1.0) * size as f64).ceil() as i64;
            [
                edge(x0.min(x1), width),
                edge(y0.min(y1), height),
                edge(x0.max(x1), width),
                edge(y0.max(y1), height),
            ]
        }
        _ => {
            let name = if bounds.is_empty() { "cropwindow" } else { "pixelbounds" };
            let message = format!("`{name}` needs four numbers: x0, x1, y0 and y1");
            return Err(PbrtError::new(parameters.span_of(name), message));
        }
    };
    if crop[0] >= crop[2] || crop[1] >= crop[3] {
        let name = if bounds.is_empty() { "cropwindow" } else { "pixelbounds" };
        return Err(PbrtError::new(
            parameters.span_of(name),
            format!("`{name}` leaves nothing of the image"),
        ));
    }
    Ok(crop)
}

/// Returns how long the shutter is open.
fn exposure_time(parameters: &Parameters) -> PbrtResult<f64> {
    let time = parameters.float("shutterclose", 1.0)? - parameters.float("shutteropen", 0.0)?;
    if time > 0.0 {
        return Ok(time);
    }
    Err(PbrtError::new(parameters.span_of("shutterclose"), "the shutter closes before it opens"))
}
