// abbe-notify: sends webhooks and mails when the state of abbed changes. It requests the status of
// abbed over the control socket. It is a separate process without privileges, so that no receiver
// can stop abbed.
#include <poll.h>
#include <signal.h>

#include <fmt/format.h>
#include <CLI/CLI.hpp>
#include <chrono>
#include <exception>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "abbe/base/daemon_poll.hpp"
#include "abbe/base/exit_codes.hpp"
#include "abbe/base/exit_deadline.hpp"
#include "abbe/base/limited_log.hpp"
#include "abbe/base/message.hpp"
#include "abbe/base/option_values.hpp"
#include "abbe/base/service_manager.hpp"
#include "abbe/base/standard_error.hpp"
#include "abbe/base/wall_clock.hpp"
#include "abbe/config/notify_config.hpp"
#include "abbe/notify/delivery.hpp"
#include "abbe/notify/event_limit.hpp"
#include "abbe/notify/receiver.hpp"
#include "abbe/notify/state_changes.hpp"
#include "abbe/notify/transfer.hpp"

namespace {

using namespace std::chrono_literals;
using abbe::daemon::DaemonPoll;
using abbe::daemon::Error;
using abbe::daemon::ExitCode;
using abbe::daemon::ExitDeadline;
using abbe::daemon::NotifySettings;
using abbe::daemon::utc_now;
using abbe::notify::Delivery;
using abbe::notify::EventLimit;
using abbe::notify::Moment;
using abbe::notify::Receiver;
using abbe::notify::StateChanges;
using abbe::notify::Transfer;
using abbe::notify::TransferOutcome;

using Clock = std::chrono::steady_clock;
using Deliveries = std::vector<std::unique_ptr<Delivery>>;

constexpr int kDone = number(ExitCode::Done), kUsage = number(ExitCode::Usage),
              kIo = number(ExitCode::Io), kInternal = number(ExitCode::Internal);
// Longest time between two checks of signals, watchdog and notifications that are held back.
constexpr auto kCycle = 100ms;
// If abbed does not answer, the time-out of the request delays the end.
constexpr auto kLongestEnd = 1500ms;

volatile sig_atomic_t stop_requested = 0;

std::string footer() {
  return "Examples: abbe-notify -c /etc/abbe/abbed.toml\n"
         "          abbe-notify -c /etc/abbe/abbed.toml --test\n" +
         abbe::daemon::exit_codes_text(
             {{ExitCode::Done, "stopped by SIGTERM or SIGINT; --test: all receivers accepted"},
              {ExitCode::Usage},
              {ExitCode::BadInput, "the configuration, or a file that it names, cannot be used"},
              {ExitCode::Io, "--test: a receiver did not accept the test message"},
              {ExitCode::Internal}});
}

void log_line(std::string_view line) {
  abbe::daemon::print_message("abbe-notify", line);
}

int refuse(const Error& error) {
  abbe::daemon::print_error("abbe-notify", error);
  return exit_code(error.code);
}

void stop_on_signals() {
  struct sigaction action {};
  action.sa_handler = [](int) { stop_requested = 1; };
  for (const int signal : {SIGTERM, SIGINT}) ::sigaction(signal, &action, nullptr);
}

/// Sends one message to every configured receiver and prints the results.
int test_all(const NotifySettings& settings, const std::vector<Receiver>& receivers) {
  const auto message = abbe::notify::test_notification(settings.machine, utc_now());
  bool all_accepted = true;
  for (const Receiver& receiver : receivers) {
    const auto outcome = Transfer{}.send(receiver, message, 0);
    if (outcome.kind == TransferOutcome::Kind::Accepted) {
      fmt::print("{}: accepted ({})\n", receiver.name, outcome.text);
    } else {
      all_accepted = false;
      log_line(fmt::format("{}: not accepted: {}", receiver.name, outcome.text));
    }
  }
  return all_accepted ? kDone : kIo;
}

/// Logs when abbed begins and stops answering.
class AnswerLog {
 public:
  void see(const DaemonPoll::Answer& answer) {
    if (answers_ == answer.has_value()) return;
    answers_ = answer.has_value();
    log_line(answer ? "abbed answers" : answer.error().text);
  }

 private:
  std::optional<bool> answers_;  ///< nullopt: abbed was not asked yet
};

/// Follows the state of abbed until a signal arrives. `deadline` is then set: the end may take
/// kLongestEnd.
void follow(const NotifySettings& settings, Deliveries& deliveries,
            std::optional<ExitDeadline>& deadline) {
  StateChanges changes(settings.notify.settle);
  EventLimit limit(settings.machine, settings.notify.events, abbe::notify::random_run());
  AnswerLog answers;
  DaemonPoll daemon_poll(settings.control_socket);
  const auto period = abbe::daemon::watchdog_period();
  auto next_alive = Clock::now();
  abbe::daemon::notify_ready("following abbed");

  while (stop_requested == 0) {
    pollfd wait{daemon_poll.wake_fd(), POLLIN, 0};
    (void)::poll(&wait, 1, static_cast<int>(std::chrono::milliseconds{kCycle}.count()));
    if (const auto answer = daemon_poll.take()) {
      answers.see(*answer);
      for (const auto& event : changes.take(*answer, Moment{Clock::now(), utc_now()}))
        limit.add(event);
    }

    for (const auto& notification : limit.due(Clock::now()))
      for (const auto& delivery : deliveries) delivery->push(notification);
    if (period && Clock::now() >= next_alive) {
      abbe::daemon::notify_alive();
      next_alive = Clock::now() + *period;
    }
  }

  abbe::daemon::notify_stopping();
  deadline.emplace(kLongestEnd, kDone, "abbe-notify: ended before abbed answered\n");
}

int run(const NotifySettings& settings, const std::vector<Receiver>& receivers) {
  std::optional<ExitDeadline> deadline;
  abbe::daemon::LimitedLog log(log_line, {.lines = 20, .period = std::chrono::minutes{1}});
  Deliveries deliveries;
  for (const Receiver& receiver : receivers)
    deliveries.push_back(
        std::make_unique<Delivery>(receiver, abbe::notify::DeliveryOptions{},
                                   [&log, name = receiver.name](std::string_view line) {
                                     log.line(name, std::string(line));
                                   }));

  stop_on_signals();
  for (const Receiver& receiver : receivers) log_line(fmt::format("sends to {}", receiver.name));
  follow(settings, deliveries, deadline);
  return kDone;
}

}  // namespace

int main(int argc, char** argv) {
  abbe::daemon::unblock_stderr("abbe-notify");
  CLI::App app{
      "Sends webhooks and mails when the state of abbed changes: calibrations, devices, "
      "model."};
  app.footer(footer());
  app.set_version_flag("--version", "abbe-notify " ABBE_VERSION);
  std::string config;
  bool test = false;
  app.add_option("-c,--config", config, "abbed.toml, with [notify]")->required();
  app.add_flag("--test", test, "send one test message to every receiver, and end");

  try {
    abbe::daemon::check_option_values(app);
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? kDone : kUsage;
  }

  try {
    const auto settings = abbe::daemon::load_notify_settings(config);
    if (!settings) return refuse(settings.error());
    const auto receivers = abbe::notify::receivers_of(settings->notify);
    if (!receivers) return refuse(receivers.error());
    return test ? test_all(*settings, *receivers) : run(*settings, *receivers);
  } catch (const std::exception& e) {
    log_line(fmt::format("internal error: {}", e.what()));
    return kInternal;
  }
}
