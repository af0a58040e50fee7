use super::super::mapping::UvTransform;
use super::*;
use crate::materials::footprint::{ExtraCoordinates, Footprint, SecondUvPoint, UvSet};
use crate::materials::mipmaps::ImageHalver;
use crate::materials::texels::TexelData;

/// A texture with the values [[0, 1], [2, 3]]. The bottom row comes first.
fn numbered(filter: TextureFilter, wrap: Wrap) -> ImageTexture {
    let data = [2.0, 3.0, 0.0, 1.0].map(Vec3::splat).to_vec();
    let texels = Arc::new(Texels { width: 2, height: 2, data: TexelData::Float(data), unusable: 0 });
    ImageTexture { texels, mipmaps: None, filter, wrap, mapping: TextureMapping::IDENTITY, factor: None }
}

fn bilinear(wrap: Wrap, u: f32, v: f32) -> f32 {
    numbered(TextureFilter::Bilinear, wrap).lookup(&TexturePoint::from_uv(Vec2::new(u, v).as_dvec2())).x
}

#[test]
fn bilinear_lookups_return_expected_values() {
    for (u, v, expected) in [(0.25, 0.25, 0.0), (0.5, 0.5, 1.5), (0.5, 0.25, 0.5), (0.75, 0.75, 3.0)] {
        for wrap in [Wrap::Repeat, Wrap::Clamp, Wrap::Mirror] {
            assert!((bilinear(wrap, u, v) - expected).abs() < 1e-6, "{wrap:?} at {u}, {v}");
        }
    }
    assert!((bilinear(Wrap::Repeat, 0.0, 0.0) - 1.5).abs() < 1e-6);
    assert!((bilinear(Wrap::Clamp, 0.0, 0.0) - 0.0).abs() < 1e-6);
    assert!((bilinear(Wrap::Mirror, 0.0, 0.0) - 0.0).abs() < 1e-6);
}

#[test]
fn coordinates_wrap_outside_the_unit_square() {
    assert!((bilinear(Wrap::Repeat, -0.75, 3.25) - bilinear(Wrap::Repeat, 0.25, 0.25)).abs() < 1e-5);
    assert!((bilinear(Wrap::Mirror, 1.25, 0.25) - bilinear(Wrap::Mirror, 0.75, 0.25)).abs() < 1e-5);
    assert!((bilinear(Wrap::Mirror, -0.25, -0.25) - bilinear(Wrap::Mirror, 0.25, 0.25)).abs() < 1e-5);
    assert!((bilinear(Wrap::Clamp, 9.0, 9.0) - 3.0).abs() < 1e-6);
    let mut repeated = numbered(TextureFilter::Nearest, Wrap::Repeat);
    repeated.mapping.repeat = Vec2::new(2.0, 1.0);
    assert_eq!(repeated.lookup(&TexturePoint::from_uv(DVec2::new(0.6, 0.1))).x, 0.0);
    assert_eq!(repeated.lookup(&TexturePoint::from_uv(DVec2::new(0.4, 0.1))).x, 1.0);
}

#[test]
fn coordinates_repeat_then_rotate_then_translate() {
    let at =
        |texture: &ImageTexture, u: f64, v: f64| texture.lookup(&TexturePoint::from_uv(DVec2::new(u, v))).x;
    let mut texture = numbered(TextureFilter::Nearest, Wrap::Repeat);
    texture.mapping.repeat = Vec2::new(2.0, 1.0);
    texture.mapping.moved = UvTransform::new(UvSet::First, 90.0, DVec2::new(0.0, 0.5)).map(Box::new);
    // (u, v) is mapped to (−v, 2u + ½). For example, (0.1, 0.3) maps to (−0.3, 0.7), which wraps to (0.7,
    // 0.7).
    assert_eq!(at(&texture, 0.1, 0.3), 3.0);
    assert_eq!(at(&texture, 0.1, 0.7), 2.0);
    assert_eq!(at(&texture, 0.3, 0.3), 1.0);
    assert_eq!(texture.texels_per_unit(), [4.0, 2.0]);
}

#[test]
fn second_uv_set_is_used_if_present() {
    let second = SecondUvPoint {
        uv: DVec2::new(0.9, 0.9),
        footprint: Footprint::POINT,
        tangents: [Vec3::Y * 2.0, Vec3::NEG_X],
    };
    let extra = ExtraCoordinates { second: Some(second), object: None };
    let at = TexturePoint { extra: Some(Box::new(extra)), ..TexturePoint::from_uv(DVec2::new(0.1, 0.1)) };
    let mut texture = numbered(TextureFilter::Nearest, Wrap::Repeat);
    let first = [Vec3::X, Vec3::Y];
    assert_eq!((texture.lookup(&at).x, texture.mapping.untransformed_tangents(&at, first)), (0.0, first));
    texture.mapping.moved = UvTransform::new(UvSet::Second, 0.0, DVec2::ZERO).map(Box::new);
    assert_eq!(
        (texture.lookup(&at).x, texture.mapping.untransformed_tangents(&at, first)),
        (3.0, second.tangents)
    );
    assert_eq!(texture.lookup(&at.without_footprint()).x, 3.0);
    let alone = TexturePoint { extra: None, ..at };
    assert_eq!(
        (texture.lookup(&alone).x, texture.mapping.untransformed_tangents(&alone, first)),
        (0.0, first)
    );
    // The second set is repeated, rotated, and translated like the first set.
    texture.mapping.repeat = Vec2::new(1.0, 0.5);
    texture.mapping.moved = UvTransform::new(UvSet::Second, 90.0, DVec2::new(0.5, 0.0)).map(Box::new);
    assert_eq!(texture.lookup(&at).x, 2.0);
}

#[test]
fn factor_scales_values_and_mean_but_not_slopes() {
    let plain = numbered(TextureFilter::Bilinear, Wrap::Repeat);
    let factor = Vec3::new(0.5, 2.0, 3.0);
    let texture = ImageTexture { factor: ValueScaleAndOffset::from_scale(factor), ..plain.clone() };
    let at = TexturePoint::from_uv(DVec2::new(0.3, 0.6));
    assert_eq!(texture.lookup(&at), plain.lookup(&at) * factor);
    assert_eq!((texture.mean(), texture.slopes(&at)), (plain.mean() * factor, plain.slopes(&at)));
    let uv = [[0.3; PACKET_SIZE], [0.6; PACKET_SIZE]];
    let [row, before] = [&texture, &plain].map(|one| lane(&one.lookup_packet(&uv), 3));
    assert_eq!(row, before * factor);
}

#[test]
fn clamped_values_have_a_clamped_mean() {
    let data = TexelData::Float(vec![Vec3::ZERO, Vec3::ONE]);
    let texels = Arc::new(Texels { width: 2, height: 1, data, unusable: 0 });
    let mut texture = numbered(TextureFilter::Nearest, Wrap::Repeat);
    texture.texels = texels;
    for (base, gain, expected) in [(-0.5, 1.0, 0.25), (1.0, -2.0, 0.5), (-2.0, 1.0, 0.0)] {
        texture.factor = ValueScaleAndOffset::from_scale_and_offset(Vec3::splat(gain), Vec3::splat(base));
        assert_eq!(texture.mean(), Vec3::splat(expected), "{base} {gain}");
        let at = TexturePoint::from_uv(DVec2::new(0.1, 0.5));
        assert_eq!(texture.lookup(&at), Vec3::splat(f32::max(base, 0.0)), "{base} {gain}");
    }
    let black = TexelData::Float(vec![Vec3::ZERO; 2]);
    texture.texels = Arc::new(Texels { width: 2, height: 1, data: black, unusable: 0 });
    for (base, is_black) in [(-0.5, true), (0.0, true), (1.0, false)] {
        texture.factor = ValueScaleAndOffset::from_scale_and_offset(Vec3::ONE, Vec3::splat(base));
        assert_eq!(texture.is_black(), is_black, "{base}");
    }
}

#[test]
fn slopes_follow_the_texture_transform() {
    // Near the center, values increase by 1 per texel to the right and by 2 per texel upward. Relative to
    // the image size, the slopes are 2 and 4.
    let mut texture = numbered(TextureFilter::Bilinear, Wrap::Repeat);
    let at =
        |texture: &ImageTexture, u: f64, v: f64| texture.slopes(&TexturePoint::from_uv(DVec2::new(u, v)));
    assert_eq!(at(&texture, 0.5, 0.5), Vec2::new(2.0, 4.0));
    texture.mapping.repeat = Vec2::new(2.0, -3.0);
    assert_eq!(at(&texture, 0.25, -0.5), Vec2::new(4.0, -12.0));
    // (u, v) maps to (−v, 2u), so the slope along u is the vertical slope of the image.
    (texture.mapping.repeat, texture.mapping.moved) =
        (Vec2::new(2.0, 1.0), UvTransform::new(UvSet::First, 90.0, DVec2::new(1.0, 0.0)).map(Box::new));
    assert_eq!(at(&texture, 0.25, 0.5), Vec2::new(8.0, -2.0));
    // Clamped borders and non-finite coordinates have no slope.
    let clamped = numbered(TextureFilter::Bilinear, Wrap::Clamp);
    assert_eq!(at(&clamped, -1.0, 0.5), Vec2::new(0.0, 4.0));
    assert_eq!(at(&clamped, f64::NAN, f64::INFINITY), Vec2::ZERO);
}

#[test]
fn extreme_coordinates_stay_in_range() {
    for filter in [TextureFilter::Nearest, TextureFilter::Bilinear] {
        for wrap in [Wrap::Repeat, Wrap::Clamp, Wrap::Mirror] {
            let texture = numbered(filter, wrap);
            for bad in [f32::NAN, f32::INFINITY, -1e30, 1e30, 1.0, 0.0, -0.0, 1.0_f32.next_down(), -1e-9] {
                assert!(
                    (0.0..=3.0)
                        .contains(&texture.lookup(&TexturePoint::from_uv(Vec2::new(bad, bad).as_dvec2())).x),
                    "{filter:?} {wrap:?} {bad}"
                );
            }
        }
    }
}

#[test]
fn packet_lookups_match_single_lookups() {
    let bytes: Vec<[u8; 3]> = (0..35_u8).map(|i| [i * 7, 255 - i, i.wrapping_mul(41)]).collect();
    let floats = bytes.iter().map(|[r, g, b]| Vec3::new(f32::from(*r), f32::from(*g), f32::from(*b)));
    let images = [
        (7, 5, TexelData::Srgb8(bytes.clone())),
        (5, 7, TexelData::Linear8(bytes.clone())),
        (35, 1, TexelData::Float(floats.collect())),
        (1, 1, TexelData::Srgb8(vec![[200, 100, 50]])),
    ];
    let hostile = [f64::NAN, f64::INFINITY, -1e300, 1e300, 0.0, -0.0, 1.0, 1.0_f64.next_down(), -1e-20, 7.0];
    let number = |i: usize| match i % 3 {
        0 => hostile[i / 3 % hostile.len()],
        _ => (i as f64 * 0.618_033_988).fract() * 6.0 - 3.0,
    };
    for (width, height, data) in images {
        let texels = Arc::new(Texels { width, height, data, unusable: 0 });
        for filter in [TextureFilter::Nearest, TextureFilter::Bilinear] {
            for wrap in [Wrap::Repeat, Wrap::Clamp, Wrap::Mirror] {
                for (repeat, degrees) in
                    [(Vec2::ONE, 0.0), (Vec2::new(2.5, -3.0), 0.0), (Vec2::new(2.0, 3.0), 25.0)]
                {
                    let texels = Arc::clone(&texels);
                    let moved = UvTransform::new(UvSet::First, degrees, DVec2::new(degrees, 0.25))
                        .filter(|_| degrees != 0.0);
                    let mapping = TextureMapping { repeat, moved: moved.map(Box::new) };
                    let texture = ImageTexture { texels, mipmaps: None, filter, wrap, mapping, factor: None };
                    for first in 0..60 {
                        let u = std::array::from_fn(|i| number(first + i));
                        let v = std::array::from_fn(|i| number(first + 5 * i));
                        let row = texture.lookup_packet(&[u, v]);
                        for i in 0..PACKET_SIZE {
                            let alone = texture.lookup(&TexturePoint::from_uv(DVec2::new(u[i], v[i])));
                            assert_eq!(lane(&row, i), alone, "{filter:?} {wrap:?} {} {}", u[i], v[i]);
                        }
                    }
                }
            }
        }
    }
}

/// Creates an image's mip levels.
fn levels(image: &Texels) -> Option<Arc<Mipmaps>> {
    let halved = |level: &Texels| -> Result<Texels, ()> {
        let halving = ImageHalver::new(level);
        let mut rows = halving.allocate_halved_rows();
        (0..halving.halved_height()).for_each(|y| halving.append_halved_row(y, &mut rows));
        Ok(halving.assemble_image(rows))
    };
    Mipmaps::build(image, halved).ok().map(Arc::new)
}

/// Creates a clamped texture from a row of texels.
fn row(width: u32, data: TexelData, filter: TextureFilter) -> ImageTexture {
    let texels = Arc::new(Texels { width, height: 1, data, unusable: 0 });
    let (mipmaps, wrap) = (levels(&texels), Wrap::Clamp);
    ImageTexture { texels, mipmaps, filter, wrap, mapping: TextureMapping::IDENTITY, factor: None }
}

#[test]
fn transparent_texels_do_not_bleed_color() {
    for data in [
        TexelData::SrgbAlpha8(vec![[255, 255, 255, 0], [0, 255, 0, 255]]),
        TexelData::LinearAlpha8(vec![[255, 0, 0, 0], [0, 255, 0, 51]]),
        TexelData::FloatAlpha(vec![Vec4::ZERO, Vec4::new(0.0, 0.5, 0.0, 0.5)]),
    ] {
        for filter in [TextureFilter::Bilinear, TextureFilter::Mipmap] {
            let texture = row(2, data.clone(), filter);
            for u in [0.3, 0.5, 0.7, 0.9] {
                let color = texture.lookup(&TexturePoint::from_uv(DVec2::new(u, 0.5)));
                assert!((color - Vec3::Y).length() < 1e-6, "{data:?} {filter:?} {u}: {color}");
            }
            for level in [0.5, 1.0] {
                let color = texture.trilinear(level, [0.2, 0.5]);
                assert!((color - Vec3::Y).length() < 1e-6, "{data:?} {level}: {color}");
            }
            assert!((texture.mean() - Vec3::Y).length() < 1e-6);
        }
        let texture = ImageTexture { mipmaps: None, ..row(2, data, TextureFilter::Bilinear) };
        let uv = [std::array::from_fn(|i| i as f64 / 15.0), [0.5; PACKET_SIZE]];
        let lanes = texture.lookup_packet(&uv);
        for i in 0..PACKET_SIZE {
            let alone = texture.lookup(&TexturePoint::from_uv(DVec2::new(uv[0][i], 0.5)));
            assert_eq!(lane(&lanes, i), alone, "{i}");
        }
    }
    // Partially transparent texels weight the colors by their alpha.
    let half = TexelData::LinearAlpha8(vec![[255, 0, 0, 51], [0, 255, 0, 204]]);
    let color = row(2, half, TextureFilter::Bilinear).lookup(&TexturePoint::from_uv(DVec2::new(0.5, 0.5)));
    assert!((color - Vec3::new(0.2, 0.8, 0.0)).length() < 1e-6, "{color}");
}

#[test]
fn mip_levels_preserve_cutoff_coverage() {
    // Four of the ten texels are visible, with an alpha just above the cutoff.
    let alphas = [140, 140, 120, 0, 0, 140, 120, 0, 140, 0].map(|alpha| [alpha; 3]);
    let mut texture = row(10, TexelData::Linear8(alphas.to_vec()), TextureFilter::Mipmap);
    texture.mipmaps = levels(&texture.texels.threshold_red_channel(0.5));
    let at = |u: f64, width: f32| {
        let footprint = Footprint::from_ray_cone(width, Vec3::Z, Vec3::Z, [Vec3::X, Vec3::Y]);
        TexturePoint { footprint, ..TexturePoint::from_uv(DVec2::new(u, 0.5)) }
    };
    for u in [0.1, 0.3, 0.9] {
        let coverage = texture.coverage_above_cutoff(&at(u, 1e3), 0.5);
        assert!((coverage - 0.4).abs() < 1e-6, "{coverage}");
    }
    // In the original image, coverage is 0 or 1.
    for (u, expected) in [(0.05, 1.0), (0.25, 0.0), (0.35, 0.0), (0.55, 1.0)] {
        assert_eq!(texture.coverage_above_cutoff(&at(u, 0.0), 0.5), expected, "{u}");
    }
    // Coverage is continuous between the original image and its first mip level.
    let near = [1.0 + 1e-4, 1.0].map(|texels| texture.coverage_above_cutoff(&at(0.05, texels * 0.1), 0.5));
    assert!((near[0] - near[1]).abs() < 1e-2, "{near:?}");
}
