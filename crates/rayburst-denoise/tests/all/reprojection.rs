//! Surfaces are found again.

use glam::Vec3;
use rayburst_denoise::{Reprojection, SurfaceTests, Taps, reproject};
use rayburst_image::Plane;

use crate::frames::{Frame, plane};

const TESTS: SurfaceTests =
    SurfaceTests { depth: 0.01, slope: 2.0, normal: 0.9, object: true, search: false };

/// A picture that depends on nothing but the place in the world.
fn world(x: f32, y: f32) -> f32 {
    100.0 + 3.0 * x - 7.0 * y
}

fn moved(frame: &Frame, by: (f32, f32)) -> Frame {
    let mut frame = frame.clone();
    frame.motion[0].fill(by.0);
    frame.motion[1].fill(by.1);
    frame
}

#[test]
fn a_pan_finds_the_exact_values_of_the_frame_before() {
    let (w, h) = (37, 21);
    let before = plane(w, h, |x, y| world(x as f32, y as f32));
    for (dx, dy) in [(0.0, 0.0), (3.0, -2.0), (-4.0, 5.0), (0.25, 0.5), (-1.75, 2.125)] {
        let frame = Frame::wall(w, h);
        let mut reprojection = Reprojection::new();
        let first = reprojection.advance(&frame.guides(), &TESTS).unwrap();
        assert!(first.row(0).iter().all(|taps| !taps.is_some()));
        let moved = moved(&frame, (dx, dy));
        let taps = reprojection.advance(&moved.guides(), &TESTS).unwrap();
        let mut now = Plane::new(w, h).unwrap();
        reproject(taps, &before, -1e3, &mut now).unwrap();
        for y in 0..h {
            for x in 0..w {
                let (px, py) = (x as f32 + dx, y as f32 + dy);
                let inside =
                    (0.0..=w as f32 - 1.0).contains(&px) && (0.0..=h as f32 - 1.0).contains(&py);
                let whole = dx.fract() == 0.0 && dy.fract() == 0.0;
                if inside {
                    let error = (now.get(x, y) - world(px, py)).abs();
                    assert!(error <= if whole { 0.0 } else { 1e-4 }, "{x} {y}: {error}");
                }
                let sum: f32 = taps.get(x, y).weights.iter().sum();
                assert!(sum == 0.0 || (sum - 1.0).abs() < 1e-6);
                assert_eq!(sum > 0.0, now.get(x, y) != -1e3);
                if px < -0.5 || py < -0.5 || px > w as f32 - 0.5 || py > h as f32 - 0.5 {
                    assert_eq!(taps.get(x, y), Taps::NONE);
                }
            }
        }
    }
}

#[test]
fn other_surfaces_get_no_weight_and_what_was_hidden_no_history() {
    // An object in front moves to the right by four pixels and uncovers the wall.
    let (w, h) = (32, 8);
    let with_object = |left: u32| {
        let mut frame = Frame::wall(w, h);
        for y in 0..h {
            for x in left..left + 8 {
                frame.depth.set(x, y, 5.0);
                frame.object.set(x, y, 2);
            }
        }
        frame
    };
    let mut now = with_object(12);
    for y in 0..h {
        for x in 12..20 {
            now.motion[0].set(x, y, -4.0);
        }
    }
    // Each test suffices on its own to tell object and wall apart.
    let loose = SurfaceTests { depth: 1.0, normal: -1.0, object: false, ..TESTS };
    for tests in [SurfaceTests { object: true, ..loose }, SurfaceTests { depth: 0.01, ..loose }] {
        let mut reprojection = Reprojection::new();
        reprojection.advance(&with_object(8).guides(), &tests).unwrap();
        let taps = reprojection.advance(&now.guides(), &tests).unwrap();
        for y in 0..h {
            for x in 0..w {
                assert_eq!(taps.get(x, y).is_some(), !(8..12).contains(&x), "{x} {y} {tests:?}");
            }
        }
    }
    // Half a pixel over the edge: the whole weight goes to the pixel of the wall.
    let mut before = with_object(8);
    let mut reprojection = Reprojection::new();
    reprojection.advance(&before.guides(), &TESTS).unwrap();
    before.motion[0].fill(0.5);
    let taps = reprojection.advance(&before.guides(), &TESTS).unwrap();
    assert_eq!(taps.get(7, 3), Taps { x: 7, y: 3, weights: [1.0, 0.0, 0.0, 0.0] });
    assert_eq!(taps.get(15, 3), Taps { x: 15, y: 3, weights: [1.0, 0.0, 0.0, 0.0] });
    assert_eq!(taps.get(3, 3).weights, [0.5, 0.5, 0.0, 0.0]);
}

#[test]
fn normals_tell_surfaces_apart() {
    let mut frame = Frame::wall(16, 4);
    let mut reprojection = Reprojection::new();
    reprojection.advance(&frame.guides(), &TESTS).unwrap();
    for y in 0..4 {
        for x in 8..16 {
            frame.normal.set(x, y, Vec3::X);
        }
    }
    let taps = reprojection.advance(&frame.guides(), &TESTS).unwrap();
    assert!((0..16).all(|x| taps.get(x, 2).is_some() == (x < 8)));
}

#[test]
fn slanted_surfaces_pass_the_depth_test() {
    // A floor whose depth grows by a tenth from row to row.
    let mut frame = Frame::wall(8, 64);
    for y in 0..64 {
        for x in 0..8 {
            frame.depth.set(x, y, 5.0 * 1.1f32.powi(y as i32));
        }
    }
    for (slope, found) in [(2.0, true), (0.0, false)] {
        let tests = SurfaceTests { slope, ..TESTS };
        let mut reprojection = Reprojection::new();
        reprojection.advance(&frame.guides(), &tests).unwrap();
        let moved = moved(&frame, (0.0, 0.5));
        let taps = reprojection.advance(&moved.guides(), &tests).unwrap();
        let both = taps.get(4, 30).weights;
        assert_eq!(both[0] > 0.0 && both[2] > 0.0, found);
    }
}

#[test]
fn the_search_finds_a_surface_one_pixel_away() {
    let mut frame = Frame::wall(16, 16);
    frame.object.fill(2);
    frame.object.set(7, 9, 1);
    for (search, expected) in [(false, false), (true, true)] {
        let tests = SurfaceTests { search, ..TESTS };
        let mut reprojection = Reprojection::new();
        reprojection.advance(&frame.guides(), &tests).unwrap();
        let mut now = frame.clone();
        now.object.fill(1);
        let taps = reprojection.advance(&now.guides(), &tests).unwrap();
        for (x, y) in [(6, 8), (8, 8), (6, 10), (8, 10)] {
            let taps = taps.get(x, y);
            assert_eq!(taps.is_some(), expected);
            if expected {
                let mut marked = Plane::new(16, 16).unwrap();
                marked.set(7, 9, 1.0);
                assert_eq!(taps.of(&marked), 1.0);
            }
        }
        assert!(!taps.get(9, 9).is_some());
    }
}

#[test]
fn nothing_finds_nothing_again_and_bad_guides_find_no_history() {
    let mut frame = Frame::wall(16, 4);
    for x in 0..16 {
        frame.depth.set(x, 0, f32::INFINITY);
        frame.object.set(x, 0, 0);
        frame.normal.set(x, 0, Vec3::ZERO);
    }
    let mut reprojection = Reprojection::new();
    reprojection.advance(&frame.guides(), &TESTS).unwrap();
    frame.motion[0].set(3, 1, f32::NAN);
    frame.motion[1].set(4, 1, f32::INFINITY);
    frame.depth.set(5, 1, f32::NAN);
    frame.normal.set(6, 1, Vec3::splat(f32::NAN));
    let taps = reprojection.advance(&frame.guides(), &TESTS).unwrap().clone();
    assert!((0..16).all(|x| taps.get(x, 0).is_some()));
    assert!((0..16).all(|x| taps.get(x, 1).is_some() != (3..7).contains(&x)));
    // A reset, or another size, starts afresh.
    reprojection.reset();
    assert!(!reprojection.advance(&frame.guides(), &TESTS).unwrap().get(8, 2).is_some());
    assert!(reprojection.advance(&frame.guides(), &TESTS).unwrap().get(8, 2).is_some());
    let other = Frame::wall(1, 1);
    assert!(!reprojection.advance(&other.guides(), &TESTS).unwrap().get(0, 0).is_some());
    assert!(reprojection.advance(&other.guides(), &TESTS).unwrap().get(0, 0).is_some());
    let bad = SurfaceTests { depth: f32::NAN, ..TESTS };
    assert!(reprojection.advance(&other.guides(), &bad).is_err());
}
