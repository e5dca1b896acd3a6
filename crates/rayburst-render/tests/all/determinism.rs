//! Same settings, same bits: for any number of threads, any interruption, any resumption.

use std::{
    ops::ControlFlow,
    sync::atomic::{AtomicU32, Ordering},
    time::Duration,
};

use rayburst_image::{decode_exr, encode_exr};
use rayburst_render::{
    Aov, IntegratorKind, Limits, RenderError, RenderSettings, Renderer, StopReason,
};

use crate::scenes::{render, settings, zoo};

fn all_aovs(size: (u32, u32), spp: u32) -> RenderSettings {
    RenderSettings { aovs: Aov::ALL.map(|(_, aov)| aov).to_vec(), ..settings(size, spp) }
}

#[test]
fn threads_do_not_show() {
    let (scene, camera) = zoo();
    for (name, integrator) in IntegratorKind::ALL {
        let settings = RenderSettings { integrator, ..all_aovs((40, 24), 3) };
        let films = [1, 2, 7].map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| render(&scene, camera, &settings).film().clone())
        });
        assert!(films[0] == films[1] && films[0] == films[2], "{name}");
        // Nothing there has texture coordinates.
        let black = films[0].mean().pixels.iter().all(|p| p.max_element() == 0.0);
        assert_eq!(black, name == "uv", "{name}");
    }
}

#[test]
fn a_resumed_render_is_an_uninterrupted_one() {
    let (scene, camera) = zoo();
    let whole = render(&scene, camera, &all_aovs((40, 24), 13));
    let mut bytes: Option<Vec<u8>> = None;
    for spp in [1, 4, 13] {
        let mut part = Renderer::new(scene.clone(), camera, all_aovs((40, 24), spp)).unwrap();
        if let Some(bytes) = &bytes {
            let saved = decode_exr(bytes, "saved").unwrap();
            assert!(part.resume(&saved).unwrap() > 0);
        }
        part.render();
        bytes = Some(encode_exr(&part.layers(true), "part").unwrap());
    }
    assert!(bytes.unwrap() == encode_exr(&whole.layers(true), "whole").unwrap());
}

#[test]
fn another_render_is_not_continued() {
    let (scene, camera) = zoo();
    let saved = render(&scene, camera, &settings((8, 8), 2)).layers(true);
    let other = RenderSettings { seed: 5, ..settings((8, 8), 4) };
    let error = Renderer::new(scene.clone(), camera, other).unwrap().resume(&saved).unwrap_err();
    assert!(matches!(&error, RenderError::Resume { name, .. } if name == "seed"), "{error}");
    // Neither is a picture without the state.
    let plain = render(&scene, camera, &settings((8, 8), 2)).layers(false);
    assert!(Renderer::new(scene, camera, settings((8, 8), 4)).unwrap().resume(&plain).is_err());
}

#[test]
fn an_interrupt_keeps_complete_passes() {
    let (scene, camera) = zoo();
    let mut renderer = Renderer::new(scene.clone(), camera, settings((64, 48), 1000)).unwrap();
    let calls = AtomicU32::new(0);
    let outcome = renderer.render_until(&Limits::default(), &|progress| {
        assert!(progress.tiles_done <= progress.tiles && progress.samples_done() <= 1000.0);
        // In the middle of the third pass; a pass has twelve tiles.
        if calls.fetch_add(1, Ordering::Relaxed) == 30 {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    });
    assert_eq!((outcome.reason, outcome.samples), (StopReason::Interrupted, 2));
    assert_eq!(renderer.film().samples_taken(), (2, 2));
    let expected = render(&scene, camera, &settings((64, 48), 2));
    assert!(renderer.film() == expected.film());
    assert_eq!(renderer.rays(), expected.rays());
}

#[test]
fn limits_end_a_render() {
    let (scene, camera) = zoo();
    let go_on = |_: &rayburst_render::Progress| ControlFlow::Continue(());
    let mut renderer = Renderer::new(scene.clone(), camera, settings((16, 12), 1 << 20)).unwrap();
    let budget = Duration::from_millis(300);
    let limits = Limits { budget: Some(budget), noise: None };
    let outcome = renderer.render_until(&limits, &go_on);
    assert_eq!(outcome.reason, StopReason::Budget);
    assert!(outcome.samples > 0 && outcome.elapsed < 4 * budget, "{outcome:?}");
    // A budget of nothing still gives a picture.
    let mut renderer = Renderer::new(scene.clone(), camera, settings((16, 12), 64)).unwrap();
    let limits = Limits { budget: Some(Duration::ZERO), noise: None };
    assert_eq!(renderer.render_until(&limits, &go_on).samples, 1);
    let mut renderer = Renderer::new(scene, camera, settings((16, 12), 1 << 20)).unwrap();
    let limits = Limits { budget: None, noise: Some(0.1) };
    let outcome = renderer.render_until(&limits, &go_on);
    assert_eq!(outcome.reason, StopReason::Noise);
    assert!(renderer.noise().unwrap() <= 0.1 && outcome.samples < 1 << 20);
}

#[test]
fn settings_out_of_range_are_named() {
    let (scene, camera) = zoo();
    let good = settings((8, 8), 4);
    for (bad, word) in [
        (RenderSettings { size: (0, 8), ..good.clone() }, "empty"),
        (RenderSettings { size: (100_000, 100_000), ..good.clone() }, "limit"),
        (RenderSettings { spp: 0, ..good.clone() }, "samples"),
        (RenderSettings { max_depth: 0, ..good.clone() }, "depth"),
        (RenderSettings { filter_radius: Some(-1.0), ..good.clone() }, "radius"),
        (RenderSettings { ao_radius: f32::NAN, ..good.clone() }, "occlusion"),
    ] {
        let error = Renderer::new(scene.clone(), camera, bad).unwrap_err().to_string();
        assert!(error.contains(word), "{error}");
    }
}
