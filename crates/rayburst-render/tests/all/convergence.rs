//! Errors fall as they must: by the square root of the samples, and never more slowly with Sobol'.
//!
//! A render of 4096 samples a pixel is also 4096/N renders of N samples each, so that all points of
//! the curve rest on the same samples: rare bright ones would spoil the comparison otherwise.

use std::array::from_fn;

use rayburst_math::SamplerKind;
use rayburst_render::Renderer;

use crate::scenes::{built_in, settings};

const SIZE: (u32, u32) = (12, 12);
const SAMPLES: usize = 4096;
const LEVELS: [usize; 7] = [1, 4, 16, 64, 256, 1024, SAMPLES];

/// Sums of the first n samples of each pixel and channel.
type Sums = Vec<f64>;

/// The sums of 0, 1, … 4096 samples.
fn render(scene: &str, sampler: SamplerKind, seed: u32) -> Vec<Sums> {
    let (scene, camera) = built_in(scene);
    let mut settings = settings(SIZE, 1);
    (settings.sampler, settings.seed, settings.max_depth) = (sampler, seed, 4);
    let mut renderer = Renderer::new(scene, camera, settings).unwrap();
    let pixels: Vec<(u32, u32)> =
        (0..SIZE.1).flat_map(|y| (0..SIZE.0).map(move |x| (x, y))).collect();
    let mut series = vec![vec![0.0; 3 * pixels.len()]];
    for spp in 1..=SAMPLES as u32 {
        renderer.set_spp(spp).unwrap();
        renderer.render();
        let film = renderer.film();
        let sums = pixels.iter().flat_map(|&(x, y)| film.pixel(x, y).rgb.map(|s| s.value()));
        series.push(sums.collect());
    }
    series
}

fn mean_of(renders: &[&Vec<Sums>]) -> Sums {
    let total = (renders.len() * SAMPLES) as f64;
    (0..renders[0][SAMPLES].len())
        .map(|i| renders.iter().map(|r| r[SAMPLES][i]).sum::<f64>() / total)
        .collect()
}

/// Mean squared error of all renders of `n` samples within a series.
fn mse(series: &[Sums], n: usize, truth: &Sums) -> f64 {
    let mut sum = 0.0;
    for block in 0..SAMPLES / n {
        let (from, to) = (&series[block * n], &series[(block + 1) * n]);
        let error = |i: usize| (to[i] - from[i]) / n as f64 - truth[i];
        sum += (0..truth.len()).map(|i| error(i).powi(2)).sum::<f64>();
    }
    sum / (SAMPLES / n * truth.len()) as f64
}

fn check(scene: &str) {
    let independent: [_; 4] = from_fn(|i| render(scene, SamplerKind::Independent, i as u32));
    let sobol: [_; 2] = from_fn(|i| render(scene, SamplerKind::Sobol, 10 + i as u32));

    // The slope: each series against the mean of the others, whose own error is known.
    let others = (independent.len() - 1) * SAMPLES;
    let rmse: [f64; LEVELS.len()] = from_fn(|level| {
        let n = LEVELS[level];
        let sum: f64 = (0..independent.len())
            .map(|own| {
                let rest: Vec<_> =
                    (0..independent.len()).filter(|&i| i != own).map(|i| &independent[i]).collect();
                mse(&independent[own], n, &mean_of(&rest))
            })
            .sum();
        (sum / independent.len() as f64 / (1.0 + n as f64 / others as f64)).sqrt()
    });
    let points: Vec<(f64, f64)> =
        LEVELS.iter().zip(rmse).map(|(&n, e)| ((n as f64).log10(), e.log10())).collect();
    let count = points.len() as f64;
    let mx = points.iter().map(|p| p.0).sum::<f64>() / count;
    let my = points.iter().map(|p| p.1).sum::<f64>() / count;
    let slope = points.iter().map(|p| (p.0 - mx) * (p.1 - my)).sum::<f64>()
        / points.iter().map(|p| (p.0 - mx).powi(2)).sum::<f64>();
    assert!((slope + 0.5).abs() <= 0.03, "{scene}: slope {slope:.3}, {rmse:?}");

    // Both samplers against the mean of everything.
    let truth = mean_of(&independent.iter().chain(&sobol).collect::<Vec<_>>());
    for n in LEVELS {
        let error = |all: &[Vec<Sums>]| {
            (all.iter().map(|s| mse(s, n, &truth)).sum::<f64>() / all.len() as f64).sqrt()
        };
        let (ours, theirs) = (error(&sobol), error(&independent));
        // One sample is one sample: there chance decides.
        let slack = if n == 1 { 1.15 } else { 1.02 };
        assert!(ours <= slack * theirs, "{scene}, {n} samples: Sobol' {ours}, random {theirs}");
    }
}

#[test]
fn cornell_converges_by_the_square_root() {
    check("cornell");
}

#[test]
fn veach_mis_converges_by_the_square_root() {
    check("veach-mis");
}
