//! Where output goes wrong: folders, devices, closed pipes.

use std::process::Stdio;

use crate::program::{Place, Ran, command};

const TINY: &str = "render --size 8x8 --spp 1 --integrator normal -o";

#[test]
fn an_unwritable_place_is_found_before_rendering() {
    let place = Place::new();
    place.write("file", "");
    std::fs::create_dir(place.path("folder.png")).unwrap();
    // Far more samples than the test would wait for.
    let slow = "render --size 512x512 --spp 1000000 -o";
    for (path, words) in [
        ("missing/a.png", "no such file or folder"),
        ("file/a.png", "cannot write file/a.png"),
        ("folder.png", "is a folder"),
    ] {
        let complaint = place.bad(1, &format!("{slow} {path}"));
        assert!(complaint.contains(words), "{complaint}");
    }
    if cfg!(target_os = "linux") {
        let complaint = place.bad(1, &format!("{slow} /proc/a.png"));
        assert!(complaint.contains("cannot write /proc/a.png"), "{complaint}");
    }
    place.bad(1, "figure 26.4 -o missing/f.png");
    place.good(&format!("{TINY} a.png"));
    place.bad(1, "compare a.png a.png --heatmap missing/map.png");
    place.bad(1, "bench rays --json missing/rows.json");
}

#[test]
#[cfg(target_os = "linux")]
fn a_full_disk_is_an_error() {
    let place = Place::new();
    for name in ["full.png", "full.exr", "full.hdr"] {
        std::os::unix::fs::symlink("/dev/full", place.path(name)).unwrap();
        let complaint = place.bad(1, &format!("{TINY} {name}"));
        assert!(complaint.to_lowercase().contains("no space left"), "{complaint}");
    }
    let full = || std::fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
    for line in ["scenes", "info cornell", "completions bash"] {
        let ran = Ran::new(command(place.folder()).args(line.split(' ')).stdout(full()).output());
        assert_eq!(ran.code, Some(1), "{line}: {ran:?}");
        assert!(ran.complaint(line).contains("standard output"));
    }
    // With stderr full too there is nobody to tell, and still nothing breaks.
    let ran = Ran::new(command(place.folder()).args(["scenes"]).stderr(full()).output());
    assert_eq!(ran.code, Some(0));
}

#[test]
fn a_closed_pipe_is_no_failure() {
    let place = Place::new();
    for line in ["scenes", "completions zsh", "--help", "render --help"] {
        let mut child = command(place.folder())
            .args(line.split(' '))
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        drop(child.stdout.take());
        let ran = Ran::new(child.wait_with_output());
        assert_eq!(ran.code, Some(0), "{line}: {ran:?}");
        assert!(ran.stderr.is_empty(), "{line}: {ran:?}");
    }
}

#[test]
fn an_existing_picture_survives_a_failure() {
    let place = Place::new();
    place.write("a.png", "what was there");
    place.bad(1, "render missing.gltf -o a.png");
    assert_eq!(place.read("a.png"), b"what was there");
    place.good(&format!("{TINY} a.png"));
    assert!(place.read("a.png").starts_with(b"\x89PNG"));
    assert_eq!(place.files(), ["a.png"]);
}
