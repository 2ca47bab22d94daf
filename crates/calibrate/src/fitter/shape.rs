//! Gain that pixels share: the shape of the light on the sensor, and the gains of the classes of pixels.
//!
//! The light of a lamp behind a lens falls off toward the corners. EMVA 1288 removes this shape before it compares pixels.
//! The filters of a mosaic have different gains. [`PixelClasses`](crate::recordings::color_filters::PixelClasses) numbers
//! them. Both are fitted together to the logarithms of the gains:
//!
//! `ln a = c + P(u, v) + e`
//!
//! * `a`: gain of a pixel. `c`: constant of the pixel's class. `e`: residual of the pixel.
//! * `P`: polynomial without a constant. `u` and `v`: column and row, from -1 to 1 between the edges of the sensor.
//!
//! The polynomial and the differences between the classes are used only if they are significant. The differences between
//! filters are always used.

use super::state::{Fitter, GainShape};
use crate::formulas::fit::{chi_square_over_freedom, solve_cholesky};
use crate::formulas::robust::biweights;
use crate::result::{FieldTerm, LightField};
use spikelane::spikes::Geometry;
use spikelane_measure::Estimate;

/// Degree of the polynomial. For a light that falls off by 60 % with the squared radius, the polynomial of degree 6
/// deviates from the logarithm by less than 0.5 %. The polynomial of degree 4 deviates by 2 % in the corners.
const MAX_DEGREE: u32 = 6;
/// Smallest number of pixels for each coefficient. With fewer pixels the degree is lower.
const MIN_PIXELS_PER_TERM: usize = 12;

/// Number of standard deviations of a normal variable that one of ten thousand exceeds. Of ten thousand sensors without a
/// shape, one is given a shape.
const SIGNIFICANCE_Z: f64 = 3.719;

/// Largest number of pixels that are fitted. With 10,000 pixels and a gain spread of 7 %, the error of the falloff is 0.3 %.
/// Larger sensors are thinned out by whole cells of the pattern.
const MAX_FITTED_PIXELS: usize = 10_000;

/// Number of iterations of the robust fit. The weights change by less than a thousandth after five.
const ITERATIONS: usize = 10;

/// Powers of `u` and `v` of each term of the polynomial.
fn powers(degree: u32) -> Vec<[i32; 2]> {
    (1..=degree as i32).flat_map(|sum| (0..=sum).map(move |i| [i, sum - i])).collect()
}

/// Returns the position of pixel `p`, from -1 to 1 between the edges of the sensor.
fn position(p: usize, geometry: Geometry) -> [f64; 2] {
    let center = |i: usize, count: usize| (2.0 * i as f64 + 1.0) / count as f64 - 1.0;
    [center(p % geometry.width(), geometry.width()), center(p / geometry.width(), geometry.height())]
}

fn terms([u, v]: [f64; 2], powers: &[[i32; 2]]) -> impl Iterator<Item = f64> {
    powers.iter().map(move |[i, j]| u.powi(*i) * v.powi(*j))
}

/// A linear model of the logarithms of the gains.
struct Model {
    columns: usize,
    rows: Vec<Vec<f64>>,
}

/// A weighted least-squares fit of a [`Model`].
struct ModelFit {
    coefficients: Vec<f64>,
    /// Normal matrix of the fit.
    normal: Vec<f64>,
    residuals: Vec<f64>,
    squares: f64,
}

impl Model {
    fn fit(&self, y: &[f64], weights: &[f64]) -> Option<ModelFit> {
        let k = self.columns;
        let (mut normal, mut right) = (vec![0.0; k * k], vec![0.0; k]);
        for ((row, y), w) in self.rows.iter().zip(y).zip(weights) {
            for i in 0..k {
                right[i] += w * row[i] * y;
                for j in 0..k {
                    normal[i * k + j] += w * row[i] * row[j];
                }
            }
        }
        let (coefficients, _) = solve_cholesky(&normal, &right, k)?;
        let value = |row: &Vec<f64>| row.iter().zip(&coefficients).map(|(x, c)| x * c).sum::<f64>();
        let residuals: Vec<f64> = self.rows.iter().zip(y).map(|(row, y)| y - value(row)).collect();
        let squares = residuals.iter().zip(weights).map(|(r, w)| w * r * r).sum();
        Some(ModelFit { coefficients, normal, residuals, squares })
    }
}

impl Fitter<'_> {
    /// Fits the shape of the light and the classes to the gains of the pixels without defects.
    pub(super) fn update_shape(&mut self) {
        let pixels = self.fits.len();
        self.shape = self.fit_shape().unwrap_or_else(|| GainShape::uniform(pixels));
    }

    fn fit_shape(&self) -> Option<GainShape> {
        let geometry = self.observed.geometry;
        let defect_free = self.defect_free_mask();
        let all_good: Vec<usize> =
            (0..self.fits.len()).filter(|p| defect_free[*p] && self.fits[*p].a > 0.0).collect();
        let stride = all_good.len().div_ceil(MAX_FITTED_PIXELS).max(1);
        let is_fitted = |p: usize| {
            let [row, column] = self.classes.cell(p);
            (row + 3 * column).is_multiple_of(stride)
        };
        let good: Vec<usize> = all_good.iter().copied().filter(|p| is_fitted(*p)).collect();
        let y: Vec<f64> = good.iter().map(|p| self.fits[*p].a.ln()).collect();
        let degree = (1..=MAX_DEGREE).rev().find(|degree| {
            good.len() >= MIN_PIXELS_PER_TERM * (powers(*degree).len() + self.classes.count())
        })?;
        let all_powers = powers(degree);
        let class = |p: usize| self.classes.class(p);
        // The classes that occur. A sensor of one row has two.
        let mut classes: Vec<usize> = good.iter().map(|p| class(*p)).collect();
        classes.sort_unstable();
        classes.dedup();
        let model = |with_classes: bool, with_field: bool| {
            let row = |p: &usize| {
                let constants = classes.iter().map(|c| f64::from(u8::from(*c == class(*p))));
                let constants: Vec<f64> = if with_classes { constants.collect() } else { vec![1.0] };
                let field = terms(position(*p, geometry), if with_field { &all_powers } else { &[] });
                constants.into_iter().chain(field).collect::<Vec<f64>>()
            };
            let rows: Vec<Vec<f64>> = good.iter().map(row).collect();
            Model { columns: rows[0].len(), rows }
        };
        let full = model(true, true);
        let mut weights = vec![1.0; good.len()];
        let mut fit = full.fit(&y, &weights)?;
        for _ in 0..ITERATIONS {
            weights = biweights(&fit.residuals).1;
            fit = full.fit(&y, &weights)?;
        }
        let total: f64 = weights.iter().sum();
        let variance = fit.squares / (total - full.columns as f64);
        let limit = |n: f64| n * chi_square_over_freedom(n, SIGNIFICANCE_Z);
        let is_significant = |reduced: &Model| {
            let removed = full.columns - reduced.columns;
            let gain = reduced.fit(&y, &weights).map_or(f64::INFINITY, |r| r.squares - fit.squares);
            removed > 0 && gain > limit(removed as f64) * variance
        };
        let has_field = is_significant(&model(true, false));
        let has_classes =
            classes.len() > 1 && (self.classes.are_filters || is_significant(&model(false, true)));
        if !has_field && !has_classes {
            return None;
        }
        let used = model(has_classes, has_field);
        let fit = used.fit(&y, &weights)?;
        let constants = used.columns - if has_field { all_powers.len() } else { 0 };
        let (levels, field) = fit.coefficients.split_at(constants);
        let used_powers = if has_field { &all_powers[..] } else { &[] };
        let log_field = |at: [f64; 2]| terms(at, used_powers).zip(field).map(|(x, c)| x * c).sum::<f64>();
        let level = |p: usize| {
            // A class whose pixels are all defective has the mean gain.
            let mean = levels.iter().sum::<f64>() / levels.len() as f64;
            let index = if has_classes { classes.iter().position(|c| *c == class(p)) } else { Some(0) };
            index.map_or(mean, |i| levels[i])
        };
        let normalized = |log: &dyn Fn(usize) -> f64| {
            let map: Vec<f64> = (0..self.fits.len()).map(|p| log(p).exp()).collect();
            let mean = map.iter().sum::<f64>() / map.len() as f64;
            map.into_iter().map(|x| x / mean).collect::<Vec<f64>>()
        };
        let mut shape = GainShape {
            field: normalized(&|p| log_field(position(p, geometry))),
            class: normalized(&level),
            max_class: 1.0,
            light_field: None,
            class_gains: Vec::new(),
            coefficients: used.columns - 1,
        };
        shape.max_class = shape.class.iter().copied().fold(0.0, f64::max);
        if has_field {
            // The contrast between the mean of the corners and the center.
            let corners = [[-1.0, -1.0], [-1.0, 1.0], [1.0, -1.0], [1.0, 1.0]].map(|[x, y]| {
                [x * (1.0 - 1.0 / geometry.width() as f64), y * (1.0 - 1.0 / geometry.height() as f64)]
            });
            let mut contrast = vec![0.0; used.columns];
            for corner in corners {
                let values = terms(corner, used_powers);
                contrast[constants..].iter_mut().zip(values).for_each(|(c, x)| *c += 0.25 * x);
            }
            let log: f64 = contrast.iter().zip(&fit.coefficients).map(|(x, c)| x * c).sum();
            let (solved, _) = solve_cholesky(&fit.normal, &contrast, used.columns)?;
            let square: f64 = solved.iter().zip(&contrast).map(|(x, c)| x * c).sum();
            shape.light_field = Some(LightField {
                corner_falloff: Estimate {
                    value: 1.0 - log.exp(),
                    error: log.exp() * (variance * square).sqrt(),
                    samples: good.len(),
                },
                terms: used_powers
                    .iter()
                    .zip(field)
                    .map(|([i, j], c)| FieldTerm { column_power: *i, row_power: *j, coefficient: *c })
                    .collect(),
            });
        }
        if has_classes {
            let gains = |c: usize| {
                let of_class = all_good.iter().filter(|p| class(**p) == c);
                Estimate::mean(of_class.map(|p| self.fits[*p].a / shape.field[*p]))
            };
            shape.class_gains = (0..self.classes.count()).map(gains).collect();
        }
        Some(shape)
    }
}
