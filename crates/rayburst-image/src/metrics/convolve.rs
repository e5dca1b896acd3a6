//! Separable convolution of one plane; beyond the border the nearest value goes on.

use std::ops::{AddAssign, Mul};

use rayon::prelude::*;

/// A number that can be filtered.
pub(super) trait Number:
    Copy + Default + Send + Sync + AddAssign + Mul<Output = Self>
{
}

impl Number for f32 {}
impl Number for f64 {}

/// A plane of numbers, row by row.
#[derive(Clone)]
pub(super) struct Plane<T> {
    pub(super) width: usize,
    pub(super) values: Vec<T>,
}

impl<T: Number> Plane<T> {
    pub(super) fn new(width: u32, values: Vec<T>) -> Self {
        Self { width: width as usize, values }
    }

    /// Filters with a kernel along rows and one along columns, both of odd length.
    pub(super) fn convolve(&self, across: &[T], down: &[T]) -> Self {
        self.across(across).down(down)
    }

    fn across(&self, kernel: &[T]) -> Self {
        let (width, radius) = (self.width, kernel.len() / 2);
        let mut out = vec![T::default(); self.values.len()];
        out.par_chunks_mut(width).zip(self.values.par_chunks(width)).for_each_init(
            || Vec::with_capacity(width + 2 * radius),
            |padded, (out, row)| {
                padded.clear();
                padded.resize(radius, row[0]);
                padded.extend_from_slice(row);
                padded.resize(width + 2 * radius, row[width - 1]);
                for (tap, &weight) in kernel.iter().enumerate() {
                    accumulate(out, &padded[tap..tap + width], weight);
                }
            },
        );
        Self { width, values: out }
    }

    fn down(&self, kernel: &[T]) -> Self {
        let (width, radius) = (self.width, kernel.len() / 2);
        let height = self.values.len() / width;
        let mut out = vec![T::default(); self.values.len()];
        out.par_chunks_mut(width).enumerate().for_each(|(y, out)| {
            for (tap, &weight) in kernel.iter().enumerate() {
                let from = (y + tap).saturating_sub(radius).min(height - 1);
                accumulate(out, &self.values[from * width..][..width], weight);
            }
        });
        Self { width, values: out }
    }
}

#[inline]
fn accumulate<T: Number>(out: &mut [T], values: &[T], weight: T) {
    for (out, &value) in out.iter_mut().zip(values) {
        *out += weight * value;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_impulse_shows_the_mirrored_kernel_and_borders_hold() {
        let mut values = vec![0.0f32; 7 * 5];
        values[2 * 7 + 3] = 1.0;
        let out = Plane::new(7, values).convolve(&[1.0, 2.0, 4.0], &[1.0, 10.0, 100.0]);
        assert_eq!(out.values[7 + 2..7 + 5], [400.0, 200.0, 100.0]);
        assert_eq!(out.values[3 * 7 + 2..3 * 7 + 5], [4.0, 2.0, 1.0]);
        let flat = Plane::new(3, vec![2.0f64; 6]).convolve(&[0.25, 0.5, 0.25], &[0.2; 5]);
        assert!(flat.values.iter().all(|v| (v - 2.0).abs() < 1e-12));
    }
}
