//! Scenes of mesh files without a scene of their own: OBJ, OFF, PLY, STL.

use std::path::Path;

use super::frame::framed;
use super::toml::Toml;
use super::{FOV, ModelText, SIZE, Show, Unique, camera, file_name, ground, light, render};
use crate::assets::AssetError;
use crate::control::{CancelToken, unwatched};
use crate::math::DVec3;
use crate::pipeline::settings::Side;
use crate::pipeline::stages::containers::Containers;
use crate::scene::quoted;

/// Whether a format counts z upwards, as programs for construction and printing do.
fn is_z_up(path: &Path) -> bool {
    path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("stl"))
}

/// The scene of a mesh file.
pub(super) fn text(
    path: &Path,
    show: Show,
    containers: &Containers,
    token: &CancelToken,
) -> Result<ModelText, AssetError> {
    let loaded = containers.mesh((path, None), &unwatched, token)?;
    let Some([least, greatest]) = loaded.mesh.bounds() else {
        return Err(AssetError::Malformed {
            path: path.to_owned(),
            line: None,
            reason: "no usable face".to_owned(),
        });
    };
    // The rotation that makes z point upwards takes (x, y, z) to (x, z, −y).
    let upright = |at: DVec3| if is_z_up(path) { DVec3::new(at.x, at.z, -at.y) } else { at };
    let (a, b) = (upright(least), upright(greatest));
    let bounds = [a.min(b), a.max(b)];
    let points: Vec<DVec3> = loaded.mesh.extremes().into_iter().map(upright).collect();
    let eye = framed(
        bounds,
        &points,
        (show.from.unwrap_or(Side::Iso), show.turns),
        show.aspect.unwrap_or(SIZE[0] / SIZE[1]),
    );
    let (mut toml, mut names) = (Toml::default(), Unique::default());
    toml.comment(&format!("{}, as glimt shows it.", file_name(path)));
    render(&mut toml, None);
    camera(&mut toml, &eye, FOV);
    light(&mut toml, &eye, false);
    let is_colored = !loaded.mesh.colors.is_empty();
    let needs_material = loaded.lacks_materials();
    let name = names.name("model", "model");
    if needs_material {
        toml.table(&format!("[materials.{name}]"));
        toml.key("type", "\"principled\"");
        toml.key("color", if is_colored { "1" } else { "[0.7, 0.68, 0.64]" });
    }
    toml.table("[[mesh]]");
    toml.key("file", quoted(&file_name(path)));
    if is_z_up(path) {
        toml.key("rotate", "[-90, 0, 0]");
        // Facets have no normals, and edges of parts are sharp.
        toml.key("smooth", "false");
    }
    if needs_material {
        toml.key("material", format!("\"{name}\""));
    }
    if is_colored {
        toml.key("vertex_colors", "true");
    }
    ground(&mut toml, &mut names, bounds, &eye);
    let (companions, notes, assets) = (loaded.companions.clone(), Vec::new(), Vec::new());
    containers.keep(path, loaded);
    Ok(ModelText { text: toml.finish(), companions, notes, assets })
}
