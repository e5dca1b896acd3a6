//! Figure 26.2: the camera's frame {**r**, **u**, **v**} and the ray through a pixel (Eq. 26.2).
//!
//! One camera of ours is drawn as another one sees it: every point of the diagram goes through
//! [`Camera::ray`] of the first and [`Camera::project`] of the second.

use rayburst::{
    glam::{DVec3, Mat3, Vec2, Vec3},
    scene::Camera,
};

use super::{
    Drawing,
    canvas::{Anchor, Canvas, Pen, Style, ink},
};
use crate::error::Result;

/// Pixels of the camera that is drawn.
const GRID: (u32, u32) = (8, 5);
/// The pixel whose ray is drawn.
const PIXEL: (u32, u32) = (6, 3);
/// Vertical field of view of the camera that is drawn, degrees.
const FOV: f32 = 48.0;
/// The picture on which Eq. 26.2 is checked.
const CHECKED: (u32, u32) = (640, 400);

/// Draws the frame and checks the equation at every pixel.
pub(super) fn draw() -> Result<Drawing> {
    let mut canvas = Canvas::new(790, 460)?;
    canvas.heading(
        "Figure 26.2 · the camera",
        "Position e, frame {r, u, v} with v into the scene, and the ray with direction d through the pixel (x, y).",
    );
    let camera = Camera::look_at(Vec3::ZERO, -Vec3::Z, Vec3::Y, FOV.to_radians());
    let observer =
        Camera::look_at(Vec3::new(2.3, 1.25, 1.55), Vec3::new(0.12, -0.02, -0.62), Vec3::Y, 0.62);
    let diagram = Diagram { camera, observer, page: (790, 460) };
    diagram.screen(&mut canvas);
    diagram.angle(&mut canvas);
    diagram.frame(&mut canvas);
    diagram.ray(&mut canvas);

    let check = check(&Camera::look_at(
        Vec3::new(1.0, 2.0, 3.0),
        Vec3::new(-4.0, 0.5, -2.0),
        Vec3::Y,
        FOV.to_radians(),
    ));
    let (width, height) = CHECKED;
    canvas.footing(&format!(
        "d of all {} pixels of a {width}x{height} picture follows Eq. 26.2 within {:.1e}; det {{r, u, v}} = {:.0} (left-handed).",
        width * height,
        check.direction,
        check.handedness
    ));
    let numbers = vec![
        ("largest |d − Eq. 26.2| over all pixels", format!("{:.1e}", check.direction)),
        ("det {r, u, v} (left-handed: −1)", format!("{:.6}", check.handedness)),
        ("largest |r·u|, |r·v|, |u·v|", format!("{:.1e}", check.skew)),
        ("largest |project(ray) − pixel|", format!("{:.1e} pixels", check.projection)),
    ];
    Ok(Drawing { picture: canvas.into_image(), numbers })
}

/// How well the camera follows the equation.
struct Check {
    direction: f64,
    handedness: f32,
    skew: f32,
    projection: f32,
}

fn check(camera: &Camera) -> Check {
    let [r, u, v] = camera.frame();
    let (width, height) = CHECKED;
    let mut check = Check {
        direction: 0.0,
        handedness: Mat3::from_cols(r, u, v).determinant(),
        skew: r.dot(u).abs().max(r.dot(v).abs()).max(u.dot(v).abs()),
        projection: 0.0,
    };
    let f = (0.5 * f64::from(FOV.to_radians())).tan();
    let a = f64::from(width) / f64::from(height);
    let [r64, u64, v64]: [DVec3; 3] = [r, u, v].map(|axis| axis.as_dvec3());
    for y in 0..height {
        for x in 0..width {
            let pixel = Vec2::new(x as f32 + 0.5, y as f32 + 0.5);
            let (ray, _) = camera.ray(pixel, CHECKED, Vec2::ZERO);
            let sx = a * f * (2.0 * (f64::from(x) + 0.5) / f64::from(width) - 1.0);
            let sy = f * (2.0 * (f64::from(y) + 0.5) / f64::from(height) - 1.0);
            let expected = (sx * r64 - sy * u64 + v64).normalize();
            let error = (ray.direction.as_dvec3() - expected).length();
            check.direction = check.direction.max(error);
            if let Some((back, _)) = camera.project(ray.at(3.0), CHECKED) {
                check.projection = check.projection.max(back.distance(pixel));
            }
        }
    }
    check
}

struct Diagram {
    camera: Camera,
    observer: Camera,
    page: (u32, u32),
}

impl Diagram {
    /// A point of the world on the page.
    fn page(&self, world: Vec3) -> Vec2 {
        self.observer.project(world, self.page).map_or(Vec2::ZERO, |(p, _)| p)
    }

    /// Where the ray through a point of the picture meets the plane at distance 1.
    fn on_screen(&self, x: f32, y: f32) -> Vec3 {
        let (ray, _) = self.camera.ray(Vec2::new(x, y), GRID, Vec2::ZERO);
        let ahead = self.camera.frame()[2];
        ray.origin + ray.direction / ray.direction.dot(ahead)
    }

    fn screen(&self, canvas: &mut Canvas) {
        let (w, h) = (GRID.0 as f32, GRID.1 as f32);
        let corner = |x: f32, y: f32| self.page(self.on_screen(x, y));
        let corners = [corner(0.0, 0.0), corner(w, 0.0), corner(w, h), corner(0.0, h)];
        for &at in &corners {
            canvas.line(self.page(self.camera.eye()), at, Pen::dashed(ink::GREY, 0.8));
        }
        canvas.polygon(&corners, [208, 228, 240, 110], None);
        let (x, y) = (PIXEL.0 as f32, PIXEL.1 as f32);
        let pixel =
            [corner(x, y), corner(x + 1.0, y), corner(x + 1.0, y + 1.0), corner(x, y + 1.0)];
        canvas.polygon(&pixel, [240, 180, 30, 170], None);
        let pen = Pen::new([0, 114, 178, 150], 0.9);
        for column in 0..=GRID.0 {
            canvas.line(corner(column as f32, 0.0), corner(column as f32, h), pen);
        }
        for row in 0..=GRID.1 {
            canvas.line(corner(0.0, row as f32), corner(w, row as f32), pen);
        }
        let label = |canvas: &mut Canvas, at: Vec2, text: &str, anchor| {
            canvas.label(at, text, ink::BLUE, anchor);
        };
        label(canvas, corners[0] + Vec2::new(-8.0, 0.0), "(0, 0)", Anchor::End);
        label(canvas, corners[2] + Vec2::new(8.0, 12.0), "(w, h)", Anchor::Start);
        let top = corners[0].lerp(corners[1], 0.5) + Vec2::new(4.0, -10.0);
        label(canvas, top, "w pixels, 2 a f wide", Anchor::Start);
        let side = corners[1].lerp(corners[2], 0.3) + Vec2::new(10.0, 0.0);
        label(canvas, side, "h pixels, 2 f high", Anchor::Start);
    }

    /// The vertical field of view φ.
    fn angle(&self, canvas: &mut Canvas) {
        let middle = 0.5 * GRID.0 as f32;
        let (top, bottom) = (self.on_screen(middle, 0.0), self.on_screen(middle, GRID.1 as f32));
        let eye = self.camera.eye();
        for end in [top, bottom] {
            canvas.line(self.page(eye), self.page(end), Pen::new(ink::GREY, 1.0));
        }
        let arc: Vec<Vec2> = (0..=24)
            .map(|i| {
                let along = top.lerp(bottom, i as f32 / 24.0) - eye;
                self.page(eye + 0.3 * along.normalize())
            })
            .collect();
        canvas.polyline(&arc, Pen::new(ink::GREEN, 1.8));
        canvas.text(
            arc[16] + Vec2::new(-12.0, 10.0),
            "φ",
            16.0,
            ink::GREEN,
            Anchor::End,
            Style::Bold,
        );
    }

    fn frame(&self, canvas: &mut Canvas) {
        let eye = self.camera.eye();
        let at = self.page(eye);
        let inks = [ink::ORANGE, ink::GREEN, ink::BLUE];
        let shifts = [Vec2::new(10.0, 12.0), Vec2::new(-6.0, -8.0), Vec2::new(2.0, 22.0)];
        for (i, (axis, name)) in self.camera.frame().into_iter().zip(["r", "u", "v"]).enumerate() {
            let tip = self.page(eye + 0.5 * axis);
            canvas.arrow(at, tip, Pen::new(inks[i], 2.6));
            canvas.text(tip + shifts[i], name, 17.0, inks[i], Anchor::Middle, Style::Bold);
        }
        canvas.circle(at, 4.5, ink::BLACK, None);
        let below = at + Vec2::new(-8.0, 18.0);
        canvas.text(below, "e", 17.0, ink::BLACK, Anchor::End, Style::Bold);
    }

    fn ray(&self, canvas: &mut Canvas) {
        let eye = self.camera.eye();
        let through = self.on_screen(PIXEL.0 as f32 + 0.5, PIXEL.1 as f32 + 0.5);
        let at = self.page(through);
        canvas.line(self.page(eye), at, Pen::new(ink::BLACK, 1.6));
        let end = self.page(eye + 1.4 * (through - eye));
        canvas.arrow(at, end, Pen::new(ink::BLACK, 1.6));
        canvas.circle(at, 3.2, ink::BLACK, None);
        canvas.text(
            end + Vec2::new(-4.0, -8.0),
            "d",
            17.0,
            ink::BLACK,
            Anchor::Middle,
            Style::Bold,
        );
        let label = at + Vec2::new(8.0, 18.0);
        canvas.label(label, "(x + ½, y + ½)", ink::BLACK, Anchor::Start);
        let formula = [
            "d = s / ‖s‖",
            "s = a f (2 (x + ½) / w − 1) r − f (2 (y + ½) / h − 1) u + v",
            "f = tan(φ / 2),  a = w / h",
        ];
        for (i, line) in formula.into_iter().enumerate() {
            let at = Vec2::new(24.0, 378.0 + 19.0 * i as f32);
            canvas.text(at, line, 13.0, ink::BLACK, Anchor::Start, Style::Plain);
        }
    }
}
