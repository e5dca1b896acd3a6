//! Writes frames as the output's format asks.

use std::time::Instant;

use rayburst::image::{LayeredImage, RgbImage, write_exr, write_linear, write_png};

use super::plan::{Frame, Plan};
use crate::{develop::Developer, error::Result, movie::Movie, output::Format};

/// Where frames go.
pub(super) struct Writer {
    format: Format,
    developer: Developer,
    movie: Option<Movie>,
}

impl Writer {
    /// For the frames of a plan.
    pub(super) fn new(plan: &Plan, developer: Developer, size: (u32, u32)) -> Result<Self> {
        let movie = match plan.format {
            Format::Gif => Some(Movie::gif(&plan.output, plan.fps)),
            Format::Mp4 => Some(Movie::mp4(&plan.output, plan.fps, size)?),
            _ => None,
        };
        Ok(Self { format: plan.format, developer, movie })
    }

    /// Writes the picture of a frame, with its layers where the file can hold them, or adds it to the
    /// film.
    pub(super) fn write(
        &mut self,
        frame: &Frame,
        picture: impl FnOnce() -> RgbImage,
        layers: impl FnOnce() -> LayeredImage,
    ) -> Result<()> {
        match (self.format, &mut self.movie) {
            (Format::Exr, _) => Ok(write_exr(&frame.path, &layers())?),
            (Format::Hdr, _) => Ok(write_linear(&frame.path, &picture())?),
            (_, None) => Ok(write_png(&frame.path, &self.developer.develop(&picture()))?),
            (_, Some(movie)) => movie.add(self.developer.develop(&picture())),
        }
    }

    /// Ends a film of all frames; returns the seconds it took.
    pub(super) fn finish(self) -> Result<f64> {
        let start = Instant::now();
        if let Some(movie) = self.movie {
            movie.finish()?;
        }
        Ok(start.elapsed().as_secs_f64())
    }
}
