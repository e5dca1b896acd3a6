//! Figure 26.5: a path tracer follows one random ray at each hit; a pixel is the mean of many paths.
//!
//! The slice is a flatland: a diffuse surface reflects the mean of what it sees over `sin θ`, so a
//! path and a tree of several rays a hit estimate the same number.

use rayburst::glam::Vec2;
use rayburst::math::hash::Rng;

use super::{
    Drawing,
    canvas::{Anchor, Canvas, Pen, ink},
    slice::{Slice, SliceBuilder, SliceHit, Substance},
    symbols::eye,
};
use crate::error::Result;

const EYE: Vec2 = Vec2::new(0.7, 2.5);
const TARGET: Vec2 = Vec2::new(4.3, 0.3);
const ALBEDO: f64 = 0.7;
const MAX_DEPTH: u32 = 6;
const BRANCHES: u32 = 3;

/// Draws two paths through one pixel.
pub(super) fn draw() -> Result<Drawing> {
    let mut canvas = Canvas::new(790, 475)?;
    let slice = room(canvas.size().y)?;
    canvas.heading(
        "Figure 26.5 · two paths of one pixel",
        "Each hit continues with a single ray in a random direction; where a path meets the light, the pixel gets its share.",
    );
    slice.draw(&mut canvas);
    let inks = [ink::BLUE, ink::ORANGE];
    let mut shown = Vec::new();
    for (i, length) in [3usize, 4].into_iter().enumerate() {
        let Some(path) = fine_path(&slice, length, i as u64) else { continue };
        for (k, pair) in path.windows(2).enumerate().skip(1) {
            let (from, to) = (slice.page(pair[0]), slice.page(pair[1]));
            canvas.ray(from, to, Pen::new(inks[i], 2.0));
            canvas.circle(from, 3.2, inks[i], None);
            let name = format!("{}", k + 1);
            let side = (to - from).normalize().perp() * 11.0;
            canvas.label(from.lerp(to, 0.5) + side + Vec2::Y * 4.0, &name, inks[i], Anchor::Middle);
        }
        shown.push(path.len() - 1);
    }
    canvas.ray(slice.page(EYE), slice.page(TARGET), Pen::new(ink::BLACK, 2.2));
    let middle = slice.page(EYE.lerp(TARGET, 0.72));
    canvas.label(middle + Vec2::new(4.0, -10.0), "1", ink::BLACK, Anchor::Middle);
    screen(&mut canvas, &slice);
    eye(&mut canvas, slice.page(EYE));
    canvas.label(slice.page(EYE) + Vec2::new(0.0, 26.0), "eye", ink::BLACK, Anchor::Middle);
    let lamp = slice.page(Vec2::new(6.3, 4.6));
    canvas.label(lamp + Vec2::new(0.0, 6.0), "area light", ink::BLACK, Anchor::Start);

    let mut paths = Estimate::default();
    let mut trees = Estimate::default();
    for sample in 0..60_000 {
        paths.add(&slice, 1, Rng::new(sample));
    }
    for sample in 0..4_000 {
        trees.add(&slice, BRANCHES, Rng::new((1 << 40) + sample));
    }
    let apart = (paths.mean() - trees.mean()).abs()
        / (paths.variance_of_mean() + trees.variance_of_mean()).sqrt();
    let numbers = vec![
        ("rays of the two paths drawn", format!("{shown:?}")),
        ("mean of 60000 paths", format!("{:.4} ± {:.4}", paths.mean(), paths.deviation())),
        (
            "mean of 4000 trees (3 rays a hit)",
            format!("{:.4} ± {:.4}", trees.mean(), trees.deviation()),
        ),
        ("difference in standard deviations", format!("{apart:.2}")),
        ("rays a path", format!("{:.2}", paths.rays())),
        ("rays a tree", format!("{:.1}", trees.rays())),
    ];
    canvas.footing(&format!(
        "Same mean, {:.2} and {:.2} (apart by {apart:.1} σ): a path takes {:.1} rays, a tree of 3 rays a hit {:.0}.",
        paths.mean(),
        trees.mean(),
        paths.rays(),
        trees.rays()
    ));
    Ok(Drawing { picture: canvas.into_image(), numbers })
}

fn room(page_height: f32) -> Result<Slice> {
    let mut builder = SliceBuilder::default();
    let wall = Substance { diffuse: true, ..Substance::default() };
    let light = Substance { emission: 4.0, ..Substance::default() };
    let stone = (ink::STONE, ink::GREY);
    builder.rectangle(Vec2::new(0.0, 0.0), Vec2::new(10.3, 0.3), stone, wall);
    builder.rectangle(Vec2::new(0.0, 0.3), Vec2::new(0.2, 4.75), stone, wall);
    builder.rectangle(Vec2::new(10.1, 0.3), Vec2::new(10.3, 4.75), stone, wall);
    builder.rectangle(Vec2::new(0.0, 4.75), Vec2::new(10.3, 4.95), stone, wall);
    builder.disk(Vec2::new(6.6, 1.0), 0.7, ([220, 232, 222, 255], ink::GREEN), wall);
    let block =
        [Vec2::new(7.9, 0.3), Vec2::new(9.2, 0.3), Vec2::new(9.2, 2.3), Vec2::new(7.9, 2.0)];
    builder.polygon(&block, ([238, 218, 228, 255], ink::PINK), wall);
    let lamp = (ink::YELLOW, ink::ORANGE);
    builder.rectangle(Vec2::new(4.4, 4.6), Vec2::new(6.2, 4.72), lamp, light);
    builder.build(page_height)
}

fn screen(canvas: &mut Canvas, slice: &Slice) {
    let (low, high) = (Vec2::new(1.7, 1.4), Vec2::new(1.7, 2.6));
    for i in 0..=6 {
        let at = slice.page(low.lerp(high, i as f32 / 6.0));
        canvas.line(at - Vec2::new(5.0, 0.0), at + Vec2::new(5.0, 0.0), Pen::new(ink::BLACK, 1.2));
    }
    canvas.line(slice.page(low), slice.page(high), Pen::new(ink::BLACK, 1.8));
    canvas.label(slice.page(low) + Vec2::new(0.0, 18.0), "pixels", ink::BLACK, Anchor::Middle);
}

/// A direction on the visible side whose `sin θ` is uniform: a flatland's cosine distribution.
fn scatter(hit: &SliceHit, towards: Vec2, rng: &mut Rng) -> Vec2 {
    let n = if hit.normal.dot(towards) > 0.0 { -hit.normal } else { hit.normal };
    let sin = rng.range(-1.0, 1.0);
    (1.0 - sin * sin).max(0.0).sqrt() * n + sin * n.perp()
}

/// The corners of a path of so many rays that ends on the light and is easy to see.
fn fine_path(slice: &Slice, rays: usize, variant: u64) -> Option<Vec<Vec2>> {
    (0..20_000).find_map(|seed| {
        let mut rng = Rng::new(seed * 2 + variant);
        let mut points = vec![EYE];
        let mut direction = TARGET - EYE;
        let mut hit = slice.trace(EYE, direction)?;
        loop {
            points.push(hit.position);
            if hit.substance.emission > 0.0 {
                break;
            }
            if points.len() > rays {
                return None;
            }
            direction = scatter(&hit, direction, &mut rng);
            hit = slice.trace_from(&hit, direction)?;
        }
        let long = points.windows(2).all(|p| p[0].distance(p[1]) > 1.2);
        // The second path goes to the right, so that the two are easily told apart.
        let side =
            if variant == 0 { points[2].x < 0.5 && points[2].y > 3.3 } else { points[2].x > 6.5 };
        (points.len() == rays + 1 && long && side).then_some(points)
    })
}

/// Mean and spread of an estimator, and its rays.
#[derive(Default)]
struct Estimate {
    samples: f64,
    sum: f64,
    squares: f64,
    rays: u64,
}

impl Estimate {
    fn add(&mut self, slice: &Slice, branches: u32, mut rng: Rng) {
        let direction = TARGET - EYE;
        self.rays += 1;
        let value = slice
            .trace(EYE, direction)
            .map_or(0.0, |hit| self.radiance(slice, &hit, direction, 1, branches, &mut rng));
        self.samples += 1.0;
        self.sum += value;
        self.squares += value * value;
    }

    fn radiance(
        &mut self,
        slice: &Slice,
        hit: &SliceHit,
        direction: Vec2,
        depth: u32,
        branches: u32,
        rng: &mut Rng,
    ) -> f64 {
        let own = f64::from(hit.substance.emission);
        if own > 0.0 || depth >= MAX_DEPTH {
            return own;
        }
        let mut sum = 0.0;
        for _ in 0..branches {
            let along = scatter(hit, direction, rng);
            self.rays += 1;
            if let Some(next) = slice.trace_from(hit, along) {
                sum += self.radiance(slice, &next, along, depth + 1, branches, rng);
            }
        }
        own + ALBEDO * sum / f64::from(branches)
    }

    fn mean(&self) -> f64 {
        self.sum / self.samples
    }

    fn variance_of_mean(&self) -> f64 {
        (self.squares / self.samples - self.mean().powi(2)).max(0.0) / (self.samples - 1.0)
    }

    fn deviation(&self) -> f64 {
        self.variance_of_mean().sqrt()
    }

    fn rays(&self) -> f64 {
        self.rays as f64 / self.samples
    }
}
