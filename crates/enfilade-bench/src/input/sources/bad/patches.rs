//! Free-form patches: knots, counts, weights and loops that make no surface, or one of too many triangles.

use enfilade_testkit::Rng;

use super::cases::{BadSource, Cases, table};

const POINTS: &str = "[[[0,0,0],[2,3,0],[4,0,0]],[[0,0,6],[2,3,6],[4,0,6]]]";

/// Nets of points.
const NETS: &str = "
none | []
rows of none | [[],[]]
uneven rows | [[[0,0,0],[2,3,0],[4,0,0]],[[0,0,6]]]
all the same | [[[1,1,1],[1,1,1],[1,1,1]],[[1,1,1],[1,1,1],[1,1,1]]]
in a line | [[[0,0,0],[1,0,0],[2,0,0]],[[0,0,0],[1,0,0],[2,0,0]]]
";
/// Changes of [`POINTS`].
const CHANGES: &str = "
not finite | 6 to 1e999
no numbers | 6 to null
far apart | 6 to 1e8
farther apart | 6 to 1e300
far up | 2,3 to 2,9e8
of no weight | 2,3,0 to 2,3,0,0
of negative weight | 2,3,0 to 2,3,0,-1
of all weight | 2,3,0 to 2,3,0,1e300
of five numbers | 2,3,0 to 2,3,0,1,1
";

fn patch(fields: &str) -> String {
    format!(r#"{{"enfilade":"patches","patches":[{{{fields}}}]}}"#)
}

pub(super) fn cases() -> Vec<BadSource> {
    let mut all = Cases::new("json", &[]);
    numbers(&mut all);
    many(&mut all);
    loops(&mut all);
    all.ending = "obj";
    objs(&mut all);
    all.all
}

fn numbers(all: &mut Cases) {
    for degrees in [
        "[0,0]",
        "[2]",
        "[-2,1]",
        "[17,1]",
        "[1e9,1e9]",
        "[2.5,1]",
        "[3,1]",
        "null",
    ] {
        all.add(
            format!("degrees {degrees}"),
            patch(&format!(r#""degrees":{degrees},"points":{POINTS}"#)),
        );
    }
    for knots in [
        "[[0,0,0,0,0,0],[0,0,0,0]]",
        "[[0,0,0,1,1,1],[0,0,1]]",
        "[[],[]]",
        "[[0,0,0,1,1,1]]",
        "[[1,1,1,0,0,0],[0,0,1,1]]",
        "[[0,0,0,1e-300,1e-300,1e-300],[0,0,1,1]]",
        "[[0,0,0,1e308,1e308,1e308],[0,0,1,1]]",
        "[[-1e308,-1e308,-1e308,1e308,1e308,1e308],[0,0,1,1]]",
        "[[0,0,0,null,1,1],[0,0,1,1]]",
    ] {
        let fields = format!(r#""degrees":[2,1],"points":{POINTS},"knots":{knots}"#);
        all.add(format!("knots {knots}"), patch(&fields));
    }
    let points = |all: &mut Cases, name: &str, points: &str| {
        let fields = format!(r#""degrees":[2,1],"points":{points}"#);
        all.add(format!("points: {name}"), patch(&fields));
    };
    for (name, text) in table(NETS) {
        points(all, name, text);
    }
    for (name, change) in table(CHANGES) {
        let (from, to) = change.split_once(" to ").unwrap_or_default();
        points(all, name, &POINTS.replace(from, to));
    }
}

fn many(all: &mut Cases) {
    let mut rng = Rng::new(5);
    for n in [40, 250] {
        let mut row = || {
            let points: Vec<String> = (0..n)
                .map(|_| {
                    format!(
                        "[{:.3},{:.3},{:.3}]",
                        rng.unit() * 9.0,
                        rng.unit() * 9.0,
                        rng.unit() * 9.0
                    )
                })
                .collect();
            format!("[{}]", points.join(","))
        };
        let rows: Vec<String> = (0..n).map(|_| row()).collect();
        let fields = format!(r#""degrees":[3,3],"points":[{}]"#, rows.join(","));
        all.add(format!("{n} × {n} points at random"), patch(&fields));
    }
}

fn loops(all: &mut Cases) {
    let bow = |by: f64| format!("[[0.2,0.2],[{by},0.8],[0.8,0.2],[0.2,{by}],[0.2,0.2]]");
    for (name, loops) in [
        ("crossing", format!(r#"[[{{"points":{}}}]]"#, bow(0.8))),
        ("beyond", r#"[[{"points":[[0,0],[9,0],[9,9],[0,0]]}]]"#.to_owned()),
        ("of one point", r#"[[{"points":[[0.5,0.5]]}]]"#.to_owned()),
        ("of equal points", r#"[[{"points":[[0.5,0.5],[0.5,0.5],[0.5,0.5]]}]]"#.to_owned()),
        ("without curves", "[[]]".to_owned()),
        ("of no area", r#"[[{"points":[[0.2,0.2],[0.8,0.8],[0.2,0.2]]}]]"#.to_owned()),
        ("of a curve out of proportion", r#"[[{"degree":2,"points":[[0.1,0.1,1e-6],[0.9,0.5,1e6],[0.1,0.9,1e-6],[0.1,0.1,1e6]]}]]"#.to_owned()),
    ] {
        let fields = format!(r#""degrees":[2,1],"points":{POINTS},"trim":{loops}"#);
        all.add(format!("loops {name}"), patch(&fields));
    }
    // As many edges as there can be, in one step of the lattice.
    for n in [3_000, 100_000] {
        let star: Vec<String> = (0..=n)
            .map(|k| {
                let turn = std::f64::consts::TAU * f64::from(k % n) / f64::from(n);
                let r = if k % 2 == 0 { 0.4 } else { 0.1 };
                format!("[{},{}]", 0.5 + r * turn.cos(), 0.5 + r * turn.sin())
            })
            .collect();
        let flat = "[[[0,0,0],[4,0,0]],[[0,0,6],[4,0,6]]]";
        let fields = format!(
            r#""degrees":[1,1],"points":{flat},"holes":[[{{"points":[{}]}}]]"#,
            star.join(",")
        );
        all.add(format!("a star of {n} rays"), patch(&fields));
    }
    let one = format!(r#"{{"degrees":[2,1],"points":{POINTS}}}"#);
    let many = vec![one.as_str(); 50_000].join(",");
    all.add(
        "50,000 patches at one place",
        format!(r#"{{"enfilade":"patches","patches":[{many}]}}"#),
    );
    all.add("no patches", r#"{"enfilade":"patches","patches":[]}"#);
    let whole = patch(&format!(r#""degrees":[2,1],"points":{POINTS}"#));
    all.cut("", whole.as_bytes(), |c| c > 24);
}

/// Surfaces in OBJ.
fn objs(all: &mut Cases) {
    let vertices: String = (0..3)
        .flat_map(|j| (0..3).map(move |i| format!("v {i} {} {j}\n", i % 2)))
        .collect();
    let with = |rest: &str| format!("{vertices}cstype rat bspline\ndeg 2 2\n{rest}end\n");
    let knots = "parm u 0 0 0 1 1 1\nparm v 0 0 0 1 1 1\n";
    let surf = "surf 0 1 0 1 1 2 3 4 5 6 7 8 9\n";
    let many = "0 ".repeat(300_000);
    for (name, text) in [
        ("no knots", with(surf)),
        (
            "no end",
            with(&format!("{surf}{knots}")).replace("end\n", ""),
        ),
        (
            "too few points",
            with(&format!("surf 0 1 0 1 1 2 3\n{knots}")),
        ),
        (
            "points that are not there",
            with(&format!("surf 0 1 0 1 1 2 3 4 5 6 7 8 99\n{knots}")),
        ),
        (
            "an empty range",
            with(&format!("surf 1 1 0 1 1 2 3 4 5 6 7 8 9\n{knots}")),
        ),
        (
            "a range of no number",
            with(&format!("surf nan inf 0 1 1 2 3 4 5 6 7 8 9\n{knots}")),
        ),
        (
            "knots without end",
            with(&format!("{surf}parm u {many}\nparm v {many}\n")),
        ),
        (
            "a trim that is not there",
            with(&format!("{surf}{knots}trim 0 1 7\n")),
        ),
        (
            "degree 0",
            format!("{vertices}cstype bezier\ndeg 0 0\n{surf}end\n"),
        ),
        (
            "degree 99999999",
            format!("{vertices}cstype bezier\ndeg 99999999 9\n{surf}end\n"),
        ),
        ("parm alone", format!("{vertices}parm u 0 1\n")),
        (
            "points of no number",
            format!("v nan inf 1e999\n{}", with(&format!("{surf}{knots}"))),
        ),
    ] {
        all.add(format!("obj: {name}"), text);
    }
}
