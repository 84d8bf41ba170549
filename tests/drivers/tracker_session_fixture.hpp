#pragma once
/// A tracker session in the hands of a test: time, answers, and what the session asked for.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <variant>
#include <vector>

#include "abbe/drivers/tracker/session.hpp"

namespace abbe::drivers {

using namespace std::chrono_literals;
using emscon::Command;
using emscon::Event;
using emscon::Status;
using protocol::HostTime;
using testing::ElementsAre;
using testing::HasSubstr;

class TrackerSessionTest : public testing::Test {
 protected:
  explicit TrackerSessionTest(TrackerSessionOptions options = {})
      : options_(options), session_(named(options)) {}

  static TrackerSessionOptions named(TrackerSessionOptions options) {
    options.peer = "tracker 10.0.0.7:700";
    return options;
  }

  TrackerAction on(const TrackerInput& input) {
    action_ = session_.on(input, now_);
    if (const auto* send = std::get_if<TrackerSend>(&action_))
      sent_.push_back(emscon::command_of(send->request));
    return action_;
  }
  TrackerAction tick_after(std::chrono::nanoseconds d) {
    now_ += d;
    return on(TrackerTick{});
  }
  TrackerAction answer(Status status = Status::Ok) {
    return on(emscon::Answer{emscon::Acknowledge{sent_.back(), status}});
  }
  TrackerAction say(Event event) { return on(emscon::StatusChange{event}); }
  /// Steps the time to each deadline in between.
  void let_pass(std::chrono::nanoseconds d) {
    const HostTime end = now_ + d;
    while (session_.deadline() <= end) {
      now_ = std::max(now_, session_.deadline());
      on(TrackerTick{});
    }
    now_ = end;
  }

  void connect() {
    on(TrackerTick{});
    ASSERT_TRUE(std::holds_alternative<TrackerOpen>(action_));
    on(TrackerConnected{});
  }
  /// Up to the first setting; the questions before are answered, but with nothing.
  void pass_query(
      emscon::TrackerProcessorStatus processor = emscon::TrackerProcessorStatus::CompensationSet) {
    emscon::SystemStatusAnswer status;
    status.tracker_processor = processor;
    on(emscon::Answer{status});
    answer_until(Command::SetUnits);
  }
  void answer_until(Command last) {
    for (int i = 0; i < 100 && sent_.back() != last; ++i) answer();
  }
  void reach_streaming() {
    connect();
    pass_query();
    answer_until(Command::StartMeasurement);
    answer();
    on(TrackerPointsArrived{100});
    ASSERT_EQ(session_.state(), TrackerState::Streaming);
    sent_.clear();
  }
  [[nodiscard]] bool closed() const { return std::holds_alternative<TrackerClose>(action_); }
  [[nodiscard]] bool nothing() const { return std::holds_alternative<TrackerNothing>(action_); }

  TrackerSessionOptions options_;
  TrackerSession session_;
  HostTime now_{1h};
  TrackerAction action_;
  std::vector<Command> sent_;
};

}  // namespace abbe::drivers
