#pragma once
/// A client of the simulated tracker for tests: sends requests, collects packets, owns the clock.

#include <array>
#include <variant>
#include <vector>

#include "abbe/sim/tracker_device.hpp"

namespace abbe::sim::test {

using namespace std::chrono_literals;

inline VirtualMachine standing_machine() {
  TruthMachine truth;
  PathPlan plan;
  plan.vertices = {{{0.1, 0.2, -0.3}}};
  return {truth, PathMotion::plan(plan).value()};
}

inline VirtualMachine moving_machine(double feed_m_per_s) {
  PathPlan plan;
  plan.vertices = {
      {{-0.3, -0.25, -0.4}}, {{0.3, 0.25, 0.0}}, {{-0.3, 0.25, 0.0}}, {{-0.3, -0.25, -0.4}}};
  plan.feed_m_per_s = feed_m_per_s;
  return {TruthMachine{}, PathMotion::plan(plan).value()};
}

struct Burst {
  HostTime arrival;
  std::vector<emscon::MultiPoint> points;
};

/// The device and its only client. Time advances in steps of `step`; no clock is read.
class TrackerScript {
 public:
  explicit TrackerScript(const VirtualMachine& machine, const TrackerOptions& options = {},
                         std::chrono::nanoseconds step = 1ms)
      : device(options, machine, HostTime{1000s}), now(HostTime{1000s}), step_(step) {
    device.connected(now);
  }

  void run(std::chrono::nanoseconds duration) {
    for (const HostTime end = now + duration; now < end;) {
      now += step_;
      device.advance(now);
      collect();
    }
  }

  /// Sends and waits for the answer; Unknown if there is none within 10 s.
  emscon::Status ask(const emscon::Request& request) {
    const std::size_t before = answers.size();
    send(request);
    for (int i = 0; i < 10'000 && answers.size() == before; ++i) run(step_);
    return answers.size() > before ? status_of(answers.back()) : emscon::Status::Unknown;
  }

  void send(const emscon::Request& request) {
    std::array<std::byte, emscon::kMaxRequestSize> bytes{};
    const std::size_t size = emscon::encode(request, bytes);
    device.receive(std::span(bytes).first(size), now);
    collect();
  }

  void start_streaming(std::int32_t separation_ms = 2) {
    ask(emscon::Initialize{});
    ask(emscon::SetMeasurementMode{emscon::MeasurementMode::ContinuousTime});
    ask(emscon::SetContinuousTimeModeParams{separation_ms, 0, false, {}});
    ask(emscon::StartMeasurement{});
  }

  [[nodiscard]] std::vector<emscon::MultiPoint> points() const {
    std::vector<emscon::MultiPoint> all;
    for (const Burst& burst : bursts)
      all.insert(all.end(), burst.points.begin(), burst.points.end());
    return all;
  }

  TrackerDevice device;
  HostTime now;
  std::vector<emscon::Answer> answers;
  std::vector<emscon::Event> events;
  std::vector<emscon::ErrorResponse> errors;
  std::vector<emscon::SingleResult> singles;
  std::vector<Burst> bursts;

 private:
  void collect() {
    const std::vector<std::byte> bytes = device.take_output();
    framer_.push(bytes);
    while (const auto packet = framer_.next()) sort(emscon::decode(*packet).value());
  }
  void sort(const emscon::ControllerPacket& packet) {
    if (const auto* a = std::get_if<emscon::Answer>(&packet)) answers.push_back(*a);
    if (const auto* e = std::get_if<emscon::StatusChange>(&packet)) events.push_back(e->event);
    if (const auto* e = std::get_if<emscon::ErrorResponse>(&packet)) errors.push_back(*e);
    if (const auto* s = std::get_if<emscon::SingleResult>(&packet)) singles.push_back(*s);
    if (const auto* m = std::get_if<emscon::MultiResult>(&packet)) {
      Burst burst{now, {}};
      for (std::size_t k = 0; k < m->size(); ++k) burst.points.push_back(m->point(k));
      bursts.push_back(burst);
    }
  }

  std::chrono::nanoseconds step_;
  emscon::PacketFramer framer_;
};

}  // namespace abbe::sim::test
