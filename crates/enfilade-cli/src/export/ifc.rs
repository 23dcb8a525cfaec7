//! `enfilade export --ifc IN -o OUT.ifc`: the rooms in the model that they were found in.

use std::io::Write;
use std::path::Path;

use anyhow::{Context, bail};
use enfilade::geom::shown;
use enfilade_export::{IfcOptions, SurfaceLevel, ifc_with_spaces};

use crate::export::{Export, extension_of, read_valid};
use crate::formats::Format;
use crate::output::{Outputs, Written, write_whole};
use crate::screen::print_json;
use enfilade_cli::input::{is_stream, name_of};

#[derive(serde::Serialize)]
struct IfcExportReport {
    #[serde(flatten)]
    file: Written,
    spaces_added: usize,
    spaces_replaced: usize,
    spaces_kept: usize,
    boundaries: usize,
    surfaces_without_element: usize,
}

pub(super) fn run(args: &Export, model: &Path, outputs: &mut Outputs) -> anyhow::Result<()> {
    if extension_of(&args.output) != "ifc" {
        bail!(
            "{}: with --ifc, a model is written; end its name in .ifc",
            args.output.display()
        );
    }
    if is_stream(model) {
        bail!("--ifc is read from a file only; give the name of the model in place of '-'");
    }
    outputs.write("-o", Format::Ifc, &args.output)?;
    let world = read_valid(args)?;
    let options = IfcOptions {
        replaces_spaces: args.replace_spaces,
        level: if args.first_level {
            SurfaceLevel::First
        } else {
            SurfaceLevel::Second
        },
    };
    let ifc = std::fs::read(model).with_context(|| format!("cannot read {}", name_of(model)))?;
    let written = ifc_with_spaces(&world, &ifc, &options).with_context(|| name_of(model))?;
    write_whole(&args.output, &written.bytes)?;
    let report = IfcExportReport {
        file: Written::new(&args.output, &written.bytes),
        spaces_added: written.n_added,
        spaces_replaced: written.n_replaced,
        spaces_kept: written.n_kept,
        boundaries: written.n_boundaries,
        surfaces_without_element: written.n_without_element,
    };
    if args.json {
        return print_json(outputs.printed(), &report);
    }
    let mut out = outputs.printed();
    writeln!(out, "{}", report.file)?;
    writeln!(
        out,
        "{} spaces added, {} boundaries",
        report.spaces_added + report.spaces_replaced,
        report.boundaries
    )?;
    if report.spaces_kept > 0 {
        let model = name_of(model);
        let advice = if args.replace_spaces {
            "no room is named after one of them alone"
        } else {
            "--replace-spaces gives those that are rooms the bodies that were found"
        };
        writeln!(
            out,
            "{} spaces of {} stay as they are: {advice}",
            report.spaces_kept,
            shown(&model)
        )?;
    }
    if report.surfaces_without_element > 0 {
        writeln!(
            out,
            "{} surfaces have no boundary: no element of the model makes them, as where the bake closed a gap",
            report.surfaces_without_element
        )?;
    }
    Ok(())
}
