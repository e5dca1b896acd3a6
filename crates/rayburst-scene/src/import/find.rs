//! Files as OBJ and MTL name them: written on Windows, in any case, with folders of another machine.

use std::{
    collections::HashMap,
    fs,
    path::{Path, PathBuf},
};

use super::resolve::{ResolveError, Resolver};

/// Looks for files around one scene; remembers what folders hold.
#[derive(Debug)]
pub(crate) struct FileFinder<'a> {
    resolver: &'a Resolver,
    folder: PathBuf,
    /// For each folder, names as spelled by names in small letters.
    listings: HashMap<PathBuf, HashMap<String, String>>,
}

impl<'a> FileFinder<'a> {
    /// For files named in `scene`, relative to its folder.
    pub(crate) fn new(resolver: &'a Resolver, scene: &Path) -> Self {
        let folder = match scene.parent() {
            Some(parent) if !parent.as_os_str().is_empty() => parent.to_path_buf(),
            _ => PathBuf::from("."),
        };
        Self { resolver, folder, listings: HashMap::new() }
    }

    /// The file meant by `written` in a file that lies in `base`, a folder relative to the scene's.
    ///
    /// In turn: as written from `base`, from the scene's folder, both without regard to case, and
    /// last a file of that name beside the scene, for paths of another machine. The error is that
    /// of the first attempt.
    pub(crate) fn find(&mut self, base: &str, written: &str) -> Result<PathBuf, ResolveError> {
        let path = written.trim().replace('\\', "/");
        let path = path.trim_start_matches("./");
        let based = if base.is_empty() { path.to_owned() } else { format!("{base}/{path}") };
        let first = match self.resolver.resolve_path(&based) {
            Ok(found) => return Ok(found),
            Err(error) => error,
        };
        let name = path.rsplit('/').next().unwrap_or(path);
        for candidate in [based.as_str(), path, name] {
            if let Ok(found) = self.resolver.resolve_path(candidate) {
                return Ok(found);
            }
            if let Some(spelled) = self.respell(candidate)
                && let Ok(found) = self.resolver.resolve_path(&spelled)
            {
                return Ok(found);
            }
        }
        Err(first)
    }

    /// A relative path with each part spelled as on the disk.
    fn respell(&mut self, path: &str) -> Option<String> {
        let mut spelled: Vec<String> = Vec::new();
        for part in path.split('/') {
            match part {
                "" | "." => {}
                ".." => drop(spelled.pop()?),
                _ => {
                    let folder = self.folder.join(spelled.join("/"));
                    let listing = self.listings.entry(folder).or_insert_with_key(|f| list(f));
                    spelled.push(listing.get(&part.to_lowercase())?.clone());
                }
            }
        }
        (!spelled.is_empty()).then(|| spelled.join("/"))
    }
}

/// The names in a folder. Of several that differ in case only, the last in order is taken, so that
/// the choice is always the same.
fn list(folder: &Path) -> HashMap<String, String> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let mut names: Vec<String> =
        entries.filter_map(|entry| entry.file_name().into_string().ok()).collect();
    names.sort_unstable();
    names.into_iter().map(|name| (name.to_lowercase(), name)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn finds_files_however_they_are_written() {
        let dir = tempfile::tempdir().expect("temporary folder");
        let scene = dir.path().join("scene");
        fs::create_dir_all(scene.join("Textures/Wood")).expect("folders");
        fs::write(scene.join("Textures/Wood/Oak A.PNG"), b"").expect("file");
        fs::write(scene.join("stone.png"), b"").expect("file");
        fs::write(dir.path().join("secret.png"), b"").expect("file");
        let obj = scene.join("x.obj");
        let resolver = Resolver::new(&obj, false, 1 << 20).expect("resolver");
        let mut finder = FileFinder::new(&resolver, &obj);
        let oak = scene.join("Textures/Wood/Oak A.PNG");
        for written in [
            "Textures/Wood/Oak A.PNG",
            "textures\\wood\\oak a.png",
            ".\\Textures\\Wood\\Oak A.PNG",
            " TEXTURES/WOOD/../wood/OAK A.png",
        ] {
            assert_eq!(finder.find("", written).expect(written), oak, "{written}");
        }
        assert_eq!(finder.find("textures", "Wood/oak a.png").expect("based"), oak);
        let stone = scene.join("stone.png");
        for written in ["C:\\Users\\me\\Stone.png", "/home/me/stone.png", "../other/STONE.PNG"] {
            assert_eq!(finder.find("", written).expect(written), stone, "{written}");
        }
        assert_eq!(finder.find("Textures", "stone.png").expect("beside"), stone);
        assert!(finder.find("", "../secret.png").is_err());
        assert!(finder.find("", "missing.png").is_err());
        assert!(finder.find("", "").is_err());
    }
}
