#include "abbe/drivers/ippdme/session.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace abbe::drivers {
namespace {

using protocol::HostTime;
using std::chrono::nanoseconds;

constexpr HostTime kNever = HostTime::max();
constexpr int kRepairable = 2;  // severity: from here on the command has failed
constexpr int kUserNeeded = 3;  // and from here on ClearAllErrors alone does not mend it
constexpr std::uint32_t kLastTag = 99'999;
constexpr ippdme::Tag kMoveReportTag{true, 1};
constexpr ippdme::Tag kAbortTag{true, 2};
constexpr double kMillimetresPerMetre = 1e3;

double seconds(nanoseconds d) {
  return 1e-9 * static_cast<double>(d.count());
}

tl::unexpected<Error> bad(const IppSessionOptions& options, std::string_view what) {
  return tl::unexpected(Error{ErrorCode::BadConfiguration, fmt::format("{}: {}", options.peer, what)});
}

std::string said(const IppError& e) {
  return fmt::format("{:04} {} (severity {})", e.code, e.text.view(), e.severity);
}

std::string_view method_name(std::string_view method) {
  return method.substr(0, method.find('('));
}

std::string mm(double m) {
  return ippdme::number_text(kMillimetresPerMetre * m);
}

std::string go_to(const ProbePoint& p) {
  return fmt::format("GoTo(X({}),Y({}),Z({}))", mm(p.position_m[0]), mm(p.position_m[1]),
                     mm(p.position_m[2]));
}

std::string pt_meas(const ProbePoint& p) {
  const auto number = [](double v) { return ippdme::number_text(v); };
  return fmt::format("PtMeas(X({}),Y({}),Z({}),IJK({},{},{}))", mm(p.position_m[0]), mm(p.position_m[1]),
                     mm(p.position_m[2]), number(p.normal[0]), number(p.normal[1]), number(p.normal[2]));
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
    case IppState::Measuring:
      return "measuring";
    case IppState::Clearing:
      return "clearing";
    case IppState::Stopping:
      return "stopping";
    case IppState::Faulted:
      return "faulted";
  }
  return "?";
}

Result<void> check(const IppSessionOptions& o) {
  const nanoseconds zero{};
  // The server gives at most 10 reports a second.
  if (o.poll_period < std::chrono::milliseconds{100}) return bad(o, "polled more than 10 times a second");
  if (o.connect_timeout <= zero || o.command_timeout <= zero || o.motion_timeout <= zero)
    return bad(o, "a time-out not above 0");
  if (o.first_pause <= zero || o.longest_pause < o.first_pause)
    return bad(o, "pauses between tries not rising");
  const auto printable = [](char c) { return c >= ' ' && c <= '~' && c != '"'; };
  if (!std::ranges::all_of(o.tool, printable)) return bad(o, "a tool name that cannot be sent");
  return {};
}

IppSession::IppSession(IppSessionOptions options)
    : options_(std::move(options)), pause_(options_.first_pause) {
  write_script();
}

void IppSession::write_script() {
  using enum IppState;
  script_ = {{.state = Opening, .method = "StartSession()"},
             {.state = Opening, .method = "ClearAllErrors()"},
             {.state = Opening, .method = "GetDMEVersion()", .purpose = Purpose::Version},
             {.state = Configuring, .method = "IsHomed()", .purpose = Purpose::IsHomed}};
  if (!options_.tool.empty())
    script_.push_back({.state = Configuring, .method = fmt::format("SetTool(\"{}\")", options_.tool)});
  script_.push_back({.state = Configuring, .method = "OnPtMeasReport(X(),Y(),Z())"});
  if (options_.move_reports) {
    script_.push_back({.state = Configuring,
                       .method = fmt::format("OnMoveReportE(Time({}),Dis(1),X(),Y(),Z())",
                                             ippdme::number_text(seconds(options_.poll_period))),
                       .optional = true,
                       .event = true});
  }
}

bool IppSession::online() const noexcept {
  return state_ != IppState::Disconnected && state_ != IppState::Faulted && state_ != IppState::Connecting;
}

HostTime IppSession::deadline() const noexcept {
  if (stopped_ && !online()) return kNever;
  return pending_ ? std::min(pending_->due, due_) : due_;
}

IppAction IppSession::on(const IppInput& input, HostTime now) {
  now_ = now;
  return std::visit([this](const auto& i) { return take(i); }, input);
}

void IppSession::note(const std::string& what) {
  fault_.text = fmt::format("{}: {}", options_.peer, what);
  ++fault_.count;
}

IppAction IppSession::give_up(IppState into, const std::string& what) {
  note(what);
  pending_.reset();
  points_.clear();  // whoever asked begins anew: the machine may have moved
  state_ = into;
  due_ = stopped_ ? kNever : now_ + pause_;
  pause_ = std::min(2 * pause_, options_.longest_pause);
  return IppClose{};
}

// --- the connection

IppAction IppSession::take(const IppTick&) {
  if (pending_ && now_ >= pending_->due) {
    if (state_ == IppState::Stopping) {
      pending_.reset();
      state_ = IppState::Disconnected;
      return IppClose{};
    }
    return give_up(
        IppState::Faulted,
        fmt::format("no answer to {} in {:g} s", method_name(pending_->step.method),
                    seconds(pending_->step.moves ? options_.motion_timeout : options_.command_timeout)));
  }
  if (stopped_ || now_ < due_) return IppNothing{};
  switch (state_) {
    case IppState::Disconnected:
    case IppState::Faulted:
      state_ = IppState::Connecting;
      due_ = now_ + options_.connect_timeout;
      return IppOpen{};
    case IppState::Connecting:
      return give_up(IppState::Disconnected,
                     fmt::format("no connection in {:g} s", seconds(options_.connect_timeout)));
    case IppState::Ready:
      return pending_
                 ? IppAction{IppNothing{}}
                 : send({.state = IppState::Ready, .method = "Get(X(),Y(),Z())", .purpose = Purpose::Get});
    default:
      return IppNothing{};
  }
}

IppAction IppSession::take(const IppConnected&) {
  if (state_ != IppState::Connecting) return IppNothing{};
  step_ = 0;
  tag_ = 0;
  due_ = kNever;
  return next_step();
}

IppAction IppSession::take(const IppConnectionLost& lost) {
  if (state_ == IppState::Stopping) {
    pending_.reset();
    state_ = IppState::Disconnected;
  } else if (state_ == IppState::Connecting || online()) {
    (void)give_up(IppState::Disconnected, lost.what);
  }
  return IppNothing{};  // there is nothing to close any more
}

IppAction IppSession::take(const IppStopRequested&) {
  if (std::exchange(stopped_, true)) return IppNothing{};
  const bool opened = online();
  const bool moving = state_ == IppState::Measuring;
  const bool connecting = state_ == IppState::Connecting;
  due_ = kNever;
  points_.clear();
  pending_.reset();
  state_ = opened ? IppState::Stopping : IppState::Disconnected;
  if (opened) {
    auto end = send({.state = IppState::Stopping, .method = "EndSession()", .purpose = Purpose::End});
    // A machine that nobody watches any more must not go on moving.
    if (moving) std::get<IppSend>(end).line.insert(0, ippdme::to_string(kAbortTag) + " AbortE()\r\n");
    return end;
  }
  return connecting ? IppAction{IppClose{}} : IppAction{IppNothing{}};
}

/// Whoever asked saw the machine stand somewhere: what is asked of one that is away must not be driven when
/// it returns.
IppAction IppSession::take(const ProbePoint& point) {
  if (stopped_) return IppNothing{};
  const bool ready_to_move =
      state_ == IppState::Ready || state_ == IppState::Measuring || state_ == IppState::Clearing;
  if (!ready_to_move) {
    note(fmt::format("asked to move while {}: not done", name_of(state_)));
    return IppNothing{};
  }
  points_.push_back(point);
  return state_ == IppState::Ready && !pending_ ? ready() : IppAction{IppNothing{}};
}

// --- commands and answers

IppAction IppSession::send(const Step& step) {
  state_ = step.state;
  ippdme::Tag tag = kMoveReportTag;
  if (!step.event) {
    tag_ = tag_ % kLastTag + 1;
    tag = {false, tag_};
  }
  due_ = kNever;  // nothing else until it is complete
  const auto patience = step.moves ? options_.motion_timeout : options_.command_timeout;
  pending_ = Pending{.step = step, .tag = tag, .due = now_ + patience};
  return IppSend{fmt::format("{} {}\r\n", ippdme::to_string(tag), step.method)};
}

IppAction IppSession::next_step() {
  if (step_ < script_.size()) return send(script_[step_++]);
  pause_ = options_.first_pause;
  due_ = now_;
  return ready();
}

IppAction IppSession::ready() {
  state_ = IppState::Ready;
  if (points_.empty()) return IppNothing{};
  const ProbePoint point = points_.front();
  points_.pop_front();
  return send({.state = IppState::Measuring,
               .method = point.touch ? pt_meas(point) : go_to(point),
               .purpose = point.touch ? Purpose::Touch : Purpose::Move,
               .moves = true});
}

/// Of a command that is not the pending one, and no event.
bool IppSession::foreign(ippdme::Tag tag) const noexcept {
  return !tag.event && (!pending_ || tag != pending_->tag);
}

IppAction IppSession::strange(std::string_view what, ippdme::Tag tag) {
  if (state_ == IppState::Stopping) return IppNothing{};  // of what was under way
  return give_up(
      IppState::Faulted,
      fmt::format("{} for {}, which was not asked{}", what, ippdme::to_string(tag),
                  pending_ ? " (pending: " + ippdme::to_string(pending_->tag) + ")" : std::string{}));
}

IppAction IppSession::take(const IppAck& ack) {
  if (!online()) return IppNothing{};
  if (foreign(ack.tag)) return strange("an acknowledgement", ack.tag);
  if (!pending_ || ack.tag != pending_->tag) return IppNothing{};
  pending_->acknowledged = true;
  return pending_->step.event ? done() : IppAction{IppNothing{}};
}

IppAction IppSession::take(const IppData& data) {
  if (!online()) return IppNothing{};
  if (foreign(data.tag)) return strange("data", data.tag);
  if (pending_ && data.tag == pending_->tag) pending_->data = data.text.view();
  return IppNothing{};
}

IppAction IppSession::take(const IppError& error) {
  if (!online() || state_ == IppState::Stopping) return IppNothing{};
  if (error.severity < kRepairable) return IppNothing{};
  if (pending_ && error.tag == pending_->tag) {
    if (!pending_->error) pending_->error = error;
    // An event command that is refused is never acknowledged.
    return pending_->step.event ? done() : IppAction{IppNothing{}};
  }
  return give_up(IppState::Faulted, fmt::format("reports {}", said(error)));
}

IppAction IppSession::take(const IppComplete& complete) {
  if (!online()) return IppNothing{};
  if (foreign(complete.tag)) return strange("completion", complete.tag);
  if (!pending_ || complete.tag != pending_->tag) return IppNothing{};
  if (!pending_->acknowledged) return strange("completion before acknowledgement", complete.tag);
  return done();
}

IppAction IppSession::take(const IppNonsense& nonsense) {
  if (!online()) return IppNothing{};
  return give_up(IppState::Faulted, fmt::format("this is no I++ DME server: {}: \"{}\"",
                                                ippdme::name_of(nonsense.error), nonsense.line.view()));
}

IppAction IppSession::done() {
  const Pending was = *std::exchange(pending_, std::nullopt);
  if (was.error && !was.step.optional && was.step.purpose != Purpose::End) return failed(was);
  switch (was.step.purpose) {
    case Purpose::End:
      state_ = IppState::Disconnected;
      return IppClose{};
    case Purpose::Version:
      if (was.data.empty()) return give_up(IppState::Faulted, "GetDMEVersion was answered without a version");
      return next_step();
    case Purpose::IsHomed:
      return judge_home(was.data);
    case Purpose::Get:
      due_ = was.due - options_.command_timeout + options_.poll_period;  // from when it was sent
      return ready();
    case Purpose::Move:
    case Purpose::Touch:
    case Purpose::Clear:
      due_ = now_;
      return ready();
    case Purpose::Other:
      break;
  }
  return next_step();
}

IppAction IppSession::judge_home(const std::string& data) {
  const bool homed = data.find('1') != std::string::npos;  // "IsHomed(1)" or "1"
  if (homed) return next_step();
  if (!options_.home) return give_up(IppState::Faulted, "the machine is not homed");
  return send({.state = IppState::Configuring, .method = "Home()", .moves = true});
}

IppAction IppSession::failed(const Pending& was) {
  const std::string what = fmt::format("{} was refused: {}", method_name(was.step.method), said(*was.error));
  const bool moving = was.step.purpose == Purpose::Move;
  const bool measuring = moving || was.step.purpose == Purpose::Touch || was.step.purpose == Purpose::Get;
  if (!measuring || was.error->severity >= kUserNeeded) return give_up(IppState::Faulted, what);
  note(what);
  if (moving) points_.clear();  // the way to what comes next was not made
  return send({.state = IppState::Clearing, .method = "ClearAllErrors()", .purpose = Purpose::Clear});
}

}  // namespace abbe::drivers
