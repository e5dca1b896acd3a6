//! Ray payloads: one value of any type, which all shaders of the ray but intersection shaders change.

use std::sync::Mutex;

use rayburst_accel::{BuildOptions, RayFlags, Tlas};
use rayburst_pipeline::{HitGroup, ShaderTable};

use crate::{
    harness::{once, ray, structure},
    scenes::{ball, down, scene_of, sheet, solids, triangles},
};

/// Two sheets, and a ball about a point of the z axis.
fn tlas(z: f64) -> Tlas {
    let geometries =
        vec![triangles(vec![sheet(0.0), sheet(1.0)], false), solids(vec![ball(z, 0.5)], false)];
    structure(&scene_of(vec![geometries]), &BuildOptions::default())
}

/// A payload goes through any hit, intersection and closest hit shaders, and comes back.
fn check<P: Clone + PartialEq + std::fmt::Debug + Send + Sync + 'static>(
    start: P,
    any_hit: fn(&mut P),
    closest_hit: fn(&mut P),
) -> P {
    let result = Mutex::new(start);
    {
        let mut table = ShaderTable::new();
        let ray_type = table.ray_type::<P>("ray", 0, 1, 0);
        table.no_miss();
        let group = HitGroup::triangles("sheets").any_hit(move |hit, payload: &mut P| {
            any_hit(payload);
            hit.ignore_hit()
        });
        table.hit(&group, ());
        let group = HitGroup::<P, ()>::procedural("ball", |shader| {
            assert!(shader.payload().is_some());
            assert!(shader.report_hit(8.0, 0, ()));
        });
        let group = group.any_hit(move |hit, payload| {
            any_hit(payload);
            hit.accept_hit()
        });
        table.hit(&group.closest_hit(move |_, payload| closest_hit(payload)), ());
        let generate = table.ray_generation(|launch| {
            let mut payload = result.lock().unwrap();
            launch.trace_ray(ray_type, RayFlags::empty(), 0xFF, &ray(&down(5.0)), &mut payload);
        });
        // Behind the sheets, so that these are asked in any order.
        once(table, &tlas(-3.0), generate);
    }
    result.into_inner().unwrap()
}

#[test]
fn of_four_bytes() {
    assert_eq!(check(1u32, |payload| *payload += 10, |payload| *payload *= 2), 62);
}

#[test]
fn of_a_kilobyte() {
    let result = check([0u32; 256], |payload| payload[255] += 1, |payload| payload[0] = 7);
    assert_eq!((result[0], result[255]), (7, 3));
    assert!(result[1..255].iter().all(|&word| word == 0));
}

#[test]
fn of_text() {
    let result = check("ray".to_owned(), |text| text.push('a'), |text| text.push_str(" hit"));
    assert_eq!(result, "rayaaa hit");
}

#[test]
fn of_a_list() {
    let result = check(vec![0u8], |list| list.push(1), |list| list.reverse());
    assert_eq!(result, [1, 1, 1, 0]);
}

#[test]
fn of_a_boxed_structure() {
    #[derive(Clone, Debug, Default, PartialEq)]
    struct Path {
        bounces: u32,
        next: Option<Box<Path>>,
    }
    let lengthen = |path: &mut Path| {
        path.bounces += 1;
        path.next = Some(Box::new(Path { bounces: path.bounces, next: path.next.take() }));
    };
    let result = check(Path::default(), lengthen, |path| path.bounces = 100);
    assert_eq!(result.bounces, 100);
    assert_eq!(result.next.map(|next| next.bounces), Some(3));
}

#[test]
fn of_no_bytes() {
    let calls = Mutex::new(0);
    let mut table = ShaderTable::new();
    let ray_type = table.ray_type::<()>("ray", 0, 0, 0);
    table.no_miss();
    let group =
        HitGroup::triangles("sheets").closest_hit(|_, (): &mut ()| *calls.lock().unwrap() += 1);
    table.hit(&group, ());
    let generate = table.ray_generation(|launch| {
        launch.trace_ray(ray_type, RayFlags::empty(), 0xFF, &ray(&down(5.0)), &mut ());
    });
    let scene = scene_of(vec![vec![triangles(vec![sheet(0.0)], false)]]);
    once(table, &structure(&scene, &BuildOptions::default()), generate);
    assert_eq!(*calls.lock().unwrap(), 1);
}

/// Two ray types with payloads of their own over the same structure, one traced inside the other.
#[test]
fn of_two_types() {
    let result = Mutex::new((0.0f32, false));
    let mut table = ShaderTable::new();
    let standard = table.ray_type::<f32>("standard", 0, 2, 0);
    let shadow = table.ray_type::<bool>("shadow", 1, 2, 1);
    table.miss("black", |_, colour: &mut f32| *colour = 0.0);
    table.miss("lit", |_, lit: &mut bool| *lit = true);
    let group = HitGroup::triangles("sheets").closest_hit(move |hit, colour: &mut f32| {
        let mut lit = false;
        let up = rayburst_math::Ray::new(hit.world_position() + 0.1 * glam::Vec3::Z, glam::Vec3::Z);
        let flags = RayFlags::SKIP_CLOSEST_HIT_SHADER;
        hit.trace_ray(shadow, flags, 0xFF, &up, &mut lit);
        *colour = if lit { 1.0 } else { 0.25 };
    });
    table.hit(&group, ());
    table.hit(&HitGroup::<bool>::triangles("sheets in shadow rays"), ());
    table.no_hit();
    let ball = HitGroup::<bool, ()>::procedural("ball in shadow rays", |shader| {
        let middle = shader.object_ray().origin.z;
        shader.report_hit(3.0 - middle, 0, ());
    });
    table.hit(&ball, ());
    let generate = table.ray_generation(|launch| {
        let mut colour = -1.0;
        launch.trace_ray(standard, RayFlags::empty(), 0xFF, &ray(&down(5.0)), &mut colour);
        let mut lit = false;
        let up = rayburst_math::Ray::new(glam::Vec3::new(0.0, 0.0, 4.0), glam::Vec3::Z);
        launch.trace_ray(shadow, RayFlags::empty(), 0xFF, &up, &mut lit);
        *result.lock().unwrap() = (colour, lit);
    });
    once(table, &tlas(3.0), generate);
    assert_eq!(*result.lock().unwrap(), (0.25, true));
}
