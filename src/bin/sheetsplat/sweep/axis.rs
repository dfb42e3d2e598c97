//! Settings with several values.

/// A setting that takes several values in turn.
#[derive(Debug, PartialEq)]
pub(super) struct Axis {
    /// The index of its `--set`.
    pub(super) at: usize,
    pub(super) key: String,
    /// The values, as TOML or strings.
    pub(super) values: Vec<String>,
}

/// The settings that have several values.
pub(super) fn swept(sets: &[String]) -> Vec<Axis> {
    let axis = |(at, set): (usize, &String)| {
        let (key, values) = set.split_once('=')?;
        let values = split(values);
        (values.len() > 1).then(|| Axis { at, key: key.trim().to_owned(), values })
    };
    sets.iter().enumerate().filter_map(axis).collect()
}

/// Splits at commas outside brackets, braces and quotes.
fn split(text: &str) -> Vec<String> {
    let (mut depth, mut quote) = (0_usize, None);
    let mut escaped = false;
    text.split(|character: char| {
        match (quote, character) {
            _ if escaped => escaped = false,
            (Some('"'), '\\') => escaped = true,
            (Some(open), _) if open == character => quote = None,
            (None, '"' | '\'') => quote = Some(character),
            (None, '[' | '{') => depth += 1,
            (None, ']' | '}') => depth = depth.saturating_sub(1),
            (None, ',') => return depth == 0,
            _ => {}
        }
        false
    })
    .map(|value| value.trim().to_owned())
    .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn commas_separate_values_but_not_within_one() {
        assert_eq!(split("0.5,1, 2"), ["0.5", "1", "2"]);
        assert_eq!(split("linear"), ["linear"]);
        assert_eq!(split("[1,0,0],[0,1,0]"), ["[1,0,0]", "[0,1,0]"]);
        assert_eq!(split("[[1,2],[3,4]],{a=1,b=[2,3]}"), ["[[1,2],[3,4]]", "{a=1,b=[2,3]}"]);
        assert_eq!(split(r#""a,b",'c",d',"e\",f""#), [r#""a,b""#, r#"'c",d'"#, r#""e\",f""#]);
        assert_eq!(split("1,,2,"), ["1", "", "2", ""]);
        assert_eq!(split("],1"), ["]", "1"]);
    }

    #[test]
    fn what_has_one_value_is_not_swept() {
        let sets = ["a=1", "b = 2,3", "c"].map(str::to_owned);
        let axis = Axis { at: 1, key: "b".to_owned(), values: vec!["2".to_owned(), "3".to_owned()] };
        assert_eq!(swept(&sets), [axis]);
    }
}
