// abbe-watch: a subscriber. Shows the data that abbe publishes about a machine, and compares a
// received model with known errors.
#include <fmt/format.h>
#include <signal.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <array>
#include <chrono>
#include <cstdio>
#include <exception>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <utility>

#include "abbe/base/exit_codes.hpp"
#include "abbe/base/known_errors.hpp"
#include "abbe/config/config.hpp"
#include "abbe/dds/grid_nodes.hpp"
#include "abbe/dds/json_lines.hpp"
#include "abbe/dds/participant.hpp"
#include "abbe/dds/participant_addresses.hpp"
#include "abbe/dds/publisher_pin.hpp"
#include "abbe/dds/readers.hpp"
#include "abbe/dds/received_model.hpp"
#include "abbe/messages/cdr.hpp"

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
         "  abbe watch --domain 7 --machine mill --grid-csv grid.csv --timeout 60\n" +
         daemon::exit_codes_text(
             {{ExitCode::Done},
              {ExitCode::DataInsufficient,
               "no model that may be applied arrived in time (stderr has the reason)"},
              {ExitCode::Usage},
              {ExitCode::BadInput, "a file or profile cannot be used"},
              {ExitCode::Io, "no participant or output file can be created"},
              {ExitCode::Internal}});
}

/// In the order in which they are read. ModelState first: Readers::take() goes topic by topic, so
/// every other sample is judged by the latest state.
constexpr std::array kTopics{Topic::ModelState,      Topic::ErrorModel, Topic::ErrorGrid,
                             Topic::Snapshot,        Topic::Health,     Topic::Compensation,
                             Topic::CalibrationEvent};

/// Without any sample for so long, the user learns what is waited for. ModelState is repeated every
/// second.
constexpr std::chrono::seconds kReportedSilence{5};

/// A publisher is not alive if its last ModelState is older. ModelState is repeated every second,
/// even if nothing changes.
constexpr std::chrono::milliseconds kLongestSilence{1500};

volatile sig_atomic_t stop_requested = 0;

struct Options {
  std::string config;  ///< empty: the options below apply
  dds::ParticipantOptions participant;
  std::string machine;  ///< empty: all machines
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
  for (const auto& detail : error.details) std::fprintf(stderr, "  %s\n", detail.c_str());
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

/// A missing axis is shown as "-": its last position is out of date.
std::string millimetres(const std::vector<double>& position_m, unsigned missing_mask) {
  std::string text;
  for (std::size_t axis = 0; axis < position_m.size(); ++axis) {
    const bool missing = (missing_mask >> axis & 1u) != 0;
    text += missing ? fmt::format("{:>10}", '-') : fmt::format("{:10.4f}", position_m[axis] * 1e3);
  }
  return text + " mm";
}

/// Keeps the received data of every machine, and prints what has changed.
class Watch {
 public:
  Watch(const Options& options, const dds::Readers& readers,
        const dds::ParticipantAddresses& addresses)
      : options_(options), readers_(readers), addresses_(addresses) {}

  /// True once a sample of a machine that is watched has arrived.
  [[nodiscard]] bool received() const { return received_; }

  void take(const dds::Arrival& arrival) {
    using Verdict = dds::PublisherPin::Verdict;
    const auto key = daemon::payload_key(arrival.topic, arrival.payload);

    if (!key || (!options_.machine.empty() && key->machine != options_.machine)) return;
    received_ = true;
    const std::string name(key->machine);
    auto& machine = machines_[name];
    const auto from = dds::participant_of(arrival.writer);
    const auto former = machine.pin.pinned();
    const auto verdict = machine.pin.heard(from, WallClock::now());
    auto& publisher = machine.publisher(from);
    keep(arrival, publisher);
    if (verdict == Verdict::Waiting) return;
    if (verdict == Verdict::Foreign) return report_foreign_publisher(name, machine, from);
    if (former && former != from) show_successor(name, from, *former);
    show(arrival, name, machine, publisher);
  }

  /// Discards the ModelState of publishers that are not alive, and shows the change. If such a
  /// publisher becomes alive again, it repeats its state within a second.
  void notice_losses() {
    for (auto& [name, machine] : machines_) {
      for (auto& [id, publisher] : machine.publishers)
        if (!alive(publisher)) publisher.state_from.reset();
      show_liveness(name, machine);
    }
  }

  /// The first model that may be applied and is complete; nullptr if there is none.
  [[nodiscard]] const dds::ReceivedModel* applicable() const {
    for (const auto& [name, machine] : machines_) {
      const Publisher& publisher = machine.pinned();
      const auto& model = publisher.model;
      if (!model.model() || !model.decide(alive(publisher)).apply) continue;
      if (model.model()->model_id() == model.state()->model_id()) return &model;
    }
    return nullptr;
  }

  [[nodiscard]] std::string why_not() const {
    std::string text;
    for (const auto& [name, machine] : machines_) {
      const auto decision = machine.pinned().model.decide(alive(machine.pinned()));
      text += name + ": " +
              (decision.apply ? std::string("no ErrorModel received") : decision.reason) + "; ";
    }
    return text.empty() ? "nothing received" : text;
  }

 private:
  /// The data that one participant published about one machine.
  struct Publisher {
    dds::ReceivedModel model;
    std::optional<dds::WriterId> state_from;  ///< writer of the last valid ModelState
    WallClock::time_point state_at{};         ///< when that ModelState arrived
    std::string position;
    dds::Delay delay;
    std::optional<std::chrono::nanoseconds> last_delay;  ///< of the last vector
  };

  /// Several participants of a domain may publish data of the same machine. Only the data of the
  /// pinned publisher is shown and used.
  struct Machine {
    dds::PublisherPin pin;
    std::map<dds::ParticipantId, Publisher> publishers;
    bool shown_alive = false;
    std::string shown_state, shown_model;
    WallClock::time_point last_live{};
    std::optional<WallClock::time_point> foreign_reported;

    /// Valid once a sample of the machine was received.
    [[nodiscard]] const Publisher& pinned() const { return publishers.at(*pin.pinned()); }

    Publisher& publisher(const dds::ParticipantId& id) {
      const auto [found, is_new] = publishers.try_emplace(id);
      if (is_new && pin.pinned() != id) found->second.delay = pinned().delay.for_next_publisher();
      if (is_new) std::erase_if(publishers, [&](const auto& p) { return !pin.remembers(p.first); });
      return found->second;
    }
  };

  [[nodiscard]] bool alive(const Publisher& publisher) const {
    return publisher.state_from && WallClock::now() - publisher.state_at < kLongestSilence &&
           readers_.is_alive(*publisher.state_from);
  }

  template <class T, class F>
  void with(std::span<const std::byte> payload, F&& use) {
    if (auto value = daemon::decode<T>(payload)) {
      use(*value);
    } else {
      std::fprintf(stderr, "abbe-watch: %s\n", value.error().text.c_str());
    }
  }

  /// Called also for publishers that are not pinned, because one of them may be pinned next.
  void keep(const dds::Arrival& arrival, Publisher& publisher) {
    switch (arrival.topic) {
      case Topic::ModelState:
        return with<v1::ModelState>(arrival.payload, [&](auto& m) {
          publisher.state_from = arrival.writer;
          publisher.state_at = WallClock::now();
          publisher.model.state(m);
        });
      case Topic::ErrorModel:
        return with<v1::ErrorModel>(arrival.payload, [&](auto& m) { publisher.model.model(m); });
      case Topic::ErrorGrid:
        return with<v1::ErrorGrid>(arrival.payload, [&](auto& m) { publisher.model.slice(m); });
      case Topic::Snapshot:
        return with<v1::Snapshot>(arrival.payload, [&](auto& m) {
          publisher.position = millimetres(m.position(), m.missing_mask());
        });
      case Topic::Compensation:
        return with<v1::Compensation>(arrival.payload, [&](auto& m) {
          publisher.last_delay = publisher.delay.of(m, WallClock::now());
        });
      case Topic::Health:
      case Topic::CalibrationEvent:
        return;  // shown when it arrives, not kept
    }
  }

  /// Shows a sample of the pinned publisher, after keep().
  void show(const dds::Arrival& arrival, const std::string& name, Machine& machine,
            const Publisher& publisher) {
    const auto& payload = arrival.payload;
    if (options_.json) print_json(arrival.topic, payload);
    show_liveness(name, machine);
    show_state(name, machine, publisher);
    if (arrival.topic == Topic::ErrorModel) show_model(machine, publisher);
    if (arrival.topic == Topic::Health) with<v1::Health>(payload, [&](auto& m) { show_health(m); });
    if (arrival.topic == Topic::CalibrationEvent)
      with<v1::CalibrationEvent>(payload, [&](auto& m) { show_event(m); });
    if (arrival.topic == Topic::Compensation)
      with<v1::Compensation>(payload, [&](auto& m) { show_vector(machine, publisher, m); });
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

  void show_liveness(const std::string& name, Machine& machine) {
    const bool now = alive(machine.pinned());
    if (std::exchange(machine.shown_alive, now) == now) return;
    if (options_.json) {
      fmt::print("{{\"machine\":\"{}\",\"publisher_alive\":{}}}\n", name, now);
      std::fflush(stdout);
    }
    print(fmt::format("{}  {}", name,
                      now ? "publisher is alive" : "publisher is not alive: do not apply"));
  }

  /// Participant id and announced addresses; the addresses are not verified.
  [[nodiscard]] std::string described(const dds::ParticipantId& id) const {
    const auto address = addresses_.of(id);
    return dds::text_of(id) + (address.empty() ? "" : ", announced at " + address);
  }

  void show_successor(const std::string& name, const dds::ParticipantId& id,
                      const dds::ParticipantId& former) {
    if (options_.json) {
      fmt::print("{{\"machine\":\"{}\",\"publisher\":\"{}\",\"former\":\"{}\"}}\n", name,
                 dds::text_of(id), dds::text_of(former));
      std::fflush(stdout);
    }
    print(fmt::format("{}  publisher is now {}: {} sends no more", name, described(id),
                      dds::text_of(former)));
  }

  void report_foreign_publisher(const std::string& name, Machine& machine,
                                const dds::ParticipantId& id) {
    constexpr std::chrono::seconds kReportPeriod{10};
    const auto now = WallClock::now();
    if (machine.foreign_reported && now - *machine.foreign_reported < kReportPeriod) return;
    machine.foreign_reported = now;
    if (options_.json) {
      fmt::print("{{\"machine\":\"{}\",\"rival\":\"{}\",\"address\":\"{}\"}}\n", name,
                 dds::text_of(id), addresses_.of(id));
      std::fflush(stdout);
    }
    print(fmt::format(
        "{}  another publisher {}: ignored; stop it, or use DDS Security (abbe dds keys)", name,
        described(id)));
  }

  void show_state(const std::string& name, Machine& machine, const Publisher& publisher) {
    const auto& s = publisher.model.state();
    if (!s) return;
    const std::string line =
        fmt::format("{}  model {} is {}{}{}", name, s->model_id().empty() ? "-" : s->model_id(),
                    dds::name_of(s->state()), s->reason().empty() ? "" : ": ", s->reason());
    if (std::exchange(machine.shown_state, line) != line) print(line);
  }

  void show_model(Machine& machine, const Publisher& publisher) {
    const auto& m = publisher.model.model();
    if (!m || std::exchange(machine.shown_model, m->model_id()) == m->model_id()) return;
    print(fmt::format("{}  received model {}: {} {}, gauge {}, {} parameters, chain {}",
                      m->machine(), m->model_id(), m->method(), m->estimator(), m->gauge(),
                      m->parameters().size(), m->chain()));
  }

  void show_health(const v1::Health& h) {
    const std::string line = fmt::format("{}  {} {}{}{}", h.machine(), h.stream(), h.state(),
                                         h.fault().empty() ? "" : ": ", h.fault());
    if (std::exchange(health_[{h.machine(), h.stream()}], line) != line) print(line);
  }

  void show_event(const v1::CalibrationEvent& e) {
    const std::string line = fmt::format("{}  calibration {} {}{}{}", e.machine(), e.method(),
                                         e.state(), e.reason().empty() ? "" : ": ", e.reason());
    if (std::exchange(calibration_[e.machine()], line) != line) print(line);
  }

  /// The line with position, vector and decision. On a terminal it is updated in place, otherwise a
  /// new line is printed once a second.
  void show_vector(Machine& machine, const Publisher& publisher, const v1::Compensation& c) {
    const auto now = WallClock::now();
    if (options_.json || now - machine.last_live < (on_terminal_ ? std::chrono::milliseconds{100}
                                                                 : std::chrono::seconds{1}))
      return;
    machine.last_live = now;
    const auto decision =
        dds::decide(c, publisher.last_delay, publisher.model.state(), alive(publisher));
    const std::string line =
        fmt::format("{}  {}  V {}  {}", c.machine(), publisher.position, micrometres(c.vector_m()),
                    decision.apply ? "apply" : "do not apply: " + decision.reason);
    std::printf(on_terminal_ ? "\r\033[K%s" : "%s\n", line.c_str());
    std::fflush(stdout);
  }

  const Options& options_;
  const dds::Readers& readers_;
  const dds::ParticipantAddresses& addresses_;
  bool received_ = false;
  const bool on_terminal_ = ::isatty(STDOUT_FILENO) != 0;
  std::map<std::string, Machine> machines_;
  std::map<std::pair<std::string, std::string>, std::string> health_;  // by machine and stream
  std::map<std::string, std::string> calibration_;                     // by machine
};

void print_comparison(const Options& options, const calib::FieldComparison& c,
                      const std::string& model_id) {
  if (options.json) {
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

  const auto row = [](const char* what, const calib::VectorStatistics& s) {
    fmt::print("  {:<42} mean {:9.3f} um   max {:9.3f} um\n", what, s.mean_m * 1e6, s.max_m * 1e6);
  };

  fmt::print("model {} against known errors at {} points ({} outside the grid)\n", model_id,
             c.points, c.outside);
  row("before: |V_true|", c.before);
  row("after:  |V_true - V_received|, as received", c.after);
  row("after:  best-fit rigid motion removed", c.after_rigid_free);
}

std::vector<calib::Vector3> vectors(const std::vector<std::array<double, 3>>& rows) {
  std::vector<calib::Vector3> out;
  for (const auto& row : rows) out.emplace_back(row[0], row[1], row[2]);
  return out;
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
  const auto comparison =
      calib::compare(vectors(known->points_m), vectors(known->errors_m), *lattice);
  if (!comparison) return daemon::fail(ErrorCode::DataInsufficient, comparison.error().text);
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

/// The keys of the daemon allow publishing, and only abbed may read them: those of subscriber-1 in
/// the folder above are used. `abbe dds keys` makes both.
std::filesystem::path subscriber_keys(const std::filesystem::path& daemon_keys) {
  if (daemon_keys.empty()) return {};
  const auto folder = daemon_keys.lexically_normal();
  return folder.has_filename() ? folder.parent_path() : folder.parent_path().parent_path();
}

/// --security on the command line takes precedence.
Result<void> take_from_config(Options& options) {
  auto config = daemon::load_config(options.config);
  if (!config) return tl::make_unexpected(config.error());

  options.participant.domain = config->dds.domain;
  options.participant.profiles = config->dds.profile;
  if (options.participant.security.empty())
    options.participant.security = subscriber_keys(config->dds.security);
  return {};
}

int watch(const Options& options, dds::Readers& readers, const dds::ParticipantAddresses& addresses,
          const std::optional<daemon::KnownErrorsFile>& known) {
  Watch watch(options, readers, addresses);
  const auto start = WallClock::now();
  bool silence_reported = false;
  while (stop_requested == 0 &&
         std::chrono::duration<double>(WallClock::now() - start).count() < options.timeout_s) {
    readers.wait(std::chrono::milliseconds{100});
    readers.take([&](const dds::Arrival& arrival) { watch.take(arrival); });
    watch.notice_losses();

    if (!watch.received() && !silence_reported && WallClock::now() - start >= kReportedSilence) {
      silence_reported = true;
      report_silence(options);
    }

    if (!options.ends_with_model()) continue;
    if (const auto* model = watch.applicable()) {
      const auto used = use_model(options, *model, known);
      return used ? kDone : exit_code_of(used.error());
    }
  }

  if (!options.ends_with_model()) return kDone;
  std::fprintf(stderr, "abbe-watch: no model that may be applied: %s\n", watch.why_not().c_str());
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
  app.add_option("--machine", options.machine, "only this machine (default: all)");
  app.add_flag("--json", options.json, "print one line with a JSON object per sample");
  app.add_flag("--until-model", options.until_model,
               "exit with code 0 as soon as a model that may be applied has arrived");
  app.add_option("--timeout", options.timeout_s,
                 "exit after this many seconds; exit code 1 if a model was awaited");
  app.add_option("--grid-csv", options.grid_csv,
                 "wait for a model that may be applied and write its grid to this file: "
                 "x_mm,...,ex_um,...,ux_um,...");
  app.add_option("--compare", options.known_errors,
                 "wait for a model that may be applied and compare its grid with the known "
                 "errors V in this CSV file: x_mm,y_mm,z_mm,ex_um,ey_um,ez_um");

  try {
    app.parse(argc, argv);
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
