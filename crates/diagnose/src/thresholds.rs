//! Numbers of a diagnosis, each with its origin: thresholds, and numbers of simulations and steps.
//!
//! A threshold is *derived* from a probability or a number of standard deviations, *measured* on simulated sensors, or *a
//! choice*. The limits of an alarm are in `null_model/limits.rs`. Sizes of memory and of vector loops are beside their code.

// Recordings before the search

/// Largest rate of a pixel whose first spike shows its start phase, in spikes per readout. Derived: an interval has four
/// readouts.
pub(crate) const MAX_PHASE_RATE: f64 = 0.25;

/// Smallest number of pixels whose phases are compared. A choice.
pub(crate) const MIN_PHASE_PIXELS: usize = 100;

/// Length of the mean phase vector from which on pixels began together. Derived: charges over three quarters of a threshold
/// have 0.3. Uniform charges have the square of the rate, at most 0.06, and 0.02 by chance for 2,000 pixels.
pub(crate) const MIN_COMMON_PHASE: f64 = 0.25;

/// The same after the pixels have drifted apart, relative to the length by chance. A choice.
pub(crate) const MAX_CHANCE_PHASE: f64 = 3.0;

/// Largest excluded part of a recording is its length, divided by this number. A choice.
pub(crate) const MAX_ASIDE_DIVISOR: usize = 3;

/// Largest number of examined pixels. A choice that limits the time.
pub(crate) const MAX_DRIFT_PIXELS: usize = 20_000;

/// Excluded readouts of a square wave if no flat shows how fast bright pixels drift apart. A choice.
pub(crate) const SQUARE_WAVE_ASIDE: usize = 64;

/// Brightest level of the lines of dim pixels. The response to brighter light bends.
pub(crate) const MAX_DIM_LIGHT: f64 = 0.35;

/// Deviations by which two silent pixels lack charge in the light. A choice.
pub(crate) const MIN_CHARGE_DEFICIT_SDS: f64 = 5.0;

/// The same for one silent pixel. A choice.
pub(crate) const MIN_SINGLE_DEFICIT_SDS: f64 = 12.0;

/// Number of the faintest firing pixels, whose spread is the standard deviation of a charge deficit. A choice.
pub(crate) const FAINT_PIXELS: usize = 200;

/// Skew of the quantiles from which on dark currents have a tail. Derived: the skew of 2,000 normal numbers deviates by 0.03.
pub(crate) const MIN_TAIL_SKEW: f64 = 0.15;

/// Largest relative error of a calibrated parameter that is used. A choice.
pub(crate) const MAX_CALIBRATION_ERROR: f64 = 0.25;

/// Largest factor between a calibrated and a published parameter. A larger factor comes from a missing effect.
pub(crate) const MAX_CALIBRATION_FACTOR: f64 = 30.0;

// Light of the recordings

/// Simulated sensors of one step, for a set without sources and for a set with sources. The mean gains of two sensors differ by
/// a thousandth. Independent lamps absorb this difference. Sums of sources cannot absorb it if the response is nonlinear.
pub(crate) const LIGHT_SENSORS: [usize; 2] = [2, 24];

/// Largest number of steps. A choice.
pub(crate) const MAX_LIGHT_STEPS: usize = 4;

/// Change of the light below which no further step is made. A choice.
pub(crate) const MIN_LIGHT_STEP: f64 = 2e-4;

/// Largest deviation of the found light from the stated light, in uncertainties. The rates of a camera with a strong effect
/// would require a larger deviation.
pub(crate) const MAX_FOUND_PULL: f64 = 3.5;

/// The same for recordings with sources. All recordings of the sources show their light, and a found light at the limit would
/// contradict the sums.
pub(crate) const MAX_FOUND_SOURCE_PULL: f64 = 6.0;

/// Change of the light from which on two steps show the slope of the rate. A choice.
pub(crate) const MIN_SECANT_STEP: f64 = 2e-3;

/// Change of the light that other simulations must follow. A choice.
pub(crate) const MAX_UNCHANGED_LIGHT: f64 = 1e-3;

/// Change of the offset of a lamp from which on a model is simulated at the new offset. Derivatives hold within it, because
/// their step is [`LAMP_STEP`].
pub(crate) const MAX_LINEAR_OFFSET: f64 = 2e-3;

/// Largest deviation of a lamp from the stated light in a fit, in uncertainties. A choice.
pub(crate) const MAX_LAMP_PULL: f64 = 4.0;

/// Largest change of a lamp in one step of a fit. Derivatives do not hold beyond it. Otherwise an effect that is not fitted yet
/// would move the lamps, and the lamps would replace it.
pub(crate) const MAX_LAMP_STEP: f64 = 3e-3;

/// Step of the derivative by a lamp, relative to its light. It does not depend on the uncertainty of the lamp, because the
/// statistics of bright intervals are linear in the light only over a few thousandths.
pub(crate) const LAMP_STEP: f64 = 3e-3;

/// Standard deviation of the lamps of simulated sensors from which the noise is estimated. A statistic that is not linear in
/// the light then has noise only as far as the found light may be wrong.
pub(crate) const SMALL_LAMP_DEVIATION: f64 = 1e-3;

/// Smallest relative deviation of a level that is reported, and that of the darkest and of the brightest level. A bend of the
/// response is largest there, and the other levels determine it least.
pub(crate) const MIN_LEVEL_DEVIATIONS: [f64; 2] = [0.005, 0.012];

/// Deviation of a single level above which the level is reported, in uncertainties of its lamp. Derived: a lamp with the stated
/// uncertainty exceeds it with a probability of 5e-4.
pub(crate) const MAX_LEVEL_PULL: f64 = 3.5;

/// Relative uncertainty of a reported lamp. Its level then contains nearly no information about the response.
pub(crate) const REPORTED_LAMP_UNCERTAINTY: f64 = 0.3;

/// Normal quantile of the limit above which a scatter is reported. Derived: lamps with their stated uncertainties exceed the
/// limit with a probability of 0.001.
pub(crate) const REPORTED_SCATTER_Z: f64 = 3.09;

/// Normal quantile of the limit above which larger uncertainties are used. Derived: the probability is 0.05, because larger
/// uncertainties cost little.
pub(crate) const WIDENED_SCATTER_Z: f64 = 1.645;

/// Largest relative scatter that is attributed to lamps. A response with a larger scatter is not smooth.
pub(crate) const MAX_LAMP_SCATTER: f64 = 0.1;

/// Smallest relative uncertainty of a measured response. A choice.
pub(crate) const MIN_RESPONSE_UNCERTAINTY: f64 = 1e-4;

// Fit of uncertain base parameters

/// Smallest number of simulations of the mean. A choice.
pub(crate) const MIN_BASE_FIT_SIMULATIONS: usize = 24;

/// Largest number of steps. A choice that limits the time.
pub(crate) const MAX_BASE_FIT_STEPS: usize = 10;

/// Largest relative change of a parameter in one step. A choice.
pub(crate) const MAX_BASE_FIT_STEP: f64 = 0.45;

/// Relative change of a parameter beyond which derivatives are computed again. A choice.
pub(crate) const MAX_DERIVATIVE_MOVE: f64 = 0.15;

/// Relative uncertainty of the parameters before the data are seen. A parameter that the data do not determine keeps its value.
pub(crate) const BASE_PARAMETER_UNCERTAINTY: f64 = 0.3;

/// Length of a step, in standard deviations, below which no further step is made. A choice.
pub(crate) const MIN_BASE_FIT_STEP: f64 = 0.5;

/// Deviation, in standard deviations, to which the influence of a statistic is limited. A single missing effect must not change
/// every parameter.
pub(crate) const MAX_BASE_FIT_Z: f64 = 6.0;

/// Simulations for the derivatives by the lamps. A precision of a few percent suffices, because the fit ends within some
/// thousandths of the found light.
pub(crate) const BASE_FIT_LAMP_DRAWS: usize = 4;

/// Reweighted steps of the fit of the lamps. A choice.
pub(crate) const BASE_FIT_LAMP_STEPS: usize = 4;

// Null model

/// Number of pixels of a large sensor, and simulations for each of its derivatives. Each simulation of a large sensor counts as
/// several.
pub(crate) const MANY_PIXELS: (usize, usize) = (20_000, 8);

/// Number of pixels of a usual sensor, and simulations for each of its derivatives. A smaller sensor has more simulations in
/// proportion, up to [`MAX_DERIVATIVE_PAIRS`].
pub(crate) const USUAL_PIXELS: (usize, usize) = (2304, 16);

/// Largest number of simulations for a derivative. A choice that limits the time.
pub(crate) const MAX_DERIVATIVE_PAIRS: usize = 64;

/// Deviations of the noise of a change below which the change hardly counts. A choice.
pub(crate) const MIN_CHANGE_SDS: f64 = 2.5;

/// Median of the square of a standard normal variable.
pub(crate) const NORMAL_SQUARE_MEDIAN: f64 = 0.455;

/// Correlations below this number of standard errors are set to zero. With a few hundred simulations, most correlations are
/// noise.
pub(crate) const MIN_CORRELATION_SDS: f64 = 3.2;

/// Parts of the clean sensors. The noise of the others judges each part. A choice.
pub(crate) const LIMIT_FOLDS: usize = 5;

/// Factor of the limit of the total misfit for real sensors. A choice: one hidden clean sensor of eight exceeded the limit by 4
/// % without it.
pub(crate) const MISFIT_MARGIN: f64 = 1.15;

/// Prior weight of a standard deviation of one for a score, in sensors. A choice.
pub(crate) const SCORE_SD_PRIOR: f64 = 10.0;

/// Simulations of a held-out set with another part or another light. A choice.
pub(crate) const HELD_OUT_SIMULATIONS: usize = 24;

/// The same for the first simulations. No verdict depends on them if the set agrees.
pub(crate) const FIRST_HELD_OUT_SIMULATIONS: usize = 8;

/// Squared length below which a signature is lost in its own noise. Derived: the square of five standard deviations.
pub(crate) const MIN_SIGNATURE_SQUARE: f64 = 25.0;

/// Deviation and score up to which the preliminary result reports no deviation. Derived: the noise comes from 24 sensors. A
/// statistic of a clean sensor exceeds the limit once in 2.6 million sets, and one of 250 statistics once in ten thousand.
pub(crate) const MAX_PRELIMINARY_Z: f64 = 7.0;

/// Share of the largest squared score from which on an effect is likely in the preliminary result. A choice.
pub(crate) const MIN_LIKELY_SHARE: f64 = 0.35;

/// Largest number of likely effects in the preliminary result. A choice.
pub(crate) const MAX_LIKELY_EFFECTS: usize = 5;

/// Length of a signature up to which a straight line to [`DETECTION_SCORE`](crate::DETECTION_SCORE) holds. A choice.
pub(crate) const MAX_LINEAR_LENGTH: f64 = 40.0;

/// Largest cosine of the nearest effect that is projected out. Effects that nothing separates are ambiguous instead.
pub(crate) const MAX_PROJECTED_COSINE: f64 = 0.97;

/// Bisections of the strength at which an effect sets in. Derived: they determine it to a few percent.
pub(crate) const ONSET_STEPS: usize = 6;

/// Number of expected events of a detectable strength. Derived: fewer than one set in a hundred then has none.
pub(crate) const MIN_EXPECTED_EVENTS: f64 = 5.0;

// Fits

/// Squared width of the range of a number that cannot move, in positions.
pub(crate) const FIXED_RANGE_SQUARE: f64 = 1e-12;

/// Deviations of the largest noise of a change from which on a statistic counts as changed. A choice.
pub(crate) const MIN_EFFECT_CHANGE_SDS: f64 = 2.0;

/// Smallest number of simulations that show whether a statistic changes. A choice.
pub(crate) const MIN_CHANGE_SIMULATIONS: usize = 6;

/// Number of statistics from which on their noise together is longer than a detectable change. Static scenes and maps have
/// fewer.
pub(crate) const MIN_CROWDED_STATISTICS: usize = 100;

/// Share of the step of a derivative within which the derivative holds. A choice.
pub(crate) const MAX_SLOPE_MOVE: f64 = 0.25;

/// Simulations of a fitted model with redrawn parameters. A choice.
pub(crate) const REDRAWN_SIMULATIONS: usize = 30;

/// Largest number of fits of an accepted model with its own noise. A choice.
pub(crate) const MAX_REFITS: usize = 2;

/// Quantile of Student's distribution for 95 % intervals. Derived: thirty simulations determine a standard deviation.
pub(crate) const INTERVAL_QUANTILE: f64 = 2.04;

/// If the noise is proportional to a variance, the variance may have no upper end. The reported end is then that of two and a
/// half times the standard deviation.
pub(crate) const MIN_VARIANCE_SHARE: f64 = 0.3;

/// Expected fall of the cost, absolute and relative, from which on a step is simulated. A choice.
pub(crate) const MIN_STEP_GAIN: (f64, f64) = (0.5, 0.003);

/// Change of a base parameter from which on a step is always simulated. The cost does not depend on base parameters, so it
/// shows no gain.
pub(crate) const MIN_BASE_MOVE: f64 = 0.1;

/// Pairs of simulations for the change per event. A choice.
pub(crate) const EVENT_PAIRS: usize = 2;

/// Weight of the variances of the null model beside those of a fitted model, in simulations. A choice.
pub(crate) const PRIOR_SIMULATIONS: f64 = 10.0;

/// Ratio of variances from which on the variance of a fitted model is used. Derived: three deviations of a ratio of one with
/// [`PRIOR_SIMULATIONS`] and eight simulations.
pub(crate) const MIN_WIDER_VARIANCE: f64 = 1.6;

// Simulations of a mean

/// Simulations of a mean in a tournament. A choice that limits the time.
pub(crate) const FEW_SIMULATIONS: usize = 2;

/// Simulations of a mean in the second leg of a tournament, or if sets differ more than clean sets. A choice.
pub(crate) const SOME_SIMULATIONS: usize = 6;

/// Simulations of a mean with which a fitted model is compared with itself. A choice.
pub(crate) const MEAN_SIMULATIONS: usize = 12;

/// Simulations of a mean if fewer do not separate the best candidates. A choice.
pub(crate) const MOST_SIMULATIONS: usize = 24;

/// Logarithm of the determinant of a noise, relative to the null model, from which on two simulations determine little.
/// Derived: ten statistics with twice the deviation have 10 ln 4.
pub(crate) const MIN_NOISY_LOG_VOLUME: f64 = 14.0;

// Base parameters

/// Information of the calibration about a base parameter: as much as a measurement with an error of half the value has.
/// Without it, parameters with similar changes, such as the spreads of gain and of threshold, wander.
pub(crate) const CALIBRATION_INFORMATION: f64 = 4.0;

// Lines in the frame totals

/// Power of a line in the frame totals, relative to the mean around it, from which on its frequency is used. Noise
/// exceeds it with a probability of exp(-12) at each frequency.
pub(crate) const MIN_LINE_POWER: f64 = 12.0;

// Tournament

/// Largest factor by which the amplitude of a signature is extrapolated. Beyond, another start value is nearer.
pub(crate) const MAX_SIGNATURE_SCALE: f64 = 8.0;

/// Largest number of candidates in a tournament. A choice that limits the time.
pub(crate) const MAX_CANDIDATES: usize = 5;

/// Largest number of candidates in the second leg of a tournament. A choice that limits the time.
pub(crate) const MAX_FINALISTS: usize = 3;

/// Largest number of Gauss-Newton steps in both legs for the first effect. An effect with three parameters requires as many.
pub(crate) const STEPS_OF_FIRST_EFFECT: [usize; 2] = [4, 3];

/// The same beside other effects, whose parameters also move. With half as many steps, right effects were measured to lose
/// to similar ones.
pub(crate) const STEPS_OF_FURTHER_EFFECT: [usize; 2] = [7, 5];

/// Largest cost that the noise of few simulations adds. A choice.
pub(crate) const MAX_SIMULATION_COST: f64 = 40.0;

/// Share of the largest promise from which on a candidate takes part. Measured: weak `telegraph_dark`, whose shape is between
/// the start values, promised 0.4 of what `false_spikes` promised.
pub(crate) const MIN_PROMISE_SHARE: f64 = 0.35;

/// Share of the largest promise from which on a candidate has a second simulation. The noise of one simulation can hide half of
/// the promise of a weak signature.
pub(crate) const MIN_SECOND_DRAW_SHARE: f64 = 0.1;

/// Smallest promise of the best candidate. Derived: the square of 4.5 standard deviations.
pub(crate) const MIN_PROMISE: f64 = 20.0;

/// Standard deviation of a score from which on more simulations of the best candidates are made. Derived: half of
/// the smallest difference of 4 at which two models are ambiguous.
pub(crate) const MAX_SCORE_DEVIATION: f64 = 2.0;

// Acceptance of an effect

/// Largest number of effects that a search adds. A choice that limits the time.
pub(crate) const MAX_EFFECTS: usize = 4;

/// The same for static scenes of unknown light without held-out recordings. Their dozen statistics do not test a second effect
/// beside the two or three fitted parameters of the first.
pub(crate) const MAX_STATIC_EFFECTS: usize = 1;

/// Number of rejected effects after which a search ends. A choice.
pub(crate) const MAX_REJECTED: usize = 2;

/// Fall of the held-out deviance below which an effect is rejected. Derived: the square of three standard deviations of one
/// parameter.
pub(crate) const MIN_HELD_OUT_GAIN: f64 = 9.0;

/// Share of the excess below which the accepted effect explains so little that the search ends. Derived: of three effects of
/// equal strength, the first explains a third.
pub(crate) const MIN_EXPLAINED_EXCESS: f64 = 0.2;

/// Share of the held-out deviance below which [`REMAINDER_SHARE`] does not apply to a further effect. Measured:
/// `comparator_noise` beside strong `adaptation` left 278 of 3,637, and the remainder was 3,998.
pub(crate) const COMPLETE_REMAINDER: f64 = 0.1;

// Backward elimination

/// Share of the squared distance from the base model that a further effect must explain, and that an eliminated effect may leave.
/// Measured: an approximate signature of a strong effect leaves this much. With three times as much, `supply_droop` beside
/// strong `row_noise` was not named.
pub(crate) const REMAINDER_SHARE: f64 = 0.0003;

/// Variance inflation of an amplitude from which on other parameters may replace the effect. Derived: 1 / (1 - c^2) is 5 at the
/// cosine c = 0.9.
pub(crate) const MAX_VARIANCE_INFLATION: f64 = 5.0;

/// Rise of the cost from which on an effect is necessary, in addition to [`REMAINDER_SHARE`]. Derived: the square of 3.5
/// standard deviations.
pub(crate) const MIN_ELIMINATION_COST: f64 = 12.0;

/// Share of a gain that the held-out set must confirm. Measured: a wrong `response_nonlinearity` in place of weak
/// `dark_shot_noise` gained 30 on the fitted set and 6 on the held-out set.
pub(crate) const MIN_HELD_OUT_GAIN_SHARE: f64 = 0.5;

/// Largest number of effects that are tried in place of another one. Measured: the right effect was up to the third by its
/// promise, which is linear.
pub(crate) const MAX_REPLACEMENTS: usize = 4;

/// Simulations of a mean in both legs of a replacement if the effects of a model add strong noise. Measured: `partial_reset`
/// beside strong `row_noise` cost 460 with 6 simulations and 360 with 24; wrong effects cost 361 to 373 with 24.
pub(crate) const NOISY_SIMULATIONS: [usize; 2] = [MOST_SIMULATIONS / 2, MOST_SIMULATIONS];

/// Steps of a fit after which a replacement must explain half as much as the replaced effect. A choice.
pub(crate) const ENTRY_STEPS: usize = 2;

/// Largest number of effects that are replaced, one after the other. A choice.
pub(crate) const MAX_SWAPS: usize = 4;

// Final steps of the base parameters

/// Largest number of final steps. Each is about a quarter of the previous one.
pub(crate) const MAX_FINAL_STEPS: usize = 6;

/// Final step, in standard deviations of its largest parameter, below which no further one is made: the noise of another mean is
/// larger. A choice.
pub(crate) const MIN_FINAL_STEP: f64 = 0.3;

/// First final step, in standard deviations of its largest parameter, below which none is made. The refits of an accepted model
/// leave as much.
pub(crate) const MIN_FIRST_FINAL_STEP: f64 = 1.0;

/// Largest final step of a base parameter, relative to the larger one of its values in the camera and in the base model. A
/// choice.
pub(crate) const MAX_FINAL_BASE_STEP: f64 = 0.3;

// Parameter mismatches

/// Fall of the squared distance between camera and fit from which on a parameter is a mismatch. Derived: the square of 3.5
/// standard deviations.
pub(crate) const MIN_MISMATCH_GAIN: f64 = 12.0;

/// Difference of squared distances up to which two parameters are ambiguous. Derived: the square of two standard deviations.
pub(crate) const MAX_AMBIGUOUS_DISTANCE: f64 = 4.0;

// Verdict and tentative names

/// Smallest share of the initial excess that the model must explain if a significant discrepancy remains. Below it,
/// all names are tentative. True effects leave a few percent at most, and wrong ones were measured to leave 20 %.
pub(crate) const MIN_EXPLAINED_SHARE: f64 = 0.95;

/// Remaining discrepancy, divided by the noise floor, above which the model does not describe the data. The floor of a
/// model with random events deviates by up to three standard deviations of the number of events.
pub(crate) const MAX_FLOORS: f64 = 10.0;

/// Largest remaining discrepancy, divided by the noise floor, of a model that explains less than [`COMPLETE_SHARE`] of
/// the initial excess. Models with the true effects were measured to violate at most one of both limits.
pub(crate) const INCOMPLETE_MAX_FLOORS: f64 = 3.0;

/// Share of the initial excess above which a model may exceed [`INCOMPLETE_MAX_FLOORS`].
pub(crate) const COMPLETE_SHARE: f64 = 0.99;

/// Relative change of a base parameter, caused by added effects, above which its linear derivative is not valid.
/// Strong row noise was measured to change base parameters by factors of 0.2 to 3.6.
pub(crate) const MAX_BASE_CHANGE: f64 = 0.45;

/// Smallest relative deviation of a parameter that is reported.
pub(crate) const MIN_MISMATCH: f64 = 0.02;

/// Largest number of names beside a parameter that the data contradict.
pub(crate) const MAX_AMBIGUOUS_PARAMETERS: usize = 2;

// Qualifications

/// Standard deviation of the noise floor, divided by the noise floor, above which a discrepancy at the floor is not
/// evidence. Such a floor is compatible with a discrepancy of zero and with one of several floors.
pub(crate) const MAX_RELATIVE_FLOOR_SD: f64 = 3.0;

/// Smallest cosine of two signatures at which one effect may replace the other.
pub(crate) const MIN_SIMILAR_COSINE: f64 = 0.9;

/// Largest number of effects that are reported as ambiguous with one effect.
pub(crate) const MAX_AMBIGUOUS_EFFECTS: usize = 3;

// Judged readouts and recorded scenes

/// Largest number of pixel-readouts that are judged per recording. Named effects are far stronger than the noise of so
/// many. The time of a simulation is proportional to their number.
pub(crate) const MAX_PIXEL_READOUTS: usize = 35_000_000;

/// Smallest number of judged readouts of a long recording, however large its frames are. The low frequency bands of the
/// spectra require it. A choice.
pub(crate) const MIN_JUDGED_READOUTS: usize = 1250;

/// Smallest number of judged half periods of a square wave.
pub(crate) const MIN_JUDGED_HALF_PERIODS: usize = 5;

/// Largest rate at which all intervals are measured. A choice.
pub(crate) const MAX_INTERVAL_RATE: f64 = 0.25;

/// Shortest half period, in readouts, whose response to steps is measured: at least 40 readouts are steady.
pub(crate) const MIN_RESPONSE_HALF_PERIOD: usize = STEADY_READOUTS + 40;

/// Radius of the neighborhood, in pixels, whose mean rate is the rate of the scene. A choice.
pub(crate) const SURFACE_RADIUS: usize = 2;

/// Smallest number of uniform, static pixels. A choice.
pub(crate) const MIN_UNIFORM_PIXELS: usize = 500;

/// Rates of the compared pixels, in spikes per readout. Slower pixels have too few intervals, and faster pixels have too few
/// readouts per interval.
pub(crate) const COMPARED_RATES: std::ops::Range<f64> = 0.05..0.45;

/// Smallest number of readouts of a recording. A choice.
pub(crate) const MIN_READOUTS: usize = 256;

/// Largest number of simulated pixels of a static scene. 20,000 pixels determine the temporal noise to 1 %.
pub(crate) const MAX_STATIC_PIXELS: usize = 20_000;

// Steps of a square wave

/// Number of readouts after a step from which the response serves as the steady reference. It is twice the largest time
/// constant with which image lag is tried (150), and the end of the last window after a step.
pub(crate) const STEADY_READOUTS: usize = 300;

/// Number of excluded readouts after a fall, because the first interval contains charge of the brighter light.
pub(crate) const SETTLED_READOUTS: usize = 20;

/// Shortest stretch whose response is measured, in readouts: at least 20 readouts are steady.
pub(crate) const MIN_STRETCH_READOUTS: usize = STEADY_READOUTS + 20;

/// Number of successive readouts on the other side of the middle that make a step. A choice.
pub(crate) const MIN_AGREEING_READOUTS: usize = 4;

/// Smallest difference between both lights in standard deviations of a Poisson count. Lights with a smaller difference
/// have no detectable steps. A choice.
pub(crate) const MIN_STEP_SDS: f64 = 6.0;

// Statistics

/// Smallest number of half periods across the map at which a wave belongs to the spectrum. Longer waves are uneven
/// light.
pub(crate) const MIN_WAVE_HALF_PERIODS: usize = 4;

/// Number of robust standard deviations from the median beyond which a pixel is an outlier. A choice.
pub(crate) const OUTLIER_SDS: f64 = 5.0;

/// Number of outliers at which their mean distance has half of its full weight. One or two outliers are insignificant.
/// A choice.
pub(crate) const OUTLIER_HALF_WEIGHT: f64 = 9.0;

/// Smallest light at which the firing rates of the pixels exceed the frequencies of lines. A choice.
pub(crate) const MIN_LINE_LIGHT: f64 = 0.2;

/// Windows after a step, in readouts.
pub(crate) const STEP_WINDOWS: [(usize, usize); 4] = [(2, 20), (20, 60), (60, 120), (120, 300)];

/// Highest frequency of a line, in cycles per readout. The firing rates of bright pixels are higher.
pub(crate) const MAX_LINE_FREQUENCY: f64 = 0.13;

/// Number of examined frequencies per frequency step of the spectrum. A choice.
pub(crate) const STEPS_PER_BIN: f64 = 10.0;

/// Number of frequencies on either side of a line whose mean power is its background. A choice.
pub(crate) const BACKGROUND_BINS: usize = 40;

/// Fewest periods of a line in a recording. A mean and a drift have fewer. A choice.
pub(crate) const MIN_PERIODS: f64 = 2.0;

// Lost and repeated readouts

/// Number of events from which on the effect is a candidate regardless of its signature. A choice.
pub(crate) const MIN_CERTAIN_EVENTS: usize = 3;

/// Largest number of events whose locations are listed. A choice.
pub(crate) const MAX_LISTED_EVENTS: usize = 4;

/// Shortest mean interval, in readouts, at which a missing spike is visible. The interval across a lost readout is
/// then `2 x 2.3 - 1 = 3.6`, above the longest regular interval of 3.
pub(crate) const MIN_MEAN_INTERVAL: f64 = 2.3;

/// Smallest length of an interval with a missing spike, in mean intervals. A choice.
pub(crate) const MIN_GAP_INTERVALS: f64 = 1.4;

/// Largest number of successive missing spikes. Two readouts at a distance of one mean interval cause two.
pub(crate) const MAX_MISSING_RUN: u32 = 2;

/// Smallest number of intervals that determine the mean interval of a pixel. A choice.
pub(crate) const MIN_INTERVALS: usize = 4;

/// Smallest expected number of spikes in a lost readout. With 30, the probability that fewer than [`MIN_FOUND_SHARE`]
/// of them are missing is below 1/500.
pub(crate) const MIN_EXPECTED_SPIKES: f64 = 30.0;

/// Smallest share of the expected spikes that are missing at a lost readout. A choice.
pub(crate) const MIN_FOUND_SHARE: f64 = 0.45;

/// Smallest number of missing spikes at a lost readout, relative to the windows beside it. A choice.
pub(crate) const MIN_SHARPNESS: f64 = 4.0;

/// Share of the expected spikes in the adjacent readouts above which another lost readout is assumed there. A choice.
pub(crate) const ADJACENT_SHARE: f64 = 0.15;

/// Smallest mean number of changed bits per readout at which equal readouts are distinguishable from chance. A choice.
pub(crate) const MIN_MEAN_CHANGES: f64 = 4.0;

/// Smallest number of pixels with an unusual repetition in a repeated readout. A single pixel may repeat by chance.
pub(crate) const MIN_UNUSUAL_PIXELS: usize = 2;

// Faults

/// Smallest number of lit levels for a report of a single level, and for a report of the scatter. A choice.
pub(crate) const MIN_LIT_LEVELS: [usize; 2] = [4, 3];

/// Smallest pattern correlation of two recordings of one sensor. A choice.
pub(crate) const MIN_OWN_CORRELATION: f64 = 0.5;

/// Largest pattern correlation of two sensors. A choice.
pub(crate) const MAX_FOREIGN_CORRELATION: f64 = 0.25;

/// Smallest change of a lamp relative to the largest change of steady recordings. An effect of the camera changes all
/// recordings. A choice.
pub(crate) const MIN_CHANGE_RATIO: f64 = 5.0;

/// Relative change between the halves below which a recording is steady. A choice.
pub(crate) const MAX_STEADY_CHANGE: f64 = 1e-3;

/// Smallest prominence of a line, which is its power divided by the mean power around it. One frequency in 1e17
/// exceeds it by chance (exp(-40)).
pub(crate) const MIN_PROMINENCE: f64 = 40.0;

/// Twice the mains frequencies, in hertz.
pub(crate) const MAINS_LIGHT_HZ: [f64; 2] = [100.0, 120.0];

/// Largest distance between two frequencies of a spectrum that distinguishes both of [`MAINS_LIGHT_HZ`], in hertz.
pub(crate) const MAINS_RESOLUTION_HZ: f64 = (MAINS_LIGHT_HZ[1] - MAINS_LIGHT_HZ[0]) / 2.0;

// Simulations of the base model

/// Sensors with the parameters of the base model. A choice.
pub(crate) const SENSORS: usize = 80;

/// Simulations of the first step.
///
/// Sensors: noise from 24 sensors judges a clean set as noise from 200 does. It finds an effect of eight standard
/// deviations at 7.9 (median of all candidates of the recommended protocol).
/// Lamps: the derivative by a lamp is a direction that costs nothing, so its noise removes one random direction of 250.
pub(crate) const FIRST_SENSORS: usize = 24;

/// Simulations of the derivatives by the lamps in the first step; see [`FIRST_SENSORS`].
pub(crate) const FIRST_LAMP_DRAWS: usize = 4;

/// Simulations of a signature: two show how much of it is noise. The first step makes one.
pub(crate) const SIGNATURE_DRAWS: usize = 2;

/// Simulations of a signature in the first step; see [`SIGNATURE_DRAWS`].
pub(crate) const FIRST_SIGNATURE_DRAWS: usize = 1;

/// Sensors of a complete null model whose parameters are drawn from their posterior. A choice.
pub(crate) const POSTERIOR_SENSORS: usize = 120;

/// Number of simulated readouts before the recording, during which pixels with a common start phase become
/// independent. A choice.
pub(crate) const LEAD_READOUTS: usize = 200;

// Limits of other effects, recommended recordings and the report

/// Quantile of the standard normal distribution at a probability of 95 %.
pub(crate) const NORMAL_QUANTILE_95: f64 = 1.645;

/// Length of a signature, in standard deviations, from which on one simulation determines it. The noise of a single
/// simulation was measured to be up to ten standard deviations long (24x24 pixels).
pub(crate) const MIN_CERTAIN_LENGTH: f64 = 15.0;

/// Exponent of the length of a signature as a function of the amplitude above which an effect counts as quadratic. Measured
/// exponents (24x24 pixels) of most effects are 0.5 to 1.12. Those of `telegraph_dark` and `readout_jitter`, whose variance
/// is proportional to the square of the amplitude, and of `false_spikes` are 1.24 to 1.52.
pub(crate) const MAX_LINEAR_EXPONENT: f64 = 1.2;

/// Smallest share of a tried variance, or of a tried probability of rare events, to which a limit is interpolated. Measured
/// with 20 hidden sensors at the interpolated limit: the estimate was zero for 11 with `row_noise` (1/36 of the tried
/// variance) and for 7 with `false_spikes` (two spikes are expected, and some sensors have none). It should be zero for one.
pub(crate) const MIN_INTERPOLATED_SHARE: f64 = 0.1;

/// Number of standard deviations between two fitted models at which they count as distinguished. A choice.
pub(crate) const DISTINCT_SDS: f64 = 5.0;

/// Largest recommended length of a recording, relative to the present one. A choice.
pub(crate) const MAX_LENGTH_FACTOR: f64 = 400.0;

/// Largest number of unexplained statistics that are listed. A choice.
pub(crate) const MAX_UNEXPLAINED_STATISTICS: usize = 6;

/// Number of statistics in the plot of the largest deviations. A choice.
pub(crate) const MAX_SHOWN_DEVIATIONS: usize = 24;

/// Number of standard deviations that some statistic of a sensor without missing effects exceeds with a probability of
/// 0.001.
pub(crate) const DEVIATION_LIMIT: f64 = 5.0;

/// Number of additional simulated sensors of the final model. At one frequency, another such sensor lies outside of
/// their range with a probability of 2 / (20 + 1).
pub(crate) const RANGE_SENSORS: usize = 20;
