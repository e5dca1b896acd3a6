//! What an earlier render left in the output file.

use std::path::Path;

use rayburst::image::{LayeredImage, read_exr};

use crate::error::Result;

/// What there is to go on with.
pub(super) enum State {
    /// Nothing, or nobody asked.
    None,
    /// A picture without a state: it was written whole.
    Finished,
    /// Samples.
    Samples(Box<LayeredImage>),
}

/// Looks at the file of a frame.
pub(super) fn state(resume: bool, path: &Path) -> Result<State> {
    if !resume || !path.exists() {
        return Ok(State::None);
    }
    if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("exr")) {
        return Ok(State::Samples(Box::new(read_exr(path)?)));
    }
    Ok(State::Finished)
}
