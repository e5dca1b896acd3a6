//! The feature pipeline: differences of edges and of points in luminance (paper section 4.2).

use super::super::convolve::Plane;

/// The width of the features in degrees: a Gaussian of twice this deviation.
const WIDTH: f32 = 0.082;

/// The feature difference of each pixel, 0 to 1, of two Y planes of Y Cx Cz.
pub(super) fn difference(
    reference: &Plane<f32>,
    test: &Plane<f32>,
    pixels_per_degree: f32,
) -> Vec<f32> {
    let kernels = Kernels::new(pixels_per_degree);
    let [reference, test] = [reference, test].map(|y| kernels.features(y));
    reference
        .iter()
        .zip(&test)
        .map(|(a, b)| {
            let edge = (a[0] - b[0]).abs();
            let point = (a[1] - b[1]).abs();
            (std::f32::consts::FRAC_1_SQRT_2 * edge.max(point)).sqrt()
        })
        .collect()
}

/// A Gaussian and its first two derivatives.
struct Kernels {
    smooth: Vec<f32>,
    edge: Vec<f32>,
    point: Vec<f32>,
}

impl Kernels {
    fn new(pixels_per_degree: f32) -> Self {
        let deviation = 0.5 * WIDTH * pixels_per_degree;
        let radius = (3.0 * deviation).ceil() as i32;
        let kernel = |f: &dyn Fn(f32) -> f32| -> Vec<f32> {
            let g = |x: f32| f(x) * (-x * x / (2.0 * deviation * deviation)).exp();
            (-radius..=radius).map(|x| g(x as f32)).collect()
        };
        Self {
            smooth: balanced(kernel(&|_| 1.0)),
            edge: balanced(kernel(&|x| -x)),
            point: balanced(kernel(&|x| x * x / (deviation * deviation) - 1.0)),
        }
    }

    /// Strength of edges and of points at each pixel.
    fn features(&self, y: &Plane<f32>) -> Vec<[f32; 2]> {
        let grey = y.values.iter().map(|v| (v + 16.0) / 116.0).collect();
        let grey = Plane { width: y.width, values: grey };
        let strength = |kernel: &[f32]| {
            let across = grey.convolve(kernel, &self.smooth);
            let down = grey.convolve(&self.smooth, kernel);
            let length = |(a, b): (&f32, &f32)| (a * a + b * b).sqrt();
            across.values.iter().zip(&down.values).map(length).collect::<Vec<f32>>()
        };
        let (edges, points) = (strength(&self.edge), strength(&self.point));
        edges.into_iter().zip(points).map(|(e, p)| [e, p]).collect()
    }
}

/// Scales positive weights to a sum of 1 and negative ones to -1.
fn balanced(mut kernel: Vec<f32>) -> Vec<f32> {
    let positive: f32 = kernel.iter().filter(|k| **k > 0.0).sum();
    let negative: f32 = -kernel.iter().filter(|k| **k <= 0.0).sum::<f32>();
    kernel.iter_mut().for_each(|k| *k /= if *k > 0.0 { positive } else { negative.max(1e-30) });
    kernel
}
