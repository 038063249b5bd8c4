//! Conversion of coupling, knowledge and ranges of sensors.

use palpate_core::sensor as core;
use palpate_core::sensor::SensorError;
use palpate_schemas as wire;

use crate::wire::Invalid;

/// Coupling in its wire form.
pub(crate) fn coupling(known: &core::Coupling) -> wire::Coupling {
    wire::Coupling {
        kernel: kernel(known.kernel),
        margin: known.margin,
        edge: edge(known.edge),
        cross_talk: known.cross_talk,
        gain_spread: known.gain_spread,
        hysteresis: known.hysteresis,
    }
}

/// Coupling as the wire gives it; its numbers are checked with the description.
pub(crate) fn coupling_of(given: &wire::Coupling) -> core::Coupling {
    core::Coupling {
        kernel: kernel_of(given.kernel),
        margin: given.margin,
        edge: edge_of(given.edge),
        cross_talk: given.cross_talk,
        gain_spread: given.gain_spread,
        hysteresis: given.hysteresis,
    }
}

/// A level of knowledge in its wire form.
pub(crate) fn knowledge(known: core::SensorKnowledge) -> wire::SensorKnowledge {
    match known {
        core::SensorKnowledge::Measured => wire::SensorKnowledge::Measured,
        core::SensorKnowledge::DataSheet => wire::SensorKnowledge::DataSheet,
        core::SensorKnowledge::Unknown => wire::SensorKnowledge::Unknown,
    }
}

/// The level of knowledge that the wire gives.
pub(crate) fn knowledge_of(given: wire::SensorKnowledge) -> core::SensorKnowledge {
    match given {
        wire::SensorKnowledge::Measured => core::SensorKnowledge::Measured,
        // A passport is a description with ranges of its own.
        wire::SensorKnowledge::DataSheet | wire::SensorKnowledge::Commissioned => {
            core::SensorKnowledge::DataSheet
        }
        wire::SensorKnowledge::Unknown => core::SensorKnowledge::Unknown,
    }
}

/// Ranges in their wire form.
pub(crate) fn ranges(known: &core::SensorRanges) -> wire::SensorRanges {
    let range = |(low, high): (f64, f64)| Some(wire::NumberRange { low, high });
    wire::SensorRanges {
        spread_factor: range(known.spread_factor),
        kernels: Some(known.kernels.iter().map(|one| kernel(*one)).collect()),
        margin: range(known.margin),
        edges: Some(known.edges.iter().map(|one| edge(*one)).collect()),
        cross_talk: range(known.cross_talk),
        stiffness: range(known.stiffness),
        stiffening: range(known.stiffening),
    }
}

/// The checked ranges that a request states.
pub(crate) fn stated_ranges(
    given: Option<&wire::SensorRanges>,
) -> Result<core::StatedRanges, Invalid> {
    let Some(given) = given else { return Ok(core::StatedRanges::default()) };
    let range = |range: Option<wire::NumberRange>| range.map(|range| (range.low, range.high));
    let stated = core::StatedRanges {
        spread_factor: range(given.spread_factor),
        kernels: given.kernels.as_ref().map(|all| distinct(all, kernel_of)),
        margin: range(given.margin),
        edges: given.edges.as_ref().map(|all| distinct(all, edge_of)),
        cross_talk: range(given.cross_talk),
        stiffness: range(given.stiffness),
        stiffening: range(given.stiffening),
    };
    stated.check().map_err(refuse)?;
    Ok(stated)
}

fn refuse(error: SensorError) -> Invalid {
    let pointer = match &error {
        SensorError::Range { field, .. }
        | SensorError::Order { field, .. }
        | SensorError::Empty { field }
        | SensorError::Count { field, .. } => format!("/description/ranges/{field}"),
        SensorError::ForceCurve { .. } | SensorError::Layout(_) | SensorError::OrderOfLayout => {
            "/description/ranges".to_owned()
        }
    };
    Invalid::field(pointer, error)
}

/// The core's values, each once.
fn distinct<W: Copy, C: PartialEq>(given: &[W], of: impl Fn(W) -> C) -> Vec<C> {
    let mut found = Vec::new();
    for one in given.iter().map(|one| of(*one)) {
        if !found.contains(&one) {
            found.push(one);
        }
    }
    found
}

fn kernel(known: core::SpreadKernel) -> wire::SpreadKernel {
    match known {
        core::SpreadKernel::Gaussian => wire::SpreadKernel::Gaussian,
        core::SpreadKernel::Exponential => wire::SpreadKernel::Exponential,
    }
}

fn kernel_of(given: wire::SpreadKernel) -> core::SpreadKernel {
    match given {
        wire::SpreadKernel::Gaussian => core::SpreadKernel::Gaussian,
        wire::SpreadKernel::Exponential => core::SpreadKernel::Exponential,
    }
}

fn edge(known: core::CoveringEdge) -> wire::CoveringEdge {
    match known {
        core::CoveringEdge::Continues => wire::CoveringEdge::Continues,
        core::CoveringEdge::ConservesForce => wire::CoveringEdge::ConservesForce,
        core::CoveringEdge::LosesForce => wire::CoveringEdge::LosesForce,
    }
}

fn edge_of(given: wire::CoveringEdge) -> core::CoveringEdge {
    match given {
        wire::CoveringEdge::Continues => core::CoveringEdge::Continues,
        wire::CoveringEdge::ConservesForce => core::CoveringEdge::ConservesForce,
        wire::CoveringEdge::LosesForce => core::CoveringEdge::LosesForce,
    }
}
