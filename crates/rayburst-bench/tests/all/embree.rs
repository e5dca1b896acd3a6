//! Every configuration of Embree finds what Rayburst finds; `RAYBURST_EMBREE` names its library.

use std::{collections::HashMap, path::PathBuf, sync::Arc};

use rayburst_accel::{AcceptAll, Blas, BuildOptions, TraceOptions, TriangleMesh};
use rayburst_bench::{
    Engine, FlatMesh, Query,
    peers::embree::{Config, Embree, EmbreeEngine},
};
use rayburst_math::{Hit, Ray, hash::Rng};
use rayburst_testkit::meshes;

/// No multiple of a packet.
const RAYS: usize = 10_003;

#[test]
fn embree_finds_the_same_hits() {
    let Some(library) = std::env::var_os("RAYBURST_EMBREE").map(PathBuf::from) else {
        println!("skipped: RAYBURST_EMBREE does not name Embree's library");
        return;
    };
    let mesh = meshes::all().into_iter().find(|mesh| mesh.inside.is_some()).expect("a closed mesh");
    let flat =
        FlatMesh { positions: mesh.positions.clone(), indices: mesh.indices.clone(), light: None };
    let bounds = mesh.bounds();
    let mut rng = Rng::new(3);
    let rays: Vec<Ray> = (0..RAYS)
        .map(|i| {
            let origin = bounds.centre() + 2.0 * bounds.extent() * (rng.vec3() - 0.5);
            let target = bounds.lower + bounds.extent() * rng.vec3();
            // Some end before they meet anything.
            let t_max = if i % 3 == 0 { 0.5 } else { f32::INFINITY };
            Ray::with_interval(origin, target - origin, 0.0, t_max)
        })
        .collect();
    let triangles = [TriangleMesh::new(&flat.positions, &flat.indices)];
    let blas = Blas::build(&triangles, &BuildOptions::default()).expect("builds");
    let mut expected = vec![Hit::MISS; RAYS];
    blas.closest_hits(&rays, &mut expected, &TraceOptions::default(), &AcceptAll);
    let count = expected.iter().filter(|hit| hit.is_hit()).count();
    assert!(count > RAYS / 10 && count < RAYS * 9 / 10, "{count}");

    let embree = Embree::load(&library, 1).expect("loads");
    let before = embree.memory();
    let geometry = embree.geometry(&flat).expect("is copied");
    assert!(embree.memory() > before, "its memory is counted");
    let mut scenes = HashMap::new();
    for config in Config::all() {
        let scene = scenes.entry(config.scene).or_insert_with(|| {
            let (scene, time, bytes) = geometry.build(config.scene).expect("builds");
            assert!(!time.is_zero() && bytes > 0, "{config}");
            Arc::new(scene)
        });
        let engine = EmbreeEngine::new(scene.clone(), config);
        let (mut hits, mut occluded) = (vec![Hit::MISS; RAYS], vec![false; RAYS]);
        engine.trace(Query::Closest, &rays, &mut hits, &mut []);
        engine.trace(Query::Any, &rays, &mut [], &mut occluded);
        let mut different = 0;
        for ((hit, occluded), expected) in hits.iter().zip(&occluded).zip(&expected) {
            assert_eq!(*occluded, hit.is_hit(), "{config}");
            let same = hit.is_hit() == expected.is_hit()
                && (!hit.is_hit()
                    || ((hit.t - expected.t).abs() <= 1e-3 * expected.t.abs()
                        && (hit.u - expected.u).abs().max((hit.v - expected.v).abs()) < 0.01
                        && (hit.primitive, hit.geometry)
                            == (expected.primitive, expected.geometry)));
            different += usize::from(!same);
        }
        assert!(different <= RAYS / 500, "{config}: {different} rays differ");
    }
}

#[test]
fn embree_fits_a_mesh_anew() {
    let Some(library) = std::env::var_os("RAYBURST_EMBREE").map(PathBuf::from) else {
        println!("skipped: RAYBURST_EMBREE does not name Embree's library");
        return;
    };
    let embree = Embree::load(&library, 1).expect("loads");
    let mesh = meshes::all().swap_remove(0);
    let flat = FlatMesh { positions: mesh.positions, indices: mesh.indices, light: None };
    let geometry = embree.geometry(&flat).expect("is copied");
    let mut scene = geometry.build_refittable().expect("builds");
    for _ in 0..3 {
        assert!(!scene.refit().expect("refits").is_zero());
    }
}
