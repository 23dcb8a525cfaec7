//! Forms of a plan's file: SVG, PNG, PDF.

use anyhow::{Context, bail};
use enfilade_report::{Drawing, PAPERS, Paper, Plans, to_pdf};

use super::Plan;
use enfilade_cli::input::is_stream;

/// Options of printed plans.
#[derive(clap::Args)]
pub(super) struct PrintOptions {
    /// Width of a .png in pixels; 2400 if not given.
    #[arg(long, value_name = "PIXELS", value_parser = clap::value_parser!(u32).range(1..=i64::from(enfilade_report::MAX_PIXELS)))]
    width: Option<u32>,
    /// Paper of a .pdf: A0 to A5, Letter or Tabloid; A4 if not given.
    #[arg(long, value_name = "PAPER", value_parser = paper)]
    paper: Option<Paper>,
    /// Scale of a .pdf, as in 1:100; the largest common scale that fits the paper if not given.
    #[arg(long, value_name = "1:N", value_parser = scale)]
    scale: Option<f64>,
}

/// The form of the file, with its settings.
pub(super) enum Form {
    Svg,
    Png {
        width: u32,
    },
    Pdf {
        paper: Paper,
        /// The largest common scale that fits, if not given.
        scale: Option<f64>,
    },
}

impl Plan {
    /// The form by the extension; refused if an option is for another one.
    pub(super) fn form(&self) -> anyhow::Result<Form> {
        let PrintOptions {
            width,
            paper,
            scale,
        } = &self.print;
        let extension = self.output.extension().unwrap_or_default();
        let extension = extension.to_string_lossy().to_ascii_lowercase();
        let misplaced = [
            ("--width", width.is_some(), "png"),
            ("--paper", paper.is_some(), "pdf"),
            ("--scale", scale.is_some(), "pdf"),
        ];
        for (option, is_given, of) in misplaced {
            if is_given && extension != of {
                bail!(
                    "{option} applies only to a .{of} file, not to {}; leave {option} out, or give -o a name that ends in .{of}",
                    if is_stream(&self.output) {
                        "standard output".into()
                    } else {
                        self.output.display().to_string()
                    }
                );
            }
        }
        Ok(match extension.as_str() {
            "png" => Form::Png {
                width: width.unwrap_or(2400),
            },
            "pdf" => Form::Pdf {
                paper: paper.unwrap_or(PAPERS[1]),
                scale: *scale,
            },
            _ => Form::Svg,
        })
    }
}

impl Form {
    /// The bytes of one file.
    pub(super) fn drawn(&self, plans: &Plans, which: &[usize]) -> anyhow::Result<Vec<u8>> {
        match self {
            Self::Svg => Ok(plans.sheet(which).to_svg().into_bytes()),
            Self::Png { width } => {
                let picture = plans.sheet(which).to_png(*width);
                picture.context("no picture was drawn; change --width")
            }
            Self::Pdf { paper, scale } => {
                let pages: Vec<Drawing> = if which.is_empty() {
                    vec![plans.sheet(&[])]
                } else {
                    which.iter().map(|&k| plans.sheet(&[k])).collect()
                };
                to_pdf(&pages, *paper, *scale).context("change --scale or --paper")
            }
        }
    }
}

fn paper(text: &str) -> Result<Paper, String> {
    let found = PAPERS
        .into_iter()
        .find(|p| p.name.eq_ignore_ascii_case(text));
    let names = PAPERS.map(|p| p.name).join(", ");
    found.ok_or_else(|| format!("a size of paper is needed: {names}"))
}

fn scale(text: &str) -> Result<f64, String> {
    let number = text.strip_prefix("1:").unwrap_or(text);
    match number.parse::<f64>() {
        Ok(x) if (1.0..=1e6).contains(&x) => Ok(x),
        _ => Err("a scale from 1:1 to 1:1000000 is needed, e.g. 1:100".into()),
    }
}
