//! Sizes that are refused before anything is allocated for them.

use crate::{ImageError, Result};

/// The most pixels of a picture: 2^28, for example 16384 × 16384.
pub const MAX_PIXELS: u64 = 1 << 28;

/// The most bytes that all the decoded channels of one file may take: 4 GiB.
pub const MAX_BYTES: u64 = 1 << 32;

/// The longest side of a texture.
pub const MAX_TEXTURE_SIDE: u32 = 16_384;

/// Checks that a picture has pixels, and not too many; returns their number.
///
/// `name` is the file (or a word) that the error message begins with.
pub fn check_size(name: &str, width: u64, height: u64) -> Result<usize> {
    if width == 0 || height == 0 {
        return Err(ImageError::Empty { name: name.to_owned(), width, height });
    }
    match width.checked_mul(height) {
        Some(n) if n <= MAX_PIXELS && width.max(height) <= i32::MAX as u64 => Ok(n as usize),
        _ => Err(ImageError::TooManyPixels {
            name: name.to_owned(),
            width,
            height,
            limit: MAX_PIXELS,
        }),
    }
}

/// Checks the memory that `samples` values of `bytes_each` take.
pub(crate) fn check_bytes(name: &str, samples: u128, bytes_each: u128) -> Result<()> {
    let bytes = samples.saturating_mul(bytes_each);
    if bytes > u128::from(MAX_BYTES) {
        return Err(ImageError::TooManyBytes { name: name.to_owned(), bytes, limit: MAX_BYTES });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_checked_without_overflow() {
        assert_eq!(check_size("p", 640, 360).unwrap(), 230_400);
        assert!(matches!(check_size("p", 0, 5), Err(ImageError::Empty { .. })));
        assert!(check_size("p", u64::MAX, u64::MAX).is_err());
        let text = check_size("p.png", 100_000, 100_000).unwrap_err().to_string();
        assert_eq!(text, "p.png: 100000x100000 is 10000000000 pixels, the limit is 268435456");
    }
}
