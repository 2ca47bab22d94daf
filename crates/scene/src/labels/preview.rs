//! Preview images of labels and light.

use glam::Vec3;
use image::ExtendedColorType;

use super::{expect_len, png};
use crate::ground_truth::boxes::VehicleBox;
use crate::ground_truth::flow::Flow;
use crate::lighting::luminance;
use crate::rendering::rendered_frame::{Labels, RenderedFrame};
use crate::shapes::material::Semantic;
use spikelane::error::Result;
use spikelane::unstable::light::srgb_byte;

fn rgb_png(pixels: Vec<[u8; 3]>, width: usize, height: usize) -> Result<Vec<u8>> {
    expect_len("picture", pixels.len(), width * height)?;
    png(pixels.as_flattened(), width, height, ExtendedColorType::Rgb8)
}

/// Returns the sRGB code of a linear value. Values above 0.6 are compressed smoothly, so that the shape of lamps
/// remains visible.
fn tone_map_srgb(linear: f32) -> u8 {
    let x = linear.max(0.0);
    srgb_byte(if x < 0.6 { x } else { 1.0 - 0.4 * libm::expf((0.6 - x) / 0.4) })
}

/// Returns the sRGB codes of the pixels. The codes have the hue of `rgb` and the luminance of `light`, as the sensor
/// receives it.
fn srgb_pixels(frame: &RenderedFrame, white_cd_m2: f32) -> Vec<[u8; 3]> {
    let pixel = |(color, light): (&[f32; 3], &f32)| {
        let scale = light / luminance(Vec3::from(*color)).max(f32::MIN_POSITIVE);
        color.map(|v| tone_map_srgb(v * scale / white_cd_m2))
    };
    frame.rgb.iter().zip(&frame.light).map(pixel).collect()
}

/// Encodes a color image. The luminance `white_cd_m2` becomes white.
///
/// # Errors
/// [`ErrorKind::Usage`](spikelane::ErrorKind::Usage) if the lengths of the frame's fields do not match its size.
pub fn light_preview(frame: &RenderedFrame, white_cd_m2: f32) -> Result<Vec<u8>> {
    rgb_png(srgb_pixels(frame, white_cd_m2), frame.labels.width, frame.labels.height)
}

/// Encodes the color image and draws the boxes of visible vehicles.
///
/// The visible box is green. The amodal box is clipped to the image and is orange.
///
/// # Errors
/// [`ErrorKind::Usage`](spikelane::ErrorKind::Usage) if the lengths of the frame's fields do not match its size.
pub fn boxes_preview(frame: &RenderedFrame, white_cd_m2: f32, boxes: &[VehicleBox]) -> Result<Vec<u8>> {
    let (width, height) = (frame.labels.width, frame.labels.height);
    let mut pixels = srgb_pixels(frame, white_cd_m2);
    expect_len("picture", pixels.len(), width * height)?;
    for b in boxes {
        let Some(visible) = b.visible_box else { continue };
        outline(&mut pixels, width, height, b.clipped_amodal_box, [255, 140, 0]);
        outline(&mut pixels, width, height, visible, [40, 255, 60]);
    }
    rgb_png(pixels, width, height)
}

/// Colors the pixels along the inner side of the edges of a box.
fn outline(pixels: &mut [[u8; 3]], width: usize, height: usize, corners: [f32; 4], color: [u8; 3]) {
    let [x0, y0, x1, y1] = corners;
    let inside = |v: f32, n: usize| v.max(0.0).min((n - 1) as f32) as usize;
    let (left, right) = (inside(x0.floor(), width), inside(x1.ceil() - 1.0, width));
    let (top, bottom) = (inside(y0.floor(), height), inside(y1.ceil() - 1.0, height));
    for x in left..=right {
        pixels[top * width + x] = color;
        pixels[bottom * width + x] = color;
    }
    for y in top..=bottom {
        pixels[y * width + left] = color;
        pixels[y * width + right] = color;
    }
}

/// Encodes depth as color. Near points are red, far points are blue, and the sky is black. The color is linear in 1 /
/// (depth + 3 m).
///
/// # Errors
/// [`ErrorKind::Usage`](spikelane::ErrorKind::Usage) if the lengths of the labels' fields do not match their size.
pub fn depth_preview(labels: &Labels) -> Result<Vec<u8>> {
    let color = |d: &f32| {
        if d.is_finite() { turbo_color((4.0 / (d + 3.0)).clamp(0.0, 1.0)) } else { [0; 3] }
    };
    rgb_png(labels.depth_m.iter().map(color).collect(), labels.width, labels.height)
}

/// Returns a color from blue through green to red. The colors are a polynomial fit of Google's Turbo color map (2019).
fn turbo_color(x: f32) -> [u8; 3] {
    let p = |c: [f32; 6]| c.iter().rev().fold(0.0, |a, b| a * x + b);
    [
        p([0.1357, 4.6154, -42.6603, 132.1311, -152.9424, 59.2864]),
        p([0.0914, 2.1942, 4.8430, -14.1850, 4.2773, 2.8296]),
        p([0.1067, 12.6419, -60.5820, 110.3628, -89.9031, 27.3482]),
    ]
    .map(|v| (v.clamp(0.0, 1.0) * 255.0) as u8)
}

/// Encodes flow as color. The direction determines the hue, and the length determines the saturation. The saturation
/// is full for a length of `full_px`.
///
/// # Errors
/// [`ErrorKind::Usage`](spikelane::ErrorKind::Usage) if the lengths of the flow's fields do not match its width and
/// height.
pub fn flow_preview(flow: &Flow, full_px: f32) -> Result<Vec<u8>> {
    let color = |(dx, dy): (&f32, &f32)| {
        let hue = libm::atan2f(*dy, *dx) / std::f32::consts::TAU + 0.5;
        let strength = (dx.hypot(*dy) / full_px).min(1.0);
        [0.0, 2.0, 4.0].map(|shift| {
            let k = (hue * 6.0 + shift).rem_euclid(6.0);
            let channel = ((k - 3.0).abs() - 1.0).clamp(0.0, 1.0);
            ((1.0 - strength * (1.0 - channel)) * 255.0) as u8
        })
    };
    rgb_png(flow.dx.iter().zip(&flow.dy).map(color).collect(), flow.width, flow.height)
}

/// Encodes every semantic class in the color that Cityscapes assigns to the class.
///
/// # Errors
/// [`ErrorKind::Usage`](spikelane::ErrorKind::Usage) if the lengths of the labels' fields do not match their size.
pub fn semantic_preview(labels: &Labels) -> Result<Vec<u8>> {
    let color = |n: &u8| Semantic::ALL.into_iter().find(|s| *s as u8 == *n).map_or([0; 3], Semantic::color);
    rgb_png(labels.semantic.iter().map(color).collect(), labels.width, labels.height)
}

/// Encodes every vehicle in a different color.
///
/// # Errors
/// [`ErrorKind::Usage`](spikelane::ErrorKind::Usage) if the lengths of the labels' fields do not match their size.
pub fn instance_preview(labels: &Labels) -> Result<Vec<u8>> {
    let color = |id: &u32| {
        if *id == 0 {
            return [24; 3];
        }
        let h = id.wrapping_mul(0x9e37_79b1);
        [h >> 24, h >> 16, h >> 8].map(|b| 64 + (b & 0xff) as u8 / 4 * 3)
    };
    rgb_png(labels.instance.iter().map(color).collect(), labels.width, labels.height)
}
