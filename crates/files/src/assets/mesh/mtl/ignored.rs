//! Warnings about MTL statements that are ignored or approximated.

use std::collections::HashMap;
use std::path::Path;

use super::map::{MapKind, MtlMap};
use super::material::{is_opaque_despite_tr, to_file_material};
use super::statements::{MtlColorParameter, MtlScalarParameter};
use super::{MtlMaterial, WithLine};
use crate::assets::{FileMaterial, FileMaterialKind, PhysicalMaterial};
use crate::math::Vec3;

/// An MTL statement that is ignored or approximated.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::assets::mesh) struct MtlWarning {
    pub(super) line: usize,
    pub(super) words: String,
}

/// Collects warnings about a file and the materials in use, merging warnings that several materials share.
pub(in crate::assets::mesh) fn collect_warnings<'a>(
    path: &Path,
    of_file: Vec<MtlWarning>,
    materials: impl Iterator<Item = &'a MtlMaterial>,
) -> Vec<String> {
    let mut warnings: Vec<(MtlWarning, usize)> = Vec::new();
    let mut known: HashMap<String, usize> = HashMap::new();
    for ignored in of_file {
        known.entry(ignored.words.clone()).or_insert(warnings.len());
        warnings.push((ignored, 0));
    }
    for ignored in materials.flat_map(material_warnings) {
        match known.get(&ignored.words) {
            Some(index) => warnings[*index].1 += 1,
            None => {
                known.insert(ignored.words.clone(), warnings.len());
                warnings.push((ignored, 0));
            }
        }
    }
    let text = |(MtlWarning { line, words }, more)| {
        let more = if more > 0 { format!(" ({more} more)") } else { String::new() };
        format!("{}:{line}: {words}{more}", path.display())
    };
    warnings.into_iter().map(text).collect()
}

fn material_warnings(found: &MtlMaterial) -> Vec<MtlWarning> {
    let converted = to_file_material(found, Path::new(""));
    let mut ignored = found.ignored.clone();
    let mut add = |line: Option<usize>, words: &str| {
        ignored.push(MtlWarning { line: line.unwrap_or(found.line), words: words.to_owned() });
    };
    warn_about_approximations(found, &converted, &mut add);
    warn_about_opacity(found, &converted, &mut add);
    warn_about_altered_reflectance(found, &converted, &mut add);
    warn_about_ineffective_pbr(found, &converted, &mut add);
    for (kind, map) in &found.maps {
        warn_about_map(found, &converted, *kind, map, &mut add);
    }
    ignored
}

pub(super) const UNSHADED: &str = "`illum 0` (unshaded color) is rendered as a matte surface";
pub(super) const SHADOW_CATCHER: &str = "`illum 10` (shadow catcher) is rendered as an ordinary surface";
pub(super) const UNKNOWN_MODEL: &str = "unknown illumination model; `illum 2` is used";
pub(super) const INVISIBLE_GLASS: &str = "glass is invisible unless `Ni` (index of refraction) is above 1";
pub(super) const IOR_CLAMPED: &str = "`Ni` is clamped to 10";
const OPAQUE_TR: &str = "`Tr 1` without `d` is rendered as opaque; use `d 0` for an invisible surface";
const TR_IGNORED: &str = "`Tr` is ignored because `d` takes precedence";
const OPACITY_MAP: &str = "the opacity map replaces `d`";
pub(super) const FILTER_IGNORED: &str = "`Tf` is ignored; use `tint` in a material of the scene";
pub(super) const BLACK_EMISSION: &str = "`map_Ke` has no effect because `Ke` is 0";
const NO_HIGHLIGHT: &str = "`Ks` has no effect unless `Ns` is above 0";
pub(super) const GAINS_ENERGY: &str =
    "the material reflects more light than it receives; keep `Kd` and `Ks` at or below 1";
const BRIGHT_DIFFUSE: &str = "`Kd` is clamped to 1";
const BRIGHT_COAT: &str = "`Ks` is clamped to 0.66 for a mirror over a diffuse color";
pub(super) const BRIGHT_MIRROR: &str = "`Ks` is clamped to 1 for a mirror";
pub(super) const DIFFUSE_UNDER_MIRROR: &str =
    "`Kd` is ignored because the mirror reflection `Ks` is stronger";
const LOW_IOR: &str = "`Ni` is ignored because it is not above 1; 1.5 is used";
pub(super) const ANISOTROPY_OF_METALS: &str = "`aniso` has no effect unless `Pm` is 1";
const SECOND_NORMAL_MAP: &str = "`bump` has no effect because the material has a normal map";
pub(super) const AMBIENT_MAP: &str = "`map_Ka` is not supported; ambient light uses the diffuse color";

pub(super) fn ignored_statement_warning(keyword: &str) -> String {
    format!("`{keyword}` is ignored")
}

pub(super) fn unsupported_map_warning(keyword: &str) -> String {
    format!("`{keyword}` is not supported")
}

fn no_effect_on_material_warning(keyword: &str, kind: FileMaterialKind<'_>) -> String {
    let kind = match kind {
        FileMaterialKind::Phong => "Phong materials",
        FileMaterialKind::Principled(_) => "materials with PBR statements",
        FileMaterialKind::Coated | FileMaterialKind::Mirror => "mirrors",
        FileMaterialKind::Glass => "glass",
    };
    format!("`{keyword}` has no effect on {kind}")
}

fn line_of_value<T>(at: Option<WithLine<T>>) -> Option<usize> {
    at.map(|at| at.line)
}

/// Whether a number is above 1 by more than rounding errors.
fn is_above_one_with_tolerance(number: f32) -> bool {
    number > 1.0 + 1e-5
}

/// Warns about illumination models and indices of refraction that are approximated.
fn warn_about_approximations(
    found: &MtlMaterial,
    converted: &FileMaterial,
    add: &mut impl FnMut(Option<usize>, &str),
) {
    let model = line_of_value(found.illumination);
    match converted.illumination_model.unwrap_or(2) {
        0 => add(model, UNSHADED),
        10 => add(model, SHADOW_CATCHER),
        11.. => add(model, UNKNOWN_MODEL),
        1..=9 => {}
    }
    let ior = found.number_with_line(MtlScalarParameter::Ior);
    match converted.kind() {
        FileMaterialKind::Glass if converted.ior <= 1.0 => add(model, INVISIBLE_GLASS),
        FileMaterialKind::Glass | FileMaterialKind::Principled(_)
            if converted.ior > FileMaterial::MAX_IOR =>
        {
            add(line_of_value(ior), IOR_CLAMPED);
        }
        FileMaterialKind::Principled(_) if ior.is_some() && converted.ior <= 1.0 => {
            add(line_of_value(ior), LOW_IOR);
        }
        FileMaterialKind::Principled(_)
        | FileMaterialKind::Phong
        | FileMaterialKind::Coated
        | FileMaterialKind::Mirror
        | FileMaterialKind::Glass => {}
    }
    if converted.emission != Vec3::ZERO && !converted.emits() {
        let emission = found.color(MtlColorParameter::Emission);
        if emission.is_some() {
            add(line_of_value(emission), &no_effect_on_material_warning("Ke", converted.kind()));
        }
    }
}

/// Warns about ignored opacities and transmission filters. Glass has no opacity.
fn warn_about_opacity(
    found: &MtlMaterial,
    converted: &FileMaterial,
    add: &mut impl FnMut(Option<usize>, &str),
) {
    if let Some(at) = found.color(MtlColorParameter::Filter).filter(|at| at.value != [1.0; 3]) {
        add(Some(at.line), FILTER_IGNORED);
    }
    if converted.is_glass() {
        return;
    }
    let [opacity, transparency] =
        [MtlScalarParameter::Dissolve, MtlScalarParameter::Transparency].map(|of| found.number_with_line(of));
    if converted.opacity_texture.is_some() {
        let given = opacity.or(transparency).filter(|_| converted.opacity < 1.0);
        given.iter().for_each(|at| add(Some(at.line), OPACITY_MAP));
    } else if is_opaque_despite_tr(found) {
        add(line_of_value(transparency), OPAQUE_TR);
    }
    if let (Some(opacity), Some(transparency)) = (opacity, transparency) {
        // Some programs write the opacity as `Tr`.
        let is_same = |other: f64| (opacity.value - other).abs() < 1e-3;
        if !is_same(transparency.value) && !is_same(1.0 - transparency.value) {
            add(Some(transparency.line), TR_IGNORED);
        }
    }
}

/// Warns about reflectances that cannot be rendered as specified.
fn warn_about_altered_reflectance(
    found: &MtlMaterial,
    converted: &FileMaterial,
    add: &mut impl FnMut(Option<usize>, &str),
) {
    let (diffuse, specular) =
        (found.color(MtlColorParameter::Diffuse), found.color(MtlColorParameter::Specular));
    let kd = match converted.diffuse_texture {
        Some(_) => 0.0,
        None => converted.diffuse.max_element(),
    };
    let ks = converted.specular.max_element();
    match converted.kind() {
        FileMaterialKind::Phong => warn_about_highlight_and_energy_gain(found, converted, add),
        FileMaterialKind::Principled(_) | FileMaterialKind::Coated if is_above_one_with_tolerance(kd) => {
            add(line_of_value(diffuse), BRIGHT_DIFFUSE);
        }
        FileMaterialKind::Coated if ks > FileMaterial::MAX_COAT => add(line_of_value(specular), BRIGHT_COAT),
        FileMaterialKind::Mirror if is_above_one_with_tolerance(ks) => {
            add(line_of_value(specular), BRIGHT_MIRROR);
        }
        FileMaterialKind::Mirror if kd > 0.0 => add(line_of_value(diffuse), DIFFUSE_UNDER_MIRROR),
        FileMaterialKind::Principled(_)
        | FileMaterialKind::Coated
        | FileMaterialKind::Mirror
        | FileMaterialKind::Glass => {}
    }
}

/// Warns about missing highlights and about surfaces that reflect more light than they receive.
fn warn_about_highlight_and_energy_gain(
    found: &MtlMaterial,
    converted: &FileMaterial,
    add: &mut impl FnMut(Option<usize>, &str),
) {
    let (diffuse, specular) =
        (found.color(MtlColorParameter::Diffuse), found.color(MtlColorParameter::Specular));
    let specular_map = found.map(MapKind::Specular);
    let is_matte = matches!(converted.illumination_model, Some(0 | 1));
    let has_strength = converted.specular != Vec3::ZERO || specular_map.is_some();
    if !is_matte && has_strength && !converted.allows_specular_highlight() {
        add(line_of_value(specular).or(specular_map.map(|map| map.line)), NO_HIGHLIGHT);
    }
    let kd = if converted.diffuse_texture.is_some() { Vec3::ZERO } else { converted.diffuse };
    let has_constant_highlight =
        converted.allows_specular_highlight() && converted.specular_texture.is_none();
    let ks = match has_constant_highlight {
        true => converted.specular * (2.0 / (converted.shininess + 2.0)),
        false => Vec3::ZERO,
    };
    if is_above_one_with_tolerance((kd + ks).max_element()) {
        add(line_of_value(diffuse).or(line_of_value(specular)), GAINS_ENERGY);
    }
}

/// Warns about parameters of the PBR extension that have no effect.
fn warn_about_ineffective_pbr(
    found: &MtlMaterial,
    converted: &FileMaterial,
    add: &mut impl FnMut(Option<usize>, &str),
) {
    let nonzero = |number: MtlScalarParameter| found.number_with_line(number).filter(|at| at.value != 0.0);
    for number in [MtlScalarParameter::Sheen, MtlScalarParameter::AnisotropyRotation] {
        if let Some(at) = nonzero(number) {
            add(Some(at.line), &ignored_statement_warning(number.keyword()));
        }
    }
    let is_metal = converted.physical.as_ref().is_some_and(PhysicalMaterial::is_metal);
    if let Some(at) = nonzero(MtlScalarParameter::Anisotropy).filter(|_| !is_metal || converted.is_glass()) {
        add(Some(at.line), ANISOTROPY_OF_METALS);
    }
    for number in [MtlScalarParameter::Metallic, MtlScalarParameter::Coat] {
        if let Some(at) = nonzero(number).filter(|_| converted.is_glass()) {
            add(Some(at.line), &no_effect_on_material_warning(number.keyword(), converted.kind()));
        }
    }
}

/// Warns about maps and options that are unsupported or have no effect.
fn warn_about_map(
    found: &MtlMaterial,
    converted: &FileMaterial,
    kind: MapKind,
    map: &MtlMap,
    add: &mut impl FnMut(Option<usize>, &str),
) {
    let line = Some(map.line);
    let physical = converted.physical.as_ref();
    let texture = match kind {
        MapKind::Other(name) => return add(line, &unsupported_map_warning(name)),
        MapKind::Ambient => {
            let is_diffuse = found
                .map(MapKind::Diffuse)
                .is_some_and(|diffuse| diffuse.candidate_paths().eq(map.candidate_paths()));
            if !is_diffuse {
                add(line, AMBIENT_MAP);
            }
            return;
        }
        MapKind::Bump if found.map(MapKind::Normal).is_some() => return add(line, SECOND_NORMAL_MAP),
        MapKind::Diffuse => converted.diffuse_texture.as_ref(),
        MapKind::Specular => converted.specular_texture.as_ref(),
        MapKind::Emission => {
            if converted.emission == Vec3::ZERO {
                return add(line, BLACK_EMISSION);
            }
            converted.emission_texture.as_ref()
        }
        MapKind::Opacity => converted.opacity_texture.as_ref(),
        MapKind::Normal | MapKind::Bump => converted.normal_texture.as_ref(),
        MapKind::Roughness => physical.and_then(|own| own.roughness_texture.as_ref()),
        MapKind::Metallic => physical.and_then(|own| own.metallic_texture.as_ref()),
        MapKind::Coat => physical.and_then(|own| own.clearcoat_texture.as_ref()),
        MapKind::CoatRoughness => physical.and_then(|own| own.clearcoat_roughness_texture.as_ref()),
    };
    if texture.is_none() {
        match converted.kind() {
            // Only specular maps can be unused here, and the warning about a missing highlight covers them.
            FileMaterialKind::Phong => {}
            FileMaterialKind::Principled(_)
            | FileMaterialKind::Coated
            | FileMaterialKind::Mirror
            | FileMaterialKind::Glass => {
                add(line, &no_effect_on_material_warning(kind.keyword(), converted.kind()));
            }
        }
        return;
    }
    for words in map.option_warnings(kind) {
        add(line, &words);
    }
}
