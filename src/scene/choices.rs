//! The values of a random number, dealt to what is chosen by it.

/// Values that a random choice can take.
pub(crate) const CHOICES: u32 = 1 << 24;

/// By shares of a sum of 1, at least one to each, so that the probability that a kernel divides by is the one with which it chose.
pub(crate) fn deal(shares: &[f64]) -> Vec<u32> {
    if shares.is_empty() {
        return Vec::new();
    }
    let free = f64::from(CHOICES - shares.len() as u32);
    let mut dealt = 0u32;
    let mut sum = 0.0;
    let of_share = |share: &f64| {
        sum += share;
        let until = (sum * free).round().min(free) as u32;
        let own = until.saturating_sub(dealt);
        dealt += own;
        own + 1
    };
    let mut choices: Vec<u32> = shares.iter().map(of_share).collect();
    // What rounding of the shares' sum left over.
    *choices.last_mut().expect("there is a share") += free as u32 - dealt;
    choices
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn choices_follow_the_shares_and_leave_none_out() {
        let mut shares = vec![1e-12; 1000];
        shares.push(0.25);
        shares.push(0.75 - 1e-9);
        let dealt = deal(&shares);
        assert_eq!(dealt.iter().map(|choices| u64::from(*choices)).sum::<u64>(), u64::from(CHOICES));
        assert!(dealt.iter().all(|choices| *choices >= 1));
        assert!((f64::from(dealt[1000]) / f64::from(CHOICES) - 0.25).abs() < 1e-4);
        assert!(deal(&[]).is_empty());
        assert_eq!(deal(&[1.0]), [CHOICES]);
    }
}
