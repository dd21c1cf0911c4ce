//! NPZ, NumPy's files of several arrays: a ZIP archive with an NPY file for each (PKWARE, *APPNOTE*, 6.3.10).

use crate::import::lines::ImportError;
use canaletto::memory;
use flate2::Crc;
use flate2::read::DeflateDecoder;
use std::borrow::Cow;
use std::io::Read;

/// The first bytes of an archive.
pub(super) const MAGIC: &[u8] = b"PK";

/// An array in an archive.
struct Member<'a> {
    name: String,
    method: u16,
    is_encrypted: bool,
    crc: u32,
    /// The bytes as they are stored, and their number once inflated.
    stored: &'a [u8],
    size: u64,
}

fn u16_at(bytes: &[u8], at: usize) -> Option<u16> {
    bytes.get(at..)?.first_chunk().map(|bytes| u16::from_le_bytes(*bytes))
}

fn u32_at(bytes: &[u8], at: usize) -> Option<u32> {
    bytes.get(at..)?.first_chunk().map(|bytes| u32::from_le_bytes(*bytes))
}

fn u64_at(bytes: &[u8], at: usize) -> Option<u64> {
    bytes.get(at..)?.first_chunk().map(|bytes| u64::from_le_bytes(*bytes))
}

/// The NPY file of an array in an archive: the one of this name, or the only one.
pub(super) fn array<'a>(bytes: &'a [u8], wanted: Option<&str>) -> Result<Cow<'a, [u8]>, ImportError> {
    let damaged = || ImportError::file("the archive is damaged or cut off").help("np.savez writes such files");
    let members = members(bytes).ok_or_else(damaged)?;
    let names: Vec<&str> = members.iter().take(12).map(|member| member.name.as_str()).collect();
    let found = match wanted {
        Some(wanted) => members.iter().find(|member| member.name == wanted),
        None if members.len() == 1 => members.first(),
        None if members.is_empty() => return Err(ImportError::file("there are no arrays in it")),
        None => {
            return Err(ImportError::file(format!("it has {} arrays", members.len()))
                .help(format!("choose one with array=\"…\": {}", names.join(", "))));
        }
    };
    let member = found.ok_or_else(|| {
        ImportError::file(format!("there is no array \"{}\" in it", wanted.unwrap_or_default()))
            .help(format!("its arrays are {}", names.join(", ")))
    })?;
    let about = |what: String| ImportError::file(format!("array \"{}\" {what}", member.name));
    if member.is_encrypted {
        return Err(about("is encrypted".into()));
    }
    match member.method {
        0 if member.stored.len() as u64 == member.size && sum(member.stored) == member.crc => {
            Ok(Cow::Borrowed(member.stored))
        }
        0 => Err(about("is damaged: its bytes don't give its checksum".into())),
        8 => inflated(member).map(Cow::Owned).map_err(|what| about(what.to_string())),
        other => Err(about(format!("is packed by method {other}; stored and deflated ones are read"))),
    }
}

fn sum(bytes: &[u8]) -> u32 {
    let mut crc = Crc::new();
    crc.update(bytes);
    crc.sum()
}

/// The bytes of a deflated array.
fn inflated(member: &Member) -> Result<Vec<u8>, String> {
    /// The largest factor by which deflated bytes grow (zlib's technical details).
    const MOST_GROWTH: u64 = 1032;
    if member.size > (member.stored.len() as u64 + 1) * MOST_GROWTH {
        return Err("is damaged: its packed bytes can't hold as many as it declares".into());
    }
    memory::room(member.size).map_err(|e| e.to_string())?;
    let mut bytes = Vec::new();
    let read = DeflateDecoder::new(member.stored).take(member.size + 1).read_to_end(&mut bytes);
    if read.is_err() || bytes.len() as u64 != member.size || sum(&bytes) != member.crc {
        return Err("is damaged: its packed bytes don't give what it declares".into());
    }
    Ok(bytes)
}

/// The NPY files of the archive's directory.
fn members(bytes: &[u8]) -> Option<Vec<Member<'_>>> {
    // The end of the directory stands before a remark of at most 65,535 bytes.
    let from = bytes.len().saturating_sub(22 + 65535);
    let end = memchr::memmem::rfind(&bytes[from..], b"PK\x05\x06")? + from;
    let count = u16_at(bytes, end + 10)?;
    let mut at = u32_at(bytes, end + 16)? as usize;
    let mut members = Vec::new();
    for _ in 0..count {
        if bytes.get(at..)?.get(..4)? != b"PK\x01\x02" {
            return None;
        }
        let [name_length, extra_length, remark_length] = [28, 30, 32].map(|place| u16_at(bytes, at + place));
        let (name_length, extra_length) = (usize::from(name_length?), usize::from(extra_length?));
        let name = bytes.get(at + 46..)?.get(..name_length)?;
        let extra = bytes.get(at + 46 + name_length..)?.get(..extra_length)?;
        let [packed, size, start] = long_numbers([20, 24, 42].map(|place| u32_at(bytes, at + place)), extra)?;
        if let Some(name) = name.strip_suffix(b".npy") {
            let local = usize::try_from(start).ok()?;
            // The names of local headers may be followed by other extra fields than those of the directory.
            let skip =
                30 + usize::from(u16_at(bytes, local.checked_add(26)?)?) + usize::from(u16_at(bytes, local + 28)?);
            members.push(Member {
                name: String::from_utf8_lossy(name).into_owned(),
                method: u16_at(bytes, at + 10)?,
                is_encrypted: u16_at(bytes, at + 8)? & 1 == 1,
                crc: u32_at(bytes, at + 16)?,
                stored: bytes.get(local + skip..)?.get(..usize::try_from(packed).ok()?)?,
                size,
            });
        }
        at += 46 + name_length + extra_length + usize::from(remark_length?);
    }
    Some(members)
}

/// The sizes and the place of a member. Those that 32 bits can't hold stand in the extra field 1 (ZIP64), size first.
fn long_numbers([packed, size, start]: [Option<u32>; 3], extra: &[u8]) -> Option<[u64; 3]> {
    let mut long = None;
    let mut at = 0;
    while let (Some(id), Some(length)) = (u16_at(extra, at), u16_at(extra, at + 2)) {
        if id == 1 {
            long = extra.get(at + 4..).and_then(|rest| rest.get(..usize::from(length)));
        }
        at += 4 + usize::from(length);
    }
    let mut next = 0;
    let mut number = |short: u32| {
        if short != u32::MAX {
            return Some(u64::from(short));
        }
        next += 8;
        u64_at(long?, next - 8)
    };
    let size = number(size?)?;
    let packed = number(packed?)?;
    Some([packed, size, number(start?)?])
}
