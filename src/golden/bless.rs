//! The choice of goldens that may be rewritten.

use std::collections::BTreeSet;

use super::error::{GoldenError, VARIABLE};

/// The goldens that are rewritten if their image fails.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Bless {
    /// No golden.
    #[default]
    None,
    /// Every golden.
    All,
    /// The goldens with these names.
    Names(BTreeSet<String>),
}

impl Bless {
    /// The environment variable: `all`, or names separated by commas. Unset or empty, it blesses no golden.
    pub const VARIABLE: &str = VARIABLE;

    /// Reads the environment variable.
    ///
    /// # Errors
    /// If it holds anything that is not the name of a golden.
    pub fn from_env() -> Result<Self, GoldenError> {
        Self::parse(&std::env::var_os(Self::VARIABLE).unwrap_or_default().to_string_lossy())
    }

    /// Parses the environment variable's text.
    ///
    /// # Errors
    /// As for [`Bless::from_env`].
    pub fn parse(text: &str) -> Result<Self, GoldenError> {
        let names: BTreeSet<&str> = text.split(',').map(str::trim).filter(|name| !name.is_empty()).collect();
        if names.contains(ALL) {
            return Ok(Self::All);
        }
        for name in &names {
            check_name(name).map_err(|error| GoldenError::Bless(Box::new(error)))?;
        }
        Ok(if names.is_empty() { Self::None } else { Self::Names(names.into_iter().map(str::to_owned).collect()) })
    }

    /// Whether the golden with this name is rewritten if its image fails.
    pub fn contains(&self, name: &str) -> bool {
        match self {
            Self::None => false,
            Self::All => true,
            Self::Names(names) => names.contains(name),
        }
    }
}

const ALL: &str = "all";

/// Checks that a name can be part of a file name on every system, and differs from `all` in a list.
pub(super) fn check_name(name: &str) -> Result<(), GoldenError> {
    let allowed = |c: char| c.is_ascii_alphanumeric() || "-_.".contains(c);
    if name.is_empty() || name.starts_with('.') || name == ALL || !name.chars().all(allowed) {
        return Err(GoldenError::Name { found: name.to_owned() });
    }
    Ok(())
}
