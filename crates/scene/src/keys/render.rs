//! `[render]`, from the definition of its settings.

use std::sync::LazyLock;

use super::endings::IMAGES;
use super::key::{Default, Form, KeyInfo, Kind, TableInfo, key};
use super::limits::Limits;
use crate::description::{KeyRange, Render, RenderKey};
use crate::math::limits::LARGEST;

/// The keys, made once.
static KEYS: LazyLock<Vec<KeyInfo>> = LazyLock::new(|| {
    let output = key(
        "output",
        Kind::File(IMAGES),
        "",
        Default::By("the scene's name with `.png`"),
        "The image; the ending chooses the format",
    );
    Render::keys().into_iter().map(info).chain([output]).collect()
});

/// The table.
pub(super) fn table() -> TableInfo {
    TableInfo { name: "render", form: Form::Single, doc: "The picture", keys: &KEYS, types: &[] }
}

fn info(key: RenderKey) -> KeyInfo {
    let RenderKey { name, doc, unit, range, words, default, has_option: _ } = key;
    let kind = match range {
        KeyRange::Whole(range) => Kind::Whole((*range.start()).into(), (*range.end()).into()),
        KeyRange::Number(range) if *range.end() >= LARGEST => Kind::Number(Limits::AtLeast(*range.start())),
        KeyRange::Number(range) => Kind::Number(Limits::Between(*range.start(), *range.end())),
        KeyRange::Names(_) => Kind::Words(words),
        KeyRange::Color => Kind::Color(Limits::AtLeast(0.0)),
    };
    // The list of keys lives as long as the program.
    KeyInfo { name, kind, unit, default: Default::Is(default.leak()), doc }
}
