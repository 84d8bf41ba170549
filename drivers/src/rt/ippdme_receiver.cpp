#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "abbe/drivers/ippdme/receiver.hpp"

namespace abbe::drivers {
namespace {

using protocol::AxisSample;
using protocol::HostTime;
using protocol::ProbeTrigger;
using protocol::SampleFlag;
using protocol::SampleHead;
using protocol::TouchFlag;
using std::chrono::nanoseconds;

constexpr double kMetresPerMillimetre = 1e-3;
constexpr double kCountsPerMillimetre = 1e6;  // the machine reports no counts: nanometres instead
constexpr int kRepairable = 2;                // severity: from this value on the command has failed

IppText text_of(std::string_view text) noexcept {
  IppText t;
  t.length = static_cast<std::uint8_t>(std::min(text.size(), t.characters.size()));
  std::copy_n(text.begin(), t.length, t.characters.begin());
  return t;
}

std::string_view chars(std::span<const std::byte> bytes) noexcept {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

/// The point of a touch made by the operator, PtMeas(X(..),Y(..),Z(..)); empty: other data.
std::string_view picked(std::string_view data) noexcept {
  constexpr std::string_view kFront = "PtMeas(";
  // starts_with() is not used: without inlining, the library's version calls a function that can
  // throw.
  if (data.size() <= kFront.size() || !std::equal(kFront.begin(), kFront.end(), data.begin()))
    return {};
  if (data.back() != ')') return {};
  data.remove_prefix(kFront.size());
  data.remove_suffix(1);
  return data;
}

}  // namespace

void IppReceiver::sent(std::span<const std::byte> bytes, HostTime time) ABBE_RT {
  std::string_view line = chars(bytes);
  if (line.size() >= 2 && line[line.size() - 2] == '\r' && line.back() == '\n')
    line.remove_suffix(2);
  const auto command = ippdme::parse_command(line);
  if (!command) return;
  Asked asked{.tag = command->tag, .time = time, .known = true};
  if (command->method == "Get") asked.purpose = Purpose::Position;
  if (command->method == "OnMoveReportE") asked.purpose = Purpose::MoveReport;
  if (command->tag == ippdme::kAbort) {
    aborting_ = true;
    return framer_.resume();
  }
  if (command->method == "PtMeas") {
    asked.purpose = Purpose::Touch;
    asked.touch = ++touches_;
  }

  // Entry 0 is reserved for the move report (OnMoveReportE), which stays active until the
  // connection ends.
  if (asked.purpose == Purpose::MoveReport) {
    asked_[0] = asked;
    return;
  }

  next_asked_ = next_asked_ % (kMostAsked - 1) + 1;
  asked_[next_asked_] = asked;
}

IppReceiver::Asked* IppReceiver::find(ippdme::Tag tag) ABBE_RT {
  for (Asked& asked : asked_)
    if (asked.known && asked.tag == tag) return &asked;
  return nullptr;
}

void IppReceiver::push(std::span<const std::byte> bytes, HostTime arrival) ABBE_RT {
  arrival_ = arrival;
  if (bytes.empty()) {
    framer_.reset();
    silenced_ = aborting_ = false;
    position_restarted_ = touch_restarted_ = true;
    error_due_.reset();
    for (Asked& asked : asked_) asked.known = false;
    return;
  }
  framer_.push(bytes);
}

std::optional<IppMessage> IppReceiver::next() ABBE_RT {
  if (error_due_) {
    const IppMessage due = *error_due_;
    error_due_.reset();
    return due;
  }
  for (;;) {
    const auto line = framer_.next();
    if (!line) return std::nullopt;
    if (silenced_) {
      if (!*line) framer_.resume();
      if (!*line) continue;
      if (auto message = of_the_abort(**line)) return message;
    } else if (!*line) {
      return protocol_error(line->error(), {});
    } else if (auto message = understand(**line)) {
      return message;
    }
  }
}

IppError IppReceiver::refusal_of(const ippdme::Response& response) ABBE_RT {
  return {response.tag, response.error.severity, response.error.code, text_of(response.error.text)};
}

/// After a malformed line only the answer to AbortE is accepted from this server.
std::optional<IppMessage> IppReceiver::of_the_abort(std::string_view line) ABBE_RT {
  const auto response = ippdme::parse_response(line);
  if (!response || response->tag != ippdme::kAbort) return std::nullopt;
  if (response->kind == ippdme::Response::Kind::Error) return refusal_of(*response);
  if (response->kind != ippdme::Response::Kind::Complete) return std::nullopt;
  return IppMessage{IppComplete{response->tag}};
}

IppMessage IppReceiver::protocol_error(ippdme::LineError error, std::string_view line) ABBE_RT {
  silenced_ = true;
  if (aborting_) framer_.resume();  // the answer to the abort may follow
  return IppProtocolError{error, text_of(line)};
}

std::optional<IppMessage> IppReceiver::understand(std::string_view line) ABBE_RT {
  const auto response = ippdme::parse_response(line);
  if (!response) return protocol_error(response.error(), line);
  switch (response->kind) {
    case ippdme::Response::Kind::Ack:
      return IppMessage{IppAck{response->tag}};
    case ippdme::Response::Kind::Complete:
      return IppMessage{IppComplete{response->tag}};
    case ippdme::Response::Kind::Error:
      return error(*response);
    case ippdme::Response::Kind::Data:
      break;
  }
  return data(*response, line);
}

/// The time of an event between `from` and the arrival: the middle of the interval, with a
/// rectangular uncertainty.
SampleHead IppReceiver::between(HostTime from) ABBE_RT {
  const nanoseconds half = std::max(nanoseconds{0}, arrival_ - from) / 2;
  SampleHead head;
  head.time = arrival_ - half;
  head.u_time = nanoseconds{std::llround(static_cast<double>(half.count()) / std::sqrt(3.0))};
  return head;
}

std::optional<IppMessage> IppReceiver::data(const ippdme::Response& response,
                                            std::string_view line) ABBE_RT {
  const Asked* asked = find(response.tag);
  const bool unsolicited = response.tag == ippdme::kUnsolicited;
  const std::string_view by_hand = unsolicited ? picked(response.data) : std::string_view{};
  if (by_hand.empty() && (asked == nullptr || asked->purpose == Purpose::Other)) {
    if (unsolicited) return std::nullopt;  // a key was pressed or a property has changed: not used
    return IppMessage{IppData{response.tag, text_of(response.data)}};
  }
  const auto point = ippdme::parse_point(unsolicited ? by_hand : response.data);
  if (!point) return protocol_error(point.error(), line);
  if (unsolicited)
    return touch(*point, between(arrival_ - options_.max_report_delay), ++touches_, false);

  switch (asked->purpose) {
    case Purpose::Position:
      return position(*point, between(asked->time));
    case Purpose::MoveReport:
      return position(*point, between(arrival_ - options_.max_report_delay));
    case Purpose::Touch:
      return touch(*point, between(asked->time), asked->touch, asked->warned);
    case Purpose::Other:
      break;
  }

  return std::nullopt;
}

AxisSample IppReceiver::position(const ippdme::PointReport& at, const SampleHead& head) ABBE_RT {
  AxisSample sample;
  sample.head = head;
  if (std::exchange(position_restarted_, false)) sample.head.flags |= SampleFlag::Restarted;
  sample.cycle = ++cycle_;
  sample.axis_count = 3;
  sample.missing_mask = static_cast<std::uint8_t>(0b111 & ~at.known);
  if (sample.missing_mask != 0) sample.head.flags |= SampleFlag::AxisMissing;
  for (std::size_t i = 0; i < 3; ++i) {
    const bool known = ((at.known >> i) & 1u) != 0 && std::abs(at.p_mm[i]) < 1e9;
    sample.position[i] =
        known ? kMetresPerMillimetre * at.p_mm[i] : std::numeric_limits<double>::quiet_NaN();
    sample.count[i] = known ? std::llround(kCountsPerMillimetre * at.p_mm[i]) : 0;
  }
  return sample;
}

ProbeTrigger IppReceiver::touch(const ippdme::PointReport& at, const SampleHead& head,
                                std::uint32_t number, bool warned) ABBE_RT {
  ProbeTrigger t;
  t.head = head;
  if (std::exchange(touch_restarted_, false)) t.head.flags |= SampleFlag::Restarted;
  t.touch = number;
  t.probe = options_.probe;
  t.latch = protocol::TouchLatch::Reported;
  if (warned) t.touch_flags |= TouchFlag::Refused;
  t.axis_count = 3;
  t.missing_mask = static_cast<std::uint8_t>(0b111 & ~at.known);
  if (t.missing_mask != 0) {
    t.head.flags |= SampleFlag::AxisMissing;
    t.touch_flags |= TouchFlag::NoPosition;
  }
  for (std::size_t i = 0; i < 3; ++i) {
    const bool known = ((at.known >> i) & 1u) != 0;
    t.position[i] =
        known ? kMetresPerMillimetre * at.p_mm[i] : std::numeric_limits<double>::quiet_NaN();
    t.u_position[i] = options_.u_position_m;
    t.U95_position[i] = 1.96 * options_.u_position_m;
  }
  return t;
}

/// A failed touch also gives a touch without a position, for the caller that requested it.
IppMessage IppReceiver::error(const ippdme::Response& response) ABBE_RT {
  const IppError report{response.tag, response.error.severity, response.error.code,
                        text_of(response.error.text)};
  Asked* asked = find(response.tag);
  if (asked == nullptr || asked->purpose != Purpose::Touch) return report;
  asked->warned = true;
  if (response.error.severity < kRepairable) return report;
  error_due_ = report;
  asked->known = false;  // an abort is a second error of the same command, not a second touch
  return touch({}, between(asked->time), asked->touch, true);
}

}  // namespace abbe::drivers
