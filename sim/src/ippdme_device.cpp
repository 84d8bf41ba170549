#include "abbe/sim/ippdme_device.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <utility>

namespace abbe::sim {
namespace {

constexpr double kMillimetresPerMetre = 1e3;
// shortest interval of reports: the specification allows at most 10 per second
constexpr auto kFastestReport = std::chrono::milliseconds{100};

using ippdme::Argument;

std::vector<Argument> arguments_of(const std::string& text) {
  std::vector<Argument> all;
  ippdme::ArgumentReader reader{text};
  while (const auto argument = reader.next())
    if (*argument) all.push_back(**argument);
  return all;
}

/// The names in X(),Y(),IJK(); nullopt if one of them is not a coordinate of a position.
std::optional<std::vector<std::string>> place_names(const std::vector<Argument>& arguments) {
  std::vector<std::string> names;
  for (const Argument& a : arguments) {
    const bool known = a.text == "X" || a.text == "Y" || a.text == "Z" || a.text == "IJK";
    if (a.kind != Argument::Kind::Property || !known) return std::nullopt;
    names.emplace_back(a.text);
  }
  return names;
}

/// The position X(1),Y(2),Z(3); a coordinate that is not given keeps its current value.
Eigen::Vector3d place_m(const std::string& arguments, Eigen::Vector3d here_m) {
  const auto point = ippdme::parse_point(arguments);
  for (Eigen::Index i = 0; point && i < 3; ++i)
    if (((point->known >> i) & 1) != 0)
      here_m[i] = point->p_mm[static_cast<std::size_t>(i)] / kMillimetresPerMetre;
  return here_m;
}

/// True if the machine can report the position: all coordinates are within 1e12 mm of zero.
bool finite_place(const std::string& arguments) {
  constexpr double kFarthest_mm = 1e12;
  const auto point = ippdme::parse_point(arguments);
  return point &&
         std::ranges::all_of(point->p_mm, [](double p) { return std::abs(p) <= kFarthest_mm; });
}

}  // namespace

IppDmeDevice::IppDmeDevice(const IppDmeOptions& options, HostTime)
    : options_(options), homed_(options.homed) {
  if (!options_.tools.empty()) tool_ = options_.tools.front();
}

void IppDmeDevice::connected(HostTime) {
  framer_->reset();
  out_.clear();
}

void IppDmeDevice::disconnected() {
  session_ = wants_close_ = false;
  queue_.clear();
  move_report_.reset();
  if (motion_) motion_->client_gone = true;
  if (!options_.keeps_moving) motion_.reset();
}

std::vector<std::byte> IppDmeDevice::take_output() {
  return std::exchange(out_, {});
}

void IppDmeDevice::send_line(std::string_view line) {
  const auto bytes = std::as_bytes(std::span{line});
  out_.insert(out_.end(), bytes.begin(), bytes.end());
  out_.push_back(std::byte{'\r'});
  out_.push_back(std::byte{'\n'});
}

void IppDmeDevice::fault(const Command& command, int severity, int code, std::string_view text) {
  const std::string number = std::to_string(code);
  send_line(ippdme::to_string(command.tag) + " ! Error(" + std::to_string(severity) + "," +
            std::string(4 - std::min<std::size_t>(4, number.size()), '0') + number + "," +
            command.method + ",\"" + std::string(text) + "\")");
  failed_ = failed_ || severity >= 2;
}

std::string IppDmeDevice::place(const std::vector<std::string>& names,
                                const Eigen::Vector3d& p_m) const {
  std::string text;
  for (const std::string& name : names) {
    if (!text.empty()) text += ',';
    if (name == "IJK") {
      text += "IJK(0,0,1)";
    } else {
      // number_text() succeeds, see finite_place()
      text +=
          name + "(" + ippdme::number_text(kMillimetresPerMetre * p_m[name[0] - 'X']).value() + ")";
    }
  }
  return text;
}

Eigen::Vector3d IppDmeDevice::reading_m(HostTime now) const {
  if (!motion_) return position_m_;
  const double whole_s = std::max(1e-9, ns_to_seconds(motion_->end - motion_->begin));
  const double share = std::clamp(ns_to_seconds(now - motion_->begin) / whole_s, 0.0, 1.0);
  return motion_->from_m + share * (motion_->to_m - motion_->from_m);
}

void IppDmeDevice::inject(const Fault& fault, HostTime now) {
  constexpr int kSurfaceNotFound = 1006;
  constexpr int kOutOfLimits = 2500;
  if (fault.kind == FaultKind::Mute) {
    disconnected();  // discards the session and the queued commands
    motion_.reset();
    mute_until_ = now + seconds_to_ns(fault.duration_s);
  }

  if (fault.kind == FaultKind::Disconnect) wants_close_ = true;
  if (fault.kind == FaultKind::EmergencyStop)
    press_emergency_stop(now, now + seconds_to_ns(fault.duration_s));
  if (fault.kind == FaultKind::ErrorReport) report_error(static_cast<int>(fault.value));
  if (fault.kind == FaultKind::OddTag) send_line("98765 %");
  if (fault.kind == FaultKind::NotAscii)
    send_line("E0000 ! Error(1,0504,Maschine,\"Druckluft zu niedrig f\xFCr T\xE4ster\")");
  if (fault.kind == FaultKind::RefuseTouch)
    refuse_touch_ = fault.value > 0.0 ? static_cast<int>(fault.value) : kSurfaceNotFound;
  if (fault.kind == FaultKind::RefuseWay)
    refuse_way_ = fault.value > 0.0 ? static_cast<int>(fault.value) : kOutOfLimits;
  if (fault.kind == FaultKind::LineGarbage) send_line("\x01 this is no line of I++ DME");
}

// --- received lines

void IppDmeDevice::receive(std::span<const std::byte> bytes, HostTime now) {
  advance(now);
  if (now < mute_until_) return;
  while (!bytes.empty()) {
    const std::size_t taken = framer_->push(bytes);
    bytes = bytes.subspan(taken);
    while (const auto line = framer_->next()) {
      if (!*line) {
        send_line("E0000 ! Error(3,0007,Server,\"Illegal character\")");
        framer_->reset();
        return;
      }
      if (!std::ranges::all_of(**line, [](char c) { return c >= ' ' && c <= '~'; })) {
        send_line("E0000 ! Error(3,0007,Server,\"Illegal character\")");
        continue;
      }
      on_line(**line, now);
    }

    if (taken == 0) return;
  }

  begin_next(now);
}

void IppDmeDevice::on_line(std::string_view line, HostTime now) {
  const auto parsed = ippdme::parse_command(line);
  if (!parsed) {
    const bool tag = parsed.error() == ippdme::LineError::BadTag;
    send_line(tag ? "E0000 ! Error(2,0001,Server,\"Illegal tag\")"
                  : "E0000 ! Error(3,0008,Server,\"Protocol error\")");
    return;
  }

  const Command command{parsed->tag, std::string(parsed->method), std::string(parsed->arguments)};
  heard_.push_back(command.method + "(" + command.arguments + ")");
  if (heard_.size() > kMostHeard) heard_.pop_front();
  if (command.method == "AbortE" && !options_.answers_aborts) return;
  acknowledge(command.tag);

  if (command.tag.event) {
    on_event(command, now);
  } else {
    queue_.push_back(command);
  }
}

void IppDmeDevice::on_event(const Command& command, HostTime now) {
  if (command.method == "AbortE") {
    if (options_.refuses_aborts) {
      fault(command, 3, 500, "Refused by the simulation");
    } else if (!session_ && !options_.aborts_outside_session) {
      fault(command, 3, 8, "Protocol error");
    } else {
      abort(now);
    }
  } else if (command.method == "GetErrStatusE") {
    data(command.tag, failed_ ? "ErrStatus(1)" : "ErrStatus(0)");
  } else if (command.method == "OnMoveReportE" && session_) {
    if (!carry_out_reports(command, now)) return;
    return;  // stays active until the session ends
  } else {
    fault(command, 2, 501, "Unsupported command");
  }

  complete(command.tag);
}

void IppDmeDevice::abort(HostTime now) {
  position_m_ = reading_m(now);
  if (motion_ && !motion_->client_gone) queue_.push_front(motion_->command);
  motion_.reset();
  for (const Command& command : queue_) {
    fault(command, 2, 6, "Transaction aborted");
    complete(command.tag);
  }
  queue_.clear();
  failed_ = true;
}

/// Sends an error that belongs to no command.
void IppDmeDevice::report_error(int severity) {
  const int code = severity >= 9 ? 503 : severity >= 3 ? 1009 : severity == 2 ? 1001 : 504;
  fault({ippdme::kUnsolicited, "Machine", {}}, severity, code, "From the simulation");
}

void IppDmeDevice::press_emergency_stop(HostTime now, HostTime pulled_out_at) {
  position_m_ = reading_m(now);
  emergency_until_ = pulled_out_at;
  motion_.reset();
  queue_.clear();
  failed_ = true;
  send_line("E0000 ! Error(3,0500,Machine,\"Emergency stop\")");
}

void IppDmeDevice::touch_by_hand(const Eigen::Vector3d& reading_m) {
  ++touches_;
  send_line("E0000 # PtMeas(" + place({"X", "Y", "Z"}, reading_m) + ")");
}

// --- due actions

HostTime IppDmeDevice::next_due() const {
  HostTime due = HostTime::max();
  if (motion_) due = motion_->end;
  if (motion_ && move_report_) due = std::min(due, move_report_->next);
  return due;
}

void IppDmeDevice::advance(HostTime now) {
  while (motion_ && next_due() <= now) {
    if (move_report_ && move_report_->next < motion_->end) {
      data(move_report_->tag, place(move_report_->names, reading_m(move_report_->next)));
      move_report_->next += move_report_->period;
    } else {
      const HostTime end = motion_->end;
      end_motion();
      begin_next(end);
    }
  }
}

void IppDmeDevice::begin_next(HostTime now) {
  while (!motion_ && !queue_.empty()) {
    const Command command = queue_.front();
    queue_.pop_front();
    carry_out(command, now);
    if (!motion_) complete(command.tag);
  }
}

void IppDmeDevice::carry_out(const Command& command, HostTime now) {
  const bool always = command.method == "StartSession" || command.method == "EndSession";
  if (!session_ && !always) return fault(command, 3, 8, "Protocol error");
  const bool allowed_after_error =
      command.method == "ClearAllErrors" || command.method == "GetXtdErrStatus" || always;
  if (failed_ && !allowed_after_error)
    return fault(command, 2, 514, "Use ClearAllErrors to continue");
  if (now < emergency_until_ && command.method == "ClearAllErrors")
    return fault(command, 3, 500, "Emergency stop");
  if (carry_out_session(command) || carry_out_tools(command) || carry_out_motion(command, now) ||
      carry_out_reports(command, now))
    return;
  fault(command, 1, 501, "Unsupported command");
}

bool IppDmeDevice::carry_out_session(const Command& command) {
  if (command.method == "StartSession") {
    if (session_) {
      fault(command, 3, 8, "Protocol error");
      return true;
    }
    session_ = true;
    failed_ = false;
    touch_report_ = {"X", "Y", "Z"};
  } else if (command.method == "EndSession") {
    session_ = false;
    move_report_.reset();
  } else if (command.method == "ClearAllErrors") {
    failed_ = false;
  } else if (command.method == "GetDMEVersion") {
    data(command.tag, "GetDMEVersion(\"1.4.3\")");
  } else if (command.method == "GetMachineClass") {
    data(command.tag, "GetMachineClass(\"CartCMM\")");
  } else if (command.method == "GetXtdErrStatus") {
    data(command.tag, homed_ ? "IsHomed(1)" : "IsHomed(0)");
  } else if (command.method == "GetErrorInfo") {
    data(command.tag, "\"see I++ DME 1.4.3\"");
  } else {
    return command.method == "EnableUser" || command.method == "DisableUser";
  }

  return true;
}

bool IppDmeDevice::carry_out_tools(const Command& command) {
  if (command.method == "EnumTools") {
    for (const std::string& tool : options_.tools) data(command.tag, "\"" + tool + "\"");
    return true;
  }

  if (command.method != "SetTool" && command.method != "ChangeTool" && command.method != "FindTool")
    return false;
  const auto arguments = arguments_of(command.arguments);

  if (arguments.size() != 1 || arguments[0].kind != Argument::Kind::String) {
    fault(command, 1, 502, "Incorrect arguments");
  } else if (std::ranges::find(options_.tools, arguments[0].text) == options_.tools.end()) {
    fault(command, 2, 1502, "Tool not found");
  } else {
    tool_ = arguments[0].text;
  }

  return true;
}

bool IppDmeDevice::carry_out_reports(const Command& command, HostTime now) {
  auto arguments = arguments_of(command.arguments);
  if (command.method == "OnPtMeasReport" || command.method == "Get") {
    const auto names = place_names(arguments);
    if (!names) {
      fault(command, 1, 502, "Incorrect arguments");
    } else if (command.method == "Get") {
      data(command.tag, place(*names, reading_m(now)));
    } else {
      touch_report_ = *names;
    }
    return true;
  }

  if (command.method != "OnMoveReportE" || !options_.speaks_move_reports) {
    if (command.tag.event) fault(command, 1, 501, "Unsupported command");
    return false;
  }

  MoveReport report{command.tag, {}, kFastestReport, now};
  std::erase_if(arguments, [&](const Argument& a) {
    if (a.text == "Time" && a.count == 1 && a.numbers[0] < 1e6)
      report.period =
          std::max<std::chrono::nanoseconds>(kFastestReport, seconds_to_ns(a.numbers[0]));
    return a.text == "Time" || a.text == "Dis";
  });

  const auto names = place_names(arguments);
  if (!names) {
    fault(command, 1, 502, "Incorrect arguments");
    return true;
  }

  report.names = *names;
  move_report_ = report;
  return true;
}

// --- motion

bool IppDmeDevice::carry_out_motion(const Command& command, HostTime now) {
  if (command.method == "IsHomed") {
    data(command.tag, homed_ ? "IsHomed(1)" : "IsHomed(0)");
    return true;
  }

  if (command.method == "Home") {
    begin_motion(command, Eigen::Vector3d::Zero(), ns_to_seconds(options_.home_time), now);
    motion_->homing = true;
    return true;
  }

  if (command.method != "GoTo" && command.method != "PtMeas") return false;
  if (!finite_place(command.arguments)) {
    fault(command, 1, 502, "Incorrect arguments");
  } else if (!homed_) {
    fault(command, 2, 1000, "Machine in error state: not homed");
  } else if (command.method == "GoTo") {
    begin_motion(command, place_m(command.arguments, position_m_), 0.0, now);
  } else {
    begin_touch(command, now);
  }

  return true;
}

void IppDmeDevice::begin_motion(const Command& command, const Eigen::Vector3d& to_m, double extra_s,
                                HostTime now) {
  const double way_s = (to_m - position_m_).norm() / options_.travel_speed_m_s;
  motion_ =
      Motion{command, position_m_, to_m, now, now + seconds_to_ns(way_s + extra_s), std::nullopt};
  if (move_report_) move_report_->next = std::max(move_report_->next, now);
}

void IppDmeDevice::begin_touch(const Command& command, HostTime now) {
  const auto point = ippdme::parse_point(command.arguments);
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();
  if (point->has_ijk) normal = {point->ijk[0], point->ijk[1], point->ijk[2]};
  if (!(normal.norm() > 1e-6)) return fault(command, 2, 1010, "Vector has no norm");
  normal.normalize();
  const Eigen::Vector3d nominal_m = place_m(command.arguments, position_m_);
  const MeasuringMachine& machine = options_.machine;
  const Probing probing = probe(machine, nominal_m, normal, touches_++);
  const Eigen::Vector3d approach_m = nominal_m + machine.approach_m * normal;
  const double probing_s = (probing.reading_m - approach_m).norm() / options_.probing_speed_m_s;
  begin_motion(command, approach_m, 2.0 * probing_s, now);
  motion_->probing = probing;
}

void IppDmeDevice::end_motion() {
  const Motion motion = *std::exchange(motion_, std::nullopt);
  position_m_ = motion.to_m;
  homed_ = homed_ || motion.homing;
  if (motion.client_gone) return;

  if (motion.probing && refuse_touch_ != 0) {
    fault(motion.command, 2, std::exchange(refuse_touch_, 0), "Refused by the simulation");
  } else if (motion.command.method == "GoTo" && refuse_way_ != 0) {
    fault(motion.command, 2, std::exchange(refuse_way_, 0), "Refused by the simulation");
  } else if (motion.probing && motion.probing->fault == ProbingFault::AlreadyTouching) {
    fault(motion.command, 2, 1001, "Illegal touch");
  } else if (motion.probing && motion.probing->fault == ProbingFault::NothingThere) {
    fault(motion.command, 2, 1006, "Surface not found");
  } else if (motion.probing) {
    data(motion.command.tag, place(touch_report_, motion.probing->reading_m));
  }

  complete(motion.command.tag);
}

}  // namespace abbe::sim
