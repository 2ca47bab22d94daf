//! Numbers of a diagnosis, each with its origin: thresholds, and numbers of simulations and of steps.
//!
//! The origin of a threshold is one of three. It is *derived* from a probability or a number of standard
//! deviations, it was *measured* on simulated sensors, or it is *a choice*. The limits of an alarm are in
//! `null_model/limits.rs`. Sizes of memory and of vector loops are beside their code.

// Recordings before the search

/// Largest rate, in spikes per readout, at which the first spike of a pixel shows the start phase of the pixel.
/// Derived: at this rate an interval has four readouts, so the first spike determines the phase to a quarter of a
/// cycle.
pub(crate) const MAX_PHASE_RATE: f64 = 0.25;

/// Smallest number of pixels whose phases are compared. A choice.
pub(crate) const MIN_PHASE_PIXELS: usize = 100;

/// Length of the mean phase vector above which the pixels began together. The vector is the mean of one unit vector
/// per pixel. Its angle is the start phase: the charge of the pixel at the first readout, with one turn per
/// threshold.
///
/// Derived: if the start charges are uniform over three quarters of a threshold, the mean vector has the length 0.3.
/// If they are uniform over a whole threshold, its length is at most 0.08. Of this, 0.06 is the square of
/// [`MAX_PHASE_RATE`], and 0.02 is the length of a mean of 2,000 random vectors.
pub(crate) const MIN_COMMON_PHASE: f64 = 0.25;

/// Length of the mean phase vector above which pixels that began together have not drifted apart yet. The unit is
/// the length of random phases, `1 / sqrt(number of pixels)`. A choice.
pub(crate) const MAX_CHANCE_PHASE: f64 = 3.0;

/// Divisor that limits the excluded start of a recording: at most the length of the recording, divided by this
/// number. A choice.
pub(crate) const MAX_ASIDE_DIVISOR: usize = 3;

/// Largest number of pixels whose rates are used to compute how fast pixels drift apart. A choice that limits the
/// time.
pub(crate) const MAX_DRIFT_PIXELS: usize = 20_000;

/// Number of readouts that are excluded at the start of a square wave whose pixels began together. It applies only
/// if no constant recording is brighter than [`MAX_PHASE_RATE`], because such a recording shows how fast bright
/// pixels drift apart. A choice.
pub(crate) const SQUARE_WAVE_ASIDE: usize = 64;

/// Largest light of the levels from which negative dark currents are detected. A line is fitted to the rates of
/// each pixel at these levels. The response to brighter light is not linear.
pub(crate) const MAX_DIM_LIGHT: f64 = 0.35;

/// Smallest charge deficit of two pixels that shows that the camera keeps negative dark currents. Both pixels have
/// no spike in the dark recording. The deficit is the dark rate that is extrapolated from dim light, subtracted
/// from the measured dark rate. The unit is the standard deviation of [`FAINT_PIXELS`]. A choice.
pub(crate) const MIN_CHARGE_DEFICIT_SDS: f64 = 5.0;

/// Smallest charge deficit of a single pixel that shows that the camera keeps negative dark currents; see
/// [`MIN_CHARGE_DEFICIT_SDS`]. The unit is the standard deviation of [`FAINT_PIXELS`]. A choice.
pub(crate) const MIN_SINGLE_DEFICIT_SDS: f64 = 12.0;

/// Number of pixels that determine the standard deviation of a charge deficit. They are the pixels with the lowest
/// dark rates above zero. A choice.
pub(crate) const FAINT_PIXELS: usize = 200;

/// Skew above which the dark currents of a map have a tail. The skew is computed from the 5 %, 50 % and 95 %
/// quantiles. Derived: the skew of 2,000 normal numbers has a standard deviation of 0.03, so the limit is five
/// standard deviations.
pub(crate) const MIN_TAIL_SKEW: f64 = 0.15;

/// Limit of the relative standard error of a calibrated parameter. If the error is larger, the published value is
/// used instead. A choice.
pub(crate) const MAX_CALIBRATION_ERROR: f64 = 0.25;

/// Largest factor between a calibrated and a published parameter. If the factor is larger, the published value is
/// used, because a missing effect has changed the calibrated value.
pub(crate) const MAX_CALIBRATION_FACTOR: f64 = 30.0;

// Light of the recordings

/// Numbers of simulated sensors per step of the search for the light: for a set without sources, and for a set with
/// sources.
///
/// The mean gains of two sensors differ by about 0.1 %. If each recording has its own lamp, the lamps absorb this
/// difference. Sums of sources cannot absorb it if the response is nonlinear, so more sensors are averaged.
pub(crate) const LIGHT_SENSORS: [usize; 2] = [2, 24];

/// Largest number of steps of the search for the light. A choice.
pub(crate) const MAX_LIGHT_STEPS: usize = 4;

/// Relative change of the light below which the search for the light ends. A choice.
pub(crate) const MIN_LIGHT_STEP: f64 = 2e-4;

/// Largest deviation of the found light from the stated light, in uncertainties of the light. Without this limit, a
/// strong effect of the camera, which changes the rates, would move the light further.
pub(crate) const MAX_FOUND_PULL: f64 = 3.5;

/// Largest deviation of the found light from the stated light for recordings with sources, in uncertainties of the
/// light. The limit is larger than [`MAX_FOUND_PULL`], because several recordings determine the light of one
/// source. A found light at a smaller limit would contradict the sums of the sources.
pub(crate) const MAX_FOUND_SOURCE_PULL: f64 = 6.0;

/// Relative change of the light between two steps of the search for the light. If the change is larger, the rates
/// of both steps determine the slope of the rate as a function of the light. A choice.
pub(crate) const MIN_SECANT_STEP: f64 = 2e-3;

/// Relative change of the found light above which sensors are simulated again. A choice.
pub(crate) const MAX_UNCHANGED_LIGHT: f64 = 1e-3;

/// Largest change of the relative offset of a lamp for which the derivative by the lamp is used. The derivative
/// holds there, because its step [`LAMP_STEP`] is larger. For a larger change, the model is simulated at the new
/// offset.
pub(crate) const MAX_LINEAR_OFFSET: f64 = 2e-3;

/// Largest deviation of a lamp from the stated light in a fit, in uncertainties of the lamp. A choice.
pub(crate) const MAX_LAMP_PULL: f64 = 4.0;

/// Largest change of the relative offset of a lamp in one step of a fit. The derivatives do not hold beyond it.
/// Without the limit, the lamps would absorb an effect that is not fitted yet.
pub(crate) const MAX_LAMP_STEP: f64 = 3e-3;

/// Relative step of the derivative by a lamp. It is the same for all uncertainties, because the statistics of
/// intervals in bright light are linear in the light only over a few thousandths.
pub(crate) const LAMP_STEP: f64 = 3e-3;

/// Largest relative standard deviation with which the lamps of sensors are simulated. Derivatives add the rest of
/// each deviation.
///
/// The error of the found light has about this size. A statistic that is not linear in the light therefore gets
/// only as much noise as this error causes.
pub(crate) const SMALL_LAMP_DEVIATION: f64 = 1e-3;

/// Smallest relative deviation of a level that is reported: for the levels between the darkest and the brightest
/// one, and for these two. The limit is larger for these two, because a bend of the response is largest there, and
/// the other levels determine it least.
pub(crate) const MIN_LEVEL_DEVIATIONS: [f64; 2] = [0.005, 0.012];

/// Deviation of a single level above which the level is reported, in uncertainties of its lamp. Derived: a lamp
/// with a correct uncertainty exceeds the limit with a probability of 5e-4.
pub(crate) const MAX_LEVEL_PULL: f64 = 3.5;

/// Relative uncertainty that a lamp receives if its level is reported. The level then contains nearly no
/// information about the response.
pub(crate) const REPORTED_LAMP_UNCERTAINTY: f64 = 0.3;

/// Normal quantile of the chi-square limit above which the scatter of the levels about a smooth response is
/// reported. Derived: lamps with correct uncertainties exceed the limit with a probability of 0.001.
pub(crate) const REPORTED_SCATTER_Z: f64 = 3.09;

/// Normal quantile of the chi-square limit for the scatter of the levels about a smooth response. Above this limit,
/// the diagnosis uses larger uncertainties of the lamps.
///
/// Derived: lamps with correct uncertainties exceed the limit with a probability of 0.05. The probability is larger
/// than that of a report ([`REPORTED_SCATTER_Z`]), because larger uncertainties cost little.
pub(crate) const WIDENED_SCATTER_Z: f64 = 1.645;

/// Largest relative scatter of the levels about a smooth response that is attributed to the lamps. If the scatter
/// is larger, the response itself is not smooth.
pub(crate) const MAX_LAMP_SCATTER: f64 = 0.1;

/// Relative error of a measured response, which is added in quadrature to the uncertainty of the light. A choice.
pub(crate) const MIN_RESPONSE_UNCERTAINTY: f64 = 1e-4;

// Fit of uncertain base parameters

/// Smallest number of simulations of the mean in the fit of the base parameters. A choice.
pub(crate) const MIN_BASE_FIT_SIMULATIONS: usize = 24;

/// Largest number of steps of the fit of the base parameters. A choice that limits the time.
pub(crate) const MAX_BASE_FIT_STEPS: usize = 10;

/// Largest relative change of a base parameter in one step of the fit of the base parameters. A choice.
pub(crate) const MAX_BASE_FIT_STEP: f64 = 0.45;

/// Relative change of a base parameter in one step of the fit above which the derivatives are computed again. A
/// choice.
pub(crate) const MAX_DERIVATIVE_MOVE: f64 = 0.15;

/// Relative standard deviation of the prior of a base parameter. A parameter that the data do not determine keeps
/// its given value.
pub(crate) const BASE_PARAMETER_UNCERTAINTY: f64 = 0.3;

/// Length of a step below which the fit of the base parameters ends, in standard deviations of the parameters. A
/// choice.
pub(crate) const MIN_BASE_FIT_STEP: f64 = 0.5;

/// Deviation beyond which the influence of a statistic on the fit does not grow, in standard deviations (a Huber
/// weight). A single missing effect must not change every parameter.
pub(crate) const MAX_BASE_FIT_Z: f64 = 6.0;

/// Number of simulations for the derivatives by the lamps in the fit of the base parameters. A precision of a few
/// percent is sufficient, because the fitted light is within some thousandths of the found light.
pub(crate) const BASE_FIT_LAMP_DRAWS: usize = 4;

/// Number of iterations of the robust fit of the lamps. Each iteration computes new weights. A choice.
pub(crate) const BASE_FIT_LAMP_STEPS: usize = 4;

// Null model

/// Smallest number of pixels of a large sensor, and number of simulations for each derivative of a large sensor. A
/// large sensor needs few simulations, because its many pixels average the noise of each simulation.
pub(crate) const MANY_PIXELS: (usize, usize) = (20_000, 8);

/// Number of pixels of a usual sensor, and number of simulations for each of its derivatives. For a smaller sensor,
/// the number of simulations is inversely proportional to the number of pixels, up to [`MAX_DERIVATIVE_PAIRS`].
pub(crate) const USUAL_PIXELS: (usize, usize) = (2304, 16);

/// Largest number of simulations for each derivative by a base parameter. A choice that limits the time.
pub(crate) const MAX_DERIVATIVE_PAIRS: usize = 64;

/// Size of a change, in standard deviations of its noise, below which the change is set to zero. A choice.
pub(crate) const MIN_CHANGE_SDS: f64 = 2.5;

/// Median of the square of a standard normal variable.
pub(crate) const NORMAL_SQUARE_MEDIAN: f64 = 0.455;

/// Number of standard errors below which a correlation is set to zero. Most correlations of a few hundred
/// simulations are only noise.
pub(crate) const MIN_CORRELATION_SDS: f64 = 3.2;

/// Number of parts of the clean sensors in the cross-validation of the limits. Each part is judged by the noise of
/// the other parts. A choice.
pub(crate) const LIMIT_FOLDS: usize = 5;

/// Factor by which the limit of the total misfit is raised. A choice: without it, one of eight clean sensors of an
/// independent simulator exceeded the limit by 4 %.
pub(crate) const MISFIT_MARGIN: f64 = 1.15;

/// Weight of the prior value 1 in the estimated standard deviation of a score, as a number of sensors. A choice.
pub(crate) const SCORE_SD_PRIOR: f64 = 10.0;

/// Number of simulations of the mean of a held-out set that has another part of the recordings, or another light,
/// than the fitted set. A choice.
pub(crate) const HELD_OUT_SIMULATIONS: usize = 24;

/// Number of the simulations of [`HELD_OUT_SIMULATIONS`] while the null model has only its first simulations. If
/// the set agrees with the first simulations, no verdict depends on them.
pub(crate) const FIRST_HELD_OUT_SIMULATIONS: usize = 8;

/// Squared length of a signature, in standard deviations squared, below which its noise hides the signature. A
/// signature is the change of the statistics by an effect. Derived: the square of five standard deviations.
pub(crate) const MIN_SIGNATURE_SQUARE: f64 = 25.0;

/// Limit for the deviation of a statistic and for the score of an effect, in standard deviations. If one of them is
/// larger, the preliminary result reports a deviation.
///
/// Derived: 24 sensors determine the noise, so a deviation follows Student's distribution with 23 degrees of
/// freedom. One statistic of a clean sensor exceeds the limit in one of 2.6 million sets, and at least one of 250
/// statistics in one of ten thousand.
pub(crate) const MAX_PRELIMINARY_Z: f64 = 7.0;

/// Smallest squared score of an effect that the preliminary result lists, relative to the largest squared score. A
/// choice.
pub(crate) const MIN_LIKELY_SHARE: f64 = 0.35;

/// Largest number of likely effects in the preliminary result. A choice.
pub(crate) const MAX_LIKELY_EFFECTS: usize = 5;

/// Largest length of a signature from which the strength at [`DETECTION_SCORE`](crate::DETECTION_SCORE) is
/// extrapolated linearly, in standard deviations. A choice.
pub(crate) const MAX_LINEAR_LENGTH: f64 = 40.0;

/// Largest cosine between the signatures of two effects in the computation of detectability. A larger cosine is
/// replaced by this one, because effects that nothing separates are reported as ambiguous instead.
pub(crate) const MAX_PROJECTED_COSINE: f64 = 0.97;

/// Number of bisections that determine the strength at which an effect with an onset begins to act. Derived: they
/// determine this strength to a few percent.
pub(crate) const ONSET_STEPS: usize = 6;

/// Expected number of events at the smallest detectable strength of an effect that consists of events. Derived: the
/// probability of no event is then exp(-5), below 1/100.
pub(crate) const MIN_EXPECTED_EVENTS: f64 = 5.0;

// Fits

/// Smallest squared width of the range of a parameter, in positions of its knob. The prior information about a
/// parameter is inversely proportional to this square. The limit keeps it finite for a parameter that cannot move.
pub(crate) const FIXED_RANGE_SQUARE: f64 = 1e-12;

/// Smallest change of a statistic by an effect that counts as a change. The unit is the standard deviation of a
/// change between simulations with independent draws. Common draws reduce this standard deviation. A choice.
pub(crate) const MIN_EFFECT_CHANGE_SDS: f64 = 2.0;

/// Smallest number of simulations from which the diagnosis decides whether an effect changes a statistic. A choice.
pub(crate) const MIN_CHANGE_SIMULATIONS: usize = 6;

/// Smallest number of statistics for which the sum of their noise can be longer than a detectable change. Static
/// scenes and maps have fewer statistics.
pub(crate) const MIN_CROWDED_STATISTICS: usize = 100;

/// Largest move of a parameter after which its derivative is still used, as a share of the step of the derivative.
/// A choice.
pub(crate) const MAX_SLOPE_MOVE: f64 = 0.25;

/// Number of simulations of a fitted model whose parameters are drawn from their posterior. A choice.
pub(crate) const REDRAWN_SIMULATIONS: usize = 30;

/// Largest number of times that an accepted model is fitted again with its own noise. A choice.
pub(crate) const MAX_REFITS: usize = 2;

/// Quantile of Student's distribution for 95 % intervals. Derived: thirty degrees of freedom, because thirty
/// simulations determine the standard deviation of a parameter.
pub(crate) const INTERVAL_QUANTILE: f64 = 2.04;

/// Smallest value of `1 - r` for which the upper end of an interval is computed. `r` is the squared half width of
/// the interval, divided by the squared value.
///
/// If the noise of a variance is proportional to the variance, `r` can exceed 1, and no upper end exists. The
/// reported upper end is then about six times the fitted variance, which is 2.5 times the fitted standard
/// deviation.
pub(crate) const MIN_VARIANCE_SHARE: f64 = 0.3;

/// Smallest expected decrease of the merit at which a step of a fit is simulated: an absolute part, plus a part
/// relative to the merit. The merit is the squared distance from the data plus the cost of the light. A choice.
pub(crate) const MIN_STEP_GAIN: (f64, f64) = (0.5, 0.003);

/// Change of a base parameter above which a step is always simulated. The unit is the value of the parameter. The
/// merit does not depend on base parameters, so it does not show a gain by such a step.
pub(crate) const MIN_BASE_MOVE: f64 = 0.1;

/// Number of pairs of simulations that determine the change of the statistics per event. A choice.
pub(crate) const EVENT_PAIRS: usize = 2;

/// Weight of the variance of the null model in the estimated variance of a fitted model, as a number of
/// simulations. A choice.
pub(crate) const PRIOR_SIMULATIONS: f64 = 10.0;

/// Ratio of the variance of a fitted model to that of the null model above which the larger variance is used.
/// Derived: three standard deviations above a true ratio of 1, with [`PRIOR_SIMULATIONS`] and eight simulations.
pub(crate) const MIN_WIDER_VARIANCE: f64 = 1.6;

// Simulations of a mean

/// Number of simulations of a fitted mean in the first leg of a tournament. A choice that limits the time.
pub(crate) const FEW_SIMULATIONS: usize = 2;

/// Number of simulations of a fitted mean in the second leg of a tournament. If the model has more noise than the
/// null model ([`MIN_NOISY_LOG_VOLUME`]), also in the first leg. A choice.
pub(crate) const SOME_SIMULATIONS: usize = 6;

/// Number of simulations of a fitted mean when a model is compared with its own simulations. A choice.
pub(crate) const MEAN_SIMULATIONS: usize = 12;

/// Number of simulations of a fitted mean if fewer simulations do not separate the best candidates. A choice.
pub(crate) const MOST_SIMULATIONS: usize = 24;

/// Logarithm of the determinant of the noise of a model, relative to the null model, above which two simulations do
/// not determine the mean. Derived: if ten statistics have twice the standard deviation, the logarithm is 10 ln 4.
pub(crate) const MIN_NOISY_LOG_VOLUME: f64 = 14.0;

// Base parameters

/// Prior information of the calibration about a base parameter: that of a measurement with a relative standard
/// error of 1/2. Without it, parameters that change the statistics in similar ways would drift apart in a fit.
/// Examples are the spreads of gain and of threshold.
pub(crate) const CALIBRATION_INFORMATION: f64 = 4.0;

// Lines in the frame totals

/// Smallest power of a line in the spikes per readout at which its frequency is used, relative to the mean power
/// around the line. Noise exceeds it with a probability of exp(-12) at each frequency.
pub(crate) const MIN_LINE_POWER: f64 = 12.0;

// Tournament

/// Largest factor by which the amplitude of a signature is extrapolated. For a larger amplitude, another start
/// value is nearer.
pub(crate) const MAX_SIGNATURE_SCALE: f64 = 8.0;

/// Largest number of candidates in a tournament. A choice that limits the time.
pub(crate) const MAX_CANDIDATES: usize = 5;

/// Largest number of candidates in the second leg of a tournament. A choice that limits the time.
pub(crate) const MAX_FINALISTS: usize = 3;

/// Largest number of Gauss-Newton steps in the first and in the second leg of a tournament, while the model has no
/// effect. An effect with three parameters requires this many.
pub(crate) const STEPS_OF_FIRST_EFFECT: [usize; 2] = [4, 3];

/// Largest number of Gauss-Newton steps in both legs if the model already contains effects, whose parameters also
/// move. Measured: with half as many steps, right effects lost to similar ones.
pub(crate) const STEPS_OF_FURTHER_EFFECT: [usize; 2] = [7, 5];

/// Assumed upper limit of the cost that the noise of a mean of few simulations adds. A choice.
pub(crate) const MAX_SIMULATION_COST: f64 = 40.0;

/// Smallest promise of a candidate that takes part in a tournament, relative to the largest promise. The promise is
/// the expected decrease of the squared distance by a linear fit.
///
/// Measured: the shape of a weak `telegraph_dark` was between the start values. Its promise was 0.4 of the promise
/// of `false_spikes`.
pub(crate) const MIN_PROMISE_SHARE: f64 = 0.35;

/// Smallest promise of a candidate that is simulated a second time, relative to the largest promise
/// ([`MIN_PROMISE_SHARE`]). The noise of one simulation can hide half of the promise of a weak signature.
pub(crate) const MIN_SECOND_DRAW_SHARE: f64 = 0.1;

/// Smallest promise ([`MIN_PROMISE_SHARE`]) of the best candidate at which a tournament takes place. Derived: the
/// square of 4.5 standard deviations.
pub(crate) const MIN_PROMISE: f64 = 20.0;

/// Standard deviation of the difference of two scores above which the best candidates are simulated again. Derived:
/// two models are ambiguous if their scores differ by less than 4, and half of this difference is 2.
pub(crate) const MAX_SCORE_DEVIATION: f64 = 2.0;

// Acceptance of an effect

/// Largest number of effects that one search adds. A choice that limits the time.
pub(crate) const MAX_EFFECTS: usize = 4;

/// Largest number of effects that a search adds to static scenes of unknown light without held-out recordings. Such
/// scenes have about a dozen statistics. The first effect has two or three fitted parameters, so the statistics do
/// not test a second effect.
pub(crate) const MAX_STATIC_EFFECTS: usize = 1;

/// Number of rejected effects after which a search ends. A choice.
pub(crate) const MAX_REJECTED: usize = 2;

/// Decrease of the held-out deviance below which an effect is rejected. Derived: the square of three standard
/// deviations of one parameter.
pub(crate) const MIN_HELD_OUT_GAIN: f64 = 9.0;

/// Share of the excess that an added effect must explain for the search to continue. The excess is the discrepancy
/// above the noise floor. Derived: of three effects of equal strength, the first explains a third.
pub(crate) const MIN_EXPLAINED_EXCESS: f64 = 0.2;

/// Remaining share of the held-out deviance below which [`REMAINDER_SHARE`] does not apply to a further effect.
/// Measured: `comparator_noise` beside a strong `adaptation` reduced the deviance from 3,637 to 278. This effect is
/// right, although the decrease is below the 3,998 that [`REMAINDER_SHARE`] requires.
pub(crate) const COMPLETE_REMAINDER: f64 = 0.1;

// Backward elimination

/// Share of the squared distance from the base model. A further effect must explain more than this share, and the
/// removal of an effect must cost more. The reason is that the signature of a strong effect is approximate.
///
/// Measured: after a fit with the approximate signature of a strong effect, about this share of the squared distance
/// remains. If the constant is three times as large, `supply_droop` is not named in a camera that also has a strong
/// `row_noise`.
pub(crate) const REMAINDER_SHARE: f64 = 0.0003;

/// Variance inflation of the amplitude of an effect above which other parameters may replace the effect. Derived:
/// the inflation `1 / (1 - c^2)` is 5 at the cosine c = 0.9.
pub(crate) const MAX_VARIANCE_INFLATION: f64 = 5.0;

/// An effect is necessary if the cost of the fit without it is larger by at least this number, plus
/// [`REMAINDER_SHARE`] of the squared distance from the base model. Derived: the square of 3.5 standard deviations.
pub(crate) const MIN_ELIMINATION_COST: f64 = 12.0;

/// Share of the gain in the fitted set that the held-out set must confirm. Measured: a wrong
/// `response_nonlinearity` in the place of a weak `dark_shot_noise` gained 30 in the fitted set and 6 in the
/// held-out set.
pub(crate) const MIN_HELD_OUT_GAIN_SHARE: f64 = 0.5;

/// Largest number of effects that are tried in the place of an accepted effect. Measured: the right effect had at
/// worst the third largest promise. Promises come from a linear fit, so their order can be wrong.
pub(crate) const MAX_REPLACEMENTS: usize = 4;

/// Numbers of simulations of a mean in both legs of a replacement, if the effects of the model add strong noise.
/// Measured: `partial_reset` beside a strong `row_noise` had a cost of 460 with 6 simulations and of 360 with 24.
/// Wrong effects had costs of 361 to 373 with 24 simulations.
pub(crate) const NOISY_SIMULATIONS: [usize; 2] = [MOST_SIMULATIONS / 2, MOST_SIMULATIONS];

/// Number of steps after which a replacement must explain half as much as the replaced effect, or it is not fitted
/// further. A choice.
pub(crate) const ENTRY_STEPS: usize = 2;

/// Largest number of accepted effects that are replaced by other effects in one search. A choice.
pub(crate) const MAX_SWAPS: usize = 4;

// Final steps of the base parameters

/// Largest number of final steps of the base parameters. Each step is about a quarter of the previous one.
pub(crate) const MAX_FINAL_STEPS: usize = 6;

/// Length of a final step below which the final steps end. The unit is one standard deviation of the parameter that
/// moves most. A shorter step is smaller than the noise of another mean. A choice.
pub(crate) const MIN_FINAL_STEP: f64 = 0.3;

/// Length of the first final step below which no final step is made. The unit is one standard deviation of the
/// parameter that moves most. The refits of an accepted model leave steps of this length.
pub(crate) const MIN_FIRST_FINAL_STEP: f64 = 1.0;

/// Largest final step of a base parameter, as a share of its value. Of the values in the camera and in the base
/// model, the larger one counts. A choice.
pub(crate) const MAX_FINAL_BASE_STEP: f64 = 0.3;

// Parameter mismatches

/// Smallest gain by which a parameter of the camera becomes a mismatch. The gain is the decrease of the squared
/// distance between the parameters of the camera and the fitted parameters when this parameter is free. Derived:
/// the square of 3.5 standard deviations.
pub(crate) const MIN_MISMATCH_GAIN: f64 = 12.0;

/// Difference of squared distances below which two parameters explain the data equally well. Derived: the square of
/// two standard deviations.
pub(crate) const MAX_AMBIGUOUS_DISTANCE: f64 = 4.0;

// Verdict and tentative names

/// Smallest share of the initial excess that the model must explain if a significant discrepancy remains. If the
/// share is smaller, all names are tentative. The excess is the discrepancy above the noise floor. Measured: true
/// effects left at most a few percent of the excess, and wrong effects left 20 %.
pub(crate) const MIN_EXPLAINED_SHARE: f64 = 0.95;

/// Remaining discrepancy, divided by the noise floor, above which the model does not describe the data. The limit
/// is wide, because the noise floor of a model with random events depends on the number of events. This number can
/// deviate by three standard deviations.
pub(crate) const MAX_FLOORS: f64 = 10.0;

/// Largest remaining discrepancy, divided by the noise floor, of a model that explains less than [`COMPLETE_SHARE`]
/// of the initial excess. Measured: models with the true effects violated this limit or [`COMPLETE_SHARE`], but not
/// both.
pub(crate) const INCOMPLETE_MAX_FLOORS: f64 = 3.0;

/// Share of the initial excess above which a model may exceed [`INCOMPLETE_MAX_FLOORS`]. The excess is the
/// discrepancy above the noise floor.
pub(crate) const COMPLETE_SHARE: f64 = 0.99;

/// Relative change of a base parameter by added effects above which its linear derivative is not valid. Measured:
/// strong row noise changed base parameters by factors of 0.2 to 3.6.
pub(crate) const MAX_BASE_CHANGE: f64 = 0.45;

/// Smallest relative difference between the fitted and the given value at which a parameter mismatch is reported.
pub(crate) const MIN_MISMATCH: f64 = 0.02;

/// Largest number of effects that are listed as ambiguous with a parameter mismatch.
pub(crate) const MAX_AMBIGUOUS_PARAMETERS: usize = 2;

// Qualifications

/// Standard deviation of the noise floor, divided by the noise floor, above which a small discrepancy does not show
/// that the model is complete. Such an uncertain floor is compatible with a discrepancy of zero and with one of
/// several times the floor.
pub(crate) const MAX_RELATIVE_FLOOR_SD: f64 = 3.0;

/// Smallest cosine between the signatures of two effects at which one effect may replace the other. The two are
/// then reported as ambiguous, even if their fits were not compared.
pub(crate) const MIN_SIMILAR_COSINE: f64 = 0.9;

/// Largest number of effects that are reported as ambiguous with one effect.
pub(crate) const MAX_AMBIGUOUS_EFFECTS: usize = 3;

// Judged readouts and recorded scenes

/// Largest number of pixel-readouts per recording that are judged. The time of a simulation is proportional to this
/// number. The effects that a diagnosis names are far stronger than the noise of this many pixel-readouts.
pub(crate) const MAX_PIXEL_READOUTS: usize = 35_000_000;

/// Smallest number of readouts of a long recording that a diagnosis compares with the model. Large frames do not
/// reduce it, because the low frequency bands of the spectra require this many readouts. A choice.
pub(crate) const MIN_JUDGED_READOUTS: usize = 1250;

/// Smallest number of half periods of a square wave that are compared with the model.
pub(crate) const MIN_JUDGED_HALF_PERIODS: usize = 5;

/// Light below which all intervals of a constant recording are measured. A choice.
pub(crate) const MAX_INTERVAL_RATE: f64 = 0.25;

/// Shortest half period, in readouts, of a square wave whose response to steps is measured. Each half period then
/// has at least 40 steady readouts.
pub(crate) const MIN_RESPONSE_HALF_PERIOD: usize = STEADY_READOUTS + 40;

/// Radius, in pixels, of the square around a pixel. The mean rate in the square is the rate of the scene at the
/// pixel. A choice.
pub(crate) const SURFACE_RADIUS: usize = 2;

/// Smallest number of static pixels in uniform areas of a static scene. A choice.
pub(crate) const MIN_UNIFORM_PIXELS: usize = 500;

/// Rates, in spikes per readout, of the pixels of a static scene that are compared. Slower pixels have too few
/// intervals. Faster pixels have too few readouts per interval.
pub(crate) const COMPARED_RATES: std::ops::Range<f64> = 0.05..0.45;

/// Smallest number of readouts of a recording, or of each half of a divided recording. A choice.
pub(crate) const MIN_READOUTS: usize = 256;

/// Largest number of simulated pixels of a static scene. Derived: 20,000 pixels determine the temporal noise to
/// 1 %.
pub(crate) const MAX_STATIC_PIXELS: usize = 20_000;

// Steps of a square wave

/// Number of readouts after a step of the light. The later readouts are the steady reference of the response. It is
/// twice 150 readouts, the largest time constant with which image lag is tried. It is also the end of the last
/// window after a step.
pub(crate) const STEADY_READOUTS: usize = 300;

/// Number of readouts that are excluded after a fall of the light. The first interval after a fall contains charge
/// of the brighter light.
pub(crate) const SETTLED_READOUTS: usize = 20;

/// Length in readouts of the shortest stretch of constant light that a diagnosis uses. The stretch has at least 20
/// readouts after the first [`STEADY_READOUTS`].
pub(crate) const MIN_STRETCH_READOUTS: usize = STEADY_READOUTS + 20;

/// Number of successive readouts that must cross the middle between both lights to make a step. A choice.
pub(crate) const MIN_AGREEING_READOUTS: usize = 4;

/// Smallest detectable difference between both lights of a square wave, in standard deviations of the spikes per
/// readout (a Poisson count). If the difference is smaller, the steps are taken from the protocol. A choice.
pub(crate) const MIN_STEP_SDS: f64 = 6.0;

// Statistics

/// Smallest number of half periods that a wave must have across the map to belong to the spectrum of the map.
/// Longer waves come from uneven light.
pub(crate) const MIN_WAVE_HALF_PERIODS: usize = 4;

/// Number of robust standard deviations from the median beyond which a pixel is an outlier. A choice.
pub(crate) const OUTLIER_SDS: f64 = 5.0;

/// Number of outliers at which their mean distance has half of its full weight. It makes one or two outliers
/// insignificant. A choice.
pub(crate) const OUTLIER_HALF_WEIGHT: f64 = 9.0;

/// Smallest light of a recording in which lines are searched. At this light, the firing rates of the pixels are
/// higher than the frequencies of lines. A choice.
pub(crate) const MIN_LINE_LIGHT: f64 = 0.2;

/// Windows after a step of a square wave in which the response is measured. Each has its first readout and the
/// first readout after it, counted from the step.
pub(crate) const STEP_WINDOWS: [(usize, usize); 4] = [(2, 20), (20, 60), (60, 120), (120, 300)];

/// Highest frequency of a line, in cycles per readout. The firing rates of bright pixels are higher, so they are
/// not mistaken for lines.
pub(crate) const MAX_LINE_FREQUENCY: f64 = 0.13;

/// Number of frequencies per frequency step of the spectrum that are examined to refine the frequency of a line. A
/// choice.
pub(crate) const STEPS_PER_BIN: f64 = 10.0;

/// Number of frequencies on each side of a line whose mean power is the background of the line. A choice.
pub(crate) const BACKGROUND_BINS: usize = 40;

/// Smallest number of periods of a line in a recording. The mean and a drift have fewer periods. A choice.
pub(crate) const MIN_PERIODS: f64 = 2.0;

// Lost and repeated readouts

/// Smallest number of located events that makes an effect of whole readouts a candidate, even if its signature
/// resembles the deviations only a little. A choice.
pub(crate) const MIN_CERTAIN_EVENTS: usize = 3;

/// Largest number of events whose locations are listed. A choice.
pub(crate) const MAX_LISTED_EVENTS: usize = 4;

/// Shortest mean interval, in readouts, at which a missing spike is visible. The interval across a lost readout
/// then has `2 x 2.3 - 1 = 3.6` readouts, more than the longest regular interval of 3.
pub(crate) const MIN_MEAN_INTERVAL: f64 = 2.3;

/// Smallest length of an interval that contains a missing spike, in mean intervals of the pixel. A choice.
pub(crate) const MIN_GAP_INTERVALS: f64 = 1.4;

/// Largest number of successive missing spikes of a pixel. Two lost readouts at a distance of one mean interval
/// cause two.
pub(crate) const MAX_MISSING_RUN: u32 = 2;

/// Smallest number of intervals of a pixel that determine its mean interval. A choice.
pub(crate) const MIN_INTERVALS: usize = 4;

/// Smallest expected number of spikes in a lost readout at which lost readouts are located. With 30 expected
/// spikes, the probability that fewer than [`MIN_FOUND_SHARE`] of them are missing is below 1/500.
pub(crate) const MIN_EXPECTED_SPIKES: f64 = 30.0;

/// Smallest number of missing spikes at a lost readout, as a share of the expected number. A choice.
pub(crate) const MIN_FOUND_SHARE: f64 = 0.45;

/// Smallest ratio between the missing spikes at a lost readout and those in the windows beside it. A choice.
pub(crate) const MIN_SHARPNESS: f64 = 4.0;

/// Number of missing spikes beside a lost readout above which the window is extended, as a share of the expected
/// spikes of a readout. The window then contains another lost readout. A choice.
pub(crate) const ADJACENT_SHARE: f64 = 0.15;

/// Smallest mean number of changed bits per readout at which repeated readouts are located. With fewer changes,
/// equal readouts also occur by chance. A choice.
pub(crate) const MIN_MEAN_CHANGES: f64 = 4.0;

/// Smallest number of pixels that repeat in an unusual way in a repeated readout. A single pixel may repeat by
/// chance.
pub(crate) const MIN_UNUSUAL_PIXELS: usize = 2;

// Faults

/// Smallest number of lit levels for a report of a single level, and for a report of the scatter of all levels. A
/// choice.
pub(crate) const MIN_LIT_LEVELS: [usize; 2] = [4, 3];

/// Correlation above which the fixed patterns of two recordings come from one sensor. A choice.
pub(crate) const MIN_OWN_CORRELATION: f64 = 0.5;

/// Correlation below which the fixed patterns of two recordings come from different sensors. A choice.
pub(crate) const MAX_FOREIGN_CORRELATION: f64 = 0.25;

/// Smallest ratio between the change of a drifting lamp and the largest change in the steady recordings. An effect
/// of the camera changes all recordings, so the ratio is then smaller. A choice.
pub(crate) const MIN_CHANGE_RATIO: f64 = 5.0;

/// Relative change of the rate between the halves of a recording below which the light is steady. A choice.
pub(crate) const MAX_STEADY_CHANGE: f64 = 1e-3;

/// Smallest prominence at which a line counts as an oscillation of the light. The prominence is the power of the
/// line, divided by the mean power around it. By chance, one frequency in 1e17 exceeds the limit (exp(-40)).
pub(crate) const MIN_PROMINENCE: f64 = 40.0;

/// Twice the mains frequencies, in hertz.
pub(crate) const MAINS_LIGHT_HZ: [f64; 2] = [100.0, 120.0];

/// Largest distance between two frequencies of a spectrum at which the two frequencies of [`MAINS_LIGHT_HZ`] are
/// distinguished, in hertz.
pub(crate) const MAINS_RESOLUTION_HZ: f64 = (MAINS_LIGHT_HZ[1] - MAINS_LIGHT_HZ[0]) / 2.0;

// Simulations of the base model

/// Number of simulated sensors with exactly the parameters of the base model. A choice.
pub(crate) const SENSORS: usize = 80;

/// Number of sensors in the first step. Measured: the noise of 24 sensors judges a clean set as the noise of 200
/// sensors does. An effect of eight standard deviations then has a score of 7.9 (the median of all candidates of
/// the recommended protocol).
pub(crate) const FIRST_SENSORS: usize = 24;

/// Number of simulations of the derivatives by the lamps in the first step. The lamps are free directions. The
/// noise of their derivatives therefore only removes one random direction of about 250 from each comparison.
pub(crate) const FIRST_LAMP_DRAWS: usize = 4;

/// Number of simulations of a signature. Two simulations show how much of a signature is noise. The first step
/// makes one ([`FIRST_SIGNATURE_DRAWS`]).
pub(crate) const SIGNATURE_DRAWS: usize = 2;

/// Number of simulations of a signature in the first step; see [`SIGNATURE_DRAWS`].
pub(crate) const FIRST_SIGNATURE_DRAWS: usize = 1;

/// Number of sensors of a complete null model whose parameters are drawn from the posterior of the calibration. A
/// choice.
pub(crate) const POSTERIOR_SENSORS: usize = 120;

/// Number of readouts that are simulated before the recording of a static scene. Pixels that start with a common
/// phase become independent in this time. A choice.
pub(crate) const LEAD_READOUTS: usize = 200;

// Limits of other effects, recommended recordings and the report

/// Quantile of the standard normal distribution at a probability of 95 %.
pub(crate) const NORMAL_QUANTILE_95: f64 = 1.645;

/// Length of a signature, in standard deviations, above which one simulation determines the signature. Measured
/// with 24x24 pixels: the noise of one simulation is up to ten standard deviations long.
pub(crate) const MIN_CERTAIN_LENGTH: f64 = 15.0;

/// Exponent above which an effect counts as quadratic. It is the exponent of the length of the signature as a
/// function of the amplitude.
///
/// Measured with 24x24 pixels: most effects have exponents of 0.5 to 1.12. `telegraph_dark`, `readout_jitter` and
/// `false_spikes` have 1.24 to 1.52. The variance of the first two is proportional to the square of the amplitude.
pub(crate) const MAX_LINEAR_EXPONENT: f64 = 1.2;

/// Smallest share of a tried variance, or of a tried probability of rare events, to which a limit is interpolated.
///
/// Measured with 20 simulated sensors that had an effect exactly at its interpolated limit. The estimated strength
/// should be zero for one of them. It was zero for 11 sensors with `row_noise`, at 1/36 of the tried variance. It
/// was zero for 7 sensors with `false_spikes`, where two spikes are expected and some sensors have none.
pub(crate) const MIN_INTERPOLATED_SHARE: f64 = 0.1;

/// Distance between two fitted models, in standard deviations, at which the recordings distinguish them.
/// Recommended lengths reach this distance. A choice.
pub(crate) const DISTINCT_SDS: f64 = 5.0;

/// Largest recommended length of recordings, as a multiple of their present length. A choice.
pub(crate) const MAX_LENGTH_FACTOR: f64 = 400.0;

/// Largest number of unexplained statistics that are listed. A choice.
pub(crate) const MAX_UNEXPLAINED_STATISTICS: usize = 6;

/// Number of statistics in the plot of the largest deviations. A choice.
pub(crate) const MAX_SHOWN_DEVIATIONS: usize = 24;

/// Deviation, in standard deviations, that marks a large deviation in the report. In a sensor without missing
/// effects, at least one statistic exceeds it with a probability of 0.001.
pub(crate) const DEVIATION_LIMIT: f64 = 5.0;

/// Number of additional simulated sensors of the final model whose spectra are shown as a range. At one frequency,
/// another such sensor lies outside the range with a probability of 2 / (20 + 1).
pub(crate) const RANGE_SENSORS: usize = 20;
