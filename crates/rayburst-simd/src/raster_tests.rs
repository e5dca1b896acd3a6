//! Tiles are covered alike by all instruction sets.

use crate::{
    Isa, IsaLevel, Kernel, PixelPlanes, PixelTile, PixelTriangle, TilePart, tests::Random,
};

struct Cover<'a>(&'a PixelPlanes, &'a PixelTriangle<'a>, &'a TilePart, u32, PixelTile);

impl Kernel for Cover<'_> {
    type Output = ([[u64; 2]; 4], PixelTile);

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) -> Self::Output {
        let Self(planes, triangle, part, id, mut tile) = self;
        let only_asked = isa.cover_tile::<true, false>(planes, triangle, part, id, &mut tile);
        let mut without = tile;
        let masks = [
            only_asked,
            isa.cover_tile::<false, false>(planes, triangle, part, id, &mut tile),
            isa.cover_tile::<true, true>(planes, triangle, part, id, &mut tile),
            isa.cover_tile::<false, true>(planes, triangle, part, id, &mut without),
        ];
        assert_eq!(
            (masks[0], masks[1]),
            (masks[2], masks[3]),
            "writing does not change the answer"
        );
        assert_eq!(without.ids, self.4.ids);
        (masks, tile)
    }
}

#[test]
fn tiles_are_covered_alike_bit_for_bit() {
    let mut random = Random(11);
    let (mut covered, mut ties, mut close) = (0, 0, 0);
    for i in 0..40_000u32 {
        let mut number = |size: f32| random.vector()[0] * size;
        let four = |number: &mut dyn FnMut(f32) -> f32, size: f32| [0; 4].map(|_| number(size));
        let mut planes = PixelPlanes {
            x: four(&mut number, 1.0),
            y: four(&mut number, 1.0),
            at_origin: four(&mut number, 8.0),
            limit: 20.0,
            nearest: number(30.0),
        };
        if i % 2 == 0 {
            // Whole numbers: edges through pixels, and equal nearness.
            for row in [&mut planes.x, &mut planes.y, &mut planes.at_origin] {
                *row = row.map(f32::round);
            }
        }
        if i % 64 == 0 {
            planes.x[(i / 64 % 4) as usize] = f32::NAN;
        }
        let mut tile = PixelTile { nearness: [0.0; 64], ids: [0; 64] };
        for pixel in 0..64 {
            tile.nearness[pixel] = number(8.0).round();
            tile.ids[pixel] = i / 2 + pixel as u32 % 3;
        }
        let corner = |value: f32| (value.abs() * 4.0) as u32 % 8;
        let mut span = || {
            let (a, b) = (corner(number(2.0)), corner(number(2.0)));
            [a.min(b), a.max(b)]
        };
        let (columns, rows) = (span(), span());
        // What decides in doubt has nothing to do with the planes here.
        let corners = [[-9.0, -9.0, 1.0, 0.0], [20.0, -9.0, 1.0, 0.0], [-9.0, 30.0, 1.0, 0.0]];
        let triangle = PixelTriangle { corners: &corners, first: [0.25, 0.25], turned: false };
        let part = TilePart { first: [8.0 * (i % 3) as f32, 8.0 * (i % 5) as f32], columns, rows };
        let (expected, seen) = Cover(&planes, &triangle, &part, i / 2 + 1, tile).run(crate::Scalar);
        covered += expected[0][0].count_ones();
        ties += (expected[0][0] & !expected[1][0]).count_ones();
        close += expected[0][1].count_ones();
        for level in IsaLevel::available() {
            let (masks, found) = level.dispatch(Cover(&planes, &triangle, &part, i / 2 + 1, tile));
            assert_eq!(masks, expected, "{}", level.name());
            assert_eq!(found.nearness.map(f32::to_bits), seen.nearness.map(f32::to_bits));
            assert_eq!(found.ids, seen.ids);
        }
    }
    assert!(covered > 10_000 && ties > 100 && close > 100, "{covered} {ties} {close}");
}

struct Prepare<'a>(&'a [[f32; 4]; 3], [f64; 2], bool);

impl Kernel for Prepare<'_> {
    type Output = (PixelPlanes, crate::PixelEdges);

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) -> Self::Output {
        let mut planes = PixelPlanes::NONE;
        let edges = if self.2 {
            isa.pixel_planes::<true>(self.0, self.1, &mut planes)
        } else {
            isa.pixel_planes::<false>(self.0, self.1, &mut planes)
        };
        (planes, edges)
    }
}

#[test]
fn planes_are_prepared_alike_and_doubt_covers_their_errors() {
    let mut random = Random(23);
    let mut least = [0; 2];
    for i in 0..40_000 {
        let perspective = i % 2 == 0;
        let size = [1.0, 30.0, 900.0, 1e6][i / 2 % 4];
        let corners = [0; 3].map(|_| {
            let [x, y, w] = random.vector();
            let w = if perspective { w + 0.5 } else { 1.0 };
            [x * size * w, y * size * w, w, if perspective { 1.0 / w } else { random.next() }]
        });
        let first = [f64::from(random.next()) * 300.0, f64::from(random.next()) * 300.0];
        let (planes, edges) = Prepare(&corners, first, perspective).run(crate::Scalar);
        for level in IsaLevel::available() {
            let (found, found_edges) = level.dispatch(Prepare(&corners, first, perspective));
            let bits = |p: &PixelPlanes| {
                let rows = [p.x, p.y, p.at_origin].map(|row| row.map(f32::to_bits));
                (rows, p.limit.to_bits(), p.nearest.to_bits())
            };
            assert_eq!(bits(&found), bits(&planes), "{}", level.name());
            assert_eq!(found_edges.det.to_bits(), edges.det.to_bits());
            for edge in 0..3 {
                let lanes = |e: &crate::PixelEdges| [0, 1, 2].map(|i| e.edges[i][edge].to_bits());
                assert_eq!(lanes(&found_edges), lanes(&edges));
            }
        }
        if edges.det == 0.0 {
            continue;
        }
        let triangle = PixelTriangle { corners: &corners, first, turned: edges.det < 0.0 };
        for _ in 0..16 {
            let [x, y, _] = random.vector().map(|x| (31.5 * (x + 1.0)).round());
            let values = [0, 1, 2].map(|edge| planes.at(edge, x, y));
            let least_value = values[0].min(values[1]).min(values[2]);
            if least_value.abs() > PixelPlanes::DOUBT {
                assert_eq!(
                    triangle.covers(x, y),
                    least_value > 0.0,
                    "{corners:?} {first:?} {x} {y}"
                );
                least[usize::from(least_value > 0.0)] += 1;
            }
        }
    }
    assert!(least[0] > 10_000 && least[1] > 1000, "{least:?}");
}
