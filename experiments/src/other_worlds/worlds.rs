//! The worlds of `other-worlds`: sensors that differ from their description in one way each.

use palpate_core::sensor::family::bent;
use palpate_core::sensor::{Coupling, CoveringEdge, SensorDescription, SensorParameters};
use palpate_core::units::MM;
use palpate_sim::press::{CoveringConfig, Physics};

use crate::sensing::Sensing;

/// A sensor as it is built.
pub(super) struct World {
    pub(super) name: &'static str,
    pub(super) sensing: Sensing,
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
    let world = |name, sensing| World { name, sensing };
    let elastic = |covering| Sensing {
        physics: Physics::ElasticCovering(covering),
        ..Sensing::with(described.clone())
    };
    let mut worlds: Vec<World> =
        built.into_iter().map(|(name, sensor)| world(name, sensing(sensor))).collect();
    worlds.push(world("bonded_layer", elastic(CoveringConfig::bonded_layer(described))));
    worlds.push(world("half_space", elastic(CoveringConfig::half_space(described))));
    worlds
}
