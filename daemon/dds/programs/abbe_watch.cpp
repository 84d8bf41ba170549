// abbe-watch: a subscriber. Shows the data that abbe publishes about a machine, and compares a
// received model with known errors of the machine, such as those of abbe-sim.
#include <fmt/format.h>
#include <signal.h>

#include <CLI/CLI.hpp>
#include <array>
#include <chrono>
#include <cstdio>
#include <exception>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "abbe/base/exit_codes.hpp"
#include "abbe/base/known_errors.hpp"
#include "abbe/base/message.hpp"
#include "abbe/base/option_values.hpp"
#include "abbe/dds/field_comparison.hpp"
#include "abbe/dds/grid_nodes.hpp"
#include "abbe/dds/participant.hpp"
#include "abbe/dds/participant_addresses.hpp"
#include "abbe/dds/readers.hpp"
#include "abbe/dds/received_model.hpp"
#include "abbe/result/try.hpp"
#include "abbe/settings/dds_config.hpp"
#include "watched_machines.hpp"

namespace {

using namespace abbe;
using daemon::Error;
using daemon::ErrorCode;
using daemon::Result;
using daemon::Topic;
using WallClock = std::chrono::steady_clock;

using daemon::ExitCode;

constexpr int kDone = number(ExitCode::Done), kNoAnswer = number(ExitCode::DataInsufficient),
              kUsage = number(ExitCode::Usage), kBadInput = number(ExitCode::BadInput),
              kIo = number(ExitCode::Io), kInternal = number(ExitCode::Internal);

std::string footer() {
  return "Examples:\n"
         "  abbe watch -c /etc/abbe/abbed.toml\n"
         "  abbe watch --domain 7 --machine mill --grid-csv grid.csv --timeout-s 60\n" +
         daemon::exit_codes_text(
             {{ExitCode::Done},
              {ExitCode::DataInsufficient,
               "no model that may be applied arrived in time (stderr has the reason)"},
              {ExitCode::Usage},
              {ExitCode::BadInput, "a file or profile cannot be used"},
              {ExitCode::Io, "no participant or output file can be created"},
              {ExitCode::Internal}});
}

/// The topics, in the order in which their readers are read. Identity and ModelState are first:
/// Readers::take() reads topic by topic, so every other sample is judged by the latest of these
/// two.
constexpr std::array kTopics{Topic::Identity,     Topic::ModelState,      Topic::ErrorModel,
                             Topic::ErrorGrid,    Topic::Snapshot,        Topic::Health,
                             Topic::Compensation, Topic::CalibrationEvent};

/// If no sample has arrived for this time, a message tells the user what may be wrong. The time
/// exceeds the second after which ModelState is repeated.
constexpr std::chrono::seconds kReportedSilence{5};

volatile sig_atomic_t stop_requested = 0;

struct Options {
  std::string config;  ///< empty: the options below apply
  dds::ParticipantOptions participant;
  dds::WatchOptions show;
  bool until_model = false;
  double timeout_s = std::numeric_limits<double>::infinity();
  std::string grid_csv;
  std::string known_errors;

  [[nodiscard]] bool needs_grid() const { return !grid_csv.empty() || !known_errors.empty(); }
  [[nodiscard]] bool ends_with_model() const { return until_model || needs_grid(); }
};

int exit_code_of(const Error& error) {
  daemon::print_error("abbe-watch", error);
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

void print_comparison(const Options& options, const dds::FieldComparison& c,
                      const std::string& model_id) {
  if (options.show.json) {
    fmt::print(
        "{{\"comparison\":{{\"model_id\":\"{}\",\"points\":{},\"outside\":{},\"before_mean_um\":{:."
        "6g},"
        "\"before_max_um\":{:.6g},\"after_mean_um\":{:.6g},\"after_max_um\":{:.6g},"
        "\"after_rigid_free_mean_um\":{:.6g},\"after_rigid_free_max_um\":{:.6g}}}}}\n",
        model_id, c.points, c.outside, c.before.mean_m * 1e6, c.before.max_m * 1e6,
        c.after.mean_m * 1e6, c.after.max_m * 1e6, c.after_rigid_free.mean_m * 1e6,
        c.after_rigid_free.max_m * 1e6);
    return;
  }

  const auto row = [](const char* what, const dds::FieldComparison::Lengths& s) {
    fmt::print("  {:<42} mean {:9.3f} um   max {:9.3f} um\n", what, s.mean_m * 1e6, s.max_m * 1e6);
  };

  fmt::print("model {} against known errors at {} points ({} outside the grid)\n", model_id,
             c.points, c.outside);
  row("before: |V_true|", c.before);
  row("after:  |V_true - V_received|, as received", c.after);
  row("after:  best-fit rigid motion removed", c.after_rigid_free);
}

std::vector<Eigen::Vector3d> vectors(const std::vector<std::array<double, 3>>& rows) {
  std::vector<Eigen::Vector3d> out;
  for (const auto& row : rows) out.emplace_back(row[0], row[1], row[2]);
  return out;
}

Result<void> use_model(const Options& options, const dds::ReceivedModel& model,
                       const std::optional<daemon::KnownErrorsFile>& known) {
  const auto nodes = model.grid();
  if (!options.grid_csv.empty()) {
    ABBE_TRY(dds::write_grid_csv(options.grid_csv, *nodes));
  }
  if (!known) return {};
  const auto lattice = dds::lattice_of(*nodes);
  ABBE_TRY(lattice);
  const auto comparison =
      dds::compare(vectors(known->points_m), vectors(known->errors_m), *lattice);
  ABBE_TRY(comparison);
  print_comparison(options, *comparison, model.state()->model_id());
  return {};
}

/// Reports once, on stderr, that nothing arrives, with the possible causes.
void report_silence(const Options& options) {
  std::string topics;
  for (const auto topic : kTopics)
    topics += fmt::format("{}{}", topics.empty() ? "" : ", ", daemon::traits(topic).name);
  fmt::print(stderr,
             "abbe-watch: nothing received for {} s in DDS domain {}; waiting for the topics {}\n"
             "  check that abbed and abbe-dds run (abbe status), and that domain, profile and "
             "security are those of [dds] in abbed.toml (-c FILE takes them from it)\n",
             kReportedSilence.count(), options.participant.domain, topics);
}

/// The folder that contains the folder `daemon_keys`. A subscriber uses the keys in its subfolder
/// subscriber-1: the keys in `daemon_keys` allow publishing, and only abbed may read them. `abbe
/// dds keys` makes both subfolders.
std::filesystem::path subscriber_keys(const std::filesystem::path& daemon_keys) {
  if (daemon_keys.empty()) return {};
  const auto folder = daemon_keys.lexically_normal();
  return folder.has_filename() ? folder.parent_path() : folder.parent_path().parent_path();
}

/// Takes the options that the configuration file defines. --security on the command line takes
/// precedence over the file.
Result<void> take_from_config(Options& options) {
  auto config = daemon::load_participant_config(options.config);
  ABBE_TRY(config);

  options.participant.domain = config->dds.domain;
  options.participant.profiles = config->dds.profile;
  if (options.participant.security.empty())
    options.participant.security = subscriber_keys(config->dds.security);
  return {};
}

int watch(const Options& options, dds::Readers& readers, const dds::ParticipantAddresses& addresses,
          const std::optional<daemon::KnownErrorsFile>& known) {
  auto show = options.show;
  show.keep_grids = options.ends_with_model();
  dds::WatchedMachines machines(show, readers, addresses);
  const auto start = WallClock::now();
  bool silence_reported = false;
  while (stop_requested == 0 &&
         std::chrono::duration<double>(WallClock::now() - start).count() < options.timeout_s) {
    readers.wait(machines.until_next_loss(std::chrono::milliseconds{100}));
    readers.take([&](const dds::Arrival& arrival) { machines.take(arrival); });
    machines.notice_losses();

    if (!machines.received() && !silence_reported && WallClock::now() - start >= kReportedSilence) {
      silence_reported = true;
      report_silence(options);
    }

    if (!options.ends_with_model()) continue;
    if (const auto* model = machines.applicable()) {
      const auto used = use_model(options, *model, known);
      return used ? kDone : exit_code_of(used.error());
    }
  }

  if (!options.ends_with_model()) return kDone;
  daemon::print_message("abbe-watch", "no model that may be applied: " + machines.why_not());
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

  if (!participant->is_secure())
    std::fprintf(stderr, "abbe-watch: %s\n",
                 daemon::dds_security_is_off(options.participant.domain).c_str());
  const dds::ParticipantAddresses addresses(*participant);
  auto readers = dds::Readers::create(*participant, kTopics);
  if (!readers) return exit_code_of(readers.error());
  struct sigaction action {};
  action.sa_handler = [](int) { stop_requested = 1; };
  for (const int signal : {SIGTERM, SIGINT}) ::sigaction(signal, &action, nullptr);

  return watch(options, *readers, addresses, known);
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{
      "Shows the data that abbe publishes over DDS, and whether the correction may be applied by "
      "the rule of abbe_v1.idl: apply or not."};
  app.name(argv[0]);
  app.footer(footer());
  app.set_version_flag("--version", "abbe-watch " ABBE_VERSION);
  Options options;
  auto* const domain =
      app.add_option("--domain", options.participant.domain, "DDS domain, 0 to 232")
          ->capture_default_str();
  auto* const profile = app.add_option(
      "--profile", options.participant.profiles,
      "XML file with a participant profile \"abbe\" (default: built in, UDP on every interface)");
  app.add_option("--security", options.participant.security,
                 "folder of keys from the same `abbe dds keys` as the publisher's (default: DDS "
                 "Security is off)");
  app.add_option("-c,--config", options.config,
                 "take domain, profile and security from [dds] of this abbed.toml; instead of keys "
                 "in daemon/ those in subscriber-1/ beside it are used")
      ->excludes(domain)
      ->excludes(profile);
  auto* const machine =
      app.add_option("--machine", options.show.machine, "only this machine (default: all)");
  app.add_option("--machine-id", options.show.machine_id,
                 "identity of this machine, from `abbe machine identity` (default: the first one "
                 "that publishes under the name, while abbe-watch runs)")
      ->needs(machine);
  app.add_flag("--json", options.show.json, "print one line with a JSON object per sample");
  app.add_flag("--until-model", options.until_model,
               "exit with code 0 as soon as a model that may be applied has arrived");
  app.add_option("--timeout-s", options.timeout_s,
                 "exit after this many seconds; exit code 1 if a model was awaited");
  app.add_option("--grid-csv", options.grid_csv,
                 "wait for a model that may be applied and write its grid to this file: "
                 "x_mm,...,ex_um,...,ux_um,...");
  app.add_option("--compare", options.known_errors,
                 "wait for a model that may be applied and compare its grid with the known "
                 "errors V in this CSV file: x_mm,y_mm,z_mm,ex_um,ey_um,ez_um");

  try {
    daemon::check_option_values(app);
    app.parse(daemon::option_words(app, {argv + 1, argv + argc}));
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? kDone : kUsage;
  }

  try {
    if (!options.config.empty()) {
      if (const auto taken = take_from_config(options); !taken) return exit_code_of(taken.error());
    }
    return run(options);
  } catch (const std::exception& e) {
    std::fprintf(stderr, "abbe-watch: internal error: %s\n", e.what());
    return kInternal;
  }
}
