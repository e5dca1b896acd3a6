//! Procedural primitives: every box that a ray meets is visited, once; and what options leave out.

use std::{
    collections::{BTreeMap, BTreeSet},
    ops::ControlFlow,
    sync::Arc,
};

use glam::{Affine3A, Mat3, Quat, Vec3, Vec3Swizzles};
use rayburst_accel::{
    Blas, BuildControl, BuildError, BuildOptions, Geometry, GeometryKind, Instance, InstanceFlags,
    IsaLevel, Layout, ProceduralBoxes, ProceduralCandidate, Skip, Tlas, TraceOptions, TriangleMesh,
};
use rayburst_math::{Aabb, Ray};

use crate::{
    meshes::{Random, ray_at, soup, with_isa},
    mixed::{Part, Primitive, Rules, World, blas, local, primitives, random_boxes, slabs},
};

const ANY: TraceOptions = TraceOptions::DEFAULT;
/// Boxes that are missed by no more than this may be visited, relative to the distances on an axis from
/// the origin of space and of the ray to the farthest box.
const MARGIN: f64 = 1.0 / (1u64 << 19) as f64;

/// All candidates of a ray, in the order of the visit.
macro_rules! candidates {
    ($structure:expr, $ray:expr, $options:expr) => {{
        let mut found: Vec<ProceduralCandidate> = vec![];
        let mut visit = |candidate: &ProceduralCandidate, t_max| {
            found.push(*candidate);
            ControlFlow::Continue(t_max)
        };
        $structure.procedural_candidates($ray, $options, &mut visit);
        found
    }};
}

/// What brute force says of boxes: which are met, and which are not far from it.
#[derive(Default)]
struct Expected {
    met: BTreeMap<(u32, u32, u32), bool>,
    near: BTreeMap<(u32, u32, u32), bool>,
}

impl Expected {
    /// Adds boxes of a BLAS, for a ray in its space.
    fn add(
        &mut self,
        instance: u32,
        boxes: &[Primitive],
        ray: &Ray,
        opacity: impl Fn(bool) -> Option<bool>,
    ) {
        if !ray.is_valid() {
            return;
        }
        let all = boxes.iter().fold(Aabb::EMPTY, |all, b| all.union(b.bounds));
        let origin = ray.origin.as_dvec3();
        let reach =
            (all.lower.as_dvec3() - origin).abs().max((all.upper.as_dvec3() - origin).abs());
        let margin = MARGIN * (reach + origin.abs()).max_element();
        for b in boxes {
            let Some(opaque) = opacity(b.opaque) else { continue };
            let id = (instance, b.geometry, b.primitive);
            if slabs(&b.bounds, ray, 0.0).is_some() {
                self.met.insert(id, opaque);
            }
            if slabs(&b.bounds, ray, margin).is_some() {
                self.near.insert(id, opaque);
            }
        }
    }

    fn check(&self, found: &[ProceduralCandidate]) {
        let mut ids = BTreeSet::new();
        for c in found {
            let id = (c.instance, c.geometry, c.primitive);
            assert!(ids.insert(id), "{c:?} twice");
            assert_eq!(self.near.get(&id), Some(&c.opaque), "{c:?}");
        }
        for id in self.met.keys() {
            assert!(ids.contains(id), "{id:?} is missing");
        }
    }
}

/// Rays of all kinds through [−1, 1]³: along axes through corners of boxes, short, backwards, invalid.
fn rays(seed: u64, count: usize, boxes: &[Primitive]) -> Vec<Ray> {
    let mut random = Random::new(seed);
    let ray = |i: usize| {
        let ray = ray_at(&mut random, Vec3::ZERO, 1.0);
        let corner = boxes[random.below(boxes.len())].bounds.lower;
        let axis = [Vec3::X, Vec3::NEG_Y, Vec3::Z][random.below(3)];
        match i % 12 {
            0 => Ray::new(corner - 2.0 * axis, axis),
            1 => Ray::new(corner.with_x(-3.0), 0.01 * Vec3::X),
            2 => Ray { t_max: random.unit(), ..ray },
            3 => Ray { t_min: -5.0, ..ray },
            4 => Ray { t_min: f32::NEG_INFINITY, t_max: 0.0, ..ray },
            5 => Ray { direction: ray.direction * 1e-40, ..ray },
            6 => Ray { direction: ray.direction * 1e30, ..ray },
            7 => Ray { t_min: 0.3, t_max: 0.3, ..ray },
            8 => Ray { direction: Vec3::new(f32::NAN, 1.0, 0.0), ..ray },
            9 => Ray { t_min: 1.0, t_max: 0.5, ..ray },
            _ => ray,
        }
    };
    (0..count).map(ray).collect()
}

#[test]
fn boxes_of_one_structure_are_those_of_brute_force() {
    let parts = [
        Part::Boxes(random_boxes(201, 70_000, 0.02), true),
        Part::Triangles(soup(202, 100, 0.3), true),
        Part::Boxes(random_boxes(203, 30_000, 0.1), false),
    ];
    let boxes = primitives(&parts);
    let rays = rays(204, 360, &boxes);
    let expected = rays.iter().map(|ray| {
        let mut expected = Expected::default();
        expected.add(0, &boxes, ray, Some);
        expected
    });
    let expected: Vec<_> = expected.collect();
    assert!(expected.iter().map(|e| e.met.len()).sum::<usize>() > 50_000);
    for isa in IsaLevel::available() {
        let blas = blas(&parts, &with_isa(isa));
        let report = blas.validate().unwrap();
        assert_eq!(report.primitives, boxes.len() + 100);
        for (ray, expected) in rays.iter().zip(&expected) {
            expected.check(&candidates!(blas, ray, &ANY));
        }
        // Through an instance that is the world they are the same, in the same order.
        let blas = Arc::new(blas);
        let instance = Instance::new(0, Affine3A::IDENTITY);
        let tlas = Tlas::build(vec![blas.clone()], &[instance], &with_isa(isa)).unwrap();
        for ray in &rays[..60] {
            assert_eq!(candidates!(tlas, ray, &ANY), candidates!(blas, ray, &ANY));
        }
    }
}

/// Options of all kinds.
fn some_options(random: &mut Random) -> TraceOptions {
    let mut flag = || random.below(4) == 0;
    let skip = Skip { opaque: flag(), non_opaque: flag(), triangles: flag(), procedural: flag() };
    let force_opaque = [None, None, Some(true), Some(false)][random.below(4)];
    let mask = if random.below(2) == 0 { 0xFF } else { random.below(256) as u8 };
    TraceOptions { mask, force_opaque, skip, ..ANY }
}

#[test]
fn boxes_of_instances_are_those_of_brute_force() {
    let world = World::new(210, random_boxes);
    let boxes: Vec<_> = world.parts.iter().map(|parts| primitives(parts)).collect();
    let mut random = Random::new(211);
    let rays = rays(212, 1200, &boxes[0]);
    let mut met = 0;
    for isa in IsaLevel::available() {
        let tlas = world.tlas(&with_isa(isa));
        for ray in &rays {
            let options = some_options(&mut random);
            let rules = Rules::of_options(&options);
            let mut expected = Expected::default();
            for (instance, index) in world.instances.iter().zip(0..) {
                let opacity = |opaque| rules.opacity(instance, opaque);
                if !rules.skips_boxes {
                    let ray = local(&tlas, index, ray);
                    expected.add(index, &boxes[instance.blas as usize], &ray, opacity);
                }
            }
            met += expected.met.len();
            expected.check(&candidates!(tlas, ray, &options));
        }
    }
    assert!(met > 5000, "{met}");
}

#[test]
fn boxes_at_the_edge_of_stretched_instances() {
    // Transforms that magnify rounding: rays that miss the box in the world meet that of the instance.
    let unit = Aabb { lower: Vec3::NEG_ONE, upper: Vec3::ONE };
    let parts = [Part::Boxes(vec![unit], true)];
    let boxes = primitives(&parts);
    let blas = Arc::new(blas(&parts, &BuildOptions::default()));
    let mut random = Random::new(215);
    let mut met = 0;
    for _ in 0..150 {
        let turns = [(); 2].map(|()| Quat::from_scaled_axis(3.0 * random.vector()));
        let scale = Mat3::from_diagonal(Vec3::new(1.0, 1e-3, 30.0));
        let matrix = Mat3::from_quat(turns[0]) * scale * Mat3::from_quat(turns[1]);
        let placed = Affine3A::from_mat3_translation(matrix, 100.0 * random.vector());
        let instance = Instance::new(0, placed);
        let tlas = Tlas::build(vec![blas.clone()], &[instance], &BuildOptions::default()).unwrap();
        for axis in 0..3 {
            let corners = (0..8).map(|corner| {
                let sign = |bit: u32| if corner & bit == 0 { -1.0 } else { 1.0 };
                placed.transform_point3(Vec3::new(sign(1), sign(2), sign(4)))
            });
            let farthest = corners.max_by(|a, b| a[axis].total_cmp(&b[axis])).unwrap();
            for i in 0..40 {
                // Along the face of the box in the world, a little off it.
                let mut direction = 300.0 * random.vector();
                direction[axis] = 0.0;
                let mut origin = farthest - direction;
                origin[axis] += random.unit() * 0.1f32.powi(i % 5);
                let ray = Ray::new(origin, direction);
                let mut expected = Expected::default();
                expected.add(0, &boxes, &local(&tlas, 0, &ray), Some);
                met += expected.met.len();
                expected.check(&candidates!(tlas, &ray, &ANY));
            }
        }
    }
    assert!(met > 1000, "{met}");
}

#[test]
fn boxes_of_every_degenerate_kind() {
    let unit = Aabb { lower: Vec3::NEG_ONE, upper: Vec3::ONE };
    let (nan, infinite) = (Vec3::splat(f32::NAN), Vec3::splat(f32::INFINITY));
    let huge = Vec3::splat(rayburst_accel::MAX_COORDINATE);
    let never = [
        Aabb::EMPTY,
        Aabb { lower: nan, ..unit },
        Aabb { upper: nan, ..unit },
        Aabb { lower: Vec3::ONE, upper: Vec3::NEG_ONE },
        Aabb { lower: -infinite, upper: infinite },
        Aabb { upper: huge * 1.001, ..unit },
    ];
    // So many at one place that only the median can split them.
    let same = vec![unit; 3000];
    let points = [Aabb::of_point(Vec3::ZERO), Aabb { lower: -huge, upper: huge }];
    let geometries = [&never[..], &same, &points].map(|boxes| ProceduralBoxes::new(boxes).into());
    for isa in IsaLevel::available() {
        let blas = Blas::of_geometries(&geometries, &with_isa(isa)).unwrap();
        blas.validate().unwrap();
        let stats = blas.stats();
        assert_eq!((stats.primitives, stats.inactive), (3002, 6));
        let ray = Ray::new(Vec3::new(0.0, 0.0, -5.0), Vec3::Z);
        let found = candidates!(blas, &ray, &ANY);
        let ids: BTreeSet<_> = found.iter().map(|c| (c.geometry, c.primitive)).collect();
        assert!(found.len() == 3002 && ids.len() == 3002);
        assert!(ids.iter().all(|id| id.0 > 0));
        // Off the others, but in the huge one.
        let ray = Ray::new(Vec3::new(3e12, 0.0, -5e12), Vec3::Z);
        let found = candidates!(blas, &ray, &ANY);
        assert!(found.iter().any(|c| (c.geometry, c.primitive) == (2, 1)));
        // Nothing but what is never met, and nothing at all.
        for boxes in [&never[..], &[]] {
            let geometries = [ProceduralBoxes::new(boxes).into()];
            let blas = Blas::of_geometries(&geometries, &with_isa(isa)).unwrap();
            assert_eq!(blas.validate().unwrap().primitives, 0);
            assert!(blas.bounds().is_empty());
            assert_eq!(candidates!(blas, &ray, &ANY), []);
            let instance = Instance::new(0, Affine3A::IDENTITY);
            let tlas = Tlas::build(vec![Arc::new(blas)], &[instance], &with_isa(isa)).unwrap();
            assert_eq!(candidates!(tlas, &ray, &ANY), []);
            assert_eq!((tlas.stats().primitives, tlas.stats().inactive), (0, 1));
        }
    }
}

#[test]
fn a_shorter_interval_visits_less_and_loses_nothing_nearer() {
    let parts = [Part::Boxes(random_boxes(220, 4000, 0.2), true)];
    let boxes = primitives(&parts);
    let rays = rays(221, 600, &boxes);
    for isa in IsaLevel::available() {
        let blas = blas(&parts, &with_isa(isa));
        let (mut all, mut fewer) = (0, 0);
        for ray in &rays {
            all += candidates!(blas, ray, &ANY).len();
            let mut end = ray.t_max;
            let mut found = BTreeSet::new();
            let mut visit = |c: &ProceduralCandidate, t_max: f32| {
                assert_eq!(t_max, end);
                found.insert(c.primitive);
                // Something is where the ray leaves the box.
                let b = boxes.iter().find(|b| b.primitive == c.primitive).unwrap();
                match slabs(&b.bounds, ray, 0.0) {
                    Some([_, far]) if c.primitive.is_multiple_of(3) => end = end.min(far as f32),
                    // Such answers change nothing.
                    _ => return ControlFlow::Continue([f32::NAN, f32::INFINITY][found.len() % 2]),
                }
                ControlFlow::Continue(end)
            };
            blas.procedural_candidates(ray, &ANY, &mut visit);
            fewer += found.len();
            let inside = Ray { t_max: end, ..*ray };
            for b in boxes.iter().filter(|_| inside.is_valid()) {
                let lost =
                    slabs(&b.bounds, &inside, 0.0).is_some() && !found.contains(&b.primitive);
                assert!(!lost, "{ray:?} until {end} loses {b:?}");
            }
        }
        assert!(fewer > 1000 && 2 * fewer < all, "{fewer} of {all}");
    }
}

#[test]
fn a_break_ends_the_search() {
    let world = World::new(230, random_boxes);
    let tlas = world.tlas(&BuildOptions::default());
    let mut random = Random::new(231);
    let mut broken = 0;
    for _ in 0..200 {
        let ray = ray_at(&mut random, Vec3::ZERO, 1.0);
        let all = candidates!(tlas, &ray, &ANY);
        for limit in [1, 2, 5] {
            let mut found = vec![];
            let mut visit = |c: &ProceduralCandidate, t_max| {
                found.push(*c);
                if found.len() == limit {
                    ControlFlow::Break(())
                } else {
                    ControlFlow::Continue(t_max)
                }
            };
            tlas.procedural_candidates(&ray, &ANY, &mut visit);
            assert_eq!(found, all[..limit.min(all.len())]);
            broken += usize::from(all.len() > limit);
        }
    }
    assert!(broken > 100, "{broken}");
}

#[test]
fn both_trees_count_and_are_proved() {
    let world = World::new(240, random_boxes);
    for layout in Layout::ALL {
        let options = BuildOptions { layout, ..BuildOptions::default() };
        for parts in &world.parts {
            let blas = blas(parts, &options);
            let boxes = primitives(parts);
            let count = |part: &Part| match part {
                Part::Triangles(mesh, _) => (GeometryKind::Triangles, mesh.indices.len() as u32),
                Part::Boxes(boxes, _) => (GeometryKind::Procedural, boxes.len() as u32),
            };
            let (stats, report) = (blas.stats(), blas.validate().unwrap());
            assert_eq!(
                (stats.primitives, stats.references, stats.nodes, stats.leaves, stats.depth),
                (report.primitives, report.references, report.nodes, report.leaves, report.depth)
            );
            let total: u32 = parts.iter().map(|part| count(part).1).sum();
            assert_eq!(stats.primitives + stats.inactive, total as usize);
            assert!((stats.sah_cost - report.sah_cost).abs() <= 1e-4 * stats.sah_cost);
            let infos = blas.geometries();
            assert_eq!((infos.len(), blas.geometry_count()), (parts.len(), parts.len()));
            for (info, part) in infos.iter().zip(parts) {
                assert_eq!((info.kind, info.primitives), count(part));
                assert_eq!(info.opaque, part.is_opaque());
            }
            let mut bounds = boxes.iter().fold(Aabb::EMPTY, |all, b| all.union(b.bounds));
            for part in parts {
                if let Part::Triangles(mesh, _) = part {
                    bounds = bounds.union(Aabb::of_points(mesh.positions.iter().copied()));
                }
            }
            assert_eq!(blas.bounds(), bounds);
        }
        let tlas = world.tlas(&options);
        let (stats, report) = (tlas.stats(), tlas.validate().unwrap());
        assert_eq!((stats.primitives, stats.inactive), (24, 0));
        assert_eq!((report.primitives, report.references), (24, stats.references));
        assert!(stats.references > 24 && report.nodes == stats.nodes);
        for (instance, index) in world.instances.iter().zip(0..) {
            let bounds = tlas.blases()[instance.blas as usize].bounds();
            assert!(tlas.bounds().contains(instance.transform.transform_point3(bounds.centre())));
            let there_and_back = tlas.world_to_object(index) * instance.transform;
            assert!(there_and_back.abs_diff_eq(Affine3A::IDENTITY, 1e-4));
        }
    }
}

#[test]
fn triangles_are_refitted_and_boxes_stay() {
    let parts = [
        Part::Boxes(random_boxes(250, 300, 0.2), true),
        Part::Triangles(soup(251, 300, 0.2), true),
        Part::Boxes(random_boxes(252, 300, 0.2), true),
        Part::Triangles(soup(253, 300, 0.2), true),
    ];
    let mut refitted = blas(&parts, &BuildOptions::default());
    let moved = parts.map(|part| match part {
        Part::Triangles(mesh, opaque) => {
            Part::Triangles(mesh.map(|p| p.yzx() * 1.25 + 0.25), opaque)
        }
        boxes => boxes,
    });
    let mesh = |part: &'_ Part| match part {
        Part::Triangles(mesh, _) => mesh.clone(),
        Part::Boxes(..) => Default::default(),
    };
    let meshes = moved.each_ref().map(mesh);
    let meshes = meshes.each_ref().map(|mesh| mesh.geometry());
    let rebuilt = blas(&moved, &BuildOptions::default());
    let mut random = Random::new(254);
    let rays: Vec<_> = (0..500).map(|_| ray_at(&mut random, Vec3::ZERO, 1.2)).collect();
    let check = |refitted: &Blas| {
        let report = refitted.validate().unwrap();
        assert_eq!(report.primitives, rebuilt.stats().primitives);
        assert_eq!(refitted.geometries(), rebuilt.geometries());
        for ray in &rays {
            let hit = |blas: &Blas| blas.closest_hit(ray, &ANY, &rayburst_accel::AcceptAll);
            assert_eq!(hit(refitted), hit(&rebuilt));
            assert_eq!(candidates!(refitted, ray, &ANY), candidates!(rebuilt, ray, &ANY));
        }
    };
    let mut changed = refitted.clone();
    let report = refitted.refit(&meshes).unwrap();
    check(&refitted);
    assert!(rebuilt.bounds().contains_box(&report.bounds));
    let all: Vec<_> = [1, 3].into_iter().flat_map(|g| (0..300).map(move |p| (g, p))).collect();
    changed.refit_changed(&meshes, &all).unwrap();
    check(&changed);
    // What is said of boxes as if they were triangles is an error.
    let error = changed.refit_changed(&meshes, &[(0, 1)]).unwrap_err();
    assert_eq!(error, BuildError::NoSuchTriangle { geometry: 0, primitive: 1 });
    let error = changed.refit(&meshes[1..]).unwrap_err();
    assert_eq!(error, BuildError::GeometriesDiffer { built: 4, given: 3 });
    let mut wrong = meshes;
    wrong.swap(0, 1);
    let error = changed.refit(&wrong).unwrap_err();
    assert_eq!(error, BuildError::TrianglesDiffer { geometry: 0, built: 0, given: 300 });
    check(&changed);
}

#[test]
fn instances_without_triangles_are_entered() {
    let unit = [Aabb { lower: Vec3::NEG_ONE, upper: Vec3::ONE }];
    let boxes = ProceduralBoxes { opaque: false, ..ProceduralBoxes::new(&unit) };
    let blas = Arc::new(Blas::of_geometries(&[boxes.into()], &BuildOptions::default()).unwrap());
    let flags = InstanceFlags { force_opaque: Some(true), ..InstanceFlags::default() };
    let place = |x| Instance::new(0, Affine3A::from_translation(Vec3::X * x));
    let instances = [Instance { mask: 1, ..place(0.0) }, Instance { flags, mask: 2, ..place(4.0) }];
    let tlas = Tlas::build(vec![blas], &instances, &BuildOptions::default()).unwrap();
    assert_eq!(tlas.bounds(), tlas.bounds().union(Aabb { lower: Vec3::NEG_ONE, upper: Vec3::X }));
    let ray = Ray::new(Vec3::new(-9.0, 0.5, 0.5), Vec3::X);
    let ids = |options: &TraceOptions| {
        let found = candidates!(tlas, &ray, options);
        found.iter().map(|c| (c.instance, c.opaque)).collect::<Vec<_>>()
    };
    assert_eq!(ids(&ANY), [(0, false), (1, true)]);
    assert_eq!(ids(&TraceOptions { mask: 2, ..ANY }), [(1, true)]);
    assert_eq!(ids(&TraceOptions { force_opaque: Some(false), ..ANY }), [(0, false), (1, false)]);
    let skip = |skip| TraceOptions { skip, ..ANY };
    assert_eq!(ids(&skip(Skip { opaque: true, ..Skip::NONE })), [(0, false)]);
    assert_eq!(ids(&skip(Skip { non_opaque: true, ..Skip::NONE })), [(1, true)]);
    assert_eq!(ids(&skip(Skip { procedural: true, ..Skip::NONE })), []);
    assert_eq!(ids(&skip(Skip { triangles: true, ..Skip::NONE })).len(), 2);
}

#[test]
fn builds_are_cancelled_and_wrong_meshes_refused() {
    let boxes = random_boxes(260, 100, 0.1);
    let control = BuildControl::new();
    let options = BuildOptions { control: Some(&control), ..BuildOptions::default() };
    let positions = [Vec3::ZERO, Vec3::X, Vec3::Y];
    let boxes: Geometry<'_> = ProceduralBoxes::new(&boxes).into();
    let good = TriangleMesh::new(&positions, &[[0, 1, 2]]).into();
    let bad = TriangleMesh::new(&positions, &[[0, 1, 3]]).into();
    assert!(Blas::of_geometries(&[boxes, good], &options).is_ok());
    assert_eq!(control.progress(), 1.0);
    let error = Blas::of_geometries(&[boxes, bad], &options).unwrap_err();
    assert!(matches!(error, BuildError::IndexOutOfRange { geometry: 1, index: 3, .. }), "{error}");
    control.cancel();
    let error = Blas::of_geometries(&[boxes, good], &options).unwrap_err();
    assert_eq!(error, BuildError::Cancelled);
}
