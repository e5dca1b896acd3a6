//! What is asked of settings and planes before any work is done.

pub(crate) use crate::reprojection::same_size as size;
use crate::{Result, error};

/// Fails unless a setting is in a range, which its text names.
pub(crate) fn setting(
    name: &'static str,
    value: f32,
    (least, most): (f32, f32),
    range: &'static str,
) -> Result<()> {
    error::check(name, value, least..=most, range)
}

/// Fails where a picture has no pixels.
pub(crate) fn picture(size: (u32, u32)) -> Result<()> {
    if size.0 == 0 || size.1 == 0 {
        rayburst_image::Plane::<u32>::new(size.0, size.1)?;
    }
    Ok(())
}
