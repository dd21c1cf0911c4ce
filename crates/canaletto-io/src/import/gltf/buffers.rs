//! Buffers and buffer views: bytes of the binary chunk, of data URIs and of other files, compressed or not.

use super::fault::{Fault, named};
use super::meshopt;
use super::schema::{CompressedView, Document, Index};
use crate::assets::{AssetPath, Assets, reason};
use crate::import::draco;
use base64::Engine;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};
use std::borrow::Cow;
use std::cell::{Cell, OnceCell};

/// The bytes that a document refers to. Each buffer is read once, when it is first needed.
pub(super) struct Buffers<'a> {
    document: &'a Document,
    binary_chunk: Option<&'a [u8]>,
    files: Files<'a>,
    buffers: Vec<OnceCell<Result<Cow<'a, [u8]>, Fault>>>,
    /// The decoded bytes of compressed views.
    decoded: Vec<OnceCell<Result<Vec<u8>, Fault>>>,
    /// The bytes that each buffer's compressed views decode to, of those that were needed so far.
    decoded_sizes: Vec<Cell<usize>>,
    /// The decoded meshes of views.
    meshes: Vec<OnceCell<Result<draco::Mesh, Fault>>>,
    /// The elements without bytes so far.
    pub(super) zeros: Cell<usize>,
    /// The number of bytes that were read or decoded so far.
    size: Cell<usize>,
}

/// The files beside a document.
#[derive(Clone, Copy)]
pub(super) struct Files<'a> {
    pub(super) assets: &'a dyn Assets,
    pub(super) from: &'a AssetPath,
}

/// The bytes of a buffer view.
#[derive(Clone, Copy)]
pub(super) struct ViewBytes<'a> {
    pub(super) bytes: &'a [u8],
    pub(super) stride: Option<usize>,
}

impl<'a> Buffers<'a> {
    pub(super) fn new(document: &'a Document, binary_chunk: Option<&'a [u8]>, files: Files<'a>) -> Buffers<'a> {
        let buffers = document.buffers.iter().map(|_| OnceCell::new()).collect();
        let decoded = document.buffer_views.iter().map(|_| OnceCell::new()).collect();
        let decoded_sizes = document.buffers.iter().map(|_| Cell::new(0)).collect();
        let meshes = document.buffer_views.iter().map(|_| OnceCell::new()).collect();
        Buffers {
            document,
            binary_chunk,
            files,
            buffers,
            decoded,
            decoded_sizes,
            meshes,
            zeros: Cell::new(0),
            size: Cell::new(0),
        }
    }

    pub(super) fn files(&self) -> Files<'a> {
        self.files
    }

    /// The bytes of a buffer view.
    pub(super) fn view(&self, index: Index) -> Result<ViewBytes<'_>, Fault> {
        let view = named(&self.document.buffer_views, index, "buffer view")?;
        let place = format!("/bufferViews/{index}");
        let bytes = match view.extensions.compressed() {
            Some((compressed, name)) => {
                let decoded = self.decoded[index as usize].get_or_init(|| {
                    let place = format!("{place}/extensions/{name}");
                    self.decode(compressed).map_err(|fault| fault.at_if_relative(&place))
                });
                decoded.as_deref().map_err(Clone::clone)?
            }
            None => {
                let range = self.range(view.buffer, view.byte_offset, view.byte_length);
                range.map_err(|fault| fault.at_if_relative(&place))?
            }
        };
        if let Some(stride) = view.byte_stride.filter(|stride| !(4..=252).contains(stride) || stride % 4 != 0) {
            let message = format!("is {stride}; it must be a multiple of 4 from 4 to 252");
            return Err(Fault::new(message).at(format!("{place}/byteStride")));
        }
        Ok(ViewBytes { bytes, stride: view.byte_stride })
    }

    /// Bytes of a buffer.
    fn range(&self, buffer: Index, offset: usize, length: usize) -> Result<&[u8], Fault> {
        let buffer = self.buffer(buffer).map_err(|fault| fault.at_if_bare("/buffer"))?;
        offset.checked_add(length).and_then(|end| buffer.get(offset..end)).ok_or_else(|| {
            let size = buffer.len();
            Fault::new(format!("byteOffset {offset} and byteLength {length} go beyond the {size} bytes of its buffer"))
        })
    }

    /// The bytes of a compressed view. Its own buffer, the fallback, isn't read.
    fn decode(&self, view: &CompressedView) -> Result<Vec<u8>, Fault> {
        let bytes = self.range(view.buffer, view.byte_offset, view.byte_length)?;
        let sum = &self.decoded_sizes[view.buffer as usize];
        sum.set(sum.get().saturating_add(view.count.saturating_mul(view.byte_stride)));
        // Views that share bytes would fill the memory out of a small file.
        if sum.get() >= self.buffer(view.buffer)?.len().saturating_mul(meshopt::MOST_PER_BYTE) {
            let (index, count) = (view.buffer, view.count);
            let message =
                format!("is {count}: the compressed views of buffer {index} have more than its bytes can hold");
            return Err(Fault::new(message).at("/count"));
        }
        meshopt::decode(view, bytes).inspect(|bytes| self.count(bytes.len()))
    }

    /// The mesh that a buffer view holds, compressed by Draco.
    pub(super) fn mesh(&self, index: Index) -> Result<&draco::Mesh, Fault> {
        let bytes = self.view(index)?.bytes;
        let mesh = self.meshes[index as usize].get_or_init(|| {
            // Views that share bytes would fill the memory out of a small file.
            let most = draco::most_numbers(self.bytes_read()).saturating_sub(self.bytes_of_meshes() / 4);
            let mesh = draco::decode(bytes, most).inspect(|mesh| self.count(mesh.bytes()));
            mesh.map_err(|why| {
                let message = format!("its {} compressed bytes can't be decoded: {why}", bytes.len());
                Fault::new(message).help("the file may be damaged").at(format!("/bufferViews/{index}"))
            })
        });
        mesh.as_ref().map_err(Clone::clone)
    }

    fn bytes_read(&self) -> usize {
        let read = self.buffers.iter().filter_map(|cell| cell.get()?.as_ref().ok()).map(|bytes| bytes.len());
        read.fold(0, usize::saturating_add)
    }

    fn bytes_of_meshes(&self) -> usize {
        let meshes = self.meshes.iter().filter_map(|cell| cell.get()?.as_ref().ok()).map(draco::Mesh::bytes);
        meshes.fold(0, usize::saturating_add)
    }

    /// The number of bytes that were read or decoded so far.
    pub(super) fn size(&self) -> usize {
        self.size.get()
    }

    fn count(&self, bytes: usize) {
        self.size.set(self.size.get().saturating_add(bytes));
    }

    /// Checks that the bytes of a buffer are there.
    pub(super) fn check(&self, index: usize) -> Result<(), Fault> {
        self.buffer(index as Index).map(|_| ())
    }

    /// Whether a buffer view has bytes at all, read or not.
    pub(super) fn has_bytes(&self, index: Index) -> bool {
        let view = self.document.buffer_views.get(index as usize);
        let buffer = view.map(|view| view.extensions.compressed().map_or(view.buffer, |(view, _)| view.buffer));
        let uri = buffer.and_then(|buffer| Some((buffer, &self.document.buffers.get(buffer as usize)?.uri)));
        uri.is_some_and(|(buffer, uri)| uri.is_some() || buffer == 0 && self.binary_chunk.is_some())
    }

    /// The first bytes of a buffer view that isn't compressed, and whether they are all; none if it has no bytes.
    pub(super) fn start(&self, index: usize) -> Option<Result<(Vec<u8>, bool), Fault>> {
        let view = self.document.buffer_views.get(index)?;
        if view.extensions.compressed().is_some() || !self.has_bytes(index as Index) {
            return None;
        }
        let bytes = self.view(index as Index).map(|view| view.bytes);
        Some(bytes.map(|bytes| (bytes[..bytes.len().min(STARTS)].to_vec(), bytes.len() <= STARTS)))
    }

    fn buffer(&self, index: Index) -> Result<&[u8], Fault> {
        let cell = self
            .buffers
            .get(index as usize)
            .ok_or_else(|| Fault::missing("buffer", index, self.document.buffers.len()))?;
        let read = cell.get_or_init(|| {
            let read = self.read(index).inspect(|bytes| self.count(bytes.len()));
            read.map_err(|fault| fault.at(format!("/buffers/{index}")))
        });
        read.as_deref().map_err(Clone::clone)
    }

    fn read(&self, index: Index) -> Result<Cow<'a, [u8]>, Fault> {
        let buffer = &self.document.buffers[index as usize];
        let bytes = match &buffer.uri {
            Some(uri) => self.files.bytes(uri).map_err(|fault| fault.at("/uri"))?,
            None if index == 0 => {
                let chunk = self
                    .binary_chunk
                    .ok_or_else(|| Fault::new("it has no uri, and there is no binary chunk to hold its bytes"))?;
                Cow::Borrowed(chunk)
            }
            None => return Err(Fault::new("it has no uri, though only the first buffer may be the binary chunk")),
        };
        if bytes.len() < buffer.byte_length {
            let message = format!("is {}, but there are {} bytes only", buffer.byte_length, bytes.len());
            return Err(Fault::new(message).at("/byteLength").help("the file may have been cut off"));
        }
        let length = buffer.byte_length;
        Ok(match bytes {
            Cow::Borrowed(bytes) => Cow::Borrowed(&bytes[..length]),
            Cow::Owned(mut bytes) => {
                bytes.truncate(length);
                Cow::Owned(bytes)
            }
        })
    }
}

impl Files<'_> {
    /// The bytes of a URI: those that it holds, or those of a file beside the document.
    pub(super) fn bytes<'b>(&self, uri: &str) -> Result<Cow<'b, [u8]>, Fault> {
        match data(uri) {
            Some(bytes) => bytes.map(Cow::Owned),
            None => Ok(Cow::Owned(self.file(uri)?.bytes)),
        }
    }

    /// The first bytes of what a URI names, and whether they are all.
    pub(super) fn start(&self, uri: &str) -> Result<(Vec<u8>, bool), Fault> {
        // Four characters of Base64 are three bytes.
        const CHARACTERS: usize = STARTS / 3 * 4;
        if let Some((header, text)) = uri.split_once(',').filter(|_| is_data(uri)) {
            let is_all = text.len() <= CHARACTERS;
            let short = text.get(..CHARACTERS).filter(|_| !is_all && header.ends_with("base64"));
            let bytes = short.map_or_else(|| self.bytes(uri), |text| self.bytes(&format!("{header},{text}")));
            return bytes.map(|bytes| (bytes.into_owned(), short.is_none()));
        }
        if is_data(uri) {
            return self.bytes(uri).map(|bytes| (bytes.into_owned(), true));
        }
        let path = file_name(uri)?;
        let file = self.assets.open(&path, self.from).map_err(|error| Fault::of(&error, error.help()))?;
        let (view, mut buffer) = (file.content.view(), Vec::new());
        let bytes = view.piece(0..STARTS, &mut buffer).map(<[u8]>::to_vec);
        let bytes = bytes.map_err(|error| Fault::new(format!("it can't be read: {}", reason(&error))))?;
        Ok((bytes, view.size() <= STARTS))
    }

    /// The file that a URI names.
    pub(super) fn file(&self, uri: &str) -> Result<crate::assets::Asset, Fault> {
        let path = file_name(uri)?;
        self.assets.read(&path, self.from).map_err(|error| Fault::of(&error, error.help()))
    }
}

/// The path that a relative URI reference (RFC 3986) names.
fn file_name(uri: &str) -> Result<String, Fault> {
    let scheme = uri.split_once(':').map(|(scheme, _)| scheme);
    let is_scheme = |word: &str| {
        word.len() > 1
            && word.starts_with(|c: char| c.is_ascii_alphabetic())
            && word.bytes().all(|b| b.is_ascii_alphanumeric() || matches!(b, b'+' | b'-' | b'.'))
    };
    if let Some(scheme) = scheme.filter(|scheme| is_scheme(scheme)) {
        let message = format!("{:?} isn't read: its scheme is {scheme}", shortened(uri));
        return Err(Fault::new(message).help("files beside the model are read, and data: URIs; nothing is downloaded"));
    }
    percent_decoded(uri)
        .ok_or_else(|| Fault::new(format!("{:?} has a percent sign that no character follows", shortened(uri))))
}

/// How many first bytes of a picture tell its format.
const STARTS: usize = 96;

fn is_data(uri: &str) -> bool {
    uri.get(..5).is_some_and(|start| start.eq_ignore_ascii_case("data:"))
}

fn shortened(uri: &str) -> String {
    uri.chars().take(80).collect()
}

/// The text with its percent-encoded bytes decoded (RFC 3986, 2.1).
fn percent_decoded(text: &str) -> Option<String> {
    let mut bytes = Vec::with_capacity(text.len());
    let mut rest = text.as_bytes();
    while let Some((&byte, after)) = rest.split_first() {
        if byte != b'%' {
            bytes.push(byte);
            rest = after;
            continue;
        }
        let digits = after.get(..2).and_then(|digits| std::str::from_utf8(digits).ok())?;
        bytes.push(u8::from_str_radix(digits, 16).ok()?);
        rest = &after[2..];
    }
    String::from_utf8(bytes).ok()
}

/// Base64 with padding or without.
const BASE64: GeneralPurpose = GeneralPurpose::new(
    &base64::alphabet::STANDARD,
    GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent),
);

/// The bytes of a data URI (RFC 2397); none if it isn't one.
fn data(uri: &str) -> Option<Result<Vec<u8>, Fault>> {
    if !is_data(uri) {
        return None;
    }
    let damaged = |why: &str| Fault::new(format!("the data URI is damaged: {why}"));
    let Some((kind, data)) = uri[5..].split_once(',') else { return Some(Err(damaged("it has no comma"))) };
    if kind.rsplit(';').next().is_some_and(|word| word.trim().eq_ignore_ascii_case("base64")) {
        return Some(BASE64.decode(data.trim_ascii()).map_err(|e| damaged(&e.to_string())));
    }
    Some(percent_decoded(data).map(String::into_bytes).ok_or_else(|| damaged("a percent sign is alone")))
}
