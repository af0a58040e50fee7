//! The `[render]` table.

use std::path::PathBuf;
use std::sync::LazyLock;

use super::super::description::{RenderOptions, render_keys};
use super::super::keys::endings::IMAGES;
use super::super::keys::key::DefaultValue::By;
use super::super::keys::key::ValueKind::File;
use super::super::keys::key::{KeyInfo, TableInfo, TableSyntax, keys};
use super::context::Issue;
use super::key::KeyInTable;
use super::table::TableReader;

pub(crate) static RENDER: LazyLock<TableInfo> = LazyLock::new(|| {
    const OUTPUT: &[KeyInfo] = keys! {
        /// The image file; the extension determines the format.
        output: File(IMAGES), By("the scene's name with `.png`");
    };
    // The table is created once and never freed.
    let keys = [RenderOptions::key_definitions(), OUTPUT.to_vec()].concat().leak();
    TableInfo::new("render", TableSyntax::Single, "Image and render settings", keys)
});

const MAX_PIXELS: u64 = 1 << 30;

macro_rules! read {
    (whole) => {
        KeyInTable::integer
    };
    (at_least) => {
        KeyInTable::number_f32
    };
    (between) => {
        KeyInTable::number_f32
    };
    (choice) => {
        KeyInTable::choice
    };
    (color) => {
        KeyInTable::color
    };
}

macro_rules! reader {
    ($(
        $(#[doc = $doc:literal])* $name:ident: $type:ty = $default:expr, $range:ident $(($($limit:expr),*))?, $unit:literal, $change:ident;
    )*) => {
        fn read_render_options(table: &TableReader<'_>) -> RenderOptions {
            RenderOptions {
                $($name: table.key(stringify!($name)).read_or_default(read!($range)),)*
            }
        }
    };
}

render_keys!(reader);

/// Reads the settings and the optional output path.
pub(super) fn read_render_table(root: &TableReader<'_>) -> (Option<RenderOptions>, Option<PathBuf>) {
    let Some(table) = root.table_or_empty(&RENDER) else { return (None, None) };
    let render = read_render_options(&table);
    let output = read_output_path(&table);
    check_image_size(&table, &render);
    table.report_unknown_and_missing_keys();
    (Some(render), output)
}

fn read_output_path(table: &TableReader<'_>) -> Option<PathBuf> {
    let key = table.key("output");
    let text = key.string("an image path, such as \"image.png\"")?;
    key.check_extension(text, key.allowed_file_extensions()).then(|| table.context.resolve_path(text))
}

fn check_image_size(table: &TableReader<'_>, render: &RenderOptions) {
    let RenderOptions { width, height, .. } = *render;
    let spans = || table.key("width").value_span().or(table.key("height").value_span());
    if u64::from(width) * u64::from(height) > MAX_PIXELS {
        let issue =
            Issue::error(spans().unwrap_or_default(), format!("{width} × {height} pixels are too many"))
                .with_help(format!("the limit is {MAX_PIXELS} pixels"));
        table.context.report(issue);
    }
}
