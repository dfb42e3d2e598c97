//! The adapter that the tests draw on.

/// The name of the adapter on which the tests compare images: Mesa's software driver, so that results are the same on every machine, unless
/// `SHEETSPLAT_TEST_ADAPTER` names another.
pub(crate) fn adapter() -> String {
    std::env::var("SHEETSPLAT_TEST_ADAPTER").unwrap_or_else(|_| "llvmpipe".to_owned())
}
