//! 255 colours for a set of pictures, by median cut.
//!
//! Heckbert: "Color Image Quantization for Frame Buffer Display", SIGGRAPH 1982, on a histogram of
//! 5 bits a channel. The box to split is the one with the largest error, not the largest count, so
//! that smooth gradients of rare colours get their share.

use crate::Rgb8Image;

/// The palette's last entry means "as before".
pub(super) const TRANSPARENT: u8 = 255;

/// The eye's weights of red, green and blue differences.
pub(super) const WEIGHTS: [f32; 3] = [0.299, 0.587, 0.114];

/// A cell of the histogram: how often, and its mean colour.
#[derive(Clone, Copy)]
struct Bin {
    count: f32,
    mean: [f32; 3],
}

/// Up to 255 colours, filled up with black, and the transparent entry.
pub(super) fn build(frames: &[Rgb8Image]) -> [[u8; 3]; 256] {
    let mut boxes = vec![ColourBox::new(histogram(frames))];
    while boxes.len() < usize::from(TRANSPARENT) {
        // The first of the largest, so that the result does not depend on chance.
        let worst =
            (0..boxes.len()).reduce(|a, b| if boxes[b].error > boxes[a].error { b } else { a });
        let Some((at, halves)) = worst.and_then(|at| Some((at, boxes[at].split()?))) else { break };
        boxes[at] = halves.0;
        boxes.push(halves.1);
    }
    let mut palette = [[0; 3]; 256];
    for (entry, cut) in palette.iter_mut().zip(&boxes) {
        *entry = cut.mean.map(|v| (v + 0.5) as u8);
    }
    palette
}

fn histogram(frames: &[Rgb8Image]) -> Vec<Bin> {
    let mut sums = vec![(0u64, [0u64; 3]); 1 << 15];
    for frame in frames {
        for pixel in frame.data.as_chunks::<3>().0 {
            let [r, g, b] = pixel.map(|v| usize::from(v >> 3));
            let (count, sum) = &mut sums[r << 10 | g << 5 | b];
            *count += 1;
            sum.iter_mut().zip(pixel).for_each(|(sum, &v)| *sum += u64::from(v));
        }
    }
    sums.retain(|(count, _)| *count > 0);
    sums.iter()
        .map(|&(n, sum)| Bin { count: n as f32, mean: sum.map(|s| (s as f64 / n as f64) as f32) })
        .collect()
}

struct ColourBox {
    bins: Vec<Bin>,
    mean: [f32; 3],
    /// Weighted squared distance of all pixels to the mean, with the widest axis.
    error: f32,
    axis: usize,
}

impl ColourBox {
    fn new(bins: Vec<Bin>) -> Self {
        let (mut count, mut sum, mut squares) = (0.0f64, [0.0f64; 3], [0.0f64; 3]);
        for bin in &bins {
            let n = f64::from(bin.count);
            count += n;
            for i in 0..3 {
                let v = f64::from(bin.mean[i]);
                sum[i] += n * v;
                squares[i] += n * v * v;
            }
        }
        let mean = sum.map(|s| s / count.max(1.0));
        let spread: [f64; 3] = std::array::from_fn(|i| {
            f64::from(WEIGHTS[i]) * (squares[i] - mean[i] * sum[i]).max(0.0)
        });
        let axis = (0..3).reduce(|a, b| if spread[b] > spread[a] { b } else { a }).unwrap_or(0);
        // The root of the count keeps large flat areas from taking all entries.
        let error = (spread.iter().sum::<f64>() / count.max(1.0).sqrt()) as f32;
        Self { bins, mean: mean.map(|m| m as f32), error, axis }
    }

    /// Two halves at the mean of the widest axis; none of a single colour.
    fn split(&self) -> Option<(Self, Self)> {
        let (axis, mean) = (self.axis, self.mean[self.axis]);
        let (low, high): (Vec<Bin>, Vec<Bin>) =
            self.bins.iter().partition(|bin| bin.mean[axis] < mean);
        (!low.is_empty() && !high.is_empty()).then(|| (Self::new(low), Self::new(high)))
    }
}
