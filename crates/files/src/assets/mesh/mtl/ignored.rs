//! Warnings about MTL statements that are ignored or approximated.

use std::path::Path;

use super::map::{Map, MapKind};
use super::material::{is_opaque_despite_tr, material};
use super::statements::{MtlColor, MtlNumber};
use super::{MtlMaterial, WithLine};
use crate::assets::FileMaterial;
use crate::math::Vec3;

/// A statement that is ignored or approximated.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::assets::mesh) struct IgnoredStatement {
    pub(super) line: usize,
    pub(super) words: String,
}

/// Collects warnings about a file and its used materials. Warnings shared by several materials are merged.
pub(in crate::assets::mesh) fn warnings<'a>(
    path: &Path,
    of_file: Vec<IgnoredStatement>,
    materials: impl Iterator<Item = &'a MtlMaterial>,
) -> Vec<String> {
    let mut all = of_file;
    let of_file = all.len();
    all.extend(materials.flat_map(material_warnings));
    let mut warnings: Vec<(IgnoredStatement, usize)> = Vec::new();
    for (index, ignored) in all.into_iter().enumerate() {
        let known = warnings.iter_mut().find(|(known, _)| index >= of_file && known.words == ignored.words);
        match known {
            Some((_, more)) => *more += 1,
            None => warnings.push((ignored, 0)),
        }
    }
    let text = |(IgnoredStatement { line, words }, more)| {
        let more = if more > 0 { format!(" ({more} more)") } else { String::new() };
        format!("{}:{line}: {words}{more}", path.display())
    };
    warnings.into_iter().map(text).collect()
}

fn material_warnings(found: &MtlMaterial) -> Vec<IgnoredStatement> {
    let converted = material(found, Path::new(""));
    let mut ignored = found.ignored.clone();
    let mut add = |line: Option<usize>, words: &str| {
        ignored.push(IgnoredStatement { line: line.unwrap_or(found.line), words: words.to_owned() });
    };
    let model = converted.illumination_model.unwrap_or(2);
    let line_of_model = found.illumination.map(|at| at.line);
    match model {
        0 => add(line_of_model, UNSHADED),
        10 => add(line_of_model, SHADOW_CATCHER),
        11.. => add(line_of_model, UNKNOWN_MODEL),
        1..=9 => {}
    }
    let is_glass = matches!(model, 4 | 6 | 7 | 9) && converted.opacity_texture.is_none();
    if is_glass && converted.ior <= 1.0 {
        add(line_of_model, INVISIBLE_GLASS);
    }
    if is_opaque_despite_tr(found) && converted.opacity_texture.is_none() && !is_glass {
        let line = found.numbers[MtlNumber::Transparency as usize].map(|at| at.line);
        add(line, OPAQUE_TR);
    }
    let has_filter = found.color(MtlColor::Filter).filter(|at| at.value != [1.0; 3]);
    if let Some(at) = has_filter
        && (is_glass || converted.opacity < 1.0 || converted.opacity_texture.is_some())
    {
        add(Some(at.line), FILTER_IGNORED);
    }
    warn_about_reflectance(found, &converted, model, &mut add);
    warn_about_pbr(found, &mut add);
    for (kind, map) in &found.maps {
        warn_about_map(found, (*kind, map), &mut add);
    }
    ignored
}

pub(super) const UNSHADED: &str = "`illum 0` (unshaded color) is rendered as a matte surface";
pub(super) const SHADOW_CATCHER: &str = "`illum 10` (shadow catcher) is rendered as an ordinary surface";
pub(super) const UNKNOWN_MODEL: &str = "unknown illumination model; `illum 2` is used";
pub(super) const INVISIBLE_GLASS: &str = "glass without an index of refraction `Ni` above 1 is invisible";
const OPAQUE_TR: &str = "`Tr 1` without `d` is rendered as opaque; use `d 0` for an invisible surface";
pub(super) const FILTER_IGNORED: &str = "`Tf` is ignored; use `tint` in a material of the scene";
const NO_HIGHLIGHT: &str = "`Ks` has no effect without `Ns` above 0";
pub(super) const GAINS_ENERGY: &str =
    "the material reflects more light than it receives; keep `Kd` and `Ks` at or below 1";
pub(super) const BRIGHT_MIRROR: &str = "`Ks` of a mirror is clamped to 1";
pub(super) const DIFFUSE_UNDER_MIRROR: &str =
    "`Kd` is ignored because the mirror reflection `Ks` is stronger";
pub(super) const AMBIENT_MAP: &str = "`map_Ka` is not supported; ambient light uses the diffuse color";

pub(super) fn statement_ignored(keyword: &str) -> String {
    format!("`{keyword}` is ignored")
}

pub(super) fn map_unsupported(keyword: &str) -> String {
    format!("`{keyword}` is not supported")
}

pub(super) fn option_ignored(option: &str) -> String {
    format!("option `{option}` is ignored")
}

fn line<T>(at: Option<WithLine<T>>) -> Option<usize> {
    at.map(|at| at.line)
}

/// Warns about reflectances that cannot be rendered as specified.
fn warn_about_reflectance(
    found: &MtlMaterial,
    converted: &FileMaterial,
    model: u8,
    add: &mut impl FnMut(Option<usize>, &str),
) {
    let (diffuse, specular) = (found.color(MtlColor::Diffuse), found.color(MtlColor::Specular));
    let is_rough = matches!(model, 0..=2 | 10..) || converted.specular == Vec3::ZERO;
    let is_phong = converted.physical.is_none() && !matches!(model, 4 | 6 | 7 | 9);
    let has_strength = converted.specular != Vec3::ZERO || converted.specular_texture.is_some();
    let is_shiny = is_phong && matches!(model, 2 | 10..);
    if is_shiny && has_strength && !converted.has_highlight() {
        let line = line(specular).or(found.map(MapKind::Specular).map(|map| map.line));
        add(line, NO_HIGHLIGHT);
    }
    if !is_phong {
        return;
    }
    let kd = if converted.diffuse_texture.is_some() { Vec3::ZERO } else { converted.diffuse };
    let has_highlight = is_shiny && converted.has_highlight() && converted.specular_texture.is_none();
    let ks =
        if has_highlight { converted.specular * (2.0 / (converted.shininess + 2.0)) } else { Vec3::ZERO };
    if (kd + ks).max_element() > 1.0 + 1e-5 {
        let line = line(diffuse).or(line(specular));
        add(line, GAINS_ENERGY);
    } else if converted.specular.max_element() > 1.0 + 1e-5 && !is_rough {
        add(line(specular), BRIGHT_MIRROR);
    }
    let is_mirror = !is_rough && !converted.is_coated();
    if is_mirror && (converted.diffuse != Vec3::ZERO || converted.diffuse_texture.is_some()) {
        add(line(diffuse), DIFFUSE_UNDER_MIRROR);
    }
}

/// Warns about parameters of the PBR extension that have no effect.
fn warn_about_pbr(found: &MtlMaterial, add: &mut impl FnMut(Option<usize>, &str)) {
    for number in [MtlNumber::Sheen, MtlNumber::Anisotropy, MtlNumber::AnisotropyRotation] {
        let given = found.numbers[number as usize].filter(|at| at.value != 0.0);
        if let Some(at) = given {
            add(Some(at.line), &statement_ignored(number.keyword()));
        }
    }
}

/// Warns about an unsupported map or unsupported options of a map.
fn warn_about_map(
    found: &MtlMaterial,
    (kind, map): (MapKind, &Map),
    add: &mut impl FnMut(Option<usize>, &str),
) {
    match kind {
        MapKind::Other(name) => return add(Some(map.line), &map_unsupported(name)),
        MapKind::Ambient => {
            let is_diffuse = found
                .map(MapKind::Diffuse)
                .is_some_and(|diffuse| diffuse.candidate_paths().eq(map.candidate_paths()));
            if !is_diffuse {
                add(Some(map.line), AMBIENT_MAP);
            }
            return;
        }
        MapKind::Diffuse
        | MapKind::Specular
        | MapKind::Emission
        | MapKind::Opacity
        | MapKind::Normal
        | MapKind::Bump
        | MapKind::Roughness
        | MapKind::Metallic => {}
    }
    for option in map.ignored_options(kind) {
        add(Some(map.line), &option_ignored(&option));
    }
}
