//! Which goldens may be rewritten.

use std::collections::BTreeSet;

use super::GoldenError;

/// Which goldens are rewritten if they fail.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum Bless {
    /// None.
    #[default]
    None,
    /// All.
    All,
    /// Those of these names.
    Names(BTreeSet<String>),
}

impl Bless {
    /// The environment variable: `all`, or names with commas between them. Unset or empty, it blesses none.
    pub const VARIABLE: &str = "SHEETSPLAT_BLESS";

    /// What the environment variable says.
    ///
    /// # Errors
    /// If it holds what is no name of a golden.
    pub fn from_env() -> Result<Self, GoldenError> {
        Self::parse(&std::env::var_os(Self::VARIABLE).unwrap_or_default().to_string_lossy())
    }

    /// Reads what the environment variable may hold.
    ///
    /// # Errors
    /// As [`Bless::from_env`].
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

    /// Whether the golden of this name is rewritten if it fails.
    pub fn contains(&self, name: &str) -> bool {
        match self {
            Self::None => false,
            Self::All => true,
            Self::Names(names) => names.contains(name),
        }
    }
}

const ALL: &str = "all";

/// Names are parts of file names on every system, and can be told from `all` and from one another in a list.
pub(super) fn check_name(name: &str) -> Result<(), GoldenError> {
    let allowed = |c: char| c.is_ascii_alphanumeric() || "-_.".contains(c);
    if name.is_empty() || name.starts_with('.') || name == ALL || !name.chars().all(allowed) {
        return Err(GoldenError::Name { found: name.to_owned() });
    }
    Ok(())
}
