//! Text about the trust in a sensor's description.

use palpate_client::schemas::SensorKnowledge;

/// Meaning of a level of knowledge for trainings from meshes.
pub(crate) fn meaning(knowledge: SensorKnowledge) -> &'static str {
    match knowledge {
        SensorKnowledge::Measured => {
            "meshes are pressed exactly as described; unless this very sensor was measured or is \
             simulated, `--knowledge data_sheet` recognises more"
        }
        SensorKnowledge::DataSheet => {
            "meshes are pressed with many sensors that the description may stand for; twenty touches \
             with `palpate sensors commission` tell which one yours is"
        }
        SensorKnowledge::Unknown => {
            "meshes are pressed with many sensors of this grid; the numbers of a data sheet, or \
             `palpate sensors commission`, save touches"
        }
        SensorKnowledge::Commissioned => {
            "meshes are pressed with sensors as this one was measured; commission it again when its \
             health asks for it"
        }
    }
}
