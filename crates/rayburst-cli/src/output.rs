//! Where pictures go: formats, numbered sequences, and whether a path can be written at all.

use std::{
    fs::{self, OpenOptions},
    path::{Path, PathBuf},
};

use crate::error::{CliError, Result, shown};

/// What is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Format {
    /// 8-bit, tone-mapped.
    Png,
    /// Linear, with layers, can be resumed.
    Exr,
    /// Linear.
    Hdr,
    /// 8-bit, all frames in one file.
    Gif,
    /// All frames in one file, by ffmpeg.
    Mp4,
}

/// The formats and what their files end with.
const FORMATS: [(&str, Format); 5] = [
    ("png", Format::Png),
    ("exr", Format::Exr),
    ("hdr", Format::Hdr),
    ("gif", Format::Gif),
    ("mp4", Format::Mp4),
];

impl Format {
    /// What a path's ending asks for.
    pub(crate) fn of(path: &Path) -> Result<Self> {
        let ending = path.extension().map(|e| e.to_string_lossy().to_lowercase());
        let known: Vec<String> = FORMATS.iter().map(|(e, _)| format!(".{e}")).collect();
        FORMATS.iter().find(|(e, _)| Some(*e) == ending.as_deref()).map(|(_, f)| *f).ok_or_else(
            || {
                let name = shown(path);
                CliError::usage(format!(
                    "cannot tell the format of '{}' from its name; it must end in one of {}",
                    name.display(),
                    known.join(", ")
                ))
            },
        )
    }

    /// Whether one file holds all frames.
    pub(crate) fn is_film(self) -> bool {
        matches!(self, Self::Gif | Self::Mp4)
    }
}

/// Whether a path numbers its frames.
pub(crate) fn is_pattern(path: &Path) -> bool {
    let name = path.to_string_lossy();
    name.contains("{frame}") || name.contains("####")
}

/// The file of one frame: `{frame}` becomes the number, `####` the number with leading zeros.
pub(crate) fn frame_path(pattern: &Path, frame: u32) -> PathBuf {
    let name = pattern.to_string_lossy().replace("{frame}", &frame.to_string());
    let Some(start) = name.find("####") else { return name.into() };
    let width = name[start..].chars().take_while(|&c| c == '#').count();
    format!("{}{frame:0width$}{}", &name[..start], &name[start + width..]).into()
}

/// Fails now if a file could not be written later.
pub(crate) fn check_writable(path: &Path) -> Result<()> {
    let fail = |e: &std::io::Error| CliError::file("write", &shown(path), e);
    // What stands behind a link is written, as is a device or a pipe.
    let target = fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
    match fs::metadata(&target) {
        Ok(meta) if meta.is_dir() => {
            return Err(CliError::failed(format!("{} is a folder", shown(path).display())));
        }
        Ok(meta) if !meta.is_file() => {
            OpenOptions::new().write(true).open(&target).map_err(|e| fail(&e))?;
            return Ok(());
        }
        _ => {}
    }
    let name = target
        .file_name()
        .ok_or_else(|| CliError::failed(format!("{} names no file", shown(path).display())))?;
    let mut probe = std::ffi::OsString::from(".");
    probe.push(name);
    probe.push(format!(".{}.probe", std::process::id()));
    let probe = target.with_file_name(probe);
    OpenOptions::new().write(true).create_new(true).open(&probe).map_err(|e| fail(&e))?;
    fs::remove_file(&probe).map_err(|e| fail(&e))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_numbered() {
        let path = |p: &str, f| frame_path(Path::new(p), f).to_string_lossy().into_owned();
        assert_eq!(path("a/{frame}.png", 7), "a/7.png");
        assert_eq!(path("shot.####.exr", 12), "shot.0012.exr");
        assert_eq!(path("s######.png", 12), "s000012.png");
        assert!(is_pattern(Path::new("x{frame}.png")) && !is_pattern(Path::new("x#1.png")));
    }

    #[test]
    fn formats_come_from_names() {
        assert_eq!(Format::of(Path::new("A.PNG")).unwrap(), Format::Png);
        let error = Format::of(Path::new("a.jpg")).unwrap_err();
        assert_eq!(error.exit_code(), 2);
        assert!(error.to_string().contains(".png, .exr"));
    }

    #[test]
    fn what_cannot_be_written_is_found_early() {
        let folder = tempfile::tempdir().unwrap();
        check_writable(&folder.path().join("a.png")).unwrap();
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
        assert!(check_writable(folder.path()).is_err());
        let error = check_writable(&folder.path().join("no/a.png")).unwrap_err();
        assert!(error.to_string().contains("there is no such file or folder"), "{error}");
    }
}
