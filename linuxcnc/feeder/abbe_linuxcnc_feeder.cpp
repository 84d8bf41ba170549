// SPDX-License-Identifier: GPL-2.0-or-later
// abbe-linuxcnc-feeder: receives the model of a machine over DDS, computes the correction at the
// joint positions of LinuxCNC every millisecond, and writes it into the shared memory of the
// realtime component abbe_correction.
#include <sched.h>
#include <signal.h>
#include <time.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <exception>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "abbe/base/exit_codes.hpp"
#include "abbe/dds/participant.hpp"
#include "abbe/dds/readers.hpp"
#include "abbe/protocol/option_values.hpp"
#include "abbe/protocol/printable.hpp"
#include "control_link.hpp"
#include "correction_field.hpp"
#include "latest_usable.hpp"
#include "restarted.hpp"
#include "subscription.hpp"

namespace {

using namespace abbe;
using linuxcnc::ControlLink;
using linuxcnc::LatestUsable;
using Clock = std::chrono::steady_clock;

constexpr double kMillimetre = 1e-3;
// period of the decision that the DDS rule requires
constexpr std::chrono::milliseconds kDecisionPeriod{20};
// shortest time between two reported changes
constexpr std::chrono::milliseconds kReportPeriod{100};

constexpr unsigned kExitDeadline_s = 3;

volatile sig_atomic_t stop_requested = 0;

struct Options {
  dds::ParticipantOptions participant;
  std::string machine;
  std::string machine_id;
  std::vector<double> tool_offset_mm{0.0, 0.0, 0.0};
  double clamp_mm = 0.2;
  long period_us = 1000;
  int priority = 0;
  int key = ABBE_HAND_OVER_KEY;
  bool restart = false;
};

int fail(const std::string& text, daemon::ExitCode code) {
  std::fprintf(stderr, "abbe-linuxcnc-feeder: %s\n", protocol::printable_line(text).c_str());
  return number(code);
}

/// Prints changes of the state: whether the correction is applied, and why not. It has a separate
/// thread, so that a halted terminal or a full pipe delays neither the decisions nor the loop.
class Reporter {
 public:
  explicit Reporter(const ControlLink& link) : link_(link) {}

  /// Any thread.
  void decided(const std::string& model_id) {
    const std::lock_guard lock(mutex_);
    model_id_ = model_id;
  }
  void report_until(const std::stop_token& stop) {
    std::string reported;
    while (!stop.stop_requested()) {
      std::string line = current();
      if (!line.empty() && line != reported) {
        std::printf("abbe-linuxcnc-feeder: %s\n", protocol::printable_line(line).c_str());
        reported = std::move(line);
      }
      std::this_thread::sleep_for(kReportPeriod);
    }
  }

 private:
  [[nodiscard]] std::string current() {
    const auto sent = link_.sent();
    if (!sent) return {};
    const std::lock_guard lock(mutex_);
    if (sent->valid != 0 && model_id_.empty()) return {};  // the model was withdrawn meanwhile
    return sent->valid != 0 ? "correction of model " + model_id_
                            : std::string("no correction: ") + sent->reason;
  }

  const ControlLink& link_;
  std::mutex mutex_;
  std::string model_id_;
};

/// Function of the subscription's thread.
void decide(const std::stop_token& stop, linuxcnc::Subscription& subscription, LatestUsable& latest,
            Reporter& reporter) {
  while (!stop.stop_requested()) {
    const auto usable = subscription.poll(kDecisionPeriod);
    latest.set(usable, Clock::now());
    reporter.decided(usable->identified ? usable->model_id
                                        : usable->model_id +
                                              ", whose publisher states no identity "
                                              "(an abbe-dds of an earlier version)");
  }
}

/// Sets SCHED_FIFO for the calling thread, which runs the loop.
void take_priority(int priority) {
  sched_param parameters{};
  parameters.sched_priority = priority;
  if (priority == 0 || ::sched_setscheduler(0, SCHED_FIFO, &parameters) == 0) return;
  std::fprintf(stderr,
               "abbe-linuxcnc-feeder: no realtime priority %d (%s): other programs may delay the "
               "correction; allow it with \"rtprio\" in /etc/security/limits.d\n",
               priority, std::strerror(errno));
}

/// Waits for the next cycle. After a delay of more than a second, for example of a process that was
/// stopped, the missed cycles are omitted.
void wait_for_next(timespec& next, long period_us) {
  constexpr long kSecond_ns = 1'000'000'000;
  timespec now{};
  ::clock_gettime(CLOCK_MONOTONIC, &now);
  if (now.tv_sec > next.tv_sec + 1) next = now;
  next.tv_nsec += period_us * 1000;
  while (next.tv_nsec >= kSecond_ns) next.tv_nsec -= kSecond_ns, ++next.tv_sec;
  ::clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &next, nullptr);
}

/// Runs until a signal arrives or LinuxCNC ends; in the second case returns the reason.
std::string feed(const Options& options, ControlLink& link, LatestUsable& latest) {
  linuxcnc::FeedOptions feed_options;
  feed_options.clamp_m = options.clamp_mm * kMillimetre;
  const auto& t = options.tool_offset_mm;
  feed_options.tool_offset_at_zero_m = Eigen::Vector3d(t[0], t[1], t[2]) * kMillimetre;
  timespec next{};
  ::clock_gettime(CLOCK_MONOTONIC, &next);

  while (stop_requested == 0) {
    const auto now = Clock::now();
    const abbe_control& control = link.read();
    if (auto reason = link.ended(now); !reason.empty()) return reason;
    link.write(linuxcnc::wanted(latest.get(), latest.silence_s(now), control, feed_options));
    wait_for_next(next, options.period_us);
  }

  abbe_wanted nothing{};
  std::snprintf(nothing.reason, sizeof nothing.reason, "the feeder has ended");
  link.write(nothing);
  return {};
}

int run(const Options& options) {
  using daemon::ExitCode;
  std::string error;
  auto link = ControlLink::attach(options.key, error);
  if (!link) return fail(error, ExitCode::Refused);
  auto participant = dds::Participant::create(options.participant);
  if (!participant) {
    const bool is_input = participant.error().code == daemon::ErrorCode::BadInput;
    return fail(participant.error().text, is_input ? ExitCode::BadInput : ExitCode::Io);
  }
  auto readers = dds::Readers::create(*participant, linuxcnc::Subscription::kTopics);
  if (!readers) return fail(readers.error().text, ExitCode::Io);

  linuxcnc::Subscription subscription({options.machine, options.machine_id}, *readers);
  LatestUsable latest;
  Reporter reporter(*link);
  std::jthread reporting([&](const std::stop_token& stop) { reporter.report_until(stop); });
  std::jthread deciding(
      [&](const std::stop_token& stop) { decide(stop, subscription, latest, reporter); });

  take_priority(options.priority);
  const std::string ended = feed(options, *link, latest);
  ::alarm(kExitDeadline_s);  // ends the process even if a thread cannot end because it writes to a
                             // halted terminal
  if (ended.empty() || link->closed()) return number(ExitCode::Done);
  return fail(ended, ExitCode::Refused);
}

/// True for exit codes after which --restart starts no new child process, because the cause would
/// remain.
bool is_final(int code) {
  using daemon::ExitCode;
  for (const auto last : {ExitCode::Done, ExitCode::BadInput, ExitCode::Refused})
    if (code == number(last)) return true;
  return false;
}

void stop_on_signals() {
  struct sigaction action {};
  action.sa_handler = [](int) { stop_requested = 1; };
  for (const int signal : {SIGTERM, SIGINT}) ::sigaction(signal, &action, nullptr);
  ::signal(SIGPIPE, SIG_IGN);  // the reader of the output may have ended
}

int run_caught(const Options& options) {
  try {
    stop_on_signals();
    return run(options);
  } catch (const std::exception& e) {
    return fail(std::string("internal error: ") + e.what(), daemon::ExitCode::Internal);
  }
}

void add_options(CLI::App& app, Options& options) {
  app.add_option("--machine", options.machine, "name of the machine in abbed.toml")->required();
  app.add_option("--machine-id", options.machine_id,
                 "identity of the machine, from `abbe machine identity` (default: the first one "
                 "that publishes under the name, while the feeder runs)");
  app.add_option("--tool-offset-mm", options.tool_offset_mm,
                 "abbe's tool offset x y z while motion.tooloffset is 0; that of a tool is this "
                 "minus motion.tooloffset (default: 0 0 0)")
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
  app.add_option("--priority", options.priority,
                 "SCHED_FIFO priority of the loop, below that of the servo thread; 0: none")
      ->check(CLI::Range(0, 98))
      ->capture_default_str();
  app.add_flag("--restart", options.restart,
               "start again within a second when it is killed or fails, until LinuxCNC ends");
  app.add_option("--key", options.key, "key of the shared memory: key= of abbe_correction")
      ->capture_default_str();
}

}  // namespace

int main(int argc, char** argv) {
  using daemon::ExitCode;
  std::setvbuf(stdout, nullptr, _IOLBF, 0);
  CLI::App app{
      "Receives the error model of a machine from abbe over DDS and feeds its correction to the "
      "realtime component abbe_correction of LinuxCNC, which must be loaded first."};
  app.set_version_flag("--version", "abbe-linuxcnc-feeder " ABBE_VERSION);
  app.footer(daemon::exit_codes_text(
      {{ExitCode::Done, "a signal, or LinuxCNC has ended"},
       {ExitCode::Usage},
       {ExitCode::BadInput, "profile or keys cannot be used"},
       {ExitCode::Io},
       {ExitCode::Refused, "LinuxCNC does not run with abbe_correction, or another feeder runs"},
       {ExitCode::Internal}}));
  Options options;
  add_options(app, options);

  try {
    abbe::protocol::check_option_values(app);
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? 0 : number(ExitCode::Usage);
  }

  if (!options.restart) return run_caught(options);
  return linuxcnc::run_restarted([&options] { return run_caught(options); }, is_final,
                                 [](const std::string& text) {
                                   std::fprintf(stderr, "abbe-linuxcnc-feeder: %s\n", text.c_str());
                                 });
}
