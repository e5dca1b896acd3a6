//! `bench frame`: frames in real time under a camera that moves, pass by pass.

use std::{sync::Arc, time::Instant};

use glam::{Affine3A, Vec3};
use rayburst_render::realtime::{FrameMode, FrameRenderer, FrameSettings, History};
use rayburst_scene::{Camera, FlatInstance, FlatScene};

use crate::{BenchError, Row, error, machine::Machine, updates::median};

/// Frames before those that are measured.
pub const WARM_UP: usize = 16;

/// The pass that stands for the whole frame.
pub const WHOLE: &str = "frame";

/// What to measure.
#[derive(Clone, Debug)]
pub struct FrameBench {
    /// Threads that render, ≥ 1.
    pub threads: usize,
    /// Runs of each mode and scale, ≥ 1; they take turns.
    pub repeats: usize,
    /// Measured frames of a run, ≥ 1.
    pub frames: usize,
    /// Which modes.
    pub modes: Vec<FrameMode>,
    /// Which sizes that are rendered, as parts of the frame's along each side.
    pub render_scales: Vec<f32>,
    /// Everything else.
    pub settings: FrameSettings,
}

impl FrameBench {
    /// Frames of all runs on one scene, with those before.
    pub fn total_frames(&self) -> usize {
        let runs = self.repeats * self.modes.len() * self.render_scales.len();
        runs * (WARM_UP + self.frames)
    }
}

/// Measures all modes and scales on one scene: for each a row a pass in milliseconds, then the whole frame
/// in milliseconds and in frames a second. `advance` is called after every frame.
///
/// The camera sways around where it is; every run renders the same frames.
pub fn bench_frames(
    name: &str,
    scene: &Arc<FlatScene>,
    camera: &Camera,
    options: &FrameBench,
    advance: &mut dyn FnMut(),
) -> Result<Vec<Row>, BenchError> {
    let pool = error::pool(options.threads)?;
    let mut subjects = Vec::new();
    for &mode in &options.modes {
        for &render_scale in &options.render_scales {
            let settings = FrameSettings { mode, render_scale, ..options.settings };
            subjects.push((FrameRenderer::new(settings)?, Times::default()));
        }
    }
    let sway = Sway::new(camera, scene);
    for _ in 0..options.repeats {
        for (renderer, times) in &mut subjects {
            let mut history = History::new();
            for number in 0..WARM_UP + options.frames {
                let camera = sway.at(number);
                pool.install(|| {
                    let begin = Instant::now();
                    let frame = renderer.frame(scene, &camera, &mut history)?;
                    let seconds = begin.elapsed().as_secs_f64();
                    if number >= WARM_UP {
                        times.begin_frame(seconds, frame.rays().total());
                        for pass in frame.passes {
                            times.add(pass.name, pass.seconds, pass.rays.total());
                        }
                    }
                    Ok::<(), BenchError>(())
                })?;
                advance();
            }
        }
    }
    let common = Row {
        bench: "frame",
        scene: name.to_owned(),
        triangles: triangles(scene),
        denoiser: Some(options.settings.denoiser.name()),
        frames: Some(options.frames),
        repeats: options.repeats,
        threads: options.threads,
        machine: Machine::here(),
        ..Row::default()
    };
    let rows = subjects.iter().flat_map(|(renderer, times)| {
        let settings = renderer.settings();
        let (width, height) = settings.render_size();
        let row = Row {
            mode: Some(settings.mode.name()),
            render_scale: Some(settings.render_scale),
            ..common.clone()
        };
        times.rows(&row, f64::from(width) * f64::from(height))
    });
    Ok(rows.collect())
}

/// Placed triangles.
fn triangles(scene: &FlatScene) -> usize {
    let of_instance = |instance: &FlatInstance| {
        let first = instance.first_geometry as usize;
        let geometries = &scene.geometries[first..first + instance.geometry_count as usize];
        geometries.iter().map(|geometry| geometry.primitive.indices.len()).sum::<usize>()
    };
    scene.instances.iter().map(of_instance).sum()
}

/// What the frames of one mode and scale took.
#[derive(Debug, Default)]
struct Times {
    /// The whole frame first.
    passes: Vec<PassTimes>,
    frames: usize,
}

#[derive(Debug)]
struct PassTimes {
    name: &'static str,
    /// Frame by frame.
    seconds: Vec<f64>,
    rays: u64,
}

impl Times {
    fn begin_frame(&mut self, seconds: f64, rays: u64) {
        self.frames += 1;
        for pass in &mut self.passes {
            pass.seconds.push(0.0);
        }
        self.add(WHOLE, seconds, rays);
    }

    /// Adds a pass to the frame that began last; a pass may come several times.
    fn add(&mut self, name: &'static str, seconds: f64, rays: u64) {
        let at = self.passes.iter().position(|pass| pass.name == name).unwrap_or_else(|| {
            self.passes.push(PassTimes { name, seconds: vec![0.0; self.frames], rays: 0 });
            self.passes.len() - 1
        });
        let pass = &mut self.passes[at];
        if let Some(last) = pass.seconds.last_mut() {
            *last += seconds;
        }
        pass.rays += rays;
    }

    /// Rows of the passes, then those of the whole frame.
    fn rows(&self, common: &Row, pixels: f64) -> Vec<Row> {
        let row = |pass: &PassTimes| {
            let (least, most) = pass
                .seconds
                .iter()
                .fold((f64::INFINITY, 0.0f64), |(least, most), &s| (least.min(s), most.max(s)));
            Row {
                pass: Some(pass.name),
                rays_per_pixel: Some(pass.rays as f64 / (pixels * self.frames as f64)),
                value: 1e3 * median(&pass.seconds),
                unit: "ms",
                min: 1e3 * least,
                max: 1e3 * most,
                ..common.clone()
            }
        };
        let Some((whole, parts)) = self.passes.split_first() else { return Vec::new() };
        let mut rows: Vec<Row> = parts.iter().map(row).collect();
        let whole = row(whole);
        let rate = |milliseconds: f64| 1e3 / milliseconds.max(1e-6);
        let fps = Row {
            value: rate(whole.value),
            unit: "fps",
            min: rate(whole.max),
            max: rate(whole.min),
            ..whole.clone()
        };
        rows.extend([whole, fps]);
        rows
    }
}

/// A camera that sways to the sides and up and down, and turns a few degrees: smooth, and never twice in
/// the same place.
#[derive(Clone, Copy, Debug)]
struct Sway {
    camera: Camera,
    /// How far it goes to either side, world units.
    reach: f32,
}

impl Sway {
    /// Turns to either side, radians.
    const TURN: f32 = 0.05;
    /// How far it goes, as a part of the distance to what it looks at.
    const REACH: f32 = 0.04;
    /// Radians of the slowest oscillation a frame.
    const STEP: f32 = 0.1;

    fn new(camera: &Camera, scene: &FlatScene) -> Self {
        let bounds = &scene.bounds;
        let distance = if bounds.is_empty() {
            1.0
        } else {
            // Inside of a scene its middle may be near.
            let to_middle = camera.eye().distance(bounds.centre());
            to_middle.max(0.1 * bounds.extent().length())
        };
        Self { camera: *camera, reach: Self::REACH * distance }
    }

    fn at(&self, frame: usize) -> Camera {
        // Ratios of the golden section: the path does not close.
        let phase = Self::STEP * frame as f32;
        let (slow, fast) = ((0.618 * phase).sin(), phase.sin());
        let local = Affine3A::from_rotation_translation(
            glam::Quat::from_rotation_y(Self::TURN * slow),
            self.reach * Vec3::new(fast, 0.25 * slow, 0.0),
        );
        Camera { transform: self.camera.transform * local, ..self.camera }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    use rayburst_accel::BuildOptions;
    use rayburst_render::realtime::{Passes, Technique};
    use rayburst_scene::{Flattener, Pose};

    fn cornell() -> (Arc<FlatScene>, Camera) {
        let scene = rayburst_scene::builtin::build("cornell").unwrap();
        let pose = Pose::rest(&scene);
        let flat = Flattener::new(&scene, BuildOptions::default()).at(&pose).unwrap();
        (Arc::new(flat), scene.views[0].camera)
    }

    fn options() -> FrameBench {
        FrameBench {
            threads: 1,
            repeats: 2,
            frames: 3,
            modes: FrameMode::ALL.map(|(_, mode)| mode).to_vec(),
            render_scales: vec![1.0, 0.5],
            settings: FrameSettings {
                size: (24, 16),
                gbuffer: Technique::Rays,
                ..FrameSettings::default()
            },
        }
    }

    #[test]
    fn every_mode_and_scale_has_its_passes_and_the_frame() {
        let (scene, camera) = cornell();
        let (options, mut frames) = (options(), 0);
        let rows = bench_frames("cornell", &scene, &camera, &options, &mut || frames += 1).unwrap();
        assert_eq!((frames, options.total_frames()), (2 * 4 * 19, 2 * 4 * 19));
        for (_, mode) in FrameMode::ALL {
            for scale in [1.0, 0.5] {
                let of =
                    |row: &&Row| row.mode == Some(mode.name()) && row.render_scale == Some(scale);
                let rows: Vec<&Row> = rows.iter().filter(of).collect();
                let (parts, whole) = rows.split_at(rows.len() - 2);
                assert_eq!((whole[0].pass, whole[0].unit), (Some(WHOLE), "ms"));
                assert_eq!((whole[1].pass, whole[1].unit), (Some(WHOLE), "fps"));
                assert!((whole[0].value * whole[1].value - 1000.0).abs() < 1e-6);
                assert!((whole[0].max * whole[1].min - 1000.0).abs() < 1e-6);
                // The frame that is fastest of all takes as long as its passes do, at least.
                let sum: f64 = parts.iter().map(|row| row.min).sum();
                assert!(sum > 0.0 && sum <= whole[0].min, "{sum} of {}", whole[0].min);
                let rays: f64 = parts.iter().filter_map(|row| row.rays_per_pixel).sum();
                assert!((rays - whole[0].rays_per_pixel.unwrap()).abs() < 1e-9);
                let eye = parts.iter().find(|row| row.pass == Some("visibility")).unwrap();
                assert!((1.0..2.5).contains(&rays) || mode == FrameMode::Path, "{rays}");
                assert_eq!((eye.rays_per_pixel, eye.unit), (Some(1.0), "ms"));
                for row in rows {
                    assert!(row.min <= row.value && row.value <= row.max, "{row:?}");
                    assert_eq!((row.bench, row.denoiser, row.repeats), ("frame", Some("none"), 2));
                    assert_eq!((row.scene.as_str(), row.frames), ("cornell", Some(3)));
                }
            }
        }
        let json = serde_json::to_value(&rows[0]).unwrap();
        assert_eq!((&json["mode"], &json["render_scale"]), (&"hybrid".into(), &1.0.into()));
    }

    #[test]
    fn passes_that_do_not_run_have_no_rays() {
        let (scene, camera) = cornell();
        let passes = Passes { indirect: false, reflections: false, ..Passes::ALL };
        let settings = FrameSettings { passes, ..options().settings };
        let options = FrameBench { settings, repeats: 1, ..options() };
        let rows = bench_frames("cornell", &scene, &camera, &options, &mut || ()).unwrap();
        let mut indirect = rows.iter().filter(|row| row.pass == Some("indirect"));
        assert!(indirect.all(|row| row.rays_per_pixel == Some(0.0)));
        let wrong = FrameBench { render_scales: vec![0.25], ..options };
        assert!(bench_frames("cornell", &scene, &camera, &wrong, &mut || ()).is_err());
    }

    #[test]
    fn the_camera_sways_smoothly_and_never_stands_still() {
        let (scene, camera) = cornell();
        let sway = Sway::new(&camera, &scene);
        let cameras: Vec<Camera> = (0..200).map(|frame| sway.at(frame)).collect();
        let distance = camera.eye().distance(scene.bounds.centre());
        for (index, one) in cameras.iter().enumerate() {
            assert!(one.eye().distance(camera.eye()) < 0.05 * distance);
            assert!(one.frame()[2].dot(camera.frame()[2]) > 0.05f32.cos() - 1e-5);
            assert!(cameras[..index].iter().all(|other| other.transform != one.transform));
        }
        for pair in cameras.windows(2) {
            assert!(pair[0].eye().distance(pair[1].eye()) < 0.006 * distance);
        }
    }

    #[test]
    fn a_pass_may_be_missing_or_come_twice() {
        let mut times = Times::default();
        times.begin_frame(5.0, 9);
        times.add("a", 1.0, 4);
        times.add("a", 2.0, 4);
        times.begin_frame(7.0, 1);
        times.add("b", 6.0, 1);
        times.begin_frame(9.0, 0);
        let rows = times.rows(&Row::default(), 1.0);
        let shown: Vec<_> =
            rows.iter().map(|row| (row.pass.unwrap(), row.min, row.value, row.max)).collect();
        assert_eq!(
            shown[..3],
            [("a", 0.0, 0.0, 3000.0), ("b", 0.0, 0.0, 6000.0), (WHOLE, 5000.0, 7000.0, 9000.0)]
        );
        assert_eq!(rows[0].rays_per_pixel, Some(8.0 / 3.0));
    }
}
