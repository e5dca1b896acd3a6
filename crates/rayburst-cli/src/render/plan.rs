//! Which frames at which times go to which files.

use std::path::{Path, PathBuf};

use crate::{
    args::render::RenderArgs,
    error::{CliError, Result},
    output::{self, Format},
    terminal,
};

/// Frames a second unless told otherwise.
const DEFAULT_FPS: f32 = 24.0;

/// What is rendered and where it goes.
pub(super) struct Plan {
    pub(super) format: Format,
    pub(super) output: PathBuf,
    pub(super) fps: f32,
    pub(super) frames: Vec<Frame>,
    sequence: bool,
}

/// One picture.
pub(super) struct Frame {
    pub(super) number: u32,
    /// Seconds in the animation; `None` is the scene as authored.
    pub(super) time: Option<f32>,
    /// Its file, or that of all frames.
    pub(super) path: PathBuf,
    format: Format,
}

impl Frame {
    /// Whether its file can be continued later.
    pub(super) fn keeps_state(&self) -> bool {
        self.format == Format::Exr
    }

    /// Says that it is lost.
    pub(super) fn tell_unfinished(&self) {
        terminal::note(format!("frame {} is not finished, nothing of it is kept", self.number));
    }
}

impl Plan {
    /// Checks that the options fit together.
    pub(super) fn new(args: &RenderArgs) -> Result<Self> {
        let format = Format::of(&args.output)?;
        let numbered = output::is_pattern(&args.output);
        let wrong = |message: String| Err(CliError::usage(message));
        if args.aov.is_some() && format != Format::Exr {
            return wrong(format!(
                "--aov writes layers, which {} cannot hold; use -o NAME.exr",
                args.output.display()
            ));
        }
        if args.frames.is_none() && args.fps.is_some() {
            return wrong("--fps needs --frames FIRST..LAST".into());
        }
        match &args.frames {
            Some(_) if args.scene.instant.time.is_some() => {
                return wrong("--frames and --time exclude each other".into());
            }
            Some(_) if !numbered && !format.is_film() => {
                return wrong(
                    "a sequence needs {frame} or #### in the output's name, or .gif or .mp4".into(),
                );
            }
            None if numbered || format.is_film() => {
                return wrong("a sequence needs --frames FIRST..LAST".into());
            }
            _ => {}
        }
        if args.resume && (format.is_film() || (format != Format::Exr && !numbered)) {
            return wrong(format!(
                "--resume continues an .exr or a sequence of pictures, not {}",
                args.output.display()
            ));
        }
        let fps = args.fps.unwrap_or(DEFAULT_FPS);
        let path = |number| {
            if numbered { output::frame_path(&args.output, number) } else { args.output.clone() }
        };
        let frame = |number: u32, time| Frame { number, time, path: path(number), format };
        let frames = match &args.frames {
            None => vec![frame(0, args.scene.instant.time)],
            Some(range) => range
                .clone()
                .map(|n| frame(n, Some((f64::from(n) / f64::from(fps)) as f32)))
                .collect(),
        };
        Ok(Self {
            format,
            output: args.output.clone(),
            fps,
            frames,
            sequence: args.frames.is_some(),
        })
    }

    /// Whether there may be several frames.
    pub(super) fn is_sequence(&self) -> bool {
        self.sequence
    }

    /// Fails now if the files could not be written later.
    pub(super) fn check_writable(&self) -> Result<()> {
        let first = self.frames.first().map_or(Path::new(""), |f| f.path.as_path());
        output::check_writable(first)
    }

    /// What stands before the progress bar.
    pub(super) fn frame_label(&self, frame: &Frame) -> String {
        let last = self.frames.last().map_or(0, |f| f.number);
        if self.sequence { format!("frame {} of {last} ", frame.number) } else { String::new() }
    }
}
