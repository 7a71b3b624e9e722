//! Axes: positions of data, and tick marks.

use super::plane::Range;

/// An axis. On a logarithmic one coordinates are logarithms to base 10.
#[derive(Debug, Clone, Copy)]
pub(super) struct Axis {
    pub(super) range: Range,
    pub(super) logarithmic: bool,
    /// Pixels of the lower and the upper bound.
    pub(super) ends: (f64, f64),
}

impl Axis {
    /// The pixel of a coordinate (a logarithm on a logarithmic axis).
    pub(super) fn pixel(&self, coordinate: f64) -> f64 {
        let (lower, upper) = self.range;
        let share = (coordinate - lower) / (upper - lower);
        self.ends.0 + share * (self.ends.1 - self.ends.0)
    }

    /// Coordinates and labels of tick marks, about one for `every` so many pixels.
    pub(super) fn ticks(&self, every: f64) -> Vec<(f64, String)> {
        let room = (self.ends.1 - self.ends.0).abs();
        let most = (room / every).floor().clamp(4.0, 20.0);
        let (lower, upper) = self.range;
        if !self.logarithmic {
            return linear(lower, upper, most);
        }
        if upper - lower < 1.5 {
            return within_decades(lower, upper);
        }
        let stride = ((upper - lower) / most).ceil().max(1.0);
        multiples(lower, upper, stride)
            .map(|k| (k * stride, power(k * stride)))
            .collect()
    }
}

fn multiples(lower: f64, upper: f64, step: f64) -> impl Iterator<Item = f64> {
    let (first, last) = ((lower / step).ceil(), (upper / step).floor());
    (0..=(last - first).clamp(-1.0, 100.0) as i64).map(move |k| first + k as f64)
}

/// 1, 2 or 5 times a power of ten that divides a range into at most so many parts.
fn nice_step(span: f64, most: f64) -> f64 {
    let least = span / most;
    let decade = 10.0_f64.powf(least.log10().floor());
    let factor = [1.0, 2.0, 5.0, 10.0]
        .into_iter()
        .find(|f| f * decade >= least * (1.0 - 1e-9));
    factor.unwrap_or(10.0) * decade
}

fn linear(lower: f64, upper: f64, most: f64) -> Vec<(f64, String)> {
    let step = nice_step(upper - lower, most);
    let largest = lower.abs().max(upper.abs());
    let exponent = largest.log10().floor();
    let tick = |k: f64| {
        let value = k * step;
        let label = if k == 0.0 {
            "0".into()
        } else if (-3.0..5.0).contains(&exponent) {
            decimal(value, step)
        } else {
            let unit = 10.0_f64.powf(exponent);
            format!("{}×{}", decimal(value / unit, step / unit), power(exponent))
        };
        (value, label)
    };
    multiples(lower, upper, step).map(tick).collect()
}

/// With as many decimals as the step between ticks has.
fn decimal(value: f64, step: f64) -> String {
    let decimals = (-(step * (1.0 + 1e-9)).log10().floor()).clamp(0.0, 15.0) as usize;
    format!("{value:.decimals$}").replace('-', "−")
}

fn power(exponent: f64) -> String {
    format!("10^{{{}}}", decimal(exponent, 1.0))
}

/// 1, 2 and 5 times powers of ten; in a short range all multiples of a power.
fn within_decades(lower: f64, upper: f64) -> Vec<(f64, String)> {
    let mut ticks = Vec::new();
    for decade in multiples(lower.floor(), upper.ceil(), 1.0) {
        for factor in (1..10)
            .filter(|f| upper - lower < 0.8 || [1, 2, 5].contains(f))
            .map(f64::from)
        {
            let at = decade + factor.log10();
            if (lower..=upper).contains(&at) {
                let label = match (-3.0..5.0).contains(&decade) {
                    true => decimal(factor * 10.0_f64.powf(decade), 10.0_f64.powf(decade)),
                    false => format!("{factor}×{}", power(decade)),
                };
                ticks.push((at, label));
            }
        }
    }
    ticks
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(range: Range, logarithmic: bool) -> Vec<String> {
        let axis = Axis {
            range,
            logarithmic,
            ends: (0.0, 500.0),
        };
        let ticks = axis.ticks(80.0);
        assert!((2..=21).contains(&ticks.len()), "{range:?} {ticks:?}");
        let room = 1e-9 * (range.1 - range.0);
        assert!(
            ticks
                .iter()
                .all(|t| t.0 >= range.0 - room && t.0 <= range.1 + room),
            "{range:?} {ticks:?}"
        );
        ticks.into_iter().map(|t| t.1).collect()
    }

    #[test]
    fn ticks_are_short_numbers() {
        assert_eq!(
            labels((-0.06, 1.06), false),
            ["0", "0.2", "0.4", "0.6", "0.8", "1.0"]
        );
        assert_eq!(labels((-5.0, 5.0), false), ["−4", "−2", "0", "2", "4"]);
        assert_eq!(labels((0.0, 3e7), false)[1], "0.5×10^{7}");
        assert_eq!(labels((1e-9, 4e-9), false)[0], "1.0×10^{−9}");
        assert_eq!(
            labels((0.0, 5.9), true),
            ["10^{0}", "10^{1}", "10^{2}", "10^{3}", "10^{4}", "10^{5}"]
        );
        assert_eq!(
            labels((-12.0, 3.0), true),
            ["10^{−12}", "10^{−9}", "10^{−6}", "10^{−3}", "10^{0}", "10^{3}"]
        );
        assert_eq!(labels((0.9, 1.8), true), ["10", "20", "50"]);
        assert_eq!(labels((-0.5, 0.5), true), ["0.5", "1", "2"]);
    }

    /// k + 0.3 − k, whose rounding depends on k, in three steps.
    #[test]
    fn steps_do_not_depend_on_the_rounding_of_differences() {
        for k in 0..200 {
            let k = f64::from(k);
            assert!((nice_step(k + 0.3 - k, 3.0) - 0.1).abs() < 1e-15, "{k}");
        }
    }

    #[test]
    fn every_range_has_ticks() {
        for k in -90..90 {
            let unit = 10.0_f64.powi(k);
            for (a, b) in [(0.0, 1.0), (-3.3, 7.1), (0.999, 1.001), (-1.0, -0.9999)] {
                labels((a * unit, b * unit), false);
            }
        }
    }

    #[test]
    fn bounds_stand_at_the_ends() {
        let axis = Axis {
            range: (2.0, 4.0),
            logarithmic: false,
            ends: (300.0, 100.0),
        };
        assert_eq!(
            [axis.pixel(2.0), axis.pixel(3.0), axis.pixel(4.0)],
            [300.0, 200.0, 100.0]
        );
    }
}
