//! Thresholds of the search for effects and of the verdict, each with its origin.
//!
//! A threshold is *derived* from a probability or a number of standard deviations, *measured* on simulated sensors, or *a
//! choice*. The limits of an alarm are in `null_model/limits.rs`.

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
