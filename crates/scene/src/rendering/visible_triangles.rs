//! The triangles of the city that are visible in some renders.
//!
//! Most triangles in the field of view are hidden behind other triangles. A render at an instant between two renders draws
//! only the triangles that are visible in one of them, and all triangles of vehicles.

use super::band::Band;
use super::fragment::part_and_triangle;
use super::raster::NO_TRIANGLE;
use crate::shapes::mesh::Mesh;

/// A set of triangles of the city.
#[derive(Clone, Debug, Default)]
pub(crate) struct TriangleSet {
    /// One bit per triangle.
    words: Vec<u64>,
}

impl TriangleSet {
    /// Returns the triangles of the city that are visible at any sample of the bands.
    pub(crate) fn from_bands(bands: &[Band], city: &Mesh) -> Self {
        let mut words = vec![0; city.triangles.len().div_ceil(64)];
        for band in bands {
            // Neighboring samples usually show the same triangle.
            let mut latest = NO_TRIANGLE;
            for &id in band.sample_ids() {
                if id == latest || id == NO_TRIANGLE {
                    continue;
                }
                latest = id;
                if let (0, triangle) = part_and_triangle(id) {
                    words[triangle / 64] |= 1 << (triangle % 64);
                }
            }
        }
        Self { words }
    }

    /// Adds the triangles of another set.
    pub(crate) fn extend(&mut self, other: &Self) {
        self.words.resize(self.words.len().max(other.words.len()), 0);
        self.words.iter_mut().zip(&other.words).for_each(|(word, other)| *word |= other);
    }

    /// Returns the triangles of each chunk of the city.
    pub(crate) fn by_chunk(&self, city: &Mesh) -> Vec<Vec<u32>> {
        let is_set = |t: u32| self.words.get(t as usize / 64).is_some_and(|word| word >> (t % 64) & 1 == 1);
        city.chunks.iter().map(|chunk| chunk.triangles.clone().filter(|&t| is_set(t)).collect()).collect()
    }
}
