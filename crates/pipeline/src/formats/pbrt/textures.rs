//! Writes the `[textures]` tables.

use std::sync::Arc;

use super::scene::PbrtConverter;
use super::texture_nodes::{ImageFilter, ImageNode, ImageWrap, TextureNode, UvMapping};
use crate::formats::foreign::import::TableEntries;
use crate::formats::rounding::shorten_color;
use crate::math::DVec3;
use crate::scene::SceneDocumentValue;

/// How a texture's values are used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum PbrtTextureUse {
    Color,
    Number,
    /// Heights, whose factor is the separate key `bump_scale`.
    Height,
    Normal,
}

impl PbrtConverter<'_> {
    /// Returns the value of a color key: a color or a texture reference.
    pub(super) fn color_value(&mut self, node: &TextureNode) -> SceneDocumentValue {
        let node = &self.with_missing_images_gray(node);
        if let Some(color) = node.as_constant() {
            return shorten_color(color);
        }
        texture_reference(self.texture(node, PbrtTextureUse::Color))
    }

    /// Returns the value of a number key: a number or a texture reference.
    pub(super) fn number_value(&mut self, node: &TextureNode) -> SceneDocumentValue {
        let node = &self.with_missing_images_gray(node);
        if let Some(number) = node.as_constant() {
            return number.x.into();
        }
        let name = self.texture(node, PbrtTextureUse::Number);
        SceneDocumentValue::Table(vec![("texture", name.into()), ("channel", "r".into())])
    }

    /// Replaces missing images with gray if `--missing note` tolerates them.
    pub(super) fn with_missing_images_gray(&mut self, node: &TextureNode) -> TextureNode {
        if let TextureNode::Image(image) = node
            && self.tolerate_if_missing(&image.file, "image", "gray is used")
        {
            return TextureNode::Constant(DVec3::splat(0.5));
        }
        let mut of = |part: &TextureNode| self.with_missing_images_gray(part);
        match node {
            TextureNode::Constant(_) | TextureNode::Image(_) | TextureNode::Noise { .. } => node.clone(),
            TextureNode::Checker(mapping, parts) => {
                TextureNode::Checker(*mapping, Arc::new(parts.each_ref().map(&mut of)))
            }
            TextureNode::Product(parts) => {
                let [first, second] = parts.each_ref().map(&mut of);
                TextureNode::product(first, second)
            }
            TextureNode::Mix(parts) => {
                let [first, second, amount] = parts.each_ref().map(&mut of);
                TextureNode::mix(first, second, amount)
            }
            TextureNode::Bilinear(mapping, parts) => {
                TextureNode::Bilinear(*mapping, Arc::new(parts.each_ref().map(&mut of)))
            }
            TextureNode::Power(part, exponent) => match of(part) {
                TextureNode::Constant(value) => {
                    TextureNode::Constant(DVec3::splat(libm::pow(value.x.max(0.0), *exponent)))
                }
                part => TextureNode::Power(Arc::new(part), *exponent),
            },
        }
    }

    /// Returns the name of a texture's table, adding the table if it is new.
    pub(super) fn texture(&mut self, node: &TextureNode, usage: PbrtTextureUse) -> String {
        let (keys, name) = match node {
            TextureNode::Image(image) if self.can_use_image_unbaked(image, usage) => {
                (self.image_keys(image, usage), file_stem(&image.file.text))
            }
            TextureNode::Checker(mapping, parts) => match (parts[0].as_constant(), parts[1].as_constant()) {
                (Some(first), Some(second)) => {
                    (checker_keys(*mapping, [first, second]), "checker".to_owned())
                }
                _ => self.bake_texture(node, usage),
            },
            TextureNode::Noise { octaves, factor } => (noise_keys(*octaves, *factor), "noise".to_owned()),
            TextureNode::Constant(_)
            | TextureNode::Image(_)
            | TextureNode::Product(_)
            | TextureNode::Mix(_)
            | TextureNode::Power(..)
            | TextureNode::Bilinear(..) => self.bake_texture(node, usage),
        };
        self.find_or_add_texture_table(keys, &name)
    }

    /// Returns the name of the table with these keys, adding the table if it is new.
    pub(super) fn find_or_add_texture_table(&mut self, keys: TableEntries, wanted: &str) -> String {
        let identity = format!("{keys:?}");
        if let Some(known) = self.textures.get(&identity) {
            return known.clone();
        }
        let name = self.texture_names.make_unique(wanted, "texture");
        self.document.start_named_table("textures", &name);
        keys.into_iter().for_each(|(key, value)| self.document.set(key, value));
        self.textures.insert(identity, name.clone());
        name
    }

    /// Whether glimt can use the image file directly, without baking.
    fn can_use_image_unbaked(&mut self, image: &ImageNode, usage: PbrtTextureUse) -> bool {
        if image.wrap == ImageWrap::Black || image.mapping.scale.min_element() == 0.0 {
            return false;
        }
        if image.factor.min_element() < 0.0 && usage != PbrtTextureUse::Height {
            return false;
        }
        match usage {
            PbrtTextureUse::Color => !image.is_inverted,
            PbrtTextureUse::Number => !image.is_inverted && self.is_gray_opaque_image(image),
            PbrtTextureUse::Height => self.is_gray_opaque_image(image),
            PbrtTextureUse::Normal => true,
        }
    }

    fn image_keys(&mut self, image: &ImageNode, usage: PbrtTextureUse) -> TableEntries {
        let mut keys: TableEntries = vec![("file", self.register_asset_file(&image.file).into())];
        match image.wrap {
            ImageWrap::Repeat | ImageWrap::Black => {}
            ImageWrap::Clamp => keys.push(("wrap", "clamp".into())),
        }
        match image.filter {
            ImageFilter::Nearest => keys.push(("filter", "nearest".into())),
            ImageFilter::Bilinear => {}
            ImageFilter::Mipmap => keys.push(("filter", "mipmap".into())),
        }
        let is_integer = !has_float_extension(&image.file.text);
        match usage {
            PbrtTextureUse::Normal => {}
            PbrtTextureUse::Color | PbrtTextureUse::Number | PbrtTextureUse::Height if image.is_linear => {
                keys.push(("encoding", "linear".into()));
            }
            // pbrt decodes the images of number textures from sRGB, as it does for colors.
            PbrtTextureUse::Number | PbrtTextureUse::Height if is_integer => {
                keys.push(("encoding", "srgb".into()));
            }
            PbrtTextureUse::Color | PbrtTextureUse::Number | PbrtTextureUse::Height => {}
        }
        push_mapping(&mut keys, image.mapping, 1.0);
        if usage == PbrtTextureUse::Color && image.factor != DVec3::ONE {
            keys.push(("factor", shorten_color(image.factor)));
        } else if usage == PbrtTextureUse::Number && image.factor.x != 1.0 {
            keys.push(("factor", image.factor.x.into()));
        }
        keys
    }
}

/// Value of a key that references a texture.
pub(super) fn texture_reference(name: String) -> SceneDocumentValue {
    SceneDocumentValue::Table(vec![("texture", name.into())])
}

/// Whether a file has an extension of a floating-point image format, whose texels are linear.
pub(super) fn has_float_extension(file: &str) -> bool {
    let file = file.to_lowercase();
    [".exr", ".hdr", ".pfm"].iter().any(|extension| file.ends_with(extension))
}

fn file_stem(file: &str) -> String {
    std::path::Path::new(file).file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default()
}

/// Adds the keys `repeat` and `offset`. One repetition in glimt spans `cells` units of pbrt's mapping.
pub(super) fn push_mapping(keys: &mut TableEntries, mapping: UvMapping, cells: f64) {
    let UvMapping { scale, offset } = mapping;
    if scale / cells != crate::math::DVec2::ONE {
        keys.push(("repeat", (scale / cells).to_array().into()));
    }
    if offset != crate::math::DVec2::ZERO {
        keys.push(("offset", (offset / cells).to_array().into()));
    }
}

/// Keys of a checker texture, which has two cells per repetition in glimt.
fn checker_keys(mapping: UvMapping, colors: [DVec3; 2]) -> TableEntries {
    let colors = colors.map(|color| color.max(DVec3::ZERO)).map(shorten_color).to_vec();
    let mut keys: TableEntries = vec![
        ("type", "checker".into()),
        ("colors", SceneDocumentValue::Array(colors)),
        ("filter", "mipmap".into()),
    ];
    push_mapping(&mut keys, mapping, 2.0);
    keys
}

/// Keys of a noise texture with values from 0 to `factor`.
fn noise_keys(octaves: u32, factor: f64) -> TableEntries {
    let colors = SceneDocumentValue::Array(vec![0.0.into(), factor.abs().into()]);
    vec![("type", "noise".into()), ("colors", colors), ("octaves", f64::from(octaves).into())]
}
