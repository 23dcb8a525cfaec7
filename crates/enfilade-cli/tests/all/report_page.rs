//! Opens the page of `enfilade report` in a headless browser, and uses it as a reader would.
//!
//! Needs Chromium; without it, prints a note and passes. The browser has no network.

use std::path::{Path, PathBuf};
use std::process::Command;

use enfilade::cpg::Cell;
use enfilade::import::export_glb;
use enfilade_testkit::furnished_house;

/// The actions of a reader in the page, and their results: an element `answers` at the end of the page.
const READER: &str = r##"<script>
addEventListener("load", () => {
  const one = (query) => document.querySelector(query);
  const n = (query) => document.querySelectorAll(query).length;
  const seen = (query) => [...document.querySelectorAll(query)].filter((e) => e.getClientRects().length > 0).length;
  const point = (element) => element.dispatchEvent(new PointerEvent("pointerover", { bubbles: true }));
  const answers = {};
  // Pictures in the page are not requests.
  answers.requests = performance.getEntriesByType("resource").filter((e) => !e.name.startsWith("data:")).length;
  answers.errors = window.errors;
  const cell = one("tr[data-cell]").dataset.cell;
  point(one(`tr[data-cell="${cell}"]`));
  answers.plan_of_row = n(`path.cell.lit[data-cell="${cell}"]`);
  answers.graph_of_row = n(`.graph g.lit[data-cell="${cell}"]`);
  answers.matrix_of_row = n(`.matrix g.lit[data-cell="${cell}"]`);
  answers.others_of_row = [...document.querySelectorAll(".lit[data-cell]")].filter((e) => e.dataset.cell !== cell).length;
  const room = [...document.querySelectorAll("path.cell")].find((e) => e.dataset.cell !== cell);
  point(room);
  const row = `table:not(#reasons) tr.lit[data-cell="${room.dataset.cell}"]`;
  answers.row_of_plan = n(row);
  answers.reasons = n(`#reasons tr[data-cell="${room.dataset.cell}"]`);
  answers.reasons_lit = n(`#reasons tr.lit[data-cell="${room.dataset.cell}"]`);
  answers.told = n("#why:not([hidden]) p");
  answers.left_lit = n(`.lit[data-cell="${cell}"]`);
  room.dispatchEvent(new MouseEvent("click", { bubbles: true }));
  point(one("h1"));
  answers.kept = n(row);
  answers.edges = n("line.lit");
  answers.voids = document.body.dataset.voids.split(" ").filter(Boolean).length;
  answers.voids_before = seen("tr.void");
  const rows = seen("tr[data-cell]");
  const matrices = seen(".matrix");
  if (one("#voids")) one("#voids").click();
  answers.voids_after = seen(".void");
  answers.rows_hidden = rows - seen("tr[data-cell]");
  answers.matrices = [matrices, seen(".matrix")];
  answers.matrix_rows = [...document.querySelectorAll(".matrix")].filter((e) => e.getClientRects().length > 0)[0].querySelectorAll("g").length;
  // Disks of the graph lie apart, and their numbers are legible.
  const disks = [...document.querySelectorAll(".graph g:not(.void) circle")].map((e) => e.getBoundingClientRect());
  answers.disks = disks.length;
  answers.overlaps = disks.flatMap((a, i) => disks.slice(i + 1).filter((b) =>
    Math.hypot(a.x + a.width / 2 - b.x - b.width / 2, a.y + a.height / 2 - b.y - b.height / 2) < (a.width + b.width) / 2)).length;
  answers.letters = Math.min(...[...document.querySelectorAll(".graph g:not(.void) text")].map((e) => e.getBoundingClientRect().height));
  const out = document.createElement("pre");
  out.id = "answers";
  out.textContent = JSON.stringify(answers);
  document.body.append(out);
});
</script></body>"##;

/// In the page's head, before all scripts.
const WATCH: &str = "<script>window.errors = 0; addEventListener('error', () => window.errors += 1);</script></head>";

fn chromium() -> Option<PathBuf> {
    let path = std::env::var_os("PATH")?;
    let names = ["chromium", "chromium-browser", "google-chrome"];
    std::env::split_paths(&path)
        .flat_map(|dir| names.map(|name| dir.join(name)))
        .find(|file| file.is_file())
}

fn folder(name: &str) -> PathBuf {
    let dir = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("page-{name}"));
    let _ = std::fs::remove_dir_all(&dir);
    std::fs::create_dir_all(&dir).unwrap();
    dir
}

fn report(dir: &Path, world: &str) -> String {
    let done = Command::new(env!("CARGO_BIN_EXE_enfilade"))
        .args([
            "report",
            world,
            "-o",
            "page.html",
            "--no-pictures",
            "--views",
            "2",
        ])
        .current_dir(dir)
        .output()
        .unwrap();
    assert!(done.status.success(), "{done:?}");
    std::fs::read_to_string(dir.join("page.html")).unwrap()
}

/// The results of the reader; `None` without a browser.
fn read(dir: &Path, page: &str) -> Option<serde_json::Value> {
    let Some(browser) = chromium() else {
        eprintln!("skipped: there is no Chromium to open the page in; apt-get install chromium");
        return None;
    };
    let page = page
        .replacen("</head>", WATCH, 1)
        .replacen("</body>", READER, 1);
    let file = dir.join("read.html");
    std::fs::write(&file, page).unwrap();
    let done = Command::new(browser)
        .args([
            "--headless",
            "--no-sandbox",
            "--disable-gpu",
            "--no-first-run",
            "--disable-background-networking",
            "--disable-component-update",
            "--disable-sync",
            "--disable-dev-shm-usage",
            // Requests by host name fail.
            "--host-resolver-rules=MAP * ~NOTFOUND",
            "--window-size=1100,1600",
            "--virtual-time-budget=5000",
            "--dump-dom",
        ])
        .arg(format!("--user-data-dir={}", dir.join("profile").display()))
        .arg(format!("file://{}", file.display()))
        .output()
        .unwrap();
    let dom = String::from_utf8_lossy(&done.stdout);
    let found = dom.split_once("<pre id=\"answers\">");
    let Some((_, rest)) = found else {
        panic!(
            "the page was not read: {}",
            String::from_utf8_lossy(&done.stderr)
        );
    };
    let (json, _) = rest.split_once("</pre>").unwrap();
    Some(serde_json::from_str(json).unwrap())
}

/// A house, and a space above a ceiling without a floor to stand on.
fn house(dir: &Path) -> String {
    let scene = dir.join("house.glb");
    std::fs::write(&scene, export_glb(&furnished_house().scene)).unwrap();
    let done = Command::new(env!("CARGO_BIN_EXE_enfilade"))
        .args([
            "bake",
            "-q",
            "house.glb",
            "-o",
            "world.glb",
            "--voxel",
            "0.2",
        ])
        .current_dir(dir)
        .output()
        .unwrap();
    assert!(done.status.success(), "{done:?}");
    let mut world = enfilade::open(dir.join("world.glb")).unwrap();
    // Those of the bake know no other room.
    world.room_facts = None;
    // Without floor and doorway: the marks of a void.
    world.graph.cells.push(Cell {
        name: "cavity".into(),
        aabb: [[4.0, 2.7, 4.0], [5.0, 2.8, 5.0]],
        volume: 0.1,
        ..Cell::default()
    });
    enfilade::save(dir.join("void.glb"), &world).unwrap();
    "void.glb".into()
}

#[test]
fn rooms_light_up_everywhere_and_voids_go() {
    let dir = folder("house");
    let world = house(&dir);
    let page = report(&dir, &world);
    let Some(a) = read(&dir, &page) else { return };
    let number = |key: &str| a[key].as_u64().unwrap_or_else(|| panic!("{key} in {a}"));
    assert_eq!((number("requests"), number("errors")), (0, 0), "{a}");
    assert!(number("plan_of_row") >= 1, "{a}");
    assert_eq!(
        (number("graph_of_row"), number("others_of_row")),
        (1, 0),
        "{a}"
    );
    assert!(number("matrix_of_row") >= 1, "{a}");
    assert_eq!((number("row_of_plan"), number("left_lit")), (1, 0), "{a}");
    assert_eq!(number("kept"), 1, "{a}");
    assert!(
        number("reasons") >= 1 && number("told") >= number("reasons"),
        "{a}"
    );
    assert_eq!(number("reasons_lit"), number("reasons"), "{a}");
    assert!(number("edges") >= 1, "{a}");
    assert_eq!(
        (
            number("voids"),
            number("voids_before"),
            number("voids_after"),
            number("rows_hidden")
        ),
        (1, 1, 0, 1),
        "{a}"
    );
    assert_eq!(a["matrices"], serde_json::json!([1, 1]), "{a}");
    // Twelve rooms and the outdoors.
    assert_eq!(number("matrix_rows"), 13, "{a}");
}

#[test]
fn a_graph_of_a_hundred_rooms_is_readable() {
    use enfilade_testkit::{GridParams, room_grid};
    let dir = folder("hundred");
    let world = room_grid(&GridParams::offices(100, 1));
    enfilade::save(dir.join("world.glb"), &world).unwrap();
    let page = report(&dir, "world.glb");
    let Some(a) = read(&dir, &page) else { return };
    assert!(a["disks"].as_u64().unwrap() >= 100, "{a}");
    assert_eq!(a["overlaps"], 0, "{a}");
    assert!(a["letters"].as_f64().unwrap() >= 11.0, "{a}");
    assert_eq!(a["errors"], 0, "{a}");
}
