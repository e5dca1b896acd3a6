//! Ctrl-C: the picture so far is kept.

#![cfg(unix)]

use std::{
    process::{Child, Command, Stdio},
    time::{Duration, Instant},
};

use crate::program::{Place, Ran, command};

fn start(place: &Place, output: &str) -> Child {
    begin(place, &format!("render --size 64x64 --spp 1000000 -o {output}"))
}

fn begin(place: &Place, line: &str) -> Child {
    command(place.folder())
        .args(line.split(' '))
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap()
}

fn signal(child: &Child, name: &str) {
    let sent = Command::new("kill").args([name, &child.id().to_string()]).status().unwrap();
    assert!(sent.success());
}

#[test]
fn the_picture_so_far_is_kept_and_can_be_continued() {
    let place = Place::new();
    for (name, kind) in [("a.png", "-INT"), ("b.exr", "-TERM")] {
        let child = start(&place, name);
        std::thread::sleep(Duration::from_millis(1500));
        let asked = Instant::now();
        signal(&child, kind);
        let ran = Ran::new(child.wait_with_output());
        assert_eq!(ran.code, Some(0), "{ran:?}");
        assert!(asked.elapsed() < Duration::from_secs(20), "it stops soon");
        assert!(ran.stderr.contains("samples a pixel, stopped by you"), "{ran:?}");
        assert!(!place.read(name).is_empty());
    }
    assert_eq!(place.files(), ["a.png", "b.exr"]);
    let ran = place.good("render --size 64x64 --spp 1000000 --budget 0.2 --resume -o b.exr --json");
    assert!(ran.json()["spp"].as_u64().unwrap() > 1);
    assert!(ran.stderr.contains("b.exr holds"), "{ran:?}");
}

#[test]
fn the_second_one_ends_the_process() {
    let place = Place::new();
    let child = start(&place, "a.png");
    std::thread::sleep(Duration::from_millis(700));
    signal(&child, "-INT");
    signal(&child, "-INT");
    let ran = Ran::new(child.wait_with_output());
    assert!(matches!(ran.code, Some(0 | 130)), "{ran:?}");
    assert!(place.files().iter().all(|f| !f.contains("part")), "{:?}", place.files());
}

#[test]
fn frames_end_between_each_other() {
    let place = Place::new();
    let line = "render --size 48x48 --integrator hybrid --frames 0..999999 -o f.####.png";
    let child = begin(&place, line);
    std::thread::sleep(Duration::from_millis(1500));
    signal(&child, "-INT");
    let ran = Ran::new(child.wait_with_output());
    assert_eq!(ran.code, Some(0), "{ran:?}");
    let files = place.files();
    assert!(files.len() > 1 && files.iter().all(|name| name.ends_with(".png")), "{files:?}");
    let child = begin(&place, "render --size 48x48 --integrator hybrid --spp 10000000 -o one.png");
    std::thread::sleep(Duration::from_millis(1500));
    signal(&child, "-INT");
    let ran = Ran::new(child.wait_with_output());
    assert_eq!(ran.code, Some(0), "{ran:?}");
    assert!(ran.stderr.contains("samples a pixel, stopped by you"), "{ran:?}");
    assert!(place.files().contains(&"one.png".to_owned()));
}
