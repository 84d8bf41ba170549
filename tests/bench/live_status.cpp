// What watching a run costs: abbed calibrates a simulated machine on the fly (abbe-sim on loopback,
// in real time, tracker at 500 Hz and encoders at 200 Hz), and its status is requested while the
// machine moves. Requirements: an answer with the current tables and their uncertainties within 100
// ms, and no change in the latency of the acquisition threads.
// Phases without and with requests (20 a second over the control socket, and every second the
// program `abbe status`) alternate in the same run, so that other load on the computer meets both
// alike. Compared between them, for each acquisition thread: the time in receive(), p99; the mean
// scheduling delay, which is the part of the time from arrival to receipt that the kernel counts;
// and the data lost.
//   bench_live_status [--short]
// Exit code 1: an answer later than 100 ms or without tables, or a latency with requests above that
// without (limits: acquisition_comparison.hpp). 2: the run failed. 3: inconclusive, because other
// load changes the latency by more than 1.5.
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <map>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "acquisition_comparison.hpp"
#include "calibrated_run.hpp"
#include "figure.hpp"

namespace {

using namespace abbe;  // NOLINT(google-build-using-namespace): a program, not a header
using namespace std::chrono_literals;
using bench::AcquisitionPhases;
using bench::CalibratedRun;
using bench::has_tables;
using bench::Outcome;
using nlohmann::json;
using Clock = std::chrono::steady_clock;

constexpr double kAsked_ms = 100.0;
constexpr auto kBetweenRequests = 50ms;
constexpr int kRequestsPerProgram = 20;
constexpr auto kHealthPeriod = 1100ms;  // abbed reads the histograms once a second

double ms_since(Clock::time_point begin) {
  return 1e3 * std::chrono::duration<double>(Clock::now() - begin).count();
}

struct Answers {
  std::vector<double> socket_ms, program_ms;
  std::size_t with_tables = 0;
};

void request_until(Clock::time_point end, const CalibratedRun& run, Answers& answers) {
  for (int i = 0; Clock::now() < end; ++i) {
    const auto begin = Clock::now();
    const json status = run.status();
    answers.socket_ms.push_back(ms_since(begin));
    answers.with_tables += has_tables(status) ? 1 : 0;

    if (i % kRequestsPerProgram == 0) {
      const auto started = Clock::now();
      if (!run.show_status()) throw std::runtime_error("abbe status failed");
      answers.program_ms.push_back(ms_since(started));
    }
    std::this_thread::sleep_for(kBetweenRequests);
  }
}

/// One phase with requests; what abbed counts in its first second belongs to the phase before.
AcquisitionPhases phase_with_requests(const CalibratedRun& run, std::chrono::seconds lasts,
                                      Answers& answers) {
  request_until(Clock::now() + kHealthPeriod, run, answers);
  const auto before = run.acquisition();
  request_until(Clock::now() + lasts, run, answers);
  return bench::difference(run.acquisition(), before);
}

AcquisitionPhases quiet_phase(const CalibratedRun& run, std::chrono::seconds lasts) {
  std::this_thread::sleep_for(kHealthPeriod);
  const auto before = run.acquisition();
  std::this_thread::sleep_for(lasts);
  return bench::difference(run.acquisition(), before);
}

double part_of(std::vector<double> values, double share) {
  if (values.empty()) return 0.0;
  std::ranges::sort(values);
  const auto at = static_cast<std::size_t>(share * static_cast<double>(values.size()));
  return values[std::min(at, values.size() - 1)];
}

Outcome report_answers(std::string_view what, const std::vector<double>& ms) {
  tests::print_figure(fmt::format("live status, {}", what), fmt::format("{:.0f} ms", kAsked_ms),
                      "median {:.1f} ms, p99 {:.1f} ms, longest {:.1f} ms, {} answers",
                      part_of(ms, 0.5), part_of(ms, 0.99), part_of(ms, 1.0), ms.size());
  return !ms.empty() && part_of(ms, 1.0) <= kAsked_ms ? Outcome::Met : Outcome::Missed;
}

Outcome report_tables(const Answers& answers) {
  const std::size_t all = answers.socket_ms.size();
  tests::print_figure("live status, answers with a determined table", "all", "{} of {}",
                      answers.with_tables, all);
  return answers.with_tables == all ? Outcome::Met : Outcome::Missed;
}

Outcome measure(const CalibratedRun& run, int pairs, std::chrono::seconds phase) {
  Answers answers;
  std::map<std::string, bench::AcquisitionComparison> streams;
  for (int i = 0; i < pairs; ++i) {
    for (const auto& [stream, quiet] : quiet_phase(run, phase))
      add(i % 2 == 0 ? streams[stream].quiet_even : streams[stream].quiet_odd, quiet);
    for (const auto& [stream, requested] : phase_with_requests(run, phase, answers))
      add(streams[stream].requested, requested);
  }

  Outcome outcome = streams.empty() ? Outcome::Missed : Outcome::Met;
  outcome = worse(outcome, report_answers("answer over the socket", answers.socket_ms));
  outcome = worse(outcome, report_answers("program abbe status", answers.program_ms));
  outcome = worse(outcome, report_tables(answers));
  for (const auto& [stream, of] : streams) outcome = worse(outcome, report_acquisition(stream, of));

  return outcome;
}

}  // namespace

int main(int argc, char** argv) {
  const bool brief = argc > 1 && std::string_view{argv[1]} == "--short";
  try {
    CalibratedRun run;
    run.calibrate();
    return exit_code(measure(run, brief ? 2 : 6, brief ? 3s : 8s));
  } catch (const std::exception& error) {
    fmt::print(stderr, "live_status: {}\n", error.what());
    return 2;
  }
}
