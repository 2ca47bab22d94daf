//! Labels and light as pictures for people.

use image::ExtendedColorType;

use super::{expect_len, png};
use crate::drawing::picture::{Labels, Rendered};
use crate::shapes::material::Semantic;
use crate::truth::boxes::VehicleBox;
use crate::truth::flow::Flow;
use spikelane::error::Result;

fn picture(pixels: Vec<[u8; 3]>, width: usize, height: usize) -> Result<Vec<u8>> {
    expect_len("picture", pixels.len(), width * height)?;
    png(pixels.as_flattened(), width, height, ExtendedColorType::Rgb8)
}

/// The sRGB curve with a soft shoulder above 0.6, so that lamps keep a shape.
fn tone(linear: f32) -> u8 {
    let x = linear.max(0.0);
    let x = if x < 0.6 { x } else { 1.0 - 0.4 * libm::expf((0.6 - x) / 0.4) };
    let s = if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * libm::powf(x, 1.0 / 2.4) - 0.055 };
    (s * 255.0 + 0.5) as u8
}

/// A colour photograph exposed for `white_cd_m2`.
///
/// # Errors
/// When the frame's fields do not match its size.
pub fn light_picture(frame: &Rendered, white_cd_m2: f32) -> Result<Vec<u8>> {
    let pixels = frame.rgb.iter().map(|c| c.map(|v| tone(v / white_cd_m2))).collect();
    picture(pixels, frame.labels.width, frame.labels.height)
}

/// The photograph with the boxes of visible vehicles: what is seen in green, the whole
/// vehicle as far as it lies in the image in orange.
///
/// # Errors
/// When the frame's fields do not match its size.
pub fn boxes_picture(frame: &Rendered, white_cd_m2: f32, boxes: &[VehicleBox]) -> Result<Vec<u8>> {
    let (width, height) = (frame.labels.width, frame.labels.height);
    let mut pixels: Vec<_> = frame.rgb.iter().map(|c| c.map(|v| tone(v / white_cd_m2))).collect();
    expect_len("picture", pixels.len(), width * height)?;
    for b in boxes {
        let Some(visible) = b.visible else { continue };
        outline(&mut pixels, width, height, b.amodal_in_image, [255, 140, 0]);
        outline(&mut pixels, width, height, visible, [40, 255, 60]);
    }
    picture(pixels, width, height)
}

/// The pixels along the inside of a box's edges.
fn outline(pixels: &mut [[u8; 3]], width: usize, height: usize, corners: [f32; 4], colour: [u8; 3]) {
    let [x0, y0, x1, y1] = corners;
    let inside = |v: f32, n: usize| v.max(0.0).min((n - 1) as f32) as usize;
    let (left, right) = (inside(x0.floor(), width), inside(x1.ceil() - 1.0, width));
    let (top, bottom) = (inside(y0.floor(), height), inside(y1.ceil() - 1.0, height));
    for x in left..=right {
        pixels[top * width + x] = colour;
        pixels[bottom * width + x] = colour;
    }
    for y in top..=bottom {
        pixels[y * width + left] = colour;
        pixels[y * width + right] = colour;
    }
}

/// Depth from near (warm) to far (blue), black in the sky; equal steps of 1/depth.
///
/// # Errors
/// When the labels' fields do not match their size.
pub fn depth_picture(labels: &Labels) -> Result<Vec<u8>> {
    let colour = |d: &f32| {
        if d.is_finite() { rainbow((4.0 / (d + 3.0)).clamp(0.0, 1.0)) } else { [0; 3] }
    };
    picture(labels.depth_m.iter().map(colour).collect(), labels.width, labels.height)
}

/// Blue through green to red (a polynomial fit of Google's Turbo, 2019).
fn rainbow(x: f32) -> [u8; 3] {
    let p = |c: [f32; 6]| c.iter().rev().fold(0.0, |a, b| a * x + b);
    [
        p([0.1357, 4.6154, -42.6603, 132.1311, -152.9424, 59.2864]),
        p([0.0914, 2.1942, 4.8430, -14.1850, 4.2773, 2.8296]),
        p([0.1067, 12.6419, -60.5820, 110.3628, -89.9031, 27.3482]),
    ]
    .map(|v| (v.clamp(0.0, 1.0) * 255.0) as u8)
}

/// Direction as hue and length as saturation, full at `full_px`.
///
/// # Errors
/// When the flow's fields do not match its size.
pub fn flow_picture(flow: &Flow, full_px: f32) -> Result<Vec<u8>> {
    let colour = |(dx, dy): (&f32, &f32)| {
        let hue = libm::atan2f(*dy, *dx) / std::f32::consts::TAU + 0.5;
        let strength = (dx.hypot(*dy) / full_px).min(1.0);
        [0.0, 2.0, 4.0].map(|shift| {
            let k = (hue * 6.0 + shift).rem_euclid(6.0);
            let channel = ((k - 3.0).abs() - 1.0).clamp(0.0, 1.0);
            ((1.0 - strength * (1.0 - channel)) * 255.0) as u8
        })
    };
    picture(flow.dx.iter().zip(&flow.dy).map(colour).collect(), flow.width, flow.height)
}

/// Every class in the colour of Cityscapes.
///
/// # Errors
/// When the labels' fields do not match their size.
pub fn semantic_picture(labels: &Labels) -> Result<Vec<u8>> {
    let colour = |n: &u8| Semantic::ALL.into_iter().find(|s| *s as u8 == *n).map_or([0; 3], Semantic::colour);
    picture(labels.semantic.iter().map(colour).collect(), labels.width, labels.height)
}

/// Every vehicle in a colour of its own.
///
/// # Errors
/// When the labels' fields do not match their size.
pub fn instance_picture(labels: &Labels) -> Result<Vec<u8>> {
    let colour = |id: &u32| {
        if *id == 0 {
            return [24; 3];
        }
        let h = id.wrapping_mul(0x9e37_79b1);
        [h >> 24, h >> 16, h >> 8].map(|b| 64 + (b & 0xff) as u8 / 4 * 3)
    };
    picture(labels.instance.iter().map(colour).collect(), labels.width, labels.height)
}
