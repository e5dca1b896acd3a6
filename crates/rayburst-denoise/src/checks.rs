//! What is asked of settings and planes before any work is done.

use crate::{DenoiseError, Result};

/// Fails unless a setting is in a range, which its text names.
pub(crate) fn setting(
    name: &'static str,
    value: f32,
    (least, most): (f32, f32),
    range: &'static str,
) -> Result<()> {
    if value >= least && value <= most {
        return Ok(());
    }
    Err(DenoiseError::Setting { name, value: f64::from(value), range })
}

/// Fails unless a plane has the picture's size.
pub(crate) fn size(name: &'static str, found: (u32, u32), expected: (u32, u32)) -> Result<()> {
    if found == expected {
        return Ok(());
    }
    Err(DenoiseError::Mismatch { name, found, expected })
}

/// Fails where a picture has no pixels.
pub(crate) fn picture(size: (u32, u32)) -> Result<()> {
    if size.0 == 0 || size.1 == 0 {
        rayburst_image::Plane::<u32>::new(size.0, size.1)?;
    }
    Ok(())
}
