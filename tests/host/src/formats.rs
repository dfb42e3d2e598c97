//! Volume formats that this application does not compile.

use std::path::Path;

use sheetsplat::volume::Volume;

#[test]
fn formats_left_out_are_named() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../fixtures/sform.nii");
    let message = Volume::open(&file).unwrap_err().to_string();
    for part in
        ["format: found NIfTI, which needs the feature `nifti`, allowed: NRRD (", "not compiled in: NIfTI (.nii"]
    {
        assert!(message.contains(part), "{message}");
    }
}
