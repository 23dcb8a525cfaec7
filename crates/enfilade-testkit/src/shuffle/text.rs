//! Text scenes with lines and blocks in another order.

use enfilade_demo::Rng;

/// Returns an OBJ file with its positions in another order, as well as the faces between two names or materials, each
/// triangle starting at another vertex. Texture coordinates and normals stay in their places.
///
/// # Panics
/// If a face refers to positions from the end, or to none.
#[must_use]
pub fn shuffled_obj(text: &str, seed: u64) -> String {
    let mut rng = Rng::new(seed);
    let is_position = |line: &&str| line.starts_with("v ");
    let mut positions: Vec<(usize, &str)> = text.lines().filter(is_position).enumerate().collect();
    rng.shuffle(&mut positions);
    let mut number = vec![0; positions.len()];
    for (new, (old, _)) in positions.iter().enumerate() {
        number[*old] = new + 1;
    }
    let corner = |corner: &str| -> String {
        let (position, rest) = corner
            .split_once('/')
            .map_or((corner, String::new()), |(p, rest)| (p, format!("/{rest}")));
        let old: usize = position.parse().expect("counted from the first");
        format!("{}{rest}", number[old - 1])
    };
    let mut out: Vec<String> = positions.iter().map(|p| p.1.to_owned()).collect();
    let mut faces: Vec<String> = Vec::new();
    let rest = text.lines().filter(|line| !is_position(line));
    for line in rest.chain(["#"]) {
        if let Some(corners) = line.strip_prefix("f ") {
            let mut corners: Vec<String> = corners.split_whitespace().map(corner).collect();
            if corners.len() == 3 {
                corners.rotate_left(rng.below(3));
            }
            faces.push(format!("f {}", corners.join(" ")));
            continue;
        }
        // Coordinates may stand between faces.
        if !line.starts_with('v') {
            rng.shuffle(&mut faces);
            out.append(&mut faces);
        }
        out.push(line.to_owned());
    }
    out.join("\n")
}

/// Returns a Quake map with its entities, their brushes, and the sides of each brush in another order. Properties
/// stay in their places.
#[must_use]
pub fn shuffled_map(text: &str, seed: u64) -> String {
    let mut rng = Rng::new(seed);
    let (head, mut entities) = blocks(text.lines().filter(|l| !l.trim_start().starts_with("//")));
    rng.shuffle(&mut entities);
    let mut out: Vec<&str> = head;
    for entity in &entities {
        let (properties, mut brushes) = blocks(entity.iter().copied());
        rng.shuffle(&mut brushes);
        out.push("{");
        out.extend(properties);
        for brush in &mut brushes {
            if brush.iter().all(|side| side.trim_start().starts_with('(')) {
                rng.shuffle(brush);
            }
            out.push("{");
            out.extend(&*brush);
            out.push("}");
        }
        out.push("}");
    }
    out.join("\n")
}

/// Returns the lines outside of braces, and the contents of each outer pair of braces.
fn blocks<'t>(lines: impl Iterator<Item = &'t str>) -> (Vec<&'t str>, Vec<Vec<&'t str>>) {
    let (mut outside, mut inside) = (Vec::new(), Vec::new());
    let mut depth = 0;
    for line in lines {
        match line.trim() {
            "{" => {
                depth += 1;
                if depth == 1 {
                    inside.push(Vec::new());
                    continue;
                }
            }
            "}" => {
                depth -= 1;
                if depth == 0 {
                    continue;
                }
            }
            _ => {}
        }
        match inside.last_mut().filter(|_| depth > 0) {
            Some(block) => block.push(line),
            None => outside.push(line),
        }
    }
    (outside, inside)
}
