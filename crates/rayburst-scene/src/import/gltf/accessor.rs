//! Accessors (glTF 2.0, section 3.6.2): typed, strided, sparse views of buffers, checked once and
//! then read without a way to fail.

use super::source::Source;
use crate::import::ImportError;

/// Types of components, by their numbers in the file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Component {
    I8 = 5120,
    U8 = 5121,
    I16 = 5122,
    U16 = 5123,
    U32 = 5125,
    F32 = 5126,
}

impl Component {
    fn from_code(code: u32) -> Option<Self> {
        [Self::I8, Self::U8, Self::I16, Self::U16, Self::U32, Self::F32]
            .into_iter()
            .find(|&c| c as u32 == code)
    }

    fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::U32 | Self::F32 => 4,
        }
    }
}

/// A checked accessor: every element lies within its buffer.
pub(super) struct Accessor<'a> {
    pub(super) index: usize,
    pub(super) count: usize,
    pub(super) component: Component,
    normalized: bool,
    rows: usize,
    columns: usize,
    /// Bytes from one column of a matrix to the next.
    column_stride: usize,
    element_size: usize,
    /// The elements and the bytes from one to the next; zeros without.
    base: Option<(&'a [u8], usize)>,
    sparse: Option<Sparse<'a>>,
}

/// Elements that replace some of the base's.
struct Sparse<'a> {
    /// Strictly increasing.
    indices: Vec<u32>,
    values: &'a [u8],
}

impl<'a> Accessor<'a> {
    /// Checks an accessor of one of the given types (`SCALAR`, `VEC3`, …).
    pub(super) fn new(
        source: &'a Source<'_>,
        index: usize,
        kinds: &[&str],
    ) -> Result<Self, ImportError> {
        let location = || format!("/accessors/{index}");
        let bad = |reason: String| Err(source.malformed(location(), reason));
        let Some(json) = source.root.accessors.get(index) else {
            return bad("there is no such accessor".into());
        };
        let Some(component) = Component::from_code(json.component_type) else {
            return bad(format!("unknown component type {}", json.component_type));
        };
        if !kinds.contains(&json.kind.as_str()) {
            let found: String = json.kind.chars().take(20).collect();
            return bad(format!("type {} is needed here, found '{found}'", kinds.join(" or ")));
        }
        let (columns, rows) = match json.kind.as_str() {
            "VEC2" => (1, 2),
            "VEC3" => (1, 3),
            "VEC4" => (1, 4),
            "MAT2" => (2, 2),
            "MAT3" => (3, 3),
            "MAT4" => (4, 4),
            _ => (1, 1),
        };
        let mut column_stride = rows * component.size();
        if columns > 1 {
            // Columns of matrices begin at multiples of four bytes.
            column_stride = column_stride.next_multiple_of(4);
        }
        let element_size = columns * column_stride;
        let Ok(count) = u32::try_from(json.count) else {
            return bad(format!("{} elements are more than can be addressed", json.count));
        };
        let count = count as usize;
        let base = match json.buffer_view {
            Some(view) => {
                let bytes = source.view(view)?;
                // The view exists: `view` has found it.
                let stride = source.root.buffer_views[view].byte_stride;
                let stride = stride.unwrap_or(element_size as u64);
                if stride < element_size as u64 || stride > 1 << 16 {
                    return bad(format!("a stride of {stride} for elements of {element_size}"));
                }
                let needed = (count as u64)
                    .checked_sub(1)
                    .map_or(0, |steps| steps * stride + element_size as u64);
                match tail(bytes, json.byte_offset) {
                    Some(bytes) if bytes.len() as u64 >= needed => Some((bytes, stride as usize)),
                    _ => {
                        let (offset, have) = (json.byte_offset, bytes.len());
                        return bad(format!(
                            "{count} elements need {needed} bytes from {offset} on, \
                             buffer view {view} has {have}"
                        ));
                    }
                }
            }
            None => {
                source.charge_implied(count as u64 * element_size as u64, location)?;
                None
            }
        };
        let sparse = match &json.sparse {
            Some(_) => Some(Sparse::new(source, index, count, element_size)?),
            None => None,
        };
        Ok(Self {
            index,
            count,
            component,
            normalized: json.normalized,
            rows,
            columns,
            column_stride,
            element_size,
            base,
            sparse,
        })
    }

    /// Numbers an element has.
    pub(super) fn width(&self) -> usize {
        self.rows * self.columns
    }

    /// All elements, or those picked (in range), as floats: integers are converted, normalized ones
    /// to [0, 1] or [-1, 1] (section 3.6.2.2). `N` is [`Accessor::width`].
    pub(super) fn floats<const N: usize>(
        &self,
        source: &Source<'_>,
        pick: Option<&[u32]>,
    ) -> Result<Vec<[f32; N]>, ImportError> {
        debug_assert_eq!(N, self.width());
        self.charge(source, pick, 4 * N)?;
        let u8 = |b: &[u8]| f32::from(b[0]);
        let i8 = |b: &[u8]| f32::from(b[0] as i8);
        let u16 = |b: &[u8]| f32::from(u16::from_le_bytes([b[0], b[1]]));
        let i16 = |b: &[u8]| f32::from(i16::from_le_bytes([b[0], b[1]]));
        let u32 = |b: &[u8]| u32::from_le_bytes([b[0], b[1], b[2], b[3]]);
        let f32 = |b: &[u8]| f32::from_bits(u32(b));
        Ok(match (self.component, self.normalized) {
            (Component::F32, _) => self.gather(pick, f32),
            (Component::U8, true) => self.gather(pick, |b| u8(b) / 255.0),
            (Component::I8, true) => self.gather(pick, |b| (i8(b) / 127.0).max(-1.0)),
            (Component::U16, true) => self.gather(pick, |b| u16(b) / 65_535.0),
            (Component::I16, true) => self.gather(pick, |b| (i16(b) / 32_767.0).max(-1.0)),
            (Component::U32, true) => self.gather(pick, |b| u32(b) as f32 / u32::MAX as f32),
            (Component::U8, false) => self.gather(pick, u8),
            (Component::I8, false) => self.gather(pick, i8),
            (Component::U16, false) => self.gather(pick, u16),
            (Component::I16, false) => self.gather(pick, i16),
            (Component::U32, false) => self.gather(pick, |b| u32(b) as f32),
        })
    }

    /// All elements, or those picked (in range), as unsigned integers.
    pub(super) fn integers<const N: usize>(
        &self,
        source: &Source<'_>,
        pick: Option<&[u32]>,
    ) -> Result<Vec<[u32; N]>, ImportError> {
        debug_assert_eq!(N, self.width());
        self.charge(source, pick, 4 * N)?;
        match self.component {
            Component::U8 => Ok(self.gather(pick, |b| u32::from(b[0]))),
            Component::U16 => {
                Ok(self.gather(pick, |b| u32::from(u16::from_le_bytes([b[0], b[1]]))))
            }
            Component::U32 => {
                Ok(self.gather(pick, |b| u32::from_le_bytes([b[0], b[1], b[2], b[3]])))
            }
            other => {
                let reason = format!("unsigned integers are needed here, not {other:?}");
                Err(source.malformed(format!("/accessors/{}", self.index), reason))
            }
        }
    }

    fn charge(
        &self,
        source: &Source<'_>,
        pick: Option<&[u32]>,
        bytes: usize,
    ) -> Result<(), ImportError> {
        let count = pick.map_or(self.count, <[u32]>::len);
        source.charge(count as u64 * bytes as u64, || format!("/accessors/{}", self.index))
    }

    fn gather<T: Copy + Default, const N: usize>(
        &self,
        pick: Option<&[u32]>,
        read: impl Fn(&[u8]) -> T,
    ) -> Vec<[T; N]> {
        let step = self.component.size();
        let decode = |bytes: &[u8]| -> [T; N] {
            if self.columns == 1 {
                std::array::from_fn(|k| read(&bytes[k * step..]))
            } else {
                std::array::from_fn(|k| {
                    read(&bytes[k / self.rows * self.column_stride + k % self.rows * step..])
                })
            }
        };
        let base = |i: usize| match self.base {
            Some((bytes, stride)) => decode(&bytes[i * stride..i * stride + self.element_size]),
            None => [T::default(); N],
        };
        let replaced = |sparse: &Sparse<'_>, at: usize| {
            decode(&sparse.values[at * self.element_size..][..self.element_size])
        };
        match (pick, &self.sparse) {
            (None, None) => (0..self.count).map(base).collect(),
            (None, Some(sparse)) => {
                let mut elements: Vec<[T; N]> = (0..self.count).map(base).collect();
                for (at, &i) in sparse.indices.iter().enumerate() {
                    elements[i as usize] = replaced(sparse, at);
                }
                elements
            }
            (Some(pick), None) => pick.iter().map(|&i| base(i as usize)).collect(),
            (Some(pick), Some(sparse)) => pick
                .iter()
                .map(|&i| match sparse.indices.binary_search(&i) {
                    Ok(at) => replaced(sparse, at),
                    Err(_) => base(i as usize),
                })
                .collect(),
        }
    }
}

impl<'a> Sparse<'a> {
    fn new(
        source: &'a Source<'_>,
        index: usize,
        elements: usize,
        element_size: usize,
    ) -> Result<Self, ImportError> {
        let location = || format!("/accessors/{index}/sparse");
        let bad = |reason: &str| source.malformed(location(), reason);
        let json = source.root.accessors[index].sparse.as_ref();
        let json = json.ok_or_else(|| bad("it is missing"))?;
        if json.count > elements as u64 {
            return Err(bad("it replaces more elements than there are"));
        }
        let count = json.count as usize;
        let component = match Component::from_code(json.indices.component_type) {
            Some(c @ (Component::U8 | Component::U16 | Component::U32)) => c,
            _ => return Err(bad("its indices are not unsigned integers")),
        };
        let bytes = tail(source.view(json.indices.buffer_view)?, json.indices.byte_offset)
            .and_then(|bytes| bytes.get(..count * component.size()))
            .ok_or_else(|| bad("its indices go beyond their buffer view"))?;
        let values = tail(source.view(json.values.buffer_view)?, json.values.byte_offset)
            .and_then(|bytes| bytes.get(..count * element_size))
            .ok_or_else(|| bad("its values go beyond their buffer view"))?;
        source.charge(count as u64 * 4, location)?;
        let indices: Vec<u32> = bytes
            .chunks_exact(component.size())
            .map(|b| b.iter().rev().fold(0, |n, &byte| n << 8 | u32::from(byte)))
            .collect();
        if !indices.is_sorted_by(|a, b| a < b) {
            return Err(bad("its indices do not increase"));
        }
        if indices.last().is_some_and(|&last| last as usize >= elements) {
            return Err(bad("an index is out of range"));
        }
        Ok(Self { indices, values })
    }
}

fn tail(bytes: &[u8], offset: u64) -> Option<&[u8]> {
    bytes.get(usize::try_from(offset).ok()?..)
}
