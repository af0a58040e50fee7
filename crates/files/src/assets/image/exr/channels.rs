//! Selects the color channels in an EXR file.

use std::collections::BTreeMap;

use ::exr::meta::header::Header;

/// A channel, identified by a part index and a channel index within the part.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PartAndChannelIndex {
    pub(super) part: usize,
    pub(super) channel: usize,
}

/// Channels to decode.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ChosenChannels {
    pub(super) color: ColorChannels,
    pub(super) alpha: Option<PartAndChannelIndex>,
}

/// Channels that make up a color.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum ColorChannels {
    Rgb([PartAndChannelIndex; 3]),
    Gray(PartAndChannelIndex),
    /// Y, and the differences RY = (R − Y)/Y and BY = (B − Y)/Y.
    LuminanceChroma(PartAndChannelIndex, [PartAndChannelIndex; 2]),
}

impl ChosenChannels {
    /// Source channel for each pixel component: red, green, blue, alpha. Chroma channels are not included.
    pub(super) fn component_channels(self) -> [Option<PartAndChannelIndex>; 4] {
        match self.color {
            ColorChannels::Rgb([red, green, blue]) => [Some(red), Some(green), Some(blue), self.alpha],
            ColorChannels::Gray(y) | ColorChannels::LuminanceChroma(y, _) => {
                [Some(y), Some(y), Some(y), self.alpha]
            }
        }
    }

    /// Returns the Y, RY and BY channels if the image is stored as luminance and chroma.
    pub(super) fn as_luminance_chroma(self) -> Option<[PartAndChannelIndex; 3]> {
        match self.color {
            ColorChannels::Rgb(_) | ColorChannels::Gray(_) => None,
            ColorChannels::LuminanceChroma(y, [ry, by]) => Some([y, ry, by]),
        }
    }

    /// All channels to decode, including chroma.
    pub(super) fn all(self) -> impl Iterator<Item = PartAndChannelIndex> {
        self.component_channels()
            .into_iter()
            .flatten()
            .chain(self.as_luminance_chroma().into_iter().flatten())
    }
}

/// A layer's channels with known names, ignoring case.
#[derive(Clone, Copy, Default)]
struct LayerChannels {
    rgb: [Option<PartAndChannelIndex>; 3],
    luminance: Option<PartAndChannelIndex>,
    chroma: [Option<PartAndChannelIndex>; 2],
    alpha: Option<PartAndChannelIndex>,
    /// Whether the layer has an X channel, which means that Y is a coordinate rather than luminance.
    has_x: bool,
}

impl LayerChannels {
    fn add(&mut self, name: &str, channel: PartAndChannelIndex) {
        let slot = match name.to_ascii_uppercase().as_str() {
            "R" => &mut self.rgb[0],
            "G" => &mut self.rgb[1],
            "B" => &mut self.rgb[2],
            "A" => &mut self.alpha,
            "Y" => &mut self.luminance,
            "RY" => &mut self.chroma[0],
            "BY" => &mut self.chroma[1],
            "X" => {
                self.has_x = true;
                return;
            }
            _ => return,
        };
        slot.get_or_insert(channel);
    }

    fn rgb_channels(&self) -> Option<ChosenChannels> {
        let [red, green, blue] = self.rgb;
        Some(ChosenChannels { color: ColorChannels::Rgb([red?, green?, blue?]), alpha: self.alpha })
    }

    fn gray_or_luminance_chroma(&self) -> Option<ChosenChannels> {
        let luminance = self.luminance.filter(|_| !self.has_x)?;
        let color = match self.chroma {
            [Some(ry), Some(by)] => ColorChannels::LuminanceChroma(luminance, [ry, by]),
            [None, None] => ColorChannels::Gray(luminance),
            [Some(_), None] | [None, Some(_)] => return None,
        };
        Some(ChosenChannels { color, alpha: self.alpha })
    }
}

type LayerMap = BTreeMap<String, LayerChannels>;

/// Selects the channels to decode. Prefers unnamed layers to named ones, then RGB to gray, then layers in a
/// single part to layers across parts, then earlier layers to later ones. Falls back to a part's only
/// channel, whatever its name.
pub(super) fn choose_channels(headers: &[Header]) -> Option<ChosenChannels> {
    let mut parts: Vec<LayerMap> =
        headers.iter().enumerate().map(|(part, header)| layers_by_name(part, header)).collect();
    let across = layers_of_single_channel_parts(headers);
    // The X channel that matches a Y channel may be in another part.
    for layers in &mut parts {
        for (name, layer) in layers {
            layer.has_x |= across.get(name).is_some_and(|across| across.has_x);
        }
    }
    parts.push(across);
    let find = |is_named: bool, channels: fn(&LayerChannels) -> Option<ChosenChannels>| {
        parts.iter().find_map(|layers| {
            let mut layers = layers.iter().filter(|(name, _)| name.is_empty() != is_named);
            layers.find_map(|(_, layer)| channels(layer))
        })
    };
    let unnamed = find(false, LayerChannels::rgb_channels)
        .or_else(|| find(false, LayerChannels::gray_or_luminance_chroma));
    let named = || {
        find(true, LayerChannels::rgb_channels)
            .or_else(|| find(true, LayerChannels::gray_or_luminance_chroma))
    };
    unnamed.or_else(named).or_else(|| choose_lone_channel_as_gray(headers))
}

/// Returns a part's layers, keyed by name. A layer name is the part of a channel name before its last dot.
fn layers_by_name(part: usize, header: &Header) -> LayerMap {
    let mut layers = LayerMap::new();
    if !header.deep {
        add_part_channels_to_layers(part, header, &mut layers);
    }
    layers
}

fn add_part_channels_to_layers(part: usize, header: &Header, layers: &mut LayerMap) {
    for (channel, description) in header.channels.list.iter().enumerate() {
        let name = description.name.to_string();
        let (layer, name) = name.rsplit_once('.').unwrap_or(("", &name));
        layers.entry(layer.to_owned()).or_default().add(name, PartAndChannelIndex { part, channel });
    }
}

/// Assembles layers from single-channel parts.
fn layers_of_single_channel_parts(headers: &[Header]) -> LayerMap {
    let mut layers = LayerMap::new();
    for (part, header) in single_channel_parts(headers) {
        add_part_channels_to_layers(part, header, &mut layers);
    }
    layers
}

/// Returns the flat parts with a single channel, each with its index.
fn single_channel_parts(headers: &[Header]) -> impl Iterator<Item = (usize, &Header)> {
    let headers = headers.iter().enumerate();
    headers.filter(|(_, header)| !header.deep && header.channels.list.len() == 1)
}

/// Returns the channel of the first single-channel part, or `None` if the single-channel parts are components
/// of a color or vector.
fn choose_lone_channel_as_gray(headers: &[Header]) -> Option<ChosenChannels> {
    const COMPONENTS: [&str; 7] = ["R", "G", "B", "RY", "BY", "X", "Y"];
    let is_component = |header: &Header| {
        let name = header.channels.list[0].name.to_string().to_ascii_uppercase();
        COMPONENTS.contains(&name.rsplit('.').next().unwrap_or_default())
    };
    let is_vector =
        headers.len() > 1 && single_channel_parts(headers).any(|(_, header)| is_component(header));
    let (part, _) = single_channel_parts(headers).find(|_| !is_vector)?;
    Some(ChosenChannels { color: ColorChannels::Gray(PartAndChannelIndex { part, channel: 0 }), alpha: None })
}

/// Error message for a file without usable channels.
pub(super) fn describe_unusable_channels(headers: &[Header]) -> String {
    const MAX_NAMES: usize = 8;
    if headers.iter().all(|header| header.deep) {
        return "deep images are not supported; flatten the image".to_owned();
    }
    let flat = headers.iter().filter(|header| !header.deep);
    let mut names = flat.flat_map(|header| &header.channels.list).map(|channel| channel.name.to_string());
    let shown: Vec<_> = names.by_ref().take(MAX_NAMES).collect();
    let more = if names.next().is_some() { ", …" } else { "" };
    no_usable_channels_message(&format!("{}{more}", shown.join(", ")))
}

/// Error message for an image without usable channels. `names` lists the channels.
pub(in crate::assets::image) fn no_usable_channels_message(names: &str) -> String {
    format!("no usable channels among {names}; expected R, G and B, or Y for gray")
}
