//! Accessors: typed views of buffers, with strides, normalized integers and sparse values (glTF 2.0, 3.6.2).

use super::json::{Accessor, BufferView};
use super::{GltfError, GltfFile};

/// Maximum number of elements in an accessor without a buffer view, whose elements are all zero.
const MAX_ZEROS: u64 = 1 << 22;

/// Type of an accessor's components.
#[derive(Clone, Copy, PartialEq)]
enum ComponentType {
    I8,
    U8,
    I16,
    U16,
    U32,
    F32,
}

impl ComponentType {
    fn from_number(number: u32) -> Option<Self> {
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

    fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::U32 | Self::F32 => 4,
        }
    }

    /// Decodes a component as a float. Normalized integers map to [0, 1] or [-1, 1] (3.6.2.2).
    fn decode_as_float(self, bytes: &[u8], normalized: bool) -> f32 {
        let word = || [bytes[0], bytes[1]];
        let long = || [bytes[0], bytes[1], bytes[2], bytes[3]];
        let (value, max) = match self {
            Self::I8 => (f32::from(bytes[0] as i8), 127.0),
            Self::U8 => (f32::from(bytes[0]), 255.0),
            Self::I16 => (f32::from(i16::from_le_bytes(word())), 32767.0),
            Self::U16 => (f32::from(u16::from_le_bytes(word())), 65535.0),
            Self::U32 => (u32::from_le_bytes(long()) as f32, 4_294_967_295.0),
            Self::F32 => return f32::from_le_bytes(long()),
        };
        if normalized { (value / max).max(-1.0) } else { value }
    }

    /// Decodes a component as an index, or returns `None` for types that cannot be indices.
    fn decode_as_index(self, bytes: &[u8]) -> Option<u32> {
        match self {
            Self::U8 => Some(u32::from(bytes[0])),
            Self::U16 => Some(u32::from(u16::from_le_bytes([bytes[0], bytes[1]]))),
            Self::U32 => Some(u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]])),
            Self::I8 | Self::I16 | Self::F32 => None,
        }
    }
}

/// Number of components of an element type.
fn component_count(kind: &str) -> Option<usize> {
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

/// Strided elements in a buffer.
#[derive(Clone, Copy)]
struct StridedElements<'a> {
    bytes: &'a [u8],
    stride: usize,
}

/// Reads the elements in a validated accessor.
pub(super) struct AccessorReader<'a> {
    component: ComponentType,
    normalized: bool,
    /// Components per element.
    pub(super) width: usize,
    /// Number of elements.
    pub(super) count: usize,
    /// Elements in the buffer view. Without a view (`None`), all elements are zero.
    elements: Option<StridedElements<'a>>,
    /// Sparse values and their sorted indices.
    sparse: Option<(Vec<u32>, StridedElements<'a>)>,
}

impl<'a> AccessorReader<'a> {
    /// Opens an accessor, given its index.
    pub(super) fn open(container: &'a GltfFile, number: usize) -> Result<Self, GltfError> {
        let accessor = container.root.accessors.get(number);
        let accessor = accessor.ok_or_else(|| {
            GltfError::index_out_of_range("accessors", number, container.root.accessors.len())
        })?;
        Self::new(container, accessor).map_err(|wrong| wrong.add_location(format!("accessors[{number}]")))
    }

    fn new(container: &'a GltfFile, accessor: &Accessor) -> Result<Self, GltfError> {
        let component = ComponentType::from_number(accessor.component_type)
            .ok_or_else(|| GltfError::new(format!("unknown component type {}", accessor.component_type)))?;
        let width = component_count(&accessor.kind).ok_or_else(|| {
            GltfError::new(format!("unknown type {:?}", super::truncate_for_message(&accessor.kind)))
        })?;
        let size = width * component.size();
        if accessor.count > u64::from(u32::MAX) {
            return Err(GltfError::new(format!("too many elements: {}", accessor.count)));
        }
        let count = accessor.count as usize;
        let elements_of_view = match accessor.buffer_view {
            Some(view) => Some(locate_elements(container, view, accessor.byte_offset, size, count)?),
            None if accessor.count <= MAX_ZEROS => None,
            None => {
                return Err(GltfError::new(too_many_viewless_elements_message(accessor.count)));
            }
        };
        let sparse = match &accessor.sparse {
            Some(sparse) => {
                if sparse.count > accessor.count {
                    return Err(GltfError::new(format!(
                        "{} sparse values for only {count} elements",
                        sparse.count
                    )));
                }
                let replaced = sparse.count as usize;
                let json = &sparse.indices;
                let index_type = ComponentType::from_number(json.component_type);
                let index_type = index_type.filter(|component| component.decode_as_index(&[0; 4]).is_some());
                let index_type =
                    index_type.ok_or_else(|| GltfError::new("sparse indices must be integers"))?;
                let indices = locate_elements(
                    container,
                    json.buffer_view,
                    json.byte_offset,
                    index_type.size(),
                    replaced,
                )?;
                let indices: Vec<u32> = (0..replaced)
                    .filter_map(|element| {
                        index_type.decode_as_index(&indices.bytes[element * indices.stride..])
                    })
                    .collect();
                if indices.iter().any(|index| *index as usize >= count) || !indices.is_sorted() {
                    return Err(GltfError::new("sparse indices are out of range or not sorted"));
                }
                let values = &sparse.values;
                Some((
                    indices,
                    locate_elements(container, values.buffer_view, values.byte_offset, size, replaced)?,
                ))
            }
            None => None,
        };
        Ok(Self {
            component,
            normalized: accessor.normalized,
            width,
            count,
            elements: elements_of_view,
            sparse,
        })
    }

    /// Returns the bytes from the start of an element, or `None` if the element is zero.
    fn bytes_starting_at_element(&self, index: usize) -> Option<&'a [u8]> {
        if let Some((indices, values)) = &self.sparse
            && let Ok(element) = indices.binary_search(&(index as u32))
        {
            return Some(&values.bytes[element * values.stride..]);
        }
        self.elements.map(|elements| &elements.bytes[index * elements.stride..])
    }

    /// Returns an element's first `N` components, with `missing` for components that its type does not have.
    /// The element must exist.
    pub(super) fn element_floats<const N: usize>(&self, index: usize, missing: f32) -> [f32; N] {
        let (size, element) = (self.component.size(), self.bytes_starting_at_element(index));
        std::array::from_fn(|component| match element {
            _ if component >= self.width => missing,
            Some(bytes) => self.component.decode_as_float(&bytes[component * size..], self.normalized),
            None => 0.0,
        })
    }

    /// Whether the elements can be used as indices.
    pub(super) fn are_indices(&self) -> bool {
        self.width == 1 && self.component.decode_as_index(&[0; 4]).is_some()
    }

    /// Reads element number `element` as an index. The element must exist.
    pub(super) fn read_index(&self, element: usize) -> u32 {
        self.bytes_starting_at_element(element)
            .and_then(|bytes| self.component.decode_as_index(bytes))
            .unwrap_or_default()
    }
}

/// Locates `count` elements of `size` bytes each in a buffer view.
fn locate_elements<'a>(
    container: &'a GltfFile,
    view: usize,
    offset: u64,
    size: usize,
    count: usize,
) -> Result<StridedElements<'a>, GltfError> {
    let views = &container.root.buffer_views;
    let place = format!("bufferViews[{view}]");
    let json =
        views.get(view).ok_or_else(|| GltfError::index_out_of_range("bufferViews", view, views.len()))?;
    let bytes = buffer_view_bytes(container, json).map_err(|wrong| wrong.add_location(place.clone()))?;
    let stride = json.byte_stride.unwrap_or(size as u64);
    if stride < size as u64 || stride > 1 << 16 {
        return Err(GltfError::new(format!("invalid stride of {stride} bytes for {size}-byte elements"))
            .add_location(place));
    }
    let stride = stride as usize;
    let needed = if count == 0 { 0 } else { (count as u64 - 1) * stride as u64 + size as u64 };
    let end = offset.checked_add(needed).filter(|end| *end <= bytes.len() as u64);
    if end.is_none() {
        return Err(GltfError::new(view_too_short_message(count, offset, needed, &place, bytes.len())));
    }
    Ok(StridedElements { bytes: &bytes[offset as usize..], stride })
}

/// Returns the bytes in a buffer view.
pub(super) fn buffer_view_bytes<'a>(
    container: &'a GltfFile,
    view: &BufferView,
) -> Result<&'a [u8], GltfError> {
    let buffers = &container.buffers;
    let buffer = buffers
        .get(view.buffer)
        .ok_or_else(|| GltfError::index_out_of_range("buffers", view.buffer, buffers.len()))?;
    let end = view.byte_offset.checked_add(view.byte_length).filter(|end| *end <= buffer.len() as u64);
    let end = end.ok_or_else(|| GltfError::new(view_exceeds_buffer_message(view, buffer.len())))?;
    Ok(&buffer[view.byte_offset as usize..end as usize])
}

pub(super) fn too_many_viewless_elements_message(count: u64) -> String {
    format!("{count} elements without a buffer view; the limit is {MAX_ZEROS}")
}

/// Error message for elements that extend past their buffer view.
pub(super) fn view_too_short_message(
    count: usize,
    offset: u64,
    needed: u64,
    view: &str,
    has: usize,
) -> String {
    format!("{count} elements at byte {offset} need {needed} bytes, but {view} has {has}")
}

/// Error message for a view that extends past its buffer.
fn view_exceeds_buffer_message(view: &BufferView, has: usize) -> String {
    let BufferView { buffer, byte_offset, byte_length, .. } = view;
    format!("bytes {byte_offset} + {byte_length} exceed buffers[{buffer}], which has {has} bytes")
}
