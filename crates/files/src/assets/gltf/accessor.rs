//! Numbers of accessors: typed views into buffers, with strides, normalised integers and sparse replacements
//! (glTF 2.0, 3.6.2).

use super::json::{Accessor, BufferView};
use super::{Container, Wrong};

/// Most elements of an accessor that has no bytes of its own, which stand for zeros.
const MOST_ZEROS: u64 = 1 << 22;

/// The type of a component.
#[derive(Clone, Copy, PartialEq)]
enum Component {
    I8,
    U8,
    I16,
    U16,
    U32,
    F32,
}

impl Component {
    fn of(number: u32) -> Option<Self> {
        match number {
            5120 => Some(Self::I8),
            5121 => Some(Self::U8),
            5122 => Some(Self::I16),
            5123 => Some(Self::U16),
            5125 => Some(Self::U32),
            5126 => Some(Self::F32),
            _ => None,
        }
    }

    fn bytes(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::U32 | Self::F32 => 4,
        }
    }

    /// The number in bytes of this component's size; normalised integers are in [0, 1] or [-1, 1] (3.6.2.2).
    fn number(self, bytes: &[u8], normalized: bool) -> f32 {
        let word = || [bytes[0], bytes[1]];
        let long = || [bytes[0], bytes[1], bytes[2], bytes[3]];
        let (value, most) = match self {
            Self::I8 => (f32::from(bytes[0] as i8), 127.0),
            Self::U8 => (f32::from(bytes[0]), 255.0),
            Self::I16 => (f32::from(i16::from_le_bytes(word())), 32767.0),
            Self::U16 => (f32::from(u16::from_le_bytes(word())), 65535.0),
            Self::U32 => (u32::from_le_bytes(long()) as f32, 4_294_967_295.0),
            Self::F32 => return f32::from_le_bytes(long()),
        };
        if normalized { (value / most).max(-1.0) } else { value }
    }

    /// The whole number in bytes of this component's size.
    fn index(self, bytes: &[u8]) -> Option<u32> {
        match self {
            Self::U8 => Some(u32::from(bytes[0])),
            Self::U16 => Some(u32::from(u16::from_le_bytes([bytes[0], bytes[1]]))),
            Self::U32 => Some(u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]])),
            Self::I8 | Self::I16 | Self::F32 => None,
        }
    }
}

/// Number of components of a type.
fn components(kind: &str) -> Option<usize> {
    match kind {
        "SCALAR" => Some(1),
        "VEC2" => Some(2),
        "VEC3" => Some(3),
        "VEC4" | "MAT2" => Some(4),
        "MAT3" => Some(9),
        "MAT4" => Some(16),
        _ => None,
    }
}

/// Elements in a buffer, some bytes apart.
#[derive(Clone, Copy)]
struct Elements<'a> {
    bytes: &'a [u8],
    stride: usize,
}

/// A checked accessor.
pub(super) struct Numbers<'a> {
    component: Component,
    normalized: bool,
    /// Components of each element.
    pub(super) width: usize,
    /// Number of elements.
    pub(super) count: usize,
    /// `None` for zeros.
    elements: Option<Elements<'a>>,
    /// Elements that are replaced, by rising index.
    sparse: Option<(Vec<u32>, Elements<'a>)>,
}

impl<'a> Numbers<'a> {
    /// The accessor of a number.
    pub(super) fn of(container: &'a Container, number: usize) -> Result<Self, Wrong> {
        let accessor = container.root.accessors.get(number);
        let accessor =
            accessor.ok_or_else(|| Wrong::index("accessors", number, container.root.accessors.len()))?;
        Self::new(container, accessor).map_err(|wrong| wrong.inside(format!("accessors[{number}]")))
    }

    fn new(container: &'a Container, accessor: &Accessor) -> Result<Self, Wrong> {
        let component = Component::of(accessor.component_type)
            .ok_or_else(|| Wrong::new(format!("there is no component type {}", accessor.component_type)))?;
        let width = components(&accessor.kind)
            .ok_or_else(|| Wrong::new(format!("there is no type {:?}", super::shown(&accessor.kind))))?;
        let size = width * component.bytes();
        if accessor.count > u64::from(u32::MAX) {
            return Err(Wrong::new(format!("it claims {} elements", accessor.count)));
        }
        let count = accessor.count as usize;
        let own = match accessor.buffer_view {
            Some(view) => Some(elements(container, view, accessor.byte_offset, size, count)?),
            None if accessor.count <= MOST_ZEROS => None,
            None => {
                return Err(Wrong::new(format!(
                    "{} elements without a buffer view, more than the {MOST_ZEROS} that are read",
                    accessor.count
                )));
            }
        };
        let sparse = match &accessor.sparse {
            Some(sparse) => {
                if sparse.count > accessor.count {
                    return Err(Wrong::new(format!("it replaces {} of {count} elements", sparse.count)));
                }
                let replaced = sparse.count as usize;
                let places = &sparse.indices;
                let of_index =
                    Component::of(places.component_type).filter(|one| one.index(&[0; 4]).is_some());
                let of_index = of_index
                    .ok_or_else(|| Wrong::new("its sparse indices are not whole numbers".to_owned()))?;
                let indices =
                    elements(container, places.buffer_view, places.byte_offset, of_index.bytes(), replaced)?;
                let indices: Vec<u32> = (0..replaced)
                    .filter_map(|place| of_index.index(&indices.bytes[place * indices.stride..]))
                    .collect();
                if indices.iter().any(|index| *index as usize >= count) || !indices.is_sorted() {
                    return Err(Wrong::new("its sparse indices are out of range or not in order".to_owned()));
                }
                let values = &sparse.values;
                Some((indices, elements(container, values.buffer_view, values.byte_offset, size, replaced)?))
            }
            None => None,
        };
        Ok(Self { component, normalized: accessor.normalized, width, count, elements: own, sparse })
    }

    /// Bytes of an element; `None` for zeros.
    fn element(&self, index: usize) -> Option<&'a [u8]> {
        if let Some((indices, values)) = &self.sparse
            && let Ok(place) = indices.binary_search(&(index as u32))
        {
            return Some(&values.bytes[place * values.stride..]);
        }
        self.elements.map(|elements| &elements.bytes[index * elements.stride..])
    }

    /// The first components of an element, which must exist; what it does not have is `missing`.
    pub(super) fn floats<const N: usize>(&self, index: usize, missing: f32) -> [f32; N] {
        let (size, element) = (self.component.bytes(), self.element(index));
        std::array::from_fn(|place| match element {
            _ if place >= self.width => missing,
            Some(bytes) => self.component.number(&bytes[place * size..], self.normalized),
            None => 0.0,
        })
    }

    /// Whether these are indices.
    pub(super) fn are_indices(&self) -> bool {
        self.width == 1 && self.component.index(&[0; 4]).is_some()
    }

    /// An index, which must exist.
    pub(super) fn index(&self, place: usize) -> u32 {
        self.element(place).and_then(|bytes| self.component.index(bytes)).unwrap_or_default()
    }
}

/// The bytes of some elements of a size in a view.
fn elements<'a>(
    container: &'a Container,
    view: usize,
    offset: u64,
    size: usize,
    count: usize,
) -> Result<Elements<'a>, Wrong> {
    let views = &container.root.buffer_views;
    let place = format!("bufferViews[{view}]");
    let json = views.get(view).ok_or_else(|| Wrong::index("bufferViews", view, views.len()))?;
    let bytes = view_bytes(container, json).map_err(|wrong| wrong.inside(place.clone()))?;
    let stride = json.byte_stride.unwrap_or(size as u64);
    if stride < size as u64 || stride > 1 << 16 {
        return Err(Wrong::new(format!("a stride of {stride} bytes for elements of {size}")).inside(place));
    }
    let stride = stride as usize;
    let needed = if count == 0 { 0 } else { (count as u64 - 1) * stride as u64 + size as u64 };
    let end = offset.checked_add(needed).filter(|end| *end <= bytes.len() as u64);
    if end.is_none() {
        let has = bytes.len();
        return Err(Wrong::new(format!(
            "{count} elements from byte {offset} need {needed} bytes of {place}, which has {has}"
        )));
    }
    Ok(Elements { bytes: &bytes[offset as usize..], stride })
}

/// The bytes of a view.
pub(super) fn view_bytes<'a>(container: &'a Container, view: &BufferView) -> Result<&'a [u8], Wrong> {
    let buffers = &container.buffers;
    let buffer =
        buffers.get(view.buffer).ok_or_else(|| Wrong::index("buffers", view.buffer, buffers.len()))?;
    let end = view.byte_offset.checked_add(view.byte_length).filter(|end| *end <= buffer.len() as u64);
    let end = end.ok_or_else(|| {
        Wrong::new(format!(
            "bytes {} + {} of buffers[{}], which has {}",
            view.byte_offset,
            view.byte_length,
            view.buffer,
            buffer.len()
        ))
    })?;
    Ok(&buffer[view.byte_offset as usize..end as usize])
}
