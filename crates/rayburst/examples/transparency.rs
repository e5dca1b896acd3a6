//! Transparent layers in the right order: any hit shaders keep the nearest ones sorted.
//!
//! A k-buffer (Bavoil, Callahan, Lefohn, Comba, Silva: "Multi-Fragment Effects on the GPU using the
//! k-Buffer", I3D 2007) in the payload of a ray.

use std::sync::Arc;

use rayburst::{
    math::hash::Rng,
    pipeline::{AnyHit, Miss},
    prelude::*,
    scene::shapes,
};

mod common;

use common::{Eye, Result, arguments, contact_sheet, daylight::sky, picture, save};

/// The most layers that a ray can keep.
pub(crate) const MOST: usize = 24;

// ANCHOR: layers
/// A layer that a ray goes through.
#[derive(Clone, Copy, Default)]
struct Layer {
    t: f32,
    color: Vec3,
    alpha: f32,
}

/// The nearest layers of a ray, sorted by distance.
struct Layers {
    nearest: [Layer; MOST],
    count: usize,
    /// How many may be kept.
    most: usize,
    /// What is seen behind all layers, and where.
    behind: Vec3,
    end: f32,
}

impl Layers {
    fn new(most: usize) -> Self {
        let nearest = [Layer::default(); MOST];
        Self { nearest, count: 0, most: most.min(MOST), behind: Vec3::ZERO, end: f32::INFINITY }
    }

    /// Puts a layer in its place; the farthest one falls out if there are too many.
    fn insert(&mut self, layer: Layer) {
        let place = self.nearest[..self.count].partition_point(|other| other.t < layer.t);
        if place >= self.most {
            return;
        }
        self.count = (self.count + 1).min(self.most);
        self.nearest.copy_within(place..self.count - 1, place + 1);
        self.nearest[place] = layer;
    }

    /// Front to back: each layer covers a part of what is left.
    fn blend(&self) -> Vec3 {
        let (mut color, mut left) = (Vec3::ZERO, 1.0);
        for layer in self.nearest[..self.count].iter().filter(|layer| layer.t < self.end) {
            color += left * layer.alpha * layer.color;
            left *= 1.0 - layer.alpha;
        }
        color + left * self.behind
    }
}
// ANCHOR_END: layers

/// The layer that a bubble is where a ray meets it: clearer in the middle than at the rim.
fn layer(ray: &Ray, object_ray: &Ray, t: f32, id: u32) -> Layer {
    let normal = object_ray.at(t).normalize_or(Vec3::Y);
    let facing = normal.dot(ray.direction.normalize()).abs();
    let hue = 2.399_963 * id as f32;
    let tint = 0.5 + 0.5 * Vec3::new(hue.cos(), (hue - 2.1).cos(), (hue + 2.1).cos());
    let glint = normal.dot(Vec3::new(-0.4, 0.8, 0.45).normalize()).max(0.0).powi(60);
    let color = (tint * (0.45 + 0.55 * normal.y.max(0.0))).lerp(Vec3::ONE, glint);
    let alpha = (0.16 + 0.7 * (1.0 - facing).powi(2) + 0.6 * glint).min(0.95);
    Layer { t, color, alpha }
}

/// A checkered ground and the sky.
fn backdrop(miss: &Miss<'_>) -> (Vec3, f32) {
    let ray = miss.world_ray();
    let t = (-1.6 - ray.origin.y) / ray.direction.y;
    if !(t > 0.0 && t < 80.0) {
        return (sky(ray.direction), f32::INFINITY);
    }
    let place = ray.at(t);
    let odd = (place.x.floor() + place.z.floor()).rem_euclid(2.0) > 0.5;
    let tile = if odd { Vec3::new(0.55, 0.54, 0.52) } else { Vec3::new(0.20, 0.22, 0.26) };
    (tile.lerp(sky(ray.direction), 1.0 - (-0.035 * t).exp()), t)
}

/// Bubbles of all sizes, instances of one sphere.
fn bubbles() -> Result<Tlas> {
    let ball = shapes::sphere(Vec3::ZERO, 1.0, 5);
    let primitive = ball.into_primitive(0);
    let mesh = TriangleMesh {
        opaque: false,
        // A layer must not be counted twice.
        no_duplicate_any_hit: true,
        ..TriangleMesh::new(&primitive.positions, &primitive.indices)
    };
    let blas = Arc::new(Blas::build(&[mesh], &BuildOptions::default())?);
    let mut rng = Rng::new(11);
    let instances: Vec<Instance> = (0..26)
        .map(|id| {
            let radius = rng.range(0.35, 1.0);
            let at = (rng.vec3() - 0.5) * Vec3::new(5.6, 2.6, 5.0) + Vec3::new(0.0, 0.25, 0.0);
            let scale = Affine3A::from_scale(Vec3::splat(radius));
            Instance { id, ..Instance::new(0, Affine3A::from_translation(at) * scale) }
        })
        .collect();
    Ok(Tlas::build(vec![blas], &instances, &BuildOptions::default())?)
}

/// How layers are found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Order {
    /// By one ray whose any hit shader keeps the nearest ones.
    Buffer,
    /// By one ray a layer, each of which begins where the one before has ended.
    Peel,
}

/// Bubbles of which each ray sees so many layers.
pub(crate) fn render(
    order: Order,
    layers: usize,
    size: (u32, u32),
    samples: u32,
) -> Result<RgbImage> {
    let tlas = bubbles()?;
    let eye = Eye::look_at(Vec3::new(0.0, 0.9, 8.2), Vec3::new(0.0, 0.05, 0.0), 33.0);
    let texels = RwTexture::<Vec3>::new(size.0, size.1);

    let mut table = ShaderTable::new();
    // ANCHOR: any_hit
    let buffered = table.ray_type::<Layers>("buffered", 0, 0, 0);
    table
        .miss("backdrop", |miss, layers: &mut Layers| (layers.behind, layers.end) = backdrop(miss));
    let collect = |hit: &AnyHit<'_, Barycentrics, ()>, layers: &mut Layers| {
        layers.insert(layer(hit.world_ray(), &hit.object_ray(), hit.t(), hit.instance_id()));
        // The ray goes on through everything, so that every layer is seen.
        hit.ignore_hit()
    };
    table.hit(&HitGroup::triangles("bubble").any_hit(collect), ());
    // ANCHOR_END: any_hit

    // ANCHOR: peel
    let peeled = table.ray_type::<Layers>("peeled", 1, 0, 0);
    let nearest = HitGroup::triangles("nearest").closest_hit(|hit, layers: &mut Layers| {
        layers.insert(layer(hit.world_ray(), &hit.object_ray(), hit.t(), hit.instance_id()));
        layers.end = hit.t();
    });
    table.hit(&nearest, ());
    // ANCHOR_END: peel

    let generate = table.ray_generation(|launch| {
        let mut sum = Vec3::ZERO;
        for sample in 0..samples {
            let (mut ray, _) = eye.ray(launch.launch_index(), launch.launch_dimensions(), sample);
            let mut found = Layers::new(layers);
            match order {
                Order::Buffer => {
                    launch.trace_ray(buffered, RayFlags::empty(), 0xFF, &ray, &mut found);
                }
                Order::Peel => {
                    for _ in 0..layers {
                        launch.trace_ray(peeled, RayFlags::FORCE_OPAQUE, 0xFF, &ray, &mut found);
                        ray.t_min = found.end;
                        if found.behind != Vec3::ZERO {
                            break;
                        }
                    }
                    // What is behind everything that was peeled off.
                    ray.t_min = f32::MAX;
                    launch.trace_ray(peeled, RayFlags::FORCE_OPAQUE, 0xFF, &ray, &mut found);
                }
            }
            sum += found.blend();
        }
        texels.store(launch.launch_index().truncate(), sum / samples as f32);
    });
    table.build(1)?.dispatch_rays(&tlas, generate, size.0, size.1, 1)?;
    Ok(picture(&texels, size))
}

/// The greatest difference between two pictures.
pub(crate) fn greatest_difference(a: &RgbImage, b: &RgbImage) -> f32 {
    let pairs = a.pixels.iter().zip(&b.pixels);
    pairs.map(|(&a, &b)| (a - b).abs().max_element()).fold(0.0, f32::max)
}

fn main() -> Result<()> {
    let (path, size) = arguments("transparency", (640, 480))?;
    let half = (size.0 / 2, size.1 / 2);
    // ANCHOR: compare
    let mut panels = Vec::new();
    for layers in [1, 2, 4, MOST] {
        let buffer = render(Order::Buffer, layers, half, 16)?;
        let sorted = render(Order::Peel, layers, half, 16)?;
        let apart = greatest_difference(&buffer, &sorted);
        common::say(format!("{layers:2} layers: at most {apart:.1e} from sorted ones"));
        panels.push(buffer);
    }
    // ANCHOR_END: compare
    save(&contact_sheet(&panels, 2), path)
}
