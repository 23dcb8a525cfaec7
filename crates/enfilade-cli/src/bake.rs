//! `enfilade bake`: a scene becomes a world.

use std::collections::BTreeMap;
use std::io::{self, IsTerminal, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use enfilade::bake::{BakeConfig, BakeContext, BakeOutput, Progress, bake};
use enfilade::cpg::wire::encode_glb;
use enfilade::cpg::{PortalKind, World};
use enfilade::geom::scene::{Role, Scene};
use enfilade::import::{
    CleaningOptions, ImportOptions, ImportReport, RoleRules, Up, cleaning_report, import,
};

use crate::output::write_atomically;
use crate::progress::StageBar;

/// Finds the rooms and doorways of a scene and writes them as a world.
#[derive(clap::Args)]
pub(crate) struct Bake {
    /// Scene files: GLB, glTF, OBJ, PLY or STL. Several become one scene.
    #[arg(required = true, value_name = "IN")]
    inputs: Vec<PathBuf>,
    /// World to write, one GLB.
    #[arg(short, long, value_name = "OUT.glb")]
    output: PathBuf,
    #[command(flatten)]
    options: BakeOptions,
}

#[derive(clap::Args)]
pub(crate) struct BakeOptions {
    /// Files whose objects are all detail: furniture, door leaves, plants.
    #[arg(long, value_name = "FILE")]
    detail: Vec<PathBuf>,
    /// Objects whose object, mesh or material name fits this pattern (`*`, `?`) are detail.
    #[arg(long, value_name = "PATTERN")]
    detail_name: Vec<String>,
    /// Objects whose name fits this pattern are structural, whatever else says they are detail.
    #[arg(long, value_name = "PATTERN")]
    structural_name: Vec<String>,
    /// Meters per unit of the input; 0.001 for millimeters.
    #[arg(long, value_name = "METERS")]
    unit: Option<f64>,
    /// The input's up axis.
    #[arg(long, value_enum)]
    up: Option<UpAxis>,
    /// How cells are found.
    #[arg(long, value_enum, default_value_t = Method::Auto)]
    method: Method,
    /// Settings file in TOML; what is given on the command line wins.
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Edge of a voxel in meters; chosen from the narrowest opening and the scene's size if not given.
    #[arg(long, value_name = "METERS")]
    voxel: Option<f64>,
    /// Width in meters of the narrowest opening that must be found [default: 0.6].
    #[arg(long, value_name = "METERS")]
    min_opening: Option<f64>,
    /// Threads to use; as many as there are cores if not given. The result is the same.
    #[arg(long, value_name = "N")]
    threads: Option<usize>,
    /// Print the role of each object with its reason, notes of the import and stage times.
    #[arg(short, long)]
    verbose: bool,
}

#[derive(Clone, Copy, clap::ValueEnum)]
enum UpAxis {
    Y,
    Z,
}

#[derive(Clone, Copy, PartialEq, clap::ValueEnum)]
enum Method {
    /// Choose by what the input is; the watershed so far.
    Auto,
    /// Voxels, distances, watershed.
    Watershed,
}

/// The settings file: the fields of the bake's configuration, all optional.
#[derive(Default, serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct ConfigFile {
    voxel: Option<f64>,
    min_opening: Option<f64>,
    max_voxels: Option<usize>,
    noise: Option<f64>,
    unit: Option<f64>,
    #[serde(default)]
    detail_names: Vec<String>,
    #[serde(default)]
    structural_names: Vec<String>,
    #[serde(default)]
    merge: BTreeMap<String, f64>,
}

pub(crate) fn run(args: &Bake) -> anyhow::Result<()> {
    if args
        .inputs
        .iter()
        .chain(&args.options.detail)
        .any(|p| same_file(p, &args.output))
    {
        bail!(
            "{} is an input; choose another name with -o",
            args.output.display()
        );
    }
    let (import_options, config) = settings(&args.options)?;
    let imported = import(&args.inputs, &args.options.detail, &import_options)?;
    report_import(&imported.scene, &imported.report, args.options.verbose)?;
    let baked = bake_scene(&imported.scene, &config, args.options.threads)?;
    let bytes = encode_glb(&baked.world).context("the baked world breaks an invariant (a bug)")?;
    write_atomically(&args.output, &bytes)?;
    report_bake(&baked, args.options.verbose)?;
    let mut out = io::stdout().lock();
    print_summary(&mut out, &baked.world)?;
    writeln!(
        out,
        "wrote {} ({:.1} MB)",
        args.output.display(),
        bytes.len() as f64 / 1e6
    )?;
    Ok(())
}

fn same_file(a: &Path, b: &Path) -> bool {
    matches!((a.canonicalize(), b.canonicalize()), (Ok(a), Ok(b)) if a == b)
}

fn settings(options: &BakeOptions) -> anyhow::Result<(ImportOptions, BakeConfig)> {
    let file: ConfigFile = match &options.config {
        None => ConfigFile::default(),
        Some(path) => {
            let text = std::fs::read_to_string(path)
                .with_context(|| format!("cannot read settings {}", path.display()))?;
            toml::from_str(&text)
                .with_context(|| format!("settings {} are not understood", path.display()))?
        }
    };
    let mut config = BakeConfig {
        voxel: options.voxel.or(file.voxel),
        ..BakeConfig::default()
    };
    if let Some(v) = options.min_opening.or(file.min_opening) {
        config.min_opening = v;
    }
    if let Some(v) = file.max_voxels {
        config.max_voxels = v;
    }
    if let Some(v) = file.noise {
        config.noise = v;
    }
    for (name, value) in file.merge {
        let m = &mut config.merge;
        let field = match name.as_str() {
            "threshold" => &mut m.threshold,
            "wall_threshold" => &mut m.wall_threshold,
            "wall_rim" => &mut m.wall_rim,
            "radius_gain" => &mut m.radius_gain,
            "reach" => &mut m.reach,
            "surround" => &mut m.surround,
            "outdoor_gain" => &mut m.outdoor_gain,
            "closed_share" => &mut m.closed_share,
            "min_radius" => &mut m.min_radius,
            _ => bail!("setting merge.{name} does not exist"),
        };
        *field = value;
    }
    let import_options = ImportOptions {
        unit: options.unit.or(file.unit),
        up: options.up.map(|up| match up {
            UpAxis::Y => Up::Y,
            UpAxis::Z => Up::Z,
        }),
        roles: RoleRules {
            structural: [options.structural_name.clone(), file.structural_names].concat(),
            detail: [options.detail_name.clone(), file.detail_names].concat(),
            ..RoleRules::default()
        },
        ..ImportOptions::default()
    };
    Ok((import_options, config))
}

/// Bakes on a pool of its own, with a progress line.
pub(crate) fn bake_scene(
    scene: &Scene,
    config: &BakeConfig,
    threads: Option<usize>,
) -> anyhow::Result<BakeOutput> {
    struct Bar(StageBar);
    impl Progress for Bar {
        fn stage(&self, name: &'static str, index: usize, count: usize) {
            self.0.start(&format!("{}/{count} {name}", index + 1), 0);
        }
    }
    let bar = Bar(StageBar::new());
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads.unwrap_or(0))
        .build()?;
    let baked = pool.install(|| bake(scene, config, &BakeContext::new(&bar, None)))?;
    bar.0.finish();
    Ok(baked)
}

fn report_import(scene: &Scene, report: &ImportReport, verbose: bool) -> anyhow::Result<()> {
    let mut err = io::stderr().lock();
    if verbose {
        writeln!(err, "{report}")?;
        for o in &scene.objects {
            let role = match o.role {
                Role::Structural => "structural",
                Role::Detail => "detail",
            };
            writeln!(err, "{role:<10} {}: {}", o.name, o.reason)?;
        }
    }
    let cleaning = cleaning_report(scene, Some(report), &CleaningOptions::default())?;
    if verbose || cleaning.findings().iter().any(|(_, f)| f.n > 0) {
        writeln!(err, "the model as found (nothing was changed):\n{cleaning}")?;
    }
    Ok(())
}

/// Leaks worth a line: wide enough that they may be meant.
const LEAKS_SHOWN: usize = 10;

fn report_bake(baked: &BakeOutput, verbose: bool) -> anyhow::Result<()> {
    let mut err = io::stderr().lock();
    let [nx, ny, nz] = baked.dims;
    writeln!(err, "voxels of {:.3} m, {nx} × {ny} × {nz}", baked.voxel)?;
    if verbose || io::stderr().is_terminal() {
        for (stage, time) in &baked.times {
            writeln!(err, "{stage:>20} {:>8.3} s", time.as_secs_f64())?;
        }
    }
    if !baked.leaks.is_empty() {
        let mut leaks = baked.leaks.clone();
        leaks.sort_by(|a, b| b.area.total_cmp(&a.area));
        writeln!(
            err,
            "{} gaps in the model let light through; they became portals:",
            leaks.len()
        )?;
        for l in leaks.iter().take(LEAKS_SHOWN) {
            writeln!(
                err,
                "  at {:.2} {:.2} {:.2}: {:.0} mm wide, {:.3} m², between cells {} and {}",
                l.position.x,
                l.position.y,
                l.position.z,
                l.width * 1000.0,
                l.area,
                l.cells[0],
                l.cells[1]
            )?;
        }
        if leaks.len() > LEAKS_SHOWN {
            writeln!(err, "  and {} more", leaks.len() - LEAKS_SHOWN)?;
        }
    }
    Ok(())
}

/// The summary table: what was found, in one glance.
pub(crate) fn print_summary(out: &mut impl Write, world: &World) -> io::Result<()> {
    let graph = &world.graph;
    let count = |kind| graph.portals.iter().filter(|p| p.kind == kind).count();
    let indoor = graph.cells.iter().filter(|c| !c.outdoor).count();
    let rows = [
        (
            "triangles",
            graph
                .statistics
                .counts
                .get("input_triangles")
                .copied()
                .unwrap_or(0.0) as usize,
        ),
        ("cells indoors", indoor),
        ("portals", graph.portals.len()),
        ("  doors", count(PortalKind::Door)),
        ("  windows", count(PortalKind::Window)),
        ("  open", count(PortalKind::Open)),
        ("  cracks", count(PortalKind::Crack)),
        ("detail objects", world.details.len()),
    ];
    for (name, n) in rows {
        writeln!(out, "{name:<16} {n:>9}")?;
    }
    Ok(())
}
