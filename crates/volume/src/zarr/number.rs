//! The types of numbers, and the values that stand for numbers which a store does not hold.

use serde_json::Value;

use super::super::sample_type::SampleType;

/// A type of numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Number {
    Bool,
    Sample(SampleType),
}

impl Number {
    pub(super) fn names() -> String {
        SampleType::NAMED.map(|(name, _)| name).join(", ") + ", bool"
    }

    pub(super) fn named(name: &str) -> Option<Self> {
        let sample = || SampleType::NAMED.into_iter().find(|(known, _)| *known == name);
        match name {
            "bool" => Some(Self::Bool),
            _ => sample().map(|(_, kind)| Self::Sample(kind)),
        }
    }

    /// The type of version 2 that NumPy writes as `<u2`, and whether its numbers are big-endian.
    pub(super) fn of_dtype(text: &str) -> Option<(Self, bool)> {
        let &[order, letter, digit @ (b'1' | b'2' | b'4' | b'8')] = text.as_bytes() else { return None };
        if !(if digit == b'1' { &b"|"[..] } else { b"<>" }).contains(&order) {
            return None;
        }
        let bits = 8 * (digit - b'0');
        let number = match letter {
            b'b' if digit == b'1' => Some(Self::Bool),
            b'i' => Self::named(&format!("int{bits}")),
            b'u' => Self::named(&format!("uint{bits}")),
            b'f' => Self::named(&format!("float{bits}")),
            _ => None,
        };
        Some((number?, order == b'>'))
    }

    /// The type of the numbers as they are read.
    pub(super) fn kind(self) -> SampleType {
        match self {
            Self::Bool => SampleType::U8,
            Self::Sample(kind) => kind,
        }
    }

    /// The fill values that are allowed, for errors.
    pub(super) fn fills(self) -> String {
        match self {
            Self::Bool => "true or false".to_owned(),
            Self::Sample(SampleType::F16 | SampleType::F32 | SampleType::F64) => {
                "a number, NaN, Infinity, -Infinity, or 0x and the digits of all bits".to_owned()
            }
            Self::Sample(kind) => format!("a whole number of the type {kind}"),
        }
    }

    /// The bytes of a fill value.
    pub(super) fn fill(self, value: &Value) -> Option<Vec<u8>> {
        match value {
            Value::Bool(truth) if self == Self::Bool => Some(vec![u8::from(*truth)]),
            Value::Number(number) if self != Self::Bool => self.parse(&number.to_string()),
            Value::String(text) => match text.as_str() {
                "NaN" => self.parse("NaN"),
                "Infinity" => self.parse("inf"),
                "-Infinity" => self.parse("-inf"),
                _ => self.bits(text.strip_prefix("0x")?),
            },
            _ => None,
        }
    }

    /// The bytes of a number that is written in decimal.
    pub(super) fn parse(self, text: &str) -> Option<Vec<u8>> {
        let mut bytes = Vec::new();
        self.kind().parse(text, &mut bytes)?;
        Some(bytes).filter(|bytes| self != Self::Bool || bytes[0] < 2)
    }

    /// The bytes of a float of which all bits are written as hexadecimal digits.
    fn bits(self, digits: &str) -> Option<Vec<u8>> {
        let (whole, count) = match self {
            Self::Sample(SampleType::F16) => (SampleType::U16, 4),
            Self::Sample(SampleType::F32) => (SampleType::U32, 8),
            Self::Sample(SampleType::F64) => (SampleType::U64, 16),
            _ => return None,
        };
        if digits.len() != count || !digits.bytes().all(|digit| digit.is_ascii_hexdigit()) {
            return None;
        }
        let mut bytes = Vec::new();
        whole.parse(&u64::from_str_radix(digits, 16).ok()?.to_string(), &mut bytes)?;
        Some(bytes)
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "tests")]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn fill_values_in_all_spellings() {
        let fill = |name: &str, value: Value| Number::named(name).unwrap().fill(&value);
        let float = |value: Value| fill("float32", value).map(|bytes| f32::from_ne_bytes(bytes.try_into().unwrap()));
        let half = |value: Value| fill("float16", value).map(|bytes| u16::from_ne_bytes(bytes.try_into().unwrap()));
        let bits = |value: f32| Some(value.to_bits());
        for (value, expected) in [
            (json!(0.5), 0.5),
            (json!(-3), -3.0),
            (json!(-0.0), -0.0),
            (json!(1e300), f32::INFINITY),
            (json!("Infinity"), f32::INFINITY),
            (json!("-Infinity"), f32::NEG_INFINITY),
            (json!("NaN"), f32::from_bits(0x7fc0_0000)),
            (json!("0x7fc00001"), f32::from_bits(0x7fc0_0001)),
            (json!("0x3F800000"), 1.0),
        ] {
            assert_eq!(float(value.clone()).map(f32::to_bits), bits(expected), "{value}");
        }
        let bytes = |number: f64| Some(number.to_ne_bytes().to_vec());
        assert_eq!(
            (fill("float64", json!("0x3ff8000000000000")), fill("float64", json!(0.1))),
            (bytes(1.5), bytes(0.1))
        );
        assert_eq!(
            (half(json!(0.1)), half(json!("0x3C00")), half(json!("NaN"))),
            (Some(0x2e66), Some(0x3c00), Some(0x7e00))
        );
        assert_eq!((half(json!("-Infinity")), half(json!(65520))), (Some(0xfc00), Some(0x7c00)));
        for value in ["nan", "inf", "-inf", "1", "", "0x", "0x3f80", "0x3f8000000", "0x+f800000", "0xü23456"] {
            assert_eq!(float(json!(value)), None, "{value}");
        }
        assert_eq!(fill("int8", json!(-128)), Some(vec![0x80]));
        assert_eq!(fill("uint64", json!(u64::MAX)), Some(vec![0xff; 8]));
        assert_eq!(fill("int64", json!(i64::MIN)), Some(i64::MIN.to_ne_bytes().to_vec()));
        for (name, value) in [
            ("int8", json!(128)),
            ("uint8", json!(-1)),
            ("uint8", json!(1.0)),
            ("uint8", json!(true)),
            ("uint8", json!("0x07")),
            ("uint8", json!("NaN")),
            ("int64", json!(u64::MAX)),
            ("bool", json!(1)),
            ("bool", json!("NaN")),
            ("float32", json!(true)),
            ("float32", json!([0])),
            ("float32", json!({})),
        ] {
            assert_eq!(fill(name, value.clone()), None, "{name} {value}");
        }
        assert_eq!((fill("bool", json!(true)), fill("bool", json!(false))), (Some(vec![1]), Some(vec![0])));
    }
}
