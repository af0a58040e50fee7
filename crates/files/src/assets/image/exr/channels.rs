//! The channels of an EXR that make its colors.

use std::collections::BTreeMap;

use ::exr::meta::header::Header;

/// A channel of a part, both by their indices.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Channel {
    pub(super) part: usize,
    pub(super) channel: usize,
}

/// Channels to read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Chosen {
    pub(super) color: Color,
    pub(super) alpha: Option<Channel>,
}

/// Channels of a color.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Color {
    Rgb([Channel; 3]),
    Gray(Channel),
    /// Y, and the differences RY = (R − Y)/Y and BY = (B − Y)/Y.
    LuminanceChroma(Channel, [Channel; 2]),
}

impl Chosen {
    /// Slots of a pixel with their channels: red, green, blue, alpha. Chroma has no slot.
    pub(super) fn slots(self) -> [Option<Channel>; 4] {
        match self.color {
            Color::Rgb([red, green, blue]) => [Some(red), Some(green), Some(blue), self.alpha],
            Color::Gray(y) | Color::LuminanceChroma(y, _) => [Some(y), Some(y), Some(y), self.alpha],
        }
    }

    /// Y, RY and BY.
    pub(super) fn planes(self) -> Option<[Channel; 3]> {
        match self.color {
            Color::Rgb(_) | Color::Gray(_) => None,
            Color::LuminanceChroma(y, [ry, by]) => Some([y, ry, by]),
        }
    }

    /// All channels.
    pub(super) fn all(self) -> impl Iterator<Item = Channel> {
        self.slots().into_iter().flatten().chain(self.planes().into_iter().flatten())
    }
}

/// The channels of a layer that have known names, in any case.
#[derive(Clone, Copy, Default)]
struct Layer {
    rgb: [Option<Channel>; 3],
    luminance: Option<Channel>,
    chroma: [Option<Channel>; 2],
    alpha: Option<Channel>,
    /// Whether it has an X: its Y is a coordinate.
    has_x: bool,
}

impl Layer {
    fn add(&mut self, name: &str, channel: Channel) {
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

    fn color(&self) -> Option<Chosen> {
        let [red, green, blue] = self.rgb;
        Some(Chosen { color: Color::Rgb([red?, green?, blue?]), alpha: self.alpha })
    }

    fn gray(&self) -> Option<Chosen> {
        let luminance = self.luminance.filter(|_| !self.has_x)?;
        let color = match self.chroma {
            [Some(ry), Some(by)] => Color::LuminanceChroma(luminance, [ry, by]),
            [None, None] => Color::Gray(luminance),
            [Some(_), None] | [None, Some(_)] => return None,
        };
        Some(Chosen { color, alpha: self.alpha })
    }
}

type Layers = BTreeMap<String, Layer>;

/// The channels to read. Colors come before gray, channels without a layer's name before those with one, channels of one part before
/// channels of several, then the first; otherwise the only channel of a part, whatever its name.
pub(super) fn choose(headers: &[Header]) -> Option<Chosen> {
    let mut parts: Vec<Layers> =
        headers.iter().enumerate().map(|(part, header)| layers(part, header)).collect();
    let joined = across_parts(headers);
    // The Y of a part may belong to an X of another.
    for layers in &mut parts {
        for (name, layer) in layers {
            layer.has_x |= joined.get(name).is_some_and(|joined| joined.has_x);
        }
    }
    parts.push(joined);
    let find = |is_named: bool, channels: fn(&Layer) -> Option<Chosen>| {
        parts.iter().find_map(|layers| {
            let mut layers = layers.iter().filter(|(name, _)| name.is_empty() != is_named);
            layers.find_map(|(_, layer)| channels(layer))
        })
    };
    let unnamed = find(false, Layer::color).or_else(|| find(false, Layer::gray));
    let named = || find(true, Layer::color).or_else(|| find(true, Layer::gray));
    unnamed.or_else(named).or_else(|| only(headers))
}

/// Layers of a part by name; the name is before the last dot of the channels' names.
fn layers(part: usize, header: &Header) -> Layers {
    let mut layers = Layers::new();
    if !header.deep {
        add_channels(part, header, &mut layers);
    }
    layers
}

fn add_channels(part: usize, header: &Header, layers: &mut Layers) {
    for (channel, description) in header.channels.list.iter().enumerate() {
        let name = description.name.to_string();
        let (layer, name) = name.rsplit_once('.').unwrap_or(("", &name));
        layers.entry(layer.to_owned()).or_default().add(name, Channel { part, channel });
    }
}

/// Layers of the parts that have one channel each.
fn across_parts(headers: &[Header]) -> Layers {
    let mut layers = Layers::new();
    for (part, header) in single(headers) {
        add_channels(part, header, &mut layers);
    }
    layers
}

/// Flat parts of one channel.
fn single(headers: &[Header]) -> impl Iterator<Item = (usize, &Header)> {
    let headers = headers.iter().enumerate();
    headers.filter(|(_, header)| !header.deep && header.channels.list.len() == 1)
}

/// The first part of one channel, unless that is a component of a color or a vector.
fn only(headers: &[Header]) -> Option<Chosen> {
    const COMPONENTS: [&str; 7] = ["R", "G", "B", "RY", "BY", "X", "Y"];
    let is_component = |header: &Header| {
        let name = header.channels.list[0].name.to_string().to_ascii_uppercase();
        COMPONENTS.contains(&name.rsplit('.').next().unwrap_or_default())
    };
    let is_vector = headers.len() > 1 && single(headers).any(|(_, header)| is_component(header));
    let (part, _) = single(headers).find(|_| !is_vector)?;
    Some(Chosen { color: Color::Gray(Channel { part, channel: 0 }), alpha: None })
}

/// The reason why no channels can be chosen.
pub(super) fn no_color(headers: &[Header]) -> String {
    const MOST_NAMES: usize = 8;
    if headers.iter().all(|header| header.deep) {
        return "deep images are not read; flatten it".to_owned();
    }
    let flat = headers.iter().filter(|header| !header.deep);
    let mut names = flat.flat_map(|header| &header.channels.list).map(|channel| channel.name.to_string());
    let some: Vec<_> = names.by_ref().take(MOST_NAMES).collect();
    let more = if names.next().is_some() { ", …" } else { "" };
    format!("its channels are {}{more}; wanted are R, G and B, or Y for grey", some.join(", "))
}
