//! Writes the rooms of a world into the IFC file that it was baked from: `ifc WORLD.glb IN.ifc OUT.ifc`.

use enfilade_cpg::wire;
use enfilade_export::{IfcOptions, ifc_with_spaces};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [world, ifc, out] = args.as_slice() else {
        return Err("usage: ifc WORLD.glb IN.ifc OUT.ifc".into());
    };
    let world = wire::decode_glb(&std::fs::read(world)?)?;
    let options = IfcOptions {
        replaces_spaces: true,
        ..IfcOptions::default()
    };
    let written = ifc_with_spaces(&world, &std::fs::read(ifc)?, &options)?;
    std::fs::write(out, &written.bytes)?;
    let (added, boundaries) = (written.n_added, written.n_boundaries);
    eprintln!("{added} spaces added, {boundaries} boundaries");
    Ok(())
}
