//! How depth changes from pixel to pixel on a surface.

use rayburst_image::Plane;

use crate::geometry::smaller;

/// Change of depth from a pixel to the next, world units.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Slope {
    /// To the right.
    pub(crate) x: f32,
    /// Downwards.
    pub(crate) y: f32,
}

/// The slope at a pixel: of the differences to the neighbours on both sides the smaller one, as the larger
/// one may lead over the surface's edge. Zero where neither is finite.
#[inline(always)]
pub(crate) fn slope(depth: &Plane, x: u32, y: u32) -> Slope {
    let (width, height) = depth.size();
    let (stride, index) = (depth.stride(), depth.index(x, y));
    let z = depth.at(index);
    let at = |is_inside: bool, index: usize| if is_inside { depth.at(index) } else { f32::NAN };
    Slope {
        x: smaller(z - at(x > 0, index.wrapping_sub(1)), at(x + 1 < width, index + 1) - z),
        y: smaller(
            z - at(y > 0, index.wrapping_sub(stride)),
            at(y + 1 < height, index + stride) - z,
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slopes_are_those_of_the_surface_and_not_of_its_edge() {
        let mut depth = Plane::new(8, 4).unwrap();
        for y in 0..4 {
            for x in 0..8 {
                let far = if x < 4 { 0.0 } else { 100.0 };
                depth.set(x, y, 10.0 + far + 0.5 * x as f32 - 0.25 * y as f32);
            }
        }
        for y in 0..4 {
            for x in 0..8 {
                assert_eq!(slope(&depth, x, y), Slope { x: 0.5, y: -0.25 }, "{x} {y}");
            }
        }
        let mut alone = Plane::new(1, 1).unwrap();
        for value in [0.0, f32::INFINITY, f32::NAN] {
            alone.fill(value);
            assert_eq!(slope(&alone, 0, 0), Slope::default());
        }
    }
}
