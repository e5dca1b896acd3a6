//! `DispatchRays`: a launch for each index of the grid, and what a grid may be.

use glam::UVec3;
use rayburst_accel::{BuildOptions, Tlas};
use rayburst_pipeline::{DispatchError, MAX_LAUNCHES, RwBuffer, ShaderTable};

use crate::{harness::structure, model::Scene};

pub fn nothing() -> Tlas {
    structure(&Scene::default(), &BuildOptions::default())
}

/// Runs `shader` with as many threads.
pub fn with_threads(threads: usize, run: impl FnOnce() + Send) {
    rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(run);
}

fn check(width: u32, height: u32, depth: u32) {
    let counts = RwBuffer::<u32>::new((width * height * depth) as usize);
    let total = RwBuffer::<u32>::new(1);
    let mut table = ShaderTable::new();
    let generate = table.ray_generation(|launch| {
        let at = launch.launch_index();
        assert_eq!(launch.launch_dimensions(), UVec3::new(width, height, depth));
        assert!(at.cmplt(launch.launch_dimensions()).all());
        counts.atomic_add(((at.z * height + at.y) * width + at.x) as usize, 1);
        total.atomic_add(0, 1);
    });
    let pipeline = table.build(0).unwrap();
    let tlas = nothing();
    for threads in [1, 2, 5] {
        with_threads(threads, || {
            pipeline.dispatch_rays(&tlas, generate, width, height, depth).unwrap();
        });
    }
    drop(pipeline);
    assert!(counts.to_vec().iter().all(|&count| count == 3), "each index once a dispatch");
    assert_eq!(total.load(0), 3 * width * height * depth);
}

macro_rules! grids {
    ($($name:ident = ($width:literal, $height:literal, $depth:literal);)*) => {
        $(
            #[test]
            fn $name() {
                check($width, $height, $depth);
            }
        )*
    };
}

grids! {
    one_launch = (1, 1, 1);
    a_row = (1000, 1, 1);
    a_column = (1, 777, 1);
    a_stack = (1, 1, 65);
    whole_tiles = (64, 32, 1);
    parts_of_tiles = (37, 23, 1);
    three_dimensions = (9, 17, 5);
    of_primes = (7, 11, 13);
    width_of_zero = (0, 5, 5);
    height_of_zero = (5, 0, 5);
    depth_of_zero = (5, 5, 0);
    zero = (0, 0, 0);
}

#[test]
fn zero_beside_the_greatest_numbers() {
    let mut table = ShaderTable::new();
    let generate = table.ray_generation(|_| panic!("there are no launches"));
    let pipeline = table.build(0).unwrap();
    let most = u32::MAX;
    for (width, height, depth) in [(most, most, 0), (0, most, most), (most, 0, most), (0, 0, most)]
    {
        pipeline.dispatch_rays(&nothing(), generate, width, height, depth).unwrap();
    }
}

#[test]
fn too_many_launches() {
    let mut table = ShaderTable::new();
    let generate = table.ray_generation(|_| panic!("nothing may run"));
    let pipeline = table.build(0).unwrap();
    for (width, height, depth) in
        [(1 << 15, 1 << 15, 2), (MAX_LAUNCHES as u32 + 1, 1, 1), (u32::MAX, u32::MAX, u32::MAX)]
    {
        let error = pipeline.dispatch_rays(&nothing(), generate, width, height, depth).unwrap_err();
        assert!(matches!(error, DispatchError::TooManyLaunches { launches, limit: MAX_LAUNCHES }
            if launches > MAX_LAUNCHES));
        assert!(error.to_string().contains("use several dispatches"), "{error}");
    }
}

#[test]
fn several_ray_generation_shaders() {
    let results = RwBuffer::<u32>::new(3);
    let mut table = ShaderTable::new();
    let all = &results;
    let shaders: Vec<_> = (0..3u32)
        .map(|n| {
            table.ray_generation(move |_| {
                all.atomic_add(n as usize, 10 + n);
            })
        })
        .collect();
    let pipeline = table.build(0).unwrap();
    for shader in [shaders[2], shaders[0], shaders[2]] {
        pipeline.dispatch_rays(&nothing(), shader, 1, 1, 1).unwrap();
    }
    drop(pipeline);
    assert_eq!(results.to_vec(), [10, 0, 24]);
}

#[test]
fn dispatches_at_the_same_time() {
    let total = RwBuffer::<u32>::new(1);
    let mut table = ShaderTable::new();
    let generate = table.ray_generation(|_| {
        total.atomic_add(0, 1);
    });
    let (pipeline, tlas) = (table.build(0).unwrap(), nothing());
    std::thread::scope(|scope| {
        for _ in 0..4 {
            scope.spawn(|| pipeline.dispatch_rays(&tlas, generate, 40, 25, 1).unwrap());
        }
    });
    drop(pipeline);
    assert_eq!(total.load(0), 4000);
}

#[test]
fn handle_of_another_pipeline() {
    let mut other = ShaderTable::new();
    let foreign = other.ray_generation(|_| {});
    let mut table = ShaderTable::new();
    table.ray_generation(|_| panic!("nothing may run"));
    let error = table.build(0).unwrap().dispatch_rays(&nothing(), foreign, 1, 1, 1).unwrap_err();
    assert_eq!(error, DispatchError::OtherRayGeneration);
    assert!(error.to_string().contains("another pipeline's; use the handle that `ray_generation`"));
}

#[test]
fn one_pipeline_over_several_structures() {
    use crate::scenes::{down, scene_of, sheet, triangles};
    let distances = RwBuffer::<f32>::new(2);
    let mut table = ShaderTable::new();
    let ray_type = table.ray_type::<f32>("ray", 0, 1, 0);
    table.no_miss();
    table.hit(
        &rayburst_pipeline::HitGroup::triangles("sheet")
            .closest_hit(|hit, t: &mut f32| *t = hit.t()),
        (),
    );
    let trace = |launch: &rayburst_pipeline::RayGeneration<'_>| {
        let mut t = -1.0;
        let ray = crate::harness::ray(&down(5.0));
        launch.trace_ray(ray_type, rayburst_accel::RayFlags::empty(), 0xFF, &ray, &mut t);
        t
    };
    let all = &distances;
    let first = table.ray_generation(move |launch| all.store(0, trace(launch)));
    let second = table.ray_generation(move |launch| all.store(1, trace(launch)));
    let pipeline = table.build(1).unwrap();
    for (shader, z) in [(first, 0.0), (second, 3.0)] {
        let scene = scene_of(vec![vec![triangles(vec![sheet(z)], true)]]);
        let tlas = structure(&scene, &BuildOptions::default());
        pipeline.dispatch_rays(&tlas, shader, 1, 1, 1).unwrap();
    }
    drop(pipeline);
    assert_eq!(distances.to_vec(), [5.0, 2.0]);
}
