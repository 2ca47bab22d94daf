//! KITTI files (Geiger et al., CVPR 2012, and the development kits of 2012 and 2015). Flow and depth are 16-bit PNG
//! files, and boxes are text files.

use std::fmt::Write;

use image::ExtendedColorType;

use super::{expect_len, png};
use crate::ground_truth::boxes::VehicleBox;
use crate::ground_truth::flow::Flow;
use spikelane::error::Result;

/// Returns the bytes of 16-bit samples in native byte order. The PNG encoder requires this order.
fn native_words(values: impl Iterator<Item = u16>) -> Vec<u8> {
    values.flat_map(u16::to_ne_bytes).collect()
}

/// Encodes flow as 16-bit RGB. Red is `64 dx + 32768`, green is `64 dy + 32768`, and blue is 1 for valid pixels and 0
/// for invalid pixels.
///
/// Codes have a step of 1/64 px, which is too coarse for the motion of one readout. For short intervals, use an `f32`
/// format. If `occluded_too` is true, occluded pixels are valid (`flow_occ`). Otherwise occluded pixels are invalid
/// (`flow_noc`). Pixels with flow of more than 512 px are always invalid.
///
/// # Errors
/// [`ErrorKind::Usage`](spikelane::ErrorKind::Usage) if the lengths of the flow's fields do not match its width and
/// height.
pub fn kitti_flow(flow: &Flow, occluded_too: bool) -> Result<Vec<u8>> {
    let n = flow.width * flow.height;
    expect_len("flow", flow.dx.len().min(flow.dy.len()).min(flow.is_occluded.len()), n)?;
    let code = |d: f32| (d * 64.0 + 32_768.0).round();
    let pixels = (0..n).flat_map(|i| {
        let (x, y) = (code(flow.dx[i]), code(flow.dy[i]));
        let fits = |v: f32| (0.0..=65_535.0).contains(&v);
        let valid = fits(x) && fits(y) && (occluded_too || !flow.is_occluded[i]);
        if valid { [x as u16, y as u16, 1] } else { [0, 0, 0] }
    });
    png(&native_words(pixels), flow.width, flow.height, ExtendedColorType::Rgb16)
}

/// Encodes depth as 16-bit gray. A depth of 1 m has code 256. Code 0 represents unknown depth, which applies to the
/// sky and to depths of 255.99 m or more.
///
/// # Examples
/// ```
/// let png = spikelane_scene::labels::kitti_depth(&[1.0, f32::INFINITY], 2, 1)?;
/// assert!(png.starts_with(b"\x89PNG"));
/// let error = spikelane_scene::labels::kitti_depth(&[1.0], 2, 1).unwrap_err();
/// assert_eq!(error.kind(), spikelane::ErrorKind::Usage);
/// # Ok::<(), spikelane::Error>(())
/// ```
///
/// # Errors
/// [`ErrorKind::Usage`](spikelane::ErrorKind::Usage) if the number of values is not width times height.
pub fn kitti_depth(depth_m: &[f32], width: usize, height: usize) -> Result<Vec<u8>> {
    expect_len("depth", depth_m.len(), width * height)?;
    let code = |d: &f32| {
        if *d < 255.99 { (d * 256.0).round() as u16 } else { 0 }
    };
    png(&native_words(depth_m.iter().map(code)), width, height, ExtendedColorType::L16)
}

/// Returns the line of one vehicle in a label file.
///
/// The line contains type, truncated, occluded, alpha, the four edges of the box, the size, the bottom center, and
/// rotation_y. The edges are left, top, right and bottom of the clipped amodal box. The size is height, width and
/// length of the vehicle.
#[must_use]
pub fn kitti_box_line(b: &VehicleBox) -> String {
    let [x0, y0, x1, y1] = b.clipped_amodal_box;
    let [l, w, h] = b.size_m;
    let [x, y, z] = b.center_m;
    // In KITTI files, the center of the first pixel has coordinate 0, and the box includes its last pixel.
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

/// Returns a label file of all vehicles that have at least `min_pixels` visible pixels. Vehicles without visible
/// pixels are never included.
#[must_use]
pub fn kitti_box_file(boxes: &[VehicleBox], min_pixels: u32) -> String {
    let mut text = String::new();
    for b in boxes.iter().filter(|b| b.visible_pixels >= min_pixels.max(1)) {
        // Writing to a string cannot fail, so the result is ignored.
        let _ = writeln!(text, "{}", kitti_box_line(b));
    }
    text
}

#[cfg(test)]
mod tests {
    use crate::ground_truth::flow::Flow;

    #[test]
    fn flow_comes_back_within_half_a_step() {
        let flow = Flow {
            width: 2,
            height: 1,
            dx: vec![3.21, 600.0],
            dy: vec![-0.37, 0.0],
            is_occluded: vec![false, false],
        };
        let bytes = super::kitti_flow(&flow, true).unwrap();
        let read = image::load_from_memory(&bytes).unwrap().into_rgb16();
        let p = read.get_pixel(0, 0).0;
        assert!((f32::from(p[0]) / 64.0 - 512.0 - 3.21).abs() <= 1.0 / 128.0);
        assert!((f32::from(p[1]) / 64.0 - 512.0 + 0.37).abs() <= 1.0 / 128.0);
        assert_eq!((p[2], read.get_pixel(1, 0).0[2]), (1, 0));
    }
}
