//! Round numbers: 1, 2 and 5 times powers of ten.

/// The exponent of the largest power of ten up to a number above 0.
fn exponent(number: f64) -> i32 {
    // The logarithm of a power of ten may be off by a rounding error.
    (libm::log10(number) + 1e-12).floor() as i32
}

/// The largest round number up to a number above 0.
pub(super) fn round_down(number: f64) -> f64 {
    let power = 10_f64.powi(exponent(number));
    let fits = |round: &f64| *round <= number * (1.0 + 1e-12);
    [5.0, 2.0].map(|digit| digit * power).into_iter().find(fits).unwrap_or(power)
}

/// The smallest round number not below a number above 0.
fn round_up(number: f64) -> f64 {
    let power = 10_f64.powi(exponent(number));
    let fits = |round: &f64| *round >= number * (1.0 - 1e-12);
    [1.0, 2.0, 5.0].map(|digit| digit * power).into_iter().find(fits).unwrap_or(10.0 * power)
}

/// The multiples of a round step within a range, at least `apart` from one another, with their text; the range's lower end if no
/// multiple fits.
pub(super) fn ticks([lo, hi]: [f64; 2], apart: f64) -> Vec<(f64, String)> {
    let step = if apart > 0.0 { round_up(apart) } else { 1.0 };
    let (first, last) = ((lo / step).ceil(), (hi / step).floor());
    if first > last || lo == hi {
        return vec![(lo, format!("{lo}"))];
    }
    let multiples = (0..=(last - first) as u32).map(|at| (first + f64::from(at)) * step);
    multiples.map(|value| (value, written(value, step))).collect()
}

/// The text of a multiple of a round step, with as many digits as the step needs.
pub(super) fn written(number: f64, step: f64) -> String {
    if number == 0.0 {
        return "0".to_owned();
    }
    let digits = -exponent(step);
    if number.abs() >= 1e6 || digits > 4 {
        let digits = (exponent(number.abs()) + digits).clamp(0, 15) as usize;
        return format!("{number:.digits$e}");
    }
    let digits = digits.max(0) as usize;
    format!("{number:.digits$}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn round_numbers_are_the_nearest_ones() {
        for (number, down, up) in [
            (1.0, 1.0, 1.0),
            (0.001, 0.001, 0.001),
            (1e-7, 1e-7, 1e-7),
            (1000.0, 1000.0, 1000.0),
            (0.3, 0.2, 0.5),
            (4.9, 2.0, 5.0),
            (5.1, 5.0, 10.0),
            (77.0, 50.0, 100.0),
        ] {
            let is_near = |a: f64, b: f64| (a / b - 1.0).abs() < 1e-9;
            assert!(is_near(round_down(number), down) && is_near(round_up(number), up), "{number}");
        }
    }

    fn texts(range: [f64; 2], apart: f64) -> Vec<String> {
        ticks(range, apart).into_iter().map(|(_, text)| text).collect()
    }

    #[test]
    fn ticks_are_multiples_of_a_round_step() {
        assert_eq!(texts([3.0, 21.0], 4.0), ["5", "10", "15", "20"]);
        assert_eq!(texts([-1000.0, 1000.0], 400.0), ["-1000", "-500", "0", "500", "1000"]);
        assert_eq!(texts([-0.05, 0.31], 0.09), ["0", "0.1", "0.2", "0.3"]);
        assert_eq!(texts([0.0, 5e-6], 1.1e-6), ["0", "2e-6", "4e-6"]);
        assert_eq!(texts([1.1e6, 1.32e6], 5e4), ["1.10e6", "1.15e6", "1.20e6", "1.25e6", "1.30e6"]);
        for (value, text) in ticks([0.0, 0.31], 0.09) {
            assert!((text.parse::<f64>().unwrap_or(f64::NAN) - value).abs() < 1e-12);
        }
    }

    #[test]
    fn a_range_without_room_has_its_lower_end() {
        assert_eq!(texts([7.5, 7.5], 0.0), ["7.5"]);
        assert_eq!(texts([7.1, 7.2], 3.0), ["7.1"]);
    }
}
