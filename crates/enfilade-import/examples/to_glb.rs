//! Reads scenes of any format, prints the reports of import and cleaning, and writes one GLB:
//! `to_glb OUT.glb IN...`.

use enfilade_import::{CleaningOptions, ImportOptions, cleaning_report, export_glb, import};
use std::error::Error;
use std::path::PathBuf;

fn main() -> Result<(), Box<dyn Error>> {
    let mut paths = std::env::args_os().skip(1).map(PathBuf::from);
    let out = paths.next().ok_or("usage: to_glb OUT.glb IN...")?;
    let inputs: Vec<PathBuf> = paths.collect();
    let start = std::time::Instant::now();
    let imported = import(&inputs, &[], &ImportOptions::default())?;
    eprintln!("{}read in {:?}", imported.report, start.elapsed());
    let start = std::time::Instant::now();
    let options = CleaningOptions::default();
    let report = cleaning_report(&imported.scene, Some(&imported.report), &options)?;
    eprintln!("{report}\nchecked in {:?}", start.elapsed());
    std::fs::write(out, export_glb(&imported.scene))?;
    Ok(())
}
