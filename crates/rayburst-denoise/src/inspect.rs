//! The weights of a single pixel, to be looked at.

use crate::{
    EdgeStopping, Stack,
    atrous_kernel::{LEAST_DEVIATION, LUMINANCE, SIGNAL, VARIANCE},
    geometry::{DEPTH, LEAST_SLOPE, NORMAL, OBJECT, SLOPE},
};

/// A level of the wavelet transform that has been run.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Level<'a> {
    pub(crate) geometry: &'a Stack,
    /// What it read.
    pub(crate) from: &'a Stack,
    pub(crate) level: u32,
    pub(crate) stopping: EdgeStopping,
    pub(crate) plain: bool,
}

impl Level<'_> {
    /// By row and column the share that every tap has in a pixel of a signal; zero outside the picture.
    pub(crate) fn weights(&self, signal: usize, (x, y): (u32, u32)) -> [[f32; 5]; 5] {
        let (width, height) = self.from.size();
        let step = 1i64 << self.level;
        let kernel = self.stopping.kernel.weights();
        let mut weights = [[0.0; 5]; 5];
        let mut sum = 0.0;
        for (row, dy) in (-2i64..=2).enumerate() {
            for (column, dx) in (-2i64..=2).enumerate() {
                let (qx, qy) = (i64::from(x) + dx * step, i64::from(y) + dy * step);
                let inside =
                    (0..i64::from(width)).contains(&qx) && (0..i64::from(height)).contains(&qy);
                if inside {
                    let share =
                        kernel[dx.unsigned_abs() as usize] * kernel[dy.unsigned_abs() as usize];
                    let offset = (dx as f32, dy as f32);
                    let alike = self.alike(signal, (x, y), (qx as u32, qy as u32), offset);
                    weights[row][column] = share * alike;
                    sum += share * alike;
                }
            }
        }
        // The centre's weight is not zero.
        weights.map(|row| row.map(|weight| weight / sum))
    }

    /// What edges leave of a tap's weight.
    fn alike(&self, signal: usize, p: (u32, u32), q: (u32, u32), (dx, dy): (f32, f32)) -> f32 {
        if p == q {
            return 1.0;
        }
        let shape = |channel: usize, (x, y): (u32, u32)| self.geometry.row(channel, y)[x as usize];
        if shape(OBJECT, p).to_bits() != shape(OBJECT, q).to_bits() {
            return 0.0;
        }
        let step = (1u32 << self.level) as f32;
        // Tolerances grow with the number of steps in the offset's direction.
        let (a, b) = (dx.abs().max(dy.abs()), dx.abs().min(dy.abs()));
        let times = if b == 0.0 || a == b { a } else { 1.0 };
        let slope = (shape(SLOPE, p) * dx + shape(SLOPE + 1, p) * dy).abs();
        let change = step * (slope + LEAST_SLOPE * shape(DEPTH, p).abs() * times);
        let depth = (shape(DEPTH, q) - shape(DEPTH, p)).abs();
        let cosine: f32 = (NORMAL..NORMAL + 3).map(|axis| shape(axis, p) * shape(axis, q)).sum();
        let value = |channel: usize, (x, y): (u32, u32)| {
            self.from.row(signal * SIGNAL + channel, y)[x as usize]
        };
        let luminance = (value(LUMINANCE, q) - value(LUMINANCE, p)).abs();
        let tolerated = if self.plain {
            self.stopping.luminance / step
        } else {
            self.stopping.luminance * self.blurred_variance(signal, p).sqrt()
        };
        let apart = depth / (self.stopping.depth * change).max(1e-18)
            + self.stopping.normal * (1.0 - cosine)
            + luminance / (tolerated + LEAST_DEVIATION * value(LUMINANCE, p) + 1e-18);
        (-apart).exp()
    }

    fn blurred_variance(&self, signal: usize, (x, y): (u32, u32)) -> f32 {
        let (width, height) = self.from.size();
        let mut sum = 0.0;
        for (qy, a) in [(y.saturating_sub(1), 1.0), (y, 2.0), ((y + 1).min(height - 1), 1.0)] {
            let row = self.from.row(signal * SIGNAL + VARIANCE, qy);
            for (qx, b) in [(x.saturating_sub(1), 1.0), (x, 2.0), ((x + 1).min(width - 1), 1.0)] {
                sum += a * b * row[qx as usize];
            }
        }
        sum / 16.0
    }
}
