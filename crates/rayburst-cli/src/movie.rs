//! Files that hold all frames of a sequence.

use std::{
    fs,
    io::{Read as _, Write as _},
    path::{Path, PathBuf},
    process::{Child, ChildStdin, Command, Stdio},
};

use rayburst::image::{Rgb8Image, file::gif::write_gif};

use crate::error::{CliError, Result, describe};

/// A film of 8-bit frames.
pub(crate) enum Movie {
    /// The frames so far: they share one palette, which is found at the end.
    Gif { path: PathBuf, fps: f32, frames: Vec<Rgb8Image> },
    /// Handed to an encoder one by one.
    Mp4(Encoder),
}

impl Movie {
    /// Begins a GIF.
    pub(crate) fn gif(path: &Path, fps: f32) -> Self {
        Self::Gif { path: path.to_owned(), fps, frames: Vec::new() }
    }

    /// Begins an MP4.
    pub(crate) fn mp4(path: &Path, fps: f32, size: (u32, u32)) -> Result<Self> {
        Encoder::start(path, fps, size).map(Self::Mp4)
    }

    /// Adds a frame.
    pub(crate) fn add(&mut self, frame: Rgb8Image) -> Result<()> {
        match self {
            Self::Gif { frames, .. } => {
                frames.push(frame);
                Ok(())
            }
            Self::Mp4(encoder) => encoder.add(&frame),
        }
    }

    /// Ends the file.
    pub(crate) fn finish(self) -> Result<()> {
        match self {
            Self::Gif { frames, .. } if frames.is_empty() => {
                Err(CliError::failed("stopped before the first frame: there is no film"))
            }
            Self::Gif { path, fps, frames } => Ok(write_gif(&path, &frames, fps)?),
            Self::Mp4(encoder) => encoder.finish(),
        }
    }
}

/// An installed ffmpeg that encodes H.264.
pub(crate) struct Encoder {
    child: Child,
    input: Option<ChildStdin>,
    part: PathBuf,
    path: PathBuf,
}

impl Encoder {
    /// Starts the encoder; the file appears under its name only when all frames are in.
    fn start(path: &Path, fps: f32, (width, height): (u32, u32)) -> Result<Self> {
        let mut name = std::ffi::OsString::from(".");
        name.push(path.file_name().unwrap_or_default());
        name.push(format!(".{}-0.part", std::process::id()));
        let part = path.with_file_name(name);
        let mut command = Command::new("ffmpeg");
        command
            .args(["-loglevel", "error", "-nostdin", "-y", "-f", "rawvideo", "-pix_fmt", "rgb24"])
            .args(["-s", &format!("{width}x{height}"), "-r", &fps.to_string(), "-i", "-"])
            // H.264 in 4:2:0 needs even sides.
            .args(["-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2", "-c:v", "libx264", "-crf", "16"])
            .args(["-pix_fmt", "yuv420p", "-movflags", "+faststart", "-f", "mp4"])
            .arg(&part)
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .stderr(Stdio::piped());
        // Ctrl-C is for us: the encoder still has to end its file.
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        let mut child = command.spawn().map_err(|e| {
            CliError::failed(if e.kind() == std::io::ErrorKind::NotFound {
                "an .mp4 needs ffmpeg, which is not installed; write .gif or numbered .png files"
                    .to_owned()
            } else {
                format!("cannot start ffmpeg: {}", describe(&e))
            })
        })?;
        let input = child.stdin.take();
        Ok(Self { child, input, part, path: path.to_owned() })
    }

    fn add(&mut self, frame: &Rgb8Image) -> Result<()> {
        let written = match &mut self.input {
            Some(input) => input.write_all(&frame.data),
            None => Ok(()),
        };
        written.map_err(|_| self.complaint())
    }

    fn finish(mut self) -> Result<()> {
        drop(self.input.take());
        let status = self.child.wait();
        if !status.is_ok_and(|s| s.success()) {
            return Err(self.complaint());
        }
        fs::rename(&self.part, &self.path).map_err(|e| CliError::file("write", &self.path, &e))
    }

    /// What the encoder says.
    fn complaint(&mut self) -> CliError {
        drop(self.input.take());
        let mut text = String::new();
        if let Some(mut stderr) = self.child.stderr.take() {
            // Without its words the failure is still told.
            let _ = stderr.read_to_string(&mut text);
        }
        let text = text.lines().last().unwrap_or("it gave no reason").to_owned();
        CliError::failed(format!("ffmpeg cannot write {}: {text}", self.path.display()))
    }
}

impl Drop for Encoder {
    fn drop(&mut self) {
        drop(self.input.take());
        // Both fail only where there is nothing to end or to remove any more.
        let _ = self.child.wait();
        let _ = fs::remove_file(&self.part);
    }
}
