// abbe-watch: a subscriber. Shows what abbe says about a machine, and what its correction is worth.
#include <fmt/format.h>
#include <signal.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <cstdio>
#include <exception>
#include <limits>
#include <map>
#include <optional>
#include <string>

#include "abbe/daemon/cdr.hpp"
#include "abbe/daemon/input_files.hpp"
#include "abbe/dds/grid_nodes.hpp"
#include "abbe/dds/json_lines.hpp"
#include "abbe/dds/participant.hpp"
#include "abbe/dds/readers.hpp"
#include "abbe/dds/received_model.hpp"

namespace {

using namespace abbe;
using daemon::Error;
using daemon::ErrorCode;
using daemon::Result;
using daemon::Topic;
using WallClock = std::chrono::steady_clock;

constexpr int kDone = 0, kNoAnswer = 1, kUsage = 2, kBadInput = 3, kIo = 4, kInternal = 70;

constexpr const char* kExitCodes =
    "Exit codes: 0 done, 1 no model that may be applied arrived in time (said why), 2 usage, 3 a file or "
    "profile cannot be\n"
    "used, 4 no participant or output file can be created, 70 an exception nobody expected.";

volatile sig_atomic_t stop_requested = 0;

struct Options {
  dds::ParticipantOptions participant;
  std::string machine;  ///< empty: every one
  bool json = false;
  bool until_model = false;
  double timeout_s = std::numeric_limits<double>::infinity();
  std::string grid_csv;
  std::string known_errors;

  [[nodiscard]] bool needs_grid() const { return !grid_csv.empty() || !known_errors.empty(); }
  [[nodiscard]] bool ends_with_model() const { return until_model || needs_grid(); }
};

int exit_code_of(const Error& error) {
  std::fprintf(stderr, "abbe-watch: %s\n", error.text.c_str());
  switch (error.code) {
    case ErrorCode::DataInsufficient:
      return kNoAnswer;
    case ErrorCode::Usage:
      return kUsage;
    case ErrorCode::BadInput:
      return kBadInput;
    default:
      return kIo;
  }
}

std::string micrometres(const std::array<double, 3>& v_m) {
  return fmt::format("{:+.2f} {:+.2f} {:+.2f} um", v_m[0] * 1e6, v_m[1] * 1e6, v_m[2] * 1e6);
}

std::string millimetres(const std::vector<double>& position_m) {
  std::string text;
  for (const double p : position_m) text += fmt::format("{:10.4f}", p * 1e3);
  return text + " mm";
}

/// What is known of every machine, and what of it is worth a line.
class Watch {
 public:
  explicit Watch(const Options& options) : options_(options) {}

  void take(Topic topic, std::span<const std::byte> payload, bool answered_for) {
    const auto key = daemon::payload_key(topic, payload);
    if (!key || (!options_.machine.empty() && key->machine != options_.machine)) return;
    if (options_.json) print_json(topic, payload);
    auto& model = machines_[std::string(key->machine)];
    switch (topic) {
      case Topic::ModelState:
        return with<v1::ModelState>(payload, [&](auto& m) { show_state(model, m); });
      case Topic::ErrorModel:
        return with<v1::ErrorModel>(payload, [&](auto& m) { show_model(model, m); });
      case Topic::ErrorGrid:
        return with<v1::ErrorGrid>(payload, [&](auto& m) { model.slice(m); });
      case Topic::Health:
        return with<v1::Health>(payload, [&](auto& m) { show_health(m); });
      case Topic::CalibrationEvent:
        return with<v1::CalibrationEvent>(payload, [&](auto& m) { show_event(m); });
      case Topic::Snapshot:
        return with<v1::Snapshot>(payload, [&](auto& m) { live_position_ = millimetres(m.position()); });
      case Topic::Compensation:
        return with<v1::Compensation>(
            payload, [&](auto& m) { show_vector(m, dds::decide(m, model.state(), answered_for)); });
    }
  }

  /// A machine whose model may be applied, with everything the options need of it.
  [[nodiscard]] const dds::ReceivedModel* applicable(bool answered_for) const {
    for (const auto& [name, model] : machines_) {
      if (!model.model() || !model.decide(answered_for).apply) continue;
      if (model.model()->model_id() == model.state()->model_id()) return &model;
    }
    return nullptr;
  }

  [[nodiscard]] std::string why_not(bool answered_for) const {
    std::string text;
    for (const auto& [name, model] : machines_) {
      const auto decision = model.decide(answered_for);
      text += name + ": " + (decision.apply ? std::string("no ErrorModel received") : decision.reason) + "; ";
    }
    return text.empty() ? "nothing received" : text;
  }

 private:
  template <class T, class F>
  void with(std::span<const std::byte> payload, F&& use) {
    if (auto value = daemon::decode<T>(payload)) {
      use(*value);
    } else {
      std::fprintf(stderr, "abbe-watch: %s\n", value.error().text.c_str());
    }
  }

  void print_json(Topic topic, std::span<const std::byte> payload) {
    if (const auto line = dds::json_line(topic, payload)) std::printf("%s\n", line->c_str());
    std::fflush(stdout);
  }

  void print(const std::string& line) {
    if (options_.json) return;
    std::printf("%s%s\n", on_terminal_ ? "\r\033[K" : "", line.c_str());
    std::fflush(stdout);
  }

  void show_state(dds::ReceivedModel& model, const v1::ModelState& s) {
    const auto& old = model.state();
    if (!old || old->state() != s.state() || old->reason() != s.reason() || old->model_id() != s.model_id()) {
      print(fmt::format("{}  model {} is {}{}{}", s.machine(), s.model_id().empty() ? "-" : s.model_id(),
                        dds::name_of(s.state()), s.reason().empty() ? "" : ": ", s.reason()));
    }
    model.state(s);
  }

  void show_model(dds::ReceivedModel& model, const v1::ErrorModel& m) {
    if (!model.model() || model.model()->model_id() != m.model_id()) {
      print(fmt::format("{}  received model {}: {} {}, gauge {}, {} parameters, chain {}", m.machine(),
                        m.model_id(), m.method(), m.estimator(), m.gauge(), m.parameters().size(),
                        m.chain()));
    }
    model.model(m);
  }

  void show_health(const v1::Health& h) {
    const std::string line = fmt::format("{}  {} {}{}{}", h.machine(), h.stream(), h.state(),
                                         h.fault().empty() ? "" : ": ", h.fault());
    if (std::exchange(health_[h.stream()], line) != line) print(line);
  }

  void show_event(const v1::CalibrationEvent& e) {
    const std::string line = fmt::format("{}  calibration {} {}{}{}", e.machine(), e.method(), e.state(),
                                         e.reason().empty() ? "" : ": ", e.reason());
    if (std::exchange(calibration_, line) != line) print(line);
  }

  /// The one line that is always true; on a terminal it stands still, elsewhere it comes once a second.
  void show_vector(const v1::Compensation& c, const dds::Decision& decision) {
    const auto now = WallClock::now();
    if (options_.json ||
        now - last_live_ < (on_terminal_ ? std::chrono::milliseconds{100} : std::chrono::seconds{1}))
      return;
    last_live_ = now;
    const std::string line =
        fmt::format("{}  {}  V {}  {}", c.machine(), live_position_, micrometres(c.vector_m()),
                    decision.apply ? "apply" : "do not apply: " + decision.reason);
    std::printf(on_terminal_ ? "\r\033[K%s" : "%s\n", line.c_str());
    std::fflush(stdout);
  }

  const Options& options_;
  const bool on_terminal_ = ::isatty(STDOUT_FILENO) != 0;
  std::map<std::string, dds::ReceivedModel> machines_;
  std::map<std::string, std::string> health_;
  std::string calibration_;
  std::string live_position_;
  WallClock::time_point last_live_{};
};

void print_comparison(const Options& options, const calib::FieldComparison& c, const std::string& model_id) {
  if (options.json) {
    fmt::print(
        "{{\"comparison\":{{\"model_id\":\"{}\",\"points\":{},\"outside\":{},\"before_mean_um\":{:.6g},"
        "\"before_max_um\":{:.6g},\"after_mean_um\":{:.6g},\"after_max_um\":{:.6g},"
        "\"after_rigid_free_mean_um\":{:.6g},\"after_rigid_free_max_um\":{:.6g}}}}}\n",
        model_id, c.points, c.outside, c.before.mean_m * 1e6, c.before.max_m * 1e6, c.after.mean_m * 1e6,
        c.after.max_m * 1e6, c.after_rigid_free.mean_m * 1e6, c.after_rigid_free.max_m * 1e6);
    return;
  }
  const auto row = [](const char* what, const calib::VectorStatistics& s) {
    fmt::print("  {:<42} mean {:9.3f} um   max {:9.3f} um\n", what, s.mean_m * 1e6, s.max_m * 1e6);
  };
  fmt::print("model {} against known errors at {} points ({} outside the grid)\n", model_id, c.points,
             c.outside);
  row("before: |V_true|", c.before);
  row("after:  |V_true - V_received|, as received", c.after);
  row("after:  best-fit rigid motion removed", c.after_rigid_free);
}

Result<void> use_model(const Options& options, const dds::ReceivedModel& model,
                       const std::optional<daemon::KnownErrorsFile>& known) {
  const auto nodes = model.grid();
  if (!options.grid_csv.empty()) {
    if (auto written = dds::write_grid_csv(options.grid_csv, *nodes); !written) return written;
  }
  if (!known) return {};
  const auto lattice = dds::lattice_of(*nodes);
  if (!lattice) return tl::make_unexpected(lattice.error());
  std::vector<calib::Vector3> positions_m;
  for (const auto& q : known->points_m) positions_m.emplace_back(q[0], q[1], q[2]);
  const auto comparison = calib::compare(positions_m, known->errors_m, *lattice);
  if (!comparison) return daemon::fail(ErrorCode::DataInsufficient, comparison.error().text);
  print_comparison(options, *comparison, model.state()->model_id());
  return {};
}

int watch(const Options& options, dds::Readers& readers,
          const std::optional<daemon::KnownErrorsFile>& known) {
  Watch watch(options);
  const auto start = WallClock::now();
  bool answered_for = false;
  while (stop_requested == 0 &&
         std::chrono::duration<double>(WallClock::now() - start).count() < options.timeout_s) {
    readers.wait(std::chrono::milliseconds{100});
    if (const bool now = readers.state_is_answered_for(); now != answered_for) {
      answered_for = now;
      if (options.json)
        std::printf("{\"state_is_answered_for\":%s}\n", now ? "true" : "false");
      else
        std::printf("%s\n", now ? "abbe is there" : "abbe is gone: do not apply");
      std::fflush(stdout);
    }
    readers.take(
        [&](Topic topic, std::span<const std::byte> payload) { watch.take(topic, payload, answered_for); });
    if (!options.ends_with_model()) continue;
    if (const auto* model = watch.applicable(answered_for)) {
      const auto used = use_model(options, *model, known);
      return used ? kDone : exit_code_of(used.error());
    }
  }
  if (!options.ends_with_model()) return kDone;
  std::fprintf(stderr, "abbe-watch: no model that may be applied: %s\n", watch.why_not(answered_for).c_str());
  return kNoAnswer;
}

int run(const Options& options) {
  std::optional<daemon::KnownErrorsFile> known;
  if (!options.known_errors.empty()) {
    auto read = daemon::read_known_errors_csv(options.known_errors);
    if (!read) return exit_code_of(read.error());
    known = std::move(*read);
  }
  auto participant = dds::Participant::create(options.participant);
  if (!participant) return exit_code_of(participant.error());
  // The state first, so that nothing is judged by an older one.
  constexpr std::array kTopics{Topic::ModelState,      Topic::ErrorModel, Topic::ErrorGrid,
                               Topic::Snapshot,        Topic::Health,     Topic::Compensation,
                               Topic::CalibrationEvent};
  auto readers = dds::Readers::create(*participant, kTopics);
  if (!readers) return exit_code_of(readers.error());
  struct sigaction action {};
  action.sa_handler = [](int) { stop_requested = 1; };
  for (const int signal : {SIGTERM, SIGINT}) ::sigaction(signal, &action, nullptr);
  return watch(options, *readers, known);
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"Shows what abbe publishes over DDS, and applies the rule of abbe_v1.idl: apply or not."};
  app.footer(kExitCodes);
  Options options;
  app.add_option("--domain", options.participant.domain, "DDS domain, 0 to 232")->capture_default_str();
  app.add_option("--profile", options.participant.profiles,
                 "XML file with a participant profile \"abbe\" (default: built in, UDP on every interface)");
  app.add_option("--machine", options.machine, "only this machine (default: all)");
  app.add_flag("--json", options.json, "one JSON object a line for every sample");
  app.add_flag("--until-model", options.until_model,
               "end with 0 as soon as a model arrived that may be applied");
  app.add_option("--timeout", options.timeout_s,
                 "end after this many seconds, with 1 if a model was waited for");
  app.add_option("--grid-csv", options.grid_csv,
                 "wait for such a model and write its grid: x_mm,...,ex_um,...,ux_um,...");
  app.add_option(
      "--compare", options.known_errors,
      "wait for such a model and compare its grid with a CSV x_mm,y_mm,z_mm,ex_um,ey_um,ez_um of known V");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? kDone : kUsage;
  }
  try {
    return run(options);
  } catch (const std::exception& e) {
    std::fprintf(stderr, "abbe-watch: %s\n", e.what());
    return kInternal;
  }
}
