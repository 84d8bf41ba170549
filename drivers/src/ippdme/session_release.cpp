// Stopping a motion after a fault or on request, and waiting for the release by an operator.
#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "abbe/drivers/ippdme/session.hpp"
#include "ippdme/session_text.hpp"

namespace abbe::drivers {

/// Stops a motion with AbortE, because its progress can no longer be monitored.
IppAction IppSession::stop_motion(bool close_then) {
  pending_.reset();
  points_.clear();
  close_then_ = close_then;
  stop_reason_ = last_note_;
  state_ = IppState::Aborting;
  wait_only_for(Due::Abort, now_ + options_.command_timeout);
  return IppSend{ippdme::to_string(ippdme::kAbort) + " AbortE()\r\n"};
}

IppAction IppSession::stopped_moving() {
  moving_ = false;
  settle(IppStopOutcome::Stopped, "AbortE was answered: the motion is stopped");
  if (stopped_) {
    if (!asked_reason_.empty()) hold_for(asked_reason_);
    return in_session_ ? end_session() : close(IppState::Disconnected);
  }
  hold_for(stop_reason_);
  return close_then_ ? close(IppState::AwaitingRelease) : await_release();
}

/// AbortE was not answered: the next connection begins with another AbortE. Some servers do not
/// answer AbortE outside a session. Therefore, if AbortE was sent outside a session, the next
/// connection starts a session before it sends AbortE. The connection after that sends AbortE
/// outside a session again. No session is started for a machine that is held.
IppAction IppSession::abort_unanswered() {
  const std::string what =
      fmt::format("no answer to AbortE in {:g} s: the machine may still be moving",
                  ipp_text::seconds(options_.command_timeout));
  note(what);
  settle(IppStopOutcome::NotConfirmed, what);
  if (!in_session_) session_first_ = !session_first_ && !held_;
  return stopped_ ? end_session() : close(IppState::Faulted);
}

/// AbortE was refused. Some servers refuse AbortE outside a session: a session is started first,
/// once. No session is started for a machine that is held: an operator must inspect it.
IppAction IppSession::abort_refused(const IppError& error) {
  if (!in_session_ && !held_ && !session_first_ && !stopped_) {
    session_first_ = true;
    return next_step();
  }

  const std::string what = fmt::format("AbortE was refused: {}: the machine may still be moving",
                                       ipp_text::text_of(error));
  note(what);
  settle(IppStopOutcome::NotConfirmed, what);
  if (stopped_) return end_session();
  hold_for(what);
  session_first_ = false;
  const bool retry = in_session_;  // the next connection sends AbortE outside a session
  (void)close(IppState::AwaitingRelease);
  if (!retry) deadlines_.cancel_all();

  return IppClose{};
}

/// Holds the machine: it awaits a release. The first reason is kept until the release.
void IppSession::hold_for(const std::string& reason) {
  if (!std::exchange(held_, true)) hold_reason_ = reason;
}

IppAction IppSession::hold(const std::string& what) {
  hold_for(what);
  note(what);
  points_.clear();
  return moving_ && open_ ? stop_motion(false) : await_release();
}

IppAction IppSession::await_release() {
  pending_.reset();
  deadlines_.cancel_all();
  state_ = IppState::AwaitingRelease;
  if (open_ && in_session_) deadlines_.set(Due::Watch, now_ + 10 * options_.poll_period);
  return IppNothing{};
}

/// Sets the outcome of the outstanding request to stop, if there is one.
void IppSession::settle(IppStopOutcome outcome, std::string text) {
  if (stop_.outcome != IppStopOutcome::Pending) return;
  stop_.outcome = outcome;
  stop_.text = std::move(text);
}

IppAction IppSession::take(const IppAbortRequested& request) {
  stop_ = {std::max(stop_.number, request.number), IppStopOutcome::Pending, {}};
  points_.clear();
  // the answer to the running AbortE is the outcome
  if (state_ == IppState::Aborting) return IppNothing{};
  if (moving_ && open_) return stop_motion_by_request(request.reason);
  if (moving_) {
    asked_reason_ = request.reason;
    return connect_to_abort();
  }
  if (!open_) return stop_without_connection(request.reason);

  settle(IppStopOutcome::Stopped, "no motion of abbed was under way");
  const bool ended = state_ == IppState::Stopping || held_ || stopped_;
  return ended ? IppAction{IppNothing{}} : hold(std::string{request.reason});
}

IppAction IppSession::stop_motion_by_request(std::string_view reason) {
  if (!held_) note(std::string{reason});
  return stop_motion(false);
}

/// The connection was lost during a motion: another one is opened at once, and it begins with
/// AbortE. If it cannot be opened, the request to stop is not sent.
IppAction IppSession::connect_to_abort() {
  return state_ == IppState::Connecting ? IppAction{IppNothing{}} : connect();
}

IppAction IppSession::stop_without_connection(std::string_view reason) {
  settle(IppStopOutcome::NotSent,
         "there is no connection to the machine; no motion of abbed was under way");
  if (held_ || stopped_) return IppNothing{};
  note(std::string{reason});
  hold_for(std::string{reason});
  return close(IppState::AwaitingRelease);
}

std::string IppSession::danger() const {
  if (!moving_ || state_ == IppState::Aborting) return {};
  if (!open_)
    return "the machine may be moving: AbortE is not confirmed, and there is no connection";
  return in_session_ ? std::string{} : "the machine may be moving: AbortE is not confirmed";
}

/// True also between the attempts to send AbortE for a motion that an earlier connection began.
bool IppSession::releasable() const noexcept {
  const bool trying =
      state_ == IppState::Connecting || (state_ == IppState::Aborting && !in_session_);
  return !stopped_ && (state_ == IppState::AwaitingRelease || (held_ && trying));
}

/// Handles the release by an operator. Only here are errors of the machine cleared.
IppAction IppSession::take(const IppReleaseRequested&) {
  if (!releasable()) return IppNothing{};
  settle(IppStopOutcome::NotSent, "a person has released the machine before AbortE was sent");
  held_ = moving_ = session_first_ = false;  // an operator has inspected the machine
  hold_reason_.clear();
  asked_reason_.clear();
  may_home_ = options_.home;
  pause_ = options_.first_pause;
  if (open_ && in_session_)
    return send(
        {.state = IppState::Clearing, .method = "ClearAllErrors()", .purpose = Purpose::Clear});
  if (open_) return close(IppState::Disconnected);
  if (state_ == IppState::Connecting) return IppNothing{};
  state_ = IppState::Disconnected;
  wait_only_for(Due::Connect, now_);

  return IppNothing{};
}

/// Ends the session. If AbortE is outstanding and its answer would begin a hold, the hold also
/// applies if the session ends before the answer: the next start of abbed awaits a release.
IppAction IppSession::take(const IppStopRequested&) {
  if (std::exchange(stopped_, true)) return IppNothing{};
  points_.clear();
  if (stop_.outcome != IppStopOutcome::Pending) stop_ = {stop_.number, IppStopOutcome::Pending, {}};
  if (state_ == IppState::Aborting) {
    hold_for(stop_reason_);
    return IppNothing{};
  }
  if (moving_) return open_ ? stop_motion(false) : connect_to_abort();
  settle(IppStopOutcome::Stopped, "no motion of abbed was under way");
  return end_session();
}

void IppSession::give_up_stop() {
  if (open_)
    settle(IppStopOutcome::NotConfirmed,
           "AbortE was not answered before the connection was closed: the machine may be moving");
  else
    settle(IppStopOutcome::NotSent,
           "there was no connection before the end of abbed: the machine may be moving");
}

IppAction IppSession::end_session() {
  const bool connecting = state_ == IppState::Connecting;
  deadlines_.cancel_all();
  pending_.reset();
  if (open_)
    return send({.state = IppState::Stopping, .method = "EndSession()", .purpose = Purpose::End});
  state_ = IppState::Disconnected;
  return connecting ? IppAction{IppClose{}} : IppAction{IppNothing{}};
}

}  // namespace abbe::drivers
