//! The worlds of `other-worlds`: sensors that differ from their description in one way each, and
//! some in all ways at once.
//!
//! `rig` is a crude array: no lateral spread, nothing felt beyond the array, cross-talk, a
//! stiffening skin, uneven gains and noise in proportion to the pressure. In `drake_beyond` and
//! `drake_ends` the contact is computed by Drake, an engine for simulating robots (`drake`): the
//! covering goes on beyond the array, or ends with it and loses the force that would spread beyond.

use anyhow::{bail, ensure};
use palpate_core::reading::Reading;
use palpate_core::sensor::family::bent;
use palpate_core::sensor::{Coupling, CoveringEdge, SensorDescription, SensorParameters};
use palpate_core::units::MM;
use palpate_sim::press::{CoveringConfig, Physics};

use super::drake::Drake;
use crate::objects::TestObject;
use crate::sensing::Sensing;

/// A sensor as it is built.
pub(super) struct World {
    pub(super) name: &'static str,
    pub(super) sensing: Sensing,
    engine: Engine,
}

/// Computation of the contact of covering and object.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Engine {
    /// Our simulator.
    Simulator,
    /// Drake, at the poses at which the sensor comes to rest in our simulator.
    Drake,
}

/// Worlds to play in.
pub(super) struct Wanted {
    pub(super) played: Vec<World>,
    /// Names of those that cannot be played here, and why.
    pub(super) left_out: Vec<(&'static str, String)>,
}

impl World {
    /// `n` readings of each object by the sampler of training, from one seed.
    pub(super) fn touch_all(
        &self,
        drake: &Drake,
        objects: &[TestObject],
        n: usize,
        seed: u64,
    ) -> anyhow::Result<Vec<Vec<Reading>>> {
        match self.engine {
            Engine::Simulator => self.sensing.touch_all(objects, n, seed),
            Engine::Drake => drake.touch_all(&self.sensing, objects, n, seed),
        }
    }
}

/// The worlds with these names, all if there are none. Those of Drake are left out if it is
/// missing.
pub(super) fn wanted(
    described: &SensorDescription,
    names: &[String],
    drake: &Drake,
) -> anyhow::Result<Wanted> {
    let mut played = all(described);
    let known: Vec<&str> = played.iter().map(|world| world.name).collect();
    if let Some(unknown) = names.iter().find(|name| !known.contains(&name.as_str())) {
        bail!("no world is named {unknown}, expected some of {}", known.join(", "));
    }
    played.retain(|world| names.is_empty() || names.iter().any(|name| name == world.name));
    let mut left_out = Vec::new();
    if played.iter().any(|world| world.engine == Engine::Drake)
        && let Some(reason) = drake.missing()?
    {
        let (without, with): (Vec<World>, Vec<World>) =
            played.into_iter().partition(|world| world.engine != Engine::Drake);
        left_out = with.iter().map(|world| (world.name, reason.clone())).collect();
        ensure!(!without.is_empty(), "no world can be played: {reason}");
        played = without;
    }
    Ok(Wanted { played, left_out })
}

/// All worlds, for a sensor with this description.
pub(super) fn all(described: &SensorDescription) -> Vec<World> {
    let known = described.parameters();
    let pitch = known.grid.pitch;
    let with = |change: &dyn Fn(&mut SensorParameters)| {
        let mut parameters = known.clone();
        change(&mut parameters);
        SensorDescription::new(parameters).expect("a world is within a description's limits")
    };
    let ending = |taxels: f64, edge| {
        with(&|p| p.coupling = Coupling { margin: Some(taxels * pitch), edge, ..p.coupling })
    };
    let spread = |sigma: f64| with(&|p| p.point_spread = sigma);
    let stiff = |stiffness, stiffening| {
        with(&|p| p.force_curve = bent(&p.force_curve, p.covering_thickness, stiffness, stiffening))
    };
    let (continues, conserves, loses) =
        (CoveringEdge::Continues, CoveringEdge::ConservesForce, CoveringEdge::LosesForce);
    let built = [
        ("matched", described.clone()),
        ("beyond_4_conserves", ending(4.0, conserves)),
        ("beyond_4_loses", ending(4.0, loses)),
        ("beyond_1_normalised", ending(1.0, continues)),
        ("beyond_1_conserves", ending(1.0, conserves)),
        ("beyond_1_loses", ending(1.0, loses)),
        ("ends_normalised", ending(0.0, continues)),
        ("ends_conserves", ending(0.0, conserves)),
        ("ends_loses", ending(0.0, loses)),
        ("spread_0_mm", spread(0.2 * MM)),
        ("spread_1_5_mm", spread(1.5 * MM)),
        ("spread_5_mm", spread(5.0 * MM)),
        ("stiffness_0_5", stiff(0.5, 0.0)),
        ("stiffness_2", stiff(2.0, 0.0)),
        ("stiffening", stiff(1.0, 2.0)),
        ("cross_talk", with(&|p| p.coupling.cross_talk = 0.12)),
    ];
    // Gains deviate by 5 % in every world. Elastic coverings have gains of their own.
    let sensing = |sensor| Sensing { gain_spread: 0.05, ..Sensing::with(sensor) };
    let world = |name, sensing| World { name, sensing, engine: Engine::Simulator };
    let elastic = |covering| Sensing {
        physics: Physics::ElasticCovering(covering),
        ..Sensing::with(described.clone())
    };
    let mut worlds: Vec<World> =
        built.into_iter().map(|(name, sensor)| world(name, sensing(sensor))).collect();
    worlds.push(world("bonded_layer", elastic(CoveringConfig::bonded_layer(described))));
    worlds.push(world("half_space", elastic(CoveringConfig::half_space(described))));
    worlds.push(world("rig", Sensing { relative_noise: RIG_NOISE, ..sensing(rig(described)) }));
    worlds.push(world("xela", xela(described)));
    let drake = |name, sensor| World { engine: Engine::Drake, ..world(name, sensing(sensor)) };
    worlds.push(drake("drake_beyond", described.clone()));
    worlds.push(drake("drake_ends", ending(0.0, loses)));
    worlds
}

/// The described grid with the electronics of a real XELA uSkin.
///
/// From 30 recordings of two units (`imanlab/tactile_prediction_flat_dataset`, raw counts of the
/// normal axis): of about 10,800 counts that the strongest grasp gave, noise has a deviation of 1.4;
/// a taxel that was let go reads up to 112 counts away from where it began, 48 in the median of
/// those recordings that end without contact, so after its driver subtracted the values at the
/// start its offset deviates by 0.5 % of the range. Nothing saturated. Gains deviate by the 10 %
/// that the preset assumes.
fn xela(described: &SensorDescription) -> Sensing {
    let known = described.parameters().clone();
    let saturation = known.saturation;
    let parameters = SensorParameters {
        noise: 1.3e-4 * saturation,
        quantisation: saturation / 10_800.0,
        ..known
    };
    let sensor =
        SensorDescription::new(parameters).expect("a world is within a description's limits");
    Sensing { gain_spread: 0.1, offset_spread: 0.005, ..Sensing::with(sensor) }
}

/// Noise of the rig in proportion to the pressure.
const RIG_NOISE: f64 = 0.02;

/// A crude rig of the described grid, range and thickness, with the proportions of one whose 8 × 8
/// taxels at 2.5 mm lie under a skin of 4 mm.
///
/// A taxel takes the mean indentation m of its whole cell, each of its neighbours adds 12 % of its
/// own, and the pressure is k (c / 1.48) (1 + c / t) with the sum c and the thickness t. On an even
/// press, c is 1.48 m in the middle of the array, and 1.36 or 1.24 m at its edge and in its corners:
/// the pressure in the middle is k m (1 + 1.48 m / t). Its description states 2 k m, the line to
/// 80 kPa at 4 mm with a k of 40 kPa in 4 mm. So full indentation gives 1.24 of what is described,
/// and 2.48 times the ratio of first touch. Here the pressure stiffens taxel by taxel, before the
/// cross-talk instead of after it. Additive noise is 80 Pa and a step of the converter 16 Pa in
/// 80 kPa. Presses are those of the other worlds, turned to the surface and to a quarter of the
/// range; the real rig's were neither.
fn rig(described: &SensorDescription) -> SensorDescription {
    let known = described.parameters().clone();
    let cross_talk = 0.12;
    let even = 1.0 + 4.0 * cross_talk;
    let at_full = 0.5 * (1.0 + even);
    let mut grid = known.grid;
    grid.taxel_width = grid.pitch;
    SensorDescription::new(SensorParameters {
        grid,
        // Too narrow to reach the next cell.
        point_spread: 0.1 * MM,
        force_curve: bent(&known.force_curve, known.covering_thickness, at_full / even, even),
        noise: 1e-3 * known.saturation,
        quantisation: 2e-4 * known.saturation,
        coupling: Coupling { margin: Some(0.0), cross_talk, ..known.coupling },
        ..known
    })
    .expect("a world is within a description's limits")
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use palpate_core::units::KPA;
    use palpate_sim::press::Load;
    use palpate_sim::shapes::LARGEST_DIMENSION;

    use super::*;
    use crate::objects::generated;

    #[test]
    fn an_even_press_reads_as_on_the_rig() {
        let described = SensorDescription::digitacts_6x6();
        let object = &generated(&["hammer"], LARGEST_DIMENSION).unwrap()[0];
        let simulator = Sensing::with(rig(&described)).simulator(object);
        let (thickness, k) = (2.54 * MM, 0.5 * 20.0 * KPA / (2.54 * MM));
        for depth in [0.2 * thickness, 0.6 * thickness] {
            let press = simulator.press_of(&[depth; 144]);
            let Load::Displacements(displacements) = &press.load else { panic!("a spread") };
            assert!(displacements.iter().all(|d| (d / depth - 1.0).abs() < 1e-9), "no spread");
            // In the middle, c is 1.48 times the depth: 48 % from four neighbours.
            let expected = k * depth * (1.0 + 1.48 * depth / thickness);
            let curve = &simulator.sensor().parameters().force_curve;
            let found = 1.48 * curve.pressure(depth);
            assert!((found / expected - 1.0).abs() < 0.01, "{found} for {expected}");
        }
    }

    #[test]
    fn worlds_of_drake_are_left_out_without_it() {
        let described = SensorDescription::digitacts_6x6();
        let drake = Drake { python: PathBuf::from("sh"), script: PathBuf::from("no/script.py") };
        let all = wanted(&described, &[], &drake).unwrap();
        let names: Vec<&str> = all.left_out.iter().map(|(name, _)| *name).collect();
        assert_eq!(names, ["drake_beyond", "drake_ends"]);
        assert!(all.played.iter().any(|world| world.name == "rig"));
        assert!(all.left_out[0].1.contains("no/script.py"), "{}", all.left_out[0].1);
        let error = wanted(&described, &["drake_ends".to_owned()], &drake).err().unwrap();
        assert!(error.to_string().contains("no world can be played"), "{error}");
        let error = wanted(&described, &["moon".to_owned()], &drake).err().unwrap();
        assert!(error.to_string().contains("moon"), "{error}");
    }
}
