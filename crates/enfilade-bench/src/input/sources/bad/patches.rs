//! Free-form patches: knots, counts, weights and loops that make no surface, or one of too many triangles.

use enfilade_testkit::Rng;

use super::cases::{BadSource, cuts};

const POINTS: &str = "[[[0,0,0],[2,3,0],[4,0,0]],[[0,0,6],[2,3,6],[4,0,6]]]";

fn patch(fields: &str) -> String {
    format!(r#"{{"enfilade":"patches","patches":[{{{fields}}}]}}"#)
}

pub(super) fn cases() -> Vec<BadSource> {
    [numbers(), many(), loops(), objs()]
        .into_iter()
        .flatten()
        .collect()
}

fn numbers() -> Vec<BadSource> {
    let mut all: Vec<BadSource> = Vec::new();
    let mut add = |name: String, text: String| all.push(BadSource::new(name, "json", text));
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
        add(
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
        add(format!("knots {knots}"), patch(&fields));
    }
    for (name, points) in [
        ("none", "[]".to_owned()),
        ("rows of none", "[[],[]]".to_owned()),
        (
            "uneven rows",
            "[[[0,0,0],[2,3,0],[4,0,0]],[[0,0,6]]]".to_owned(),
        ),
        (
            "all the same",
            "[[[1,1,1],[1,1,1],[1,1,1]],[[1,1,1],[1,1,1],[1,1,1]]]".to_owned(),
        ),
        (
            "in a line",
            "[[[0,0,0],[1,0,0],[2,0,0]],[[0,0,0],[1,0,0],[2,0,0]]]".to_owned(),
        ),
        ("not finite", POINTS.replace('6', "1e999")),
        ("no numbers", POINTS.replace('6', "null")),
        ("far apart", POINTS.replace('6', "1e8")),
        ("farther apart", POINTS.replace('6', "1e300")),
        ("far up", POINTS.replace("2,3", "2,9e8")),
        ("of no weight", POINTS.replace("2,3,0", "2,3,0,0")),
        ("of negative weight", POINTS.replace("2,3,0", "2,3,0,-1")),
        ("of all weight", POINTS.replace("2,3,0", "2,3,0,1e300")),
        ("of five numbers", POINTS.replace("2,3,0", "2,3,0,1,1")),
    ] {
        add(
            format!("points: {name}"),
            patch(&format!(r#""degrees":[2,1],"points":{points}"#)),
        );
    }
    all
}

fn many() -> Vec<BadSource> {
    let mut all: Vec<BadSource> = Vec::new();
    let mut add = |name: String, text: String| all.push(BadSource::new(name, "json", text));
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
        add(format!("{n} × {n} points at random"), patch(&fields));
    }
    all
}

fn loops() -> Vec<BadSource> {
    let mut all: Vec<BadSource> = Vec::new();
    let mut add = |name: String, text: String| all.push(BadSource::new(name, "json", text));
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
        add(format!("loops {name}"), patch(&fields));
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
        add(format!("a star of {n} rays"), patch(&fields));
    }
    let one = format!(r#"{{"degrees":[2,1],"points":{POINTS}}}"#);
    let many = vec![one.as_str(); 50_000].join(",");
    add(
        "50,000 patches at one place".into(),
        format!(r#"{{"enfilade":"patches","patches":[{many}]}}"#),
    );
    add(
        "no patches".into(),
        r#"{"enfilade":"patches","patches":[]}"#.into(),
    );
    let whole = patch(&format!(r#""degrees":[2,1],"points":{POINTS}"#));
    for cut in cuts(whole.len()).into_iter().filter(|&c| c > 24) {
        add(format!("cut after {cut}"), whole[..cut].into());
    }
    all
}

/// Surfaces in OBJ.
fn objs() -> Vec<BadSource> {
    let vertices: String = (0..3)
        .flat_map(|j| (0..3).map(move |i| format!("v {i} {} {j}\n", i % 2)))
        .collect();
    let with = |rest: &str| format!("{vertices}cstype rat bspline\ndeg 2 2\n{rest}end\n");
    let knots = "parm u 0 0 0 1 1 1\nparm v 0 0 0 1 1 1\n";
    let surf = "surf 0 1 0 1 1 2 3 4 5 6 7 8 9\n";
    let many = "0 ".repeat(300_000);
    [
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
    ]
    .into_iter()
    .map(|(name, text)| BadSource::new(format!("obj: {name}"), "obj", text))
    .collect()
}
