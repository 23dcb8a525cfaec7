//! Lamps of the input: point and spot lights of the glTF extension `KHR_lights_punctual`.

use enfilade_cpg::World;
use enfilade_geom::DVec3;
use enfilade_geom::scene::{Fixture, FixtureKind};
use enfilade_world::PartId;
use serde_json::Value;

use super::{LampCone, LampLight};

/// Light of the middle one of a world's lamps on a surface that faces it 2 m away.
const TYPICAL: f32 = 0.5;
/// Most by which lamps are brighter or darker than the middle one.
const SPREAD: f32 = 8.0;
/// Light at which a lamp without a range ends.
const FAINTEST: f32 = 0.02;
/// Largest range. [Units: wu]
const FARTHEST: f32 = 40.0;

/// Returns the point and spot lights of a world as lamps in the frame of `part`. Directional lights are left out: the sun
/// is always the renderer's own.
///
/// Files give candela, but modelers use them as they like, from 1 to 100,000 for the same room. So lamps are exposed like a
/// photograph of a lit room: the middle one of all (by intensity) lights a surface 2 m away half as bright as an outdoor
/// surface in the shade, and the others relative to it, by a factor of 8 at most. A lamp without a range ends where it is
/// faint, 40 m away at most.
#[must_use]
pub fn lamp_lights(world: &World, part: PartId) -> Vec<LampLight> {
    let lit = world.fixtures.iter().filter_map(|f| lamp_of(f, part));
    let mut lights: Vec<LampLight> = lit.collect();
    let strength = |l: &LampLight| l.color.into_iter().fold(0.0, f32::max);
    let mut strengths: Vec<f32> = lights.iter().map(strength).collect();
    strengths.sort_by(f32::total_cmp);
    let middle = strengths.get(strengths.len() / 2).copied().unwrap_or(1.0);
    for light in &mut lights {
        let own = strength(light);
        let exposed = TYPICAL * 4.0 * (own / middle).clamp(1.0 / SPREAD, SPREAD);
        light.color = light.color.map(|c| c / own * exposed);
        let faint = (exposed / FAINTEST).sqrt();
        light.range = light.range.min(faint).min(FARTHEST);
    }
    lights
}

/// Returns the lamp of a fixture, its color in candela; `None` for others than point and spot lights, and for dark ones.
fn lamp_of(fixture: &Fixture, part: PartId) -> Option<LampLight> {
    if fixture.kind != FixtureKind::Light {
        return None;
    }
    let value: Value = serde_json::from_str(&fixture.gltf).ok()?;
    let number = |v: &Value, or: f64| v.as_f64().filter(|x| x.is_finite()).unwrap_or(or);
    let intensity = number(&value["intensity"], 1.0) as f32;
    let color = [0, 1, 2].map(|k| number(&value["color"][k], 1.0).clamp(0.0, 1.0) as f32);
    let cone = match value["type"].as_str()? {
        "point" => None,
        "spot" => Some(LampCone {
            toward: fixture
                .transform
                .transform_vector3(DVec3::NEG_Z)
                .as_vec3()
                .to_array(),
            inner: number(&value["spot"]["innerConeAngle"], 0.0) as f32,
            outer: number(
                &value["spot"]["outerConeAngle"],
                std::f64::consts::FRAC_PI_4,
            ) as f32,
        }),
        _ => return None,
    };
    let at = fixture.transform.w_axis.truncate().as_vec3();
    let color = color.map(|c| c * intensity);
    let range = number(&value["range"], f64::INFINITY) as f32;
    let is_lit = color.iter().any(|c| *c > 0.0) && color.iter().all(|c| c.is_finite());
    (is_lit && at.is_finite() && range > 0.0).then_some(LampLight {
        part,
        at: at.to_array(),
        color,
        range,
        cone,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use enfilade_geom::DMat4;

    fn light(gltf: &str, x: f64) -> Fixture {
        Fixture {
            kind: FixtureKind::Light,
            name: String::new(),
            transform: DMat4::from_translation(DVec3::new(x, 2.0, 3.0)),
            gltf: gltf.into(),
            extras: String::new(),
        }
    }

    #[test]
    fn lamps_are_read_and_exposed_by_the_middle_one() {
        let world = World {
            fixtures: vec![
                light(r#"{"type":"point","intensity":54351}"#, 1.0),
                light(
                    r#"{"type":"point","intensity":54351,"color":[1,0.5,0],"range":3}"#,
                    2.0,
                ),
                light(r#"{"type":"spot","intensity":9e9,"spot":{}}"#, 3.0),
                light(r#"{"type":"directional","intensity":10}"#, 4.0),
                light(r#"{"type":"point","intensity":0}"#, 5.0),
                light("no JSON", 6.0),
            ],
            ..World::default()
        };
        let lamps = lamp_lights(&world, PartId::ROOT);
        assert_eq!(lamps.len(), 3);
        assert_eq!(lamps[0].color, [2.0; 3]);
        assert_eq!((lamps[1].color, lamps[1].range), ([2.0, 1.0, 0.0], 3.0));
        assert_eq!((lamps[2].at, lamps[2].color), ([3.0, 2.0, 3.0], [16.0; 3]));
        let cone = lamps[2].cone.unwrap();
        assert_eq!((cone.toward, cone.inner), ([0.0, 0.0, -1.0], 0.0));
        assert!((lamps[0].range - 10.0).abs() < 1e-4);
    }
}
