//! Accessors: typed elements of buffer views (glTF 2.0, 3.6.2). All bytes of meshes pass through here: bounds, strides,
//! counts and overflow are checked once.

use super::buffers::{Buffers, ViewBytes};
use super::fault::{Fault, named};
use super::schema::{AccessorInfo, Document, Index, Sparse};
use crate::import::draco::Mesh;

/// A component type.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Component {
    I8,
    U8,
    I16,
    U16,
    U32,
    F32,
}

impl Component {
    pub(super) fn of(code: u32) -> Option<Component> {
        Some(match code {
            5120 => Component::I8,
            5121 => Component::U8,
            5122 => Component::I16,
            5123 => Component::U16,
            5125 => Component::U32,
            5126 => Component::F32,
            _ => return None,
        })
    }

    fn size(self) -> usize {
        match self {
            Component::I8 | Component::U8 => 1,
            Component::I16 | Component::U16 => 2,
            Component::U32 | Component::F32 => 4,
        }
    }

    /// The number at the start of `bytes`, which are enough; normalized as in 3.11.
    fn number(self, bytes: &[u8], normalized: bool) -> f32 {
        let two = || [bytes[0], bytes[1]];
        let four = || [bytes[0], bytes[1], bytes[2], bytes[3]];
        let (value, most) = match self {
            Component::I8 => (f32::from(bytes[0] as i8), 127.0),
            Component::U8 => (f32::from(bytes[0]), 255.0),
            Component::I16 => (f32::from(i16::from_le_bytes(two())), 32767.0),
            Component::U16 => (f32::from(u16::from_le_bytes(two())), 65535.0),
            Component::U32 => return u32::from_le_bytes(four()) as f32,
            Component::F32 => return f32::from_le_bytes(four()),
        };
        if normalized { (value / most).max(-1.0) } else { value }
    }

    /// The whole number at the start of `bytes`, which are enough. None of types that aren't whole and without a sign.
    fn whole(self, bytes: &[u8]) -> Option<u32> {
        Some(match self {
            Component::U8 => bytes[0].into(),
            Component::U16 => u16::from_le_bytes([bytes[0], bytes[1]]).into(),
            Component::U32 => u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]),
            Component::I8 | Component::I16 | Component::F32 => return None,
        })
    }
}

/// The form of an element: its columns and rows.
pub(super) fn shape(kind: &str) -> Option<[usize; 2]> {
    Some(match kind {
        "SCALAR" => [1, 1],
        "VEC2" => [1, 2],
        "VEC3" => [1, 3],
        "VEC4" => [1, 4],
        "MAT2" => [2, 2],
        "MAT3" => [3, 3],
        "MAT4" => [4, 4],
        _ => return None,
    })
}

/// The elements that may have no bytes in a file: those of accessors without a buffer view, which are 0.
const MOST_ZEROS: usize = 1 << 24;

/// The readers of a document's accessors.
pub(super) struct Accessors<'a> {
    pub(super) document: &'a Document,
    pub(super) buffers: &'a Buffers<'a>,
    /// What a compressed primitive has in place of accessors' own elements.
    pub(super) unpacked: Unpacked<'a>,
}

/// What a compressed primitive has in place of accessors' own elements.
#[derive(Default)]
pub(super) struct Unpacked<'a> {
    pub(super) mesh: Option<&'a Mesh>,
    /// The elements by their accessors.
    pub(super) elements: Vec<(Index, Elements<'a>)>,
}

/// A checked accessor: the bytes of its elements, and how they are read.
#[derive(Clone, Copy)]
pub(super) struct Elements<'a> {
    info: &'a AccessorInfo,
    pub(super) component: Component,
    columns: usize,
    rows: usize,
    /// The distance between columns, each of which starts at a multiple of 4 bytes.
    column: usize,
    /// The bytes of an element.
    size: usize,
    stride: usize,
    pub(super) count: usize,
    /// Whether integers stand for fractions of the largest one.
    normalized: bool,
    /// The bytes from the first element on; none for zeros.
    bytes: Option<&'a [u8]>,
}

impl<'a> Unpacked<'a> {
    fn elements(&self, index: Index) -> Option<Elements<'a>> {
        self.elements.iter().find(|(own, _)| *own == index).map(|(_, elements)| *elements)
    }
}

impl<'a> Accessors<'a> {
    pub(super) fn new(document: &'a Document, buffers: &'a Buffers<'a>) -> Accessors<'a> {
        Accessors { document, buffers, unpacked: Unpacked::default() }
    }

    /// The accessors of a compressed primitive.
    pub(super) fn with(&self, unpacked: Unpacked<'a>) -> Accessors<'a> {
        Accessors { unpacked, ..*self }
    }

    fn info(&self, index: Index) -> Result<&'a AccessorInfo, Fault> {
        named(&self.document.accessors, index, "accessor")
    }

    /// The number of elements of an accessor.
    pub(super) fn count(&self, index: Index) -> Result<usize, Fault> {
        let own = self.info(index)?.count;
        Ok(self.unpacked.elements(index).map_or(own, |elements| elements.count))
    }

    /// Says whether an accessor has numbers of its own, in a buffer or sparse. One without means zeros.
    pub(super) fn has_values(&self, index: Index) -> Result<bool, Fault> {
        let info = self.info(index)?;
        Ok(info.buffer_view.is_some() || info.sparse.is_some())
    }

    /// The number of components of an accessor's elements.
    pub(super) fn width(&self, index: Index) -> Result<usize, Fault> {
        let info = self.info(index)?;
        Ok(shape(&info.kind).map_or(0, |[columns, rows]| columns * rows))
    }

    /// Elements of `N` numbers. Integers are converted, and normalized if the accessor says so.
    pub(super) fn numbers<const N: usize>(&self, index: Index) -> Result<Vec<[f32; N]>, Fault> {
        self.read(index, N, |component, normalized, bytes| Some(component.number(bytes, normalized)), 0.0)
    }

    /// Elements of `N` whole numbers without a sign.
    pub(super) fn whole<const N: usize>(&self, index: Index) -> Result<Vec<[u32; N]>, Fault> {
        self.read(index, N, |component, _, bytes| component.whole(bytes), 0)
    }

    /// All numbers of an accessor, element after element, as they stand in the file: integers aren't normalized.
    pub(super) fn stored(&self, index: Index) -> Result<Vec<f64>, Fault> {
        let info = self.info(index)?;
        let place = || format!("/accessors/{index}");
        let elements = self.elements(index, info).map_err(|fault| fault.at_if_relative(&place()))?;
        let is_packed = elements.columns == 1 || elements.column == elements.component.size() * elements.rows;
        if let Some(bytes) = elements.bytes.filter(|_| is_packed && info.sparse.is_none()) {
            return Ok(elements.spread(bytes));
        }
        let exact = |component: Component, _, bytes: &[u8]| {
            Some(component.whole(bytes).map_or_else(|| component.number(bytes, false).into(), f64::from))
        };
        Ok(match elements.columns * elements.rows {
            1 => self.read::<1, f64>(index, 1, exact, 0.0)?.into_flattened(),
            2 => self.read::<2, f64>(index, 2, exact, 0.0)?.into_flattened(),
            3 => self.read::<3, f64>(index, 3, exact, 0.0)?.into_flattened(),
            4 => self.read::<4, f64>(index, 4, exact, 0.0)?.into_flattened(),
            9 => self.read::<9, f64>(index, 9, exact, 0.0)?.into_flattened(),
            _ => self.read::<16, f64>(index, 16, exact, 0.0)?.into_flattened(),
        })
    }

    fn read<const N: usize, T: Copy>(
        &self,
        index: Index,
        width: usize,
        number: impl Fn(Component, bool, &[u8]) -> Option<T>,
        zero: T,
    ) -> Result<Vec<[T; N]>, Fault> {
        let info = self.info(index)?;
        let read = || {
            let elements = self.elements(index, info)?;
            if elements.columns * elements.rows != width {
                return Err(
                    Fault::new(format!("is {:?}, whose elements don't have {width} numbers", info.kind)).at("/type")
                );
            }
            let mut all = match elements.bytes {
                None => vec![[zero; N]; elements.count],
                Some(bytes) => (0..elements.count)
                    .map(|i| elements.element(&bytes[i * elements.stride..], &number))
                    .collect::<Option<Vec<_>>>()
                    .ok_or_else(|| not_whole(info))?,
            };
            if let Some(sparse) = info.sparse.as_ref().filter(|_| self.unpacked.elements(index).is_none()) {
                self.replace(&elements, sparse, &number, &mut all).map_err(|fault| fault.at_if_bare("/sparse"))?;
            }
            Ok(all)
        };
        read().map_err(|fault| fault.at_if_relative(&format!("/accessors/{index}")))
    }

    fn elements(&self, index: Index, info: &'a AccessorInfo) -> Result<Elements<'a>, Fault> {
        if let Some(unpacked) = self.unpacked.elements(index) {
            return Ok(unpacked);
        }
        let Some(component) = Component::of(info.component_type) else {
            let message = format!("is {}; component types are 5120 to 5123, 5125 and 5126", info.component_type);
            return Err(Fault::new(message).at("/componentType"));
        };
        let Some([columns, rows]) = shape(&info.kind) else {
            let message = format!("is {:?}; types are SCALAR, VEC2 to VEC4 and MAT2 to MAT4", info.kind);
            return Err(Fault::new(message).at("/type"));
        };
        if info.count == 0 {
            return Err(Fault::new("is 0; an accessor has at least one element").at("/count"));
        }
        let column = match columns {
            1 => component.size() * rows,
            _ => (component.size() * rows).next_multiple_of(4),
        };
        let size = column * (columns - 1) + component.size() * rows;
        let (count, normalized) = (info.count, info.normalized);
        let elements =
            Elements { info, component, columns, rows, column, size, stride: size, count, normalized, bytes: None };
        let Some(view) = info.buffer_view else {
            let zeros = self.buffers.zeros.get().saturating_add(info.count);
            self.buffers.zeros.set(zeros);
            if zeros > MOST_ZEROS {
                let message =
                    format!("is {}, without a buffer view: at most {MOST_ZEROS} elements are zeros", info.count);
                return Err(Fault::new(message).at("/count"));
            }
            return Ok(elements);
        };
        let ViewBytes { bytes, stride } = self.buffers.view(view)?;
        let stride = stride.unwrap_or(column * columns);
        if stride < size {
            let message =
                format!("its elements of {size} bytes don't fit the byteStride {stride} of buffer view {view}");
            return Err(Fault::new(message));
        }
        let bytes = within(bytes, info.byte_offset, stride, size, info.count)?;
        Ok(Elements { stride, bytes: Some(bytes), ..elements })
    }

    /// Puts sparse values in their places.
    fn replace<const N: usize, T: Copy>(
        &self,
        elements: &Elements,
        sparse: &Sparse,
        number: &impl Fn(Component, bool, &[u8]) -> Option<T>,
        all: &mut [[T; N]],
    ) -> Result<(), Fault> {
        let indices = &sparse.indices;
        let component =
            Component::of(indices.component_type).filter(|c| c.whole(&[0; 4]).is_some()).ok_or_else(|| {
                let message = format!("is {}; indices are 5121, 5123 or 5125", indices.component_type);
                Fault::new(message).at("/sparse/indices/componentType")
            })?;
        if sparse.count == 0 || sparse.count > all.len() {
            let message = format!("is {}; it must be 1 to {}, the count of the accessor", sparse.count, all.len());
            return Err(Fault::new(message).at("/sparse/count"));
        }
        let size = component.size();
        let places = self.buffers.view(indices.buffer_view)?.bytes;
        let places = within(places, indices.byte_offset, size, size, sparse.count)
            .map_err(|fault| fault.at("/sparse/indices"))?;
        let values = self.buffers.view(sparse.values.buffer_view)?.bytes;
        // Sparse values are tightly packed.
        let stride = elements.column * elements.columns;
        let values = within(values, sparse.values.byte_offset, stride, elements.size, sparse.count)
            .map_err(|fault| fault.at("/sparse/values"))?;
        let count = all.len();
        for i in 0..sparse.count {
            let place = component.whole(&places[i * size..]).unwrap_or(0);
            let element = all.get_mut(place as usize).ok_or_else(|| {
                let message = format!("index {i} is {place}, but the accessor has {count} elements");
                Fault::new(message).at("/sparse/indices")
            })?;
            *element = elements.element(&values[i * stride..], number).ok_or_else(|| not_whole(elements.info))?;
        }
        Ok(())
    }
}

impl<'a> Elements<'a> {
    /// Elements of `width` numbers, one after the other, in place of an accessor's own.
    pub(super) fn unpacked(
        info: &'a AccessorInfo,
        component: Component,
        normalized: bool,
        width: usize,
        bytes: &'a [u8],
    ) -> Elements<'a> {
        let size = component.size() * width;
        let (columns, rows, column, stride, count) = (1, width, size, size, bytes.len() / size);
        Elements { info, component, columns, rows, column, size, stride, count, normalized, bytes: Some(bytes) }
    }

    /// All numbers of elements without a gap inside.
    fn spread(&self, bytes: &[u8]) -> Vec<f64> {
        match self.component {
            Component::I8 => self.all(bytes, |[b]: [u8; 1]| f64::from(b as i8)),
            Component::U8 => self.all(bytes, |[b]: [u8; 1]| f64::from(b)),
            Component::I16 => self.all(bytes, |b| f64::from(i16::from_le_bytes(b))),
            Component::U16 => self.all(bytes, |b| f64::from(u16::from_le_bytes(b))),
            Component::U32 => self.all(bytes, |b| f64::from(u32::from_le_bytes(b))),
            Component::F32 => self.all(bytes, |b| f64::from(f32::from_le_bytes(b))),
        }
    }

    fn all<const S: usize>(&self, bytes: &[u8], number: impl Fn([u8; S]) -> f64) -> Vec<f64> {
        let mut all = Vec::with_capacity(self.count.saturating_mul(self.columns * self.rows));
        let spread = |bytes: &[u8], all: &mut Vec<f64>| all.extend(bytes.as_chunks().0.iter().map(|b| number(*b)));
        match self.stride == self.size {
            true => spread(bytes, &mut all),
            false => bytes.chunks(self.stride).for_each(|element| {
                spread(&element[..self.size.min(element.len())], &mut all);
            }),
        }
        all
    }

    /// The element at the start of `bytes`.
    fn element<const N: usize, T: Copy>(
        &self,
        bytes: &[u8],
        number: &impl Fn(Component, bool, &[u8]) -> Option<T>,
    ) -> Option<[T; N]> {
        let mut element = [number(self.component, self.normalized, bytes)?; N];
        for (k, slot) in element.iter_mut().enumerate() {
            let at = k / self.rows * self.column + k % self.rows * self.component.size();
            *slot = number(self.component, self.normalized, &bytes[at..])?;
        }
        Some(element)
    }
}

fn not_whole(info: &AccessorInfo) -> Fault {
    let message = format!("is {}; whole numbers without a sign are needed: 5121, 5123 or 5125", info.component_type);
    Fault::new(message).at("/componentType")
}

/// The bytes of `count` elements of `size` bytes, one each `stride`, from an offset on.
fn within(bytes: &[u8], offset: usize, stride: usize, size: usize, count: usize) -> Result<&[u8], Fault> {
    let needed =
        (count - 1).checked_mul(stride).and_then(|last| last.checked_add(size)).and_then(|n| n.checked_add(offset));
    match needed {
        Some(needed) if needed <= bytes.len() => Ok(&bytes[offset..needed]),
        _ => {
            let message = format!(
                "{count} elements of {size} bytes at byteOffset {offset} go beyond the {} bytes of its buffer view",
                bytes.len()
            );
            Err(Fault::new(message))
        }
    }
}
