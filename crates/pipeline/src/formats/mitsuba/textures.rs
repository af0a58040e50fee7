//! Converts textures.

use std::ops::Range;

use super::graph::{GraphObjectIndex, ObjectKind, PluginInstance};
use super::material_key::UvFlips;
use super::reader::{ColorRole, ColorSource, SceneReader, luminance};
use super::settings::span_of;
use super::xml::truncate_for_message;
use crate::formats::foreign::import::TableEntries;
use crate::formats::rounding::{shorten_color, shorten_number};
use crate::math::{DMat4, DVec3};
use crate::scene::SceneDocumentValue;

/// Purpose of a texture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum MitsubaTextureUse {
    Color,
    Number,
    Normal,
}

/// Extensions of images with linear floating-point pixels.
const FLOAT_IMAGES: [&str; 4] = ["exr", "hdr", "pfm", "rgbe"];
/// Extensions of images that glimt reads.
const IMAGES: [&str; 14] =
    ["png", "jpg", "jpeg", "ppm", "pgm", "pbm", "pfm", "tga", "bmp", "hdr", "rgbe", "exr", "webp", "apng"];

/// An affine map of texture coordinates: a 2 × 2 matrix in rows, then an offset.
#[derive(Clone, Copy, Debug, PartialEq)]
struct UvAffineMap {
    rows: [[f64; 2]; 2],
    offset: [f64; 2],
}

impl UvAffineMap {
    /// Combines the shape's convention and the texture's `to_uv`. Images are flipped, because Mitsuba's v = 0
    /// is their top row.
    fn new(to_uv: &DMat4, uv: UvFlips, is_image: bool) -> Self {
        let flip = |flips: bool| if flips { (-1.0, 1.0) } else { (1.0, 0.0) };
        let [(scale_u, offset_u), (scale_v, offset_v)] = [flip(uv.flips_u), flip(uv.flips_v)];
        let row = |index: usize| {
            let row = to_uv.row(index);
            let linear = [row.x * scale_u, row.y * scale_v];
            (linear, row.x * offset_u + row.y * offset_v + row.w)
        };
        let ((first, first_offset), (second, second_offset)) = (row(0), row(1));
        if is_image {
            let flipped = [-second[0], -second[1]];
            return Self { rows: [first, flipped], offset: [first_offset, 1.0 - second_offset] };
        }
        Self { rows: [first, second], offset: [first_offset, second_offset] }
    }

    /// Returns the keys `repeat`, `rotate` and `offset`, or `None` if the map shears or is degenerate.
    fn keys(&self) -> Option<TableEntries> {
        let [[a, b], [c, d]] = self.rows;
        let (first, second) = (libm::hypot(a, c), libm::hypot(b, d));
        let is_valid = first > 1e-12 && second > 1e-12 && first.is_finite() && second.is_finite();
        if !is_valid || (a * b + c * d).abs() > 1e-6 * first * second {
            return None;
        }
        let mut keys = TableEntries::new();
        let (repeat, angle) = if b.abs() <= 1e-9 * second && c.abs() <= 1e-9 * first {
            ([a, d], 0.0)
        } else {
            // The columns are rotated axes; the second may be mirrored.
            ([first, (a * d - b * c) / first], libm::atan2(c, a).to_degrees())
        };
        if repeat != [1.0; 2] {
            keys.push(("repeat", repeat.map(shorten_number).into()));
        }
        if angle != 0.0 {
            keys.push(("rotate", shorten_number(angle).into()));
        }
        // Keep integer offsets: they do not affect repeated textures, but they do affect clamped ones.
        if self.offset != [0.0; 2] {
            keys.push(("offset", self.offset.map(shorten_number).into()));
        }
        Some(keys)
    }
}

impl<'a> SceneReader<'a> {
    /// Returns the name of a texture, adding it if it is new. Returns `None` if the texture is constant or
    /// missing.
    pub(super) fn find_or_add_texture(
        &mut self,
        index: GraphObjectIndex,
        usage: MitsubaTextureUse,
        uv: UvFlips,
    ) -> Option<String> {
        self.find_or_add_scaled_texture(index, usage, uv, 1.0)
    }

    /// Like [`Self::find_or_add_texture`], with the colors multiplied by `factor`.
    pub(super) fn find_or_add_scaled_texture(
        &mut self,
        index: GraphObjectIndex,
        usage: MitsubaTextureUse,
        uv: UvFlips,
        factor: f64,
    ) -> Option<String> {
        let object = self.object_by_index(index);
        let (keys, wanted) = match object.plugin.as_str() {
            "bitmap" | "ldrtexture" | "exrtexture" => self.bitmap_keys(object, usage, uv)?,
            "checkerboard" => (self.checkerboard_keys(object, usage, uv)?, "checker".to_owned()),
            "scale" => {
                let inner = self.children_of_kind(object, ObjectKind::Texture).next()?.target;
                let scale =
                    self.float(object, "scale").or_else(|| self.float(object, "value")).unwrap_or(1.0);
                self.report_unused(index);
                return self.find_or_add_scaled_texture(inner, usage, uv, factor * scale);
            }
            "mesh_attribute" | "vertexcolors" | "vertex_color" => {
                if let Some(found) = self.attribute_texture_keys(object, usage) {
                    found
                } else {
                    let text = "replaced by its usual value, gray";
                    self.notes.note_lighting_substitution(
                        &format!("`{}`", object.plugin),
                        text,
                        object.span.clone(),
                    );
                    return None;
                }
            }
            "gridtexture" | "wireframe" | "curvature" | "volume" => {
                let text = "replaced by gray";
                self.notes.note_lighting_substitution(
                    &format!("texture `{}`", object.plugin),
                    text,
                    object.span.clone(),
                );
                return None;
            }
            _ => {
                self.report_unknown_plugin(
                    object,
                    "texture",
                    &["bitmap", "checkerboard", "mesh_attribute", "volume", "scale"],
                );
                return None;
            }
        };
        self.report_unused(index);
        self.report_unused_children(index);
        let mut keys = keys;
        if factor != 1.0 {
            keys.push(("factor", shorten_number(factor).into()));
        }
        let wanted = object.id.as_deref().unwrap_or(&wanted).to_owned();
        let spans = [object.span.clone(), span_of(object, "filename")];
        Some(self.find_or_add_texture_table(keys, &wanted, spans))
    }

    /// Returns the color of a spectrum that is used in place of a texture.
    pub(super) fn color_if_spectrum(&mut self, index: GraphObjectIndex, role: ColorRole) -> Option<DVec3> {
        let object = self.object_by_index(index);
        match object.kind {
            ObjectKind::Spectrum => Some(self.spectrum_plugin_color(object, role)),
            ObjectKind::Scene
            | ObjectKind::Bsdf
            | ObjectKind::Emitter
            | ObjectKind::Film
            | ObjectKind::Filter
            | ObjectKind::Integrator
            | ObjectKind::Medium
            | ObjectKind::Phase
            | ObjectKind::Sampler
            | ObjectKind::Sensor
            | ObjectKind::Shape
            | ObjectKind::Subsurface
            | ObjectKind::Texture
            | ObjectKind::Volume => None,
        }
    }

    /// Returns the value of a number key that reads a texture.
    pub(super) fn number_texture(
        &mut self,
        index: GraphObjectIndex,
        uv: UvFlips,
    ) -> Option<SceneDocumentValue> {
        let name = self.find_or_add_texture(index, MitsubaTextureUse::Number, uv)?;
        Some(SceneDocumentValue::Table(vec![("texture", name.into())]))
    }

    /// Returns the value of `roughness`, which is √α, for a texture of α.
    pub(super) fn roughness_texture(
        &mut self,
        index: GraphObjectIndex,
        uv: UvFlips,
    ) -> Option<SceneDocumentValue> {
        let object = self.object_by_index(index);
        if object.plugin == "checkerboard" {
            // Convert both values exactly.
            let name = self.add_square_root_checkerboard(index, uv)?;
            return Some(SceneDocumentValue::Table(vec![("texture", name.into())]));
        }
        let text = "used as √α instead of α";
        self.notes.note_lighting_substitution("a textured `alpha`", text, object.span.clone());
        self.number_texture(index, uv)
    }

    /// Returns the value of `bump`.
    pub(super) fn height_texture(
        &mut self,
        index: GraphObjectIndex,
        uv: UvFlips,
    ) -> Option<SceneDocumentValue> {
        let name = self.find_or_add_texture(index, MitsubaTextureUse::Number, uv)?;
        Some(name.into())
    }

    /// Whether an image may have an alpha channel, from the color type of a PNG file or the file extension.
    pub(super) fn image_may_have_alpha(&mut self, object: &'a PluginInstance) -> bool {
        let Some((name, span)) = self.text(object, "filename") else { return false };
        let Some(path) = self.find_file(name, &span) else { return false };
        match extension(&path.to_string_lossy()).as_str() {
            "png" | "apng" => self.inspect_watched(&path, None, |_| {
                use std::io::Read;
                let mut start = [0; 33];
                let read = std::fs::File::open(&path).and_then(|mut file| file.read_exact(&mut start));
                read.is_ok() && matches!(start[25], 4 | 6)
            }),
            "tga" | "webp" | "exr" | "bmp" => true,
            _ => false,
        }
    }

    fn bitmap_keys(
        &mut self,
        object: &'a PluginInstance,
        usage: MitsubaTextureUse,
        uv: UvFlips,
    ) -> Option<(TableEntries, String)> {
        let Some((name, span)) = self.text(object, "filename") else {
            self.report_error(object.span.clone(), "the texture needs `filename`", None);
            return None;
        };
        let kind = extension(name);
        if !IMAGES.contains(&kind.as_str()) {
            let help = format!("convert it to one of {}", IMAGES[..12].join(", "));
            self.report_error(
                span,
                format!("glimt cannot read .{} images", truncate_for_message(&kind)),
                Some(help),
            );
            return None;
        }
        let mut keys: TableEntries =
            vec![("file", self.resolve_asset_reference(name, &span, "image")?.into())];
        match self.text(object, "filter_type") {
            None | Some(("bilinear" | "trilinear" | "ewa", _)) => {}
            Some(("nearest", _)) => keys.push(("filter", "nearest".into())),
            Some((other, span)) => {
                let help = "expected bilinear or nearest".to_owned();
                self.report_error(
                    span,
                    format!("unknown filter `{}`", truncate_for_message(other)),
                    Some(help),
                );
            }
        }
        let wrap = self.text(object, "wrap_mode").or_else(|| self.text(object, "wrap_mode_u"));
        match wrap {
            None | Some(("repeat", _)) => {}
            Some(("mirror", _)) => keys.push(("wrap", "mirror".into())),
            Some(("clamp", _)) => keys.push(("wrap", "clamp".into())),
            Some((other, span)) => {
                let help = "expected repeat, mirror or clamp".to_owned();
                self.report_error(
                    span,
                    format!("unknown wrap mode `{}`", truncate_for_message(other)),
                    Some(help),
                );
            }
        }
        for name in ["wrap_mode_v", "max_anisotropy", "cache", "format"] {
            object.property(name);
        }
        let is_raw = self.boolean(object, "raw", false);
        let gamma = self.float(object, "gamma");
        let is_float = is_float_image(&kind);
        if !is_float && usage != MitsubaTextureUse::Normal {
            let is_linear = is_raw || gamma == Some(1.0);
            keys.push(("encoding", if is_linear { "linear" } else { "srgb" }.into()));
        } else if usage == MitsubaTextureUse::Normal && !is_raw && !is_float {
            let text = "read as linear; Mitsuba decodes it from sRGB";
            self.notes.note_lighting_substitution(
                "a normal map that is not `raw`",
                text,
                object.span.clone(),
            );
        }
        if let Some(gamma) = gamma
            && gamma != 1.0
            && (gamma - 2.2).abs() > 0.01
            && gamma > 0.0
        {
            self.notes.note_lighting_substitution(
                "`gamma` of a bitmap",
                "replaced by sRGB",
                span_of(object, "gamma"),
            );
        }
        keys.extend(self.uv_keys(object, uv, true));
        let stem = name.rsplit(['/', '\\']).next().unwrap_or_default();
        let stem = stem.rsplit_once('.').map_or(stem, |(stem, _)| stem);
        Some((keys, stem.to_owned()))
    }

    fn uv_keys(&mut self, object: &'a PluginInstance, uv: UvFlips, is_image: bool) -> TableEntries {
        let to_uv =
            self.transform_value(object, "to_uv").map_or(DMat4::IDENTITY, |transform| transform.matrix);
        let keys = UvAffineMap::new(&to_uv, uv, is_image).keys();
        keys.unwrap_or_else(|| {
            let text = "ignored";
            self.notes.note_lighting_substitution(
                "`to_uv` that shears the texture",
                text,
                span_of(object, "to_uv"),
            );
            UvAffineMap::new(&DMat4::IDENTITY, uv, is_image).keys().unwrap_or_default()
        })
    }

    /// Colors of a checkerboard, which may not be textures themselves.
    pub(super) fn checker_colors(&mut self, object: &'a PluginInstance) -> [DVec3; 2] {
        let mut color = |name: &str, default: f64| match self.color_or_texture(
            object,
            name,
            ColorRole::Reflectance,
            default,
        ) {
            ColorSource::Constant(color) => color,
            ColorSource::Texture(_) => {
                self.notes.note_lighting_substitution(
                    "a texture in a checkerboard",
                    "replaced by gray",
                    object.span.clone(),
                );
                DVec3::splat(0.5)
            }
        };
        [color("color0", 0.4), color("color1", 0.2)]
    }

    fn checkerboard_keys(
        &mut self,
        object: &'a PluginInstance,
        usage: MitsubaTextureUse,
        uv: UvFlips,
    ) -> Option<TableEntries> {
        let mut colors = self.checker_colors(object);
        match usage {
            MitsubaTextureUse::Color => {}
            // Mitsuba swaps the colors when it evaluates a checkerboard as a number.
            MitsubaTextureUse::Number => colors.reverse(),
            MitsubaTextureUse::Normal => {
                self.report_error(object.span.clone(), "a checkerboard cannot be a normal map", None);
                return None;
            }
        }
        Some(self.checker_keys_with_colors(object, colors, uv))
    }

    pub(super) fn checker_keys_with_colors(
        &mut self,
        object: &'a PluginInstance,
        colors: [DVec3; 2],
        uv: UvFlips,
    ) -> TableEntries {
        let colors = colors.map(shorten_color).to_vec();
        let mut keys: TableEntries =
            vec![("type", "checker".into()), ("colors", SceneDocumentValue::Array(colors))];
        keys.extend(self.uv_keys(object, uv, false));
        keys
    }

    /// Adds a texture with these keys unless an equal one exists, and returns its name. The spans locate the
    /// texture and its file name in the text.
    pub(super) fn find_or_add_texture_table(
        &mut self,
        mut keys: TableEntries,
        wanted: &str,
        [span, file_span]: [Range<usize>; 2],
    ) -> String {
        let identity = format!("{keys:?}");
        if let Some(known) = self.textures.get(&identity) {
            return known.clone();
        }
        let name = self.texture_names.make_unique(wanted, "texture");
        self.document.set_span_for_next_values(span.clone());
        self.document.start_named_table("textures", &name);
        // Errors of the image are reported at the name of the file.
        if let Some(file) = keys.extract_if(.., |(key, _)| *key == "file").next() {
            self.document.set_span_for_next_values(file_span);
            self.set_all(vec![file]);
            self.document.set_span_for_next_values(span);
        }
        self.set_all(keys);
        self.textures.insert(identity, name.clone());
        name
    }

    /// Adds a checkerboard of α as a texture of √α.
    fn add_square_root_checkerboard(&mut self, index: GraphObjectIndex, uv: UvFlips) -> Option<String> {
        let object = self.object_by_index(index);
        let [first, second] = self.checker_colors(object);
        let root = |color: DVec3| DVec3::splat(libm::sqrt(luminance(color).clamp(1e-4, 1.0)));
        let keys = self.checker_keys_with_colors(object, [root(second), root(first)], uv);
        Some(self.find_or_add_texture_table(keys, "roughness", [object.span.clone(), object.span.clone()]))
    }
}

/// Whether an extension is of images with linear floating-point values.
pub(super) fn is_float_image(extension: &str) -> bool {
    FLOAT_IMAGES.contains(&extension)
}

/// Returns the extension of a file name in lowercase.
pub(super) fn extension(name: &str) -> String {
    name.rsplit_once('.').map_or(String::new(), |(_, extension)| extension.to_lowercase())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn map(uv: UvFlips, to_uv: DMat4, is_image: bool) -> impl Fn(f64, f64) -> [f64; 2] {
        let UvAffineMap { rows, offset } = UvAffineMap::new(&to_uv, uv, is_image);
        move |u, v| std::array::from_fn(|index| rows[index][0] * u + rows[index][1] * v + offset[index])
    }

    #[test]
    fn uv_maps_follow_mitsubas_order() {
        let obj = UvFlips { flips_v: true, flips_u: false };
        assert_eq!(map(obj, DMat4::IDENTITY, true)(0.25, 0.75), [0.25, 0.75]);
        assert_eq!(map(UvFlips::default(), DMat4::IDENTITY, true)(0.25, 0.75), [0.25, 0.25]);
        // v scale s and offset t give the offset 1 − s − t.
        let to_uv = DMat4::from_translation(DVec3::new(0.0, 0.25, 0.0))
            * DMat4::from_scale(DVec3::new(1.0, 4.0, 1.0));
        assert_eq!(map(obj, to_uv, true)(0.0, 0.0), [0.0, 1.0 - 4.0 - 0.25]);
        assert_eq!(map(obj, to_uv, true)(0.0, 1.0), [0.0, 1.0 - 0.25]);
    }

    #[test]
    fn rotations_are_decomposed() {
        let to_uv = DMat4::from_rotation_z(0.5) * DMat4::from_scale(DVec3::new(2.0, 3.0, 1.0));
        let keys = UvAffineMap::new(&to_uv, UvFlips::default(), false).keys().expect("a map");
        let names: Vec<_> = keys.iter().map(|(key, _)| *key).collect();
        assert_eq!(names, ["repeat", "rotate"]);
        let shear = DMat4::from_scale(DVec3::new(2.0, 3.0, 1.0)) * DMat4::from_rotation_z(0.5);
        assert!(UvAffineMap::new(&shear, UvFlips::default(), false).keys().is_none());
    }
}
