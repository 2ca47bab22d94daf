//! Numbers as they are said.

/// `value` to a tenth or less of how uncertain it is: two digits of half its interval.
pub(super) fn rounded(value: f64, low: f64, high: f64) -> String {
    let half = (high - low) / 2.0;
    let decimals = if half > 0.0 { (1.0 - half.log10().floor()).clamp(0.0, 7.0) as usize } else { 5 };
    format!("{value:.decimals$}")
}

pub(super) fn interval(low: f64, high: f64) -> String {
    format!("{} to {}", rounded(low, low, high), rounded(high, low, high))
}

#[cfg(test)]
mod tests {
    use super::{interval, rounded};

    #[test]
    fn numbers_are_shown_as_far_as_they_are_known() {
        assert_eq!(rounded(0.00744, 0.003_42, 0.011_46), "0.0074");
        assert_eq!(interval(0.003_42, 0.011_46), "0.0034 to 0.0115");
        assert_eq!(interval(6.574_67, 9.950_68), "6.6 to 10.0");
        assert_eq!(rounded(2480.0, 2100.0, 2900.0), "2480");
        assert_eq!(rounded(0.5, 0.5, 0.5), "0.50000", "known exactly");
    }
}
