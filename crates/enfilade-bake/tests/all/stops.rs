//! A bake stops when its work budget is spent: promptly, and with an error that names the stage, in every stage.

use enfilade_bake::{BakeConfig, BakeContext, BakeError, Budget, Method, Stage, bake};
use enfilade_geom::scene::Scene;
use enfilade_geom::{Aabb, DVec3};
use enfilade_testkit::solid::MeshBuilder;
use enfilade_testkit::{Site, furnished_house};

/// Most work spent beyond the budget: about 20 ms, on two threads or more.
const MOST_BEYOND: u64 = 400_000;

/// Deterministic numbers in `0..1` (SplitMix64).
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 40) as f64 / f64::from(1 << 24)
    }

    fn point(&mut self, size: f64) -> DVec3 {
        DVec3::from_array([0; 3].map(|_| size * self.next()))
    }
}

/// A scene of one mesh.
fn scene_of(fill: impl FnOnce(&mut MeshBuilder, &mut Random)) -> Scene {
    let mut site = Site::new("nasty");
    let plaster = site.material("plaster", [0.8; 3]);
    let mut mesh = MeshBuilder::new(plaster);
    fill(&mut mesh, &mut Random(7));
    site.structure("nasty", mesh);
    site.finish().scene
}

/// Triangles with edges up to `edge`, anywhere in a box.
fn soup(n: usize, size: f64, edge: f64) -> Scene {
    scene_of(|mesh, random| {
        for _ in 0..n {
            let at = random.point(size);
            let corners = [0; 3].map(|_| at + random.point(edge));
            mesh.convex(&corners);
        }
    })
}

/// Intersecting boxes.
fn boxes(n: usize) -> Scene {
    scene_of(|mesh, random| {
        for _ in 0..n {
            let at = random.point(8.0);
            mesh.cuboid(Aabb::new(at, at + DVec3::ONE + random.point(3.0)));
        }
    })
}

fn scenes() -> [(&'static str, Scene); 5] {
    [
        ("house", furnished_house().scene),
        ("random", soup(30, 1.0, 6.0)),
        ("confetti", soup(120, 5.0, 1.0)),
        ("boxes", boxes(12)),
        (
            "slivers",
            scene_of(|mesh, random| {
                for _ in 0..60 {
                    let [a, b] = [0; 2].map(|_| 6.0 * random.next());
                    let tip = random.point(6.0);
                    let foot = [DVec3::new(a, 0.0, 0.0), DVec3::new(b, 0.001, 0.001)];
                    mesh.convex(&[tip, foot[0], foot[1]]);
                }
            }),
        ),
    ]
}

/// Returns the work of each stage of a bake, or its error.
fn baked(scene: &Scene, method: Method, work: u64) -> Result<Vec<(Stage, u64)>, BakeError> {
    let config = BakeConfig {
        budget: Budget {
            work: Some(work),
            ..Budget::default()
        },
        min_opening: 1.2,
        ..BakeConfig::of(method)
    };
    bake(scene, &config, &BakeContext::default()).map(|baked| baked.work)
}

fn each_stage_of(method: Method) {
    let mut n_stopped = 0;
    for (name, scene) in scenes() {
        let whole = baked(&scene, method, u64::MAX).unwrap_or_else(|e| panic!("{name}: {e}"));
        assert_eq!(whole.len(), method.stages().len(), "{name}");
        let mut before = 0;
        for (stage, work) in whole {
            // Half way, and just before its end.
            for part in [work / 2, work.saturating_sub(1)] {
                let allowed = before + part;
                if part >= work {
                    continue;
                }
                let stopped = baked(&scene, method, allowed);
                match stopped {
                    Err(BakeError::TooMuchWork {
                        stage: at, spent, ..
                    }) => {
                        assert_eq!(at, stage, "{name}: {allowed}");
                        let beyond = spent - allowed;
                        assert!(
                            beyond <= MOST_BEYOND,
                            "{name}, {stage:?}: {beyond} beyond {allowed}"
                        );
                        n_stopped += 1;
                    }
                    other => panic!("{name}, {stage:?}: {allowed} of {work}: {other:?}"),
                }
            }
            before += work;
        }
        // The sum is the same on any number of threads, and so is the sufficient budget.
        assert!(baked(&scene, method, before).is_ok(), "{name}: {before}");
    }
    // All scenes, all stages that do anything.
    assert!(
        n_stopped >= 5 * 2 * (method.stages().len() - 2),
        "{n_stopped}"
    );
}

#[test]
fn each_stage_of_the_watershed_answers_to_a_stop() {
    each_stage_of(Method::Watershed);
}

#[test]
fn each_stage_of_the_partition_answers_to_a_stop() {
    each_stage_of(Method::Bsp);
}

#[test]
fn each_stage_of_the_delaunay_builder_answers_to_a_stop() {
    each_stage_of(Method::Delaunay);
}
