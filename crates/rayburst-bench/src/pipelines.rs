//! `bench pipeline`: what shaders cost beside queries without them, on a scene's eye rays and shadow rays.
//!
//! All forms trace the same rays and shade alike: the cosine to the light where it is seen. They must agree
//! on the picture.

use std::{hint::black_box, sync::Arc, time::Instant};

use glam::{Affine3A, UVec2, UVec3, Vec2, Vec3};
use rayburst_accel::{
    AcceptAll, Blas, BuildOptions, Instance, RayFlags, Tlas, TraceOptions, TriangleMesh,
};
use rayburst_math::{Hit, Ray};
use rayburst_pipeline::{
    AnyHitResult, HitGroup, Next, PortableHitGroup, PortableTable, RwTexture, ShaderTable,
    TraceRequest,
};
use rayburst_scene::Camera;
use rayon::prelude::*;

use crate::{BenchError, FlatMesh, Row, error, machine::Machine};

/// What to measure.
#[derive(Clone, Debug)]
pub struct PipelineBench {
    /// Threads that trace, ≥ 1.
    pub threads: usize,
    /// Timed runs of each form, ≥ 1.
    pub repeats: usize,
    /// Least length of a timed run, seconds.
    pub seconds: f64,
    /// Width and height of the picture, pixels.
    pub size: u32,
}

/// A way to trace and shade.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Form {
    /// A loop over pixels with a query for each ray.
    Query,
    /// A loop over tiles with a query for all their rays.
    Batch,
    /// Shaders that trace recursively, with a payload of so many words.
    Recursive(usize),
    /// The same, with any hit shaders that opaque geometry never runs.
    AnyHit,
    /// Portable shaders.
    Portable,
}

impl Form {
    /// All of them.
    const ALL: [Self; 9] = [
        Self::Query,
        Self::Batch,
        Self::Portable,
        Self::Recursive(1),
        Self::AnyHit,
        Self::Recursive(4),
        Self::Recursive(16),
        Self::Recursive(32),
        Self::Recursive(64),
    ];

    /// Its name.
    fn name(self) -> String {
        match self {
            Self::Query => "query".to_owned(),
            Self::Batch => "batch".to_owned(),
            Self::Recursive(words) => format!("recursive:{}", 4 * words),
            Self::AnyHit => "any-hit".to_owned(),
            Self::Portable => "portable".to_owned(),
        }
    }
}

/// Pixels along the side of a tile.
const TILE: u32 = 64;

/// What is traced.
struct Subject<'a> {
    mesh: &'a FlatMesh,
    tlas: Tlas,
    camera: &'a Camera,
    light: Vec3,
    size: u32,
}

/// Light that arrives, and the ray that tells whether it does.
struct Shaded {
    cosine: f32,
    towards: Ray,
}

const SHADOW: RayFlags =
    RayFlags::ACCEPT_FIRST_HIT_AND_END_SEARCH.union(RayFlags::SKIP_CLOSEST_HIT_SHADER);
/// What rays see that leave the scene.
const SKY: f32 = 0.5;

impl Subject<'_> {
    fn ray(&self, x: u32, y: u32) -> Ray {
        let pixel = Vec2::new(x as f32 + 0.5, y as f32 + 0.5);
        self.camera.ray(pixel, (self.size, self.size), Vec2::ZERO).0
    }

    fn shade(&self, ray: &Ray, t: f32, primitive: u32) -> Shaded {
        let (at, normal) = (ray.at(t), self.mesh.normal(primitive));
        let to_light = self.light - at;
        let cosine = normal.dot(to_light).abs() / to_light.length().max(f32::MIN_POSITIVE);
        Shaded { cosine, towards: Ray::with_interval(at, to_light, 1e-3, 1.0) }
    }

    fn tiles(&self) -> impl ParallelIterator<Item = (u32, u32)> + use<> {
        let tiles = self.size.div_ceil(TILE);
        (0..tiles * tiles).into_par_iter().map(move |i| (i % tiles * TILE, i / tiles * TILE))
    }

    /// Pixels of a tile, 8×8 at a time.
    fn pixels(&self, (left, top): (u32, u32)) -> impl Iterator<Item = (u32, u32)> + use<> {
        let size = self.size;
        (0..TILE * TILE).filter_map(move |i| {
            let (block, inside) = (i / 64, i % 64);
            let x = left + block % (TILE / 8) * 8 + inside % 8;
            let y = top + block / (TILE / 8) * 8 + inside / 8;
            (x < size && y < size).then_some((x, y))
        })
    }

    fn query(&self, picture: &RwTexture<f32>) {
        let options = TraceOptions::default();
        self.tiles().for_each(|tile| {
            for (x, y) in self.pixels(tile) {
                let ray = self.ray(x, y);
                let hit = self.tlas.closest_hit(&ray, &options, &AcceptAll);
                let value = if hit.is_hit() {
                    let shaded = self.shade(&ray, hit.t, hit.primitive);
                    let lit = !self.tlas.any_hit(&shaded.towards, &options, &AcceptAll);
                    if lit { shaded.cosine } else { 0.0 }
                } else {
                    SKY
                };
                picture.store(UVec2::new(x, y), value);
            }
        });
    }

    fn batch(&self, picture: &RwTexture<f32>) {
        let options = TraceOptions::default();
        self.tiles().for_each(|tile| {
            let pixels: Vec<_> = self.pixels(tile).collect();
            let rays: Vec<Ray> = pixels.iter().map(|&(x, y)| self.ray(x, y)).collect();
            let mut hits = vec![Hit::MISS; rays.len()];
            self.tlas.closest_hits(&rays, &mut hits, &options, &AcceptAll);
            let (mut waiting, mut shadow) = (vec![], vec![]);
            for ((&(x, y), ray), hit) in pixels.iter().zip(&rays).zip(&hits) {
                if hit.is_hit() {
                    let shaded = self.shade(ray, hit.t, hit.primitive);
                    waiting.push((UVec2::new(x, y), shaded.cosine));
                    shadow.push(shaded.towards);
                } else {
                    picture.store(UVec2::new(x, y), SKY);
                }
            }
            let mut occluded = vec![false; shadow.len()];
            self.tlas.any_hits(&shadow, &mut occluded, &options, &AcceptAll);
            for ((at, cosine), occluded) in waiting.into_iter().zip(occluded) {
                picture.store(at, if occluded { 0.0 } else { cosine });
            }
        });
    }

    fn recursive<const WORDS: usize>(
        &self,
        picture: &RwTexture<f32>,
        any_hit: bool,
    ) -> Result<(), BenchError> {
        let mut table = ShaderTable::new();
        let eye = table.ray_type::<[f32; WORDS]>("eye", 0, 0, 0);
        let shadow = table.ray_type::<f32>("shadow", 1, 0, 1);
        table.miss("sky", |_, p: &mut [f32; WORDS]| p[0] = SKY);
        table.miss("lit", |_, visible: &mut f32| *visible = 1.0);
        let mut surface =
            HitGroup::triangles("surface").closest_hit(move |hit, p: &mut [f32; WORDS]| {
                let shaded = self.shade(hit.world_ray(), hit.t(), hit.primitive_index());
                let mut visible = 0.0;
                hit.trace_ray(shadow, SHADOW, 0xFF, &shaded.towards, &mut visible);
                p[0] = visible * shaded.cosine;
            });
        let mut occluder = HitGroup::<f32>::triangles("occluder");
        if any_hit {
            surface = surface.any_hit(|_, _| AnyHitResult::Ignore);
            occluder = occluder.any_hit(|_, _| AnyHitResult::Ignore);
        }
        table.hit(&surface, ());
        table.hit(&occluder, ());
        let generate = table.ray_generation(|launch| {
            let at = launch.launch_index();
            let mut payload = [0.0; WORDS];
            let ray = self.ray(at.x, at.y);
            launch.trace_ray(eye, RayFlags::empty(), 0xFF, &ray, &mut payload);
            picture.store(at.truncate(), payload[0]);
        });
        let pipeline = table.build(2)?;
        pipeline.dispatch_rays(&self.tlas, generate, self.size, self.size, 1)?;
        Ok(())
    }

    fn portable(&self, picture: &RwTexture<f32>) -> Result<(), BenchError> {
        // What a pixel is so far, and what it becomes if the light is seen.
        let mut table = PortableTable::<[f32; 2]>::new();
        let eye = table.ray_type("eye", 0, 0, 0);
        let shadow = table.ray_type("shadow", 1, 0, 1);
        table.miss(|_, _| ([SKY; 2], Next::Done));
        table.miss(|_, [_, lit]| ([lit; 2], Next::Done));
        let surface = PortableHitGroup::triangles("surface").closest_hit(move |hit, _| {
            let shaded = self.shade(hit.ray.ray, hit.hit.t, hit.hit.primitive);
            let (flags, mask, ray) = (SHADOW, 0xFF, shaded.towards);
            ([0.0, shaded.cosine], Next::Trace(TraceRequest { ray_type: shadow, flags, mask, ray }))
        });
        table.hit(&surface, ());
        table.hit(&PortableHitGroup::<[f32; 2]>::triangles("occluder"), ());
        let pipeline = table.build(2)?;
        let generate = |at: UVec3| {
            let (flags, mask, ray) = (RayFlags::empty(), 0xFF, self.ray(at.x, at.y));
            ([0.0; 2], Next::Trace(TraceRequest { ray_type: eye, flags, mask, ray }))
        };
        let finish = |at: UVec3, [value, _]: [f32; 2]| picture.store(at.truncate(), value);
        pipeline.dispatch_rays(&self.tlas, [self.size, self.size, 1], generate, finish)?;
        Ok(())
    }

    fn run(&self, form: Form, picture: &RwTexture<f32>) -> Result<(), BenchError> {
        match form {
            Form::Query => self.query(picture),
            Form::Batch => self.batch(picture),
            Form::Portable => self.portable(picture)?,
            Form::AnyHit => self.recursive::<1>(picture, true)?,
            Form::Recursive(1) => self.recursive::<1>(picture, false)?,
            Form::Recursive(2..=4) => self.recursive::<4>(picture, false)?,
            Form::Recursive(5..=16) => self.recursive::<16>(picture, false)?,
            Form::Recursive(17..=32) => self.recursive::<32>(picture, false)?,
            Form::Recursive(_) => self.recursive::<64>(picture, false)?,
        }
        Ok(())
    }
}

/// Measures all forms on one scene. Every row is also given to `report`.
pub fn bench_pipelines(
    name: &str,
    mesh: &FlatMesh,
    camera: &Camera,
    options: &PipelineBench,
    report: &mut dyn FnMut(&Row),
) -> Result<Vec<Row>, BenchError> {
    let pool = error::pool(options.threads)?;
    let build = BuildOptions::default();
    let blas = Blas::build(&[TriangleMesh::new(&mesh.positions, &mesh.indices)], &build)?;
    let instances = [Instance::new(0, Affine3A::IDENTITY)];
    let tlas = Tlas::build(vec![Arc::new(blas)], &instances, &build)?;
    let (bounds, size) = (mesh.bounds(), options.size);
    let above = bounds.lower.y + 0.75 * (bounds.upper.y - bounds.lower.y);
    let light = mesh.light.unwrap_or(bounds.centre().with_y(above));
    let subject = Subject { mesh, tlas, camera, light, size };
    let forms = &Form::ALL;

    let picture = RwTexture::new(size, size);
    let mut pictures = Vec::with_capacity(forms.len());
    for &form in forms {
        pool.install(|| subject.run(form, &picture))?;
        pictures.push(picture.to_vec());
    }
    for (form, picture) in forms.iter().zip(&pictures) {
        let others = picture.iter().zip(&pictures[0]);
        let differing = others.filter(|(a, b)| (*a - *b).abs() > 1e-6).count();
        // Triangles at the very ends of shadow rays may be met or not.
        if differing as f64 > 1e-4 * picture.len() as f64 {
            let (first, second) = (forms[0].name(), form.name());
            return Err(BenchError::PicturesDiffer { first, second, differing });
        }
    }
    let hits = pictures[0].iter().filter(|&&value| value != SKY).count();
    let rays = (size * size) as usize + hits;

    let mut rates = vec![Vec::with_capacity(options.repeats); forms.len()];
    for _ in 0..options.repeats {
        for (&form, rates) in forms.iter().zip(&mut rates) {
            let (begin, mut runs) = (Instant::now(), 0);
            while runs == 0 || begin.elapsed().as_secs_f64() < options.seconds {
                pool.install(|| subject.run(form, &picture))?;
                runs += 1;
            }
            black_box(&picture);
            rates.push(1e-6 * (rays * runs) as f64 / begin.elapsed().as_secs_f64());
        }
    }
    let machine = Machine::here();
    rates.iter_mut().for_each(|rates| rates.sort_by(f64::total_cmp));
    let median = |rates: &[f64]| rates[rates.len() / 2];
    let base = median(&rates[0]);
    let rows: Vec<Row> = forms
        .iter()
        .zip(&rates)
        .enumerate()
        .map(|(index, (form, rates))| Row {
            bench: "pipeline",
            scene: name.to_owned(),
            triangles: mesh.indices.len(),
            engine: Some(form.name()),
            threads: options.threads,
            value: median(rates),
            unit: "Mrays/s",
            ratio: (index > 0).then(|| median(rates) / base),
            peer: (index > 0).then(|| forms[0].name()),
            repeats: rates.len(),
            min: rates[0],
            max: rates[rates.len() - 1],
            rays: Some(rays),
            hits: Some(hits),
            machine: machine.clone(),
            ..Row::default()
        })
        .collect();
    rows.iter().for_each(&mut *report);
    Ok(rows)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_form_gives_the_same_picture() {
        let scene = rayburst_scene::builtin::build("cornell").unwrap();
        let mesh = FlatMesh::new(&scene).unwrap();
        let bounds = mesh.bounds();
        let eye = bounds.centre().with_z(bounds.upper.z + 1.5 * bounds.diagonal());
        let camera = Camera::look_at(eye, bounds.centre(), Vec3::Y, 0.6);
        let options = PipelineBench { threads: 1, repeats: 1, seconds: 0.0, size: 40 };
        let mut reported = 0;
        let rows = bench_pipelines("cornell", &mesh, &camera, &options, &mut |_| reported += 1);
        let rows = rows.unwrap();
        assert_eq!((rows.len(), reported), (Form::ALL.len(), Form::ALL.len()));
        assert!(rows[0].ratio.is_none() && rows[1..].iter().all(|row| row.ratio.is_some()));
        assert!(rows.iter().all(|row| row.value > 0.0 && row.hits > Some(200)));
    }
}
