//! Animated GIF pictures: one palette for all frames, ordered dither that stands still.
//!
//! A palette of its own for each frame flickers, and so does error diffusion, whose pattern changes
//! everywhere when one pixel does. Pixels that stay are stored as transparent, which makes slow
//! animations small.

mod dither;
mod palette;

use std::io;
use std::path::Path;

use ::gif::{DisposalMethod, Encoder, Frame, Repeat};

use crate::file::atomic_write;
use crate::{ImageError, Result, Rgb8Image};
use dither::Ditherer;
use palette::{TRANSPARENT, build};

/// Writes an endless animation, whole or not at all. All frames have one size.
pub fn write_gif(path: &Path, frames: &[Rgb8Image], frames_per_second: f32) -> Result<()> {
    let name = path.display().to_string();
    let Some(first) = frames.first() else {
        return Err(ImageError::unsupported(&name, "an animation needs at least one frame"));
    };
    let (width, height) = (first.width, first.height);
    let (Ok(w), Ok(h)) = (u16::try_from(width), u16::try_from(height)) else {
        let reason =
            format!("{width}x{height} is too large for GIF, whose sides are at most 65535");
        return Err(ImageError::unsupported(&name, reason));
    };
    if let Some(other) = frames.iter().find(|f| (f.width, f.height) != (width, height)) {
        return Err(ImageError::SizeMismatch {
            a: (width, height),
            b: (other.width, other.height),
        });
    }
    if width == 0 || height == 0 {
        return Err(ImageError::Empty { name, width: width.into(), height: height.into() });
    }
    if !(frames_per_second > 0.0 && frames_per_second.is_finite()) {
        let reason = format!("{frames_per_second} frames a second is no speed of an animation");
        return Err(ImageError::unsupported(&name, reason));
    }
    let palette = build(frames);
    let mut ditherer = Ditherer::new(&palette);
    atomic_write(path, |file| {
        let mut encoder = Encoder::new(&mut *file, w, h, palette.as_flattened()).map_err(to_io)?;
        encoder.set_repeat(Repeat::Infinite).map_err(to_io)?;
        let mut shown: Vec<u8> = Vec::new();
        for (i, frame) in frames.iter().enumerate() {
            let indices = ditherer.indices(frame);
            let changes = indices.iter().enumerate().map(|(at, &index)| {
                if shown.get(at) == Some(&index) { TRANSPARENT } else { index }
            });
            let frame = Frame {
                width: w,
                height: h,
                delay: delay(i, frames_per_second),
                dispose: DisposalMethod::Keep,
                transparent: Some(TRANSPARENT),
                buffer: changes.collect::<Vec<u8>>().into(),
                ..Frame::default()
            };
            encoder.write_frame(&frame).map_err(to_io)?;
            shown = indices;
        }
        encoder.into_inner().map(|_| ()).map_err(to_io)
    })
}

/// Hundredths of a second, rounded so that the sum stays right; browsers slow down below two.
fn delay(frame: usize, frames_per_second: f32) -> u16 {
    let until = |n: usize| (n as f64 * 100.0 / f64::from(frames_per_second)).round();
    (until(frame + 1) - until(frame)).clamp(2.0, 65_535.0) as u16
}

fn to_io(error: ::gif::EncodingError) -> io::Error {
    match error {
        ::gif::EncodingError::Io(error) => error,
        other => io::Error::other(other),
    }
}

#[cfg(test)]
mod tests;
