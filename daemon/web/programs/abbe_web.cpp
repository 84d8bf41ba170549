// abbe-web: the page of abbe. A separate process without privileges, so that no browser can stop
// abbed.
#include <fmt/format.h>
#include <signal.h>
#include <sys/resource.h>
#include <termios.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <cstdio>
#include <exception>
#include <iostream>
#include <string>
#include <utility>

#include "abbe/base/exit_codes.hpp"
#include "abbe/base/exit_deadline.hpp"
#include "abbe/base/message.hpp"
#include "abbe/base/option_values.hpp"
#include "abbe/base/service_manager.hpp"
#include "abbe/base/standard_error.hpp"
#include "abbe/web/page_server.hpp"
#include "abbe/web/web_users.hpp"

namespace {

using abbe::daemon::Error;
using abbe::daemon::ErrorCode;
using abbe::daemon::ExitCode;

constexpr int kDone = number(ExitCode::Done), kUsage = number(ExitCode::Usage),
              kInternal = number(ExitCode::Internal);
constexpr std::chrono::seconds kReplayEnds{5};
constexpr int kNice = 10;  ///< below abbed, which must not wait for a page
constexpr std::chrono::hours kNoticePeriod{24};

std::string footer() {
  return "Examples: abbe-web -c /etc/abbe/abbed.toml\n"
         "          abbe-web --hash-password anna --role calibrate >>/etc/abbe/web-users\n" +
         abbe::daemon::exit_codes_text(
             {{ExitCode::Done, "stopped by SIGTERM or SIGINT"},
              {ExitCode::Usage},
              {ExitCode::BadInput,
               "the configuration or the certificate cannot be used (an expired one is named)"},
              {ExitCode::Io,
               "the address or port cannot be used, or no connection can be accepted any more"},
              {ExitCode::Internal}});
}

/// A line to stderr, which is the journal under systemd.
void log_line(const std::string& text) {
  abbe::daemon::print_message("abbe-web", text);
}

int refuse(const Error& error) {
  abbe::daemon::print_error("abbe-web", error);
  return exit_code(error.code);
}

/// Reads a line without showing it on a terminal.
std::string read_password() {
  termios shown{};
  const bool terminal = ::tcgetattr(STDIN_FILENO, &shown) == 0;
  if (terminal) {
    fmt::print(stderr, "password: ");
    termios hidden = shown;
    hidden.c_lflag &= ~static_cast<tcflag_t>(ECHO);
    ::tcsetattr(STDIN_FILENO, TCSAFLUSH, &hidden);
  }
  std::string password;
  std::getline(std::cin, password);
  if (terminal) {
    ::tcsetattr(STDIN_FILENO, TCSAFLUSH, &shown);
    fmt::print(stderr, "\n");
  }
  return password;
}

int hash_password(const std::string& user, const std::string& role_name) {
  const auto role = abbe::web::web_role_named(role_name);
  const auto line = abbe::web::web_user_line(user, *role, read_password());
  if (!line) return refuse(line.error());
  fmt::print("{}\n", *line);
  return kDone;
}

/// Tells systemd how the page is, and the log when that changes or kNoticePeriod has passed.
class Health {
 public:
  /// Empty: the page is served without a remark.
  void report(const std::string& state) {
    const auto now = std::chrono::steady_clock::now();
    // A longer duration, such as "for 21 s", is no other state.
    const bool same = without_digits(state) == without_digits(state_);
    if (same && (state.empty() || now < next_)) return;
    if (!state.empty() || !state_.empty())
      log_line(state.empty() ? "the page is served again" : state);
    abbe::daemon::notify_status(state.empty() ? "serving" : state);
    state_ = state;
    next_ = now + kNoticePeriod;
  }

 private:
  static std::string without_digits(std::string text) {
    std::erase_if(text, [](char c) { return c >= '0' && c <= '9'; });
    return text;
  }

  std::string state_;
  std::chrono::steady_clock::time_point next_;
};

/// Until SIGTERM or SIGINT, or until the page cannot serve. Feeds the watchdog of systemd as long
/// as the page is served: systemd restarts abbe-web if the page cannot be reached.
int run_until_stop(const sigset_t& stop, const abbe::web::PageServer& page) {
  const bool watched = abbe::daemon::watchdog_period().has_value();
  const timespec period{.tv_sec = 1, .tv_nsec = 0};
  Health health;
  for (;;) {
    if (sigtimedwait(&stop, nullptr, &period) > 0) return kDone;
    const std::string fault = page.fault();
    if (page.ended()) {
      log_line(fault);
      return number(ExitCode::Io);
    }
    health.report(fault.empty() ? page.notice() : fault);
    if (watched && fault.empty()) abbe::daemon::notify_alive();
  }
}

int serve(const std::string& file) {
  auto settings = abbe::daemon::load_web_settings(file);
  if (!settings)
    return refuse({ErrorCode::BadInput, settings.error().text, settings.error().details});
  const auto web = settings->web;
  if (::geteuid() == 0)
    log_line("warning: runs as root; abbe-web.service runs it as the user abbe-web");

  (void)::setpriority(PRIO_PROCESS, 0, kNice);  // of all threads: they inherit it

  // Blocked before any thread starts, so that only this thread receives them.
  sigset_t stop;
  sigemptyset(&stop);
  sigaddset(&stop, SIGTERM);
  sigaddset(&stop, SIGINT);
  pthread_sigmask(SIG_BLOCK, &stop, nullptr);
  auto page = abbe::web::PageServer::start(
      {.settings = std::move(*settings), .config_file = file, .report = log_line});
  if (!page) return refuse(page.error());

  const bool v6 = web.address.find(':') != std::string::npos;
  log_line(fmt::format("serving http{}://{}{}{}:{}/", web.tls() ? "s" : "", v6 ? "[" : "",
                       web.address, v6 ? "]" : "", (*page)->port()));
  abbe::daemon::notify_ready("serving");
  const int code = run_until_stop(stop, **page);
  abbe::daemon::notify_stopping();
  {
    // Neither a replay nor an identification writes anything: it can end anywhere.
    const abbe::daemon::ExitDeadline deadline(kReplayEnds, code,
                                              "abbe-web: stopped before the end of a replay or an "
                                              "identification");
    page->reset();
  }
  log_line("stopped");
  return code;
}

}  // namespace

int main(int argc, char** argv) {
  abbe::daemon::unblock_stderr("abbe-web");
  CLI::App app{
      "Serves the page of abbe: live axes, calibration, models, recordings. Asks abbed over its "
      "control socket. Read-only unless a user logs in."};
  app.footer(footer());
  app.set_version_flag("--version", "abbe-web " ABBE_VERSION);
  std::string file = "/etc/abbe/abbed.toml", user, role = "view";
  app.add_option("-c,--config", file, "configuration file; the table [web] is used")
      ->capture_default_str();
  auto* const hash = app.add_option("--hash-password", user,
                                    "read a password from standard input and print the line of "
                                    "this user for the file [web] users");
  app.add_option("--role", role, "of the user: view, calibrate or administer")
      ->capture_default_str()
      ->check(CLI::IsMember({"view", "calibrate", "administer"}))
      ->needs(hash);

  try {
    abbe::daemon::check_option_values(app);
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? kDone : kUsage;
  }

  try {
    return hash->count() == 0 ? serve(file) : hash_password(user, role);
  } catch (const std::exception& e) {
    log_line(fmt::format("internal error: {}", e.what()));
    return kInternal;
  }
}
