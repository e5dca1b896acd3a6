//! What shaders cost beside queries without them, on a scene that is made here.
//!
//! `shader_cost` counts instructions a ray of every form under valgrind (which knows no AVX-512);
//! `shader_cost time [SECONDS]` gives the least time of every form, their runs interleaved;
//! `shader_cost run FORM COUNT` renders so many pictures, for profilers. One thread in all cases.
#![allow(clippy::print_stdout, reason = "the result of the program")]

use std::{error::Error, process::Command, sync::Arc, time::Instant};

use glam::{Affine3A, UVec2, UVec3, Vec3};
use rayburst_accel::{
    AcceptAll, Blas, BuildOptions, Instance, RayFlags, Tlas, TraceOptions, TriangleMesh,
};
use rayburst_math::{Hit, Ray};
use rayburst_pipeline::{
    AnyHitResult, HitGroup, Next, PortableHitGroup, PortableTable, RwTexture, ShaderTable,
    TraceRequest,
};
use rayburst_testkit::meshes::{boxes, spiky_sphere};

/// Pixels along the side of the picture, and of a tile of the batch form.
const SIZE: u32 = 256;
const TILE: u32 = 32;
const LIGHT: Vec3 = Vec3::new(3.0, 5.0, 4.0);
const SHADOW: RayFlags =
    RayFlags::ACCEPT_FIRST_HIT_AND_END_SEARCH.union(RayFlags::SKIP_CLOSEST_HIT_SHADER);
/// What rays see that leave the scene.
const SKY: f32 = 0.5;
/// Ways to trace and shade: the number is the payload in bytes; `any-hit` adds shaders that opaque geometry
/// never runs.
const FORMS: [&str; 9] = [
    "query",
    "batch",
    "portable",
    "portable any-hit",
    "recursive:4",
    "recursive:4 any-hit",
    "recursive:16",
    "recursive:64",
    "recursive:256",
];

struct Subject {
    normals: Vec<Vec3>,
    tlas: Tlas,
}

/// Light that arrives, and the ray that tells whether it does.
struct Shaded {
    cosine: f32,
    towards: Ray,
}

impl Subject {
    fn new() -> Result<Self, Box<dyn Error>> {
        let mut mesh = spiky_sphere(300, 200, 1);
        let floor = boxes(6).placed("floor", 3.0, Vec3::new(-9.0, -4.0, -9.0));
        let first = mesh.positions.len() as u32;
        mesh.positions.extend(&floor.positions);
        mesh.indices.extend(floor.indices.iter().map(|corners| corners.map(|i| i + first)));
        let normal = |&[a, b, c]: &[u32; 3]| {
            let [a, b, c] = [a, b, c].map(|i| mesh.positions[i as usize]);
            (b - a).cross(c - a).normalize_or_zero()
        };
        let normals = mesh.indices.iter().map(normal).collect();
        let options = BuildOptions::default();
        let blas = Blas::build(&[TriangleMesh::new(&mesh.positions, &mesh.indices)], &options)?;
        let instances = [Instance::new(0, Affine3A::IDENTITY)];
        Ok(Self { normals, tlas: Tlas::build(vec![Arc::new(blas)], &instances, &options)? })
    }

    fn ray(&self, at: UVec2) -> Ray {
        let point = (at.as_vec2() + 0.5) / SIZE as f32 * 2.0 - 1.0;
        Ray::new(Vec3::new(0.1, 0.2, 4.0), Vec3::new(point.x, -point.y, -2.0))
    }

    fn shade(&self, ray: &Ray, t: f32, primitive: u32) -> Shaded {
        let (at, normal) = (ray.at(t), self.normals[primitive as usize]);
        let to_light = LIGHT - at;
        let cosine = normal.dot(to_light).abs() / to_light.length().max(f32::MIN_POSITIVE);
        Shaded { cosine, towards: Ray::with_interval(at, to_light, 1e-3, 1.0) }
    }

    fn tiles(&self) -> impl Iterator<Item = UVec2> + use<> {
        (0..SIZE)
            .step_by(TILE as usize)
            .flat_map(|y| (0..SIZE).step_by(TILE as usize).map(move |x| UVec2::new(x, y)))
    }

    /// Pixels of a tile, 8×8 at a time.
    fn pixels(&self, corner: UVec2) -> impl Iterator<Item = UVec2> + use<> {
        (0..TILE * TILE).map(move |i| {
            let (block, inside) = (i / 64, i % 64);
            let block = UVec2::new(block % (TILE / 8), block / (TILE / 8));
            corner + 8 * block + UVec2::new(inside % 8, inside / 8)
        })
    }

    fn query(&self, picture: &RwTexture<f32>) {
        let options = TraceOptions::default();
        for pixel in self.tiles().flat_map(|tile| self.pixels(tile)) {
            let ray = self.ray(pixel);
            let hit = self.tlas.closest_hit(&ray, &options, &AcceptAll);
            let value = if hit.is_hit() {
                let shaded = self.shade(&ray, hit.t, hit.primitive);
                let lit = !self.tlas.any_hit(&shaded.towards, &options, &AcceptAll);
                if lit { shaded.cosine } else { 0.0 }
            } else {
                SKY
            };
            picture.store(pixel, value);
        }
    }

    fn batch(&self, picture: &RwTexture<f32>) {
        let options = TraceOptions::default();
        for tile in self.tiles() {
            let pixels: Vec<_> = self.pixels(tile).collect();
            let rays: Vec<Ray> = pixels.iter().map(|&pixel| self.ray(pixel)).collect();
            let mut hits = vec![Hit::MISS; rays.len()];
            self.tlas.closest_hits(&rays, &mut hits, &options, &AcceptAll);
            let (mut waiting, mut shadow) = (vec![], vec![]);
            for ((&pixel, ray), hit) in pixels.iter().zip(&rays).zip(&hits) {
                if hit.is_hit() {
                    let shaded = self.shade(ray, hit.t, hit.primitive);
                    waiting.push((pixel, shaded.cosine));
                    shadow.push(shaded.towards);
                } else {
                    picture.store(pixel, SKY);
                }
            }
            let mut occluded = vec![false; shadow.len()];
            self.tlas.any_hits(&shadow, &mut occluded, &options, &AcceptAll);
            for ((pixel, cosine), occluded) in waiting.into_iter().zip(occluded) {
                picture.store(pixel, if occluded { 0.0 } else { cosine });
            }
        }
    }

    fn recursive<const WORDS: usize>(
        &self,
        picture: &RwTexture<f32>,
        any_hit: bool,
    ) -> Result<(), Box<dyn Error>> {
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
            let at = launch.launch_index().truncate();
            let mut payload = [0.0; WORDS];
            launch.trace_ray(eye, RayFlags::empty(), 0xFF, &self.ray(at), &mut payload);
            picture.store(at, payload[0]);
        });
        table.build(2)?.dispatch_rays(&self.tlas, generate, SIZE, SIZE, 1)?;
        Ok(())
    }

    fn portable(&self, picture: &RwTexture<f32>, any_hit: bool) -> Result<(), Box<dyn Error>> {
        // What a pixel is so far, and what it becomes if the light is seen.
        let mut table = PortableTable::<[f32; 2]>::new();
        let eye = table.ray_type("eye", 0, 0, 0);
        let shadow = table.ray_type("shadow", 1, 0, 1);
        table.miss(|_, _| ([SKY; 2], Next::Done));
        table.miss(|_, [_, lit]| ([lit; 2], Next::Done));
        let mut surface = PortableHitGroup::triangles("surface").closest_hit(move |hit, _| {
            let shaded = self.shade(hit.ray.ray, hit.hit.t, hit.hit.primitive);
            let (flags, mask, ray) = (SHADOW, 0xFF, shaded.towards);
            ([0.0, shaded.cosine], Next::Trace(TraceRequest { ray_type: shadow, flags, mask, ray }))
        });
        let mut occluder = PortableHitGroup::<[f32; 2]>::triangles("occluder");
        if any_hit {
            surface = surface.any_hit(|_, _| AnyHitResult::Ignore);
            occluder = occluder.any_hit(|_, _| AnyHitResult::Ignore);
        }
        table.hit(&surface, ());
        table.hit(&occluder, ());
        let generate = |at: UVec3| {
            let (flags, mask, ray) = (RayFlags::empty(), 0xFF, self.ray(at.truncate()));
            ([0.0; 2], Next::Trace(TraceRequest { ray_type: eye, flags, mask, ray }))
        };
        let finish = |at: UVec3, [value, _]: [f32; 2]| picture.store(at.truncate(), value);
        let pipeline = table.build(2)?;
        pipeline.dispatch_rays(&self.tlas, [SIZE, SIZE, 1], generate, finish)?;
        Ok(())
    }

    fn run(&self, form: &str, picture: &RwTexture<f32>) -> Result<(), Box<dyn Error>> {
        match form {
            "query" => self.query(picture),
            "batch" => self.batch(picture),
            "portable" => self.portable(picture, false)?,
            "portable any-hit" => self.portable(picture, true)?,
            "recursive:4" => self.recursive::<1>(picture, false)?,
            "recursive:4 any-hit" => self.recursive::<1>(picture, true)?,
            "recursive:16" => self.recursive::<4>(picture, false)?,
            "recursive:64" => self.recursive::<16>(picture, false)?,
            "recursive:256" => self.recursive::<64>(picture, false)?,
            other => return Err(format!("there is no form '{other}'; forms: {FORMS:?}").into()),
        }
        Ok(())
    }
}

/// Instructions that valgrind counts in so many pictures.
fn count(form: &str, pictures: u32) -> Result<u64, Box<dyn Error>> {
    let output = Command::new("valgrind")
        .args(["--tool=cachegrind", "--cache-sim=no", "--cachegrind-out-file=/dev/null"])
        .arg(std::env::current_exe()?)
        .args(["run", form, &pictures.to_string()])
        .env("RAYBURST_ISA", "avx2")
        .output()?;
    let said = String::from_utf8_lossy(&output.stderr);
    let line = said.lines().find(|line| line.contains("refs:")).ok_or("valgrind counts nothing")?;
    let digits = line.rsplit(':').next().unwrap_or_default().chars();
    Ok(digits.filter(char::is_ascii_digit).collect::<String>().parse()?)
}

/// The table of the forms, in Markdown, given what a ray costs in each.
fn table(what: &str, costs: &[f64]) {
    println!("| form | {what} a ray | to `query` | to `batch` |");
    println!("| --- | --: | --: | --: |");
    for (form, cost) in FORMS.iter().zip(costs) {
        println!("| `{form}` | {cost:.1} | {:.3} | {:.3} |", cost / costs[0], cost / costs[1]);
    }
}

fn work(arguments: &[&str]) -> Result<(), Box<dyn Error>> {
    let subject = Subject::new()?;
    let picture = RwTexture::new(SIZE, SIZE);
    if let ["run", form, count] = arguments {
        for _ in 0..count.parse()? {
            subject.run(form, &picture)?;
        }
        return Ok(());
    }
    subject.query(&picture);
    let expected = picture.to_vec();
    let hits = expected.iter().filter(|&&value| value != SKY).count();
    let rays = f64::from(SIZE * SIZE) + hits as f64;
    for form in FORMS {
        subject.run(form, &picture)?;
        let others = picture.to_vec();
        let differing = expected.iter().zip(&others).filter(|(a, b)| (*a - *b).abs() > 1e-6);
        // Triangles at the very ends of shadow rays may be met or not.
        if differing.count() as f64 > 1e-4 * rays {
            return Err(format!("the picture of {form} is another").into());
        }
    }
    let mut costs = [f64::INFINITY; FORMS.len()];
    match arguments {
        [] => {
            for (form, cost) in FORMS.iter().zip(&mut costs) {
                *cost = (count(form, 2)? - count(form, 1)?) as f64 / rays;
            }
            table("instructions", &costs);
        }
        ["time", seconds @ ..] => {
            let seconds: f64 = seconds.first().map_or(Ok(10.0), |seconds| seconds.parse())?;
            let begin = Instant::now();
            while begin.elapsed().as_secs_f64() < seconds {
                for (form, cost) in FORMS.iter().zip(&mut costs) {
                    let begin = Instant::now();
                    subject.run(form, &picture)?;
                    *cost = cost.min(1e9 * begin.elapsed().as_secs_f64() / rays);
                }
            }
            table("ns", &costs);
        }
        _ => return Err("arguments: nothing, `time [SECONDS]` or `run FORM COUNT`".into()),
    }
    Ok(())
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    // Errors of another thread come as text.
    let outcome = pool.install(|| work(&arguments).map_err(|error| error.to_string()));
    outcome.map_err(Into::into)
}
