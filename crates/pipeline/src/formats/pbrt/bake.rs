//! Bakes textures that glimt cannot express into images: products, mixes, inverted images and powers.

use std::collections::HashMap;

use rayon::prelude::*;

use super::lexer::{PbrtError, PbrtResult};
use super::memo;
use super::scene::PbrtConverter;
use super::texture_nodes::{ImageFilter, ImageNode, ImageWrap, TextureNode, UvMapping};
use super::textures::{PbrtTextureUse, push_mapping};
use crate::assets::image::{ColorEncoding, ColorTransferFunction, ImageLimits, load_and_hash};
use crate::assets::{AssetError, Companion};
use crate::control::{CancelToken, ignore_progress};
use crate::formats::foreign::import::TableEntries;
use crate::formats::foreign::pixels::Pixels;
use crate::materials::texels::Texels;
use crate::math::color::luminance;
use crate::math::{DVec2, DVec3, Vec3};
use crate::system::file::FileStamp;

/// Maximum number of texels in a baked image.
const MAX_TEXELS: f64 = 8e6;
/// Texels per checker cell along each axis.
const CELL_TEXELS: f64 = 64.0;

/// Identity of a decoded image: its file, `is_linear` and `is_number`.
type DecodedImageKey = (String, bool, bool);

/// Decoded images by identity.
type Images = HashMap<DecodedImageKey, Pixels>;

/// The part of the (u, v) plane that a baked image covers.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Domain {
    /// Maps (u, v) to the image.
    mapping: UvMapping,
    /// Number of columns and rows.
    size: [usize; 2],
    wrap: ImageWrap,
}

impl PbrtConverter<'_> {
    /// Converts a texture of pbrt's roughness to glimt's, which is the square root of α.
    pub(super) fn roughness_node(&mut self, node: TextureNode, is_remapped: bool) -> TextureNode {
        TextureNode::Power(node.into(), if is_remapped { 0.25 } else { 0.5 })
    }

    /// Returns the name of a height texture, and the height of its white texels.
    pub(super) fn height_texture(&mut self, node: &TextureNode) -> (String, f64) {
        if let TextureNode::Image(image) = node
            && image.wrap != ImageWrap::Black
        {
            let sign = if image.is_inverted { -1.0 } else { 1.0 };
            let plain = ImageNode { factor: DVec3::ONE, is_inverted: false, ..image.clone() };
            return (self.texture(&TextureNode::Image(plain), PbrtTextureUse::Height), sign * image.factor.x);
        }
        (self.texture(node, PbrtTextureUse::Height), 1.0)
    }

    /// Whether an image is gray and opaque, so that its first channel is the number that pbrt uses.
    pub(super) fn is_gray_opaque_image(&mut self, image: &ImageNode) -> bool {
        let path = self.asset_path(&image.file.text);
        let stamp = FileStamp::from_path(&path);
        self.companions.push(Companion { path: path.clone(), hash: None, stamp });
        memo::memoized_is_gray(&path, stamp, || {
            let Ok(texels) =
                self.load_and_watch_image(image, ColorEncoding::CutOut(ColorTransferFunction::Srgb))
            else {
                return true;
            };
            texels.are_all_gray() && !has_transparency(&texels)
        })
    }

    /// Mean luminance of an image.
    pub(super) fn mean_luminance(&mut self, image: &ImageNode) -> PbrtResult<f64> {
        let texels = self.load_and_watch_image(image, ColorEncoding::Srgb);
        let texels = texels.map_err(|error| PbrtError::new(image.file.span.clone(), error.to_string()))?;
        Ok(f64::from(luminance(texels.mean())).max(1e-12))
    }

    /// Bakes a texture. Returns the keys of its table and a name for it.
    pub(super) fn bake_texture(
        &mut self,
        node: &TextureNode,
        usage: PbrtTextureUse,
    ) -> (TableEntries, String) {
        let mut leaves = Vec::new();
        collect_uv_dependent_nodes(node, &mut leaves);
        let first_file = leaves.iter().find_map(|leaf| leaf.as_image()).map(|image| &image.file);
        let mut images = Images::new();
        for leaf in &leaves {
            if let TextureNode::Image(image) = leaf {
                let loaded = self.load_image(image, &mut images);
                if self.value_or_record_error(loaded).is_none() {
                    return (vec![("file", image.file.text.clone().into())], "image".to_owned());
                }
            }
        }
        let (domain, is_exact) = domain_of(&leaves, &images);
        if !is_exact {
            let text = "their combination repeats after one unit of u and v";
            let span = first_file.map_or(0..0, |file| file.span.clone());
            self.notes.note_substitution("textures with different scales", text, span);
        }
        let is_number = usage != PbrtTextureUse::Color;
        let pixels = bake(node, &images, &domain, usage, self.token);
        let name = first_file.map_or_else(|| "texture".to_owned(), |file| file_stem(&file.text));
        let file = self.add_generated_file(&name, "pfm", pixels.encode_pfm(is_number));
        let mut keys: TableEntries = vec![("file", file.into())];
        if domain.wrap == ImageWrap::Clamp {
            keys.push(("wrap", "clamp".into()));
        }
        push_mapping(&mut keys, domain.mapping, 1.0);
        (keys, name)
    }

    fn load_image(&mut self, image: &ImageNode, images: &mut Images) -> PbrtResult<()> {
        let key = decoded_image_key(image);
        if images.contains_key(&key) {
            return Ok(());
        }
        let curve = if image.is_linear { ColorTransferFunction::Linear } else { ColorTransferFunction::Srgb };
        let texels = self.load_and_watch_image(image, ColorEncoding::CutOut(curve));
        let texels = texels.map_err(|error| PbrtError::new(image.file.span.clone(), error.to_string()))?;
        let is_alpha = has_transparency(&texels);
        let value = |index: usize| {
            if !image.is_number {
                return texels.linear_color_at_index(index);
            }
            let alpha = texels.premultiplied_texel(index).w;
            Vec3::splat(match is_alpha {
                true => alpha,
                false => texels.linear_color_at_index(index).element_sum() / 3.0,
            })
        };
        let values = (0..texels.len()).map(value).collect();
        let (width, height) = (texels.width as usize, texels.height as usize);
        images.insert(key, Pixels { width, height, values });
        Ok(())
    }

    fn load_and_watch_image(
        &mut self,
        image: &ImageNode,
        encoding: ColorEncoding,
    ) -> Result<Texels, AssetError> {
        let path = self.asset_path(&image.file.text);
        let stamp = FileStamp::from_path(&path);
        let loaded = load_and_hash(&path, encoding, ImageLimits::default(), &ignore_progress, self.token);
        let (hash, result) = match loaded {
            Ok((decoded, hash)) => (Some(hash), Ok(decoded.texels)),
            Err(error) => (None, Err(error)),
        };
        self.companions.push(Companion { path, hash, stamp });
        result
    }
}

fn file_stem(file: &str) -> String {
    std::path::Path::new(file).file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

fn has_transparency(texels: &Texels) -> bool {
    texels.has_alpha() && (0..texels.len()).any(|index| texels.premultiplied_texel(index).w < 1.0)
}

fn decoded_image_key(image: &ImageNode) -> DecodedImageKey {
    (image.file.text.clone(), image.is_linear, image.is_number)
}

/// Collects the nodes that depend directly on (u, v).
fn collect_uv_dependent_nodes<'a>(node: &'a TextureNode, leaves: &mut Vec<&'a TextureNode>) {
    match node {
        TextureNode::Image(_) | TextureNode::Checker(..) | TextureNode::Bilinear(..) => leaves.push(node),
        TextureNode::Constant(_)
        | TextureNode::Noise { .. }
        | TextureNode::Product(_)
        | TextureNode::Mix(_)
        | TextureNode::Power(..) => {}
    }
    node.parts().iter().for_each(|part| collect_uv_dependent_nodes(part, leaves));
}

/// Returns the mapping of a leaf, its period in mapped units, and its number of texels per mapped unit.
fn leaf_mapping_and_resolution(leaf: &TextureNode, images: &Images) -> (UvMapping, f64, DVec2) {
    match leaf {
        TextureNode::Image(image) => {
            let size = images.get(&decoded_image_key(image));
            let size = size.map_or(DVec2::ONE, |size| DVec2::new(size.width as f64, size.height as f64));
            (image.mapping, 1.0, size)
        }
        TextureNode::Checker(mapping, _) => (*mapping, 2.0, DVec2::splat(CELL_TEXELS)),
        TextureNode::Bilinear(mapping, _) => (*mapping, 1.0, DVec2::splat(256.0)),
        TextureNode::Constant(_)
        | TextureNode::Noise { .. }
        | TextureNode::Product(_)
        | TextureNode::Mix(_)
        | TextureNode::Power(..) => (UvMapping::IDENTITY, 1.0, DVec2::ONE),
    }
}

/// Chooses the domain of a baked image. Also returns whether the image repeats exactly as the texture does.
fn domain_of(leaves: &[&TextureNode], images: &Images) -> (Domain, bool) {
    let grids: Vec<_> = leaves.iter().map(|leaf| leaf_mapping_and_resolution(leaf, images)).collect();
    let first = grids.first().map_or(UvMapping::IDENTITY, |grid| grid.0);
    let has_same_mapping = grids.iter().all(|grid| grid.0 == first) && first.scale.abs().min_element() > 0.0;
    let period = grids.iter().map(|grid| grid.1).fold(1.0, f64::max);
    let (mapping, is_exact) = match has_same_mapping {
        true => (UvMapping { scale: first.scale / period, offset: first.offset / period }, true),
        false => {
            let is_whole = |number: f64| (number - number.round()).abs() < 1e-6;
            let repeats = |(mapping, period, _): &(UvMapping, f64, DVec2)| {
                is_whole(mapping.scale.x / period) && is_whole(mapping.scale.y / period)
            };
            (UvMapping::IDENTITY, grids.iter().all(repeats))
        }
    };
    let resolution = grids.iter().map(|(leaf, _, size)| {
        let units = (leaf.scale / mapping.scale).abs();
        *size * units
    });
    let mut size = resolution.fold(DVec2::ONE, DVec2::max).ceil();
    let most = MAX_TEXELS.sqrt();
    if size.x * size.y > MAX_TEXELS {
        size = (size * (most / (size.x * size.y).sqrt())).ceil().min(DVec2::splat(8192.0));
    }
    let is_clamped = |leaf: &&TextureNode| match leaf {
        TextureNode::Image(image) => image.wrap != ImageWrap::Repeat,
        TextureNode::Bilinear(..) => true,
        TextureNode::Constant(_)
        | TextureNode::Checker(..)
        | TextureNode::Product(_)
        | TextureNode::Mix(_)
        | TextureNode::Power(..)
        | TextureNode::Noise { .. } => false,
    };
    let clamps = has_same_mapping && period == 1.0 && !leaves.is_empty() && leaves.iter().all(is_clamped);
    let wrap = if clamps { ImageWrap::Clamp } else { ImageWrap::Repeat };
    (Domain { mapping, size: [size.x as usize, size.y as usize], wrap }, is_exact)
}

/// Evaluates a texture at all texel centers of a domain. Heights are shifted so that their minimum is 0.
/// After cancellation, the remaining rows are black.
fn bake(
    node: &TextureNode,
    images: &Images,
    domain: &Domain,
    usage: PbrtTextureUse,
    token: &CancelToken,
) -> Pixels {
    let [width, height] = domain.size;
    let row_values = |row: usize| {
        let is_canceled = token.is_canceled();
        (0..width).map(move |column| {
            if is_canceled {
                return Vec3::ZERO;
            }
            let x = (column as f64 + 0.5) / width as f64;
            let y = 1.0 - (row as f64 + 0.5) / height as f64;
            let uv = (DVec2::new(x, y) - domain.mapping.offset) / domain.mapping.scale;
            evaluate(node, images, uv).as_vec3()
        })
    };
    let mut values: Vec<Vec3> = (0..height).into_par_iter().flat_map_iter(row_values).collect();
    if usage == PbrtTextureUse::Height {
        let least = values.iter().map(|value| value.x).fold(f32::INFINITY, f32::min);
        values.iter_mut().for_each(|value| *value -= least);
    }
    values.iter_mut().for_each(|value| *value = value.max(Vec3::ZERO));
    Pixels { width, height, values }
}

/// Evaluates a texture at (u, v).
fn evaluate(node: &TextureNode, images: &Images, uv: DVec2) -> DVec3 {
    let of = |part: &TextureNode| evaluate(part, images, uv);
    match node {
        TextureNode::Constant(value) => *value,
        TextureNode::Image(image) => image_color_at_uv(image, images, uv),
        TextureNode::Checker(mapping, parts) => {
            let cell = (uv * mapping.scale + mapping.offset).floor();
            of(&parts[usize::from((cell.x + cell.y).rem_euclid(2.0) == 1.0)])
        }
        TextureNode::Product(parts) => of(&parts[0]) * of(&parts[1]),
        TextureNode::Mix(parts) => of(&parts[0]).lerp(of(&parts[1]), of(&parts[2]).x),
        TextureNode::Bilinear(mapping, parts) => {
            let at = uv * mapping.scale + mapping.offset;
            let [a, b, c, d] = [0, 1, 2, 3].map(|index| of(&parts[index]));
            a.lerp(c, at.x).lerp(b.lerp(d, at.x), at.y)
        }
        TextureNode::Power(part, exponent) => {
            DVec3::splat(libm::pow(of(part).x.max(0.0), *exponent).min(1.0))
        }
        // Noise depends on positions in space, not on (u, v), so use its mean.
        TextureNode::Noise { factor, .. } => DVec3::splat(0.5 * factor),
    }
}

fn image_color_at_uv(image: &ImageNode, images: &Images, uv: DVec2) -> DVec3 {
    let Some(pixels) = images.get(&decoded_image_key(image)) else { return DVec3::ZERO };
    let at = uv * image.mapping.scale + image.mapping.offset;
    let place = DVec2::new(at.x * pixels.width as f64, (1.0 - at.y) * pixels.height as f64);
    let place = match image.filter {
        ImageFilter::Nearest => place.floor() + 0.5,
        ImageFilter::Bilinear | ImageFilter::Mipmap => place,
    };
    let index = |index: i64, count: usize| {
        let count = count as i64;
        match image.wrap {
            ImageWrap::Repeat => Some(index.rem_euclid(count) as usize),
            ImageWrap::Clamp => Some(index.clamp(0, count - 1) as usize),
            ImageWrap::Black => (0..count).contains(&index).then_some(index as usize),
        }
    };
    let value = image.factor * pixels.bilinear(place, index);
    if image.is_inverted { (1.0 - value).max(DVec3::ZERO) } else { value }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::super::parameters::Text;
    use super::*;

    fn image(scale: f64) -> TextureNode {
        TextureNode::Image(ImageNode {
            file: Text { text: "a.png".to_owned(), span: 0..0 },
            mapping: UvMapping { scale: DVec2::splat(scale), offset: DVec2::ZERO },
            wrap: ImageWrap::Repeat,
            filter: ImageFilter::Bilinear,
            is_linear: false,
            is_number: true,
            factor: DVec3::ONE,
            is_inverted: false,
        })
    }

    /// A 2 × 2 image: 0.25 and 0.5 in the top row, 0.75 and 1 in the bottom row.
    fn images() -> Images {
        let values = [0.25, 0.5, 0.75, 1.0].map(Vec3::splat).to_vec();
        HashMap::from([(("a.png".to_owned(), false, true), Pixels { width: 2, height: 2, values })])
    }

    fn baked(node: &TextureNode) -> (Pixels, Domain, bool) {
        let mut leaves = Vec::new();
        collect_uv_dependent_nodes(node, &mut leaves);
        let (domain, is_exact) = domain_of(&leaves, &images());
        let pixels = bake(node, &images(), &domain, PbrtTextureUse::Number, &CancelToken::new());
        (pixels, domain, is_exact)
    }

    #[test]
    fn powers_of_an_image_keep_its_mapping() {
        let node = TextureNode::Power(Arc::new(image(3.0)), 0.5);
        let (pixels, domain, is_exact) = baked(&node);
        assert_eq!((domain.mapping.scale, domain.size, is_exact), (DVec2::splat(3.0), [2, 2], true));
        let expected = [0.25, 0.5, 0.75, 1.0_f64].map(f64::sqrt);
        for (value, expected) in pixels.values.iter().zip(expected) {
            assert!((f64::from(value.x) - expected).abs() < 1e-6);
        }
    }

    #[test]
    fn products_with_integer_scales_repeat() {
        let node = TextureNode::Product(Arc::new([image(1.0), image(2.0)]));
        let (pixels, domain, is_exact) = baked(&node);
        assert_eq!((domain.mapping, domain.size, is_exact), (UvMapping::IDENTITY, [4, 4], true));
        // The bottom left texel is 0.75 in the fine image, and 0.25 columns from the left border in the
        // coarse one, which interpolates across the border.
        let corner = pixels.get(0, 3).x;
        let coarse = {
            let [top, bottom] = [[0.25, 0.5], [0.75, 1.0]].map(|[a, b]: [f64; 2]| 0.75 * a + 0.25 * b);
            0.25 * top + 0.75 * bottom
        };
        assert!((corner - 0.75 * coarse).abs() < 1e-6, "{corner}");
        let odd = TextureNode::Product(Arc::new([image(1.0), image(1.5)]));
        assert!(!baked(&odd).2);
    }

    #[test]
    fn checkers_of_images_cover_two_cells() {
        let checker = TextureNode::Checker(
            UvMapping { scale: DVec2::ONE, offset: DVec2::ZERO },
            Arc::new([image(1.0), TextureNode::Constant(DVec3::ZERO)]),
        );
        let (pixels, domain, is_exact) = baked(&checker);
        assert!(is_exact && domain.mapping.scale == DVec2::splat(0.5));
        let [width, height] = domain.size;
        // The first texture is in the bottom left cell.
        assert!(pixels.get(1, height - 2).x > 0.0 && pixels.get(width - 2, height - 2).x == 0.0);
        assert!(pixels.get(1, 1).x == 0.0 && pixels.get(width - 2, 1).x > 0.0);
    }
}
