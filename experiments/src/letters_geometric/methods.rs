//! The methods that compete on letters. Each is prepared once per seed and begins one belief per
//! trial.

use std::f64::consts::PI;
use std::sync::Arc;

use glam::{DVec2, DVec3};
use palpate_core::pose::Pose;
use palpate_core::rng::{Purpose, Stream};
use palpate_core::units::MM;
use palpate_dissertation::filter::class_field::ClassField;
use palpate_dissertation::filter::histogram::{
    Extent, HistogramModel, PlanarBins, PlanarHistogram, Reseed,
};
use palpate_dissertation::filter::particle::{
    Injection, ParticleFilter, ParticleOptions, PoseRegion, Resampling,
};
use palpate_dissertation::filter::planes::BinShare;
use palpate_dissertation::geometric::{
    AdaptiveOptions, GeometricBelief, GeometricFilter, GeometricOptions, PosePrior,
    PreparedGeometry,
};
use palpate_dissertation::occupancy::{ClassTable, OccupancyGrid};

use super::Lab;
use super::beliefs::{Adaptive, Belief, Bins, Particles, SEEDED_SHARE, Seeded};

/// Maximum offset of the letter from its trained place along x and y, metres.
pub(super) const REACH: f64 = 10.0 * MM;

/// Extent of a sparse filter, which leaves out bins this many nats behind the best.
pub(super) const SPARSE: Extent =
    Extent::Sparse { nats: 40.0, reseed: Reseed::WhenWorseThanNothing };

/// Table of Pr(class | log-odds) of a method.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Table {
    /// The printed classifier.
    Literal,
    /// The table that training counted.
    Learnt,
}

/// One method.
pub(super) struct Method {
    /// Its name in tables and plots.
    pub(super) name: &'static str,
    /// Prefix of its keys in the summary; empty for the default method.
    pub(super) key: &'static str,
    pub(super) table: Table,
    pub(super) exponent: f64,
    pub(super) kind: Kind,
}

/// Representation of a method's belief.
pub(super) enum Kind {
    /// Bins an object along x, y and angle.
    Histogram([usize; 3], Extent),
    /// Histogram filter whose bins stand for their extent.
    Extents([usize; 3]),
    /// Particles as printed, `n` in all or an object.
    Particles { n: usize, per_object: bool },
    /// The service's default: forces and the adaptive histogram.
    Adaptive,
    /// Particles with other resampling: systematic, below half the effective sample size, with
    /// random ones added.
    ParticlesResampled { n: usize },
    /// Particles as printed, with random ones as Augmented MCL adds them.
    ParticlesAugmented { n: usize },
    /// Particles as printed, a share of them drawn from a histogram of these bins.
    ParticlesSeeded { n: usize, bins: [usize; 3] },
}

/// Rates of Augmented MCL's averages. Chosen before any run: its authors leave them open and ask
/// for the first to be much smaller.
const AUGMENTED: Injection = Injection::Augmented { slow: 0.05, fast: 0.5 };

const fn literal(name: &'static str, key: &'static str, kind: Kind) -> Method {
    Method { name, key, table: Table::Literal, exponent: 1.0, kind }
}

const fn learnt(name: &'static str, key: &'static str, exponent: f64, kind: Kind) -> Method {
    Method { name, key, table: Table::Learnt, exponent, kind }
}

const fn bins(n: [usize; 3]) -> Kind {
    Kind::Histogram(n, Extent::Exhaustive)
}

/// All methods; Table 3.1's first.
pub(super) const METHODS: [Method; 26] = [
    learnt("adaptive-force", "", 1.0, Kind::Adaptive),
    literal("histogram-100", "histogram_100", bins([5, 5, 4])),
    literal("histogram-1000", "histogram_1000", bins([10, 10, 10])),
    literal("histogram-10000", "literal", bins([25, 25, 16])),
    literal("histogram-10000-sparse", "sparse", Kind::Histogram([25, 25, 16], SPARSE)),
    literal("balanced-980", "balanced_980", bins([7, 7, 20])),
    literal("balanced-10140", "balanced_10140", bins([13, 13, 60])),
    learnt("learnt-980", "learnt_980", 1.0, bins([7, 7, 20])),
    learnt("learnt-10000", "learnt_10000", 1.0, bins([25, 25, 16])),
    learnt("learnt-10140", "learnt", 1.0, bins([13, 13, 60])),
    literal("extents-10000", "extents", Kind::Extents([25, 25, 16])),
    learnt("learnt-extents-10140", "learnt_extents", 1.0, Kind::Extents([13, 13, 60])),
    literal("particles-100", "particles_100", Kind::Particles { n: 100, per_object: false }),
    literal("particles-1000", "particles_1000", Kind::Particles { n: 1_000, per_object: false }),
    literal("particles-10000", "particles_10000", Kind::Particles { n: 10_000, per_object: false }),
    literal(
        "particles-100-each",
        "particles_100_each",
        Kind::Particles { n: 100, per_object: true },
    ),
    literal(
        "particles-1000-each",
        "particles_1000_each",
        Kind::Particles { n: 1_000, per_object: true },
    ),
    literal(
        "particles-10000-each",
        "particles_10000_each",
        Kind::Particles { n: 10_000, per_object: true },
    ),
    // The options of the last row one by one: resampling, table, exponent.
    literal(
        "particles-1000-resampled",
        "particles_1000_resampled",
        Kind::ParticlesResampled { n: 1_000 },
    ),
    learnt(
        "particles-1000-learnt",
        "particles_1000_learnt",
        1.0,
        Kind::Particles { n: 1_000, per_object: false },
    ),
    Method {
        name: "particles-1000-tempered",
        key: "particles_1000_tempered",
        table: Table::Literal,
        exponent: 0.3,
        kind: Kind::Particles { n: 1_000, per_object: false },
    },
    learnt(
        "particles-1000-options",
        "particles_1000_options",
        0.3,
        Kind::ParticlesResampled { n: 1_000 },
    ),
    // Section 3.4.1: attempts that did not help.
    literal(
        "particles-1000-augmented",
        "particles_1000_augmented",
        Kind::ParticlesAugmented { n: 1_000 },
    ),
    literal(
        "particles-10000-augmented",
        "particles_10000_augmented",
        Kind::ParticlesAugmented { n: 10_000 },
    ),
    literal(
        "particles-1000-seeded-100",
        "particles_1000_seeded_100",
        Kind::ParticlesSeeded { n: 1_000, bins: [5, 5, 4] },
    ),
    literal(
        "particles-1000-seeded-1000",
        "particles_1000_seeded_1000",
        Kind::ParticlesSeeded { n: 1_000, bins: [10, 10, 10] },
    ),
];

impl Method {
    /// Number of hypotheses of all letters at the beginning.
    pub(super) fn hypotheses(&self, n_letters: usize) -> usize {
        match self.kind {
            Kind::Adaptive => {
                let bins = AdaptiveOptions::default().first_bins([REACH, REACH, PI]);
                n_letters * bins.iter().product::<usize>()
            }
            Kind::Histogram(n, _) | Kind::Extents(n) => n_letters * n.iter().product::<usize>(),
            Kind::Particles { n, per_object } => {
                if per_object {
                    n * n_letters
                } else {
                    n
                }
            }
            Kind::ParticlesResampled { n }
            | Kind::ParticlesAugmented { n }
            | Kind::ParticlesSeeded { n, .. } => n,
        }
    }
}

/// A method prepared for a seed's maps.
pub(super) struct Prepared<'a> {
    method: &'a Method,
    lab: &'a Lab,
    histogram: Option<(Arc<HistogramModel>, PlanarBins, Extent)>,
    fields: Vec<ClassField>,
    adaptive: Option<GeometricBelief>,
}

/// Bins over the possible poses of the trials' letters.
pub(super) fn planar_bins(n: [usize; 3]) -> PlanarBins {
    PlanarBins { n, center: DVec2::ZERO, half: DVec2::splat(REACH) }
}

impl<'a> Prepared<'a> {
    pub(super) fn new(method: &'a Method, lab: &'a Lab) -> Self {
        let table = match method.table {
            Table::Literal => ClassTable::literal(),
            Table::Learnt => lab.model.table.clone(),
        };
        let maps = || lab.model.maps.iter().map(|map| &map.occupancy);
        let histogram = |n, extent, share| {
            let bins = planar_bins(n);
            let maps: Vec<OccupancyGrid> = maps().cloned().collect();
            (Arc::new(HistogramModel::new(maps, table.clone(), &bins, share)), bins, extent)
        };
        let fields = || maps().map(|map| ClassField::new(map, &table)).collect();
        let (histogram, fields) = match method.kind {
            Kind::Adaptive => (None, vec![]),
            Kind::Histogram(n, extent) => (Some(histogram(n, extent, BinShare::Center)), vec![]),
            Kind::Extents(n) => (Some(histogram(n, Extent::Exhaustive, BinShare::Extent)), vec![]),
            Kind::Particles { .. }
            | Kind::ParticlesResampled { .. }
            | Kind::ParticlesAugmented { .. } => (None, fields()),
            Kind::ParticlesSeeded { bins, .. } => {
                (Some(histogram(bins, Extent::Exhaustive, BinShare::Center)), fields())
            }
        };
        let adaptive = matches!(method.kind, Kind::Adaptive).then(|| adaptive_belief(lab));
        Self { method, lab, histogram, fields, adaptive }
    }

    /// The belief of a trial before its first reading; its random numbers come from the seed and
    /// the trial's number.
    pub(super) fn belief(&self, trial: u64) -> Box<dyn Belief + '_> {
        if let Some(belief) = &self.adaptive {
            return Box::new(Adaptive { belief: belief.clone(), sensor: &self.lab.sensor });
        }
        let exponent = self.method.exponent;
        let bins = self.histogram.as_ref().map(|(model, bins, extent)| {
            let filter = PlanarHistogram::new(model.clone(), *bins, *extent, exponent);
            (Bins { filter, lab: self.lab }, *bins)
        });
        let bins = match (bins, &self.method.kind) {
            (Some((histogram, bins)), Kind::ParticlesSeeded { .. }) => Some((histogram, bins)),
            (Some((histogram, _)), _) => return Box::new(histogram),
            (None, _) => None,
        };
        let n = self.method.hypotheses(self.fields.len());
        let mut options = ParticleOptions { exponent, ..ParticleOptions::literal(n) };
        if let Kind::ParticlesResampled { .. } = self.method.kind {
            options.resampling = Resampling::Systematic;
            options.resample_below = 0.5;
            options.injection = Injection::Share(SEEDED_SHARE);
        }
        if let Kind::ParticlesAugmented { .. } = self.method.kind {
            options.injection = AUGMENTED;
        }
        let region = PoseRegion::Planar { center: DVec3::ZERO, half: DVec3::splat(REACH) };
        let seed = self.lab.seed << 20 | trial;
        let filter = ParticleFilter::new(options, region, self.fields.len(), seed);
        let particles = Particles { filter, fields: &self.fields, lab: self.lab };
        match bins {
            None => Box::new(particles),
            Some((histogram, bins)) => {
                let stream = Stream::new(self.lab.seed, Purpose::Particles, 1 << 40 | trial);
                Box::new(Seeded { particles, histogram, bins, stream, n_readings: 0 })
            }
        }
    }
}

/// The default method before the first reading of a trial.
pub(super) fn adaptive_belief(lab: &Lab) -> GeometricBelief {
    let pose = PosePrior::Planar {
        // A letter's face is the plane z = 0 of its frame, and so is the session's.
        session_from_plane: Pose::IDENTITY,
        center: [0.0; 2],
        half_extent: REACH,
        angle: 0.0,
        half_angle: PI,
    };
    let filter = GeometricFilter::Adaptive(AdaptiveOptions::default());
    let options = GeometricOptions { pose, filter, seed: lab.seed };
    GeometricBelief::new(&PreparedGeometry::new(Arc::new(lab.model.clone())), options, None)
        .expect("planar training gives every letter a mosaic")
}
