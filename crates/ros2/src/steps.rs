//! The action `SimulateSteps`: a step with feedback under way that can be cancelled. One goal at a
//! time.

use futures::FutureExt;
use futures::future::{Either, select};
use ros2_client::action::{
    AsyncActionServer, CancelHandle, ExecutingGoalHandle, GoalEndStatus, NewGoalHandle,
};

use crate::interfaces::simulation::{Done, Outcome, Progress, Step};
use crate::services;
use crate::simulator::{Simulator, State};

/// Ticks between two feedbacks.
const SLICE: u64 = 10;

pub(crate) type Server = AsyncActionServer<Step, Done, Progress>;

/// Serves goals, one after the other, as long as it is polled.
pub(crate) async fn serve(server: &Server, simulator: &dyn Simulator) {
    let mut waiting = None;
    loop {
        let new = match waiting.take() {
            Some(new) => new,
            None => next_goal(server).await,
        };
        let Some(goal) = server.get_new_goal(new) else { continue };
        let Ok(accepted) = server.accept_goal(new).await else { continue };
        let Ok(executing) = server.start_executing_goal(accepted).await else { continue };
        let (end, result) = drive(server, simulator, executing, goal.steps).await;
        let answer = std::pin::pin!(server.send_result_response(executing, end, result));
        let next = std::pin::pin!(next_goal(server));
        // Who does not fetch the result does not keep the next one waiting
        if let Either::Right((new, _)) = select(answer, next).await {
            let _ = server.abort_executing_goal(executing).await;
            waiting = Some(new);
        }
    }
}

/// The next goal. There is nothing to cancel until it comes.
async fn next_goal(server: &Server) -> NewGoalHandle<Step> {
    loop {
        let goal = std::pin::pin!(server.receive_new_goal());
        let cancel = std::pin::pin!(server.receive_cancel_request());
        match select(goal, cancel).await {
            Either::Left((Ok(new), _)) => return new,
            Either::Right((Ok(cancel), _)) => refuse(server, &cancel).await,
            // What cannot be read has no sender to answer
            Either::Left((Err(_), _)) | Either::Right((Err(_), _)) => {}
        }
    }
}

/// Drives the ticks of a goal; says how it ended.
async fn drive(
    server: &Server,
    simulator: &dyn Simulator,
    executing: ExecutingGoalHandle<Step>,
    steps: u64,
) -> (GoalEndStatus, Done) {
    let failed = |why: String| Done { result: Outcome::error(Outcome::OPERATION_FAILED, why) };
    if simulator.state() != State::Paused {
        return (GoalEndStatus::Aborted, failed("the simulation is not paused".to_owned()));
    }
    if !(1..=services::MAX_STEPS).contains(&steps) {
        let why = format!("steps = {steps}: expected 1 to {}", services::MAX_STEPS);
        return (GoalEndStatus::Aborted, failed(why));
    }
    let mut completed_steps = 0;
    while completed_steps < steps {
        let slice = Step { steps: SLICE.min(steps - completed_steps) };
        let done = services::step(simulator, slice).await;
        if done.result.result != Outcome::OK {
            return (GoalEndStatus::Aborted, done);
        }
        completed_steps += slice.steps;
        let progress = Progress { completed_steps, remaining_steps: steps - completed_steps };
        let _ = server.publish_feedback(executing, progress).await;
        if let Some(Ok(other)) = server.receive_new_goal().now_or_never() {
            let _ = server.reject_goal(other).await;
        }
        if let Some(Ok(cancel)) = server.receive_cancel_request().now_or_never() {
            if cancel.contains_goal(&executing.goal_id()) {
                let ours = std::iter::once(executing.goal_id());
                let _ = server.respond_to_cancel_requests(&cancel, ours).await;
                let why = format!("cancelled after {completed_steps} of {steps} steps");
                return (GoalEndStatus::Canceled, failed(why));
            }
            refuse(server, &cancel).await;
        }
    }
    (GoalEndStatus::Succeeded, Done { result: Outcome::ok() })
}

async fn refuse(server: &Server, cancel: &CancelHandle) {
    let _ = server.respond_to_cancel_requests(cancel, std::iter::empty()).await;
}
