//! A key that a sweep varies, and its values: `KEY=1e5:1e7:log5`, `KEY=0:1:lin3` or `KEY=a,b,c`.

use std::str::FromStr;

/// Largest number of points of a sweep: each has a directory, and its scene is held in memory.
pub(crate) const MOST_POINTS: usize = 100_000;

/// A key with its values, in the form of `--over`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Axis {
    /// The key, in the form of `--set`.
    pub key: String,
    /// Values, in the form of `--set`.
    pub values: Vec<String>,
}

/// Error in the text of an axis.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum AxisError {
    /// There is no key or no value.
    #[error("write it as KEY=FROM:TO:log5, KEY=FROM:TO:lin5 or KEY=VALUE,VALUE,…")]
    Form,
    /// A range that cannot be divided.
    #[error("{0}")]
    Range(&'static str),
}

impl FromStr for Axis {
    type Err = AxisError;

    fn from_str(text: &str) -> Result<Self, AxisError> {
        let (key, values) = text.split_once('=').ok_or(AxisError::Form)?;
        let (key, values) = (key.trim(), values.trim());
        if key.is_empty() || values.is_empty() {
            return Err(AxisError::Form);
        }
        let values = match range(values)? {
            Some(values) => values,
            None => list(values),
        };
        if values.iter().any(String::is_empty) {
            return Err(AxisError::Form);
        }
        Ok(Self { key: key.to_owned(), values })
    }
}

/// Parses `FROM:TO:logN` or `FROM:TO:linN`; returns `None` if the text is not a range.
fn range(text: &str) -> Result<Option<Vec<String>>, AxisError> {
    let &[from, to, rule] = text.split(':').collect::<Vec<_>>().as_slice() else { return Ok(None) };
    let (Ok(low), Ok(high)) = (from.trim().parse::<f64>(), to.trim().parse::<f64>()) else { return Ok(None) };
    let (is_log, count) = match (rule.strip_prefix("log"), rule.strip_prefix("lin")) {
        (Some(count), _) => (true, count),
        (_, Some(count)) => (false, count),
        _ => return Err(AxisError::Range("a range ends with log or lin and a count, e.g. 1e5:1e7:log5")),
    };
    let Some(count) = count.parse::<u32>().ok().filter(|&count| (2..=MOST_POINTS as u32).contains(&count))
    else {
        return Err(AxisError::Range("a range has 2 to 100000 values, e.g. 1e5:1e7:log5"));
    };
    if !(low.is_finite() && high.is_finite()) || (is_log && !(low > 0.0 && high > 0.0)) {
        return Err(AxisError::Range("the ends of a range are finite, and positive where it is logarithmic"));
    }
    let value = |k: u32| match f64::from(k) / f64::from(count - 1) {
        0.0 => low,
        1.0 => high,
        share if is_log => low * (high / low).powf(share),
        share => low + share * (high - low),
    };
    let values: Vec<f64> = (0..count).map(value).collect();
    // Integer ranges keep integer values.
    let is_whole = |text: &str| text.trim().parse::<i64>().is_ok();
    let are_whole = is_whole(from) && is_whole(to) && values.iter().all(|value| value.fract() == 0.0);
    let text = |value: &f64| if are_whole { format!("{value}") } else { format!("{value:?}") };
    Ok(Some(values.iter().map(text).collect()))
}

/// Splits a list at commas outside brackets and quotes.
fn list(text: &str) -> Vec<String> {
    let (mut parts, mut depth, mut is_quoted) = (vec![String::new()], 0_i32, false);
    for letter in text.chars() {
        match letter {
            '"' => is_quoted = !is_quoted,
            '[' | '{' if !is_quoted => depth += 1,
            ']' | '}' if !is_quoted => depth -= 1,
            ',' if !is_quoted && depth == 0 => {
                parts.push(String::new());
                continue;
            }
            _ => {}
        }
        if let Some(part) = parts.last_mut() {
            part.push(letter);
        }
    }
    parts.into_iter().map(|part| part.trim().to_owned()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn values(text: &str) -> Vec<String> {
        text.parse::<Axis>().unwrap().values
    }

    #[test]
    fn ranges_have_their_ends_and_even_ratios_or_differences() {
        let found: Vec<f64> = values("a=1e5:1e7:log5").iter().map(|value| value.parse().unwrap()).collect();
        assert_eq!((found.len(), found[0], found[4]), (5, 1e5, 1e7));
        assert!(found.windows(2).all(|pair| (pair[1] / pair[0] / 10.0_f64.sqrt() - 1.0).abs() < 1e-14));
        assert_eq!(values("a=0:3:lin4"), ["0", "1", "2", "3"]);
        assert_eq!(values("a=0:1:lin3"), ["0.0", "0.5", "1.0"]);
        assert_eq!(values("a=0.0:2:lin3"), ["0.0", "1.0", "2.0"]);
    }

    #[test]
    fn lists_keep_what_brackets_and_quotes_enclose() {
        assert_eq!(values("a=1e-3, 5e-4"), ["1e-3", "5e-4"]);
        assert_eq!(values("a=[1,1,2],[2,2,4]"), ["[1,1,2]", "[2,2,4]"]);
        assert_eq!(values("a=\"x,y\",z"), ["\"x,y\"", "z"]);
    }

    #[test]
    fn what_is_no_axis_is_refused() {
        for text in ["", "a", "a=", "=1", "a=1,,2", "a=1:2:log1", "a=1:2:5", "a=0:1:log3", "a=1:inf:lin3"] {
            assert!(text.parse::<Axis>().is_err(), "{text}");
        }
    }
}
