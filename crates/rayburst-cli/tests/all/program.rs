//! Running the program and judging what it leaves.

use std::{
    path::{Path, PathBuf},
    process::{Command, Output},
};

/// A folder of its own in which the program runs.
pub(crate) struct Place(tempfile::TempDir);

/// What a run left.
#[derive(Debug)]
pub(crate) struct Ran {
    pub(crate) code: Option<i32>,
    pub(crate) stdout: String,
    pub(crate) stderr: String,
}

/// The program with a clean environment.
pub(crate) fn command(folder: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_rayburst"));
    command.current_dir(folder).env_remove("RAYBURST_ISA").env_remove("RAYBURST_LOG");
    command
}

impl Place {
    pub(crate) fn new() -> Self {
        Self(tempfile::tempdir().expect("a temporary folder"))
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    pub(crate) fn folder(&self) -> &Path {
        self.0.path()
    }

    pub(crate) fn write(&self, name: &str, content: impl AsRef<[u8]>) {
        std::fs::write(self.path(name), content).expect("a file of the test");
    }

    pub(crate) fn read(&self, name: &str) -> Vec<u8> {
        std::fs::read(self.path(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
    }

    pub(crate) fn files(&self) -> Vec<String> {
        let entries = std::fs::read_dir(self.folder()).expect("the test's folder");
        let mut names: Vec<String> =
            entries.flatten().map(|e| e.file_name().to_string_lossy().into_owned()).collect();
        names.sort();
        names
    }

    /// Runs the program with words separated by blanks.
    pub(crate) fn run(&self, line: &str) -> Ran {
        Ran::new(command(self.folder()).args(line.split_whitespace()).output())
    }

    /// Runs it and expects success.
    pub(crate) fn good(&self, line: &str) -> Ran {
        let ran = self.run(line);
        assert_eq!(ran.code, Some(0), "{line}: {ran:?}");
        ran
    }

    /// Runs it and expects one clear line of complaint and no new file; returns the line.
    pub(crate) fn bad(&self, code: i32, line: &str) -> String {
        let before = self.files();
        let ran = self.run(line);
        assert_eq!(ran.code, Some(code), "{line}: {ran:?}");
        assert_eq!(self.files(), before, "{line} left files");
        ran.complaint(line)
    }
}

impl Ran {
    pub(crate) fn new(output: std::io::Result<Output>) -> Self {
        let output = output.expect("the program starts");
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        let ran = Self {
            code: output.status.code(),
            stdout: text(&output.stdout),
            stderr: text(&output.stderr),
        };
        assert!(!ran.stderr.contains("a bug in rayburst"), "{ran:?}");
        assert!(!ran.stderr.contains("panicked"), "{ran:?}");
        ran
    }

    /// The one line that begins with `error:`.
    pub(crate) fn complaint(&self, what: &str) -> String {
        let lines: Vec<&str> = self.stderr.lines().filter(|l| l.starts_with("error:")).collect();
        assert_eq!(lines.len(), 1, "{what}: {self:?}");
        assert!(self.stdout.is_empty(), "{what}: {self:?}");
        lines[0].to_owned()
    }

    /// The last line of stdout as JSON.
    pub(crate) fn json(&self) -> serde_json::Value {
        let last = self.stdout.lines().last().unwrap_or_default();
        serde_json::from_str(last).unwrap_or_else(|e| panic!("{e}: {last}"))
    }
}
