//! Queries that stop at candidates: what they commit is what brute force finds.

use std::sync::Arc;

use glam::{Affine3A, Vec3};
use rayburst_accel::{
    AcceptAll, Blas, BuildOptions, BuildQuality, CandidateType, CommittedStatus, Instance,
    IsaLevel, ProceduralBoxes, RayFlags, RayQuery, Tlas, TraceOptions, TriangleMesh,
};
use rayburst_math::{Aabb, Hit, HitKind, Ray};

use crate::{
    meshes::{Mesh, Random, all_builds, needles, ray_at, soup, with_isa, with_quality},
    mixed::{
        Ends, Part, Probe, Rules, World, blas, local, passes, primitives, sphere_hits, spheres,
    },
    oracle::check_closest,
};

const ANY: TraceOptions = TraceOptions::DEFAULT;

/// What is traced: parts by instance.
struct Scene<'a> {
    instances: Vec<(Instance, &'a [Part])>,
}

impl<'a> Scene<'a> {
    fn of_world(world: &'a World) -> Self {
        let parts = |instance: &Instance| &world.parts[instance.blas as usize][..];
        Self { instances: world.instances.iter().map(|i| (*i, parts(i))).collect() }
    }

    fn of_parts(parts: &'a [Part]) -> Self {
        Self { instances: vec![(Instance::new(0, Affine3A::IDENTITY), parts)] }
    }

    /// All hits of spheres, whatever the options, for a ray in the space of each instance.
    fn sphere_hits(&self, local: impl Fn(u32) -> Ray) -> Vec<Hit> {
        let mut hits = vec![];
        for ((_, parts), instance) in self.instances.iter().zip(0..) {
            let ray = local(instance);
            for b in primitives(parts) {
                let kind = HitKind::procedural(0);
                let (primitive, geometry) = (b.primitive, b.geometry);
                let hit = Hit { primitive, geometry, instance, kind, ..Hit::MISS };
                let inside = |t: &f32| ray.t_min <= *t && *t <= ray.t_max && t.is_finite();
                let both = sphere_hits(&b.bounds, &ray).into_iter().flatten().filter(inside);
                hits.extend(both.map(|t| Hit { t, ..hit }));
            }
        }
        hits
    }

    /// Whether a hit is opaque, if it is there under the rules.
    fn opacity(&self, hit: &Hit, rules: &Rules) -> Option<bool> {
        let (instance, parts) = &self.instances[hit.instance as usize];
        let part = &parts[hit.geometry as usize];
        if hit.kind.is_triangle() {
            rules.triangle(instance, part, hit)
        } else {
            rules.opacity(instance, part.is_opaque()).filter(|_| !rules.skips_boxes)
        }
    }

    fn bounds(&self, hit: &Hit) -> Aabb {
        let (_, parts) = &self.instances[hit.instance as usize];
        match &parts[hit.geometry as usize] {
            Part::Boxes(boxes, _) => boxes[hit.primitive as usize],
            Part::Triangles(..) => panic!("{hit:?} is no procedural primitive"),
        }
    }
}

/// The candidate as a hit; infinite `t` if it is procedural.
fn candidate(query: &RayQuery<'_>) -> Hit {
    let hit = Hit {
        primitive: query.candidate_primitive_index().unwrap(),
        geometry: query.candidate_geometry_index().unwrap(),
        instance: query.candidate_instance_index().unwrap(),
        kind: HitKind::procedural(0),
        ..Hit::MISS
    };
    match query.candidate_type().unwrap() {
        CandidateType::ProceduralPrimitive => {
            assert_eq!(query.candidate_triangle_ray_t(), None);
            assert_eq!(query.candidate_triangle_barycentrics(), None);
            assert_eq!(query.candidate_triangle_front_face(), None);
            hit
        }
        CandidateType::NonOpaqueTriangle => {
            assert_eq!(query.candidate_procedural_primitive_non_opaque(), None);
            let [u, v] = query.candidate_triangle_barycentrics().unwrap().to_array();
            let front = query.candidate_triangle_front_face().unwrap();
            let kind = if front { HitKind::TRIANGLE_FRONT } else { HitKind::TRIANGLE_BACK };
            Hit { t: query.candidate_triangle_ray_t().unwrap(), u, v, kind, ..hit }
        }
    }
}

/// Runs a query to its end; `decide` says what is committed. Checks candidates on the way.
fn finish(
    query: &mut RayQuery<'_>,
    scene: &Scene<'_>,
    rules: &Rules,
    mut decide: impl FnMut(&Hit) -> bool,
) -> Hit {
    while query.proceed() {
        let found = candidate(query);
        let opaque = scene.opacity(&found, rules).expect("what is left out is no candidate");
        if found.kind.is_triangle() {
            assert!(!opaque && found.t <= query.committed_ray_t());
            if decide(&found) {
                assert!(query.commit_non_opaque_triangle_hit());
                assert_eq!(query.committed(), found);
            }
            continue;
        }
        assert_eq!(query.candidate_procedural_primitive_non_opaque(), Some(!opaque));
        let origin = query.candidate_object_ray_origin().unwrap();
        let direction = query.candidate_object_ray_direction().unwrap();
        let ray = Ray { origin, direction, ..*query.ray() };
        // The farther one first, so that it has to give way.
        for t in sphere_hits(&scene.bounds(&found), &ray).into_iter().flatten().rev() {
            let before = query.committed();
            let hit = Hit { t, ..found };
            if decide(&hit) {
                let committed = query.commit_procedural_primitive_hit(t);
                assert_eq!(query.committed(), if committed { hit } else { before });
            }
        }
    }
    assert_eq!(query.candidate_type(), None);
    assert!(!query.proceed());
    query.committed()
}

fn first<'a>(hits: impl Iterator<Item = &'a Hit>) -> Hit {
    hits.fold(Hit::MISS, |best, hit| if hit.precedes(&best) { *hit } else { best })
}

fn rays(seed: u64, count: usize) -> Vec<Ray> {
    let mut random = Random::new(seed);
    let ray = |i: usize| {
        let ray = ray_at(&mut random, Vec3::ZERO, 1.0);
        match i % 10 {
            0 => Ray { t_min: -2.0, ..ray },
            1 => Ray { t_max: random.unit(), ..ray },
            2 => Ray { direction: ray.direction * 1e-20, ..ray },
            3 => Ray { direction: Vec3::Z, ..ray },
            4 if i % 50 == 4 => Ray { t_max: f32::NAN, ..ray },
            5 if i % 50 == 5 => Ray { origin: Vec3::splat(f32::INFINITY), ..ray },
            6 if i % 50 == 6 => Ray { t_min: 2.0, t_max: 1.0, ..ray },
            _ => ray,
        }
    };
    (0..count).map(ray).collect()
}

/// No flag, each flag, and every pair of flags.
fn some_flags() -> Vec<RayFlags> {
    let all: Vec<_> = RayFlags::all().iter().collect();
    assert_eq!(all.len(), 10);
    let mut some = vec![RayFlags::empty()];
    for (i, &flag) in all.iter().enumerate() {
        some.push(flag);
        some.extend(all[..i].iter().map(|&other| flag | other));
    }
    some
}

/// Whether a triangle is strictly within the interval, as queries want it.
fn is_inside(hit: &Hit, ray: &Ray) -> bool {
    ray.t_min < hit.t && hit.t < ray.t_max
}

#[test]
fn all_flags_commit_what_brute_force_finds() {
    let world = World::new(300, spheres);
    let scene = Scene::of_world(&world);
    let rays = rays(301, 300);
    let mut statuses = [0; 3];
    for isa in IsaLevel::available() {
        let tlas = world.tlas(&with_isa(isa));
        let mut everything = vec![];
        for ray in &rays {
            let mut hits = vec![];
            tlas.all_hits(ray, &ANY, &AcceptAll, &mut hits);
            hits.retain(|hit| is_inside(hit, ray));
            if ray.is_valid() {
                hits.extend(scene.sphere_hits(|instance| local(&tlas, instance, ray)));
            }
            everything.push(hits);
        }
        let mut query = RayQuery::new(&tlas, RayFlags::empty(), 0xFF, &rays[0]);
        for (flags, mask) in some_flags().into_iter().zip([0xFF, 0x3C, 0x81].into_iter().cycle()) {
            let rules = Rules::of_flags(flags, mask);
            for (ray, hits) in rays.iter().zip(&everything) {
                let is_there = |hit: &&Hit| match scene.opacity(hit, &rules) {
                    Some(opaque) => passes(hit) || opaque && hit.kind.is_triangle(),
                    None => false,
                };
                query.restart(flags, mask, ray);
                let hit = finish(&mut query, &scene, &rules, passes);
                if flags.contains(RayFlags::ACCEPT_FIRST_HIT_AND_END_SEARCH) {
                    let is_one = hits.iter().filter(is_there).any(|other| *other == hit);
                    let none = !hit.is_hit() && !hits.iter().any(|hit| is_there(&hit));
                    assert!(is_one || none, "{flags:?} {ray:?} {hit:?}");
                } else {
                    let expected = first(hits.iter().filter(is_there));
                    assert_eq!(hit, expected, "{flags:?} {ray:?}");
                }
                statuses[query.committed_status() as usize] += 1;
            }
        }
    }
    assert!(statuses.iter().all(|&count| count > 3000), "{statuses:?}");
}

#[test]
fn triangles_are_those_of_a_filter_and_of_brute_force() {
    let mesh = soup(310, 400, 0.4);
    let parts = [Part::Triangles(mesh.clone(), false)];
    let scene = Scene::of_parts(&parts);
    let flags = RayFlags::empty();
    let rules = Rules::of_flags(flags, 0xFF);
    let filter = Probe::new(passes, Ends::Never);
    let world = World::new(311, spheres);
    let of_world = Scene::of_world(&world);
    let mut hit_count = 0;
    for isa in IsaLevel::available() {
        let (blas, tlas) = (blas(&parts, &with_isa(isa)), world.tlas(&with_isa(isa)));
        for ray in &rays(312, 600) {
            let mut query = RayQuery::of_blas(&blas, flags, ray);
            let hit = finish(&mut query, &scene, &rules, |_| true);
            if ray.is_valid() {
                check_closest(&mesh, ray, &hit).unwrap();
            }
            assert_eq!(hit, blas.closest_hit(ray, &ANY, &AcceptAll));
            let mut query = RayQuery::of_blas(&blas, flags, ray);
            let hit = finish(&mut query, &scene, &rules, passes);
            assert_eq!(hit, blas.closest_hit(ray, &ANY, &filter));
            let flags = RayFlags::SKIP_PROCEDURAL_PRIMITIVES | RayFlags::CULL_BACK_FACING_TRIANGLES;
            let rules = Rules::of_flags(flags, 0x7F);
            let mut query = RayQuery::new(&tlas, flags, 0x7F, ray);
            let hit = finish(&mut query, &of_world, &rules, passes);
            assert_eq!(hit, tlas.closest_hit(ray, &flags.options(0x7F), &filter));
            hit_count += usize::from(hit.is_hit());
        }
    }
    assert!(hit_count > 300, "{hit_count}");
}

#[test]
fn the_order_of_candidates_changes_no_answer() {
    // Every primitive twice, so that there are ties.
    let (solid, glass) = (soup(320, 60, 0.5), soup(321, 60, 0.5));
    let boxes = spheres(322, 60, 0.3);
    let boxes = [boxes.clone(), boxes].concat();
    let parts = [
        Part::Boxes(boxes.clone(), true),
        Part::Triangles(solid.clone().merged(&solid), true),
        Part::Boxes(boxes, false),
        Part::Triangles(glass.clone().merged(&glass), false),
    ];
    let scene = Scene::of_parts(&parts);
    let flags = RayFlags::empty();
    let rules = Rules::of_flags(flags, 0xFF);
    let rays = rays(323, 300);
    let mut expected: Option<Vec<Hit>> = None;
    for build in all_builds() {
        for isa in IsaLevel::available() {
            let options = BuildOptions { isa: Some(isa), reference_budget: Some(4.0), ..build };
            let blas = blas(&parts, &options);
            let hits: Vec<Hit> = rays
                .iter()
                .map(|ray| {
                    let mut query = RayQuery::of_blas(&blas, flags, ray);
                    finish(&mut query, &scene, &rules, passes)
                })
                .collect();
            assert_eq!(*expected.get_or_insert_with(|| hits.clone()), hits, "{options:?}");
        }
    }
    let hits = expected.unwrap();
    assert!(hits.iter().filter(|hit| hit.kind.is_procedural()).count() > 50);
    assert!(hits.iter().filter(|hit| hit.kind.is_triangle()).count() > 50);
}

#[test]
fn candidates_that_nobody_commits_are_all_hits() {
    for mesh in [soup(330, 300, 0.5), needles(331, 200)] {
        let parts = [Part::Triangles(mesh, false), Part::Boxes(spheres(332, 200, 0.3), true)];
        let scene = Scene::of_parts(&parts);
        let rules = Rules::of_flags(RayFlags::empty(), 0xFF);
        for build in all_builds() {
            let blas = blas(&parts, &build);
            for ray in &rays(333, 100) {
                let (mut all, mut found, mut boxes) = (vec![], vec![], vec![]);
                blas.all_hits(ray, &ANY, &AcceptAll, &mut all);
                all.retain(|hit| is_inside(hit, ray));
                let mut query = RayQuery::of_blas(&blas, RayFlags::empty(), ray);
                while query.proceed() {
                    let hit = candidate(&query);
                    assert_eq!(scene.opacity(&hit, &rules), Some(hit.kind.is_procedural()));
                    if hit.kind.is_triangle() { found.push(hit) } else { boxes.push(hit.primitive) }
                }
                assert_eq!(query.committed_status(), CommittedStatus::Nothing);
                let order = |a: &Hit, b: &Hit| (a.t, a.primitive).partial_cmp(&(b.t, b.primitive));
                found.sort_by(|a, b| order(a, b).unwrap());
                if blas.may_ask_twice() {
                    found.dedup();
                }
                assert_eq!(found, all);
                let count = boxes.len();
                boxes.sort_unstable();
                boxes.dedup();
                assert_eq!(boxes.len(), count, "a box twice");
            }
        }
    }
}

#[test]
fn an_aborted_query_keeps_what_it_has() {
    let world = World::new(340, spheres);
    let tlas = world.tlas(&BuildOptions::default());
    let scene = Scene::of_world(&world);
    let rules = Rules::of_flags(RayFlags::empty(), 0xFF);
    let (mut aborted, mut committed) = (0, 0);
    for ray in &rays(341, 300) {
        let mut query = RayQuery::new(&tlas, RayFlags::empty(), 0xFF, ray);
        let whole = finish(&mut query, &scene, &rules, passes);
        for limit in 0..6 {
            query.restart(RayFlags::empty(), 0xFF, ray);
            let mut last = Hit::MISS;
            for _ in 0..limit {
                if !query.proceed() {
                    break;
                }
                if passes(&candidate(&query)) {
                    query.commit_non_opaque_triangle_hit();
                }
                last = query.committed();
            }
            let is_open = query.candidate_type().is_some();
            query.abort();
            // The candidate can still be looked at, but it is too late.
            assert_eq!(query.candidate_type().is_some(), is_open);
            assert!(!query.commit_non_opaque_triangle_hit());
            assert!(!query.commit_procedural_primitive_hit(ray.t_min.max(0.0)));
            assert!(!query.proceed() && query.candidate_type().is_none());
            let kept = query.committed();
            assert!(kept == last || !is_open);
            assert!(!kept.precedes(&whole));
            aborted += usize::from(is_open);
            committed += usize::from(kept.is_hit());
        }
    }
    assert!(aborted > 300 && committed > 100, "{aborted} {committed}");
}

/// A translucent triangle at each height, and a box around it.
fn tower(heights: &[f32]) -> (Mesh, Vec<Aabb>) {
    let mut mesh = Mesh::default();
    for &z in heights {
        mesh.push([[0.0, 0.0, z], [1.0, 0.0, z], [0.0, 1.0, z]].map(Vec3::from));
    }
    let bounds = |&z: &f32| Aabb {
        lower: Vec3::new(0.0, 0.0, z - 0.25),
        upper: Vec3::new(1.0, 1.0, z + 0.25),
    };
    (mesh, heights.iter().map(bounds).collect())
}

const UP: Ray = Ray::new(Vec3::new(0.25, 0.25, 0.0), Vec3::Z);

#[test]
fn the_first_commit_ends_a_search_for_any() {
    let (mesh, boxes) = tower(&[1.0, 2.0, 3.0]);
    let flags = RayFlags::ACCEPT_FIRST_HIT_AND_END_SEARCH;
    let glass = TriangleMesh { opaque: false, ..mesh.geometry() };
    let parts = [glass.into(), ProceduralBoxes::new(&boxes).into()];
    for isa in IsaLevel::available() {
        let blas = Blas::of_geometries(&parts, &with_isa(isa)).unwrap();
        let mut query = RayQuery::of_blas(&blas, flags, &UP);
        assert!(query.proceed() && query.commit_non_opaque_triangle_hit());
        let hit = query.committed();
        assert!(hit.is_hit() && !query.proceed() && query.committed() == hit);

        query.restart(flags | RayFlags::SKIP_TRIANGLES, 0xFF, &UP);
        assert!(query.proceed());
        assert_eq!(query.candidate_primitive_index(), Some(0));
        assert!(query.commit_procedural_primitive_hit(1.1));
        // Nearer, but too late.
        assert!(!query.commit_procedural_primitive_hit(0.9));
        assert_eq!((query.committed_ray_t(), query.proceed()), (1.1, false));

        // Opaque triangles end it without a word.
        query.restart(flags | RayFlags::FORCE_OPAQUE, 0xFF, &UP);
        assert!(!query.proceed());
        assert_eq!(query.committed_status(), CommittedStatus::TriangleHit);
    }
}

#[test]
fn commits_shorten_the_rest_and_near_boxes_come_first() {
    let heights: Vec<f32> = (1..200).map(|i| i as f32).collect();
    let (mesh, boxes) = tower(&heights);
    let glass = TriangleMesh { opaque: false, ..mesh.geometry() };
    let parts = [glass.into(), ProceduralBoxes::new(&boxes).into()];
    for isa in IsaLevel::available() {
        let blas = Blas::of_geometries(&parts, &with_isa(isa)).unwrap();
        let mut query = RayQuery::of_blas(&blas, RayFlags::SKIP_TRIANGLES, &UP);
        let mut seen = vec![];
        while query.proceed() {
            seen.extend(query.candidate_primitive_index());
        }
        assert_eq!(seen, (0..199).collect::<Vec<_>>());

        query.restart(RayFlags::empty(), 0xFF, &UP);
        let (mut triangles, mut boxes) = (0, 0);
        while query.proceed() {
            if query.commit_non_opaque_triangle_hit() {
                triangles += 1;
            } else {
                boxes += 1;
            }
        }
        assert_eq!((query.committed_ray_t(), boxes), (1.0, 1));
        assert!(triangles <= 4, "{triangles}");
    }
}

#[test]
fn intervals_end_as_in_dxr() {
    let (mesh, boxes) = tower(&[1.0, 2.0]);
    let (solid, boxes) = (mesh.geometry(), ProceduralBoxes::new(&boxes));
    let glass = TriangleMesh { opaque: false, ..solid };
    for isa in IsaLevel::available() {
        for triangles in [solid, glass] {
            let blas = Blas::of_geometries(&[triangles.into()], &with_isa(isa)).unwrap();
            let found = |t_min, t_max| {
                let ray = Ray { t_min, t_max, ..UP };
                let mut query = RayQuery::of_blas(&blas, RayFlags::empty(), &ray);
                while query.proceed() {
                    assert!(query.commit_non_opaque_triangle_hit() || query.committed().t < 2.0);
                }
                query.committed().t
            };
            assert_eq!(found(0.0, f32::INFINITY), 1.0);
            assert_eq!(found(1.0, f32::INFINITY), 2.0);
            assert_eq!(found(1.0, 2.0), f32::INFINITY);
            assert_eq!(found(1.0f32.next_down(), 2.0), 1.0);
            assert_eq!(found(1.0, 2.0f32.next_up()), 2.0);
        }
        let blas = Blas::of_geometries(&[boxes.into()], &with_isa(isa)).unwrap();
        let ray = Ray { t_min: 0.9, t_max: 1.1, ..UP };
        let mut query = RayQuery::of_blas(&blas, RayFlags::empty(), &ray);
        assert!(query.proceed());
        for t in [0.9f32.next_down(), 1.1f32.next_up(), f32::NAN, f32::INFINITY] {
            assert!(!query.commit_procedural_primitive_hit(t), "{t}");
        }
        assert!(query.commit_procedural_primitive_hit(1.1));
        assert!(query.commit_procedural_primitive_hit(0.9));
        // No farther one, and not the same again.
        assert!(!query.commit_procedural_primitive_hit(1.0));
        assert!(!query.commit_procedural_primitive_hit(0.9));
        assert!(!query.proceed() && query.committed().t == 0.9);
        // An infinite interval holds no infinite distance.
        query.restart(RayFlags::empty(), 0xFF, &Ray { t_min: f32::NEG_INFINITY, ..UP });
        assert!(query.proceed());
        assert!(!query.commit_procedural_primitive_hit(f32::INFINITY));
        assert!(!query.commit_procedural_primitive_hit(f32::NEG_INFINITY));
        assert!(query.commit_procedural_primitive_hit(-0.0));
        assert_eq!(query.committed().t.to_bits(), 0);
    }
}

#[test]
fn ties_go_to_the_smallest_indices_of_both_kinds() {
    let (mesh, boxes) = tower(&[1.0, 1.0]);
    let (solid, boxes) = (mesh.geometry(), ProceduralBoxes::new(&boxes));
    let glass = TriangleMesh { opaque: false, ..solid };
    let expected =
        [(0, CommittedStatus::TriangleHit), (1, CommittedStatus::ProceduralPrimitiveHit)];
    for isa in IsaLevel::available() {
        for triangles in [solid, glass] {
            for (boxes_first, status) in expected {
                let mut geometries = [triangles.into(), boxes.into()];
                geometries.rotate_left(boxes_first);
                let blas = Arc::new(Blas::of_geometries(&geometries, &with_isa(isa)).unwrap());
                let instances = [Instance::new(0, Affine3A::IDENTITY); 3];
                let tlas = Tlas::build(vec![blas], &instances, &with_isa(isa)).unwrap();
                let mut query = RayQuery::new(&tlas, RayFlags::empty(), 0xFF, &UP);
                while query.proceed() {
                    query.commit_non_opaque_triangle_hit();
                    query.commit_procedural_primitive_hit(1.0);
                }
                assert_eq!(query.committed_status(), status);
                let hit = query.committed();
                assert_eq!((hit.instance, hit.geometry, hit.primitive, hit.t), (0, 0, 0, 1.0));
            }
        }
    }
}

#[test]
fn calls_at_the_wrong_time_do_nothing() {
    let (mesh, boxes) = tower(&[1.0, 2.0]);
    let glass = TriangleMesh { opaque: false, ..mesh.geometry() };
    let parts = [glass.into(), ProceduralBoxes::new(&boxes[1..]).into()];
    let blas = Arc::new(Blas::of_geometries(&parts, &BuildOptions::default()).unwrap());
    let transform = Affine3A::from_scale_rotation_translation(
        Vec3::new(1.0, 1.0, -2.0),
        glam::Quat::IDENTITY,
        Vec3::Z * 8.0,
    );
    let instance = Instance { id: 7, contribution: 9, ..Instance::new(0, transform) };
    let tlas = Tlas::build(vec![blas], &[instance], &BuildOptions::default()).unwrap();
    let none = |query: &RayQuery<'_>| {
        query.candidate_type().is_none()
            && query.candidate_triangle_ray_t().is_none()
            && query.candidate_triangle_barycentrics().is_none()
            && query.candidate_triangle_front_face().is_none()
            && query.candidate_procedural_primitive_non_opaque().is_none()
            && query.candidate_instance_index().is_none()
            && query.candidate_instance_id().is_none()
            && query.candidate_instance_contribution().is_none()
            && query.candidate_geometry_index().is_none()
            && query.candidate_primitive_index().is_none()
            && query.candidate_object_ray_origin().is_none()
            && query.candidate_object_ray_direction().is_none()
            && query.candidate_object_to_world().is_none()
            && query.candidate_world_to_object().is_none()
    };
    let nothing = |query: &RayQuery<'_>| {
        query.committed() == Hit::MISS
            && query.committed_status() == CommittedStatus::Nothing
            && query.committed_ray_t() == query.ray().t_max
            && query.committed_triangle_barycentrics().is_none()
            && query.committed_triangle_front_face().is_none()
            && query.committed_instance_index().is_none()
            && query.committed_instance_id().is_none()
            && query.committed_instance_contribution().is_none()
            && query.committed_geometry_index().is_none()
            && query.committed_primitive_index().is_none()
            && query.committed_object_ray_origin().is_none()
            && query.committed_object_ray_direction().is_none()
            && query.committed_object_to_world().is_none()
            && query.committed_world_to_object().is_none()
    };
    let mut query = RayQuery::new(&tlas, RayFlags::empty(), 0xFF, &UP);
    assert!(none(&query) && nothing(&query));
    assert!(!query.commit_non_opaque_triangle_hit());
    assert!(!query.commit_procedural_primitive_hit(1.0));
    // Triangles at 8 − 2·1 and 8 − 2·2.
    assert!(query.proceed() && nothing(&query) && !none(&query));
    assert!(!query.commit_procedural_primitive_hit(1.0) && nothing(&query));
    while query.candidate_primitive_index() != Some(1) {
        assert!(query.proceed());
    }
    let (origin, direction) = (Vec3::new(0.25, 0.25, 4.0), Vec3::new(0.0, 0.0, -0.5));
    assert_eq!(query.candidate_triangle_ray_t(), Some(4.0));
    assert_eq!(query.candidate_object_ray_origin(), Some(origin));
    assert_eq!(query.candidate_object_ray_direction(), Some(direction));
    assert_eq!(query.candidate_object_to_world(), Some(transform));
    assert_eq!(query.candidate_world_to_object(), Some(tlas.world_to_object(0)));
    assert_eq!(query.candidate_triangle_front_face(), Some(true));
    assert_eq!(query.candidate_instance_id(), Some(7));
    assert_eq!(query.candidate_instance_contribution(), Some(9));
    assert!(query.commit_non_opaque_triangle_hit() && !query.commit_non_opaque_triangle_hit());
    assert_eq!(query.committed_status(), CommittedStatus::TriangleHit);
    assert_eq!(query.committed_triangle_front_face(), Some(true));
    assert_eq!(query.committed_triangle_barycentrics().unwrap().to_array(), [0.25, 0.25]);
    // Then the box, from 8 − 2·2.25 on.
    while query.candidate_type() != Some(CandidateType::ProceduralPrimitive) {
        assert!(query.proceed());
    }
    assert!(!query.commit_non_opaque_triangle_hit());
    assert_eq!(query.committed().kind, HitKind::TRIANGLE_FRONT);
    assert_eq!(query.candidate_procedural_primitive_non_opaque(), Some(false));
    assert!(query.commit_procedural_primitive_hit(3.75));
    assert!(!query.proceed() && none(&query));
    assert!(!query.commit_procedural_primitive_hit(3.5));
    assert_eq!(query.committed_ray_t(), 3.75);
    assert_eq!(query.committed_triangle_barycentrics(), None);
    assert_eq!(query.committed_triangle_front_face(), None);
    assert_eq!(
        (query.committed_instance_index(), query.committed_instance_id()),
        (Some(0), Some(7))
    );
    assert_eq!(query.committed_instance_contribution(), Some(9));
    assert_eq!(query.committed_geometry_index(), Some(1));
    assert_eq!(query.committed_primitive_index(), Some(0));
    assert_eq!(query.committed_object_ray_origin(), Some(origin));
    assert_eq!(query.committed_object_ray_direction(), Some(direction));
    assert_eq!(query.committed_object_to_world(), Some(transform));
    assert_eq!(query.committed_world_to_object(), Some(tlas.world_to_object(0)));
    // A new ray knows nothing of it; no instance shares the mask.
    query.restart(RayFlags::FORCE_OPAQUE, 0, &UP);
    assert_eq!(query.ray_flags(), RayFlags::FORCE_OPAQUE);
    assert!(none(&query) && nothing(&query));
    assert!(!query.proceed() && nothing(&query));
}

/// Geometry with `no_duplicate_any_hit` after spatial splits: a query may show a triangle that was not
/// committed again, one that was committed never; what there is to see is all there.
#[test]
fn triangles_in_several_leaves_may_be_candidates_again_until_they_are_committed() {
    let mesh = soup(247, 2000, 0.05).merged(&soup(248, 60, 1.0));
    let geometry = TriangleMesh { opaque: false, no_duplicate_any_hit: true, ..mesh.geometry() };
    let options = BuildOptions { reference_budget: Some(4.0), ..with_quality(BuildQuality::Best) };
    let blas = Blas::build(&[geometry], &options).unwrap();
    assert!(blas.may_ask_twice() && blas.geometries()[0].no_duplicate_any_hit);
    let (mut shown, mut different, mut random) = (0, 0, Random::new(248));
    for _ in 0..2000 {
        let ray = ray_at(&mut random, Vec3::ZERO, 1.0);
        let mut seen = vec![];
        let mut query = RayQuery::of_blas(&blas, RayFlags::empty(), &ray);
        while query.proceed() {
            seen.extend(query.candidate_primitive_index());
        }
        shown += seen.len();
        seen.sort_unstable();
        seen.dedup();
        different += seen.len();
        let mut committed = vec![];
        query.restart(RayFlags::empty(), 0xFF, &ray);
        while query.proceed() {
            committed.extend(query.candidate_primitive_index());
            query.commit_non_opaque_triangle_hit();
        }
        let before = committed.len();
        committed.sort_unstable();
        committed.dedup();
        assert_eq!(committed.len(), before, "{ray:?}");
        let nearest = blas.closest_hit(&ray, &TraceOptions::DEFAULT, &AcceptAll);
        assert_eq!(query.committed(), nearest);
        assert!(!nearest.is_hit() || seen.contains(&nearest.primitive));
    }
    assert!(different > 200 && shown > different, "{shown} shown, {different} different");
}
