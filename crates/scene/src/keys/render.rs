//! Definitions of the `[render]` keys, generated from `render_keys!`.

use std::sync::LazyLock;

use super::endings::IMAGES;
use super::key::{DefaultValue, KeyInfo, TableInfo, TableSyntax, ValueKind, define_key};
use super::limits::Limits;
use crate::description::{KeyRange, RenderKeySpec, RenderOptions};
use crate::math::limits::LARGEST;

/// Definitions of the `[render]` keys, created on first use.
static KEYS: LazyLock<Vec<KeyInfo>> = LazyLock::new(|| {
    let output = define_key(
        "output",
        ValueKind::File(IMAGES),
        "",
        DefaultValue::By("the scene's name with `.png`"),
        "The image file; the extension determines the format",
    );
    RenderOptions::key_specs().into_iter().map(render_key_info).chain([output]).collect()
});

/// Returns the definition of the `[render]` table.
pub(super) fn render_table() -> TableInfo {
    TableInfo {
        name: "render",
        form: TableSyntax::Single,
        doc: "Image and render settings",
        keys: &KEYS,
        types: &[],
    }
}

fn render_key_info(key: RenderKeySpec) -> KeyInfo {
    let RenderKeySpec { name, doc, unit, range, choice_values, default, has_option: _ } = key;
    let kind = match range {
        KeyRange::Whole(range) => ValueKind::Whole((*range.start()).into(), (*range.end()).into()),
        KeyRange::Number(range) if *range.end() >= LARGEST => {
            ValueKind::Number(Limits::AtLeast(*range.start()))
        }
        KeyRange::Number(range) => ValueKind::Number(Limits::Between(*range.start(), *range.end())),
        KeyRange::Names(_) => ValueKind::Words(choice_values),
        KeyRange::Color => ValueKind::Color(Limits::AtLeast(0.0)),
    };
    // Leaking is fine: the list is created once.
    KeyInfo { name, kind, unit, default: DefaultValue::Is(default.leak()), doc }
}
