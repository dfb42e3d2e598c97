//! Attributes and errors of XML, for the formats that use it.

use std::path::Path;

use quick_xml::XmlVersion;
use quick_xml::events::BytesStart;

use super::VolumeError;
use super::error::volume::invalid;
use super::fields::Fields;

/// An element's attributes by their names without prefix.
pub(super) fn attributes(path: &Path, element: &BytesStart) -> Result<Fields, VolumeError> {
    let mut fields = Fields::new(path.to_owned());
    for attribute in element.attributes() {
        let attribute = attribute.map_err(|error| damage(path, error))?;
        let value = attribute.normalized_value(XmlVersion::Implicit1_0).map_err(|error| damage(path, error))?;
        fields.add(attribute.key.local_name().as_ref(), &value)?;
    }
    Ok(fields)
}

/// The error for malformed XML.
pub(super) fn damage(path: &Path, error: impl std::error::Error) -> VolumeError {
    invalid(path, "header", error, "well-formed XML")
}
