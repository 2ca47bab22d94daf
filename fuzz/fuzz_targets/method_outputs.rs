//! Uses any bytes as the output of a method. The first byte selects the task. The scores must be finite, and a fault is
//! one line of text.
#![no_main]

use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;
use spikelane_benchmark::generated::GeneratedSuite;
use spikelane_benchmark::score::evaluate_output;
use spikelane_fuzz::generate_suite;

static TASKS: LazyLock<[GeneratedSuite; 5]> = LazyLock::new(|| {
    [
        ("tracking", r#"["hota/1", "det_a/1", "ass_a/1", "loc_a/1"]"#),
        ("detection", r#"["ap/1", "ap_50/1", "ar_100/1"]"#),
        ("reconstruction", r#"["psnr/1", "ssim/1", "detail_slope/1", "noise_chen/1"]"#),
        ("flow", r#"["flow_epe/1"]"#),
        ("depth", r#"["depth_abs_rel/1"]"#),
    ]
    .map(|(task, metrics)| generate_suite(&format!("outputs-{task}"), task, metrics))
});

// The generation takes longer than an input may take.
fuzz_target!(init: { LazyLock::force(&TASKS); }, |data: &[u8]| {
    let Some((which, bytes)) = data.split_first() else { return };
    let suite = &TASKS[usize::from(*which) % TASKS.len()];
    let (group, sequence) = suite.scored().next().expect("a sequence");
    let evaluation = evaluate_output(suite, group, sequence, Some(bytes), None).expect("intact references");
    assert!(evaluation.scores.values().all(|score| score.is_finite()), "{:?}", evaluation.scores);
    if let Some(fault) = evaluation.fault {
        assert!(!fault.is_empty() && !fault.contains(['\n', '\r']), "{fault:?}");
    }
});
