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

bool is_settled(const json& answer, std::uint64_t number) {
  const auto stop = answer.find("stop");
  return stop != answer.end() && (*stop)["number"].get<std::uint64_t>() >= number &&
         (*stop)["outcome"] != "pending";
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
  for (auto answered = steady_clock::now();; std::this_thread::sleep_for(kStopPollPeriod)) {
    const auto answer = ask_daemon(socket, {{"do", "machine"}});
    if (answer) {
      answered = steady_clock::now();
      if (is_settled(*answer, number)) return stop_outcome((*answer)["stop"]);
    } else if (steady_clock::now() - answered >= kDaemonTimeout) {
      return fail(ErrorCode::StopNotConfirmed,
                  fmt::format("the stop of the machine is not confirmed: {}; {}",
                              answer.error().text, kWhatToDo));
    }
  }
}

}  // namespace abbe::daemon
