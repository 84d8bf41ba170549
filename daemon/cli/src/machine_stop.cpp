#include "machine_stop.hpp"

#include <fmt/format.h>

#include <chrono>
#include <string_view>
#include <thread>

#include "abbe/base/control_protocol.hpp"
#include "daemon_socket.hpp"

namespace abbe::daemon {
namespace {

using nlohmann::json;
using std::chrono::steady_clock;

constexpr std::chrono::milliseconds kStopPollPeriod{50};
constexpr std::string_view kWhatToDo = "check the machine, use its emergency stop";

/// abbed needs at most 3 s to connect again and at most 5 s for the answer to AbortE.
constexpr std::chrono::seconds kLongestStop{10};
/// A request reaches the machine's thread within a few ms. If the answer contains no number, or a
/// smaller number, after this time, abbed has restarted.
constexpr std::chrono::seconds kReceivedSoon{2};

bool is_received(const json& stop, std::uint64_t number) {
  return stop.is_object() && stop.value("number", std::uint64_t{0}) >= number;
}

bool is_settled(const json& stop) {
  return stop.value("outcome", "pending") != "pending";
}

tl::unexpected<Error> not_confirmed(const std::string& why) {
  return fail(ErrorCode::StopNotConfirmed,
              fmt::format("the stop of the machine is not confirmed: {}; {}", why, kWhatToDo));
}

}  // namespace

Result<std::string> stop_outcome(const json& stop) {
  const auto outcome = stop.at("outcome").get<std::string>();
  const auto text = stop.at("text").get<std::string>();
  if (outcome == "stopped") return fmt::format("stopped: {}", text);
  return fail(outcome == "not sent" ? ErrorCode::StopNotSent : ErrorCode::StopNotConfirmed,
              fmt::format("the stop of the machine is {}: {}; {}", outcome, text, kWhatToDo));
}

Result<std::string> await_stop(const std::filesystem::path& socket, std::uint64_t number) {
  const auto asked = steady_clock::now();
  for (auto answered = asked;; std::this_thread::sleep_for(kStopPollPeriod)) {
    const auto answer = ask_daemon(socket, {{"do", "machine"}});
    const auto now = steady_clock::now();
    if (!answer) {
      if (now - answered >= kDaemonTimeout) return not_confirmed(answer.error().text);
      continue;
    }

    answered = now;
    const json stop = answer->value("stop", json());
    if (!is_received(stop, number)) {
      if (now - asked >= kReceivedSoon)
        return not_confirmed("abbed does not know the request: it may have restarted");
    } else if (is_settled(stop)) {
      return stop_outcome(stop);
    }
    if (now - asked >= kLongestStop)
      return not_confirmed(fmt::format("no outcome in {} s", kLongestStop.count()));
  }
}

}  // namespace abbe::daemon
