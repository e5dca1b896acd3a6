//! State object validation: each error, and what its message names.

use std::sync::Mutex;

use glam::UVec3;
use rayburst_accel::{BuildOptions, RayFlags, Tlas};
use rayburst_pipeline::{DispatchError, HitGroup, PipelineError, ShaderTable};

use crate::{
    harness::{ray, structure},
    model::Geometry,
    scenes::{ball, down, scene_of, sheet, solids, triangles},
};

struct Payload;
struct Other;

fn sheets() -> Geometry {
    triangles(vec![sheet(0.0)], false)
}

fn balls() -> Geometry {
    solids(vec![ball(0.0, 1.0)], false)
}

/// Two instances; the second has another contribution.
fn tlas(geometries: Vec<Geometry>, contribution: u32) -> Tlas {
    let mut scene = scene_of(vec![geometries]);
    let second = crate::model::Instance { contribution, ..scene.instances[0].clone() };
    scene.instances.push(second);
    structure(&scene, &BuildOptions::default())
}

fn names(error: &PipelineError, parts: &[&str]) {
    let message = error.to_string();
    for part in parts {
        assert!(message.contains(part), "'{part}' is not in: {message}");
    }
}

/// What a table says of a structure: nothing may run.
fn check(mut table: ShaderTable<'_>, tlas: &Tlas) -> PipelineError {
    let generate = table.ray_generation(|_| panic!("nothing may run"));
    let pipeline = table.build(1).expect("the table is right by itself");
    let error = pipeline.check(tlas).expect_err("the structure does not fit");
    let of_dispatch = pipeline.dispatch_rays(tlas, generate, 4, 4, 1);
    assert_eq!(of_dispatch, Err(DispatchError::Pipeline(error.clone())));
    assert_eq!(of_dispatch.unwrap_err().to_string(), error.to_string());
    error
}

#[test]
fn recursion_depth() {
    let error = ShaderTable::new().build(40).err().unwrap();
    assert_eq!(error, PipelineError::RecursionDepth { depth: 40, limit: 31 });
    names(&error, &["depth of 40", "0 to 31"]);
}

macro_rules! too_large {
    ($($name:ident = $what:literal, ($contribution:literal, $multiplier:literal, $miss:literal), $value:literal, $limit:literal;)*) => {
        $(
            #[test]
            fn $name() {
                let mut table = ShaderTable::new();
                table.ray_type::<Payload>("glossy", $contribution, $multiplier, $miss);
                table.no_miss();
                let error = table.build(1).err().unwrap();
                let ray_type = "glossy".to_owned();
                let (what, value, limit) = ($what, $value, $limit);
                assert_eq!(error, PipelineError::TooLarge { ray_type, what, value, limit });
                names(&error, &["'glossy'", $what, stringify!($value), stringify!($limit)]);
            }
        )*
    };
}

too_large! {
    contribution_too_large = "contribution", (16, 0, 0), 16, 15;
    multiplier_too_large = "multiplier", (15, 16, 0), 16, 15;
    miss_index_too_large = "miss index", (15, 15, 65536), 65536, 65535;
    contribution_far_too_large = "contribution", (4294967295, 0, 0), 4294967295, 15;
}

#[test]
fn greatest_numbers_are_allowed() {
    let mut table = ShaderTable::new();
    for _ in 0..65536 {
        table.no_miss();
    }
    table.ray_type::<Payload>("ray", 15, 15, 65535);
    assert!(table.build(31).is_ok());
}

#[test]
fn no_miss_record() {
    let mut table = ShaderTable::new();
    table.ray_type::<Payload>("shadow", 0, 1, 2);
    table.no_miss();
    table.no_miss();
    let error = table.build(1).err().unwrap();
    let ray_type = "shadow".to_owned();
    assert_eq!(error, PipelineError::NoMissRecord { ray_type, index: 2, records: 2 });
    names(&error, &["'shadow'", "miss record 2", "there are 2", "`miss`", "`no_miss`"]);
}

#[test]
fn miss_payload() {
    let mut table = ShaderTable::new();
    table.ray_type::<Payload>("camera", 0, 1, 1);
    table.no_miss();
    table.miss("sky", |_, _: &mut Other| {});
    let error = table.build(1).err().unwrap();
    assert!(matches!(&error, PipelineError::MissPayload { index: 1, .. }));
    let parts = [
        "miss record 1",
        "'sky'",
        "Other",
        "'camera'",
        "Payload",
        "change the ray type's miss index",
    ];
    names(&error, &parts);
}

#[test]
fn no_hit_record() {
    let mut table = ShaderTable::new();
    table.ray_type::<Payload>("camera", 1, 2, 0);
    table.no_miss();
    for _ in 0..4 {
        table.no_hit();
    }
    let error = check(table, &tlas(vec![sheets(), sheets()], 5));
    let ray_type = "camera".to_owned();
    let expected =
        PipelineError::NoHitRecord { ray_type, instance: 1, geometry: 0, index: 6, records: 4 };
    assert_eq!(error, expected);
    let parts = [
        "'camera'",
        "geometry 0 of instance 1",
        "hit record 6",
        "there are 4",
        "`hit`",
        "`no_hit`",
        "the instance's contribution",
    ];
    names(&error, &parts);
}

#[test]
fn hit_payload() {
    let mut table = ShaderTable::new();
    table.ray_type::<Payload>("camera", 0, 1, 0);
    table.no_miss();
    table.hit(&HitGroup::<Payload>::triangles("grass"), ());
    table.hit(&HitGroup::<Other>::triangles("water"), ());
    let error = check(table, &tlas(vec![sheets(), sheets()], 0));
    assert!(matches!(
        &error,
        PipelineError::HitPayload { instance: 0, geometry: 1, index: 1, group, .. } if group == "water"
    ));
    let parts = [
        "hit record 1",
        "'water'",
        "Other",
        "'camera'",
        "geometry 1 of instance 0",
        "Payload",
        "change the ray type's contribution or multiplier, the instance's contribution, or the group",
    ];
    names(&error, &parts);
}

#[test]
fn hit_kind_of_triangles() {
    let mut table = ShaderTable::new();
    table.ray_type::<Payload>("camera", 0, 1, 0);
    table.no_miss();
    table.hit(&HitGroup::<Payload, ()>::procedural("spheres", |_| {}), ());
    let error = check(table, &tlas(vec![sheets()], 0));
    assert!(matches!(
        &error,
        PipelineError::HitKind { index: 0, constructor: "HitGroup::triangles", .. }
    ));
    let parts = [
        "hit record 0",
        "'spheres'",
        "for procedural primitives",
        "geometry 0 of instance 0 consists of triangles",
        "'camera'",
        "`HitGroup::triangles`",
    ];
    names(&error, &parts);
}

#[test]
fn hit_kind_of_procedural_primitives() {
    let mut table = ShaderTable::new();
    table.ray_type::<Payload>("camera", 0, 1, 0);
    table.no_miss();
    table.hit(&HitGroup::<Payload>::triangles("leaves"), ());
    table.hit(&HitGroup::<Payload>::triangles("leaves"), ());
    let error = check(table, &tlas(vec![sheets(), balls()], 0));
    assert!(matches!(
        &error,
        PipelineError::HitKind { index: 1, constructor: "HitGroup::procedural", .. }
    ));
    let parts = ["'leaves'", "for triangles", "consists of procedural", "`HitGroup::procedural`"];
    names(&error, &parts);
}

#[test]
fn instance_contribution_too_large() {
    let mut table = ShaderTable::new();
    table.no_miss();
    let error = check(table, &tlas(vec![sheets()], 1 << 24));
    let (what, value, limit) = ("contribution", 1 << 24, (1 << 24) - 1);
    assert_eq!(error, PipelineError::InstanceTooLarge { instance: 1, what, value, limit });
    names(&error, &["instance 1", "contribution", "16777216", "24 bits", "16777215"]);
}

#[test]
fn instance_id_too_large() {
    let mut scene = scene_of(vec![vec![sheets()]]);
    scene.instances[0].id = u32::MAX;
    let tlas = structure(&scene, &BuildOptions::default());
    let error = check(ShaderTable::new(), &tlas);
    let (what, value, limit) = ("id", u32::MAX, (1 << 24) - 1);
    assert_eq!(error, PipelineError::InstanceTooLarge { instance: 0, what, value, limit });
    names(&error, &["instance 0", "id of 4294967295", "24 bits"]);
}

/// Null records fit everything.
#[test]
fn null_records_fit() {
    let mut table = ShaderTable::new();
    table.ray_type::<Payload>("camera", 0, 1, 0);
    table.ray_type::<Other>("shadow", 0, 1, 0);
    table.no_miss();
    table.no_hit();
    table.no_hit();
    let pipeline = table.build(1).unwrap();
    assert_eq!(pipeline.check(&tlas(vec![sheets(), balls()], 0)), Ok(()));
}

/// Ray types that are never traced are checked too: a trace cannot fail.
#[test]
fn every_ray_type_is_checked() {
    let mut table = ShaderTable::new();
    table.ray_type::<Payload>("camera", 0, 1, 0);
    table.ray_type::<Other>("shadow", 0, 1, 1);
    table.miss("sky", |_, _: &mut Payload| {});
    table.miss("light", |_, _: &mut Other| {});
    table.hit(&HitGroup::<Payload>::triangles("wall"), ());
    let error = check(table, &tlas(vec![sheets()], 0));
    assert!(matches!(&error, PipelineError::HitPayload { ray_type, .. } if ray_type == "shadow"));
}

/// A handle of another pipeline's ray type, with the same name and payload as this one's.
#[test]
fn ray_type_of_another_pipeline() {
    let mut other = ShaderTable::new();
    let foreign = other.ray_type::<u32>("camera", 0, 1, 0);
    let mut table = ShaderTable::new();
    table.ray_type::<u32>("camera", 0, 1, 0);
    table.miss("sky", |_, _: &mut u32| panic!("nothing is traced"));
    table.no_hit();
    let generate = table.ray_generation(|launch| {
        launch.trace_ray(foreign, RayFlags::empty(), 0xFF, &ray(&down(5.0)), &mut 0);
    });
    let pipeline = table.build(1).unwrap();
    let error = pipeline.dispatch_rays(&tlas(vec![sheets()], 0), generate, 2, 2, 1).unwrap_err();
    assert_eq!(error, DispatchError::OtherPipeline { launch: UVec3::ZERO, payload: "u32" });
    assert!(
        error
            .to_string()
            .contains("a type that is another pipeline's; use the handle that `ray_type`"),
        "{error}"
    );
}

/// A handle of another pipeline's ray type with another payload: the shaders do not run.
#[test]
fn payload_of_another_pipeline() {
    let foreign = ShaderTable::new().ray_type::<String>("text", 0, 1, 0);
    let value = Mutex::new(String::new());
    for geometry in [sheets(), balls()] {
        let is_ball = matches!(geometry.shape, crate::model::Shape::Solids(_));
        for upwards in [false, true] {
            let mut table = ShaderTable::new();
            table.ray_type::<u32>("camera", 0, 1, 0);
            table.miss("sky", |_, _: &mut u32| panic!("of another payload"));
            if is_ball {
                let group = HitGroup::<u32, ()>::procedural("ball", |shader| {
                    panic!("of another payload: {:?}", shader.payload());
                });
                table.hit(&group.closest_hit(|_, _| panic!("of another payload")), ());
            } else {
                let group = HitGroup::triangles("sheet")
                    .any_hit(|_, _: &mut u32| panic!("of another payload"))
                    .closest_hit(|_, _| panic!("of another payload"));
                table.hit(&group, ());
            }
            let generate = table.ray_generation(|launch| {
                let mut ray = ray(&down(5.0));
                if upwards {
                    ray.direction *= -1.0;
                }
                let mut text = "as it was".to_owned();
                launch.trace_ray(foreign, RayFlags::empty(), 0xFF, &ray, &mut text);
                *value.lock().unwrap() = text;
            });
            let tlas = tlas(vec![geometry.clone()], 0);
            let pipeline = table.build(1).unwrap();
            let error = pipeline.dispatch_rays(&tlas, generate, 1, 1, 1).unwrap_err();
            let launch = UVec3::ZERO;
            assert!(
                matches!(error, DispatchError::OtherPipeline { launch: at, .. } if at == launch)
            );
            drop(pipeline);
            assert_eq!(*value.lock().unwrap(), "as it was");
        }
    }
}
