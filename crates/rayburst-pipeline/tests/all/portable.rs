//! Portable shaders give what recursive ones do.

use std::sync::{Arc, atomic::AtomicU32, atomic::Ordering};

use glam::{Affine3A, Quat, UVec2, UVec3, Vec3};
use rayburst_accel::{Blas, BuildOptions, Instance, RayFlags, Tlas, TriangleMesh};
use rayburst_math::{Hit, Ray};
use rayburst_pipeline::{
    AnyHitResult, DispatchError, HitGroup, Next, PipelineError, PortableHitGroup, PortableTable,
    RwTexture, ShaderTable, TraceRequest,
};
use rayburst_testkit::meshes::{TestMesh, boxes, random_soup};

const SIZE: u32 = 96;
const BOUNCES: u32 = 4;
const LIGHT: Vec3 = Vec3::new(3.0, 5.0, 4.0);

fn structure() -> Tlas {
    fn geometry(mesh: &TestMesh) -> TriangleMesh<'_> {
        TriangleMesh::new(&mesh.positions, &mesh.indices)
    }
    let (soup, cubes) =
        (random_soup(900, 0.3, 7), boxes(3).placed("boxes", 0.4, Vec3::new(-1.3, -1.0, -1.2)));
    let translucent = TriangleMesh { opaque: false, ..geometry(&soup) };
    let options = BuildOptions::default();
    let first = Blas::build(&[translucent, geometry(&cubes)], &options).unwrap();
    let second = Blas::build(&[geometry(&cubes)], &options).unwrap();
    let turned = Affine3A::from_rotation_translation(
        Quat::from_rotation_y(0.7) * Quat::from_rotation_x(0.3),
        Vec3::new(0.3, -0.2, -1.0),
    );
    let mirrored = Affine3A::from_scale(Vec3::new(-1.0, 0.7, 1.2));
    let instances = [
        Instance::new(0, Affine3A::IDENTITY),
        Instance { contribution: 4, ..Instance::new(1, turned) },
        Instance { contribution: 2, mask: 0x0F, ..Instance::new(0, turned * mirrored) },
    ];
    Tlas::build(vec![Arc::new(first), Arc::new(second)], &instances, &options).unwrap()
}

fn camera_ray(at: UVec2) -> Ray {
    let point = (at.as_vec2() + 0.5) / SIZE as f32 * 2.0 - 1.0;
    Ray::new(Vec3::new(0.1, 0.2, 4.0), Vec3::new(point.x, -point.y, -2.0))
}

/// Whether a triangle of cut-out geometry stops rays.
fn is_solid(hit: &Hit) -> bool {
    (hit.primitive + u32::from(hit.u > 0.4)) & 1 == 0
}

fn normal(tlas: &Tlas, hit: &Hit) -> Vec3 {
    let instance = &tlas.instances()[hit.instance as usize];
    let blas = &tlas.blases()[instance.blas as usize];
    let [a, b, c] = blas.triangle(hit.geometry, hit.primitive).unwrap();
    let normal = (b - a).cross(c - a).normalize();
    tlas.world_to_object(hit.instance).matrix3.transpose().mul_vec3(normal).normalize()
}

fn color_of(hit: &Hit, tint: Vec3) -> Vec3 {
    tint * Vec3::new(hit.u, hit.v, (hit.primitive % 7) as f32 / 7.0)
}

fn shadow_ray(from: Vec3) -> Ray {
    Ray::with_interval(from, LIGHT - from, 1e-3, 1.0)
}

fn reflected_ray(ray: &Ray, from: Vec3, normal: Vec3) -> Ray {
    Ray::with_interval(from, ray.direction.reflect(normal), 1e-3, f32::INFINITY)
}

const SHADOW: RayFlags = RayFlags::ACCEPT_FIRST_HIT_AND_END_SEARCH;
const TINTS: [Vec3; 6] = [Vec3::X, Vec3::Y, Vec3::ONE, Vec3::Z, Vec3::ONE, Vec3::NEG_ONE];

#[derive(Clone, Copy, Default)]
struct Radiance {
    color: Vec3,
    depth: u32,
}

/// The picture by recursion.
fn recursive(tlas: &Tlas) -> Vec<Vec3> {
    let picture = RwTexture::<Vec3>::new(SIZE, SIZE);
    let mut table = ShaderTable::new();
    let radiance = table.ray_type::<Radiance>("radiance", 0, 1, 0);
    let shadow = table.ray_type::<bool>("shadow", 6, 0, 1);
    table.miss("sky", |miss, p: &mut Radiance| {
        p.color = 0.2 * Vec3::ONE + 0.1 * miss.world_ray().direction;
    });
    table.miss("lit", |_, lit: &mut bool| *lit = true);
    let surface = HitGroup::triangles("surface")
        .closest_hit(move |hit, p: &mut Radiance| {
            let (at, n) = (hit.world_position(), normal(hit.structure(), hit.hit()));
            let mut color = color_of(hit.hit(), *hit.record());
            let mut lit = false;
            let flags = SHADOW | RayFlags::SKIP_CLOSEST_HIT_SHADER;
            hit.trace_ray(shadow, flags, 0xFF, &shadow_ray(at), &mut lit);
            if !lit {
                color *= 0.5;
            }
            if p.depth < BOUNCES {
                let mut inner = Radiance { depth: p.depth + 1, ..Radiance::default() };
                let ray = reflected_ray(hit.world_ray(), at, n);
                hit.trace_ray(radiance, RayFlags::empty(), 0x1F, &ray, &mut inner);
                color += 0.5 * inner.color;
            }
            p.color = color;
        })
        .any_hit(
            |hit, _| {
                if is_solid(hit.hit()) { AnyHitResult::Accept } else { AnyHitResult::Ignore }
            },
        );
    for tint in TINTS {
        table.hit(&surface, tint);
    }
    let occluder = HitGroup::triangles("occluder").any_hit(|hit, _: &mut bool| {
        if is_solid(hit.hit()) { hit.accept_hit() } else { hit.ignore_hit() }
    });
    for _ in 0..8 {
        table.hit(&occluder, ());
    }
    let generate = table.ray_generation(|launch| {
        let at = launch.launch_index().truncate();
        let mut payload = Radiance::default();
        let flags = RayFlags::empty();
        launch.trace_ray(radiance, flags, 0x1F, &camera_ray(at), &mut payload);
        picture.store(at, payload.color);
    });
    let depth = BOUNCES + 2;
    table.build(depth).unwrap().dispatch_rays(tlas, generate, SIZE, SIZE, 1).unwrap();
    picture.to_vec()
}

/// What goes along with a path.
#[derive(Clone, Copy)]
struct Path {
    /// Colours of the surfaces so far, the first one first.
    colors: [Vec3; BOUNCES as usize + 2],
    surfaces: usize,
    /// The ray to go on with after the shadow ray.
    next: Ray,
}

impl Path {
    fn with_sky(mut self, ray: &Ray) -> Self {
        self.colors[self.surfaces] = 0.2 * Vec3::ONE + 0.1 * ray.direction;
        self.surfaces += 1;
        self
    }

    fn color(&self) -> Vec3 {
        let colors = self.colors[..self.surfaces].iter().rev();
        colors.copied().reduce(|inner, outer| outer + 0.5 * inner).unwrap_or_default()
    }
}

/// The picture by batches.
fn portable(tlas: &Tlas) -> Vec<Vec3> {
    let picture = RwTexture::<Vec3>::new(SIZE, SIZE);
    let mut table = PortableTable::<Path>::new();
    let radiance = table.ray_type("radiance", 0, 1, 0);
    let shadow = table.ray_type("shadow", 6, 0, 1);
    let go_on = move |path: Path| {
        let request = TraceRequest {
            ray_type: radiance,
            flags: RayFlags::empty(),
            mask: 0x1F,
            ray: path.next,
        };
        let more = path.surfaces <= BOUNCES as usize;
        (path, if more { Next::Trace(request) } else { Next::Done })
    };
    table.miss(|miss, path: Path| (path.with_sky(miss.ray), Next::Done));
    table.miss(move |_, path| go_on(path));
    let surface = PortableHitGroup::triangles("surface")
        .closest_hit(move |hit, mut path: Path| {
            let ray = hit.ray.ray;
            let (at, n) = (ray.at(hit.hit.t), normal(hit.structure(), hit.hit));
            path.colors[path.surfaces] = color_of(hit.hit, *hit.record);
            path.surfaces += 1;
            path.next = reflected_ray(ray, at, n);
            let ray = shadow_ray(at);
            (path, Next::Trace(TraceRequest { ray_type: shadow, flags: SHADOW, mask: 0xFF, ray }))
        })
        .any_hit(
            |hit, _| {
                if is_solid(hit.hit) { AnyHitResult::Accept } else { AnyHitResult::Ignore }
            },
        );
    for tint in TINTS {
        table.hit(&surface, tint);
    }
    let occluder = PortableHitGroup::triangles("occluder")
        .closest_hit(move |_, mut path: Path| {
            path.colors[path.surfaces - 1] *= 0.5;
            go_on(path)
        })
        .any_hit(
            |hit, _| {
                if is_solid(hit.hit) { AnyHitResult::Accept } else { AnyHitResult::Ignore }
            },
        );
    for _ in 0..8 {
        table.hit(&occluder, ());
    }
    let pipeline = table.build(2 * BOUNCES + 3).unwrap();
    let generate = |launch: UVec3| {
        let path = Path {
            colors: [Vec3::ZERO; BOUNCES as usize + 2],
            surfaces: 0,
            next: camera_ray(launch.truncate()),
        };
        go_on(path)
    };
    let finish = |launch: UVec3, path: Path| picture.store(launch.truncate(), path.color());
    pipeline.dispatch_rays(tlas, [SIZE, SIZE, 1], generate, finish).unwrap();
    picture.to_vec()
}

#[test]
fn the_picture_is_that_of_recursion_bit_for_bit() {
    let tlas = structure();
    let (expected, picture) = (recursive(&tlas), portable(&tlas));
    assert!(expected == picture);
    let sky = 0.2 * Vec3::ONE + 0.1 * Vec3::Z;
    let bright = expected.iter().filter(|color| color.max_element() > 0.5).count();
    let others = expected.iter().filter(|color| (**color - sky).length() > 0.5).count();
    assert!(bright > 500 && others > 200, "{bright}, {others}");
}

#[test]
fn the_picture_does_not_depend_on_threads() {
    let tlas = structure();
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| portable(&tlas))
    };
    assert!(with(1) == with(3));
}

#[test]
fn every_launch_is_generated_and_finished_once() {
    let tlas = structure();
    let mut table = PortableTable::<u32>::new();
    let ray_type = table.ray_type("any", 0, 0, 0);
    table.no_miss();
    for _ in 0..8 {
        table.no_hit();
    }
    let pipeline = table.build(1).unwrap();
    let (width, height, depth) = (130, 67, 3);
    let counts: Vec<AtomicU32> = (0..width * height * depth).map(|_| AtomicU32::new(0)).collect();
    let number = |at: UVec3| (at.z * height + at.y) * width + at.x;
    let request = |ray| TraceRequest { ray_type, flags: RayFlags::empty(), mask: 0xFF, ray };
    let generate = |at: UVec3| {
        let next = if at.x.is_multiple_of(3) {
            Next::Done
        } else {
            Next::Trace(request(camera_ray(at.truncate())))
        };
        (number(at), next)
    };
    let finish = |at: UVec3, payload: u32| {
        assert_eq!(payload, number(at));
        counts[payload as usize].fetch_add(1, Ordering::Relaxed);
    };
    pipeline.dispatch_rays(&tlas, [width, height, depth], generate, finish).unwrap();
    assert!(counts.iter().all(|count| count.load(Ordering::Relaxed) == 1));
    pipeline.dispatch_rays(&tlas, [0, 5, 1], generate, finish).unwrap();
}

#[test]
fn a_launch_that_never_ends_is_an_error_and_the_first_one_is_named() {
    let tlas = structure();
    let mut table = PortableTable::<u32>::new();
    let ray_type = table.ray_type("any", 0, 0, 0);
    let request = |ray| TraceRequest { ray_type, flags: RayFlags::empty(), mask: 0xFF, ray };
    table.miss(move |miss, payload| (payload, Next::Trace(request(*miss.ray))));
    for _ in 0..8 {
        table.no_hit();
    }
    let pipeline = table.build(9).unwrap();
    let away = Ray::new(Vec3::splat(50.0), Vec3::ONE);
    let generate = |at: UVec3| {
        let ends = at != UVec3::new(99, 70, 0) && at != UVec3::new(5, 71, 0);
        (0, if ends { Next::Done } else { Next::Trace(request(away)) })
    };
    let finish = |at: UVec3, _| assert_ne!(at, UVec3::new(99, 70, 0));
    let error = pipeline.dispatch_rays(&tlas, [128, 128, 1], generate, finish).unwrap_err();
    assert_eq!(error, DispatchError::TooManyRays { launch: UVec3::new(99, 70, 0), limit: 9 });
}

#[test]
fn a_table_that_does_not_fit_the_structure_is_an_error() {
    let tlas = structure();
    let mut table = PortableTable::<u32>::new();
    table.ray_type("any", 0, 1, 0);
    table.no_miss();
    table.no_hit();
    let pipeline = table.build(1).unwrap();
    let expected = PipelineError::NoHitRecord {
        ray_type: "any".into(),
        instance: 0,
        geometry: 1,
        index: 1,
        records: 1,
    };
    assert_eq!(pipeline.check(&tlas), Err(expected.clone()));
    let error = pipeline.dispatch_rays(&tlas, [1, 1, 1], |_| (0, Next::Done), |_, _| ());
    assert_eq!(error, Err(DispatchError::Pipeline(expected)));
    let mut table = PortableTable::<u32>::new();
    table.ray_type("any", 0, 1, 3);
    assert!(matches!(table.build(1), Err(PipelineError::NoMissRecord { index: 3, .. })));
}
