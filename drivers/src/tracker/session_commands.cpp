/// The commands of a tracker session: their order, and the reactions to the answers.

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "abbe/drivers/tracker/session.hpp"
#include "refusals.hpp"

namespace abbe::drivers {

using emscon::Command;
using emscon::Status;
using std::chrono::nanoseconds;

// --- plans

/// Sends the first query of a connection. Its answer determines the next commands.
TrackerAction TrackerSession::begin() {
  end_order(Outcome::Failed, "the session with the controller restarted");
  new_plan(Goal::Stay);
  without_deadline_of_state();
  end_pending();
  plan(TrackerState::Querying, emscon::GetSystemStatus{});
  return next_step();
}

void TrackerSession::new_plan(Goal goal) {
  goal_ = goal;
  plan_.clear();
  step_ = 0;
  deadlines_.cancel(Due::Restart);
}

void TrackerSession::plan_sets(std::initializer_list<Command> commands, bool optional) {
  for (const Command command : commands) {
    if (const auto request = settings_.wanted(command))
      plan(TrackerState::Configuring, *request, optional);
  }
}

/// Controllers require this order: units before every value with a unit, parameters of a mode after
/// the mode.
void TrackerSession::plan_set_up(bool initialised) {
  using enum TrackerState;
  new_plan(Goal::Stream);
  plan_sets({Command::SetUnits, Command::SetSystemSettings, Command::SetEnvironmentParams});

  if (!initialised) plan(Initialising, emscon::Initialize{});
  if (!options_.reflector.empty()) plan_reflector(Configuring, false);
  plan_sets({Command::SetSearchParams});
  if (!initialised && options_.home_after_initialize) plan(Initialising, emscon::GoBirdBath{});
  plan_sets({Command::SetCoordinateSystemType});
  plan_sets({Command::SetStatisticMode}, true);  // AT40x has no statistics to choose
  plan_sets({Command::SetMeasurementMode, Command::SetContinuousTimeModeParams,
             Command::SetContinuousDistanceModeParams, Command::SetStationaryModeParams});
  plan_sets({Command::SetLongSystemParameter}, true);  // older controllers have a fixed packet rate
  plan(Ready, emscon::StartMeasurement{});
}

void TrackerSession::plan_restoring(TrackerState state) {
  if (reflector_before_ && reflector_before_ != reflector_in_use_)
    plan(state, emscon::SetReflector{*reflector_before_}, true);
  for (const emscon::Request& request : settings_.restoring()) plan(state, request, true);
}

TrackerAction TrackerSession::next_step() {
  if (step_ == plan_.size()) return plan_done();
  const Step step = plan_[step_++];
  state_ = step.state.value_or(state_);
  return send(step, true);
}

TrackerAction TrackerSession::plan_done() {
  switch (goal_) {
    case Goal::Stream:
      streaming();
      return TrackerNothing{};
    case Goal::Stay:
      // A result that arrived while these requests were sent did not start the next measurement. It
      // is started here.
      return result_came_ && state_ == TrackerState::Streaming ? measure_again()
                                                               : TrackerAction{TrackerNothing{}};
    case Goal::SetUp:
      plan_set_up(initialised_);
      return next_step();
    case Goal::Leave:
      state_ = TrackerState::Disconnected;
      without_deadline_of_state();
      break;
    case Goal::GiveUp:
      state_ = TrackerState::Faulted;
      connect_after(options_.refused_pause);
      break;
  }

  end_pending();
  return TrackerClose{};
}

// --- one command

namespace {

nanoseconds time_for_search(const TrackerSessionOptions& options) {
  return options.search
             ? std::chrono::milliseconds{options.search->timeout_ms} + std::chrono::seconds{5}
             : options.initialize_timeout;
}

}  // namespace

nanoseconds longest_order(const TrackerSessionOptions& options) noexcept {
  // commands before an order: the pending one, StopMeasurement, GetReflector, Set- or GetReflectors
  constexpr int kShort = 4;
  constexpr int kLong = 2;  // Initialize and GoBirdBath
  return kShort * options.command_timeout +
         std::max(kLong * options.initialize_timeout, time_for_search(options)) +
         options.busy_patience;
}

nanoseconds TrackerSession::time_for(Command command) const noexcept {
  switch (command) {
    case Command::FindReflector:
      return time_for_search(options_);
    case Command::Initialize:
    case Command::GoBirdBath:
      return options_.initialize_timeout;
    default:
      return options_.command_timeout;
  }
}

TrackerAction TrackerSession::send(const Step& step, bool scripted) {
  const emscon::Request request = step.request;
  if (emscon::command_of(request) == Command::GetReflectors) reflectors_.clear();
  pending_ = Pending{.step = step, .scripted = scripted, .patience = now_ + options_.busy_patience};
  await_answer();
  return TrackerSend{request};
}

void TrackerSession::await_answer() {
  deadlines_.set(Due::Answer, now_ + time_for(emscon::command_of(pending_->step.request)));
  deadlines_.cancel(Due::Repeat);
  if (state_ == TrackerState::Querying) deadlines_.set(Due::Repeat, now_ + options_.ask_again);
}

/// The command was answered, or its answer is no longer awaited.
void TrackerSession::end_pending() {
  pending_.reset();
  deadlines_.cancel(Due::Answer);
  deadlines_.cancel(Due::Repeat);
}

TrackerAction TrackerSession::repeat() {
  if (std::exchange(pending_->waiting_to_resend, false)) {
    await_answer();
  } else {
    deadlines_.set(Due::Repeat, now_ + options_.ask_again);
  }
  return TrackerSend{pending_->step.request};
}

TrackerAction TrackerSession::send_later() {
  pending_->waiting_to_resend = true;
  deadlines_.cancel(Due::Answer);
  deadlines_.set(Due::Repeat, now_ + options_.busy_retry);
  return TrackerNothing{};
}

TrackerAction TrackerSession::overdue() {
  const Command command = emscon::command_of(pending_->step.request);
  if (state_ == TrackerState::Stopping || state_ == TrackerState::Restoring) return plan_done();
  const double allowed_s = std::chrono::duration<double>(time_for(command)).count();
  return give_up(TrackerState::Faulted,
                 fmt::format("no answer to {} in {:g} s", emscon::name_of(command), allowed_s));
}

// --- answers

TrackerAction TrackerSession::take(const emscon::Answer& answer) {
  const bool awaited = pending_ && !pending_->waiting_to_resend &&
                       emscon::command_of(pending_->step.request) == emscon::command_of(answer);
  if (!awaited) return TrackerNothing{};  // answer to a command of an earlier client
  keep(answer);
  if (!list_complete(answer)) return TrackerNothing{};
  const Status status = emscon::status_of(answer);
  if (emscon::accepted(status)) return done(answer);
  if (status == Status::ServerBusy && now_ < pending_->patience) {
    cause_ = refusal_text(emscon::command_of(answer), status) + "; repeating the command";
    return send_later();
  }
  return pending_->step.optional ? done(answer) : refused(status);
}

void TrackerSession::keep(const emscon::Answer& answer) {
  if (pending_->scripted && state_ != TrackerState::Stopping && state_ != TrackerState::Restoring)
    settings_.found(answer);
  if (const auto* r = std::get_if<emscon::ReflectorAnswer>(&answer))
    reflector_in_use_ = r->internal_id;
  if (const auto* set = std::get_if<emscon::SetReflector>(&pending_->step.request)) {
    if (emscon::accepted(emscon::status_of(answer))) reflector_in_use_ = set->internal_id;
  }
}

TrackerAction TrackerSession::refused(Status status) {
  const Command command = emscon::command_of(pending_->step.request);
  const std::string text = refusal_text(command, status);
  if (pending_->step.of_order) {
    end_pending();
    end_order(Outcome::Refused, text);
    while (step_ < plan_.size() && plan_[step_].of_order) ++step_;
    return next_step();
  }

  if (command == Command::StartMeasurement && needs_beam(status)) return wait_for_beam(text);
  if (without_beam()) return start_refused();
  if (status == Status::NotWarmedUp) {
    end_pending();
    state_ = TrackerState::WaitWarm;
    cause_ = text;
    in_state(Due::WarmUp, options_.warm_poll);
    return TrackerNothing{};
  }

  if (passes(status) && now_ < pending_->patience) {
    cause_ = text + "; repeating the command";
    return send_later();
  }

  return refuse(text);
}

/// Gives up after a refusal. The controller still answers, so its settings are restored first.
TrackerAction TrackerSession::refuse(const std::string& what) {
  note_fault(what);
  end_order(Outcome::Failed, what);
  end_pending();
  new_plan(Goal::GiveUp);
  plan_restoring(TrackerState::Restoring);
  in_state(Due::Leave, options_.leave_within);
  return next_step();
}

TrackerAction TrackerSession::done(const emscon::Answer& answer) {
  const Pending was = *pending_;
  end_pending();
  if (const auto* status = std::get_if<emscon::SystemStatusAnswer>(&answer))
    return evaluate(*status);
  if (was.scripted) {
    const bool listed = !stopped_ && emscon::command_of(answer) == Command::GetReflectors;
    if (const std::string unknown = listed ? choose_reflector() : ""; !unknown.empty()) {
      if (!was.step.of_order) return refuse(unknown);
      end_order(Outcome::Refused, unknown);
      while (step_ < plan_.size() && plan_[step_].of_order) ++step_;
    }
    const bool last_of_order = step_ == plan_.size() || !plan_[step_].of_order;
    if (was.step.of_order && last_of_order && order_) end_order(Outcome::Done, outcome_of(*order_));
    return next_step();
  }

  if (state_ == TrackerState::Ready) streaming();
  return without_beam() ? done_without_beam(answer) : TrackerAction{TrackerNothing{}};
}

TrackerAction TrackerSession::evaluate(const emscon::SystemStatusAnswer& status) {
  switch (status.laser) {
    case emscon::LaserStatus::Heating:
      state_ = TrackerState::WaitWarm;
      cause_ = "the laser is heating";
      in_state(Due::WarmUp, options_.warm_poll);
      return TrackerNothing{};
    case emscon::LaserStatus::CommunicationFailed:
      return refuse("the controller has no communication with the laser");
    case emscon::LaserStatus::Unable:
      return refuse("the laser is unable to measure");
    case emscon::LaserStatus::Off:
      return refuse("the laser is off: switch it on at the controller");
    case emscon::LaserStatus::NotAvailable:
    case emscon::LaserStatus::Ready:
      break;
  }

  const bool initialised = status.tracker_processor == emscon::TrackerProcessorStatus::Initialised;
  if (!initialised) settings_.ask_again();  // a restarted controller may have lost its settings
  initialised_ = initialised;
  new_plan(Goal::SetUp);
  for (const emscon::Request& question : settings_.questions())
    plan(TrackerState::Configuring, question, true);

  return next_step();
}

}  // namespace abbe::drivers
