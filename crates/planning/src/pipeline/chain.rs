//! Which goal configurations a route passes: chains of short legs with shallow corners, before any leg is planned.

use crate::error::{Infeasible, PlannerError};
use crate::goals::goal_configurations::goal_configurations_until;
use crate::goals::inverse_kinematics::{is_solved, solve_tips};
use crate::motion::duration_bound::longest_travel;
use crate::moving_obstacles::MovingObstacles;
use crate::pipeline::context::RequestContext;
use crate::pipeline::goal_set::add_distinct;
use crate::problem::{Goal, Problem};
use collision::Scene;
use pcc_model::{Configuration, UnitRobot};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

/// Configurations of a goal that are found whatever the others are.
const OF_A_GOAL: usize = 6;
/// Configurations of a goal, with those that are near to the ones of the goal before.
const MOST_OF_A_GOAL: usize = 12;
/// Steps by which the configurations of a chain are moved on their tip positions, rad.
const STEPS_RAD: [f64; 10] = [0.6, 0.4, 0.3, 0.2, 0.15, 0.1, 0.07, 0.05, 0.03, 0.02];
/// Times that each step is tried.
const TRIES_OF_A_STEP: usize = 3;
/// Moves of one configuration that are tried at once.
const MOVES: usize = 8;

/// Bending below the limit from which on a smooth corner may have too little room, rad.
const ROOM_RAD: f64 = 0.1;

/// A pair of configurations between which no path was found: the goal's index, and the places of both among their goals' configurations.
pub(super) type ForbiddenLeg = [usize; 3];

/// The goals of a route with configurations of each.
pub(super) struct Chains<'a> {
    robot: &'a UnitRobot,
    scene: &'a Scene,
    start: Configuration,
    goals: &'a [Goal],
    /// Configurations of each goal, radians.
    found: Vec<Vec<Configuration>>,
    /// Fastest travel of a tendon, section lengths per s.
    speed: f64,
    /// Time that a stop costs, s.
    stop_s: f64,
}

/// A configuration of each goal.
#[derive(Clone, Debug)]
pub(super) struct Chain {
    /// The configurations, radians.
    pub(super) configurations: Vec<Configuration>,
    /// Their places among those that were found of each goal.
    pub(super) places: Vec<usize>,
    /// About how long the motion takes, s.
    cost_s: f64,
}

impl<'a> Chains<'a> {
    /// Finds configurations of all goals from a start on; none where the interrupt left no time for it.
    ///
    /// # Errors
    /// [`PlannerError::Infeasible`] of the last goal, [`PlannerError::InfeasibleVia`] of another one.
    pub(super) fn find(
        context: &'a RequestContext,
        goals: &'a [Goal],
    ) -> Result<Option<Self>, PlannerError> {
        let constraints = &context.constraints;
        let limits = &constraints.limits;
        let mut chains = Self {
            robot: constraints.padded,
            scene: constraints.scene,
            start: context.problem.start,
            goals,
            found: Vec::with_capacity(goals.len()),
            speed: limits.velocity,
            stop_s: limits.velocity / limits.acceleration + limits.acceleration / limits.jerk,
        };
        let mut rng = Pcg64::seed_from_u64(context.request.seed);
        for (index, goal) in goals.iter().enumerate() {
            let interrupt = context.supervision.interrupt;
            let found = chains.configurations_of(goal, &mut rng, interrupt);
            let found = found.map_err(|infeasible| match index + 1 == goals.len() {
                true => PlannerError::Infeasible(infeasible),
                false => PlannerError::InfeasibleVia { index, infeasible },
            })?;
            if found.is_empty() {
                return Ok(None);
            }
            chains.found.push(found);
        }
        Ok(Some(chains))
    }

    /// Configurations of the next goal, some of them near to those of the goal before.
    fn configurations_of(
        &self,
        goal: &Goal,
        rng: &mut Pcg64,
        interrupt: crate::request::Interrupt,
    ) -> Result<Vec<Configuration>, Infeasible> {
        let before = self
            .found
            .last()
            .map_or(std::slice::from_ref(&self.start), Vec::as_slice);
        let problem = Problem {
            start: before[0],
            goal: *goal,
            scene: self.scene.clone(),
            moving: MovingObstacles::default(),
        };
        let mut found = goal_configurations_until(self.robot, &problem, OF_A_GOAL, rng, interrupt)?;
        if let Goal::Tip(tip) = goal {
            let near = solve_tips(self.robot, tip, before);
            let near = near
                .into_iter()
                .filter(|(_, distance)| is_solved(*distance));
            let near = near
                .map(|(near, _)| near)
                .filter(|near| self.is_clear(near));
            add_distinct(&mut found, &near.collect::<Vec<_>>(), MOST_OF_A_GOAL);
        }
        Ok(found)
    }

    fn is_clear(&self, configuration: &Configuration) -> bool {
        self.scene.clearance_at(self.robot, configuration) >= 0.0
    }

    /// The goal that chains differ in: the first one with the most configurations.
    fn distinguishing(&self) -> usize {
        let most = self.found.iter().map(Vec::len).max();
        let is_it = |found: &Vec<Configuration>| Some(found.len()) == most;
        self.found.iter().position(is_it).unwrap_or(0)
    }

    /// The best chain through each configuration of one goal, the best ones first, at most `count`.
    pub(super) fn best(&self, count: usize) -> Vec<Chain> {
        let layer = self.distinguishing();
        let places = 0..self.found[layer].len();
        let through = places.filter_map(|place| self.best_through(layer, place, &[]));
        let mut chains: Vec<Chain> = through.collect();
        chains.sort_by(|a, b| a.cost_s.total_cmp(&b.cost_s));
        chains.truncate(count);
        chains
    }

    /// The best chain like another one in the goal that chains differ in, without these legs.
    pub(super) fn instead_of(&self, chain: &Chain, without: &[ForbiddenLeg]) -> Option<Chain> {
        let layer = self.distinguishing();
        self.best_through(layer, chain.places[layer], without)
    }

    /// The best chain through one configuration of a goal, without these legs.
    fn best_through(&self, layer: usize, place: usize, without: &[ForbiddenLeg]) -> Option<Chain> {
        let open = |k: usize| match k == layer {
            true => place..place + 1,
            false => 0..self.found[k].len(),
        };
        // Of all chains that end with one pair of configurations, only the best can be continued to the best.
        let mut ends: Vec<Chain> = Vec::new();
        for place in open(0).filter(|&place| !without.contains(&[0, 0, place])) {
            ends.push(self.chain(vec![place]));
        }
        for k in 1..self.goals.len() {
            let mut next: Vec<Chain> = Vec::new();
            for to in open(k) {
                let mut of_pair: Vec<Option<Chain>> = vec![None; self.found[k - 1].len()];
                for end in &ends {
                    let from = end.places[k - 1];
                    if without.contains(&[k, from, to]) {
                        continue;
                    }
                    let longer = self.longer(end, to);
                    let best = &mut of_pair[from];
                    if best.as_ref().is_none_or(|best| longer.cost_s < best.cost_s) {
                        *best = Some(longer);
                    }
                }
                next.extend(of_pair.into_iter().flatten());
            }
            ends = next;
        }
        ends.into_iter()
            .min_by(|a, b| a.cost_s.total_cmp(&b.cost_s))
    }

    fn chain(&self, places: Vec<usize>) -> Chain {
        let configurations = places.iter().enumerate();
        let configurations: Vec<Configuration> = configurations
            .map(|(k, &place)| self.found[k][place])
            .collect();
        Chain {
            cost_s: self.cost_s(&configurations),
            configurations,
            places,
        }
    }

    fn longer(&self, chain: &Chain, place: usize) -> Chain {
        let mut places = chain.places.clone();
        places.push(place);
        self.chain(places)
    }

    /// About how long a motion through these configurations takes, s: each leg as long as its longest tendon at full speed, and each
    /// corner the part of a stop that the tendons' change of speed is.
    fn cost_s(&self, configurations: &[Configuration]) -> f64 {
        let mut from = self.start;
        let mut before: Option<Configuration> = None;
        let mut cost_s = self.stop_s;
        for to in configurations {
            let step = to - from;
            let travel = longest_travel(self.robot, &step);
            cost_s += travel / self.speed;
            let direction = step / travel.max(f64::MIN_POSITIVE);
            if let Some(before) = before {
                cost_s += 0.5 * self.stop_s * longest_travel(self.robot, &(direction - before));
            }
            (before, from) = (Some(direction), *to);
        }
        cost_s + self.crowding_s(configurations)
    }

    /// Time that corners near the bending limit are taken to cost, s: at the limit a stop each, since a smooth curve through a corner
    /// there leaves the limit.
    fn crowding_s(&self, configurations: &[Configuration]) -> f64 {
        let corners = configurations.iter().rev().skip(1);
        let lacking = corners.map(|q| (self.robot.limit_excess(q) / ROOM_RAD + 1.0).max(0.0));
        self.stop_s * lacking.sum::<f64>()
    }

    /// Moves the configurations of a chain on their tip positions to where the motion takes less time; `keeps` stays what it is.
    pub(super) fn shorten(&self, chain: &mut Chain, keeps_its_own: bool, rng: &mut Pcg64) {
        let kept = keeps_its_own.then(|| self.distinguishing());
        for step_rad in STEPS_RAD.iter().flat_map(|step| [*step; TRIES_OF_A_STEP]) {
            for (k, goal) in self.goals.iter().enumerate() {
                if let Goal::Tip(tip) = goal
                    && kept != Some(k)
                {
                    self.move_on_tip(chain, k, tip, step_rad, rng);
                }
            }
        }
    }

    /// Moves one configuration of a chain by about a step (rad), where that makes the motion shorter.
    fn move_on_tip(
        &self,
        chain: &mut Chain,
        k: usize,
        tip: &pcc_model::Point,
        step_rad: f64,
        rng: &mut Pcg64,
    ) {
        let own = chain.configurations[k];
        let mut random = || Configuration::from_fn(|_, _| rng.random_range(-1.0..1.0));
        let seeds: Vec<Configuration> = (0..MOVES).map(|_| own + random() * step_rad).collect();
        for (moved, distance) in solve_tips(self.robot, tip, &seeds) {
            if !is_solved(distance) {
                continue;
            }
            let before = std::mem::replace(&mut chain.configurations[k], moved);
            let cost_s = self.cost_s(&chain.configurations);
            if cost_s < chain.cost_s && self.is_clear(&moved) {
                chain.cost_s = cost_s;
            } else {
                chain.configurations[k] = before;
            }
        }
    }
}
