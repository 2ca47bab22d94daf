//! A part of the study of `calibrate` in random laboratories: what is said there is right, or nothing is said.

mod calibrate_support;
#[path = "../study/labs/judge.rs"]
#[allow(dead_code, reason = "the study makes tables of it")]
mod judge;
#[path = "../study/labs/lab.rs"]
#[allow(dead_code, reason = "the study makes tables of it")]
mod lab;

use judge::{Verdict, judge};
use lab::Lab;
use rayon::prelude::*;

/// One laboratory or two of each kind. A wrong value lies five of its errors from the truth: of some 300 values with normal errors
/// chance puts none there in 99.98 % of all suites.
#[test]
fn what_is_said_of_a_random_laboratory_is_right_or_nothing_is_said() {
    (0..20_u64).into_par_iter().for_each(|index| {
        let lab = Lab::new(index);
        let verdict = judge(&lab);
        let wrong: Vec<_> = verdict.wrong().iter().map(|c| (judge::QUANTITIES[c.quantity], c.z)).collect();
        assert!(wrong.is_empty(), "laboratory {index}, {}: {wrong:?}", lab.fault);
        if let Verdict::Refused(why) = verdict {
            panic!("laboratory {index}, {}: {why}", lab.fault);
        }
    });
}
