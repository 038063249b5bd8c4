//! Appearance trials on objects in simulation, shared by figures 4.8, 4.14, 4.15 and 4.16.
//!
//! Objects are touched by the sampler of section 4.4.1.2, once for training and validation
//! and once, from another seed, for testing. The classes are learnt from a part of the
//! training readings, histograms from all of them.

use clap::Args;
use palpate_core::descriptor::DescriptorKind;
use palpate_core::reading::Reading;
use palpate_core::sensor::SensorDescription;
use palpate_dissertation::appearance::model::{AppearanceModel, AppearanceRule};
use palpate_dissertation::appearance::train::AppearanceConfig;
use palpate_sim::noise::NoiseLevel;
use palpate_sim::plot::{Line, Panel};
use serde::Serialize;

use crate::appearance_trials::{Confused, Evidence, Point, accuracy_at, train_with_vocabulary_of};
use crate::arguments::{ObjectSet, count};
use crate::objects::{TestObject, touch_in_noise};
use crate::report::Report;

/// The descriptors of figures 4.14 to 4.16: the three best and the control.
pub const TOP_DESCRIPTORS: [DescriptorKind; 4] = [
    DescriptorKind::Mnti,
    DescriptorKind::PolarFourier,
    DescriptorKind::MomentNormalized,
    DescriptorKind::Vectorize,
];

/// Counts of readings after which accuracy is measured.
const COUNTS: [usize; 16] = [1, 2, 3, 4, 5, 6, 8, 10, 12, 15, 20, 30, 40, 60, 80, 100];

/// Counts that the summary states.
const STATED_AT: [usize; 4] = [5, 10, 20, 60];

/// Arguments of the appearance experiments on objects: the dissertation's 1,000 training,
/// 100 validation and 100 test readings; 48 classes from 400 readings an object.
#[derive(Args, Clone, Debug, Serialize)]
pub struct ObjectTrials {
    /// The objects that are touched.
    #[command(flatten)]
    #[serde(flatten)]
    pub objects: ObjectSet,
    /// Seed of everything random.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Training and validation readings per object.
    #[arg(long, default_value_t = 1_100, value_parser = count)]
    pub training_readings: usize,
    /// Training readings per object, first in order, that the classes are learnt from.
    #[arg(long, default_value_t = 440, value_parser = count)]
    pub vocabulary_readings: usize,
    /// Test readings per object.
    #[arg(long, default_value_t = 100, value_parser = count)]
    pub test_readings: usize,
    /// Trials per object.
    #[arg(long, default_value_t = 100, value_parser = count)]
    pub trials: usize,
    /// Candidates for the number of classes.
    #[arg(long, default_values_t = [48], value_delimiter = ',', value_parser = count)]
    pub n_classes: Vec<usize>,
}

/// The world of one curve: a sensor and its noise.
pub struct Setting {
    /// Name in rows and plots.
    pub name: String,
    /// Part of the summary's keys; empty for the only setting.
    pub key: String,
    /// The sensor.
    pub sensor: SensorDescription,
    /// Noise beyond the sensor's own.
    pub noise_level: NoiseLevel,
}

impl Setting {
    /// The dissertation's 6 × 6 sensor under 0.10 inch, without more noise, as the only setting.
    pub(crate) fn printed(name: &str) -> Self {
        let (sensor, noise_level) = (SensorDescription::digitacts_6x6(), NoiseLevel::NONE);
        Self { name: name.to_owned(), key: String::new(), sensor, noise_level }
    }

    /// A sensor without more noise, named after its resolution.
    pub(crate) fn of_resolution(sensor: SensorDescription) -> Self {
        let side = sensor.grid().rows;
        let (name, key) = (format!("{side}×{side}"), format!("{side}x{side}_"));
        Self { name, key, sensor, noise_level: NoiseLevel::NONE }
    }
}

/// Readings of every object in one setting.
pub struct Touched {
    /// Readings per object for training and validation.
    pub training: Vec<Vec<Reading>>,
    /// Readings per object for tests.
    pub test: Vec<Vec<Reading>>,
}

/// A model and the results of its test.
pub struct Tested {
    /// The model.
    pub model: AppearanceModel,
    /// Accuracy against readings.
    pub curve: Vec<Point>,
}

impl ObjectTrials {
    /// The objects.
    ///
    /// # Errors
    /// When the folder cannot be read or holds no mesh.
    pub fn objects(&self) -> anyhow::Result<Vec<TestObject>> {
        self.objects.load()
    }

    /// Touches every object in a setting.
    ///
    /// # Errors
    /// When an object cannot be touched often enough.
    pub fn touch(&self, objects: &[TestObject], setting: &Setting) -> anyhow::Result<Touched> {
        let touch_all = |n: usize, seed: u64| -> anyhow::Result<Vec<Vec<Reading>>> {
            let touch = |object: &TestObject| {
                touch_in_noise(object, &setting.sensor, setting.noise_level, n, seed)
            };
            objects.iter().map(touch).collect()
        };
        Ok(Touched {
            training: touch_all(self.training_readings, 2 * self.seed)?,
            test: touch_all(self.test_readings, 2 * self.seed + 1)?,
        })
    }

    /// Trains with a configuration, which holds back about 1/11 of the readings, and tests.
    ///
    /// # Errors
    /// When the readings cannot be learnt from.
    pub fn test(
        &self,
        touched: &Touched,
        setting: &Setting,
        appearance: &AppearanceConfig,
    ) -> anyhow::Result<Tested> {
        let (n, sensor) = (self.vocabulary_readings, &setting.sensor);
        let model = train_with_vocabulary_of(n, &touched.training, sensor, appearance, self.seed)?;
        let evidence = Evidence::of(&model, &touched.test, sensor, AppearanceRule::Divergence);
        let curve = evidence.drawn(&COUNTS, self.trials, self.seed);
        Ok(Tested { model, curve })
    }

    /// The configuration of a descriptor: one in eleven readings is held back.
    #[must_use]
    pub fn appearance(&self, descriptor: DescriptorKind) -> AppearanceConfig {
        AppearanceConfig {
            descriptor,
            n_classes: self.n_classes.clone(),
            held_back_share: 1.0 / 11.0,
            ..AppearanceConfig::default()
        }
    }
}

/// A panel of accuracy against readings.
#[must_use]
pub fn panel(title: &str, lines: Vec<Line>) -> Panel {
    let (x, y) = ("readings".to_owned(), "right (%)".to_owned());
    Panel { title: title.to_owned(), x, y, lines }
}

/// Adds the rows of a curve, its confusions after 20 readings, and the summary.
pub fn rows(
    report: &mut Report,
    setting: &Setting,
    method: &str,
    objects: &[TestObject],
    curve: &[Point],
) {
    for point in curve {
        report.labelled(&[("setting", &setting.name), ("method", method)], point);
    }
    for (truth, named, trials) in
        curve.iter().filter(|point| point.readings == 20).flat_map(|point| &point.confusions)
    {
        report.labelled(
            &[
                ("setting", &setting.name),
                ("method", method),
                ("object", &objects[*truth].name),
                ("confused_with", &objects[*named].name),
            ],
            Confused { readings: 20, trials: *trials },
        );
    }
    for readings in STATED_AT {
        if let Some(accuracy) = accuracy_at(curve, readings) {
            let key = format!("{method}_{}accuracy_at_{readings}", setting.key);
            report.summarise(&key, accuracy);
        }
    }
    for point in curve.iter().filter(|point| [20, 100].contains(&point.readings)) {
        let key = format!("{method}_{}standard_error_at_{}", setting.key, point.readings);
        report.summarise(&key, point.standard_error);
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::arguments::defaults;

    /// A run small enough for a test: ten objects, few readings, few classes.
    pub(crate) fn small() -> ObjectTrials {
        ObjectTrials {
            seed: 101,
            training_readings: 66,
            vocabulary_readings: 66,
            test_readings: 20,
            trials: 3,
            n_classes: vec![12],
            ..defaults()
        }
    }
}
