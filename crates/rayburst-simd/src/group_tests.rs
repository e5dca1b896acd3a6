//! Groups of sixteen rays against the tests of single rays, with every instruction set.

use crate::{
    Boxes8, Extent16, Frustum, GROUP, Group16, GroupAxes, Isa, IsaLevel, Kernel, Preparation16,
    Question16, Rays16, ShearRay, SlabRay, TriangleHits, Triangles4,
    tests::{Random, random_block, random_boxes},
};

/// Sixteen rays with the signs and the longest component of the first.
fn rays(random: &mut Random) -> [[f32; 8]; GROUP] {
    let mut lead = random.vector().map(|x| if x == 0.0 { 0.5 } else { 0.6 * x });
    let longest = (random.next().abs() * 3.0) as usize % 3;
    lead[longest] = lead[longest].signum() * 1.5;
    let origin = random.vector();
    std::array::from_fn(|_| {
        let [x, y, z] = random.vector().map(|x| 0.1 * x);
        let bend = random.vector().map(|x| 1.0 + 0.2 * x);
        [
            origin[0] + x,
            origin[1] + y,
            origin[2] + z,
            random.next().abs() * 0.1,
            lead[0] * bend[0],
            lead[1] * bend[1],
            lead[2] * bend[2],
            1.0 + random.next(),
        ]
    })
}

/// A group and what else its tests need.
#[derive(Clone, Copy)]
struct Prepared {
    axes: GroupAxes,
    how: Preparation16,
    group: Group16,
    extent: Extent16,
}

/// Loads and prepares rays, leaving out those not in `lanes`.
struct Prepare<'a>(&'a [[f32; 8]; GROUP], u32);

impl Kernel for Prepare<'_> {
    type Output = Prepared;

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) -> Prepared {
        let [_, _, _, _, dx, dy, dz, _] = self.0[0];
        let direction = [dx, dy, dz];
        let longest = (0..3).find(|&k| direction[k].abs() >= 1.0).unwrap();
        let negative = direction.map(|d| d < 0.0);
        let axes = GroupAxes::new(negative, longest);
        let how = Preparation16 {
            lanes: self.1,
            spare: [[0.0; 3], direction],
            scale: 0.5,
            unscale: 2.0,
            sign: direction.map(f32::signum),
            error: [1e-6; 3],
            smallest: 1e-9,
            waist: 0.25,
        };
        let mut side_by_side = Rays16::ZERO;
        isa.load16(self.0, &mut side_by_side);
        for (lane, &[ox, oy, oz, t_min, dx, dy, dz, t_max]) in self.0.iter().enumerate() {
            assert_eq!(side_by_side.origin.map(|row| row[lane]), [ox, oy, oz]);
            assert_eq!(side_by_side.direction.map(|row| row[lane]), [dx, dy, dz]);
            assert_eq!([side_by_side.t_min[lane], side_by_side.t_max[lane]], [t_min, t_max]);
        }
        let (mut group, mut extent) = (Group16::NONE, Extent16::NONE);
        isa.prepare16(&side_by_side, &how, &axes, &mut group, &mut extent);
        Prepared { axes, how, group, extent }
    }
}

/// The end of the rays' intervals from the waist on.
struct End<'a>(&'a Group16, u32);

impl Kernel for End<'_> {
    type Output = f32;

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) -> f32 {
        isa.end16(self.0, self.1)
    }
}

#[test]
fn groups_are_prepared_like_single_rays() {
    let mut random = Random(11);
    for _ in 0..200 {
        let (rays, lanes) = (rays(&mut random), 0xF7DB);
        let plain = IsaLevel::Scalar(crate::Scalar).dispatch(Prepare(&rays, lanes));
        for (lane, &[ox, oy, oz, t_min, dx, dy, dz, t_max]) in rays.iter().enumerate() {
            let group = &plain.group;
            if lanes >> lane & 1 == 0 {
                assert_eq!(group.t_max[lane], -1.0);
                continue;
            }
            let ray = ShearRay::new(&[ox, oy, oz], &[dx, dy, dz], plain.how.scale);
            assert_eq!(ray.axes(), plain.axes.axes());
            assert_eq!(group.origin.map(|row| row[lane]), ray.origin());
            assert_eq!(group.shear.map(|row| row[lane]), ray.shear());
            assert_eq!([group.t_min[lane], group.t_max[lane]], [2.0 * t_min, 2.0 * t_max]);
            // The point at the waist.
            let z = ray.origin()[2] + group.shift[lane] / ray.shear()[2];
            assert!((z - plain.how.waist).abs() < 1e-4, "{z}");
        }
        for isa in IsaLevel::available() {
            let other = isa.dispatch(Prepare(&rays, lanes));
            assert_eq!(other.group.origin, plain.group.origin, "{}", isa.name());
            assert_eq!(other.group.shear, plain.group.shear, "{}", isa.name());
            assert_eq!(other.group.t_min, plain.group.t_min, "{}", isa.name());
            assert_eq!(other.group.t_max, plain.group.t_max, "{}", isa.name());
            assert_eq!(other.group.inverse, plain.group.inverse, "{}", isa.name());
            assert_eq!(other.extent.inverse, plain.extent.inverse, "{}", isa.name());
            assert_eq!(other.extent.points, plain.extent.points, "{}", isa.name());
            assert_eq!(other.extent.t_min, plain.extent.t_min, "{}", isa.name());
            for active in [lanes, 0x0010, 0xFF00 & lanes] {
                let ends = [isa, IsaLevel::Scalar(crate::Scalar)];
                let [a, b] = ends.map(|isa| isa.dispatch(End(&plain.group, active)));
                assert_eq!(a, b, "{}", isa.name());
            }
        }
    }
}

/// Boxes against a group and against each of its rays.
struct InBoxes<'a>(&'a Boxes8, &'a Prepared);

impl Kernel for InBoxes<'_> {
    /// Rays that meet each box, tested together and one by one.
    type Output = [[u32; 8]; 2];

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) -> Self::Output {
        let Self(boxes, Prepared { axes, group, .. }) = self;
        let mut met = [[0; 8]; 2];
        for (slot, met) in met[0].iter_mut().enumerate() {
            *met = isa.box16(boxes, slot, axes, group);
        }
        for lane in 0..GROUP {
            let pick =
                |rows: &[[f32; GROUP]; 3]| [rows[0][lane], rows[1][lane], rows[2][lane], 1.0];
            let ray = SlabRay::new(
                pick(&group.inverse),
                pick(&group.near_offset),
                pick(&group.far_offset),
            );
            assert_eq!(ray.near_plane(), axes.near_plane());
            let (t_min, t_max) = (group.t_min[lane], group.t_max[lane]);
            let slots = isa.slab8(boxes, &ray, t_min, t_max, &mut [0.0; 8]);
            for (slot, met) in met[1].iter_mut().enumerate() {
                *met |= (slots >> slot & 1) << lane;
            }
        }
        met
    }
}

#[test]
fn boxes_are_met_as_by_single_rays() {
    let mut random = Random(12);
    let mut count = 0;
    for _ in 0..500 {
        let (boxes, rays) = (random_boxes(&mut random), rays(&mut random));
        for isa in IsaLevel::available() {
            let prepared = isa.dispatch(Prepare(&rays, 0xFFFF));
            let [together, single] = isa.dispatch(InBoxes(&boxes, &prepared));
            assert_eq!(together, single, "{}", isa.name());
            assert_eq!(together[7], 0, "an empty slot was met");
            count += together.iter().map(|met| met.count_ones()).sum::<u32>();
        }
    }
    assert!(count > 3000, "{count}");
}

/// Boxes against an interval.
struct InFrustum<'a>(&'a Boxes8, &'a GroupAxes, &'a Frustum, [f32; 2]);

impl Kernel for InFrustum<'_> {
    type Output = (u32, [f32; 8]);

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) -> Self::Output {
        let Self(boxes, axes, frustum, [t_min, t_max]) = self;
        let mut distances = [0.0; 8];
        let mask = isa.frustum8(boxes, axes, frustum, t_min, t_max, &mut distances);
        (mask, distances)
    }
}

#[test]
fn intervals_meet_what_their_rays_meet_and_not_everything() {
    let mut random = Random(13);
    let (mut missed, mut tested) = (0, 0);
    for _ in 0..500 {
        let (boxes, rays) = (random_boxes(&mut random), rays(&mut random));
        for isa in IsaLevel::available() {
            let prepared = isa.dispatch(Prepare(&rays, 0xFFFF));
            let ends = |row: &[f32; GROUP]| {
                row.iter().fold([f32::MAX, f32::MIN], |[a, b], &x| [a.min(x), b.max(x)])
            };
            let mut frustum = Frustum::default();
            for axis in 0..3 {
                frustum.scale[axis] = ends(&prepared.group.inverse[axis]);
                let of_origin = |scale: f32, far: bool| {
                    let origins: Vec<f32> = rays.iter().map(|ray| ray[axis] * scale).collect();
                    let margin = 2e-6 * scale.abs();
                    if far {
                        origins.iter().copied().fold(f32::MAX, f32::min) - margin
                    } else {
                        origins.iter().copied().fold(f32::MIN, f32::max) + margin
                    }
                };
                frustum.near_offset[axis] = frustum.scale[axis].map(|s| of_origin(s, false));
                frustum.far_offset[axis] = frustum.scale[axis].map(|s| of_origin(s, true));
            }
            let interval = [ends(&prepared.group.t_min)[0], ends(&prepared.group.t_max)[1]];
            let (mask, distances) =
                isa.dispatch(InFrustum(&boxes, &prepared.axes, &frustum, interval));
            let [together, _] = isa.dispatch(InBoxes(&boxes, &prepared));
            for slot in 0..8 {
                let met = mask >> slot & 1 != 0;
                assert!(met || together[slot] == 0, "{}: {boxes:?} {rays:?}", isa.name());
                assert!(!met || distances[slot] <= interval[1]);
                missed += u32::from(!met);
                tested += 1;
            }
        }
    }
    assert!(missed > tested / 4, "{missed} of {tested}");
}

/// One triangle against a group and against each of its rays.
struct Triangle<'a>(&'a Triangles4, usize, &'a [[f32; 8]; GROUP], &'a mut Prepared, &'a Question16);

impl Kernel for Triangle<'_> {
    /// Rays that met it, and that are in doubt, asked for the nearest and for any; what each ray
    /// finds alone.
    type Output = ([(u32, u32); 2], Vec<Option<[f32; 3]>>, u32);

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) -> Self::Output {
        let Self(block, lane, given, Prepared { axes, how, group, .. }, question) = self;
        let (mut alone, mut front) = (vec![], 0);
        for ray in 0..GROUP {
            let [ox, oy, oz, _, dx, dy, dz, _] = given[ray];
            let shear = ShearRay::new(&[ox, oy, oz], &[dx, dy, dz], how.scale);
            let mut hits = TriangleHits::NONE;
            isa.triangles4(block, &shear, group.t_min[ray], group.t_max[ray], &mut hits);
            let met = hits.mask >> lane & 1 != 0;
            alone.push(met.then(|| [hits.t[lane], hits.u[lane], hits.v[lane]]));
            front |= (hits.front >> lane & 1) << ray;
        }
        let any = isa.triangle16::<false>(block, lane, axes, &mut group.clone(), question);
        let nearest = isa.triangle16::<true>(block, lane, axes, group, question);
        ([nearest, any], alone, front)
    }
}

#[test]
fn triangles_are_met_as_by_single_rays() {
    let mut random = Random(14);
    let (mut count, mut doubts) = (0, 0);
    for round in 0..2000 {
        let block = random_block(&mut random, round % 4 == 0);
        let mut given = rays(&mut random);
        if round % 4 == 0 {
            // On the lattice of the block.
            for ray in &mut given {
                (ray[0], ray[1], ray[2]) =
                    ((2.0 * ray[0]).round(), (2.0 * ray[1]).round(), (2.0 * ray[2]).round());
                for k in [4, 5, 6] {
                    ray[k] = ray[k].signum() * if ray[k].abs() >= 1.0 { 1.0 } else { 0.5 };
                }
            }
        }
        let question = Question16 { active: 0xFF7F, keep: [u32::MAX; 2], smallest: 1e-30, id: 5 };
        for isa in IsaLevel::available() {
            let mut prepared = isa.dispatch(Prepare(&given, 0xFFFF));
            let before = prepared.group;
            let ([nearest, any], alone, front) =
                isa.dispatch(Triangle(&block, round % 3, &given, &mut prepared, &question));
            let after = prepared.group;
            for (ray, alone) in alone.iter().enumerate() {
                let bit = 1 << ray;
                if nearest.1 & bit != 0 {
                    doubts += 1;
                    assert_eq!(after.t_max[ray], before.t_max[ray]);
                    continue;
                }
                let expected = alone.is_some() && question.active & bit != 0;
                assert_eq!(nearest.0 & bit != 0, expected, "{}", isa.name());
                assert_eq!(any.0 & bit != 0, expected, "{}", isa.name());
                if let (Some(hit), true) = (alone, expected) {
                    count += 1;
                    assert_eq!([after.t_max[ray], after.u[ray], after.v[ray]], *hit);
                    assert_eq!(after.id[ray], 5);
                    assert_eq!(after.front & bit, front & bit);
                } else {
                    assert_eq!(after.t_max[ray], before.t_max[ray]);
                    assert_eq!(after.id[ray], Group16::NO_ID);
                }
            }
            // The same triangle again changes nothing, one of a lesser index wins, and culled sides
            // are not met.
            let again =
                isa.dispatch(Triangle(&block, round % 3, &given, &mut prepared, &question)).0[0];
            assert_eq!(again.0, 0);
            let lesser = Question16 { id: 4, ..question };
            let won =
                isa.dispatch(Triangle(&block, round % 3, &given, &mut prepared, &lesser)).0[0];
            assert_eq!(won.0, nearest.0);
            for (keep, sides) in [([u32::MAX, 0], front), ([0, u32::MAX], !front)] {
                let mut prepared = isa.dispatch(Prepare(&given, 0xFFFF));
                let kept = Question16 { keep, ..question };
                let met =
                    isa.dispatch(Triangle(&block, round % 3, &given, &mut prepared, &kept)).0[0].0;
                assert_eq!(met, nearest.0 & sides, "{}", isa.name());
            }
        }
    }
    assert!(count > 2000 && doubts > 100, "{count} hits, {doubts} doubts");
}
