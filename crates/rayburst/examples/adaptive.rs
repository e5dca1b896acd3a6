//! More rays where pixels are noisy: a second dispatch whose ray generation shader traces what the first
//! one has shown to be worth it.

use std::sync::Arc;

use bytemuck::{Pod, Zeroable};
use rayburst::{
    math::{Sampler, hash},
    prelude::*,
    scene::shapes,
};

mod common;

use common::{
    Eye, Result, arguments, contact_sheet,
    daylight::{SHADOW_FLAGS, Shadow, daylight, sky},
    normal_of, save,
};

// ANCHOR: estimate
/// What is known of a pixel.
#[derive(Clone, Copy, Default, Pod, Zeroable)]
#[repr(C)]
struct Estimate {
    sum: Vec3,
    /// Sum of squared luminances.
    squares: f32,
    samples: u32,
    rays: u32,
}

impl Estimate {
    fn mean(&self) -> Vec3 {
        self.sum / self.samples.max(1) as f32
    }

    /// The variance of a sample's luminance, unbiased.
    fn variance(&self) -> f32 {
        let (n, mean) = (self.samples as f32, luminance(self.mean()));
        ((self.squares - n * mean * mean) / (n - 1.0).max(1.0)).max(0.0)
    }

    /// Rays that a sample costs.
    fn cost(&self) -> f32 {
        self.rays as f32 / self.samples.max(1) as f32
    }
}
// ANCHOR_END: estimate

fn luminance(color: Vec3) -> f32 {
    rayburst::image::colour::luminance(color)
}

/// How rays are shared out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Plan {
    /// All pixels get as many samples.
    Uniform,
    /// A quarter of the samples evenly, the other rays by what those show.
    Adaptive,
}

/// A picture, and where its samples went.
pub(crate) struct Outcome {
    pub(crate) picture: RgbImage,
    pub(crate) samples: Vec<u32>,
    pub(crate) rays: u64,
}

/// What an eye ray carries.
struct Seen {
    sampler: Sampler,
    color: Vec3,
    rays: u32,
}

// ANCHOR: share
/// How many samples more each pixel gets, so that the mean squared error of the picture is least for
/// a number of rays: in all, samples in proportion to the deviation over the root of what a sample costs.
fn share_out(pilot: &[Estimate], (width, height): (u32, u32), budget: f64) -> Vec<u32> {
    // A few samples say little about a variance: the mean of it and its neighbours' says more.
    let deviation = |i: usize| {
        let (x, y) = (i as u32 % width, i as u32 / width);
        let columns = x.saturating_sub(1)..(x + 2).min(width);
        let rows = y.saturating_sub(1)..(y + 2).min(height);
        let around = rows.flat_map(|y| columns.clone().map(move |x| (y * width + x) as usize));
        let (sum, count) =
            around.fold((0.0, 0.0), |(sum, count), j| (sum + pilot[j].variance(), count + 1.0));
        (sum / count).sqrt()
    };
    let weights: Vec<f64> = (0..pilot.len())
        .map(|i| f64::from(deviation(i) / pilot[i].cost().max(1.0).sqrt()))
        .collect();
    let more = |scale: f64, i: usize| (scale * weights[i] - f64::from(pilot[i].samples)).max(0.0);
    let rays = |scale: f64| {
        (0..pilot.len()).map(|i| more(scale, i) * f64::from(pilot[i].cost())).sum::<f64>()
    };
    let (mut low, mut high) = (0.0, 1.0);
    while rays(high) < budget && high < 1e12 {
        high *= 2.0;
    }
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if rays(middle) < budget { low = middle } else { high = middle }
    }
    // Fractions become samples with their probability.
    (0..pilot.len())
        .map(|i| (more(low, i) + f64::from(hash::to_unit(hash::words(&[i as u32])))) as u32)
        .collect()
}
// ANCHOR_END: share

/// A teapot and two balls on the ground.
fn still_life() -> Result<Tlas> {
    let options = BuildOptions::default();
    let build = |shape: shapes::Shape| -> Result<Arc<Blas>> {
        let primitive = shape.into_primitive(0);
        let mesh = TriangleMesh::new(&primitive.positions, &primitive.indices);
        Ok(Arc::new(Blas::build(&[mesh], &options)?))
    };
    let mut ground = shapes::Shape::default();
    ground.add_quad(
        [(-1.0, 1.0), (1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)]
            .map(|(x, z)| Vec3::new(60.0 * x, 0.0, 60.0 * z)),
    );
    let blases = vec![
        build(shapes::teapot(12))?,
        build(shapes::sphere(Vec3::ZERO, 1.0, 6))?,
        build(ground)?,
    ];
    let at = |x, y, z, size| {
        Affine3A::from_translation(Vec3::new(x, y, z)) * Affine3A::from_scale(Vec3::splat(size))
    };
    let instances = [
        Instance { id: 0, ..Instance::new(2, Affine3A::IDENTITY) },
        Instance {
            id: 1,
            ..Instance::new(0, at(-0.6, 0.0, 0.0, 0.8) * Affine3A::from_rotation_y(0.5))
        },
        Instance { id: 2, ..Instance::new(1, at(2.5, 0.9, -0.9, 0.9)) },
        Instance { id: 3, ..Instance::new(1, at(1.9, 0.45, 1.5, 0.45)) },
    ];
    Ok(Tlas::build(blases, &instances, &options)?)
}

/// The still life, with as many rays as `samples` a pixel take.
pub(crate) fn render(plan: Plan, size: (u32, u32), samples: u32) -> Result<Outcome> {
    let colors = [
        Vec3::new(0.58, 0.55, 0.50),
        Vec3::new(0.72, 0.28, 0.16),
        Vec3::new(0.16, 0.42, 0.50),
        Vec3::new(0.82, 0.66, 0.24),
    ];
    let tlas = still_life()?;
    // The variance tells the error of independent samples; Sobol' points do better than it says.
    let eye = Eye::look_at(Vec3::new(1.6, 2.4, 10.8), Vec3::new(0.55, 1.2, 0.0), 31.0)
        .with_numbers(SamplerKind::Independent);
    let estimates = RwBuffer::<Estimate>::new(size.0 as usize * size.1 as usize);
    let planned = RwBuffer::<u32>::new(estimates.len());

    let mut table = ShaderTable::new();
    let eye_ray = table.ray_type::<Seen>("eye", 0, 0, 0);
    let shadow_ray = table.ray_type::<Shadow>("shadow", 1, 0, 1);
    table.miss("sky", |miss, seen: &mut Seen| seen.color = sky(miss.world_ray().direction));
    table.miss("nothing in between", |_, shadow: &mut Shadow| shadow.lit = true);
    let group = HitGroup::triangles("surface").closest_hit(|hit, seen: &mut Seen| {
        let light = daylight(hit.world_position(), normal_of(hit), &seen.sampler, 4, |ray| {
            let mut shadow = Shadow::default();
            hit.trace_ray(shadow_ray, SHADOW_FLAGS, 0xFF, ray, &mut shadow);
            shadow.lit
        });
        seen.color = colors[hit.instance_id() as usize % colors.len()] * light;
        seen.rays += 2;
    });
    table.hit(&group, ());
    table.no_hit();

    // ANCHOR: generate
    let generate = table.ray_generation(|launch| {
        let (pixel, dimensions) = (launch.launch_index(), launch.launch_dimensions());
        let index = (pixel.y * dimensions.x + pixel.x) as usize;
        let mut estimate = estimates.load(index);
        for _ in 0..planned.load(index) {
            let (ray, sampler) = eye.ray(pixel, dimensions, estimate.samples);
            let mut seen = Seen { sampler, color: Vec3::ZERO, rays: 1 };
            launch.trace_ray(eye_ray, RayFlags::empty(), 0xFF, &ray, &mut seen);
            estimate.sum += seen.color;
            estimate.squares += luminance(seen.color).powi(2);
            estimate.samples += 1;
            estimate.rays += seen.rays;
        }
        estimates.store(index, estimate);
    });
    let pipeline = table.build(2)?;
    // ANCHOR_END: generate

    // ANCHOR: passes
    let dispatch = |samples: &[u32]| {
        samples.iter().enumerate().for_each(|(index, &count)| planned.store(index, count));
        pipeline.dispatch_rays(&tlas, generate, size.0, size.1, 1)
    };
    let all = vec![samples; estimates.len()];
    match plan {
        Plan::Uniform => dispatch(&all)?,
        Plan::Adaptive => {
            let first = (samples / 4).max(2).min(samples);
            dispatch(&vec![first; estimates.len()])?;
            let pilot = estimates.to_vec();
            let rays: f64 = pilot.iter().map(|pixel| f64::from(pixel.rays)).sum();
            let budget = rays * f64::from(samples - first) / f64::from(first.max(1));
            dispatch(&share_out(&pilot, size, budget))?;
        }
    }
    // ANCHOR_END: passes
    let estimates = estimates.to_vec();
    Ok(Outcome {
        picture: RgbImage {
            width: size.0,
            height: size.1,
            pixels: estimates.iter().map(Estimate::mean).collect(),
        },
        samples: estimates.iter().map(|pixel| pixel.samples).collect(),
        rays: estimates.iter().map(|pixel| u64::from(pixel.rays)).sum(),
    })
}

/// Root mean square of the difference of two pictures.
pub(crate) fn rmse(a: &RgbImage, b: &RgbImage) -> f64 {
    let apart = a.pixels.iter().zip(&b.pixels).map(|(&a, &b)| f64::from((a - b).length_squared()));
    (apart.sum::<f64>() / (3.0 * a.pixels.len() as f64)).sqrt()
}

fn main() -> Result<()> {
    let (path, size) = arguments("adaptive", (960, 240))?;
    let size = (size.0 / 3, size.1);
    // ANCHOR: compare
    let reference = render(Plan::Uniform, size, 1024)?.picture;
    let uniform = render(Plan::Uniform, size, 16)?;
    let adaptive = render(Plan::Adaptive, size, 16)?;
    for (name, outcome) in [("uniform", &uniform), ("adaptive", &adaptive)] {
        let error = rmse(&outcome.picture, &reference);
        common::say(format!("{name}: {} rays, RMSE {error:.5}", outcome.rays));
    }
    // ANCHOR_END: compare
    let most = adaptive.samples.iter().copied().max().unwrap_or(1).max(1) as f32;
    let map = RgbImage::from_fn(size.0, size.1, |x, y| {
        Vec3::splat(adaptive.samples[(y * size.0 + x) as usize] as f32 / most)
    });
    save(&contact_sheet(&[uniform.picture, adaptive.picture, map], 3), path)
}
