//! References from a scene to other files: what they may reach, and their bytes.
//!
//! A scene from elsewhere is not trusted: it reads files of its own folder only (links are
//! followed before the check), never devices or pipes, and never the network.

use std::{
    fs::{self, File},
    io::{self, Read},
    path::{Component, Path, PathBuf},
};

use base64::{
    Engine,
    engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig},
};

/// Why a reference cannot be followed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ResolveError {
    /// It leaves the scene's folder.
    #[error("'{uri}' leaves the scene's folder; external files are not allowed")]
    Outside {
        /// The reference.
        uri: String,
    },
    /// It names something on a network.
    #[error("'{uri}' is not a file; remote resources are never fetched, download it first")]
    Remote {
        /// The reference.
        uri: String,
    },
    /// It is not a well-formed URI.
    #[error("'{uri}' is not a valid URI: {reason}")]
    Invalid {
        /// The reference, shortened.
        uri: String,
        /// What is wrong.
        reason: String,
    },
    /// The operating system refused.
    #[error("cannot read {}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// There is more than may be read.
    #[error("{what} exceeds the limit of {limit} bytes")]
    TooLarge {
        /// What is too large, with its size.
        what: String,
        /// The limit.
        limit: u64,
    },
}

/// Follows references relative to one scene's folder.
#[derive(Clone, Debug)]
pub struct Resolver {
    folder: PathBuf,
    canonical: PathBuf,
    allow_external: bool,
    max_bytes: u64,
}

impl Resolver {
    /// For the references of `scene`, a path to a file.
    pub fn new(scene: &Path, allow_external: bool, max_bytes: u64) -> io::Result<Self> {
        let folder = match scene.parent() {
            Some(parent) if !parent.as_os_str().is_empty() => parent.to_path_buf(),
            _ => PathBuf::from("."),
        };
        let canonical = folder.canonicalize()?;
        Ok(Self { folder, canonical, allow_external, max_bytes })
    }

    /// The bytes behind a URI reference as glTF has them: relative, percent-encoded, or `data:`.
    pub fn read_uri(&self, uri: &str) -> Result<Vec<u8>, ResolveError> {
        match strip_scheme(uri, "data:") {
            Some(data) => self.decode_data(data),
            None => self.read(&self.resolve_uri(uri)?),
        }
    }

    /// The file behind a URI reference that is not `data:`.
    pub fn resolve_uri(&self, uri: &str) -> Result<PathBuf, ResolveError> {
        let invalid =
            |reason: &str| ResolveError::Invalid { uri: shorten(uri), reason: reason.to_owned() };
        if let Some(rest) = strip_scheme(uri, "file:") {
            let path = rest.strip_prefix("//localhost").unwrap_or(rest);
            let path = path.strip_prefix("//").unwrap_or(path);
            let path = percent_decode(path).ok_or_else(|| invalid("bad percent-encoding"))?;
            return self.resolve_path(&path);
        }
        if uri.starts_with("//") || has_scheme(uri) {
            return Err(ResolveError::Remote { uri: shorten(uri) });
        }
        let path = percent_decode(uri).ok_or_else(|| invalid("bad percent-encoding"))?;
        match self.resolve_path(&path) {
            // Many writers do not encode: a file may really be called `100%25.png`.
            Err(ResolveError::Io { .. }) if path != uri => self.resolve_path(uri),
            result => result,
        }
    }

    /// The file behind a path as it stands, relative to the scene's folder, with `/` or the
    /// system's separator.
    pub fn resolve_path(&self, path: &str) -> Result<PathBuf, ResolveError> {
        let outside = || ResolveError::Outside { uri: shorten(path) };
        if path.is_empty() || path.contains('\0') {
            let reason = "it names no file".to_owned();
            return Err(ResolveError::Invalid { uri: shorten(path), reason });
        }
        let relative = Path::new(path);
        let full = self.folder.join(relative);
        if !self.allow_external && (escapes(relative) || is_drive(path)) {
            return Err(outside());
        }
        let io = |source| ResolveError::Io { path: full.clone(), source };
        let canonical = full.canonicalize().map_err(io)?;
        if !self.allow_external && !canonical.starts_with(&self.canonical) {
            return Err(outside());
        }
        let metadata = fs::metadata(&canonical).map_err(io)?;
        if !metadata.is_file() {
            return Err(io(io::Error::other("it is not a regular file")));
        }
        Ok(full)
    }

    /// The bytes of a resolved file.
    pub fn read(&self, path: &Path) -> Result<Vec<u8>, ResolveError> {
        read_limited(path, self.max_bytes)
    }

    fn decode_data(&self, data: &str) -> Result<Vec<u8>, ResolveError> {
        let invalid = |reason: String| ResolveError::Invalid { uri: "data:…".to_owned(), reason };
        let (header, body) =
            data.split_once(',').ok_or_else(|| invalid("it has no comma".to_owned()))?;
        if body.len() as u64 / 4 * 3 > self.max_bytes {
            let what = format!("a data URI of {} characters", body.len());
            return Err(ResolveError::TooLarge { what, limit: self.max_bytes });
        }
        if !header.trim_end().to_ascii_lowercase().ends_with(";base64") {
            return Ok(percent_decode_bytes(body.as_bytes()));
        }
        let config =
            GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent);
        let engine = GeneralPurpose::new(&base64::alphabet::STANDARD, config);
        engine.decode(body.trim().as_bytes()).map_err(|e| invalid(e.to_string()))
    }
}

/// Reads a regular file of at most `max_bytes`.
pub fn read_limited(path: &Path, max_bytes: u64) -> Result<Vec<u8>, ResolveError> {
    let io = |source| ResolveError::Io { path: path.to_path_buf(), source };
    let metadata = fs::metadata(path).map_err(io)?;
    if !metadata.is_file() {
        return Err(io(io::Error::other("it is not a regular file")));
    }
    let too_large = |bytes: u64| ResolveError::TooLarge {
        what: format!("{} ({bytes} bytes)", path.display()),
        limit: max_bytes,
    };
    if metadata.len() > max_bytes {
        return Err(too_large(metadata.len()));
    }
    let mut bytes = Vec::with_capacity(metadata.len() as usize);
    let limit = max_bytes.saturating_add(1);
    File::open(path).map_err(io)?.take(limit).read_to_end(&mut bytes).map_err(io)?;
    if bytes.len() as u64 > max_bytes {
        return Err(too_large(bytes.len() as u64));
    }
    Ok(bytes)
}

/// Whether a path is absolute or climbs above its start.
fn escapes(path: &Path) -> bool {
    let mut depth = 0i64;
    for component in path.components() {
        match component {
            Component::Prefix(_) | Component::RootDir => return true,
            Component::ParentDir => depth -= 1,
            Component::CurDir => {}
            Component::Normal(_) => depth += 1,
        }
        if depth < 0 {
            return true;
        }
    }
    false
}

/// Whether a path begins with a Windows drive, on any system.
fn is_drive(path: &str) -> bool {
    matches!(path.as_bytes(), [letter, b':', ..] if letter.is_ascii_alphabetic())
}

/// Whether a URI begins with a scheme of two letters or more (one letter is a Windows drive).
fn has_scheme(uri: &str) -> bool {
    let Some((scheme, rest)) = uri.split_once(':') else { return false };
    let mut letters = scheme.chars();
    scheme.len() >= 2
        && letters.next().is_some_and(|c| c.is_ascii_alphabetic())
        && letters.all(|c| c.is_ascii_alphanumeric() || "+-.".contains(c))
        && (rest.starts_with("//") || !scheme.contains('.'))
}

fn strip_scheme<'a>(uri: &'a str, scheme: &str) -> Option<&'a str> {
    let head = uri.get(..scheme.len())?;
    head.eq_ignore_ascii_case(scheme).then(|| &uri[scheme.len()..])
}

/// Percent-decoded text; `None` if it is not UTF-8 then. A `%` without two digits stays.
fn percent_decode(text: &str) -> Option<String> {
    String::from_utf8(percent_decode_bytes(text.as_bytes())).ok()
}

fn percent_decode_bytes(text: &[u8]) -> Vec<u8> {
    let digit = |at: usize| text.get(at).and_then(|&c| (c as char).to_digit(16));
    let mut bytes = Vec::with_capacity(text.len());
    let mut at = 0;
    while let Some(&byte) = text.get(at) {
        match (byte, digit(at + 1), digit(at + 2)) {
            (b'%', Some(high), Some(low)) => {
                bytes.push((high * 16 + low) as u8);
                at += 3;
            }
            _ => {
                bytes.push(byte);
                at += 1;
            }
        }
    }
    bytes
}

/// At most 80 characters, for messages.
fn shorten(text: &str) -> String {
    if text.chars().count() <= 80 {
        return text.to_owned();
    }
    text.chars().take(77).chain("…".chars()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn folder() -> (tempfile::TempDir, Resolver) {
        let dir = tempfile::tempdir().unwrap();
        let scene = dir.path().join("scene");
        fs::create_dir_all(scene.join("textures")).unwrap();
        fs::write(scene.join("textures/a b.png"), b"inside").unwrap();
        fs::write(dir.path().join("secret"), b"outside").unwrap();
        let resolver = Resolver::new(&scene.join("scene.gltf"), false, 1 << 20).unwrap();
        (dir, resolver)
    }

    #[test]
    fn reads_files_of_the_folder_with_and_without_encoding() {
        let (_dir, resolver) = folder();
        for uri in ["textures/a%20b.png", "textures/a b.png", "./textures/../textures/a b.png"] {
            assert_eq!(resolver.read_uri(uri).unwrap(), b"inside", "{uri}");
        }
    }

    #[test]
    fn refuses_what_leaves_the_folder() {
        let (dir, resolver) = folder();
        let absolute = dir.path().join("secret").display().to_string();
        let file_uri = format!("file://{absolute}");
        let uris = ["../secret", "textures/../../secret", "%2e%2e/secret", "C:\\secret"];
        for uri in uris.iter().copied().chain([absolute.as_str(), file_uri.as_str()]) {
            let error = resolver.read_uri(uri).unwrap_err();
            assert!(matches!(error, ResolveError::Outside { .. }), "{uri}: {error}");
        }
        let trusting = Resolver { allow_external: true, ..resolver };
        for uri in ["../secret", absolute.as_str(), file_uri.as_str()] {
            assert_eq!(trusting.read_uri(uri).unwrap(), b"outside", "{uri}");
        }
    }

    #[cfg(unix)]
    #[test]
    fn refuses_links_that_leave_the_folder() {
        let (dir, resolver) = folder();
        let link = dir.path().join("scene/link");
        std::os::unix::fs::symlink(dir.path().join("secret"), link).unwrap();
        assert!(matches!(resolver.read_uri("link"), Err(ResolveError::Outside { .. })));
    }

    #[test]
    fn never_goes_to_the_network_or_to_folders() {
        let (_dir, resolver) = folder();
        let trusting = Resolver { allow_external: true, ..resolver };
        for uri in ["https://example.org/a.png", "HTTP://x/y", "//host/share/a.png", "ftp:x"] {
            let error = trusting.read_uri(uri).unwrap_err();
            assert!(matches!(error, ResolveError::Remote { .. }), "{uri}: {error}");
        }
        assert!(matches!(trusting.read_uri("textures"), Err(ResolveError::Io { .. })));
        assert!(matches!(trusting.read_uri(""), Err(ResolveError::Invalid { .. })));
    }

    #[test]
    fn decodes_data_uris_and_limits_them() {
        let (_dir, resolver) = folder();
        let read = |uri: &str| resolver.read_uri(uri);
        assert_eq!(read("data:application/octet-stream;base64,AQID").unwrap(), [1, 2, 3]);
        assert_eq!(read("data:;base64,AQI=").unwrap(), [1, 2]);
        assert_eq!(read("data:;base64,AQI").unwrap(), [1, 2]);
        assert_eq!(read("data:text/plain,a%20b").unwrap(), b"a b");
        assert!(matches!(read("data:;base64,####"), Err(ResolveError::Invalid { .. })));
        assert!(matches!(read("data:;base64"), Err(ResolveError::Invalid { .. })));
        let small = Resolver { max_bytes: 2, ..resolver.clone() };
        let error = small.read_uri("data:;base64,AQIDBAUG").unwrap_err();
        assert!(matches!(error, ResolveError::TooLarge { .. }), "{error}");
        let error = small.read_uri("textures/a b.png").unwrap_err();
        assert!(matches!(error, ResolveError::TooLarge { .. }), "{error}");
    }
}
