//! Scenes of unusual shapes, small as files and hard to bake.

use std::f64::consts::PI;
use std::fmt::Write as _;

use super::random::Random;

pub(super) type Triangle = [[f64; 3]; 3];

/// Returns forty scenes of at most 2,000 triangles, except a few with copies and dust.
pub(super) fn scenes() -> Vec<(&'static str, String)> {
    let mut random = Random(7);
    let mut all = Vec::new();
    for (name, n) in [
        ("random 100", 100),
        ("random 400", 400),
        ("random 800", 800),
        ("random 2000", 2000),
    ] {
        let triangles: Vec<Triangle> = (0..n).map(|_| [0; 3].map(|_| random.point(10.0))).collect();
        all.push((name, obj(&triangles)));
    }
    let confetti: Vec<Triangle> = (0..2000)
        .map(|_| {
            let at = random.point(10.0);
            [0; 3].map(|_| {
                let by = random.point(1.0);
                [0, 1, 2].map(|k| at[k] + by[k] - 0.5)
            })
        })
        .collect();
    all.push(("confetti 2000", obj(&confetti)));
    let fan = (0..1000).flat_map(|i| {
        let (s, c) = (PI * f64::from(i) / 1000.0).sin_cos();
        let (x, z) = (5.0 * c, 5.0 * s);
        quad([[-x, 0.0, -z], [x, 0.0, z], [x, 3.0, z], [-x, 3.0, -z]])
    });
    all.push(("fan 2000", obj(&fan.collect::<Vec<_>>())));
    let sheets = (0..1000).flat_map(|i| {
        let (y, lift) = (f64::from(i) * 0.01, random.next() * 0.1 - 0.05);
        quad([
            [0.0, y, 0.0],
            [10.0, y + lift, 0.0],
            [10.0, y, 10.0],
            [0.0, y, 10.0],
        ])
    });
    all.push(("sheets 2000", obj(&sheets.collect::<Vec<_>>())));
    let slivers: Vec<Triangle> = (0..2000)
        .map(|_| {
            let (a, b) = (10.0 * random.next(), 10.0 * random.next());
            [random.point(10.0), [a, 0.0, 0.0], [b, 0.001, 0.001]]
        })
        .collect();
    all.push(("slivers 2000", obj(&slivers)));
    let mut far = cuboid([0.0; 3], [4.0, 3.0, 5.0]);
    far.extend(cuboid([1000.0, 0.0, 1000.0], [1004.0, 3.0, 1005.0]));
    all.push(("rooms in a kilometer", obj(&far)));
    let mut wide = cuboid([0.0; 3], [1000.0, 3.0, 1000.0]);
    wide.extend(cuboid([0.0; 3], [4.0, 3.0, 5.0]));
    all.push(("hall of a kilometer", obj(&wide)));
    let copies = quad([
        [0.0, 0.0, 0.0],
        [4.0, 0.3, 0.0],
        [4.0, 2.3, 4.0],
        [0.0, 2.0, 4.0],
    ]);
    all.push(("20,000 copies of a quad", obj(&copies.repeat(20_000))));
    more(&mut random, &mut all);
    all
}

/// Adds shapes from attacks, in several sizes.
fn more(random: &mut Random, all: &mut Vec<(&'static str, String)>) {
    for (name, n, edge, size) in [
        ("confetti 500 of 6 m", 500, 6.0, 20.0),
        ("confetti 1000 of 3 m", 1000, 3.0, 20.0),
        ("confetti 200 of 15 m", 200, 15.0, 20.0),
        ("dust 20,000", 20_000, 0.3, 10.0),
        ("dust 5,000", 5_000, 0.5, 8.0),
        ("splinters in a kilometer", 800, 2.0, 1000.0),
    ] {
        let triangles: Vec<Triangle> = (0..n).map(|_| scrap(random, edge, size)).collect();
        all.push((name, obj(&triangles)));
    }
    for (name, n, size, most) in [
        ("boxes 160 turned", 160, 15.0, 4.0),
        ("boxes 60 turned", 60, 8.0, 4.0),
        ("boxes 160 thin, turned", 160, 12.0, 0.2),
    ] {
        let boxes = (0..n).flat_map(|_| {
            let low = random.point(size);
            let by = random.point(most);
            let high = [0, 1, 2].map(|k| low[k] + 0.1 + by[k]);
            let angles = random.point(2.0 * PI);
            turned(cuboid(low, high), low, angles)
        });
        all.push((name, obj(&boxes.collect::<Vec<_>>())));
    }
    for (name, n, size) in [
        ("boxes 300 crossing", 300, 20.0),
        ("boxes 100 crossing", 100, 8.0),
    ] {
        let boxes = (0..n).flat_map(|_| {
            let low = random.point(size);
            let by = random.point(5.0);
            cuboid(low, [0, 1, 2].map(|k| low[k] + by[k]))
        });
        all.push((name, obj(&boxes.collect::<Vec<_>>())));
    }
    built(random, all);
    thin(random, all);
}

/// Adds shapes that are built like rooms, except for their sizes.
fn built(random: &mut Random, all: &mut Vec<(&'static str, String)>) {
    for (name, n) in [("balls 12", 12), ("balls 3", 3)] {
        let balls = (0..n).flat_map(|_| ball(random.point(6.0), 1.0 + 2.0 * random.next(), 12));
        all.push((name, obj(&balls.collect::<Vec<_>>())));
    }
    for (name, n, step) in [("shells 20", 20, 0.3), ("shells 60", 60, 0.1)] {
        let shells = (0..n).flat_map(|i| {
            let by = step * f64::from(i);
            cuboid([-by; 3], [5.0 + by, 3.0 + by, 5.0 + by])
        });
        all.push((name, obj(&shells.collect::<Vec<_>>())));
    }
    for (name, n, pitch) in [
        ("rooms 15 x 15", 15, 3.0),
        ("rooms 20 x 20, small", 20, 1.2),
    ] {
        let cells = (0..n * n).flat_map(|i| {
            let (x, z) = (pitch * f64::from(i % n), pitch * f64::from(i / n));
            // Each leaves a slit to the next.
            cuboid([x, 0.0, z], [x + 0.9 * pitch, 2.5, z + 0.9 * pitch])
        });
        all.push((name, obj(&cells.collect::<Vec<_>>())));
    }
    for (name, n, thick) in [("columns 400", 20, 0.3), ("columns 900", 30, 0.1)] {
        let mut hall = cuboid([0.0; 3], [20.0, 3.0, 20.0]);
        let pitch = 20.0 / f64::from(n);
        hall.extend((0..n * n).flat_map(|i| {
            let (x, z) = (
                pitch * f64::from(i % n) + 0.2,
                pitch * f64::from(i / n) + 0.2,
            );
            cuboid([x, 0.0, z], [x + thick, 3.0, z + thick])
        }));
        all.push((name, obj(&hall)));
    }
}

/// Adds sheets, needles and slits.
fn thin(random: &mut Random, all: &mut Vec<(&'static str, String)>) {
    let comb = (0..400).flat_map(|i| {
        let x = 0.05 * f64::from(i);
        quad([[x, 0.0, 0.0], [x, 3.0, 0.0], [x, 3.0, 5.0], [x, 0.0, 5.0]])
    });
    all.push(("comb 400", obj(&comb.collect::<Vec<_>>())));
    let star = (0..500).flat_map(|_| {
        let (a, b) = (random.point(10.0), random.point(10.0));
        [[[5.0; 3], a, b]]
    });
    all.push(("star 500", obj(&star.collect::<Vec<_>>())));
    let needles = (0..1000).flat_map(|_| {
        let a = random.point(10.0);
        [[a, [a[0] + 1e-4, a[1], a[2]], random.point(10.0)]]
    });
    all.push(("needles 1000", obj(&needles.collect::<Vec<_>>())));
    let ground = (0..900).flat_map(|i| {
        let at = |i: i32, j: i32| {
            let (x, z) = (f64::from(i), f64::from(j));
            [
                x,
                (0.7 * x).sin() + (0.9 * z).cos() + 0.05 * (13.0 * x * z).sin(),
                z,
            ]
        };
        let (x, z) = (i % 30, i / 30);
        quad([at(x, z), at(x + 1, z), at(x + 1, z + 1), at(x, z + 1)])
    });
    all.push(("ground 1800", obj(&ground.collect::<Vec<_>>())));
    let leaning = (0..300).flat_map(|i| {
        let by = 1e-4 * f64::from(i);
        quad([
            [0.0, by, 0.0],
            [9.0, 3.0 * by, 0.0],
            [9.0, by, 9.0],
            [0.0, 2.0 * by, 9.0],
        ])
    });
    all.push(("sheets 600 a hair apart", obj(&leaning.collect::<Vec<_>>())));
    let mut stack = Vec::new();
    for i in 0..120 {
        let y = 0.25 * f64::from(i);
        stack.extend(cuboid([0.0, y, 0.0], [6.0, y + 0.2, 6.0]));
    }
    all.push(("slabs 120", obj(&stack)));
    let tubes = (0..200).flat_map(|_| {
        let (a, by) = (random.point(10.0), random.point(10.0));
        cuboid(a, [a[0] + 0.3, a[1] + 0.3, a[2] + by[2]])
    });
    all.push(("sticks 200", obj(&tubes.collect::<Vec<_>>())));
    let cracked = (0..400).flat_map(|i| {
        let (x, z) = (f64::from(i % 20), f64::from(i / 20));
        let gap = 0.02 * random.next();
        quad([
            [x + gap, 0.0, z],
            [x + 1.0, gap, z],
            [x + 1.0 - gap, 0.0, z + 1.0],
            [x, 0.0, z + 1.0 - gap],
        ])
    });
    let steps = (0..300).flat_map(|i| {
        let by = f64::from(i);
        let (sin, cos) = (0.2 * by).sin_cos();
        let low = [5.0 * cos, 0.15 * by, 5.0 * sin];
        cuboid(low, [low[0] + 1.5, low[1] + 0.15, low[2] + 1.5])
    });
    all.push(("steps 300, winding", obj(&steps.collect::<Vec<_>>())));
    let slits = (0..200).flat_map(|i| {
        let x = 0.1 * f64::from(i);
        cuboid([x, 0.0, 0.0], [x + 0.09, 3.0, 0.1])
    });
    all.push(("fence of 200 slits", obj(&slits.collect::<Vec<_>>())));
    all.push((
        "floor of 400 tiles apart",
        obj(&cracked.collect::<Vec<_>>()),
    ));
}

/// Returns a triangle with edges up to `edge` at a random place in a box.
fn scrap(random: &mut Random, edge: f64, size: f64) -> Triangle {
    let at = random.point(size);
    [0; 3].map(|_| {
        let by = random.point(edge);
        [0, 1, 2].map(|k| at[k] + by[k] - 0.5 * edge)
    })
}

/// Returns triangles rotated about a point, axis by axis.
fn turned(triangles: Vec<Triangle>, about: [f64; 3], angles: [f64; 3]) -> Vec<Triangle> {
    let turn = |p: [f64; 3]| {
        let mut p = [0, 1, 2].map(|k| p[k] - about[k]);
        for (axis, angle) in angles.into_iter().enumerate() {
            let (sin, cos) = angle.sin_cos();
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            (p[u], p[v]) = (cos * p[u] - sin * p[v], sin * p[u] + cos * p[v]);
        }
        [0, 1, 2].map(|k| p[k] + about[k])
    };
    triangles.into_iter().map(|t| t.map(turn)).collect()
}

/// Returns a ball of `2 n²` triangles.
fn ball(middle: [f64; 3], radius: f64, n: i32) -> Vec<Triangle> {
    let at = |i: i32, j: i32| {
        let (s, c) = (PI * f64::from(i) / f64::from(n)).sin_cos();
        let (sin, cos) = (2.0 * PI * f64::from(j % n) / f64::from(n)).sin_cos();
        let out = [s * cos, c, s * sin];
        [0, 1, 2].map(|k| middle[k] + radius * out[k])
    };
    let quads = (0..n * n).map(|k| (k / n, k % n));
    quads
        .flat_map(|(i, j)| quad([at(i, j), at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)]))
        .collect()
}

fn quad([a, b, c, d]: [[f64; 3]; 4]) -> [Triangle; 2] {
    [[a, b, c], [a, c, d]]
}

pub(super) fn cuboid(low: [f64; 3], high: [f64; 3]) -> Vec<Triangle> {
    let corner = |c: usize| [0, 1, 2].map(|k| if c >> k & 1 == 1 { high[k] } else { low[k] });
    let faces = [
        [0, 4, 6, 2],
        [1, 3, 7, 5],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 2, 3, 1],
        [4, 5, 7, 6],
    ];
    faces.iter().flat_map(|f| quad(f.map(corner))).collect()
}

pub(super) fn obj(triangles: &[Triangle]) -> String {
    let mut text = String::new();
    for triangle in triangles {
        for [x, y, z] in triangle {
            let _ = writeln!(text, "v {x} {y} {z}");
        }
        text.push_str("f -3 -2 -1\n");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn there_are_forty_and_each_has_its_name() {
        let all = scenes();
        let mut names: Vec<&str> = all.iter().map(|s| s.0).collect();
        names.sort_unstable();
        names.dedup();
        assert_eq!((all.len(), names.len()), (40, 40));
    }
}
