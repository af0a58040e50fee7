//! Reads numbers and textures used as numbers.

use super::super::super::description::{Channel, NumberSource};
use super::super::context::Issue;
use super::super::names::DefinedNames;
use super::KeyInTable;

const NUMBER_OR_TEXTURE: &str = "a number, or { texture = \"name\" }";
const NAME_OR_TEXTURE: &str = "the name of a texture, or { texture = \"name\" }";

impl KeyInTable<'_> {
    /// Reads a number, or a texture with an optional channel.
    pub(in super::super) fn number_or_texture(&self, textures: &DefinedNames) -> Option<NumberSource> {
        if self.is_table() {
            let (texture, channel) = self.inline_table_texture_and_channel(textures)?;
            return Some(NumberSource::Texture { texture, channel });
        }
        let value = self.value?;
        if let Some(text) = value.as_str()
            && textures.find_and_mark_used(text).is_some()
        {
            let issue =
                Issue::error(value.span(), format!("`{}` must be {NUMBER_OR_TEXTURE}", self.info.name))
                    .with_label("found the name of a texture")
                    .with_help(format!("write {{ texture = {} }}", self.context.span_text(&value.span())));
            self.context.report(issue);
            return None;
        }
        self.number_from_value(value, NUMBER_OR_TEXTURE).map(|number| NumberSource::Constant(number as f32))
    }

    /// Reads the name of a texture, or `{ texture = "name", channel = "r" }`.
    pub(in super::super) fn texture_with_optional_channel(
        &self,
        textures: &DefinedNames,
    ) -> Option<(usize, Option<Channel>)> {
        if self.is_table() {
            return self.inline_table_texture_and_channel(textures);
        }
        let name = self.read_string_described_by(|| NAME_OR_TEXTURE.to_owned())?;
        Some((self.resolve_name_or_report(textures, name, self.value_span())?, None))
    }

    /// Reads the texture and the channel in `{ texture = "name", channel = "r" }`.
    fn inline_table_texture_and_channel(&self, textures: &DefinedNames) -> Option<(usize, Option<Channel>)> {
        let table = self.inline_table()?;
        let texture = table.key("texture").index_by_name(textures);
        let key = table.key("channel");
        let channel = if key.is_present() { key.choice().map(Some) } else { Some(None) };
        table.report_unknown_and_missing_keys();
        Some((texture?, channel?))
    }
}
