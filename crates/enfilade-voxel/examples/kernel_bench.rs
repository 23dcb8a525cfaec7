//! Times one voxel kernel on a raw input file and prints a JSON line; `scripts/bench_kernels.py`
//! runs it beside other implementations.
//!
//! ```text
//! kernel_bench KERNEL INPUT NX NY NZ [--repeats N] [--threads N] [--h H] [--out FILE]
//! ```
//!
//! For most kernels INPUT holds one byte per voxel, x fastest, 0 for occupied. For `voxelize` it holds
//! nine little-endian `f64` per triangle, in voxel coordinates.
#![expect(clippy::print_stdout, reason = "a command-line tool")]

use std::time::Instant;

use enfilade_geom::{Allowance, DVec3, Triangle};
use enfilade_voxel::{
    BitVolume, Connectivity, Grid, WatershedOptions, components, distance, distance_squared, flood,
    mark_dams, voxelize, watershed,
};

/// User and system time of this process so far. [Units: s]
#[cfg(unix)]
fn cpu_seconds() -> (f64, f64) {
    use nix::sys::resource::{UsageWho, getrusage};
    let usage = getrusage(UsageWho::RUSAGE_SELF).expect("own usage is always known");
    let seconds = |t: nix::sys::time::TimeVal| t.tv_sec() as f64 + t.tv_usec() as f64 * 1e-6;
    (seconds(usage.user_time()), seconds(usage.system_time()))
}

/// Not available on this platform.
#[cfg(not(unix))]
fn cpu_seconds() -> (f64, f64) {
    (f64::NAN, f64::NAN)
}

/// A value from `/proc/self/status`; 0 if there is no such file. [Units: MiB]
fn memory(field: &str) -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find(|l| l.starts_with(field));
    let kib = line
        .and_then(|l| l.split_whitespace().nth(1))
        .and_then(|v| v.parse::<f64>().ok());
    kib.unwrap_or(0.0) / 1024.0
}

struct Times {
    user: Vec<f64>,
    system: Vec<f64>,
    wall: Vec<f64>,
    peak: f64,
}

/// Runs `call` on fresh input `repeats` times; returns the last answer.
fn measure<I, O>(repeats: usize, input: impl Fn() -> I, call: impl Fn(I) -> O) -> (Times, O) {
    let mut times = Times {
        user: vec![],
        system: vec![],
        wall: vec![],
        peak: 0.0,
    };
    let mut answer = None;
    for _ in 0..repeats {
        drop(answer.take());
        let given = input();
        // Linux resets the high-water mark; elsewhere the value is too high.
        _ = std::fs::write("/proc/self/clear_refs", "5");
        let resident = memory("VmRSS");
        let (user, system) = cpu_seconds();
        let start = Instant::now();
        answer = Some(call(given));
        times.wall.push(start.elapsed().as_secs_f64());
        let after = cpu_seconds();
        times.user.push(after.0 - user);
        times.system.push(after.1 - system);
        times.peak = times.peak.max(memory("VmHWM") - resident);
    }
    (times, answer.expect("repeats is at least 1"))
}

fn main() {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let option = |name: &str| {
        args.iter()
            .position(|a| a == name)
            .map(|i| args[i + 1].as_str())
    };
    let number = |name: &str, default: f64| -> f64 {
        option(name).map_or(default, |v| v.parse().expect("a number"))
    };
    let [kernel, path, nx, ny, nz, ..] = args.as_slice() else {
        panic!(
            "usage: kernel_bench KERNEL INPUT NX NY NZ [--repeats N] [--threads N] [--h H] [--out FILE]"
        );
    };
    let dims = [nx, ny, nz].map(|n| n.parse::<usize>().expect("a whole number of voxels"));
    let repeats = number("--repeats", 1.0) as usize;
    let threads = number("--threads", 1.0) as usize;
    let h = number("--h", 2.0);
    let bytes = std::fs::read(path).expect("the input file");
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .expect("threads");

    let run = Run {
        kernel,
        dims,
        bytes: &bytes,
        repeats,
        h,
        is_written: option("--out").is_some(),
    };
    let (times, result, out) = pool.install(|| run.kernel());
    if let Some(path) = option("--out") {
        std::fs::write(path, out).expect("the output file");
    }
    println!(
        "{{\"kernel\":\"{kernel}\",\"threads\":{threads},\"user_s\":{:?},\"sys_s\":{:?},\"wall_s\":{:?},\
         \"peak_mib\":{:.1},{result}}}",
        times.user, times.system, times.wall, times.peak
    );
}

/// A kernel and its input.
struct Run<'a> {
    kernel: &'a str,
    dims: [usize; 3],
    bytes: &'a [u8],
    repeats: usize,
    h: f64,
    is_written: bool,
}

impl Run<'_> {
    /// Runs it; returns the times, figures of the answer as JSON, and the answer's bytes for output.
    fn kernel(&self) -> (Times, String, Vec<u8>) {
        let dims = self.dims;
        let occupied = || BitVolume::from_fn(dims, |i| self.bytes[i] == 0);
        let mut out: Vec<u8> = Vec::new();
        let (times, result) = match self.kernel {
            "edt-u16" => {
                let set = occupied();
                let (times, field) = measure(
                    self.repeats,
                    || (),
                    |()| distance_squared(&set, &Allowance::default()),
                );
                let sum: u64 = field.iter().map(|&d| u64::from(d)).sum();
                (times, format!("\"sum\":{sum}"))
            }
            "edt-f32" => {
                let set = occupied();
                let (times, field) = measure(self.repeats, || (), |()| distance(&set));
                if self.is_written {
                    out = field.iter().flat_map(|d| d.to_le_bytes()).collect();
                }
                let sum: f64 = field.iter().map(|&d| f64::from(d)).sum();
                (times, format!("\"sum\":{sum}"))
            }
            "components6" | "components26" => {
                let set = occupied().complement();
                let connectivity = if self.kernel == "components6" {
                    Connectivity::Faces6
                } else {
                    Connectivity::Corners26
                };
                let (times, answer) =
                    measure(self.repeats, || (), |()| components(&set, connectivity));
                (times, format!("\"components\":{}", answer.n_components))
            }
            "flood" => {
                let set = occupied().complement();
                let mut seed = BitVolume::new(dims);
                if let Some(v) = set.iter_set().next() {
                    let [nx, ny, _] = dims;
                    seed.set(v % nx, v / nx % ny, v / nx / ny, true);
                }
                let (times, wet) = measure(
                    self.repeats,
                    || (),
                    |()| flood(&set, &seed, Connectivity::Faces6),
                );
                (times, format!("\"voxels\":{}", wet.count()))
            }
            "watershed" => {
                let field = distance_squared(&occupied(), &Allowance::default());
                let (times, (answer, dams)) = measure(
                    self.repeats,
                    || field.clone(),
                    |field| {
                        let answer = watershed(
                            dims,
                            field,
                            &WatershedOptions {
                                h: self.h,
                                outdoors: None,
                            },
                            &Allowance::default(),
                        );
                        let dams = mark_dams(dims, &answer.labels);
                        (answer, dams)
                    },
                );
                if self.is_written {
                    out = answer.labels.iter().flat_map(u32::to_le_bytes).collect();
                }
                (
                    times,
                    format!(
                        "\"basins\":{},\"saddles\":{},\"dams\":{}",
                        answer.basins.len(),
                        answer.saddles.len(),
                        dams.count()
                    ),
                )
            }
            "voxelize" => self.voxelize(),
            other => panic!("unknown kernel `{other}`"),
        };
        (times, result, out)
    }

    fn voxelize(&self) -> (Times, String) {
        let number = |b: &[u8]| f64::from_le_bytes(b.try_into().expect("eight bytes"));
        let values: Vec<f64> = self.bytes.chunks_exact(8).map(number).collect();
        let triangles: Vec<Triangle> = values
            .chunks_exact(9)
            .map(|t| [0, 3, 6].map(|i| DVec3::new(t[i], t[i + 1], t[i + 2])))
            .collect();
        let grid = Grid {
            origin: DVec3::ZERO,
            voxel: 1.0,
            dims: self.dims,
        };
        let (times, set) = measure(
            self.repeats,
            || (),
            |()| voxelize(&grid, &triangles, &Allowance::default()),
        );
        (
            times,
            format!("\"triangles\":{},\"set\":{}", triangles.len(), set.count()),
        )
    }
}
