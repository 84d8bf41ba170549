// abbed: the daemon. Runs in the foreground, logs to stderr, tells systemd when it is ready and
// that it is alive.
#include <fmt/format.h>
#include <signal.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include "abbe/base/service_manager.hpp"
#include "abbe/config/config.hpp"
#include "abbe/messages/dds_security.hpp"
#include "abbe/service/abbed.hpp"
#include "abbe/service/background_tasks.hpp"

namespace {

using namespace abbe::daemon;  // NOLINT(google-build-using-namespace): a program, not a header
using namespace std::chrono_literals;

constexpr int kDone = 0, kUsage = 2, kBadInput = 3, kIo = 4, kDefect = 70;

constexpr const char* kExitCodes =
    "Exit codes: 0 stopped by SIGTERM or SIGINT (or the configuration is good), 2 usage, 3 the "
    "configuration "
    "is bad or cannot be read,\n"
    "4 the system refused something (socket, directory, port, priority), 70 the hub hangs (also "
    "when it "
    "does not end\nwithin 5 s after a signal) or a defect ended abbed: systemd starts it anew.";

constexpr auto kCycle = 20ms;  // how often abbe-dds is looked after

int refuse(const Error& error) {
  fmt::print(stderr, "abbed: {}\n", error.text);
  for (const auto& detail : error.details) fmt::print(stderr, "  {}\n", detail);
  return error.code == ErrorCode::Io ? kIo : kBadInput;
}

std::string text_of(const std::filesystem::path& file) {
  std::ifstream in{file, std::ios::binary};
  return {std::istreambuf_iterator<char>{in}, {}};
}

/// abbe-dds stands beside abbed; else the PATH is asked.
std::string dds_program() {
  std::error_code error;
  const auto beside =
      std::filesystem::read_symlink("/proc/self/exe", error).parent_path() / "abbe-dds";
  return !error && std::filesystem::exists(beside, error) ? beside.string() : "abbe-dds";
}

Result<void> check_dds_keys(const std::filesystem::path& security) {
  if (security.empty()) return {};
  const auto identity =
      find_dds_identity(security, DdsRole::Daemon, std::chrono::system_clock::now());
  if (!identity) return tl::unexpected(identity.error());
  return {};
}

/// Blocked before any thread is started, so that only the main thread ever takes them.
sigset_t block_stop_signals() {
  sigset_t stop;
  sigemptyset(&stop);
  sigaddset(&stop, SIGTERM);
  sigaddset(&stop, SIGINT);
  pthread_sigmask(SIG_BLOCK, &stop, nullptr);
  return stop;
}

int run(Abbed& abbed, const sigset_t& stop) {
  const auto feed_period = watchdog_period();
  auto next_feed = std::chrono::steady_clock::now();
  bool hangs = false;
  const timespec turn{.tv_sec = 0, .tv_nsec = std::chrono::nanoseconds{kCycle}.count()};

  for (;;) {
    if (sigtimedwait(&stop, nullptr, &turn) > 0) return kDone;
    abbed.cycle();
    if (const bool hung = !abbed.alive(); hung != hangs) {
      hangs = hung;
      fmt::print(stderr, "abbed: {}\n",
                 hangs ? "the hub has not turned for a second" : "the hub turns again");
    }
    if (hangs) {
      if (!feed_period) continue;  // nobody to start us anew: keep what still works
      return kDefect;
    }
    if (const auto now = std::chrono::steady_clock::now(); feed_period && now >= next_feed) {
      tell_alive();
      next_feed = now + *feed_period;
    }
  }
}

int abbed_main(int argc, char** argv) {
  CLI::App app{
      "Watches a machine tool or measuring machine, identifies its geometric errors and publishes "
      "their "
      "compensation."};
  app.footer(kExitCodes);
  app.set_version_flag("--version", ABBE_VERSION);
  std::string file = "/etc/abbe/abbed.toml";
  bool check_only = false;
  app.add_option("-c,--config", file, "the configuration")->capture_default_str();
  app.add_flag("--check-config", check_only,
               "only check the configuration, say everything that is wrong with it");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? kDone : kUsage;
  }

  auto config = load_config(file);
  // Also where it cannot be read: it does not come back by itself, and systemd would start abbed
  // for ever.
  if (!config) return refuse({ErrorCode::BadInput, config.error().text, config.error().details});
  if (check_only) {
    if (auto usable = check_dds_keys(config->dds.security); !usable) return refuse(usable.error());
    fmt::print("{}: good\n", file);
    return kDone;
  }
  const sigset_t stop = block_stop_signals();
  // A file that may not grow (RLIMIT_FSIZE, LimitFSIZE=) is for the recorder to report like a full
  // disk, by the EFBIG of its write; the signal's default would end acquisition with it.
  ::signal(SIGXFSZ, SIG_IGN);
  auto abbed = Abbed::start(std::move(*config),
                            {.configuration_text = text_of(file), .dds_program = dds_program()});
  if (!abbed) return refuse(abbed.error());
  for (const auto& warning : (*abbed)->warnings())
    fmt::print(stderr, "abbed: warning: {}\n", warning);
  fmt::print(stderr, "abbed: running, configuration {}\n", file);
  tell_ready("running");
  const int code = run(**abbed, stop);
  tell_stopping();
  abbed->reset();
  fmt::print(stderr, "abbed: stopped\n");

  if (background_tasks_running()) {  // an identification between two looks at its stop
    std::fflush(nullptr);
    ::_exit(code);
  }

  return code;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return abbed_main(argc, argv);
  } catch (const std::exception& defect) {
    fmt::print(stderr, "abbed: ended by a defect: {}\n", defect.what());
    return kDefect;
  }
}
