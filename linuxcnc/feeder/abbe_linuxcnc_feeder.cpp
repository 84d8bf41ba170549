// SPDX-License-Identifier: GPL-2.0-or-later
// abbe-linuxcnc-feeder: receives the model of a machine over DDS, computes the correction at the
// joint positions of LinuxCNC every millisecond, and writes it into HAL for the realtime component
// abbe_correction.
#include <fmt/format.h>
#include <signal.h>
#include <time.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <cstdio>
#include <exception>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "abbe/base/exit_codes.hpp"
#include "abbe/dds/participant.hpp"
#include "abbe/dds/readers.hpp"
#include "abbe/protocol/option_values.hpp"
#include "abbe/protocol/printable.hpp"
#include "correction_field.hpp"
#include "hal_pins.hpp"
#include "subscription.hpp"

namespace {

using namespace abbe;
using linuxcnc::HalPins;
using linuxcnc::Usable;
using Clock = std::chrono::steady_clock;

constexpr double kMillimetre = 1e-3;
constexpr std::chrono::milliseconds kDecisionPeriod{20};  // of the DDS rule
constexpr std::chrono::milliseconds kReportPeriod{100};   // between two reported changes

volatile sig_atomic_t stop_requested = 0;

struct Options {
  dds::ParticipantOptions participant;
  std::string machine;
  std::vector<double> tool_offset_mm;
  double clamp_mm = 0.2;
  long period_us = 1000;
};

/// Latest decision of the subscription's thread, and its time.
class Latest {
 public:
  void set(std::shared_ptr<const Usable> usable) {
    const std::lock_guard lock(mutex_);
    usable_ = std::move(usable);
    at_ = Clock::now();
  }
  [[nodiscard]] std::pair<std::shared_ptr<const Usable>, Clock::time_point> get() const {
    const std::lock_guard lock(mutex_);
    return {usable_, at_};
  }

 private:
  mutable std::mutex mutex_;
  std::shared_ptr<const Usable> usable_ = std::make_shared<const Usable>();
  Clock::time_point at_{};
};

/// Prints whether the correction is applied, and why not, when this changes.
class Reporter {
 public:
  void report(const linuxcnc::Wanted& wanted, const std::string& model_id, Clock::time_point now) {
    const std::string line =
        wanted.valid ? "correction of model " + model_id : "no correction: " + wanted.reason;
    if (line == reported_ || now - reported_at_ < kReportPeriod) return;
    reported_ = line;
    reported_at_ = now;
    std::printf("abbe-linuxcnc-feeder: %s\n", line.c_str());
  }

 private:
  std::string reported_;
  Clock::time_point reported_at_{};
};

void wait_for_next(timespec& next, long period_us) {
  constexpr long kSecond_ns = 1'000'000'000;
  next.tv_nsec += period_us * 1000;
  while (next.tv_nsec >= kSecond_ns) next.tv_nsec -= kSecond_ns, ++next.tv_sec;
  ::clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &next, nullptr);
}

void feed(const Options& options, HalPins& pins, const Latest& latest) {
  linuxcnc::FeedLimits limits;
  limits.clamp_m = options.clamp_mm * kMillimetre;
  Reporter reporter;
  timespec next{};
  ::clock_gettime(CLOCK_MONOTONIC, &next);

  while (stop_requested == 0) {
    const auto [usable, decided_at] = latest.get();
    const auto now = Clock::now();
    const auto p = pins.positions_mm();
    const auto wanted =
        linuxcnc::wanted(*usable, std::chrono::duration<double>(now - decided_at).count(),
                         pins.homed(), calib::Vector3(p[0], p[1], p[2]) * kMillimetre, limits);
    const calib::Vector3 c_mm = wanted.correction_m / kMillimetre;

    pins.write({c_mm[0], c_mm[1], c_mm[2]}, wanted.valid);
    reporter.report(wanted, usable->model_id, now);
    wait_for_next(next, options.period_us);
  }
  pins.write({}, false);
}

int run(const Options& options) {
  using daemon::ExitCode;
  const auto failed = [](const std::string& text, ExitCode code) {
    std::fprintf(stderr, "abbe-linuxcnc-feeder: %s\n", abbe::protocol::printable(text).c_str());
    return number(code);
  };

  auto participant = dds::Participant::create(options.participant);
  if (!participant) return failed(participant.error().text, ExitCode::BadInput);
  auto readers = dds::Readers::create(*participant, linuxcnc::Subscription::kTopics);
  if (!readers) return failed(readers.error().text, ExitCode::Io);
  std::string error;
  auto pins = HalPins::create(error);
  if (!pins) return failed(error, ExitCode::Io);

  const auto& t = options.tool_offset_mm;
  linuxcnc::Subscription subscription(
      {options.machine, calib::Vector3(t[0], t[1], t[2]) * kMillimetre}, *readers);
  Latest latest;
  std::jthread deciding([&](const std::stop_token& stop) {
    while (!stop.stop_requested()) latest.set(subscription.poll(kDecisionPeriod));
  });

  feed(options, *pins, latest);
  return number(ExitCode::Done);
}

void stop_on_signals() {
  struct sigaction action {};
  action.sa_handler = [](int) { stop_requested = 1; };
  for (const int signal : {SIGTERM, SIGINT}) ::sigaction(signal, &action, nullptr);
}

}  // namespace

int main(int argc, char** argv) {
  std::setvbuf(stdout, nullptr, _IOLBF, 0);
  CLI::App app{
      "Receives the error model of a machine from abbe over DDS and feeds its correction to the "
      "realtime component abbe_correction of LinuxCNC. Load it from HAL: loadusr -Wn abbe-feeder."};
  app.set_version_flag("--version", "abbe-linuxcnc-feeder " ABBE_VERSION);
  Options options;
  app.add_option("--machine", options.machine, "name of the machine in abbed.toml")->required();
  app.add_option("--tool-offset-mm", options.tool_offset_mm,
                 "tool offset x y z for which the model must be valid")
      ->required()
      ->expected(3);
  app.add_option("--domain", options.participant.domain, "DDS domain, 0 to 232")
      ->check(CLI::Range(0U, dds::kHighestDomain))
      ->capture_default_str();
  app.add_option("--profile", options.participant.profiles,
                 "XML file with a participant profile \"abbe\" (default: built in)");
  app.add_option("--security", options.participant.security,
                 "folder of keys of a subscriber, from `abbe dds keys`");
  app.add_option("--clamp-mm", options.clamp_mm,
                 "largest correction of an axis, 0.001 to 1; a larger one is not applied at all")
      ->check(CLI::Range(0.001, 1.0))
      ->capture_default_str();
  app.add_option("--period-us", options.period_us, "period of the loop")
      ->check(CLI::Range(100L, 20'000L))
      ->capture_default_str();

  try {
    abbe::protocol::check_option_values(app);
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? 0 : number(daemon::ExitCode::Usage);
  }

  try {
    stop_on_signals();
    return run(options);
  } catch (const std::exception& e) {
    std::fprintf(stderr, "abbe-linuxcnc-feeder: internal error: %s\n", e.what());
    return number(daemon::ExitCode::Internal);
  }
}
