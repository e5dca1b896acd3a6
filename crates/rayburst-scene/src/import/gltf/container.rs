//! The two containers of glTF 2.0: plain JSON, and GLB (section 4) with its binary chunk.

use std::{ops::Range, path::Path};

use super::json::Root;
use crate::import::ImportError;

const MAGIC: &[u8; 4] = b"glTF";
const JSON_CHUNK: u32 = u32::from_le_bytes(*b"JSON");
const BINARY_CHUNK: u32 = u32::from_le_bytes(*b"BIN\0");

/// Parses a file; with a GLB comes the range of its binary chunk.
pub(super) fn parse(
    path: &Path,
    bytes: &[u8],
) -> Result<(Root, Option<Range<usize>>), ImportError> {
    let (json, binary) =
        if bytes.starts_with(MAGIC) { split_glb(path, bytes)? } else { (0..bytes.len(), None) };
    let text = bytes[json.clone()].strip_prefix(b"\xef\xbb\xbf").unwrap_or(&bytes[json.clone()]);
    let root: Root = serde_json::from_slice(text).map_err(|e| {
        let chunk = if json.start == 0 { "" } else { "JSON chunk, " };
        let location = format!("{chunk}line {}, column {}", e.line(), e.column());
        // The message ends with the position that `location` has told.
        let message = e.to_string();
        let reason = message.split(" at line ").next().unwrap_or(&message);
        ImportError::malformed(path, location, format!("not valid glTF JSON: {reason}"))
    })?;
    check_version(path, &root)?;
    Ok((root, binary))
}

fn split_glb(
    path: &Path,
    bytes: &[u8],
) -> Result<(Range<usize>, Option<Range<usize>>), ImportError> {
    let word = |at: usize| {
        let end = at.checked_add(4)?;
        Some(u32::from_le_bytes(bytes.get(at..end)?.try_into().ok()?))
    };
    let bad = |at: usize, reason: String| {
        Err(ImportError::malformed(path, format!("GLB, byte {at}"), reason))
    };
    let (Some(version), Some(length)) = (word(4), word(8)) else {
        return bad(0, "the header is cut off".into());
    };
    if version != 2 {
        return bad(4, format!("container version {version}; only glTF 2.0 is read"));
    }
    let end = length as usize;
    if end > bytes.len() {
        let reason = format!("the header says {end} bytes, the file has {}", bytes.len());
        return bad(8, format!("{reason}: it is cut off"));
    }
    let (mut json, mut binary) = (None, None);
    let mut at = 12;
    while at < end {
        let (Some(size), Some(kind)) = (word(at), word(at + 4)) else {
            return bad(at, "a chunk header is cut off".into());
        };
        let start = at + 8;
        let Some(stop) = start.checked_add(size as usize).filter(|&stop| stop <= end) else {
            return bad(at, format!("a chunk of {size} bytes goes beyond the file's end"));
        };
        match kind {
            JSON_CHUNK if json.is_none() => json = Some(start..stop),
            BINARY_CHUNK if binary.is_none() && json.is_some() => binary = Some(start..stop),
            // Readers skip chunks that they do not know.
            _ => {}
        }
        // Chunks are padded; a writer that leaves the last one unpadded does no harm.
        at = stop.next_multiple_of(4);
    }
    match json {
        Some(json) => Ok((json, binary)),
        None => bad(12, "there is no JSON chunk".into()),
    }
}

fn check_version(path: &Path, root: &Root) -> Result<(), ImportError> {
    let too_new = root.asset.min_version.as_deref().is_some_and(|v| v != "2.0");
    let version = if too_new { root.asset.min_version.as_ref() } else { None };
    let version = version.unwrap_or(&root.asset.version);
    if too_new || !version.starts_with("2.") {
        let reason = if version.is_empty() {
            "no glTF version is given; is this a glTF file?".to_owned()
        } else {
            format!("glTF version {version:.20}; only 2.0 is read")
        };
        return Err(ImportError::malformed(path, "/asset", reason));
    }
    Ok(())
}
