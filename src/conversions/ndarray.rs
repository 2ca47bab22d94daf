//! Feature `ndarray`: conversion of two-dimensional views to frames of light, and of spikes to three-dimensional arrays.

use ndarray::{Array3, ArrayView2, ArrayView3};

use crate::error::{Error, Result, error};
use crate::simulate::FrameRef;
use crate::spikes::{Geometry, SpikeFrames, SpikeFramesRef};

macro_rules! frame_from_view {
    ($($sample:ty),*) => {$(
        impl<'a> TryFrom<ArrayView2<'a, $sample>> for FrameRef<'a> {
            type Error = Error;

            /// Borrows a contiguous view of shape (height, width) in row-major order as a frame.
            ///
            /// # Errors
            /// Returns [`ErrorKind::Usage`](crate::ErrorKind::Usage) if the view has gaps between rows or is not in row-major order, such as a
            /// transposed view.
            fn try_from(view: ArrayView2<'a, $sample>) -> Result<Self> {
                match view.to_slice() {
                    Some(samples) => Ok(FrameRef::new(samples)),
                    None => Err(strides_error()),
                }
            }
        }
    )*};
}

frame_from_view!(u8, u16, f32);

fn strides_error() -> Error {
    error!(Usage, "array of light"; found "rows with gaps, or columns stored in memory order";
        expected "a contiguous array in row-major order"; remedy "copy the array with `as_standard_layout()`")
}

impl SpikeFramesRef<'_> {
    /// Returns an array of shape (readouts, height, width) with one byte, 0 or 1, per pixel and readout.
    #[must_use]
    pub fn to_array(self) -> Array3<u8> {
        let shape = (self.readouts(), self.geometry().height(), self.geometry().width());
        Array3::from_shape_vec(shape, self.to_dense())
            .expect("the shape has as many elements as the stream has pixels")
    }
}

impl SpikeFrames {
    /// Returns an array of shape (readouts, height, width) with one byte, 0 or 1, per pixel and readout.
    ///
    /// # Examples
    /// ```
    /// use spikelane::{Camera, Seeds, Sensor, Simulator};
    /// let mut simulator = Simulator::new(&Camera::ideal(Sensor::new(32, 24, 20_000.0)?), Seeds::default())?;
    /// let light = ndarray::Array2::from_elem((24, 32), 0.2f32);
    /// let spikes = simulator.run(spikelane::FrameRef::try_from(light.view())?, 5)?.to_array();
    /// assert_eq!(spikes.dim(), (5, 24, 32));
    /// assert_eq!(spikelane::SpikeFrames::try_from(spikes.view())?.to_array(), spikes);
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    #[must_use]
    pub fn to_array(&self) -> Array3<u8> {
        self.view().to_array()
    }
}

impl TryFrom<ArrayView3<'_, u8>> for SpikeFrames {
    type Error = Error;

    /// Packs an array of shape (readouts, height, width) whose values are 0 and 1, or 0 and 255.
    ///
    /// # Errors
    /// Returns the errors of [`SpikeFrames::from_dense`] and [`Geometry::new`].
    fn try_from(array: ArrayView3<'_, u8>) -> Result<Self> {
        let (_, height, width) = array.dim();
        let side = |n: usize| u32::try_from(n).unwrap_or(u32::MAX);
        let geometry = Geometry::new(side(width), side(height))?;
        match array.to_slice() {
            Some(dense) => Self::from_dense(geometry, dense),
            None => Self::from_dense(geometry, &array.iter().copied().collect::<Vec<u8>>()),
        }
    }
}
