//! Signatures of oscillating light at the frequency of the recorded oscillation.

use crate::null_model::model::NullModel;
use crate::null_model::signature::Signature;
use crate::sensors::catalog::Candidate;
use crate::statistics::measured_set::MeasuredSet;
use crate::statistics::spectrum::{line, power, refine_line};
use crate::thresholds::{MIN_LINE_LIGHT, MIN_LINE_POWER};
use spikelane::effects::Definition;
use spikelane::error::Result;

/// Returns the signatures of the null model. Those of oscillating light are computed again at the frequency of the
/// strongest line in the spikes per readout.
///
/// If all recordings show static scenes, oscillating light is not a candidate. The statistics of static scenes do
/// not contain the spikes per readout, because these depend on the scene. An oscillation would then only replace
/// other noise. A line in the spikes per readout is reported as a fault of the light instead.
pub(crate) fn with_line(reference: &NullModel, measured: &MeasuredSet) -> Result<Vec<Signature>> {
    let (setup, mut signatures) = (&reference.setup, reference.signatures.clone());
    if setup.only_still() {
        signatures.retain(|s| line_of(s.candidate.effect).is_none());
        return Ok(signatures);
    }
    let mut best = (0.0, MIN_LINE_POWER);
    let mut bright: Vec<&[u32]> = Vec::new();
    for (scene, scan) in setup.recordings.iter().zip(&measured.scans) {
        if scene.is_constant() && scene.brightness() >= MIN_LINE_LIGHT {
            let found = line(&power(&scan.totals), scan.totals.len());
            best = if found.1 > best.1 { found } else { best };
            bright.push(&scan.totals);
        }
    }
    if best.0 == 0.0 {
        return Ok(signatures);
    }
    let frequency = refine_line(&bright, best.0);
    // The null model has signatures at several frequencies for the detectability. One signature at the frequency of
    // the line replaces them.
    let mut kept: Vec<&Definition> = Vec::new();
    signatures.retain(|s| {
        let (effect, again) = (s.candidate.effect, kept.contains(&s.candidate.effect));
        kept.push(effect);
        line_of(effect).is_none() || !again
    });
    for signature in &mut signatures {
        let Some(line) = line_of(signature.candidate.effect) else { continue };
        let mut candidate: Candidate = signature.candidate.clone();
        for (knob, at) in candidate.knobs.iter_mut().zip(&mut candidate.at) {
            if knob.key == line {
                knob.center = frequency * setup.readout_hz;
                // The refined frequency is uncertain by about 0.3 of the frequency step of the spectrum.
                let bin = 0.3 / (frequency * setup.recordings[0].readouts as f64);
                knob.range = (knob.center * (1.0 - bin), knob.center * (1.0 + bin));
                *at = 0.0;
            }
        }
        *signature = reference.signature(candidate)?;
    }
    Ok(signatures)
}

/// Returns the key of the frequency parameter of an effect, or `None` if the effect has no frequency.
fn line_of(effect: &Definition) -> Option<&'static str> {
    effect.searched_params().find(|(_, tried)| tried.is_frequency).map(|(param, _)| param.key)
}
