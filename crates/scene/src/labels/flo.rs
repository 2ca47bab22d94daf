//! Middlebury `.flo` files (Baker et al., IJCV 92, 2011). A file contains the tag 202021.25, width, height, and then
//! (dx, dy) of each pixel as little-endian `f32`.
//!
//! In a `.flo` file, 1e10 represents unknown flow. The files of this crate never contain this value, because the flow
//! of occluded pixels is known too.

use super::expect_len;
use crate::ground_truth::flow::Flow;
use spikelane::error::Result;

/// Encodes flow as a `.flo` file.
///
/// # Errors
/// [`ErrorKind::Usage`](spikelane::ErrorKind::Usage) if the lengths of the flow's fields do not match its width and
/// height.
pub fn flo_flow(flow: &Flow) -> Result<Vec<u8>> {
    expect_len("flow", flow.dx.len().min(flow.dy.len()), flow.width * flow.height)?;
    let mut out = 202_021.25f32.to_le_bytes().to_vec();
    out.extend((flow.width as u32).to_le_bytes());
    out.extend((flow.height as u32).to_le_bytes());
    for (x, y) in flow.dx.iter().zip(&flow.dy) {
        out.extend(x.to_le_bytes());
        out.extend(y.to_le_bytes());
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use crate::ground_truth::flow::Flow;

    #[test]
    fn the_tag_spells_pieh() {
        let flow = Flow { width: 1, height: 1, dx: vec![0.25], dy: vec![-1.0], is_occluded: vec![false] };
        let bytes = super::flo_flow(&flow).unwrap();
        assert_eq!(&bytes[..4], b"PIEH");
        assert_eq!(bytes.len(), 12 + 8);
        assert_eq!(bytes[12..16], 0.25f32.to_le_bytes());
    }
}
