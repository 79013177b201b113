//! Every experiment of the paper made again, beside honest rivals.

mod browser;
mod checker;
mod comparison;
mod page;
mod page_commands;
mod page_killed;
mod paper_model;
mod planners;
mod referee;
mod refinements;
mod rivals;
mod view;

use crate::report::Report;
use crate::scale::Scale;

pub(crate) const GROUPS: &[fn(&mut Report, Scale)] = &[
    rivals::run,
    referee::run,
    page::run,
    comparison::run,
    paper_model::run,
    refinements::run,
    checker::run,
    view::run,
];
