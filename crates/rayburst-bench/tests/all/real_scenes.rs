//! Ten thousand rays on each real scene against brute force.

use std::path::{Path, PathBuf};

use rayburst_accel::{
    AcceptAll, Blas, BuildOptions, BuildQuality, Layout, TraceOptions, TriangleMesh,
};
use rayburst_bench::FlatMesh;
use rayburst_math::{Ray, hash::Rng, warp};
use rayburst_scene::import::{LoadOptions, load};
use rayburst_testkit::Oracle;
use rayon::prelude::*;

const SCENES: [&str; 16] = [
    "sponza/sponza.gltf",
    "conference/conference.obj",
    "bathroom/bathroom.gltf",
    "hotel_room/hotel_room.glb",
    "lost_empire/lost_empire.obj",
    "stanford_dragon/dragon_vrip.ply",
    "armadillo/Armadillo.ply",
    "bunny/bun_zipper.ply",
    "scrub_pine/scrub_pine_forest.gltf",
    "cornell_box/CornellBox-Water.obj",
    "littlest_tokyo/LittlestTokyo.glb",
    "chess_board/chess_board.glb",
    "flight_helmet/FlightHelmet.gltf",
    "damaged_helmet/DamagedHelmet.glb",
    "fox/Fox.glb",
    "cesium_man/CesiumMan.glb",
];

const RAYS: usize = 10_000;

fn scenes() -> Option<PathBuf> {
    let root = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/scenes"));
    root.is_dir().then(|| root.to_owned())
}

#[test]
fn real_scenes_answer_as_brute_force_does() {
    let Some(root) = scenes() else {
        println!("skipped: the scenes are not here");
        return;
    };
    for name in SCENES {
        let scene = load(&root.join(name), &LoadOptions::default()).expect("loads");
        let mesh = FlatMesh::new(&scene).expect("fits 32-bit indices");
        drop(scene);
        let triangles = TriangleMesh::new(&mesh.positions, &mesh.indices);
        let oracle = Oracle::new(&mesh.positions, &mesh.indices);
        let bounds = mesh.bounds();
        let mut rng = Rng::new(5);
        let rays: Vec<Ray> = (0..RAYS)
            .map(|_| {
                let origin = bounds.lower + bounds.extent() * rng.vec3();
                Ray::new(origin, warp::uniform_sphere(rng.vec2()))
            })
            .collect();
        for (quality, layout) in [
            (BuildQuality::Balanced, Layout::Wide),
            (BuildQuality::Best, Layout::Wide),
            (BuildQuality::Balanced, Layout::Compressed),
        ] {
            let options = BuildOptions { quality, layout, ..BuildOptions::default() };
            let blas = Blas::build(&[triangles], &options).expect("builds");
            blas.validate().expect("valid");
            rays.par_iter().for_each(|ray| {
                let hit = blas.closest_hit(ray, &TraceOptions::default(), &AcceptAll);
                if let Err(wrong) = oracle.verdict(ray).check_hit(&hit) {
                    panic!("{name}: {ray:?}: {hit:?}: {wrong}");
                }
                assert_eq!(
                    blas.any_hit(ray, &TraceOptions::default(), &AcceptAll),
                    hit.is_hit(),
                    "{name}: {ray:?}"
                );
            });
        }
    }
}
