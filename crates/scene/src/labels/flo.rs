//! Middlebury's `.flo`: the tag 202021.25, width, height, then (dx, dy) as
//! little-endian `f32` (Baker et al., IJCV 92, 2011). Unknown flow is 1e10;
//! this project knows all of it, occluded pixels included.

use super::expect_len;
use crate::truth::flow::Flow;
use spikelane::error::Result;

/// The bytes of a `.flo` file.
///
/// # Errors
/// When the flow's fields do not match its size.
pub fn flo(flow: &Flow) -> Result<Vec<u8>> {
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
    use crate::truth::flow::Flow;

    #[test]
    fn the_tag_spells_pieh() {
        let flow = Flow { width: 1, height: 1, dx: vec![0.25], dy: vec![-1.0], occluded: vec![false] };
        let bytes = super::flo(&flow).unwrap();
        assert_eq!(&bytes[..4], b"PIEH");
        assert_eq!(bytes.len(), 12 + 8);
        assert_eq!(bytes[12..16], 0.25f32.to_le_bytes());
    }
}
