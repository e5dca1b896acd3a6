//! Sixteen pixels of a row at a time: plain loops over fixed arrays, which compilers turn into vector
//! instructions of whatever set a kernel is compiled for.

/// Pixels that are worked on together.
pub(crate) const LANES: usize = 16;

/// A number for each of them.
pub(crate) type Lanes = [f32; LANES];

/// The numbers from an index on.
#[inline(always)]
pub(crate) fn load(values: &[f32], at: usize) -> Lanes {
    let mut lanes = [0.0; LANES];
    lanes.copy_from_slice(&values[at..at + LANES]);
    lanes
}

/// Writes numbers from an index on.
#[inline(always)]
pub(crate) fn store(values: &mut [f32], at: usize, lanes: &Lanes) {
    values[at..at + LANES].copy_from_slice(lanes);
}

/// The lesser number; the second where the first is NaN. One instruction, unlike `f32::min`.
#[inline(always)]
pub(crate) fn lesser(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// The greater number; the second where the first is NaN.
#[inline(always)]
pub(crate) fn greater(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// The greatest of the numbers.
#[inline(always)]
pub(crate) fn greatest(lanes: &Lanes) -> f32 {
    let mut half = [0.0; LANES / 2];
    for i in 0..LANES / 2 {
        half[i] = greater(lanes[i], lanes[i + LANES / 2]);
    }
    let mut most = half[0];
    for value in half {
        most = greater(value, most);
    }
    most
}

/// Light of at least nothing and at most [`MOST_LIGHT`]; nothing where it is NaN.
#[inline(always)]
pub(crate) fn light(value: f32) -> f32 {
    lesser(greater(value, 0.0), MOST_LIGHT)
}

/// More than any picture has; its square is still a number, and so are sums of many squares.
pub(crate) const MOST_LIGHT: f32 = 1e15;

/// Luminance of linear sRGB.
#[inline(always)]
pub(crate) fn luminance(r: f32, g: f32, b: f32) -> f32 {
    0.2126 * r + 0.7152 * g + 0.0722 * b
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_greatest_is_found_in_every_lane() {
        for i in 0..LANES {
            let mut lanes = [1.0; LANES];
            lanes[i] = 2.0;
            assert_eq!(greatest(&lanes), 2.0);
        }
    }

    #[test]
    fn light_is_a_number_that_is_not_negative() {
        for (value, expected) in [
            (f32::NAN, 0.0),
            (f32::INFINITY, MOST_LIGHT),
            (f32::NEG_INFINITY, 0.0),
            (-1.0, 0.0),
            (2.5, 2.5),
        ] {
            assert_eq!(light(value), expected);
        }
    }
}
