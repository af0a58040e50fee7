//! Converts lights that project images (`projector`, textured `spot`).
//!
//! glimt's spotlights have no textures. A small thin pane in front of a light, with an index of refraction of
//! 1, filters the light in the same way: shadow rays are multiplied by its `tint`.

use std::f64::consts::PI;

use super::graph::{GraphObjectIndex, ObjectKind, PluginInstance};
use super::material_key::UvFlips;
use super::reader::{ColorRole, ColorSource, SceneReader};
use super::settings::FilmWindow;
use super::textures::{MitsubaTextureUse, extension, is_float_image};
use crate::assets::Companion;
use crate::assets::image::{ColorEncoding, ColorTransferFunction, ImageLimits, load_and_hash};
use crate::control::ignore_progress;
use crate::formats::foreign::pixels::Pixels;
use crate::formats::rounding::{shorten_color, shorten_number};
use crate::math::{DMat4, DVec2, DVec3, Vec3};
use crate::scene::SceneDocumentValue;
use crate::system::file::FileStamp;

/// Distance of the pane, relative to the distance of the light's target.
const PANE_DISTANCE: f64 = 1e-4;
/// Distance of the pane if the light has no target.
const DEFAULT_DISTANCE: f64 = 1e-3;
/// Distance of a camera at the light, in distances of the pane.
const CAMERA_CLEARANCE: f64 = 2.0;
/// A camera this close to the light might see the pane, in distances of the pane.
const NEAR_CAMERA: f64 = 20.0;
/// Minimum cosine between the directions of the light and of a camera that moves in front of the pane.
const PARALLEL: f64 = 0.999;
/// Maximum tangent of the angle between the axis and a corner of a pane.
const MAX_TANGENT: f64 = 20.0;
/// Minimum width and height of the image on the pane of a projector.
const MIN_PIXELS: usize = 256;

/// A light with a pane in front of it.
#[derive(Clone, Copy, Debug)]
struct PaneFrame {
    position: DVec3,
    /// Unit vectors: across, up, and the direction of the light.
    across: DVec3,
    up: DVec3,
    axis: DVec3,
    /// Distance of the pane.
    distance: f64,
}

impl PaneFrame {
    /// Returns `None` if the transform is degenerate.
    fn new(matrix: &DMat4, target: Option<DVec3>) -> Option<Self> {
        let position = matrix.w_axis.truncate();
        let axes = [matrix.x_axis, matrix.y_axis, matrix.z_axis].map(|axis| axis.truncate().try_normalize());
        let [Some(across), Some(up), Some(axis)] = axes else { return None };
        let distance = target.map_or(DEFAULT_DISTANCE, |target| (target - position).length() * PANE_DISTANCE);
        Some(Self { position, across, up, axis, distance: distance.max(1e-6) })
    }

    /// The point of the pane at tangents of the angles across and up.
    fn point(&self, x: f64, y: f64) -> DVec3 {
        self.position + (self.axis + self.across * x + self.up * y) * self.distance
    }
}

/// The image of a projector.
struct ProjectedImage {
    pixels: Pixels,
    /// Factor on the pixels.
    factor: DVec3,
}

/// Compensates for the cos³ falloff of the irradiance on a plane, so that the plane shows the image. Divides
/// the image by cos³ relative to the corners, and scales it to a maximum of 1; the scale becomes the factor.
/// `half` contains the tangents of half the angles of view.
fn compensate_cosine_falloff(image: &Pixels, half: DVec2) -> ProjectedImage {
    let peak = image.values.iter().fold(Vec3::splat(1e-30), |peak, value| peak.max(*value)).as_dvec3();
    let (width, height) = (image.width.max(MIN_PIXELS), image.height.max(MIN_PIXELS));
    let wrap = |index: i64, count: usize| Some(index.rem_euclid(count as i64) as usize);
    let pixel = |index: usize| {
        let uv = DVec2::new(
            ((index % width) as f64 + 0.5) / width as f64,
            ((index / width) as f64 + 0.5) / height as f64,
        );
        let at = (uv * 2.0 - 1.0) * half;
        let ratio = (1.0 + at.length_squared()) / (1.0 + half.length_squared());
        let size = DVec2::new(image.width as f64, image.height as f64);
        (image.bilinear(uv * size, wrap) / peak * (ratio * libm::sqrt(ratio))).as_vec3()
    };
    let values = (0..width * height).map(pixel).collect();
    ProjectedImage { pixels: Pixels { width, height, values }, factor: peak }
}

impl<'a> SceneReader<'a> {
    /// The frame of a light's pane. `None` if its transform is degenerate.
    fn light_frame(&mut self, object: &'a PluginInstance) -> Option<PaneFrame> {
        let transform = self.transform_value(object, "to_world");
        let matrix = transform.map_or(DMat4::IDENTITY, |transform| transform.matrix);
        PaneFrame::new(&matrix, transform.and_then(|transform| transform.target))
    }

    /// The frame of a pane in front of a light. `None` if the camera is so close that it would see the pane.
    fn pane_frame(&mut self, object: &'a PluginInstance) -> Option<PaneFrame> {
        let frame = self.light_frame(object)?;
        let would_see_pane = |camera: DVec3| {
            let is_in_front = (camera - frame.position).dot(frame.axis) > frame.distance;
            camera.distance(frame.position) < NEAR_CAMERA * frame.distance && !is_in_front
        };
        (!self.camera_position.is_some_and(would_see_pane)).then_some(frame)
    }

    /// Moves a camera that is at a light with a pane, and looks in the light's direction, in front of the
    /// pane.
    pub(super) fn camera_in_front_of_panes(
        &mut self,
        scene: &'a PluginInstance,
        position: DVec3,
        forward: DVec3,
    ) -> DVec3 {
        for child in self.children_of_kind(scene, ObjectKind::Emitter) {
            let light = self.object_by_index(child.target);
            let has_pane = light.plugin == "projector"
                || light.plugin == "spot" && light.named_child("texture").is_some();
            let Some(frame) = has_pane.then(|| self.light_frame(light)).flatten() else { continue };
            let is_at_light = position.distance(frame.position) < 0.01 * frame.distance;
            if is_at_light && frame.axis.dot(forward) > PARALLEL {
                let text = "the camera moves forward by 0.02 % of the distance of the light's target";
                self.notes.note("a camera at a light with an image", text, light.span.clone());
                return frame.position + frame.axis * (CAMERA_CLEARANCE * frame.distance);
            }
        }
        position
    }

    /// Adds a quad of a pane between tangents of angles. Texture coordinates are 0 at the first ones.
    fn add_pane_quad(&mut self, frame: &PaneFrame, [x0, x1]: [f64; 2], [y0, y1]: [f64; 2], material: &str) {
        let corner = frame.point(x0, y0);
        self.document.start_list_table("quad");
        self.document.set("material", material.to_owned());
        self.document.set("corner", corner);
        self.document.set("u", frame.point(x1, y0) - corner);
        self.document.set("v", frame.point(x0, y1) - corner);
    }

    /// Adds the material of a pane, and returns its name.
    fn add_pane_material(&mut self, texture: &str) -> String {
        let name = self.material_names.make_unique("projection", "material");
        self.document.start_named_table("materials", &name);
        self.document.set("type", "glass");
        self.document.set("ior", 1.0);
        self.document.set("thin", true);
        self.document.set("tint", SceneDocumentValue::Table(vec![("texture", texture.to_owned().into())]));
        name
    }

    /// Adds the pane of a spotlight with a texture. Returns false if glimt cannot express it.
    pub(super) fn add_spot_texture(
        &mut self,
        object: &'a PluginInstance,
        texture: GraphObjectIndex,
        cutoff: f64,
    ) -> bool {
        let bitmap = self.object_by_index(texture);
        let is_bounded = bitmap.plugin == "bitmap"
            && self.text(bitmap, "filename").is_some_and(|(name, _)| !is_float_image(&extension(name)));
        let half = libm::tan(cutoff.to_radians());
        if !is_bounded || cutoff >= 90.0 || half > MAX_TANGENT {
            return false;
        }
        let Some(frame) = self.pane_frame(object) else { return false };
        let Some(name) = self.find_or_add_texture(texture, MitsubaTextureUse::Color, UvFlips::default())
        else {
            return false;
        };
        let material = self.add_pane_material(&name);
        self.add_pane_quad(&frame, [-half, half], [-half, half], &material);
        true
    }

    /// Returns the irradiance of a projector, from the top row.
    fn projector_image(&mut self, object: &'a PluginInstance) -> Option<Pixels> {
        match self.color_or_texture(object, "irradiance", ColorRole::Emission, 1.0) {
            ColorSource::Constant(color) => {
                Some(Pixels { width: 1, height: 1, values: vec![color.as_vec3()] })
            }
            ColorSource::Texture(texture) => {
                let bitmap = self.object_by_index(texture);
                if bitmap.plugin != "bitmap" || bitmap.property("to_uv").is_some() {
                    self.refuse(object, "projectors without an image");
                    return None;
                }
                let (name, span) = self.text(bitmap, "filename")?;
                let path = self.asset_path(name, &span, "image")?;
                let is_raw = self.boolean(bitmap, "raw", false);
                self.report_unused(texture);
                let curve = if is_raw { ColorTransferFunction::Linear } else { ColorTransferFunction::Srgb };
                let stamp = FileStamp::from_path(&path);
                let encoding = ColorEncoding::CutOut(curve);
                let loaded =
                    load_and_hash(&path, encoding, ImageLimits::default(), &ignore_progress, self.token);
                let hash = loaded.as_ref().ok().map(|(_, hash)| *hash);
                self.companions.push(Companion { path, hash, stamp });
                match loaded {
                    Ok((image, _)) => {
                        let (width, height) = (image.texels.width as usize, image.texels.height as usize);
                        let color = |index: usize| image.texels.linear_color_at_index(index);
                        Some(Pixels { width, height, values: (0..width * height).map(color).collect() })
                    }
                    Err(error) => {
                        self.report_error(span, error.to_string(), None);
                        None
                    }
                }
            }
        }
    }

    /// Adds a projector: a spotlight whose pane contains the image, and a black frame around the pane.
    pub(super) fn add_projector(&mut self, object: &'a PluginInstance) {
        let Some(frame) = self.pane_frame(object) else {
            return self.refuse(object, "projectors at the camera");
        };
        let Some(image) = self.projector_image(object) else { return };
        let window = FilmWindow::full(image.width as f64, image.height as f64);
        let half_height = self.half_height_of_perspective(object, &window);
        let half = DVec2::new(half_height * window.aspect(), half_height);
        let reach = half.length();
        if reach > MAX_TANGENT {
            return self.refuse(object, "projectors with so wide angles");
        }
        let scale = self.float(object, "scale").unwrap_or(1.0).max(0.0);
        let ProjectedImage { pixels, factor } = compensate_cosine_falloff(&image, half);
        let secant = libm::sqrt(1.0 + half.length_squared());
        let intensity = factor * scale * PI * (secant * secant * secant);
        let file = self.add_generated_file("projection", "pfm", pixels.encode_pfm(false));
        let texture = self.texture_names.make_unique("projection", "texture");
        self.document.start_named_table("textures", &texture);
        self.document.set("file", file);
        self.document.set("wrap", "clamp");
        let material = self.add_pane_material(&texture);
        let black = self.black_material();
        // Mitsuba's u grows to −x, and v downward.
        self.add_pane_quad(&frame, [half.x, -half.x], [-half.y, half.y], &material);
        let outside = reach * 1.01;
        self.add_pane_quad(&frame, [half.x, outside], [-outside, outside], &black);
        self.add_pane_quad(&frame, [-outside, -half.x], [-outside, outside], &black);
        self.add_pane_quad(&frame, [-half.x, half.x], [half.y, outside], &black);
        self.add_pane_quad(&frame, [-half.x, half.x], [-outside, -half.y], &black);
        self.document.start_list_table("light");
        self.document.set("type", "spot");
        self.document.set("position", frame.position);
        self.document.set("look_at", frame.position + frame.axis);
        self.document.set("intensity", shorten_color(intensity));
        self.document.set("angle", shorten_number(2.0 * libm::atan(reach).to_degrees()));
        self.document.set("blend", 0.0);
    }

    /// Returns the name of the black material, adding it if it is new.
    fn black_material(&mut self) -> String {
        if let Some(known) = &self.black {
            return known.clone();
        }
        let name = self.material_names.make_unique("black", "material");
        self.document.start_named_table("materials", &name);
        self.document.set("diffuse", 0.0);
        self.black = Some(name.clone());
        name
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn images_are_equalized_by_the_cosine() {
        let image = Pixels { width: 1, height: 1, values: vec![Vec3::new(3.0, 1.0, 0.0)] };
        let half = DVec2::new(2.0, 1.0);
        let ProjectedImage { pixels, factor } = compensate_cosine_falloff(&image, half);
        assert_eq!(factor.x, 3.0);
        let (first, middle) = (pixels.get(0, 0), pixels.get(MIN_PIXELS / 2, MIN_PIXELS / 2));
        assert!(first.x > 0.98 && first.x <= 1.0 && (first.y - first.x).abs() < 1e-6, "{first}");
        // cos³ at the corner of the image is (1 + 4 + 1)^(−3/2).
        assert!((middle.x - 6_f64.powf(-1.5)).abs() < 1e-3, "{middle}");
    }
}
