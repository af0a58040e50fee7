//! Resolves named textures to expression trees of images, checkers and constants.

use std::collections::HashMap;
use std::sync::Arc;

use super::colors::{ColorReader, SpectrumUse};
use super::lexer::{PbrtError, PbrtResult};
use super::parameters::{ParameterType, Parameters, Text};
use super::state::{ColorSpace, PlacedEntity, Statements};
use crate::formats::foreign::notes::NoteCollector;
use crate::math::{DVec2, DVec3};
use crate::scene::nearest::nearest_name;
use crate::scene::sanitize::escape_and_truncate;

/// Maximum nesting depth of textures.
const MAX_DEPTH: usize = 32;
/// Maximum number of nodes in the tree of a texture. A texture counts once for each use.
const MAX_NODES: usize = 256;

/// Whether a texture is a color or a number. pbrt has separate namespaces for them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum TextureValueKind {
    Color(SpectrumUse),
    Number,
}

impl TextureValueKind {
    /// A color that is a reflectance or transmittance.
    pub(super) const REFLECTANCE: Self = Self::Color(SpectrumUse::Reflectance);
}

/// Maps texture coordinates: (u, v) · `scale` + `offset`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct UvMapping {
    pub(super) scale: DVec2,
    pub(super) offset: DVec2,
}

impl UvMapping {
    pub(super) const IDENTITY: Self = Self { scale: DVec2::ONE, offset: DVec2::ZERO };
}

/// How an image continues outside the unit square.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ImageWrap {
    Repeat,
    Clamp,
    Black,
}

/// Interpolation of texels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ImageFilter {
    Nearest,
    Bilinear,
    Mipmap,
}

/// An image.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct ImageNode {
    pub(super) file: Text,
    pub(super) mapping: UvMapping,
    pub(super) wrap: ImageWrap,
    pub(super) filter: ImageFilter,
    /// Whether 8- and 16-bit values are linear.
    pub(super) is_linear: bool,
    /// Whether the texture is a number: alpha if there is an alpha channel, otherwise the channels' mean.
    pub(super) is_number: bool,
    /// Factor by which the texels are multiplied.
    pub(super) factor: DVec3,
    /// Whether the value is max(0, 1 − factor · texel).
    pub(super) is_inverted: bool,
}

/// A texture, as an expression tree.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum TextureNode {
    Constant(DVec3),
    Image(ImageNode),
    /// A checkerboard of cells one unit wide. The first texture fills the cell at (0, 0).
    Checker(UvMapping, Arc<[Self; 2]>),
    Product(Arc<[Self; 2]>),
    /// First, second and amount: (1 − amount) · first + amount · second.
    Mix(Arc<[Self; 3]>),
    /// Bilinear interpolation of the values at (0, 0), (0, 1), (1, 0) and (1, 1).
    Bilinear(UvMapping, Arc<[Self; 4]>),
    /// A number raised to a constant power.
    Power(Arc<Self>, f64),
    /// Gradient noise from 0 to `factor`.
    Noise {
        octaves: u32,
        factor: f64,
    },
}

impl TextureNode {
    /// The value of a constant, or `None` for other textures.
    pub(super) fn as_constant(&self) -> Option<DVec3> {
        match self {
            Self::Constant(value) => Some(*value),
            Self::Image(_)
            | Self::Checker(..)
            | Self::Product(_)
            | Self::Mix(_)
            | Self::Bilinear(..)
            | Self::Power(..)
            | Self::Noise { .. } => None,
        }
    }

    /// The image, or `None` for other textures.
    pub(super) fn as_image(&self) -> Option<&ImageNode> {
        match self {
            Self::Image(image) => Some(image),
            Self::Constant(_)
            | Self::Checker(..)
            | Self::Product(_)
            | Self::Mix(_)
            | Self::Bilinear(..)
            | Self::Power(..)
            | Self::Noise { .. } => None,
        }
    }

    /// The textures that this one directly combines.
    pub(super) fn parts(&self) -> &[Self] {
        match self {
            Self::Constant(_) | Self::Image(_) | Self::Noise { .. } => &[],
            Self::Checker(_, parts) | Self::Product(parts) => &**parts,
            Self::Mix(parts) => &**parts,
            Self::Bilinear(_, parts) => &**parts,
            Self::Power(part, _) => std::slice::from_ref(part),
        }
    }

    /// Number of nodes in the tree.
    fn node_count(&self) -> usize {
        1 + self.parts().iter().map(Self::node_count).sum::<usize>()
    }

    /// Multiplies two textures.
    pub(super) fn product(first: Self, second: Self) -> Self {
        match (first, second) {
            (Self::Constant(factor), other) | (other, Self::Constant(factor)) => other.scaled(factor),
            (first, second) => Self::Product(Arc::new([first, second])),
        }
    }

    /// Multiplies a texture by a constant.
    fn scaled(self, factor: DVec3) -> Self {
        match self {
            Self::Constant(value) => Self::Constant(value * factor),
            Self::Image(image) if !image.is_inverted => {
                Self::Image(ImageNode { factor: image.factor * factor, ..image })
            }
            Self::Checker(mapping, parts) => {
                Self::Checker(mapping, Arc::new(parts.as_ref().clone().map(|part| part.scaled(factor))))
            }
            other => Self::Product(Arc::new([other, Self::Constant(factor)])),
        }
    }

    /// Interpolates two textures.
    pub(super) fn mix(first: Self, second: Self, amount: Self) -> Self {
        match (&first, &second, amount.as_constant()) {
            (Self::Constant(a), Self::Constant(b), Some(amount)) => Self::Constant(a.lerp(*b, amount.x)),
            (_, _, Some(amount)) if amount.x == 0.0 => first,
            (_, _, Some(amount)) if amount.x == 1.0 => second,
            _ => Self::Mix(Arc::new([first, second, amount])),
        }
    }
}

/// Resolves textures by name.
pub(super) struct TextureResolver<'a> {
    pub(super) statements: &'a Statements,
    pub(super) colors: &'a ColorReader<'a>,
    /// Textures resolved so far.
    known: HashMap<(String, TextureValueKind), TextureNode>,
}

impl<'a> TextureResolver<'a> {
    pub(super) fn new(statements: &'a Statements, colors: &'a ColorReader<'a>) -> Self {
        Self { statements, colors, known: HashMap::new() }
    }

    /// Reads a parameter that may be a texture or a constant. Returns `None` if it is absent.
    pub(super) fn texture_or_constant(
        &mut self,
        parameters: &Parameters,
        name: &'static str,
        value: TextureValueKind,
        space: ColorSpace,
        notes: &mut NoteCollector,
    ) -> PbrtResult<Option<TextureNode>> {
        self.texture_or_constant_at_depth(parameters, name, value, space, notes, 0)
    }

    fn texture_or_constant_at_depth(
        &mut self,
        parameters: &Parameters,
        name: &'static str,
        value: TextureValueKind,
        space: ColorSpace,
        notes: &mut NoteCollector,
        depth: usize,
    ) -> PbrtResult<Option<TextureNode>> {
        let Some(found) = parameters.find(name) else { return Ok(None) };
        if found.kind == ParameterType::Texture {
            let text = found.single(found.texts()?)?;
            return self.named(text, value, notes, depth).map(Some);
        }
        match value {
            TextureValueKind::Number => {
                Ok(parameters.optional_float(name)?.map(DVec3::splat).map(TextureNode::Constant))
            }
            TextureValueKind::Color(usage) => self
                .colors
                .color_from_parameter(found, space, usage)
                .map(|color| Some(TextureNode::Constant(color))),
        }
    }

    /// Resolves a texture by name.
    fn named(
        &mut self,
        name: &Text,
        value: TextureValueKind,
        notes: &mut NoteCollector,
        depth: usize,
    ) -> PbrtResult<TextureNode> {
        let key = (name.text.clone(), value);
        if let Some(known) = self.known.get(&key) {
            return Ok(known.clone());
        }
        if depth > MAX_DEPTH {
            let message = "this texture uses itself, or textures are nested too deeply";
            return Err(PbrtError::new(name.span.clone(), message));
        }
        let (textures, kind) = match value {
            TextureValueKind::Number => (&self.statements.float_textures, "float"),
            TextureValueKind::Color(_) => (&self.statements.spectrum_textures, "spectrum"),
        };
        let Some(texture) = textures.get(&name.text) else {
            let near = nearest_name(&name.text, textures.keys().map(String::as_str));
            let shown = escape_and_truncate(&name.text, 40);
            let message = format!("there is no {kind} texture \"{shown}\"");
            return Err(PbrtError::new(name.span.clone(), message).with_suggestion(near));
        };
        let node = self.resolve_statement(texture, value, notes, depth)?;
        // Each use of a texture duplicates its tree, so the size could grow exponentially with the depth.
        if node.node_count() > MAX_NODES {
            let message = format!("this texture combines more than {MAX_NODES} textures");
            return Err(PbrtError::new(name.span.clone(), message));
        }
        self.known.insert(key, node.clone());
        Ok(node)
    }

    fn resolve_statement(
        &mut self,
        texture: &PlacedEntity,
        value: TextureValueKind,
        notes: &mut NoteCollector,
        depth: usize,
    ) -> PbrtResult<TextureNode> {
        let entity = &texture.entity;
        let parameters = &entity.parameters;
        let mut part = |resolver: &mut Self, name: &'static str, default: f64| {
            let space = entity.color_space;
            let found =
                resolver.texture_or_constant_at_depth(parameters, name, value, space, notes, depth + 1)?;
            PbrtResult::Ok(found.unwrap_or(TextureNode::Constant(DVec3::splat(default))))
        };
        let node = match &*entity.kind.text {
            "constant" => part(self, "value", 1.0)?,
            "scale" => {
                let tex = part(self, "tex", 1.0)?;
                // `scale` is a number even in color textures.
                let space = entity.color_space;
                let number = TextureValueKind::Number;
                let scale =
                    self.texture_or_constant_at_depth(parameters, "scale", number, space, notes, depth + 1)?;
                TextureNode::product(tex, scale.unwrap_or(TextureNode::Constant(DVec3::ONE)))
            }
            "mix" => {
                let (first, second) = (part(self, "tex1", 0.0)?, part(self, "tex2", 1.0)?);
                let (space, number) = (entity.color_space, TextureValueKind::Number);
                let amount =
                    self.texture_or_constant_at_depth(parameters, "amount", number, space, notes, depth + 1)?;
                let amount = amount.unwrap_or(TextureNode::Constant(DVec3::splat(0.5)));
                TextureNode::mix(first, second, amount)
            }
            "directionmix" => {
                let (first, second) = (part(self, "tex1", 0.0)?, part(self, "tex2", 1.0)?);
                parameters.ignore(&["dir"]);
                let text = "the mean of the two textures is used";
                notes.note_lighting_substitution("texture `directionmix`", text, entity.span());
                TextureNode::mix(first, second, TextureNode::Constant(DVec3::splat(0.5)))
            }
            "checkerboard" => {
                let parts = [part(self, "tex1", 1.0)?, part(self, "tex2", 0.0)?];
                if parameters.integer("dimension", 2, 2..=3)? == 3 {
                    let text = "its cells follow the texture coordinates instead of positions in space";
                    notes.note_substitution("texture `checkerboard` with 3 dimensions", text, entity.span());
                }
                TextureNode::Checker(uv_mapping(texture, notes)?, Arc::new(parts))
            }
            "dots" => {
                let (inside, outside) = (part(self, "inside", 1.0)?, part(self, "outside", 0.0)?);
                notes.note_substitution("texture `dots`", "their mean is used", entity.span());
                uv_mapping(texture, notes)?;
                // Half of the cells contain a dot of radius 0.35.
                let share = std::f64::consts::PI * 0.35 * 0.35 * 0.5;
                TextureNode::mix(outside, inside, TextureNode::Constant(DVec3::splat(share)))
            }
            "bilerp" => {
                let corners = [
                    part(self, "v00", 0.0)?,
                    part(self, "v01", 1.0)?,
                    part(self, "v10", 0.0)?,
                    part(self, "v11", 1.0)?,
                ];
                TextureNode::Bilinear(uv_mapping(texture, notes)?, Arc::new(corners))
            }
            "imagemap" => TextureNode::Image(image_node(texture, value, notes)?),
            "fbm" | "wrinkled" | "windy" | "marble" => noise_node(texture, notes)?,
            "ptex" => {
                parameters.ignore(&["filename", "encoding", "scale"]);
                notes.note_lighting_substitution(
                    "texture `ptex`",
                    "a constant of 0.5 is used",
                    entity.span(),
                );
                TextureNode::Constant(DVec3::splat(0.5))
            }
            other => return Err(unknown_texture_type_error(other, &entity.kind)),
        };
        parameters.check_all_used()?;
        Ok(node)
    }
}

fn unknown_texture_type_error(kind: &str, at: &Text) -> Box<PbrtError> {
    const NAMES: [&str; 13] = [
        "constant",
        "scale",
        "mix",
        "directionmix",
        "checkerboard",
        "dots",
        "bilerp",
        "imagemap",
        "fbm",
        "wrinkled",
        "windy",
        "marble",
        "ptex",
    ];
    let message = format!("unknown texture type \"{}\"", escape_and_truncate(kind, 40));
    PbrtError::new(at.span.clone(), message).with_suggestion(nearest_name(kind, NAMES))
}

/// Reads the mapping of a texture. Only (u, v) mappings have an equivalent.
fn uv_mapping(texture: &PlacedEntity, notes: &mut NoteCollector) -> PbrtResult<UvMapping> {
    let parameters = &texture.entity.parameters;
    let number = |name, default| parameters.float(name, default);
    let scale = DVec2::new(number("uscale", 1.0)?, number("vscale", 1.0)?);
    let offset = DVec2::new(number("udelta", 0.0)?, number("vdelta", 0.0)?);
    let mapping = parameters.string("mapping")?;
    parameters.ignore(&["v1", "v2"]);
    match mapping.map(|text| &*text.text) {
        None | Some("uv") => Ok(UvMapping { scale, offset }),
        Some(other @ ("spherical" | "cylindrical" | "planar")) => {
            let subject = format!("texture mapping `{other}`");
            notes.note_substitution(
                &subject,
                "the shape's texture coordinates are used",
                texture.entity.span(),
            );
            Ok(UvMapping { scale, offset })
        }
        Some(other) => {
            let near = nearest_name(other, ["uv", "spherical", "cylindrical", "planar"]);
            let span = parameters.span_of("mapping");
            Err(PbrtError::new(span, "unknown texture mapping").with_suggestion(near))
        }
    }
}

fn image_node(
    texture: &PlacedEntity,
    value: TextureValueKind,
    notes: &mut NoteCollector,
) -> PbrtResult<ImageNode> {
    let parameters = &texture.entity.parameters;
    let span = || texture.entity.span();
    let Some(file) = parameters.string("filename")? else {
        return Err(PbrtError::new(span(), "this texture has no `filename`"));
    };
    let filter = match parameters.string("filter")?.map(|text| &*text.text) {
        Some("point") => ImageFilter::Nearest,
        None | Some("bilinear") => ImageFilter::Bilinear,
        Some("trilinear" | "ewa" | "EWA") => ImageFilter::Mipmap,
        Some(other) => {
            let near = nearest_name(other, ["point", "bilinear", "trilinear", "ewa"]);
            let at = parameters.span_of("filter");
            return Err(PbrtError::new(at, "unknown texture filter").with_suggestion(near));
        }
    };
    let wrap = match parameters.string("wrap")?.map(|text| &*text.text) {
        None | Some("repeat") => ImageWrap::Repeat,
        Some("clamp") => ImageWrap::Clamp,
        Some("black") => ImageWrap::Black,
        Some("octahedralsphere") => {
            notes.note_substitution("`wrap` \"octahedralsphere\"", "the image repeats", span());
            ImageWrap::Repeat
        }
        Some(other) => {
            let near = nearest_name(other, ["repeat", "clamp", "black", "octahedralsphere"]);
            let at = parameters.span_of("wrap");
            return Err(PbrtError::new(at, "unknown `wrap`").with_suggestion(near));
        }
    };
    // pbrt ignores `encoding` except for PNG files.
    let is_png = file.text.to_lowercase().ends_with(".png");
    let is_linear = match parameters.string("encoding")?.map(|text| &*text.text) {
        None | Some("sRGB" | "srgb") => false,
        Some("linear") => is_png,
        Some(_) => {
            notes.note_substitution("`encoding` with a gamma", "sRGB is used", span());
            false
        }
    };
    parameters.ignore(&["maxanisotropy"]);
    Ok(ImageNode {
        file: file.clone(),
        mapping: uv_mapping(texture, notes)?,
        wrap,
        filter,
        is_linear,
        is_number: value == TextureValueKind::Number,
        factor: DVec3::splat(parameters.float("scale", 1.0)?),
        is_inverted: parameters.bool("invert", false)?,
    })
}

/// Replaces procedural textures that pbrt evaluates at positions in space.
fn noise_node(texture: &PlacedEntity, notes: &mut NoteCollector) -> PbrtResult<TextureNode> {
    let (parameters, kind) = (&texture.entity.parameters, &*texture.entity.kind.text);
    let octaves = parameters.integer("octaves", 8, 1..=64)?.min(16) as u32;
    parameters.ignore(&["roughness", "variation"]);
    let factor = parameters.float("scale", 1.0)?;
    let subject = format!("texture `{kind}`");
    let span = texture.entity.span();
    if kind == "marble" {
        notes.note_substitution(&subject, "its mean color is used", span);
        return Ok(TextureNode::Constant(DVec3::new(0.42, 0.42, 0.45)));
    }
    notes.note_substitution(&subject, "glimt's noise is used, which has a different pattern", span);
    Ok(TextureNode::Noise { octaves, factor: if kind == "windy" { 1.0 } else { factor } })
}
