#include "abbe/drivers/ippdme/session.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "ippdme/session_text.hpp"

namespace abbe::drivers {
namespace {

using std::chrono::nanoseconds;

constexpr std::uint32_t kLastTag = 99'999;
constexpr ippdme::Tag kMoveReportTag{true, 1};
constexpr ippdme::Tag kWatchTag{true, 3};

tl::unexpected<Error> bad(const IppSessionOptions& options, std::string_view what) {
  return tl::unexpected(
      Error{ErrorCode::BadConfiguration, fmt::format("{}: {}", options.peer, what)});
}

}  // namespace

const char* name_of(IppState state) noexcept {
  switch (state) {
    case IppState::Disconnected:
      return "disconnected";
    case IppState::Connecting:
      return "connecting";
    case IppState::Opening:
      return "opening";
    case IppState::Configuring:
      return "configuring";
    case IppState::Ready:
      return "ready";
    case IppState::Storing:
      return "storing";
    case IppState::Measuring:
      return "measuring";
    case IppState::Aborting:
      return "aborting";
    case IppState::AwaitingRelease:
      return "awaiting release";
    case IppState::Clearing:
      return "clearing";
    case IppState::Stopping:
      return "stopping";
    case IppState::Faulted:
      return "faulted";
  }

  return "?";
}

const char* name_of(IppStopOutcome outcome) noexcept {
  switch (outcome) {
    case IppStopOutcome::None:
      return "none";
    case IppStopOutcome::Pending:
      return "pending";
    case IppStopOutcome::Stopped:
      return "stopped";
    case IppStopOutcome::NotConfirmed:
      return "not confirmed";
    case IppStopOutcome::NotSent:
      return "not sent";
  }

  return "?";
}

Result<void> check(const IppSessionOptions& o) {
  const nanoseconds zero{};
  // The server gives at most 10 reports a second.
  if (o.poll_period < std::chrono::milliseconds{100})
    return bad(o, "poll period below 100 ms: a server gives at most 10 reports a second");
  if (o.connect_timeout <= zero || o.command_timeout <= zero || o.motion_timeout <= zero ||
      o.store_timeout <= zero)
    return bad(o, "all time-outs must be above 0");
  if (o.first_pause <= zero || o.longest_pause < o.first_pause)
    return bad(o, "first pause must be above 0 and not above the longest pause");
  const auto printable = [](char c) { return c >= ' ' && c <= '~' && c != '"'; };
  if (!std::ranges::all_of(o.tool, printable))
    return bad(o, "tool name: only printable ASCII without \" can be sent");
  return {};
}

IppSession::IppSession(IppSessionOptions options)
    : options_(std::move(options)), pause_(options_.first_pause), may_home_(options_.home) {
  write_script();
  deadlines_.set(Due::Connect, {});
  if (options_.held.empty()) return;
  (void)hold(options_.held);
  moving_ = options_.moving;
  if (moving_) deadlines_.set(Due::Connect, {});  // at once, to send AbortE
}

void IppSession::write_script() {
  using enum IppState;
  script_ = {{.state = Opening, .method = "StartSession()", .purpose = Purpose::Start},
             {.state = Opening, .method = "GetDMEVersion()", .purpose = Purpose::Version},
             {.state = Configuring, .method = "IsHomed()", .purpose = Purpose::IsHomed}};
  if (!options_.tool.empty())
    script_.push_back(
        {.state = Configuring, .method = fmt::format("SetTool(\"{}\")", options_.tool)});
  script_.push_back({.state = Configuring, .method = "OnPtMeasReport(X(),Y(),Z())"});

  const auto period = ippdme::number_text(ipp_text::seconds(options_.poll_period));
  if (options_.move_reports && period) {
    script_.push_back({.state = Configuring,
                       .method = fmt::format("OnMoveReportE(Time({}),Dis(1),X(),Y(),Z())", *period),
                       .event = kMoveReportTag});
  }
}

/// Gives up move reports, for a server that refuses OnMoveReportE with severity 2 or more: it would
/// refuse the command again after every release.
void IppSession::without_move_reports() {
  options_.move_reports = false;
  write_script();
}

void IppSession::wait_only_for(Due due, protocol::HostTime at) {
  deadlines_.cancel_all();
  deadlines_.set(due, at);
}

void IppSession::end_pending() {
  pending_.reset();
  deadlines_.cancel(Due::Answer);
}

IppAction IppSession::on(const IppInput& input, protocol::HostTime now) {
  now_ = now;
  return std::visit([this](const auto& i) { return take(i); }, input);
}

void IppSession::note(const std::string& what) {
  fault_.text = held_ && what != hold_reason_
                    ? fmt::format("{}: {}; {}", options_.peer, hold_reason_, what)
                    : fmt::format("{}: {}", options_.peer, what);
  last_note_ = what;
  ++fault_.count;
}

IppAction IppSession::give_up(IppState into, const std::string& what) {
  note(what);
  points_.clear();  // the machine may have moved: the caller must request all points again
  if (state_ == IppState::Aborting) {
    close_then_ = true;
    return IppNothing{};
  }
  return moving_ && open_ ? stop_motion(true) : close(into);
}

IppAction IppSession::close(IppState into) {
  settle(open_ ? IppStopOutcome::NotConfirmed : IppStopOutcome::NotSent,
         fmt::format("{}{}", last_note_, moving_ ? ": the machine may be moving" : ""));
  pending_.reset();
  deadlines_.cancel_all();
  open_ = in_session_ = false;
  state_ = held_ && !stopped_ ? IppState::AwaitingRelease : into;
  // An unfinished motion is aborted on the next connection, whether or not the machine is held.
  if (!stopped_ && (!held_ || moving_)) deadlines_.set(Due::Connect, now_ + pause_);
  pause_ = std::min(2 * pause_, options_.longest_pause);
  return IppClose{};
}

// --- the connection

IppAction IppSession::take(const IppTick&) {
  const auto due = deadlines_.passed(now_);
  if (!due) return IppNothing{};

  switch (*due) {
    case Due::Abort:
      return abort_unanswered();
    case Due::Answer:
      return unanswered();
    case Due::Connect:
      return connect();
    case Due::Connection:
      return give_up(
          IppState::Disconnected,
          fmt::format("no connection in {:g} s", ipp_text::seconds(options_.connect_timeout)));
    case Due::Store:
      return take(
          IppMotionNotStored{fmt::format("the state of the machine is not stored after {:g} s",
                                         ipp_text::seconds(options_.store_timeout))});
    case Due::Poll:
      return send(
          {.state = IppState::Ready, .method = "Get(X(),Y(),Z())", .purpose = Purpose::Get});
    case Due::Watch:
      return send({.state = IppState::AwaitingRelease,
                   .method = "GetErrStatusE()",
                   .purpose = Purpose::Watch,
                   .event = kWatchTag});
  }

  return IppNothing{};
}

IppAction IppSession::unanswered() {
  if (state_ == IppState::Stopping) return close(IppState::Disconnected);
  const auto patience = pending_->step.moves ? options_.motion_timeout : options_.command_timeout;
  return give_up(IppState::Faulted, fmt::format("no answer to {} in {:g} s",
                                                ipp_text::method_name(pending_->step.method),
                                                ipp_text::seconds(patience)));
}

IppAction IppSession::connect() {
  state_ = IppState::Connecting;
  wait_only_for(Due::Connection, now_ + options_.connect_timeout);
  return IppOpen{};
}

IppAction IppSession::take(const IppConnected&) {
  if (state_ != IppState::Connecting) return IppNothing{};
  open_ = true;
  step_ = 0;
  tag_ = 0;
  deadlines_.cancel_all();
  if (!moving_ || (session_first_ && !held_)) return next_step();
  if (!held_) note("the connection was lost while the machine was moving");
  return stop_motion(false);
}

IppAction IppSession::take(const IppConnectionLost& lost) {
  const bool awaited = state_ == IppState::Connecting || open_;
  if (awaited && state_ != IppState::Stopping) note(lost.what);
  points_.clear();
  if (awaited) (void)close(IppState::Disconnected);
  return IppNothing{};  // the connection is already closed
}

/// A path requested while the connection is lost is discarded: the caller planned it from a
/// position that may have changed, so it must not move the machine after a reconnection. A path
/// with a target that cannot be written is discarded as a whole.
IppAction IppSession::take(const IppPath& path) {
  if (stopped_) return IppNothing{};
  const bool accepts =
      state_ == IppState::Ready || state_ == IppState::Storing || state_ == IppState::Measuring;
  if (!accepts) {
    note(fmt::format("asked to move while {}: the request was discarded", name_of(state_)));
    return IppNothing{};
  }
  if (const auto valid = check(path); !valid) {
    note(valid.error().text);
    return IppNothing{};
  }
  points_.insert(points_.end(), path.begin(), path.end());
  return state_ == IppState::Ready && !pending_ ? ready() : IppAction{IppNothing{}};
}

// --- commands and answers

IppAction IppSession::send(const Step& step) {
  state_ = step.state;
  moving_ = moving_ || step.moves;
  if (!step.event) tag_ = tag_ % kLastTag + 1;
  const ippdme::Tag tag = step.event.value_or(ippdme::Tag{false, tag_});
  const auto patience = step.moves ? options_.motion_timeout : options_.command_timeout;
  wait_only_for(Due::Answer, now_ + patience);  // no other command until this one is answered
  pending_ = Pending{.step = step, .tag = tag, .sent = now_};
  return IppSend{fmt::format("{} {}\r\n", ippdme::to_string(tag), step.method)};
}

/// Sends a motion once it is stored that the machine moves: see IppMotionStored. A stop, an error
/// or a lost connection in between discards the motion.
IppAction IppSession::begin_motion(Step step) {
  step.moves = true;
  state_ = IppState::Storing;
  prepared_ = std::move(step);
  wait_only_for(Due::Store, now_ + options_.store_timeout);
  return IppNothing{};
}

IppAction IppSession::take(const IppMotionStored&) {
  return state_ == IppState::Storing ? send(prepared_) : IppAction{IppNothing{}};
}

IppAction IppSession::take(const IppMotionNotStored& failed) {
  if (state_ != IppState::Storing) return IppNothing{};
  const std::string what =
      fmt::format("{} was not sent: {}", ipp_text::method_name(prepared_.method), failed.why);
  if (prepared_.state == IppState::Configuring) return give_up(IppState::Faulted, what);
  note(what);
  points_.clear();
  wait_only_for(Due::Poll, now_);
  return ready();
}

IppAction IppSession::next_step() {
  if (step_ < script_.size()) return send(script_[step_++]);
  pause_ = options_.first_pause;
  may_home_ = false;
  wait_only_for(Due::Poll, now_);
  return ready();
}

IppAction IppSession::ready() {
  state_ = IppState::Ready;
  if (points_.empty()) return IppNothing{};
  const ProbePoint point = points_.front();
  points_.pop_front();
  auto method = point.touch ? ipp_text::pt_meas(point) : ipp_text::go_to(point);
  if (!method) return give_up(IppState::Faulted, method.error().text);
  return begin_motion({.state = IppState::Measuring,
                       .method = std::move(*method),
                       .purpose = point.touch ? Purpose::Touch : Purpose::Move});
}

/// True for the tag of a command that is neither the pending one nor an event.
bool IppSession::foreign(ippdme::Tag tag) const noexcept {
  return !tag.event && (!pending_ || tag != pending_->tag);
}

IppAction IppSession::unexpected_response(std::string_view what, ippdme::Tag tag) {
  const bool late = state_ == IppState::Stopping || state_ == IppState::Aborting ||
                    state_ == IppState::AwaitingRelease || state_ == IppState::Clearing;
  if (late) return IppNothing{};  // a late response to the previous command
  return give_up(IppState::Faulted,
                 fmt::format("{} for tag {} without a command{}", what, ippdme::to_string(tag),
                             pending_ ? " (pending: " + ippdme::to_string(pending_->tag) + ")"
                                      : std::string{}));
}

IppAction IppSession::take(const IppAck& ack) {
  if (!open_) return IppNothing{};
  if (foreign(ack.tag)) return unexpected_response("an acknowledgement", ack.tag);
  if (!pending_ || ack.tag != pending_->tag) return IppNothing{};
  pending_->acknowledged = true;
  return pending_->step.event ? done() : IppAction{IppNothing{}};
}

IppAction IppSession::take(const IppData& data) {
  if (!open_) return IppNothing{};
  if (foreign(data.tag)) return unexpected_response("data", data.tag);
  if (pending_ && data.tag == pending_->tag) pending_->data = data.text.view();
  return IppNothing{};
}

IppAction IppSession::take(const IppError& error) {
  if (!open_ || state_ == IppState::Stopping) return IppNothing{};
  const bool failed = error.severity >= ipp_text::kRepairable;
  const bool of_abort = error.tag == ippdme::kAbort && error.code != ipp_text::kAborted;
  if (failed && of_abort && state_ == IppState::Aborting) return abort_refused(error);
  if (failed && error.tag == kMoveReportTag) without_move_reports();
  const bool of_pending = pending_ && error.tag == pending_->tag;
  if (of_pending && failed && !pending_->error) pending_->error = error;
  if (of_pending && pending_->step.event) return done();  // a refused event is not acknowledged
  if (!failed) return IppNothing{};
  if (of_pending && !(pending_->step.moves && error.severity >= ipp_text::kUserNeeded))
    return IppNothing{};

  return take_foreign(error);
}

/// Handles an error that belongs to no pending command, or one after which the pending motion must
/// be stopped.
IppAction IppSession::take_foreign(const IppError& error) {
  const std::string what = fmt::format("reports {}", ipp_text::text_of(error));
  const bool held = state_ == IppState::Aborting || state_ == IppState::AwaitingRelease;
  if (!held) return hold(what);
  const bool caused_by_abort = error.code == ipp_text::kAborted || error.tag == ippdme::kAbort;
  if (caused_by_abort) return IppNothing{};
  hold_for(what);
  note(what);
  return IppNothing{};
}

IppAction IppSession::take(const IppComplete& complete) {
  if (!open_) return IppNothing{};
  if (state_ == IppState::Aborting && complete.tag == ippdme::kAbort) return stopped_moving();
  if (foreign(complete.tag)) return unexpected_response("completion", complete.tag);
  if (!pending_ || complete.tag != pending_->tag) return IppNothing{};
  if (!pending_->acknowledged)
    return unexpected_response("completion before acknowledgement", complete.tag);
  return done();
}

IppAction IppSession::take(const IppProtocolError& malformed) {
  if (!open_) return IppNothing{};
  return give_up(IppState::Faulted, fmt::format("this is no I++ DME server: {}: \"{}\"",
                                                ippdme::name_of(malformed.error),
                                                ipp_text::escaped(malformed.line.view())));
}

IppAction IppSession::done() {
  const Pending was = *pending_;
  end_pending();
  if (was.step.moves) moving_ = false;
  const bool tolerated = was.step.purpose == Purpose::End || was.step.purpose == Purpose::Watch;
  if (was.error && !tolerated) return failed(was);

  switch (was.step.purpose) {
    case Purpose::End:
      return close(IppState::Disconnected);
    case Purpose::Start:
      return began_session();
    case Purpose::Version:
      if (was.data.empty())
        return give_up(IppState::Faulted, "GetDMEVersion was answered without a version");
      return next_step();
    case Purpose::IsHomed:
      return check_homed(was.data);
    case Purpose::Get:
      wait_only_for(Due::Poll, was.sent + options_.poll_period);
      return ready();
    case Purpose::Move:
    case Purpose::Touch:
      wait_only_for(Due::Poll, now_);
      return ready();
    case Purpose::Watch:
      return await_release();
    case Purpose::Clear:
      step_ = 1;  // without StartSession: the session exists
      return next_step();
    case Purpose::Other:
      break;
  }

  return next_step();
}

IppAction IppSession::check_homed(const std::string& data) {
  const bool homed = data.find('1') != std::string::npos;  // "IsHomed(1)" or "1"
  if (homed) return next_step();
  if (!options_.home)
    return give_up(IppState::Faulted, "the machine is not homed: home it at its controller");
  if (!may_home_) return hold("the machine is not homed any more");
  return begin_motion({.state = IppState::Configuring, .method = "Home()"});
}

/// Handles a refused command. StartSession is refused while another client's session, or the
/// previous one of this client, has not ended: a temporary fault. Every other refusal holds the
/// machine until a release.
IppAction IppSession::failed(const Pending& was) {
  const std::string what = fmt::format("{} was refused: {}", ipp_text::method_name(was.step.method),
                                       ipp_text::text_of(*was.error));
  const bool busy =
      was.step.purpose == Purpose::Start && was.error->code == ipp_text::kProtocolError;
  return busy && !moving_ ? give_up(IppState::Faulted, what) : hold(what);
}

IppAction IppSession::began_session() {
  in_session_ = true;
  if (!moving_) return next_step();
  note("the connection was lost while the machine was moving");
  return stop_motion(false);
}

}  // namespace abbe::drivers
