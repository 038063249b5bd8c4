//! Known sensors by name, each as its data sheet describes it.

use super::arrays;
use super::coupling::Coupling;
use super::defaults;
use super::description::{ImageOrder, SensorDescription, SensorParameters};
use super::grid::TaxelGrid;
use super::point_spread::point_spread_of_covering;
use super::ranges::StatedRanges;
use crate::units::{INCH, KPA, MM};

/// A known sensor.
#[derive(Clone, Debug, PartialEq)]
pub struct Preset {
    /// Its description.
    pub description: SensorDescription,
    /// Ranges of what the description leaves open.
    pub ranges: StatedRanges,
}

impl Preset {
    /// The names that [`Preset::named`] accepts.
    pub const NAMES: [&'static str; 13] = [
        "digitacts-6x6",
        "digitacts-6x6-thin",
        "digitacts-6x8",
        "fingertip-14x14",
        "tekscan-26x26",
        "xela-uskin-4x4",
        "contactile-papillarray-3x3",
        "pps-digitacts-6x4",
        "pps-digitacts-6x8",
        "gelsight-mini-18x24",
        "digit-16x19",
        "icub-fingertip-12",
        "fingertip-curved-24",
    ];

    /// The preset with the given name in the API and on the command line.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        let simulated = |description| Self { description, ranges: StatedRanges::default() };
        let real = |(parameters, ranges)| Self { description: checked(parameters), ranges };
        match name {
            "digitacts-6x6" => Some(simulated(SensorDescription::digitacts_6x6())),
            "digitacts-6x6-thin" => Some(simulated(SensorDescription::digitacts_6x6_thin())),
            "digitacts-6x8" => Some(simulated(SensorDescription::digitacts_6x8())),
            "fingertip-14x14" => Some(simulated(SensorDescription::fingertip_14x14())),
            "tekscan-26x26" => Some(simulated(SensorDescription::tekscan_26x26())),
            "xela-uskin-4x4" => Some(real(arrays::xela_uskin_4x4())),
            "contactile-papillarray-3x3" => Some(real(arrays::contactile_papillarray_3x3())),
            "pps-digitacts-6x4" => Some(real(arrays::pps_digitacts(1))),
            "pps-digitacts-6x8" => Some(real(arrays::pps_digitacts(2))),
            "gelsight-mini-18x24" => Some(real(arrays::gelsight_mini_18x24())),
            "digit-16x19" => Some(real(arrays::digit_16x19())),
            "icub-fingertip-12" => Some(real(arrays::icub_fingertip_12())),
            "fingertip-curved-24" => Some(simulated(checked(arrays::fingertip_curved_24()))),
            _ => None,
        }
    }
}

impl SensorDescription {
    /// A sensor like DigiTacts of `rows` × `cols` taxels with the 2 mm pitch of section
    /// 2.1.1, under the 0.10 inch covering, 0–20 kPa.
    #[must_use]
    pub fn digitacts(rows: usize, cols: usize) -> Self {
        preset(TaxelGrid { rows, cols, pitch: 2.0 * MM, taxel_width: 1.8 * MM })
    }

    /// The 6 × 6 sensor of the dissertation's simulations.
    #[must_use]
    pub fn digitacts_6x6() -> Self {
        Self::digitacts(6, 6)
    }

    /// The 6 × 6 sensor under the thinnest covering, 0.04 inch, of the dissertation's raised
    /// letters: σ = 1.3625 elements (section 3.2.3).
    #[must_use]
    pub fn digitacts_6x6_thin() -> Self {
        let grid = TaxelGrid { rows: 6, cols: 6, pitch: 2.0 * MM, taxel_width: 1.8 * MM };
        covered(grid, 0.04 * INCH)
    }

    /// The 6 × 8 image of the two physical modules (section 2.1.1).
    #[must_use]
    pub fn digitacts_6x8() -> Self {
        Self::digitacts(6, 8)
    }

    /// The density of the human fingertip over 12 mm (section 4.4.2.6).
    #[must_use]
    pub fn fingertip_14x14() -> Self {
        over_12_mm(14)
    }

    /// The density of a Tekscan sensor over 12 mm (section 4.4.2.6).
    #[must_use]
    pub fn tekscan_26x26() -> Self {
        over_12_mm(26)
    }

    /// The description of [`Preset::named`].
    #[must_use]
    pub fn preset_named(name: &str) -> Option<Self> {
        Preset::named(name).map(|preset| preset.description)
    }
}

fn over_12_mm(side: usize) -> SensorDescription {
    let pitch = 12.0 * MM / side as f64;
    preset(TaxelGrid { rows: side, cols: side, pitch, taxel_width: 0.9 * pitch })
}

fn preset(grid: TaxelGrid) -> SensorDescription {
    covered(grid, 0.10 * INCH)
}

fn covered(grid: TaxelGrid, covering_thickness: f64) -> SensorDescription {
    let saturation = 20.0 * KPA;
    checked(SensorParameters {
        grid,
        layout: None,
        covering_thickness,
        point_spread: point_spread_of_covering(covering_thickness),
        force_curve: defaults::force_curve(covering_thickness, saturation),
        saturation,
        noise: defaults::noise(saturation, saturation / 256.0),
        quantisation: saturation / 256.0,
        image_order: ImageOrder::default(),
        coupling: Coupling::default(),
    })
}

fn checked(parameters: SensorParameters) -> SensorDescription {
    SensorDescription::new(parameters).expect("a preset is within a description's limits")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn presets_are_valid_and_have_their_names() {
        for name in Preset::NAMES {
            let preset = Preset::named(name).unwrap();
            assert_eq!(preset.ranges.check(), Ok(()), "{name}");
            let grid = preset.description.grid();
            let shape = name.trim_end_matches("-thin");
            let size = match preset.description.listed() {
                Some(layout) => layout.taxels().len().to_string(),
                None => format!("{}x{}", grid.rows, grid.cols),
            };
            assert!(shape.ends_with(&size), "{name}: {size}");
        }
        assert_eq!(Preset::named("6x6"), None);
    }

    #[test]
    fn fingertips_are_curved_and_modules_are_not() {
        let described = |name| SensorDescription::preset_named(name).unwrap();
        let icub = described("icub-fingertip-12");
        assert!((4.0 * MM..8.0 * MM).contains(&icub.radius().unwrap()), "{:?}", icub.radius());
        let dome = described("fingertip-curved-24");
        assert!((dome.radius().unwrap() - 10.0 * MM).abs() < 1e-9);
        assert_eq!((dome.n_taxels(), dome.grid().rows % 2), (24, 1));
        let two = described("pps-digitacts-6x8");
        assert_eq!(two.radius(), None);
        // 4 columns of 1.8 mm with gaps of 0.1, 0.2, 0.1 mm, then 0.1 mm to the second module.
        let (first, fifth) = (two.taxel(0).position, two.taxel(4).position);
        assert!((fifth.x - first.x - 7.7 * MM).abs() < 1e-8);
        // What docs/sensors.md states.
        let lost = |sensor: &SensorDescription| sensor.layout().unwrap().resampling_loss();
        for (sensor, stated) in [(&two, 0.02), (&icub, 0.06), (&dome, 0.16)] {
            assert!((lost(sensor) - stated).abs() < 0.005, "{stated}: {}", lost(sensor));
        }
    }
}
