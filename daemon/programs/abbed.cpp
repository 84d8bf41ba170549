// abbed: the daemon. It runs in the foreground, logs to stderr, notifies systemd when it is ready,
// and resets the watchdog of systemd.
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <signal.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "abbe/base/end_limits.hpp"
#include "abbe/base/exit_codes.hpp"
#include "abbe/base/exit_deadline.hpp"
#include "abbe/base/message.hpp"
#include "abbe/base/option_values.hpp"
#include "abbe/base/printable.hpp"
#include "abbe/base/service_manager.hpp"
#include "abbe/base/standard_error.hpp"
#include "abbe/config/check_config.hpp"
#include "abbe/config/config.hpp"
#include "abbe/messages/dds_security.hpp"
#include "abbe/result/try.hpp"
#include "abbe/service/abbed.hpp"
#include "abbe/service/background_tasks.hpp"
#include "abbe/service/process_signals.hpp"

namespace {

using namespace abbe::daemon;  // NOLINT(google-build-using-namespace): a program, not a header
using namespace std::chrono_literals;

constexpr int kDone = number(ExitCode::Done), kUsage = number(ExitCode::Usage),
              kBadInput = number(ExitCode::BadInput), kIo = number(ExitCode::Io),
              kInternal = number(ExitCode::Internal);

std::string footer() {
  return exit_codes_text(
      {{ExitCode::Done,
        "stopped by SIGTERM, SIGINT, SIGHUP, SIGQUIT, SIGPWR or SIGXCPU (--check-config: the "
        "configuration is valid)"},
       {ExitCode::Usage},
       {ExitCode::BadInput, "the configuration is invalid or cannot be read"},
       {ExitCode::Io, "the system refused a socket, directory, port or priority"},
       {ExitCode::StopNotConfirmed,
        "abbed has ended, but the measuring machine did not confirm its stop: it may be moving"},
       {ExitCode::StopNotSent,
        "abbed has ended without a connection to the measuring machine: it may be moving"},
       {ExitCode::Internal,
        "the hub hangs, or abbed does not end within 27 s after a signal (the hub: 5 s), or an "
        "internal error: systemd restarts abbed"}});
}

constexpr auto kCycle = 20ms;  // period of the main loop, which supervises abbe-dds

int refuse(const Error& error) {
  print_error("abbed", error);
  return error.code == ErrorCode::Io ? kIo : kBadInput;
}

std::string text_of(const std::filesystem::path& file) {
  std::ifstream in{file, std::ios::binary};
  return {std::istreambuf_iterator<char>{in}, {}};
}

/// The path of abbe-dds: in the folder of abbed, or else the one in PATH.
std::string dds_program() {
  std::error_code error;
  const auto beside =
      std::filesystem::read_symlink("/proc/self/exe", error).parent_path() / "abbe-dds";
  return !error && std::filesystem::exists(beside, error) ? beside.string() : "abbe-dds";
}

/// Checks the keys. Keys that belong to the user of abbe-dds can be checked by root only; abbe-dds
/// then checks them itself.
Result<void> check_dds_keys(const DdsConfig& dds) {
  const auto& security = dds.security;
  if (security.empty()) return {};
  if (dds.supervise != Supervise::Child && ::access(security.c_str(), R_OK | X_OK) != 0 &&
      errno == EACCES)
    return {};
  const auto identity =
      find_dds_identity(security, DdsRole::Daemon, std::chrono::system_clock::now());
  ABBE_TRY(identity);
  return {};
}

/// Option --check-config: prints all faults; without a fault, prints how abbe understood the
/// configuration and which values are improbable.
int check(const std::string& file) {
  const auto checked = check_config(file, static_cast<int>(::sysconf(_SC_NPROCESSORS_CONF)));
  if (!checked) return refuse({ErrorCode::BadInput, checked.error().text, checked.error().details});
  if (auto usable = check_dds_keys(checked->config.dds); !usable) return refuse(usable.error());

  const auto& example = checked->of_the_example;
  fmt::print("{}: valid{}\n", file,
             example.empty()
                 ? ""
                 : fmt::format(", but still the example: {}; enter those of your machine",
                               fmt::join(example, ", ")));
  for (const auto& line : summary_of(checked->config)) fmt::print("  {}\n", printable(line));
  if (!checked->warnings.empty()) fmt::print("warnings:\n");
  for (const auto& warning : checked->warnings) fmt::print("  {}\n", printable(warning));
  return kDone;
}

/// Runs until a signal arrives or the hub hangs. Returns the exit code.
int run(Abbed& abbed, const sigset_t& stop) {
  const auto feed_period = watchdog_period();
  auto next_feed = std::chrono::steady_clock::now();
  bool hangs = false;
  const timespec period{.tv_sec = 0, .tv_nsec = std::chrono::nanoseconds{kCycle}.count()};

  for (;;) {
    if (const int number = sigtimedwait(&stop, nullptr, &period); number > 0) {
      print_message("abbed", fmt::format("ends in order after {}", signal_name(number)));
      return kDone;
    }
    abbed.cycle();

    if (const bool hung = !abbed.alive(); hung != hangs) {
      hangs = hung;
      print_message("abbed", hangs
                                 ? "the hub hangs: it has completed no cycle for 1 s; a measuring "
                                   "machine that moves is stopped"
                                 : "the hub runs again");
      if (hangs) abbed.stop_machine();
    }
    if (hangs) {
      // The hub hangs. Without a watchdog no program would restart abbed, so abbed continues: the
      // threads of devices and recorder may still work.
      if (!feed_period) continue;
      return kInternal;
    }

    if (const auto now = std::chrono::steady_clock::now(); feed_period && now >= next_feed) {
      notify_alive();
      next_feed = now + *feed_period;
    }
  }
}

/// True if no measuring machine may still be moving.
bool stands(const std::optional<abbe::drivers::IppStop>& machine) {
  return !machine || machine->outcome == abbe::drivers::IppStopOutcome::Stopped;
}

/// Reports a measuring machine that may still be moving, before any step that may wait for a disk.
/// Returns the exit code: `code`, or the code for such a machine.
int report_machine(const std::optional<abbe::drivers::IppStop>& machine, int code) {
  using Outcome = abbe::drivers::IppStopOutcome;
  if (stands(machine)) return code;
  print_message("abbed",
                fmt::format("ended, but the stop of the measuring machine is {}: {}; check "
                            "the machine, use its emergency stop",
                            name_of(machine->outcome), machine->text));
  if (code != kDone) return code;
  return number(machine->outcome == Outcome::NotSent ? ExitCode::StopNotSent
                                                     : ExitCode::StopNotConfirmed);
}

/// Stops all parts and reports the result; returns the exit code. Ends the process at once if this
/// takes too long.
int end_in_order(std::unique_ptr<Abbed> abbed, int code) {
  notify_stopping();
  const ExitDeadline deadline{
      kLongestEnd, kInternal,
      fmt::format(
          "abbed: does not end within {} s, for example because a disk does not answer: exit "
          "code {}\n",
          kLongestEnd.count(), kInternal),
      &stop_machines_at_once};
  const auto machine = abbed->end();
  const int reported = report_machine(machine, code);
  abbed.reset();
  if (stands(machine)) print_message("abbed", "stopped");
  return reported;
}

int abbed_main(int argc, char** argv) {
  CLI::App app{
      "Acquires data from a machine tool or measuring machine, identifies its geometric errors and "
      "publishes their compensation."};
  app.footer(footer());
  app.set_version_flag("--version", ABBE_VERSION);
  std::string file = "/etc/abbe/abbed.toml";
  bool check_only = false, dds_unit = false;
  app.add_option("-c,--config", file, "configuration file")->capture_default_str();
  app.add_flag("--check-config", check_only,
               "only check the configuration, print all of its errors, or what was understood and "
               "what is improbable, and exit");
  app.add_flag(
      "--dds-unit", dds_unit,
      "unless [dds] supervise is given: systemd runs abbe-dds, as abbe-dds.service (set by "
      "abbed.service); otherwise abbed starts it as a child");
  try {
    check_option_values(app);
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? kDone : kUsage;
  }

  if (check_only) return check(file);
  auto config = load_config(file);
  // The code is BadInput even if the file cannot be read. With the code Io systemd would restart
  // abbed again and again, although only a person can repair the file.
  if (!config) return refuse({ErrorCode::BadInput, config.error().text, config.error().details});

  const sigset_t stop = prepare_signals();
  auto abbed = Abbed::start(
      std::move(*config),
      {.configuration_text = text_of(file), .dds_program = dds_program(), .dds_unit = dds_unit});
  if (!abbed) return refuse(abbed.error());

  for (const auto& warning : (*abbed)->warnings())
    print_message("abbed", fmt::format("warning: {}", warning));
  print_message("abbed", fmt::format("running, configuration {}", file));
  notify_ready("running");

  const int ended_with = run(**abbed, stop);
  const int code = end_in_order(std::move(*abbed), ended_with);

  // A running identification checks its stop flag only from time to time, so the process ends
  // without waiting for it.
  if (background_tasks_running()) {
    std::fflush(nullptr);
    drain_stderr();
    ::_exit(code);
  }

  return code;
}

}  // namespace

int main(int argc, char** argv) {
  unblock_stderr("abbed");
  try {
    return abbed_main(argc, argv);
  } catch (const std::exception& error) {
    print_message("abbed", fmt::format("internal error: {}", error.what()));
    return kInternal;
  }
}
