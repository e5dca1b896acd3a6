//! Instance masking: a ray visits an instance if their masks share a bit.

use glam::DVec3;

use crate::{
    harness::verify,
    model::{Instance, Scene, Table},
    scenes::{ONE_TYPE, clear, down, sheet, solids, triangles, without_ends},
};
use crate::{model::flag, scenes::ball};

/// Eight sheets below each other, the nth of mask 2ⁿ, each with a ball under it.
fn stack(masks: [u8; 8]) -> Scene {
    let geometries = vec![triangles(vec![sheet(0.0)], true), solids(vec![ball(-0.5, 0.25)], false)];
    let instances = masks.iter().enumerate().map(|(n, &mask)| {
        let transform = glam::DAffine3::from_translation(DVec3::new(0.0, 0.0, -(n as f64)));
        Instance { mask, ..Instance::new(0, transform) }
    });
    Scene { instances: instances.collect(), blases: vec![geometries] }
}

fn bits() -> [u8; 8] {
    std::array::from_fn(|bit| 1 << bit)
}

/// The instance that a ray of a mask stops at.
fn check(masks: [u8; 8], mask: u8, instance: Option<usize>) {
    let scene = stack(masks);
    let table = Table::fit(&scene, &ONE_TYPE, without_ends);
    for flags in [0, flag::SKIP_TRIANGLES, flag::ACCEPT_FIRST] {
        let ray = clear(&scene, &table, crate::model::Ray { mask, flags, ..down(5.0) });
        if flags != flag::ACCEPT_FIRST {
            let stop = ray.1.stops[0].map(|stop| ray.1.candidates[stop].event.place.instance);
            assert_eq!(stop, instance.map(|instance| instance as u32));
        }
        let tally = verify(&scene, &table, &[ray]);
        assert_eq!(
            (tally.closest_hits, tally.misses),
            match instance {
                Some(_) => (1, 0),
                None => (0, 1),
            }
        );
    }
}

macro_rules! each_bit {
    ($($name:ident = $bit:literal;)*) => {
        $(
            #[test]
            fn $name() {
                check(bits(), 1 << $bit, Some($bit));
                // Every bit but one passes the one instance without it.
                let others = bits().map(|bit| if bit == 1 << $bit { !bit } else { bit });
                check(others, 1 << $bit, None);
            }
        )*
    };
}

each_bit! {
    bit_0 = 0;
    bit_1 = 1;
    bit_2 = 2;
    bit_3 = 3;
    bit_4 = 4;
    bit_5 = 5;
    bit_6 = 6;
    bit_7 = 7;
}

#[test]
fn ray_mask_of_zero_misses() {
    check(bits(), 0, None);
    check([0xFF; 8], 0, None);
}

#[test]
fn instance_mask_of_zero_is_never_visited() {
    check([0; 8], 0xFF, None);
}

#[test]
fn one_common_bit_is_enough() {
    check([0x0F; 8], 0x18, Some(0));
    check([0x0F, 0x0F, 0xF0, 0xFF, 0, 0, 0, 0], 0x30, Some(2));
}

#[test]
fn all_bits_visit_everything() {
    check(bits(), 0xFF, Some(0));
    check([0, 0, 0, 0, 0, 0, 0, 0x80], 0xFF, Some(7));
}
