//! Warnings about statements that are not shown to the letter.

use std::path::Path;

use super::map::{Kind, Map};
use super::material::{is_hidden_by_tr, material};
use super::statements::{Colour, Number};
use super::{At, MtlMaterial};
use crate::assets::FileMaterial;
use crate::math::Vec3;

/// A statement that is not shown to the letter.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::assets::mesh) struct Ignored {
    pub(super) line: usize,
    pub(super) words: String,
}

/// Warnings about a file and some of its materials; equal ones of several materials are one.
pub(in crate::assets::mesh) fn warnings<'a>(
    path: &Path,
    of_file: Vec<Ignored>,
    materials: impl Iterator<Item = &'a MtlMaterial>,
) -> Vec<String> {
    let mut all = of_file;
    let of_file = all.len();
    all.extend(materials.flat_map(of_material));
    let mut warnings: Vec<(Ignored, usize)> = Vec::new();
    for (index, one) in all.into_iter().enumerate() {
        let known = warnings.iter_mut().find(|(known, _)| index >= of_file && known.words == one.words);
        match known {
            Some((_, more)) => *more += 1,
            None => warnings.push((one, 0)),
        }
    }
    let text = |(Ignored { line, words }, more)| {
        let more = if more > 0 { format!(" ({more} more)") } else { String::new() };
        format!("{}:{line}: {words}{more}", path.display())
    };
    warnings.into_iter().map(text).collect()
}

fn of_material(found: &MtlMaterial) -> Vec<Ignored> {
    let own = material(found, Path::new(""));
    let mut ignored = found.ignored.clone();
    let mut add = |line: Option<usize>, words: &str| {
        ignored.push(Ignored { line: line.unwrap_or(found.line), words: words.to_owned() });
    };
    let model = own.illumination_model.unwrap_or(2);
    let line_of_model = found.illumination.map(|at| at.line);
    match model {
        0 => add(line_of_model, "`illum 0`, a color without shading, is shown as a matte surface"),
        10 => add(line_of_model, "`illum 10`, shadows on an invisible surface, is shown as a plain surface"),
        11.. => add(line_of_model, "this `illum` is no model of the format; it counts as 2"),
        1..=9 => {}
    }
    let is_glass = matches!(model, 4 | 6 | 7 | 9) && own.opacity_texture.is_none();
    if is_glass && own.ior <= 1.0 {
        add(line_of_model, "glass without an index of refraction `Ni` above 1 is invisible");
    }
    if is_hidden_by_tr(found) && own.opacity_texture.is_none() && !is_glass {
        let line = found.numbers[Number::Transparency as usize].map(|at| at.line);
        add(line, "`Tr 1` without `d` counts as opaque; write `d 0` for what is not to be seen");
    }
    let has_filter = found.color(Colour::Filter).filter(|at| at.value != [1.0; 3]);
    if let Some(at) = has_filter
        && (is_glass || own.opacity < 1.0 || own.opacity_texture.is_some())
    {
        add(Some(at.line), "`Tf` is ignored; a `material` of the scene may have a `tint`");
    }
    add_reflection(found, &own, model, &mut add);
    add_physical(found, &mut add);
    for (kind, map) in &found.maps {
        add_map(found, (*kind, map), &mut add);
    }
    ignored
}

fn line<T>(at: Option<At<T>>) -> Option<usize> {
    at.map(|at| at.line)
}

/// Reflectances that cannot be shown.
fn add_reflection(
    found: &MtlMaterial,
    own: &FileMaterial,
    model: u8,
    add: &mut impl FnMut(Option<usize>, &str),
) {
    let (diffuse, specular) = (found.color(Colour::Diffuse), found.color(Colour::Specular));
    let is_rough = matches!(model, 0..=2 | 10..) || own.specular == Vec3::ZERO;
    let is_phong = own.physical.is_none() && !matches!(model, 4 | 6 | 7 | 9);
    let has_strength = own.specular != Vec3::ZERO || own.specular_texture.is_some();
    let is_shiny = is_phong && matches!(model, 2 | 10..);
    if is_shiny && has_strength && !own.has_highlight() {
        let line = line(specular).or(found.map(Kind::Specular).map(|map| map.line));
        add(line, "`Ks` without `Ns` above 0 makes no highlight");
    }
    if !is_phong {
        return;
    }
    let kd = if own.diffuse_texture.is_some() { Vec3::ZERO } else { own.diffuse };
    let has_highlight = is_shiny && own.has_highlight() && own.specular_texture.is_none();
    let ks = if has_highlight { own.specular * (2.0 / (own.shininess + 2.0)) } else { Vec3::ZERO };
    if (kd + ks).max_element() > 1.0 + 1e-5 {
        let line = line(diffuse).or(line(specular));
        add(line, "this material reflects more light than falls on it; keep `Kd` and `Ks` at or below 1");
    } else if own.specular.max_element() > 1.0 + 1e-5 && !is_rough {
        add(line(specular), "this mirror reflects more light than falls on it; `Ks` counts as 1");
    }
    let is_mirror = !is_rough && !own.is_coated();
    if is_mirror && (own.diffuse != Vec3::ZERO || own.diffuse_texture.is_some()) {
        add(line(diffuse), "`Kd` below a stronger mirror `Ks` is ignored");
    }
}

/// Numbers of the extension that have no effect.
fn add_physical(found: &MtlMaterial, add: &mut impl FnMut(Option<usize>, &str)) {
    for number in [Number::Sheen, Number::Anisotropy, Number::AnisotropyRotation] {
        let given = found.numbers[number as usize].filter(|at| at.value != 0.0);
        if let Some(at) = given {
            add(Some(at.line), &format!("`{}` is ignored", number.keyword()));
        }
    }
}

/// A map that is not read, or options of it.
fn add_map(found: &MtlMaterial, (kind, map): (Kind, &Map), add: &mut impl FnMut(Option<usize>, &str)) {
    match kind {
        Kind::Other(name) => return add(Some(map.line), &format!("`{name}` is not read")),
        Kind::Ambient => {
            let is_diffuse = found.map(Kind::Diffuse).is_some_and(|diffuse| diffuse.files().eq(map.files()));
            if !is_diffuse {
                add(Some(map.line), "`map_Ka` is not read; ambient light uses the diffuse color");
            }
            return;
        }
        Kind::Diffuse
        | Kind::Specular
        | Kind::Emission
        | Kind::Opacity
        | Kind::Normal
        | Kind::Bump
        | Kind::Roughness
        | Kind::Metallic => {}
    }
    for option in map.ignored(kind) {
        add(Some(map.line), &format!("the option `{option}` is ignored"));
    }
}
