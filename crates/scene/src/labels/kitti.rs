//! KITTI's files: flow and depth as 16-bit PNG, boxes as text
//! (Geiger et al., CVPR 2012, and the development kits of 2012 and 2015).

use std::fmt::Write;

use image::ExtendedColorType;

use super::{expect_len, png};
use crate::truth::boxes::VehicleBox;
use crate::truth::flow::Flow;
use spikelane::error::Result;

/// 16-bit samples in the machine's order, as the encoder wants them.
fn words(values: impl Iterator<Item = u16>) -> Vec<u8> {
    values.flat_map(u16::to_ne_bytes).collect()
}

/// Flow as 16-bit RGB: `64 d + 32768` for dx and dy, then 1 where valid.
///
/// The step of 1/64 px is too coarse for the motion of one readout: use it
/// over an interval, or the `f32` formats. `occluded_too` keeps hidden pixels
/// valid (`flow_occ`); otherwise they are invalid (`flow_noc`). Flow beyond
/// 512 px is invalid.
///
/// # Errors
/// When the flow's fields do not match its size.
pub fn kitti_flow(flow: &Flow, occluded_too: bool) -> Result<Vec<u8>> {
    let n = flow.width * flow.height;
    expect_len("flow", flow.dx.len().min(flow.dy.len()).min(flow.occluded.len()), n)?;
    let code = |d: f32| (d * 64.0 + 32_768.0).round();
    let pixels = (0..n).flat_map(|i| {
        let (x, y) = (code(flow.dx[i]), code(flow.dy[i]));
        let fits = |v: f32| (0.0..=65_535.0).contains(&v);
        let valid = fits(x) && fits(y) && (occluded_too || !flow.occluded[i]);
        if valid { [x as u16, y as u16, 1] } else { [0, 0, 0] }
    });
    png(&words(pixels), flow.width, flow.height, ExtendedColorType::Rgb16)
}

/// Depth as 16-bit grey: `256 m`, 0 where unknown (sky, and beyond 255.99 m).
///
/// # Errors
/// When the data is not width times height.
pub fn kitti_depth(depth_m: &[f32], width: usize, height: usize) -> Result<Vec<u8>> {
    expect_len("depth", depth_m.len(), width * height)?;
    let code = |d: &f32| {
        if *d < 255.99 { (d * 256.0).round() as u16 } else { 0 }
    };
    png(&words(depth_m.iter().map(code)), width, height, ExtendedColorType::L16)
}

/// One line of a label file: type, truncated, occluded, alpha, the amodal box
/// within the image, height width length, bottom centre, rotation_y.
#[must_use]
pub fn kitti_line(b: &VehicleBox) -> String {
    let [x0, y0, x1, y1] = b.amodal_in_image;
    let [l, w, h] = b.size_m;
    let [x, y, z] = b.centre_m;
    // KITTI counts pixels from the middle of the first one, boxes inclusive.
    format!(
        "{} {:.2} {} {:.2} {:.2} {:.2} {:.2} {:.2} {:.2} {:.2} {:.2} {:.2} {:.2} {:.2} {:.2}",
        b.class.kitti(),
        b.truncation,
        b.kitti_occlusion(),
        b.alpha(),
        x0,
        y0,
        x1 - 1.0,
        y1 - 1.0,
        h,
        w,
        l,
        x,
        y + 0.5 * f64::from(h),
        z,
        b.rotation_y
    )
}

/// A label file of all vehicles with at least `min_pixels` visible pixels.
#[must_use]
pub fn kitti_text(boxes: &[VehicleBox], min_pixels: u32) -> String {
    let mut text = String::new();
    for b in boxes.iter().filter(|b| b.visible_pixels >= min_pixels.max(1)) {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{}", kitti_line(b));
    }
    text
}

#[cfg(test)]
mod tests {
    use crate::truth::flow::Flow;

    #[test]
    fn flow_comes_back_within_half_a_step() {
        let flow = Flow {
            width: 2,
            height: 1,
            dx: vec![3.21, 600.0],
            dy: vec![-0.37, 0.0],
            occluded: vec![false, false],
        };
        let bytes = super::kitti_flow(&flow, true).unwrap();
        let read = image::load_from_memory(&bytes).unwrap().into_rgb16();
        let p = read.get_pixel(0, 0).0;
        assert!((f32::from(p[0]) / 64.0 - 512.0 - 3.21).abs() <= 1.0 / 128.0);
        assert!((f32::from(p[1]) / 64.0 - 512.0 + 0.37).abs() <= 1.0 / 128.0);
        assert_eq!((p[2], read.get_pixel(1, 0).0[2]), (1, 0));
    }
}
