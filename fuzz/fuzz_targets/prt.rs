#![no_main]
//! Hostile bytes for the readers of portal files and text PVS: what is read is written and read alike.

use enfilade_import::{read_prt, read_pvs_text, write_prt, write_pvs_text};

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    let Ok(text) = std::str::from_utf8(data) else {
        return;
    };
    if let Ok(file) = read_prt(text) {
        assert_eq!(read_prt(&write_prt(&file)).as_ref(), Ok(&file));
    }
    if let Ok(pvs) = read_pvs_text(text) {
        assert_eq!(read_pvs_text(&write_pvs_text(&pvs)).map(|p| p.rows), Ok(pvs.rows));
    }
});
