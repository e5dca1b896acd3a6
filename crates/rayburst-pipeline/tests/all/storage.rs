//! Storage that shaders write: buffers and textures, with what is beyond their ends.

use std::sync::Mutex;

use glam::{UVec2, Vec3};
use rayburst_accel::{BuildOptions, RayFlags};
use rayburst_pipeline::{HitGroup, RwBuffer, RwTexture, ShaderTable};

use crate::{
    dispatch_rays::nothing,
    harness::{once, ray, structure},
    scenes::down,
    trace_ray::both,
};

/// Values come back, and neighbours stay.
fn round_trip<T: bytemuck::NoUninit + bytemuck::AnyBitPattern + PartialEq + std::fmt::Debug>(
    value: T,
) {
    let buffer = RwBuffer::<T>::new(5);
    assert_eq!((buffer.len(), buffer.is_empty()), (5, false));
    buffer.store(3, value);
    let zero = T::zeroed();
    assert_eq!(buffer.to_vec(), [zero, zero, zero, value, zero]);
    // Beyond the end: zero is read, nothing is written.
    for index in [5, 6, 1000, usize::MAX / 2, usize::MAX] {
        buffer.store(index, value);
        assert_eq!(buffer.load(index), zero);
    }
    assert_eq!(buffer.to_vec(), [zero, zero, zero, value, zero]);
    let none = RwBuffer::<T>::new(0);
    assert!(none.is_empty() && none.to_vec().is_empty());
    assert_eq!(none.load(0), zero);
}

macro_rules! elements {
    ($($name:ident = $value:expr;)*) => {
        $(
            #[test]
            fn $name() {
                round_trip($value);
            }
        )*
    };
}

elements! {
    elements_of_one_word = 0xDEAD_BEEFu32;
    elements_of_a_float = -0.5f32;
    elements_of_two_words = u64::MAX - 7;
    elements_of_bytes = [1u8, 2, 3, 4, 5, 6, 7, 8];
    elements_of_three_words = Vec3::new(1.0, 2.0, 3.0);
    elements_of_64_words = std::array::from_fn::<u32, 64, _>(|n| n as u32 + 1);
    elements_of_1024_words = [7u32; 1024];
}

#[test]
fn atomic_add_of_all_launches() {
    let sums = RwBuffer::<u32>::new(3);
    let before = RwBuffer::<u32>::new(4096);
    let mut table = ShaderTable::new();
    let generate = table.ray_generation(|launch| {
        let x = launch.launch_index().x;
        before.store(x as usize, sums.atomic_add(0, 1) + 1);
        sums.atomic_add(1, x);
        sums.atomic_add(usize::MAX, 1);
        assert_eq!(sums.atomic_add(3, 5), 0);
    });
    table.build(0).unwrap().dispatch_rays(&nothing(), generate, 4096, 1, 1).unwrap();
    assert_eq!(sums.to_vec(), [4096, 4095 * 4096 / 2, 0]);
    // What it was is different for each.
    let mut before = before.to_vec();
    before.sort_unstable();
    assert!(before.into_iter().eq(1..=4096));
}

#[test]
fn atomic_add_wraps() {
    let sum = RwBuffer::<u32>::new(1);
    sum.store(0, u32::MAX);
    assert_eq!(sum.atomic_add(0, 2), u32::MAX);
    assert_eq!(sum.load(0), 1);
}

#[test]
fn atomic_min_and_max_of_all_launches() {
    let ends = RwBuffer::<u32>::new(2);
    ends.store(0, u32::MAX);
    let mut table = ShaderTable::new();
    let generate = table.ray_generation(|launch| {
        let value = 100 + launch.launch_index().x * 7919 % 1009;
        assert!(ends.atomic_min(0, value) >= 100);
        assert!(ends.atomic_max(1, value) <= 1108);
        assert_eq!((ends.atomic_min(2, 0), ends.atomic_max(2, 9)), (0, 0));
    });
    table.build(0).unwrap().dispatch_rays(&nothing(), generate, 1009, 1, 1).unwrap();
    assert_eq!(ends.to_vec(), [100, 1108]);
}

#[test]
fn texels_by_position() {
    let texture = RwTexture::<[u32; 2]>::new(7, 5);
    let mut table = ShaderTable::new();
    let generate = table.ray_generation(|launch| {
        let at = launch.launch_index().truncate();
        texture.store(at, [at.x, at.y]);
    });
    // A grid larger than the texture: what is outside is dropped.
    table.build(0).unwrap().dispatch_rays(&nothing(), generate, 9, 8, 1).unwrap();
    let expected = (0..5).flat_map(|y| (0..7).map(move |x| [x, y]));
    assert_eq!(texture.to_vec(), expected.collect::<Vec<_>>());
}

#[test]
fn texels_outside() {
    let texture = RwTexture::<f32>::new(4, 3);
    let outside =
        [(4, 0), (0, 3), (4, 3), (u32::MAX, 0), (0, u32::MAX), (u32::MAX, u32::MAX), (5, 1)];
    for at in outside.map(|(x, y)| UVec2::new(x, y)) {
        texture.store(at, 1.0);
        assert_eq!(texture.load(at), 0.0, "{at}");
    }
    assert_eq!(texture.to_vec(), [0.0; 12]);
    let none = RwTexture::<f32>::new(0, 3);
    none.store(UVec2::ZERO, 1.0);
    assert_eq!((none.load(UVec2::ZERO), none.to_vec().len()), (0.0, 0));
}

/// Every shader type writes, intersection shaders too, and a later dispatch reads.
#[test]
fn written_by_all_shader_types() {
    let counts = RwBuffer::<u32>::new(6);
    let tlas = structure(&both(), &BuildOptions::default());
    let copy = Mutex::new(vec![]);
    let mut table = ShaderTable::new();
    let ray_type = table.ray_type::<u32>("ray", 0, 1, 0);
    let note = |which| {
        counts.atomic_add(which, 1);
    };
    let callable = table.callable(|_, _: &mut u32| note(5));
    table.miss("miss", |_, _: &mut u32| note(4));
    table.hit(&HitGroup::triangles("sheet").closest_hit(|_, _: &mut u32| note(3)), ());
    let group = HitGroup::<u32, ()>::procedural("ball", |shader| {
        note(1);
        shader.report_hit(2.0, 0, ());
    });
    let group = group.any_hit(|hit, _| {
        note(2);
        hit.ignore_hit()
    });
    table.hit(&group, ());
    let generate = table.ray_generation(|launch| {
        note(0);
        launch.call_shader(callable, &mut 0);
        let up = rayburst_math::Ray::new(Vec3::new(0.0, 0.0, 9.0), Vec3::Z);
        for ray in [ray(&down(5.0)), up] {
            launch.trace_ray(ray_type, RayFlags::empty(), 0xFF, &ray, &mut 0);
        }
    });
    let read = table.ray_generation(|_| *copy.lock().unwrap() = counts.to_vec());
    let pipeline = table.build(1).unwrap();
    pipeline.dispatch_rays(&tlas, generate, 50, 2, 1).unwrap();
    pipeline.dispatch_rays(&tlas, read, 1, 1, 1).unwrap();
    drop(pipeline);
    let copy = copy.lock().unwrap();
    assert_eq!((copy[0], copy[3], copy[4], copy[5]), (100, 100, 100, 100));
    // The ball is before the sheet: its box is met whatever is found first.
    assert_eq!((copy[1], copy[2]), (100, 100));
    assert_eq!(counts.to_vec(), *copy);
}

/// Words are written as a whole: what is read of one is what somebody wrote.
#[test]
fn words_are_whole() {
    let shared = RwBuffer::<u32>::new(1);
    let mut table = ShaderTable::new();
    let generate = table.ray_generation(|launch| {
        let byte = launch.launch_index().x % 256;
        shared.store(0, byte * 0x0101_0101);
        let seen = shared.load(0);
        assert_eq!(seen, (seen & 0xFF) * 0x0101_0101);
    });
    once_many(table, generate);
    let seen = shared.load(0);
    assert_eq!(seen, (seen & 0xFF) * 0x0101_0101);
}

fn once_many(table: ShaderTable<'_>, generate: rayburst_pipeline::RayGenerationId) {
    let pipeline = table.build(0).unwrap();
    pipeline.dispatch_rays(&nothing(), generate, 5000, 1, 1).unwrap();
}

#[test]
fn stored_values_are_seen_by_the_same_launch() {
    let buffer = RwBuffer::<u32>::new(1);
    let mut table = ShaderTable::new();
    let generate = table.ray_generation(|_| {
        for value in 0..100 {
            buffer.store(0, value);
            assert_eq!(buffer.load(0), value);
        }
    });
    once(table, &nothing(), generate);
}

#[test]
fn textures_know_their_size_and_come_from_slices() {
    let texels: Vec<u32> = (0..12).collect();
    let texture = RwTexture::from_slice(4, &texels).unwrap();
    assert_eq!(texture.size(), UVec2::new(4, 3));
    assert_eq!(texture.load(UVec2::new(1, 2)), 9);
    assert_eq!(texture.to_vec(), texels);
    texture.store(UVec2::new(3, 0), 77);
    let copy = RwTexture::from_slice(texture.size().x, &texture.to_vec()).unwrap();
    assert_eq!((copy.load(UVec2::new(3, 0)), copy.load(UVec2::new(4, 0))), (77, 0));
    assert_eq!(RwTexture::<u32>::new(7, 5).size(), UVec2::new(7, 5));
    assert_eq!(RwTexture::<u32>::new(7, 0).size(), UVec2::new(7, 0));
    assert_eq!(RwTexture::<u32>::new(0, 7).size(), UVec2::ZERO);
    // No whole rows.
    assert!(RwTexture::from_slice(5, &texels).is_none());
    assert!(RwTexture::from_slice(0, &texels).is_none());
    assert_eq!(
        RwTexture::<u32>::from_slice(0, &[]).map(|texture| texture.size()),
        Some(UVec2::ZERO)
    );
    assert_eq!(RwBuffer::from_slice(&texels).to_vec(), texels);
}
