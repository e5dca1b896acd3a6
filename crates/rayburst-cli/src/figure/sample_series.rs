//! Figure 26.6: the same picture with 1 to 65,536 samples a pixel. The error falls with the square
//! root of the number of samples: four times as many halve it.

use rayburst::{
    glam::Vec2,
    image::{
        RgbImage,
        exposure::{auto_exposure, scale},
        metrics::rmse,
    },
    math::SamplerKind,
    render::{IntegratorKind, RenderSettings, Renderer},
};

use super::{
    Drawing,
    canvas::{Anchor, Canvas, ink},
    rendering,
};
use crate::error::Result;

/// Samples a pixel of the pictures; the last one is the reference of the others.
const SERIES: [u32; 5] = [1, 16, 256, 4096, 65_536];
/// Pixels of a side, and points that a pixel takes on the page.
const SIDE: u32 = 48;
const MAGNIFIED: f32 = 3.5;
const MARGIN: f32 = 24.0;
const GAP: f32 = 8.0;

/// Renders the series in one go: each picture goes on with the samples of the one before.
pub(super) fn draw() -> Result<Drawing> {
    let (flat, camera) = rendering::scene("cornell")?;
    let all = SERIES[SERIES.len() - 1];
    let mut pictures: Vec<RgbImage> = Vec::new();
    let mut saved = None;
    for spp in SERIES {
        let settings = RenderSettings {
            size: (SIDE, SIDE),
            spp,
            integrator: IntegratorKind::Path,
            // Independent numbers have the law of the figure; `sobol` falls faster.
            sampler: SamplerKind::Independent,
            ..RenderSettings::default()
        };
        let mut renderer = Renderer::new(flat.clone(), camera, settings)?;
        let from = match &saved {
            Some(image) => renderer.resume(image)?,
            None => 0,
        };
        rendering::finish(&mut renderer, from, all)?;
        pictures.push(renderer.picture());
        saved = Some(renderer.layers(true));
    }
    let reference = &pictures[pictures.len() - 1];
    let stops = auto_exposure(reference);
    let errors: Vec<f64> =
        // In units of the white of the developed picture.
        pictures[..pictures.len() - 1]
            .iter()
            .map(|p| rmse(reference, p) * f64::from(scale(stops)))
            .collect();
    let slope = slope(&SERIES[..errors.len()], &errors);

    let cell = SIDE as f32 * MAGNIFIED;
    let width = 2.0 * MARGIN + 5.0 * cell + 4.0 * GAP;
    let mut canvas = Canvas::new(width as u32, (cell + 142.0) as u32)?;
    canvas.heading(
        "Figure 26.6 · samples a pixel",
        "The Cornell box by path tracing with independent random numbers. Four times as many samples halve the error.",
    );
    for (i, (picture, spp)) in pictures.iter().zip(SERIES).enumerate() {
        let at = Vec2::new(MARGIN + i as f32 * (cell + GAP), 66.0);
        canvas.picture(at, &rendering::develop(picture, stops), MAGNIFIED);
        let label = match errors.get(i) {
            Some(error) => format!("{spp} spp · RMSE {error:.3}"),
            None => format!("{spp} spp · reference"),
        };
        let below = at + Vec2::new(0.5 * cell, cell + 19.0);
        canvas.label(below, &label, ink::BLACK, Anchor::Middle);
    }
    canvas.footing(&format!(
        "RMSE against the last picture falls with slope {slope:.3} (law: −0.5)."
    ));
    let names = ["RMSE at 1 spp", "RMSE at 16 spp", "RMSE at 256 spp", "RMSE at 4096 spp"];
    let mut numbers: Vec<(&'static str, String)> =
        names.into_iter().zip(&errors).map(|(n, e)| (n, format!("{e:.6}"))).collect();
    numbers.push(("slope in log-log (law: −0.5)", format!("{slope:.4}")));
    Ok(Drawing { picture: canvas.into_image(), numbers })
}

/// Slope of the least-squares line through the logarithms. The reference has noise of its own: a
/// prefix of n of its N samples is `√(1/n − 1/N)` away from it, so `n` stands for `1/(1/n − 1/N)`.
fn slope(samples: &[u32], errors: &[f64]) -> f64 {
    let whole = f64::from(SERIES[SERIES.len() - 1]);
    let points: Vec<(f64, f64)> = samples
        .iter()
        .zip(errors)
        .map(|(&n, e)| (-(1.0 / f64::from(n) - 1.0 / whole).ln(), e.ln()))
        .collect();
    let mean = |f: fn(&(f64, f64)) -> f64| points.iter().map(f).sum::<f64>() / points.len() as f64;
    let (x, y) = (mean(|p| p.0), mean(|p| p.1));
    let above: f64 = points.iter().map(|p| (p.0 - x) * (p.1 - y)).sum();
    above / points.iter().map(|p| (p.0 - x).powi(2)).sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_slope_of_a_square_root_is_one_half() {
        let errors: Vec<f64> = SERIES[..4]
            .iter()
            .map(|&n| 3.0 * (1.0 / f64::from(n) - 1.0 / 65_536.0).sqrt())
            .collect();
        assert!((slope(&SERIES[..4], &errors) + 0.5).abs() < 1e-12);
    }
}
