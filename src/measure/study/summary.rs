//! Three sentences for whoever has a minute: what an error costs, what to change first, and what not to trust.

use super::findings::{Effect, between, common_error, named, ratio};
use super::point::Curve;
use super::{Part, Study};
use crate::measure::interval::CONFIDENCE;
use crate::output::words::{duration, times};
use crate::text::percent;

pub fn sentences(study: &Study, part: &Part) -> [String; 3] {
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
    let told: Vec<String> = match points.as_slice() {
        [] => {
            return format!(
                "On {device}, {how}, every error measured is below {}, the least that can be judged here.",
                percent(part.least_error)
            );
        }
        [first, .., last] => vec![reach(first), reach(last)],
        [only] => vec![reach(only)],
    };
    let halving = match points.as_slice() {
        [first, .., last] if last.1 < 0.8 * first.1 => {
            let power = (last.0 / first.0).ln() / (first.1 / last.1).ln();
            format!(" Half the error takes about {} the time.", times(2f64.powf(power)))
        }
        _ => String::new(),
    };
    format!("On {device}, {how}, {}.{halving}", told.join(", and "))
}

fn first_change(part: &Part) -> String {
    let best = part.best_choice();
    if let Some(default) = part.default.as_ref().filter(|default| default.points.len() > 1) {
        // At the smallest error that both reach.
        let against = best.map_or_else(
            || part.base().map(|base| ("the base settings".to_owned(), base)),
            |(axis, curve)| Some((named(axis, &curve.label), curve)),
        );
        let compared = against.and_then(|(name, curve)| {
            let error = common_error(default, curve, part.least_error)?;
            Some((name, error, curve.times_longer(default, error, CONFIDENCE)?))
        });
        return match compared {
            Some((name, error, longer)) if longer.low > 1.0 => format!(
                "Leave the settings alone: to {} the best single change that was tried ({name}) takes {} as long as the defaults ({}).",
                percent(error),
                ratio(longer.value),
                between(longer, ratio)
            ),
            Some((name, error, longer)) if longer.high < 1.0 => format!(
                "Change this first: {name}. It reaches {} in {} of the defaults' time ({}).",
                percent(error),
                ratio(longer.value),
                between(longer, ratio)
            ),
            Some((name, error, longer)) => format!(
                "To {} the defaults and the best single change that was tried ({name}, {} of their time, {}) could not be told apart.",
                percent(error),
                ratio(longer.value),
                between(longer, ratio)
            ),
            None => "The defaults and the other choices reached no error in common within this budget, so this study cannot tell which is faster."
                .to_owned(),
        };
    }
    match best {
        Some((axis, curve)) => {
            let choices = part.choices();
            let of = choices.iter().find(|choice| choice.axis == axis && choice.curve.label == curve.label);
            match of.map(|choice| choice.effect) {
                Some(Effect::Differs(error, longer)) => format!(
                    "Change this first: {}. It reaches {} in {} of the time ({}).",
                    named(axis, &curve.label),
                    percent(error),
                    ratio(longer.value),
                    between(longer, ratio)
                ),
                Some(Effect::Apart([own, base])) => format!(
                    "Change this first: {}. It reaches {} in {}, where the base has {} after {}.",
                    named(axis, &curve.label),
                    percent(own.0),
                    duration(own.1),
                    percent(base.0),
                    duration(base.1)
                ),
                _ => String::new(),
            }
        }
        None => "No single change that was tried is significantly faster than the base settings.".to_owned(),
    }
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
