// abbe-dds: the DDS participant of abbe. It is a separate process, so that no message from the
// network can stop abbed.
#include <linux/close_range.h>
#include <signal.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <optional>
#include <string>

#include "abbe/base/exit_codes.hpp"
#include "abbe/base/message.hpp"
#include "abbe/base/option_values.hpp"
#include "abbe/base/service_manager.hpp"
#include "abbe/base/standard_error.hpp"
#include "abbe/base/text_file.hpp"
#include "abbe/dds/announcer.hpp"
#include "abbe/dds/interface_watch.hpp"
#include "abbe/dds/participant.hpp"
#include "abbe/dds/twin_watch.hpp"
#include "abbe/dds/writers.hpp"
#include "abbe/messages/dds_bridge.hpp"
#include "abbe/result/try.hpp"
#include "abbe/settings/dds_config.hpp"

namespace {

using abbe::daemon::DdsBridge;
using abbe::daemon::DdsFeed;
using abbe::daemon::Error;
using abbe::daemon::ErrorCode;

using abbe::daemon::ExitCode;

constexpr int kDone = number(ExitCode::Done), kUsage = number(ExitCode::Usage),
              kBadInput = number(ExitCode::BadInput), kIo = number(ExitCode::Io),
              kRefused = number(ExitCode::Refused), kInternal = number(ExitCode::Internal);

std::string footer() {
  return "Example: abbe-dds -c /etc/abbe/abbed.toml\n" +
         abbe::daemon::exit_codes_text(
             {{ExitCode::Done, "stopped by SIGTERM or SIGINT, or the parent process has ended"},
              {ExitCode::Usage},
              {ExitCode::BadInput, "the configuration or the profile cannot be used"},
              {ExitCode::Io, "no participant or writer can be created"},
              {ExitCode::Refused, "[dds] supervise in the configuration is \"child\" or \"off\""},
              {ExitCode::Internal}});
}

volatile sig_atomic_t stop_requested = 0;

struct Options {
  std::string config;
  std::string socket;
  abbe::dds::ParticipantOptions participant;
  pid_t parent = 0;  ///< 0: not started by abbed
};

void stop_on_signals() {
  struct sigaction action {};
  action.sa_handler = [](int) { stop_requested = 1; };
  for (const int signal : {SIGTERM, SIGINT}) ::sigaction(signal, &action, nullptr);
}

int refuse(const Error& error) {
  abbe::daemon::print_error("abbe-dds", error);
  switch (error.code) {
    case ErrorCode::Usage:
      return kUsage;
    case ErrorCode::BadInput:
      return kBadInput;
    case ErrorCode::Refused:
      return kRefused;
    default:
      return kIo;
  }
}

bool parent_is_gone(const Options& options) {
  return options.parent != 0 && ::getppid() != options.parent;
}

void log_source_change(const DdsBridge& bridge, bool& alive) {
  if (bridge.source_alive() == alive) return;
  alive = bridge.source_alive();
  std::fprintf(stderr, alive ? "abbe-dds: abbed is alive\n"
                             : "abbe-dds: no data from abbed: ModelState INVALID is published\n");
}

/// The configuration as abbe-dds.service passes it on (LoadCredential=), because the user of
/// abbe-dds may not read it; else the file itself. In both cases, paths in it are relative to the
/// folder of `file`.
abbe::daemon::Result<abbe::daemon::ParticipantConfig> configuration_of(const std::string& file) {
  const char* const credentials = std::getenv("CREDENTIALS_DIRECTORY");
  const auto passed_on =
      std::filesystem::path{credentials != nullptr ? credentials : ""} / "abbed.toml";
  std::error_code error;
  if (credentials == nullptr || (!std::filesystem::exists(passed_on, error) && !error))
    return abbe::daemon::load_participant_config(file);
  const auto text = abbe::daemon::read_regular_file(passed_on);
  ABBE_TRY(text);
  return abbe::daemon::parse_participant_config(*text, file);
}

/// Reads the options from abbed.toml when abbe-dds runs as a systemd service. Refused if [dds]
/// supervise does not name systemd: abbed then starts its own abbe-dds, or none.
abbe::daemon::Result<void> take_from_config(Options& options) {
  auto config = configuration_of(options.config);
  ABBE_TRY(config);
  abbe::daemon::use_dds_unit(config->dds, config->runtime_dir, true);
  if (config->dds.supervise != abbe::daemon::Supervise::Systemd) {
    return abbe::daemon::fail(ErrorCode::Refused,
                              options.config +
                                  ": abbe-dds.service is not used: [dds] supervise is \"child\" "
                                  "or \"off\"");
  }

  options.socket = config->dds.socket;
  options.participant.domain = config->dds.domain;
  options.participant.profiles = config->dds.profile;
  options.participant.security = config->dds.security;

  return {};
}

/// Notifies systemd that the loop is alive when abbe-dds runs as a service; systemd kills it if its
/// loop hangs. When abbe-dds is a child of abbed nothing is sent, because the notification socket
/// that the child inherits is that of abbed.
class ServiceManager {
 public:
  using Instant = std::chrono::steady_clock::time_point;

  explicit ServiceManager(const Options& options) {
    if (options.parent != 0) return;
    period_ = abbe::daemon::watchdog_period();
    abbe::daemon::notify_ready("publishing");
  }
  void cycle(Instant now) {
    if (!period_ || now < next_) return;
    abbe::daemon::notify_alive();
    next_ = now + *period_;
  }

 private:
  std::optional<std::chrono::microseconds> period_;
  Instant next_{};
};

/// Publishes until a signal or the end of abbed stops it, and returns the exit code. Returns
/// nullopt if a new network address requires that the participant is created again.
std::optional<int> publish(const Options& options) {
  using Clock = std::chrono::steady_clock;
  abbe::dds::InterfaceWatch interfaces(Clock::now());
  auto participant = abbe::dds::Participant::create(options.participant);
  if (!participant) return refuse(participant.error());
  auto writers = abbe::dds::Writers::create(*participant);
  if (!writers) return refuse(writers.error());
  stop_on_signals();

  // The service reports readiness to systemd only after participant and writers exist.
  ServiceManager manager(options);
  DdsBridge bridge(*writers);
  DdsFeed feed(options.socket, bridge);
  abbe::dds::Announcer announcer(*participant, *writers);
  abbe::dds::TwinWatch twins(*participant);
  if (!twins.looks())
    std::fputs(
        "abbe-dds: other machines of this name are not noticed: the permissions of the keys do not "
        "allow abbe-dds to read abbe/v1/Identity; `abbe dds keys` makes keys that do\n",
        stderr);
  bool alive = false;

  while (stop_requested == 0 && !parent_is_gone(options)) {
    feed.cycle();
    announcer.cycle(Clock::now());
    feed.report_twin(twins.cycle(writers->identity(), Clock::now()));
    manager.cycle(Clock::now());
    log_source_change(bridge, alive);
    if (const auto added = interfaces.cycle(participant->allowed_addresses(), Clock::now())) {
      std::fprintf(stderr,
                   "abbe-dds: address %s came up: the participant is created again to use it\n",
                   added->c_str());
      return std::nullopt;
    }
  }

  bridge.lost();
  writers->wait_for_state_acknowledged(std::chrono::seconds{1});
  return kDone;
}

/// Replaces this process by a new one with the same arguments. Returns only if that fails.
int start_again(char** argv) {
  abbe::daemon::drain_stderr();
  ::close_range(3, ~0u, CLOSE_RANGE_CLOEXEC);
  ::execv("/proc/self/exe", argv);
  std::perror("abbe-dds: /proc/self/exe");
  return kIo;
}

}  // namespace

int main(int argc, char** argv) {
  abbe::daemon::unblock_stderr("abbe-dds");
  CLI::App app{
      "Publishes over DDS the data that abbed sends over its local socket, and publishes "
      "ModelState INVALID when abbed is lost."};
  app.footer(footer());
  app.set_version_flag("--version", "abbe-dds " ABBE_VERSION);
  Options options;
  options.participant.role = abbe::daemon::DdsRole::Daemon;
  auto* const socket =
      app.add_option("--socket", options.socket, "Unix socket of abbed; waits until it exists");
  auto* const domain =
      app.add_option("--domain", options.participant.domain, "DDS domain, 0 to 232")
          ->capture_default_str();
  auto* const profile = app.add_option(
      "--profile", options.participant.profiles,
      "XML file with a participant profile \"abbe\" (default: built in, UDP on every interface)");
  auto* const security = app.add_option(
      "--security", options.participant.security,
      "folder of keys from `abbe dds keys` (default: DDS Security is off, unless the profile "
      "switches it on)");
  app.add_option("-c,--config", options.config,
                 "take socket, domain, profile and security from this abbed.toml; for "
                 "abbe-dds.service")
      ->excludes(socket)
      ->excludes(domain)
      ->excludes(profile)
      ->excludes(security);
  app.add_option("--parent", options.parent,
                 "process id; exit when it is no longer the parent process (set by abbed)");

  try {
    abbe::daemon::check_option_values(app);
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? kDone : kUsage;
  }

  if (options.config.empty() && options.socket.empty()) {
    return refuse({ErrorCode::Usage, "--socket or --config is required"});
  }

  try {
    if (!options.config.empty()) {
      if (auto taken = take_from_config(options); !taken) {
        if (taken.error().code == ErrorCode::Refused)  // no fault: the unit ends without an error
          abbe::daemon::notify_ready("not used: see [dds] supervise");
        return refuse(taken.error());
      }
    }
    if (const auto code = publish(options)) return *code;
    return start_again(argv);
  } catch (const std::exception& e) {
    abbe::daemon::print_message("abbe-dds", std::string("internal error: ") + e.what());
    return kInternal;
  }
}
