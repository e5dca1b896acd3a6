//! Callable shaders and `CallShader`.

use std::sync::{Mutex, OnceLock};

use glam::{UVec3, Vec3};
use rayburst_accel::RayFlags;
use rayburst_math::Ray;
use rayburst_pipeline::{CallableId, DispatchError, HitGroup, RwBuffer, ShaderTable};

use crate::{
    dispatch_rays::{nothing, with_threads},
    harness::{once, ray, structure},
    scenes::down,
    trace_ray::both,
};

#[test]
fn parameters_come_back() {
    #[derive(Clone, Debug, Default, PartialEq)]
    struct Parameters {
        input: Vec3,
        name: String,
        output: Option<f32>,
    }
    let result = Mutex::new(Parameters::default());
    let mut table = ShaderTable::new();
    let length = table.callable(|_, data: &mut Parameters| {
        data.output = Some(data.input.length());
        data.name += " was called";
    });
    let generate = table.ray_generation(|launch| {
        let input = Vec3::new(3.0, 4.0, 0.0);
        let mut data = Parameters { input, name: "length".to_owned(), output: None };
        launch.call_shader(length, &mut data);
        *result.lock().unwrap() = data;
    });
    once(table, &nothing(), generate);
    let result = result.lock().unwrap();
    assert_eq!((result.output, &result.name[..]), (Some(5.0), "length was called"));
}

#[test]
fn from_ray_generation_closest_hit_miss_and_callable() {
    let tlas = structure(&both(), &Default::default());
    let calls = Mutex::new(vec![]);
    let mut table = ShaderTable::new();
    let ray_type = table.ray_type::<Vec<&'static str>>("ray", 0, 1, 0);
    let note = table.callable(|_, notes: &mut Vec<&'static str>| notes.push("called"));
    let twice = table.callable(move |shader, notes: &mut Vec<&'static str>| {
        shader.call_shader(note, notes);
        shader.call_shader(note, notes);
    });
    table.miss("miss", move |miss, notes: &mut Vec<&'static str>| {
        notes.push("miss");
        miss.call_shader(note, notes);
    });
    let group = HitGroup::triangles("sheet").closest_hit(move |hit, notes: &mut Vec<_>| {
        notes.push("hit");
        hit.call_shader(twice, notes);
    });
    table.hit(&group, ());
    table.no_hit();
    let generate = table.ray_generation(|launch| {
        let mut notes = vec!["begin"];
        launch.call_shader(note, &mut notes);
        launch.trace_ray(ray_type, RayFlags::empty(), 0xFF, &ray(&down(5.0)), &mut notes);
        let up = Ray::new(Vec3::ZERO, Vec3::Z);
        launch.trace_ray(ray_type, RayFlags::empty(), 0xFF, &up, &mut notes);
        *calls.lock().unwrap() = notes;
    });
    once(table, &tlas, generate);
    let expected = ["begin", "called", "hit", "called", "called", "miss", "called"];
    assert_eq!(*calls.lock().unwrap(), expected);
}

#[test]
fn launch_index_and_dimensions() {
    let mut table = ShaderTable::new();
    let check = table.callable(|shader, at: &mut UVec3| {
        assert_eq!(shader.launch_index(), *at);
        assert_eq!(shader.launch_dimensions(), UVec3::new(5, 4, 3));
        *at += 1;
    });
    let generate = table.ray_generation(|launch| {
        let mut at = launch.launch_index();
        launch.call_shader(check, &mut at);
        assert_eq!(at, launch.launch_index() + 1);
    });
    table.build(0).unwrap().dispatch_rays(&nothing(), generate, 5, 4, 3).unwrap();
}

/// What a shader that calls itself `depth` times counts, and what the dispatch says.
fn nested(depth: u32) -> (u32, Result<(), DispatchError>) {
    let count = RwBuffer::<u32>::new(1);
    let own = OnceLock::new();
    let mut table = ShaderTable::new();
    let handle: CallableId<u32> = table.callable(|shader, left: &mut u32| {
        count.atomic_add(0, 1);
        *left -= 1;
        if let Some(own) = own.get().filter(|_| *left > 0) {
            shader.call_shader(*own, left);
        }
    });
    own.set(handle).unwrap();
    let generate = table.ray_generation(|launch| launch.call_shader(handle, &mut depth.clone()));
    let result = table.build(0).unwrap().dispatch_rays(&nothing(), generate, 1, 1, 1);
    (count.load(0), result)
}

#[test]
fn recursion_of_31() {
    assert_eq!(nested(1), (1, Ok(())));
    assert_eq!(nested(31), (31, Ok(())));
}

#[test]
fn recursion_of_32_fails() {
    for depth in [32, 100] {
        let (count, result) = nested(depth);
        assert_eq!(count, 31, "nothing is called beyond");
        let error = result.unwrap_err();
        assert_eq!(error, DispatchError::CallableDepth { launch: UVec3::ZERO });
        assert!(error.to_string().contains("more than 31 deep"), "{error}");
    }
}

#[test]
fn the_first_failing_launch_is_named() {
    let own = OnceLock::new();
    let mut table = ShaderTable::new();
    let handle: CallableId<u32> = table.callable(|shader, data: &mut u32| {
        if let Some(own) = own.get() {
            shader.call_shader(*own, data);
        }
    });
    own.set(handle).unwrap();
    let generate = table.ray_generation(|launch| {
        let at = launch.launch_index();
        if at.x + at.y >= 9 {
            launch.call_shader(handle, &mut 0);
        }
    });
    let pipeline = table.build(0).unwrap();
    for threads in [1, 2, 4] {
        with_threads(threads, || {
            let error = pipeline.dispatch_rays(&nothing(), generate, 40, 30, 1).unwrap_err();
            assert_eq!(error, DispatchError::CallableDepth { launch: UVec3::new(9, 0, 0) });
        });
    }
}

#[test]
fn handle_of_another_pipeline() {
    let mut other = ShaderTable::new();
    let foreign = other.callable(|_, _: &mut u32| {});
    let mut table = ShaderTable::new();
    table.callable(|_, _: &mut u32| panic!("not called"));
    let generate = table.ray_generation(|launch| launch.call_shader(foreign, &mut 7));
    let error = table.build(0).unwrap().dispatch_rays(&nothing(), generate, 1, 1, 1).unwrap_err();
    assert_eq!(error, DispatchError::OtherCallable { launch: UVec3::ZERO, data: "u32" });
    assert!(error.to_string().contains("another pipeline's; use the handle"), "{error}");
}

#[test]
fn handle_of_another_pipeline_with_other_parameters() {
    let foreign = ShaderTable::new().callable(|_, _: &mut String| {});
    let mut table = ShaderTable::new();
    table.callable(|_, _: &mut u32| panic!("not called"));
    let generate = table.ray_generation(|launch| launch.call_shader(foreign, &mut String::new()));
    let error = table.build(0).unwrap().dispatch_rays(&nothing(), generate, 1, 1, 1).unwrap_err();
    assert!(matches!(error, DispatchError::OtherCallable { launch: UVec3::ZERO, .. }));
    assert!(error.to_string().contains("launch [0, 0, 0] calls a callable shader"), "{error}");
}

/// Each launch has its own parameters, whatever runs at the same time.
#[test]
fn launches_do_not_share_parameters() {
    let sums = RwBuffer::<u32>::new(2000);
    let mut table = ShaderTable::new();
    let square = table.callable(|_, data: &mut u32| *data *= *data);
    let generate = table.ray_generation(|launch| {
        let mut data = launch.launch_index().x;
        launch.call_shader(square, &mut data);
        sums.store(launch.launch_index().x as usize, data);
    });
    table.build(0).unwrap().dispatch_rays(&nothing(), generate, 2000, 1, 1).unwrap();
    assert!(sums.to_vec().into_iter().zip(0..).all(|(sum, x): (u32, u32)| sum == x * x));
}
