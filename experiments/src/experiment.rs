//! Every experiment with its arguments: one struct parses them, states them in the record and
//! gives the command line again.

use std::str::FromStr;

use clap::{Parser, Subcommand};
use serde::Serialize;
use serde_json::{Map, Value};

use crate::camera::{self, Camera};
use crate::commissioning::{self, CommissioningTrials};
use crate::consistency::{self, Consistency};
use crate::contact_rates::{self, ContactRates};
use crate::controllers::{self, Controllers};
use crate::covering::{self, Covering};
use crate::exploration::Exploration;
use crate::explorations::ExplorationTrials;
use crate::geometric_elsewhere::{self, GeometricElsewhere};
use crate::large_content::{self, LargeContent};
use crate::letters_appearance::{self, LettersAppearance};
use crate::letters_geometric::{self, LettersGeometric};
use crate::letters_sva::{self, LettersSva};
use crate::next_touch::{self, NextTouch};
use crate::object_trials::ObjectTrials;
use crate::other_physics::{self, OtherPhysics};
use crate::other_worlds::{self, OtherWorlds};
use crate::planner_trials::PlannerTrials;
use crate::ppf_peer::{self, PpfPeer};
use crate::real_contacts::{self, RealContacts};
use crate::real_edges::{self, RealEdges};
use crate::real_frames::{self, RealFrames};
use crate::report::{Outcome, Progress};
use crate::restart::{self, Restart};
use crate::server_throughput::{self, ServerThroughput};
use crate::several_servers::{self, SeveralServers};
use crate::sim_to_real::{self, SimToReal};
use crate::skins::{self, Skins};
use crate::solid_geometry::{self, SolidGeometry};
use crate::surface_noise::{self, SurfaceNoise};
use crate::surface_objects::{self, SurfaceObjects};
use crate::surface_scale::{self, SurfaceScale};
use crate::sva_objects::{self, SvaObjects};
use crate::symmetry::{self, SymmetryTrials};
use crate::thinning::{self, Thinning};
use crate::unknown::{self, Unknown};
use crate::{
    appearance_rules, covering_thickness, descriptors, exploration, noise, perturbation, resolution,
};

/// Command line before the name of an experiment.
pub const PROGRAM: &str = "palpate experiment";

/// An experiment and its arguments.
#[derive(Clone, Debug, Serialize, Subcommand)]
#[serde(rename_all = "kebab-case")]
pub enum Experiment {
    /// Section 5.5.1: accuracy and errors of pose against readings, literal and default.
    SvaObjects(SvaObjects),
    /// Section 3.4: raised letters by geometry, histogram and particle filters.
    LettersGeometric(LettersGeometric),
    /// Section 5.5.2: raised letters by spatially varying appearance, as printed and as served.
    LettersSva(LettersSva),
    /// Presses and converged readings per second on one core.
    ContactRates(ContactRates),
    /// Chapter 2: elastic reference, point spread, choice of a covering, H indenter.
    Covering(Covering),
    /// Symmetries by touches alone and by the mesh: ten solids, also with a handle or a notch.
    Symmetry(SymmetryTrials),
    /// Figure 4.8: every descriptor on ten objects, accuracy against readings.
    Descriptors(PlannerTrials),
    /// Sections 4.3.1.2 and 4.4.2.1: clusterings, and comparisons of histograms.
    AppearanceRules(ObjectTrials),
    /// Figure 4.14: appearance under coverings of 0.04 to 0.20 inch.
    CoveringThickness(PlannerTrials),
    /// Figure 4.15: appearance with 6×6, 14×14 and 26×26 taxels over 12 mm.
    Resolution(PlannerTrials),
    /// Figure 4.16: appearance under noise of up to 40 % of the sensing range.
    Noise(PlannerTrials),
    /// Figure 4.19: raised letters by appearance alone, 52 simulated and 5 on the rig.
    LettersAppearance(LettersAppearance),
    /// Figure 4.20: letters learnt in simulation, recognised with another sensor.
    SimToReal(SimToReal),
    /// Real frames of a 28×50 array, without poses.
    RealFrames(RealFrames),
    /// Points felt by a real hand, against meshes.
    RealContacts(RealContacts),
    /// Where a cable lies under a real array of pillars, from one touch
    RealEdges(RealEdges),
    /// Figure 5.2: similarity of touches against their distance.
    Consistency(Consistency),
    /// Section 5.5.1 by surface matching, beside SVA as served and as printed.
    SurfaceObjects(SurfaceObjects),
    /// Catalogues of fifty, a hundred and on demand a thousand objects.
    SurfaceScale(SurfaceScale),
    /// Touches needed with and without a camera's word about the pose, true or not.
    Camera(Camera),
    /// Presses until an object is recognised and stays so, by choice of the next touch.
    NextTouch(NextTouch),
    /// Objects that the catalogue does not hold: detection, calibration and the stop rule.
    Unknown(Unknown),
    /// Trained on the point spread, tested on elastic coverings.
    OtherPhysics(OtherPhysics),
    /// Trained from meshes, tested with other coverings, stiffness and tool centres.
    OtherWorlds(OtherWorlds),
    /// Touches to recognise by arrays, a row, a single taxel, and contacts without an image.
    Skins(Skins),
    /// Mistakes of a set-up, found by twenty touches of a known object.
    Commissioning(CommissioningTrials),
    /// Noise, errors of the arm's pose, moving objects, and sensors other than in training.
    SurfaceNoise(SurfaceNoise),
    /// Accuracy with fewer touches kept of each object, farthest first and at random.
    Thinning(Thinning),
    /// `geometric` with solid maps: accuracy by the size of the box of poses.
    SolidGeometry(SolidGeometry),
    /// `geometric` on noise, coverings, physics and fonts other than those of training.
    GeometricElsewhere(GeometricElsewhere),
    /// OpenCV's point-pair features and ICP on the same touches.
    PpfPeer(PpfPeer),
    /// Figures 4.11 and 4.12: strategies of exploration, and the sampler's readings.
    Exploration(Exploration),
    /// Figure 4.13: objects that move each time they are touched.
    Perturbation(ExplorationTrials),
    /// Figure 4.17: convergence of the contact controllers under noise.
    Controllers(Controllers),
    /// Readings per second through a whole server, at 1, 8 and 64 sessions.
    ServerThroughput(ServerThroughput),
    /// The same readings through a folder and through one to three servers on a NATS cluster.
    SeveralServers(SeveralServers),
    /// Start and memory of a second server on a NATS cluster, by where large content is.
    LargeContent(LargeContent),
    /// Time from a restart until the beliefs of all open sessions are answered again.
    Restart(Restart),
}

/// Command line after [`PROGRAM`].
#[derive(Parser)]
struct Typed {
    #[command(subcommand)]
    experiment: Experiment,
}

impl Experiment {
    /// Runs the experiment; most take minutes.
    ///
    /// # Errors
    /// When objects cannot be loaded, touched or learnt, or a server of its own fails.
    pub fn run(&self, progress: Progress<'_>) -> anyhow::Result<Outcome> {
        match self {
            Self::SvaObjects(config) => sva_objects::run(config, progress),
            Self::LettersGeometric(config) => letters_geometric::run(config, progress),
            Self::LettersSva(config) => letters_sva::run(config, progress),
            Self::ContactRates(config) => contact_rates::run(config, progress),
            Self::Covering(config) => covering::run(config, progress),
            Self::Symmetry(config) => symmetry::run(config, progress),
            Self::Descriptors(config) => descriptors::run(config, progress),
            Self::AppearanceRules(config) => appearance_rules::run(config, progress),
            Self::CoveringThickness(config) => covering_thickness::run(config, progress),
            Self::Resolution(config) => resolution::run(config, progress),
            Self::Noise(config) => noise::run(config, progress),
            Self::LettersAppearance(config) => letters_appearance::run(config, progress),
            Self::SimToReal(config) => sim_to_real::run(config, progress),
            Self::RealFrames(config) => real_frames::run(config, progress),
            Self::RealContacts(config) => real_contacts::run(config, progress),
            Self::RealEdges(config) => real_edges::run(config, progress),
            Self::Consistency(config) => consistency::run(config, progress),
            Self::SurfaceObjects(config) => surface_objects::run(config, progress),
            Self::Camera(config) => camera::run(config, progress),
            Self::SurfaceScale(config) => surface_scale::run(config, progress),
            Self::NextTouch(config) => next_touch::run(config, progress),
            Self::Unknown(config) => unknown::run(config, progress),
            Self::OtherPhysics(config) => other_physics::run(config, progress),
            Self::OtherWorlds(config) => other_worlds::run(config, progress),
            Self::Skins(config) => skins::run(config, progress),
            Self::Commissioning(config) => commissioning::run(config, progress),
            Self::SurfaceNoise(config) => surface_noise::run(config, progress),
            Self::Thinning(config) => thinning::run(config, progress),
            Self::SolidGeometry(config) => solid_geometry::run(config, progress),
            Self::GeometricElsewhere(config) => geometric_elsewhere::run(config, progress),
            Self::PpfPeer(config) => ppf_peer::run(config, progress),
            Self::Exploration(config) => exploration::run(config, progress),
            Self::Perturbation(config) => perturbation::run(config, progress),
            Self::Controllers(config) => controllers::run(config, progress),
            Self::ServerThroughput(config) => server_throughput::run(config, progress),
            Self::SeveralServers(config) => several_servers::run(config, progress),
            Self::LargeContent(config) => large_content::run(config, progress),
            Self::Restart(config) => restart::run(config, progress),
        }
    }

    /// Name of the experiment and of its files.
    #[must_use]
    pub fn name(&self) -> String {
        self.stated().0
    }

    /// Every argument by name, defaults included.
    #[must_use]
    pub fn arguments(&self) -> Map<String, Value> {
        self.stated().1
    }

    /// The command line that gives the same figures again: what differs from the defaults, and
    /// the seed.
    #[must_use]
    pub fn command_line(&self) -> String {
        let (name, arguments) = self.stated();
        let defaults = name.parse::<Self>().map(|plain| plain.arguments()).unwrap_or_default();
        let is_typed = |key: &str, value: &Value| key == "seed" || defaults.get(key) != Some(value);
        let typed = arguments.iter().filter(|(key, value)| is_typed(key, value));
        let words = typed.map(|(key, value)| word(&key.replace('_', "-"), value));
        format!("{PROGRAM} {name}{}", words.collect::<String>())
    }

    fn stated(&self) -> (String, Map<String, Value>) {
        let stated = serde_json::to_value(self).expect("arguments are numbers and text");
        let Value::Object(stated) = stated else { unreachable!("a variant with its arguments") };
        match stated.into_iter().next() {
            Some((name, Value::Object(arguments))) => (name, arguments),
            other => unreachable!("a variant with its arguments, not {other:?}"),
        }
    }
}

impl FromStr for Experiment {
    type Err = clap::Error;

    /// An experiment from its command line, whose words are separated by spaces.
    fn from_str(line: &str) -> Result<Self, clap::Error> {
        let words = line.strip_prefix(PROGRAM).unwrap_or(line).split_whitespace();
        Ok(Typed::try_parse_from(std::iter::once(PROGRAM).chain(words))?.experiment)
    }
}

/// An argument as it is typed, with a space before it.
fn word(name: &str, value: &Value) -> String {
    let text = |value: &Value| match value {
        Value::String(text) => text.clone(),
        other => other.to_string(),
    };
    match value {
        Value::Null | Value::Bool(false) => String::new(),
        Value::Bool(true) => format!(" --{name}"),
        Value::Array(values) => {
            format!(" --{name} {}", values.iter().map(text).collect::<Vec<_>>().join(","))
        }
        other => format!(" --{name} {}", text(other)),
    }
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory as _;

    use super::*;

    fn typed(line: &str) -> Experiment {
        line.parse().unwrap()
    }

    #[track_caller]
    fn check(line: &str) {
        let experiment = typed(line);
        let again = typed(&experiment.command_line());
        assert_eq!(again.command_line(), experiment.command_line());
        assert_eq!(again.arguments(), experiment.arguments());
        assert_eq!(experiment.command_line(), line);
    }

    #[test]
    fn a_command_line_gives_the_same_arguments_again() {
        for command in Typed::command().get_subcommands() {
            let needed = match command.get_name() {
                name if name.starts_with("real-") => " --data folder",
                "several-servers" => " --nats nats://host",
                "large-content" => " --nats nats://host --palpate palpate",
                _ => "",
            };
            let line = format!("{PROGRAM} {}{needed}", command.get_name());
            let experiment = typed(&line);
            assert_eq!(typed(&experiment.command_line()).arguments(), experiment.arguments());
        }
        check("palpate experiment sva-objects --as-printed --public --seed 3 --trials 50");
        check("palpate experiment surface-scale --objects 10,25 --pool more --seed 1 --thousand");
        check(
            "palpate experiment letters-geometric --maps as-printed --method grid,adaptive --seed 1",
        );
        check("palpate experiment surface-noise --meshes m --only arm --seed 2 --size-mm 40.0");
    }

    #[test]
    fn what_is_out_of_range_is_refused() {
        for line in [
            "sva-objects --trials 0",
            "sva-objects --size-mm 0.08",
            "sva-objects --public --meshes m",
            "letters-geometric --letters AA",
            "unknown --prior 2",
        ] {
            assert!(line.parse::<Experiment>().is_err(), "{line}");
        }
    }

    #[test]
    fn the_arguments_are_well_formed() {
        Typed::command().debug_assert();
    }
}
