// abbe-mtconnect: an MTConnect adapter. It requests the status of abbed over the control socket and
// sends SHDR lines to agents (cppagent). It is a separate process without privileges, so that no
// packet from the network can stop abbed.
#include <signal.h>

#include <fmt/format.h>
#include <CLI/CLI.hpp>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <optional>
#include <string>
#include <string_view>

#include "abbe/base/daemon_poll.hpp"
#include "abbe/base/exit_codes.hpp"
#include "abbe/base/limited_log.hpp"
#include "abbe/base/message.hpp"
#include "abbe/base/option_values.hpp"
#include "abbe/base/service_manager.hpp"
#include "abbe/base/standard_error.hpp"
#include "abbe/base/wall_clock.hpp"
#include "abbe/config/mtconnect_config.hpp"
#include "abbe/mtconnect/shdr_feed.hpp"
#include "abbe/mtconnect/shdr_server.hpp"

namespace {

using namespace std::chrono_literals;
using abbe::daemon::DaemonPoll;
using abbe::daemon::Error;
using abbe::daemon::ErrorCode;
using abbe::daemon::ExitCode;
using abbe::daemon::MtconnectSettings;
using abbe::daemon::utc_now;
using abbe::mtconnect::ShdrFeed;
using abbe::mtconnect::ShdrServer;

constexpr int kDone = number(ExitCode::Done), kUsage = number(ExitCode::Usage),
              kInternal = number(ExitCode::Internal);
// Longest time between two checks of signals, watchdog and heartbeats.
constexpr auto kCycle = 100ms;

volatile sig_atomic_t stop_requested = 0;

std::string footer() {
  return "Example: abbe-mtconnect -c /etc/abbe/abbed.toml\n"
         "`abbe example mtconnect-devices.xml` prints the device for the agent.\n" +
         abbe::daemon::exit_codes_text(
             {{ExitCode::Done, "stopped by SIGTERM or SIGINT"},
              {ExitCode::Usage},
              {ExitCode::BadInput, "the configuration cannot be used"},
              {ExitCode::Io, "address and port cannot be used: another process listens there"},
              {ExitCode::Internal}});
}

void log_line(std::string_view line) {
  abbe::daemon::print_message("abbe-mtconnect", line);
}

int refuse(const Error& error) {
  abbe::daemon::print_error("abbe-mtconnect", error);
  return exit_code(error.code);
}

void stop_on_signals() {
  struct sigaction action {};
  action.sa_handler = [](int) { stop_requested = 1; };
  for (const int signal : {SIGTERM, SIGINT}) ::sigaction(signal, &action, nullptr);
}

/// The state of abbed, for its agents and for the log.
class Adapter {
 public:
  /// The lines that a client receives first.
  [[nodiscard]] std::string greeting() const {
    return "* adapterVersion: " ABBE_VERSION "\n" + feed_.everything(utc_now());
  }

  /// The lines with the values that changed.
  [[nodiscard]] std::string take(const DaemonPoll::Answer& answer) {
    if (!answer) return away(answer.error().text);
    try {
      auto observed = abbe::mtconnect::observations_of(*answer);
      if (answers_ != true) log_line("abbed answers");
      answers_ = true;
      return feed_.update(std::move(observed), utc_now());
    } catch (const std::exception& error) {
      return away(fmt::format("the answer of abbed is not that of this version: {}", error.what()));
    }
  }

 private:
  std::string away(const std::string& fault) {
    if (answers_ != false) log_line(fmt::format("everything is UNAVAILABLE: {}", fault));
    answers_ = false;
    return feed_.update(abbe::mtconnect::nothing_observed(), utc_now());
  }

  ShdrFeed feed_;
  std::optional<bool> answers_;  ///< nullopt: abbed was not asked yet
};

void serve(ShdrServer& server, Adapter& adapter, DaemonPoll& poll) {
  using Clock = std::chrono::steady_clock;
  const auto period = abbe::daemon::watchdog_period();
  auto next_alive = Clock::now();

  while (stop_requested == 0) {
    server.cycle(kCycle, poll.wake_fd());
    if (const auto answer = poll.take()) server.send(adapter.take(*answer));
    if (period && Clock::now() >= next_alive) {
      abbe::daemon::notify_alive();
      next_alive = Clock::now() + *period;
    }
  }

  abbe::daemon::notify_stopping();
}

int run(const MtconnectSettings& settings) {
  Adapter adapter;
  abbe::daemon::LimitedLog clients(log_line, {.lines = 20, .period = std::chrono::minutes{1}});
  const auto& wanted = settings.mtconnect;
  auto server = ShdrServer::listen(
      {.address = wanted.address,
       .port = wanted.port,
       .heartbeat = std::chrono::duration_cast<std::chrono::milliseconds>(wanted.heartbeat)},
      [&adapter] { return adapter.greeting(); },
      [&clients](std::string_view line) { clients.line("clients", std::string(line)); });
  if (!server) return refuse(server.error());
  stop_on_signals();

  log_line(fmt::format("listening at {}, port {}", wanted.address, server->port()));
  if (!wanted.address.starts_with("127.") && wanted.address != "::1")
    log_line("every computer that reaches this address can read the state of the machine");
  DaemonPoll poll(settings.control_socket);
  abbe::daemon::notify_ready("serving SHDR");
  serve(*server, adapter, poll);
  return kDone;
}

struct Options {
  MtconnectSettings settings;
  std::string config;
};

void add_options(CLI::App& app, Options& out) {
  auto* const socket =
      app.add_option("--socket", out.settings.control_socket, "control socket of abbed")
          ->capture_default_str();
  auto* const address =
      app.add_option("--address", out.settings.mtconnect.address,
                     "numeric address to listen on; 0.0.0.0: every network, without a password")
          ->capture_default_str();
  auto* const port = app.add_option("--port", out.settings.mtconnect.port, "0: any free port")
                         ->capture_default_str();
  app.add_option("-c,--config", out.config,
                 "take socket, address, port and heartbeat from this abbed.toml")
      ->excludes(socket)
      ->excludes(address)
      ->excludes(port);
}

}  // namespace

int main(int argc, char** argv) {
  abbe::daemon::unblock_stderr("abbe-mtconnect");
  CLI::App app{
      "MTConnect adapter: sends calibration, uncertainty and health of the machine as SHDR to "
      "agents."};
  app.footer(footer());
  app.set_version_flag("--version", "abbe-mtconnect " ABBE_VERSION);
  Options options;
  add_options(app, options);

  try {
    abbe::daemon::check_option_values(app);
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? kDone : kUsage;
  }

  try {
    if (options.config.empty()) return run(options.settings);
    const auto settings = abbe::daemon::load_mtconnect_settings(options.config);
    return settings ? run(*settings) : refuse(settings.error());
  } catch (const std::exception& e) {
    log_line(fmt::format("internal error: {}", e.what()));
    return kInternal;
  }
}
