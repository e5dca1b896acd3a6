use std::fs;

use super::*;
use crate::colour::srgb_table;

fn frames(count: u32) -> Vec<Rgb8Image> {
    let (width, height) = (96u32, 54u32);
    let frame = |t: u32| {
        let pixel = |i: u32| {
            let (x, y) = (i % width, i / width);
            if x.abs_diff(10 + 4 * t) < 6 && y.abs_diff(27) < 6 {
                return [250, 40, 30];
            }
            [(x * 255 / 95) as u8, (y * 255 / 53) as u8, 128]
        };
        Rgb8Image { width, height, data: (0..width * height).flat_map(pixel).collect() }
    };
    (0..count).map(frame).collect()
}

/// The frames as a viewer shows them, and their delays.
fn play(bytes: &[u8]) -> (Vec<Vec<[u8; 3]>>, Vec<u16>) {
    let mut decoder = ::gif::DecodeOptions::new().read_info(bytes).unwrap();
    let palette: Vec<[u8; 3]> = decoder.palette().unwrap().as_chunks().0.to_vec();
    let (mut shown, mut out, mut delays) = (Vec::new(), Vec::new(), Vec::new());
    while let Some(frame) = decoder.read_next_frame().unwrap() {
        shown.resize(frame.buffer.len(), [0; 3]);
        for (pixel, &index) in shown.iter_mut().zip(frame.buffer.iter()) {
            if Some(index) != frame.transparent {
                *pixel = palette[usize::from(index)];
            }
        }
        out.push(shown.clone());
        delays.push(frame.delay);
    }
    (out, delays)
}

#[test]
fn an_animation_plays_as_it_was_given() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.gif");
    let frames = frames(12);
    write_gif(&path, &frames, 30.0).unwrap();
    let bytes = fs::read(&path).unwrap();
    let (played, delays) = play(&bytes);
    assert_eq!(played.len(), 12);
    assert_eq!(delays.iter().map(|&d| u32::from(d)).sum::<u32>(), 40);
    for (shown, frame) in played.iter().zip(&frames) {
        let wanted = frame.data.as_chunks::<3>().0;
        let error: f64 = shown
            .iter()
            .zip(wanted)
            .map(|(a, b)| (0..3).map(|i| f64::from(a[i].abs_diff(b[i])).powi(2)).sum::<f64>())
            .sum();
        let rms = (error / frame.data.len() as f64).sqrt();
        assert!(rms < 8.0, "{rms}");
        // Dithered areas have the right light on average.
        let light = |p: &[u8; 3]| f64::from(srgb_table()[usize::from(p[1])]);
        let mean = |p: &[[u8; 3]]| p.iter().map(light).sum::<f64>() / p.len() as f64;
        assert!((mean(shown) - mean(wanted)).abs() < 0.01);
    }
    // What stands still costs little: far less than twelve pictures.
    let one = folder.path().join("one.gif");
    write_gif(&one, &frames[..1], 30.0).unwrap();
    assert!((bytes.len() as u64) < 3 * fs::metadata(&one).unwrap().len());
    write_gif(&path, &frames, 30.0).unwrap();
    assert_eq!(fs::read(&path).unwrap(), bytes);
}

#[test]
fn few_colours_are_exact() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("flat.gif");
    let colours = [[0u8, 0, 0], [255, 255, 255], [12, 200, 100], [255, 0, 128]];
    let data = (0..64).flat_map(|i| colours[i / 16]).collect();
    write_gif(&path, &[Rgb8Image { width: 8, height: 8, data }], 1.0).unwrap();
    let (played, delays) = play(&fs::read(&path).unwrap());
    assert!(played[0].iter().enumerate().all(|(i, p)| *p == colours[i / 16]));
    assert_eq!(delays, [100]);
}

#[test]
fn what_is_no_animation_is_said() {
    let path = Path::new("/nowhere/a.gif");
    assert!(write_gif(path, &[], 25.0).unwrap_err().to_string().contains("at least one frame"));
    let one = frames(1);
    assert!(write_gif(path, &one, 0.0).unwrap_err().to_string().contains("0 frames a second"));
    assert!(write_gif(path, &one, 25.0).unwrap_err().to_string().contains("/nowhere/a.gif"));
    let long = Rgb8Image { width: 70_000, height: 1, data: vec![0; 210_000] };
    assert!(write_gif(path, &[long], 25.0).unwrap_err().to_string().contains("65535"));
    let other = Rgb8Image { width: 3, height: 1, data: vec![0; 9] };
    assert!(write_gif(path, &[one[0].clone(), other], 25.0).is_err());
}
