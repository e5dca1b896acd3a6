//! Files that appear whole or not at all.
//!
//! The bytes go to a temporary file beside the target, which is renamed over it only when every
//! byte is on the disk: a full disk, a crash or Ctrl-C leaves the old file as it was.

use std::fs::{self, File, OpenOptions};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};

use crate::{ImageError, Result};

/// Writes `path` through `write`; on any error nothing is left behind and an existing file stays.
///
/// Devices and pipes (`/dev/stdout`) are written directly: renaming over them would replace them.
pub fn atomic_write(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>,
) -> Result<()> {
    write_through(path, write).map_err(|source| ImageError::Write { path: path.to_owned(), source })
}

fn write_through(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>,
) -> io::Result<()> {
    // A link keeps pointing where it points; what it points to is replaced.
    let target = fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
    match fs::metadata(&target) {
        Ok(meta) if meta.is_dir() => return Err(io::ErrorKind::IsADirectory.into()),
        Ok(meta) if !meta.is_file() => {
            let mut file = BufWriter::new(OpenOptions::new().write(true).open(&target)?);
            write(&mut file)?;
            return file.flush();
        }
        _ => {}
    }
    let (temporary, file) = create_beside(&target)?;
    let guard = RemoveOnDrop(Some(temporary));
    let mut file = BufWriter::new(file);
    write(&mut file)?;
    let file = file.into_inner().map_err(io::IntoInnerError::into_error)?;
    // Some file systems report a full disk only here.
    file.sync_all()?;
    drop(file);
    guard.rename_to(&target)
}

fn create_beside(target: &Path) -> io::Result<(PathBuf, File)> {
    static COUNTER: AtomicU32 = AtomicU32::new(0);
    let name = target
        .file_name()
        .ok_or_else(|| io::Error::new(io::ErrorKind::InvalidInput, "the path names no file"))?;
    loop {
        let mut hidden = std::ffi::OsString::from(".");
        hidden.push(name);
        let unique = COUNTER.fetch_add(1, Ordering::Relaxed);
        hidden.push(format!(".{}-{unique}.part", std::process::id()));
        let temporary = target.with_file_name(hidden);
        match OpenOptions::new().read(true).write(true).create_new(true).open(&temporary) {
            Err(e) if e.kind() == io::ErrorKind::AlreadyExists => {}
            other => return other.map(|file| (temporary, file)),
        }
    }
}

struct RemoveOnDrop(Option<PathBuf>);

impl RemoveOnDrop {
    fn rename_to(mut self, target: &Path) -> io::Result<()> {
        if let Some(temporary) = &self.0 {
            fs::rename(temporary, target)?;
        }
        self.0 = None;
        Ok(())
    }
}

impl Drop for RemoveOnDrop {
    fn drop(&mut self) {
        if let Some(temporary) = &self.0 {
            // Already failing: the first error is the one worth telling.
            let _ = fs::remove_file(temporary);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failed_write_leaves_the_old_file_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("picture.png");
        atomic_write(&path, |w| w.write_all(b"old")).unwrap();
        let full = |w: &mut BufWriter<File>| {
            w.write_all(&[7; 100_000])?;
            Err(io::ErrorKind::StorageFull.into())
        };
        let text = atomic_write(&path, full).unwrap_err().to_string();
        assert!(text.contains("picture.png") && text.contains("free some space"), "{text}");
        assert_eq!(fs::read(&path).unwrap(), b"old");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
        atomic_write(&path, |w| w.write_all(b"new")).unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"new");
    }

    #[test]
    fn folders_that_do_not_exist_and_folders_as_targets_are_errors() {
        let folder = tempfile::tempdir().unwrap();
        let missing = folder.path().join("nowhere").join("a.png");
        let text = atomic_write(&missing, |_| Ok(())).unwrap_err().to_string();
        assert!(text.contains("does the folder exist"), "{text}");
        assert!(atomic_write(folder.path(), |_| Ok(())).is_err());
        assert!(atomic_write(Path::new("/"), |_| Ok(())).is_err());
        assert!(atomic_write(Path::new(""), |_| Ok(())).is_err());
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_device_is_written_to_and_not_replaced() {
        use std::os::unix::fs::FileTypeExt;
        let full = Path::new("/dev/full");
        assert!(atomic_write(full, |w| w.write_all(&[0; 1 << 16])).is_err());
        assert!(fs::metadata(full).unwrap().file_type().is_char_device());
        atomic_write(Path::new("/dev/null"), |w| w.write_all(b"x")).unwrap();
        assert!(fs::metadata("/dev/null").unwrap().file_type().is_char_device());
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_folder_that_no_one_may_write_to_is_an_error() {
        // Not even root may create files here.
        let text = atomic_write(Path::new("/proc/a.png"), |_| Ok(())).unwrap_err().to_string();
        assert!(text.starts_with("cannot write /proc/a.png: "), "{text}");
    }

    #[cfg(unix)]
    #[test]
    fn links_are_followed() {
        let folder = tempfile::tempdir().unwrap();
        let (real, link) = (folder.path().join("real"), folder.path().join("link"));
        fs::write(&real, "a").unwrap();
        std::os::unix::fs::symlink(&real, &link).unwrap();
        atomic_write(&link, |w| w.write_all(b"b")).unwrap();
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        assert_eq!(fs::read(&real).unwrap(), b"b");
    }
}
