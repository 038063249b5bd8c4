//! Text about the trust in a sensor's description.

use palpate_client::schemas::SensorKnowledge;

/// Meaning of a level of knowledge for trainings from meshes.
pub(crate) fn meaning(knowledge: SensorKnowledge) -> &'static str {
    match knowledge {
        SensorKnowledge::Measured => {
            "meshes are pressed exactly as described: right only for a sensor that is measured \
             or simulated"
        }
        SensorKnowledge::DataSheet => {
            "meshes are pressed with many sensors that the description may stand for, so that \
             spread, edge and stiffness need not be known"
        }
        SensorKnowledge::Unknown => {
            "meshes are pressed with many sensors of the same grid, twice as different as a data \
             sheet allows: recognition needs more touches"
        }
        SensorKnowledge::Commissioned => {
            "meshes are pressed with sensors as touches of a known object measured this one"
        }
    }
}
