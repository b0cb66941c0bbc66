//! Three sentences for whoever has a minute: what an error costs, what to change first, and what not to trust.

use super::findings::{Effect, between, common_error, ratio};
use super::point::Curve;
use super::{Part, Study};
use crate::measure::interval::CONFIDENCE;
use crate::output::words::{duration, times};
use crate::text::percent;

pub(crate) fn sentences(study: &Study, part: &Part) -> [String; 3] {
    [cost(study, part), first_change(part), doubts(part)]
}

/// The curve that a user meets: default settings, else the base.
fn usual(part: &Part) -> Option<(&Curve, &'static str)> {
    let default = part.default.as_ref().filter(|default| !default.points.is_empty());
    default.map(|default| (default, "with default settings")).or_else(|| part.base().map(|base| (base, "with the base settings")))
}

fn cost(study: &Study, part: &Part) -> String {
    let device = &study.device;
    let Some((curve, how)) = usual(part) else { return format!("Nothing was measured on {device}.") };
    let mut points: Vec<(f64, f64)> = curve.points.iter().map(|point| (point.ms().value, point.error().value)).collect();
    points.retain(|point| point.1 >= part.least_error);
    points.dedup_by(|next, before| next.1 >= before.1);
    let reach = |&(ms, error): &(f64, f64)| format!("an error of {} takes {}", percent(error), duration(ms));
    let phrases = match points.as_slice() {
        [] => format!("every error measured is below {}, the least that can be judged here.", percent(part.least_error)),
        [only] => format!("{}.", reach(only)),
        [first, .., last] => {
            let power = (last.0 / first.0).ln() / (first.1 / last.1).ln();
            let halving = format!(" Half the error takes about {} the time.", times(2f64.powf(power)));
            format!("{}, and {}.{}", reach(first), reach(last), if last.1 < 0.8 * first.1 { &halving } else { "" })
        }
    };
    format!("On {device}, {how}, {phrases}")
}

fn first_change(part: &Part) -> String {
    let best = part.best_choice();
    if let Some(default) = part.default.as_ref().filter(|default| default.points.len() > 1) {
        // At the smallest error that both reach.
        let against = best
            .map_or_else(|| part.base().map(|base| ("the base settings".to_owned(), base)), |choice| Some((choice.name(), choice.curve)));
        let compared = against.and_then(|(name, curve)| {
            let error = common_error(default, curve, part.least_error)?;
            Some((name, percent(error), curve.times_longer(default, error, CONFIDENCE)?))
        });
        let Some((name, error, longer)) = compared else {
            return "The defaults and the other choices reached no error in common within this budget, so this study cannot tell which is faster."
                .to_owned();
        };
        let (share, interval) = (ratio(longer.value), between(longer, ratio));
        return if longer.low > 1.0 {
            format!(
                "Leave the settings alone: to {error} the best single change that was tried ({name}) takes {share} as long as the defaults ({interval})."
            )
        } else if longer.high < 1.0 {
            format!("Change this first: {name}. It reaches {error} in {share} of the defaults' time ({interval}).")
        } else {
            format!(
                "To {error} the defaults and the best single change that was tried ({name}, {share} of their time, {interval}) could not be told apart."
            )
        };
    }
    let Some(choice) = best else { return "No single change that was tried is significantly faster than the base settings.".to_owned() };
    let reached = match choice.effect {
        Effect::Differs(error, longer) => {
            format!("{} in {} of the time ({})", percent(error), ratio(longer.value), between(longer, ratio))
        }
        Effect::Apart([(own, own_ms), (base, base_ms)]) => {
            let [own, base] = [own, base].map(percent);
            format!("{own} in {}, where the base has {base} after {}", duration(own_ms), duration(base_ms))
        }
        Effect::Undecided(..) | Effect::SinglePoint => return String::new(),
    };
    format!("Change this first: {}. It reaches {reached}.", choice.name())
}

fn doubts(part: &Part) -> String {
    let least = part.least_error;
    let of_reference = if least > 0.0 {
        format!("Do not trust errors below {}: the reference has an error of {} itself", percent(least), percent(part.reference_error))
    } else {
        "The reference is exact".to_owned()
    };
    let undecided = part.choices().iter().filter(|choice| matches!(choice.effect, Effect::Undecided(..))).count();
    let of_noise = match undecided {
        0 => String::new(),
        1 => "; one choice below, in grey, could not be told from noise".to_owned(),
        many => format!("; {many} choices below, in grey, could not be told from noise"),
    };
    let bias = part.base().and_then(|base| base.points.last()).map(super::point::Point::bias);
    let of_bias = match bias {
        Some(bias) if bias.low > least => {
            format!("; the base keeps a bias of {} however long it runs", percent(bias.value))
        }
        _ => String::new(),
    };
    format!("{of_reference}{of_noise}{of_bias}.")
}
